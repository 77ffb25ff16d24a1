//! The bench of gap filling: it measures what it says and checks what was filled.

use std::time::Duration;

use render::gpu::Gpu;
use render::stages::fill::{Fill, Form, Sources};
use render_proof::fill::hold_out::HoldOut;
use render_proof::fill::timing::{Case, bench_fill};

#[test]
fn the_bench_measures_every_form_and_checks_its_answers() {
    if test_data::is_without_gpu("the bench of gap filling") {
        return;
    }
    let gpu = &Gpu::open().expect("a Vulkan adapter, or NO_GPU=1");
    let fill = Fill::new(gpu, Sources::default());
    let case = Case {
        rows: 48,
        cols: 64,
        missing: HoldOut {
            share: 0.2,
            side_cells: 2,
            seed: 1,
        },
    };
    for form in Form::ALL {
        let timing = bench_fill(gpu, &fill, case, form, 3, Duration::from_secs(20)).unwrap();
        assert!(timing.median_s() > 0.0 && timing.gaps > 100);
        let tolerance = if form == Form::Window { 0.5 } else { 1e-4 };
        if let Some(apart) = timing.from_all_pairs {
            assert!(apart < tolerance, "{}: {apart}", form.name());
        }
    }
}
