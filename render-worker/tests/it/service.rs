//! The service over a store in memory: manifests and fields in, PNG out.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use contract::context::Relief;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob};
use contract::quantity::Quantity;
use render::stages::layout::is_missing;
use render::{Backend, RenderError, Renderer, pyramid};
use render_worker::{DrawError, Limits, Source};
use storage::Store;
use storage::domain::Cells;

use crate::here::Here;
use crate::scenes::{FIVE_DEGREES, ONE_DEGREE};
use crate::stored::{at, product, quick, two_months, two_months_in};

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
    let store = Store::memory();
    let (flux, carbon) = two_months(&store).await;
    let service = Here::new(store, Backend::Cpu);
    for mode in Mode::SCALAR {
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
                ..at(&flux, &carbon, time)
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
    let store = Store::memory();
    let (flux, carbon) = two_months(&store).await;
    let service = Here::new(store, Backend::Cpu);
    // Row 20 (10 S to 15 S), columns 0 to 5: seen on the tile south of the equator at the date line.
    let late = at(&flux, &carbon, "2000-03-01");
    let alpha = alpha(&service.draw(&late).await.unwrap());
    let (x, y) = (10, 18);
    assert!(alpha[y * 256 + x] > 200, "a map where the cloud was");
}

#[tokio::test]
async fn a_stored_relief_on_a_grid_of_its_own_lies_below_the_picture() {
    let store = Store::memory();
    let (flux, carbon) = two_months(&store).await;
    let heights = vec![-3000.0; ONE_DEGREE.cell_count()];
    let relief = product(
        &store,
        "relief",
        Quantity::Elevation,
        ONE_DEGREE,
        &[heights],
    )
    .await;
    let relief = Relief::of(&relief, 15.0).unwrap();
    let service = Here::new(store, Backend::Cpu);
    let plain = at(&flux, &carbon, "2000-01-30");
    let job = plain.clone().over(Some(relief.clone())).unwrap();
    let png = service.draw(&job).await.unwrap();
    assert!(alpha(&png).iter().all(|alpha| *alpha == 255));
    assert!(alpha(&service.draw(&plain).await.unwrap()).contains(&0));
    // Of the grid of a relief nobody is believed either, whether its field is in memory or not.
    let mut wrong = relief.clone();
    (wrong.grid.rows, wrong.grid.cols) = (90, 180);
    (wrong.grid.dlat_deg, wrong.grid.dlon_deg) = (2.0, 2.0);
    let mut unknown = relief;
    unknown.field = "frames/relief/nothing".parse().unwrap();
    for (relief, is_unknown) in [(wrong, false), (unknown, true)] {
        let job = plain.clone().over(Some(relief)).unwrap();
        let refused = service.draw(&job).await.unwrap_err();
        assert_eq!(refused.is_not_found(), is_unknown, "{refused}");
    }
    let refused = Relief::of(&flux, 15.0).unwrap_err().to_string();
    assert!(refused.contains("a product of elevation"), "{refused}");
}

#[tokio::test]
async fn jobs_that_name_what_is_not_there_are_refused() {
    let store = Store::memory();
    let (flux, carbon) = two_months(&store).await;
    let job = at(&flux, &carbon, "2000-01-30");
    let other = Grid {
        rows: 1,
        cols: 2,
        ..FIVE_DEGREES
    };
    let small = product(
        &store,
        "small-accumulated",
        Quantity::AccumulatedCarbon,
        other,
        &[vec![1.0, 2.0]],
    )
    .await;
    // A few bytes that stand for 2^31 cells.
    let none = Cells::none(1 << 31);
    let vast = storage::domain::write_cells(&store, &flux.product, none).await;
    let service = Here::new(store, Backend::Cpu);
    let mut unknown = job.clone();
    unknown.value.domain = "domain/nothing/0".parse().unwrap();
    let refused = service.draw(&unknown).await.unwrap_err();
    assert!(refused.is_not_found(), "{refused}");
    // Nothing that a job says of its grid makes anybody lay out more than is stored.
    let mut mismatched = job.clone();
    mismatched.accumulated = small.time_sample("2000-01-30".parse().unwrap());
    let mut wider = job.clone();
    (wider.grid.rows, wider.grid.dlat_deg) = (1 << 20, 1e-4);
    let mut of_many = job.clone();
    of_many.value.domain = vast.unwrap();
    for wrong in [mismatched, wider, of_many] {
        let refused = service.draw(&wrong).await.unwrap_err();
        let expected = matches!(
            *refused,
            DrawError::Render(RenderError::GridMismatch { .. })
        );
        assert!(expected, "{refused}");
    }
    let (time, view, style) = ("2000-01-30".parse().unwrap(), job.view, job.style);
    let quarrel = RenderJob::of(&flux, Some(&small), time, Mode::Volume, view, style).unwrap_err();
    assert!(quarrel.to_string().contains("grid of flux"), "{quarrel}");
    let mut refused = job;
    refused.style.slices = 0;
    assert!(service.draw(&refused).await.unwrap_err().is_bad_request());
}

#[tokio::test]
async fn many_tasks_draw_at_the_same_time_and_agree_with_one_after_the_other() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let service = Here::new(store, Backend::Cpu);
    // Equal jobs would be one.
    let jobs: Vec<RenderJob> = (0..8).map(|number| quick(&job, number)).collect();
    let draw = |job: &RenderJob| {
        let (service, job) = (service.clone(), job.clone());
        tokio::spawn(async move { service.draw(&job).await.unwrap() })
    };
    let tasks: Vec<_> = jobs.iter().map(draw).collect();
    for (task, job) in tasks.into_iter().zip(&jobs) {
        assert_eq!(task.await.unwrap(), service.draw(job).await.unwrap());
    }
}

/// Somebody's turn to draw, who looks at what is being encoded when it is let go.
struct Turn {
    service: Here,
    encoding: Arc<AtomicUsize>,
}

impl Drop for Turn {
    fn drop(&mut self) {
        let count = self.service.encoding_count();
        self.encoding.store(count, Ordering::SeqCst);
    }
}

#[tokio::test]
async fn a_turn_to_draw_is_over_when_encoding_begins_and_not_before_it_has_a_core() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let limits = Limits {
        draws_at_once: Some(NonZeroUsize::MIN),
        ..Limits::default()
    };
    let service = Here::with_limits(store, Backend::Cpu, limits);
    assert_eq!(service.desk.draws_at_once(), NonZeroUsize::MIN);
    let encoding = Arc::new(AtomicUsize::new(usize::MAX));
    let turn = Turn {
        service: service.clone(),
        encoding: Arc::clone(&encoding),
    };
    let png = service.draw_in_turn(&job, turn).await.unwrap();
    // None was encoded if it was let go after that or before a core was taken.
    assert_eq!(encoding.load(Ordering::SeqCst), 1);
    assert_eq!(service.encoding_count(), 0);
    assert_eq!(png, service.draw(&job).await.unwrap());
}

#[test]
fn as_many_pictures_are_drawn_at_once_as_suit_what_draws_unless_it_is_said() {
    let service = Here::new(Store::memory(), Backend::Cpu);
    assert_eq!(
        service.desk.draws_at_once(),
        service.renderer().draws_at_once()
    );
}

#[tokio::test]
async fn a_landing_leaves_pictures_that_it_does_not_touch_their_name_and_their_bytes() {
    let store = Store::memory();
    let (flux, carbon) = two_months(&store).await;
    let mut longer = flux.clone();
    longer.number += 1;
    longer.steps.push(contract::manifest::Step {
        period: contract::time::Period::month(2000, 3).unwrap(),
        ..flux.steps[0].clone()
    });
    assert_ne!(longer.id(), flux.id());
    let service = Here::new(store, Backend::Cpu);
    let middle = "2000-02-15T12:00:00Z";
    for time in ["2000-01-30", middle] {
        let (old, new) = (at(&flux, &carbon, time), at(&longer, &carbon, time));
        assert_eq!(old.key(), new.key(), "{time}");
    }
    // After the middle of what was the last month the new one shows.
    let (old, new) = (
        at(&flux, &carbon, "2000-02-25"),
        at(&longer, &carbon, "2000-02-25"),
    );
    assert_ne!(old.key(), new.key());
    let (old, new) = (service.draw(&old).await, service.draw(&new).await);
    assert_ne!(old.unwrap(), new.unwrap());
}

#[tokio::test]
async fn fields_of_a_product_come_filled_with_the_errors_beside_them() {
    let store = Store::memory();
    // The second month has a cloud over row 20, columns 0 to 5.
    let job = two_months_in(&store).await;
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let source = Source::new(store, Arc::new(renderer), u64::MAX);
    let scene = source.scene(&job).await.unwrap();
    assert!(scene.value.before.errors.is_none() && scene.value.before.largest_error == 0.0);
    let after = &scene.value.after;
    let errors = after.errors.as_ref().unwrap().content();
    let cloud = 20 * 72..20 * 72 + 6;
    for (cell, error) in errors.iter().enumerate() {
        let (is_land, is_cloud) = (scene.domain.content()[cell] == 0, cloud.contains(&cell));
        assert_eq!(is_missing(*error), is_land, "cell {cell}");
        assert_eq!(*error > 0.0, is_cloud, "cell {cell}: {error}");
        assert!(*error <= after.largest_error);
    }
    // Blocks of four cells: rows 20 and 21, the first four columns; half of their cells were measured.
    let coarser = pyramid::coarser(&scene).unwrap();
    let error = coarser.value.after.errors.as_ref().unwrap().content()[10 * 36];
    let [north_m2, south_m2] =
        [20, 21].map(|row| scene.grid.cell_area_m2(row, Earth::Wgs84) as f32);
    let expected =
        (errors[20 * 72] + errors[20 * 72 + 1]) * north_m2 / (2.0 * (north_m2 + south_m2));
    assert!((error / expected - 1.0).abs() < 1e-5, "{error} {expected}");
    assert!(coarser.value.before.errors.is_none());
}

#[tokio::test]
async fn two_fields_that_each_fill_more_than_half_of_the_room_are_kept() {
    let store = Store::memory();
    // The second month has gaps: its errors make it twice as large as the first.
    let job = RenderJob {
        accumulated: None,
        ..two_months_in(&store).await
    };
    let whole_bytes = FIVE_DEGREES.cell_count() as u64 * 8;
    let renderer = Arc::new(Renderer::new(Backend::Cpu).unwrap());
    for (most_bytes, misses, kept_bytes) in [
        (whole_bytes, 2, whole_bytes * 3 / 2),
        (whole_bytes * 3 / 4, 3, whole_bytes / 2),
    ] {
        let source = Source::new(store.clone(), Arc::clone(&renderer), most_bytes);
        for _ in 0..2 {
            source.scene(&job).await.unwrap();
        }
        let kept = source.kept();
        assert_eq!(
            (kept.field_misses, kept.field_bytes),
            (misses, kept_bytes),
            "{most_bytes}"
        );
    }
}
