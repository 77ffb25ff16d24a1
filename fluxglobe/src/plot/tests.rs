use serde_json::{Value, json};

use super::*;

fn cited(more: Value) -> Value {
    let mut cited = json!({"product": "sst", "manifest": "sst@1-00000000", "title": "A <b>& title",
        "source": "made by a test", "synthetic": true, "quantity": "sea_surface_temperature", "unit": "°C"});
    let Value::Object(more) = more else {
        unreachable!("an object is given")
    };
    cited.as_object_mut().unwrap().extend(more);
    cited
}

fn month(index: u32) -> (String, String) {
    let period = contract::time::Period::month(2001 + (index / 12) as i32, index % 12 + 1).unwrap();
    (period.start.to_string(), period.end.to_string())
}

fn analysis(part: &str, made: Value) -> SeriesAnalysis {
    let mut all = cited(json!({"region": "global", "start": "2001-01-01T00:00:00Z",
        "end": "2011-01-01T00:00:00Z", "step_count": 120, "value_count": 120, "notes": [], "refused": []}));
    all[part] = made;
    serde_json::from_value(all).unwrap()
}

/// Bands over two years.
fn bands_of(made: Value) -> String {
    let answer = serde_json::from_value(cited(made)).unwrap();
    let data = Period::new("2001".parse().unwrap(), "2003".parse().unwrap()).unwrap();
    of_hovmoller(&answer, data).unwrap()
}

fn is_told(svg: &str) {
    for text in [
        "Sea-surface temperature",
        "(synthetic)",
        "°C",
        "sst@1-00000000",
        "made by a test",
    ] {
        assert!(svg.contains(text), "{text}");
    }
    assert!(!svg.contains("<b>"), "a title is text, not markup");
    let png = legend::raster::png(svg).unwrap();
    assert!(png.len() > 5_000, "a picture of nothing");
}

#[test]
fn a_climatology_is_a_line_of_means_in_a_band_of_spreads() {
    let row = |bin: u32| {
        let spread = (bin != 4).then_some(1.0);
        json!({"bin": "m", "mean": (bin != 7).then(|| f64::from(bin)), "spread": spread, "count": 3, "years": 3})
    };
    let rows: Vec<Value> = (0..12).map(row).collect();
    let made = json!({"bins": "month", "base": "2001/2010", "rows": rows});
    let svg = of_analysis(&analysis("climatology", made)).unwrap();
    is_told(&svg);
    assert!(svg.contains("2001/2010") && svg.contains("Jan") && svg.contains("Dec"));
    assert!(!svg.contains("alone"), "all of its years have steps");
    let made = json!({"bins": "month", "base": "1991/2020", "rows": rows});
    let short = of_analysis(&analysis("climatology", made)).unwrap();
    assert!(short.contains("1991/2020 (steps in 2001/2010 alone)"));
    // One month has no data and one no spread: three bands, and eleven dots.
    assert_eq!(
        (
            svg.matches("<polygon").count(),
            svg.matches("<circle").count()
        ),
        (3, 11)
    );
}

/// Ten years of months with these values, whatever the lines through them.
fn trend_of(of: impl Fn(u32) -> f64) -> Value {
    let value = |index: u32| {
        let (start, end) = month(index);
        json!({"start": start, "end": end, "value": of(index)})
    };
    let values: Vec<Value> = (0..120).map(value).collect();
    json!({"slope_unit": "°C per decade", "step": "month", "deseasonalised": true, "count": 120,
        "years": 10.0, "mid": "2006-01-01T00:00:00Z", "mean": 0.6,
        "least_squares": {"slope_per_decade": 1.2, "standard_error_per_decade": 0.1, "lower_per_decade": 1.0,
            "upper_per_decade": 1.4, "p_value": 1e-9, "lag1_autocorrelation": 0.1, "effective_count": 100.0},
        "theil_sen": {"slope_per_decade": 1.2, "lower_per_decade": 1.1, "upper_per_decade": 1.3, "at_mid": 0.6},
        "mann_kendall": {"score": 7000, "tau": 0.99, "variance_correction": 1.0, "z": 9.0, "p_value": 0.02},
        "values": values})
}

#[test]
fn a_trend_is_its_values_two_lines_and_their_bands() {
    let made = trend_of(|index| f64::from(index) / 100.0);
    let svg = of_analysis(&analysis("trend", made)).unwrap();
    is_told(&svg);
    for text in [
        "Theil-Sen +1.2000 °C per decade, p = 0.0200",
        "p &lt; 0.0001",
        "95 %",
        "2010",
    ] {
        assert!(svg.contains(text), "{text}: {svg}");
    }
    assert_eq!(svg.matches("<polygon").count(), 2);
}

#[test]
fn what_is_asked_for_together_is_drawn_one_below_the_other() {
    let trend = analysis("trend", trend_of(|index| f64::from(index) / 100.0));
    let row = |bin: u32| json!({"bin": "m", "mean": f64::from(bin), "spread": 1.0, "count": 3, "years": 3});
    let rows: Vec<Value> = (0..12).map(row).collect();
    let made = json!({"bins": "month", "base": "2001/2010", "rows": rows});
    let normals = analysis("climatology", made);
    let both = SeriesAnalysis {
        climatology: normals.climatology.clone(),
        ..trend.clone()
    };
    let svg = of_analysis(&both).unwrap();
    is_told(&svg);
    for (own, text) in [(&normals, "Jan"), (&trend, "Theil-Sen")] {
        let own = of_analysis(own).unwrap();
        assert!(own.contains(text) && svg.contains(text), "{text}");
        let (_, marks) = own.split_once('\n').unwrap();
        assert!(
            svg.contains(marks.trim_end()),
            "{text} is drawn as by itself"
        );
    }
    assert!(svg.contains("<svg y=\"620\"") && svg.contains("height=\"1240\""));
}

/// The highest value is the first one, in the corner of the legend.
#[test]
fn a_legend_hides_no_value() {
    let made = trend_of(|index| 1.2 - f64::from(index) / 100.0);
    let svg = of_analysis(&analysis("trend", made)).unwrap();
    let number = |line: &str, name: &str| -> f64 {
        let (_, rest) = line.split_once(&format!(" {name}=\"")).unwrap();
        rest.split('"').next().unwrap().parse().unwrap()
    };
    let dots = svg.lines().filter(|line| line.starts_with("<circle"));
    let highest = dots.map(|line| number(line, "cy")).fold(f64::MAX, f64::min);
    // The box behind the legend is the last rectangle before its words.
    let (before, _words) = svg.split_once("Theil-Sen").unwrap();
    let mut lines = before.lines();
    let behind = lines.rfind(|line| line.starts_with("<rect")).unwrap();
    let bottom = number(behind, "y") + number(behind, "height");
    assert!(bottom < highest, "{behind}: {highest}");
}

#[test]
fn anomalies_are_bars_of_two_colours() {
    let row = |index: u32| {
        let (start, end) = month(index);
        let anomaly = (index != 3).then(|| f64::from(index) - 5.0);
        json!({"start": start, "end": end, "mid": start, "value": anomaly, "normal": 0.0, "anomaly": anomaly,
            "standardised": null})
    };
    let rows: Vec<Value> = (0..12).map(row).collect();
    let made = json!({"bins": "month", "base": "2001/2010", "rows": rows});
    let svg = of_analysis(&analysis("anomaly", made)).unwrap();
    is_told(&svg);
    let bars = |colour: &str| svg.matches(&format!("fill=\"{colour}\"")).count();
    // One is missing, and what is zero has no bar.
    assert_eq!((bars("#0072B2"), bars("#D55E00")), (4, 6));
    let marked = |text: &str| svg.contains(&format!("\n{text}\n"));
    assert!(marked("−5.0") && marked("0.0") && marked("5.0"));
}

#[test]
fn bands_against_time_have_the_colours_of_the_quantity_and_a_bar_of_them() {
    let row = |index: u32| {
        let (start, end) = month(index);
        let means = json!([f64::from(index), 20.0, null]);
        json!({"start": start, "end": end, "means": means, "coverage_percent": [100.0, 100.0, 0.0]})
    };
    let rows: Vec<Value> = (0..24).map(row).collect();
    let band = |low: f64| json!({"low_deg": low, "high_deg": low + 30.0, "area_m2": 1e12});
    let mut made = json!({"along": "lat", "band_deg": 30.0, "bounds_deg": [-180.0, -30.0, 180.0, 60.0],
        "step": "month", "earth": "wgs84", "coverage_basis": "cells", "notes": [],
        "bands": [band(-30.0), band(0.0), band(30.0)], "rows": rows});
    let svg = bands_of(made.clone());
    is_told(&svg);
    assert!(svg.contains("degrees north") && svg.contains("2002-01"));
    assert_eq!(svg.matches("fill=\"#D6D6D6\"").count(), 24);
    assert!(svg.contains("gray: no data") && !svg.contains("coverage"));
    made["region"] = json!("basins@1-0a1b2c3d:30 (north)");
    made["min_coverage_percent"] = json!(40.0);
    made["left_out_count"] = json!(24);
    let svg = bands_of(made);
    assert!(svg.contains("degrees of basins@1-0a1b2c3d:30 (north), over each month"));
    assert!(svg.contains("coverage of less than 40 %"));
}

#[test]
fn the_whole_period_of_bands_is_a_profile_with_its_spread_broken_where_nothing_is() {
    let band = |low: f64| json!({"low_deg": low, "high_deg": low + 30.0, "area_m2": 1e12});
    let bands = [-60.0, -30.0, 0.0, 30.0].map(band);
    let rows = [
        json!({"start": month(0).0, "end": month(11).1, "means": [3.0, 4.0, null, 5.0], "stds": [1.0, 0.5, null, 2.0],
        "coverage_percent": [100.0, 50.0, 0.0, 75.0]}),
    ];
    let made = json!({"along": "lat", "band_deg": 30.0, "bounds_deg": [-180.0, -60.0, 180.0, 60.0],
        "step": "total", "earth": "wgs84", "coverage_basis": "cells", "notes": [], "bands": bands, "rows": rows});
    let svg = bands_of(made);
    is_told(&svg);
    assert!(svg.contains("profile of latitude") && svg.contains("degrees north"));
    assert_eq!(svg.matches("<polygon").count(), 2);
    assert_eq!(svg.matches("<circle").count(), 3);
}

/// A month of which ten days hold data.
#[test]
fn the_axis_of_bands_ends_where_data_end() {
    let (start, end) = month(0);
    let row = json!({"start": start, "end": end, "means": [1.0], "coverage_percent": [30.0]});
    let made = json!({"along": "lat", "band_deg": 30.0, "bounds_deg": [-180.0, 0.0, 180.0, 30.0],
        "step": "month", "earth": "wgs84", "coverage_basis": "cells", "notes": [],
        "bands": [{"low_deg": 0.0, "high_deg": 30.0, "area_m2": 1e12}], "rows": [row]});
    let answer = serde_json::from_value(cited(made)).unwrap();
    let until = |end: &str| {
        let data = Period::new("2001".parse().unwrap(), end.parse().unwrap()).unwrap();
        of_hovmoller(&answer, data).unwrap()
    };
    let svg = until("2001-01-11");
    assert!(svg.contains("\n2001-01-11\n") && !svg.contains("\n2001-01-12\n"));
    assert!(until("2001-02").contains("\n2001-01-31\n"));
}

fn statistics_of(names: &[(&str, &str)]) -> StatisticsAnswer {
    let notes = names
        .iter()
        .map(|(name, unit)| json!({"name": name, "unit": unit, "what": "made by a test"}));
    let row = |index: u32| {
        let (start, end) = month(index);
        let values = names
            .iter()
            .map(|(name, _)| ((*name).to_owned(), json!(index)));
        json!({"start": start, "end": end, "mid": start, "values": Value::Object(values.collect()),
            "coverage_percent": 100.0, "step_count": 1, "is_withheld": false})
    };
    let rows: Vec<Value> = (0..12).map(row).collect();
    let made = json!({"kind": "area", "geometry": "global", "step": "month", "earth": "wgs84", "cells": "whole",
        "statistics": notes.collect::<Vec<Value>>(), "coverage_basis": "sea", "size": 1e14, "size_unit": "m²",
        "min_coverage_percent": 0.0, "ocean_source": null, "notes": [], "rows": rows});
    serde_json::from_value(cited(made)).unwrap()
}

#[test]
fn all_statistics_of_the_unit_are_drawn_and_others_named_and_too_many_refused() {
    let names = ["mean", "min", "p10", "median", "p75", "p90", "p95", "max"];
    let mut asked: Vec<(&str, &str)> = names.map(|name| (name, "°C")).to_vec();
    asked.extend([("std", "°C"), ("count", "")]);
    let svg = of_statistics(&statistics_of(&asked)).unwrap();
    is_told(&svg);
    for name in names {
        assert!(svg.contains(&format!("\n{name}\n")), "{name} has a line");
    }
    let lines = svg.lines().filter(|line| line.starts_with("<circle"));
    assert_eq!(lines.count(), 8 * 12);
    assert!(svg.contains("max of the region, over each month"), "{svg}");
    assert!(svg.contains("not drawn, of another unit: count") && svg.contains("band: mean"));
    // Without a mean there is no band that it could be.
    let alone = of_statistics(&statistics_of(&[("std", "°C")])).unwrap();
    assert!(alone.contains("\nstd\n") && !alone.contains("not drawn"));
    asked.push(("p99", "°C"));
    let refused = of_statistics(&statistics_of(&asked)).unwrap_err();
    let refused = refused.to_string();
    assert!(
        refused.contains("colours for 8 statistics, and 9") && refused.contains("p99"),
        "{refused}"
    );
}

#[test]
fn a_climatology_of_one_year_promises_no_spread() {
    let row = |bin: u32| json!({"bin": "m", "mean": bin, "spread": null, "count": 1, "years": 1});
    let rows: Vec<Value> = (0..12).map(row).collect();
    let made = json!({"bins": "month", "base": "2001/2001", "rows": rows});
    let svg = of_analysis(&analysis("climatology", made)).unwrap();
    is_told(&svg);
    assert!(svg.contains("no standard deviation") && !svg.contains("on either side"));
    assert!(!svg.contains("<polygon"));
}

#[test]
fn what_has_no_plot_says_so() {
    let made = json!({"highest": [], "lowest": [], "percentiles": []});
    let refused = of_analysis(&analysis("extremes", made)).unwrap_err();
    assert!(
        refused
            .to_string()
            .contains("a climatology, of anomalies and of a trend")
    );
}
