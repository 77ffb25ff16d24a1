use super::unit::Scaled;
use super::*;

fn inputs() -> Vec<(String, Unit)> {
    [
        ("sst", Unit::KELVIN),
        ("wind", Unit::METRE_PER_SECOND),
        ("ice", Unit::ONE),
        ("pco2", Unit::PASCAL),
        ("taka-sss", Unit::ONE),
    ]
    .map(|(name, unit)| (name.to_owned(), unit))
    .to_vec()
}

fn read(text: &str) -> Result<Expression, String> {
    Expression::read(text, &inputs())
}

/// Two cells with all, one without ice, one without temperature.
fn evaluate(text: &str) -> Evaluated {
    let gap = f32::NAN;
    let columns: [&[f32]; 5] = [
        &[290.0, 300.0, 290.0, gap],
        &[7.0, 10.0, 7.0, 7.0],
        &[0.0, 0.5, gap, 0.0],
        &[36.0, 40.0, 36.0, 36.0],
        &[35.0; 4],
    ];
    read(text).unwrap().evaluate(&columns).unwrap()
}

#[track_caller]
fn close(found: &[f64], expected: &[f64]) {
    let is_close = |(found, expected): (&f64, &f64)| {
        (found - expected).abs() < 1e-12 * expected.abs().max(1.0)
            || found.is_nan() && expected.is_nan()
    };
    assert_eq!(found.len(), expected.len(), "{found:?}");
    assert!(found.iter().zip(expected).all(is_close), "{found:?}");
}

#[test]
fn arithmetic_is_of_64_bits_and_half_is_no_whole_number() {
    close(&evaluate("wind * 1/2").values, &[3.5, 5.0, 3.5, 3.5]);
    close(
        &evaluate("sst - unit(0.5, 'K')").values,
        &[289.5, 299.5, 289.5, f64::NAN],
    );
    close(&evaluate("-ice + 1").values, &[1.0, 0.5, f64::NAN, 1.0]);
    close(&evaluate("\"taka-sss\" / 7").values, &[5.0; 4]);
}

#[test]
fn no_data_in_an_input_is_no_data_whatever_is_compared() {
    let open = "CASE WHEN ice > 0.1 THEN 1 - ice ELSE 1 END * wind";
    close(&evaluate(open).values, &[7.0, 5.0, f64::NAN, 7.0]);
    let filled = open.replace("ice", "coalesce(ice, 0)");
    close(&evaluate(&filled).values, &[7.0, 5.0, 7.0, 7.0]);
    close(
        &evaluate("greatest(ice, 0.2)").values,
        &[0.2, 0.5, f64::NAN, 0.2],
    );
    // Where it stands outside as well, it is needed.
    let both = "coalesce(ice, 0) + ice";
    assert!(evaluate(both).values[2].is_nan());
}

#[test]
fn functions_of_the_flux_are_those_of_the_papers_and_count_what_they_do_not_hold_for() {
    let found = evaluate("gas_transfer_wanninkhof1992(wind * wind, schmidt_wanninkhof1992(sst))");
    let by_hand = |wind: f64, sst| {
        crate::air_sea::gas_transfer::wanninkhof1992(
            wind * wind,
            crate::air_sea::schmidt::wanninkhof1992(sst),
        )
    };
    let expected = [
        by_hand(7.0, 290.0),
        by_hand(10.0, 300.0),
        by_hand(7.0, 290.0),
        f64::NAN,
    ];
    close(&found.values, &expected);
    assert_eq!(found.outside, BTreeMap::new());
    // Beside temperatures degrees Celsius are one.
    for celsius in [
        "CASE WHEN sst > unit(6.85, 'degC') THEN 1 ELSE 0 END",
        "CASE WHEN sst > unit(280, 'K') THEN 1 ELSE 0 END",
    ] {
        close(
            &evaluate(celsius).values,
            &evaluate("CASE WHEN sst > unit(280, 'K') THEN 1 ELSE 0 END").values,
        );
    }
    let cold = evaluate("schmidt_wanninkhof1992(sst - unit(20, 'K'))");
    assert_eq!(cold.outside["schmidt_wanninkhof1992"], 2);
    let constant = evaluate("wind * carbon_kg_per_mol()").values[0];
    close(&[constant], &[7.0 * 0.012_011]);
}

#[test]
fn what_is_no_number_is_no_data_and_counted() {
    let found = evaluate("wind / ice");
    close(&found.values, &[f64::NAN, 20.0, f64::NAN, f64::NAN]);
    assert_eq!(found.not_finite, 2);
    assert_eq!(evaluate("sqrt(pco2 * pco2 * -1)").not_finite, 4);
    for (power, of_half) in [("power(ice, -1)", 2.0), ("power(ice, -2)", 4.0)] {
        let found = evaluate(power);
        close(&found.values, &[f64::NAN, of_half, f64::NAN, f64::NAN]);
        assert_eq!(found.not_finite, 2, "{power}");
    }
}

/// Without ice 0 / 0, in the first cell and in the last, which is none by bits below or above every number.
#[test]
fn no_comparison_with_what_is_no_number_is_true() {
    for truth in [
        "ice / ice < 2",
        "ice / ice <= 1",
        "ice / ice > 0",
        "ice / ice >= 1",
        "2 > ice / ice",
        "0 < ice / ice",
        "ice / ice = 1",
        "ice / ice <> 2",
        "ice / ice = ice / ice",
        "NOT ice / ice < 1",
        "NOT ice / ice > 1",
        "NOT (ice / ice > 1 OR ice / ice < 1)",
        "ice / ice BETWEEN 0 AND 2",
        "ice / ice NOT BETWEEN 2 AND 3",
        "1 BETWEEN ice / ice AND 2",
        "-(ice / ice) < 0",
        "-(ice / ice) > -2",
        "sqrt(ice - 0.25) > 0",
        "sqrt(ice - 0.25) < 1",
    ] {
        let chosen = evaluate(&format!("CASE WHEN {truth} THEN 1 ELSE 2 END"));
        let expected = [2.0, 1.0, f64::NAN, 2.0];
        let is_same = |(found, expected): (&f64, &f64)| found.total_cmp(expected).is_eq();
        assert_eq!(chosen.values.len(), expected.len(), "{truth}");
        let mut all = chosen.values.iter().zip(&expected);
        assert!(all.all(is_same), "{truth}: {:?}", chosen.values);
        assert_eq!(chosen.not_finite, 0);
    }
    // Only what is compared is none: without a comparison it is masked and counted as before.
    assert_eq!(evaluate("ice / ice").not_finite, 2);
}

#[test]
fn units_that_the_reason_gives_as_forms_are_read() {
    for form in [
        "unit(1, 'm s-1')",
        "unit(20, 'mol m-2 year-1')",
        "unit(5, 'hPa')",
        "unit(0.17, 'K')",
    ] {
        assert!(read(form).is_ok(), "{form}");
    }
    let unknown = read("nobody - unit(1, 'K')").map(|_| ()).unwrap_err();
    assert!(!unknown.contains("single quotes"), "{unknown}");
}

#[test]
fn mixed_units_and_whatever_is_no_arithmetic_are_refused_with_the_reason() {
    for (text, reason) in [
        ("sst + wind", "one is in K, the other in m s-1"),
        ("sst - 273.15", "one is in K, the other in 1"),
        ("ice > sst", "one is in 1, the other in K"),
        (
            "CASE WHEN ice > 0.1 THEN sst ELSE wind END",
            "branches of CASE",
        ),
        ("coalesce(sst, 280)", "arguments of coalesce"),
        ("exp(sst)", "takes a pure number"),
        ("sqrt(sst)", "no whole powers"),
        ("power(sst, ice)", "second argument of power"),
        (
            "gas_transfer_wanninkhof2014(wind, 660)",
            "is in m s-1, but gas_transfer_wanninkhof2014(wind_moment2",
        ),
        ("schmidt_wanninkhof2014(sst, ice)", "2 arguments are given"),
        ("sst > unit(280, 'K')", "it is a comparison"),
        ("unit(1, 'furlong') * sst", "no unit"),
        ("unit(1,'m/s')", "as in unit(1, 'm s-1')"),
        ("unit(1, 'm s^-1')", "as in unit(1, 'm s-1')"),
        ("unit(1)", "a number and a unit: unit(0.17, 'K')"),
        ("unit('K', 1)", "a number and a unit: unit(0.17, 'K')"),
        (
            "sst - unit(1, \"K\")",
            "in single quotes, as in unit(0.17, 'K')",
        ),
        (
            "sst - unit(1, K)",
            "in single quotes, as in unit(0.17, 'K')",
        ),
        (
            "sst - unit(0.17, 'degC')",
            "unit(0.17, 'degC') in arithmetic may be a temperature or a difference",
        ),
        ("sst * unit(2, 'degC')", "may be a temperature"),
        ("sst + -unit(2, 'degC')", "may be a temperature"),
        ("coalesce(sst, -unit(1.8, 'degC'))", "may be a temperature"),
        (
            "sst - CASE WHEN ice > 0.5 THEN unit(0.17, 'degC') ELSE unit(0, 'K') END",
            "may be a temperature",
        ),
        ("sst - least(sst, unit(2, 'degC'))", "may be a temperature"),
        (
            "CASE WHEN abs(sst - unit(280, 'K')) > unit(2, 'degC') THEN sst END",
            "may be a temperature",
        ),
        ("nobody * 2", "\"nobody\" is not an input; inputs are "),
        ("sin(ice)", "the function sin is not one of"),
        ("ice % 2", "operator %"),
        ("CAST(ice AS INT)", "not understood"),
        ("(SELECT 1)", ""),
        ("ice IS NULL", "not understood"),
        ("sum(ice)", "not understood"),
        ("ice +", "the expression cannot be read: Expected"),
        ("ice; DROP TABLE x", ""),
        ("'text'", ""),
        ("", ""),
        (&"(".repeat(3000), ""),
        (&"ice+".repeat(2500), "longer than"),
        (&format!("ice{}", "+1".repeat(4000)), "one in another"),
    ] {
        let refused = read(text).map(|_| ()).unwrap_err();
        assert!(refused.contains(reason), "{text}: {refused}");
        assert!(!refused.contains('\n'), "{refused}");
    }
}

#[test]
fn an_input_that_is_called_as_a_word_of_sql_is_told_how_it_is_written() {
    let inputs = [
        ("sst-2010".to_owned(), Unit::ONE),
        ("any".to_owned(), Unit::ONE),
    ];
    let read = |text: &str| Expression::read(text, &inputs).map(|_| ());
    let refused = read("2 * any").unwrap_err();
    assert!(refused.contains("the input any is called as"), "{refused}");
    assert_eq!(read("\"any\" * \"sst-2010\""), Ok(()));
}

/// Statistics are kept in units that people read.
#[test]
fn inputs_and_results_of_other_units_are_of_si_in_between() {
    let rise = Scaled::kept("K year-1").unwrap();
    let inputs = [("rise".to_owned(), rise.unit)];
    let values = |text: &str, stored: &str| {
        let stored = Scaled::kept(stored).unwrap();
        let read = Expression::read(text, &inputs).unwrap();
        assert_eq!(read.unit(), stored.unit, "{text}");
        let read = read.with_factors(vec![rise.factor], stored.factor);
        read.evaluate(&[&[0.5, f32::NAN]]).unwrap().values
    };
    close(&values("rise * unit(10, 'year')", "K"), &[5.0, f64::NAN]);
    close(&values("rise * 2", "K year-1"), &[1.0, f64::NAN]);
    let day = values("rise", "K day-1")[0];
    assert!((day * 365.25 - 0.5).abs() < 1e-12, "{day}");
    assert_eq!(
        Scaled::kept("kg m-2 s-1").unwrap().factor.to_bits(),
        1.0_f64.to_bits()
    );
    for other in ["degC", "%", "ppm"] {
        assert_eq!(Scaled::kept(other), None, "{other}");
    }
}

#[test]
fn what_is_compared_alone_is_not_computed_with() {
    let of = |text: &str| {
        let found = computed_with(text, &["a", "b", "c"]);
        found.into_iter().collect::<Vec<_>>().join(" ")
    };
    assert_eq!(of("a * 0.5 + abs(b)"), "a b");
    assert_eq!(
        of("CASE WHEN a > 0 AND c BETWEEN 1 AND 2 THEN b ELSE 0 END"),
        "b"
    );
    assert_eq!(of("2 * CASE WHEN a > b THEN 1 ELSE c END"), "c");
    assert_eq!(of("coalesce(a, c)"), "a c");
    assert_eq!(of("no ("), "a b c");
}
