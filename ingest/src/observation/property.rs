//! What is measured: names, the unit each is stored in, and what can be true.

use std::ops::RangeInclusive;

/// A property that this program knows.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Property {
    /// CF standard name.
    pub(super) name: &'static str,
    /// Unit of stored values.
    pub(super) unit: &'static str,
    /// Values that can be true, stored unit.
    pub(super) plausible: RangeInclusive<f64>,
}

/// Depth down to which ships take in and buoys meet what they call surface water; their sensors and hulls reach to 3 to 10 m.
pub(super) const SURFACE_M: f64 = 20.0;
/// Longest name of a property.
const MAX_NAME_CHARS: usize = 64;
/// Unit of directions, which no unit parser knows as a unit of anything else.
pub(super) const DEGREE: &str = "degree";

const TEMPERATURE_K: RangeInclusive<f64> = 180.0..=340.0;
const WATER_K: RangeInclusive<f64> = 270.0..=325.0;
const SPEED_M_S: RangeInclusive<f64> = 0.0..=120.0;
const COMPONENT_M_S: RangeInclusive<f64> = -120.0..=120.0;
const CURRENT_M_S: RangeInclusive<f64> = -10.0..=10.0;
const DIRECTION: RangeInclusive<f64> = 0.0..=360.0;
const SHARE: RangeInclusive<f64> = 0.0..=1.2;
const PRESSURE_PA: RangeInclusive<f64> = 80_000.0..=110_000.0;
const CO2_PA: RangeInclusive<f64> = 0.0..=500.0;
const SALINITY: RangeInclusive<f64> = 0.0..=60.0;

const fn of(name: &'static str, unit: &'static str, plausible: RangeInclusive<f64>) -> Property {
    Property {
        name,
        unit,
        plausible,
    }
}

/// Every property with a unit of its own.
const KNOWN: &[Property] = &[
    of("air_pressure", "Pa", PRESSURE_PA),
    of("air_pressure_at_mean_sea_level", "Pa", PRESSURE_PA),
    of("air_pressure_at_sea_level", "Pa", PRESSURE_PA),
    of("air_temperature", "K", TEMPERATURE_K),
    of("dew_point_temperature", "K", TEMPERATURE_K),
    of("eastward_sea_water_velocity", "m s-1", CURRENT_M_S),
    of("eastward_wind", "m s-1", COMPONENT_M_S),
    of("fugacity_of_carbon_dioxide_in_sea_water", "Pa", CO2_PA),
    of("latitude", DEGREE, -90.0..=90.0),
    of("longitude", DEGREE, -180.0..=360.0),
    of(
        "mass_concentration_of_chlorophyll_a_in_sea_water",
        "kg m-3",
        0.0..=1e-2,
    ),
    of(
        "mass_concentration_of_chlorophyll_in_sea_water",
        "kg m-3",
        0.0..=1e-2,
    ),
    of("mole_fraction_of_carbon_dioxide_in_air", "1", 0.0..=0.01),
    of("northward_sea_water_velocity", "m s-1", CURRENT_M_S),
    of("northward_wind", "m s-1", COMPONENT_M_S),
    of("relative_humidity", "1", SHARE),
    of("sea_surface_salinity", "1", SALINITY),
    of("sea_surface_temperature", "K", WATER_K),
    of("sea_surface_wave_from_direction", DEGREE, DIRECTION),
    of("sea_surface_wave_mean_period", "s", 0.0..=60.0),
    of(
        "sea_surface_wave_period_at_variance_spectral_density_maximum",
        "s",
        0.0..=60.0,
    ),
    of("sea_surface_wave_significant_height", "m", 0.0..=40.0),
    of("sea_water_practical_salinity", "1", SALINITY),
    of("sea_water_salinity", "1", SALINITY),
    of("sea_water_sigma_t", "kg m-3", -10.0..=80.0),
    of("sea_water_speed", "m s-1", 0.0..=10.0),
    of("sea_water_temperature", "K", WATER_K),
    of("sea_water_velocity_to_direction", DEGREE, DIRECTION),
    of(
        "surface_partial_pressure_of_carbon_dioxide_in_sea_water",
        "Pa",
        CO2_PA,
    ),
    of("visibility_in_air", "m", 0.0..=100_000.0),
    of(
        "water_surface_height_above_reference_datum",
        "m",
        -100.0..=100.0,
    ),
    of("wind_from_direction", DEGREE, DIRECTION),
    of("wind_speed", "m s-1", SPEED_M_S),
    of("wind_speed_of_gust", "m s-1", SPEED_M_S),
    of("wind_to_direction", DEGREE, DIRECTION),
];

/// Units that values of unknown properties are stored in, if their own unit is of the same kind.
pub(super) const COMMON_UNITS: [&str; 7] = ["K", "m s-1", "Pa", "m", "1", "kg m-3", "s"];

/// The property of a standard name, if it is known.
pub(super) fn known(name: &str) -> Option<&'static Property> {
    KNOWN.iter().find(|property| property.name == name)
}

/// The name of a property that has no standard name, from that of its variable or column: what stands before a unit in
/// brackets, in lower case, one underscore for anything else.
pub(super) fn name_of(text: &str) -> String {
    let mut name = String::new();
    for c in text
        .chars()
        .take_while(|c| !matches!(c, '[' | '('))
        .take(MAX_NAME_CHARS)
    {
        let c = c.to_ascii_lowercase();
        if c.is_ascii_lowercase() || c.is_ascii_digit() {
            name.push(c);
        } else if !name.is_empty() && !name.ends_with('_') {
            name.push('_');
        }
    }
    name.trim_end_matches('_').to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::quantity::Quantity;

    #[test]
    fn what_a_grid_holds_too_has_the_unit_of_the_grid() {
        let pairs = [
            ("sea_surface_temperature", Quantity::SeaSurfaceTemperature),
            ("wind_speed", Quantity::WindSpeed),
            ("fugacity_of_carbon_dioxide_in_sea_water", Quantity::Pco2),
            ("sea_surface_salinity", Quantity::Salinity),
            ("air_pressure_at_mean_sea_level", Quantity::AirPressure),
            ("sea_surface_wave_significant_height", Quantity::WaveHeight),
            ("eastward_sea_water_velocity", Quantity::Current),
            (
                "mass_concentration_of_chlorophyll_a_in_sea_water",
                Quantity::Chlorophyll,
            ),
        ];
        for (name, quantity) in pairs {
            assert_eq!(known(name).unwrap().unit, quantity.unit(), "{name}");
        }
    }

    #[test]
    fn names_are_sorted_and_safe() {
        assert!(KNOWN.is_sorted_by_key(|p| p.name));
        assert!(KNOWN.iter().all(|p| name_of(p.name) == p.name));
        assert_eq!(name_of("Temperature equi [°C]"), "temperature_equi");
    }
}
