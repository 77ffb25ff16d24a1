//! What a notice may make the service read: files of allowed folders, and nothing else.

use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use clap::Parser;
use contract::digest::Digest;
use contract::event::{Body, Event, RejectReason};
use contract::topic::Topic;
use ingest::{
    DecoderCommand, IngestError, IngestService, Outcome, Quiet, ServiceSettings, Settings,
};
use storage::Store;
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{Place, SmallFile, events};

#[derive(Parser)]
#[command(args_override_self = true)]
struct Flags {
    #[command(flatten)]
    service: ServiceSettings,
}

/// The settings of a service as its flags give them.
pub(crate) fn guarded(place: &Place, flags: &[&str]) -> Result<Settings, IngestError> {
    let spool = place.path("spool").display().to_string();
    let always = [
        "ingestd",
        "--spool",
        &spool,
        "--fetch-tries",
        "2",
        "--fetch-retry-s",
        "1",
    ];
    let flags = Flags::parse_from(always.iter().chain(flags));
    let program = PathBuf::from(env!("CARGO_BIN_EXE_decode-file"));
    let mut settings = flags.service.resolve(DecoderCommand {
        program,
        arguments: vec![],
    })?;
    settings.limits.memory_bytes = 1 << 30;
    settings.limits.wall = std::time::Duration::from_mins(1);
    Ok(settings)
}

/// What becomes of a notice of a file.
pub(crate) async fn outcome_of(place: &Place, settings: &Settings, event: Event) -> Outcome {
    let log = Arc::new(EmbeddedLog::memory());
    log.append(&[event]).await.unwrap();
    let service = IngestService::new(
        place.store.clone(),
        Arc::clone(&log) as Arc<dyn EventLog>,
        settings.clone(),
    );
    let mut outcomes = service.drain(&Quiet).await.unwrap();
    assert_eq!(outcomes.len(), 1);
    assert_eq!(log.lag(Topic::GranuleNotice, "ingest").await.unwrap(), 0);
    if outcomes[0].is_rejected() {
        assert_eq!(events(log.as_ref(), Topic::GranuleRejected).await.len(), 1);
    }
    outcomes.remove(0)
}

pub(crate) fn notice(path: &str, sha256: Option<Digest>, size_bytes: Option<u64>) -> Event {
    let body = Body::GranuleNotice {
        path: path.to_owned(),
        profile: None,
        product: None,
        variable: None,
        indexes: vec![],
        sha256,
        size_bytes,
        attempt: 1,
    };
    Event::new("t", body)
}

/// Reason and line of the refusal of a path.
pub(crate) async fn refused(
    place: &Place,
    settings: &Settings,
    path: &str,
) -> (RejectReason, String) {
    match outcome_of(place, settings, notice(path, None, None)).await {
        outcome @ Outcome::Rejected { reason, .. } => (reason, outcome.to_string()),
        other => panic!("{path}: {other}"),
    }
}

/// A folder that is allowed, with a file inside and one outside.
struct Folders {
    place: Place,
    settings: Settings,
}

fn folders() -> Folders {
    let place = Place::new();
    std::fs::create_dir_all(place.path("in/deep")).unwrap();
    std::fs::create_dir_all(place.path("in-side")).unwrap();
    SmallFile::new().write_hdf5(&place.path("in/deep/a.h5"));
    SmallFile::new().write_classic(&place.path("in/a.nc"));
    SmallFile::new().write_classic(&place.path("secret.nc"));
    SmallFile::new().write_classic(&place.path("in-side/b.nc"));
    let allowed = place.path("in").display().to_string();
    let settings = guarded(&place, &["--allow-folder", &allowed]).unwrap();
    Folders { place, settings }
}

fn text(path: &Path) -> String {
    path.display().to_string()
}

#[tokio::test]
async fn files_inside_an_allowed_folder_land_by_path_url_and_inner_link() {
    let Folders { place, settings } = folders();
    symlink(place.path("in/deep/a.h5"), place.path("in/link.h5")).unwrap();
    for path in [
        text(&place.path("in/deep/a.h5")),
        format!("file://{}", text(&place.path("in/a.nc"))),
        text(&place.path("in/link.h5")),
        text(&place.path("in/deep/../a.nc")),
    ] {
        let outcome = outcome_of(&place, &settings, notice(&path, None, None)).await;
        assert!(!outcome.is_rejected(), "{outcome}");
    }
    let manifest = place.newest("fgco2").await;
    assert_eq!(
        manifest.steps[0].origin, "a.nc",
        "the name of the file, not of a handle"
    );
}

#[tokio::test]
async fn a_way_out_of_the_allowed_folder_is_refused() {
    let Folders { place, settings } = folders();
    symlink(place.path("secret.nc"), place.path("in/link.nc")).unwrap();
    symlink(place.folder.path(), place.path("in/up")).unwrap();
    symlink(place.path("in/loop"), place.path("in/loop")).unwrap();
    for path in [
        text(&place.path("secret.nc")),
        text(&place.path("in/../secret.nc")),
        text(&place.path("in/link.nc")),
        text(&place.path("in/up/secret.nc")),
        text(&place.path("in-side/b.nc")),
        format!("file://{}", text(&place.path("in/%2e%2e/secret.nc"))),
        "in/a.nc".to_owned(),
        "/dev/zero".to_owned(),
        "/proc/self/environ".to_owned(),
        text(&place.path("not-there.nc")),
    ] {
        let (reason, line) = refused(&place, &settings, &path).await;
        assert_eq!(reason, RejectReason::Location, "{line}");
        assert!(line.contains("--allow-folder"), "{line}");
    }
    let (reason, line) = refused(&place, &settings, &text(&place.path("in/loop"))).await;
    assert!(
        matches!(reason, RejectReason::Unavailable | RejectReason::Location),
        "{line}"
    );
    assert!(
        storage::manifests::products(&place.store)
            .await
            .unwrap()
            .is_empty()
    );
}

#[tokio::test]
async fn a_file_that_is_not_there_is_asked_for_again_and_then_given_up() {
    let Folders { place, settings } = folders();
    let path = text(&place.path("in/late.nc"));
    let (reason, line) = refused(&place, &settings, &path).await;
    assert_eq!(reason, RejectReason::Unavailable, "{line}");
    let (reason, line) = refused(&place, &settings, &text(&place.path("in/deep"))).await;
    assert_eq!(reason, RejectReason::Unreadable, "{line}");
    let late = async {
        tokio::time::sleep(std::time::Duration::from_millis(100)).await;
        std::fs::copy(place.path("in/a.nc"), place.path("in/late.nc")).unwrap();
    };
    let (outcome, ()) = tokio::join!(
        outcome_of(&place, &settings, notice(&path, None, None)),
        late
    );
    assert!(matches!(outcome, Outcome::Landed { .. }), "{outcome}");
}

#[tokio::test]
async fn no_folder_is_allowed_without_a_setting() {
    let place = Place::new();
    SmallFile::new().write_classic(&place.path("a.nc"));
    let settings = guarded(&place, &[]).unwrap();
    let (reason, _) = refused(&place, &settings, &text(&place.path("a.nc"))).await;
    assert_eq!(reason, RejectReason::Location);
    let (reason, line) = refused(&place, &settings, "s3://bucket/a.nc").await;
    assert_eq!(reason, RejectReason::Location);
    assert!(line.contains("--allow-store"), "{line}");
}

#[tokio::test]
async fn another_digest_or_size_than_announced_is_refused() {
    let Folders { place, settings } = folders();
    let path = text(&place.path("in/a.nc"));
    let content = std::fs::read(&path).unwrap();
    let (right, size) = (Digest::of(&content), content.len() as u64);
    for (sha256, size_bytes) in [
        (Some(Digest::of(b"other")), None),
        (Some(right), Some(size + 1)),
    ] {
        let outcome = outcome_of(&place, &settings, notice(&path, sha256, size_bytes)).await;
        let Outcome::Rejected { reason, .. } = &outcome else {
            panic!("{outcome}")
        };
        assert_eq!(*reason, RejectReason::Checksum);
    }
    let outcome = outcome_of(&place, &settings, notice(&path, Some(right), Some(size))).await;
    assert!(matches!(outcome, Outcome::Landed { .. }), "{outcome}");
}

/// A notice may name a profile of the service, never a file that a profile would be read from.
#[tokio::test]
async fn a_notice_cannot_have_a_file_read_as_a_profile() {
    let Folders { place, settings } = folders();
    let secret = place.path("in/secret.toml");
    std::fs::write(&secret, "password = \"hunter2\"").unwrap();
    let Body::GranuleNotice { path, .. } = notice(&text(&place.path("in/a.nc")), None, None).body
    else {
        panic!("a notice is a notice")
    };
    let body = Body::GranuleNotice {
        path,
        profile: Some(text(&secret)),
        product: None,
        variable: None,
        indexes: vec![],
        sha256: None,
        size_bytes: None,
        attempt: 3,
    };
    let outcome = outcome_of(&place, &settings, Event::new("t", body)).await;
    let line = outcome.to_string();
    assert!(
        outcome.is_rejected() && line.contains("is none of"),
        "{line}"
    );
    assert!(!line.contains("hunter2"));
}

/// With a real S3 server: below the allowed prefix, beside it, and absent.
#[tokio::test]
async fn files_of_an_allowed_store_land_and_others_are_refused() {
    let bucket = std::env::var_os("FLUXGLOBE_S3_BUCKET").expect(
        "FLUXGLOBE_S3_BUCKET names no bucket: `deploy/with-services.sh cargo test` starts a server and says where",
    );
    let place = Place::new();
    SmallFile::new().write_hdf5(&place.path("a.h5"));
    let content = bytes::Bytes::from(std::fs::read(place.path("a.h5")).unwrap());
    let root = format!(
        "s3://{}/ingest-test-{}",
        bucket.display(),
        std::process::id()
    );
    let store = Store::open(&root).unwrap();
    let keys = ["in/a.h5", "in-side/a.h5"].map(|key| key.parse().unwrap());
    for key in &keys {
        store.put_new(key, content.clone()).await.unwrap();
    }
    let settings = guarded(&place, &["--allow-store", &format!("{root}/in")]).unwrap();
    let sha256 = Some(Digest::of(&content));
    let event = notice(
        &format!("{root}/in/a.h5"),
        sha256,
        Some(content.len() as u64),
    );
    let outcome = outcome_of(&place, &settings, event).await;
    let beside = refused(&place, &settings, &format!("{root}/in-side/a.h5")).await;
    let absent = refused(&place, &settings, &format!("{root}/in/b.h5")).await;
    for key in &keys {
        store.remove(key).await.unwrap();
    }
    assert!(matches!(outcome, Outcome::Landed { .. }), "{outcome}");
    assert_eq!(beside.0, RejectReason::Location, "{}", beside.1);
    assert_eq!(absent.0, RejectReason::Unavailable, "{}", absent.1);
}

#[test]
fn a_setting_that_cannot_be_used_is_named_before_any_work() {
    let place = Place::new();
    std::fs::write(place.path("file"), "x").unwrap();
    let absent = text(&place.path("absent"));
    let file = text(&place.path("file"));
    for (flags, words) in [
        (["--allow-folder", absent.as_str()], "--allow-folder"),
        (["--allow-store", "ftp://x"], "--allow-store"),
        (["--profiles", absent.as_str()], "--profiles"),
        (["--spool", file.as_str()], "spool"),
    ] {
        let mut all = flags.to_vec();
        if flags[0] == "--spool" {
            all = vec![];
            std::fs::write(place.path("spool"), "in the way").unwrap();
        }
        let error = guarded(&place, &all).unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
}
