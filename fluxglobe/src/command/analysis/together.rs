//! `fluxglobe stats correlate` and `difference`: two series in; how they go together or differ out.

use anyhow::{Context as _, Result, bail};
use compute::analysis;
use contract::analysis::{CorrelationWishes, DifferenceWishes, SeriesQuery, SeriesWishes};
use contract::manifest::AskedVersion;
use contract::product::ProductId;
use storage::Store;

use super::{reader, say_source, tables, version};
use crate::cli::{Place, Settings, StatsCorrelate, StatsDifference};
use crate::command::budget::stored_region;
use crate::command::geometry;
use crate::{deployment, progress};

pub(crate) async fn correlate(settings: &Settings, options: &StatsCorrelate) -> Result<()> {
    let [first, second] = &options.products[..] else {
        bail!(
            "a correlation is of two products, not of {}: give --product twice",
            options.products.len()
        );
    };
    let store = deployment::store(settings)?;
    let wishes = SeriesWishes {
        from: options.from,
        to: options.to,
        earth: options.earth,
        ..at(settings, &store, &options.place).await?
    };
    let series = series(wishes, &first.product)?;
    let wishes = CorrelationWishes {
        step: options.step,
        deseasonalise: Some(options.deseasonalise),
        max_lag: options.max_lag,
        min_coverage: options.min_coverage,
    };
    let query = wishes.query(series, second.product.clone())?;
    let a = deployment::version(&store, first, &settings.data).await?;
    let b = deployment::version(&store, second, &settings.data).await?;
    let bar = progress::bar("correlate", 1);
    let engine = reader(settings, store, &query.series)?;
    let (a, b) = ((&a, &a.id()), (&b, &b.id()));
    let answer = analysis::correlation(&engine, a, b, &query).await?;
    bar.finish_and_clear();
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&answer)?);
    }
    progress::result(&tables::of_correlation(&answer))?;
    let place = tables::place(&answer.place);
    say_source(
        &answer.first,
        &place,
        "the first: at lags above zero it leads",
    );
    say_source(&answer.second, &place, "the second");
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    Ok(())
}

pub(crate) async fn difference(settings: &Settings, options: &StatsDifference) -> Result<()> {
    let store = deployment::store(settings)?;
    let same = AskedVersion::from(options.product.product.clone());
    let other = options.minus.as_ref().unwrap_or(&same);
    let of = version(
        settings,
        &store,
        &options.product,
        options.manifest.as_ref(),
    )
    .await?;
    let minus = version(settings, &store, other, options.minus_manifest.as_ref()).await?;
    let wishes = SeriesWishes {
        earth: options.earth,
        ..at(settings, &store, &options.place).await?
    };
    let all = series(wishes, &of.product)?;
    let wishes = DifferenceWishes {
        period: options.period,
        minus_period: options.minus_period,
    };
    let [of_series, minus_series] = wishes.sides(&all, minus.product.clone());
    let bar = progress::bar("compare", 1);
    let engine = reader(settings, store, &all)?;
    let (of_id, minus_id) = (of.id(), minus.id());
    let answer = analysis::difference(
        &engine,
        ((&of, &of_id), &of_series),
        ((&minus, &minus_id), &minus_series),
        options.min_coverage.unwrap_or_default(),
    )
    .await?;
    bar.finish_and_clear();
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&answer)?);
    }
    progress::result(&tables::of_difference(&answer))?;
    let place = tables::place(&answer.place);
    say_source(&answer.of.cited, &place, "what something is taken off from");
    say_source(&answer.minus.cited, &place, "what is taken off");
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    Ok(())
}

/// The cell, the region or the line that is asked for.
async fn at(settings: &Settings, store: &Store, place: &Place) -> Result<SeriesWishes> {
    let region = match &place.region {
        Some(text) => Some(stored_region(settings, store, text).await?),
        None => None,
    };
    Ok(SeriesWishes {
        place: place.at,
        region,
        line: place.line.as_deref().map(geometry::line).transpose()?,
        ..SeriesWishes::default()
    })
}

/// The series of a product that is asked for.
pub(crate) fn series(wishes: SeriesWishes, product: &ProductId) -> Result<SeriesQuery> {
    let query = wishes.query(product.clone())?;
    query.context("give a region, a place or a line: --region, --at or --line")
}
