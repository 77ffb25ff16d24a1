//! What is made of series on the command line: `fluxglobe stats point|line|polygon --climatology --anomaly --trend --season
//! --extremes`, `stats correlate`, `stats difference`, `stats hovmoller`; tables or JSON out, and plots.

mod tables;
mod together;

use anyhow::{Result, bail};
use compute::Engine;
use contract::analysis::{AnalysisOptions, Hovmoller, HovmollerWishes, SeriesQuery};
use contract::cited::Cited;
use contract::manifest::{AskedVersion, Manifest};
use contract::time::{Period, TimeMs};
use storage::Store;

use crate::cli::{PlotFile, Settings, StatsHovmoller};
use crate::command::budget::stored_region;
use crate::{deployment, plot, progress};

pub(crate) use together::{correlate, difference, series};

/// What is printed and drawn of an analysis.
pub(crate) struct Output<'a> {
    pub(crate) json: bool,
    pub(crate) plot: Option<&'a PlotFile>,
}

/// Analyses a series of a version of a product.
pub(crate) async fn of_series(
    settings: &Settings,
    (store, manifest): (Store, &Manifest),
    query: &SeriesQuery,
    options: &AnalysisOptions,
    output: Output<'_>,
) -> Result<()> {
    let bar = progress::bar("analyse the series", 1);
    let engine = reader(settings, store, query)?;
    let version = (manifest, &manifest.id());
    let answer = compute::analysis::analyse(&engine, version, query, options).await?;
    bar.finish_and_clear();
    if let Some(file) = output.plot {
        plot::write(file, &plot::of_analysis(&answer)?)?;
    }
    if output.json {
        return progress::result(&serde_json::to_string_pretty(&answer)?);
    }
    let tables = tables::of_analysis(&answer);
    if tables.is_empty() {
        let reasons = answer.refused.iter().map(|one| &one.reason);
        let all: Vec<&str> = reasons.chain(&answer.notes).map(String::as_str).collect();
        bail!("{}", all.join("; "));
    }
    progress::result(&tables.join("\n\n"))?;
    for refused in &answer.refused {
        progress::say(&format!("no {}: {}", refused.part, refused.reason));
    }
    let with_data = format!(
        "{} of {} steps hold data",
        answer.value_count, answer.step_count
    );
    say_source(&answer.cited, &tables::place(&answer.place), &with_data);
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    Ok(())
}

/// Latitude or longitude against time.
pub(crate) async fn hovmoller(settings: &Settings, options: &StatsHovmoller) -> Result<()> {
    let store = deployment::store(settings)?;
    let manifest = deployment::version(&store, &options.product, &settings.data).await?;
    let region = match &options.region {
        Some(text) => Some(stored_region(settings, &store, text).await?),
        None => None,
    };
    let wishes = HovmollerWishes {
        band_deg: options.band,
        region,
        step: options.step,
        from: options.from,
        to: options.to,
        earth: Some(options.earth),
        min_coverage: options.min_coverage,
    };
    let query = wishes.query(manifest.product.clone(), options.along);
    let bar = progress::bar("means of bands", 1);
    let version = (&manifest, &manifest.id());
    // Whole steps are read in this process, one after the other.
    let engine = Engine::local(store);
    let answer: Hovmoller = compute::analysis::hovmoller(&engine, version, &query).await?;
    bar.finish_and_clear();
    if let Some(file) = &options.plot {
        let data = covered(&manifest, options.from, options.to)?;
        plot::write(file, &plot::of_hovmoller(&answer, data)?)?;
    }
    if options.json {
        return progress::result(&serde_json::to_string_pretty(&answer)?);
    }
    progress::result(&tables::of_hovmoller(&answer))?;
    let cell = match &answer.region {
        Some(region) => format!("each cell by its share of {region}"),
        None => "each cell by its area".to_owned(),
    };
    let bands = format!(
        "means of {} bands of {} degrees, {cell} on the {} earth",
        answer.bands.len(),
        answer.band_deg,
        answer.earth
    );
    let holes = match answer.left_out_count {
        0 => "a hole is a band without data",
        _ => "a hole is a band without data, or with too little",
    };
    say_source(&answer.cited, &bands, holes);
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    Ok(())
}

/// What a version covers of an asked period.
fn covered(manifest: &Manifest, from: Option<TimeMs>, to: Option<TimeMs>) -> Result<Period> {
    let (Some(first), Some(last)) = (manifest.steps.first(), manifest.steps.last()) else {
        bail!("{} has no step", manifest.id());
    };
    let (first, last) = (first.period.start, last.period.end);
    let start = from.map_or(first, |from| from.max(first));
    let end = to.map_or(last, |to| to.min(last));
    Ok(Period::new(start, end)?)
}

/// Who reads a series: one cell from its block in this process, a region or a line where regions are summed.
fn reader(settings: &Settings, store: Store, query: &SeriesQuery) -> Result<Engine> {
    match query {
        SeriesQuery::Cell { .. } => Ok(Engine::local(store)),
        SeriesQuery::Region(_) | SeriesQuery::Line(_) => deployment::region_engine(settings, store),
    }
}

fn say_source(cited: &Cited, what: &str, more: &str) {
    progress::say(&format!(
        "{}, {what}; {more}; cite {}",
        cited.titled(),
        cited.manifest
    ));
    progress::say(&cited.source);
}

/// A version of a product, which another option may name.
async fn version(
    settings: &Settings,
    store: &Store,
    asked: &AskedVersion,
    named: Option<&AskedVersion>,
) -> Result<Manifest> {
    match named {
        None => deployment::version(store, asked, &settings.data).await,
        Some(named) if asked.number.is_some() => {
            bail!("{asked} and {named} both say which version is meant: give one")
        }
        Some(named) if named.product != asked.product => {
            bail!("version {named} is none of {}", asked.product)
        }
        Some(named) if named.number.is_none() => {
            bail!("{named} names no version: give its number too, such as {named}@12")
        }
        Some(named) => deployment::version(store, named, &settings.data).await,
    }
}
