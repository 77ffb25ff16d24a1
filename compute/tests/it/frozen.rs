//! A store as version 0.1.0 wrote it: its answers of then, asked again.

use std::path::{Path, PathBuf};

use compute::{Engine, budget, derive_accumulated, point_series};
use contract::grid::LonLatDeg;
use storage::{Store, manifests};

use crate::fixture::{product, total};

fn frozen() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../storage/tests/frozen/1")
}

/// A copy of the frozen store: what is asked of it stores weights.
fn store() -> (tempfile::TempDir, Store) {
    fn copy_all(from: &Path, to: &Path) {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            let to = to.join(entry.file_name());
            if entry.file_type().unwrap().is_dir() {
                copy_all(&entry.path(), &to);
            } else {
                std::fs::copy(entry.path(), to).unwrap();
            }
        }
    }
    let folder = tempfile::tempdir().unwrap();
    copy_all(&frozen().join("objects"), folder.path());
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

fn answer_of_then(name: &str) -> serde_json::Value {
    let text = std::fs::read_to_string(frozen().join(name)).unwrap();
    serde_json::from_str(&text).unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_budget_of_the_frozen_store_is_what_it_was() {
    let (_folder, store) = store();
    let engine = Engine::local(store);
    for (region, name) in [
        ("1,-50,15,55", "budget-box.json"),
        ("global", "budget-global.json"),
    ] {
        let now = budget(&engine, &total(&product("fgco2"), region)).await;
        let now = serde_json::to_value(now.unwrap()).unwrap();
        let then = answer_of_then(name);
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
async fn a_place_of_the_frozen_store_has_the_series_that_it_had() {
    let (_folder, store) = store();
    let engine = Engine::local(store);
    let place = LonLatDeg::new(3.5, 10.5).unwrap();
    let now = point_series(&engine, &product("fgco2"), place).await;
    let now = serde_json::to_value(now.unwrap()).unwrap();
    let then = answer_of_then("point.json");
    let steps = then["series"].as_array().unwrap();
    assert_eq!(steps.len(), 2);
    for (step, then) in steps.iter().enumerate() {
        let now = &now["series"][step];
        assert_eq!(
            (&now["start"], &now["value"]),
            (&then["start"], &then["value"])
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flipped_bit_of_an_old_frame_is_an_error_though_its_rows_have_no_checks() {
    let (_folder, store) = store();
    let manifest = manifests::latest(&store, &product("fgco2")).await;
    let frame = manifest.unwrap().unwrap().steps[0].frame.clone();
    let whole = store.get(&frame).await.unwrap();
    for at in (0..whole.len()).step_by(97) {
        let mut flip = whole.to_vec();
        flip[at] ^= 1 << (at % 8);
        store.put_over(&frame, flip.into()).await.unwrap();
        // A handle that has not seen it whole.
        let store = Store::open(store.url()).unwrap();
        let engine = Engine::local(store);
        let asked = budget(&engine, &total(&product("fgco2"), "1,-50,15,50")).await;
        let error = asked.unwrap_err().to_string();
        assert!(error.contains(frame.as_str()), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_was_derived_then_is_kept_now() {
    let (_folder, store) = store();
    let engine = Engine::local(store.clone());
    let target = product("fgco2-accumulated");
    let then = manifests::latest(&store, &target).await.unwrap().unwrap();
    let now = derive_accumulated(&engine, &product("fgco2"), None, &|_| ()).await;
    let now = now.unwrap();
    let frames = |m: &contract::manifest::Manifest| {
        m.steps
            .iter()
            .map(|step| step.frame.clone())
            .collect::<Vec<_>>()
    };
    assert_eq!(
        frames(&now),
        frames(&then),
        "the same values are no revision"
    );
}
