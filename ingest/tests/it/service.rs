//! The service follows notices: events after objects, offset after events.

use std::sync::Arc;

use contract::event::{Body, RejectReason};
use ingest::{IngestService, Outcome, Quiet};
use storage::Store;
use storage::log::{EmbeddedLog, EventLog};

use crate::fixture::{Place, SmallFile, settings};

fn service(store: &Store, log: &Arc<EmbeddedLog>) -> IngestService {
    IngestService::new(
        store.clone(),
        Arc::clone(log) as Arc<dyn EventLog>,
        settings(),
    )
}

#[tokio::test]
async fn notices_are_followed_once_and_in_order() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    std::fs::write(place.path("b.nc"), "no").unwrap();
    let service = service(&place.store, &log);
    service
        .notify(&[place.path("a.nc"), place.path("b.nc")], None, None)
        .await
        .unwrap();
    let outcomes = service.drain(&Quiet).await.unwrap();
    assert_eq!(
        outcomes
            .iter()
            .map(Outcome::is_rejected)
            .collect::<Vec<_>>(),
        [false, true]
    );
    assert_eq!(log.committed("granule.notice", "ingest").await.unwrap(), 2);
    assert!(service.drain(&Quiet).await.unwrap().is_empty());
    let landed = log.read("granule.landed", 0, 10).await.unwrap();
    let notices = log.read("granule.notice", 0, 10).await.unwrap();
    assert_eq!(landed.len(), 1);
    assert_eq!(landed[0].1.trace, notices[0].1.trace);
}

#[tokio::test]
async fn a_notice_names_profile_and_product() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    let service = service(&place.store, &log);
    let product = "my-flux".parse().unwrap();
    service
        .notify(&[place.path("a.nc")], None, Some(&product))
        .await
        .unwrap();
    service
        .notify(&[place.path("a.nc")], Some("no-such-profile"), None)
        .await
        .unwrap();
    service
        .notify(&[place.path("a.nc")], None, Some(&product))
        .await
        .unwrap();
    let outcomes = service.drain(&Quiet).await.unwrap();
    assert_eq!(outcomes[0].manifest().unwrap().product, product);
    assert!(
        matches!(&outcomes[1], Outcome::Rejected { reason: RejectReason::NoVariable, detail, .. } if detail.contains("takahashi09-flux"))
    );
    assert!(
        matches!(outcomes[2], Outcome::AlreadyLanded { .. }),
        "{}",
        outcomes[2]
    );
    let refused = log.read("granule.rejected", 0, 10).await.unwrap();
    assert!(matches!(refused[0].1.body, Body::GranuleRejected { .. }));
}

#[tokio::test]
async fn the_service_stops_when_told() {
    let (place, log) = (Place::new(), Arc::new(EmbeddedLog::memory()));
    SmallFile::new().write_classic(&place.path("a.nc"));
    let service = service(&place.store, &log);
    service
        .notify(&[place.path("a.nc")], None, None)
        .await
        .unwrap();
    service
        .run(
            std::time::Duration::from_millis(10),
            &Quiet,
            std::future::ready(()),
        )
        .await
        .unwrap();
    assert_eq!(place.newest("fgco2").await.steps.len(), 2);
}
