//! [`Plan`] in, the bands of each step out: values of some rows on the stored grid, in the stored unit. What the reader gives is
//! turned by whoever works on it, while the reader goes on.

mod whole_numbers;

use std::ops::{Range, RangeInclusive};
use std::sync::Arc;

use contract::masked::MaskedCells;

use crate::error::{Rejection, Stop};
use crate::inspect::file::description::Part;
use crate::inspect::values::Values;
use crate::plan::cf::axis::Mapping;
use crate::plan::cf::coordinate::{Axis, Role};
use crate::plan::cf::packing::{Packing, Unpacked};
use crate::plan::cf::unmarked::Ends;
use crate::plan::{Plan, PlannedStep};
use whole_numbers::WholeNumbers;

/// Some rows of one step as values, `[row, col]`, from the north, stored unit, NaN for no data.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DecodedBand {
    pub(crate) values: Vec<f32>,
    /// What the file gave a value for.
    pub(crate) masked: MaskedCells,
    /// Of stored numbers, where one of them may mean no data though nothing says so.
    pub(crate) ends: Ends,
}

/// Rows of the file that hold some rows of the grid: the first, and how many. Rows follow each other in one direction or the other.
fn file_rows(mapping: &Mapping, rows: &Range<u32>) -> (u64, u64) {
    let rows = &mapping.file_rows[rows.start as usize..rows.end as usize];
    let (first, last) = (rows.iter().min(), rows.iter().max());
    let (first, last) = first.zip(last).expect("a band has rows");
    (u64::from(*first), u64::from(last - first) + 1)
}

/// Some rows of one step as they lie in the file.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct RawBand {
    step: PlannedStep,
    rows: Range<u32>,
    /// Stored numbers of the latitudes of the file that hold the rows, and of all longitudes, in the order of the file.
    stored: Vec<f64>,
    /// Is each of them good enough? None if nobody asks.
    is_good: Option<Vec<bool>>,
}

/// Reads some rows of one step; what the reader is to give after them it is told before it is waited for.
pub(crate) async fn read(
    plan: &mut Plan,
    (step, rows): (PlannedStep, Range<u32>),
    next: Option<(PlannedStep, Range<u32>)>,
) -> Result<RawBand, Stop> {
    let slab = Slab::of(&plan.mapping, step, &rows);
    slab.ask(plan).await?;
    if let Some((step, rows)) = next {
        Slab::of(&plan.mapping, step, &rows).ask(plan).await?;
    }
    let is_good = is_good(plan, slab).await?;
    let (variable, axes) = (&plan.variable.name, &plan.axes);
    let stored = slab.read(&mut plan.values, variable, axes).await?;
    Ok(RawBand {
        step,
        rows,
        stored,
        is_good,
    })
}

/// What stored numbers of a file become; clones share it.
#[derive(Debug, Clone)]
pub(crate) struct Conversion(Arc<Converted>);

#[derive(Debug)]
struct Converted {
    axes: Vec<Axis>,
    mapping: Mapping,
    packing: Packing,
    /// What values can be, where one of the stored numbers may mean no data though nothing says so; none where a profile says what does.
    unmarked_in: Option<RangeInclusive<f64>>,
    /// Where they may have more digits than values have.
    whole: Option<WholeNumbers>,
}

impl Conversion {
    pub(crate) fn of(plan: &Plan) -> Self {
        let has_profile = plan.recipe.profile.is_some();
        Self(Arc::new(Converted {
            axes: plan.axes.clone(),
            mapping: plan.mapping.clone(),
            packing: plan.packing.clone(),
            unmarked_in: (!has_profile).then(|| plan.target.quantity.plausible()),
            whole: WholeNumbers::of(plan),
        }))
    }

    /// Notes with a plan what was found in the bands that were turned so far.
    pub(crate) fn tell(&self, plan: &mut Plan) {
        let said = self
            .0
            .whole
            .as_ref()
            .and_then(WholeNumbers::said)
            .map(crate::plan::line);
        if let Some(line) = said.filter(|line| !plan.assumptions.contains(line)) {
            plan.assumptions.push(line);
        }
    }

    /// Turns rows of one step.
    ///
    /// # Errors
    /// A code that values cannot hold.
    pub(crate) fn band(&self, raw: RawBand) -> Result<DecodedBand, Rejection> {
        let Converted {
            axes,
            mapping,
            packing,
            unmarked_in,
            whole,
        } = &*self.0;
        let RawBand {
            step,
            rows,
            mut stored,
            is_good,
        } = raw;
        let is_value = |stored: f64| matches!(packing.unpacked(stored), Unpacked::Value(_));
        let mut masked = MaskedCells::default();
        let cells = stored.iter_mut().zip(is_good.iter().flatten());
        for (stored, _) in cells.filter(|(_, is_good)| !**is_good) {
            masked.poor_quality += u64::from(is_value(*stored));
            *stored = f64::NAN;
        }
        let mut ends = Ends::default();
        if let Some(plausible) = unmarked_in {
            // What cannot be true is masked as it is.
            let can_be = |stored: f64| match packing.unpacked(stored) {
                Unpacked::Value(value) => plausible.contains(&(value * step.factor + step.offset)),
                Unpacked::Missing | Unpacked::OutOfRange => false,
            };
            let valued = stored.iter().filter(|stored| can_be(**stored));
            valued.for_each(|stored| ends.add(*stored));
        }
        if let Some(whole) = whole {
            let valued = stored.iter().map(|stored| packing.unpacked(*stored));
            whole.check(valued, step.period)?;
        }
        let lies = (axes.as_slice(), mapping);
        let values = converted(lies, packing, (step, rows), &stored, &mut masked);
        Ok(DecodedBand {
            values,
            masked,
            ends,
        })
    }
}

/// Values of some rows on the stored grid, in the stored unit, from a part of a map as it lies in a file.
///
/// - `stored`: stored numbers of the latitudes of the file that hold the rows, and of all longitudes, in the order of `axes`
/// - result: `[row, col]`, NaN no data; what is out of the valid range is counted in `masked`
pub(crate) fn converted(
    (axes, mapping): (&[Axis], &Mapping),
    packing: &Packing,
    (step, rows): (PlannedStep, Range<u32>),
    stored: &[f64],
    masked: &mut MaskedCells,
) -> Vec<f32> {
    let place = |role| axes.iter().position(|a| a.role == role);
    let len_of = |role| place(role).map_or(0, |at| axes[at].len as usize);
    let is_lat_first = place(Role::Latitude) < place(Role::Longitude);
    let (_, count) = file_rows(mapping, &rows);
    let strides = if is_lat_first {
        [len_of(Role::Longitude), 1]
    } else {
        [1, count as usize]
    };
    // One rounding to float32, at the end.
    let convert = |stored: f64| {
        let value = match packing.unpacked(stored) {
            Unpacked::Value(value) => value,
            Unpacked::Missing => f64::NAN,
            Unpacked::OutOfRange => {
                masked.out_of_range += 1;
                f64::NAN
            }
        };
        (value * step.factor + step.offset) as f32
    };
    turned(mapping, rows, strides, stored, convert)
}

/// Some latitudes of one map, as they lie in the file.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slab {
    step: PlannedStep,
    first: u64,
    count: u64,
}

impl Slab {
    /// What holds some rows of the grid.
    pub(crate) fn of(mapping: &Mapping, step: PlannedStep, rows: &Range<u32>) -> Self {
        let (first, count) = file_rows(mapping, rows);
        Self { step, first, count }
    }

    /// Tells the reader that all of it will be read, in the order in which it will.
    async fn ask(self, plan: &mut Plan) -> Result<(), Stop> {
        if let Some(quality) = &plan.quality {
            let (part, _) = self.parts(&quality.axes);
            plan.values.ask(&quality.variable, &part).await?;
        }
        let (part, _) = self.parts(&plan.axes);
        plan.values.ask(&plan.variable.name, &part).await
    }

    /// Its values of a variable as stored, in the order of the file.
    async fn read(
        self,
        values: &mut Values,
        variable: &str,
        axes: &[Axis],
    ) -> Result<Vec<f64>, Stop> {
        let (part, count) = self.parts(axes);
        values.read(variable, &part, count).await
    }

    /// What of each axis it is, and how many values.
    pub(crate) fn parts(self, axes: &[Axis]) -> (Vec<Part>, u64) {
        let part = axes.iter().map(|axis| self.part(axis)).collect();
        let lens = axes.iter().map(|axis| match axis.role {
            Role::Latitude => self.count,
            Role::Longitude => axis.len,
            Role::Time | Role::Other => 1,
        });
        (part, lens.product())
    }

    /// What of an axis it is.
    pub(crate) fn part(self, axis: &Axis) -> Part {
        let Self { first, count, .. } = self;
        match axis.role {
            Role::Latitude => Part::Some { first, count },
            Role::Longitude => Part::All,
            Role::Time => Part::At(self.step.time_index),
            Role::Other => Part::At(0),
        }
    }
}

/// Is every cell of a part of the file's map good enough? None if nobody asks.
async fn is_good(plan: &mut Plan, slab: Slab) -> Result<Option<Vec<bool>>, Stop> {
    let Some(quality) = &plan.quality else {
        return Ok(None);
    };
    let (variable, axes) = (&quality.variable, &quality.axes);
    let stored = slab.read(&mut plan.values, variable, axes).await?;
    Ok(Some(
        stored.into_iter().map(|n| quality.accepts(n)).collect(),
    ))
}

/// Values in the order of the grid from a part of a map in the order of the file.
///
/// - `rows`: of the grid; `stored` begins with the first latitude of the file that one of them is
/// - `strides`: distance in `stored` from one latitude, and from one longitude, to the next
/// - result: `[row, col]` of `mapping.grid`
fn turned(
    mapping: &Mapping,
    rows: Range<u32>,
    strides: [usize; 2],
    stored: &[f64],
    mut convert: impl FnMut(f64) -> f32,
) -> Vec<f32> {
    let (first, _) = file_rows(mapping, &rows);
    let mut values = Vec::with_capacity(rows.len() * mapping.file_cols.len());
    for row in &mapping.file_rows[rows.start as usize..rows.end as usize] {
        let start = (u64::from(*row) - first) as usize * strides[0];
        values.extend(
            mapping
                .file_cols
                .iter()
                .map(|col| convert(stored[start + *col as usize * strides[1]])),
        );
    }
    values
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::cf::axis::{Labels, Registration};

    #[test]
    fn south_first_and_longitude_first_files_give_the_same_map() {
        // 2 x 4 cells; the value is 10 * (index of latitude from the north) + (index of longitude from -180).
        let lat = [-45.0, 45.0];
        let lon = [45.0, 135.0, 225.0, 315.0];
        let labels = [&lat[..], &lon].map(|deg| Labels {
            deg,
            only_deg: None,
        });
        let mapping = Mapping::from_labels(labels, Registration::Center, ["lat", "lon"]).unwrap();
        let expected: Vec<f32> = vec![0.0, 1.0, 2.0, 3.0, 10.0, 11.0, 12.0, 13.0];
        let lat_first = [12.0, 13.0, 10.0, 11.0, 2.0, 3.0, 0.0, 1.0];
        let all = |strides, stored: &[f64]| turned(&mapping, 0..2, strides, stored, |v| v as f32);
        assert_eq!(all([4, 1], &lat_first), expected);
        let lon_first = [12.0, 2.0, 13.0, 3.0, 10.0, 0.0, 11.0, 1.0];
        assert_eq!(all([1, 2], &lon_first), expected);
        // The northern row alone is the second of the file.
        assert_eq!(file_rows(&mapping, &(0..1)), (1, 1));
        let north = turned(&mapping, 0..1, [4, 1], &lat_first[4..], |v| v as f32);
        assert_eq!(north, expected[..4]);
    }
}
