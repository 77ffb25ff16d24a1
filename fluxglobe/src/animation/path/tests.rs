use contract::camera::CameraAngles;
use contract::earth::SPHERE_RADIUS_M;
use contract::grid::LonLatDeg;
use glam::DVec3;

use super::*;

fn path(json: &str) -> Result<CameraPath> {
    CameraPath::new(serde_json::from_str(json)?)
}

fn said(json: &str) -> String {
    format!("{:#}", path(json).unwrap_err())
}

/// Around the North Pacific and over the pole, at uneven instants, with a turn of the camera.
const TOUR: &str = r#"[
    {"seconds": 0, "look_at": [140, 35], "distance_km": 3000, "heading": 20, "tilt": 50},
    {"seconds": 3, "look_at": [175, 48], "distance_km": 1500, "heading": 60, "tilt": 65},
    {"seconds": 5, "look_at": [-160, 60], "distance_km": 1500, "heading": 40, "tilt": 60, "roll": 10},
    {"seconds": 9, "look_at": [20, 75], "distance_km": 6000, "heading": 190, "tilt": 30, "fov": 60},
    {"seconds": 12, "look_at": [-30, 50], "distance_km": 2500, "heading": 200, "tilt": 55}
]"#;

/// Cameras that stand: down from far, low along the equator over the date line, and up again.
const STANDING: &str = r#"[
    {"seconds": 0, "camera": [160, -10], "height_km": 12000},
    {"seconds": 4, "camera": [176, 0], "height_km": 800, "heading": 80, "tilt": 70},
    {"seconds": 7, "camera": [-170, 2], "height_km": 600, "heading": 85, "tilt": 75},
    {"seconds": 12, "camera": [-140, -3], "height_km": 900, "heading": 95, "tilt": 65},
    {"seconds": 15, "camera": [-120, 20], "height_km": 9000, "heading": 95, "tilt": 5}
]"#;

/// Where a camera is, in earth radii, and which way it looks and has its top.
fn state(path: &CameraPath, seconds: f64) -> [DVec3; 3] {
    let View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        angles,
        ..
    } = path.view(seconds, [16, 9]).unwrap()
    else {
        panic!("a globe")
    };
    let ((sin_lon, cos_lon), (sin_lat, cos_lat)) = (
        lon_deg.to_radians().sin_cos(),
        lat_deg.to_radians().sin_cos(),
    );
    let up = DVec3::new(cos_lat * cos_lon, cos_lat * sin_lon, sin_lat);
    let north = DVec3::new(-sin_lat * cos_lon, -sin_lat * sin_lon, cos_lat);
    let east = north.cross(up);
    let (sin_heading, cos_heading) = angles.heading_deg.to_radians().sin_cos();
    let (sin_tilt, cos_tilt) = angles.tilt_deg.to_radians().sin_cos();
    let ahead = east * sin_heading + north * cos_heading;
    let sight = ahead * sin_tilt - up * cos_tilt;
    let top = ahead * cos_tilt + up * sin_tilt;
    let (sin_roll, cos_roll) = angles.roll_deg.to_radians().sin_cos();
    let top = top * cos_roll + sight.cross(top) * sin_roll;
    [up * (1.0 + height_m / SPHERE_RADIUS_M), sight, top]
}

fn velocity(path: &CameraPath, seconds: f64, step: f64) -> [DVec3; 3] {
    let [now, then] = [seconds, seconds + step].map(|at| state(path, at));
    std::array::from_fn(|i| (then[i] - now[i]) / step)
}

#[test]
fn a_flight_has_no_jump_of_place_sight_or_speed_and_meets_its_key_frames() {
    for json in [TOUR, STANDING] {
        let path = path(json).unwrap();
        let end = path.seconds();
        let instants = (1..600).map(|i| end * f64::from(i) / 600.0);
        let inner = path.frames[1..path.frames.len() - 1].iter();
        for at in instants.chain(inner.map(|frame| frame.seconds)) {
            let [before, after] = [-1e-4, 1e-4].map(|step| velocity(&path, at, step));
            for (before, after) in before.into_iter().zip(after) {
                // Radii, or radians, a second: the largest bend is far below 20 a second each second.
                assert!((before - after).length() < 4e-3, "{at}: {before} {after}");
                assert!(before.length() < 3.0, "{at}: {before}");
            }
        }
        for frame in &path.frames {
            let [asked, near] = [
                frame.pose.view([16, 9]).unwrap(),
                path.view(frame.seconds + 1e-7, [16, 9]).unwrap(),
            ];
            let pair = [asked, near].map(|view| match view {
                View::Globe {
                    lon_deg,
                    lat_deg,
                    height_m,
                    angles,
                    ..
                } => [
                    lon_deg,
                    lat_deg,
                    height_m / 1e5,
                    angles.heading_deg,
                    angles.tilt_deg,
                ],
                View::Tile { .. } => panic!("a globe"),
            });
            for (asked, near) in pair[0].into_iter().zip(pair[1]) {
                assert!((asked - near).abs() < 1e-3, "{}: {pair:?}", frame.seconds);
            }
        }
    }
}

#[test]
fn a_flight_rests_at_both_ends_and_nowhere_between() {
    for json in [TOUR, STANDING] {
        let path = path(json).unwrap();
        let end = path.seconds();
        for (at, step) in [(0.0, 1e-5), (end, -1e-5)] {
            let speed = velocity(&path, at, step)[0].length();
            assert!(speed < 1e-4, "{at}: {speed}");
        }
        let speeds =
            (1..100).map(|i| velocity(&path, end * f64::from(i) / 100.0, 1e-4)[0].length());
        let least = speeds.skip(4).take(90).fold(f64::INFINITY, f64::min);
        assert!(least > 0.01, "{least}");
    }
    // As each of them does alone.
    let halting = path(&TOUR.replace(r#""tilt""#, r#""easing": "in-out", "tilt""#)).unwrap();
    let speed = velocity(&halting, 3.0, 1e-4)[0].length();
    assert!(speed < 1e-4, "{speed}");
}

#[test]
fn nothing_of_a_flight_goes_beyond_its_key_frames() {
    for json in [TOUR, STANDING] {
        let path = path(json).unwrap();
        for pair in path.frames.windows(2) {
            let [from, to] = [pair[0].pose, pair[1].pose];
            for step in 0..=200 {
                let share = f64::from(step) / 200.0;
                let at = pair[0].seconds + share * (pair[1].seconds - pair[0].seconds);
                let pose = path.pose(at);
                for number in [
                    |pose: &Pose| pose.away_km,
                    |pose: &Pose| pose.tilt,
                    |pose: &Pose| pose.roll,
                    |pose: &Pose| pose.fov,
                ] {
                    let (from, to, now) = (number(&from), number(&to), number(&pose));
                    let slack = 1e-9 * from.abs().max(to.abs());
                    let is_within = now >= from.min(to) - slack && now <= from.max(to) + slack;
                    assert!(is_within, "{at}: {now} of {from} to {to}");
                }
            }
        }
    }
}

#[test]
fn a_flight_over_a_pole_goes_straight_on_and_past_it_turns_with_the_meridians() {
    let over = |lon: f64, heading: f64| {
        path(&format!(
            r#"[{{"seconds": 0, "look_at": [{lon}, 70], "distance_km": 1000, "tilt": 60}},
                {{"seconds": 4, "look_at": [180, 75], "distance_km": 1000, "tilt": 60, "heading": {heading}}}]"#
        ))
        .unwrap()
    };
    // Straight over it, and a little beside it on either hand.
    for lon in [0.0, 1.0, -1.0] {
        let path = over(lon, 180.0);
        let mut before = state(&path, 0.0);
        for step in 1..=4000 {
            let now = state(&path, f64::from(step) * 0.001);
            for (before, now) in before.into_iter().zip(now) {
                assert!(
                    (now - before).length() < 1e-3,
                    "{lon} {step}: {before} {now}"
                );
            }
            before = now;
        }
    }
    // Over the pole the way is a great circle: the camera never looks aside from it.
    let path = over(0.0, 180.0);
    for step in 0..=400 {
        let [_place, sight, _top] = state(&path, f64::from(step) * 0.01);
        assert!(sight.y.abs() < 1e-6, "{step}: {sight}");
    }
    // A pole has whichever north its longitude names.
    let path = self::path(
        r#"[{"seconds": 0, "camera": [40, 90], "height_km": 2000, "tilt": 20},
            {"seconds": 2, "camera": [130, 80], "height_km": 2000, "tilt": 20},
            {"seconds": 4, "camera": [130, 60], "height_km": 2000, "tilt": 20}]"#,
    )
    .unwrap();
    let moved = velocity(&path, 0.0, 1e-3);
    assert!(moved.iter().all(|moved| moved.length() < 0.01), "{moved:?}");
}

#[test]
fn a_flight_over_the_date_line_is_one_elsewhere() {
    let flight = |east: f64| {
        let at = |lon: f64| {
            LonLatDeg::new((lon + east + 540.0).rem_euclid(360.0) - 180.0, 0.0)
                .unwrap()
                .lon
        };
        path(&format!(
            r#"[{{"seconds": 0, "look_at": [{}, 10], "distance_km": 1000, "heading": 90, "tilt": 60}},
                {{"seconds": 3, "look_at": [{}, 12], "distance_km": 1000, "heading": 95, "tilt": 60}},
                {{"seconds": 5, "look_at": [{}, -5], "distance_km": 1000, "heading": 85, "tilt": 60}}]"#,
            at(0.0),
            at(25.0),
            at(60.0)
        ))
        .unwrap()
    };
    let (here, there) = (flight(0.0), flight(160.0));
    for step in 0..=50 {
        let (here, there) = (
            here.pose(f64::from(step) * 0.1),
            there.pose(f64::from(step) * 0.1),
        );
        let east = (there.place[0] - here.place[0] - 160.0 + 540.0).rem_euclid(360.0) - 180.0;
        assert!(east.abs() < 1e-9, "{step}: {here:?} {there:?}");
        assert!((here.place[1] - there.place[1]).abs() < 1e-9);
        assert!((here.heading - there.heading).abs() < 1e-7);
    }
}

#[test]
fn a_camera_that_keeps_its_place_turns_there_and_one_that_goes_far_goes_round() {
    let path = path(
        r#"[{"seconds": 0, "look_at": [10, 40], "distance_km": 900, "heading": 350},
            {"seconds": 2, "look_at": [10, 40], "distance_km": 900, "heading": 370, "tilt": 40},
            {"seconds": 4, "look_at": [10, 40], "distance_km": 900, "heading": 400, "tilt": 50},
            {"seconds": 9, "look_at": [-170, -40], "distance_km": 900, "heading": 400, "tilt": 50},
            {"seconds": 12, "look_at": [-60, 0], "distance_km": 900, "heading": 400, "tilt": 50}]"#,
    )
    .unwrap();
    for step in 0..=40 {
        let pose = path.pose(f64::from(step) * 0.1);
        let off = (pose.place[0] - 10.0).hypot(pose.place[1] - 40.0);
        assert!(off < 1e-9, "{step}: {pose:?}");
        let turned = pose.heading;
        assert!(
            (350.0 - 1e-6..=400.0 + 1e-6).contains(&turned),
            "{step}: {turned}"
        );
    }
    // To the opposite place and on: no step is a leap.
    let mut before = state(&path, 4.0);
    for step in 1..=8000 {
        let now = state(&path, 4.0 + f64::from(step) * 0.001);
        assert!((now[0] - before[0]).length() < 2e-3, "{step}");
        assert!((now[1] - before[1]).length() < 1e-2, "{step}");
        before = now;
    }
}

#[test]
fn cameras_that_look_and_cameras_that_stand_make_one_way() {
    let path = path(
        r#"[{"seconds": 0, "look_at": [-100, 0], "distance_km": 4000, "heading": 60, "tilt": 60},
            {"seconds": 4, "camera": [-120, -15], "height_km": 1500, "heading": 40, "tilt": 50},
            {"seconds": 8, "look_at": [-95, 10], "distance_km": 2500, "heading": 30, "tilt": 40, "easing": "linear"},
            {"seconds": 10, "look_at": [-95, 12], "distance_km": 2500, "heading": 30, "tilt": 40}]"#,
    )
    .unwrap();
    assert_eq!(path.legs.len(), 3);
    for frame in &path.frames {
        let (asked, met) = (
            frame.pose.view([16, 9]).unwrap(),
            path.view(frame.seconds, [16, 9]).unwrap(),
        );
        assert_eq!(asked, met);
    }
    let mut before = state(&path, 0.0);
    for step in 1..=1000 {
        let now = state(&path, f64::from(step) * 0.01);
        for (before, now) in before.into_iter().zip(now) {
            assert!((now - before).length() < 0.01, "{step}");
        }
        before = now;
    }
    // What is kept beside a folder of pictures is the same way.
    let kept = serde_json::to_string(&path).unwrap();
    assert_eq!(serde_json::from_str::<CameraPath>(&kept).unwrap(), path);
    assert!(
        kept.contains(r#""camera":[-120.0,-15.0],"height_km":1500.0"#),
        "{kept}"
    );
}

#[test]
fn a_standing_camera_dives_through_the_surface_and_rises_where_little_is_in_sight() {
    let path = path(
        r#"[{"seconds": 0, "camera": [-35, 40], "height_km": 300, "tilt": 80},
            {"seconds": 3, "camera": [-35, 30], "height_km": -450, "tilt": 84},
            {"seconds": 6, "camera": [-35, 27], "height_km": 800, "tilt": 150},
            {"seconds": 9, "camera": [-35, 20], "height_km": 50000, "tilt": 0}]"#,
    )
    .unwrap();
    let mut crossings = 0;
    let mut before = f64::INFINITY;
    for step in 0..=900 {
        let view = path.view(f64::from(step) * 0.01, [16, 9]).unwrap();
        view.validate().unwrap();
        let View::Globe { height_m, .. } = view else {
            panic!("a globe")
        };
        crossings += u32::from(before > 0.0 && height_m < 0.0);
        before = height_m;
    }
    assert_eq!(crossings, 1);
}

#[test]
fn between_two_key_frames_the_camera_takes_the_short_way_and_rests_at_both() {
    let flight = r#"[
        {"seconds": 0, "look_at": [170, 0], "distance_km": 1000, "heading": 90, "easing": "in-out"},
        {"seconds": 4, "look_at": [-170, 0], "distance_km": 4000, "heading": 450, "tilt": 60}
    ]"#;
    for easing in ["in-out", "through"] {
        let path = path(&flight.replace("in-out", easing)).unwrap();
        let half = path.pose(2.0);
        assert!((half.place[0].abs() - 180.0).abs() < 1e-9, "{half:?}");
        // Twice as far and twice as far again; a whole turn is half done.
        assert!((half.away_km - 2e3).abs() < 1e-6, "{half:?}");
        assert!((half.heading - 270.0).abs() < 1e-9 && (half.tilt - 30.0).abs() < 1e-9);
        // At rest at both ends.
        for (a, b) in [(0.0, 0.01), (4.0, 3.99)] {
            let moved = (path.pose(a).away_km / path.pose(b).away_km).ln();
            assert!(moved.abs() < 4e-5, "{moved}");
        }
        // What is asked for beyond the ends is the ends'.
        let size = [8, 6];
        assert_eq!(path.view(9.0, size).unwrap(), path.view(4.0, size).unwrap());
        assert_ne!(path.view(1.0, size).unwrap(), path.view(2.0, size).unwrap());
    }
    let even = path(&flight.replace("in-out", "linear")).unwrap();
    let quarter = even.pose(1.0);
    assert!((quarter.place[0] - 175.0).abs() < 1e-9 && (quarter.tilt - 15.0).abs() < 1e-9);
}

#[test]
fn an_orbit_goes_evenly_round_and_closes() {
    let look_at = LookAt {
        target: LonLatDeg {
            lon: 10.0,
            lat: 50.0,
        },
        distance_m: 2e6,
        angles: CameraAngles {
            heading_deg: 30.0,
            tilt_deg: 60.0,
            ..CameraAngles::NADIR
        },
    };
    let path = CameraPath::orbit(&look_at, 360.0, 8.0).unwrap();
    let size = [8, 6];
    let close = |a: View, b: View| match (a, b) {
        (
            View::Globe {
                lon_deg: a,
                lat_deg: c,
                ..
            },
            View::Globe {
                lon_deg: b,
                lat_deg: d,
                ..
            },
        ) => (a - b).abs() < 1e-9 && (c - d).abs() < 1e-9,
        _ => false,
    };
    let first = path.view(0.0, size).unwrap();
    assert_eq!(first, look_at.view(size).unwrap());
    assert!(close(path.view(8.0, size).unwrap(), first));
    let quarter = LookAt {
        angles: CameraAngles {
            heading_deg: 120.0,
            ..look_at.angles
        },
        ..look_at
    };
    assert!(close(
        path.view(2.0, size).unwrap(),
        quarter.view(size).unwrap()
    ));
}

#[test]
fn a_way_from_above_to_below_the_sea_leads_through_its_surface() {
    for easing in ["through", "in-out"] {
        let path = path(&format!(
            r#"[{{"seconds": 0, "look_at": [-35, 48], "distance_km": 900, "tilt": 60, "easing": "{easing}"}},
                {{"seconds": 4, "look_at": [-35, 50], "distance_km": 600, "tilt": 130}}]"#
        ))
        .unwrap();
        let heights_m = (0..=400).map(|i| {
            let view = path.view(f64::from(i) * 0.01, [16, 9]).unwrap();
            view.validate().unwrap();
            match view {
                View::Globe { height_m, .. } => height_m,
                View::Tile { .. } => panic!("a globe"),
            }
        });
        let heights_m: Vec<f64> = heights_m.collect();
        assert!(heights_m[0] > 4e5 && heights_m[400] < -3e5);
        let crossings = heights_m.windows(2).filter(|w| w[0] > 0.0 && w[1] < 0.0);
        assert_eq!(crossings.count(), 1);
        assert!(heights_m.windows(2).all(|w| w[1] <= w[0] + 1e-3));
    }
}

#[test]
fn key_frames_that_make_no_way_are_refused_by_number() {
    assert!(said("[]").contains("0 key frames"));
    let frame = |seconds: f64, more: &str| {
        format!(r#"{{"seconds": {seconds}, "look_at": [0, 0], "distance_km": 1000{more}}}"#)
    };
    let two = |a: &str, b: &str| said(&format!("[{a}, {b}]"));
    let first = frame(0.0, "");
    assert!(two(&frame(1.0, ""), &frame(2.0, "")).contains("key frame 1 of 2"));
    let order = two(&first, &frame(-3.0, ""));
    assert!(
        order.contains("key frame 2 of 2") && order.contains("-3 s"),
        "{order}"
    );
    for (broken, part) in [
        (r#", "tilt": 93"#, "0 to 90 from above"),
        (r#", "fov": 0"#, "1 to 120"),
        (r#", "heading": 1e9"#, "36000"),
        (r#", "speed": 3"#, "speed"),
        (r#", "easing": "glide""#, "glide"),
        (r#", "height_km": 5"#, "one of these pairs"),
        (r#", "camera": [0, 0], "height_km": 5"#, "at 2 s"),
    ] {
        let text = two(&first, &frame(2.0, broken));
        assert!(text.contains(part), "{broken}: {text}");
    }
    let inside = said(&format!(
        r#"[{first}, {{"seconds": 2, "look_at": [0, 0], "distance_km": -5}}]"#
    ));
    assert!(inside.contains("1 km to 1 million km"), "{inside}");
    for (standing, part) in [
        (r#""camera": [0, 91], "height_km": 1000"#, "91"),
        (
            r#""camera": [0, 0], "height_km": 0.5"#,
            "1 km to 1 million km above",
        ),
        (
            r#""camera": [0, 0], "height_km": 20000, "tilt": 120"#,
            "20000 km",
        ),
        (r#""camera": [0, 0]"#, "one of these pairs"),
        (r#""distance_km": 1000"#, "one of these pairs"),
    ] {
        let text = two(&first, &format!(r#"{{"seconds": 2, {standing}}}"#));
        assert!(text.contains(part), "{standing}: {text}");
    }
}
