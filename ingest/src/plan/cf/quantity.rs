//! Which quantity a CF standard name names, and which way round.

use contract::quantity::Quantity;

use crate::plan::unit::Substance;

/// What a standard name says of a variable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Named {
    pub(crate) quantity: Quantity,
    /// Multiplies values to be positive out of the sea, upwards.
    pub(crate) sign: f64,
    /// Of what a mass is.
    pub(crate) substance: Option<Substance>,
}

/// Does the sign of a quantity tell a direction that files count either way?
pub(crate) fn has_direction(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::CarbonFlux | Quantity::Elevation)
}

/// What turns a variable's values to be positive upwards, and the attribute that says so: `upward` or `downward` in the
/// standard name, a height or a depth, or `positive = "up"` or `"down"`.
pub(crate) fn directions(standard_name: &str, positive: &str) -> Vec<(&'static str, f64)> {
    let word = |word: &str| standard_name.split('_').any(|part| part == word);
    let named = of_standard_name(standard_name).filter(|named| has_direction(named.quantity));
    let by_name = match named {
        Some(named) => Some(named.sign),
        None if word("downward") || word("depth") => Some(-1.0),
        None if word("upward") => Some(1.0),
        None => None,
    };
    let by_positive = match positive.to_ascii_lowercase().as_str() {
        "up" => Some(1.0),
        "down" => Some(-1.0),
        _ => None,
    };
    let said = [("standard_name", by_name), ("positive", by_positive)];
    said.into_iter()
        .filter_map(|(what, sign)| Some((what, sign?)))
        .collect()
}

/// What a standard name names, if it is a quantity that can be stored.
pub(crate) fn of_standard_name(name: &str) -> Option<Named> {
    let plain = |quantity| {
        Some(Named {
            quantity,
            sign: 1.0,
            substance: None,
        })
    };
    let flux = |sign, substance| {
        Some(Named {
            quantity: Quantity::CarbonFlux,
            sign,
            substance,
        })
    };
    match name {
        "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon" => {
            flux(1.0, Some(Substance::Carbon))
        }
        "surface_downward_mass_flux_of_carbon_dioxide_expressed_as_carbon" => {
            flux(-1.0, Some(Substance::Carbon))
        }
        "surface_upward_mass_flux_of_carbon_dioxide" => flux(1.0, Some(Substance::Co2)),
        "surface_downward_mass_flux_of_carbon_dioxide" => flux(-1.0, Some(Substance::Co2)),
        "surface_upward_mole_flux_of_carbon_dioxide" => flux(1.0, None),
        "surface_downward_mole_flux_of_carbon_dioxide" => flux(-1.0, None),
        "sea_surface_temperature" => plain(Quantity::SeaSurfaceTemperature),
        "sea_surface_skin_temperature" => plain(Quantity::SeaSurfaceSkinTemperature),
        "sea_surface_subskin_temperature" => plain(Quantity::SeaSurfaceSubskinTemperature),
        "sea_surface_foundation_temperature" => plain(Quantity::SeaSurfaceFoundationTemperature),
        "mass_concentration_of_chlorophyll_a_in_sea_water"
        | "mass_concentration_of_chlorophyll_in_sea_water"
        | "concentration_of_chlorophyll_in_sea_water" => plain(Quantity::Chlorophyll),
        "wind_speed" => plain(Quantity::WindSpeed),
        "surface_partial_pressure_of_carbon_dioxide_in_sea_water"
        | "partial_pressure_of_carbon_dioxide_in_sea_water" => plain(Quantity::Pco2),
        "fugacity_of_carbon_dioxide_in_sea_water" => plain(Quantity::Fco2),
        "sea_surface_salinity" | "sea_water_practical_salinity" | "sea_water_salinity" => {
            plain(Quantity::Salinity)
        }
        "air_pressure_at_sea_level" | "air_pressure_at_mean_sea_level" => {
            plain(Quantity::AirPressure)
        }
        "sea_ice_area_fraction" => plain(Quantity::IceFraction),
        "sea_area_fraction" => plain(Quantity::SeaAreaFraction),
        "land_area_fraction" => plain(Quantity::LandAreaFraction),
        "sea_surface_wave_significant_height" => plain(Quantity::WaveHeight),
        "precipitation_flux" | "rainfall_flux" | "lwe_precipitation_rate" | "rainfall_rate" => {
            plain(Quantity::Precipitation)
        }
        "eastward_sea_water_velocity"
        | "northward_sea_water_velocity"
        | "surface_eastward_sea_water_velocity"
        | "surface_northward_sea_water_velocity" => plain(Quantity::Current),
        "surface_altitude" | "bedrock_altitude" | "height_above_mean_sea_level" => {
            plain(Quantity::Elevation)
        }
        // Depths are counted downwards.
        "sea_floor_depth"
        | "sea_floor_depth_below_geoid"
        | "sea_floor_depth_below_mean_sea_level" => Some(Named {
            quantity: Quantity::Elevation,
            sign: -1.0,
            substance: None,
        }),
        _ => None,
    }
}
