//! Maps on other axes than latitude and longitude: told by grid mapping, standard name or unit, and refused.

use contract::event::RejectReason;

use crate::error::Rejection;
use crate::inspect::file::description::{Description, Variable};

const ADVICE: &str = "regrid it to regular latitudes and longitudes first (cdo remapbil,r360x180 IN OUT, or gdalwarp -t_srs EPSG:4326)";
/// The one grid mapping whose axes are latitude and longitude.
const GEOGRAPHIC: &str = "latitude_longitude";

/// Refuses a variable whose grid mapping, or the coordinate of one of whose dimensions, is of a projection.
pub(crate) fn check(file: &Description, variable: &Variable) -> Result<(), Rejection> {
    check_mapping(file, variable)?;
    let coordinates = variable.dimensions.iter().filter_map(|dimension| {
        let coordinate = file.variable(dimension.name.as_deref()?)?;
        // What is measured in metres may be a depth.
        let is_level = |v: &Variable| {
            v.attributes.text("positive").is_some()
                || v.attributes
                    .text("axis")
                    .is_some_and(|axis| axis.eq_ignore_ascii_case("z"))
        };
        (coordinate.is_coordinate() && !is_level(coordinate)).then_some(coordinate)
    });
    coordinates.into_iter().try_for_each(check_coordinate)
}

/// Refuses a coordinate variable that is one of a projection.
pub(crate) fn check_coordinate(coordinate: &Variable) -> Result<(), Rejection> {
    let Some((attribute, value)) = of_coordinate(coordinate) else {
        return Ok(());
    };
    let is_horizontal = attribute != "units"
        || ["x", "y"].iter().any(|axis| {
            let says = coordinate.attributes.text("axis");
            says.is_some_and(|says| says.eq_ignore_ascii_case(axis))
        })
        || is_horizontal_name(&coordinate.name);
    if !is_horizontal {
        return Ok(());
    }
    let detail = format!("has {attribute} {value:?}, so it is no latitude or longitude; {ADVICE}");
    Err(Rejection::new(RejectReason::Grid, &coordinate.name, detail))
}

/// The attribute, and its value, by which a variable cannot be a latitude or longitude.
pub(crate) fn of_coordinate(variable: &Variable) -> Option<(&'static str, &str)> {
    let standard_name = variable
        .attributes
        .text("standard_name")
        .unwrap_or_default();
    let lower = standard_name.to_ascii_lowercase();
    if lower.starts_with("projection_") || lower == "grid_latitude" || lower == "grid_longitude" {
        return Some(("standard_name", standard_name));
    }
    let units = variable.attributes.text("units").unwrap_or_default();
    let is_place = matches!(lower.as_str(), "latitude" | "longitude");
    let is_wrong = if is_place || is_horizontal_name(&variable.name) {
        // An angle in degrees, however it is spelt, or nothing.
        !(units.is_empty()
            || units.to_ascii_lowercase().contains("deg")
            || units.contains('\u{b0}'))
    } else {
        is_length(units)
    };
    is_wrong.then_some(("units", units))
}

fn is_length(units: &str) -> bool {
    let words = [
        "m",
        "km",
        "metre",
        "metres",
        "meter",
        "meters",
        "kilometre",
        "kilometres",
        "kilometer",
        "kilometers",
    ];
    words.iter().any(|word| units.eq_ignore_ascii_case(word))
}

/// Is it called as latitudes and longitudes are, or as the axes of a map?
fn is_horizontal_name(name: &str) -> bool {
    let names = [
        "lat",
        "latitude",
        "nav_lat",
        "lon",
        "longitude",
        "nav_lon",
        "x",
        "y",
        "rlat",
        "rlon",
        "easting",
        "northing",
    ];
    names.iter().any(|known| name.eq_ignore_ascii_case(known))
}

fn check_mapping(file: &Description, variable: &Variable) -> Result<(), Rejection> {
    let Some(text) = variable.attributes.text("grid_mapping") else {
        return Ok(());
    };
    let refused = |name: &str, said: String| {
        let detail =
            format!("is on a map projection: its grid_mapping {name:?} has {said}; {ADVICE}");
        Err(Rejection::new(RejectReason::Grid, &variable.name, detail))
    };
    for name in mappings(text, variable) {
        let Some(mapping) = file.variable(name) else {
            continue;
        };
        let attribute = |name| mapping.attributes.text(name).filter(|t| !t.is_empty());
        let said = attribute("grid_mapping_name");
        if let Some(said) = said.filter(|said| !said.eq_ignore_ascii_case(GEOGRAPHIC)) {
            return refused(name, format!("grid_mapping_name {said:?}"));
        }
        let meridian = mapping.attributes.number("longitude_of_prime_meridian");
        if let Some(meridian) = meridian.filter(|meridian| *meridian != 0.0) {
            let detail = format!(
                "counts longitudes from {meridian} degrees east (longitude_of_prime_meridian of its grid_mapping {name:?}); give them from Greenwich"
            );
            return Err(Rejection::new(RejectReason::Grid, &variable.name, detail));
        }
        let wkt = attribute("crs_wkt").or_else(|| attribute("spatial_ref"));
        let is_projected = |wkt: &&str| wkt.to_ascii_uppercase().starts_with("PROJ");
        if said.is_none() && wkt.as_ref().is_some_and(is_projected) {
            return refused(name, "a projected coordinate reference system".to_owned());
        }
    }
    Ok(())
}

/// The mappings of a variable's own axes: `crs`, or those of `crs: x y geographic: lat lon` that speak of its dimensions.
fn mappings<'a>(text: &'a str, variable: &Variable) -> Vec<&'a str> {
    if !text.contains(':') {
        return vec![text];
    }
    let is_own = |word: &str| {
        let mut names = variable.dimensions.iter().filter_map(|d| d.name.as_deref());
        names.any(|name| name == word)
    };
    let (mut found, mut current) = (vec![], "");
    for word in text.split_whitespace() {
        match word.strip_suffix(':') {
            Some(name) => current = name,
            None if is_own(word) && !found.contains(&current) => found.push(current),
            None => {}
        }
    }
    found
}

/// The mapping that a variable names and the file lacks.
pub(crate) fn missing<'a>(file: &Description, variable: &'a Variable) -> Option<&'a str> {
    let text = variable.attributes.text("grid_mapping")?;
    mappings(text, variable)
        .into_iter()
        .find(|name| !name.is_empty() && file.variable(name).is_none())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{AttributeValue, Dimension, Kind};

    fn variable(name: &str, dimensions: &[&str], attributes: &[(&str, &str)]) -> Variable {
        let text = |(name, value): &(&str, &str)| {
            (
                (*name).to_owned(),
                AttributeValue::Text((*value).to_owned()),
            )
        };
        let dimension = |name: &&str| Dimension {
            name: Some((*name).to_owned()),
            len: 4,
        };
        Variable {
            name: name.to_owned(),
            dimensions: dimensions.iter().map(dimension).collect(),
            kind: Kind::Float(8),
            attributes: attributes.iter().map(text).collect(),
        }
    }

    fn file(variables: &[Variable]) -> Description {
        Description {
            variables: variables.to_vec(),
            ..Description::default()
        }
    }

    #[test]
    fn only_the_mapping_of_the_variables_own_axes_counts() {
        let maps = [
            variable("crs", &[], &[("grid_mapping_name", "transverse_mercator")]),
            variable("geo", &[], &[("grid_mapping_name", "latitude_longitude")]),
        ];
        let mapping = "crs: x y geo: lat lon";
        let on = |dimensions| variable("v", dimensions, &[("grid_mapping", mapping)]);
        assert!(check(&file(&maps), &on(&["lat", "lon"])).is_ok());
        let refused = check(&file(&maps), &on(&["y", "x"]))
            .unwrap_err()
            .to_string();
        assert!(
            refused.contains("v: ") && refused.contains("transverse_mercator"),
            "{refused}"
        );
        assert!(refused.contains("gdalwarp"), "{refused}");
    }

    #[test]
    fn a_reference_system_that_is_projected_is_refused_without_a_name() {
        for (wkt, is_fine) in [("PROJCS[\"UTM\"]", false), ("GEOGCS[\"WGS 84\"]", true)] {
            let maps = [variable("crs", &[], &[("spatial_ref", wkt)])];
            let v = variable("v", &["lat", "lon"], &[("grid_mapping", "crs")]);
            assert_eq!(check(&file(&maps), &v).is_ok(), is_fine, "{wkt}");
        }
    }

    #[test]
    fn depths_in_metres_are_no_projection() {
        let depth = variable("depth", &["depth"], &[("units", "m"), ("positive", "down")]);
        let level = variable("lev", &["lev"], &[("units", "m")]);
        let v = variable("v", &["depth", "lev"], &[]);
        assert!(check(&file(&[depth, level]), &v).is_ok());
    }
}
