//! `budget('product', 'region', 'year')` as a table: the rows of `fluxglobe budget`, carbon that left the sea, in exact sums.

use std::sync::Arc;

use contract::budget::{BudgetAnswer, BudgetQuery, BudgetRow, Completeness};
use contract::manifest::Manifest;
use contract::region::AskedRegion;
use datafusion::arrow::array::{ArrayRef, Float64Array, RecordBatch, StringArray};
use datafusion::arrow::compute::cast;
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use futures::future::BoxFuture;

use super::columns::instant;
use super::named::Named;
use super::worked_out::{Asked, Kind, Question, batch, instants, told_in_each_row};
use crate::budget::budget_of;
use crate::{ComputeError, Engine};

pub(super) static KIND: Kind = Kind {
    name: "budget",
    usage: "budget takes texts: 'product', 'region', and perhaps a step, such as budget('flux', 'global', 'year')",
    more: 0..=1,
    asked,
};

/// Name, signature, what it is, source.
pub(super) const ABOUT: [&str; 4] = [
    "budget",
    "budget('product', 'region', 'step') as a table",
    "the rows of `fluxglobe budget`: carbon that left the sea, Tg and exact kg, how complete sums of accumulated carbon are, and in notes what may surprise, such as periods without a row; step total if left out",
    "",
];

/// Kilograms in steps of 10⁻⁹, as budgets are summed.
const KG: DataType = DataType::Decimal128(38, 9);

fn asked(product: &Named, place: &str, more: &[&str]) -> Asked {
    let region = place.parse::<AskedRegion>()?;
    let usual = BudgetQuery::new(product.product.clone(), region);
    let step = match more.first() {
        Some(step) => step.parse()?,
        None => usual.step,
    };
    Ok(Arc::new(BudgetQuery { step, ..usual }))
}

impl Question for BudgetQuery {
    fn schema(&self) -> SchemaRef {
        let number = |name: &str| Field::new(name, DataType::Float64, false);
        Arc::new(Schema::new(vec![
            Field::new("time_start", instant(), false),
            Field::new("time_end", instant(), false),
            number("budget_tg"),
            Field::new("budget_kg", KG, false),
            number("coverage_percent"),
            number("area_m2"),
            number("ocean_area_m2"),
            number("ocean_with_data_m2"),
            Field::new("gap_tg", DataType::Float64, true),
            number("gap_area_m2"),
            // Of accumulated carbon, of versions that counted it.
            Field::new("complete_m2", DataType::Float64, true),
            Field::new("incomplete_m2", DataType::Float64, true),
            Field::new("notes", DataType::Utf8, true),
        ]))
    }

    fn over(&self, region: AskedRegion) -> Arc<dyn Question> {
        Arc::new(Self {
            region: region.region,
            region_name: region.name,
            ..self.clone()
        })
    }

    fn rows<'a>(
        &'a self,
        engine: &'a Engine,
        manifest: &'a Manifest,
    ) -> BoxFuture<'a, Result<RecordBatch, ComputeError>> {
        Box::pin(async move {
            let answer = budget_of(engine, self, manifest).await?;
            batch(self.schema(), columns(&answer)?)
        })
    }
}

fn columns(answer: &BudgetAnswer) -> Result<Vec<ArrayRef>, ComputeError> {
    let rows = &answer.rows;
    let numbers = |number: fn(&BudgetRow) -> f64| -> ArrayRef {
        Arc::new(Float64Array::from_iter_values(rows.iter().map(number)))
    };
    let of_sums = |area: fn(&Completeness) -> f64| -> ArrayRef {
        let areas = rows.iter().map(|row| row.completeness.as_ref().map(area));
        Arc::new(areas.collect::<Float64Array>())
    };
    let kg = StringArray::from_iter_values(rows.iter().map(|row| &row.budget_kg));
    let failed = ComputeError::engine("telling a budget");
    Ok(vec![
        instants(rows.iter().map(|row| row.start.ms())),
        instants(rows.iter().map(|row| row.end.ms())),
        numbers(|row| row.budget_tg),
        cast(&kg, &KG).map_err(|e| failed(e.into()))?,
        numbers(|row| row.coverage_percent),
        numbers(|row| row.area_m2),
        numbers(|row| row.ocean_area_m2),
        numbers(|row| row.ocean_with_data_m2),
        Arc::new(rows.iter().map(|row| row.gap_tg).collect::<Float64Array>()),
        numbers(|row| row.gap_area_m2),
        of_sums(|own| own.complete_m2),
        of_sums(|own| own.incomplete_m2),
        told_in_each_row(&answer.notes, rows.len()),
    ])
}
