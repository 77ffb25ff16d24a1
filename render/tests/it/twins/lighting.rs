//! The light and its twins.

use contract::job::Mode;
use render::frame_context::FrameContext;
use render::gpu::Slot;
use render::passes::splat::{self, Splats};
use render::passes::{NO_PROBES, SHARED_PROBES};
use render::stages::bin;
use render::stages::light::{self, Light};
use render::stages::sizes::list_count;

use super::{Twins, prove};
use crate::compare::worst;
use crate::scenes::tile;

#[test]
fn light_is_given_and_lists_are_counted_as_the_twins_do() {
    for twins in [Twins::tile(), Twins::globe()] {
        let expected: Vec<f32> = twins.deposited.iter().map(|&depth| depth as f32).collect();
        for (probes, right, wrong) in [
            (
                SHARED_PROBES,
                "splat.light_depth - behind",
                "splat.light_depth",
            ),
            (
                NO_PROBES,
                "atomicAdd(&counts[list], 1u)",
                "atomicMax(&counts[list], 1u)",
            ),
        ] {
            prove("splat", splat::SOURCE, right, wrong, |gpu, source| {
                let stage = Splats::new(gpu, source, probes);
                let lists = u64::from(list_count(&twins.params)) * 4;
                let [first, second] = twins.stored();
                let [seen, lit, light, counts] = twins.run_with(
                    gpu,
                    &twins.params,
                    |_| (),
                    |f| stage.record(f).unwrap(),
                    [
                        first,
                        second,
                        (Slot::Light, expected.len() as u64 * 4),
                        (Slot::Counts, lists),
                    ],
                );
                let mut own = vec![0; list_count(&twins.params) as usize];
                bin::cpu::count(&twins.params, &twins.in_order(&seen, &lit), &mut own);
                if own != bytemuck::pod_collect_to_vec::<u8, u32>(&counts) {
                    return f32::INFINITY;
                }
                let light: Vec<u32> = bytemuck::pod_collect_to_vec(&light);
                let light: Vec<f32> = light.iter().map(|&depth| depth as f32).collect();
                // A deposit may round to a neighbour; a texel sums up some hundred of them.
                worst(&light, &expected, 40.0, 1e-3)
            });
        }
    }
}

#[test]
fn neighbours_share_the_lengths_of_lists() {
    // Without light, so that a workgroup's sums have room for lists whatever the order of its invocations.
    let twins = Twins::of(Mode::Sprites, tile(2, 0, 1, 256));
    let lists = list_count(&twins.params);
    prove(
        "lists of neighbours",
        splat::SOURCE,
        "atomicAdd(&counts[key & ~LIST_KEY], ",
        "atomicAdd(&counts[key & ~LIST_KEY], 1u + ",
        |gpu, source| {
            let stage = Splats::new(gpu, source, SHARED_PROBES);
            let [first, second] = twins.stored();
            let [seen, lit, counts] = twins.run_with(
                gpu,
                &twins.params,
                |_| (),
                |f| stage.record(f).unwrap(),
                [first, second, (Slot::Counts, u64::from(lists) * 4)],
            );
            let mut own = vec![0; lists as usize];
            bin::cpu::count(&twins.params, &twins.in_order(&seen, &lit), &mut own);
            assert!(own.iter().any(|length| *length > 1));
            let same = own == bytemuck::pod_collect_to_vec::<u8, u32>(&counts);
            if same { 0.0 } else { f32::INFINITY }
        },
    );
}

#[test]
fn the_depth_above_each_slice_matches_its_twin_exactly() {
    for twins in [Twins::tile(), Twins::globe()] {
        let expected: Vec<f32> = twins.light.iter().map(|&depth| depth as f32).collect();
        for (entry, right, wrong) in [
            (light::SEGMENTED, "min(own[j], DARK)", "min(own[j], 1u)"),
            (
                light::STRAIGHT,
                "min(light[at], DARK)",
                "min(light[at], 1u)",
            ),
        ] {
            prove("light", light::SOURCE, right, wrong, |gpu, source| {
                let stage = Light::of(gpu, source, entry);
                let given = |f: &mut FrameContext<'_>| {
                    drop(f.upload(Slot::Light, &twins.deposited).unwrap());
                };
                let drawn: Vec<u32> = twins.run(
                    gpu,
                    given,
                    |f| stage.record(f).unwrap(),
                    Slot::Light,
                    expected.len(),
                );
                let drawn: Vec<f32> = drawn.iter().map(|&depth| depth as f32).collect();
                worst(&drawn, &expected, 0.5, 0.0)
            });
        }
    }
}
