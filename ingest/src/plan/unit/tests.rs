//! Units against values worked out by hand, and spellings that must be refused.

use super::*;
use crate::plan::cf::quantity::of_standard_name;
use proptest::prelude::*;

/// Factor from the spelling to kg C m-2 s-1 for a step of one month.
fn flux_factor(spelling: &str, year: i32, month: u32) -> f64 {
    let conversion = parse(spelling)
        .unwrap()
        .to_quantity(Quantity::CarbonFlux, None)
        .unwrap();
    conversion
        .for_period(Period::month(year, month).unwrap())
        .unwrap()
        .0
}

fn close(found: f64, expected: f64) {
    assert!(
        (found / expected - 1.0).abs() < 1e-12,
        "{found} is not {expected}"
    );
}

#[test]
fn a_flux_per_month_knows_how_long_its_month_is() {
    for spelling in [
        "g C m-2 month-1",
        "gC/m^2/month",
        "g C m^-2 mon^-1",
        "gC m⁻² month⁻¹",
        "g C/(m2 month)",
    ] {
        close(flux_factor(spelling, 2000, 2), 1e-3 / (29.0 * 86_400.0));
        close(flux_factor(spelling, 2001, 2), 1e-3 / (28.0 * 86_400.0));
        close(flux_factor(spelling, 2000, 1), 1e-3 / (31.0 * 86_400.0));
    }
}

#[test]
fn moles_carry_the_mass_of_their_carbon() {
    close(flux_factor("mol m-2 s-1", 2000, 1), 0.012_011);
    close(
        flux_factor("mmol m-2 d-1", 2000, 1),
        0.012_011e-3 / 86_400.0,
    );
    close(
        flux_factor("mmol C/m2/day", 2000, 1),
        0.012_011e-3 / 86_400.0,
    );
    close(
        flux_factor("mol CO2 m-2 yr-1", 2000, 1),
        0.012_011 / (365.25 * 86_400.0),
    );
    close(flux_factor("µmol m**-2 s**-1", 2000, 1), 0.012_011e-6);
}

#[test]
fn a_mass_must_say_of_what() {
    close(flux_factor("g C m-2 d-1", 2000, 1), 1e-3 / 86_400.0);
    close(flux_factor("kg CO2 m-2 s-1", 2000, 1), 12.011 / 44.009);
    close(flux_factor("gCO2 m-2 s-1", 2000, 1), 1e-3 * 12.011 / 44.009);
    let unit = parse("kg m-2 s-1").unwrap();
    assert!(
        unit.to_quantity(Quantity::CarbonFlux, None)
            .unwrap_err()
            .contains("carbon or of CO2")
    );
    let told = unit
        .to_quantity(Quantity::CarbonFlux, Some(Substance::Carbon))
        .unwrap();
    assert_eq!(
        told.for_period(Period::month(2000, 1).unwrap()).unwrap(),
        (1.0, 0.0)
    );
}

#[test]
fn other_quantities_convert_to_their_stored_unit() {
    let month = Period::month(2010, 1).unwrap();
    let convert = |spelling: &str, quantity, value: f64| {
        let (factor, offset) = parse(spelling)
            .unwrap()
            .to_quantity(quantity, None)
            .unwrap()
            .for_period(month)
            .unwrap();
        value * factor + offset
    };
    for celsius in [
        "degC",
        "celsius",
        "degree_Celsius",
        "°C",
        "^oC",
        "degrees_C",
    ] {
        close(
            convert(celsius, Quantity::SeaSurfaceTemperature, 20.0),
            293.15,
        );
    }
    for kelvin in ["K", "kelvin", "Kelvin", "degK"] {
        close(
            convert(kelvin, Quantity::SeaSurfaceTemperature, 293.15),
            293.15,
        );
    }
    for micro in [
        "uatm",
        "µatm",
        "μatm",
        "microatm",
        "uatm (micro atmospheres)",
    ] {
        close(convert(micro, Quantity::Pco2, 1e6), 101_325.0);
    }
    close(
        convert("mb (milli bar)", Quantity::AirPressure, 1013.25),
        101_325.0,
    );
    close(convert("hPa", Quantity::AirPressure, 1013.25), 101_325.0);
    close(convert("mbar", Quantity::AirPressure, 1013.25), 101_325.0);
    close(convert("mg m-3", Quantity::Chlorophyll, 1.0), 1e-6);
    close(convert("mg/m^3", Quantity::Chlorophyll, 1.0), 1e-6);
    close(convert("ug l-1", Quantity::Chlorophyll, 1.0), 1e-6);
    close(convert("knots", Quantity::WindSpeed, 3600.0), 1852.0);
    close(convert("m s-1", Quantity::WindSpeed, 1.0), 1.0);
    close(convert("cm/s", Quantity::Current, 100.0), 1.0);
    close(convert("%", Quantity::IceFraction, 50.0), 0.5);
    close(convert("mm/day", Quantity::Precipitation, 86_400.0), 1.0);
    close(convert("kg m-2 s-1", Quantity::Precipitation, 1.0), 1.0);
}

#[test]
fn numbers_in_units_are_decimal_and_a_point_between_words_is_none() {
    for (spelling, factor) in [
        ("1.0", 1.0),
        ("2.5 m", 2.5),
        (".5 m", 0.5),
        ("+2.5m", 2.5),
        ("0.001", 1e-3),
        ("1e-3", 1e-3),
        ("1.E-03", 1e-3),
        ("1E3 m", 1e3),
        ("10^-3 m", 1e-3),
        ("m/0.5 s", 2.0),
        ("10.m", 10.0),
        ("1. m", 1.0),
        ("m.2", 2.0),
        ("m.s-1", 1.0),
        ("kg.m-2.s-1", 1.0),
        ("mol.m-2", 1.0),
        ("m2.s-1", 1.0),
    ] {
        close(parse(spelling).unwrap().factor, factor);
    }
    let read = |spelling| parse(spelling).unwrap().dimension;
    // What stands in brackets behind a number is what it is a number of; behind a unit it explains that.
    assert_eq!(read("1e-6 (mol m-2)"), read("mol m-2"));
    assert_eq!(read("1 (fraction of a cell)"), read("1"));
    assert_eq!(read("kg.m-2.s-1"), read("kg m-2 s-1"));
    assert_eq!(read("1e-3 mol.m-2"), read("mol m-2"));
    for spelling in ["0.0", "1e-400", "1e999", "1e", "2.5.e"] {
        assert!(parse(spelling).is_err(), "{spelling}");
    }
}

/// As UDUNITS has it: 2000 of a hundredth of a degree are 20 °C.
#[test]
fn parts_of_a_degree_are_counted_from_its_zero_and_degrees_in_products_are_differences() {
    let quantity = Quantity::SeaSurfaceTemperature;
    let hundredths = parse("0.01 degC").unwrap().to_quantity(quantity, None);
    let month = Period::month(2001, 1).unwrap();
    let (factor, offset) = hundredths.unwrap().for_period(month).unwrap();
    close(2000.0 * factor + offset, 293.15);
    assert_eq!(canonical("0.01 degC"), None, "it may be of a difference");
    for spelling in ["degC/day", "2.5 degC m-1", "m degC", "(degC) m-1"] {
        assert!(parse(spelling).unwrap().offset.abs() <= 0.0, "{spelling}");
    }
}

#[test]
fn unknown_and_wrong_units_are_refused_by_name() {
    for (spelling, word) in [
        ("furlongs fortnight-1", "furlongs"),
        ("mol m-2 s-1 x", "\"x\""),
        ("", "empty"),
        ("m^99", "99"),
    ] {
        let error = parse(spelling).unwrap_err();
        assert!(error.contains(word), "{spelling}: {error}");
    }
    for spelling in [
        "mol (m2",
        "m^",
        "/",
        "(((((((m)))))))",
        "m//s",
        "\u{1F600}",
        &"m ".repeat(200),
    ] {
        assert!(parse(spelling).is_err(), "{spelling}");
    }
    assert!(
        parse("K")
            .unwrap()
            .to_quantity(Quantity::CarbonFlux, None)
            .is_err()
    );
    assert!(
        parse("m")
            .unwrap()
            .to_quantity(Quantity::SeaSurfaceTemperature, None)
            .unwrap_err()
            .contains("\"K\"")
    );
    assert!(parse("m9 m9 m9 m9 m9 m9 m9 m9 m9 m9 m9 m9 m9 m9 m9").is_err());
}

#[test]
fn a_unit_per_month_is_refused_for_steps_across_months() {
    let conversion = parse("g C m-2 month-1")
        .unwrap()
        .to_quantity(Quantity::CarbonFlux, None)
        .unwrap();
    let period = |a: &str, b: &str| Period::new(a.parse().unwrap(), b.parse().unwrap()).unwrap();
    assert!(
        conversion
            .for_period(period("2000-01-28", "2000-02-05"))
            .is_err()
    );
    let quarter = conversion
        .for_period(period("2000-01-01", "2000-04-01"))
        .unwrap()
        .0;
    close(quarter, 1e-3 / (91.0 * 86_400.0 / 3.0));
    close(
        conversion
            .for_period(period("2000-02-03", "2000-02-04"))
            .unwrap()
            .0,
        1e-3 / (29.0 * 86_400.0),
    );
}

#[test]
fn every_stored_unit_parses_to_itself() {
    for quantity in Quantity::ALL {
        let unit = parse(quantity.unit()).unwrap();
        let conversion = unit.to_quantity(quantity, Some(Substance::Carbon)).unwrap();
        assert_eq!(
            conversion
                .for_period(Period::month(2000, 1).unwrap())
                .unwrap(),
            (1.0, 0.0),
            "{quantity:?}"
        );
    }
}

/// Factors to stored units of the units that the conventions' table (version 93) has for the standard names that are known.
#[test]
fn canonical_units_of_the_conventions_are_read() {
    let month = Period::month(2001, 1).unwrap();
    for (name, unit, factor) in [
        (
            "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon",
            "kg m-2 s-1",
            1.0,
        ),
        (
            "surface_downward_mass_flux_of_carbon_dioxide_expressed_as_carbon",
            "kg m-2 s-1",
            1.0,
        ),
        (
            "surface_upward_mass_flux_of_carbon_dioxide",
            "kg m-2 s-1",
            0.012_011 / 0.044_009,
        ),
        (
            "surface_upward_mole_flux_of_carbon_dioxide",
            "mol m-2 s-1",
            0.012_011,
        ),
        ("sea_surface_temperature", "K", 1.0),
        ("sea_surface_skin_temperature", "K", 1.0),
        ("sea_surface_subskin_temperature", "K", 1.0),
        ("sea_surface_foundation_temperature", "K", 1.0),
        (
            "mass_concentration_of_chlorophyll_a_in_sea_water",
            "kg m-3",
            1.0,
        ),
        ("wind_speed", "m s-1", 1.0),
        (
            "surface_partial_pressure_of_carbon_dioxide_in_sea_water",
            "Pa",
            1.0,
        ),
        ("fugacity_of_carbon_dioxide_in_sea_water", "Pa", 1.0),
        ("sea_surface_salinity", "1e-3", 1.0),
        ("sea_water_salinity", "1e-3", 1.0),
        ("sea_water_practical_salinity", "1", 1.0),
        ("air_pressure_at_mean_sea_level", "Pa", 1.0),
        ("sea_ice_area_fraction", "1", 1.0),
        ("sea_area_fraction", "1", 1.0),
        ("land_area_fraction", "1", 1.0),
        ("sea_surface_wave_significant_height", "m", 1.0),
        ("precipitation_flux", "kg m-2 s-1", 1.0),
        ("rainfall_flux", "kg m-2 s-1", 1.0),
        ("lwe_precipitation_rate", "m s-1", 1000.0),
        ("rainfall_rate", "m s-1", 1000.0),
        ("eastward_sea_water_velocity", "m s-1", 1.0),
        ("surface_altitude", "m", 1.0),
        ("sea_floor_depth_below_geoid", "m", 1.0),
    ] {
        let named = of_standard_name(name).unwrap();
        let read = of(named.quantity, unit).unwrap();
        let conversion = read.to_quantity(named.quantity, named.substance).unwrap();
        let (found, offset) = conversion.for_period(month).unwrap();
        close(found, factor);
        assert!(offset.abs() <= 0.0, "{name}");
    }
}

#[test]
fn salinity_is_the_number_that_it_is_or_refused() {
    for spelling in [
        "1e-3", "0.001", "1.E-03", "PSU", "g/kg", "1", "PSS-78", "psu ",
    ] {
        let unit = of(Quantity::Salinity, spelling).unwrap();
        let conversion = unit.to_quantity(Quantity::Salinity, None).unwrap();
        let month = Period::month(2001, 1).unwrap();
        assert_eq!(
            conversion.for_period(month).unwrap(),
            (1.0, 0.0),
            "{spelling}"
        );
    }
    for spelling in ["%", "ppm", "kg/kg", "mg/kg", "K", "1e-6"] {
        let refused = of(Quantity::Salinity, spelling).unwrap_err();
        assert!(refused.contains("no unit of salinity"), "{refused}");
    }
}

/// Words that are known, with prefixes, and some that are not.
const WORDS: [&str; 24] = [
    "g", "kg", "Pg", "t", "m", "km", "pm", "l", "s", "ns", "d", "mon", "month", "yr", "K", "degC",
    "mol", "Tmol", "hPa", "%", "C", "CO2", "furlong", "1",
];

/// Spellings that look like units, with powers past every limit, and any text at all.
fn spellings() -> impl Strategy<Value = String> {
    let power = prop_oneof![
        Just(String::new()),
        (-130i32..130).prop_map(|n| n.to_string())
    ];
    let word = (
        prop::sample::select(&WORDS[..]),
        prop::sample::select(&["", "^", "**"][..]),
        power,
    )
        .prop_map(|(word, sign, power)| format!("{word}{sign}{power}"));
    let number = prop_oneof![
        any::<u64>().prop_map(|n| n.to_string()),
        Just("9".repeat(90))
    ];
    let mark = prop::sample::select(&[" ", "/", "(", ")", "*", ".", "-", "^"][..]);
    let part = prop_oneof![8 => word, 1 => number, 3 => mark.prop_map(str::to_owned)];
    let like = prop::collection::vec(part, 0..30).prop_map(|parts| parts.join(" "));
    // The longest that is read: one word again and again.
    let again = (prop::sample::select(&WORDS[..]), -9i32..10)
        .prop_map(|(word, power)| format!("{word}{power} ").repeat(100 / (word.len() + 3)));
    let pair = (again.clone(), again.clone())
        .prop_map(|(a, b)| format!("{} {}", &a[..a.len().min(49)], &b[..b.len().min(49)]));
    prop_oneof![3 => like, 2 => again, 3 => pair, 2 => ".{0,120}"]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4096, ..ProptestConfig::default() })]

    /// Whatever a file calls its unit, the answer is a factor that values can be multiplied by, or what is wrong.
    #[test]
    fn any_spelling_is_read_or_refused(spelling in spellings(), quantity in prop::sample::select(&Quantity::ALL[..])) {
        let conversions = parse(&spelling)
            .into_iter()
            .flat_map(|unit| [None, Some(Substance::Carbon), Some(Substance::Co2)].map(|s| unit.to_quantity(quantity, s)));
        for conversion in conversions.flatten() {
            for months in [1, 3] {
                let end = if months == 1 { "2000-02-01" } else { "2000-04-01" };
                let period = Period::new("2000-01-01".parse().unwrap(), end.parse().unwrap()).unwrap();
                if let Ok((factor, offset)) = conversion.for_period(period) {
                    prop_assert!(factor.is_normal() && factor > 0.0 && offset.is_finite(), "{spelling}: {factor}");
                }
            }
        }
    }
}

#[test]
fn powers_that_cannot_be_counted_are_refused() {
    let many = |word: &str, times: usize| vec![word; times].join(" ");
    // Each is within bounds; together, once a month is a time, they are not.
    let unit = parse(&format!("{} {}", many("s9", 14), many("mon9", 2))).unwrap();
    let error = unit.to_quantity(Quantity::CarbonFlux, None).unwrap_err();
    assert!(error.contains("powers too high"), "{error}");
    // The dimension is that of a flux, but no number holds so many months.
    let spelling = format!("kg C m-2 s-1 {} {}", many("s9", 7), many("mon-9", 7));
    let conversion = parse(&spelling)
        .unwrap()
        .to_quantity(Quantity::CarbonFlux, None)
        .unwrap();
    let error = conversion
        .for_period(Period::month(2000, 1).unwrap())
        .unwrap_err();
    assert!(error.contains("factor"), "{error}");
    for spelling in [
        "m-128",
        "m^-128",
        "m127 s",
        &many("Pg9", 24),
        &many("pm9", 24),
    ] {
        assert!(parse(spelling).is_err(), "{spelling}");
    }
}
