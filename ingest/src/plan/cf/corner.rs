//! Labels of a whole globe that can only be edges of cells: as centres they would reach past a pole and leave the other one
//! out.

use super::axis::Registration;

/// How far labels may be off, in cells: those of single precision are.
const TOLERANCE_CELLS: f64 = 1e-3;

/// Which corner of its cell the labels name, if they cover the globe as such and cannot be centres: latitudes from one pole
/// to one cell before the other, longitudes from, or to, 0 or the date line.
pub(crate) fn of(lat_deg: &[f64], lon_deg: &[f64]) -> Option<Registration> {
    let (south, north) = ends(lat_deg, 180.0)?;
    let (west, east) = ends(lon_deg, 360.0)?;
    let near = |label: f64, edge: f64, cell: f64| (label - edge).abs() < TOLERANCE_CELLS * cell;
    let cell = (north - south) / (lat_deg.len() - 1) as f64;
    let is_north = near(north, 90.0, cell) && near(south, cell - 90.0, cell);
    let is_south = near(south, -90.0, cell) && near(north, 90.0 - cell, cell);
    let cell = (east - west) / (lon_deg.len() - 1) as f64;
    let is_west = [-180.0, 0.0].iter().any(|edge| near(west, *edge, cell));
    let is_east = [180.0, 360.0].iter().any(|edge| near(east, *edge, cell));
    match (is_north, is_south, is_west, is_east) {
        (true, false, true, false) => Some(Registration::NorthWest),
        (true, false, false, true) => Some(Registration::NorthEast),
        (false, true, true, false) => Some(Registration::SouthWest),
        (false, true, false, true) => Some(Registration::SouthEast),
        _ => None,
    }
}

/// Lowest and highest label, if as many cells as there are labels go once around or from pole to pole.
fn ends(labels: &[f64], around_deg: f64) -> Option<(f64, f64)> {
    let low = labels.iter().copied().fold(f64::INFINITY, f64::min);
    let high = labels.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let count = labels.len() as f64;
    let missed = (high - low) * count / (count - 1.0) - around_deg;
    (missed.abs() < TOLERANCE_CELLS * around_deg / count).then_some((low, high))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn labels(first: f64, step: f64, count: u32) -> Vec<f64> {
        (0..count).map(|i| first + step * f64::from(i)).collect()
    }

    #[test]
    fn labels_on_a_pole_with_cells_for_the_whole_globe_are_corners() {
        for (lat, lon, corner) in [
            (
                labels(90.0, -1.0, 180),
                labels(-180.0, 1.0, 360),
                Registration::NorthWest,
            ),
            (
                labels(90.0, -1.0, 180),
                labels(-179.0, 1.0, 360),
                Registration::NorthEast,
            ),
            (
                labels(-90.0, 0.5, 360),
                labels(0.0, 0.5, 720),
                Registration::SouthWest,
            ),
            (
                labels(89.0, -1.0, 180),
                labels(1.0, 1.0, 360),
                Registration::SouthEast,
            ),
        ] {
            assert_eq!(of(&lat, &lon), Some(corner));
        }
    }

    #[test]
    fn what_may_be_centres_is_none() {
        let globe = labels(-180.0, 1.0, 360);
        for (lat, lon) in [
            (labels(89.5, -1.0, 180), globe.clone()),
            (labels(90.0, -1.0, 181), globe.clone()),
            (labels(90.0, -1.0, 90), globe),
            (labels(90.0, -1.0, 180), labels(-179.5, 1.0, 360)),
            (labels(90.0, -1.0, 180), labels(100.0, 1.0, 30)),
            (vec![90.0], vec![0.0]),
            (vec![], vec![]),
            (vec![f64::NAN; 180], vec![f64::NAN; 360]),
        ] {
            assert_eq!(of(&lat, &lon), None);
        }
    }
}
