//! The work itself, on whichever machine: fields of the inputs in, a field of the result stored; fields in, the cells with data
//! stored. No more of a map is held than a few bands of it.

use std::collections::BTreeMap;

use contract::chunk::bands;
use contract::computed::Computation;
use storage::domain::Cells;
use storage::fields::Spooled;
use storage::{Store, domain, fields};

use super::job::{ExtentMade, ExtentTask, FieldMade, FieldTask, Job, METHOD};
use super::read::{Inputs, SlidingRows};
use crate::ComputeError;
use crate::expression::Expression;
use crate::expression::unit::Scaled;
use crate::regrid::Regridder;
use crate::workshop::Workshop;

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
                let input = |(name, unit): &(String, String)| match Scaled::kept(unit) {
                    Some(scaled) => Ok(((name.clone(), scaled.unit), scaled.factor)),
                    None => Err(refused(format!(
                        "{name} is in {unit:?}, which is not understood"
                    ))),
                };
                let inputs = job
                    .inputs
                    .iter()
                    .map(input)
                    .collect::<Result<Vec<_>, _>>()?;
                let (inputs, factors): (Vec<_>, Vec<_>) = inputs.into_iter().unzip();
                let expression = Expression::read(expression, &inputs).map_err(refused)?;
                let result = Scaled::kept(job.quantity.unit());
                let factor = result.map_or(1.0, |result| result.factor);
                Self::Expression(expression.with_factors(factors, factor))
            }
            Computation::Regrid {
                method,
                min_coverage,
            } => Self::Regrid {
                regridder: Regridder::new(&job.grid, &job.target_grid, *method),
                min_coverage: *min_coverage,
            },
            Computation::Correlation { .. } | Computation::Statistic { .. } => {
                let reason = "a statistic is of all steps together: fluxglobe derive statistic";
                return Err(ComputeError::Expression {
                    reason: reason.to_owned(),
                });
            }
        })
    }
}

/// Computes and stores one step.
pub(crate) async fn field(
    workshop: Workshop<'_>,
    job: &Job,
    maker: &Maker,
    task: &FieldTask,
) -> Result<FieldMade, ComputeError> {
    let making = Making::begin(workshop, job, task)?;
    match maker {
        Maker::Expression(expression) => evaluated(workshop, job, (expression, task), making).await,
        Maker::Regrid {
            regridder,
            min_coverage,
        } => regridded(workshop, job, (regridder, *min_coverage, task), making).await,
    }
}

/// Evaluates an expression band by band.
async fn evaluated(
    workshop: Workshop<'_>,
    job: &Job,
    (expression, task): (&Expression, &FieldTask),
    mut making: Making<'_>,
) -> Result<FieldMade, ComputeError> {
    let mut inputs = Inputs::open(workshop, &job.grid, &task.fields).await?;
    while let Some(read) = inputs.next().await? {
        let columns: Vec<&[f32]> = inputs.of.iter().map(|at| read[*at].as_slice()).collect();
        let evaluated = expression
            .evaluate(&columns)
            .map_err(ComputeError::engine("evaluating an expression"))?;
        making.implausible += evaluated.not_finite;
        for (name, count) in evaluated.outside {
            *making.outside.entry(name).or_default() += count;
        }
        let values: Vec<f32> = making.stored(evaluated.values.into_iter());
        making.field.band(&values)?;
    }
    making.finish(workshop.store, task.index).await
}

/// Brings a field to another grid, row by row of the target.
async fn regridded(
    workshop: Workshop<'_>,
    job: &Job,
    (regridder, min_coverage, task): (&Regridder, f64, &FieldTask),
    mut making: Making<'_>,
) -> Result<FieldMade, ComputeError> {
    let [field] = &task.fields[..] else {
        let reason = "a field and no other is brought to another grid";
        return Err(ComputeError::inconsistent("regridding", reason));
    };
    let mut source = SlidingRows::open(workshop, &job.grid, field).await?;
    let first_rows = regridder.first_rows();
    for rows in bands(&job.target_grid, workshop.band_cells) {
        let mut values = Vec::with_capacity(rows.len() * job.target_grid.cols as usize);
        for row in rows {
            let below = first_rows.get(row as usize + 1).copied();
            let mut made = regridder.row(row as usize);
            while let Some(next) = made.next_row() {
                let (rows, found) = source.holding(next, below.unwrap_or(u32::MAX)).await?;
                made.take(rows, found);
            }
            // A hair less than all is all.
            let covered = |(value, coverage)| {
                if coverage < min_coverage - 1e-9 {
                    f64::NAN
                } else {
                    value
                }
            };
            values.extend(making.stored(made.finish().map(covered)));
        }
        making.field.band(&values)?;
    }
    source.read_to_the_end().await?;
    making.finish(workshop.store, task.index).await
}

/// A step of the result that is being written.
struct Making<'a> {
    job: &'a Job,
    field: Spooled,
    implausible: u64,
    outside: BTreeMap<String, u64>,
}

impl<'a> Making<'a> {
    fn begin(workshop: Workshop<'_>, job: &'a Job, task: &FieldTask) -> Result<Self, ComputeError> {
        Ok(Self {
            job,
            field: Spooled::begin(workshop.spool, &job.target_grid, task.period)?,
            implausible: 0,
            outside: BTreeMap::new(),
        })
    }

    /// Values as they are stored: none that the quantity cannot have.
    fn stored(&mut self, values: impl Iterator<Item = f64>) -> Vec<f32> {
        let plausible = self.job.quantity.plausible();
        let stored = |value: f64| {
            if value.is_nan() || plausible.contains(&value) {
                return value as f32;
            }
            self.implausible += 1;
            f32::NAN
        };
        values.map(stored).collect()
    }

    async fn finish(self, store: &Store, index: usize) -> Result<FieldMade, ComputeError> {
        let (field, valid_cells) = self.field.put(store, &self.job.target).await?;
        Ok(FieldMade {
            method: METHOD,
            index,
            field,
            valid_cells,
            implausible: self.implausible,
            outside: self.outside,
        })
    }
}

/// Finds and stores which cells hold data in a run of steps.
pub(crate) async fn run(
    workshop: Workshop<'_>,
    job: &Job,
    task: &ExtentTask,
) -> Result<ExtentMade, ComputeError> {
    let (store, grid) = (workshop.store, &job.target_grid);
    let mut cells = Cells::none(grid.cell_count());
    for key in &task.fields {
        let mut bands = fields::bands(store, key, grid, workshop.band_cells).await?;
        while let Some((rows, values)) = bands.next().await? {
            cells.add_valued(rows.start as usize * grid.cols as usize, &values);
        }
    }
    Ok(ExtentMade {
        first: task.first,
        domain: domain::write_cells(store, &job.target, cells).await?,
    })
}

#[cfg(test)]
mod tests;
