use contract::camera::CameraAngles;

use super::*;

const SIZE_PX: [u32; 2] = [1600, 900];

fn view(lon_deg: f64, lat_deg: f64, height_m: f64, angles: CameraAngles) -> View {
    View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        width_px: SIZE_PX[0],
        height_px: SIZE_PX[1],
        angles,
    }
}

fn angles(heading_deg: f64, tilt_deg: f64, roll_deg: f64) -> CameraAngles {
    CameraAngles {
        heading_deg,
        tilt_deg,
        roll_deg,
        ..CameraAngles::NADIR
    }
}

fn at(lon: f64, lat: f64) -> LonLatDeg {
    LonLatDeg { lon, lat }
}

/// The same by bearings and distances on the sphere (haversines), without a vector: pixels, and whether the place is
/// before the horizon.
fn by_trigonometry(view: &View, place: LonLatDeg, height_m: f64) -> ([f64; 2], f64, bool) {
    let View::Globe {
        lon_deg,
        lat_deg,
        height_m: camera_m,
        angles,
        ..
    } = *view
    else {
        panic!("a globe")
    };
    let (lat0, lat1) = (lat_deg.to_radians(), place.lat.to_radians());
    let dlon = (place.lon - lon_deg).to_radians();
    let haversine =
        ((lat1 - lat0) / 2.0).sin().powi(2) + lat0.cos() * lat1.cos() * (dlon / 2.0).sin().powi(2);
    let away = 2.0 * haversine.sqrt().min(1.0).asin();
    let bearing = (dlon.sin() * lat1.cos())
        .atan2(lat0.cos() * lat1.sin() - lat0.sin() * lat1.cos() * dlon.cos());
    let (eye, radius) = (
        1.0 + camera_m / SPHERE_RADIUS_M,
        1.0 + height_m / SPHERE_RADIUS_M,
    );
    let turned = bearing - angles.heading_deg.to_radians();
    let (ahead, aside) = (
        radius * away.sin() * turned.cos(),
        radius * away.sin() * turned.sin(),
    );
    let below = eye - radius * away.cos();
    let (sin_tilt, cos_tilt) = angles.tilt_deg.to_radians().sin_cos();
    let depth = ahead * sin_tilt + below * cos_tilt;
    let upwards = ahead * cos_tilt - below * sin_tilt;
    let (sin_roll, cos_roll) = angles.roll_deg.to_radians().sin_cos();
    let x = aside * cos_roll - upwards * sin_roll;
    let y = upwards * cos_roll + aside * sin_roll;
    let focal = 450.0 / (angles.field_of_view_deg / 2.0).to_radians().tan();
    // Hidden beyond the sum of the two distances to the horizon.
    let horizon = (1.0 / eye).acos() + (1.0 / radius.max(1.0)).acos();
    (
        [800.0 + focal * x / depth, 450.0 - focal * y / depth],
        depth,
        away <= horizon,
    )
}

#[test]
fn places_are_where_trigonometry_has_them() {
    let mut seen_count = 0;
    for (lon, lat, height_m) in [
        (0.0, 0.0, 1.5e7),
        (-95.0, 12.0, 4e6),
        (179.0, -60.0, 3e5),
        (20.0, 89.0, 2e6),
    ] {
        for angles in [
            angles(0.0, 0.0, 0.0),
            angles(60.0, 35.0, 0.0),
            angles(-130.0, 70.0, 20.0),
        ] {
            let view = view(lon, lat, height_m, angles);
            let projection = Projection::of(&view).unwrap();
            for place in (-6..=6)
                .flat_map(|i| (-12..12).map(move |j| at(f64::from(j) * 15.3, f64::from(i) * 14.7)))
            {
                for above_m in [0.0, 4e5, 1.2e6] {
                    let (expected, depth, is_visible) = by_trigonometry(&view, place, above_m);
                    let Some(seen) = projection.seen(place, above_m) else {
                        assert!(depth < 0.3, "{place:?} is {depth} ahead");
                        continue;
                    };
                    seen_count += 1;
                    let off = (seen.x_px - expected[0]).hypot(seen.y_px - expected[1]);
                    let size = expected[0].hypot(expected[1]).max(1.0);
                    assert!(
                        off < 1e-9 * size,
                        "{view:?} {place:?}: {seen:?} for {expected:?}"
                    );
                    assert_eq!(seen.is_visible, is_visible, "{view:?} {place:?} {above_m}");
                }
            }
        }
    }
    assert!(seen_count > 1000, "{seen_count}");
}

#[test]
fn below_the_ground_what_lies_deeper_hides() {
    let projection = Projection::of(&view(0.0, 0.0, 1.5e7, CameraAngles::NADIR)).unwrap();
    let is_visible =
        |lon: f64, height_m: f64| projection.seen(at(lon, 0.0), height_m).unwrap().is_visible;
    assert!(is_visible(10.0, -5e5) && is_visible(60.0, -5e5));
    // The horizon is at 72.7 degrees, of a globe that is smaller by 500 km at 74.
    assert!(is_visible(73.5, -5e5) && !is_visible(73.5, 0.0) && !is_visible(75.0, -5e5));
}

#[test]
fn lines_end_at_the_horizon() {
    let projection = Projection::of(&view(10.0, 0.0, 1.5e7, CameraAngles::NADIR)).unwrap();
    let equator: Vec<_> = (0..=72)
        .map(|i| at(f64::from(i) * 5.0 - 180.0, 0.0))
        .collect();
    let lines = projection.lines(&equator);
    assert_eq!(lines.len(), 1);
    let line = &lines[0];
    // A tangent to the sphere makes this angle with the line of sight.
    let eye = 1.0 + 1.5e7 / SPHERE_RADIUS_M;
    let focal = 450.0 / 22.5f64.to_radians().tan();
    let limb_px = focal * (1.0 / eye).asin().tan();
    let [first, last] = [line[0], line[line.len() - 1]];
    assert!(
        (first[0] - (800.0 - limb_px)).abs() < 1e-4,
        "{first:?} {limb_px}"
    );
    assert!(
        (last[0] - (800.0 + limb_px)).abs() < 1e-4,
        "{last:?} {limb_px}"
    );
    assert!(line.iter().all(|[_x, y]| (y - 450.0).abs() < 1e-6));
    assert!(line.windows(2).all(|pair| pair[0][0] < pair[1][0]));
    // All of a circle on the far side, and one that comes and goes.
    let far: Vec<_> = (0..=36)
        .map(|i| at(f64::from(i) * 2.0 + 154.0, 10.0))
        .collect();
    assert!(projection.lines(&far).is_empty());
    let twice: Vec<_> = (0..=144)
        .map(|i| at(f64::from(i) * 5.0 - 350.0, 30.0))
        .collect();
    // It begins and ends in sight, and comes by in between.
    assert_eq!(projection.lines(&twice).len(), 3);
    assert!(projection.lines(&[]).is_empty() && projection.lines(&[at(10.0, 0.0)]).is_empty());
}

#[test]
fn lines_end_where_the_camera_no_longer_looks() {
    // Low and level: half of the ground is behind.
    let projection = Projection::of(&view(0.0, 0.0, 1e5, angles(0.0, 85.0, 0.0))).unwrap();
    let meridian: Vec<_> = (-90..=90).map(|i| at(1.0, f64::from(i))).collect();
    let lines = projection.lines(&meridian);
    assert_eq!(lines.len(), 1);
    assert!(
        lines[0].iter().flatten().all(|px| px.abs() < 1e6),
        "{lines:?}"
    );
    let tops: Vec<f64> = lines[0].iter().map(|[_x, y]| *y).collect();
    assert!(tops.is_sorted_by(|a, b| a > b), "{tops:?}");
}

#[test]
fn what_is_seen_at_a_pixel_is_seen_there() {
    for angles in [angles(0.0, 0.0, 0.0), angles(60.0, 15.0, -10.0)] {
        let projection = Projection::of(&view(-95.0, 30.0, 3e6, angles)).unwrap();
        for px in [[800.0, 450.0], [300.5, 700.5], [1100.0, 200.0]] {
            let place = projection.ground_at(px).unwrap();
            let seen = projection.seen(place, 0.0).unwrap();
            assert!(
                (seen.x_px - px[0]).hypot(seen.y_px - px[1]) < 1e-6,
                "{seen:?}"
            );
            assert!(seen.is_visible && projection.facing(place) > 0.0);
        }
    }
    let sky = Projection::of(&view(0.0, 0.0, 1.5e7, CameraAngles::NADIR)).unwrap();
    assert_eq!(sky.ground_at([5.0, 5.0]), None);
    assert!(sky.facing(at(72.0, 0.0)) > 0.0 && sky.facing(at(73.0, 0.0)) < 0.0);
}

#[test]
fn a_metre_on_the_ground_is_as_long_as_the_camera_makes_it() {
    let focal = 450.0 / 22.5f64.to_radians().tan();
    let down = Projection::of(&view(20.0, 40.0, 2e6, CameraAngles::NADIR)).unwrap();
    let [across, away] = down.px_per_m(at(20.0, 40.0)).unwrap();
    assert!((across / (focal / 2e6) - 1.0).abs() < 1e-6 && (away / across - 1.0).abs() < 1e-6);
    // Aslant by the angle of sight, squares are flat.
    let aslant = Projection::of(&view(0.0, 0.0, 2e6, angles(90.0, 40.0, 0.0))).unwrap();
    let place = aslant.ground_at([800.0, 450.0]).unwrap();
    let [across, away] = aslant.px_per_m(place).unwrap();
    assert!(
        (away / across - aslant.facing(place)).abs() < 1e-5,
        "{away} {across}"
    );
    assert_eq!(aslant.px_per_m(at(180.0, 0.0)), None);
}
