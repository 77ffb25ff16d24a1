//! `fluxglobe stats` with statistics: a geometry, bins of time and names of statistics in; a table, CSV or JSON out.

use anyhow::Result;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::reduce::statistics_of;
use contract::manifest::Manifest;
use contract::rows::Tabular;
use contract::statistics::{StatisticsAnswer, StatisticsQuery, StatisticsRow};
use export::answer::AnswerFormat;
use storage::Store;

use crate::cli::{PlotFile, Settings};
use crate::figures::{area, figures};
use crate::instants::Instants;
use crate::{deployment, plot, progress};

const M_PER_KM: f64 = 1e3;

/// How an answer is printed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Form {
    Table,
    Json,
    Csv,
}

impl Form {
    pub(crate) fn of(is_csv: bool, is_json: bool) -> Self {
        match (is_json, is_csv) {
            (true, _) => Self::Json,
            (false, true) => Self::Csv,
            (false, false) => Self::Table,
        }
    }
}

/// Said of a place, and of a line, at which no step has a value: what was meant otherwise looks the same.
pub(super) const NOTHING_THERE: &str = "note: no step holds data at this place: it lies on land, or the product has a gap there; --lon is degrees east, --lat degrees north";
const NOTHING_ALONG: &str = "note: no step holds data along this line: it lies on land, or the product has a gap there; of each of its places the longitude comes first";

/// Asks, draws and prints.
pub(crate) async fn run(
    settings: &Settings,
    (store, manifest): (Store, &Manifest),
    query: &StatisticsQuery,
    form: Form,
    plot: Option<&PlotFile>,
) -> Result<()> {
    let engine = deployment::region_engine(settings, store)?;
    let bar = progress::bar("statistics", 1);
    let answer = statistics_of(&engine, query, manifest, manifest.id()).await?;
    bar.finish_and_clear();
    if let Some(file) = plot {
        plot::write(file, &plot::of_statistics(&answer)?)?;
    }
    match form {
        Form::Json => return progress::result(&serde_json::to_string_pretty(&answer)?),
        Form::Csv => progress::result(&csv(&answer)?)?,
        Form::Table => progress::result(&table(&answer).trim_fmt())?,
    }
    progress::say(&format!(
        "{}, {}; cite {}",
        answer.cited.titled(),
        taken(&answer),
        answer.cited.manifest
    ));
    for one in &answer.statistics {
        let unit = match one.unit.as_str() {
            "" => String::new(),
            unit => format!(" ({unit})"),
        };
        progress::say(&format!("{}{unit}: {}", one.name, one.what));
    }
    progress::say(&format!("coverage: {}", answer.coverage_basis));
    if let Some(source) = &answer.ocean_source {
        progress::say(&format!("what is sea: {source}"));
    }
    let withheld = answer.rows.iter().filter(|row| row.is_withheld).count();
    if withheld > 0 {
        progress::say(&format!(
            "{withheld} rows have less than {} % coverage: their values are withheld",
            answer.min_coverage_percent
        ));
    }
    for note in &answer.notes {
        progress::say(&format!("note: {note}"));
    }
    if let Some(note) = nothing(&answer) {
        progress::say(note);
    }
    progress::say(&answer.cited.source);
    Ok(())
}

/// What is said where no row holds data; a region says it by itself.
fn nothing(answer: &StatisticsAnswer) -> Option<&'static str> {
    if answer.rows.iter().any(|row| row.coverage_percent > 0.0) {
        return None;
    }
    match answer.size_unit.as_str() {
        "1" => Some(NOTHING_THERE),
        "m" => Some(NOTHING_ALONG),
        _ => None,
    }
}

fn is_point(answer: &StatisticsAnswer) -> bool {
    answer.size_unit == "1"
}

/// What statistics are of, with its size; a point has none.
fn taken(answer: &StatisticsAnswer) -> String {
    if is_point(answer) {
        return format!("{} {}", answer.kind, answer.geometry);
    }
    let size = match answer.size_unit.as_str() {
        "m²" => area(answer.size),
        "m" => format!("{} km", figures(answer.size / M_PER_KM, 3)),
        unit => format!("{:.6e} {unit}", answer.size),
    };
    format!(
        "{} of {} ({size}) on the {} earth",
        answer.kind, answer.geometry, answer.earth
    )
}

fn table(answer: &StatisticsAnswer) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    let mut header = vec!["from".to_owned(), "to".to_owned()];
    header.extend(answer.statistics.iter().map(|one| one.name.clone()));
    header.push("% covered".to_owned());
    let columns = header.len();
    table.set_header(header);
    for column in 2..columns {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let rows = &answer.rows;
    let instants = Instants::of(rows.iter().flat_map(|row| [row.start, row.end]));
    let found = Instants::of(rows.iter().flat_map(|row| row.found_at.values().copied()));
    for row in rows {
        let mut cells = vec![instants.text(row.start), instants.text(row.end)];
        let values = answer.statistics.iter();
        cells.extend(values.map(|one| shown(row, &one.name, found)));
        cells.push(format!("{:.1}", row.coverage_percent));
        table.add_row(cells);
    }
    table
}

/// A value with as many digits as people read, and where an extreme was found.
fn shown(row: &StatisticsRow, name: &str, found: Instants) -> String {
    let Some(value) = row.values.get(name).copied().flatten() else {
        let why = if row.is_withheld {
            "withheld"
        } else {
            "no data"
        };
        return why.to_owned();
    };
    let number = if name == "count" {
        format!("{value}")
    } else {
        figures(value, 4)
    };
    match row.found_at.get(name) {
        Some(time) => format!("{number} ({})", found.text(*time)),
        None => number,
    }
}

/// A line a row; a value that is not there is empty. The same over HTTP.
pub(crate) fn csv(answer: &dyn Tabular) -> Result<String> {
    let content = export::answer::encoded(&answer.columns(), AnswerFormat::Csv)?;
    let mut text = String::from_utf8(content)?;
    text.truncate(text.trim_end().len());
    Ok(text)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_place_and_a_line_without_data_are_told_to_be_so() {
        let of = |unit: &str, coverage_percent: f64| {
            let row = json!({"start": "2000-01-01T00:00:00Z", "end": "2000-02-01T00:00:00Z", "mid": "2000-01-16T12:00:00Z",
                "values": {}, "coverage_percent": coverage_percent, "step_count": 1, "is_withheld": false});
            let answer = json!({"product": "sst", "manifest": "sst@1-00000000", "title": "", "source": "", "synthetic": false,
                "quantity": "sea_surface_temperature", "unit": "°C", "kind": "", "geometry": "", "step": "month",
                "earth": "wgs84", "cells": "whole", "statistics": [], "coverage_basis": "", "size": 1.0, "size_unit": unit,
                "min_coverage_percent": 0.0, "ocean_source": null, "notes": [], "rows": [row]});
            nothing(&serde_json::from_value(answer).unwrap())
        };
        assert_eq!(of("1", 0.0), Some(NOTHING_THERE));
        assert_eq!(of("m", 0.0), Some(NOTHING_ALONG));
        for (unit, coverage_percent) in [("m²", 0.0), ("1", 50.0), ("m", 1.0)] {
            assert_eq!(of(unit, coverage_percent), None);
        }
    }

    #[test]
    fn a_point_has_no_size_and_lies_on_no_figure_of_the_earth() {
        let of = |kind: &str, geometry: &str, size: f64, unit: &str| {
            let answer = json!({"product": "sst", "manifest": "sst@1-00000000", "title": "", "source": "", "synthetic": false,
                "quantity": "sea_surface_temperature", "unit": "°C", "kind": kind, "geometry": geometry, "step": "month",
                "earth": "wgs84", "cells": "whole", "statistics": [], "coverage_basis": "", "size": size, "size_unit": unit,
                "min_coverage_percent": 0.0, "ocean_source": null, "notes": [], "rows": []});
            taken(&serde_json::from_value(answer).unwrap())
        };
        assert_eq!(of("point", "0,10", 1.0, "1"), "point 0,10");
        assert_eq!(
            of("area", "global", 5.1e14, "m²"),
            "area of global (510.000 10⁶ km²) on the wgs84 earth"
        );
        assert_eq!(
            of("line", "0,0;0,10", 1_105_854.8, "m"),
            "line of 0,0;0,10 (1105.855 km) on the wgs84 earth"
        );
    }
}
