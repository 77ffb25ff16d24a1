//! Coarser levels of steps: what they hold, beside a sum over all cells of each block; revised, moved, damaged and missing ones.

use std::collections::BTreeSet;
use std::ops::Range;
use std::sync::Arc;

use contract::chunk::Window;
use contract::earth::Earth;
use contract::grid::Grid;
use contract::level::{self, Level};
use contract::quantity::Quantity;
use cube::{At, Bands, Cube, CubeError, Edit, LevelWindow, Repository, WHOLLY_COVERED, WholeField};
use cube::{FieldBands, Values, follow, joined_window, verify};
use futures::future::BoxFuture;
use object_store::ObjectStoreExt as _;
use storage::{Store, fields, manifests};

use crate::follow::version;
use crate::product::{bits, description, grid, month, values};

/// A region short of the pole whose sides do not divide, and cells that are no squares.
const REGION: Grid = Grid {
    rows: 527,
    cols: 601,
    north_deg: 71.5,
    west_deg: -63.0,
    dlat_deg: 0.11,
    dlon_deg: 0.17,
};

/// Flux with land, islands of single cells, gaps and a whole block without data.
fn flux(grid: &Grid) -> Arc<[f32]> {
    let value = |cell: usize| {
        let (row, col) = (cell / grid.cols as usize, cell % grid.cols as usize);
        let is_land =
            (row / 7 + col / 5) % 4 == 0 || (8..24).contains(&row) && (16..40).contains(&col);
        if is_land {
            return f32::NAN;
        }
        ((row as f32 * 0.07).sin() + (col as f32 * 0.013).cos() + (cell % 13) as f32 * 0.1) * 1e-9
    };
    (0..grid.cell_count()).map(value).collect()
}

async fn cube_of(store: &Store, quantity: Quantity, grid: Grid, values: Arc<[f32]>) -> Cube {
    let description = description(quantity, grid);
    let repository = Repository::create(store, "p", &description).await.unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    edit.put(month(1), values).await.unwrap();
    edit.commit("one").await.unwrap();
    repository.at(&At::Newest).await.unwrap()
}

fn whole(level: &Level) -> Window {
    Window {
        row: 0,
        col: 0,
        rows: level.grid.rows,
        cols: level.grid.cols,
    }
}

async fn all_of(cube: &Cube, level: &Level, step: usize) -> LevelWindow {
    let found = cube.window_at(level.number, whole(level), step).await;
    found.unwrap().unwrap()
}

/// Cells of the grid in a cell of a level.
fn cells_of(grid: &Grid, level: &Level, row: u32, col: u32) -> Vec<(u32, u32)> {
    let [down, across] = level.cells;
    let rows = row * down..((row + 1) * down).min(grid.rows);
    let cols = col * across..((col + 1) * across).min(grid.cols);
    rows.flat_map(|row| cols.clone().map(move |col| (row, col)))
        .collect()
}

/// Mean by area and share of the area, over all cells of a block, one after the other.
fn reference(grid: &Grid, values: &[f32], cells: &[(u32, u32)]) -> (f64, f64) {
    let (mut sum, mut with_data, mut all) = (0.0, 0.0, 0.0);
    for (row, col) in cells {
        // From the edges themselves.
        let north = grid.north_deg - f64::from(*row) * grid.dlat_deg;
        let area = Earth::Wgs84.cell_area_m2(north - grid.dlat_deg, north, grid.dlon_deg);
        all += area;
        let value = values[(row * grid.cols + col) as usize];
        if !value.is_nan() {
            sum += area * f64::from(value);
            with_data += area;
        }
    }
    (sum / with_data, with_data / all)
}

#[tokio::test]
async fn levels_are_means_by_area_of_the_cells_with_data_ragged_edges_and_poles_included() {
    for grid in [REGION, grid(721, 1441)] {
        let values = flux(&grid);
        let cube = cube_of(
            &Store::memory(),
            Quantity::CarbonFlux,
            grid,
            Arc::clone(&values),
        )
        .await;
        let levels: Vec<Level> = cube.levels().copied().collect();
        assert_eq!(levels, level::levels(&grid));
        for level in &levels {
            let found = all_of(&cube, level, 0).await;
            let mut lacking = 0;
            for row in 0..level.grid.rows {
                for col in 0..level.grid.cols {
                    let own = (row * level.grid.cols + col) as usize;
                    let cells = cells_of(&grid, level, row, col);
                    let (mean, share) = reference(&grid, &values, &cells);
                    let (value, coverage) = (found.values[own], found.coverage[own]);
                    if share == 0.0 {
                        lacking += 1;
                        assert!(value.is_nan() && coverage == 0, "{row} {col}");
                        continue;
                    }
                    let off = (f64::from(value) - mean).abs() / mean.abs().max(1e-15);
                    assert!(
                        off < 2e-5,
                        "level {} {row} {col}: {value} {mean}",
                        level.number
                    );
                    let told = f64::from(coverage) / f64::from(WHOLLY_COVERED);
                    assert!(
                        (told - share).abs()
                            <= 0.51 / 255.0
                                + 1.0 / 255.0
                                    * f64::from(u8::from(coverage == 254 || coverage == 1)),
                        "{told} {share}"
                    );
                    assert_eq!(coverage == WHOLLY_COVERED, share > 1.0 - 1e-9);
                }
            }
            assert!(lacking > 0 && lacking < level.grid.cell_count() / 2);
        }
        let least = values.iter().copied().fold(f32::INFINITY, f32::min);
        let most = values.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        assert_eq!(cube.range_of(0), Some([least, most]));
    }
}

#[tokio::test]
async fn a_grid_of_512_cells_a_side_has_no_levels_and_nothing_of_them() {
    let (store, grid) = (Store::memory(), grid(512, 512));
    let cube = cube_of(&store, Quantity::CarbonFlux, grid, flux(&grid)).await;
    assert_eq!(cube.levels().count(), 0);
    assert!(!cube.has_levels(0) && cube.range_of(0).is_none());
    let window = Window {
        row: 0,
        col: 0,
        rows: 1,
        cols: 1,
    };
    assert_eq!(cube.window_at(1, window, 0).await.unwrap(), None);
    let own = cube.window_at(0, window, 0).await.unwrap().unwrap();
    assert_eq!(own.coverage, [0], "it is land");
    let repository = Repository::open(&store, "p").await.unwrap();
    let keys = repository.keys(&At::Newest).await.unwrap();
    let group = keys.get("zarr.json", None).await.unwrap().unwrap();
    assert!(!String::from_utf8_lossy(&group).contains("multiscales"));
}

#[tokio::test]
async fn steps_of_zeros_alone_and_without_data_have_levels() {
    let store = Store::memory();
    let zeros: Arc<[f32]> = vec![0.0; REGION.cell_count()].into();
    let cube = cube_of(&store, Quantity::CarbonFlux, REGION, zeros).await;
    assert_eq!(cube.range_of(0), Some([0.0; 2]));
    let level = cube.levels().next().unwrap();
    let found = all_of(&cube, level, 0).await;
    assert!(found.values.iter().all(|value| *value == 0.0));
    let repository = Repository::open(&store, "p").await.unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    let none: Arc<[f32]> = vec![f32::NAN; REGION.cell_count()].into();
    edit.put(month(2), none).await.unwrap();
    edit.commit("two").await.unwrap();
    let cube = repository.at(&At::Newest).await.unwrap();
    assert!(cube.has_levels(0) && cube.has_levels(1));
    let found = all_of(&cube, cube.levels().next().unwrap(), 1).await;
    assert!(found.values.iter().all(|value| value.is_nan()));
}

#[tokio::test]
async fn directions_become_mean_vectors_and_codes_one_of_themselves() {
    let grid = grid(4, 516);
    let wind = Quantity::open("wind_from", "degree", "Wind from").unwrap();
    let of = |cell: usize| match cell % 516 / 4 {
        // North, from both sides; what cancels; east.
        0 => [350.0, 10.0][cell % 2],
        1 => [0.0, 180.0][cell % 2],
        2 => [89.0, 91.0][cell % 2],
        // Counted both ways from north.
        3 => [-10.0, -30.0][cell % 2],
        _ => f32::NAN,
    };
    let values: Arc<[f32]> = (0..grid.cell_count()).map(of).collect();
    let cube = cube_of(&Store::memory(), wind, grid, values).await;
    let level = *cube.levels().next().unwrap();
    let found = all_of(&cube, &level, 0).await;
    let north = found.values[0].min(360.0 - found.values[0]);
    assert!(north.abs() < 0.01, "{}", found.values[0]);
    assert!(found.values[1].is_nan() && found.coverage[1] == WHOLLY_COVERED);
    assert!((found.values[2] - 90.0).abs() < 0.01, "{}", found.values[2]);
    assert!((found.values[3] + 20.0).abs() < 0.01, "{}", found.values[3]);
    assert_eq!(found.coverage[4], 0);

    let mask = Quantity::open("sea_mask", "1", "Mask").unwrap();
    let of = |cell: usize| match (cell / 516, cell % 516) {
        (2, 2) => 7.0,
        (2, 6) | (0, 4) => f32::NAN,
        (0, 5) => 5.0,
        _ => 1.0,
    };
    let values: Arc<[f32]> = (0..grid.cell_count()).map(of).collect();
    let cube = cube_of(&Store::memory(), mask, grid, values).await;
    let found = all_of(&cube, &level, 0).await;
    assert_eq!(found.values[..3], [7.0, 5.0, 1.0], "middle, first, any");
}

/// Rows of a field, and how many were asked for at once.
struct Counted {
    inner: WholeField,
    asked: Vec<Range<u32>>,
}

impl Bands for Counted {
    fn rows(&mut self, rows: Range<u32>) -> BoxFuture<'_, Result<Vec<f32>, CubeError>> {
        self.asked.push(rows.clone());
        self.inner.rows(rows)
    }
}

#[tokio::test]
async fn a_field_that_comes_in_bands_of_rows_is_asked_for_once_from_north_to_south() {
    let grid = grid(1030, 600);
    let values = flux(&grid);
    let whole = cube_of(
        &Store::memory(),
        Quantity::CarbonFlux,
        grid,
        Arc::clone(&values),
    )
    .await;
    let store = Store::memory();
    let description = description(Quantity::CarbonFlux, grid);
    let repository = Repository::create(&store, "p", &description).await.unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    let mut bands = Counted {
        inner: WholeField::new(Arc::clone(&values), grid.cols),
        asked: vec![],
    };
    let digest = whole.steps()[0].values_sha256;
    edit.put_bands(month(1), digest, &mut bands).await.unwrap();
    edit.commit("bands").await.unwrap();
    assert_eq!(bands.asked, [0..344, 344..688, 688..1030]);
    let cube = repository.at(&At::Newest).await.unwrap();
    assert_eq!(bits(&cube.field(0).await.unwrap()), bits(&values));
    for level in level::levels(&grid) {
        let (one, other) = (
            all_of(&whole, &level, 0).await,
            all_of(&cube, &level, 0).await,
        );
        assert_eq!(
            (bits(&one.values), one.coverage),
            (bits(&other.values), other.coverage)
        );
    }
}

#[tokio::test]
async fn levels_go_with_their_steps_when_these_are_revised_move_or_go() {
    let store = Store::memory();
    let grid = grid(40, 700);
    let of: [&[(u32, u32)]; 4] = [
        &[(1, 1), (3, 3)],
        &[(1, 1), (2, 2), (3, 30)],
        &[(2, 2), (3, 30)],
        &[(2, 2), (3, 30), (4, 4), (5, 5)],
    ];
    let level = level::levels(&grid)[0];
    for (at, steps) in of.iter().enumerate() {
        let manifest = version(&store, grid, at as u64 + 1, steps).await;
        follow(&store, &manifest).await.unwrap();
    }
    let repository = Repository::open(&store, "cubes/p").await.unwrap();
    let tags = ["1", "2", "3", "4"].map(|tag| At::Version(tag.to_owned()));
    for (at, steps) in tags.iter().zip(of) {
        let cube = repository.at(at).await.unwrap();
        for (place, (_month, seed)) in steps.iter().enumerate() {
            let values = values(&grid, *seed);
            let found = all_of(&cube, &level, place).await;
            let mut bands = WholeField::new(values, grid.cols);
            let own = (&grid, Quantity::CarbonFlux);
            let own = joined_window(own, 1, whole(&level), &mut bands)
                .await
                .unwrap();
            assert_eq!(bits(&found.values), bits(&own.values), "{at:?} {place}");
            assert_eq!(found.coverage, own.coverage);
        }
    }
    let product = "p".parse().unwrap();
    let checked = verify::check(&store, &product, &BTreeSet::new())
        .await
        .unwrap();
    // Its versions were not published.
    assert_eq!(checked.findings, []);
}

#[tokio::test]
async fn a_damaged_chunk_of_a_level_is_told_by_its_array_and_object_and_mended() {
    let store = Store::memory();
    let grid = grid(40, 700);
    let manifest = version(&store, grid, 1, &[(1, 1)]).await;
    manifests::commit(&store, &manifest).await.unwrap();
    let before: BTreeSet<_> = store.list("cubes").await.unwrap().into_iter().collect();
    follow(&store, &manifest).await.unwrap();
    let level = level::levels(&grid)[0];
    let repository = Repository::open(&store, "cubes/p").await.unwrap();
    let product = "p".parse().unwrap();
    // One after the other: that of values, that of levels' values, that of coverage, and others that cubes have.
    let mut told = BTreeSet::new();
    for key in store.list("cubes/p/chunks").await.unwrap() {
        assert!(!before.contains(&key));
        let content = store.get(&key).await.unwrap();
        let mut flipped = content.to_vec();
        flipped[content.len() / 2] ^= 4;
        let path = object_store::path::Path::from(key.as_str());
        let objects = store.object_store();
        objects.put(&path, flipped.into()).await.unwrap();
        let fresh = store.counted().0;
        let repository = Repository::open(&fresh, "cubes/p").await.unwrap();
        let opened = repository.at(&At::Newest).await;
        if let Ok(cube) = opened {
            let found = cube.window_at(1, whole(&level), 0).await;
            let field = cube.field(0).await;
            if let Err(error) = found {
                let text = error.to_string();
                assert!(
                    text.contains("levels/1/") && text.contains(key.as_str()),
                    "{text}"
                );
                assert!(field.is_ok(), "values have chunks of their own");
                let damaged = BTreeSet::from([key.clone()]);
                let checked = verify::check(&fresh, &product, &damaged).await.unwrap();
                told.insert(checked.places[&key].clone());
                assert_eq!(checked.findings, [], "it is known to be damaged");
                assert!(verify::mend(&fresh, &product).await.unwrap());
                let repository = Repository::open(&fresh, "cubes/p").await.unwrap();
                let cube = repository.at(&At::Newest).await.unwrap();
                assert!(cube.window_at(1, whole(&level), 0).await.unwrap().is_some());
                // What it was made again as has other names.
                break;
            }
        }
        objects.put(&path, content.into()).await.unwrap();
    }
    let told: Vec<_> = told.into_iter().collect();
    assert_eq!(told.len(), 1, "{told:?}");
    assert!(told[0].contains("chunk [0, 0, 0] of levels/1/"), "{told:?}");
    drop(repository);
}

#[tokio::test]
async fn a_window_of_a_level_reads_the_chunks_that_it_touches() {
    let store = Store::memory();
    let grid = grid(4200, 8200);
    let values: Arc<[f32]> = (0..grid.cell_count())
        .map(|cell| (cell as u32).wrapping_mul(0x9E37_79B9) as f32 * 1e-18)
        .collect();
    let cube = cube_of(&store, Quantity::CarbonFlux, grid, values).await;
    let levels: Vec<Level> = cube.levels().copied().collect();
    assert_eq!(levels.len(), 3);
    let (fresh, traffic) = store.counted();
    let repository = Repository::open(&fresh, "p").await.unwrap();
    let cube = repository.at(&At::Newest).await.unwrap();
    for (level, chunk_bytes) in [(1, 263 * 342 * 4), (2, 263 * 513 * 4)] {
        let before = traffic.counts();
        let window = Window {
            row: 10,
            col: 20,
            rows: 200,
            cols: 200,
        };
        let found = cube.window_at(level, window, 0).await.unwrap().unwrap();
        assert_eq!(found.values.len(), 200 * 200);
        let read = traffic.counts().since(before);
        // Values of one chunk, which do not compress well, and its coverage, which does; and manifests of both.
        assert!(
            read.read_bytes < chunk_bytes + 20_000,
            "level {level}: {read:?}"
        );
        assert!(read.reads <= 6, "level {level}: {read:?}");
    }
}

#[tokio::test]
async fn values_of_a_version_have_levels_where_its_cube_is_missing_too() {
    let store = Store::memory();
    let manifest = Arc::new(version(&store, REGION, 1, &[(1, 1), (2, 2)]).await);
    let without = Values::of(&store, &manifest).await.unwrap();
    let level = level::levels(&REGION)[0];
    let window = Window {
        row: 5,
        col: 7,
        rows: level.grid.rows - 5,
        cols: level.grid.cols - 7,
    };
    let from_field = without.window_at(1, window, 1).await.unwrap();
    follow(&store, &manifest).await.unwrap();
    let with = Values::of(&store, &manifest).await.unwrap();
    let from_cube = with.window_at(1, window, 1).await.unwrap();
    assert_eq!(bits(&from_field.values), bits(&from_cube.values));
    assert_eq!(from_field.coverage, from_cube.coverage);
    let cells = Window {
        rows: 3,
        cols: 4,
        ..window
    };
    let (a, b) = (
        without.window_at(0, cells, 0).await.unwrap(),
        with.window_at(0, cells, 0).await.unwrap(),
    );
    assert_eq!((bits(&a.values), a.coverage), (bits(&b.values), b.coverage));
    for (level, window) in [(1, Window { row: 500, ..window }), (9, window)] {
        let mut bands = FieldBands::new(&store, &manifest.steps[0].field, &REGION);
        let of = (&REGION, manifest.quantity);
        let refused = joined_window(of, level, window, &mut bands).await;
        assert!(matches!(refused, Err(CubeError::Outside { .. })));
    }
    drop(
        fields::read(&store, &manifest.steps[0].field, &REGION)
            .await
            .unwrap(),
    );
}

#[tokio::test]
async fn attributes_tell_others_where_levels_lie() {
    let store = Store::memory();
    let cube = cube_of(&store, Quantity::CarbonFlux, REGION, flux(&REGION)).await;
    drop(cube);
    let repository = Repository::open(&store, "p").await.unwrap();
    let keys = repository.keys(&At::Newest).await.unwrap();
    let group = keys.get("zarr.json", None).await.unwrap().unwrap();
    let group: serde_json::Value = serde_json::from_slice(&group).unwrap();
    let layout = &group["attributes"]["multiscales"]["layout"];
    assert_eq!(layout[0]["asset"], "carbon_flux");
    assert_eq!(layout[1]["asset"], "levels/1/carbon_flux");
    assert_eq!(layout[1]["derived_from"], "carbon_flux");
    let transform = &layout[1]["transform"];
    assert_eq!(transform["scale"], serde_json::json!([1.0, 4.0, 4.0]));
    assert_eq!(transform["translation"], serde_json::json!([0.0, 1.5, 1.5]));
    let arrays = &group["consolidated_metadata"]["metadata"];
    let level = &arrays["levels/1/carbon_flux"];
    assert_eq!(level["shape"], serde_json::json!([1, 132, 151]));
    assert_eq!(level["attributes"]["quantization_nsb"], 15);
    assert_eq!(level["attributes"]["ancillary_variables"], "coverage");
    for coordinate in [
        "time",
        "time_bnds",
        "lat",
        "lat_bnds",
        "lon",
        "lon_bnds",
        "crs",
        "coverage",
    ] {
        let path = format!("levels/1/{coordinate}");
        assert!(arrays[&path].is_object(), "{path}");
    }
    assert!(keys.get("levels/1/time/c/0", None).await.unwrap().is_some());
}
