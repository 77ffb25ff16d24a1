//! The pass that makes splats, and the twins of what it is made of.

use contract::job::Mode;
use render::passes::splat::{self, Splats};
use render::passes::{SHARED_PROBES, scatter, trails};
use render::stages::{
    bin, compose, eye, flow, interpolate, light, particles, project, uncertainty,
};

use super::{Twins, prove, splat_numbers};
use crate::below::below;
use crate::compare::worst;
use crate::context::{everything, with_terrain};
use crate::scenes::{FIVE_DEGREES, ocean, tile};

#[test]
fn splats_match_their_twins_on_tiles_and_on_the_globe() {
    let joined = Twins::joined(Mode::Volume, tile(2, 0, 1, 256));
    let faults = [
        (&joined, "particle.depth * share", "particle.depth"),
        (
            &joined,
            "share = share_of(cell)",
            "share = share_of(cell + 1u)",
        ),
        (Twins::tile(), "place.x + jittered", "place.y + jittered"),
        (Twins::tile(), "ground_y - nearest(", "ground_y + nearest("),
        (
            Twins::globe(),
            "1.0 + particle.height_m",
            "1.0 - particle.height_m",
        ),
        (Twins::uncertain_tile(), "shape >> 16u", "shape >> 17u"),
        (
            Twins::uncertain_tile(),
            "shape & 0xffffu",
            "shape & 0x7fffu",
        ),
        (
            Twins::uncertain_tile(),
            "uncertainty_after[cell] - before",
            "uncertainty_after[cell]",
        ),
        (
            Twins::uncertain_tile(),
            "PALENESS * uncertainty",
            "uncertainty",
        ),
    ];
    for (twins, right, wrong) in faults {
        let expected = splat_numbers(twins.params.lists.kernel, &twins.splats, &twins.splats);
        prove("splat", splat::SOURCE, right, wrong, |gpu, source| {
            let stage = Splats::new(gpu, source, SHARED_PROBES);
            let outputs = twins.stored();
            let [seen, lit] = twins.run_with(
                gpu,
                &twins.params,
                |_| (),
                |f| stage.record(f).unwrap(),
                outputs,
            );
            // Colours are bytes and may round to a neighbour; a phase of a few turns loses a few bits.
            worst(
                &splat_numbers(
                    twins.params.lists.kernel,
                    &twins.in_order(&seen, &lit),
                    &twins.splats,
                ),
                &expected,
                0.0201,
                1e-4,
            )
        });
    }
}

#[test]
fn splats_seen_from_below_the_sea_match_their_twins() {
    let view = below([-128.0, 30.0], 3e5, [20.0, 105.0], [160, 120]);
    let twins = Twins::styled(Mode::Volume, view, ocean(FIVE_DEGREES), |_| ());
    let expected = splat_numbers(twins.params.lists.kernel, &twins.splats, &twins.splats);
    for (right, wrong) in [
        ("min(distance, view.hides)", "min(distance, 1.0)"),
        ("kept_over(min(way, to_ceiling))", "kept_over(way * 2.0)"),
        ("mix(1.0, view.ceiling_kept, above)", "1.0"),
        ("mix(view.deep, view.water,", "mix(view.water, view.deep,"),
        ("through * left * 255.0", "left * 255.0"),
    ] {
        prove("splat", splat::SOURCE, right, wrong, |gpu, source| {
            let stage = Splats::new(gpu, source, SHARED_PROBES);
            let [seen, lit] = twins.run_with(
                gpu,
                &twins.params,
                |_| (),
                |f| stage.record(f).unwrap(),
                twins.stored(),
            );
            worst(
                &splat_numbers(
                    twins.params.lists.kernel,
                    &twins.in_order(&seen, &lit),
                    &twins.splats,
                ),
                &expected,
                0.0201,
                1e-4,
            )
        });
    }
}

#[test]
fn every_function_of_a_particle_is_in_the_pass_that_is_tested() {
    for functions in [
        interpolate::FUNCTIONS,
        particles::FUNCTIONS,
        uncertainty::FUNCTIONS,
        project::FUNCTIONS,
        light::DEPOSIT_FUNCTIONS,
        bin::FUNCTIONS,
    ] {
        assert!(splat::SOURCE.contains(functions));
    }
    for functions in [flow::FUNCTIONS, project::FUNCTIONS, bin::FUNCTIONS] {
        assert!(trails::SOURCE.contains(functions));
    }
    assert!(scatter::SOURCE.contains(light::SHADE_FUNCTIONS));
    assert!(
        eye::SOURCE.contains(compose::FUNCTIONS) && compose::SOURCE.contains(compose::FUNCTIONS)
    );
}

#[test]
fn splats_in_the_sea_and_in_the_night_match_their_twins() {
    let twins = Twins::of_job(
        &everything(Mode::Volume, tile(1, 0, 0, 256)),
        with_terrain(FIVE_DEGREES),
    );
    let expected = splat_numbers(twins.params.lists.kernel, &twins.splats, &twins.splats);
    for (right, wrong) in [
        ("exp(-particles.sea_per_m", "exp(-0.5 * particles.sea_per_m"),
        (
            "day_at(normal_of(particle))",
            "day_at(-normal_of(particle))",
        ),
    ] {
        prove("splat", splat::SOURCE, right, wrong, |gpu, source| {
            let stage = Splats::new(gpu, source, SHARED_PROBES);
            let [seen, lit] = twins.run_with(
                gpu,
                &twins.params,
                |_| (),
                |f| stage.record(f).unwrap(),
                twins.stored(),
            );
            worst(
                &splat_numbers(
                    twins.params.lists.kernel,
                    &twins.in_order(&seen, &lit),
                    &twins.splats,
                ),
                &expected,
                0.0201,
                1e-4,
            )
        });
    }
}
