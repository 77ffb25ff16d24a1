//! Pictures of grids above a limit, which are drawn from windows of their levels, beside those of whole fields.

use std::sync::Arc;

use contract::grid::Grid;
use contract::job::{Mode, RenderJob, View};
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::tile::Tile;
use render::{Backend, Image, Renderer};
use render_worker::Source;
use storage::Store;

use crate::scenes::{globe, job, tile};
use crate::stored::product;

/// Steps of a power of two, so that places are the same numbers in any window; from the meridian of Greenwich on, so that tiles cross
/// the edge of the grid.
pub(crate) const GRID: Grid = Grid {
    rows: 1440,
    cols: 2880,
    north_deg: 90.0,
    west_deg: 0.0,
    dlat_deg: 0.125,
    dlon_deg: 0.125,
};
/// Fewer cells than it has.
pub(crate) const LIMIT: u64 = 100_000;

/// Values of a month: smooth, with land, and in one month with a cloud.
pub(crate) fn values(scale: f32, month: usize, has_cloud: bool) -> Vec<f32> {
    let value = |cell: usize| {
        let (row, col) = (cell / 2880, cell % 2880);
        let is_land = (600..900).contains(&col) && (200..1100).contains(&row) || row > 1300;
        // Over 10 degrees a side, and a strip that tiles of the first zoom share.
        let is_cloud = (380..460).contains(&row) && (1300..1380).contains(&col)
            || (700..740).contains(&row) && (1390..1500).contains(&col);
        if is_land || (has_cloud && is_cloud) {
            return f32::NAN;
        }
        let wave = (row as f32 * 0.011).sin() + (col as f32 * 0.0065 + month as f32).cos();
        scale * wave
    };
    (0..GRID.cell_count()).map(value).collect()
}

struct Ocean {
    store: Store,
    flux: Manifest,
    carbon: Manifest,
}

/// Two months of a flux and what they accumulate; with cubes or without.
async fn ocean(has_cloud: bool, has_cubes: bool) -> Ocean {
    let store = Store::memory();
    let months = [values(2e-9, 0, false), values(2e-9, 1, has_cloud)];
    let flux = product(&store, "flux", Quantity::CarbonFlux, GRID, &months).await;
    let sums = [values(0.01, 0, false), values(0.02, 1, has_cloud)];
    let quantity = Quantity::AccumulatedCarbon;
    let carbon = product(&store, "flux-accumulated", quantity, GRID, &sums).await;
    if has_cubes {
        for manifest in [&flux, &carbon] {
            cube::follow(&store, manifest).await.unwrap();
        }
    }
    Ocean {
        store,
        flux,
        carbon,
    }
}

impl Ocean {
    fn job(&self, mode: Mode, view: View) -> RenderJob {
        let style = job(mode, view).style;
        let time = "2000-01-30".parse().unwrap();
        let carbon = Some(&self.carbon);
        RenderJob::of(&self.flux, carbon, time, mode, view, style).unwrap()
    }

    fn source(&self, renderer: &Arc<Renderer>, most_whole_cells: u64) -> Source {
        let source = Source::new(self.store.clone(), Arc::clone(renderer), 1 << 30);
        source.holding_whole(most_whole_cells)
    }
}

async fn drawn(source: &Source, renderer: &Renderer, job: &RenderJob) -> Image {
    let scene = source.scene(job).await.unwrap();
    renderer.render(job, &scene).unwrap()
}

/// Mean of the differences of all codes, the largest one, and the mean of either picture.
fn apart(one: &Image, other: &Image) -> (f64, u8, [f64; 2]) {
    assert_eq!(one.rgba8.len(), other.rgba8.len());
    let pairs = one.rgba8.iter().zip(&other.rgba8);
    let differences: Vec<u8> = pairs.map(|(a, b)| a.abs_diff(*b)).collect();
    let mean = |bytes: &[u8]| {
        let sum: f64 = bytes.iter().map(|byte| f64::from(*byte)).sum();
        sum / bytes.len() as f64
    };
    let most = differences.iter().copied().max().unwrap_or(0);
    (
        mean(&differences),
        most,
        [mean(&one.rgba8), mean(&other.rgba8)],
    )
}

fn is_empty(image: &Image) -> bool {
    let first = &image.rgba8[..4];
    image.rgba8.chunks_exact(4).all(|pixel| pixel == first)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_window_of_the_grid_itself_is_drawn_as_the_whole_field_is() {
    let ocean = ocean(false, true).await;
    let renderer = Arc::new(Renderer::new(Backend::Cpu).unwrap());
    let whole = ocean.source(&renderer, u64::MAX);
    let windows = ocean.source(&renderer, LIMIT);
    // Cells of 0.7 pixels, over the meridian where the grid begins, and along a coast.
    for (mode, view) in [
        (Mode::Map, tile(3, 3, 3, 256)),
        (Mode::Map, tile(3, 4, 3, 256)),
        (Mode::Volume, tile(3, 3, 3, 256)),
        (Mode::Volume, tile(3, 5, 2, 256)),
        (Mode::Points, tile(3, 4, 4, 256)),
        (Mode::Map, globe(0.0, 36.0, 2e6, 128)),
    ] {
        let job = ocean.job(mode, view);
        let scene = windows.scene(&job).await.unwrap();
        assert!(scene.grid.cell_count() < GRID.cell_count() / 8, "{view:?}");
        let own = renderer.render(&job, &scene).unwrap();
        let wanted = drawn(&whole, &renderer, &job).await;
        assert!(!is_empty(&wanted), "{mode} {view:?}");
        let (mean, most, _) = apart(&own, &wanted);
        println!("{mode} {view:?}: {mean} {most}");
        if matches!(view, View::Tile { .. }) {
            assert!(own.rgba8 == wanted.rgba8, "{mode} {view:?}: {mean} {most}");
        }
        // Places of a globe view are in single precision, from the window's edge.
        assert!(mean < 0.02 && most <= 2, "{mode} {view:?}: {mean} {most}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_level_is_drawn_as_bright_as_the_field_that_it_is_of() {
    for has_cloud in [false, true] {
        let ocean = ocean(has_cloud, true).await;
        let renderer = Arc::new(Renderer::new(Backend::Cpu).unwrap());
        let whole = ocean.source(&renderer, u64::MAX);
        let windows = ocean.source(&renderer, LIMIT);
        for (mode, view) in [
            (Mode::Map, tile(1, 0, 0, 256)),
            (Mode::Map, tile(1, 1, 0, 256)),
            (Mode::Volume, tile(1, 1, 0, 256)),
            (Mode::Volume, globe(20.0, 30.0, 1e7, 128)),
        ] {
            let job = ocean.job(mode, view);
            let scene = windows.scene(&job).await.unwrap();
            assert!(scene.grid.cell_count() < GRID.cell_count() / 12, "{view:?}");
            let is_tile = matches!(view, View::Tile { .. });
            assert!(!is_tile || (scene.grid.dlon_deg - 0.5).abs() < 1e-12);
            let own = renderer.render(&job, &scene).unwrap();
            let wanted = drawn(&whole, &renderer, &job).await;
            assert!(!is_empty(&wanted), "{mode} {view:?}");
            let (mean, most, means) = apart(&own, &wanted);
            println!("{mode} {view:?} cloud {has_cloud}: {mean} {most} {means:?}");
            // Values are rounded to 2^-16, and a colour is a step of 1/255; only around clouds is filled in otherwise.
            let tolerance = if has_cloud { 0.5 } else { 0.05 };
            assert!(mean < tolerance, "{mode} {view:?}: {mean} {most}");
            assert!((means[0] / means[1] - 1.0).abs() < 2e-3, "{means:?}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn four_windows_beside_one_another_are_one_large_one() {
    let ocean = ocean(true, true).await;
    let renderer = Arc::new(Renderer::new(Backend::Cpu).unwrap());
    let windows = ocean.source(&renderer, LIMIT);
    // At the zoom of levels and of the grid itself; the first cloud, and the one on the edge of two tiles, are in them.
    for (mode, z, x, y) in [
        (Mode::Map, 0, 0, 0),
        (Mode::Volume, 0, 0, 0),
        (Mode::Map, 2, 0, 1),
        (Mode::Volume, 2, 3, 1),
    ] {
        let large = ocean.job(mode, tile(z, x, y, 512));
        let large = drawn(&windows, &renderer, &large).await;
        for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let part = View::Tile {
                tile: Tile {
                    z: z + 1,
                    x: 2 * x + right,
                    y: 2 * y + down,
                },
                size_px: 256,
            };
            let small = drawn(&windows, &renderer, &ocean.job(mode, part)).await;
            for row in 0..256 {
                let from = ((down as usize * 256 + row) * 512 + right as usize * 256) * 4;
                let (own, wanted) = (
                    &small.rgba8[row * 1024..(row + 1) * 1024],
                    &large.rgba8[from..from + 1024],
                );
                assert!(own == wanted, "{mode} {z} part {right} {down}: row {row}");
            }
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn without_a_cube_levels_are_made_of_the_fields_and_the_picture_is_the_same() {
    let (with, without) = (ocean(true, true).await, ocean(true, false).await);
    let renderer = Arc::new(Renderer::new(Backend::Cpu).unwrap());
    for (mode, view) in [
        (Mode::Map, tile(1, 1, 0, 256)),
        (Mode::Volume, tile(3, 4, 2, 256)),
    ] {
        let [one, other] = [&with, &without].map(|ocean| ocean.source(&renderer, LIMIT));
        let one = drawn(&one, &renderer, &with.job(mode, view)).await;
        let other = drawn(&other, &renderer, &without.job(mode, view)).await;
        assert!(one.rgba8 == other.rgba8, "{mode} {view:?}");
        assert!(!is_empty(&one));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_window_reads_little_of_a_field_and_a_damaged_chunk_of_it_is_told() {
    let ocean = ocean(false, true).await;
    let renderer = Arc::new(Renderer::new(Backend::Cpu).unwrap());
    let job = ocean.job(Mode::Map, tile(5, 20, 9, 256));
    let (store, traffic) = ocean.store.counted();
    let source = Source::new(store, Arc::clone(&renderer), 1 << 30).holding_whole(LIMIT);
    source.scene(&job).await.unwrap();
    let field = job.value.before.clone().unwrap();
    let field_bytes = ocean.store.size_bytes(&field).await.unwrap();
    let domain_bytes = ocean.store.size_bytes(&job.value.domain).await.unwrap();
    let map_bytes = GRID.cell_count() as u64;
    let read = traffic.counts();
    // Two fields and two sums of one chunk of 18, and what names them.
    assert!(
        read.read_bytes < domain_bytes + map_bytes + field_bytes,
        "{read:?} of {field_bytes}"
    );
    let mut told = 0;
    for key in ocean.store.list("cubes/flux/chunks").await.unwrap() {
        let content = ocean.store.get(&key).await.unwrap();
        let mut flipped = content.to_vec();
        flipped[content.len() / 2] ^= 8;
        ocean.store.put_over(&key, flipped.into()).await.unwrap();
        let fresh = ocean.store.counted().0;
        let source = Source::new(fresh, Arc::clone(&renderer), 1 << 30).holding_whole(LIMIT);
        if let Err(error) = source.scene(&job).await {
            let text = error.in_full();
            let of_values = text.contains("carbon_flux") && text.contains(key.as_str());
            assert!(of_values || text.contains("chunk"), "{text}");
            assert!(error.is_final() && !error.is_retryable());
            told += u32::from(of_values);
        }
        ocean.store.put_over(&key, content).await.unwrap();
    }
    assert!(
        (2..=8).contains(&told),
        "a chunk or some of each month: {told}"
    );
}
