use super::*;
use crate::inspect::file::description::AttributeValue;

const SHORT: Kind = Kind::Integer(2);
const FLOAT: Kind = Kind::Float(4);
const DOUBLE: Kind = Kind::Float(8);

fn variable(kind: Kind, numbers: &[(&str, Kind, &[f64])]) -> Variable {
    let attribute = |(name, kind, values): &(&str, Kind, &[f64])| {
        let value = AttributeValue::Numbers {
            kind: *kind,
            bits: values.iter().map(|v| (*v).into()).collect(),
        };
        ((*name).to_owned(), value)
    };
    Variable {
        name: "v".into(),
        dimensions: vec![],
        kind,
        attributes: numbers.iter().map(attribute).collect(),
    }
}

/// Shorts that unpack to float32 degrees: 0.01 times the number, plus 20.
fn packed(range: &[(&str, Kind, &[f64])]) -> Packing {
    let mut attributes: Vec<(&str, Kind, &[f64])> = vec![
        ("scale_factor", FLOAT, &[0.01]),
        ("add_offset", FLOAT, &[20.0]),
        ("_FillValue", SHORT, &[-32_768.0]),
    ];
    attributes.extend_from_slice(range);
    Packing::of(&variable(SHORT, &attributes))
}

#[test]
fn packing_that_is_written_as_text_counts_and_what_is_no_number_is_no_packing() {
    let told = |name: &str, text: &str| {
        let mut shorts = variable(SHORT, &[]);
        let text = AttributeValue::Text(text.to_owned());
        shorts.attributes.0.insert(name.to_owned(), text);
        Packing::of(&shorts)
    };
    assert_eq!(told("scale_factor", "0.5").value(3.0), 1.5);
    assert_eq!(told("add_offset", " 20").value(3.0), 23.0);
    assert!(told("missing_value", "-999, -998").value(-998.0).is_nan());
    assert!(told("scale_factor", "see the manual").scale.is_nan());
    assert!(told("add_offset", "none").offset.is_nan());
    assert_eq!(told("scale_factor", "").value(3.0), 3.0);
    // A decimal comma is none between numbers.
    for (name, text) in [("add_offset", "273,15"), ("scale_factor", "1, 5")] {
        let packing = told(name, text);
        assert!(packing.checked(&variable(SHORT, &[])).is_err(), "{text}");
    }
    assert_eq!(told("_FillValue", "-999,0").value(0.0), 0.0);
    assert!(
        told("add_offset", "273.15")
            .checked(&variable(SHORT, &[]))
            .is_ok()
    );
    // Bounds of values are known by their type, whatever type the scale is written in.
    let bounds = [
        ("valid_min", FLOAT, &[-1.0][..]),
        ("valid_max", FLOAT, &[40.0]),
    ];
    let mut shorts = variable(SHORT, &bounds);
    let scale = AttributeValue::Text("0.01".to_owned());
    shorts.attributes.0.insert("scale_factor".to_owned(), scale);
    let packing = Packing::of(&shorts);
    assert_eq!(
        (packing.value(2500.0), packing.assumption.as_ref()),
        (25.0, None)
    );
    assert!(packing.value(4100.0).is_nan());
}

#[test]
fn a_valid_range_that_is_written_as_text_counts_and_what_is_no_numbers_is_refused() {
    let with = |mut own: Variable, texts: &[(&str, &str)]| {
        for (name, text) in texts {
            let text = AttributeValue::Text((*text).to_owned());
            own.attributes.0.insert((*name).to_owned(), text);
        }
        own
    };
    let float = |texts: &[(&str, &str)]| Packing::of(&with(variable(FLOAT, &[]), texts));
    for texts in [
        &[("valid_range", "0.0 100.1")][..],
        &[("valid_range", "0, 100.1")],
        &[("valid_min", " 0"), ("valid_max", "100.1")],
    ] {
        let packing = float(texts);
        assert_eq!(packing.value(0.0), 0.0, "{texts:?}");
        // In the precision of the values.
        let most = f64::from(100.1f32);
        assert_eq!(packing.value(most), most, "{texts:?}");
        for outside in [-1.0, 100.2] {
            assert!(packing.value(outside).is_nan(), "{outside} {texts:?}");
        }
        assert!(packing.checked(&variable(FLOAT, &[])).is_ok());
    }
    // Of packed values those that are written as no stored integer is, or that none can be; of others it is said.
    let scale = [("scale_factor", FLOAT, &[0.01][..])];
    let packed = |texts: &[(&str, &str)]| Packing::of(&with(variable(SHORT, &scale), texts));
    for (text, is_of_values) in [
        ("0.0 40.0", true),
        ("0 1e1", true),
        ("0 70000", false),
        ("0 40", false),
    ] {
        let packing = packed(&[("valid_range", text)]);
        assert_eq!(packing.value(900.0).is_nan(), text == "0 40", "{text}");
        assert_eq!(packing.assumption.is_none(), is_of_values, "{text}");
        let told = packing.assumption.unwrap_or_default();
        assert!(
            is_of_values || told.contains("valid_range is text"),
            "{told}"
        );
    }
    for (name, text) in [
        ("valid_range", "0 to 100"),
        ("valid_range", "0"),
        ("valid_min", "0,5"),
        ("valid_max", "0 100"),
        ("valid_max", "none"),
    ] {
        let packing = float(&[(name, text)]);
        let own = packing.clone().with_valid_values(0.0, 1.0);
        let refused = packing.checked(&variable(FLOAT, &[])).unwrap_err();
        assert!(
            refused.detail.contains(name) && refused.detail.contains(text),
            "{refused}"
        );
        assert!(
            own.checked(&variable(FLOAT, &[])).is_ok(),
            "a profile says it"
        );
    }
    assert!(
        float(&[("valid_min", "")])
            .checked(&variable(FLOAT, &[]))
            .is_ok()
    );
}

#[test]
fn a_fill_value_that_is_no_number_is_refused_unless_a_profile_says_another() {
    let with = |mut own: Variable, name: &str, text: &str| {
        let text = AttributeValue::Text(text.to_owned());
        own.attributes.0.insert(name.to_owned(), text);
        own
    };
    for name in ["_FillValue", "missing_value"] {
        for text in ["abc", "-999,0", "{\"value\":-999}"] {
            let own = with(variable(FLOAT, &[]), name, text);
            let refused = Packing::of(&own).checked(&own).unwrap_err();
            for part in [name, "the fill value"] {
                assert!(refused.detail.contains(part), "{refused}");
            }
            let packing = Packing::of(&own).with_fills([-999.0]);
            assert!(packing.value(-999.0).is_nan());
            assert!(packing.checked(&own).is_ok(), "a profile says it");
            let of_axes = Packing::of(&own).with_any_range_text();
            assert!(of_axes.checked(&own).is_ok(), "{text}");
        }
        for text in ["-999", "-999, -998", "NaN", ""] {
            let own = with(variable(FLOAT, &[]), name, text);
            assert!(Packing::of(&own).checked(&own).is_ok(), "{text}");
        }
        // The fill value of text is a letter.
        let letters = with(variable(Kind::Other, &[]), name, "x");
        assert!(Packing::of(&letters).checked(&letters).is_ok());
    }
}

/// Halves are 8 apart there: -9999 is stored as -10000.
#[test]
fn a_fill_value_of_more_digits_than_values_have_is_the_nearest_of_theirs() {
    let half = Kind::Float(2);
    let packing = Packing::of(&variable(half, &[("_FillValue", DOUBLE, &[-9999.0])]));
    assert!(packing.value(-10_000.0).is_nan());
    assert!((packing.value(-9992.0) + 9992.0).abs() < 1e-9);
}

#[test]
fn a_range_of_the_stored_type_speaks_of_stored_numbers() {
    let packing = packed(&[("valid_range", SHORT, &[-300.0, 4500.0])]);
    assert!((packing.value(2000.0) - 40.0).abs() < 1e-12);
    assert!(packing.value(-32_768.0).is_nan() && packing.value(4501.0).is_nan());
    assert_eq!(packing.value(4500.0), 65.0);
    assert_eq!(packing.assumption, None);
}

#[test]
fn a_range_of_the_unpacked_type_speaks_of_values() {
    for range in [
        vec![("valid_range", FLOAT, &[-2.0, 45.0][..])],
        vec![
            ("valid_min", FLOAT, &[-2.0][..]),
            ("valid_max", FLOAT, &[45.0][..]),
        ],
    ] {
        let packing = packed(&range);
        for stored in [-2200.0, 0.0, 2500.0] {
            assert_eq!(packing.value(stored), stored * 0.01 + 20.0, "{stored}");
        }
        assert!(packing.value(-2201.0).is_nan() && packing.value(2501.0).is_nan());
        assert_eq!(packing.assumption, None);
    }
}

#[test]
fn a_bound_in_single_precision_is_within_the_range() {
    let scale = f64::from(0.005f32);
    let numbers: [(&str, Kind, &[f64]); 2] = [
        ("scale_factor", FLOAT, &[scale]),
        ("valid_max", FLOAT, &[45.0]),
    ];
    let packing = Packing::of(&variable(SHORT, &numbers));
    assert_eq!(packing.value(9000.0), 9000.0 * scale);
    assert!(packing.value(9001.0).is_nan());
}

#[test]
fn a_range_of_a_third_type_is_of_values_if_it_must_be_and_else_an_assumption() {
    let packing = packed(&[("valid_range", DOUBLE, &[-2.5, 45.5])]);
    assert!(packing.value(2600.0).is_nan() && !packing.value(0.0).is_nan());
    assert_eq!(packing.assumption, None);
    let packing = packed(&[("valid_range", DOUBLE, &[-200.0, 4500.0])]);
    assert!(packing.value(-201.0).is_nan() && !packing.value(4500.0).is_nan());
    let said = packing.assumption.unwrap();
    assert!(
        said.contains("valid_range") && said.contains("float64"),
        "{said}"
    );
    let own = packed(&[("valid_range", DOUBLE, &[-200.0, 4500.0])]).with_valid_values(0.0, 30.0);
    assert_eq!((own.value(-1000.0), own.assumption), (10.0, None));
}

#[test]
fn unsigned_bytes_have_unsigned_fills_and_ranges() {
    let byte = Kind::Integer(1);
    let mut numbers = variable(
        byte,
        &[
            ("_FillValue", byte, &[-1.0]),
            ("valid_range", byte, &[0.0, -6.0]),
            ("scale_factor", FLOAT, &[0.5]),
        ],
    );
    let text = AttributeValue::Text("true".to_owned());
    numbers.attributes.0.insert("_Unsigned".to_owned(), text);
    let packing = Packing::of(&numbers);
    assert_eq!(packing.value(-6.0), 125.0);
    assert_eq!(packing.value(100.0), 50.0);
    assert!(packing.value(-1.0).is_nan() && packing.value(-5.0).is_nan());
    // Some write the fill value as it is meant, and some as it is stored.
    for fill in [255.0, -1.0] {
        let fill = [("_FillValue", Kind::Integer(2), &[fill][..])];
        let mut numbers = variable(byte, &fill);
        let text = AttributeValue::Text("true".to_owned());
        numbers.attributes.0.insert("_Unsigned".to_owned(), text);
        let packing = Packing::of(&numbers);
        assert!(packing.value(-1.0).is_nan());
        assert_eq!(packing.value(-2.0), 254.0);
    }
}

#[test]
fn every_kind_of_missing_is_missing() {
    let float = Packing::of(&variable(
        FLOAT,
        &[
            ("_FillValue", FLOAT, &[-999.9]),
            ("missing_value", FLOAT, &[-5.0]),
        ],
    ));
    for stored in [
        f64::NAN,
        f64::INFINITY,
        f64::from(-999.9f32),
        -999.9,
        -5.0,
        9.969209968386869e36,
        1e35,
        -1e35,
    ] {
        assert!(float.value(stored).is_nan(), "{stored}");
    }
    assert_eq!(float.value(-999.0), -999.0);
    for (kind, fill) in [(SHORT, -32_767.0), (Kind::Unsigned(2), 65_535.0)] {
        assert!(Packing::of(&variable(kind, &[])).value(fill).is_nan());
        let beside = [("missing_value", kind, &[9.0][..])];
        let packing = Packing::of(&variable(kind, &beside));
        assert!(packing.value(fill).is_nan() && packing.value(9.0).is_nan());
        let own = [("_FillValue", kind, &[9.0][..])];
        assert_eq!(Packing::of(&variable(kind, &own)).value(fill), fill);
    }
}
