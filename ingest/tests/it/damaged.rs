//! Stored objects with a flipped bit: found when files are read anew, and made whole again from `raw/`; and a store of an
//! earlier version, whose fields are named otherwise and are no others for that.

use std::path::PathBuf;

use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use contract::manifest::Manifest;
use ingest::reread::{self, Reason, Request, Workplace};
use storage::{Store, verify};

use crate::fixture::{Place, SmallFile, settings};

fn request(product: &str) -> Request {
    Request {
        product: product.parse().unwrap(),
        from: None,
        to: None,
        profile: None,
        is_forced: false,
        is_verified: true,
    }
}

fn workplace(place: &Place) -> Workplace {
    Workplace::new(settings(), place.path("spool"), 1 << 30)
}

/// What is planned for a request, and what its run publishes.
async fn reread(place: &Place, request: &Request) -> (Vec<Reason>, Option<Manifest>) {
    let workplace = workplace(place);
    let profiles = &workplace.settings.profiles;
    let plan = reread::plan(&place.store, profiles, request).await.unwrap();
    let reasons = plan.items.iter().map(|item| item.reason).collect();
    let ran = reread::run(&place.store, &plan, request, &workplace, &|_| ()).await;
    (reasons, ran.unwrap())
}

async fn flip(store: &Store, key: &ObjectKey) {
    let mut content = store.get(key).await.unwrap().to_vec();
    let middle = content.len() / 2;
    content[middle] ^= 2;
    store.put_over(key, content.into()).await.unwrap();
    assert!(
        store.get(key).await.is_err(),
        "{key}: the fault is not seen"
    );
}

async fn landed() -> (Place, PathBuf, Manifest) {
    let place = Place::new();
    let path = place.path("small.nc");
    SmallFile::new().write_classic(&path);
    let outcomes = place.land(std::slice::from_ref(&path)).await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    let product = outcomes[0].manifest().unwrap().product.clone();
    let manifest = place.newest(product.as_str()).await;
    (place, path, manifest)
}

#[tokio::test]
async fn damaged_fields_and_domains_are_whole_again_under_their_names() {
    let (place, _path, manifest) = landed().await;
    let request = request(manifest.product.as_str());
    let store = &place.store;
    for (key, reasons) in [
        (&manifest.steps[1].field, vec![Reason::Missing]),
        (&manifest.domain, vec![]),
    ] {
        let whole = store.get(key).await.unwrap();
        flip(store, key).await;
        assert_eq!(reread(&place, &request).await, (reasons, None));
        let place_to_work = workplace(&place);
        let mended = reread::mend(store, &request.product, &place_to_work);
        let mended = mended.await.unwrap();
        assert_eq!(mended.is_none(), Kind::of(key) == Some(Kind::Field));
        assert_eq!(store.get(key).await.unwrap(), whole);
        assert_eq!(place.newest(request.product.as_str()).await, manifest);
    }
    let keys = verify::keys(store, None).await.unwrap();
    let report = verify::run(store, &keys, &|_, _| ()).await.unwrap();
    assert_eq!((report.findings, report.unsealed_count), (vec![], 0));
}

#[tokio::test]
async fn a_damaged_input_file_is_replaced_when_it_is_given_again() {
    let (place, path, manifest) = landed().await;
    let key = ObjectKey::raw(&manifest.product, &manifest.steps[0].raw_sha256);
    flip(&place.store, &key).await;
    let outcomes = place.land(&[path]).await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    assert!(place.store.get(&key).await.is_ok());
    assert_eq!(place.newest(manifest.product.as_str()).await, manifest);
}

#[tokio::test]
async fn a_damaged_note_of_a_reading_is_written_again() {
    let (place, _path, manifest) = landed().await;
    let key = place.store.list("readings").await.unwrap().remove(0);
    let whole = place.store.get(&key).await.unwrap();
    flip(&place.store, &key).await;
    let (reasons, published) = reread(&place, &request(manifest.product.as_str())).await;
    assert_eq!((reasons, published), (vec![Reason::Missing], None));
    assert_eq!(place.store.get(&key).await.unwrap(), whole);
}

/// A place whose store is a copy of the one that version 0.1.0 wrote.
fn frozen() -> Place {
    let place = Place::new();
    test_data::frozen::copy(1, "objects", &place.path("objects"));
    let store = Store::open(place.path("objects").to_str().unwrap()).unwrap();
    Place { store, ..place }
}

#[tokio::test]
async fn the_same_values_under_names_of_before_are_no_revision() {
    let place = frozen();
    let before = place.newest("fgco2").await;
    let forced = Request {
        is_forced: true,
        ..request("fgco2")
    };
    let (reasons, published) = reread(&place, &forced).await;
    assert_eq!(reasons, [Reason::Forced]);
    // What was masked is counted now, and was not then: a new version, of the same objects.
    let after = published.unwrap();
    let fields = |manifest: &Manifest| {
        let fields = manifest.steps.iter().map(|step| step.field.clone());
        fields.collect::<Vec<_>>()
    };
    assert_eq!(fields(&after), fields(&before));
    assert_eq!(&after.domain, &before.domain);
    assert!(after.series.is_empty() && !before.series.is_empty());
    // Nor is the file, however it comes again.
    let raw = ObjectKey::raw(&before.product, &before.steps[0].raw_sha256);
    let path = place.path("frozen-flux.nc");
    std::fs::write(&path, place.store.get(&raw).await.unwrap()).unwrap();
    place.land(&[path]).await;
    assert_eq!(place.newest("fgco2").await, after);
}

#[tokio::test]
async fn a_damaged_field_of_before_is_replaced_by_one_that_is_named_by_its_values() {
    let place = frozen();
    let before = place.newest("fgco2").await;
    let right = place.values(&before, 0).await;
    flip(&place.store, &before.steps[0].field).await;
    let (reasons, published) = reread(&place, &request("fgco2")).await;
    assert_eq!(reasons, [Reason::Stale]);
    let after = published.unwrap();
    assert!(matches!(after.steps[0].field.vouches(), Vouched::Values(_)));
    assert_eq!(after.steps[1].field, before.steps[1].field);
    let now = place.values(&after, 0).await;
    assert!(
        now.iter()
            .zip(&right)
            .all(|(a, b)| a.to_bits() == b.to_bits())
    );
}
