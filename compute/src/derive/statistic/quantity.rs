//! What the values of a statistic are, and how they come from those of the product.

use contract::ContractError;
use contract::analysis::CorrelationStatistic;
use contract::analysis::MapStatistic;
use contract::quantity::{MAX_TITLE_BYTES, Quantity};

use crate::summed::{GO_ROUND, PARTS};

/// Years in a decade.
const DECADE: f64 = 10.0;

/// The quantity of a statistic, and what its values are multiplied with: means stay what they are, differences are no
/// temperatures or fluxes with a sign of their own any more, and are kept in the unit that people read. Of two products `second` is
/// that of the other one.
///
/// # Errors
/// A statistic of codes that takes a mean: that of two is the code of something else. One of directions that takes a mean or an extreme.
pub(super) fn of(
    own: Quantity,
    second: Option<Quantity>,
    statistic: MapStatistic,
) -> Result<(Quantity, f64), ContractError> {
    check_codes([Some(own), second], statistic)?;
    check_directions([Some(own), second], statistic)?;
    let display = own.display();
    let unit = plain_unit(display.unit);
    let (word, unit, says, factor) = match statistic {
        MapStatistic::Mean
        | MapStatistic::Min
        | MapStatistic::Max
        | MapStatistic::Percentile(_)
        | MapStatistic::Climatology => return Ok((own, 1.0)),
        MapStatistic::Correlation(of) => {
            return Ok((of_two([own, second.unwrap_or(own)], of)?, 1.0));
        }
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

/// A mean of codes is the code of something else.
fn check_codes(of: [Option<Quantity>; 2], statistic: MapStatistic) -> Result<(), ContractError> {
    let mut of_codes = of
        .into_iter()
        .flatten()
        .filter(|quantity| !quantity.flags().is_empty());
    let Some(codes) = of_codes.next().filter(|_| !is_of_codes(statistic)) else {
        return Ok(());
    };
    let reason = format!(
        "{} holds codes, which have none: there are count, coverage, min, max, percentiles, min-time and max-time of them, and any of the share of a \
         code, which fluxglobe derive --expr \"CASE WHEN code = 1 THEN 1 ELSE 0 END\" makes",
        codes.title()
    );
    let asked = statistic.to_string();
    Err(ContractError::invalid("statistic", &asked, reason))
}

/// Directions go round: of them there are numbers of values alone.
fn check_directions(
    of: [Option<Quantity>; 2],
    statistic: MapStatistic,
) -> Result<(), ContractError> {
    let counts = matches!(statistic, MapStatistic::Count | MapStatistic::Coverage);
    let found = of.into_iter().flatten().find(|own| own.is_direction());
    let Some(direction) = found.filter(|_| !counts) else {
        return Ok(());
    };
    let reason = format!(
        "{} holds {GO_ROUND}: there are count and coverage of them, and any of the parts: {PARTS}",
        direction.title()
    );
    let asked = statistic.to_string();
    Err(ContractError::invalid("statistic", &asked, reason))
}

/// Does it count values, or is it one that was there, so that no mean is taken for it?
fn is_of_codes(statistic: MapStatistic) -> bool {
    match statistic {
        MapStatistic::Count
        | MapStatistic::Coverage
        | MapStatistic::Min
        | MapStatistic::Max
        | MapStatistic::MinTime
        | MapStatistic::MaxTime
        | MapStatistic::Percentile(_) => true,
        MapStatistic::Mean
        | MapStatistic::Spread
        | MapStatistic::Climatology
        | MapStatistic::Anomaly
        | MapStatistic::Amplitude
        | MapStatistic::Phase
        | MapStatistic::Trend
        | MapStatistic::TrendPValue
        | MapStatistic::LeastSquaresTrend
        | MapStatistic::LeastSquaresTrendPValue
        | MapStatistic::Correlation(_) => false,
    }
}

/// What is said of a correlation, by a name of its own: which two go together is in the title.
fn of_two(both: [Quantity; 2], of: CorrelationStatistic) -> Result<Quantity, ContractError> {
    let (word, says) = match of {
        CorrelationStatistic::Coefficient => ("correlation", "correlation"),
        CorrelationStatistic::PValue => ("correlation_p_value", "p value of the correlation"),
        CorrelationStatistic::Pairs => ("correlation_pairs", "pairs of values"),
        CorrelationStatistic::EffectivePairs => {
            ("correlation_effective_pairs", "effective pairs of values")
        }
    };
    let [first, second] = both.map(Quantity::title);
    let whole = format!("{first} and {second}, {says}");
    let title = if whole.len() <= MAX_TITLE_BYTES {
        &whole
    } else {
        says
    };
    let quantity = Quantity::open(word, "1", title)?;
    match of {
        // Drawn alike wherever it is, from less to more than none.
        CorrelationStatistic::Coefficient => quantity.over([-1.0, 1.0]),
        _ => Ok(quantity),
    }
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
    use contract::quantity::{Flag, OpenQuantity, OpenWords};

    use super::*;

    #[test]
    fn differences_have_a_quantity_of_their_own_in_the_unit_people_read() {
        let of = |own, statistic| {
            let (quantity, factor) = super::of(own, None, statistic).unwrap();
            (quantity.word(), quantity.unit(), factor)
        };
        let sst = Quantity::SeaSurfaceTemperature;
        let phase = super::of(sst, None, MapStatistic::Phase).unwrap().0;
        assert!(phase.is_day_of_year() && !phase.is_linear());
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
        let anomaly = super::of(Quantity::CarbonFlux, None, MapStatistic::Anomaly);
        assert_eq!(anomaly.unwrap().0.display().unit, "g C m⁻² year⁻¹");
        assert!((flux.2 - 1000.0 * contract::quantity::SECONDS_PER_YEAR).abs() < 1e-3);
        assert_eq!(of(Quantity::Salinity, MapStatistic::Trend).1, "year-1");
        assert_eq!(
            of(Quantity::Precipitation, MapStatistic::Spread).1,
            "mm day-1"
        );
        assert_eq!(of(Quantity::WindSpeed, MapStatistic::TrendPValue).1, "1");
        // The title, which is the `long_name` of cubes and exports, says of what it is one.
        let spread = super::of(sst, None, MapStatistic::Spread).unwrap().0;
        assert_eq!(
            spread.title(),
            "Sea-surface temperature, standard deviation"
        );
    }

    #[test]
    fn a_correlation_is_from_less_to_more_than_none_and_names_both() {
        let sst = Quantity::SeaSurfaceTemperature;
        let of = |second, statistic: CorrelationStatistic| {
            let statistic = MapStatistic::Correlation(statistic);
            super::of(sst, Some(second), statistic).unwrap().0
        };
        let found = of(Quantity::WindSpeed, CorrelationStatistic::Coefficient);
        assert_eq!((found.word(), found.unit()), ("correlation", "1"));
        assert_eq!(
            found.title(),
            "Sea-surface temperature and Wind speed at 10 m, correlation"
        );
        let Quantity::Open(open) = found.over([-0.5, 0.25]).unwrap() else {
            panic!("{found:?} is built in");
        };
        assert_eq!(open.words().range, Some([-1.0, 1.0]));
        assert!(open.is_difference());
        let long = Quantity::open("long", "1", &"t".repeat(MAX_TITLE_BYTES)).unwrap();
        let found = of(long, CorrelationStatistic::PValue);
        assert_eq!(found.title(), "p value of the correlation");
    }

    #[test]
    fn codes_have_no_statistic_that_a_mean_is_taken_for() {
        let Quantity::Open(plain) = Quantity::open("ice_type", "1", "Kind of ice").unwrap() else {
            panic!("a kind of ice is built in");
        };
        let flag = Flag {
            value: 2,
            meaning: "first_year_ice".to_owned(),
        };
        let words = OpenWords {
            flags: vec![flag],
            ..plain.words().clone()
        };
        let codes = Quantity::Open(OpenQuantity::new(words).unwrap());
        for statistic in MapStatistic::ALL {
            let found = super::of(codes, None, statistic);
            assert_eq!(found.is_ok(), is_of_codes(statistic), "{statistic}");
        }
        let kept = super::of(codes, None, MapStatistic::Max).unwrap();
        assert_eq!(kept, (codes, 1.0));
        let coefficient = MapStatistic::Correlation(CorrelationStatistic::Coefficient);
        let refused = super::of(Quantity::WindSpeed, Some(codes), coefficient);
        let refused = refused.unwrap_err().to_string();
        assert!(refused.contains("Kind of ice holds codes"), "{refused}");
    }

    #[test]
    fn directions_are_counted_and_nothing_else() {
        let wind = Quantity::open("wind_from_direction", "degree", "Wind direction").unwrap();
        for statistic in MapStatistic::ALL {
            let counts = matches!(statistic, MapStatistic::Count | MapStatistic::Coverage);
            for (own, second) in [(wind, None), (Quantity::WindSpeed, Some(wind))] {
                match super::of(own, second, statistic) {
                    Ok(_) => assert!(counts, "{statistic}"),
                    Err(refused) => {
                        let refused = refused.to_string();
                        assert!(!counts && refused.contains("go round"), "{refused}");
                    }
                }
            }
        }
    }

    #[test]
    fn every_quantity_has_every_statistic() {
        for own in Quantity::ALL {
            for statistic in MapStatistic::ALL {
                let found = super::of(own, Some(own), statistic);
                assert!(found.is_ok(), "{own:?} {statistic}");
            }
        }
    }
}
