//! `analysis('product', 'region', 'trend')` as a table: climatology, anomaly or trend of a series, as `fluxglobe stats` and the page
//! of a product tell them.

use std::sync::Arc;

use contract::ContractError;
use contract::analysis::{
    AnalysisOptions, AnalysisPart, AnalysisWishes, Anomalies, Climatology, ClimatologyRow,
    SeriesAnalysis, SeriesQuery, SeriesWishes, Trend,
};
use contract::manifest::Manifest;
use contract::region::AskedRegion;
use datafusion::arrow::array::{
    ArrayRef, BooleanArray, Float64Array, RecordBatch, StringArray, UInt64Array,
};
use datafusion::arrow::datatypes::{DataType, Field, Schema, SchemaRef};
use futures::future::BoxFuture;

use super::columns::instant;
use super::named::Named;
use super::place::Place;
use super::worked_out::{Asked, Kind, Question, batch, instants, told_in_each_row};
use crate::analysis::analyse;
use crate::{ComputeError, Engine};

pub(super) static KIND: Kind = Kind {
    name: "analysis",
    usage: "analysis takes texts: 'product', 'region', 'LON,LAT' or 'LON,LAT;LON,LAT;...', one of climatology, anomaly and trend, and perhaps bins of the year or, of a trend, a step, such as analysis('sst', 'global', 'climatology', 'season')",
    more: 1..=2,
    asked,
};

/// Name, signature, what it is, source.
pub(super) const ABOUT: [&str; 4] = [
    "analysis",
    "analysis('product', 'region'|'LON,LAT'|'LON,LAT;LON,LAT;...', 'climatology'|'anomaly'|'trend', 'bins'|'step') as a table",
    "what is made of the series of a place, region or line, in the unit that people read, and in notes what may surprise: steps that cover little of a region, steps without data; bins or step month if left out",
    "",
];

/// What is made of which series.
#[derive(Debug, Clone)]
struct Analysis {
    of: SeriesQuery,
    made: Made,
    options: AnalysisOptions,
}

/// What a table tells.
#[derive(Debug, Clone, Copy)]
enum Made {
    Climatology,
    Anomaly,
    Trend,
}

impl Made {
    fn of(word: &str) -> Result<(Self, AnalysisPart), ContractError> {
        match word.parse()? {
            part @ AnalysisPart::Climatology => Ok((Self::Climatology, part)),
            part @ AnalysisPart::Anomaly => Ok((Self::Anomaly, part)),
            part @ AnalysisPart::Trend => Ok((Self::Trend, part)),
            AnalysisPart::Season | AnalysisPart::Extremes => {
                let reason = "a table is made of climatology, anomaly or trend; of the others ask `fluxglobe stats`";
                Err(ContractError::invalid("analysis", word, reason))
            }
        }
    }
}

fn asked(product: &Named, place: &str, more: &[&str]) -> Asked {
    let (made, part) = Made::of(more.first().copied().unwrap_or_default())?;
    let mut wishes = AnalysisWishes {
        parts: vec![part],
        ..AnalysisWishes::default()
    };
    match (made, more.get(1)) {
        (_, None) => {}
        (Made::Trend, Some(step)) => wishes.trend_step = Some(step.parse()?),
        (_, Some(bins)) => wishes.bins = Some(bins.parse()?),
    }
    let mut of = SeriesWishes::default();
    match place.parse()? {
        Place::Point(place) => of.place = Some(place),
        Place::Line(line) => of.line = Some(line),
        Place::Region(region) => of.region = Some(region),
    }
    let of = of.query(product.product.clone())?;
    let none = || ContractError::invalid("place", place, "give a region, a place or a line");
    Ok(Arc::new(Analysis {
        of: of.ok_or_else(none)?,
        made,
        options: wishes.options()?,
    }))
}

impl Question for Analysis {
    fn schema(&self) -> SchemaRef {
        let number = |name: &str| Field::new(name, DataType::Float64, true);
        let count = |name: &str| Field::new(name, DataType::UInt64, false);
        let unit = Field::new("unit", DataType::Utf8, false);
        let mut fields = match self.made {
            Made::Climatology => vec![
                Field::new("bin", DataType::Utf8, false),
                number("mean"),
                number("spread"),
                count("count"),
                count("years"),
                unit,
            ],
            Made::Anomaly => vec![
                Field::new("time_start", instant(), false),
                Field::new("time_end", instant(), false),
                number("value"),
                number("normal"),
                number("anomaly"),
                number("standardised"),
                unit,
            ],
            Made::Trend => vec![
                number("slope_per_decade"),
                number("lower_per_decade"),
                number("upper_per_decade"),
                number("p_value"),
                number("tau"),
                number("least_squares_per_decade"),
                number("least_squares_standard_error"),
                number("least_squares_p_value"),
                number("years"),
                count("count"),
                Field::new("deseasonalised", DataType::Boolean, false),
                unit,
            ],
        };
        fields.push(Field::new("notes", DataType::Utf8, true));
        Arc::new(Schema::new(fields))
    }

    fn over(&self, region: AskedRegion) -> Arc<dyn Question> {
        let mut over = self.clone();
        if let SeriesQuery::Region(own) = &mut over.of {
            own.region = region.region;
            own.region_name = region.name;
        }
        Arc::new(over)
    }

    fn rows<'a>(
        &'a self,
        engine: &'a Engine,
        manifest: &'a Manifest,
    ) -> BoxFuture<'a, Result<RecordBatch, ComputeError>> {
        Box::pin(async move {
            let id = manifest.id();
            let answer = analyse(engine, (manifest, &id), &self.of, &self.options).await?;
            batch(self.schema(), self.columns(answer)?)
        })
    }
}

impl Analysis {
    fn columns(&self, answer: SeriesAnalysis) -> Result<Vec<ArrayRef>, ComputeError> {
        let SeriesAnalysis {
            cited,
            notes,
            refused,
            climatology: by_bin,
            anomaly: by_step,
            trend: line,
            ..
        } = answer;
        let columns = match self.made {
            Made::Climatology => by_bin.map(|made| climatology(&made, &cited.unit)),
            Made::Anomaly => by_step.map(|made| anomaly(&made, &cited.unit)),
            Made::Trend => line.map(|made| trend(&made)),
        };
        // Such as steps that cover little of a region, or none.
        let with_notes = |mut columns: Vec<ArrayRef>| {
            let count = columns.first().map_or(0, |column| column.len());
            columns.push(told_in_each_row(&notes, count));
            columns
        };
        // What is not defined is no empty table.
        columns.map(with_notes).ok_or_else(|| {
            let reason = refused.into_iter().next().map(|one| one.reason);
            let what = self.options.parts[0].as_str();
            let reason = reason.unwrap_or_else(|| "nothing was made".to_owned());
            ContractError::invalid("analysis", what, reason).into()
        })
    }
}

fn climatology(made: &Climatology, unit: &str) -> Vec<ArrayRef> {
    let rows = &made.rows;
    let counts = |count: fn(&ClimatologyRow) -> u64| -> ArrayRef {
        Arc::new(UInt64Array::from_iter_values(rows.iter().map(count)))
    };
    vec![
        Arc::new(StringArray::from_iter_values(
            rows.iter().map(|row| &row.bin),
        )),
        numbers(rows.iter().map(|row| row.mean)),
        numbers(rows.iter().map(|row| row.spread)),
        counts(|row| row.count),
        counts(|row| row.years),
        texts(unit, rows.len()),
    ]
}

fn anomaly(made: &Anomalies, unit: &str) -> Vec<ArrayRef> {
    let rows = &made.rows;
    vec![
        instants(rows.iter().map(|row| row.start.ms())),
        instants(rows.iter().map(|row| row.end.ms())),
        numbers(rows.iter().map(|row| row.value)),
        numbers(rows.iter().map(|row| row.normal)),
        numbers(rows.iter().map(|row| row.anomaly)),
        numbers(rows.iter().map(|row| row.standardised)),
        texts(unit, rows.len()),
    ]
}

/// One row.
fn trend(made: &Trend) -> Vec<ArrayRef> {
    let one = |value: Option<f64>| numbers(std::iter::once(value));
    let (robust, test, squares) = (&made.theil_sen, &made.mann_kendall, &made.least_squares);
    vec![
        one(Some(robust.slope_per_decade)),
        one(Some(robust.lower_per_decade)),
        one(Some(robust.upper_per_decade)),
        one(Some(test.p_value)),
        one(Some(test.tau)),
        one(Some(squares.slope_per_decade)),
        one(squares.standard_error_per_decade),
        one(squares.p_value),
        one(Some(made.years)),
        Arc::new(UInt64Array::from(vec![made.count])),
        Arc::new(BooleanArray::from(vec![made.deseasonalised])),
        texts(&made.slope_unit, 1),
    ]
}

fn numbers(values: impl Iterator<Item = Option<f64>>) -> ArrayRef {
    Arc::new(values.collect::<Float64Array>())
}

fn texts(text: &str, count: usize) -> ArrayRef {
    Arc::new(StringArray::from_iter_values(std::iter::repeat_n(
        text, count,
    )))
}
