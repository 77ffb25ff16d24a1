//! Numbers for people: so many decimals where these say something, figures and size where they do not, areas, and places.

use contract::series::Cell;

/// Longitudes and latitudes are told to so many parts of a degree: some 10 m.
const PARTS_PER_DEGREE: f64 = 1e4;
const M2_PER_KM2: f64 = 1e6;
const M2_PER_MILLION_KM2: f64 = 1e12;
/// A tenth of a million km², below which three decimals of a million are two figures and less.
const SMALL_M2: f64 = 0.1 * M2_PER_MILLION_KM2;

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

/// Millions of square kilometres with three decimals; what rounding leaves of nothing is nothing, and not below it.
pub(crate) fn million_km2(m2: f64) -> String {
    format!("{:.3}", (m2 / M2_PER_MILLION_KM2 * 1e3).round() / 1e3 + 0.0)
}

/// An area with its unit: `510.066 10⁶ km²`, and `12.500 km²` where three decimals of a million would show little of it.
pub(crate) fn area(m2: f64) -> String {
    if m2 < SMALL_M2 {
        format!("{} km²", figures(m2 / M2_PER_KM2, 3))
    } else {
        format!("{} 10⁶ km²", million_km2(m2))
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
    fn nothing_has_no_sign() {
        let texts = [5.1e14, 4e8, -3.0, -0.0].map(million_km2);
        assert_eq!(texts, ["510.000", "0.000", "0.000", "0.000"]);
    }

    #[test]
    fn an_area_has_the_unit_in_which_it_is_read() {
        let texts = [5.100_656e14, 1e11, 1.25e10, 4e8, 12.0, 0.0].map(area);
        let expected = [
            "510.066 10⁶ km²",
            "0.100 10⁶ km²",
            "12500.000 km²",
            "400.000 km²",
            "1.200e-5 km²",
            "0.000 km²",
        ];
        assert_eq!(texts, expected);
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
