//! The service over a store in memory: manifests and frames in, PNG out.

use contract::digest::Digest;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob};
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::quantity::Quantity;
use contract::time::Period;
use render_worker::{Backend, RenderError, RenderService};
use storage::Store;

use crate::scenes::{FIVE_DEGREES, job, ocean, tile};

/// Stores a product of these monthly values.
async fn stored(
    store: &Store,
    name: &str,
    quantity: Quantity,
    grid: Grid,
    months: &[Vec<f32>],
) -> Manifest {
    let product = name.parse().unwrap();
    let mut steps = vec![];
    let mut domain = vec![false; grid.cell_count()];
    for (month, values) in (1..).zip(months) {
        let period = Period::month(2000, month).unwrap();
        let frame = storage::frames::write(store, &product, &grid, values, period)
            .await
            .unwrap();
        for (cell, value) in domain.iter_mut().zip(values) {
            *cell |= value.is_finite();
        }
        steps.push(Step {
            period,
            frame,
            raw_sha256: Digest::of(b""),
            origin: "made up".into(),
            valid_cells: 1,
        });
    }
    let domain = storage::domain::write(store, &product, &domain)
        .await
        .unwrap();
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        product,
        number: 1,
        title: name.into(),
        quantity,
        synthetic: true,
        source: String::new(),
        grid,
        steps,
        domain,
        series: vec![],
        derived_from: None,
    };
    storage::manifests::commit(store, &manifest).await.unwrap();
    manifest
}

fn values(frame: &render_worker::Frame) -> Vec<f32> {
    frame
        .cells
        .content()
        .iter()
        .map(|value| if *value < -1e29 { f32::NAN } else { *value })
        .collect()
}

struct Stored {
    store: Store,
    job: RenderJob,
}

async fn two_months() -> Stored {
    let store = Store::memory();
    let scene = ocean(FIVE_DEGREES);
    let carbon = scene.accumulated.unwrap();
    let mut after = values(&scene.value.after);
    // A cloud over the second month: gaps to fill.
    after[20 * 72..20 * 72 + 6].fill(f32::NAN);
    let flux = stored(
        &store,
        "flux",
        Quantity::CarbonFlux,
        FIVE_DEGREES,
        &[values(&scene.value.before), after],
    )
    .await;
    let carbon = [values(&carbon.before), values(&carbon.after)];
    let carbon = stored(
        &store,
        "flux-accumulated",
        Quantity::AccumulatedCarbon,
        FIVE_DEGREES,
        &carbon,
    )
    .await;
    let mut job = job(Mode::Map, tile(1, 0, 1, 256));
    (job.product, job.accumulated) = (flux.id(), Some(carbon.id()));
    job.time = "2000-01-30".parse().unwrap();
    Stored { store, job }
}

fn alpha(png: &[u8]) -> Vec<u8> {
    image::load_from_memory(png)
        .unwrap()
        .into_rgba8()
        .pixels()
        .map(|pixel| pixel.0[3])
        .collect()
}

#[tokio::test]
async fn a_stored_product_is_drawn_at_any_instant_in_every_mode() {
    let Stored { store, job } = two_months().await;
    let service = RenderService::new(store, Backend::Cpu).unwrap();
    for mode in Mode::ALL {
        let mut pictures = vec![];
        for time in [
            "1990-01-01",
            "2000-01-01T06:00:00Z",
            "2000-01-30",
            "2000-02-14",
            "2010-01-01",
        ] {
            let job = RenderJob {
                mode,
                time: time.parse().unwrap(),
                ..job.clone()
            };
            let png = service.draw(&job).await.unwrap();
            assert!(
                alpha(&png).iter().any(|alpha| *alpha > 100),
                "{mode} {time}"
            );
            assert_eq!(png, service.draw(&job).await.unwrap(), "{mode} {time}");
            pictures.push(png);
        }
        assert_ne!(pictures[1], pictures[2], "{mode}: time changes the picture");
        assert_ne!(pictures[2], pictures[3], "{mode}: time changes the picture");
    }
}

#[tokio::test]
async fn gaps_of_the_domain_are_filled_before_anything_is_drawn() {
    let Stored { store, job } = two_months().await;
    let service = RenderService::new(store, Backend::Cpu).unwrap();
    // Row 20 (10 S to 15 S), columns 0 to 5: seen on the tile south of the equator at the date line.
    let late = RenderJob {
        time: "2000-03-01".parse().unwrap(),
        ..job
    };
    let alpha = alpha(&service.draw(&late).await.unwrap());
    let (x, y) = (10, 18);
    assert!(alpha[y * 256 + x] > 200, "a map where the cloud was");
}

#[tokio::test]
async fn jobs_that_name_what_is_not_there_are_refused() {
    let Stored { store, job } = two_months().await;
    let other = Grid {
        rows: 1,
        cols: 2,
        ..FIVE_DEGREES
    };
    let small = stored(
        &store,
        "small-accumulated",
        Quantity::AccumulatedCarbon,
        other,
        &[vec![1.0, 2.0]],
    )
    .await;
    let service = RenderService::new(store, Backend::Cpu).unwrap();
    let unknown = RenderJob {
        product: "nothing@3-00000000".parse().unwrap(),
        ..job.clone()
    };
    let refused = service.draw(&unknown).await.unwrap_err();
    assert!(
        matches!(refused, RenderError::Store { .. }) && refused.to_string().contains("nothing"),
        "{refused}"
    );
    let mismatched = RenderJob {
        accumulated: Some(small.id()),
        ..job.clone()
    };
    assert!(matches!(
        service.draw(&mismatched).await,
        Err(RenderError::GridMismatch { .. })
    ));
    let mut refused = job;
    refused.style.slices = 0;
    assert!(service.draw(&refused).await.unwrap_err().is_bad_request());
}

#[tokio::test]
async fn many_tasks_draw_at_the_same_time_and_agree() {
    let Stored { store, job } = two_months().await;
    let service = RenderService::new(store, Backend::Cpu).unwrap();
    let job = RenderJob {
        mode: Mode::Volume,
        ..job
    };
    let draw = || {
        let (service, job) = (service.clone(), job.clone());
        tokio::spawn(async move { service.draw(&job).await.unwrap() })
    };
    let tasks: Vec<_> = (0..8).map(|_| draw()).collect();
    let mut pictures = vec![];
    for task in tasks {
        pictures.push(task.await.unwrap());
    }
    assert!(pictures.windows(2).all(|pair| pair[0] == pair[1]));
}
