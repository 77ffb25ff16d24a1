//! What was measured: a line a region and program.

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use serde::Serialize;

use super::process::Ran;
use crate::bench::quantile;

/// A program's times for one region.
#[derive(Debug, Serialize)]
pub(super) struct Timed {
    program: &'static str,
    pub(super) budget_tg: f64,
    first_s: f64,
    median_s: f64,
    longest_s: f64,
    /// Of all runs but the first.
    peak_mb: Option<f64>,
}

/// One region.
#[derive(Debug, Serialize)]
pub(super) struct Row {
    pub(super) region: &'static str,
    pub(super) timed: Vec<Timed>,
}

impl Timed {
    /// `again` is not empty.
    pub(super) fn new(program: &'static str, budget_tg: f64, first: &Ran, again: &[Ran]) -> Self {
        let mut walls: Vec<f64> = again.iter().map(|ran| ran.wall_s).collect();
        walls.sort_by(f64::total_cmp);
        let peaks = again.iter().filter_map(|ran| ran.peak_mb);
        Self {
            program,
            budget_tg,
            first_s: first.wall_s,
            median_s: quantile(&walls, 0.5),
            longest_s: quantile(&walls, 1.0),
            peak_mb: peaks.max_by(f64::total_cmp),
        }
    }
}

/// Landings, and times by region and program.
pub(super) fn table(landings: &[(&'static str, Ran)], rows: &[Row]) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header([
        "what",
        "by",
        "Tg C",
        "first s",
        "median s",
        "longest s",
        "peak MB",
    ]);
    for column in 2..7 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    let mb = |mb: Option<f64>| mb.map_or_else(|| "-".to_owned(), |mb| format!("{mb:.0}"));
    for (program, ran) in landings {
        table.add_row([
            "landing".to_owned(),
            (*program).to_owned(),
            String::new(),
            format!("{:.2}", ran.wall_s),
            String::new(),
            String::new(),
            mb(ran.peak_mb),
        ]);
    }
    for row in rows {
        for timed in &row.timed {
            table.add_row([
                row.region.to_owned(),
                timed.program.to_owned(),
                format!("{:.6}", timed.budget_tg),
                format!("{:.2}", timed.first_s),
                format!("{:.2}", timed.median_s),
                format!("{:.2}", timed.longest_s),
                mb(timed.peak_mb),
            ]);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_time_is_told_apart() {
        let ran = |wall_s, peak_mb| Ran {
            output: String::new(),
            wall_s,
            peak_mb,
        };
        let again = [ran(3.0, Some(5.0)), ran(1.0, None), ran(2.0, Some(7.0))];
        let timed = Timed::new("a", -1.5, &ran(9.0, Some(99.0)), &again);
        assert_eq!(
            [timed.first_s, timed.median_s, timed.longest_s].map(f64::to_bits),
            [9.0, 2.0, 3.0].map(f64::to_bits)
        );
        assert_eq!(timed.peak_mb, Some(7.0));
        let rows = [Row {
            region: "box",
            timed: vec![timed],
        }];
        let text = table(&[("a", ran(4.0, None))], &rows).to_string();
        assert!(
            text.contains("landing") && text.contains("-1.500000"),
            "{text}"
        );
    }
}
