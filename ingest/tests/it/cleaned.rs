//! Clean-up of what landing notes down.

use std::time::{Duration, SystemTime, UNIX_EPOCH};

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::time::TimeMs;
use ingest::{LandingNotes, Readings};
use storage::gc::{self, Keep, Kept, Owner, Versions};
use storage::{StorageError, Store};

use crate::attached::Own;
use crate::fixture::{Place, SmallFile};

const OWNERS: [&dyn Owner; 3] = [&Versions, &Readings, &LandingNotes];
const KEEP: Keep = Keep {
    versions: 1,
    age: Duration::from_hours(24),
};

async fn doomed(store: &Store, days: i64) -> Vec<String> {
    let since = SystemTime::now().duration_since(UNIX_EPOCH).unwrap();
    let then = TimeMs::new(since.as_millis() as i64 + days * 86_400_000).unwrap();
    let plan = gc::plan(store, &OWNERS, KEEP, then).await.unwrap();
    plan.garbage.iter().map(|g| g.key.to_string()).collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_known_of_a_raw_file_goes_with_it() {
    let place = Place::new();
    let path = place.path("flux.nc");
    let mut raws = vec![];
    for value in [1.0, 2.0] {
        let mut file = SmallFile::new().first_month();
        file.values[9] = value;
        file.write_classic(&path);
        let outcomes = place.land(std::slice::from_ref(&path)).await;
        assert!(!outcomes[0].is_rejected(), "{outcomes:?}");
        let raw = Digest::of(&std::fs::read(&path).unwrap()).to_string();
        raws.push(raw);
    }
    assert!(doomed(&place.store, 0).await.is_empty());
    let gone = doomed(&place.store, 2).await;
    let readings: Vec<_> = gone
        .iter()
        .filter(|key| key.starts_with("readings/"))
        .collect();
    assert_eq!(readings.len(), 1, "{gone:?}");
    assert!(readings[0].contains(&raws[0]) && !gone.iter().any(|key| key.contains(&raws[1])));
}

#[tokio::test(flavor = "multi_thread")]
async fn notes_of_landings_stay_as_long_as_a_notice_may_come_again() {
    let place = Place::new();
    let note = format!("landings/flux/{}-3-17", Digest::of(b"raw"));
    let content = "granule.notice/3/17";
    place
        .store
        .put_new(&note.parse().unwrap(), content.into())
        .await
        .unwrap();
    assert!(doomed(&place.store, 0).await.is_empty());
    // Other old things go after a day; a topic keeps notices for 30.
    assert!(doomed(&place.store, 31).await.is_empty());
    assert_eq!(doomed(&place.store, 46).await, [note]);
}

#[tokio::test]
async fn what_references_that_cannot_be_read_refer_to_stays() {
    let own = Own::with("v2-plain.zarr");
    own.attach().await.unwrap();
    let mut version = own.newest().await;
    let attachment = ObjectKey::raw(&version.product, &version.steps[0].raw_sha256);
    // Where the product was attached again, the version names what it was attached to before.
    for step in &mut version.steps {
        step.raw_sha256 = Digest::of(b"before");
    }
    let kept = Kept {
        manifests: vec![version],
        versions: 1,
        pinned: vec![],
        only_pinned_count: 0,
        oldest_ms: i64::MAX,
    };
    let in_use = Versions.in_use(&own.store, &kept).await.unwrap();
    assert!(in_use.contains(&attachment));
    let bare = own.store.bare();
    for step in &kept.manifests[0].steps {
        let path = object_store::path::Path::from(step.field.as_str());
        let objects = bare.object_store();
        let found = object_store::ObjectStoreExt::get(&objects, &path).await;
        let mut reference = found.unwrap().bytes().await.unwrap().to_vec();
        let middle = reference.len() / 2;
        reference[middle] ^= 1;
        bare.put_over(&step.field, reference.into()).await.unwrap();
        let read = own.store.reference(&step.field).await;
        assert!(
            matches!(read, Err(StorageError::Damaged { .. })),
            "{read:?}"
        );
    }
    let in_use = Versions.in_use(&own.store, &kept).await.unwrap();
    assert!(in_use.contains(&attachment));
}
