use bytes::Bytes;
use contract::computed::Regridding;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::quantity::Quantity;
use contract::time::Period;

use std::path::Path;

use super::*;
use crate::peak::{check, is_inner, peak_bytes};

/// Three rows of chunks, the last one short.
const FINE: Grid = Grid {
    rows: 150,
    cols: 250,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 1.2,
    dlon_deg: 1.44,
};
/// Coarser, with its rows across those of the finer one, and begun elsewhere.
const COARSE: Grid = Grid {
    rows: 7,
    cols: 11,
    north_deg: 90.0,
    west_deg: -33.3,
    dlat_deg: 180.0 / 7.0,
    dlon_deg: 360.0 / 11.0,
};
/// Finer than the finer one, of a part of the globe.
const FINEST: Grid = Grid {
    rows: 301,
    cols: 200,
    north_deg: 80.0,
    west_deg: 100.0,
    dlat_deg: 0.37,
    dlon_deg: 0.31,
};

fn value(cell: usize, seed: usize) -> f32 {
    // Beyond what a wind may have.
    if (cell + seed) % 997 == 1 {
        return 9_000.0;
    }
    match (cell + seed) % 13 {
        0 => f32::NAN,
        n => ((cell * 7919) % 10_007) as f32 / 1000.0 + n as f32,
    }
}

async fn landed(store: &Store, grid: &Grid, seed: usize) -> ObjectKey {
    let values: Vec<f32> = (0..grid.cell_count()).map(|i| value(i, seed)).collect();
    let january = Period::month(2001, 1).unwrap();
    let product = "p".parse().unwrap();
    let written = fields::write(store, &product, grid, &values, january);
    written.await.unwrap()
}

fn job(how: Computation, names: &[&str], grids: [Grid; 2]) -> Job {
    let input = |name: &&str| ((*name).to_owned(), "m s-1".to_owned());
    Job {
        how,
        inputs: names.iter().map(input).collect(),
        grid: grids[0],
        target_grid: grids[1],
        target: "made".parse().unwrap(),
        quantity: Quantity::WindSpeed,
    }
}

fn in_bands(store: &Store, band_cells: u64) -> Workshop<'_> {
    Workshop {
        band_cells,
        ..Workshop::of(store)
    }
}

/// What is made of fields in bands of so many cells: the step, the bytes of its field, those of its domain.
async fn made(
    band_cells: u64,
    job: &Job,
    of: &Store,
    fields: &[ObjectKey],
) -> (FieldMade, [Bytes; 2]) {
    let workshop = in_bands(of, band_cells);
    let task = FieldTask {
        index: 3,
        period: Period::month(2001, 1).unwrap(),
        fields: fields.to_vec(),
    };
    let maker = Maker::of(job).unwrap();
    let made = field(workshop, job, &maker, &task).await.unwrap();
    let task = ExtentTask {
        first: 0,
        fields: vec![made.field.clone(), fields[0].clone()],
    };
    // What is looked through is on one grid.
    let task = ExtentTask {
        fields: task.fields[..=usize::from(job.grid == job.target_grid)].to_vec(),
        ..task
    };
    let extent = run(workshop, job, &task).await.unwrap();
    let bytes = [
        of.get(&made.field).await.unwrap(),
        of.get(&extent.domain).await.unwrap(),
    ];
    (made, bytes)
}

#[tokio::test]
async fn an_expression_gives_the_same_bytes_and_counts_in_bands_of_any_size() {
    let store = Store::memory();
    let fields = [
        landed(&store, &FINE, 0).await,
        landed(&store, &FINE, 5).await,
        landed(&store, &FINE, 0).await,
    ];
    assert_eq!(fields[0], fields[2], "the same field under two names");
    let how = Computation::Expression {
        expression: "CASE WHEN a > unit(9, 'm s-1') THEN a * a / (c - a) ELSE a + b END".to_owned(),
    };
    let job = job(how, &["a", "b", "c"], [FINE; 2]);
    let whole = made(1 << 30, &job, &store, &fields).await;
    assert!(
        whole.0.implausible > 100 && whole.0.valid_cells > 10_000,
        "{:?}",
        whole.0
    );
    for band_cells in [1, 3 * 60 * u64::from(FINE.cols)] {
        assert!(
            made(band_cells, &job, &store, &fields).await == whole,
            "{band_cells}"
        );
    }
}

#[tokio::test]
async fn a_regridded_map_has_the_same_bytes_in_bands_of_any_size() {
    let store = Store::memory();
    for method in [
        Regridding::Nearest,
        Regridding::Bilinear,
        Regridding::Conservative,
    ] {
        for (source, target) in [
            (FINE, COARSE),
            (FINE, FINEST),
            (COARSE, FINE),
            (FINEST, FINE),
        ] {
            let fields = [landed(&store, &source, 2).await];
            let how = Computation::Regrid {
                method,
                min_coverage: 0.3,
            };
            let job = job(how, &["a"], [source, target]);
            let whole = made(1 << 30, &job, &store, &fields).await;
            assert!(whole.0.valid_cells > 10, "{method} {:?}", whole.0);
            // The whole map at once, as it is told to others.
            let values = fields::read(&store, &fields[0], &source).await.unwrap();
            let direct = Regridder::new(&source, &target, method)
                .apply(&values)
                .unwrap();
            let stored = fields::read(&store, &whole.0.field, &target).await.unwrap();
            for (cell, (value, coverage)) in direct.values.iter().zip(&direct.coverage).enumerate()
            {
                let is_held = *coverage >= 0.3 - 1e-9 && job.quantity.plausible().contains(value);
                let expected = if is_held { *value as f32 } else { f32::NAN };
                assert_eq!(
                    stored[cell].to_bits(),
                    expected.to_bits(),
                    "{method} {cell}"
                );
            }
            assert!(
                made(1, &job, &store, &fields).await == whole,
                "{method} {source:?} {target:?}"
            );
        }
    }
}

#[tokio::test]
async fn a_damaged_field_is_told_of_though_no_row_of_the_target_needs_it_all() {
    let store = Store::memory();
    let key = landed(&store, &FINE, 0).await;
    // Whole rows of other values under its name: only all of them together tell.
    let values: Vec<f32> = (0..FINE.cell_count()).map(|i| value(i, 1)).collect();
    let january = Period::month(2001, 1).unwrap();
    let other = fields::encode(&FINE, &values, january).unwrap();
    store.put_over(&key, other.content).await.unwrap();
    let how = Computation::Regrid {
        method: Regridding::Nearest,
        min_coverage: 0.5,
    };
    let target = Grid {
        rows: 5,
        cols: 5,
        north_deg: 80.0,
        west_deg: 100.0,
        dlat_deg: 1.0,
        dlon_deg: 1.0,
    };
    let job = job(how, &["a"], [FINE, target]);
    let task = FieldTask {
        index: 0,
        period: january,
        fields: vec![key.clone()],
    };
    let maker = Maker::of(&job).unwrap();
    for band_cells in [1, 1 << 30] {
        let workshop = in_bands(&store, band_cells);
        let error = field(workshop, &job, &maker, &task).await.unwrap_err();
        assert!(error.to_string().contains(key.as_str()), "{error}");
    }
}

/// A map that is large in cells only: 128 MB as it is stored, and 512 MB more where two of them and what is made are held.
const LARGE: Grid = Grid {
    rows: 4000,
    cols: 8000,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 0.045,
    dlon_deg: 0.045,
};
/// Cells of a band of it.
const BAND_CELLS: u64 = 1 << 20;

/// A field of it, made in bands.
async fn large(store: &Store, seed: f32) -> ObjectKey {
    let january = Period::month(2001, 1).unwrap();
    let mut field = Spooled::begin(Path::new("/var/tmp"), &LARGE, january).unwrap();
    for rows in bands(&LARGE, BAND_CELLS) {
        let cells = rows.len() * LARGE.cols as usize;
        let value = |cell: usize| ((cell / 64 % 100) as f32 + rows.start as f32 / 100.0) * seed;
        field
            .band(&(0..cells).map(value).collect::<Vec<_>>())
            .unwrap();
    }
    let put = field.put(store, &"p".parse().unwrap()).await;
    put.unwrap().0
}

#[tokio::test]
async fn a_large_map_takes_the_memory_of_its_bands() {
    let name = "computed::make::tests::a_large_map_takes_the_memory_of_its_bands";
    if !is_inner(name) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    let fields = [large(&store, 0.5).await, large(&store, 0.25).await];
    let before = peak_bytes();
    let how = Computation::Expression {
        expression: "a + b".to_owned(),
    };
    let summed = job(how, &["a", "b"], [LARGE; 2]);
    let half = Grid {
        rows: 2000,
        cols: 4000,
        dlat_deg: 0.09,
        dlon_deg: 0.09,
        ..LARGE
    };
    let how = Computation::Regrid {
        method: Regridding::Conservative,
        min_coverage: 0.5,
    };
    let halved = job(how, &["a"], [LARGE, half]);
    for (job, fields) in [(summed, &fields[..]), (halved, &fields[..1])] {
        let task = FieldTask {
            index: 0,
            period: Period::month(2001, 1).unwrap(),
            fields: fields.to_vec(),
        };
        let workshop = in_bands(&store, BAND_CELLS);
        let maker = Maker::of(&job).unwrap();
        let made = field(workshop, &job, &maker, &task).await.unwrap();
        assert_eq!(made.valid_cells, job.target_grid.cell_count() as u64);
        let task = ExtentTask {
            first: 0,
            fields: vec![made.field],
        };
        run(workshop, &job, &task).await.unwrap();
    }
    check(before, 160 << 20);
}
