//! What the CF conventions call things: names and attributes of variables and coordinates.

use contract::analysis::MapStatistic;
use contract::earth::{WGS84_EQUATORIAL_RADIUS_M, WGS84_POLAR_RADIUS_M};
use contract::quantity::{Flag, Quantity};
use contract::statistics::Percentile;
use serde_json::{Map, Value, json};

use crate::Description;
use crate::joining::{Method, WHOLLY_COVERED};
use crate::rounding::KEPT_BITS;

/// Unit of the time coordinate; instants are whole milliseconds, so that no time is rounded.
pub(crate) const TIME_UNITS: &str = "milliseconds since 1970-01-01 00:00:00";

/// The ellipsoid of latitudes by the name that other programs know it by, EPSG:4326 (OGC 18-010r7).
pub const WGS84_WKT: &str = r#"GEOGCRS["WGS 84",DATUM["World Geodetic System 1984",ELLIPSOID["WGS 84",6378137,298.257223563,LENGTHUNIT["metre",1]]],PRIMEM["Greenwich",0,ANGLEUNIT["degree",0.0174532925199433]],CS[ellipsoidal,2],AXIS["geodetic latitude (Lat)",north,ORDER[1],ANGLEUNIT["degree",0.0174532925199433]],AXIS["geodetic longitude (Lon)",east,ORDER[2],ANGLEUNIT["degree",0.0174532925199433]],ID["EPSG",4326]]"#;

/// Names of the arrays beside the values.
const OTHERS: [&str; 11] = [
    "bnds",
    "crs",
    "lat",
    "lat_bnds",
    "lon",
    "lon_bnds",
    "sha256_byte",
    "step_start",
    "time",
    "time_bnds",
    "values_sha256",
];

/// Attributes from a JSON object.
pub(crate) fn attributes(object: Value) -> Map<String, Value> {
    match object {
        Value::Object(map) => map,
        _ => Map::new(),
    }
}

/// Name of the variable that holds the values: that of the quantity.
pub fn variable(quantity: Quantity) -> String {
    match quantity.word() {
        name if OTHERS.contains(&name) => format!("{name}_values"),
        name => name.to_owned(),
    }
}

/// Standard name, if the conventions' table (version 93) has one that says what the values are and no more.
///
/// It has none for the upward flux of CO2 as mass of carbon, nor for what that adds up to; under partial pressure lies
/// fugacity too, of products that landed before the two were told apart. That of an open quantity is its name, where its files
/// state it as such, and of values as they are or means of them: of others it would need a word in `cell_methods`.
fn standard_name(description: &Description) -> Option<&'static str> {
    match description.quantity {
        Quantity::Current if description.product.northward().is_some() => {
            Some("eastward_sea_water_velocity")
        }
        Quantity::Current if description.product.eastward().is_some() => {
            Some("northward_sea_water_velocity")
        }
        Quantity::CarbonFlux | Quantity::AccumulatedCarbon | Quantity::Pco2 | Quantity::Current => {
            None
        }
        Quantity::Open(open) => {
            let is_of_values = matches!(description.statistic, None | Some(MapStatistic::Mean));
            let words = open.words();
            (is_of_values && words.is_standard_name).then_some(words.name.as_str())
        }
        Quantity::Fco2 => Some("fugacity_of_carbon_dioxide_in_sea_water"),
        Quantity::SeaSurfaceSkinTemperature => Some("sea_surface_skin_temperature"),
        Quantity::SeaSurfaceSubskinTemperature => Some("sea_surface_subskin_temperature"),
        Quantity::SeaSurfaceFoundationTemperature => Some("sea_surface_foundation_temperature"),
        Quantity::SeaSurfaceTemperature => Some("sea_surface_temperature"),
        Quantity::Chlorophyll => Some("mass_concentration_of_chlorophyll_a_in_sea_water"),
        Quantity::WindSpeed => Some("wind_speed"),
        Quantity::Salinity => Some("sea_water_practical_salinity"),
        Quantity::AirPressure => Some("air_pressure_at_mean_sea_level"),
        Quantity::IceFraction => Some("sea_ice_area_fraction"),
        Quantity::WaveHeight => Some("sea_surface_wave_significant_height"),
        Quantity::Precipitation => Some("precipitation_flux"),
        Quantity::Elevation => Some("height_above_mean_sea_level"),
        Quantity::SeaAreaFraction => Some("sea_area_fraction"),
        Quantity::LandAreaFraction => Some("land_area_fraction"),
    }
}

/// What values are of their cells and steps (CF 7.3); none of an open quantity, for it may be a mean, a code of a mask or an extreme. What
/// the conventions have no word for is said of cells alone.
fn cell_methods(quantity: Quantity, statistic: Option<MapStatistic>) -> Option<&'static str> {
    match (quantity, statistic) {
        (Quantity::Open(_), _) => return None,
        (_, Some(MapStatistic::Mean)) => return Some("area: mean time: mean"),
        (_, Some(MapStatistic::Min)) => return Some("area: mean time: minimum"),
        (_, Some(MapStatistic::Max)) => return Some("area: mean time: maximum"),
        (_, Some(MapStatistic::Percentile(Percentile::MEDIAN))) => {
            return Some("area: mean time: median");
        }
        (_, Some(_)) => return Some("area: mean"),
        (_, None) => {}
    }
    match quantity {
        Quantity::AccumulatedCarbon => Some("area: mean time: sum"),
        // They hold at any time.
        Quantity::Elevation | Quantity::SeaAreaFraction | Quantity::LandAreaFraction => {
            Some("area: mean")
        }
        Quantity::Open(_) => None,
        _ => Some("area: mean time: mean"),
    }
}

/// What values are of their cells and steps, by the conventions and, where these have no word for it, in words.
pub(crate) fn method(description: &Description) -> (Option<&'static str>, Option<String>) {
    let methods = cell_methods(description.quantity, description.statistic);
    let said = methods.and(description.statistic);
    (methods, said.and_then(over_time))
}

/// What a statistic is of the time that its bounds tell, where `cell_methods` has no word for it.
fn over_time(statistic: MapStatistic) -> Option<String> {
    match statistic {
        MapStatistic::Percentile(Percentile::MEDIAN) => None,
        MapStatistic::Percentile(_) => Some(format!(
            "percentile {statistic} of each cell over the time of the bounds"
        )),
        MapStatistic::Climatology => Some(
            "means over all years of the climatology, which the title tells, of the month or season that the bounds give in one of them"
                .to_owned(),
        ),
        _ => None,
    }
}

/// What is said of the values.
pub fn of_values(description: &Description) -> Map<String, Value> {
    let quantity = description.quantity;
    let mut attributes = attributes(json!({
        "long_name": quantity.title(),
        "units": quantity.unit(),
        "grid_mapping": "crs",
    }));
    let mut comments = vec![];
    let (methods, over_time) = method(description);
    if let Some(methods) = methods {
        attributes.insert("cell_methods".to_owned(), methods.into());
        comments.extend(over_time);
    }
    if let Some(name) = standard_name(description) {
        attributes.insert("standard_name".to_owned(), name.into());
    }
    // The tables of CMIP have it of fluxes, and so it is what programs look for; the conventions have no name that says it.
    if quantity == Quantity::CarbonFlux {
        attributes.insert("positive".to_owned(), "up".into());
    }
    if let Some([below, above]) = quantity.ends() {
        comments.push(format!("below zero the {below}, above it the {above}"));
    }
    if !comments.is_empty() {
        attributes.insert("comment".to_owned(), comments.join("; ").into());
    }
    let flags = quantity.flags();
    if !flags.is_empty() {
        let codes: Vec<f32> = flags.iter().map(Flag::code).collect();
        let meanings: Vec<&str> = flags.iter().map(|flag| flag.meaning.as_str()).collect();
        attributes.insert("flag_values".to_owned(), json!(codes));
        attributes.insert("flag_meanings".to_owned(), meanings.join(" ").into());
    }
    attributes
}

/// Says more of the values, after what is said.
fn add_comment(attributes: &mut Map<String, Value>, comment: &str) {
    let before = attributes.get("comment").and_then(Value::as_str);
    let all = before.map_or_else(
        || comment.to_owned(),
        |before| format!("{before}; {comment}"),
    );
    attributes.insert("comment".to_owned(), all.into());
}

/// Name of the variable that tells how much of a cell of a level holds data.
pub(crate) fn coverage(quantity: Quantity) -> String {
    const NAME: &str = "coverage";
    match variable(quantity) {
        name if name == NAME => format!("{NAME}_of_cells"),
        _ => NAME.to_owned(),
    }
}

/// Of the values of a level.
pub(crate) fn of_level_values(description: &Description) -> Map<String, Value> {
    let mut attributes = of_values(description);
    let quantity = description.quantity;
    let comment = match Method::of(quantity) {
        Method::Mean => "means by area over the cells that hold data",
        Method::Direction { .. } => {
            "where the mean of unit vectors by area points, over the cells that hold data; none where they cancel"
        }
        Method::Sample => {
            "the value of one cell of the block, that of its middle where it holds data: codes, and days of a year, have no mean"
        }
    };
    let rounded = match Method::of(quantity) {
        Method::Sample => String::new(),
        _ => format!(
            "; rounded to {KEPT_BITS} bits behind the leading one, which is 2^-16 of a value at most"
        ),
    };
    add_comment(&mut attributes, &format!("{comment}{rounded}"));
    if Method::of(quantity) != Method::Sample {
        attributes.insert("quantization_nsb".to_owned(), KEPT_BITS.into());
    }
    attributes.insert("ancillary_variables".to_owned(), coverage(quantity).into());
    attributes
}

/// Of how much of each cell of a level holds data.
pub(crate) fn of_coverage() -> Map<String, Value> {
    attributes(
        json!({ "long_name": "share of the area of the cell that holds data", "units": "1",
        "scale_factor": 1.0 / f64::from(WHOLLY_COVERED), "add_offset": 0.0, "grid_mapping": "crs",
        "comment": "0 where there is no data at all, the largest number where there is data everywhere" }),
    )
}

/// Of what the levels of steps were made of.
pub(crate) fn of_level_names() -> Map<String, Value> {
    attributes(
        json!({ "long_name": "SHA-256 of the values that the levels of a step were made of" }),
    )
}

/// Of the smallest and largest values of steps.
pub(crate) fn of_ranges() -> Map<String, Value> {
    attributes(
        json!({ "long_name": "smallest and largest value of a step, zeros where it has no data" }),
    )
}

/// Of the time-major copy of the values.
pub(crate) fn of_series(description: &Description) -> Map<String, Value> {
    let mut attributes = of_values(description);
    let comment = "a copy of the values for reading along time, of runs of 128 steps from the first one on; NaN, too, where a run is not made yet, which steps_sha256 tells by zeros, and at the end of the last one, which lacks the newest steps";
    add_comment(&mut attributes, comment);
    attributes
}

/// Of what the runs of the time-major copy were made of.
pub(crate) fn of_runs() -> Map<String, Value> {
    attributes(json!({ "long_name": "SHA-256 of the digests of the steps of a run" }))
}

/// Of the time coordinate.
pub fn of_time() -> Map<String, Value> {
    attributes(
        json!({ "standard_name": "time", "long_name": "time", "axis": "T", "units": TIME_UNITS,
        "calendar": "proleptic_gregorian", "bounds": "time_bnds" }),
    )
}

/// Of the first instants of steps, where the bounds of time are those of a sum.
pub fn of_step_start() -> Map<String, Value> {
    attributes(
        json!({ "long_name": "start of the step that was added last", "units": TIME_UNITS,
        "calendar": "proleptic_gregorian" }),
    )
}

/// Of the digests of values.
pub(crate) fn of_digests() -> Map<String, Value> {
    attributes(json!({ "long_name": "SHA-256 of the values of a step" }))
}

/// Of latitudes.
pub fn of_lat() -> Map<String, Value> {
    attributes(
        json!({ "standard_name": "latitude", "long_name": "latitude", "axis": "Y", "units": "degrees_north",
        "bounds": "lat_bnds" }),
    )
}

/// Of longitudes.
pub fn of_lon() -> Map<String, Value> {
    attributes(
        json!({ "standard_name": "longitude", "long_name": "longitude", "axis": "X", "units": "degrees_east",
        "bounds": "lon_bnds" }),
    )
}

/// Of the grid mapping: the ellipsoid that latitudes are on.
pub fn of_crs() -> Map<String, Value> {
    attributes(
        json!({ "grid_mapping_name": "latitude_longitude", "long_name": "WGS 84",
        "semi_major_axis": WGS84_EQUATORIAL_RADIUS_M, "semi_minor_axis": WGS84_POLAR_RADIUS_M,
        "longitude_of_prime_meridian": 0.0 }),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::quantity::{OpenQuantity, OpenWords};
    use std::collections::BTreeSet;

    #[test]
    fn every_quantity_has_a_variable_of_its_own() {
        let names: BTreeSet<_> = Quantity::ALL.map(variable).into();
        assert_eq!(names.len(), Quantity::ALL.len());
        assert_eq!(variable(Quantity::CarbonFlux), "carbon_flux");
        let open = Quantity::open("time", "1", "Time").unwrap();
        assert_eq!(variable(open), "time_values");
        // Nobody knows what those of others are.
        assert_eq!(cell_methods(open, Some(MapStatistic::Max)), None);
        let elevation = cell_methods(Quantity::Elevation, None);
        assert_eq!(elevation, Some("area: mean"));
        let with_time = Quantity::ALL.map(|quantity| cell_methods(quantity, None));
        let count = |words| with_time.iter().filter(|it| **it == Some(words)).count();
        assert_eq!(count("area: mean"), 3);
        assert_eq!(count("area: mean time: sum"), 1);
    }

    #[test]
    fn the_standard_name_of_an_open_quantity_is_that_of_its_files() {
        let plain = Quantity::open("ocean_mixed_layer_thickness", "m", "Mixed layer").unwrap();
        let Quantity::Open(open) = plain else {
            panic!("{plain:?} is built in")
        };
        let named = OpenQuantity::new(OpenWords {
            is_standard_name: true,
            ..open.words().clone()
        });
        let named = Quantity::Open(named.unwrap());
        let of = |quantity, statistic| {
            let values = of_values(&Description {
                quantity,
                statistic,
                ..crate::description::tests::description()
            });
            values.get("standard_name").cloned()
        };
        let name = Some(json!("ocean_mixed_layer_thickness"));
        for statistic in [None, Some(MapStatistic::Mean)] {
            assert_eq!(of(named, statistic), name);
            assert_eq!(of(plain, statistic), None);
        }
        assert_eq!(of(named, Some(MapStatistic::Max)), None);
    }

    /// The conventions have no name for a flux out of the sea, and who reads a file is told all the same which way it is.
    #[test]
    fn a_flux_says_that_it_is_positive_upwards_and_nothing_else_does() {
        let positive = |quantity| {
            let values = of_values(&Description {
                quantity,
                statistic: None,
                ..crate::description::tests::description()
            });
            values.get("positive").cloned()
        };
        assert_eq!(positive(Quantity::CarbonFlux), Some(json!("up")));
        let others = Quantity::ALL.into_iter().filter_map(positive);
        assert_eq!(others.count(), 1);
    }

    /// A map of highest values is none of means, whatever its quantity.
    #[test]
    fn statistics_over_time_are_named_as_the_conventions_have_it() {
        let of = |statistic: &str| {
            let statistic: MapStatistic = statistic.parse().unwrap();
            let mut description = crate::description::tests::description();
            description.statistic = Some(statistic);
            let values = of_values(&description);
            let text = |name: &str| values[name].as_str().unwrap().to_owned();
            (text("cell_methods"), text("comment"))
        };
        for (statistic, methods) in [
            ("mean", "area: mean time: mean"),
            ("min", "area: mean time: minimum"),
            ("max", "area: mean time: maximum"),
            ("median", "area: mean time: median"),
        ] {
            let (found, comment) = of(statistic);
            assert_eq!(found, methods);
            assert!(comment.starts_with("below zero"), "{comment}");
        }
        for (statistic, says) in [("p97.5", "percentile p97.5"), ("climatology", "all years")] {
            let (found, comment) = of(statistic);
            assert_eq!(found, "area: mean");
            assert!(
                comment.contains(says) && comment.contains("below zero"),
                "{comment}"
            );
        }
    }
}
