//! Stores of others that are no longer where they were attached: what is said then.

use ingest::attach::{Request, refresh};
use storage::{Store, fields};

use crate::attached::{Own, readable, request};
use crate::attached_again::deep;

/// Has the store gone from its address: with its folder, or from it.
fn lose(own: &Own, with_its_folder: bool) {
    std::fs::remove_dir_all(own.path()).unwrap();
    if !with_its_folder {
        std::fs::create_dir_all(own.path()).unwrap();
    }
}

fn assert_told(error: &str, own: &Own, words: &[&str]) {
    let place = own.path().display().to_string();
    let said = [place.as_str(), "its store is no longer there"];
    for word in said.iter().chain(words) {
        assert!(error.contains(word), "{word:?}: {error}");
    }
    assert!(!error.contains("--refresh"), "{error}");
}

#[tokio::test]
async fn a_store_that_is_gone_is_to_be_attached_where_it_is_now_and_not_refreshed() {
    for (with_its_folder, said) in [
        (true, "there is no such folder"),
        (false, "is neither a Zarr group"),
    ] {
        let own = Own::with("v2-plain.zarr");
        own.attach().await.unwrap();
        let newest = own.newest().await;
        let read = async |store: &Store, step: usize| {
            let values = fields::read(store, &newest.steps[step].field, &newest.grid).await;
            values.map_err(|e| e.to_string())
        };
        // One reader has it open already: each chunk is then one that is not there.
        let (before, after) = (readable(&own.store.bare()), readable(&own.store.bare()));
        read(&before, 0).await.unwrap();
        lose(&own, with_its_folder);
        let advice = "`fluxglobe attach URL --variable sst --product sst --replace`";
        for store in [before, after] {
            let error = read(&store, 1).await.unwrap_err();
            assert_told(
                &error,
                &own,
                &[said, advice, "step 2020-01-02", "array sst"],
            );
        }
        let product = "sst".parse().unwrap();
        let error = refresh(&own.store, &product, &|_, _| ()).await.unwrap_err();
        assert_told(&error.to_string(), &own, &[said, advice]);
    }
}

#[tokio::test]
async fn how_it_is_attached_elsewhere_is_said_with_the_index_that_is_read() {
    let own = deep();
    let request = Request {
        product: Some("sst".parse().unwrap()),
        indexes: vec![("depth".to_owned(), 1)],
        ..request(own.path().to_str().unwrap(), "sst")
    };
    own.ask(&request).await.unwrap();
    lose(&own, true);
    let product = "sst".parse().unwrap();
    let error = refresh(&own.store, &product, &|_, _| ()).await.unwrap_err();
    let advice = "--variable sst --index depth=1 --product sst --replace";
    assert_told(&error.to_string(), &own, &[advice]);
}
