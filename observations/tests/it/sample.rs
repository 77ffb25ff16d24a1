//! Observations made up for tests, the same ones in every run.

use contract::observation::{Observation, PlatformKind, Quality};
use contract::time::TimeMs;

/// 2012-01-01T00:00:00Z.
pub(crate) const START_MS: i64 = 1_325_376_000_000;

pub(crate) fn time(ms: i64) -> TimeMs {
    TimeMs::new(ms).unwrap()
}

/// An observation of a buoy at one place.
pub(crate) fn observation(platform: &str, minute: i64, value: f64) -> Observation {
    Observation {
        dataset: "buoys".parse().unwrap(),
        platform: platform.to_owned(),
        kind: PlatformKind::Buoy,
        time: time(START_MS + minute * 60_000),
        lon_deg: -69.125,
        lat_deg: 43.25,
        depth_m: 0.5,
        property: "sea_surface_temperature".to_owned(),
        value,
        unit: "K".to_owned(),
        quality: Quality::Good,
    }
}

pub(crate) fn at(lon_deg: f64, lat_deg: f64) -> Observation {
    Observation {
        lon_deg,
        lat_deg,
        ..observation(&format!("{lon_deg}/{lat_deg}"), 0, 290.0)
    }
}

/// Observations of ten ships and buoys in two datasets over some months, by a linear congruential generator (Knuth's
/// multiplier): every number of them has all of its bits.
pub(crate) fn many(count: usize) -> Vec<Observation> {
    let mut state = 1u64;
    let mut next = move || {
        state = state
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 53) as f64
    };
    let kinds = PlatformKind::ALL;
    let mut row = |i: usize| {
        let platform = i % 10;
        Observation {
            dataset: ["buoys", "ships"][platform % 2].parse().unwrap(),
            platform: format!("platform-{platform}"),
            kind: kinds[platform % 4],
            time: time(START_MS + (i / 20) as i64 * 600_000),
            lon_deg: next() * 360.0 - 180.0,
            lat_deg: next() * 180.0 - 90.0,
            depth_m: f64::from(u32::from(i % 20 >= 10)) * 10.0,
            property: ["sea_surface_temperature", "wind_speed"][(i / 7) % 2].to_owned(),
            value: next() * 300.0,
            unit: "K".to_owned(),
            quality: Quality::from_flag(1 + (i % 4) as u8).unwrap(),
        }
    };
    (0..count).map(&mut row).collect()
}
