//! The real files of `FLUXGLOBE_TEST_DATA`: each test is on the list of `tests/data`.
//!
//! Expected numbers: Python netCDF4 1.7 and csv, sentinels taken out by hand, means in float64.

use contract::event::RejectReason;
use contract::observation::{Observation, PlatformKind, Quality};
use test_data::set;

use crate::made::{observations, refusal};

/// Number, mean, least and greatest value of a property.
fn summary(all: &[Observation], property: &str) -> (usize, f64, f64, f64) {
    let values: Vec<f64> = all
        .iter()
        .filter(|o| o.property == property)
        .map(|o| o.value)
        .collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    (values.len(), mean, low, high)
}

fn near(found: f64, expected: f64) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.abs().max(1.0),
        "{found} is not {expected}"
    );
}

fn of_property(all: &[Observation], property: &str, count: usize, mean: f64) {
    let found = summary(all, property);
    assert_eq!(found.0, count, "{property}");
    near(found.1, mean);
}

#[tokio::test]
async fn gtmba_buoys_of_discrete_sampling() {
    let Some(folder) = set("buoys_gtmba_sst_dsg") else {
        return;
    };
    let all = observations(&folder.join("dsg_timeseries_example.nc")).await;
    assert_eq!(all.len(), 2312, "64 of 2376 are missing");
    of_property(
        &all,
        "sea_surface_temperature",
        2312,
        301.334_974_719_083_85,
    );
    let mut names: Vec<_> = all.iter().map(|o| o.platform.as_str()).collect();
    names.dedup();
    assert_eq!(names.len(), 70);
    assert!(
        all.iter()
            .all(|o| o.kind == PlatformKind::Buoy && o.unit == "K")
    );
    assert!(
        all.iter().all(|o| o.quality == Quality::NotEvaluated),
        "their flag 2 is the default"
    );
    let time = "2017-04-06T12:00:00Z".parse().unwrap();
    let row = all
        .iter()
        .find(|o| o.platform == "2n125w" && o.time == time)
        .unwrap();
    assert_eq!((row.lon_deg, row.lat_deg, row.depth_m), (-125.0, 2.0, 1.0));
    near(row.value, f64::from(28.30004f32) + 273.15);
}

#[tokio::test]
async fn socat_cruises_of_discrete_sampling_across_the_date_line() {
    let Some(folder) = set("ship_tracks_socat_dsg") else {
        return;
    };
    let all = observations(&folder.join("dsg_trajectory_example.nc")).await;
    of_property(
        &all,
        "surface_partial_pressure_of_carbon_dioxide_in_sea_water",
        1269,
        31.187_300_849_506_027,
    );
    of_property(&all, "temperature_equi", 1326, 285.202_247_375_821_6);
    let of_ship = |name: &str| {
        all.iter()
            .filter(|o| o.platform == name && o.property == "temperature_equi")
            .count()
    };
    let ships = [
        "33HQ20150714",
        "33RO20150714",
        "PANC20150623",
        "PANC20151026",
    ];
    assert_eq!(ships.map(of_ship), [413, 586, 160, 167]);
    assert!(all.iter().all(|o| o.kind == PlatformKind::Ship));
    let lons = || all.iter().map(|o| o.lon_deg);
    near(
        lons().fold(f64::INFINITY, f64::min),
        f64::from(-179.9434f32),
    );
    near(
        lons().fold(f64::NEG_INFINITY, f64::max),
        f64::from(179.827f32),
    );
}

#[tokio::test]
async fn ecofoci_casts_of_discrete_sampling() {
    let Some(folder) = set("profiles_ecofoci_dsg") else {
        return;
    };
    let all = observations(&folder.join("dsg_profile_example.nc")).await;
    of_property(&all, "sea_water_temperature", 1268, 275.853_025_941_666_54);
    of_property(
        &all,
        "sea_water_practical_salinity",
        1268,
        31.726_516_983_862_556,
    );
    of_property(&all, "sea_water_sigma_t", 1268, 25.256_658_690_961);
    let deepest = all.iter().map(|o| o.depth_m).fold(0.0, f64::max);
    near(deepest, 63.0);
    assert_eq!(
        (all[0].platform.as_str(), all[0].kind),
        ("aq1201c031", PlatformKind::Profile)
    );
}

#[tokio::test]
async fn tao_moorings_with_epic_codes() {
    let Some(folder) = set("buoys_tao_triton_daily") else {
        return;
    };
    let all = observations(&folder.join("met0n110w_dy.cdf")).await;
    of_property(&all, "wind_speed", 10_884, 4.699_751_374_007_465);
    of_property(&all, "eastward_wind", 10_884, -3.544_523_868_962_240_3);
    of_property(&all, "wind_to_direction", 10_884, 293.727_496_064_827);
    of_property(
        &all,
        "sea_surface_temperature",
        11_817,
        24.057_554_453_048_972 + 273.15,
    );
    of_property(&all, "relative_humidity", 5951, 0.886_109_626_230_248_4);
    let first = &all[0];
    assert_eq!(
        (first.dataset.as_str(), first.platform.as_str()),
        ("gtmba", "0n110w")
    );
    assert_eq!((first.lon_deg, first.lat_deg), (-110.0, 0.0));
    assert_eq!(first.time.to_string(), "1980-03-07T12:00:00Z");
    let depths = |property: &str| {
        let mut depths: Vec<_> = all
            .iter()
            .filter(|o| o.property == property)
            .map(|o| o.depth_m)
            .collect();
        depths.sort_by(f64::total_cmp);
        depths.dedup();
        depths
    };
    assert_eq!(depths("wind_speed"), [-4.0]);
    assert_eq!(depths("air_temperature"), [-3.0]);
    let all = observations(&folder.join("cur0.7n110w_dy.cdf")).await;
    of_property(
        &all,
        "eastward_sea_water_velocity",
        3183,
        0.207_897_446_997_379_73,
    );
    of_property(&all, "sea_water_speed", 3183, 0.409_264_826_634_747_8);
    let all = observations(&folder.join("sss0n165e_dy.cdf")).await;
    of_property(
        &all,
        "sea_water_practical_salinity",
        7331,
        34.699_806_770_675_42,
    );
    assert!(all.iter().any(|o| o.quality == Quality::Good));
    let all = observations(&folder.join("t0n140w_dy.cdf")).await;
    of_property(
        &all,
        "sea_water_temperature",
        165_592,
        21.103_918_623_723_26 + 273.15,
    );
}

#[tokio::test]
async fn tao_positions_are_observations_at_themselves() {
    let Some(folder) = set("buoys_tao_triton_daily") else {
        return;
    };
    let all = observations(&folder.join("pos0n110w_dy.cdf")).await;
    of_property(&all, "latitude", 12_855, 0.054_396_168_806_500_306);
    of_property(&all, "longitude", 12_855, 250.144_241_959_739_87 - 360.0);
    assert_eq!(all[0].dataset.as_str(), "gtmba-positions");
    for o in &all {
        let own = if o.property == "latitude" {
            o.lat_deg
        } else {
            o.lon_deg
        };
        near(own, o.value);
    }
}

#[tokio::test]
async fn every_tao_file_lands() {
    let Some(folder) = set("buoys_tao_triton_daily") else {
        return;
    };
    let mut files = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|e| e == "cdf") {
            assert!(!observations(&path).await.is_empty(), "{}", path.display());
            files += 1;
        }
    }
    assert_eq!(files, 20);
}

#[tokio::test]
async fn a_cruise_as_a_table() {
    let Some(folder) = set("ship_track_74JC20131009_socat") else {
        return;
    };
    let all = observations(&folder.join("kitidis_consistent.tsv")).await;
    of_property(&all, "sea_surface_temperature", 3677, 295.158_877_345_662_4);
    of_property(&all, "sea_surface_salinity", 3677, 36.033_640_195_811_586);
    of_property(
        &all,
        "fugacity_of_carbon_dioxide_in_sea_water",
        3677,
        39.031_706_811_653_48,
    );
    of_property(&all, "air_pressure", 3677, 101_800.952_080_500_49);
    of_property(&all, "wind_speed", 3677, 6.582_534_810_987_246);
    let first = &all[0];
    assert_eq!(first.time.to_string(), "2013-10-09T19:42:07Z");
    assert_eq!(
        (first.platform.as_str(), first.kind),
        ("kitidis", PlatformKind::Ship)
    );
    assert_eq!((first.lon_deg, first.lat_deg), (-11.8248, 45.9675));
}

#[tokio::test]
async fn a_fixed_station_as_a_table() {
    let Some(folder) = set("fixed_station_ostergarnsholm") else {
        return;
    };
    let all = observations(&folder.join("ostergarnsholm_data.tab")).await;
    of_property(
        &all,
        "sea_surface_temperature",
        14_447,
        283.180_704_644_561_56,
    );
    of_property(
        &all,
        "fugacity_of_carbon_dioxide_in_sea_water",
        11_576,
        38.718_967_384_921_314,
    );
    of_property(&all, "wind_speed", 14_447, 7.614_098_112_759_431);
    assert!(
        all.iter()
            .all(|o| o.kind == PlatformKind::Station && o.platform == "Ostergarnsholm")
    );
    let flagged = |quality| {
        all.iter()
            .filter(|o| {
                o.property == "fugacity_of_carbon_dioxide_in_sea_water" && o.quality == quality
            })
            .count()
    };
    assert_eq!(
        [flagged(Quality::Good), flagged(Quality::Questionable)],
        [11_558, 18]
    );
    let depths = all
        .iter()
        .filter(|o| o.property != "wind_speed")
        .all(|o| o.depth_m == 0.0);
    assert!(depths);
}

#[tokio::test]
async fn a_year_of_an_ndbc_buoy() {
    let Some(folder) = set("buoy_ndbc_44005_2012") else {
        return;
    };
    let all = observations(&folder.join("buoy_44005_2012.dat")).await;
    assert_eq!(all.len(), 82_245);
    of_property(&all, "wind_speed", 7970, 6.315_319_949_811_788);
    of_property(
        &all,
        "sea_surface_wave_significant_height",
        8318,
        1.284_648_954_075_500_8,
    );
    of_property(
        &all,
        "air_pressure_at_mean_sea_level",
        8344,
        101_464.907_718_120_49,
    );
    of_property(
        &all,
        "sea_surface_temperature",
        8347,
        12.173_439_559_122_961 + 273.15,
    );
    of_property(
        &all,
        "dew_point_temperature",
        8343,
        7.793_155_939_110_619 + 273.15,
    );
    let absent = [
        "visibility_in_air",
        "water_surface_height_above_reference_datum",
        "sea_surface_wave_from_direction",
    ];
    assert!(
        !all.iter().any(|o| absent.contains(&o.property.as_str())),
        "nines are no values"
    );
}

#[tokio::test]
async fn what_says_neither_where_nor_when_is_refused_with_its_reason() {
    if let Some(folder) = set("tropical_pacific_mooring_co2") {
        for name in [
            "JMA_mooring_co2_flux.nc",
            "chl.nc",
            "landsch_mooring_co2_flux.nc",
            "month_data.nc",
            "npp.nc",
        ] {
            let rejection = refusal(&folder.join(name)).await;
            assert_eq!(
                rejection.reason,
                RejectReason::NoVariable,
                "{name}: {rejection}"
            );
            assert!(
                rejection.detail.contains("where the platforms are"),
                "{name}: {rejection}"
            );
        }
    }
    if let Some(folder) = set("scs_pco2_05deg_summer") {
        for name in ["OBdata.csv", "RSdata.csv"] {
            let rejection = refusal(&folder.join(name)).await;
            assert_eq!(rejection.reason, RejectReason::Time, "{name}: {rejection}");
        }
    }
    if let Some(folder) = set("buoy_ndbc_44005_2012") {
        let rejection = refusal(&folder.join("buoy_44005_2012_README.txt")).await;
        assert_eq!(rejection.reason, RejectReason::Unreadable, "{rejection}");
    }
}
