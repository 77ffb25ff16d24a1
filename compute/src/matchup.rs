//! Observations against a gridded product: the cell that holds each place, the step that holds each time, and how far the
//! two differ in all.
//!
//! Values are compared in the stored unit of the product and told in the unit people read. Which observations are fit for it
//! the caller says ([`Fit`]) before it compares them. Left out on purpose: cells next to a cell without data.

mod fit;
mod pair;
mod scatter;
pub mod statistics;

use std::sync::Arc;

use contract::ContractError;
use contract::manifest::{Manifest, ManifestId};
use contract::observation::Observation;
use contract::product::ProductId;
use contract::time::TimeMs;
use cube::{CellAt, Values};
use futures::future::BoxFuture;
use serde::{Deserialize, Serialize};
use storage::Store;

use crate::ComputeError;
use crate::summed::{GO_ROUND, PARTS};
use pair::{Pair, Pairing};
use statistics::Statistics;

pub use fit::Fit;
pub use scatter::scatter_svg;

/// Which values of a product an observation's time is compared with.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum TimeMatch {
    /// The step that covers it.
    Nearest,
    /// The two steps whose middles it lies between, weighted (eq. 3 in docs/method.md).
    Linear,
}

/// One observation and the product's value where and when it was made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MatchRow {
    /// Dataset of the observation.
    pub dataset: ProductId,
    /// Its platform.
    pub platform: String,
    /// Its time.
    pub time: TimeMs,
    /// Its longitude, degrees.
    pub lon_deg: f64,
    /// Its latitude, degrees.
    pub lat_deg: f64,
    /// Its depth, m below the surface.
    pub depth_m: f64,
    /// What was observed, unit of the answer.
    pub observed: f64,
    /// What the product says, unit of the answer.
    pub gridded: f64,
    /// From the place of the observation to the centre of the cell, km.
    pub distance_km: f64,
    /// From the middle of the step that covers it to the time of the observation, hours.
    pub hours: f64,
}

/// Observations without a partner, by the first reason that applies.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct LeftOut {
    /// Their quality is worse than asked for.
    pub quality: u64,
    /// They are deeper than asked for.
    pub depth: u64,
    /// No step of the product covers their time.
    pub other_time: u64,
    /// They lie outside the grid.
    pub outside: u64,
    /// Their cell has no data.
    pub no_data: u64,
}

/// Observations against a product, with all that is needed to cite it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Matchup {
    /// Product.
    pub product: ProductId,
    /// The version that was read.
    pub manifest: ManifestId,
    /// Title of the product.
    pub title: String,
    /// Citation of the product.
    pub source: String,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// Property of the observations.
    pub property: String,
    /// Unit of all values here.
    pub unit: String,
    /// How times were matched.
    pub time_match: TimeMatch,
    /// Pairs in the order of the observations.
    pub rows: Vec<MatchRow>,
    /// How they differ; gridded minus observed.
    pub statistics: Statistics,
    /// What has no partner.
    pub left_out: LeftOut,
    /// Which observations were fit for it; none where nobody chose among them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fit: Option<Fit>,
}

/// Compares observations of one property with a version of a product. Of its values the cells that they lie in are read, with what
/// is stored round them.
///
/// # Errors
/// Observations of several properties, or in another unit than the product's; a store that does not answer.
pub fn matchup<'a>(
    store: &'a Store,
    manifest: &'a Manifest,
    observations: &'a [Observation],
    time_match: TimeMatch,
) -> BoxFuture<'a, Result<Matchup, ComputeError>> {
    Box::pin(async move {
        let property = one_property(manifest, observations)?;
        let Pairing {
            mut pairs,
            left_out: mut out,
        } = pair::all(manifest, observations, time_match);
        // What is read is read once, however many observations fall into it.
        let cells: Vec<CellAt> = pairs.iter().flat_map(Pair::cells).collect();
        let values = Values::of(store, &Arc::new(manifest.clone())).await?;
        let values = values.cells(&cells).await?;
        let mut values = &values[..];
        for pair in &mut pairs {
            let (own, rest) = values.split_at(pair.shares.len());
            pair.add(own);
            values = rest;
        }
        let display = manifest.quantity.display();
        let shown = |stored: f64| stored * display.factor + display.offset;
        let all = pairs.len();
        let with_data = pairs.into_iter().filter(|pair| !pair.gridded.is_nan());
        let row = |pair: Pair| {
            let observation = &observations[pair.observation];
            MatchRow {
                dataset: observation.dataset.clone(),
                platform: observation.platform.clone(),
                time: observation.time,
                lon_deg: observation.lon_deg,
                lat_deg: observation.lat_deg,
                depth_m: observation.depth_m,
                observed: shown(observation.value),
                gridded: shown(pair.gridded),
                distance_km: pair.distance_km,
                hours: pair.hours,
            }
        };
        let rows: Vec<MatchRow> = with_data.map(row).collect();
        out.no_data += (all - rows.len()) as u64;
        let values = rows.iter().map(|row| (row.observed, row.gridded));
        Ok(Matchup {
            product: manifest.product.clone(),
            manifest: manifest.id(),
            title: manifest.title.clone(),
            source: manifest.source.clone(),
            synthetic: manifest.synthetic,
            property,
            unit: display.unit.to_owned(),
            time_match,
            statistics: Statistics::of(&values),
            left_out: out,
            fit: None,
            rows,
        })
    })
}

/// The one property of all observations, which must be in the product's stored unit.
fn one_property(manifest: &Manifest, observations: &[Observation]) -> Result<String, ComputeError> {
    let invalid = |text: &str, reason: String| {
        ComputeError::from(ContractError::invalid(
            "observations to compare",
            text,
            reason,
        ))
    };
    let Some(first) = observations.first() else {
        return Err(ComputeError::NothingToCompare {
            product: manifest.product.clone(),
        });
    };
    if let Some(other) = observations.iter().find(|o| o.property != first.property) {
        let reason = format!(
            "they are of {} and {}; ask for one property",
            first.property, other.property
        );
        return Err(invalid("several", reason));
    }
    if manifest.quantity.is_direction() {
        let reason = format!(
            "{} holds {GO_ROUND}, so that no difference between two is one of numbers; {PARTS}",
            manifest.product
        );
        return Err(invalid(&first.property, reason));
    }
    let unit = manifest.quantity.unit();
    if let Some(other) = observations.iter().find(|o| o.unit != unit) {
        let reason = format!(
            "{} holds {} in {unit}, {} is in {}",
            manifest.product,
            manifest.quantity.title(),
            other.property,
            other.unit
        );
        return Err(invalid(&other.property, reason));
    }
    Ok(first.property.clone())
}

#[cfg(test)]
mod tests;
