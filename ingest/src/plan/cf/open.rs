//! What a variable becomes that no quantity of our own is for: an open quantity by its standard name, else by its long
//! name or its own, and in its unit.

use contract::event::RejectReason;
use contract::quantity::{
    DIRECTION_WORDS, MAX_NAME_BYTES, MAX_TITLE_BYTES, MAX_UNIT_BYTES, OpenQuantity, OpenWords,
    Quantity, units_per_turn,
};

use crate::error::Rejection;
use crate::inspect::file::description::Variable;
use crate::plan::unit;

/// The unit of directions, so that files of one product need not spell it alike.
const DEGREE: &str = "degree";
/// Words of things that stay as they are: masks and regions, relief, sizes of cells.
const FIXED_WORDS: [&str; 17] = [
    "mask",
    "land",
    "basin",
    "basins",
    "region",
    "regions",
    "province",
    "provinces",
    "biome",
    "biomes",
    "bathymetry",
    "topography",
    "relief",
    "orography",
    "altitude",
    "area",
    "landmask",
];
/// Words of what does not: a mask of these is one of its time.
const CHANGING_WORDS: [&str; 8] = [
    "ice", "snow", "cloud", "rain", "burned", "burnt", "flood", "bloom",
];

/// The open quantity of a variable; a unit that it does not state is `1`, as CF says.
pub(crate) fn quantity(variable: &Variable) -> Result<Quantity, Rejection> {
    let text = |name: &str| {
        let text = variable.attributes.text(name)?;
        (!text.is_empty()).then_some(text)
    };
    let refused = |reason, detail: String| Err(Rejection::new(reason, &variable.name, detail));
    let names = [
        text("standard_name"),
        text("long_name"),
        Some(&variable.name),
    ];
    let Some(name) = names.into_iter().flatten().find_map(plain_name) else {
        let detail = "gives no name for what it is; say in a profile what its quantity is";
        return refused(RejectReason::NoVariable, detail.to_owned());
    };
    let spelling = stated_unit(variable).unwrap_or("1");
    let is_direction = is_direction(&name, spelling);
    if is_direction && units_per_turn(spelling).is_none() {
        let detail = format!(
            "is a direction in {spelling:?}, which is no angle that is read; give it in degree"
        );
        return refused(RejectReason::Unit, detail);
    }
    let title =
        text("long_name").map_or_else(|| name.replace('_', " "), |long| cut(long, MAX_TITLE_BYTES));
    let words = OpenWords {
        unit: if is_direction {
            DEGREE.to_owned()
        } else {
            unit::canonical(spelling)
                .map_or_else(|| cut(spelling, MAX_UNIT_BYTES), |(unit, _)| unit)
        },
        title,
        range: None,
        flags: vec![],
        // Of one with a modifier the name is no standard name any more, nor of what is none by its letters.
        is_standard_name: text("standard_name") == Some(name.as_str()),
        name,
    };
    match OpenQuantity::new(words) {
        Ok(open) => Ok(Quantity::Open(open)),
        Err(error) => refused(
            RejectReason::NoVariable,
            format!("cannot be named: {error}"),
        ),
    }
}

/// The unit that a variable states, however the attribute is called.
pub(crate) fn stated_unit(variable: &Variable) -> Option<&str> {
    ["units", "Units", "unit", "Unit"]
        .into_iter()
        .find_map(|name| variable.attributes.text(name))
        .filter(|text| !text.is_empty())
}

/// Is it of something that holds at any time?
pub(crate) fn is_fixed(quantity: Quantity) -> bool {
    match quantity {
        Quantity::Elevation | Quantity::SeaAreaFraction | Quantity::LandAreaFraction => true,
        Quantity::Open(open) => {
            let has = |known: &[&str]| {
                open.words()
                    .name
                    .split('_')
                    .any(|word| known.contains(&word))
            };
            has(&FIXED_WORDS) && !has(&CHANGING_WORDS)
        }
        _ => false,
    }
}

/// Is it where something comes from or goes to, in degrees, however these are spelt?
fn is_direction(name: &str, unit: &str) -> bool {
    let is_one = |word: &str| DIRECTION_WORDS.contains(&word);
    name.split('_').any(is_one) && (unit == "°" || unit.to_ascii_lowercase().contains("deg"))
}

/// `Sea Surface Temp. (day)` as `sea_surface_temp_day`, and the `₂` of `CO₂` as the digit it is; none if no letter is in it.
pub(crate) fn plain_name(text: &str) -> Option<String> {
    let letters = text.chars().map(|c| match c {
        '\u{2080}'..='\u{2089}' => char::from(b'0' + (u32::from(c) - 0x2080) as u8),
        _ if c.is_ascii_alphanumeric() => c.to_ascii_lowercase(),
        _ => ' ',
    });
    let joined = letters
        .collect::<String>()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join("_");
    let name = joined.trim_start_matches(|c: char| !c.is_ascii_lowercase());
    let name = name.get(..name.len().min(MAX_NAME_BYTES))?;
    (!name.is_empty()).then(|| name.to_owned())
}

/// Text on one line of at most so many bytes.
fn cut(text: &str, most: usize) -> String {
    let mut plain = String::new();
    for c in text.chars().map(|c| if c.is_control() { ' ' } else { c }) {
        if plain.len() + c.len_utf8() > most {
            break;
        }
        plain.push(c);
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{AttributeValue, Kind};

    fn variable(name: &str, attributes: &[(&str, &str)]) -> Variable {
        let text = |(name, value): &(&str, &str)| {
            let value = AttributeValue::Text((*value).to_owned());
            ((*name).to_owned(), value)
        };
        Variable {
            name: name.to_owned(),
            dimensions: vec![],
            kind: Kind::Float(4),
            attributes: attributes.iter().map(text).collect(),
        }
    }

    fn words(name: &str, attributes: &[(&str, &str)]) -> (String, String, String) {
        let Ok(Quantity::Open(open)) = quantity(&variable(name, attributes)) else {
            panic!("no open quantity")
        };
        let OpenWords {
            name, unit, title, ..
        } = open.words().clone();
        (name, unit, title)
    }

    fn three(name: &str, unit: &str, title: &str) -> (String, String, String) {
        (name.to_owned(), unit.to_owned(), title.to_owned())
    }

    #[test]
    fn a_variable_is_named_by_its_standard_name_then_its_long_name_then_its_own() {
        let standard = ("standard_name", "sea-mask");
        let long = ("long_name", "River DIC flux (yearly)");
        assert_eq!(
            words("V", &[standard, long]),
            three("sea_mask", "1", "River DIC flux (yearly)")
        );
        assert_eq!(words("V", &[long]).0, "river_dic_flux_yearly");
        let lowered = ("long_name", "Air-sea CO₂ flux");
        assert_eq!(words("V", &[lowered]).0, "air_sea_co2_flux");
        assert_eq!(
            words("_2Tm", &[("long_name", "3²")]),
            three("tm", "1", "3²")
        );
        assert!(quantity(&variable("___", &[])).is_err());
    }

    #[test]
    fn a_name_is_a_standard_name_where_the_file_says_so_in_its_letters() {
        let is_one = |attributes: &[(&str, &str)]| {
            let Ok(Quantity::Open(open)) = quantity(&variable("v", attributes)) else {
                panic!("no open quantity")
            };
            open.words().is_standard_name
        };
        let named = |name| is_one(&[("standard_name", name), ("long_name", "Heat")]);
        assert!(named("surface_downward_heat_flux_in_sea_water"));
        assert!(!named(
            "surface_downward_heat_flux_in_sea_water standard_error"
        ));
        assert!(!named("Sea-Mask") && !named(""));
        assert!(!is_one(&[("long_name", "heat")]));
    }

    #[test]
    fn units_become_canonical_where_nothing_is_lost_and_else_stay() {
        let unit = |text| words("v", &[("units", text)]).1;
        for (spelling, stored) in [
            ("mmol/m^2/day", "mol m-2 s-1"),
            ("M/S", "m s-1"),
            ("percent", "1"),
            ("hPa", "Pa"),
            ("W m-2", "W m-2"),
            // A difference of temperatures must not be moved by 273.15, a month has no one length, carbon is no other mass.
            ("degC", "degC"),
            ("mm/month", "mm/month"),
            ("mg C m-2 d-1", "mg C m-2 d-1"),
            ("dB", "dB"),
        ] {
            assert_eq!(unit(spelling), stored, "{spelling}");
        }
    }

    #[test]
    fn directions_are_what_they_are_in_degrees_however_these_are_spelt() {
        let of = |unit: &str| {
            let named = ("standard_name", "wind_from_direction");
            quantity(&variable("d", &[named, ("units", unit)]))
        };
        for spelling in ["degree", "degrees", "Degrees_true", "deg", "°"] {
            let wind = of(spelling).unwrap();
            assert!(wind.is_direction(), "{spelling}");
            assert_eq!(wind.unit(), "degree", "{spelling}");
        }
        let refused = of("degrees clockwise from north").unwrap_err();
        assert!(refused.to_string().contains("no angle"), "{refused}");
        let code = [("long_name", "direction code"), ("units", "1")];
        assert!(!quantity(&variable("d", &code)).unwrap().is_direction());
    }

    #[test]
    fn masks_of_land_hold_at_any_time_and_masks_of_ice_do_not() {
        let fixed = |name| is_fixed(quantity(&variable(name, &[])).unwrap());
        assert!(fixed("sea-mask") && fixed("land_proportion") && fixed("cell_area"));
        assert!(!fixed("sea_ice_mask") && !fixed("salinity") && !fixed("landing"));
        assert!(is_fixed(Quantity::Elevation) && !is_fixed(Quantity::CarbonFlux));
    }
}
