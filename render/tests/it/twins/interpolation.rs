//! Interpolation and its twin.

use render::gpu::Slot;
use render::stages::interpolate::params::InterpolateParams;
use render::stages::interpolate::{self, Interpolate};
use render::stages::layout::MISSING;

use super::{Twins, prove};
use crate::compare::worst;

#[test]
fn interpolate_matches_its_twin() {
    let twins = Twins::tile();
    let mut params = twins.params;
    params.interpolation = InterpolateParams {
        first_cell: 40,
        end_cell: 2500,
    };
    let cells = 40..2500;
    let expected = &twins.value[cells.clone()];
    // A device may round a product and its sum at once, the twin rounds twice: an error of the largest operand's last
    // bits, which is all there is where two fields cancel.
    let largest = expected
        .iter()
        .filter(|v| **v > MISSING)
        .fold(0.0f32, |most, v| most.max(v.abs()));
    let right = "values.weight);\n";
    prove(
        "interpolate",
        interpolate::SOURCE,
        right,
        "values.weight * 0.5);\n",
        |gpu, source| {
            let stage = Interpolate::new(gpu, source);
            let [drawn] = twins.run_with(
                gpu,
                &params,
                |_| (),
                |f| stage.record(f).unwrap(),
                [(Slot::Value, twins.value.len() as u64 * 4)],
            );
            let drawn: Vec<f32> = bytemuck::pod_collect_to_vec(&drawn);
            worst(
                &drawn[cells.clone()],
                expected,
                4.0 * f32::EPSILON * largest,
                1e-5,
            )
        },
    );
}
