//! Velocities, drifting particles and their twins.

use render::frame_context::FrameContext;
use render::gpu::Slot;
use render::passes::SHARED_PROBES;
use render::passes::trails::{self, Trails};
use render::stages::flow::{self, Flow};
use render::stages::layout::{MISSING, Velocity};

use super::{Twins, prove, splat_numbers};
use crate::compare::worst;
use crate::scenes::{globe, tile};

#[test]
fn velocities_match_their_twin() {
    let twins = Twins::of_flow(tile(2, 0, 1, 256));
    let numbers = |velocity: &[Velocity]| -> Vec<f32> {
        let parts = velocity.iter().flat_map(|v| [v.east, v.north]);
        parts.collect()
    };
    let expected = numbers(&twins.velocity);
    assert!(expected.iter().any(|v| *v > 0.5) && expected.contains(&MISSING));
    for (right, wrong) in [
        (
            "north_after[cell], values.northward_weight",
            "north_after[cell], 0.0",
        ),
        (
            "is_missing(east) || is_missing(north)",
            "is_missing(east) && grid.rows == 0u",
        ),
    ] {
        prove("velocities", flow::SOURCE, right, wrong, |gpu, source| {
            let stage = Flow::new(gpu, source);
            let drawn: Vec<Velocity> = twins.run(
                gpu,
                |_| (),
                |f| stage.record(f).unwrap(),
                Slot::Velocity,
                twins.velocity.len(),
            );
            worst(&numbers(&drawn), &expected, 1e-5, 1e-5)
        });
    }
}

#[test]
fn drifting_splats_match_their_twins_on_tiles_and_on_the_globe() {
    let faults = [
        ("-drawn.y * flow", "drawn.y * flow"),
        ("0.5 * share * here.rate", "share * here.rate"),
        ("flow.cycle + u32(turn)", "flow.cycle"),
        ("x = (x % cols + cols) % cols;", ""),
        ("min(trail.open, here.open)", "trail.open"),
    ];
    let views = [tile(2, 0, 1, 256), globe(-178.0, 10.0, 1.5e7, 160)];
    for view in views {
        let twins = Twins::of_flow(view);
        let expected = splat_numbers(twins.params.lists.kernel, &twins.splats, &twins.splats);
        let drawn = twins.splats.iter().filter(|splat| splat.tau > 0.05).count();
        assert!(drawn > 1000, "{drawn} dots");
        for (right, wrong) in faults {
            prove("trails", trails::SOURCE, right, wrong, |gpu, source| {
                let stage = Trails::new(gpu, source, SHARED_PROBES);
                let given = |f: &mut FrameContext<'_>| {
                    drop(f.upload(Slot::Velocity, &twins.velocity).unwrap());
                };
                let [seen, lit] = twins.run_with(
                    gpu,
                    &twins.params,
                    given,
                    |f| stage.record(f).unwrap(),
                    twins.stored(),
                );
                let drawn = splat_numbers(
                    twins.params.lists.kernel,
                    &twins.in_order(&seen, &lit),
                    &twins.splats,
                );
                // A way of some hundred cells adds up what is rounded on it: two subpixels.
                worst(&drawn, &expected, 0.0201, 1e-4)
            });
        }
    }
}
