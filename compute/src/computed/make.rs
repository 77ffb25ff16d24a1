//! The work itself, on whichever machine: fields of the inputs in, a field of the result stored; fields in, the cells with data stored.

use contract::computed::Computation;
use storage::{Store, domain, fields};

use super::job::{ExtentMade, ExtentTask, FieldMade, FieldTask, Job};
use crate::ComputeError;
use crate::expression::unit::Unit;
use crate::expression::{Evaluated, Expression};
use crate::regrid::Regridder;

/// What turns fields into a field, one at a time: it counts as it goes.
#[derive(Debug)]
pub(crate) enum Maker {
    Expression(Expression),
    Regrid {
        regridder: Regridder,
        min_coverage: f64,
    },
}

impl Maker {
    /// That of a job.
    pub(crate) fn of(job: &Job) -> Result<Self, ComputeError> {
        Ok(match &job.how {
            Computation::Expression { expression } => {
                let refused = |reason| ComputeError::Expression { reason };
                let input = |(name, unit): &(String, String)| match Unit::stored(unit) {
                    Some(unit) => Ok((name.clone(), unit)),
                    None => Err(refused(format!(
                        "{name} is in {unit:?}, which is not understood"
                    ))),
                };
                let inputs = job
                    .inputs
                    .iter()
                    .map(input)
                    .collect::<Result<Vec<_>, _>>()?;
                let expression = Expression::read(expression, &inputs).map_err(refused)?;
                Self::Expression(expression)
            }
            Computation::Regrid {
                method,
                min_coverage,
            } => Self::Regrid {
                regridder: Regridder::new(&job.grid, &job.target_grid, *method),
                min_coverage: *min_coverage,
            },
        })
    }

    fn make(&self, columns: &[&[f32]]) -> Result<Evaluated, ComputeError> {
        match self {
            Self::Expression(expression) => expression
                .evaluate(columns)
                .map_err(ComputeError::engine("evaluating an expression")),
            Self::Regrid {
                regridder,
                min_coverage,
            } => {
                let values = columns.first().and_then(|values| regridder.apply(values));
                let mut out = values.ok_or_else(|| {
                    ComputeError::inconsistent("regridding", "a field does not fill its grid")
                })?;
                for (value, coverage) in out.values.iter_mut().zip(&out.coverage) {
                    // A hair less than all is all.
                    if *coverage < min_coverage - 1e-9 {
                        *value = f64::NAN;
                    }
                }
                Ok(Evaluated {
                    values: out.values,
                    ..Evaluated::default()
                })
            }
        }
    }
}

/// Computes and stores one step.
pub(crate) async fn field(
    store: &Store,
    job: &Job,
    maker: &Maker,
    task: &FieldTask,
) -> Result<FieldMade, ComputeError> {
    let mut read: Vec<Vec<f32>> = vec![];
    for (at, key) in task.fields.iter().enumerate() {
        // The same field under two names is read once.
        match task.fields[..at].iter().position(|before| before == key) {
            Some(before) => read.push(read[before].clone()),
            None => read.push(fields::read(store, key, &job.grid).await?),
        }
    }
    let columns: Vec<&[f32]> = read.iter().map(Vec::as_slice).collect();
    let evaluated = maker.make(&columns)?;
    let plausible = job.quantity.plausible();
    let mut implausible = evaluated.not_finite;
    let stored = |value: f64| {
        if value.is_nan() || plausible.contains(&value) {
            return value as f32;
        }
        implausible += 1;
        f32::NAN
    };
    let values: Vec<f32> = evaluated.values.into_iter().map(stored).collect();
    let grid = &job.target_grid;
    Ok(FieldMade {
        index: task.index,
        field: fields::write(store, &job.target, grid, &values, task.period).await?,
        valid_cells: values.iter().filter(|value| !value.is_nan()).count() as u64,
        implausible,
        outside: evaluated.outside,
    })
}

/// Finds and stores which cells hold data in a run of steps.
pub(crate) async fn run(
    store: &Store,
    job: &Job,
    task: &ExtentTask,
) -> Result<ExtentMade, ComputeError> {
    let grid = &job.target_grid;
    let mut cells = vec![false; grid.cell_count()];
    for key in &task.fields {
        let values = fields::read(store, key, grid).await?;
        for (cell, value) in cells.iter_mut().zip(&values) {
            *cell |= !value.is_nan();
        }
    }
    Ok(ExtentMade {
        first: task.first,
        domain: domain::write(store, &job.target, &cells).await?,
    })
}
