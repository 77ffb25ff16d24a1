//! Whether a computation makes sense, and whether what it makes may be the next version of what is there under its name.

use contract::computed::Computation;
use contract::manifest::Manifest;

use super::job::Job;
use super::make::Maker;
use super::request::Request;
use crate::ComputeError;
use crate::expression::unit::Scaled;
use crate::shared_grid::is_same;

/// Whether an expression can be read, over units that can be, and comes to the unit of its quantity; and whether grids meet.
pub(super) fn check(job: &Job) -> Result<(), ComputeError> {
    let refused = |reason| Err(ComputeError::Expression { reason });
    match Maker::of(job)? {
        Maker::Expression(expression) => {
            let (unit, wanted) = (expression.unit(), job.quantity.unit());
            if Scaled::kept(wanted).map(|scaled| scaled.unit) != Some(unit) {
                return refused(format!(
                    "the expression comes to {unit}, but {} is stored in {wanted}",
                    job.quantity.word()
                ));
            }
            if !is_same(&job.grid, &job.target_grid) {
                return refused("an expression has the grid of its inputs".to_owned());
            }
            Ok(())
        }
        Maker::Regrid {
            regridder,
            min_coverage,
        } => {
            if job.inputs.len() != 1 {
                return refused("one product is brought to another grid at a time".to_owned());
            }
            if !(0.0..=1.0).contains(&min_coverage) {
                return refused(format!("a share of a cell is 0 to 1, not {min_coverage}"));
            }
            job.target_grid.validate()?;
            if !regridder.touches() {
                return refused("the two grids have no place in common".to_owned());
            }
            Ok(())
        }
    }
}

/// What is there under the name must be of the same kind.
///
/// # Errors
/// It was not computed step by step, lies on another grid or holds another unit.
pub(super) fn what_is_there(
    latest: &Manifest,
    request: &Request,
    job: &Job,
) -> Result<(), ComputeError> {
    let refused = |reason| Err(ComputeError::Expression { reason });
    let product = &latest.product;
    if !latest
        .computed
        .as_ref()
        .is_some_and(|it| it.how.is_by_step())
    {
        return refused(format!(
            "{product} is there and was not computed; give another name"
        ));
    }
    // An expression that is made again goes where its inputs went.
    let is_made_again = matches!(job.how, Computation::Expression { .. })
        && Request::of(latest)
            .is_some_and(|made| made.how == request.how && made.inputs == request.inputs);
    if latest.grid != job.target_grid && !is_made_again {
        return refused(format!(
            "{product} is there on another grid; give another name"
        ));
    }
    if latest.quantity.unit() != job.quantity.unit() {
        return refused(format!(
            "{product} is there and holds {}; give another name",
            latest.quantity.word()
        ));
    }
    Ok(())
}
