//! What a product measures, in which unit it is stored, and in which unit people read it.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Mass of carbon in one mole of CO2, kg (IUPAC 2021 standard atomic weight of carbon, conventional value 12.011).
pub const CARBON_KG_PER_MOL: f64 = 0.012_011;
/// Seconds in a Julian year, for rates shown per year.
pub const SECONDS_PER_YEAR: f64 = 365.25 * 86_400.0;

/// A measured quantity. Values are stored in [`Quantity::unit`]; conversion to it happens once, at ingest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(description = "What the values of a product are.")]
pub enum Quantity {
    /// Air-sea flux of CO2 as mass of carbon, kg m⁻² s⁻¹, positive out of the sea.
    CarbonFlux,
    /// Carbon given off since a chosen start, kg m⁻², positive out of the sea.
    AccumulatedCarbon,
    /// Sea-surface temperature, K.
    SeaSurfaceTemperature,
    /// Chlorophyll-a concentration, kg m⁻³.
    Chlorophyll,
    /// Wind speed at 10 m, m s⁻¹.
    WindSpeed,
    /// Partial pressure or fugacity of CO2, Pa.
    Pco2,
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

impl Quantity {
    /// Every quantity.
    pub const ALL: [Self; 15] = [
        Self::CarbonFlux,
        Self::AccumulatedCarbon,
        Self::SeaSurfaceTemperature,
        Self::Chlorophyll,
        Self::WindSpeed,
        Self::Pco2,
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
            Self::SeaSurfaceTemperature => "K",
            Self::Chlorophyll => "kg m-3",
            Self::WindSpeed | Self::Current => "m s-1",
            Self::Pco2 | Self::AirPressure => "Pa",
            Self::Salinity | Self::IceFraction | Self::SeaAreaFraction | Self::LandAreaFraction => {
                "1"
            }
            Self::WaveHeight | Self::Elevation => "m",
        }
    }

    /// Unit, factor and offset for people.
    pub fn display(self) -> Display {
        let (unit, factor, offset) = match self {
            Self::CarbonFlux => ("g C m⁻² yr⁻¹", 1000.0 * SECONDS_PER_YEAR, 0.0),
            Self::AccumulatedCarbon => ("g C m⁻²", 1000.0, 0.0),
            Self::SeaSurfaceTemperature => ("°C", 1.0, -273.15),
            Self::Chlorophyll => ("mg m⁻³", 1e6, 0.0),
            Self::WindSpeed | Self::Current => ("m s⁻¹", 1.0, 0.0),
            Self::Pco2 => ("µatm", 1.0 / 0.101_325, 0.0),
            Self::Salinity => ("", 1.0, 0.0),
            Self::AirPressure => ("hPa", 0.01, 0.0),
            Self::IceFraction | Self::SeaAreaFraction | Self::LandAreaFraction => ("%", 100.0, 0.0),
            Self::WaveHeight | Self::Elevation => ("m", 1.0, 0.0),
            Self::Precipitation => ("mm d⁻¹", 86_400.0, 0.0),
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
            Self::Chlorophyll => "Chlorophyll-a",
            Self::WindSpeed => "Wind speed at 10 m",
            Self::Pco2 => "CO₂ partial pressure",
            Self::Salinity => "Salinity",
            Self::AirPressure => "Sea-level pressure",
            Self::IceFraction => "Sea ice",
            Self::WaveHeight => "Significant wave height",
            Self::Precipitation => "Precipitation",
            Self::Current => "Current",
            Self::Elevation => "Elevation",
            Self::SeaAreaFraction => "Share of sea",
            Self::LandAreaFraction => "Share of land",
        }
    }

    /// What values below and above zero mean, for those who do not know the sign: of fluxes.
    pub fn ends(self) -> Option<[&'static str; 2]> {
        match self {
            Self::CarbonFlux | Self::AccumulatedCarbon => Some(["sea takes up", "sea gives off"]),
            Self::SeaSurfaceTemperature
            | Self::Chlorophyll
            | Self::WindSpeed
            | Self::Pco2
            | Self::Salinity
            | Self::AirPressure
            | Self::IceFraction
            | Self::WaveHeight
            | Self::Precipitation
            | Self::Current
            | Self::Elevation
            | Self::SeaAreaFraction
            | Self::LandAreaFraction => None,
        }
    }

    /// Values that can be true, stored unit; anything outside is refused or masked at ingest.
    pub fn plausible(self) -> std::ops::RangeInclusive<f64> {
        match self {
            Self::CarbonFlux => -1e-6..=1e-6,
            Self::AccumulatedCarbon => -1e3..=1e3,
            Self::SeaSurfaceTemperature => 250.0..=325.0,
            Self::Chlorophyll => 0.0..=1e-2,
            Self::WindSpeed => 0.0..=120.0,
            Self::Pco2 => 0.0..=500.0,
            Self::Salinity => 0.0..=60.0,
            Self::AirPressure => 80_000.0..=110_000.0,
            Self::IceFraction | Self::SeaAreaFraction | Self::LandAreaFraction => 0.0..=1.0,
            Self::WaveHeight => 0.0..=40.0,
            Self::Precipitation => 0.0..=0.1,
            Self::Current => -10.0..=10.0,
            // The Challenger Deep and Mount Everest, with room for other surfaces of reference.
            Self::Elevation => -12_000.0..=9_500.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
