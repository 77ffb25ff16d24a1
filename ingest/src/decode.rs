//! [`Plan`] in, one [`DecodedGrid`] a step out: values on the stored grid, in the stored unit.

use contract::masked::MaskedCells;
use contract::quantity::Quantity;
use contract::time::Period;

use crate::error::Stop;
use crate::inspect::file::description::Part;
use crate::inspect::values::Values;
use crate::plan::cf::axis::Mapping;
use crate::plan::cf::coordinate::{Axis, Role};
use crate::plan::cf::packing::{Packing, Unpacked};
use crate::plan::cf::unmarked;
use crate::plan::{Plan, PlannedStep};

/// One step as values, `[row, col]`, row 0 north, stored unit, NaN for no data.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DecodedGrid {
    pub(crate) period: Period,
    pub(crate) values: Vec<f32>,
    /// What the file gave a value for.
    pub(crate) masked: MaskedCells,
}

/// Reads and turns one step.
pub(crate) async fn run(plan: &mut Plan, step: PlannedStep) -> Result<DecodedGrid, Stop> {
    let is_good = is_good(plan, step).await?;
    let (values, axes) = (&mut plan.values, &plan.axes);
    let mut stored = plane(values, &plan.variable.name, axes, step).await?;
    let mut masked = MaskedCells::default();
    let cells = stored.iter_mut().zip(is_good.iter().flatten());
    for (stored, _) in cells.filter(|(_, is_good)| !**is_good) {
        let is_value = matches!(plan.packing.unpacked(*stored), Unpacked::Value(_));
        masked.poor_quality += u64::from(is_value);
        *stored = f64::NAN;
    }
    if matches!(plan.target.quantity, Quantity::Open(_)) && plan.recipe.profile.is_none() {
        let said = |stored: &f64| match plan.packing.unpacked(*stored) {
            Unpacked::Value(_) => *stored,
            Unpacked::Missing | Unpacked::OutOfRange => f64::NAN,
        };
        let said: Vec<f64> = stored.iter().map(said).collect();
        unmarked::check(&plan.variable.name, &said)?;
    }
    let values = converted(
        (axes, &plan.mapping),
        &plan.packing,
        step,
        &stored,
        &mut masked,
    );
    Ok(DecodedGrid {
        period: step.period,
        values,
        masked,
    })
}

/// Values on the stored grid, in the stored unit, of a map as it lies in a file.
///
/// - `stored`: stored numbers of all latitudes and longitudes, in the order of `axes`
/// - result: `[row, col]`, NaN no data; what is out of the valid range is counted in `masked`
pub(crate) fn converted(
    (axes, mapping): (&[Axis], &Mapping),
    packing: &Packing,
    step: PlannedStep,
    stored: &[f64],
    masked: &mut MaskedCells,
) -> Vec<f32> {
    let place = |role| axes.iter().position(|a| a.role == role);
    let is_lat_first = place(Role::Latitude) < place(Role::Longitude);
    let len_of = |role| {
        let axis = axes.iter().find(|a| a.role == role);
        axis.map_or(0, |a| a.len as usize)
    };
    let strides = if is_lat_first {
        [len_of(Role::Longitude), 1]
    } else {
        [1, len_of(Role::Latitude)]
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
    turned(mapping, strides, stored, convert)
}

/// One map of a variable as stored, in the order of the file.
async fn plane(
    values: &mut Values,
    variable: &str,
    axes: &[Axis],
    step: PlannedStep,
) -> Result<Vec<f64>, Stop> {
    let part: Vec<Part> = axes.iter().map(|axis| part(axis, step)).collect();
    let expected = axes.iter().filter(|a| is_plane(a)).map(|a| a.len).product();
    values.read(variable, &part, expected).await
}

/// Is every cell of the file's map good enough? None if nobody asks.
async fn is_good(plan: &mut Plan, step: PlannedStep) -> Result<Option<Vec<bool>>, Stop> {
    let Some(quality) = &plan.quality else {
        return Ok(None);
    };
    let stored = plane(&mut plan.values, &quality.variable, &quality.axes, step).await?;
    Ok(Some(
        stored.into_iter().map(|n| quality.accepts(n)).collect(),
    ))
}

pub(crate) fn is_plane(axis: &Axis) -> bool {
    matches!(axis.role, Role::Latitude | Role::Longitude)
}

pub(crate) fn part(axis: &Axis, step: PlannedStep) -> Part {
    match axis.role {
        Role::Latitude | Role::Longitude => Part::All,
        Role::Time => Part::At(step.time_index),
        Role::Other => Part::At(0),
    }
}

/// Values in the order of the grid from a plane in the order of the file.
///
/// - `strides`: distance in the file from one latitude, and from one longitude, to the next
/// - result: `[row, col]` of `mapping.grid`
fn turned(
    mapping: &Mapping,
    strides: [usize; 2],
    stored: &[f64],
    mut convert: impl FnMut(f64) -> f32,
) -> Vec<f32> {
    let mut values = Vec::with_capacity(mapping.grid.cell_count());
    for row in &mapping.file_rows {
        let start = *row as usize * strides[0];
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
    use crate::plan::cf::axis::Registration;

    #[test]
    fn south_first_and_longitude_first_files_give_the_same_map() {
        // 2 x 4 cells; the value is 10 * (index of latitude from the north) + (index of longitude from -180).
        let lat = [-45.0, 45.0];
        let lon = [45.0, 135.0, 225.0, 315.0];
        let mapping =
            Mapping::from_labels(&lat, &lon, Registration::Center, ["lat", "lon"]).unwrap();
        let expected: Vec<f32> = vec![0.0, 1.0, 2.0, 3.0, 10.0, 11.0, 12.0, 13.0];
        let lat_first = [12.0, 13.0, 10.0, 11.0, 2.0, 3.0, 0.0, 1.0];
        assert_eq!(turned(&mapping, [4, 1], &lat_first, |v| v as f32), expected);
        let lon_first = [12.0, 2.0, 13.0, 3.0, 10.0, 0.0, 11.0, 1.0];
        assert_eq!(turned(&mapping, [1, 2], &lon_first, |v| v as f32), expected);
    }
}
