//! Casts: whose they are, and how deep each of their samples is.

use contract::event::RejectReason;
use contract::observation::{Observation, Quality};

use crate::made::{Draft, SST, observations, read, refusal, seen, settings};

const TEMPERATURE: &[(&str, &str)] = &[
    ("standard_name", "sea_water_temperature"),
    ("units", "degree_Celsius"),
];
const DEPTH: &[(&str, &str)] = &[("standard_name", "depth"), ("units", "m")];

/// Three casts of two ships or stations, two, one and two samples of each.
fn owned(feature: &str, role: &str) -> Draft {
    let sizes = [("owner", 2), ("cast", 3), ("obs", 5), ("letters", 2)];
    Draft::new(feature, &sizes)
        .names("owner", role, "aabb")
        .variable(
            "count",
            &["cast"],
            &[("sample_dimension", "obs")],
            vec![2.0, 1.0, 2.0],
        )
        .variable(
            "whose",
            &["cast"],
            &[("instance_dimension", "owner")],
            vec![1.0, 0.0, 1.0],
        )
        .variable("depth", &["obs"], DEPTH, vec![1.0, 2.0, 1.0, 1.0, 2.0])
        .variable("sst", &["obs"], SST, vec![11.0, 12.0, 13.0, 21.0, 22.0])
}

fn rows(all: [(&str, i64, i64, i64); 5]) -> Vec<(String, i64, i64, i64)> {
    let own = |(name, hour, lon, value): (&str, i64, i64, i64)| (name.to_owned(), hour, lon, value);
    all.into_iter().map(own).collect()
}

#[tokio::test]
async fn casts_of_ships_are_named_after_the_ship_of_each() {
    let folder = tempfile::tempdir().unwrap();
    let draft = owned("trajectoryProfile", "trajectory_id").axes("cast", "cast", 3, 3);
    let expected = rows([
        ("aa", 2, -160, 13),
        ("bb", 1, 100, 11),
        ("bb", 1, 100, 12),
        ("bb", 3, -60, 21),
        ("bb", 3, -60, 22),
    ]);
    let file = draft.write(folder.path());
    assert_eq!(seen(&observations(&file).await), expected);
}

#[tokio::test]
async fn casts_of_stations_are_at_the_place_and_have_the_name_of_the_station_of_each() {
    let folder = tempfile::tempdir().unwrap();
    let draft = owned("timeSeriesProfile", "timeseries_id").axes("owner", "cast", 2, 3);
    let expected = rows([
        ("aa", 2, 100, 13),
        ("bb", 1, -160, 11),
        ("bb", 1, -160, 12),
        ("bb", 3, -160, 21),
        ("bb", 3, -160, 22),
    ]);
    let file = draft.write(folder.path());
    assert_eq!(seen(&observations(&file).await), expected);
}

#[tokio::test]
async fn casts_of_several_ships_without_a_word_of_whose_each_is_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let sizes = [("owner", 2), ("cast", 3), ("obs", 3), ("letters", 2)];
    let file = Draft::new("trajectoryProfile", &sizes)
        .names("owner", "trajectory_id", "aabb")
        .axes("cast", "cast", 3, 3)
        .variable(
            "count",
            &["cast"],
            &[("sample_dimension", "obs")],
            vec![1.0; 3],
        )
        .variable("depth", &["obs"], DEPTH, vec![1.0; 3])
        .variable("sst", &["obs"], SST, vec![11.0, 12.0, 13.0])
        .write(folder.path());
    let refused = refusal(&file).await;
    assert_eq!(refused.reason, RejectReason::Corrupt, "{refused}");
    assert!(refused.detail.contains("instance_dimension"), "{refused}");
}

/// Two casts of two samples each, at 1 and 2 degrees north.
fn cast() -> Draft {
    Draft::new("profile", &[("cast", 2), ("z", 2), ("letters", 2)])
        .names("cast", "profile_id", "aabb")
        .axes("cast", "cast", 2, 2)
        .variable(
            "temp",
            &["cast", "z"],
            TEMPERATURE,
            vec![20.0, 10.0, 21.0, 11.0],
        )
}

#[tokio::test]
async fn samples_of_casts_with_a_pressure_are_at_the_depth_of_it() {
    for unit in ["dbar", "decibar"] {
        let folder = tempfile::tempdir().unwrap();
        let attributes = [("standard_name", "sea_water_pressure"), ("units", unit)];
        let file = cast()
            .variable(
                "pressure",
                &["cast", "z"],
                &attributes,
                vec![0.0, 500.0, 10.0, 1000.0],
            )
            .write(folder.path());
        let found = observations(&file).await;
        let of = found
            .iter()
            .filter(|o| o.property == "sea_water_temperature");
        let depths: Vec<f64> = of.map(|o| o.depth_m).collect();
        // Fofonoff and Millard (1983), of 1 and 2 degrees north.
        let expected = [0.0, 496.6522, 9.9448, 992.1107];
        assert_eq!(depths.len(), 4);
        for (found_m, expected_m) in depths.iter().zip(expected) {
            assert!((found_m - expected_m).abs() < 1e-3, "{depths:?}");
        }
    }
}

#[tokio::test]
async fn samples_of_casts_without_a_depth_are_refused_and_not_put_to_the_surface() {
    let folder = tempfile::tempdir().unwrap();
    let refused = refusal(&cast().write(folder.path())).await;
    assert_eq!(refused.object, "temp");
    assert!(refused.detail.contains("sea_water_pressure"), "{refused}");
    let folder = tempfile::tempdir().unwrap();
    let attributes = [("standard_name", "sea_water_pressure"), ("units", "m s-1")];
    let pressure = cast().variable("pressure", &["cast", "z"], &attributes, vec![1.0; 4]);
    let refused = refusal(&pressure.write(folder.path())).await;
    assert_eq!(refused.object, "pressure");
    assert!(refused.detail.contains("dbar"), "{refused}");
    // One value a cast is of no level.
    let folder = tempfile::tempdir().unwrap();
    let file = cast()
        .variable("sst", &["cast"], SST, vec![19.0, 20.0])
        .write(folder.path());
    let found = observations(&file).await;
    assert_eq!(seen(&found).len(), 2);
    assert!(found.iter().all(|o| o.depth_m == 0.0));
}

#[tokio::test]
async fn a_sample_whose_depth_is_not_said_is_counted_and_left_out() {
    let folder = tempfile::tempdir().unwrap();
    let file = cast()
        .variable(
            "depth",
            &["cast", "z"],
            DEPTH,
            vec![1.0, f64::NAN, 1.0, 2.0],
        )
        .write(folder.path());
    let (found, masked) = read(&file, &settings()).await.unwrap();
    let depths: Vec<f64> = found.iter().map(|o| o.depth_m).collect();
    assert_eq!((depths, masked.implausible), (vec![1.0, 1.0, 2.0], 1));
}

/// Depths and counted losses of what a ship, or another that goes along a way, measured twice; the second depth is missing.
async fn along_a_way(first_m: f64) -> (Vec<(String, f64)>, u64) {
    let folder = tempfile::tempdir().unwrap();
    let fugacity = [
        ("standard_name", "fugacity_of_carbon_dioxide_in_sea_water"),
        ("units", "uatm"),
    ];
    let wind = [("standard_name", "wind_speed"), ("units", "m s-1")];
    let file = Draft::new("trajectory", &[("obs", 2)])
        .axes("obs", "obs", 2, 2)
        .variable("depth", &["obs"], DEPTH, vec![first_m, f64::NAN])
        .variable("fco2", &["obs"], &fugacity, vec![380.0, 381.0])
        .variable("wind", &["obs"], &wind, vec![5.0, 6.0])
        .write(folder.path());
    let (found, masked) = read(&file, &settings()).await.unwrap();
    let own = |o: Observation| (o.property, o.depth_m);
    (found.into_iter().map(own).collect(), masked.implausible)
}

#[tokio::test]
async fn a_sample_of_the_surface_without_a_depth_is_kept_and_one_of_a_glider_is_counted() {
    let (found, lost) = along_a_way(5.0).await;
    let (fugacity, wind) = ("fugacity_of_carbon_dioxide_in_sea_water", "wind_speed");
    let expected = [(fugacity, 5.0), (fugacity, 0.0), (wind, 5.0), (wind, 0.0)];
    let expected = expected.map(|(property, depth_m)| (property.to_owned(), depth_m));
    assert_eq!((found, lost), (expected.to_vec(), 0));
    let (found, lost) = along_a_way(300.0).await;
    assert_eq!((found.len(), lost), (2, 2));
    let is_deep = |(_, depth_m): &(String, f64)| (depth_m - 300.0).abs() < 1e-9;
    assert!(found.iter().all(is_deep), "{found:?}");
}

#[tokio::test]
async fn flags_may_be_letters() {
    let folder = tempfile::tempdir().unwrap();
    let file = cast()
        .variable("depth", &["cast", "z"], DEPTH, vec![1.0, 2.0, 1.0, 2.0])
        .letters("temp_qc", &["cast", "z"], &[], "14 9")
        .write(folder.path());
    let found = observations(&file).await;
    let qualities: Vec<Quality> = found.iter().map(|o| o.quality).collect();
    let expected = [Quality::Good, Quality::Bad, Quality::NotEvaluated];
    assert_eq!(qualities, expected, "the fourth is missing");
}

#[tokio::test]
async fn of_a_float_the_adjusted_values_count_once_there_are_any() {
    let folder = tempfile::tempdir().unwrap();
    let shape = ["N_PROF", "N_LEVELS"];
    let pressure = [
        ("standard_name", "sea_water_pressure"),
        ("units", "decibar"),
        ("axis", "Z"),
    ];
    let fill = f64::NAN;
    let sizes = [("N_PROF", 2), ("N_LEVELS", 2), ("STRING8", 2)];
    let file = Draft::new("trajectoryProfile", &sizes)
        .letters("PLATFORM_NUMBER", &["N_PROF", "STRING8"], &[], "1122")
        .letters("DATA_MODE", &["N_PROF"], &[], "RD")
        .axes("N_PROF", "N_PROF", 2, 2)
        .variable("PRES", &shape, &pressure, vec![0.0, 10.0, 0.0, 10.0])
        .variable(
            "PRES_ADJUSTED",
            &shape,
            &pressure,
            vec![fill, fill, 5.0, 15.0],
        )
        .variable("TEMP", &shape, TEMPERATURE, vec![11.0, 12.0, 21.0, 22.0])
        .variable(
            "TEMP_ADJUSTED",
            &shape,
            TEMPERATURE,
            vec![fill, fill, 23.0, fill],
        )
        .write(folder.path());
    let (found, masked) = read(&file, &settings()).await.unwrap();
    let expected = [
        ("11".to_owned(), 1, 100, 11),
        ("11".to_owned(), 1, 100, 12),
        ("22".to_owned(), 2, -160, 23),
    ];
    assert_eq!(seen(&found), expected);
    assert_eq!(masked.poor_quality, 1, "what came was found to be bad");
    let adjusted = found.iter().find(|o| o.platform == "22").unwrap();
    assert!(
        (adjusted.depth_m - 4.9725).abs() < 1e-3,
        "{}",
        adjusted.depth_m
    );
}

/// A cast of a float whose pressure is as it came and whose oxygen is adjusted, and one of which it is the other way round.
fn oxygen() -> Draft {
    let shape = ["N_PROF", "N_LEVELS"];
    let pressure = [
        ("standard_name", "sea_water_pressure"),
        ("units", "decibar"),
        ("axis", "Z"),
    ];
    let doxy = [
        (
            "standard_name",
            "moles_of_oxygen_per_unit_mass_in_sea_water",
        ),
        ("units", "micromole/kg"),
    ];
    let fill = f64::NAN;
    let sizes = [
        ("N_PROF", 2),
        ("N_LEVELS", 2),
        ("N_PARAM", 2),
        ("STRING8", 8),
        ("STRING2", 2),
    ];
    Draft::new("trajectoryProfile", &sizes)
        .letters("PLATFORM_NUMBER", &["N_PROF", "STRING2"], &[], "1122")
        .letters(
            "STATION_PARAMETERS",
            &["N_PROF", "N_PARAM", "STRING8"],
            &[],
            "PRES    DOXY    DOXY    PRES    ",
        )
        .letters("PARAMETER_DATA_MODE", &["N_PROF", "N_PARAM"], &[], "RARD")
        .axes("N_PROF", "N_PROF", 2, 2)
        .variable("PRES", &shape, &pressure, vec![0.0, 10.0, 0.0, 10.0])
        .variable(
            "PRES_ADJUSTED",
            &shape,
            &pressure,
            vec![fill, fill, 5.0, 15.0],
        )
        .variable("DOXY", &shape, &doxy, vec![201.0, 202.0, 203.0, 204.0])
        .variable(
            "DOXY_ADJUSTED",
            &shape,
            &doxy,
            vec![211.0, fill, fill, fill],
        )
}

#[tokio::test]
async fn each_parameter_of_a_float_counts_by_its_own_mode() {
    // Files of one kind of float have the mode of their most adjusted parameter too, synthetic ones do not.
    for draft in [
        oxygen(),
        oxygen().letters("DATA_MODE", &["N_PROF"], &[], "AD"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let file = draft.write(folder.path());
        let (mut found, masked) = read(&file, &settings()).await.unwrap();
        found.sort_by(|a, b| a.value.total_cmp(&b.value));
        let depths: Vec<i64> = found.iter().map(|o| o.depth_m.round() as i64).collect();
        let platforms: Vec<&str> = found.iter().map(|o| o.platform.as_str()).collect();
        assert_eq!(platforms, ["22", "22", "11"]);
        assert_eq!(depths, [5, 15, 0]);
        assert_eq!((masked.poor_quality, masked.implausible), (1, 0));
    }
}
