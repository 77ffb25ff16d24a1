//! Steps of a manifest and new files in, the steps of the next manifest out; pure.

use contract::event::RejectReason;
use contract::grid::Grid;
use contract::manifest::{Manifest, Step};

use crate::put::StoredGranule;
use crate::rejection::Rejection;

/// Grids whose edges differ by less than this, in cells, are one grid.
const SAME_GRID_CELLS: f64 = 1e-4;

/// The steps of the next manifest and what became of each file.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Merged {
    /// In the order of time, not overlapping.
    pub(super) steps: Vec<Step>,
    /// One for each file.
    pub(super) changes: Vec<Change>,
    /// Was a step replaced, rather than only new ones added?
    pub(super) is_revision: bool,
    /// Index of the last file that was taken.
    pub(super) last_taken: Option<usize>,
}

/// What became of one file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Change {
    Taken {
        revised: bool,
    },
    /// All of it was there.
    Same,
    Refused(Rejection),
}

impl Merged {
    pub(super) fn is_changed(&self) -> bool {
        self.last_taken.is_some()
    }
}

/// How many files from the first on have no period in common.
pub(super) fn disjoint_prefix(granules: &[StoredGranule]) -> usize {
    let mut periods = Vec::new();
    for (index, granule) in granules.iter().enumerate() {
        let own: Vec<_> = granule.grids.iter().map(|g| g.step.period).collect();
        if own.iter().any(|p| periods.iter().any(|q| p.overlaps(*q))) {
            return index;
        }
        periods.extend(own);
    }
    granules.len()
}

/// Adds files to the newest manifest, in their order.
pub(super) fn merge(newest: Option<&Manifest>, granules: &[StoredGranule]) -> Merged {
    let mut merged = Merged {
        steps: newest.map_or_else(Vec::new, |m| m.steps.clone()),
        changes: Vec::with_capacity(granules.len()),
        is_revision: false,
        last_taken: None,
    };
    for (index, granule) in granules.iter().enumerate() {
        let base = newest
            .map(|m| (m.grid, m.quantity, m.synthetic))
            .or_else(|| {
                let first = granules.get(merged.last_taken?)?;
                Some((first.grid, first.target.quantity, first.target.synthetic))
            });
        let change = match base.map_or(Ok(()), |base| check_fits(granule, base)) {
            Ok(()) => add(&mut merged.steps, granule),
            Err(rejection) => Change::Refused(rejection),
        };
        if let Change::Taken { revised } = change {
            merged.last_taken = Some(index);
            merged.is_revision |= revised;
        }
        merged.changes.push(change);
    }
    merged
}

fn conflict(detail: String) -> Rejection {
    Rejection::new(RejectReason::Conflict, "product", detail)
}

/// Is the file of the grid and quantity of its product?
fn check_fits(
    granule: &StoredGranule,
    (grid, quantity, synthetic): (Grid, contract::quantity::Quantity, bool),
) -> Result<(), Rejection> {
    let product = &granule.target.product;
    let advice = "land it in a product of its own";
    if !is_same_grid(&granule.grid, &grid) {
        let shape = |g: &Grid| {
            format!(
                "{} x {} cells from {} N {} E",
                g.rows, g.cols, g.north_deg, g.west_deg
            )
        };
        return Err(conflict(format!(
            "{product} has {}, the file {}; {advice}",
            shape(&grid),
            shape(&granule.grid)
        )));
    }
    if granule.target.quantity != quantity {
        return Err(conflict(format!(
            "{product} holds {}, the file {}; {advice}",
            quantity.title(),
            granule.target.quantity.title()
        )));
    }
    if granule.target.synthetic != synthetic {
        let word = |synthetic| if synthetic { "synthetic" } else { "measured" };
        return Err(conflict(format!(
            "{product} is {}, the file {}; {advice}",
            word(synthetic),
            word(granule.target.synthetic)
        )));
    }
    Ok(())
}

pub(super) fn is_same_grid(a: &Grid, b: &Grid) -> bool {
    let near = |x: f64, y: f64, cell: f64| (x - y).abs() < SAME_GRID_CELLS * cell;
    (a.rows, a.cols) == (b.rows, b.cols)
        && near(a.north_deg, b.north_deg, a.dlat_deg)
        && near(a.south_deg(), b.south_deg(), a.dlat_deg)
        && near(a.west_deg, b.west_deg, a.dlon_deg)
        && near(a.east_deg(), b.east_deg(), a.dlon_deg)
}

/// Adds the steps of one file, all or none.
fn add(steps: &mut Vec<Step>, granule: &StoredGranule) -> Change {
    let mut next = steps.clone();
    let mut revised = false;
    let mut same = true;
    for new in granule.grids.iter().map(|g| &g.step) {
        // Steps do not overlap, so those that overlap the new one lie together.
        let first = next.partition_point(|s| s.period.end <= new.period.start);
        let overlapping = next[first..]
            .iter()
            .take_while(|s| s.period.start < new.period.end)
            .count();
        match overlapping {
            0 => {
                next.insert(first, new.clone());
                same = false;
            }
            1 if next[first].period == new.period => {
                if next[first].raw_sha256 != new.raw_sha256 || next[first].frame != new.frame {
                    next[first] = new.clone();
                    revised = true;
                    same = false;
                }
            }
            _ => {
                let there = next[first].period;
                let product = &granule.target.product;
                return Change::Refused(conflict(format!(
                    "{product} has a step for {there}, which overlaps {} of the file; land it in a product of its own",
                    new.period
                )));
            }
        }
    }
    if same {
        return Change::Same;
    }
    *steps = next;
    Change::Taken { revised }
}

#[cfg(test)]
mod tests;
