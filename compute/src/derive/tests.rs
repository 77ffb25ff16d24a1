use std::collections::BTreeMap;
use std::num::NonZeroUsize;

use bytes::Bytes;
use contract::chunk::bands;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Step};
use storage::domain::Cells;
use storage::fields::Spooled;
use storage::{domain, spool};

use super::*;
use crate::peak::{check, is_inner, peak_bytes};

/// Three rows of chunks, the last one short.
const GRID: Grid = Grid {
    rows: 150,
    cols: 130,
    north_deg: 75.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// A flux of a step, kg m⁻² s⁻¹, with gaps; the south-east has data from the fourth step on.
fn flux(step: usize, cell: usize) -> f32 {
    let is_late = cell / 130 > 100 && cell % 130 > 60 && step < 3;
    if is_late || (cell * 7919 + step * 104_729).is_multiple_of(17) {
        return f32::NAN;
    }
    ((cell % 1009) as f32 - 504.0) * 1.7e-11 * (step + 1) as f32
}

/// A version of fluxes of so many months, its fields made in bands.
async fn landed(
    store: &Store,
    grid: &Grid,
    steps: usize,
    flux: impl Fn(usize, usize) -> f32,
) -> Manifest {
    let product: ProductId = "flux".parse().unwrap();
    let mut cells = Cells::none(grid.cell_count());
    let mut listed = vec![];
    for step in 0..steps {
        let period = Period::month(2001, step as u32 + 1).unwrap();
        let mut field = Spooled::begin(&spool::FOLDER, grid, period).unwrap();
        for rows in bands(grid, 1 << 20) {
            let [first, end] = [rows.start, rows.end].map(|row| row as usize * grid.cols as usize);
            let values: Vec<f32> = (first..end).map(|cell| flux(step, cell)).collect();
            cells.add_valued(first, &values);
            field.band(&values).unwrap();
        }
        let (field, valid_cells) = field.put(store, &product).await.unwrap();
        listed.push(Step {
            masked: None,
            period,
            field,
            raw_sha256: Digest::of(&step.to_le_bytes()),
            origin: format!("step-{step}.nc"),
            valid_cells,
            contributed: None,
        });
    }
    Manifest {
        schema: MANIFEST_SCHEMA,
        product: product.clone(),
        number: steps as u64,
        title: "Fluxes".to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: "made by a test".to_owned(),
        grid: *grid,
        steps: listed,
        domain: domain::write_cells(store, &product, cells).await.unwrap(),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
    }
}

/// How a derivation is cut: cells of a band, values of a run.
type Cut = (u64, u64);
/// A band, and a run of all steps.
const WHOLE: Cut = (1 << 30, 1 << 40);
/// Bands of a row of chunks, and two steps a run.
const CUT: Cut = (1, 2);

async fn derived(store: &Store, source: &Manifest, prior: Option<&Manifest>, cut: Cut) -> Manifest {
    derived_since(store, source, (None, prior), cut).await
}

async fn derived_since(
    store: &Store,
    source: &Manifest,
    (start, prior): (Option<TimeMs>, Option<&Manifest>),
    cut: Cut,
) -> Manifest {
    let one = NonZeroUsize::new(2).unwrap();
    let engine = Engine::in_process(store.clone(), one);
    let workshop = Workshop {
        band_cells: cut.0,
        run_values: cut.1,
        ..Workshop::of(store)
    };
    let steps = steps_since(source, start).unwrap();
    let made = accumulated((&engine, workshop), source, &steps, prior, &|_progress| ());
    made.await.unwrap()
}

/// All that a version names, and the version without what tells where it is from.
async fn seen(store: &Store, manifest: &Manifest) -> (Manifest, BTreeMap<ObjectKey, Bytes>) {
    let mut objects = BTreeMap::new();
    for step in &manifest.steps {
        let counts = &step.contributed.as_ref().unwrap().counts;
        for key in [&step.field, counts, &manifest.domain] {
            objects.insert(key.clone(), store.get(key).await.unwrap());
        }
    }
    let told = Manifest {
        derived_from: None,
        ..manifest.clone()
    };
    (told, objects)
}

fn folder_store() -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

/// What is derived at once, in one band and one run.
async fn expected() -> (Manifest, BTreeMap<ObjectKey, Bytes>) {
    let (_folder, store) = folder_store();
    let source = landed(&store, &GRID, 5, flux).await;
    let whole = derived(&store, &source, None, WHOLE).await;
    let seen = seen(&store, &whole).await;
    assert_eq!(seen.1.len(), 11, "five fields, five counts, a domain");
    seen
}

#[tokio::test(flavor = "multi_thread")]
async fn carbon_accumulated_in_bands_and_runs_of_any_size_has_the_same_bytes() {
    let expected = expected().await;
    for cut in [CUT, (2 * 60 * 130, 1 << 40), (1 << 30, 1)] {
        let (_folder, store) = folder_store();
        let source = landed(&store, &GRID, 5, flux).await;
        let made = derived(&store, &source, None, cut).await;
        assert!(seen(&store, &made).await == expected, "{cut:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_accumulated_in_bands_is_gone_on_from_over_a_domain_that_grew() {
    let expected = expected().await;
    for (first, then) in [(CUT, CUT), (WHOLE, CUT), (CUT, WHOLE)] {
        let (folder, store) = folder_store();
        let early = landed(&store, &GRID, 3, flux).await;
        let prior = derived(&store, &early, None, first).await;
        let source = landed(&store, &GRID, 5, flux).await;
        assert_ne!(early.domain, source.domain);
        if first == then {
            // Nothing is asked of the early steps again: their exact sums are there, a band each.
            let kept = store.list("accumulating").await.unwrap();
            assert_eq!(kept.len(), 3);
            for step in &early.steps {
                std::fs::remove_file(folder.path().join(step.field.as_str())).unwrap();
            }
        }
        let made = derived(&store, &source, Some(&prior), then).await;
        assert!(seen(&store, &made).await == expected, "{first:?} {then:?}");
    }
}

fn is_early(cell: usize) -> bool {
    cell / 130 < 40 && cell % 130 < 60
}

/// A flux of the first month alone in the north-west, and of the fourth on in the south-east.
fn early_or_late(step: usize, cell: usize) -> f32 {
    if is_early(cell) && step > 0 {
        f32::NAN
    } else {
        flux(step, cell)
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_cell_without_data_since_the_start_has_accumulated_nothing_and_holds_none() {
    let start = Some(Period::month(2001, 2).unwrap().start);
    let (_folder, store) = folder_store();
    let source = landed(&store, &GRID, 5, early_or_late).await;
    let whole = derived_since(&store, &source, (start, None), WHOLE).await;
    assert_ne!(whole.domain, source.domain);
    let late = 120 * 130 + 100;
    for (index, step) in whole.steps.iter().enumerate() {
        let values = storage::fields::read(&store, &step.field, &GRID)
            .await
            .unwrap();
        let mut early = (0..GRID.cell_count()).filter(|cell| is_early(*cell));
        assert!(early.all(|cell| values[cell].is_nan()), "{index}");
        // A gap before the first data of a cell is no growth yet.
        assert!(!values[late].is_nan());
        let valid = values.iter().filter(|value| !value.is_nan()).count();
        assert_eq!(valid as u64, step.valid_cells);
    }
    // In parts, and gone on from what was there, it is the same.
    let expected = seen(&store, &whole).await;
    for (first, then) in [(CUT, CUT), (WHOLE, CUT), (CUT, WHOLE)] {
        let (_folder, store) = folder_store();
        let early = landed(&store, &GRID, 3, early_or_late).await;
        let prior = derived_since(&store, &early, (start, None), first).await;
        let source = landed(&store, &GRID, 5, early_or_late).await;
        let made = derived_since(&store, &source, (start, Some(&prior)), then).await;
        assert!(seen(&store, &made).await == expected, "{first:?} {then:?}");
    }
}

/// A map that is large in cells only: sums and counts of them all take 640 MB, columns of both steps 256 MB.
const LARGE: Grid = Grid {
    rows: 4000,
    cols: 8000,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 0.045,
    dlon_deg: 0.045,
};

#[tokio::test(flavor = "multi_thread")]
async fn a_large_map_takes_the_memory_of_its_bands() {
    if !is_inner("derive::tests::a_large_map_takes_the_memory_of_its_bands") {
        return;
    }
    let (_folder, store) = folder_store();
    let flux = |step: usize, cell: usize| (cell / 64 % 100 + step) as f32 * 1e-11;
    let source = landed(&store, &LARGE, 2, flux).await;
    let before = peak_bytes();
    let made = derived(&store, &source, None, (1 << 20, 1 << 21)).await;
    let counts = made.steps[1].contributed.as_ref().unwrap();
    assert_eq!(counts.complete_cells, LARGE.cell_count() as u64);
    check(before, 384 << 20);
}
