//! [`PlannedGranule`] in, one [`DecodedGrid`] a step out: values on the stored grid, in the stored unit.

use contract::masked::MaskedCells;
use contract::time::Period;

use crate::cf::axis::Mapping;
use crate::cf::coordinate::{Axis, Role};
use crate::error::Stop;
use crate::file::description::Part;
use crate::plan::{PlannedGranule, PlannedStep};

/// One step as values, `[row, col]`, row 0 north, stored unit, NaN for no data.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct DecodedGrid {
    pub(crate) period: Period,
    pub(crate) values: Vec<f32>,
    /// What the file gave a value for.
    pub(crate) masked: MaskedCells,
}

/// Reads and turns one step.
pub(crate) async fn run(
    granule: &mut PlannedGranule,
    step: PlannedStep,
) -> Result<DecodedGrid, Stop> {
    let part: Vec<Part> = granule.axes.iter().map(|axis| part(axis, step)).collect();
    let expected = granule.plane_cells();
    let stored = granule
        .session
        .read(&granule.variable.name, &part, expected)
        .await?;
    let is_lat_first = granule.axes.iter().position(|a| a.role == Role::Latitude)
        < granule.axes.iter().position(|a| a.role == Role::Longitude);
    let len_of = |role| {
        granule
            .axes
            .iter()
            .find(|a| a.role == role)
            .map_or(0, |a| a.len as usize)
    };
    let strides = if is_lat_first {
        [len_of(Role::Longitude), 1]
    } else {
        [1, len_of(Role::Latitude)]
    };
    let packing = &granule.packing;
    let mut masked = MaskedCells::default();
    // One rounding to float32, at the end.
    let convert = |stored: f64| {
        let value = packing.value(stored);
        masked.out_of_range += u64::from(value.is_nan() && !packing.is_missing(stored));
        (value * step.factor + step.offset) as f32
    };
    let values = turned(&granule.mapping, strides, &stored, convert);
    Ok(DecodedGrid {
        period: step.period,
        values,
        masked,
    })
}

fn part(axis: &Axis, step: PlannedStep) -> Part {
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
    use crate::cf::axis::Registration;

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
