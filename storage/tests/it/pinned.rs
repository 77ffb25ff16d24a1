//! What clean-up leaves for being pinned.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use bytes::Bytes;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, ManifestId, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use futures::FutureExt as _;
use object_store::ObjectStoreExt as _;
use object_store::path::Path;
use storage::gc::{self, GcPlan, Keep, Owner, Versions};
use storage::pins::{self, Pinned};
use storage::{Store, domain, fields, manifests};

const GRID: Grid = Grid {
    rows: 3,
    cols: 5,
    north_deg: 3.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};
const OWNERS: [&dyn Owner; 1] = [&Versions];
const KEEP: Keep = Keep {
    versions: 1,
    age: Duration::from_hours(24),
};

fn product(name: &str) -> ProductId {
    name.parse().unwrap()
}

fn in_days(days: i64) -> TimeMs {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    TimeMs::new(since.as_millis() as i64 + days * 86_400_000).unwrap()
}

/// Publishes a version of one month, which shares nothing with others.
async fn publish(store: &Store, name: &str, number: u64, source: Option<ManifestId>) -> Manifest {
    let id = product(name);
    let raw = format!("{name} {number}");
    let raw_sha256 = Digest::of(raw.as_bytes());
    let key = ObjectKey::raw(&id, &raw_sha256);
    store.put_new(&key, raw.into()).await.unwrap();
    let period = Period::month(2000, 1).unwrap();
    let values = [number as f32; 15];
    let field = fields::write(store, &id, &GRID, &values, period).await;
    let mut cells = [true; 15];
    cells[number as usize] = false;
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        product: id.clone(),
        number,
        title: "t".to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: "s".to_owned(),
        grid: GRID,
        steps: vec![Step {
            period,
            field: field.unwrap(),
            raw_sha256,
            origin: "a.nc".to_owned(),
            valid_cells: 15,
            contributed: None,
            masked: None,
        }],
        domain: domain::write(store, &id, &cells).await.unwrap(),
        indexes: vec![],
        series: vec![],
        derived_from: source,
        computed: None,
        notices: vec![],
    };
    manifests::commit(store, &manifest).await.unwrap();
    manifest
}

async fn three_versions(store: &Store) -> Vec<Manifest> {
    let mut all = vec![];
    for number in 1..=3 {
        all.push(publish(store, "p", number, None).await);
    }
    all
}

async fn pin(store: &Store, manifest: &Manifest, because: Option<&str>) -> Pinned {
    let because = because.map(str::to_owned);
    let pinned = pins::pin(store, manifest, because, in_days(0)).await;
    pinned.unwrap()
}

/// What is there of a version: its manifest, its field, its domain, its input file.
async fn there(store: &Store, manifest: &Manifest) -> usize {
    let step = &manifest.steps[0];
    let mut count = 0;
    for key in [
        ObjectKey::manifest(&manifest.product, manifest.number),
        step.field.clone(),
        manifest.domain.clone(),
        ObjectKey::raw(&manifest.product, &step.raw_sha256),
    ] {
        count += usize::from(store.exists(&key).await.unwrap());
    }
    count
}

async fn planned(store: &Store) -> GcPlan {
    gc::plan(store, &OWNERS, KEEP, in_days(2)).await.unwrap()
}

async fn clean(store: &Store) -> usize {
    let plan = planned(store).await;
    let removed = gc::run(store, &OWNERS, &plan, KEEP, &|_done| ()).await;
    removed.unwrap()
}

#[tokio::test]
async fn a_pinned_version_stays_with_all_that_it_names_until_it_is_released() {
    let store = Store::memory();
    let all = three_versions(&store).await;
    assert_eq!(pin(&store, &all[0], Some("a paper")).await, Pinned::Now);
    // The newest is kept anyway.
    assert_eq!(pin(&store, &all[2], None).await, Pinned::Now);
    let plan = planned(&store).await;
    assert_eq!((plan.garbage.len(), plan.only_pinned_count), (4, 1));
    assert_eq!(clean(&store).await, 4);
    for (manifest, parts) in all.iter().zip([4, 0, 4]) {
        assert_eq!(there(&store, manifest).await, parts, "{}", manifest.number);
    }
    let first = manifests::load(&store, &all[0].id()).await.unwrap();
    let values = fields::read(&store, &first.steps[0].field, &GRID).await;
    assert_eq!(values.unwrap(), [1.0; 15]);
    // Pins are no garbage, however old.
    assert_eq!(pins::all(&store).await.unwrap().len(), 2);
    assert!(pins::release(&store, &product("p"), 1).await.unwrap());
    assert!(!pins::release(&store, &product("p"), 1).await.unwrap());
    assert_eq!(planned(&store).await.only_pinned_count, 0);
    assert_eq!(clean(&store).await, 4);
    assert_eq!(there(&store, &all[0]).await, 0);
    assert_eq!(there(&store, &all[2]).await, 4);
}

#[tokio::test]
async fn what_a_pinned_version_was_derived_from_stays_with_it() {
    let store = Store::memory();
    let sources = three_versions(&store).await;
    let first = publish(&store, "d", 1, Some(sources[1].id())).await;
    publish(&store, "d", 2, Some(sources[2].id())).await;
    pin(&store, &first, None).await;
    clean(&store).await;
    for (manifest, parts) in sources.iter().chain([&first]).zip([0, 4, 4, 4]) {
        assert_eq!(there(&store, manifest).await, parts, "{}", manifest.id());
    }
}

#[tokio::test]
async fn a_version_is_pinned_once_with_the_reason_of_then() {
    let store = Store::memory();
    let all = three_versions(&store).await;
    pin(&store, &all[0], Some("a paper")).await;
    let Pinned::Before(before) = pin(&store, &all[0], Some("another")).await else {
        panic!("it was pinned before")
    };
    assert_eq!(before.version, all[0].id());
    assert_eq!(before.because.as_deref(), Some("a paper"));
    let found = pins::of_number(&store, &product("p"), 1).await.unwrap();
    assert_eq!(found, Some(before));
    let none = pins::of_number(&store, &product("p"), 2).await.unwrap();
    assert_eq!(none, None);
}

#[tokio::test]
async fn a_version_that_is_not_there_or_has_lost_a_field_is_not_pinned() {
    let store = Store::memory();
    let all = three_versions(&store).await;
    let first = ObjectKey::manifest(&product("p"), 1);
    store.remove(&first).await.unwrap();
    store.remove(&all[1].steps[0].field).await.unwrap();
    for (manifest, said) in [(&all[0], "never published"), (&all[1], "fields of it")] {
        let Pinned::Not(reason) = pin(&store, manifest, None).await else {
            panic!("{} cannot be kept", manifest.id())
        };
        assert!(reason.contains(said), "{reason}");
    }
    assert_eq!(pins::all(&store).await.unwrap(), []);
}

#[tokio::test]
async fn a_damaged_pin_is_named_and_nothing_is_removed_before_it_is_released() {
    let store = Store::memory();
    let all = three_versions(&store).await;
    pin(&store, &all[0], Some("a paper")).await;
    let plan = planned(&store).await;
    let key = ObjectKey::pin(&product("p"), 1);
    let mut flipped = store.get(&key).await.unwrap().to_vec();
    flipped[20] ^= 1;
    store.put_over(&key, flipped.into()).await.unwrap();
    let refused = gc::plan(&store, &OWNERS, KEEP, in_days(2)).await;
    let refused = refused.unwrap_err().to_string();
    for said in [key.as_str(), "keep --release p@1"] {
        assert!(refused.contains(said), "{refused}");
    }
    assert!(
        gc::run(&store, &OWNERS, &plan, KEEP, &|_done| ())
            .await
            .is_err()
    );
    assert_eq!(there(&store, &all[1]).await, 4, "nothing was removed");
    assert!(pins::release(&store, &product("p"), 1).await.unwrap());
    assert_eq!(clean(&store).await, 8);
}

/// Puts an object while others wait, as another process does.
fn put_now(store: &Store, key: &ObjectKey, content: &Bytes) {
    let (objects, path) = (store.object_store(), Path::from(key.as_str()));
    let put = objects.put(&path, content.clone().into()).now_or_never();
    put.expect("memory is there at once").unwrap();
}

#[tokio::test]
async fn a_version_that_is_pinned_while_others_are_removed_stays_whole() {
    let store = Store::memory();
    let all = three_versions(&store).await;
    pin(&store, &all[1], None).await;
    let key = ObjectKey::pin(&product("p"), 2);
    let pinned = store.get(&key).await.unwrap();
    pins::release(&store, &product("p"), 2).await.unwrap();
    let plan = planned(&store).await;
    assert_eq!(plan.garbage.len(), 8);
    // After the manifest of the first version has gone, and before that of the second.
    let progress = |done: usize| {
        if done == 1 {
            put_now(&store, &key, &pinned);
        }
    };
    let removed = gc::run(&store, &OWNERS, &plan, KEEP, &progress).await;
    assert_eq!(removed.unwrap(), 4);
    for (manifest, parts) in all.iter().zip([0, 4, 4]) {
        assert_eq!(there(&store, manifest).await, parts, "{}", manifest.number);
    }
}

#[tokio::test]
async fn a_version_that_is_pinned_when_it_has_just_gone_is_told() {
    let store = Store::memory();
    let all = three_versions(&store).await;
    pin(&store, &all[0], None).await;
    let key = ObjectKey::pin(&product("p"), 1);
    let pinned = store.get(&key).await.unwrap();
    pins::release(&store, &product("p"), 1).await.unwrap();
    let plan = planned(&store).await;
    let progress = |done: usize| {
        if done == 1 {
            put_now(&store, &key, &pinned);
        }
    };
    let lost = gc::run(&store, &OWNERS, &plan, KEEP, &progress).await;
    let lost = lost.unwrap_err().to_string();
    assert!(lost.contains("manifests/p/0000000001.json"), "{lost}");
}
