//! `fluxglobe stats`: a product and a place, a line or a region in; the series of its cell, or of the mean over it, as a table or
//! JSON out.

use anyhow::{Result, bail};
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::Engine;
use compute::point::point_series_of;
use compute::stats::region_series_of;
use contract::analysis::{SeriesQuery, SeriesWishes};
use contract::grid::LonLatDeg;
use contract::series::{PointSeries, RegionSeries};
use contract::statistics::{PointQuestion, RegionQuestion, StatisticsWishes};

use crate::cli::{Settings, Stats, StatsLine, StatsPoint, StatsPolygon};
use crate::figures::{area, figures, middle, million_km2};
use crate::instants::Instants;
use crate::{deployment, plot, progress};

use super::analysis::{self, Output};
use super::budget::{ocean, stored_region};
use super::geometry;
use super::statistics::{self, Form};

/// Width of the longest bar, characters.
const BAR_CHARS: f64 = 30.0;

pub(crate) async fn run(settings: &Settings, which: Stats) -> Result<()> {
    match which {
        Stats::Point(options) => point(settings, &options).await,
        Stats::Line(options) => Box::pin(line(settings, &options)).await,
        Stats::Polygon(options) => Box::pin(polygon(settings, &options)).await,
        Stats::Correlate(options) => analysis::correlate(settings, &options).await,
        Stats::Difference(options) => analysis::difference(settings, &options).await,
        Stats::Hovmoller(options) => analysis::hovmoller(settings, &options).await,
    }
}

async fn point(settings: &Settings, options: &StatsPoint) -> Result<()> {
    let place = LonLatDeg::new(options.lon, options.lat)?;
    let store = deployment::store(settings)?;
    let manifest = deployment::version(&store, &options.product, &settings.data).await?;
    let product = &manifest.product;
    let output = Output {
        json: options.json,
        plot: options.analysis.plot.as_ref(),
    };
    let wishes = StatisticsWishes {
        from: options.from,
        to: options.to,
        sampling: options.sampling,
        ..options.statistics.wishes()
    };
    if let Some(analysed) = options.analysis.asked(options.statistics.min_coverage)? {
        let whole = StatisticsWishes {
            from: None,
            to: None,
            min_coverage: None,
            ..wishes
        };
        let point = whole.at_point(product.clone(), place);
        alone(matches!(point, PointQuestion::Series(_)) && !options.statistics.csv)?;
        let wishes = SeriesWishes {
            place: Some(place),
            from: options.from,
            to: options.to,
            ..SeriesWishes::default()
        };
        let query = analysis::series(wishes, product)?;
        let version = (store, &manifest);
        return analysis::of_series(settings, version, &query, &analysed, output).await;
    }
    let place = match wishes.at_point(product.clone(), place) {
        PointQuestion::Statistics(query) => {
            let form = Form::of(options.statistics.csv, options.json);
            let version = (store, &manifest);
            return statistics::run(settings, version, &query, form, output.plot).await;
        }
        PointQuestion::Series(place) => place,
    };
    let engine = Engine::local(store);
    let answer = point_series_of(&engine, &manifest, manifest.id(), place).await?;
    if let Some(file) = output.plot {
        plot::write(file, &plot::of_point(&answer)?)?;
    }
    match Form::of(options.statistics.csv, options.json) {
        Form::Json => return progress::result(&serde_json::to_string_pretty(&answer)?),
        Form::Csv => progress::result(&statistics::csv(&answer)?)?,
        Form::Table => progress::result(&table(&answer).trim_fmt())?,
    }
    progress::say(&format!(
        "{}, mean of the cell around {}; cite {}",
        answer.cited.titled(),
        middle(&answer.cell),
        answer.cited.manifest
    ));
    if answer.series.iter().all(|step| step.value.is_none()) {
        progress::say(statistics::NOTHING_THERE);
    }
    progress::say(&answer.cited.source);
    Ok(())
}

async fn line(settings: &Settings, options: &StatsLine) -> Result<()> {
    let line = geometry::line(&options.line)?;
    let store = deployment::store(settings)?;
    let manifest = deployment::version(&store, &options.product, &settings.data).await?;
    let version = (store, &manifest);
    let output = Output {
        json: options.json,
        plot: options.analysis.plot.as_ref(),
    };
    let asked = &options.statistics;
    if let Some(analysed) = options.analysis.asked(asked.min_coverage)? {
        alone(asked.statistic.is_none() && asked.step.is_none() && !asked.csv)?;
        let wishes = SeriesWishes {
            line: Some(line),
            from: options.from,
            to: options.to,
            earth: Some(options.earth),
            ..SeriesWishes::default()
        };
        let query = analysis::series(wishes, &manifest.product)?;
        return analysis::of_series(settings, version, &query, &analysed, output).await;
    }
    let wishes = StatisticsWishes {
        from: options.from,
        to: options.to,
        earth: Some(options.earth),
        ..asked.wishes()
    };
    let query = wishes.query(manifest.product.clone(), line.into());
    let form = Form::of(asked.csv, options.json);
    statistics::run(settings, version, &query, form, output.plot).await
}

async fn polygon(settings: &Settings, options: &StatsPolygon) -> Result<()> {
    let store = deployment::store(settings)?;
    let manifest = deployment::version(&store, &options.product, &settings.data).await?;
    let output = Output {
        json: options.json,
        plot: options.analysis.plot.as_ref(),
    };
    let wishes = StatisticsWishes {
        from: options.from,
        to: options.to,
        earth: Some(options.earth),
        cells: options.cells,
        ocean: ocean(settings, &store, options.ocean.as_ref()).await?,
        ..options.statistics.wishes()
    };
    let region = stored_region(settings, &store, &options.region).await?;
    let analysed = options.analysis.asked(options.statistics.min_coverage)?;
    // Of what is made of a series it says which steps count.
    let min_coverage = wishes.min_coverage.filter(|_| analysed.is_none());
    let wishes = StatisticsWishes {
        min_coverage,
        ..wishes
    };
    let asked = wishes.over_region(manifest.product.clone(), region);
    let query = match (analysed, asked) {
        (Some(analysed), asked) => {
            alone(!options.statistics.csv)?;
            let RegionQuestion::Series(query) = asked else {
                return alone(false);
            };
            let (query, version) = (SeriesQuery::Region(query), (store, &manifest));
            return analysis::of_series(settings, version, &query, &analysed, output).await;
        }
        (None, RegionQuestion::Statistics(query)) => {
            let form = Form::of(options.statistics.csv, options.json);
            let version = (store, &manifest);
            return statistics::run(settings, version, &query, form, output.plot).await;
        }
        (None, RegionQuestion::Series(query)) => query,
    };
    let bar = progress::bar("mean over the region", 1);
    let engine = deployment::region_engine(settings, store)?;
    let answer = region_series_of(&engine, &query, &manifest).await?;
    bar.finish_and_clear();
    if let Some(file) = output.plot {
        plot::write(file, &plot::of_region(&answer)?)?;
    }
    match Form::of(options.statistics.csv, options.json) {
        Form::Json => return progress::result(&serde_json::to_string_pretty(&answer)?),
        Form::Csv => progress::result(&statistics::csv(&answer)?)?,
        Form::Table => progress::result(&region_table(&answer).trim_fmt())?,
    }
    progress::say(&format!(
        "{}, mean over {} ({}), each cell by its area on the {} earth; cite {}",
        answer.cited.titled(),
        answer.region,
        area(answer.region_area_m2),
        answer.earth,
        answer.cited.manifest
    ));
    progress::say(&format!("what is sea: {}", answer.ocean_source));
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    progress::say(&answer.cited.source);
    Ok(())
}

/// What is made of a series is made of its means at all steps.
fn alone(is_a_series: bool) -> Result<()> {
    if !is_a_series {
        bail!(
            "--climatology, --anomaly, --trend, --season and --extremes are made of the means of all steps: leave \
             --statistic, --step, --sampling, --cells and --csv out"
        );
    }
    Ok(())
}

fn region_table(answer: &RegionSeries) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    let unit = answer.cited.unit.as_str();
    table.set_header(["from", "to", unit, "% of sea", "10⁶ km² with data"]);
    for column in 2..5 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let instants = Instants::of(answer.series.iter().flat_map(|step| [step.start, step.end]));
    for step in &answer.series {
        let mean = step.mean.map(|mean| figures(mean, 4));
        table.add_row([
            instants.text(step.start),
            instants.text(step.end),
            mean.unwrap_or_else(|| "no data".to_owned()),
            format!("{:.1}", step.coverage_percent),
            million_km2(step.area_m2),
        ]);
    }
    table
}

fn table(answer: &PointSeries) -> Table {
    let largest = answer
        .series
        .iter()
        .filter_map(|step| step.value)
        .fold(0.0, |a: f64, v| a.max(v.abs()));
    let mut table = Table::new();
    table.load_preset(NOTHING);
    let is_counted = answer.series.iter().any(|step| step.contributed.is_some());
    let mut header = vec!["from", "to", answer.cited.unit.as_str(), ""];
    if is_counted {
        header.extend(["steps with data", "% of time"]);
    }
    table.set_header(header);
    for column in [2, 4, 5] {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let instants = Instants::of(answer.series.iter().flat_map(|step| [step.start, step.end]));
    for step in &answer.series {
        let (text, bar) = match step.value {
            Some(value) => (figures(value, 4), bar(value, largest)),
            None => ("no data".to_owned(), String::new()),
        };
        let mut row = vec![
            instants.text(step.start),
            instants.text(step.end),
            text,
            bar,
        ];
        if let Some(counts) = &step.contributed {
            row.push(format!("{} of {}", counts.steps, counts.of_steps));
            row.push(format!("{:.1}", counts.time_percent));
        }
        table.add_row(row);
    }
    table
}

/// A bar of a value's size; light for values below zero.
fn bar(value: f64, largest: f64) -> String {
    let length = if largest > 0.0 {
        (value.abs() / largest * BAR_CHARS).round() as usize
    } else {
        0
    };
    if value < 0.0 {
        "░".repeat(length)
    } else {
        "█".repeat(length)
    }
}
