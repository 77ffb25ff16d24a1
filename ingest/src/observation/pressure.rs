//! Depth from the pressure of sea water: what casts give where they give no depth in metres.

use crate::inspect::file::description::Variable;
use crate::plan::unit;

/// One decibar, Pa.
const PA_PER_DBAR: f64 = 1e4;

/// Is a variable the pressure of the sea water round a sample? By its standard name; without one by a unit that nobody gives
/// the pressure of air in.
pub(super) fn is_pressure(variable: &Variable) -> bool {
    let text = |name: &str| variable.attributes.text(name);
    match text("standard_name") {
        Some(name) => matches!(
            name,
            "sea_water_pressure" | "sea_water_pressure_due_to_sea_water"
        ),
        None => text("units").is_some_and(is_decibar),
    }
}

fn is_decibar(spelling: &str) -> bool {
    let lower = spelling.to_ascii_lowercase();
    matches!(lower.as_str(), "dbar" | "dbars" | "decibar" | "decibars")
}

/// What a pressure in a file's unit is multiplied with to be in dbar; none if it is no unit of pressure.
pub(super) fn dbar_per_unit(spelling: &str) -> Option<f64> {
    if is_decibar(spelling) {
        return Some(1.0);
    }
    let (own, pascal) = (unit::parse(spelling).ok()?, unit::parse("Pa").ok()?);
    (own.dimension == pascal.dimension).then_some(own.factor / PA_PER_DBAR)
}

/// Depth below the sea surface, m, of a pressure in sea water.
///
/// - `pressure_dbar`: dbar, 0 at the surface (that of the air is not in it, as instruments that are lowered give it)
/// - `lat_deg`: degrees north; gravity grows towards the poles
///
/// Of water of 0 °C and salinity 35 everywhere: what real water is lighter (its geopotential anomaly, some metres) is left out. NaN
/// in, NaN out. Source: Saunders & Fofonoff (1976), Deep-Sea Research 23, 109-111, refitted to the equation of state of 1980 by
/// Fofonoff & Millard (1983), Algorithms for computation of fundamental properties of seawater, UNESCO technical papers in marine
/// science 44.
pub(super) fn depth_m(pressure_dbar: f64, lat_deg: f64) -> f64 {
    let p = pressure_dbar;
    let sin_lat = lat_deg.to_radians().sin();
    let x = sin_lat * sin_lat;
    // Of the surface, and its growth downwards, m s⁻².
    let gravity = 9.780_318 * (1.0 + (5.2788e-3 + 2.36e-5 * x) * x) + 1.092e-6 * p;
    ((((-1.82e-15 * p + 2.279e-10) * p - 2.2512e-5) * p + 9.72659) * p) / gravity
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_are_those_of_the_table_of_the_source() {
        // Fofonoff & Millard (1983): its check value, and places of its table.
        for (pressure_dbar, lat_deg, expected_m) in [
            (10_000.0, 30.0, 9712.653),
            (500.0, 0.0, 496.65),
            (5000.0, 45.0, 4902.08),
            (10_000.0, 90.0, 9674.23),
        ] {
            let found_m = depth_m(pressure_dbar, lat_deg);
            assert!(
                (found_m - expected_m).abs() < 0.006,
                "{pressure_dbar} dbar at {lat_deg}: {found_m} m"
            );
        }
        assert!(depth_m(0.0, 45.0).abs() < 1e-12 && depth_m(f64::NAN, 0.0).is_nan());
    }

    #[test]
    fn pressures_are_read_in_any_unit_of_pressure() {
        for (spelling, expected) in [("decibar", 1.0), ("dbar", 1.0), ("kPa", 0.1), ("Pa", 1e-4)] {
            let found = dbar_per_unit(spelling).unwrap();
            assert!((found - expected).abs() < 1e-12, "{spelling}: {found}");
        }
        assert_eq!(dbar_per_unit("m"), None);
        assert_eq!(dbar_per_unit(""), None);
    }
}
