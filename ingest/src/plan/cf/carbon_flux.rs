//! A flux of CO2 between sea and air that no standard name names: told by its unit and its names, and taken for a carbon flux
//! where it also says which way it is positive, and of what its mass is.

use contract::quantity::Quantity;

use super::open;
use super::quantity::{Named, directions};
use crate::inspect::file::description::Variable;
use crate::plan::unit::{self, Substance};

/// The name that the tables of CMIP have for the flux into the sea.
const OF_MODELS: &str = "fgco2";
/// Words of other fluxes of carbon, and of what is said about one.
const OTHERS: [&str; 27] = [
    "organic",
    "inorganic",
    "particulate",
    "dissolved",
    "river",
    "rivers",
    "riverine",
    "export",
    "sinking",
    "burial",
    "sediment",
    "land",
    "terrestrial",
    "soil",
    "fire",
    "fossil",
    "error",
    "uncertainty",
    "std",
    "stddev",
    "deviation",
    "variance",
    "anomaly",
    "trend",
    "count",
    "flag",
    "mask",
];

/// What is not said of a flux of CO2, without which its budget could be wrong.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Untold {
    /// Which way it is positive.
    Direction,
    /// Whether its mass is that of carbon or of CO2.
    Substance,
}

impl Untold {
    /// One line for who lands the file.
    pub(crate) fn note(self, variable: &str) -> String {
        let (untold, attributes) = match self {
            Self::Direction => (
                "nothing says which way it is positive",
                "a standard_name or positive = \"up\" (out of the sea) or \"down\"",
            ),
            Self::Substance => (
                "nothing says whether its mass is that of carbon or of CO2",
                "a standard_name or a unit such as \"kg C m-2 s-1\"",
            ),
        };
        format!(
            "{variable}: not taken for a carbon flux, so that it has no budget: {untold}; give it {attributes}, or land it by a profile with quantity = \"carbon_flux\""
        )
    }
}

/// None of what is no flux of CO2 by unit and names, or has a standard name, which says what it is.
pub(crate) fn told(variable: &Variable) -> Option<Result<Named, Untold>> {
    let text = |name: &str| variable.attributes.text(name).unwrap_or_default();
    if !text("standard_name").is_empty() || !is_called_so([&variable.name, text("long_name")]) {
        return None;
    }
    let unit = unit::parse(open::stated_unit(variable)?).ok()?;
    let to_flux = |substance| unit.to_quantity(Quantity::CarbonFlux, substance);
    to_flux(Some(Substance::Carbon)).ok()?;
    if directions("", text("positive")).is_empty() {
        return Some(Err(Untold::Direction));
    }
    if to_flux(None).is_err() {
        return Some(Err(Untold::Substance));
    }
    Some(Ok(Named {
        quantity: Quantity::CarbonFlux,
        sign: 1.0,
        substance: None,
    }))
}

fn is_called_so(names: [&str; 2]) -> bool {
    let plain: Vec<String> = names.into_iter().filter_map(open::plain_name).collect();
    let has = |name: &str, known: &[&str]| name.split('_').any(|word| known.contains(&word));
    let is_one = |name: &String| {
        let is_of_carbon = name.contains("co2") || has(name, &["carbon"]);
        name == OF_MODELS || is_of_carbon && name.contains("flux")
    };
    plain.iter().any(is_one) && !plain.iter().any(|name| has(name, &OTHERS))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{AttributeValue, Kind};

    fn of(name: &str, attributes: &[(&str, &str)]) -> Option<Result<Quantity, Untold>> {
        let text = |(name, value): &(&str, &str)| {
            let value = AttributeValue::Text((*value).to_owned());
            ((*name).to_owned(), value)
        };
        let variable = Variable {
            name: name.to_owned(),
            dimensions: vec![],
            kind: Kind::Float(4),
            attributes: attributes.iter().map(text).collect(),
        };
        Some(told(&variable)?.map(|named| named.quantity))
    }

    #[test]
    fn a_flux_of_co2_is_told_by_its_unit_and_one_of_its_names() {
        let moles = ("units", "mol m-2 s-1");
        for (name, attributes) in [
            ("fgco2", vec![moles]),
            ("FGCO2", vec![("units", "gC m-2 day-1")]),
            (
                "f",
                vec![("long_name", "air-sea CO2 flux"), ("units", "mol m-2 yr-1")],
            ),
            (
                "f",
                vec![
                    ("long_name", "Sea-air CO₂ flux"),
                    ("units", "g m-2 month-1"),
                ],
            ),
            ("carbon_flux", vec![("units", "kg m-2 s-1")]),
        ] {
            let found = of(name, &attributes);
            assert_eq!(found, Some(Err(Untold::Direction)), "{name} {attributes:?}");
        }
        for (name, attributes) in [
            // Not by its unit, not by its names, and by its standard name something else.
            ("fgco2", vec![("units", "W m-2")]),
            ("fgco2", vec![]),
            ("spco2", vec![moles]),
            (
                "f",
                vec![("long_name", "Flux of particulate organic carbon"), moles],
            ),
            ("fgco2", vec![("long_name", "CO2 flux uncertainty"), moles]),
            (
                "fgco2",
                vec![("standard_name", "mole_flux_of_something"), moles],
            ),
        ] {
            assert_eq!(of(name, &attributes), None, "{name} {attributes:?}");
        }
    }

    #[test]
    fn one_that_says_its_direction_and_its_substance_is_a_carbon_flux() {
        let of_unit = |unit| of("fgco2", &[("units", unit), ("positive", "down")]);
        for unit in ["mol m-2 s-1", "g C m-2 d-1", "kg CO2 m-2 s-1"] {
            assert_eq!(of_unit(unit), Some(Ok(Quantity::CarbonFlux)), "{unit}");
        }
        assert_eq!(of_unit("kg m-2 s-1"), Some(Err(Untold::Substance)));
        let odd = [("units", "mol m-2 s-1"), ("positive", "east")];
        assert_eq!(of("fgco2", &odd), Some(Err(Untold::Direction)));
    }

    #[test]
    fn notes_are_one_line_that_is_not_cut() {
        for untold in [Untold::Direction, Untold::Substance] {
            let note = untold.note("air_sea_co2_flux");
            assert!(note.len() < 300 && note.contains("carbon_flux\""), "{note}");
        }
    }
}
