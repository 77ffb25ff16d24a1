//! What was made of series, as text in columns.

use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use contract::analysis::{
    Anomalies, Climatology, Correlation, Difference, Extremes, Harmonic, Hovmoller, HovmollerRow,
    Season, SeriesAnalysis, SeriesPlace, Trend,
};

use crate::figures::{figures, middle, million_km2};
use crate::instants::Instants;

/// Numbers of a row of bands that are shown on one line.
const BANDS_SHOWN: usize = 12;
/// Chances below this are told to be.
const SMALLEST_CHANCE: f64 = 1e-300;

/// Where a series is taken, for people.
pub(super) fn place(place: &SeriesPlace) -> String {
    match (&place.region, &place.line, &place.cell) {
        (Some(region), _, _) => format!("mean over {region}"),
        (None, Some(line), _) => format!("mean along {line}, each cell by the length in it"),
        (None, None, Some(cell)) => format!("mean of the cell around {}", middle(cell)),
        (None, None, None) => String::new(),
    }
}

/// A table for each part that there is.
pub(super) fn of_analysis(answer: &SeriesAnalysis) -> Vec<String> {
    let unit = answer.cited.unit.as_str();
    let tables = [
        answer
            .climatology
            .as_ref()
            .map(|made| climatology(made, unit)),
        answer.anomaly.as_ref().map(|made| anomaly(made, unit)),
        answer.trend.as_ref().map(|made| trend(made, unit)),
        answer.season.as_ref().map(|made| season(made, unit)),
        answer.extremes.as_ref().map(|made| extremes(made, unit)),
    ];
    tables.into_iter().flatten().collect()
}

/// A table whose columns from `first_number` on are numbers.
fn table(header: &[&str], first_number: usize, rows: impl Iterator<Item = Vec<String>>) -> String {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(header.iter().copied());
    for column in first_number..header.len() {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    rows.for_each(|row| {
        table.add_row(row);
    });
    table.trim_fmt()
}

/// A text and the unit of its number; a number without a unit is of none.
fn of_unit(text: String, between: &str, unit: &str) -> String {
    if unit.is_empty() {
        text
    } else {
        format!("{text}{between}{unit}")
    }
}

fn number(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |value| figures(value, 4))
}

/// A chance: small ones by their size.
fn chance(p_value: Option<f64>) -> String {
    match p_value {
        None => "-".to_owned(),
        Some(p) if p >= 1e-4 => format!("{p:.4}"),
        // Below some 1e-308 numbers lose their figures, and are zero in the end, which no chance is.
        Some(p) if p < SMALLEST_CHANCE => format!("< {SMALLEST_CHANCE:e}"),
        Some(p) => format!("{p:.1e}"),
    }
}

fn climatology(made: &Climatology, unit: &str) -> String {
    let title = format!("{}, {}", made.bins, made.base);
    let rows = made.rows.iter().map(|row| {
        vec![
            row.bin.clone(),
            number(row.mean),
            number(row.spread),
            row.count.to_string(),
            row.years.to_string(),
        ]
    });
    table(&[title.as_str(), unit, "spread", "steps", "years"], 1, rows)
}

fn anomaly(made: &Anomalies, unit: &str) -> String {
    let normal = format!("normal {}", made.base);
    let instants = Instants::of(made.rows.iter().flat_map(|row| [row.start, row.end]));
    let rows = made.rows.iter().map(|row| {
        vec![
            instants.text(row.start),
            instants.text(row.end),
            number(row.value),
            number(row.normal),
            number(row.anomaly),
            number(row.standardised),
        ]
    });
    let header = ["from", "to", unit, normal.as_str(), "anomaly", "in spreads"];
    table(&header, 2, rows)
}

fn trend(made: &Trend, unit: &str) -> String {
    let (squares, pairs, test) = (&made.least_squares, &made.theil_sen, &made.mann_kendall);
    let interval = |low: Option<f64>, high: Option<f64>| match low.zip(high) {
        Some((low, high)) => format!("{} to {}", figures(low, 4), figures(high, 4)),
        None => "-".to_owned(),
    };
    let rows = [
        vec![
            "least squares".to_owned(),
            number(Some(squares.slope_per_decade)),
            interval(squares.lower_per_decade, squares.upper_per_decade),
            chance(squares.p_value),
            format!(
                "{:.1} of {} values are effective, lag-1 autocorrelation {:.3}",
                squares.effective_count, made.count, squares.lag1_autocorrelation
            ),
        ],
        vec![
            "Theil-Sen, Mann-Kendall".to_owned(),
            number(Some(pairs.slope_per_decade)),
            interval(Some(pairs.lower_per_decade), Some(pairs.upper_per_decade)),
            chance(Some(test.p_value)),
            format!(
                "tau {:.3}, variance times {:.2} for autocorrelation",
                test.tau, test.variance_correction
            ),
        ],
    ];
    let seasons = match made.parts_taken_off() {
        None => "values as they are".to_owned(),
        Some(part) => format!("mean of each {part} taken off"),
    };
    let header = [
        "trend",
        made.slope_unit.as_str(),
        "95 %",
        "p",
        "allowed for",
    ];
    let told = format!(
        "{} values of step {} over {:.1} years, mean {}; {seasons}",
        made.count,
        made.step,
        made.years,
        of_unit(figures(made.mean, 4), " ", unit)
    );
    format!("{}\n {told}", table(&header, 1, rows.into_iter()))
}

fn season(made: &Season, unit: &str) -> String {
    let wave = |name: &str, wave: &Harmonic| {
        let day = wave.highest_after_days.floor() + 1.0;
        vec![
            name.to_owned(),
            number(Some(wave.amplitude)),
            format!("day {day:.0}"),
        ]
    };
    let rows = [
        wave("year", &made.annual),
        wave("half-year", &made.semi_annual),
    ];
    let told = format!(
        "mean {}; both waves explain {:.1} % of the variance{}, and leave a spread of {}",
        of_unit(figures(made.mean, 4), " ", unit),
        made.explained_percent,
        if made.has_trend { " about a line" } else { "" },
        figures(made.residual_spread, 4)
    );
    let amplitude = of_unit("amplitude".to_owned(), ", ", unit);
    let header = ["wave", amplitude.as_str(), "highest on"];
    format!("{}\n {told}", table(&header, 1, rows.into_iter()))
}

fn extremes(made: &Extremes, unit: &str) -> String {
    let pairs = made.highest.iter().zip(&made.lowest);
    let starts = pairs
        .clone()
        .flat_map(|(high, low)| [high.start, low.start]);
    let instants = Instants::of(starts);
    let rows = pairs.map(|(high, low)| {
        vec![
            instants.text(high.start),
            number(Some(high.value)),
            instants.text(low.start),
            number(Some(low.value)),
        ]
    });
    let ends = table(&["highest from", unit, "lowest from", unit], 1, rows);
    let shares = made.percentiles.iter();
    let rows = shares.map(|one| vec![format!("{} %", one.percent), number(Some(one.value))]);
    format!("{ends}\n\n{}", table(&["below", unit], 0, rows))
}

pub(super) fn of_correlation(answer: &Correlation) -> String {
    let rows = answer.rows.iter().map(|row| {
        let strongest = answer.strongest_lag_steps == Some(row.lag_steps);
        vec![
            row.lag_steps.to_string(),
            number(row.correlation),
            chance(row.p_value),
            row.count.to_string(),
            row.effective_count
                .map_or_else(|| "-".to_owned(), |n| format!("{n:.1}")),
            if strongest { "strongest" } else { "" }.to_owned(),
        ]
    });
    let lag = format!("lag, {}", answer.step);
    table(&[lag.as_str(), "r", "p", "pairs", "effective", ""], 0, rows)
}

pub(super) fn of_difference(answer: &Difference) -> String {
    let sides = [&answer.of, &answer.minus];
    let instants = Instants::of(sides.into_iter().flat_map(|side| [side.start, side.end]));
    let side = |name: &str, side: &contract::analysis::DifferenceSide| {
        vec![
            name.to_owned(),
            side.cited.manifest.to_string(),
            instants.text(side.start),
            instants.text(side.end),
            number(side.mean),
            side.count.to_string(),
        ]
    };
    let rows = [
        side("mean", &answer.of),
        side("less mean", &answer.minus),
        vec![
            "difference".to_owned(),
            format!("± {} (1σ)", number(answer.standard_error)),
            match chance(answer.p_value) {
                less if less.starts_with('<') => format!("p {less}"),
                p => format!("p = {p}"),
            },
            String::new(),
            number(answer.difference),
            String::new(),
        ],
    ];
    let header = ["", "version", "from", "to", answer.unit.as_str(), "steps"];
    table(&header, 4, rows.into_iter())
}

/// A row a band of the whole period.
fn of_profile(answer: &Hovmoller, row: &HovmollerRow) -> String {
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| figures(value, 3));
    let bands = answer.bands.iter().enumerate().map(|(at, band)| {
        vec![
            format!("{}..{}", band.low_deg, band.high_deg),
            number(row.means[at]),
            number(row.stds[at]),
            format!("{:.1}", row.coverage_percent[at]),
            million_km2(band.area_m2),
        ]
    });
    let header = ["band, degrees", "mean", "std", "coverage, %", "10⁶ km²"];
    table(&header, 1, bands)
}

/// Every so manieth band, so that a row stays a line; a row a band of the whole period.
pub(super) fn of_hovmoller(answer: &Hovmoller) -> String {
    if let [row] = answer.rows.as_slice()
        && !row.stds.is_empty()
    {
        return of_profile(answer, row);
    }
    let every = answer.bands.len().div_ceil(BANDS_SHOWN).max(1);
    let shown: Vec<usize> = (0..answer.bands.len()).step_by(every).collect();
    let mut header = vec!["from".to_owned()];
    header.extend(shown.iter().map(|band| {
        let band = &answer.bands[*band];
        format!("{}..{}", band.low_deg, band.high_deg)
    }));
    let header: Vec<&str> = header.iter().map(String::as_str).collect();
    let instants = Instants::of(answer.rows.iter().map(|row| row.start));
    let rows = answer.rows.iter().map(|row| {
        let means = shown.iter().map(|band| match row.means[*band] {
            Some(mean) => figures(mean, 3),
            None => String::new(),
        });
        std::iter::once(instants.text(row.start))
            .chain(means)
            .collect()
    });
    let table = table(&header, 1, rows);
    if every == 1 {
        return table;
    }
    format!("{table}\n one band in {every} is shown; --json has all")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_chance_is_zero() {
        let texts = [None, Some(0.04), Some(2e-7), Some(1e-299), Some(0.0)].map(chance);
        assert_eq!(texts, ["-", "0.0400", "2.0e-7", "1.0e-299", "< 1e-300"]);
    }

    #[test]
    fn what_is_small_in_its_unit_is_no_zero() {
        let texts = [None, Some(0.0), Some(1.5), Some(-5.763_9e-12)].map(number);
        assert_eq!(texts, ["-", "0.0000", "1.5000", "-5.7639e-12"]);
    }
}
