//! Standard errors of the flux in every cell of a step: stated for all, or read from a product.

use std::sync::Arc;

use contract::budget::{BudgetErrors, StatedError};
use contract::chunk::Window;
use contract::manifest::Manifest;
use contract::quantity::CARBON_KG_PER_MOL;
use contract::time::Period;
use cube::Values;
use storage::Store;

use crate::ComputeError;
use crate::expression::unit::{Scaled, Unit};
use crate::region::shares::{are_same_cells, grid_text};

/// Where standard errors come from.
pub(super) enum Source<'a> {
    /// Share of the size of the flux, 1.
    Relative(f64),
    /// The same everywhere, kg m⁻² s⁻¹.
    Absolute(f64),
    Product(Stored<'a>),
}

/// Values of the chunks of a region, in its order.
type Chunks = Arc<Vec<Vec<f32>>>;

/// Errors of a product.
pub(super) struct Stored<'a> {
    manifest: &'a Manifest,
    /// Makes kg m⁻² s⁻¹ of a stored value.
    factor: f64,
    /// Opened with the first step.
    values: Option<Values>,
    /// The map that was read last: one may hold for all steps.
    last: Option<(usize, Chunks)>,
}

/// Standard errors of one step.
#[derive(Debug, Clone)]
pub(super) enum Errors {
    Relative(f64),
    Absolute(f64),
    /// `[row, col]` of each chunk of the region, and what makes kg m⁻² s⁻¹ of them.
    Cells(Chunks, f64),
}

impl Errors {
    /// The error of a cell, by the chunk of the region and its place in that, with a flux, kg m⁻² s⁻¹, NaN where nothing says it. A share of the flux has its sign: what is wrong with
    /// a factor makes sources and sinks larger together.
    pub(super) fn of(&self, (chunk, cell): (usize, usize), flux_kg_m2_s: f64) -> f64 {
        match self {
            Self::Relative(share) => share * flux_kg_m2_s,
            Self::Absolute(error) => *error,
            Self::Cells(values, factor) => factor * f64::from(values[chunk][cell]),
        }
    }
}

impl<'a> Source<'a> {
    /// That of the errors that are asked for, for a version of a flux.
    ///
    /// # Errors
    /// `Uncertainty` for a unit that is none of a flux of carbon, or another grid.
    pub(super) fn of(errors: &'a BudgetErrors, flux: &Manifest) -> Result<Self, ComputeError> {
        match (&errors.stated, &errors.of_product) {
            (StatedError::Relative { percent }, _) => Ok(Self::Relative(percent / 100.0)),
            (StatedError::Absolute { value, unit }, _) => {
                let factor = factor_of(unit).ok_or_else(|| refused(unit, NO_FLUX))?;
                Ok(Self::Absolute(value * factor))
            }
            (StatedError::Product(_), Some(manifest)) => stored(manifest, flux).map(Self::Product),
            (StatedError::Product(product), None) => Err(ComputeError::inconsistent(
                product.as_str(),
                "no version of the errors was looked up",
            )),
        }
    }

    /// The errors of a step in some chunks.
    ///
    /// # Errors
    /// `Uncertainty` where the product has no map for it, or one with values below 0 there.
    pub(super) async fn read(
        &mut self,
        store: &Store,
        chunks: &[Window],
        period: Period,
    ) -> Result<Errors, ComputeError> {
        match self {
            Self::Relative(share) => Ok(Errors::Relative(*share)),
            Self::Absolute(error) => Ok(Errors::Absolute(*error)),
            Self::Product(stored) => {
                let factor = stored.factor;
                Ok(Errors::Cells(
                    stored.read(store, chunks, period).await?,
                    factor,
                ))
            }
        }
    }
}

const NO_FLUX: &str = "it is no unit of a flux of carbon that is understood; write it such as g m-2 year-1, mol m-2 year-1, \
                       mmol m-2 d-1 or kg m-2 s-1";

fn refused(what: &str, reason: &str) -> ComputeError {
    ComputeError::Uncertainty {
        reason: format!("{what:?}: {reason}"),
    }
}

/// What makes kg m⁻² s⁻¹ of carbon of a number in a unit; a word `C` says that mass is of carbon, which it is anyway.
fn factor_of(unit: &str) -> Option<f64> {
    let words: Vec<&str> = unit
        .split_whitespace()
        .filter(|word| *word != "C")
        .collect();
    let scaled = Scaled::parse(&words.join(" ")).filter(|scaled| scaled.offset == 0.0)?;
    if Some(scaled.unit) == Unit::stored("kg m-2 s-1") {
        Some(scaled.factor)
    } else if Some(scaled.unit) == Unit::stored("mol m-2 s-1") {
        Some(scaled.factor * CARBON_KG_PER_MOL)
    } else {
        None
    }
}

fn stored<'a>(manifest: &'a Manifest, flux: &Manifest) -> Result<Stored<'a>, ComputeError> {
    let name = manifest.product.as_str();
    let unit = manifest.quantity.unit();
    let Some(factor) = factor_of(unit) else {
        let reason = format!(
            "its unit {unit:?} is none of a flux of carbon, as standard errors of one have"
        );
        return Err(refused(name, &reason));
    };
    if !are_same_cells(&manifest.grid, &flux.grid) {
        let reason = format!(
            "its grid is {}, that of {} is {}; bring it there first: fluxglobe derive regrid",
            grid_text(&manifest.grid),
            flux.product,
            grid_text(&flux.grid)
        );
        return Err(refused(name, &reason));
    }
    Ok(Stored {
        manifest,
        factor,
        values: None,
        last: None,
    })
}

impl Stored<'_> {
    /// The place of the map of exactly a period, or of the only one there is.
    fn step(&self, period: Period) -> Result<usize, ComputeError> {
        let only = || (self.manifest.steps.len() == 1).then_some(0);
        self.manifest.step_of(period).or_else(only).ok_or_else(|| {
            let reason = format!(
                "it has no step of exactly {period}, as the flux has, and is no single map"
            );
            refused(self.manifest.product.as_str(), &reason)
        })
    }

    async fn read(
        &mut self,
        store: &Store,
        chunks: &[Window],
        period: Period,
    ) -> Result<Chunks, ComputeError> {
        let step = self.step(period)?;
        if let Some((_, values)) = self.last.as_ref().filter(|(last, _)| *last == step) {
            return Ok(Arc::clone(values));
        }
        let opened = match self.values.take() {
            Some(opened) => opened,
            None => Values::of(store, &Arc::new(self.manifest.clone())).await?,
        };
        let values = opened.windows(step, chunks).await?;
        self.values = Some(opened);
        let below = values
            .iter()
            .flatten()
            .filter(|value| **value < 0.0)
            .count();
        if below > 0 {
            let key = &self.manifest.steps[step].field;
            let reason = format!("{below} cells of {key} are below 0, which no standard error is");
            return Err(refused(self.manifest.product.as_str(), &reason));
        }
        let values = Arc::new(values);
        self.last = Some((step, Arc::clone(&values)));
        Ok(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_a_flux_of_carbon_have_their_factors() {
        let year_s = 365.25 * 86_400.0;
        for (unit, factor) in [
            ("kg m-2 s-1", 1.0),
            ("g C m-2 year-1", 1e-3 / year_s),
            ("mol m-2 yr-1", 0.012_011 / year_s),
            ("mmol m-2 d-1", 0.012_011e-3 / 86_400.0),
        ] {
            let own = factor_of(unit).unwrap();
            assert!((own / factor - 1.0).abs() < 1e-14, "{unit}: {own}");
        }
        for unit in ["g", "K", "µatm", "g CO2 m-2 year-1", "kg s-1", "furlong"] {
            assert_eq!(factor_of(unit), None, "{unit}");
        }
    }
}
