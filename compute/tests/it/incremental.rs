//! Accumulated carbon brought up to date: the same bits as when it is derived from nothing.

use std::sync::Mutex;

use compute::dependents::follow;
use compute::derive::{DeriveProgress, chosen_start, derive_anew};
use compute::{Engine, derive_accumulated};
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::Period;
use storage::{Store, manifests};

use crate::fixture::{folder_store, land, parts, product, wavy_year};

const FIVE_DEGREES: Grid = Grid {
    rows: 36,
    cols: 72,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 5.0,
    dlon_deg: 5.0,
};

type Steps = Vec<(Period, Vec<f32>)>;

async fn put(store: &Store, steps: &Steps) -> Manifest {
    let id = product("wavy");
    land(store, &id, Quantity::CarbonFlux, FIVE_DEGREES, steps).await
}

async fn derive(store: &Store) -> Manifest {
    let engine = Engine::local(store.clone());
    derive_accumulated(&engine, &product("wavy"), None, &|_progress| ())
        .await
        .unwrap()
}

/// The same steps derived from nothing, in a store that never held anything else.
async fn from_nothing(steps: &Steps) -> Manifest {
    let (_folder, store) = folder_store();
    put(&store, steps).await;
    derive(&store).await
}

/// All that readers see of a manifest but its number and the version of its source.
fn seen(manifest: &Manifest) -> Manifest {
    Manifest {
        number: 0,
        derived_from: None,
        ..manifest.clone()
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn month_after_month_gives_the_bits_of_the_whole_year_at_once() {
    let year = wavy_year(&FIVE_DEGREES);
    let (_folder, store) = folder_store();
    for months in 1..=12 {
        put(&store, &year[..months].to_vec()).await;
        derive(&store).await;
    }
    let grown = manifests::latest(&store, &product("wavy-accumulated")).await;
    let grown = grown.unwrap().unwrap();
    assert_eq!(grown.number, 12);
    assert_eq!(seen(&grown), seen(&from_nothing(&year).await));
}

#[tokio::test(flavor = "multi_thread")]
async fn months_that_are_accumulated_are_not_read_again() {
    let year = wavy_year(&FIVE_DEGREES);
    let (folder, store) = folder_store();
    let early = put(&store, &year[..9].to_vec()).await;
    derive(&store).await;
    put(&store, &year).await;
    for step in &early.steps {
        std::fs::remove_file(folder.path().join(step.field.as_str())).unwrap();
    }
    let derived = derive(&store).await;
    assert_eq!(seen(&derived), seen(&from_nothing(&year).await));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_revised_month_redoes_itself_and_what_follows_and_nothing_before() {
    let year = wavy_year(&FIVE_DEGREES);
    let (_folder, store) = folder_store();
    put(&store, &year).await;
    let before = derive(&store).await;
    let mut revised = year.clone();
    for value in &mut revised[7].1 {
        *value *= 1.25;
    }
    put(&store, &revised).await;
    let after = derive(&store).await;
    for month in 0..12 {
        let is_same = before.steps[month].field == after.steps[month].field;
        assert_eq!(is_same, month < 7, "month {month}");
    }
    assert_eq!(seen(&after), seen(&from_nothing(&revised).await));
}

#[tokio::test(flavor = "multi_thread")]
async fn cells_that_come_and_go_change_the_earlier_fields_as_they_must() {
    let year = wavy_year(&FIVE_DEGREES);
    let land_cell = (0..FIVE_DEGREES.cell_count())
        .find(|&index| year.iter().all(|(_, values)| values[index].is_nan()))
        .unwrap();
    let mut other = year.clone();
    other[11].1[land_cell] = 3e-9; // a cell that held no data in any month
    let gone = (0..FIVE_DEGREES.cell_count())
        .find(|&index| !year[11].1[index].is_nan())
        .unwrap();
    let (_folder, store) = folder_store();
    let mut only_december = year.clone();
    for (_, values) in &mut only_december[..11] {
        values[gone] = f32::NAN;
    }
    let mut nowhere = only_december.clone();
    nowhere[11].1[gone] = f32::NAN;
    for steps in [&year, &other, &only_december, &nowhere] {
        put(&store, steps).await;
        let derived = derive(&store).await;
        assert_eq!(seen(&derived), seen(&from_nothing(steps).await));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn without_stored_sums_they_are_computed_again_to_the_same_bits() {
    let year = wavy_year(&FIVE_DEGREES);
    let (folder, store) = folder_store();
    put(&store, &year[..9].to_vec()).await;
    derive(&store).await;
    let states = folder.path().join("accumulating");
    assert_eq!(std::fs::read_dir(&states).unwrap().count(), 1);
    std::fs::remove_dir_all(&states).unwrap();
    put(&store, &year).await;
    let id = product("wavy");
    let engine = Engine::standalone(store.clone(), parts(3));
    let derived = derive_accumulated(&engine, &id, None, &|_progress| ()).await;
    assert_eq!(seen(&derived.unwrap()), seen(&from_nothing(&year).await));
}

#[tokio::test(flavor = "multi_thread")]
async fn without_stored_counts_all_is_accumulated_again_to_the_same_bits() {
    let year = wavy_year(&FIVE_DEGREES);
    let (folder, store) = folder_store();
    put(&store, &year[..9].to_vec()).await;
    derive(&store).await;
    std::fs::remove_dir_all(folder.path().join("contributed")).unwrap();
    put(&store, &year).await;
    let derived = derive(&store).await;
    assert_eq!(seen(&derived), seen(&from_nothing(&year).await));
    for step in &derived.steps {
        let counts = &step.contributed.as_ref().unwrap().counts;
        assert!(store.exists(counts).await.unwrap(), "{counts}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_an_older_program_accumulated_without_counts_is_accumulated_again() {
    let year = wavy_year(&FIVE_DEGREES);
    let (_folder, store) = folder_store();
    put(&store, &year[..9].to_vec()).await;
    let mut old = derive(&store).await;
    // As it was written before there were counts, word for word; such a manifest keeps its name.
    for step in &mut old.steps {
        step.contributed = None;
    }
    let text = serde_json::to_string(&old).unwrap();
    assert!(!text.contains("contributed"), "{text}");
    old.number += 1;
    manifests::commit(&store, &old).await.unwrap();
    put(&store, &year).await;
    let derived = derive(&store).await;
    assert_eq!(seen(&derived), seen(&from_nothing(&year).await));
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_computed_anew_and_comes_out_the_same_makes_no_version() {
    let year = wavy_year(&FIVE_DEGREES);
    let (folder, store) = folder_store();
    put(&store, &year).await;
    let first = derive(&store).await;
    // A field that was lost: its key is in the manifest, its object is gone.
    let lost = &first.steps[5].field;
    std::fs::remove_file(folder.path().join(lost.as_str())).unwrap();
    let seen = Mutex::new(0);
    let count = |now: DeriveProgress| *seen.lock().unwrap() = now.done_steps;
    let from = year[5].0.start;
    let engine = Engine::local(store.clone());
    let again = derive_anew(&engine, &product("wavy"), None, from, &count).await;
    assert_eq!(again.unwrap(), first);
    assert_eq!(*seen.lock().unwrap(), 12);
    assert!(store.exists(lost).await.unwrap());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_start_is_chosen_if_the_source_did_not_begin_there() {
    let year = wavy_year(&FIVE_DEGREES);
    let (_folder, store) = folder_store();
    let id = product("wavy");
    put(&store, &year[3..].to_vec()).await;
    assert_eq!(chosen_start(&store, &id).await.unwrap(), None);
    derive(&store).await;
    // An earlier month lands: that accumulation begins later than its source now was nobody's choice.
    put(&store, &year[2..].to_vec()).await;
    assert_eq!(chosen_start(&store, &id).await.unwrap(), None);
    let start = year[6].0.start;
    let engine = Engine::local(store.clone());
    let chosen = derive_accumulated(&engine, &id, Some(start), &|_progress| ()).await;
    assert_eq!(chosen.unwrap().steps.len(), 6);
    put(&store, &year).await;
    assert_eq!(chosen_start(&store, &id).await.unwrap(), Some(start));
    let key: ObjectKey = "manifests/wavy-accumulated/0000000002.json"
        .parse()
        .unwrap();
    assert!(store.exists(&key).await.unwrap());
}

/// Months land in any order: what is there when somebody chooses is not what he chose.
#[tokio::test(flavor = "multi_thread")]
async fn a_start_that_was_chosen_in_a_gap_stays_when_the_gap_is_filled() {
    let year = wavy_year(&FIVE_DEGREES);
    let start = year[6].0.start;
    let id = product("wavy");
    // In a gap, and before all that has landed.
    for early in [5, 0] {
        let (_folder, store) = folder_store();
        let engine = Engine::local(store.clone());
        put(&store, &[&year[..early], &year[8..]].concat()).await;
        let chosen = || derive_accumulated(&engine, &id, Some(start), &|_progress| ());
        let first = chosen().await.unwrap();
        assert_eq!(first.steps.len(), 4);
        assert_eq!(first.accumulated_since(), Some(start));
        assert_eq!(chosen().await.unwrap(), first);
        assert_eq!(chosen_start(&store, &id).await.unwrap(), Some(start));
        put(&store, &year).await;
        let followed = follow(&engine, &id).await.unwrap();
        assert_eq!(followed[0].steps.len(), 6);
        assert_eq!(followed[0].steps[0].period.start, start);
        assert_eq!(chosen_start(&store, &id).await.unwrap(), Some(start));
        // The same as if nothing had been missing.
        let (_folder, whole) = folder_store();
        put(&whole, &year).await;
        let engine = Engine::local(whole);
        let at_once = derive_accumulated(&engine, &id, Some(start), &|_progress| ()).await;
        assert_eq!(seen(&followed[0]), seen(&at_once.unwrap()));
    }
}
