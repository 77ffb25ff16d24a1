//! What users say of colours, opacity and size, and cells whose gap was filled, as whole pictures.

use contract::colour::{Rgb, Stop, Stops};
use contract::job::{Mode, RenderJob, Style, View};
use render::{Image, Renderer, Scene};

use crate::compare::{assert_images_differ, distance};
use crate::device::renderers;
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE, clouded, globe, job, ocean, tile};
use crate::seams::children_of;

fn styled(mode: Mode, view: View, change: impl Fn(&mut Style)) -> RenderJob {
    let mut job = job(mode, view);
    change(&mut job.style);
    job
}

/// Everything at once that this file is about.
fn full(style: &mut Style) {
    style.transfer.colours = "-1e-9:#440154,0:#21918c,1e-9:#fde725".parse().unwrap();
    style.transfer.opacity = "-1e-9:1,0:0.2,1e-9:1".parse().unwrap();
    style.transfer.size = "-1e-9:1,0:0.5,1e-9:1".parse().unwrap();
    style.uncertainty = true;
}

#[test]
fn stops_and_uncertainty_leave_no_seams() {
    let scene = clouded(ONE_DEGREE);
    for renderer in renderers("look seams") {
        for mode in [Mode::Map, Mode::Sprites, Mode::Volume] {
            for [z, x, y] in [[2, 0, 1], [3, 7, 5]] {
                let large = styled(mode, tile(z as u8, x, y, 512), full);
                let large = renderer.render(&large, &scene).unwrap();
                let small = children_of(
                    renderer,
                    &scene,
                    &|view| styled(mode, view, full),
                    [z, x, y],
                );
                assert!(large == small, "{} {mode} {z}/{x}/{y}", renderer.name());
                assert!(large.alpha().any(|alpha| alpha > 50));
            }
        }
    }
}

#[test]
fn the_device_draws_what_the_twins_draw() {
    let scene = clouded(FIVE_DEGREES);
    let renderers = renderers("look");
    for mode in Mode::SCALAR {
        for view in [tile(1, 0, 0, 256), globe(-120.0, 10.0, 1.5e7, 160)] {
            let job = styled(mode, view, full);
            let drawn: Vec<Image> = renderers
                .iter()
                .map(|renderer| renderer.render(&job, &scene).unwrap())
                .collect();
            for other in &drawn[1..] {
                let (most, pixels) = distance(&drawn[0], other);
                let all = drawn[0].rgba8.len() / 4;
                // A colour may be the next of the palette's 256, and light or dark ink stand on the other side of grey.
                assert!(pixels <= all / 200, "{mode}: {most}, {pixels} of {all}");
            }
        }
    }
}

#[test]
fn a_palette_written_as_stops_is_the_palette() {
    let scene = ocean(FIVE_DEGREES);
    for renderer in renderers("stops") {
        for mode in Mode::SCALAR {
            let view = tile(1, 0, 0, 256);
            let plain = renderer.render(&job(mode, view), &scene).unwrap();
            let as_stops = styled(mode, view, |style| {
                let transfer = &mut style.transfer;
                let colours = transfer.palette.stops();
                let last = (colours.len() - 1) as f64;
                let stop = |(i, colour): (usize, &[u8; 3])| {
                    let place = i as f64 / last;
                    let value = transfer.low * (1.0 - place) + transfer.high * place;
                    Stop(value, Rgb(*colour))
                };
                let stops: Vec<_> = colours.iter().enumerate().map(stop).collect();
                transfer.colours = Stops::new(&stops).unwrap();
            });
            let (most, _) = distance(&plain, &renderer.render(&as_stops, &scene).unwrap());
            assert!(most <= 1, "{mode}: {most}");
            let reversed = styled(mode, view, |style| style.transfer.reversed = true);
            let reversed = renderer.render(&reversed, &scene).unwrap();
            assert!(distance(&plain, &reversed).0 > 60, "{mode}");
        }
    }
}

fn mean_alpha(image: &Image) -> f64 {
    image.alpha().map(f64::from).sum::<f64>() / image.alpha().count() as f64
}

#[test]
fn what_users_make_transparent_is_not_there_and_what_they_make_small_covers_less() {
    let scene = ocean(FIVE_DEGREES);
    let view = tile(2, 0, 1, 256);
    let drawn = |renderer: &Renderer, mode, opacity: &str, size: &str| {
        let job = styled(mode, view, |style| {
            style.transfer.opacity = opacity.parse().unwrap();
            style.transfer.size = size.parse().unwrap();
        });
        renderer.render(&job, &scene).unwrap()
    };
    for renderer in renderers("opacity") {
        for mode in Mode::SCALAR {
            let nothing = drawn(renderer, mode, "0:0", "0:1");
            assert!(nothing.alpha().all(|alpha| alpha == 0), "{mode}");
            let all = mean_alpha(&drawn(renderer, mode, "0:1", "0:1"));
            let half = mean_alpha(&drawn(renderer, mode, "0:0.5", "0:1"));
            let sources = mean_alpha(&drawn(renderer, mode, "0:0,0:1", "0:1"));
            assert!(
                half < 0.95 * all && half > 0.3 * all,
                "{mode}: {half} of {all}"
            );
            assert!(
                sources > 0.05 * all && sources < 0.9 * all,
                "{mode}: {sources} of {all}"
            );
        }
        for mode in [Mode::Points, Mode::Sprites] {
            let view = tile(4, 3, 7, 256);
            let of = |size: &str| {
                let job = styled(mode, view, |style| {
                    style.transfer.size = size.parse().unwrap();
                });
                mean_alpha(&renderer.render(&job, &scene).unwrap())
            };
            let (large, small) = (of("0:1"), of("0:0.4"));
            assert!(small < 0.7 * large, "{mode}: {small} of {large}");
        }
    }
}

#[test]
fn uncertainty_rises_with_the_estimated_error_and_is_none_where_a_cell_was_measured() {
    let field = clouded(FIVE_DEGREES).value.before;
    let (errors, uncertainties) = (
        field.errors.as_ref().unwrap().content(),
        field.uncertainties().content(),
    );
    let mut cells: Vec<_> = errors.iter().zip(uncertainties).collect();
    assert!(
        cells
            .iter()
            .all(|(error, uncertainty)| (**error > 0.0) == (**uncertainty > 0.3))
    );
    cells.retain(|(error, _)| **error > 0.0);
    cells.sort_by(|a, b| a.0.total_cmp(b.0));
    assert!(cells.len() > 200 && cells.is_sorted_by(|a, b| a.1 <= b.1));
    let most = cells.last().unwrap();
    assert!((most.1 - 1.0).abs() < 1e-6 && most.1 - cells[0].1 > 0.3);
    // Without a gap nobody uncertainties anything.
    let whole = ocean(FIVE_DEGREES).value.before;
    assert!(
        whole
            .uncertainties()
            .content()
            .iter()
            .all(|uncertainty| *uncertainty == 0.0)
    );
}

#[test]
fn uncertainty_is_seen_where_gaps_were_filled_and_nowhere_else() {
    let (scene, whole) = (clouded(ONE_DEGREE), ocean(ONE_DEGREE));
    let uncertainty = |style: &mut Style| style.uncertainty = true;
    for renderer in renderers("uncertainty") {
        for mode in Mode::SCALAR {
            let view = tile(2, 0, 1, 256);
            let (plain, uncertain) = (job(mode, view), styled(mode, view, uncertainty));
            let draw = |job: &RenderJob, scene: &Scene| renderer.render(job, scene).unwrap();
            // Without a gap there is no uncertainty, to the byte.
            assert!(draw(&plain, &whole) == draw(&uncertain, &whole), "{mode}");
            let (sure, unsure) = (draw(&plain, &scene), draw(&uncertain, &scene));
            assert_images_differ(&sure, &unsure);
        }
        // On a map every pixel tells: tile 2/0/1 covers 180 W to 90 W, 0 to 66.5 N, in 2.8 pixels a degree.
        let view = tile(2, 0, 1, 256);
        let sure = renderer.render(&job(Mode::Map, view), &scene).unwrap();
        let unsure = renderer
            .render(&styled(Mode::Map, view, uncertainty), &scene)
            .unwrap();
        let uncertainties =
            [&scene.value.before, &scene.value.after].map(|field| field.uncertainties().content());
        let (mut changed, mut checked) = (0, 0);
        for x in 0..256 {
            // The last row of pixels lies at the equator, between rows 89 and 90.
            let lon = (f64::from(x) + 0.5) / 256.0 * 90.0;
            let cols = [(lon - 0.5).max(0.0) as usize, (lon + 0.5) as usize];
            let cells = cols.iter().flat_map(|col| [89 * 360 + col, 90 * 360 + col]);
            let is_measured = cells
                .into_iter()
                .all(|cell| uncertainties.iter().all(|d| d[cell] <= 0.0));
            let is_same = sure.pixel(x, 255) == unsure.pixel(x, 255);
            if is_measured {
                assert!(is_same, "{} column {x}", renderer.name());
                checked += 1;
            }
            changed += usize::from(!is_same);
        }
        assert!(
            checked > 15 && changed > 30,
            "{checked} measured, {changed} changed"
        );
    }
}

/// What the descriptions of the sun say.
#[test]
fn particles_of_tiles_are_lit_by_no_sun_below_20_degrees_and_those_of_globes_are() {
    let scene = ocean(FIVE_DEGREES);
    for renderer in renderers("low sun") {
        let lit = |view: View, elevation_deg: f64| {
            let job = styled(Mode::Volume, view, |style| {
                style.sun.elevation_deg = elevation_deg;
            });
            renderer.render(&job, &scene).unwrap()
        };
        let flat = tile(1, 0, 0, 256);
        let at_20 = lit(flat, 20.0);
        assert!(lit(flat, 5.0) == at_20, "{}", renderer.name());
        assert!(lit(flat, 30.0) != at_20, "{}", renderer.name());
        let round = globe(-120.0, 10.0, 1.5e7, 160);
        assert!(lit(round, 5.0) != lit(round, 20.0), "{}", renderer.name());
    }
}
