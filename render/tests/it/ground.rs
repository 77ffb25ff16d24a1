//! Land in globe views: every pixel against the outlines on the map, from cameras near and far that look any way.

use contract::camera::CameraAngles;
use contract::job::{Mode, View};
use contract::land::LAND;
use render::plan::Plan;
use render::stages::sphere::{ground_below, line_share};

use crate::scenes::{FIVE_DEGREES, job, ocean};

/// Is a place within any outline on the map: rays to the east, as Natural Earth's own makers would ask.
fn is_land(lon: f64, lat: f64) -> bool {
    LAND.iter().any(|ring| {
        let ends = ring.iter().zip(ring.iter().cycle().skip(1));
        let crossed = ends.filter(|(a, b)| {
            let is_across = (a[1] <= lat) != (b[1] <= lat);
            is_across && lon < a[0] + (lat - a[1]) / (b[1] - a[1]) * (b[0] - a[0])
        });
        crossed.count() % 2 == 1
    })
}

const SIZE_PX: [u32; 2] = [192, 128];

fn view(lon_deg: f64, lat_deg: f64, height_m: f64, [heading, tilt, roll]: [f64; 3]) -> View {
    View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        width_px: SIZE_PX[0],
        height_px: SIZE_PX[1],
        angles: CameraAngles {
            heading_deg: heading,
            tilt_deg: tilt,
            roll_deg: roll,
            field_of_view_deg: 60.0,
        },
    }
}

fn plan(view: View) -> Plan {
    let mut job = job(Mode::Map, view);
    job.style.globe_surface = true;
    job.style.context.coastlines = true;
    Plan::for_device(&job, &ocean(FIVE_DEGREES), u64::MAX).unwrap()
}

/// Pixels that are all land or all sea, and how many of them the map says otherwise of.
fn compared(view: View, drawn: &Plan) -> [usize; 2] {
    let params = plan(view).params_of(drawn.whole());
    let mut counts = [0, 0];
    for y in (0..SIZE_PX[1]).step_by(3) {
        for x in (0..SIZE_PX[0]).step_by(3) {
            let share = drawn.coast[(y * SIZE_PX[0] + x) as usize] & 255;
            let ground = ground_below(&params, [x, y]);
            // Closer to the limb a pixel reaches far.
            if !ground.on_ground || ground.rim_px < 2.0 || (share > 0 && share < 255) {
                continue;
            }
            let place = [ground.lon_rad, ground.lat_rad].map(|angle| f64::from(angle).to_degrees());
            counts[0] += 1;
            counts[1] += usize::from(is_land(place[0], place[1]) != (share == 255));
        }
    }
    counts
}

/// Over oceans and continents, opposite to large ones, at poles and the date line; far, near, flat and turned.
const CAMERAS: [(f64, f64, f64, [f64; 3]); 32] = [
    (0.0, 20.0, 1.5e7, [0.0, 0.0, 0.0]),
    (100.0, 40.0, 1.5e7, [0.0, 0.0, 0.0]),
    (-90.0, -40.0, 1.5e7, [0.0, 0.0, 0.0]),
    (-140.0, -10.0, 2.0e7, [0.0, 0.0, 0.0]),
    (-160.0, -20.0, 4.0e7, [40.0, 3.0, 0.0]),
    (170.0, -42.0, 9.0e6, [10.0, 20.0, 5.0]),
    (180.0, 66.0, 4.0e6, [200.0, 30.0, 0.0]),
    (-180.0, 10.0, 1.0e6, [90.0, 70.0, 0.0]),
    (0.0, 90.0, 1.2e7, [0.0, 0.0, 0.0]),
    (30.0, -90.0, 1.2e7, [0.0, 0.0, 0.0]),
    (60.0, -80.0, 3.0e6, [120.0, 45.0, -20.0]),
    (15.0, 38.0, 1.5e6, [0.0, 0.0, 0.0]),
    (-85.0, 12.0, 4.0e6, [0.0, 50.0, 0.0]),
    (10.0, 36.0, 5.0e5, [45.0, 60.0, 0.0]),
    (10.0, 36.0, 5.0e5, [225.0, 85.0, 30.0]),
    (-80.0, 9.0, 2.0e5, [300.0, 80.0, 0.0]),
    (12.0, 55.5, 1.0e5, [0.0, 40.0, 0.0]),
    (12.0, 55.5, 3.0e4, [90.0, 88.0, -60.0]),
    (-70.0, 20.0, 8.0e5, [180.0, 100.0, 0.0]),
    (140.0, -25.0, 1.0e9, [0.0, 0.2, 0.0]),
    (80.0, 25.0, 6.0e6, [0.0, 35.0, 180.0]),
    (-60.0, -15.0, 1.5e7, [0.0, 15.0, 90.0]),
    // From below the sea surface: straight up and down, level, with land before, behind and all round.
    (-30.0, 50.0, -4.0e5, [0.0, 110.0, 0.0]),
    (-30.0, 50.0, -4.0e5, [180.0, 95.0, 20.0]),
    (10.0, 36.0, -5.0e4, [45.0, 180.0, 0.0]),
    (10.0, 36.0, -1.0e6, [225.0, 120.0, 0.0]),
    (15.0, 10.0, -2.0e5, [30.0, 90.0, 0.0]),
    (90.0, 50.0, -1.0e5, [270.0, 100.0, -70.0]),
    (90.0, 50.0, -6.0e5, [90.0, 70.0, 0.0]),
    (20.0, -85.0, -3.0e5, [0.0, 130.0, 0.0]),
    (-140.0, 0.0, -1.0e3, [0.0, 91.0, 0.0]),
    (178.0, 66.0, -8.0e5, [10.0, 60.0, 0.0]),
];

#[test]
fn a_pixel_is_land_where_the_map_says_so_from_every_camera() {
    let mut all = 0;
    for (lon, lat, height, angles) in CAMERAS {
        let view = view(lon, lat, height, angles);
        let [count, wrong] = compared(view, &plan(view));
        // Single precision puts a pixel's centre a little beside itself.
        assert!(wrong * 500 <= count, "{view:?}: {wrong} of {count}");
        all += count;
    }
    assert!(all > 15_000, "{all}");
    // Land that is turned by three degrees is seen to be.
    let [there, beside] = [0.0, 3.0].map(|off| view(off, 20.0, 1.5e7, [0.0; 3]));
    let [count, wrong] = compared(there, &plan(beside));
    assert!(wrong * 50 > count, "{wrong} of {count}");
}

#[test]
fn no_line_goes_round_land_that_is_not_seen_itself() {
    // Over Polynesia and the Galápagos, the Aleutians at the limb, the Maldives; from afar and aslant.
    for (lon, lat, height, angles) in [
        (-145.0, -12.0, 1.5e7, [0.0, 0.0, 0.0]),
        (-130.0, -5.0, 5.0e6, [250.0, 35.0, 0.0]),
        (175.0, 15.0, 8.0e6, [0.0, 25.0, 0.0]),
        (73.0, -5.0, 3.0e6, [0.0, 40.0, 0.0]),
    ] {
        let view = view(lon, lat, height, angles);
        let drawn = plan(view);
        let params = plan(view).params_of(drawn.whole());
        let word = |x: u32, y: u32| drawn.coast[(y * SIZE_PX[0] + x) as usize].to_le_bytes();
        let mut lined = 0;
        for y in 6..SIZE_PX[1] - 6 {
            for x in 6..SIZE_PX[0] - 6 {
                let [_land, _lake, shore, _border] = word(x, y);
                let ground = ground_below(&params, [x, y]);
                if shore < 100 || line_share(&ground) < 1.0 {
                    continue;
                }
                lined += 1;
                let around = (y - 5..=y + 5).flat_map(|y| (x - 5..=x + 5).map(move |x| (x, y)));
                let most = around.map(|(x, y)| word(x, y)[0]).max();
                assert!(most > Some(150), "{view:?} {x} {y}: {most:?}");
            }
        }
        println!("{lined} pixels of coast from {lon} {lat} {height}");
    }
}

#[test]
fn the_coast_line_runs_where_land_begins() {
    for (lon, lat, height, angles) in CAMERAS.into_iter().skip(10).take(4) {
        let view = view(lon, lat, height, angles);
        let drawn = plan(view);
        let params = drawn.params_of(drawn.whole());
        let (mut edges, mut lined) = (0, 0);
        for y in 0..SIZE_PX[1] {
            for x in 0..SIZE_PX[0] {
                let [land, lake, shore, _border] =
                    drawn.coast[(y * SIZE_PX[0] + x) as usize].to_le_bytes();
                let is_edge = (60..=195).contains(&land) && lake == 0;
                if is_edge && ground_below(&params, [x, y]).rim_px > 2.0 {
                    edges += 1;
                    lined += usize::from(shore > 60);
                }
            }
        }
        // Round islands of a few pixels it is faint.
        assert!(
            edges > 50 && lined * 100 >= edges * 87,
            "{view:?}: {lined} of {edges}"
        );
    }
}
