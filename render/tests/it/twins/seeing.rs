//! The eye and its twin.

use contract::job::Mode;
use render::frame_context::FrameContext;
use render::gpu::{Gpu, Slot};
use render::stages::compose;
use render::stages::compose::in_context::Surroundings;
use render::stages::eye::cpu::Hiding;
use render::stages::eye::{self, Eye};
use render_proof::views::looking_at;

use super::{Twins, bytes, channels, far_apart, prove};
use crate::compare::worst;
use crate::scenes::{FIVE_DEGREES, globe, ocean, tile};

/// The image that the eye makes of the twins' lists on the GPU, as bytes.
pub(super) fn eye_image(twins: &Twins, gpu: &Gpu, source: &str, entry: &'static str) -> Vec<f32> {
    let stage = Eye::of(gpu, source, entry);
    let lists = |f: &mut FrameContext<'_>| {
        f.upload(Slot::Counts, &twins.list_ends).unwrap();
        f.upload(Slot::Entries, &twins.entries).unwrap();
    };
    let drawn: Vec<u32> = twins.run(
        gpu,
        lists,
        |f| stage.record(f).unwrap(),
        Slot::Image,
        twins.image.len(),
    );
    bytes(drawn)
}

#[test]
fn eye_matches_its_twin_in_every_kernel() {
    let modes =
        [Mode::Volume, Mode::Sprites, Mode::Points].map(|mode| Twins::of(mode, tile(1, 0, 0, 256)));
    for twins in &modes {
        let expected = bytes(twins.image.iter().copied());
        for entry in [eye::SHARED, eye::ALONE] {
            prove(
                "eye",
                eye::SOURCE,
                "let alpha = 1.0 - exp(-",
                "let alpha = 1.0 - exp(-0.9 * ",
                // Depths are whole parts of 1/4096 and may round to a neighbour, some ten a pixel; exp is good to 1e-6.
                |gpu, source| far_apart(&eye_image(twins, gpu, source, entry), &expected, 1.01),
            );
        }
    }
}

#[test]
fn light_that_rises_across_a_cloud_is_seen_as_the_twin_sees_it() {
    let twins = Twins::of(
        Mode::Volume,
        looking_at([-122.0, 27.0], 2.2e6, [30.0, 60.0], 96),
    );
    let steep = twins
        .entries
        .iter()
        .filter(|entry| (entry.colour >> 24).abs_diff(128) > 16);
    assert!(steep.count() > twins.entries.len() / 20);
    let expected = bytes(twins.image.iter().copied());
    for entry in [eye::SHARED, eye::ALONE] {
        for (right, wrong) in [
            ("1.0 + slope.x * east", "1.0 - slope.x * east"),
            (
                "(corner_px + place - view.center_px)",
                "(place - view.center_px)",
            ),
        ] {
            prove("eye", eye::SOURCE, right, wrong, |gpu, source| {
                far_apart(&eye_image(&twins, gpu, source, entry), &expected, 1.01)
            });
        }
    }
}

#[test]
fn pixels_that_work_alone_and_pixels_that_share_come_to_the_same_picture() {
    for mode in [Mode::Volume, Mode::Sprites, Mode::Points] {
        let twins = Twins::of(mode, tile(1, 0, 0, 256));
        prove(
            "eye",
            eye::SOURCE,
            "sixteenth(rgb * bright), amount)",
            "sixteenth(rgb * bright), amount + 1u)",
            |gpu, source| {
                let [shared, alone] =
                    [eye::SHARED, eye::ALONE].map(|entry| eye_image(&twins, gpu, source, entry));
                // A device may join a product and a sum in one of the two.
                far_apart(&shared, &alone, 1.01)
            },
        );
    }
}

#[test]
fn what_lies_behind_a_covered_tile_is_left_out_and_not_missed() {
    let twins = Twins::styled(
        Mode::Volume,
        tile(1, 0, 0, 256),
        ocean(FIVE_DEGREES),
        |style| {
            style.optical_depth = 60.0;
        },
    );
    let covered = twins.picture.iter().filter(|pixel| pixel.w > 0.9997);
    assert!(covered.count() > 1000);
    let expected = bytes(twins.image.iter().copied());
    // Lists of this coarse scene are short.
    let asking = eye::SOURCE.replace("WORTH_ASKING = 1024u", "WORTH_ASKING = 4u");
    prove(
        "eye",
        &asking,
        "{ is_open = 1u; }",
        "{ is_open = 0u; }",
        |gpu, source| {
            let shared = eye_image(&twins, gpu, source, eye::SHARED);
            far_apart(&shared, &expected, 1.01)
        },
    );
}

#[test]
fn eye_blends_away_from_the_light_behind_as_its_twin_does() {
    let mut twins = Twins::of(Mode::Volume, globe(-120.0, 10.0, 1.5e7, 96));
    let front = twins.picture.clone();
    twins.params.view.front_to_back = 0;
    eye::cpu::eye(
        &twins.params,
        &twins.list_ends,
        &twins.entries,
        Hiding::of(&twins.plan),
        &mut twins.picture,
    );
    assert!(
        worst(&channels(&front), &channels(&twins.picture), 0.01, 0.0) > 1.0,
        "the order is seen"
    );
    let around = Surroundings::of(&twins.plan, &twins.scene, &twins.lines);
    compose::in_context::compose(&twins.params, &twins.picture, &around, &mut twins.image);
    let expected = bytes(twins.image.iter().copied());
    prove(
        "eye",
        eye::SOURCE,
        "view.front_to_back == 1u",
        "view.front_to_back == 0u",
        |gpu, source| {
            let image = eye_image(&twins, gpu, source, eye::SHARED);
            far_apart(&image, &expected, 1.01)
        },
    );
}
