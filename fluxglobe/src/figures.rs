//! Numbers for people: so many decimals where these say something, figures and size where they do not, and places.

use contract::series::Cell;

/// Longitudes and latitudes are told to so many parts of a degree: some 10 m.
const PARTS_PER_DEGREE: f64 = 1e4;

/// A number with so many decimals; one of which they would show little but zeros, or a huge one, by its size: `-1.2345e-9`.
pub(crate) fn figures(value: f64, decimals: usize) -> String {
    // Zero has no sign.
    let value = value + 0.0;
    if value != 0.0 && !(1e-3..1e9).contains(&value.abs()) {
        format!("{value:.decimals$e}")
    } else {
        format!("{value:.decimals$}")
    }
}

/// The middle of a cell: `149.5° W, 0.5° S`, also where the grid counts longitudes beyond 180.
pub(crate) fn middle(cell: &Cell) -> String {
    let lon_deg = (cell.lon_deg + 180.0).rem_euclid(360.0) - 180.0;
    let told = |deg: f64, names: [&str; 2]| {
        let parts = (deg * PARTS_PER_DEGREE).round() / PARTS_PER_DEGREE;
        let name = names[usize::from(parts < 0.0)];
        format!("{}° {name}", parts.abs())
    };
    format!(
        "{}, {}",
        told(lon_deg, ["E", "W"]),
        told(cell.lat_deg, ["N", "S"])
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_nothing_is_not_shown_as_zero() {
        let texts = [0.0, -0.0, -2.5, 0.001, -5.763_9e-12, 4e-4, 2e9].map(|it| figures(it, 4));
        let expected = [
            "0.0000",
            "0.0000",
            "-2.5000",
            "0.0010",
            "-5.7639e-12",
            "4.0000e-4",
            "2.0000e9",
        ];
        assert_eq!(texts, expected);
        assert_eq!(figures(-0.000_12, 3), "-1.200e-4");
    }

    #[test]
    fn a_place_says_which_way_its_degrees_count() {
        let middle = |lon_deg, lat_deg| {
            middle(&Cell {
                row: 0,
                col: 0,
                lon_deg,
                lat_deg,
            })
        };
        assert_eq!(middle(-149.5, -0.5), "149.5° W, 0.5° S");
        assert_eq!(middle(0.0, -0.000_01), "0° E, 0° N");
        assert_eq!(middle(200.125, 89.958_333_3), "159.875° W, 89.9583° N");
    }
}
