//! What the values of a statistic are, and how they come from those of the product.

use contract::ContractError;
use contract::analysis::MapStatistic;
use contract::quantity::Quantity;

/// Years in a decade.
const DECADE: f64 = 10.0;

/// The quantity of a statistic, and what its values are multiplied with: means stay what they are, differences are no
/// temperatures or fluxes with a sign of their own any more, and are kept in the unit that people read.
pub(super) fn of(own: Quantity, statistic: MapStatistic) -> Result<(Quantity, f64), ContractError> {
    let display = own.display();
    let unit = plain_unit(display.unit);
    let (word, unit, says, factor) = match statistic {
        MapStatistic::Mean
        | MapStatistic::Min
        | MapStatistic::Max
        | MapStatistic::Percentile(_)
        | MapStatistic::Climatology => return Ok((own, 1.0)),
        MapStatistic::MinTime | MapStatistic::MaxTime => {
            let (word, says) = match statistic {
                MapStatistic::MinTime => ("min_time", "lowest days after the start of 1970"),
                _ => ("max_time", "highest days after the start of 1970"),
            };
            (word, "day".to_owned(), says, 1.0)
        }
        MapStatistic::Count => ("count", "1".to_owned(), "steps with data", 1.0),
        MapStatistic::Coverage => ("coverage", "%".to_owned(), "share of time with data", 1.0),
        MapStatistic::Anomaly => ("anomaly", unit, "anomaly", display.factor),
        MapStatistic::Spread => (
            "standard_deviation",
            unit,
            "standard deviation",
            display.factor,
        ),
        MapStatistic::Amplitude => (
            "annual_amplitude",
            unit,
            "amplitude of the year",
            display.factor,
        ),
        MapStatistic::Phase => (
            "annual_phase",
            "day".to_owned(),
            "highest days after the start of the year",
            1.0,
        ),
        MapStatistic::Trend | MapStatistic::LeastSquaresTrend => {
            let a_year = if unit == "1" {
                "year-1".to_owned()
            } else {
                format!("{unit} year-1")
            };
            let (word, says) = match statistic {
                MapStatistic::Trend => ("trend", "trend"),
                _ => ("least_squares_trend", "trend by least squares"),
            };
            (word, a_year, says, display.factor / DECADE)
        }
        MapStatistic::TrendPValue => ("trend_p_value", "1".to_owned(), "p value of its trend", 1.0),
        MapStatistic::LeastSquaresTrendPValue => (
            "least_squares_trend_p_value",
            "1".to_owned(),
            "p value of its trend by least squares",
            1.0,
        ),
    };
    let name = format!("{}_{word}", own.word());
    let title = format!("{}, {says}", own.title());
    Ok((Quantity::open(&name, &unit, &title)?, factor))
}

/// A unit that people read, of differences, as UDUNITS spells it: `g C m⁻² yr⁻¹` as `g m-2 year-1`, `°C` as `K`.
fn plain_unit(shown: &str) -> String {
    let plain = |c: char| match c {
        '⁻' => '-',
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        'µ' => 'u',
        other => other,
    };
    let words: String = shown.chars().map(plain).collect();
    let words = words.split(' ').filter(|word| *word != "C");
    let word = |word: &str| match word {
        "°C" => "K".to_owned(),
        "" => "1".to_owned(),
        "d-1" => "day-1".to_owned(),
        other => other.replace("yr", "year"),
    };
    words.map(word).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_have_a_quantity_of_their_own_in_the_unit_people_read() {
        let of = |own, statistic| {
            let (quantity, factor) = of(own, statistic).unwrap();
            (quantity.word(), quantity.unit(), factor)
        };
        let sst = Quantity::SeaSurfaceTemperature;
        assert_eq!(
            of(sst, MapStatistic::Mean),
            ("sea_surface_temperature", "K", 1.0)
        );
        assert_eq!(
            of(sst, MapStatistic::Anomaly),
            ("sea_surface_temperature_anomaly", "K", 1.0)
        );
        assert_eq!(
            of(sst, MapStatistic::Trend),
            ("sea_surface_temperature_trend", "K year-1", 0.1)
        );
        let flux = of(Quantity::CarbonFlux, MapStatistic::Anomaly);
        assert_eq!((flux.0, flux.1), ("carbon_flux_anomaly", "g m-2 year-1"));
        assert!((flux.2 - 1000.0 * contract::quantity::SECONDS_PER_YEAR).abs() < 1e-3);
        assert_eq!(of(Quantity::Salinity, MapStatistic::Trend).1, "year-1");
        assert_eq!(
            of(Quantity::Precipitation, MapStatistic::Spread).1,
            "mm day-1"
        );
        assert_eq!(of(Quantity::WindSpeed, MapStatistic::TrendPValue).1, "1");
    }

    #[test]
    fn every_quantity_has_every_statistic() {
        for own in Quantity::ALL {
            for statistic in MapStatistic::ALL {
                assert!(super::of(own, statistic).is_ok(), "{own:?} {statistic}");
            }
        }
    }
}
