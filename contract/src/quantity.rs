//! What a product measures, in which unit it is stored, and in which unit people read it.

mod flags;
mod open;
mod words;

use crate::ContractError;

pub use flags::{Flag, MAX_FLAGS, MAX_MEANING_BYTES};
pub use open::{MAX_NAME_BYTES, MAX_TITLE_BYTES, MAX_UNIT_BYTES, OpenQuantity, OpenWords};

/// Mass of carbon in one mole of CO2, kg (IUPAC 2021 standard atomic weight of carbon, conventional value 12.011).
pub const CARBON_KG_PER_MOL: f64 = 0.012_011;
/// Seconds in a Julian year, for rates shown per year.
pub const SECONDS_PER_YEAR: f64 = 365.25 * 86_400.0;

/// A measured quantity. Values are stored in [`Quantity::unit`]; conversion to it happens once, at ingest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Quantity {
    /// Air-sea flux of CO2 as mass of carbon, kg m⁻² s⁻¹, positive out of the sea.
    CarbonFlux,
    /// Carbon given off since a chosen start, kg m⁻², positive out of the sea.
    AccumulatedCarbon,
    /// Sea-surface temperature, K, at whatever depth.
    SeaSurfaceTemperature,
    /// Temperature of the upper 10 to 20 µm of the sea, which infrared radiometers see, K.
    SeaSurfaceSkinTemperature,
    /// Temperature about 1 mm below, which microwave radiometers see, K.
    SeaSurfaceSubskinTemperature,
    /// Temperature below the warming of the day, K.
    SeaSurfaceFoundationTemperature,
    /// Chlorophyll-a concentration, kg m⁻³.
    Chlorophyll,
    /// Wind speed at 10 m, m s⁻¹.
    WindSpeed,
    /// Partial pressure of CO2, Pa; in products that landed before fugacity was told apart also that.
    Pco2,
    /// Fugacity of CO2, Pa.
    Fco2,
    /// Practical salinity, 1.
    Salinity,
    /// Sea-level air pressure, Pa.
    AirPressure,
    /// Share of a cell covered by ice, 1.
    IceFraction,
    /// Significant wave height, m.
    WaveHeight,
    /// Precipitation, kg m⁻² s⁻¹.
    Precipitation,
    /// Eastward or northward sea-water velocity, m s⁻¹.
    Current,
    /// Height of the solid earth above the mean level of the sea, m, negative on the sea floor.
    Elevation,
    /// Share of a cell that is sea, 1.
    SeaAreaFraction,
    /// Share of a cell that is land, 1.
    LandAreaFraction,
    /// Anything else, by its own words: no sign has a meaning, and nothing is computed from it but statistics.
    Open(OpenQuantity),
}

/// How a quantity is shown: `shown = stored * factor + offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Display {
    /// Unit people read.
    pub unit: &'static str,
    /// Multiplies the stored value.
    pub factor: f64,
    /// Added after the factor.
    pub offset: f64,
}

impl Display {
    /// The stored value of one that is shown.
    pub fn stored(&self, shown: f64) -> f64 {
        (shown - self.offset) / self.factor
    }

    /// What is shown of a stored value.
    pub fn shown(&self, stored: f64) -> f64 {
        stored * self.factor + self.offset
    }
}

/// What the name of a map of the day of the year ends with that the yearly wave of a quantity has its crest on.
pub const ANNUAL_PHASE: &str = "_annual_phase";

/// Words of names that are of directions where the unit is an angle; other angles (of elevation, of zenith) do not go round.
pub const DIRECTION_WORDS: [&str; 4] = ["direction", "azimuth", "bearing", "heading"];

/// How many of a unit are a turn; none of what is no angle.
pub fn units_per_turn(unit: &str) -> Option<f64> {
    match unit.to_lowercase().as_str() {
        "deg" | "degree" | "degrees" | "°" | "degree_true" | "degrees_true" | "degreet"
        | "degreest" | "degree_t" | "degrees_t" | "arc_degree" | "arc_degrees" => Some(360.0),
        "rad" | "radian" | "radians" => Some(std::f64::consts::TAU),
        _ => None,
    }
}

impl Quantity {
    /// Every quantity that is built in.
    pub const ALL: [Self; 19] = [
        Self::CarbonFlux,
        Self::AccumulatedCarbon,
        Self::SeaSurfaceTemperature,
        Self::SeaSurfaceSkinTemperature,
        Self::SeaSurfaceSubskinTemperature,
        Self::SeaSurfaceFoundationTemperature,
        Self::Chlorophyll,
        Self::WindSpeed,
        Self::Pco2,
        Self::Fco2,
        Self::Salinity,
        Self::AirPressure,
        Self::IceFraction,
        Self::WaveHeight,
        Self::Precipitation,
        Self::Current,
        Self::Elevation,
        Self::SeaAreaFraction,
        Self::LandAreaFraction,
    ];

    /// Unit of stored values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::CarbonFlux | Self::Precipitation => "kg m-2 s-1",
            Self::AccumulatedCarbon => "kg m-2",
            Self::SeaSurfaceTemperature
            | Self::SeaSurfaceSkinTemperature
            | Self::SeaSurfaceSubskinTemperature
            | Self::SeaSurfaceFoundationTemperature => "K",
            Self::Chlorophyll => "kg m-3",
            Self::WindSpeed | Self::Current => "m s-1",
            Self::Pco2 | Self::Fco2 | Self::AirPressure => "Pa",
            Self::Salinity | Self::IceFraction | Self::SeaAreaFraction | Self::LandAreaFraction => {
                "1"
            }
            Self::WaveHeight | Self::Elevation => "m",
            Self::Open(open) => &open.words().unit,
        }
    }

    /// Unit, factor and offset for people.
    pub fn display(self) -> Display {
        let (unit, factor, offset) = match self {
            Self::CarbonFlux => ("g C m⁻² yr⁻¹", 1000.0 * SECONDS_PER_YEAR, 0.0),
            Self::AccumulatedCarbon => ("g C m⁻²", 1000.0, 0.0),
            Self::SeaSurfaceTemperature
            | Self::SeaSurfaceSkinTemperature
            | Self::SeaSurfaceSubskinTemperature
            | Self::SeaSurfaceFoundationTemperature => ("°C", 1.0, -273.15),
            Self::Chlorophyll => ("mg m⁻³", 1e6, 0.0),
            Self::WindSpeed | Self::Current => ("m s⁻¹", 1.0, 0.0),
            Self::Pco2 | Self::Fco2 => ("µatm", 1.0 / 0.101_325, 0.0),
            Self::Salinity => ("", 1.0, 0.0),
            Self::AirPressure => ("hPa", 0.01, 0.0),
            Self::IceFraction | Self::SeaAreaFraction | Self::LandAreaFraction => ("%", 100.0, 0.0),
            Self::WaveHeight | Self::Elevation => ("m", 1.0, 0.0),
            Self::Precipitation => ("mm d⁻¹", 86_400.0, 0.0),
            Self::Open(open) => (open.shown_unit(), 1.0, 0.0),
        };
        Display {
            unit,
            factor,
            offset,
        }
    }

    /// Title for people.
    pub fn title(self) -> &'static str {
        match self {
            Self::CarbonFlux => "Air-sea CO₂ flux",
            Self::AccumulatedCarbon => "Accumulated air-sea carbon",
            Self::SeaSurfaceTemperature => "Sea-surface temperature",
            Self::SeaSurfaceSkinTemperature => "Sea-surface skin temperature",
            Self::SeaSurfaceSubskinTemperature => "Sea-surface subskin temperature",
            Self::SeaSurfaceFoundationTemperature => "Sea-surface foundation temperature",
            Self::Chlorophyll => "Chlorophyll-a",
            Self::WindSpeed => "Wind speed at 10 m",
            Self::Pco2 => "CO₂ partial pressure",
            Self::Fco2 => "CO₂ fugacity",
            Self::Salinity => "Salinity",
            Self::AirPressure => "Sea-level pressure",
            Self::IceFraction => "Sea ice",
            Self::WaveHeight => "Significant wave height",
            Self::Precipitation => "Precipitation",
            Self::Current => "Current",
            Self::Elevation => "Elevation",
            Self::SeaAreaFraction => "Share of sea",
            Self::LandAreaFraction => "Share of land",
            Self::Open(open) => &open.words().title,
        }
    }

    /// What values below and above zero mean, for those who do not know the sign: of fluxes.
    pub fn ends(self) -> Option<[&'static str; 2]> {
        match self {
            Self::CarbonFlux | Self::AccumulatedCarbon => Some(["sea takes up", "sea gives off"]),
            _ => None,
        }
    }

    /// Why it has no budget, of what is no carbon; an open one may be a flux all the same, of which files did not say enough.
    pub fn without_budget(self) -> String {
        const ONLY: &str = "only a carbon flux has a budget";
        match self {
            Self::Open(_) => format!(
                "{:?}, which is not known as a carbon flux: {ONLY}; if it is one, land its files anew with a standard_name or an attribute positive that says its direction, or by a profile with quantity = \"carbon_flux\"",
                self.title()
            ),
            known => format!("{}: {ONLY}", known.title()),
        }
    }

    /// Values that can be true, stored unit; anything outside is refused or masked at ingest.
    pub fn plausible(self) -> std::ops::RangeInclusive<f64> {
        match self {
            Self::CarbonFlux => -1e-6..=1e-6,
            Self::AccumulatedCarbon => -1e3..=1e3,
            Self::SeaSurfaceTemperature
            | Self::SeaSurfaceSkinTemperature
            | Self::SeaSurfaceSubskinTemperature
            | Self::SeaSurfaceFoundationTemperature => 250.0..=325.0,
            Self::Chlorophyll => 0.0..=1e-2,
            Self::WindSpeed => 0.0..=120.0,
            Self::Pco2 | Self::Fco2 => 0.0..=500.0,
            Self::Salinity => 0.0..=60.0,
            Self::AirPressure => 80_000.0..=110_000.0,
            Self::IceFraction | Self::SeaAreaFraction | Self::LandAreaFraction => 0.0..=1.0,
            Self::WaveHeight => 0.0..=40.0,
            Self::Precipitation => 0.0..=0.1,
            Self::Current => -10.0..=10.0,
            // The Challenger Deep and Mount Everest, with room for other surfaces of reference.
            Self::Elevation => -12_000.0..=9_500.0,
            // From there on numbers of files mean no data.
            Self::Open(_) => -1e34..=1e34,
        }
    }

    /// What its values mean, where they are codes and a file says it.
    pub fn flags(self) -> &'static [Flag] {
        match self {
            Self::Open(open) => &open.words().flags,
            _ => &[],
        }
    }

    /// Of directions how many of its units a turn is; none of what is no angle.
    pub fn units_per_turn(self) -> Option<f64> {
        let Self::Open(_) = self else { return None };
        units_per_turn(self.unit())
    }

    /// Is it where something comes from or goes to, by a word of its name and an angle as its unit? Such values go round: the mean of 350
    /// and 10 degrees is 0 and not 180, and none of them is the highest.
    pub fn is_direction(self) -> bool {
        let is_one = |word: &str| DIRECTION_WORDS.contains(&word);
        self.units_per_turn().is_some() && self.word().split('_').any(is_one)
    }

    /// Is it the day of the year that a yearly wave has its crest on, by the name and the unit that such maps have?
    pub fn is_day_of_year(self) -> bool {
        matches!(self, Self::Open(_)) && self.unit() == "day" && self.word().ends_with(ANNUAL_PHASE)
    }

    /// Does what lies half-way between two of its values lie half-way between what they mean? Not of codes; not of directions, of which the
    /// mean of 359 and 1 degree is 0 and not 180; and not of days of a year, of which that of the last and the first is in July.
    pub fn is_linear(self) -> bool {
        self.flags().is_empty() && self.units_per_turn().is_none() && !self.is_day_of_year()
    }

    /// What a code means.
    pub fn meaning(self, code: f32) -> Option<&'static str> {
        #[expect(clippy::float_cmp, reason = "a code is one exact number")]
        let found = self.flags().iter().find(|flag| flag.code() == code);
        found.map(|flag| flag.meaning.as_str())
    }

    /// Is it the same but for the words of an open one besides name and unit?
    pub fn is_same_kind(self, other: Self) -> bool {
        match (self, other) {
            (Self::Open(own), Self::Open(other)) => own.is_same_kind(other),
            _ => self == other,
        }
    }

    /// What a product of this quantity holds once values of another are added; none if they do not belong in one. Any
    /// sea-surface temperature is one where the depth is left open, and ranges grow.
    pub fn joined(self, other: Self) -> Option<Self> {
        match (self, other) {
            (Self::Open(own), Self::Open(other)) if own.is_same_kind(other) => {
                own.joined(other).ok().map(Self::Open)
            }
            (
                Self::SeaSurfaceTemperature,
                Self::SeaSurfaceSkinTemperature
                | Self::SeaSurfaceSubskinTemperature
                | Self::SeaSurfaceFoundationTemperature,
            ) => Some(self),
            _ => (self == other).then_some(self),
        }
    }

    /// The same with the range of stored values that was found; only open quantities keep one.
    ///
    /// # Errors
    /// Too many quantities.
    pub fn over(self, [low, high]: [f64; 2]) -> Result<Self, ContractError> {
        match self {
            Self::Open(open) => open.over(low, high).map(Self::Open),
            known => Ok(known),
        }
    }

    /// A quantity by its words: that of a statistic, say, whose unit is derived (`K year-1`).
    ///
    /// # Errors
    /// A word out of its limits, or too many quantities.
    pub fn open(name: &str, unit: &str, title: &str) -> Result<Self, ContractError> {
        let words = OpenWords {
            name: name.to_owned(),
            unit: unit.to_owned(),
            title: title.to_owned(),
            range: None,
            flags: vec![],
            is_standard_name: false,
        };
        OpenQuantity::new(words).map(Self::Open)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_temperature_of_a_depth_joins_one_without_and_never_the_other_way_round() {
        let (any, skin) = (
            Quantity::SeaSurfaceTemperature,
            Quantity::SeaSurfaceSkinTemperature,
        );
        assert_eq!(any.joined(skin), Some(any));
        assert_eq!(skin.joined(any), None);
        assert_eq!(skin.joined(Quantity::SeaSurfaceFoundationTemperature), None);
        assert_eq!(Quantity::Pco2.joined(Quantity::Fco2), None);
    }

    #[test]
    fn a_direction_is_told_by_its_name_and_its_unit() {
        let is_one = |name, unit| Quantity::open(name, unit, "A").unwrap().is_direction();
        assert!(is_one("wind_from_direction", "degree"));
        assert!(is_one("sea_surface_wave_to_direction", "rad"));
        assert!(is_one("platform_azimuth_angle", "degrees_true"));
        for (name, unit) in [
            ("solar_zenith_angle", "degree"),
            ("wind_from_direction_count", "1"),
            ("directional_spread", "degree"),
        ] {
            assert!(!is_one(name, unit), "{name} {unit}");
        }
        assert!(!Quantity::WindSpeed.is_direction());
    }

    #[test]
    fn open_quantities_of_one_name_and_unit_join_over_both_ranges() {
        let of = |unit, range| {
            let plain = Quantity::open("river_flux", unit, "River flux").unwrap();
            plain.over(range).unwrap()
        };
        let joined = of("1", [0.0, 5.0]).joined(of("1", [-2.0, 1.0]));
        assert_eq!(joined, Some(of("1", [-2.0, 5.0])));
        assert_eq!(of("1", [0.0, 5.0]).joined(of("m", [0.0, 5.0])), None);
    }

    #[test]
    fn what_is_not_known_as_a_flux_is_told_how_it_could_be() {
        let open = Quantity::open("air_sea_co2_flux", "mol m-2 s-1", "air-sea CO2 flux");
        let told = open.unwrap().without_budget();
        for part in [
            "\"air-sea CO2 flux\", which is not known as a carbon flux",
            "only a carbon flux has a budget",
            "standard_name",
            "quantity = \"carbon_flux\"",
        ] {
            assert!(told.contains(part), "{told}");
        }
        let salinity = Quantity::Salinity.without_budget();
        assert_eq!(salinity, "Salinity: only a carbon flux has a budget");
    }

    #[test]
    fn freezing_is_shown_as_zero_celsius() {
        let d = Quantity::SeaSurfaceTemperature.display();
        assert!((273.15 * d.factor + d.offset).abs() < 1e-9);
    }

    #[test]
    fn one_standard_atmosphere_is_a_million_microatmospheres() {
        assert!((101_325.0 * Quantity::Pco2.display().factor - 1e6).abs() < 1e-6);
    }
}
