//! What scenes of very large grids hold, beside numbers that are worked out from all cells: parts of a vector, masses, ranges, and what
//! is kept from picture to picture.

use std::sync::Arc;

use contract::colour::TransferFunction;
use contract::earth::Earth;
use contract::job::{Mode, RenderJob, Style, View};
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time_sample::Counts;
use render::scene::Scene;
use render::stages::layout::{COVERED, is_missing};
use render::{Backend, Renderer};
use render_worker::Source;
use storage::Store;

use crate::large::{GRID, LIMIT, values};
use crate::scenes::{job, tile};
use crate::stored::product;

const COLS: usize = GRID.cols as usize;
/// In January: what is accumulated is between nothing and the end of it.
const TIME: &str = "2000-01-30";

fn renderer() -> Arc<Renderer> {
    Arc::new(Renderer::new(Backend::Cpu).unwrap())
}

fn windows(store: &Store, renderer: &Arc<Renderer>) -> Source {
    Source::new(store.clone(), Arc::clone(renderer), 1 << 30).holding_whole(LIMIT)
}

fn of(flux: &Manifest, carbon: Option<&Manifest>, mode: Mode, view: View) -> RenderJob {
    let style = job(mode, view).style;
    RenderJob::of(flux, carbon, TIME.parse().unwrap(), mode, view, style).unwrap()
}

/// Row and column of the grid where a window of it begins, and how many cells of it are in one of the window.
fn place(scene: &Scene) -> ([u32; 2], u32) {
    let whole = scene.whole.unwrap();
    let cells = (whole.grid.dlat_deg / GRID.dlat_deg).round() as u32;
    ([whole.row * cells, whole.col * cells], cells)
}

#[tokio::test(flavor = "multi_thread")]
async fn particles_drift_with_both_parts_of_a_vector_from_beyond_the_edges_of_a_picture() {
    let store = Store::memory();
    let quantity = Quantity::Current;
    let of_part = |sign: f32| [values(0.5 * sign, 0, false), values(0.5, 1, false)];
    let east = product(&store, "sea-east", quantity, GRID, &of_part(1.0)).await;
    let north = product(&store, "sea-north", quantity, GRID, &of_part(-1.0)).await;
    for part in [&east, &north] {
        cube::follow(&store, part).await.unwrap();
    }
    let renderer = renderer();
    let view = tile(6, 36, 26, 256);
    let style = Style::of_flow(TransferFunction::of_speed(quantity));
    let job = RenderJob::of_flow(&east, &north, TIME.parse().unwrap(), view, style).unwrap();
    let scene = windows(&store, &renderer).scene(&job).await.unwrap();
    let ([first_row, first_col], cells) = place(&scene);
    assert_eq!(cells, 1);
    let northward = scene.northward.as_ref().unwrap();
    assert!((northward.weight - scene.value.weight).abs() < 1e-12);
    // January of one is that of the other with the other sign.
    let (own, other) = (
        scene.value.before.cells.content(),
        northward.before.cells.content(),
    );
    let (january, window) = (values(0.5, 0, false), scene.grid);
    let mut with_data = 0;
    for (cell, (own, other)) in own.iter().zip(other).enumerate() {
        let (row, col) = (cell / window.cols as usize, cell % window.cols as usize);
        let col = (first_col as usize + col) % COLS;
        let right = january[(first_row as usize + row) * COLS + col];
        if right.is_finite() {
            assert_eq!(
                (own.to_bits(), other.to_bits()),
                (right.to_bits(), (-right).to_bits())
            );
            with_data += 1;
        }
    }
    assert!(with_data > 1000, "{with_data}");
    // A tile of 5.6 degrees of longitude shows 45 cells from the 180th on; particles come from 64 farther away at least.
    let end_col = first_col + window.cols;
    assert!(
        first_col <= 180 - 64 && end_col >= 225 + 64,
        "{first_col} {end_col}"
    );
    let flux = product(&store, "flux", Quantity::CarbonFlux, GRID, &of_part(1e-9)).await;
    let map = of(&flux, None, Mode::Map, view);
    let map = windows(&store, &renderer).scene(&map).await.unwrap();
    let ([_, first_col], _) = place(&map);
    let end_col = first_col + map.grid.cols;
    assert!(
        first_col <= 180 - 4 && end_col >= 225 + 4,
        "{first_col} {end_col}"
    );
    assert!(map.grid.cols < window.cols);
    // And what comes from that far is drawn as it is from all of the fields.
    let whole = windows(&store, &renderer).holding_whole(u64::MAX);
    let whole = whole.scene(&job).await.unwrap();
    let wanted = renderer.render(&job, &whole).unwrap();
    let drawn = renderer.render(&job, &scene).unwrap();
    let pairs = wanted.rgba8.iter().zip(&drawn.rgba8);
    let differ = pairs.filter(|(a, b)| a != b).count();
    assert!(differ * 100 < wanted.rgba8.len(), "{differ}");
}

/// A flux, and sums of carbon above zero that know less of the sea.
async fn ocean(store: &Store) -> [Manifest; 2] {
    let months = [values(2e-9, 0, false), values(2e-9, 1, false)];
    let flux = product(store, "flux", Quantity::CarbonFlux, GRID, &months).await;
    let sum = |month: usize| -> Vec<f32> {
        let all = values(0.01, month, false);
        let is_known = |cell: usize| (cell % COLS) % 9 > 1 && !(cell / COLS).is_multiple_of(5);
        let value = |(cell, value): (usize, f32)| {
            if is_known(cell) {
                value + 0.1
            } else {
                f32::NAN
            }
        };
        all.into_iter().enumerate().map(value).collect()
    };
    let quantity = Quantity::AccumulatedCarbon;
    let sums = [sum(0), sum(1)];
    let carbon = product(store, "flux-accumulated", quantity, GRID, &sums).await;
    for manifest in [&flux, &carbon] {
        cube::follow(store, manifest).await.unwrap();
    }
    [flux, carbon]
}

#[tokio::test(flavor = "multi_thread")]
async fn carbon_of_a_level_keeps_its_mass_where_more_is_drawn_than_it_is_known_of() {
    let store = Store::memory();
    let [flux, carbon] = ocean(&store).await;
    let renderer = renderer();
    let source = windows(&store, &renderer);
    let job = of(&flux, Some(&carbon), Mode::Volume, tile(1, 1, 0, 256));
    let scene = source.scene(&job).await.unwrap();
    let ([first_row, first_col], cells) = place(&scene);
    assert!(cells > 1, "it is a level");
    let sums = storage::fields::read(&store, &carbon.steps[0].field, &GRID)
        .await
        .unwrap();
    let lifted = &scene.accumulated.as_ref().unwrap().after;
    let (window, shares) = (scene.grid, scene.domain.content());
    let (mut compared, mut spread) = (0, 0);
    for (cell, (kg_m2, share)) in lifted.cells.content().iter().zip(shares).enumerate() {
        if is_missing(*kg_m2) || *share == 0 {
            continue;
        }
        let (row, col) = (cell as u32 / window.cols, cell as u32 % window.cols);
        let (mut kg, mut known_m2, mut all_m2) = (0.0, 0.0, 0.0);
        for row in first_row + row * cells..first_row + (row + 1) * cells {
            let area_m2 = GRID.cell_area_m2(row, Earth::Wgs84);
            for col in first_col + col * cells..first_col + (col + 1) * cells {
                let value = sums[row as usize * COLS + col as usize % COLS];
                all_m2 += area_m2;
                if value.is_finite() {
                    kg += f64::from(value) * area_m2;
                    known_m2 += area_m2;
                }
            }
        }
        let drawn_m2 = all_m2 * f64::from(*share) / f64::from(COVERED);
        let drawn_kg = f64::from(*kg_m2) * drawn_m2;
        assert!(
            (drawn_kg / kg - 1.0).abs() < 1e-4,
            "{row} {col}: {drawn_kg} {kg}"
        );
        compared += 1;
        spread += u32::from(known_m2 < 0.9 * drawn_m2);
    }
    assert!(compared > 1000 && spread > 500, "{compared} {spread}");
}

#[tokio::test(flavor = "multi_thread")]
async fn slices_are_laid_out_for_all_sums_from_zero_on_and_uncertainty_of_sums_is_refused() {
    let store = Store::memory();
    let [flux, carbon] = ocean(&store).await;
    let sums = storage::fields::read(&store, &carbon.steps[0].field, &GRID)
        .await
        .unwrap();
    let most = sums.iter().copied().fold(0.0, f32::max);
    let renderer = renderer();
    let source = windows(&store, &renderer);
    // A level, and a window of the grid itself, where sums are smaller.
    for view in [tile(1, 0, 0, 256), tile(4, 2, 5, 256)] {
        let job = of(&flux, Some(&carbon), Mode::Volume, view);
        let scene = source.scene(&job).await.unwrap();
        let lifted = scene.accumulated.unwrap();
        assert_eq!(
            lifted.range().map(f32::to_bits),
            [0.0, most].map(f32::to_bits),
            "{view:?}"
        );
        let least = lifted
            .after
            .cells
            .content()
            .iter()
            .copied()
            .filter(|own| !is_missing(*own));
        assert!(least.fold(f32::MAX, f32::min) > 0.0);
        let mut lacking = job;
        lacking.accumulated.as_mut().unwrap().contributed = Some(Counts::default());
        let error = source.scene(&lacking).await.unwrap_err().in_full();
        assert!(error.contains("leave uncertainty out"), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn gaps_are_those_of_the_version_that_is_drawn_whatever_was_drawn_before() {
    let store = Store::memory();
    let clouded = [values(2e-9, 0, false), values(2e-9, 1, true)];
    let first = product(&store, "flux", Quantity::CarbonFlux, GRID, &clouded).await;
    // A month in which there is data where there was none before: gaps of the other months.
    let mut more = clouded.to_vec();
    more.push(vec![1e-9; GRID.cell_count()]);
    let second = product(&store, "flux-more", Quantity::CarbonFlux, GRID, &more).await;
    let renderer = renderer();
    let time = "2000-02-15T12:00:00Z";
    let job = |manifest: &Manifest| {
        let view = tile(2, 3, 1, 256);
        let style = crate::scenes::job(Mode::Map, view).style;
        RenderJob::of(
            manifest,
            None,
            time.parse().unwrap(),
            Mode::Map,
            view,
            style,
        )
        .unwrap()
    };
    let (before, mut now) = (job(&first), job(&second));
    // The same field: values are named by themselves.
    now.value.before.clone_from(&before.value.before);
    now.value.after.clone_from(&before.value.after);
    let cells = async |source: &Source, job: &RenderJob| {
        let scene = source.scene(job).await.unwrap();
        let content = scene.value.before.cells.content();
        content
            .iter()
            .map(|value| value.to_bits())
            .collect::<Vec<u32>>()
    };
    let used = windows(&store, &renderer);
    // What was filled in is known to be, and how badly.
    let scene = used.scene(&before).await.unwrap();
    let field = &scene.value.before;
    let errors = field.errors.as_ref().unwrap().content();
    assert!(scene.value.has_uncertainty() && field.largest_error > 0.0);
    let measured = errors.iter().filter(|error| error.abs() < 1e-30).count();
    let filled = errors
        .iter()
        .filter(|error| **error > 0.0 && error.is_finite())
        .count();
    assert!(measured > 1000 && filled > 10, "{measured} {filled}");
    let of_first = cells(&used, &before).await;
    let of_second = cells(&used, &now).await;
    assert_ne!(of_first, of_second);
    let fresh = windows(&store, &renderer);
    assert_eq!(of_second, cells(&fresh, &now).await);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_domain_that_is_kept_is_not_that_of_another_grid() {
    let store = Store::memory();
    let [flux, _carbon] = ocean(&store).await;
    let renderer = renderer();
    let source = windows(&store, &renderer);
    let own = of(&flux, None, Mode::Map, tile(1, 1, 0, 256));
    source.scene(&own).await.unwrap();
    let mut other = own.clone();
    other.grid.west_deg = -180.0;
    let error = source.scene(&other).await.unwrap_err().in_full();
    assert!(error.contains("domain"), "{error}");
    assert!(source.scene(&own).await.is_ok());
}
