//! `fluxglobe stats correlate` and `difference`: two series in; how they go together or differ out.

use anyhow::{Result, bail};
use compute::analysis;
use contract::analysis::{CorrelationQuery, SeriesQuery};
use contract::earth::Earth;
use contract::product::ProductId;
use contract::region::AskedRegion;
use contract::series::RegionSeriesQuery;
use contract::time::TimeMs;
use storage::Store;

use super::{reader, say_source, tables, version};
use crate::cli::{Place, Settings, StatsCorrelate, StatsDifference};
use crate::command::budget::stored_region;
use crate::{deployment, progress};

pub(crate) async fn correlate(settings: &Settings, options: &StatsCorrelate) -> Result<()> {
    let [first, second] = &options.products[..] else {
        bail!(
            "a correlation is of two products, not of {}: give --product twice",
            options.products.len()
        );
    };
    let store = deployment::store(settings)?;
    let period = [options.from, options.to];
    let region = region(settings, &store, &options.place).await?;
    let series = series(first, region, &options.place, period, options.earth)?;
    let query = CorrelationQuery {
        step: options.step,
        deseasonalise: options.deseasonalise,
        ..CorrelationQuery::new(series, second.clone(), options.max_lag)?
    };
    let a = deployment::manifest(&store, first, &settings.data).await?;
    let b = deployment::manifest(&store, second, &settings.data).await?;
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
    let other = options.minus.as_ref().unwrap_or(&options.product);
    let of = version(
        settings,
        &store,
        &options.product,
        options.manifest.as_ref(),
    )
    .await?;
    let minus = version(settings, &store, other, options.minus_manifest.as_ref()).await?;
    let region = region(settings, &store, &options.place).await?;
    let all = series(
        &options.product,
        region,
        &options.place,
        [None, None],
        options.earth,
    )?;
    let of_series = all.in_years(options.period);
    let minus_period = options.minus_period.or(options.period);
    let minus_series = all.of_product(other.clone()).in_years(minus_period);
    let bar = progress::bar("compare", 1);
    let engine = reader(settings, store, &all)?;
    let (of_id, minus_id) = (of.id(), minus.id());
    let answer = analysis::difference(
        &engine,
        ((&of, &of_id), &of_series),
        ((&minus, &minus_id), &minus_series),
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

/// The region that is asked for, if one is.
async fn region(settings: &Settings, store: &Store, place: &Place) -> Result<Option<AskedRegion>> {
    Ok(match &place.region {
        Some(text) => Some(stored_region(settings, store, text).await?),
        None => None,
    })
}

fn series(
    product: &ProductId,
    region: Option<AskedRegion>,
    place: &Place,
    [from, to]: [Option<TimeMs>; 2],
    earth: Earth,
) -> Result<SeriesQuery> {
    let product = product.clone();
    Ok(match (region, place.at) {
        (Some(region), None) => SeriesQuery::Region(RegionSeriesQuery {
            from,
            to,
            earth,
            ..RegionSeriesQuery::new(product, region)
        }),
        (None, Some(place)) => SeriesQuery::Cell {
            product,
            place,
            from,
            to,
        },
        _ => bail!("give a region or a place: --region or --at"),
    })
}
