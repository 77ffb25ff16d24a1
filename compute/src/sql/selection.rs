//! Filters of a question in, the steps, rows and columns that they leave out of a product.
//!
//! A filter that speaks of time alone, of latitude (or the area, which goes with it) alone or of longitude alone is
//! worked out at every place of that axis, whatever its form: `date_part('month', time_start) IN (12, 1, 2)` leaves as few
//! steps as a comparison does.

use datafusion::arrow::array::{Array as _, AsArray as _};
use datafusion::catalog::Session;
use datafusion::common::tree_node::TreeNode as _;
use datafusion::common::{DFSchema, Result, exec_err};
use datafusion::logical_expr::Expr;

use super::axes::{Axes, Axis};
use super::columns::Column;

/// What is left, in increasing order.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Selection {
    pub(super) steps: Vec<u32>,
    pub(super) rows: Vec<u32>,
    pub(super) cols: Vec<u32>,
}

/// The axis that a filter speaks of, if it is one alone.
pub(super) fn axis_of(filter: &Expr) -> Option<Axis> {
    let is_asked_elsewhere = filter.exists(|part| {
        Ok(matches!(
            part,
            Expr::ScalarSubquery(_)
                | Expr::InSubquery(_)
                | Expr::Exists(_)
                | Expr::OuterReferenceColumn(..)
                | Expr::Placeholder(_)
        ))
    });
    if is_asked_elsewhere.unwrap_or(true) || filter.is_volatile() {
        return None;
    }
    let columns = filter.column_refs().into_iter();
    let axes = columns.map(|column| Axis::of(Column::named(&column.name)?));
    let axes: Vec<Axis> = axes.collect::<Option<_>>()?;
    let own = *axes.first()?;
    axes.iter().all(|axis| *axis == own).then_some(own)
}

impl Selection {
    /// What all filters leave. The engine simplifies what it handed over before: of `time_start NOT IN ('2000-01-01', NULL)` a part is
    /// `NULL`, which speaks of no axis and holds nowhere, on whichever it is worked out.
    pub(super) fn of(axes: &Axes, filters: &[Expr], state: &dyn Session) -> Result<Self> {
        let along = |axis: Axis| {
            let filters = filters.iter();
            let own = filters.filter(|it| axis_of(it).unwrap_or(Axis::Steps) == axis);
            places(axes, axis, own, state)
        };
        Ok(Self {
            steps: along(Axis::Steps)?,
            rows: along(Axis::Rows)?,
            cols: along(Axis::Cols)?,
        })
    }

    /// Cells of a step.
    pub(super) fn cell_count(&self) -> usize {
        self.rows.len() * self.cols.len()
    }

    /// Rows of the table.
    pub(super) fn row_count(&self) -> usize {
        self.steps.len() * self.cell_count()
    }
}

/// Places of an axis where all filters hold.
fn places<'a>(
    axes: &Axes,
    axis: Axis,
    filters: impl Iterator<Item = &'a Expr>,
    state: &dyn Session,
) -> Result<Vec<u32>> {
    let count = axes.len(axis);
    let mut is_left = vec![true; count];
    let mut batch = None;
    for filter in filters {
        let batch = match &mut batch {
            Some(batch) => batch,
            none => none.insert(axes.batch(axis)?),
        };
        let schema = DFSchema::try_from(batch.schema())?;
        let filter = state.create_physical_expr(filter.clone(), &schema)?;
        let holds = filter.evaluate(batch)?.into_array(count)?;
        let Some(holds) = holds.as_boolean_opt() else {
            return exec_err!("a filter comes to {}", holds.data_type());
        };
        for (place, is_left) in is_left.iter_mut().enumerate() {
            *is_left &= holds.is_valid(place) && holds.value(place);
        }
    }
    Ok((0..count as u32)
        .filter(|place| is_left[*place as usize])
        .collect())
}
