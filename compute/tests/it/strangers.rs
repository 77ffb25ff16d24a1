//! Questions of strangers: however many regions they think of, the store stays as it is, and the answers are those of
//! everybody.

use std::sync::Arc;

use compute::budget::budget;
use compute::stats::region_series;
use compute::{Engine, derive_accumulated};
use contract::budget::BudgetQuery;
use contract::earth::Earth;
use contract::quantity::Quantity;
use contract::region::Cells;
use contract::series::RegionSeriesQuery;
use storage::Store;

use crate::fixture::{ONE_DEGREE, folder_store, land, parts, product, total, wavy_year};
use crate::troubled::Troubled;

/// Boxes and polygons that nobody asked for before.
fn regions() -> Vec<String> {
    let boxed = |i: u32| format!("{}.3,-20.7,{}.9,12.1", 10 + i, 60 + i);
    let polygon = |i: u32| format!("POLYGON((-{i}.1 -40,30.7 -{i},20.3 33.{i},-{i}.1 -40))");
    (1..=6).flat_map(|i| [boxed(i), polygon(i)]).collect()
}

async fn objects(store: &Store) -> usize {
    store.list("").await.unwrap().len()
}

async fn landed() -> (tempfile::TempDir, Store) {
    let (folder, store) = folder_store();
    let months = &wavy_year(&ONE_DEGREE)[..3];
    let flux = Quantity::CarbonFlux;
    land(&store, &product("wavy"), flux, ONE_DEGREE, months).await;
    derive_accumulated(
        &Engine::local(store.clone()),
        &product("wavy"),
        None,
        &|_| (),
    )
    .await
    .unwrap();
    (folder, store)
}

#[tokio::test(flavor = "multi_thread")]
async fn regions_of_strangers_leave_nothing_in_the_store_and_have_the_same_sums() {
    let (_folder, store) = landed().await;
    let (_other_folder, other) = landed().await;
    let before = objects(&store).await;
    let all = Engine::local(other);
    // In this process, and by Ballista, whose executor is handed the question.
    for engine in [
        Engine::local(store.clone()),
        Engine::standalone(store.clone(), parts(2)),
    ] {
        let engine = engine.storing_no_weights();
        for region in regions() {
            for name in ["wavy", "wavy-accumulated"] {
                let query = BudgetQuery {
                    cells: Cells::OceanShare,
                    ..total(&product(name), &region)
                };
                let strangers = budget(&engine, &query).await.unwrap();
                assert_eq!(
                    strangers.rows,
                    budget(&all, &query).await.unwrap().rows,
                    "{region}"
                );
            }
        }
        let query = RegionSeriesQuery {
            product: product("wavy"),
            region: "3.3,4.4,55.5,66.6".parse().unwrap(),
            region_name: String::new(),
            from: None,
            to: None,
            earth: Earth::Sphere,
            ocean: None,
        };
        let strangers = region_series(&engine, &query).await.unwrap();
        assert_eq!(strangers, region_series(&all, &query).await.unwrap());
        assert_eq!(objects(&store).await, before, "something was stored");
    }
    // Whoever works on this machine has them stored: two objects a region.
    let own = Engine::local(store.clone());
    budget(&own, &total(&product("wavy"), &regions()[0]))
        .await
        .unwrap();
    assert_eq!(objects(&store).await, before + 2);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_region_outside_of_the_grid_is_outside_for_strangers_too() {
    let (_folder, store) = folder_store();
    let grid = contract::grid::Grid {
        rows: 10,
        cols: 10,
        ..ONE_DEGREE
    };
    let step = (crate::fixture::months(2000)[0], vec![1e-9; 100]);
    let flux = Quantity::CarbonFlux;
    land(&store, &product("corner"), flux, grid, &[step]).await;
    let engine = Engine::local(store).storing_no_weights();
    let refused = budget(&engine, &total(&product("corner"), "10,10,20,20")).await;
    let refused = refused.unwrap_err().to_string();
    assert!(
        refused.contains("does not touch the grid of corner"),
        "{refused}"
    );
}

/// Named regions are few, and large grids need their weights stored.
#[tokio::test(flavor = "multi_thread")]
async fn named_regions_are_stored_once_for_everybody() {
    let (_folder, store) = landed().await;
    let engine = Engine::local(store.clone()).storing_no_weights();
    let query = total(&product("wavy"), "14n-50n");
    let before = objects(&store).await;
    budget(&engine, &query).await.unwrap();
    let once = objects(&store).await;
    assert_eq!(once, before + 2, "weights of all of it and of its sea");
    budget(&engine, &query).await.unwrap();
    let sphere = BudgetQuery {
        earth: Earth::Sphere,
        ..query
    };
    budget(&engine, &sphere).await.unwrap();
    assert_eq!(objects(&store).await, once);
}

/// Whoever may only read a store has the answers of everybody, of named regions too.
#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_stored_is_computed_for_the_question() {
    // Not in a folder, which creates its objects beside the layer.
    let store = Store::memory();
    let months = &wavy_year(&ONE_DEGREE)[..3];
    let flux = Quantity::CarbonFlux;
    land(&store, &product("wavy"), flux, ONE_DEGREE, months).await;
    let locked = store.through(|inner| Arc::new(Troubled::read_only(inner)));
    let before = objects(&store).await;
    let (boxed, named) = (regions().swap_remove(0), "14n-50n".to_owned());
    let mut answers = vec![];
    for region in [&boxed, &named] {
        let query = total(&product("wavy"), region);
        let answer = budget(&Engine::local(locked.clone()), &query).await;
        answers.push((query, answer.unwrap().rows));
    }
    assert_eq!(objects(&store).await, before, "something was stored");
    for (query, rows) in answers {
        let own = budget(&Engine::local(store.clone()), &query).await.unwrap();
        assert_eq!(rows, own.rows, "{}", query.region_name);
    }
    assert_eq!(objects(&store).await, before + 4, "the lock was none");
}
