//! Golden pictures, drawn by the CPU twins and kept small; the GPU must draw nearly the same. `BLESS=1` rewrites those
//! that changed, if the renderer has a new version.

mod record;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use contract::annotation::{Annotations, Graticule};
use contract::base_map::{Background, BaseMap};
use contract::context::Context;
use contract::digest::Digest;
use contract::isolines::Isolines;
use contract::job::{Mode, RENDERER_VERSION, RenderJob, View};
use render::{Image, Scene};
use render_proof::currents::{self, gyres};

use crate::below::below;
use crate::compare::distance;
use crate::context::{everything, with_terrain};
use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, GRAM_A_YEAR, ONE_DEGREE, globe, job, looking_at, ocean, tile};
use crate::trails::with_trails;
use record::{Record, digest};

/// Largest file, of a small picture and of one that is as large as people look at.
const MOST_BYTES: u64 = 64 << 10;
const MOST_WIDE_BYTES: u64 = 320 << 10;
/// The least that shows grain, thin lines and edges as people see them.
const WIDE_PX: [u32; 2] = [640, 360];
/// Largest difference of a channel between two back ends, and share of pixels that differ by more than one.
const MAX_DIFF: u8 = 6;
const DIFF_PIXELS_PER_MILLE: usize = 5;

/// Largest difference of a channel between two drawings by the twins: the maths library of another system.
const TWIN_DIFF: u8 = 1;

fn folder() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden"))
}

fn path(name: &str) -> PathBuf {
    folder().join(format!("{name}.png"))
}

fn record() -> Record {
    let text = std::fs::read_to_string(folder().join("versions.txt")).unwrap();
    text.parse().unwrap()
}

/// Writes a picture that is not there yet or is to be blessed, if this version of the renderer may draw it.
fn bless(name: &str, drawn: &Image) {
    static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());
    let _one = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
    let there = std::fs::read(path(name)).ok().map(|bytes| decode(&bytes));
    let is_same = |there: &Image| {
        (there.width, there.height) == (drawn.width, drawn.height)
            && distance(drawn, there).0 <= TWIN_DIFF
    };
    // What differs by rounding alone stays as it is: blessing twice, or elsewhere, changes nothing.
    let kept = there.filter(is_same);
    let picture = kept.as_ref().unwrap_or(drawn);
    let mut record = record();
    let added = record.add(RENDERER_VERSION, name, digest(picture));
    added.unwrap_or_else(|reason| panic!("{reason}"));
    std::fs::write(folder().join("versions.txt"), record.to_string()).unwrap();
    if kept.is_none() {
        std::fs::write(path(name), drawn.encode_png().unwrap()).unwrap();
        println!("wrote {}", path(name).display());
    }
}

#[expect(clippy::disallowed_methods, reason = "a test's own switches")]
fn is_set(variable: &str) -> bool {
    std::env::var(variable).is_ok_and(|value| !value.is_empty() && value != "0")
}

fn decode(bytes: &[u8]) -> Image {
    let image = image::load_from_memory_with_format(bytes, image::ImageFormat::Png)
        .unwrap()
        .into_rgba8();
    Image {
        width: image.width(),
        height: image.height(),
        rgba8: image.into_raw(),
    }
}

/// The middle of a tile, so that files stay small; all of a globe.
fn cropped(image: &Image) -> Image {
    if image.width != 256 {
        return image.clone();
    }
    let pixels = (64..192).flat_map(|y| (64..192).flat_map(move |x| image.pixel(x, y)));
    Image {
        width: 128,
        height: 128,
        rgba8: pixels.collect(),
    }
}

fn matches_golden(name: &str, mode: Mode, view: View) {
    matches_golden_of(name, &ocean(FIVE_DEGREES), job(mode, view));
}

fn matches_golden_of(name: &str, scene: &Scene, mut job: RenderJob) {
    job.style.globe_surface = true;
    for renderer in renderers("golden") {
        let drawn = cropped(&renderer.render(&job, scene).unwrap());
        let path = path(name);
        let is_twin = renderer.name() == "CPU twins";
        if is_twin && (is_set("BLESS") || (!path.exists() && !is_set("CI"))) {
            bless(name, &drawn);
        }
        let bytes = std::fs::read(&path)
            .unwrap_or_else(|e| panic!("{}: {e}; BLESS=1 draws it", path.display()));
        let most_bytes = if drawn.width < WIDE_PX[0] {
            MOST_BYTES
        } else {
            MOST_WIDE_BYTES
        };
        assert!(
            bytes.len() as u64 <= most_bytes,
            "{} is too large",
            path.display()
        );
        let (most, pixels) = distance(&drawn, &decode(&bytes));
        let all = (drawn.width * drawn.height) as usize;
        // On this machine the twins draw their own pictures to the byte, but for the maths library of another system.
        let (most_diff, most_pixels) = if is_twin {
            (TWIN_DIFF, 0)
        } else {
            (MAX_DIFF, all * DIFF_PIXELS_PER_MILLE / 1000)
        };
        assert!(
            most <= most_diff && pixels <= most_pixels,
            "{name} by {}: at most {most} apart, {pixels} of {all} pixels by more than one",
            renderer.name()
        );
    }
}

#[test]
fn map_tiles_match_their_golden_picture() {
    matches_golden("map_tile", Mode::Map, tile(1, 0, 0, 256));
}

#[test]
fn points_tiles_match_their_golden_picture() {
    matches_golden("points_tile", Mode::Points, tile(2, 0, 1, 256));
}

#[test]
fn sprites_tiles_match_their_golden_picture() {
    matches_golden("sprites_tile", Mode::Sprites, tile(3, 1, 3, 256));
}

#[test]
fn volume_tiles_match_their_golden_picture() {
    matches_golden("volume_tile", Mode::Volume, tile(2, 0, 1, 256));
}

#[test]
fn map_globes_match_their_golden_picture() {
    matches_golden("map_globe", Mode::Map, globe(-120.0, 10.0, 1.5e7, 160));
}

#[test]
fn volume_globes_match_their_golden_picture() {
    matches_golden(
        "volume_globe",
        Mode::Volume,
        globe(-120.0, 10.0, 1.5e7, 160),
    );
}

#[test]
fn tilted_volumes_maps_and_coasts_match_their_golden_pictures() {
    let near = looking_at([-122.0, 25.0], 2.5e6, [60.0, 70.0], 192);
    let limb = looking_at([-140.0, 50.0], 6.0e6, [-10.0, 40.0], 192);
    matches_golden("volume_low", Mode::Volume, near);
    matches_golden("map_low", Mode::Map, near);
    let mut job = job(Mode::Volume, limb);
    job.style.context.coastlines = true;
    matches_golden_of("volume_limb", &ocean(FIVE_DEGREES), job);
}

/// The same camera with a wide picture.
fn wide(view: View) -> View {
    let View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        angles,
        ..
    } = view
    else {
        panic!("a globe");
    };
    View::Globe {
        lon_deg,
        lat_deg,
        height_m,
        width_px: WIDE_PX[0],
        height_px: WIDE_PX[1],
        angles,
    }
}

#[test]
fn wide_tilted_volumes_match_their_golden_picture() {
    let view = looking_at([-112.0, 8.0], 5.0e6, [30.0, 50.0], 0);
    let mut job = job(Mode::Volume, wide(view));
    job.style.height_m_per_kg_m2 = 2e7;
    job.style.context.coastlines = true;
    matches_golden_of("volume_wide", &ocean(ONE_DEGREE), job);
}

#[test]
fn wide_looks_at_sinks_below_the_sea_match_their_golden_picture() {
    let view = looking_at([-128.0, 36.0], 3.5e6, [50.0, 48.0], 0);
    let mut job = everything(Mode::Volume, wide(view));
    job.style.height_m_per_kg_m2 = 2e7;
    matches_golden_of("below_wide", &with_terrain(ONE_DEGREE), job);
}

#[test]
fn wide_looks_from_below_the_sea_match_their_golden_picture() {
    let view = below([-128.0, 14.0], 5.0e5, [10.0, 84.0], WIDE_PX);
    let mut job = job(Mode::Volume, view);
    job.style.height_m_per_kg_m2 = 1e7;
    job.style.transfer.opacity = "-1.4e-9:0.9,-0.9e-9:0.3,-0.5e-9:0,0:0,0.5e-9:0,1.4e-9:0.9"
        .parse()
        .unwrap();
    job.style.context.coastlines = true;
    job.style.context.sea_opacity = 0.03;
    matches_golden_of("under_wide", &ocean(ONE_DEGREE), job);
}

#[test]
fn wide_maps_match_their_golden_picture() {
    let view = looking_at([-100.0, 10.0], 1.0e7, [0.0, 20.0], 0);
    let mut job = job(Mode::Map, wide(view));
    job.style.context.coastlines = true;
    matches_golden_of("map_wide", &ocean(ONE_DEGREE), job);
}

#[test]
fn wide_volumes_on_the_light_base_map_match_their_golden_picture() {
    let view = looking_at([-112.0, 8.0], 6.0e6, [30.0, 45.0], 0);
    let mut job = job(Mode::Volume, wide(view));
    job.style.height_m_per_kg_m2 = 1e7;
    job.style.context = Context {
        coastlines: true,
        borders: true,
        sea_floor: true,
        base_map: BaseMap::Light,
        background: Background::Sky,
        ..job.style.context
    };
    matches_golden_of("light_wide", &ocean(ONE_DEGREE), job);
}

#[test]
fn wide_trails_over_a_volume_match_their_golden_picture() {
    let view = looking_at([-35.0, 30.0], 6.0e6, [20.0, 45.0], 0);
    let mut job = job(Mode::Volume, wide(view));
    job.style.context.coastlines = true;
    let (scene, job) = with_trails(job);
    matches_golden_of("trails_wide", &scene, job);
}

#[test]
fn wide_flows_match_their_golden_picture() {
    let view = looking_at([-140.0, 25.0], 7.0e6, [0.0, 35.0], 0);
    let mut job = currents::job(wide(view), 1e7);
    job.style.context.coastlines = true;
    matches_golden_of("flow_wide", &gyres(ONE_DEGREE), job);
}

#[test]
fn wide_isolines_match_their_golden_picture() {
    let view = looking_at([-140.0, 15.0], 7.0e6, [10.0, 40.0], 0);
    let mut job = job(Mode::Map, wide(view));
    job.style.context.coastlines = true;
    job.style.context.isolines = Some(Isolines::Every {
        zero: 0.0,
        step: 10.0 * GRAM_A_YEAR,
    });
    job.annotations = Some(Annotations {
        graticule: Graticule::every(15.0).ok(),
        ..Annotations::none()
    });
    matches_golden_of("isolines_wide", &ocean(ONE_DEGREE), job);
}

#[test]
fn wide_seas_without_data_match_their_golden_picture() {
    // The made-up data end at 80 degrees north, and leave out seas where there is made-up land.
    let view = looking_at([-20.0, 80.0], 5.0e6, [-20.0, 25.0], 0);
    let mut job = job(Mode::Map, wide(view));
    job.style.context.coastlines = true;
    job.style.context.sea_floor = true;
    matches_golden_of("hatch_wide", &ocean(ONE_DEGREE), job);
}

#[test]
fn isolines_in_volumes_and_maps_match_their_golden_pictures() {
    for (name, mode, view) in [
        (
            "isolines_volume",
            Mode::Volume,
            globe(-120.0, 10.0, 1.5e7, 160),
        ),
        ("isolines_tile", Mode::Map, tile(2, 0, 1, 256)),
    ] {
        let mut job = job(mode, view);
        job.style.context.isolines = Some(Isolines::Every {
            zero: 0.0,
            step: 10.0 * GRAM_A_YEAR,
        });
        if let View::Globe { .. } = view {
            job.annotations = Some(Annotations {
                graticule: Graticule::every(15.0).ok(),
                ..Annotations::none()
            });
        }
        matches_golden_of(name, &ocean(FIVE_DEGREES), job);
    }
}

#[test]
fn flow_tiles_and_globes_match_their_golden_pictures() {
    let scene = gyres(FIVE_DEGREES);
    for (name, view) in [
        ("flow_tile", tile(3, 1, 3, 256)),
        ("flow_globe", globe(-120.0, 10.0, 1.5e7, 160)),
    ] {
        matches_golden_of(name, &scene, currents::job(view, 1e7));
    }
}

#[test]
fn the_golden_pictures_are_those_of_this_version_of_the_renderer() {
    // They are being written then, by the other tests of this program.
    if is_set("BLESS") {
        return;
    }
    let mut there = BTreeMap::<String, Digest>::new();
    for entry in std::fs::read_dir(folder()).unwrap() {
        let path = entry.unwrap().path();
        if path.extension().is_some_and(|extension| extension == "png") {
            let name = path.file_stem().unwrap().to_str().unwrap().to_owned();
            there.insert(name, digest(&decode(&std::fs::read(&path).unwrap())));
        }
    }
    assert!(!there.is_empty());
    let quarrels = record().quarrels(RENDERER_VERSION, &there);
    assert!(quarrels.is_empty(), "{}", quarrels.join("\n"));
}

#[test]
fn a_golden_picture_of_something_else_is_seen() {
    let drawn = |mode| {
        renderers("golden")[0]
            .render(&job(mode, tile(2, 0, 1, 256)), &ocean(FIVE_DEGREES))
            .unwrap()
    };
    let (most, pixels) = distance(
        &cropped(&drawn(Mode::Volume)),
        &cropped(&drawn(Mode::Sprites)),
    );
    assert!(most > MAX_DIFF && pixels > 128 * 128 * DIFF_PIXELS_PER_MILLE / 1000);
}

#[test]
fn trails_over_a_volume_on_the_globe() {
    let (scene, job) = with_trails(job(Mode::Volume, globe(-30.0, 25.0, 9e6, 160)));
    matches_golden_of("trails_globe", &scene, job);
}
