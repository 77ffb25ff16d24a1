//! Cells that a revision takes away, looked for in many steps.

use contract::digest::Digest;
use contract::grid::Grid;
use contract::manifest::{MANIFEST_SCHEMA, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use storage::{domain, fields, manifests};

use super::super::write;
use super::*;

const GRID: Grid = Grid {
    rows: 11,
    cols: 21,
    north_deg: 45.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};
/// A whole run, and twelve steps that are in none.
const STEPS: usize = RUN_STEPS + 12;
/// The step that is revised.
const REVISED: usize = 70;
/// A cell, and the steps that hold it besides the one that is revised: none, in two blocks, one of which the grid cuts off; one of the
/// same run; the last one, whose field is looked at first; one that no run holds, whose field is looked at last.
const CELLS: [(usize, &[usize]); 5] = [
    (0, &[]),
    (10 * 21 + 20, &[]),
    (3, &[REVISED + 1]),
    (9, &[STEPS - 1]),
    (11, &[RUN_STEPS + 2]),
];
/// A cell that all steps hold.
const EVERYWHERE: usize = 30;

async fn step(store: &Store, at: usize, is_revised: bool) -> Step {
    let day = |at: usize| TimeMs::new(at as i64 * 86_400_000).unwrap();
    let period = Period::new(day(at), day(at + 1)).unwrap();
    let mut values = vec![f32::NAN; GRID.cell_count()];
    values[EVERYWHERE] = (at + 1) as f32 * 1e-10;
    for (cell, others) in CELLS {
        if others.contains(&at) || at == REVISED && !is_revised {
            values[cell] = 2e-9;
        }
    }
    let product: ProductId = "p".parse().unwrap();
    let field = fields::write(store, &product, &GRID, &values, period).await;
    Step {
        period,
        field: field.unwrap(),
        raw_sha256: Digest::of(b""),
        origin: String::new(),
        valid_cells: 1,
        masked: None,
        contributed: None,
    }
}

/// A version that is published, with its cube along time.
async fn published(store: &Store, quantity: Quantity) -> Manifest {
    let mut steps = vec![];
    for at in 0..STEPS {
        steps.push(step(store, at, false).await);
    }
    let product: ProductId = "p".parse().unwrap();
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        number: 1,
        title: "P".to_owned(),
        quantity,
        synthetic: true,
        source: String::new(),
        grid: GRID,
        domain: write(store, &product, &GRID, None, &steps).await.unwrap(),
        steps,
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
        product: product.clone(),
    };
    manifests::commit(store, &manifest).await.unwrap();
    cube::follow(store, &manifest).await.unwrap();
    let made = cube::compact(store, &cube::folder(&product)).await;
    assert_eq!(made.unwrap(), 1);
    manifest
}

/// Cells of the domain once the step is revised, and the reads of the store that it took; the same is found with no past.
async fn revised(store: &Store, newest: &Manifest) -> (Vec<bool>, u64) {
    let mut steps = newest.steps.clone();
    steps[REVISED] = step(store, REVISED, true).await;
    let (counted, traffic) = store.counted();
    let product = &newest.product;
    let found = write(&counted, product, &GRID, Some(newest), &steps).await;
    let reads = traffic.counts().reads;
    let anew = write(store, product, &GRID, None, &steps).await;
    let found = found.unwrap();
    assert_eq!(
        found,
        anew.unwrap(),
        "it is that of a product without a past"
    );
    (domain::read(store, &found).await.unwrap(), reads)
}

fn expected() -> Vec<bool> {
    let mut cells = vec![false; GRID.cell_count()];
    cells[EVERYWHERE] = true;
    for (cell, others) in CELLS {
        cells[cell] = !others.is_empty();
    }
    cells
}

#[tokio::test(flavor = "multi_thread")]
async fn cells_that_go_are_looked_for_in_runs_of_steps_and_not_in_each() {
    let open = Quantity::open("something", "1", "Something").unwrap();
    for quantity in [Quantity::CarbonFlux, open] {
        let store = Store::memory();
        let newest = published(&store, quantity).await;
        let values = Values::of(&store, &Arc::new(newest.clone())).await.unwrap();
        let is_summed = values.summed_as(&(0..RUN_STEPS)).is_some();
        assert_eq!(is_summed, quantity == Quantity::CarbonFlux);
        let (cells, reads) = revised(&store, &newest).await;
        assert_eq!(cells, expected());
        // A field takes more than one.
        assert!(reads < STEPS as u64 / 2, "{quantity:?}: {reads}");
        // A product without a cube is looked through step by step.
        for key in store.list("cubes/p").await.unwrap() {
            store.remove(&key).await.unwrap();
        }
        let (cells, reads) = revised(&store, &newest).await;
        assert_eq!(cells, expected());
        assert!(reads > STEPS as u64, "{quantity:?}: {reads}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn steps_may_be_dropped_and_the_cube_may_be_of_the_version_before() {
    let store = Store::memory();
    let before = published(&store, Quantity::CarbonFlux).await;
    // Of a version that no cube followed: one step less at the start.
    let mut newest = Manifest {
        number: 2,
        ..before.clone()
    };
    newest.steps.remove(0);
    manifests::commit(&store, &newest).await.unwrap();
    // The next one drops the step that holds all of the cells, and one that holds one of them.
    let mut steps = newest.steps.clone();
    steps.drain(REVISED - 1..=REVISED);
    let product = &newest.product;
    let found = write(&store, product, &GRID, Some(&newest), &steps).await;
    let anew = write(&store, product, &GRID, None, &steps).await;
    let found = found.unwrap();
    assert_eq!(found, anew.unwrap());
    let cells = domain::read(&store, &found).await.unwrap();
    let held = CELLS.map(|(cell, _)| cells[cell]);
    assert_eq!(held, [false, false, false, true, true]);
    assert!(cells[EVERYWHERE]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_chunk_that_is_damaged_says_nothing_of_cells() {
    let store = Store::memory();
    let newest = published(&store, Quantity::CarbonFlux).await;
    let mut steps = newest.steps.clone();
    steps[REVISED] = step(&store, REVISED, true).await;
    // Each alone: those that a cube is opened by, and those of sums, of a run and of maps.
    for key in store.list("cubes/p/chunks").await.unwrap() {
        let sound = store.get(&key).await.unwrap();
        let damaged: Vec<u8> = sound.iter().map(|byte| byte ^ 1).collect();
        store.put_over(&key, damaged.into()).await.unwrap();
        let found = write(&store, &newest.product, &GRID, Some(&newest), &steps).await;
        let cells = domain::read(&store, &found.unwrap()).await.unwrap();
        assert_eq!(cells, expected(), "{key}");
        store.put_over(&key, sound).await.unwrap();
    }
}
