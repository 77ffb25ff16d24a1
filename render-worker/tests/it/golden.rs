//! Golden pictures, drawn by the CPU twins and kept small; the GPU must draw nearly the same. `BLESS=1` rewrites them.

use std::path::PathBuf;

use contract::job::{Mode, RenderJob, View};
use render_worker::proof::currents::{self, gyres};
use render_worker::{Image, Scene};

use crate::compare::distance;
use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, globe, job, ocean, tile};

/// Largest file.
const MOST_BYTES: u64 = 64 << 10;
/// Largest difference of a channel between two back ends, and share of pixels that differ by more than one.
const MAX_DIFF: u8 = 6;
const DIFF_PIXELS_PER_MILLE: usize = 5;

fn path(name: &str) -> PathBuf {
    PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden")).join(format!("{name}.png"))
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
            std::fs::write(&path, drawn.encode_png().unwrap()).unwrap();
            println!("wrote {}", path.display());
        }
        let bytes = std::fs::read(&path)
            .unwrap_or_else(|e| panic!("{}: {e}; BLESS=1 draws it", path.display()));
        assert!(
            bytes.len() as u64 <= MOST_BYTES,
            "{} is too large",
            path.display()
        );
        let (most, pixels) = distance(&drawn, &decode(&bytes));
        let all = (drawn.width * drawn.height) as usize;
        // On this machine the twins draw their own pictures to the byte, but for the maths library of another system.
        let (most_diff, most_pixels) = if is_twin {
            (1, 0)
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
