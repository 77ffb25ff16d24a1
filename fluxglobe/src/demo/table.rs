//! Tables of the demo: comparisons in, text out.

use anyhow::Result;
use comfy_table::presets::NOTHING;
use comfy_table::{CellAlignment, Table};
use compute::Engine;
use contract::budget::BudgetQuery;
use contract::check::{AgainstPaper, Check, Stated};
use contract::manifest::Manifest;
use contract::time::TimeStep;

use crate::instants;

/// What the paper says, what an independent integration of its grid says, what we say.
pub(crate) fn against_published(comparison: &Check) -> String {
    let mut table = table(&[
        "air-sea carbon, positive out of the sea",
        "period",
        "paper",
        "independent",
        "Fluxglobe",
        "unit",
        "Fluxglobe against the paper",
    ]);
    for row in &comparison.rows {
        let decimals = if row.unit.starts_with("Pg") { 3 } else { 1 };
        let mut verdict = row.paper.map_or(String::new(), |paper| judged(&paper));
        if !row.agrees {
            let off = format!("OFF the independent value by {:+.6}", row.difference);
            verdict = [verdict, off].join("; ");
        }
        table.add_row([
            row.what.clone(),
            row.period.clone(),
            row.paper
                .map_or(String::new(), |paper| stated(&paper.stated)),
            format!("{:.decimals$}", row.independent),
            format!("{:.decimals$}", row.ours),
            row.unit.clone(),
            verdict,
        ]);
    }
    format!("{table}\nPaper: {}\n{}", comparison.note, comparison.method)
}

/// A value with the decimals and the uncertainty that it is printed with.
fn stated(stated: &Stated) -> String {
    let value = format!("{:.*}", stated.decimals, stated.value);
    match stated.uncertainty {
        Some(uncertainty) => format!("{value} ± {uncertainty}"),
        None => value,
    }
}

fn judged(paper: &AgainstPaper) -> String {
    let (verdict, difference) = (paper.verdict.as_str(), paper.difference);
    match paper.stated.uncertainty {
        Some(uncertainty) => format!("{verdict} ± {uncertainty} (by {difference:+.3})"),
        None => format!("{verdict}; differs by {difference:+.3}"),
    }
}

/// Monthly budgets of a synthetic product: nothing is published about it.
pub(crate) async fn synthetic(engine: &Engine, flux: &Manifest) -> Result<String> {
    let query = BudgetQuery {
        step: TimeStep::Month,
        ..BudgetQuery::new(flux.product.clone(), "global".parse()?)
    };
    let answer = compute::budget::budget_of(engine, &query, flux).await?;
    let mut table = table(&[
        "SYNTHETIC: air-sea carbon of a generated sea",
        "to",
        "Tg C",
        "% of sea",
    ]);
    for row in &answer.rows {
        let numbers = [
            format!("{:.3}", row.budget_tg),
            format!("{:.1}", row.coverage_percent),
        ];
        let [budget, coverage] = numbers;
        table.add_row([
            instants::shown(row.start),
            instants::shown(row.end),
            budget,
            coverage,
        ]);
    }
    Ok(table.trim_fmt())
}

fn table(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_preset(NOTHING);
    table.set_header(header.iter().copied());
    for column in 2..5 {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::check::{CheckRow, Verdict};

    #[test]
    fn a_difference_without_a_stated_uncertainty_is_shown_and_not_judged() {
        let row = |what: &str, paper: Option<AgainstPaper>, agrees| CheckRow {
            what: what.to_owned(),
            period: "2000".to_owned(),
            unit: "Pg C".to_owned(),
            paper,
            independent: -1.404_272,
            ours: -1.404_271,
            difference: 1e-6,
            agrees,
        };
        let paper = |uncertainty: Option<f64>, verdict| {
            Some(AgainstPaper {
                stated: Stated {
                    value: -1.4,
                    decimals: 1,
                    uncertainty,
                },
                difference: -0.004_271,
                verdict,
            })
        };
        let rows = vec![
            row("whole", paper(Some(0.7), Verdict::Within), true),
            row("band", paper(None, Verdict::NoUncertaintyStated), true),
            row("month", None, false),
        ];
        let (note, method) = ("The paper.".to_owned(), "The script.".to_owned());
        let comparison = Check { rows, note, method };
        let text = against_published(&comparison);
        let line = |what: &str| text.lines().find(|line| line.contains(what)).unwrap();
        assert!(line("whole").contains("-1.4 ± 0.7") && line("whole").contains("within ± 0.7"));
        let band = line("band");
        assert!(band.contains("no uncertainty stated; differs by -0.004"));
        assert!(!band.contains("within") && !band.contains('±'), "{band}");
        assert!(line("month").contains("OFF the independent value by +0.000001"));
        assert!(text.contains("The paper.") && text.contains("The script."));
    }
}
