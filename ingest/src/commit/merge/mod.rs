//! Steps of a manifest and new files in, the steps of the next manifest out; pure.

use std::collections::BTreeMap;

use contract::event::RejectReason;
use contract::grid::Grid;
use contract::index::DimensionIndex;
use contract::manifest::{Manifest, Step};
use contract::notice::NoticeOrder;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};

use super::claim::{Claim, is_later_or_same};
use crate::error::Rejection;
use crate::plan::cf::snapped::evened;
use crate::put::StoredGranule;

/// Grids whose edges differ by less than this, in cells, are one grid.
const SAME_GRID_CELLS: f64 = 1e-4;
/// The same of what axes of single precision may differ by, as far as such axes are read.
const SAME_ROUNDED_CELLS: f64 = 0.02;
/// Edges that differ by less than this, in cells, do so by the noise of double precision.
const NOISE_CELLS: f64 = 1e-8;

/// The steps of the next manifest and what became of each file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Merged {
    /// In the order of time, not overlapping.
    pub(super) steps: Vec<Step>,
    /// Of each step the place of its file in the order of notices.
    pub(super) orders: Vec<Option<NoticeOrder>>,
    /// One for each file.
    pub(super) changes: Vec<Change>,
    /// Index of the last file that was taken.
    pub(super) last_taken: Option<usize>,
    /// What the values of all steps are; none without any.
    pub(super) quantity: Option<Quantity>,
}

/// What became of one file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Change {
    Taken {
        revised: bool,
        /// What it brought or had brought before; not those that a file of a later notice has.
        periods: Vec<Period>,
    },
    /// All of it was there.
    Same,
    /// Files of later notices have its time, or all of it that was not there.
    Superseded,
    Refused(Rejection),
}

impl Merged {
    pub(super) fn is_changed(&self) -> bool {
        self.last_taken.is_some()
    }
}

/// How many files from the first on have no period in common.
pub(super) fn disjoint_prefix(granules: &[StoredGranule]) -> usize {
    let mut taken = Taken::default();
    for (index, granule) in granules.iter().enumerate() {
        let own = || granule.reading.steps.iter().map(|step| step.period);
        if own().any(|period| taken.overlaps(period)) {
            return index;
        }
        own().for_each(|period| taken.insert(period));
    }
    granules.len()
}

/// Periods that do not overlap, by their starts: only the last that begins before the end of another can overlap it.
#[derive(Default)]
pub(super) struct Taken(BTreeMap<TimeMs, Period>);

impl Taken {
    pub(super) fn overlaps(&self, period: Period) -> bool {
        let last = self.0.range(..period.end).next_back();
        last.is_some_and(|(_, other)| other.overlaps(period))
    }

    pub(super) fn insert(&mut self, period: Period) {
        self.0.insert(period.start, period);
    }
}

/// Adds files to the newest manifest, in their order.
pub(super) fn merge(
    newest: Option<&Manifest>,
    granules: &[StoredGranule],
    claims: &[Claim],
) -> Merged {
    let steps = newest.map_or_else(Vec::new, |m| m.steps.clone());
    let mut orders = newest.map_or_else(Vec::new, Manifest::notice_orders);
    if let Some(newest) = newest {
        for claim in claims {
            claim.apply(newest, &mut orders);
        }
    }
    let mut placed: Vec<Placed> = steps.into_iter().zip(orders).collect();
    let mut merged = Merged {
        steps: vec![],
        orders: vec![],
        changes: Vec::with_capacity(granules.len()),
        last_taken: None,
        quantity: newest.map(|m| m.quantity),
    };
    for (index, granule) in granules.iter().enumerate() {
        let base = newest
            .map(|m| (m.grid, m.synthetic, &m.indexes))
            .or_else(|| {
                let first = &granules.get(merged.last_taken?)?.reading;
                Some((first.grid, first.synthetic, &first.recipe.indexes))
            });
        let base = base.zip(merged.quantity);
        let fits = base.map_or(Ok(granule.reading.quantity), |base| {
            let ((grid, synthetic, indexes), quantity) = base;
            check_indexes(granule, indexes)?;
            check_fits(granule, ((grid, synthetic), quantity))
        });
        let (change, quantity) = match fits {
            Ok(quantity) => {
                let change = add(&mut placed, granule);
                (
                    told_anew(change, granule, merged.quantity, quantity),
                    Some(quantity),
                )
            }
            Err(rejection) => (Change::Refused(rejection), None),
        };
        if let Change::Taken { .. } = &change {
            merged.last_taken = Some(index);
            merged.quantity = quantity;
        }
        merged.changes.push(change);
    }
    (merged.steps, merged.orders) = placed.into_iter().unzip();
    merged
}

/// A file whose values are there and that says what codes mean where the product says nothing, since programs of before left that out, is
/// taken for it. Where it says something, files that say otherwise would take turns for ever.
fn told_anew(
    change: Change,
    granule: &StoredGranule,
    before: Option<Quantity>,
    after: Quantity,
) -> Change {
    let is_told = before.is_some_and(|it| it.flags().is_empty()) && !after.flags().is_empty();
    if change != Change::Same || !is_told {
        return change;
    }
    let steps = granule.reading.steps.iter();
    Change::Taken {
        revised: true,
        periods: steps.map(|step| step.period).collect(),
    }
}

fn conflict(detail: String) -> Rejection {
    Rejection::new(RejectReason::Conflict, "product", detail)
}

/// Refuses a file that is read at another index of its further dimensions than those of the product: another depth is another map.
fn check_indexes(granule: &StoredGranule, there: &[DimensionIndex]) -> Result<(), Rejection> {
    let StoredGranule {
        product, reading, ..
    } = granule;
    let own = reading.recipe.indexes.as_slice();
    if own == there {
        return Ok(());
    }
    let words = |indexes: &[DimensionIndex]| match indexes {
        [] => " without --index".to_owned(),
        some => format!(" with{}", DimensionIndex::words(some)),
    };
    Err(conflict(format!(
        "{product} is of files that were read{}, this one is read{}; land it in a product of its own (--product)",
        words(there),
        words(own)
    )))
}

/// What the product holds with the file, which is of its grid and quantity.
fn check_fits(
    granule: &StoredGranule,
    ((grid, synthetic), quantity): ((Grid, bool), Quantity),
) -> Result<Quantity, Rejection> {
    let StoredGranule {
        product, reading, ..
    } = granule;
    let advice = "land it in a product of its own";
    if !is_same_grid(&reading.grid, &grid) {
        let shape = |g: &Grid| {
            format!(
                "{} x {} cells from {} N {} E",
                g.rows, g.cols, g.north_deg, g.west_deg
            )
        };
        return Err(conflict(format!(
            "{product} has {}, the file {}; {advice}",
            shape(&grid),
            shape(&reading.grid)
        )));
    }
    let Some(joined) = quantity.joined(reading.quantity) else {
        return Err(conflict(format!(
            "{product} holds {}, the file {}; {}",
            of_unit(quantity),
            of_unit(reading.quantity),
            if (quantity, reading.quantity) == (Quantity::Pco2, Quantity::Fco2) {
                "if its files did so too when the two were not told apart, recompute it (fluxglobe recompute --product), else land this one in a product of its own"
            } else {
                advice
            }
        )));
    };
    if reading.synthetic != synthetic {
        let word = |synthetic| if synthetic { "synthetic" } else { "measured" };
        return Err(conflict(format!(
            "{product} is {}, the file {}; {advice}",
            word(synthetic),
            word(reading.synthetic)
        )));
    }
    Ok(joined)
}

fn of_unit(quantity: Quantity) -> String {
    match quantity {
        Quantity::Open(_) => format!("{} ({})", quantity.title(), quantity.unit()),
        known => known.title().to_owned(),
    }
}

/// Are they one grid, but for the last digits of axes that two files have, or that were rounded when one of them was read, or for the round
/// places that steps and edges were moved to then?
pub(crate) fn is_same_grid(a: &Grid, b: &Grid) -> bool {
    is_almost(a, b) || is_almost(&evened(a), b) || is_almost(a, &evened(b))
}

fn is_almost(a: &Grid, b: &Grid) -> bool {
    is_near(a, b, |edge_deg, cell_deg| {
        let rounding_deg = 2.0 * f64::from(f32::EPSILON) * edge_deg.abs();
        let rounding_deg = rounding_deg.min(SAME_ROUNDED_CELLS * cell_deg);
        rounding_deg.max(SAME_GRID_CELLS * cell_deg)
    })
}

/// Do their cells lie in the same places?
pub(crate) fn is_equal_grid(a: &Grid, b: &Grid) -> bool {
    is_near(a, b, |_edge_deg, cell_deg| NOISE_CELLS * cell_deg)
}

/// `slack_deg`: how far an edge that lies there, of cells so wide, may be off.
fn is_near(a: &Grid, b: &Grid, slack_deg: impl Fn(f64, f64) -> f64) -> bool {
    let near = |x: f64, y: f64, cell: f64| (x - y).abs() < slack_deg(x, cell);
    (a.rows, a.cols) == (b.rows, b.cols)
        && near(a.north_deg, b.north_deg, a.dlat_deg)
        && near(a.south_deg(), b.south_deg(), a.dlat_deg)
        && near(a.west_deg, b.west_deg, a.dlon_deg)
        && near(a.east_deg(), b.east_deg(), a.dlon_deg)
}

/// A step with the place of its file in the order of notices.
pub(super) type Placed = (Step, Option<NoticeOrder>);

/// What is to be done with one step of a file.
enum Act {
    Insert,
    Replace(usize),
    /// It is there, maybe by an earlier notice of the same file.
    Keep(usize),
    /// A file of a later notice has its period.
    Leave,
}

/// Adds the steps of one file that no file of a later notice has the time of; all or none.
fn add(placed: &mut Vec<Placed>, granule: &StoredGranule) -> Change {
    let (steps, order) = (&granule.reading.steps, granule.notice.place);
    let mut acts = Vec::with_capacity(steps.len());
    for step in steps {
        match act(placed, step, order) {
            Ok(act) => acts.push(act),
            Err(there) => {
                let (product, period) = (&granule.product, step.period);
                return Change::Refused(conflict(format!(
                    "{product} has a step for {there}, which overlaps {period} of the file; land it in a product of its own"
                )));
            }
        }
    }
    let is_left = acts.iter().any(|act| matches!(act, Act::Leave));
    let is_changed = |act: &Act| matches!(act, Act::Insert | Act::Replace(_));
    if !acts.iter().any(is_changed) {
        return if is_left {
            Change::Superseded
        } else {
            Change::Same
        };
    }
    let (mut periods, mut revised) = (vec![], false);
    for (step, act) in steps.iter().zip(acts) {
        let new = || (step.clone(), Some(order));
        match act {
            Act::Insert => placed.push(new()),
            Act::Replace(index) => {
                placed[index] = new();
                revised = true;
            }
            Act::Keep(index) => placed[index].1 = placed[index].1.max(Some(order)),
            Act::Leave => continue,
        }
        periods.push(step.period);
    }
    // Two runs in order, which this sort merges in one pass.
    placed.sort_by_key(|(step, _)| step.period);
    Change::Taken { revised, periods }
}

/// What is to be done with a step; the period in the way if it overlaps others than its own.
fn act(placed: &[Placed], new: &Step, order: NoticeOrder) -> Result<Act, Period> {
    // Steps do not overlap, so those that overlap the new one lie together.
    let first = placed.partition_point(|(s, _)| s.period.end <= new.period.start);
    let mut overlapping = placed[first..]
        .iter()
        .take_while(|(s, _)| s.period.start < new.period.end);
    let Some((there, there_order)) = overlapping.next() else {
        return Ok(Act::Insert);
    };
    if there.period != new.period {
        return Err(there.period);
    }
    Ok(if is_same_source(there, new) {
        Act::Keep(first)
    } else if is_later_or_same(*there_order, order) {
        Act::Leave
    } else {
        Act::Replace(first)
    })
}

fn is_same_source(there: &Step, new: &Step) -> bool {
    there.raw_sha256 == new.raw_sha256 && there.field == new.field
}

#[cfg(test)]
mod tests;
