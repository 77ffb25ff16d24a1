//! Files with a further dimension, of which one index is read: each index is a product of its own, and stays the one that is read.

use std::path::PathBuf;
use std::sync::Arc;

use contract::event::RejectReason;
use contract::index::DimensionIndex;
use ingest::reread::{self, Request, Workplace};
use ingest::{IngestService, Outcome, Quiet, Wishes};

use crate::fixture::{Place, events, refusal, settings};
use crate::made::{Made, MadeFile, Values};

const DEPTHS: usize = 3;

/// Days from `since` on of 3 depths: of each cell 100 times its day, 10 times its depth and `more`.
fn deep(days: usize, since: &'static str, more: f32) -> MadeFile {
    let value = |day: usize, depth: usize| 100.0 * day as f32 + 10.0 * depth as f32 + more;
    let maps = (0..days).flat_map(|day| (0..DEPTHS).map(move |depth| (day, depth)));
    let values = maps.flat_map(|(day, depth)| vec![value(day, depth); 32]);
    let values = Values::Floats(values.collect());
    let depth = Values::Floats(vec![0.494, 5.0, 9.5]);
    let depth = Made::new("depth", &["depth"], depth).text("units", "m");
    let speed = Made::new("speed", &["time", "depth", "lat", "lon"], values);
    let mut file = of_days(speed, days, since).with(depth);
    file.dimensions.push(("depth", DEPTHS));
    file
}

fn of_days(speed: Made, days: usize, since: &'static str) -> MadeFile {
    let edges = (0..days).flat_map(|day| [day as f64, day as f64 + 1.0]);
    let bounds = Values::Doubles(edges.collect());
    let dated = |time: Made| time.text("units", since).text("bounds", "time_bnds");
    MadeFile::days(days)
        .but("time", dated)
        .with(Made::new("time_bnds", &["time", "two"], bounds))
        .with(speed.text("units", "m s-1").text("long_name", "Speed"))
}

/// Lands files at indexes, such as `depth=1`, in a product.
async fn land(place: &Place, files: &[PathBuf], indexes: &[&str], product: &str) -> Vec<Outcome> {
    let log: Arc<dyn storage::log::EventLog> = Arc::new(place.log.clone());
    let service = IngestService::new(place.store.clone(), log, settings());
    let wishes = Wishes {
        product: Some(product.parse().unwrap()),
        indexes: indexes.iter().map(|text| text.parse().unwrap()).collect(),
        ..Wishes::default()
    };
    service.notify_of(files, &wishes).await.unwrap();
    service.drain(&Quiet).await.unwrap()
}

fn written(place: &Place, name: &str, file: &MadeFile) -> PathBuf {
    let path = place.path(name);
    file.write(&path);
    path
}

#[tokio::test]
async fn a_file_of_several_levels_is_refused_with_what_says_which_and_lands_by_that() {
    let place = Place::new();
    let file = written(&place, "a.nc", &deep(2, "days since 2001-01-01", 0.0));
    let unsaid = place.land(std::slice::from_ref(&file)).await;
    let (reason, detail) = refusal(&unsaid);
    assert_eq!(reason, RejectReason::Grid);
    assert!(detail.contains("--index depth=N (0 to 2)"), "{detail}");

    let outcome = land(&place, &[file], &["depth=1"], "middle")
        .await
        .remove(0);
    let Outcome::Landed { assumptions, .. } = &outcome else {
        panic!("{outcome}")
    };
    let told = "speed: is read at index 1 of depth, which is 5 m";
    assert!(assumptions.iter().any(|own| own == told), "{assumptions:?}");
    let manifest = place.newest("middle").await;
    let kept = DimensionIndex::words(&manifest.indexes);
    assert_eq!(kept, " --index depth=1");
    for (step, value) in [(0, 10.0), (1, 110.0)] {
        let values = place.values(&manifest, step).await;
        assert!(values.iter().all(|own| *own == value), "{step}: {values:?}");
    }
}

/// The same bytes too: that they are there says nothing of another level of them.
#[tokio::test]
async fn another_index_does_not_land_in_the_product_of_one() {
    let place = Place::new();
    let file = written(&place, "a.nc", &deep(1, "days since 2001-01-01", 0.0));
    let next = written(&place, "b.nc", &deep(1, "days since 2001-01-02", 0.0));
    let values = Values::Floats(vec![1.0; 32]);
    let flat = Made::new("speed", &["time", "lat", "lon"], values);
    let flat = of_days(flat, 1, "days since 2001-01-03");
    let flat = written(&place, "flat.nc", &flat);
    let first = land(&place, std::slice::from_ref(&file), &["depth=0"], "speed").await;
    assert!(!first[0].is_rejected(), "{}", first[0]);
    let before = place.newest("speed").await;
    for (path, indexes) in [
        (&file, vec!["depth=2"]),
        (&next, vec!["depth=2"]),
        (&flat, vec![]),
    ] {
        let outcomes = land(&place, std::slice::from_ref(path), &indexes, "speed").await;
        let (reason, detail) = refusal(&outcomes);
        assert_eq!(reason, RejectReason::Conflict);
        assert!(
            detail.contains("--index depth=0") && detail.contains("--product"),
            "{detail}"
        );
    }
    assert_eq!(place.newest("speed").await, before);
    // Of two in one go the first is the product's.
    for indexes in ["depth=0", "depth=1"] {
        let log: Arc<dyn storage::log::EventLog> = Arc::new(place.log.clone());
        let service = IngestService::new(place.store.clone(), log, settings());
        let wishes = Wishes {
            product: Some("both".parse().unwrap()),
            indexes: vec![indexes.parse().unwrap()],
            ..Wishes::default()
        };
        let path = if indexes == "depth=0" { &file } else { &next };
        let notified = service.notify_of(std::slice::from_ref(path), &wishes).await;
        notified.unwrap();
    }
    let both = land(&place, &[], &[], "both").await;
    assert!(!both[0].is_rejected(), "{}", both[0]);
    assert_eq!(refusal(&both[1..]).0, RejectReason::Conflict);
    // The same index goes on.
    let outcomes = land(&place, &[next], &["depth=0"], "speed").await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    assert_eq!(place.newest("speed").await.steps.len(), 2);
}

#[tokio::test]
async fn files_are_read_anew_at_the_index_that_they_landed_with() {
    let place = Place::new();
    let file = written(&place, "a.nc", &deep(1, "days since 2001-01-01", 7.0));
    let outcomes = land(&place, &[file], &["depth=2"], "deep").await;
    assert!(!outcomes[0].is_rejected(), "{}", outcomes[0]);
    let before = place.newest("deep").await;
    let work = Workplace::new(settings(), place.path("spool"), 64 << 20);
    let mut request = Request {
        product: "deep".parse().unwrap(),
        from: None,
        to: None,
        profile: None,
        is_forced: false,
        is_verified: false,
    };
    let fresh = reread::plan(&place.store, &work.settings.profiles, &request);
    assert_eq!(fresh.await.unwrap().fresh_count, 1);
    request.is_forced = true;
    let plan = reread::plan(&place.store, &work.settings.profiles, &request);
    let plan = plan.await.unwrap();
    assert_eq!(plan.items.len(), 1);
    let again = reread::run(&place.store, &plan, &request, &work, &|_done| ()).await;
    assert!(again.unwrap().is_none(), "the same index gives the same");
    assert_eq!(place.newest("deep").await, before);
    assert!(place.values(&before, 0).await.iter().all(|v| *v == 27.0));
}

#[tokio::test]
async fn indexes_that_say_nothing_are_refused() {
    let place = Place::new();
    let file = written(&place, "a.nc", &deep(1, "days since 2001-01-01", 0.0));
    for (indexes, told) in [
        (vec!["depth=3"], "has the indexes 0 to 2"),
        (vec!["member=0"], "is no dimension of a variable"),
        (vec!["depth=0", "depth=1"], "one index of each dimension"),
        (vec!["depth=0", "lat=1"], "all of which are read"),
        (vec!["depth=0", "time=0"], "all of which are read"),
    ] {
        let outcomes = land(&place, std::slice::from_ref(&file), &indexes, "p").await;
        let (_, detail) = refusal(&outcomes);
        assert!(detail.contains(told), "{indexes:?}: {detail}");
    }
}

/// What a service reads and what a refused notice is sent again as is the message.
#[tokio::test]
async fn a_notice_of_an_index_is_one_message() {
    let place = Place::new();
    let file = written(&place, "a.nc", &deep(1, "days since 2001-01-01", 0.0));
    land(&place, &[file], &["depth=1"], "p").await;
    let notices = events(&place.log, contract::topic::Topic::GranuleNotice).await;
    let json = notices[0].to_json();
    assert!(json.contains(r#""indexes":["depth=1"]"#), "{json}");
}
