//! Fields read before they are wanted: which, how many, when not, and what that is worth.

use std::num::NonZeroUsize;
use std::time::{Duration, Instant};

use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use render::Backend;
use render_worker::Limits;
use render_worker::desk::Order;
use storage::Store;

use crate::device;
use crate::here::Here;
use crate::scenes::{FIVE_DEGREES, globe, job, tile};
use crate::stored::product;
use crate::worker::{USUAL, Worker, fleet, until};

const MONTHS: u32 = 8;
const QUARTER_DEGREE: Grid = Grid {
    rows: 720,
    cols: 1440,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 0.25,
    dlon_deg: 0.25,
};

/// Months of values that differ, with gaps.
async fn months(store: &Store, name: &str, grid: Grid) -> Manifest {
    let month = |month: u32| -> Vec<f32> {
        let cells = 0..grid.cell_count() as u32;
        let value = |cell: u32| {
            let is_gap = (cell / 7 + month * 3).is_multiple_of(5);
            if is_gap {
                f32::NAN
            } else {
                (cell % 97) as f32 * 1e-11 * month as f32
            }
        };
        cells.map(value).collect()
    };
    let values: Vec<_> = (1..=MONTHS).map(month).collect();
    product(store, name, Quantity::CarbonFlux, grid, &values).await
}

fn limits(fields_ahead: usize) -> Limits {
    Limits {
        draws_at_once: Some(NonZeroUsize::MIN),
        fields_ahead,
        ..Limits::default()
    }
}

fn map_at(product: &Manifest, time: &str, view: View) -> RenderJob {
    let style = job(Mode::Map, view).style;
    RenderJob::of(product, None, time.parse().unwrap(), Mode::Map, view, style).unwrap()
}

fn small() -> View {
    globe(0.0, 0.0, 2e7, 64)
}

#[tokio::test(flavor = "multi_thread")]
async fn the_fields_around_are_read_ahead_and_the_next_picture_finds_its_own() {
    let store = Store::memory();
    let flux = months(&store, "flux", FIVE_DEGREES).await;
    let service = Here::with_limits(store, Backend::Cpu, limits(1));
    let draw = async |time: &str| {
        let job = map_at(&flux, time, small());
        service.draw(&job).await.unwrap();
    };
    draw("2000-04-20").await;
    assert_eq!(service.kept().field_misses, 2);
    // Nobody knows yet which way time runs: one on either side.
    until("both neighbours", || service.kept().early_reads == 2).await;
    draw("2000-05-20").await;
    let kept = service.kept();
    assert_eq!((kept.field_misses, kept.early_hits), (2, 1));
    // Forward: July, and nothing behind.
    until("the next month", || service.kept().early_reads == 3).await;
    draw("2000-06-20").await;
    until("the month after", || service.kept().early_reads == 4).await;
    let kept = service.kept();
    assert_eq!((kept.field_misses, kept.early_hits), (2, 2));
    // Backward: what lies behind was drawn or read before, but February.
    draw("2000-05-20").await;
    draw("2000-04-20").await;
    draw("2000-03-20").await;
    until("February", || service.kept().early_reads == 5).await;
    let kept = service.kept();
    assert_eq!((kept.field_misses, kept.early_hits), (2, 3));
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_read_ahead_and_used_is_in_the_metrics() {
    let store = Store::memory();
    let flux = months(&store, "flux", FIVE_DEGREES).await;
    let worker = Worker::start(&store, 2, 8);
    let fleet = fleet(&[&worker.name]).await;
    let count = |worker: &Worker, outcome| {
        let name = "fluxglobe_render_worker_prefetch_frames_total";
        worker.metric(name, &[("outcome", outcome)])
    };
    for (time, read, used) in [("2000-04-20", 2, 0), ("2000-05-20", 3, 1)] {
        let job = map_at(&flux, time, small());
        fleet
            .draw(&job, Order::on_demand(USUAL), "t")
            .await
            .unwrap();
        worker
            .until(time, |worker| count(worker, "read") == read)
            .await;
        assert_eq!(count(&worker, "used"), used, "{time}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_read_ahead_where_that_is_off_or_fields_would_push_one_another_out() {
    let store = Store::memory();
    let flux = months(&store, "flux", FIVE_DEGREES).await;
    let field_bytes = FIVE_DEGREES.cell_count() as u64 * 8;
    let tight = Limits {
        field_bytes: 4 * field_bytes,
        ..limits(1)
    };
    for limits in [limits(0), tight] {
        let service = Here::with_limits(store.clone(), Backend::Cpu, limits);
        for (time, misses) in [("2000-04-20", 2), ("2000-05-20", 3), ("2000-06-20", 4)] {
            let job = map_at(&flux, time, small());
            service.draw(&job).await.unwrap();
            let kept = service.kept();
            assert_eq!((kept.field_misses, kept.early_reads), (misses, 0), "{time}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn reading_ahead_ends_when_the_view_moves_to_another_product() {
    let store = Store::memory();
    let large = months(&store, "large", QUARTER_DEGREE).await;
    let other = months(&store, "other", FIVE_DEGREES).await;
    let service = Here::with_limits(store, Backend::Cpu, limits(8));
    let job = map_at(&large, "2000-04-20", small());
    service.draw(&job).await.unwrap();
    let job = map_at(&other, "2000-04-20", small());
    service.draw(&job).await.unwrap();
    // Six fields of a million cells are not read in the time that a small map takes.
    until("the end", || service.kept().early_cancelled == 1).await;
    until("fields of the other", || service.kept().early_reads >= 6).await;
    let job = map_at(&other, "2000-05-20", small());
    service.draw(&job).await.unwrap();
    assert_eq!(service.kept().early_hits, 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn fields_read_ahead_lie_on_the_device_before_they_are_drawn() {
    if !device::is_wanted("fields on the device") {
        return;
    }
    let store = Store::memory();
    let flux = months(&store, "flux", FIVE_DEGREES).await;
    let service = Here::with_limits(store, Backend::Gpu, limits(1));
    let draw = async |time: &str| {
        // A plain map tile would need no device on a processor.
        let job = map_at(&flux, time, small());
        service.draw(&job).await.unwrap()
    };
    let bytes = || service.renderer().resident_bytes();
    let field_bytes = FIVE_DEGREES.cell_count() as u64 * 4;
    draw("2000-04-20").await;
    // The domain, the fields of the instant and those on either side.
    until("four fields", || bytes() == 5 * field_bytes).await;
    draw("2000-05-20").await;
    until("one more", || bytes() == 6 * field_bytes).await;
}

/// Prints what docs/performance.md tells.
#[tokio::test(flavor = "multi_thread")]
async fn the_first_picture_of_a_step_waits_for_its_drawing_alone() {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let flux = months(&store, "flux", QUARTER_DEGREE).await;
    let backend = if device::is_wanted("first pictures") {
        Backend::Gpu
    } else {
        Backend::Cpu
    };
    for (fields_ahead, misses) in [(0, 1), (1, 0)] {
        let limits = limits(fields_ahead);
        let service = Here::with_limits(store.clone(), backend.clone(), limits);
        let timed = async |time: &str| -> Duration {
            let job = map_at(&flux, time, tile(3, 1, 3, 256));
            let begun = Instant::now();
            service.draw(&job).await.unwrap();
            begun.elapsed()
        };
        timed("2000-02-20").await;
        let (mut first, mut second) = (vec![], vec![]);
        for (month, early) in (3..8).zip(2..) {
            if fields_ahead > 0 {
                until("the field ahead", || service.kept().early_reads >= early).await;
            }
            let before = service.kept().field_misses;
            first.push(timed(&format!("2000-{month:02}-20")).await);
            assert_eq!(service.kept().field_misses - before, misses, "{month}");
            second.push(timed(&format!("2000-{month:02}-21")).await);
        }
        let median_ms = |times: &mut Vec<Duration>| {
            times.sort_unstable();
            times[times.len() / 2].as_secs_f64() * 1e3
        };
        println!(
            "{fields_ahead} ahead on {}: first picture of a step {:.1} ms, second {:.1} ms",
            service.name(),
            median_ms(&mut first),
            median_ms(&mut second)
        );
    }
}
