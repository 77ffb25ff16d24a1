use contract::time::Period;

use super::*;

fn series(values: &[Option<f64>]) -> PointSeries {
    let step = |(month, value): (u32, &Option<f64>)| {
        let period = Period::month(2001 + (month / 12) as i32, month % 12 + 1).unwrap();
        contract::series::PointValue {
            start: period.start,
            end: period.end,
            mid: period.mid(),
            value: *value,
            contributed: None,
        }
    };
    PointSeries {
        cited: Cited {
            product: "sst".parse().unwrap(),
            manifest: "sst@1-00000000".parse().unwrap(),
            title: "Sea <b>& sky".to_owned(),
            source: "made by a test".to_owned(),
            synthetic: true,
            quantity: contract::quantity::Quantity::SeaSurfaceTemperature,
            unit: "°C".to_owned(),
        },
        lon_deg: 0.0,
        lat_deg: 0.0,
        cell: contract::series::Cell {
            row: 0,
            col: 0,
            lon_deg: 0.5,
            lat_deg: 0.5,
        },
        series: (0..).zip(values).map(step).collect(),
    }
}

#[test]
fn a_series_is_drawn_with_its_product_unit_version_and_source_and_breaks_at_gaps() {
    let values = [
        Some(1.0),
        Some(2.0),
        None,
        Some(3.0),
        None,
        Some(1.5),
        Some(1.0),
    ];
    let svg = of_point(&series(&values)).unwrap();
    for text in [
        "Sea-surface temperature",
        "(synthetic)",
        "(°C)",
        "sst@1-00000000",
        "made by a test",
        "5 of 7 steps",
        "2001-03",
    ] {
        assert!(svg.contains(text), "{text}: {svg}");
    }
    assert!(!svg.contains("<b>"), "a title is text, not markup");
    let lines = |svg: &str| svg.matches("stroke=\"#0072B2\"").count();
    // Three runs, one of them of a single step, which is a dot and no line.
    assert_eq!((svg.matches("<circle").count(), lines(&svg)), (5, 2));
    assert_eq!(svg, of_point(&series(&values)).unwrap());
    let whole = of_point(&series(&[Some(1.0); 7])).unwrap();
    assert_eq!(lines(&whole), 1);
    let nothing = of_point(&series(&[None; 7])).unwrap();
    assert!(nothing.contains("0 of 7 steps") && !nothing.contains("<circle"));
}
