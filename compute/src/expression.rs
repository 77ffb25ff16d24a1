//! Expressions over products: text, and the unit of every name in it, in; values of cells out. Units are checked when it is
//! read, and no data in what it needs is no data.
//!
//! The language is that of SQL's expressions, read and evaluated by DataFusion, without anything that is not arithmetic,
//! with the functions of [`crate::air_sea`] and with `unit(0.17, 'K')` for numbers that have a unit. Numbers are of 64 bits.

pub mod function;
mod rewrite;
mod typed;
pub(crate) mod udf;
pub mod unit;

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::Ordering;
use std::sync::{Arc, LazyLock};

use datafusion::arrow::array::{Array as _, ArrayRef, AsArray as _, Float64Array, RecordBatch};
use datafusion::arrow::datatypes::{DataType, Field, Float64Type, Schema, SchemaRef};
use datafusion::common::{DFSchema, DataFusionError, SchemaError};
use datafusion::execution::FunctionRegistry as _;
use datafusion::execution::session_state::{SessionState, SessionStateBuilder};
use datafusion::logical_expr::{Expr, ScalarUDF};
use datafusion::physical_expr::PhysicalExpr;

use rewrite::Outside;
use typed::Typed;
use unit::Unit;

use crate::depth;

/// Longest text of an expression, bytes.
pub const MAX_BYTES: usize = 8192;
/// Most names in one.
pub const MAX_INPUTS: usize = 64;
/// Cells that are evaluated at a time.
const BLOCK_CELLS: usize = 8192;

/// An expression that can be evaluated.
#[derive(Debug)]
pub struct Expression {
    physical: Arc<dyn PhysicalExpr>,
    schema: SchemaRef,
    /// Of each input, whether a cell without it has no result.
    required: Vec<bool>,
    /// What stored values of each input are multiplied with.
    factors: Vec<f64>,
    /// What results are divided by, to be stored.
    stored_factor: f64,
    unit: Unit,
    outside: Outside,
}

/// Values of cells, and how far they are to be trusted.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Evaluated {
    /// A value a cell, NaN without data.
    pub values: Vec<f64>,
    /// Cells where what came out is no number: a division by zero, the root of something negative.
    pub not_finite: u64,
    /// Calls by function that were outside the range of its paper.
    pub outside: BTreeMap<String, u64>,
}

/// What reads and evaluates: built-in functions, ours, `unit`.
static STATE: LazyLock<SessionState> = LazyLock::new(|| {
    let mut state = SessionStateBuilder::new().with_default_features().build();
    let unit = ScalarUDF::from(udf::UnitFunction::new());
    for function in udf::number_functions().chain([unit]) {
        state
            .register_udf(Arc::new(function))
            .expect("a session takes functions");
    }
    state
});

impl Expression {
    /// Reads an expression over names with units.
    ///
    /// # Errors
    /// Why it cannot be one, in one line for its writer: the text, an unknown name, mixed units.
    pub fn read(text: &str, inputs: &[(String, Unit)]) -> Result<Self, String> {
        if text.len() > MAX_BYTES {
            return Err(format!("it is longer than {MAX_BYTES} bytes"));
        }
        if inputs.len() > MAX_INPUTS {
            return Err(format!("it has more than {MAX_INPUTS} inputs"));
        }
        depth::check(text)?;
        let field = |(name, _unit): &(String, Unit)| Field::new(name, DataType::Float64, true);
        let schema = Arc::new(Schema::new(inputs.iter().map(field).collect::<Vec<_>>()));
        let in_words = |e: DataFusionError| in_words(&e);
        let names = DFSchema::try_from(Arc::clone(&schema)).map_err(in_words)?;
        let parsed = STATE.create_logical_expr(text, &names);
        let parsed = parsed.map_err(|e| {
            let told = unknown_name(&e, text, inputs).or_else(|| word_of_sql(inputs, &names));
            told.unwrap_or_else(|| in_words(e))
        })?;
        let parsed = rewrite::numbers(parsed).map_err(in_words)?;
        let units = inputs.iter().cloned().collect();
        let unit = match typed::typed(&parsed, &units)? {
            Typed::Number(unit) => unit,
            Typed::Zero => Unit::ONE,
            Typed::Truth => {
                return Err(
                    "it is a comparison; CASE WHEN ... THEN 1 ELSE 0 END is a number".into(),
                );
            }
        };
        let required = rewrite::required(&parsed).map_err(in_words)?;
        let mut outside = Outside::new();
        let runnable = rewrite::runnable(parsed, &mut outside).map_err(in_words)?;
        let physical = STATE
            .create_physical_expr(runnable, &names)
            .map_err(in_words)?;
        let is_required = |(name, _unit): &(String, Unit)| required.contains(name);
        Ok(Self {
            required: inputs.iter().map(is_required).collect(),
            factors: vec![1.0; inputs.len()],
            stored_factor: 1.0,
            physical,
            schema,
            unit,
            outside,
        })
    }

    /// The same over inputs whose stored values are multiplied with `factors` to be of their units of SI, and with results that are stored as
    /// `stored_factor`th parts: statistics of products are in the units that people read.
    #[must_use]
    pub fn with_factors(mut self, factors: Vec<f64>, stored_factor: f64) -> Self {
        self.factors = factors;
        self.stored_factor = stored_factor;
        self
    }

    /// Unit of its values.
    pub fn unit(&self) -> Unit {
        self.unit
    }

    /// The functions of ours that it calls.
    pub fn functions(&self) -> impl Iterator<Item = &'static function::Function> + '_ {
        self.outside
            .keys()
            .filter_map(|name| function::Function::named(name))
    }

    /// Evaluates it in every cell: `columns` are the inputs in their order, equally long, NaN without data.
    pub fn evaluate(&self, columns: &[&[f32]]) -> Result<Evaluated, DataFusionError> {
        let cell_count = columns.first().map_or(0, |column| column.len());
        let fits = columns.len() == self.required.len()
            && columns.len() == self.factors.len()
            && columns.iter().all(|column| column.len() == cell_count);
        if !fits {
            let reason = format!(
                "{} columns for {} inputs",
                columns.len(),
                self.required.len()
            );
            return Err(DataFusionError::Execution(reason));
        }
        for counter in self.outside.values() {
            counter.store(0, Ordering::Relaxed);
        }
        let mut values = vec![f64::NAN; cell_count];
        let mut not_finite = 0;
        let mut cells = Vec::with_capacity(BLOCK_CELLS);
        for start in (0..cell_count).step_by(BLOCK_CELLS) {
            cells.clear();
            let block = start..(start + BLOCK_CELLS).min(cell_count);
            cells.extend(block.filter(|&cell| self.has_data(columns, cell)));
            if cells.is_empty() {
                continue;
            }
            let results = self.of_cells(columns, &cells)?;
            for (row, &cell) in cells.iter().enumerate() {
                if results.is_null(row) {
                    continue;
                }
                let value = results.value(row) / self.stored_factor;
                if value.is_finite() {
                    values[cell] = value;
                } else {
                    not_finite += 1;
                }
            }
        }
        let counted = |(name, count): (&&str, &Arc<_>)| {
            let count = std::sync::atomic::AtomicU64::load(count, Ordering::Relaxed);
            ((*name).to_owned(), count)
        };
        let outside = self.outside.iter().map(counted);
        Ok(Evaluated {
            values,
            not_finite,
            outside: outside.filter(|(_, count)| *count > 0).collect(),
        })
    }

    fn has_data(&self, columns: &[&[f32]], cell: usize) -> bool {
        let mut inputs = columns.iter().zip(&self.required);
        inputs.all(|(column, is_required)| !is_required || !column[cell].is_nan())
    }

    fn of_cells(
        &self,
        columns: &[&[f32]],
        cells: &[usize],
    ) -> Result<Float64Array, DataFusionError> {
        let column = |(values, factor): (&&[f32], &f64)| -> ArrayRef {
            let value = |&cell: &usize| {
                let value = f64::from(values[cell]) * factor;
                Some(value).filter(|it| !it.is_nan())
            };
            Arc::new(cells.iter().map(value).collect::<Float64Array>())
        };
        let arrays = columns.iter().zip(&self.factors).map(column).collect();
        let batch = RecordBatch::try_new(Arc::clone(&self.schema), arrays)?;
        let results = self.physical.evaluate(&batch)?.into_array(cells.len())?;
        match results.as_primitive_opt::<Float64Type>() {
            Some(results) => Ok(results.clone()),
            None => Err(DataFusionError::Execution(format!(
                "the expression comes to {}, not to numbers",
                results.data_type()
            ))),
        }
    }
}

/// Of the names of its inputs, those whose values an expression computes with, and does not only compare; all of one that cannot be read.
pub(crate) fn computed_with(text: &str, names: &[&str]) -> BTreeSet<String> {
    let field = |name: &&str| Field::new(*name, DataType::Float64, true);
    let schema = Schema::new(names.iter().map(field).collect::<Vec<_>>());
    let found = DFSchema::try_from(Arc::new(schema))
        .and_then(|schema| STATE.create_logical_expr(text, &schema))
        .and_then(|parsed| rewrite::computed_with(&parsed));
    found.unwrap_or_else(|_unread| names.iter().map(|name| (*name).to_owned()).collect())
}

/// What is wrong with a name that is no input, if that is what is wrong.
fn unknown_name(error: &DataFusionError, text: &str, inputs: &[(String, Unit)]) -> Option<String> {
    let DataFusionError::SchemaError(schema, _trace) = error.find_root() else {
        return None;
    };
    let SchemaError::FieldNotFound { field, .. } = &**schema else {
        return None;
    };
    let names: Vec<&str> = inputs.iter().map(|(name, _unit)| name.as_str()).collect();
    let there = match names.as_slice() {
        [] => "there are none".to_owned(),
        names => format!("inputs are {}", names.join(", ")),
    };
    let form = if is_last_argument(&field.name, text) && text.contains("unit") {
        "; a unit stands in single quotes, as in unit(0.17, 'K')"
    } else {
        ""
    };
    Some(format!("{:?} is not an input; {there}{form}", field.name))
}

/// What is wrong with an input that is called as a word of SQL (`any`), if one is.
fn word_of_sql(inputs: &[(String, Unit)], names: &DFSchema) -> Option<String> {
    let read = |text: &str| STATE.create_logical_expr(text, names);
    // Some are words behind an operator alone (`2 * any`).
    let is_column = |name: &str| {
        matches!(read(name), Ok(Expr::Column(_))) && read(&format!("1 * {name}")).is_ok()
    };
    let is_word = |name: &str| name.bytes().all(|b| b.is_ascii_alphanumeric() || b == b'_');
    let mut names = inputs.iter().map(|(name, _unit)| name.as_str());
    let name = names.find(|name| is_word(name) && !is_column(name))?;
    Some(format!(
        "the input {name} is called as a word of SQL is; call it otherwise, or write it in quotation marks, \"{name}\""
    ))
}

/// Is a name written as the last of several arguments, as the unit of `unit(0.17, K)` and `unit(0.17, "K")` is?
fn is_last_argument(name: &str, text: &str) -> bool {
    let plain = |text: &str| -> String {
        let kept = text.chars().filter(|c| !c.is_whitespace() && *c != '"');
        kept.flat_map(char::to_lowercase).collect()
    };
    plain(text).contains(&format!(",{})", plain(name)))
}

/// What the engine says, in one line.
fn in_words(error: &DataFusionError) -> String {
    let text = match error.find_root() {
        DataFusionError::SQL(error, _trace) => {
            let reason = error.to_string().replace("sql parser error: ", "");
            format!("the expression cannot be read: {reason}")
        }
        _ => error.strip_backtrace(),
    };
    text.lines().next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests;
