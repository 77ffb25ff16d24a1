//! Stores as earlier versions wrote them (`storage/tests/frozen`): their answers of then, asked again.

use compute::budget::{Measure, sums};
use compute::region::weights::RegionKeys;
use compute::stats::region_series;
use compute::{Engine, budget, derive_accumulated, point_series};
use contract::earth::Earth;
use contract::grid::LonLatDeg;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, OLDEST_MANIFEST_SCHEMA};
use contract::region::Region;
use contract::series::RegionSeriesQuery;
use contract::time::Period;
use storage::{Store, domain, fields, manifests};
use test_data::frozen;

use crate::fixture::{folder_store, land, product, total};

/// A copy of a frozen store: what is asked of it stores weights.
pub(crate) fn store(version: u32) -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    frozen::copy(version, "objects", folder.path());
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

async fn newest(store: &Store, name: &str) -> Manifest {
    let latest = manifests::latest(store, &product(name)).await;
    latest.unwrap().unwrap()
}

fn answer_of_then(version: u32, name: &str) -> serde_json::Value {
    let text = std::fs::read_to_string(frozen::folder(version).join(name)).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_budget_of_the_frozen_store_is_what_it_was() {
    let (_folder, store) = store(1);
    let engine = Engine::local(store);
    for (region, name) in [
        ("1,-50,15,55", "budget-box.json"),
        ("global", "budget-global.json"),
    ] {
        let now = budget(&engine, &total(&product("fgco2"), region)).await;
        let now = serde_json::to_value(now.unwrap()).unwrap();
        let then = answer_of_then(1, name);
        assert_eq!(now["manifest"], then["manifest"]);
        for what in ["start", "end", "budget_kg", "area_m2"] {
            assert_eq!(
                now["rows"][0][what], then["rows"][0][what],
                "{region}: {what}"
            );
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_place_of_a_frozen_store_has_the_series_that_it_had() {
    let place = LonLatDeg::new(3.5, 10.5).unwrap();
    let then = answer_of_then(1, "point.json");
    let steps = then["series"].as_array().unwrap();
    assert_eq!(steps.len(), 2);
    for version in OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA {
        let (_folder, store) = store(version);
        let engine = Engine::local(store);
        let now = point_series(&engine, &product("fgco2"), place).await;
        let now = serde_json::to_value(now.unwrap()).unwrap();
        for (step, then) in steps.iter().enumerate() {
            let now = &now["series"][step];
            assert_eq!(now["start"], then["start"]);
            assert!(is_near(&now["value"], &then["value"]), "{version}: {now}");
        }
    }
}

/// The same values went into every frozen store, but for the rounding of a file that version 1 read.
fn is_near(a: &serde_json::Value, b: &serde_json::Value) -> bool {
    // Exact masses are text.
    let number = |it: &serde_json::Value| match it.as_str() {
        Some(text) => text.parse::<f64>().unwrap(),
        None => it.as_f64().unwrap(),
    };
    (number(a) / number(b) - 1.0).abs() < 1e-6
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_of_an_old_field_is_an_error_though_its_rows_have_no_checks() {
    let (_folder, store) = store(1);
    let field = newest(&store, "fgco2").await.steps[0].field.clone();
    let whole = store.get(&field).await.unwrap();
    for at in (0..whole.len()).step_by(97) {
        let mut flip = whole.to_vec();
        flip[at] ^= 1 << (at % 8);
        store.put_over(&field, flip.into()).await.unwrap();
        // A handle that has not seen it whole.
        let store = Store::open(store.url()).unwrap();
        let engine = Engine::local(store);
        let asked = budget(&engine, &total(&product("fgco2"), "1,-50,15,50")).await;
        let error = asked.unwrap_err().to_string();
        assert!(error.contains(field.as_str()), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_derived_then_is_kept_now() {
    let fields = |manifest: &Manifest| {
        let steps = manifest.steps.iter();
        steps.map(|step| step.field.clone()).collect::<Vec<_>>()
    };
    for version in OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA {
        let (_folder, store) = store(version);
        let engine = Engine::local(store.clone());
        let then = newest(&store, "fgco2-accumulated").await;
        let now = derive_accumulated(&engine, &product("fgco2"), None, &|_| ()).await;
        let now = now.unwrap();
        assert_eq!(
            fields(&now),
            fields(&then),
            "{version}: the same values are no revision"
        );
        if version == MANIFEST_SCHEMA {
            assert_eq!(now, then);
        }
    }
}

const MEASURES: [Measure; 2] = [Measure::Mass, Measure::Mean];

async fn global_weights(store: &Store, source: &Manifest) -> RegionKeys {
    let region: Region = "global".parse().unwrap();
    let keys = RegionKeys::stored(store, &source.grid, &region, Earth::Wgs84).await;
    keys.unwrap().unwrap()
}

/// Writes what this crate makes of the products of a store: derived steps, and stored sums of the whole earth.
async fn write(store: &Store) {
    let engine = Engine::local(store.clone());
    let derived = derive_accumulated(&engine, &product("fgco2"), None, &|_| ()).await;
    derived.unwrap();
    let source = newest(store, "fgco2").await;
    let weights = global_weights(store, &source).await;
    for measure in MEASURES {
        let stored = sums::store(&engine, &source, &weights, measure).await;
        stored.unwrap();
    }
}

/// Keys of what this crate writes, of the products above.
async fn own(store: &Store) -> Vec<ObjectKey> {
    let mut keys = vec![];
    for kind in Kind::ALL {
        keys.extend(store.list(kind.folder()).await.unwrap());
    }
    let is_own = |key: &ObjectKey| {
        // What a cube is made of has random names.
        let is_derived = key.as_str().contains("/fgco2-accumulated/");
        let is_derived = is_derived && Kind::of(key) != Some(Kind::Cube);
        is_derived || matches!(Kind::of(key), Some(Kind::Sums | Kind::Accumulating))
    };
    keys.retain(is_own);
    keys
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_derived_now_is_named_as_in_the_newest_frozen_store() {
    if let Some(folder) = frozen::to_freeze() {
        let store = Store::open(folder.join("objects").to_str().unwrap()).unwrap();
        write(&store).await;
        let answer = budget(&Engine::local(store), &total(&product("fgco2"), "global")).await;
        let answer = serde_json::to_value(answer.unwrap()).unwrap();
        std::fs::write(folder.join("budget-global.json"), format!("{answer:#}\n")).unwrap();
    }
    let (_folder, kept) = store(MANIFEST_SCHEMA);
    let (_other_folder, now) = store(MANIFEST_SCHEMA);
    for key in own(&now).await {
        now.remove(&key).await.unwrap();
    }
    write(&now).await;
    // Values along time lie in cubes now; what was frozen has a series of its own. A domain was a byte a cell.
    let named = async |store: &Store| {
        let mut keys = own(store).await;
        keys.retain(|key| !matches!(Kind::of(key), Some(Kind::Series | Kind::Domain)));
        keys
    };
    assert_eq!(named(&kept).await, named(&now).await);
    let cells = async |store: &Store| {
        let domain = newest(store, "fgco2-accumulated").await.domain;
        domain::read(store, &domain).await.unwrap()
    };
    assert_eq!(cells(&kept).await, cells(&now).await);
    for key in own(&kept).await {
        if matches!(Kind::of(&key), Some(Kind::Manifest | Kind::Sums)) {
            let of = async |store: &Store| -> serde_json::Value {
                let content = store.get(&key).await.unwrap();
                let mut document: serde_json::Value = serde_json::from_slice(&content).unwrap();
                if document.get("series").is_some() {
                    document["series"] = serde_json::json!([]);
                    document["domain"] = serde_json::Value::Null;
                    // The seal is of both too.
                    document["sha256"] = serde_json::Value::Null;
                }
                document
            };
            assert_eq!(of(&kept).await, of(&now).await);
        }
    }
}

async fn without_fields(store: &Store, source: &Manifest) {
    for step in &source.steps {
        store.remove(&step.field).await.unwrap();
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn frozen_sums_answer_where_no_field_can() {
    let (_folder, kept) = store(2);
    let source = newest(&kept, "fgco2").await;
    without_fields(&kept, &source).await;
    let engine = Engine::local(kept);
    let global = total(&product("fgco2"), "global");
    let now = budget(&engine, &global).await.unwrap();
    let now = serde_json::to_value(now).unwrap();
    let [then, of_1] = [2, 1].map(|version| answer_of_then(version, "budget-global.json"));
    for what in ["budget_kg", "area_m2"] {
        let now = &now["rows"][0][what];
        assert_eq!(now, &then["rows"][0][what], "{what}");
        assert!(is_near(now, &of_1["rows"][0][what]), "{what}: {now}");
    }
    let means = RegionSeriesQuery {
        product: product("fgco2"),
        region: "global".parse().unwrap(),
        region_name: "global".to_owned(),
        from: None,
        to: None,
        earth: Earth::Wgs84,
        ocean: None,
    };
    let means = region_series(&engine, &means).await.unwrap();
    let january = &means.series[0];
    assert!(january.mean.is_some() && january.start == source.steps[0].period.start);
    let elsewhere = budget(&engine, &total(&product("fgco2"), "1,-50,15,55")).await;
    assert!(elsewhere.is_err(), "there are fields: this tests nothing");
    // Sums of version 1 had other bits: they have other names, and nobody asks for them.
    let (_folder, old) = store(1);
    without_fields(&old, &newest(&old, "fgco2").await).await;
    assert!(budget(&Engine::local(old), &global).await.is_err());
}

/// A month more: what it follows from is kept exactly, and its fields are gone.
#[tokio::test(flavor = "multi_thread")]
async fn frozen_exact_sums_are_gone_on_from() {
    let (_folder, kept) = store(2);
    let source = newest(&kept, "fgco2").await;
    let mut months = vec![];
    for step in &source.steps {
        let values = fields::read(&kept, &step.field, &source.grid)
            .await
            .unwrap();
        months.push((step.period, values));
    }
    let march = months[1].1.iter().map(|value| value * 0.3).collect();
    months.push((Period::month(2001, 3).unwrap(), march));
    let (id, grid, quantity) = (product("fgco2"), source.grid, source.quantity);
    land(&kept, &id, quantity, grid, &months).await;
    without_fields(&kept, &source).await;
    let gone_on = derive_accumulated(&Engine::local(kept), &id, None, &|_| ()).await;
    let gone_on = gone_on.unwrap();
    let (_folder, fresh) = folder_store();
    land(&fresh, &id, quantity, grid, &months).await;
    let from_nothing = derive_accumulated(&Engine::local(fresh), &id, None, &|_| ()).await;
    assert_eq!(gone_on.steps.len(), 3);
    for (now, expected) in gone_on.steps.iter().zip(from_nothing.unwrap().steps) {
        assert_eq!(
            (&now.field, &now.contributed),
            (&expected.field, &expected.contributed)
        );
    }
}
