//! The functions of the air-sea flux that expressions may call: names, units and valid ranges of arguments, and their papers.

use contract::quantity::CARBON_KG_PER_MOL;

use super::unit::Unit;
use crate::air_sea::{
    fugacity, gas_transfer, ice, partial_pressure, schmidt, skin, solubility, vapour, wind,
};

/// One function of numbers.
#[derive(Debug)]
pub struct Function {
    /// As it is called.
    pub name: &'static str,
    /// What it takes.
    pub arguments: &'static [Argument],
    /// Unit of its value.
    pub gives: Unit,
    /// What its value is.
    pub what: &'static str,
    /// Author, year, DOI.
    pub source: &'static str,
    /// The function; as many numbers as there are arguments.
    pub evaluate: fn(&[f64]) -> f64,
}

/// One argument.
#[derive(Debug)]
pub struct Argument {
    /// What it is.
    pub name: &'static str,
    /// Its unit.
    pub unit: Unit,
    /// Where its paper says that the function holds; anywhere if none.
    pub range: Option<[f64; 2]>,
}

impl Function {
    /// The one of a name.
    pub fn named(name: &str) -> Option<&'static Self> {
        ALL.iter().find(|function| function.name == name)
    }

    /// `schmidt_wanninkhof2014(temperature K) 1`
    pub fn signature(&self) -> String {
        let arguments: Vec<String> = self
            .arguments
            .iter()
            .map(|argument| format!("{} {}", argument.name, argument.unit))
            .collect();
        format!("{}({}) {}", self.name, arguments.join(", "), self.gives)
    }

    /// Does its paper say that it holds for these?
    pub fn holds_for(&self, values: &[f64]) -> bool {
        let is_inside = |(argument, value): (&Argument, &f64)| match argument.range {
            Some([low, high]) => (low..=high).contains(value),
            None => true,
        };
        self.arguments.iter().zip(values).all(is_inside)
    }
}

const fn any(name: &'static str, unit: Unit) -> Argument {
    Argument {
        name,
        unit,
        range: None,
    }
}

const fn within(name: &'static str, unit: Unit, range: [f64; 2]) -> Argument {
    Argument {
        name,
        unit,
        range: Some(range),
    }
}

const WIND: Argument = any("wind", Unit::METRE_PER_SECOND);
const MOMENT2: Argument = any("wind_moment2", Unit::SPEED_2);
const MOMENT3: Argument = any("wind_moment3", Unit::SPEED_3);
const SCHMIDT: Argument = any("schmidt", Unit::ONE);
const PCO2: Argument = any("pco2", Unit::PASCAL);
const PRESSURE: Argument = any("pressure", Unit::PASCAL);
const SOLUBLE: [Argument; 2] = [
    within("temperature", Unit::KELVIN, solubility::RANGE_K),
    within("salinity", Unit::ONE, solubility::RANGE_SALINITY),
];
const FUGACIOUS: [Argument; 3] = [
    PCO2,
    within("temperature", Unit::KELVIN, fugacity::RANGE_K),
    PRESSURE,
];
const MOVED: [Argument; 3] = [PCO2, any("from", Unit::KELVIN), any("to", Unit::KELVIN)];

/// A gas-transfer velocity.
const fn velocity(
    name: &'static str,
    arguments: &'static [Argument],
    source: &'static str,
    evaluate: fn(&[f64]) -> f64,
) -> Function {
    Function {
        name,
        arguments,
        gives: Unit::METRE_PER_SECOND,
        what: "gas-transfer velocity of CO2",
        source,
        evaluate,
    }
}

/// Every function, in the order of a computation.
pub const ALL: &[Function] = &[
    velocity(
        "gas_transfer_wanninkhof2014",
        &[MOMENT2, SCHMIDT],
        "Wanninkhof (2014), doi:10.4319/lom.2014.12.351",
        |x| gas_transfer::wanninkhof2014(x[0], x[1]),
    ),
    velocity(
        "gas_transfer_wanninkhof1992",
        &[MOMENT2, SCHMIDT],
        "Wanninkhof (1992), doi:10.1029/92JC00188",
        |x| gas_transfer::wanninkhof1992(x[0], x[1]),
    ),
    velocity(
        "gas_transfer_nightingale2000",
        &[WIND, MOMENT2, SCHMIDT],
        "Nightingale et al. (2000), doi:10.1029/1999GB900091",
        |x| gas_transfer::nightingale2000(x[0], x[1], x[2]),
    ),
    velocity(
        "gas_transfer_ho2006",
        &[MOMENT2, SCHMIDT],
        "Ho et al. (2006), doi:10.1029/2006GL026817",
        |x| gas_transfer::ho2006(x[0], x[1]),
    ),
    velocity(
        "gas_transfer_sweeney2007",
        &[MOMENT2, SCHMIDT],
        "Sweeney et al. (2007), doi:10.1029/2006GB002784",
        |x| gas_transfer::sweeney2007(x[0], x[1]),
    ),
    velocity(
        "gas_transfer_takahashi2009",
        &[MOMENT2, SCHMIDT],
        "Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009",
        |x| gas_transfer::takahashi2009(x[0], x[1]),
    ),
    velocity(
        "gas_transfer_wanninkhof2009",
        &[WIND, MOMENT2, MOMENT3, SCHMIDT],
        "Wanninkhof et al. (2009), doi:10.1146/annurev.marine.010908.163742",
        |x| gas_transfer::wanninkhof2009(x[0], x[1], x[2], x[3]),
    ),
    velocity(
        "gas_transfer_wanninkhof_mcgillis1999",
        &[MOMENT3, SCHMIDT],
        "Wanninkhof and McGillis (1999), doi:10.1029/1999GL900363",
        |x| gas_transfer::wanninkhof_mcgillis1999(x[0], x[1]),
    ),
    velocity(
        "gas_transfer_mcgillis2001",
        &[MOMENT3, SCHMIDT],
        "McGillis et al. (2001), doi:10.1029/2000JC000506",
        |x| gas_transfer::mcgillis2001(x[0], x[1]),
    ),
    velocity(
        "gas_transfer_liss_merlivat1986",
        &[WIND, SCHMIDT],
        "Liss and Merlivat (1986), doi:10.1007/978-94-009-4738-2_5",
        |x| gas_transfer::liss_merlivat1986(x[0], x[1]),
    ),
    Function {
        name: "schmidt_wanninkhof2014",
        arguments: &[within("temperature", Unit::KELVIN, schmidt::RANGE_2014_K)],
        gives: Unit::ONE,
        what: "Schmidt number of CO2 in sea water",
        source: "Wanninkhof (2014), doi:10.4319/lom.2014.12.351",
        evaluate: |x| schmidt::wanninkhof2014(x[0]),
    },
    Function {
        name: "schmidt_wanninkhof1992",
        arguments: &[within("temperature", Unit::KELVIN, schmidt::RANGE_1992_K)],
        gives: Unit::ONE,
        what: "Schmidt number of CO2 in sea water",
        source: "Wanninkhof (1992), doi:10.1029/92JC00188",
        evaluate: |x| schmidt::wanninkhof1992(x[0]),
    },
    Function {
        name: "solubility_weiss1974",
        arguments: &SOLUBLE,
        gives: Unit::MOL_PER_M3_PASCAL,
        what: "solubility of CO2 in a volume of sea water",
        source: "Weiss (1974), doi:10.1016/0304-4203(74)90015-2",
        evaluate: |x| solubility::weiss1974(x[0], x[1]),
    },
    Function {
        name: "solubility_weiss1974_mass",
        arguments: &SOLUBLE,
        gives: Unit::MOL_PER_KG_PASCAL,
        what: "solubility of CO2 in a mass of sea water",
        source: "Weiss (1974), doi:10.1016/0304-4203(74)90015-2",
        evaluate: |x| solubility::weiss1974_mass(x[0], x[1]),
    },
    Function {
        name: "vapour_weiss_price1980",
        arguments: &[
            within("temperature", Unit::KELVIN, vapour::RANGE_K),
            within("salinity", Unit::ONE, vapour::RANGE_SALINITY),
        ],
        gives: Unit::PASCAL,
        what: "pressure of water vapour over sea water",
        source: "Weiss and Price (1980), doi:10.1016/0304-4203(80)90024-9",
        evaluate: |x| vapour::weiss_price1980(x[0], x[1]),
    },
    Function {
        name: "pco2_in_wet_air",
        arguments: &[
            any("dry_mole_fraction", Unit::ONE),
            PRESSURE,
            any("vapour", Unit::PASCAL),
        ],
        gives: Unit::PASCAL,
        what: "partial pressure of CO2 in air at the surface",
        source: "Dickson et al. (2007), PICES special publication 3",
        evaluate: |x| partial_pressure::in_wet_air(x[0], x[1], x[2]),
    },
    Function {
        name: "fco2_of_pco2_weiss1974",
        arguments: &FUGACIOUS,
        gives: Unit::PASCAL,
        what: "fugacity of a partial pressure of CO2",
        source: "Weiss (1974), doi:10.1016/0304-4203(74)90015-2",
        evaluate: |x| fugacity::of_partial_pressure(x[0], x[1], x[2]),
    },
    Function {
        name: "pco2_of_fco2_weiss1974",
        arguments: &FUGACIOUS,
        gives: Unit::PASCAL,
        what: "partial pressure of a fugacity of CO2",
        source: "Weiss (1974), doi:10.1016/0304-4203(74)90015-2",
        evaluate: |x| fugacity::to_partial_pressure(x[0], x[1], x[2]),
    },
    Function {
        name: "pco2_at_temperature_takahashi1993",
        arguments: &MOVED,
        gives: Unit::PASCAL,
        what: "partial pressure of CO2 in water brought to another temperature",
        source: "Takahashi et al. (1993), doi:10.1029/93GB02263",
        evaluate: |x| partial_pressure::at_temperature_takahashi1993(x[0], x[1], x[2]),
    },
    Function {
        name: "pco2_at_temperature_takahashi2009",
        arguments: &MOVED,
        gives: Unit::PASCAL,
        what: "partial pressure of CO2 in water brought to another temperature",
        source: "Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009",
        evaluate: |x| partial_pressure::at_temperature_takahashi2009(x[0], x[1], x[2]),
    },
    Function {
        name: "cool_skin_donlon2002",
        arguments: &[WIND],
        gives: Unit::KELVIN,
        what: "skin less subskin temperature, negative",
        source: "Donlon et al. (2002), doi:10.1175/1520-0442(2002)015<0353:TIVOTS>2.0.CO;2",
        evaluate: |x| skin::donlon2002(x[0]),
    },
    Function {
        name: "wind_moment2_rayleigh",
        arguments: &[WIND],
        gives: Unit::SPEED_2,
        what: "mean of the wind's square from its mean",
        source: "Wanninkhof (1992), doi:10.1029/92JC00188",
        evaluate: |x| wind::moment2_rayleigh(x[0]),
    },
    Function {
        name: "wind_moment3_rayleigh",
        arguments: &[WIND],
        gives: Unit::SPEED_3,
        what: "mean of the wind's cube from its mean",
        source: "Wanninkhof (1992), doi:10.1029/92JC00188",
        evaluate: |x| wind::moment3_rayleigh(x[0]),
    },
    Function {
        name: "open_water_takahashi2009",
        arguments: &[within("ice", Unit::ONE, [0.0, 1.0])],
        gives: Unit::ONE,
        what: "share of the sea that is open under ice with leads",
        source: "Takahashi et al. (2009), doi:10.1016/j.dsr2.2008.12.009",
        evaluate: |x| ice::open_water_takahashi2009(x[0]),
    },
    Function {
        name: "carbon_kg_per_mol",
        arguments: &[],
        gives: Unit::KG_PER_MOL,
        what: "mass of carbon in a mole of CO2",
        source: "IUPAC (2021) standard atomic weights",
        evaluate: |_| CARBON_KG_PER_MOL,
    },
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_function_has_a_name_of_its_own_and_holds_in_the_middle_of_its_ranges() {
        for function in ALL {
            let same = ALL.iter().filter(|other| other.name == function.name);
            assert_eq!(same.count(), 1, "{}", function.name);
            let middle = |argument: &Argument| match argument.range {
                Some([low, high]) => f64::midpoint(low, high),
                None => 7.0,
            };
            let values: Vec<f64> = function.arguments.iter().map(middle).collect();
            assert!(function.holds_for(&values), "{}", function.name);
            assert!(
                (function.evaluate)(&values).is_finite(),
                "{}",
                function.name
            );
        }
        let schmidt = Function::named("schmidt_wanninkhof1992").unwrap();
        assert!(!schmidt.holds_for(&[271.3]));
        assert_eq!(
            schmidt.signature(),
            "schmidt_wanninkhof1992(temperature K) 1"
        );
    }
}
