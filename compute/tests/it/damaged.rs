//! One bit flipped in stored objects, one after the other: an answer is the right one or an error that names the object,
//! never another number; what can be made again is.

use std::collections::BTreeSet;

use bytes::Bytes;
use compute::region::weights;
use compute::stats::region_series;
use compute::{ComputeError, Engine, budget, derive_accumulated, point_series};
use contract::budget::BudgetAnswer;
use contract::earth::Earth;
use contract::grid::{Grid, LonLatDeg};
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::quantity::Quantity;
use contract::region::Region;
use contract::series::RegionSeriesQuery;
use contract::time::Period;
use storage::sound::damage;
use storage::verify::{self, Fault};
use storage::{Store, fields, manifests};

use crate::fixture::{folder_store, land, product, total, wavy_year};
use crate::frozen;

/// Four chunks, three of them cut at the edges.
const GRID: Grid = Grid {
    rows: 61,
    cols: 122,
    north_deg: 61.0,
    west_deg: -61.0,
    dlat_deg: 2.0,
    dlon_deg: 1.0,
};
/// Over all four chunks, its weights in none of the stored sums.
const BOX: &str = "-60,-60,60.5,59.5";

async fn landed() -> (tempfile::TempDir, Store) {
    let (folder, store) = folder_store();
    let months = &wavy_year(&GRID)[..2];
    land(&store, &product("wavy"), Quantity::CarbonFlux, GRID, months).await;
    (folder, store)
}

async fn first(store: &Store, kind: Kind) -> ObjectKey {
    store.list(kind.folder()).await.unwrap().remove(0)
}

/// Every byte of the end of an object, where its footer is, and one in many of the rest; in each another bit.
fn bits(content: &Bytes) -> impl Iterator<Item = (usize, u8)> {
    let footer = content.len().saturating_sub(1100);
    let step = (footer / 90).max(1);
    let bytes = (0..footer).step_by(step).chain(footer..content.len());
    bytes.map(|at| (at, 1 << (at % 8)))
}

/// Asks once for each flipped bit; `ask` says whether the answer was the right one, else gives the error. How many were
/// errors.
async fn flipped<F: Future<Output = Result<bool, String>>>(
    store: &Store,
    key: &ObjectKey,
    ask: impl Fn() -> F,
) -> usize {
    let whole = store.get(key).await.unwrap();
    let mut errors = 0;
    for (at, bit) in bits(&whole) {
        let mut flipped = whole.to_vec();
        flipped[at] ^= bit;
        store.put_over(key, flipped.into()).await.unwrap();
        match ask().await {
            Ok(is_right) => assert!(is_right, "{key}: another answer with byte {at} flipped"),
            Err(error) => {
                assert!(error.contains(key.as_str()), "{key}, byte {at}: {error}");
                errors += 1;
            }
        }
    }
    store.put_over(key, whole).await.unwrap();
    errors
}

async fn budget_of_box(store: &Store) -> Result<BudgetAnswer, String> {
    // An engine that has seen nothing of the store: nothing is remembered from before the bit was flipped.
    let engine = Engine::local(store.clone());
    let asked = budget(&engine, &total(&product("wavy"), BOX)).await;
    asked.map_err(|e| e.to_string())
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_of_a_field_is_no_other_budget() {
    let (_folder, store) = landed().await;
    let right = budget_of_box(&store).await.unwrap();
    let field = first(&store, Kind::Field).await;
    let before = damage::count(Kind::Field);
    let errors = flipped(&store, &field, || async {
        budget_of_box(&store).await.map(|answer| answer == right)
    });
    let errors = errors.await;
    assert!(
        errors > 90,
        "{errors} errors only: what was read is not looked at"
    );
    assert!(damage::count(Kind::Field) >= before + errors as u64);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_of_a_field_is_no_other_accumulated_carbon() {
    let (_folder, store) = landed().await;
    let field = first(&store, Kind::Field).await;
    let mut flip = store.get(&field).await.unwrap().to_vec();
    let middle = flip.len() / 3;
    flip[middle] ^= 8;
    store.put_over(&field, flip.into()).await.unwrap();
    let engine = Engine::local(store.clone());
    let derived = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
    let error = derived.unwrap_err().to_string();
    assert!(error.contains(field.as_str()), "{error}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_field_that_is_gone_is_named_where_carbon_is_accumulated() {
    let (_folder, store) = landed().await;
    let key = first(&store, Kind::Field).await;
    store.remove(&key).await.unwrap();
    let engine = Engine::local(store.clone());
    let derived = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
    let error = derived.unwrap_err().to_string();
    assert!(error.contains(key.as_str()), "{error}");
}

/// A damaged footer can make the Parquet library panic: the object is named all the same, whichever bit it was.
#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_end_of_a_field_is_named_where_carbon_is_accumulated() {
    let (_folder, landed) = landed().await;
    let field = first(&landed, Kind::Field).await;
    let mut objects = vec![];
    for key in landed.list("").await.unwrap() {
        let content = landed.get(&key).await.unwrap();
        objects.push((key, content));
    }
    // In a store of its own each time: what was derived before is not derived again.
    let derived = async |content: Bytes| {
        let store = Store::memory();
        for (key, content) in &objects {
            store.put_over(key, content.clone()).await.unwrap();
        }
        store.put_over(&field, content).await.unwrap();
        let engine = Engine::local(store);
        let derived = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
        derived.map_err(|e| e.to_string())
    };
    let whole = landed.get(&field).await.unwrap();
    let right = derived(whole.clone()).await.unwrap();
    let mut errors = 0;
    for (at, bit) in bits(&whole) {
        let mut flipped = whole.to_vec();
        flipped[at] ^= bit;
        match derived(flipped.into()).await {
            Ok(manifest) => assert_eq!(manifest, right, "byte {at}"),
            Err(error) => {
                assert!(error.contains(field.as_str()), "byte {at}: {error}");
                errors += 1;
            }
        }
    }
    assert!(errors > 90, "{errors} errors only: nothing was read");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_of_a_field_or_a_chunk_is_no_other_value_of_a_place() {
    let (_folder, store) = landed().await;
    let place = LonLatDeg::new(3.3, 4.5).unwrap();
    let ask = async || {
        let engine = Engine::local(store.clone());
        let asked = point_series(&engine, &product("wavy"), place).await;
        asked.map_err(|e| e.to_string())
    };
    let right = ask().await.unwrap();
    assert!(right.series.iter().any(|point| point.value.is_some()));
    let field = first(&store, Kind::Field).await;
    let newest = manifests::latest(&store, &product("wavy")).await;
    cube::follow(&store, &newest.unwrap().unwrap())
        .await
        .unwrap();
    let mut chunks = vec![];
    for key in store.list("cubes/wavy/chunks").await.unwrap() {
        chunks.push((store.get(&key).await.unwrap().len(), key));
    }
    let chunk = chunks.into_iter().max().unwrap().1;
    assert_eq!(ask().await.unwrap(), right);
    for (key, is_read) in [(&chunk, true), (&field, false)] {
        let errors = flipped(&store, key, || async {
            ask().await.map(|answer| answer == right)
        });
        let errors = errors.await;
        // What the cube holds is not read from fields.
        assert_eq!(errors > 50, is_read, "{key}: {errors} errors");
    }
    for key in store.list("cubes/wavy").await.unwrap() {
        store.remove(&key).await.unwrap();
    }
    let errors = flipped(&store, &field, || async {
        ask().await.map(|answer| answer == right)
    });
    assert!(errors.await > 50, "there is no cube");
}

#[tokio::test(flavor = "multi_thread")]
async fn damaged_weights_are_computed_again() {
    let (_folder, store) = landed().await;
    let right = budget_of_box(&store).await.unwrap();
    let region: Region = BOX.parse().unwrap();
    let key = weights::key(&GRID, &region, Earth::Wgs84);
    let before = damage::count(Kind::Weights);
    let whole = store.get(&key).await.unwrap();
    let errors = flipped(&store, &key, || async {
        let answer = budget_of_box(&store).await?;
        Ok(answer == right && store.get(&key).await.unwrap() == whole)
    });
    assert_eq!(errors.await, 0);
    assert!(damage::count(Kind::Weights) > before);
}

#[tokio::test(flavor = "multi_thread")]
async fn damaged_sums_are_computed_again() {
    let (_folder, store) = landed().await;
    let engine = Engine::local(store.clone());
    let manifest = manifests::latest(&store, &product("wavy")).await;
    let manifest = manifest.unwrap().unwrap();
    let region: Region = "global".parse().unwrap();
    let weights = weights::RegionKeys::stored(&store, &GRID, &region, Earth::Wgs84).await;
    let weights = weights.unwrap().unwrap();
    let query = RegionSeriesQuery {
        product: product("wavy"),
        region: region.clone(),
        region_name: "global".to_owned(),
        from: None,
        to: None,
        earth: Earth::Wgs84,
        ocean: None,
    };
    let right = region_series(&engine, &query).await.unwrap();
    let measure = compute::budget::Measure::Mean;
    let sums = compute::budget::sums::store(&engine, &manifest, &weights, measure);
    let key = sums.await.unwrap().key;
    let whole = store.get(&key).await.unwrap();
    for at in (0..whole.len()).step_by(17) {
        let mut flip = whole.to_vec();
        flip[at] ^= 1 << (at % 8);
        store.put_over(&key, flip.into()).await.unwrap();
        assert_eq!(region_series(&engine, &query).await.unwrap(), right);
    }
    let stored = compute::budget::sums::store(&engine, &manifest, &weights, measure);
    assert_eq!(stored.await.unwrap().computed_count, 2);
    assert_eq!(store.get(&key).await.unwrap(), whole);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_domain_or_manifest_is_named() {
    let (_folder, store) = landed().await;
    for kind in [Kind::Domain, Kind::Manifest] {
        let key = first(&store, kind).await;
        let whole = store.get(&key).await.unwrap();
        let mut flip = whole.to_vec();
        flip[whole.len() / 2] ^= 1;
        store.put_over(&key, flip.into()).await.unwrap();
        let engine = Engine::local(store.clone());
        let derived = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
        let error = derived.unwrap_err().to_string();
        assert!(error.contains(key.as_str()), "{error}");
        store.put_over(&key, whole).await.unwrap();
    }
}

/// The derived product with a bit flipped in a field or its domain: made again under the same names.
#[tokio::test(flavor = "multi_thread")]
async fn damaged_derived_objects_are_made_again_when_they_are_looked_at() {
    use compute::recompute::{Request, What, plan, run};
    let (_folder, store) = landed().await;
    let engine = Engine::local(store.clone());
    let derived = derive_accumulated(&engine, &product("wavy"), None, &|_| ()).await;
    let derived = derived.unwrap();
    let request = |is_verified| Request {
        product: product("wavy"),
        from: None,
        to: None,
        what: vec![What::Fields],
        is_forced: false,
        is_verified,
    };
    for key in [&derived.steps[1].field, &derived.domain] {
        let whole = store.get(key).await.unwrap();
        let mut flip = whole.to_vec();
        flip[whole.len() / 2] ^= 1;
        store.put_over(key, flip.into()).await.unwrap();
        let unseen = plan(&store, &request(false)).await.unwrap();
        assert!(
            unseen.items.is_empty(),
            "it was read without being asked to"
        );
        let seen = plan(&store, &request(true)).await.unwrap();
        assert!(!seen.items.is_empty(), "{key}");
        let outcome = run(&engine, &seen, &|_| ()).await.unwrap();
        assert_eq!(outcome.derived.unwrap(), derived);
        assert_eq!(store.get(key).await.unwrap(), whole);
        let after = plan(&store, &request(true)).await.unwrap();
        assert!(after.items.is_empty());
    }
}

/// All that is asked of the store below, each answer as text: numbers of a region and a place, of fluxes and of what they
/// add up to, and what a month more comes to.
async fn answers(store: &Store) -> Vec<Result<String, String>> {
    fn text<T: serde::Serialize>(asked: Result<T, ComputeError>) -> Result<String, String> {
        let text = |answer: T| serde_json::to_string(&answer).unwrap();
        asked.map(text).map_err(|e| e.to_string())
    }
    let (flux, carbon) = (product("fgco2"), product("fgco2-accumulated"));
    let engine = Engine::local(store.clone());
    let mut answers = vec![];
    for (id, region) in [
        (&flux, "1,-50,15,55"),
        (&flux, "global"),
        (&carbon, "global"),
    ] {
        answers.push(text(budget(&engine, &total(id, region)).await));
    }
    let means = RegionSeriesQuery {
        product: flux.clone(),
        region: "global".parse().unwrap(),
        region_name: "global".to_owned(),
        from: None,
        to: None,
        earth: Earth::Wgs84,
        ocean: None,
    };
    answers.push(text(region_series(&engine, &means).await));
    let place = LonLatDeg::new(3.5, 10.5).unwrap();
    for id in [&flux, &carbon] {
        answers.push(text(point_series(&engine, id, place).await));
    }
    answers.push(text(
        derive_accumulated(&engine, &flux, None, &|_| ()).await,
    ));
    answers
}

/// The frozen store of all kinds of objects, a month more landed in it that nothing is derived from yet.
async fn store_of_all_kinds() -> (tempfile::TempDir, Store) {
    let (folder, store) = frozen::store(2);
    let (id, flux) = (product("fgco2"), Quantity::CarbonFlux);
    let source = manifests::latest(&store, &id).await.unwrap().unwrap();
    let mut months = vec![];
    for step in &source.steps {
        let values = fields::read(&store, &step.field, &source.grid).await;
        months.push((step.period, values.unwrap()));
    }
    let march = months[1].1.iter().map(|value| value * 0.3).collect();
    months.push((Period::month(2001, 3).unwrap(), march));
    land(&store, &id, flux, source.grid, &months).await;
    (folder, store)
}

/// Each object of a store of all kinds with one bit flipped, alone: it is found by whoever looks through the store, and
/// whoever asks gets the right answer, because what is damaged was not needed or can be made again, or an error with its
/// name.
#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_of_any_object_of_a_store_is_no_other_number() {
    let (_folder, store) = store_of_all_kinds().await;
    let keys = verify::keys(&store, None).await.unwrap();
    let kinds: BTreeSet<Kind> = keys.iter().filter_map(Kind::of).collect();
    assert_eq!(kinds.len(), Kind::ALL.len(), "{kinds:?}");
    let right = answers(&store).await;
    assert!(right.iter().all(Result::is_ok), "{right:?}");
    let mut refused = BTreeSet::new();
    for key in keys {
        let kind = Kind::of(&key).unwrap();
        let (_folder, store) = store_of_all_kinds().await;
        let mut flipped = store.get(&key).await.unwrap().to_vec();
        let at = flipped.len() * 5 / 8;
        flipped[at] ^= 1 << (at % 8);
        store.put_over(&key, flipped.into()).await.unwrap();
        let before = damage::count(kind);
        let all = verify::keys(&store, None).await.unwrap();
        let report = verify::run(&store, &all, &|_, _| ()).await.unwrap();
        // The month more came from no file.
        let findings = report.findings.iter();
        let damaged = findings.filter(|it| it.fault == Fault::Damaged);
        assert_eq!(damaged.map(|it| &it.key).collect::<Vec<_>>(), [&key]);
        assert!(damage::count(kind) > before, "{key} is not counted");
        for (now, right) in answers(&store).await.iter().zip(&right) {
            match now {
                Ok(_) => assert_eq!(now, right, "{key}"),
                Err(error) => {
                    // What names the chunks of a cube is told by the place of the cube.
                    let told = match kind {
                        Kind::Cube => "cubes/fgco2",
                        _ => key.as_str(),
                    };
                    assert!(error.contains(told), "{key}: {error}");
                    refused.insert(kind);
                }
            }
        }
    }
    let needed = [
        Kind::Field,
        Kind::Contributed,
        Kind::Domain,
        Kind::Manifest,
        Kind::Cube,
    ];
    assert_eq!(
        refused,
        needed.into(),
        "what is not asked for tests nothing"
    );
}
