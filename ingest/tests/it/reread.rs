//! Files read anew from the store: after a change of their profile, in part, again after a run that ended early, and when
//! they cannot be read.

use std::path::PathBuf;

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::manifest::Manifest;
use ingest::reread::{self, Plan, Reason, Request, Workplace};
use ingest::{IngestError, Profile, Profiles};
use storage::manifests;

use crate::fixture::{Place, SmallFile, settings};

const PRODUCT: &str = "mine";
/// First days of the files' months.
const SINCE: [&str; 3] = [
    "days since 2001-01-01",
    "days since 2001-02-01",
    "days since 2001-03-01",
];

/// A profile by which values are the file's times `factor`; those above `most` are none.
fn profile(factor: f64, most: f64) -> String {
    format!(
        r#"
        name = "own"
        product = "{PRODUCT}"
        title = "Flux times {factor}"
        source = "a test"
        quantity = "carbon_flux"
        [variable]
        name = "fgco2"
        scale_factor = {factor}
        valid_range = [-1e9, {most}]
        "#
    )
}

/// Three months, a file each, landed by the profile with factor 1.
async fn landed() -> Place {
    let place = Place::new();
    let mut files = vec![];
    for (index, since) in SINCE.into_iter().enumerate() {
        let mut file = SmallFile::new().first_month();
        file.time_unit = Some(since);
        file.values[9] = index as f32;
        let path = place.path(&format!("flux-{index}.nc"));
        file.write_classic(&path);
        files.push(path);
    }
    let own = Profile::parse("own", &profile(1.0, 1e9)).unwrap();
    let outcomes = place.land_with(&files, Some(&own)).await;
    assert!(outcomes.iter().all(|o| !o.is_rejected()), "{outcomes:?}");
    place
}

fn request() -> Request {
    Request {
        product: PRODUCT.parse().unwrap(),
        from: None,
        to: None,
        profile: None,
        is_forced: false,
        is_verified: false,
    }
}

/// The place to work in, with the profile as it is now.
fn workplace(place: &Place, text: &str) -> Workplace {
    let folder = place.path("profiles");
    std::fs::create_dir_all(&folder).unwrap();
    std::fs::write(folder.join("own.toml"), text).unwrap();
    let mut settings = settings();
    settings.profiles = Profiles::with_folder(&folder).unwrap();
    Workplace::new(settings, place.path("spool"), 64 << 20)
}

async fn plan(place: &Place, work: &Workplace, request: &Request) -> Plan {
    reread::plan(&place.store, &work.settings.profiles, request)
        .await
        .unwrap()
}

async fn run(
    place: &Place,
    work: &Workplace,
    request: &Request,
) -> Result<Option<Manifest>, IngestError> {
    let plan = plan(place, work, request).await;
    reread::run(&place.store, &plan, request, work, &|_done| ()).await
}

#[tokio::test]
async fn a_file_that_would_be_read_as_before_is_not_read_again() {
    let place = landed().await;
    let work = workplace(&place, &profile(1.0, 1e9));
    // Names, comments and order in a profile shape no value.
    let same = format!("# a word\n{}", profile(1.0, 1e9));
    for work in [work, workplace(&place, &same)] {
        let plan = plan(&place, &work, &request()).await;
        assert_eq!((plan.items.len(), plan.fresh_count), (0, 3));
        assert!(run(&place, &work, &request()).await.unwrap().is_none());
    }
    assert!(!place.path("spool").exists(), "there was nothing to do");
}

#[tokio::test]
async fn a_changed_profile_makes_a_new_version_and_the_old_one_stays_readable() {
    let place = landed().await;
    let before = place.newest(PRODUCT).await;
    let work = workplace(&place, &profile(2.0, 1e9));
    let planned = plan(&place, &work, &request()).await;
    let reasons: Vec<_> = planned
        .items
        .iter()
        .map(|i| (i.reason, i.is_read))
        .collect();
    assert_eq!(reasons, [(Reason::Stale, false); 3]);
    let after = run(&place, &work, &request()).await.unwrap().unwrap();
    assert_eq!(after, place.newest(PRODUCT).await);
    assert_eq!(
        (after.number, after.title.as_str()),
        (before.number + 1, "Flux times 2")
    );
    for step in 0..3 {
        let (old, new) = (
            place.values(&before, step).await,
            place.values(&after, step).await,
        );
        for (old, new) in old.into_iter().zip(new) {
            assert!(
                new == 2.0 * old || (new.is_nan() && old.is_nan()),
                "{old} {new}"
            );
        }
    }
    let loaded = manifests::load(&place.store, &before.id()).await.unwrap();
    assert_eq!(loaded, before);
    let again = plan(&place, &work, &request()).await;
    assert_eq!((again.items.len(), again.fresh_count), (0, 3));
    // Back to what it was: the readings are still there, so that only the manifest is new.
    let back = workplace(&place, &profile(1.0, 1e9));
    let planned = plan(&place, &back, &request()).await;
    assert_eq!((planned.items.len(), planned.unread_count()), (3, 0));
    let third = run(&place, &back, &request()).await.unwrap().unwrap();
    assert_eq!(third.steps, before.steps);
}

#[tokio::test]
async fn a_part_of_the_time_is_read_anew_alone() {
    let place = landed().await;
    let before = place.newest(PRODUCT).await;
    let work = workplace(&place, &profile(2.0, 1e9));
    let february = Request {
        from: Some("2001-02-01".parse().unwrap()),
        to: Some("2001-03-01".parse().unwrap()),
        ..request()
    };
    let after = run(&place, &work, &february).await.unwrap().unwrap();
    assert_eq!(after.steps[0], before.steps[0]);
    assert_ne!(after.steps[1].field, before.steps[1].field);
    assert_eq!(after.steps[2], before.steps[2]);
    let backwards = Request {
        from: february.to,
        to: february.from,
        ..request()
    };
    let refused = reread::plan(&place.store, &work.settings.profiles, &backwards).await;
    assert!(matches!(refused, Err(IngestError::Reread { .. })));
}

#[tokio::test]
async fn a_file_that_is_refused_now_leaves_everything_as_it_was() {
    let place = landed().await;
    let before = place.newest(PRODUCT).await;
    // No value of any file is so small.
    let work = workplace(&place, &profile(1.0, -1e8));
    let refused = run(&place, &work, &request())
        .await
        .unwrap_err()
        .to_string();
    assert!(refused.contains("3 of its files are refused"), "{refused}");
    assert!(
        refused.contains("flux-0.nc") && refused.contains("no value"),
        "{refused}"
    );
    assert_eq!(place.newest(PRODUCT).await, before);
    // What could be read is not read again when the profile is mended for the rest.
    let given = Request {
        profile: Some(Profile::parse("own", &profile(3.0, 1e9)).unwrap()),
        ..request()
    };
    let after = run(&place, &work, &given).await.unwrap().unwrap();
    assert_eq!(after.title, "Flux times 3");
}

#[tokio::test]
async fn what_an_unfinished_run_read_is_not_read_again() {
    let place = landed().await;
    let before = place.newest(PRODUCT).await;
    let work = workplace(&place, &profile(2.0, 1e9));
    // One of three files can no longer be had: the run ends without a new version, and has read the others.
    let key = ObjectKey::raw(&PRODUCT.parse().unwrap(), &before.steps[1].raw_sha256);
    let raw = place.store.get(&key).await.unwrap();
    let all = plan(&place, &work, &request()).await;
    place.store.remove(&key).await.unwrap();
    assert!(
        reread::run(&place.store, &all, &request(), &work, &|_| ())
            .await
            .is_err()
    );
    assert_eq!(place.newest(PRODUCT).await, before);
    let gone = reread::plan(&place.store, &work.settings.profiles, &request()).await;
    let gone = gone.unwrap_err().to_string();
    assert!(gone.contains("flux-1.nc is not in the store"), "{gone}");
    place.store.put_new(&key, raw).await.unwrap();
    let rest = plan(&place, &work, &request()).await;
    let read: Vec<bool> = rest.items.iter().map(|item| item.is_read).collect();
    assert!(read[0] && !read[1], "{read:?}");
    let after = run(&place, &work, &request()).await.unwrap().unwrap();
    // The same bytes as without the interruption.
    let other = landed().await;
    let work = workplace(&other, &profile(2.0, 1e9));
    let undisturbed = run(&other, &work, &request()).await.unwrap().unwrap();
    let unnoticed = |manifest| Manifest {
        notices: vec![],
        ..manifest
    };
    assert_eq!(unnoticed(after), unnoticed(undisturbed));
}

#[tokio::test]
async fn a_lost_field_comes_back_and_an_unknown_reading_is_made_known() {
    let place = landed().await;
    let before = place.newest(PRODUCT).await;
    let work = workplace(&place, &profile(1.0, 1e9));
    place.store.remove(&before.steps[2].field).await.unwrap();
    let planned = plan(&place, &work, &request()).await;
    assert_eq!(planned.items.len(), 1);
    assert_eq!(planned.items[0].reason, Reason::Missing);
    assert!(run(&place, &work, &request()).await.unwrap().is_none());
    assert!(place.store.exists(&before.steps[2].field).await.unwrap());
    // As an older program left it, which noted nothing.
    for key in place.store.list("readings").await.unwrap() {
        place.store.remove(&key).await.unwrap();
    }
    let given = Request {
        profile: Some(Profile::parse("own", &profile(1.0, 1e9)).unwrap()),
        ..request()
    };
    assert_eq!(plan(&place, &work, &request()).await.items.len(), 3);
    assert!(run(&place, &work, &given).await.unwrap().is_none());
    assert!(plan(&place, &work, &request()).await.items.is_empty());
}

#[tokio::test]
async fn a_profile_that_is_not_known_here_is_asked_for_only_when_it_matters() {
    let place = landed().await;
    let mut work = workplace(&place, &profile(1.0, 1e9));
    work.settings.profiles = Profiles::shipped();
    assert_eq!(plan(&place, &work, &request()).await.fresh_count, 3);
    let forced = Request {
        is_forced: true,
        ..request()
    };
    let refused = reread::plan(&place.store, &work.settings.profiles, &forced).await;
    let refused = refused.unwrap_err().to_string();
    assert!(
        refused.contains("profile own") && refused.contains("--profiles"),
        "{refused}"
    );
}

#[tokio::test]
async fn a_forced_reading_finds_a_field_that_is_not_what_it_should_be() {
    let place = landed().await;
    let work = workplace(&place, &profile(1.0, 1e9));
    let forced = Request {
        is_forced: true,
        ..request()
    };
    let planned = plan(&place, &work, &forced).await;
    assert!(
        planned
            .items
            .iter()
            .all(|item| item.reason == Reason::Forced)
    );
    assert!(run(&place, &work, &forced).await.unwrap().is_none());
    // The planted fault: a note that says of a file what it is not read as.
    let key = place.store.list("readings").await.unwrap().remove(0);
    let text = String::from_utf8(place.store.get(&key).await.unwrap().to_vec()).unwrap();
    place.store.remove(&key).await.unwrap();
    let (text, _seal) = text.rsplit_once(",\"sha256\":\"").unwrap();
    let text = format!("{text}}}");
    let spoilt = text.replace("\"valid_cells\":31", "\"valid_cells\":30");
    assert_ne!(spoilt, text);
    let spoilt = storage::sound::seal::json(spoilt.into_bytes());
    place.store.put_new(&key, spoilt.into()).await.unwrap();
    assert!(run(&place, &work, &forced).await.is_err());
}

#[tokio::test]
async fn what_is_told_is_what_was_read_anew_and_nothing_of_a_landing() {
    let place = landed().await;
    let product = PRODUCT.parse().unwrap();
    assert!(
        reread::events(&place.store, &product)
            .await
            .unwrap()
            .is_empty()
    );
    let work = workplace(&place, &profile(2.0, 1e9));
    run(&place, &work, &request()).await.unwrap();
    let events = reread::events(&place.store, &product).await.unwrap();
    assert_eq!(events.len(), 3);
    storage::log::tell_each_once(&place.log, &events)
        .await
        .unwrap();
    storage::log::tell_each_once(&place.log, &events)
        .await
        .unwrap();
    let told = crate::fixture::events(&place.log, contract::topic::Topic::GranuleLanded).await;
    assert_eq!(told.len(), 3 + 3, "landed, then read anew, each once");
}

/// The bytes that this decoder makes of a known file. If they change, values change for somebody, or readers of stored
/// fields see other bytes for the same file: raise `DECODER` (ingest/src/plan/recipe.rs) and state the new digest here.
#[tokio::test]
async fn a_known_file_is_read_as_the_fields_of_this_decoders_version() {
    let place = Place::new();
    let files: Vec<PathBuf> = vec![place.path("known.nc")];
    SmallFile::new().write_classic(&files[0]);
    let outcomes = place.land(&files).await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    let product = outcomes[0].manifest().unwrap().product.clone();
    let manifest = place.newest(product.as_str()).await;
    let mut values = vec![];
    for step in 0..manifest.steps.len() {
        for value in place.values(&manifest, step).await {
            values.extend(value.to_le_bytes());
        }
    }
    let (decoder, digest) = (10, Digest::of(&values).short());
    let notes = place.store.list("readings").await.unwrap();
    let note = place.store.get(&notes[0]).await.unwrap();
    let note: serde_json::Value = serde_json::from_slice(&note).unwrap();
    assert_eq!(note["recipe"]["decoder"], decoder);
    assert_eq!(digest, "37276a64");
}
