//! Pictures without seams: a 512 tile is its four 256 children to the byte, and equal jobs give equal bytes.

use contract::job::{Mode, RenderJob, View};
use render::{Image, Renderer, Scene};

use crate::compare::{assert_images_differ, distance};
use crate::device::{gpu_renderer, renderers};
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, globe, job, ocean, tile};

/// The four 256 tiles below a tile as one picture.
fn children(renderer: &Renderer, scene: &Scene, mode: Mode, tile: [u32; 3]) -> Image {
    children_of(renderer, scene, &|view| job(mode, view), tile)
}

/// The same for any job.
pub(crate) fn children_of(
    renderer: &Renderer,
    scene: &Scene,
    job: &dyn Fn(View) -> RenderJob,
    [z, x, y]: [u32; 3],
) -> Image {
    let mut whole = Image {
        width: 512,
        height: 512,
        rgba8: vec![0; 512 * 512 * 4],
    };
    for (east, south) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let view = tile(z as u8 + 1, 2 * x + east, 2 * y + south, 256);
        let child = renderer.render(&job(view), scene).unwrap();
        for (row, pixels) in (0..).zip(child.rgba8.chunks_exact(256 * 4)) {
            let at = ((south as usize * 256 + row) * 512 + east as usize * 256) * 4;
            whole.rgba8[at..at + 1024].copy_from_slice(pixels);
        }
    }
    whole
}

#[test]
fn a_large_tile_is_its_four_children_to_the_byte() {
    let scene = ocean(ONE_DEGREE);
    // The whole world, a tile at the date line, the last one before the northern edge of the map.
    for renderer in renderers("seams") {
        for mode in Mode::SCALAR {
            for [z, x, y] in [[0, 0, 0], [3, 0, 3], [2, 1, 0]] {
                let large = renderer
                    .render(&job(mode, tile(z as u8, x, y, 512)), &scene)
                    .unwrap();
                let small = children(renderer, &scene, mode, [z, x, y]);
                let differing = large
                    .rgba8
                    .iter()
                    .zip(&small.rgba8)
                    .filter(|(a, b)| a != b)
                    .count();
                assert_eq!(differing, 0, "{} {mode} {z}/{x}/{y}", renderer.name());
                assert!(
                    large.alpha().any(|alpha| alpha > 100),
                    "{mode} {z}/{x}/{y} shows something"
                );
            }
        }
    }
}

#[test]
fn a_deep_tile_is_its_four_children_to_the_byte() {
    let scene = ocean(FIVE_DEGREES);
    for renderer in renderers("deep seams") {
        let [z, x, y] = [12, 1100, 1990];
        let large = renderer
            .render(&job(Mode::Volume, tile(z as u8, x, y, 512)), &scene)
            .unwrap();
        assert!(
            large == children(renderer, &scene, Mode::Volume, [z, x, y]),
            "{}",
            renderer.name()
        );
        assert!(large.alpha().all(|alpha| alpha > 10));
    }
}

#[test]
fn the_world_has_no_seam_at_the_date_line() {
    let scene = ocean(ONE_DEGREE);
    for renderer in renderers("date line") {
        for mode in [Mode::Map, Mode::Volume] {
            let west = renderer
                .render(&job(mode, tile(2, 0, 1, 256)), &scene)
                .unwrap();
            let east = renderer
                .render(&job(mode, tile(2, 3, 1, 256)), &scene)
                .unwrap();
            // Neighbouring columns across the line differ no more than neighbouring columns elsewhere.
            let step = |a: &Image, ax: u32, b: &Image, bx: u32| -> u32 {
                (0..256)
                    .map(|y| u32::from(a.pixel(ax, y)[3].abs_diff(b.pixel(bx, y)[3])))
                    .sum()
            };
            let usual = (0..255)
                .map(|x| step(&west, x, &west, x + 1))
                .max()
                .unwrap();
            assert!(step(&east, 255, &west, 0) <= usual, "{mode}");
        }
    }
}

#[test]
fn equal_jobs_give_equal_bytes() {
    let scene = ocean(FIVE_DEGREES);
    for renderer in renderers("equal jobs") {
        for view in [tile(1, 0, 0, 256), globe(-120.0, 10.0, 1.5e7, 200)] {
            let png = || {
                renderer
                    .render(&job(Mode::Volume, view), &scene)
                    .unwrap()
                    .encode_png()
                    .unwrap()
            };
            let first = png();
            // Another picture in between, so that buffers hold something else.
            renderer
                .render(&job(Mode::Sprites, tile(0, 0, 0, 512)), &scene)
                .unwrap();
            assert_eq!(first, png());
        }
    }
}

#[test]
fn a_globe_picture_is_whole_where_its_parts_meet() {
    let scene = ocean(FIVE_DEGREES);
    for renderer in renderers("parts") {
        let view = |width_px| contract::job::View::Globe {
            lon_deg: -120.0,
            lat_deg: 10.0,
            height_m: 1.5e7,
            width_px,
            height_px: 64,
            angles: contract::camera::CameraAngles::NADIR,
        };
        // The shorter side sets the focal length, so both show the same globe; the wide one is drawn in two parts that
        // meet in the globe's middle.
        let wide = renderer
            .render(&job(Mode::Volume, view(2048)), &scene)
            .unwrap();
        let narrow = renderer
            .render(&job(Mode::Volume, view(64)), &scene)
            .unwrap();
        let pixels = (0..64).flat_map(|y| {
            (0..64).flat_map({
                let wide = &wide;
                move |x| wide.pixel(1024 - 32 + x, y)
            })
        });
        let middle = Image {
            width: 64,
            height: 64,
            rgba8: pixels.collect(),
        };
        // The same to a subpixel: 1024 and 32 pixels from the left leave different bits for the rest.
        let (most, _) = distance(&middle, &narrow);
        assert!(most <= 3, "{most}");
        assert!(narrow.pixel(32, 32)[3] > 30);
    }
}

#[test]
fn two_camera_angles_two_instants_and_four_modes_differ() {
    let scene = ocean(FIVE_DEGREES);
    for renderer in renderers("differences") {
        let draw = |mode, view| renderer.render(&job(mode, view), &scene).unwrap();
        let from = |lon| draw(Mode::Volume, globe(lon, 10.0, 1.5e7, 128));
        assert_images_differ(&from(-120.0), &from(-60.0));
        let pictures: Vec<_> = Mode::SCALAR
            .map(|mode| draw(mode, tile(1, 0, 0, 256)))
            .into_iter()
            .collect();
        for (i, a) in pictures.iter().enumerate() {
            for b in &pictures[i + 1..] {
                assert_images_differ(a, b);
            }
        }
    }
}

#[test]
fn trusted_shaders_draw_the_bytes_that_checked_ones_draw() {
    let Some(trusted) = gpu_renderer("trusted shaders") else {
        return;
    };
    let checked = Renderer::checked().unwrap();
    let scene = ocean(FIVE_DEGREES);
    for mode in Mode::SCALAR {
        for view in [tile(2, 0, 1, 256), globe(-120.0, 10.0, 1.5e7, 128)] {
            let job = job(mode, view);
            let images = [trusted, &checked].map(|r| r.render(&job, &scene).unwrap());
            assert!(images[0] == images[1], "{mode} {view:?}");
        }
    }
}
