//! `stats('product', 'region', 'month', 'mean,p90')` as a table: the rows of `fluxglobe stats`, exact sums and all, for what a
//! sum over rows of cells would do slower and less exactly.

use std::sync::Arc;

use contract::geometry::AskedGeometry;
use contract::manifest::Manifest;
use contract::region::AskedRegion;
use contract::statistics::{
    Statistic, StatisticNote, Statistics, StatisticsAnswer, StatisticsQuery,
};
use contract::time::TimeStep;
use datafusion::arrow::array::{ArrayRef, Float64Array, RecordBatch, StringArray, UInt32Array};
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use futures::future::BoxFuture;

use super::columns::instant;
use super::named::Named;
use super::place::Place;
use super::worked_out::{Asked, Kind, Question, batch, instants, told_in_each_row};
use crate::reduce::statistics_of;
use crate::{ComputeError, Engine};

pub(super) static KIND: Kind = Kind {
    name: "stats",
    usage: "stats takes texts: 'product', where, and perhaps a step and statistics, such as stats('sst', 'global', 'month', 'mean,p90')",
    more: 0..=2,
    asked,
};

/// Name, signature, what it is, source.
pub(super) const ABOUT: [&str; 4] = [
    "stats",
    "stats('product', 'region'|'LON,LAT'|'LON,LAT;LON,LAT;...', 'step', 'statistics') as a table",
    "the rows of `fluxglobe stats` in the units that people read, which units says of each statistic and unit where they have one, and in notes what may surprise; step native and statistics mean if left out",
    "",
];

fn asked(product: &Named, place: &str, more: &[&str]) -> Asked {
    let place: Place = place.parse()?;
    let usual = StatisticsQuery::new(product.product.clone(), place.into());
    let step = match more.first() {
        Some(step) => step.parse::<TimeStep>()?,
        None => usual.step,
    };
    let statistics = match more.get(1) {
        Some(words) => words.parse::<Statistics>()?,
        None => usual.statistics.clone(),
    };
    Ok(Arc::new(StatisticsQuery {
        step,
        statistics,
        ..usual
    }))
}

impl Question for StatisticsQuery {
    fn schema(&self) -> SchemaRef {
        let mut fields = vec![
            Field::new("time_start", instant(), false),
            Field::new("time_end", instant(), false),
        ];
        let number = |one: Statistic| Field::new(one.to_string(), DataType::Float64, true);
        fields.extend(self.statistics.iter().map(number));
        fields.extend([
            Field::new("coverage_percent", DataType::Float64, false),
            Field::new("step_count", DataType::UInt32, false),
            // A sum is of the unit times an area, a count of 1: which unit that is only the version says, and a plan knows none.
            Field::new("unit", DataType::Utf8, true),
            Field::new("units", DataType::Utf8, false),
            Field::new("notes", DataType::Utf8, true),
        ]);
        Arc::new(Schema::new(fields))
    }

    fn over(&self, region: AskedRegion) -> Arc<dyn Question> {
        let AskedGeometry { geometry, name } = region.into();
        Arc::new(Self {
            geometry,
            geometry_name: name,
            ..self.clone()
        })
    }

    fn rows<'a>(
        &'a self,
        engine: &'a Engine,
        manifest: &'a Manifest,
    ) -> BoxFuture<'a, Result<RecordBatch, ComputeError>> {
        Box::pin(async move {
            let answer = statistics_of(engine, self, manifest, manifest.id()).await?;
            batch(self.schema(), columns(&answer, &self.statistics))
        })
    }
}

fn columns(answer: &StatisticsAnswer, statistics: &Statistics) -> Vec<ArrayRef> {
    let rows = &answer.rows;
    let mut columns = vec![
        instants(rows.iter().map(|row| row.start.ms())),
        instants(rows.iter().map(|row| row.end.ms())),
    ];
    for one in statistics.iter() {
        let name = one.to_string();
        let values = rows
            .iter()
            .map(|row| row.values.get(&name).copied().flatten());
        columns.push(Arc::new(values.collect::<Float64Array>()));
    }
    let coverage = rows.iter().map(|row| row.coverage_percent);
    columns.push(Arc::new(Float64Array::from_iter_values(coverage)));
    let steps = rows.iter().map(|row| row.step_count);
    columns.push(Arc::new(UInt32Array::from_iter_values(steps)));
    let unit = std::iter::repeat_n(shared_unit(answer), rows.len());
    columns.push(Arc::new(unit.collect::<StringArray>()));
    let units = std::iter::repeat_n(units(answer), rows.len());
    columns.push(Arc::new(StringArray::from_iter_values(units)));
    columns.push(told_in_each_row(&answer.notes, rows.len()));
    columns
}

/// The unit that all statistics have; none where they have several.
fn shared_unit(answer: &StatisticsAnswer) -> Option<&str> {
    let mut units = answer.statistics.iter().map(|one| one.unit.as_str());
    let first = units.next()?;
    units.all(|unit| unit == first).then_some(first)
}

/// Each statistic with its unit, such as `mean: °C; std: K`.
fn units(answer: &StatisticsAnswer) -> String {
    let of_one = |one: &StatisticNote| format!("{}: {}", one.name, one.unit);
    let all: Vec<String> = answer.statistics.iter().map(of_one).collect();
    all.join("; ")
}
