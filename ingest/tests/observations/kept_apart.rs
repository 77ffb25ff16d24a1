//! What must not be taken for one another: errors for flags, spreads for values, one variable, place or platform for another.

use contract::event::RejectReason;
use contract::observation::{Observation, Quality};

use crate::made::{Draft, SST, observations, passed_over, read, refusal, seen, settings};

/// One buoy with three hours of temperatures.
fn buoy(attributes: &[(&str, &str)]) -> Draft {
    let attributes: Vec<_> = SST.iter().chain(attributes).copied().collect();
    Draft::new("timeSeries", &[("time", 3), ("place", 1)])
        .axes("place", "time", 1, 3)
        .variable("sst", &["time"], &attributes, vec![11.0, 12.0, 13.0])
}

async fn of(draft: Draft) -> Vec<Observation> {
    let folder = tempfile::tempdir().unwrap();
    observations(&draft.write(folder.path())).await
}

#[tokio::test]
async fn a_buoy_whose_longitude_is_in_degrees_west_is_in_the_west() {
    let axis = |draft: Draft, name: &'static str, units: &str, numbers: &[f64]| {
        let dimension = if name == "time" { "time" } else { "place" };
        draft.variable(name, &[dimension], &[("units", units)], numbers.to_vec())
    };
    let draft = Draft::new("timeSeries", &[("time", 3), ("place", 1)]);
    let draft = axis(draft, "lon", "degree_west", &[164.05]);
    let draft = axis(draft, "lat", "degrees_north", &[56.87]);
    let draft = axis(draft, "time", "hours since 2000-01-01", &[1.0, 2.0, 3.0]);
    let found = of(draft.variable("sst", &["time"], SST, vec![11.0, 12.0, 13.0])).await;
    let places: Vec<(f64, f64)> = found.iter().map(|o| (o.lon_deg, o.lat_deg)).collect();
    assert_eq!(places, [(-164.05, 56.87); 3]);
}

#[tokio::test]
async fn errors_and_counts_beside_a_variable_are_no_flags_of_it() {
    let beside = [("ancillary_variables", "sst_error sst_count")];
    let draft = buoy(&beside)
        .variable("sst_error", &["time"], &[], vec![4.0, 9.0, 3.0])
        .variable("sst_count", &["time"], &[], vec![9.0, 4.0, 1.0]);
    let found = of(draft).await;
    assert_eq!(found.len(), 3);
    assert!(found.iter().all(|o| o.quality == Quality::NotEvaluated));
    let flagged = buoy(&[("ancillary_variables", "sst_flag")]).variable(
        "sst_flag",
        &["time"],
        &[],
        vec![4.0, 9.0, 1.0],
    );
    let qualities: Vec<Quality> = of(flagged).await.iter().map(|o| o.quality).collect();
    assert_eq!(qualities, [Quality::Bad, Quality::Good]);
}

#[tokio::test]
async fn flags_of_many_names_are_read_and_what_is_bad_is_bad() {
    for name in [
        "sst_quality_control",
        "sst_quality",
        "sst_flags",
        "SST_SEADATANET",
    ] {
        let draft = buoy(&[("ancillary_variables", name)]).letters(name, &["time"], &[], "134");
        let qualities: Vec<Quality> = of(draft).await.iter().map(|o| o.quality).collect();
        let expected = [Quality::Good, Quality::Questionable, Quality::Bad];
        assert_eq!(qualities, expected, "{name}");
    }
    let draft = buoy(&[("ancillary_variables", "SST_WOCE")]);
    let draft = draft.letters("SST_WOCE", &["time"], &[], "249");
    let qualities: Vec<Quality> = of(draft).await.iter().map(|o| o.quality).collect();
    assert_eq!(qualities, [Quality::Good, Quality::Bad], "9 is missing");
}

#[tokio::test]
async fn spreads_and_extremes_are_not_taken_for_values() {
    for methods in [
        "time: standard_deviation",
        "time: maximum (interval: 1 minute)",
    ] {
        let attributes: Vec<_> = SST
            .iter()
            .copied()
            .chain([("cell_methods", methods)])
            .collect();
        let draft = buoy(&[("cell_methods", "time: mean")]).variable(
            "other",
            &["time"],
            &attributes,
            vec![1.0, 1.0, 1.0],
        );
        let values: Vec<i64> = seen(&of(draft).await).iter().map(|row| row.3).collect();
        assert_eq!(values, [11, 12, 13], "{methods}");
    }
    // A gust is the highest value by its name.
    let gust = [
        ("standard_name", "wind_speed_of_gust"),
        ("units", "m s-1"),
        ("cell_methods", "time: maximum"),
    ];
    let found = of(buoy(&[]).variable("gust", &["time"], &gust, vec![5.0; 3])).await;
    let gusts = found.iter().filter(|o| o.property == "wind_speed_of_gust");
    assert_eq!(gusts.count(), 3);
}

#[tokio::test]
async fn two_variables_of_one_name_that_differ_are_refused_with_both() {
    let folder = tempfile::tempdir().unwrap();
    let draft = buoy(&[]).variable("sst_2", &["time"], SST, vec![11.0, 12.5, 13.0]);
    let refused = refusal(&draft.write(folder.path())).await;
    assert_eq!(refused.object, "sst and sst_2", "{refused}");
    // Those that say the same do not contradict each other.
    let same = buoy(&[]).variable("sst_2", &["time"], SST, vec![11.0, f64::NAN, 13.0]);
    assert_eq!(of(same).await.len(), 5);
}

#[tokio::test]
async fn one_value_in_two_units_is_one_and_a_second_sensor_loses_its_property_alone() {
    let kelvin = [
        ("standard_name", "sea_surface_temperature"),
        ("units", "K"),
        ("coordinates", "time lat lon"),
    ];
    let rounded = |celsius: f64| f64::from((celsius + 273.15) as f32);
    let values = [11.0, 12.0, 13.0].map(rounded).to_vec();
    let found = of(buoy(&[]).variable("sst_k", &["time"], &kelvin, values)).await;
    let values: Vec<i64> = seen(&found).iter().map(|row| row.3).collect();
    assert_eq!(values, [11, 11, 12, 12, 13, 13]);
    let air = [
        ("standard_name", "air_temperature"),
        ("units", "K"),
        ("coordinates", "time lat lon"),
    ];
    let folder = tempfile::tempdir().unwrap();
    let draft = buoy(&[])
        .variable("sst_2", &["time"], SST, vec![11.0, 12.5, 13.0])
        .variable("air", &["time"], &air, vec![280.0; 3]);
    let (found, masked) = read(&draft.write(folder.path()), &settings())
        .await
        .unwrap();
    assert!(found.iter().all(|o| o.property == "air_temperature"));
    assert_eq!((found.len(), masked.implausible), (3, 6));
}

/// Two samples of one instant at two places, and one of a later one.
fn points() -> Draft {
    Draft::new("point", &[("obs", 3), ("letters", 2)])
        .variable(
            "lon",
            &["obs"],
            &[("units", "degrees_east")],
            vec![10.0, 20.0, 20.0],
        )
        .variable("lat", &["obs"], &[("units", "degrees_north")], vec![1.0; 3])
        .variable(
            "time",
            &["obs"],
            &[("units", "hours since 2000-01-01")],
            vec![1.0, 1.0, 2.0],
        )
        .variable("sst", &["obs"], SST, vec![11.0, 12.0, 13.0])
}

#[tokio::test]
async fn single_samples_of_one_instant_are_told_apart_by_their_places() {
    let row = |name: &str, hour, lon, value| (name.to_owned(), hour, lon, value);
    let expected = [
        row("made", 1, 10, 11),
        row("made", 2, 20, 13),
        row("made-2", 1, 20, 12),
    ];
    assert_eq!(seen(&of(points()).await), expected);
    let named = points().letters(
        "ship",
        &["obs", "letters"],
        &[("standard_name", "platform_id")],
        "aabbaa",
    );
    let expected = [
        row("aa", 1, 10, 11),
        row("aa", 2, 20, 13),
        row("bb", 1, 20, 12),
    ];
    assert_eq!(seen(&of(named).await), expected);
}

#[tokio::test]
async fn parts_of_months_and_years_are_no_instants() {
    let folder = tempfile::tempdir().unwrap();
    let at = |units: &str, times: Vec<f64>| {
        Draft::new("timeSeries", &[("time", 3), ("place", 1)])
            .variable("lon", &["place"], &[("units", "degrees_east")], vec![100.0])
            .variable("lat", &["place"], &[("units", "degrees_north")], vec![1.0])
            .variable("time", &["time"], &[("units", units)], times)
            .variable("sst", &["time"], SST, vec![11.0, 12.0, 13.0])
            .write(folder.path())
    };
    let found = observations(&at("years since 2000-01-01", vec![0.0, 0.5, 2.0])).await;
    let times: Vec<String> = found.iter().map(|o| o.time.to_string()).collect();
    assert_eq!(
        times,
        [
            "2000-01-01T00:00:00Z",
            "2000-07-01T00:00:00Z",
            "2002-01-01T00:00:00Z"
        ]
    );
    for (units, times) in [
        ("years since 2000-01-01", vec![0.0, 0.53, 2.0]),
        ("months since 2000-01-01", vec![0.0, 1.0, 1.5]),
    ] {
        let refused = refusal(&at(units, times)).await;
        assert_eq!(refused.reason, RejectReason::Time);
        assert!(refused.detail.contains("not equally long"), "{refused}");
    }
}

#[tokio::test]
async fn a_variable_that_was_measured_and_is_not_read_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let draft = buoy(&[]).variable(
        "wind",
        &["time"],
        &[("standard_name", "wind_speed"), ("units", "furlong")],
        vec![1.0, 2.0, 3.0],
    );
    // What has no name, or no place and time, is of something else.
    let draft = draft
        .variable("number", &["time"], &[], vec![1.0, 2.0, 3.0])
        .variable("deployed", &["place"], &[("units", "m")], vec![7.0]);
    let told = passed_over(&draft.write(folder.path())).await;
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(
        told[0].starts_with("wind: has unit \"furlong\""),
        "{told:?}"
    );
}
