//! The air-sea flux of CO2 as an expression: products and choices in, the text that computes it and its inputs out.
//!
//! `F = k (K0_below pCO2_water - K0_skin pCO2_air) open` with carbon's mass, kg m⁻² s⁻¹, positive out of the sea: the `rapid`
//! form of Woolf et al. (2016, doi:10.1002/2015JC011427), in which the gas is dissolved below the skin and enters at it. Where
//! one temperature is given it is that of both, the bulk formula (Wanninkhof 2014, doi:10.4319/lom.2014.12.351, eq. 6).

use contract::computed::Matching;
use contract::product::ProductId;

use crate::ComputeError;

/// Which gas-transfer velocity. Those of long names are functions `gas_transfer_...`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum GasTransfer {
    /// 0.251 U².
    #[default]
    Wanninkhof2014,
    /// 0.31 U².
    Wanninkhof1992,
    /// 0.222 U² + 0.333 U.
    Nightingale2000,
    /// 0.266 U².
    Ho2006,
    /// 0.27 U².
    Sweeney2007,
    /// 0.26 U².
    Takahashi2009,
    /// 3 + 0.1 U + 0.064 U² + 0.011 U³.
    Wanninkhof2009,
    /// 0.0283 U³.
    WanninkhofMcgillis1999,
    /// 3.3 + 0.026 U³.
    Mcgillis2001,
    /// Three straight lines.
    LissMerlivat1986,
}

/// Which fit of the Schmidt number.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Schmidt {
    /// -2 to 40 °C.
    #[default]
    Wanninkhof2014,
    /// 0 to 30 °C.
    Wanninkhof1992,
}

/// Which solubility; both are of Weiss (1974).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Solubility {
    /// Of a volume of water.
    #[default]
    Volume,
    /// Of a mass of water, a litre of which is taken for a kilogram: 2 to 3 % less, as FluxEngine has it.
    LitreIsKilogram,
}

/// How ice closes the sea.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Ice {
    /// `1 - ice`.
    #[default]
    Linear,
    /// Up to a tenth does not count, and a tenth of a closed cover is open (Takahashi et al. 2009).
    Leads,
}

/// The temperature below the skin.
#[derive(Debug, Clone, PartialEq)]
pub enum Below {
    /// That of the skin: the bulk formula.
    Skin,
    /// So many kelvin warmer than the skin, everywhere.
    Warmer {
        /// 0.17 is usual.
        by_k: f64,
    },
    /// Warmer by the cool skin of Donlon et al. (2002), which depends on the wind.
    Donlon2002,
    /// A product of its own, subskin or foundation.
    Product,
}

/// A product and which of its steps counts.
pub type Source = (ProductId, Matching);

/// Products and choices.
#[derive(Debug, Clone, PartialEq)]
pub struct Co2Flux {
    /// By name: `pco2_water` or `fco2_water`; `pco2_air`, `fco2_air` or `dry_mole_fraction`; `pressure`, `temperature`, `below`,
    /// `temperature_of_pco2`, `salinity`, `wind`, `wind_moment2`, `wind_moment3`, `ice`.
    pub sources: Vec<(&'static str, Source)>,
    /// Transfer velocity.
    pub gas_transfer: GasTransfer,
    /// Schmidt number.
    pub schmidt: Schmidt,
    /// Solubility.
    pub solubility: Solubility,
    /// Ice, if there is a product of it.
    pub ice: Ice,
    /// Cells where the ice is not known are open sea.
    pub no_ice_is_open: bool,
    /// Temperature below the skin.
    pub below: Below,
    /// How much saltier the skin is, 1.
    pub salty_skin: f64,
}

impl Co2Flux {
    /// The expression, over the names of `sources` that it needs.
    ///
    /// # Errors
    /// A product is missing that the choices need, or one is there that they do not.
    pub fn expression(&self) -> Result<String, ComputeError> {
        let (water, air) = self.pressures()?;
        let (below, skin) = (self.below()?, "temperature");
        let salinity = self.name("salinity")?;
        let skin_salinity = self.skin_salinity();
        let velocity = self.velocity()?;
        let (k0_below, k0_skin) = (
            self.solubility(&below, salinity),
            self.solubility(skin, &skin_salinity),
        );
        let text = format!(
            "carbon_kg_per_mol() * {velocity} * ({k0_below} * {water} - {k0_skin} * {air}){}",
            self.open_water()
        );
        let unused = self.sources.iter().find(|(name, _)| !names(&text, name));
        match unused {
            Some((name, (product, _))) => Err(refused(format!(
                "{product} is given as {name}, which this choice does not need"
            ))),
            None => Ok(text),
        }
    }

    fn has(&self, name: &str) -> bool {
        self.sources.iter().any(|(own, _)| *own == name)
    }

    fn name(&self, name: &'static str) -> Result<&'static str, ComputeError> {
        if self.has(name) {
            return Ok(name);
        }
        Err(refused(format!(
            "a product of {name} is needed: --{}",
            name.replace('_', "-")
        )))
    }

    /// Of water and air, both partial pressures or both fugacities, Pa.
    fn pressures(&self) -> Result<(String, String), ComputeError> {
        let water = match (self.has("pco2_water"), self.has("fco2_water")) {
            (true, false) => "pco2_water",
            (false, true) => "fco2_water",
            _ => {
                return Err(refused(
                    "one of --pco2-water and --fco2-water is needed".to_owned(),
                ));
            }
        };
        let is_fugacity = water == "fco2_water";
        let found = ["pco2_air", "fco2_air", "dry_mole_fraction"].map(|name| self.has(name));
        let air = match found {
            [true, false, false] if is_fugacity => {
                format!(
                    "fco2_of_pco2_weiss1974(pco2_air, temperature, {})",
                    self.name("pressure")?
                )
            }
            [true, false, false] => "pco2_air".to_owned(),
            [false, true, false] if is_fugacity => "fco2_air".to_owned(),
            [false, true, false] => {
                return Err(refused(
                    "fugacity of air and partial pressure of water are not of a kind: give --fco2-water or --pco2-air"
                        .to_owned(),
                ));
            }
            [false, false, true] => {
                let pressure = self.name("pressure")?;
                let wet = format!(
                    "pco2_in_wet_air(dry_mole_fraction, {pressure}, vapour_weiss_price1980(temperature, {}))",
                    self.skin_salinity()
                );
                if is_fugacity {
                    format!("fco2_of_pco2_weiss1974({wet}, temperature, {pressure})")
                } else {
                    wet
                }
            }
            _ => {
                return Err(refused(
                    "one of --pco2-air, --fco2-air and --dry-mole-fraction is needed".to_owned(),
                ));
            }
        };
        let water = if self.has("temperature_of_pco2") {
            let below = self.below()?;
            format!("pco2_at_temperature_takahashi2009({water}, temperature_of_pco2, {below})")
        } else {
            water.to_owned()
        };
        Ok((water, air))
    }

    fn below(&self) -> Result<String, ComputeError> {
        self.name("temperature")?;
        Ok(match self.below {
            Below::Skin => "temperature".to_owned(),
            Below::Warmer { by_k } => format!("(temperature + unit({by_k}, 'K'))"),
            Below::Donlon2002 => {
                format!(
                    "(temperature - cool_skin_donlon2002({}))",
                    self.name("wind")?
                )
            }
            Below::Product => self.name("below")?.to_owned(),
        })
    }

    fn skin_salinity(&self) -> String {
        if self.salty_skin == 0.0 {
            "salinity".to_owned()
        } else {
            format!("(salinity + {})", self.salty_skin)
        }
    }

    fn solubility(&self, temperature: &str, salinity: &str) -> String {
        match self.solubility {
            Solubility::Volume => format!("solubility_weiss1974({temperature}, {salinity})"),
            Solubility::LitreIsKilogram => {
                format!("unit(1, 'kg l-1') * solubility_weiss1974_mass({temperature}, {salinity})")
            }
        }
    }

    fn velocity(&self) -> Result<String, ComputeError> {
        let schmidt = match self.schmidt {
            Schmidt::Wanninkhof2014 => "schmidt_wanninkhof2014(temperature)",
            Schmidt::Wanninkhof1992 => "schmidt_wanninkhof1992(temperature)",
        };
        let (u, u2, u3) = ("wind", "wind_moment2", "wind_moment3");
        let (name, arguments): (_, &[&'static str]) = match self.gas_transfer {
            GasTransfer::Wanninkhof2014 => ("wanninkhof2014", &[u2]),
            GasTransfer::Wanninkhof1992 => ("wanninkhof1992", &[u2]),
            GasTransfer::Nightingale2000 => ("nightingale2000", &[u, u2]),
            GasTransfer::Ho2006 => ("ho2006", &[u2]),
            GasTransfer::Sweeney2007 => ("sweeney2007", &[u2]),
            GasTransfer::Takahashi2009 => ("takahashi2009", &[u2]),
            GasTransfer::Wanninkhof2009 => ("wanninkhof2009", &[u, u2, u3]),
            GasTransfer::WanninkhofMcgillis1999 => ("wanninkhof_mcgillis1999", &[u3]),
            GasTransfer::Mcgillis2001 => ("mcgillis2001", &[u3]),
            GasTransfer::LissMerlivat1986 => ("liss_merlivat1986", &[u]),
        };
        let mut texts = vec![];
        for argument in arguments {
            texts.push(match *argument {
                "wind" => self.name(u)?.to_owned(),
                // A moment that is not given is that of Rayleigh's distribution about the mean.
                moment if self.has(moment) => moment.to_owned(),
                moment => format!("{moment}_rayleigh({})", self.name(u)?),
            });
        }
        texts.push(schmidt.to_owned());
        Ok(format!("gas_transfer_{name}({})", texts.join(", ")))
    }

    fn open_water(&self) -> String {
        if !self.has("ice") {
            return String::new();
        }
        let ice = if self.no_ice_is_open {
            "coalesce(ice, 0)"
        } else {
            "ice"
        };
        match self.ice {
            Ice::Linear => format!(" * (1 - {ice})"),
            Ice::Leads => format!(" * open_water_takahashi2009({ice})"),
        }
    }
}

/// Does a text hold a name as a whole word?
fn names(text: &str, name: &str) -> bool {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text.split(|c: char| !is_part(c)).any(|word| word == name)
}

fn refused(reason: String) -> ComputeError {
    ComputeError::Expression { reason }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::expression::Expression;
    use crate::expression::unit::Unit;

    fn flux(names: &[&'static str]) -> Co2Flux {
        let source = |name: &&'static str| (*name, ("p".parse().unwrap(), Matching::SamePeriod));
        Co2Flux {
            sources: names.iter().map(source).collect(),
            gas_transfer: GasTransfer::default(),
            schmidt: Schmidt::default(),
            solubility: Solubility::default(),
            ice: Ice::default(),
            no_ice_is_open: false,
            below: Below::Skin,
            salty_skin: 0.0,
        }
    }

    const BULK: [&str; 6] = [
        "pco2_water",
        "pco2_air",
        "temperature",
        "salinity",
        "wind_moment2",
        "ice",
    ];

    fn unit_of(name: &str) -> Unit {
        match name {
            "temperature" | "below" | "temperature_of_pco2" => Unit::KELVIN,
            "wind" => Unit::METRE_PER_SECOND,
            "wind_moment2" => Unit::SPEED_2,
            "wind_moment3" => Unit::SPEED_3,
            "salinity" | "ice" | "dry_mole_fraction" => Unit::ONE,
            _ => Unit::PASCAL,
        }
    }

    /// The expression read, over units of its products; and in one cell of usual values.
    fn value(flux: &Co2Flux) -> f64 {
        let text = flux.expression().unwrap();
        let inputs: Vec<_> = flux
            .sources
            .iter()
            .map(|(name, _)| ((*name).to_owned(), unit_of(name)))
            .collect();
        let read = Expression::read(&text, &inputs).unwrap_or_else(|e| panic!("{text}: {e}"));
        assert_eq!(read.unit(), Unit::stored("kg m-2 s-1").unwrap(), "{text}");
        let usual = |(name, _): &(&str, Source)| -> [f32; 1] {
            [match *name {
                "temperature" => 290.0,
                "below" => 290.3,
                "temperature_of_pco2" => 289.0,
                "salinity" => 35.0,
                "wind" => 7.0,
                "wind_moment2" => 60.0,
                "wind_moment3" => 560.0,
                "ice" => 0.25,
                "pressure" => 101_000.0,
                "dry_mole_fraction" => 390e-6,
                "pco2_water" | "fco2_water" => 36.0,
                _ => 38.5,
            }]
        };
        let values: Vec<[f32; 1]> = flux.sources.iter().map(usual).collect();
        let columns: Vec<&[f32]> = values.iter().map(<[f32; 1]>::as_slice).collect();
        read.evaluate(&columns).unwrap().values[0]
    }

    #[test]
    fn the_bulk_formula_is_that_of_the_papers() {
        use crate::air_sea::{gas_transfer, schmidt, solubility};
        let k = gas_transfer::wanninkhof2014(60.0, schmidt::wanninkhof2014(290.0));
        let by_hand = 0.012_011 * k * solubility::weiss1974(290.0, 35.0) * (36.0 - 38.5) * 0.75;
        let found = value(&flux(&BULK));
        assert!((found / by_hand - 1.0).abs() < 1e-12, "{found} {by_hand}");
        // Into the sea, and of the size that people know: 4 g C m-2 a year.
        assert!(
            (-12.0..-1.0).contains(&(found * 1000.0 * 365.25 * 86_400.0)),
            "{found}"
        );
    }

    #[test]
    fn every_choice_makes_an_expression_of_the_unit_of_a_flux() {
        let of = |more: &[&'static str]| {
            let rest = BULK
                .iter()
                .filter(|name| !matches!(**name, "pco2_air" | "pco2_water" | "wind_moment2"));
            flux(
                &rest
                    .copied()
                    .chain(more.iter().copied())
                    .collect::<Vec<_>>(),
            )
        };
        let velocities = <GasTransfer as clap::ValueEnum>::value_variants();
        for &gas_transfer in velocities {
            let needed: &[&'static str] = match gas_transfer {
                GasTransfer::Nightingale2000 => &["wind", "wind_moment2"],
                GasTransfer::Wanninkhof2009 => &["wind", "wind_moment2", "wind_moment3"],
                GasTransfer::Mcgillis2001 | GasTransfer::WanninkhofMcgillis1999 => {
                    &["wind_moment3"]
                }
                GasTransfer::LissMerlivat1986 => &["wind"],
                _ => &["wind_moment2"],
            };
            let names: Vec<_> = needed
                .iter()
                .copied()
                .chain(["pco2_water", "pco2_air"])
                .collect();
            let found = value(&Co2Flux {
                gas_transfer,
                ..of(&names)
            });
            assert!(found < 0.0, "{gas_transfer:?} {found}");
            let rayleigh = Co2Flux {
                gas_transfer,
                ..of(&["wind", "pco2_water", "pco2_air"])
            };
            assert!(value(&rayleigh) < 0.0);
        }
        let skins = [Below::Warmer { by_k: 0.17 }, Below::Donlon2002];
        for below in skins {
            let names = [
                "wind",
                "fco2_water",
                "dry_mole_fraction",
                "pressure",
                "temperature_of_pco2",
            ];
            let flux = Co2Flux {
                below,
                salty_skin: 0.1,
                solubility: Solubility::LitreIsKilogram,
                schmidt: Schmidt::Wanninkhof1992,
                ice: Ice::Leads,
                no_ice_is_open: true,
                ..of(&names)
            };
            assert!(value(&flux).is_finite());
        }
    }

    #[test]
    fn what_is_missing_or_left_over_is_said() {
        let said = |flux: &Co2Flux| flux.expression().unwrap_err().to_string();
        assert!(said(&flux(&BULK[1..])).contains("--pco2-water"));
        assert!(
            said(&flux(&[
                "pco2_water",
                "fco2_air",
                "temperature",
                "salinity",
                "wind"
            ]))
            .contains("not of a kind")
        );
        assert!(
            said(&flux(&["pco2_water", "pco2_air", "temperature", "wind"])).contains("--salinity")
        );
        let more = [&BULK[..], &["wind_moment3"]].concat();
        assert!(said(&flux(&more)).contains("does not need"));
        let dry = [
            "pco2_water",
            "dry_mole_fraction",
            "temperature",
            "salinity",
            "wind",
        ];
        assert!(said(&flux(&dry)).contains("--pressure"));
    }
}
