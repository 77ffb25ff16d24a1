//! The deriver: what lands is told of once more as derived, once for each message.

use std::sync::Arc;
use std::time::Duration;

use compute::Engine;
use compute::derive::derive_statistic;
use compute::service::Deriver;
use compute::service::deriver::GROUP;
use contract::analysis::{MapOptions, MapStatistic};
use contract::digest::Digest;
use contract::event::{Body, Event, RejectReason};
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::topic::Topic;
use prometheus::Registry;
use service::Stop;
use storage::log::{EmbeddedLog, EventLog, contents};
use storage::{Store, manifests};

use crate::fixture::{folder_store, land, product, wavy_year};

const COARSE: Grid = Grid {
    rows: 18,
    cols: 36,
    north_deg: 90.0,
    west_deg: -180.0,
    dlat_deg: 10.0,
    dlon_deg: 10.0,
};

fn landed(trace: &str, manifest: &Manifest) -> Event {
    let last = manifest.steps.last().unwrap();
    let (path, sha256) = ("a.nc".to_owned(), Digest::of(b"a"));
    let body = Body::granule_landed(path, sha256, manifest.id(), &[last.period], false);
    Event::new(trace, body)
}

async fn derive_until_idle(store: &Store, log: &Arc<dyn EventLog>) {
    let engine = Engine::local(store.clone());
    let deriver = Deriver::new(engine, Arc::clone(log), &Registry::new()).unwrap();
    let stop = Stop::new();
    let running = tokio::spawn({
        let (deriver, stop) = (deriver.clone(), stop.clone());
        async move { deriver.run(stop).await }
    });
    let idle = async {
        while log.lag(Topic::GranuleLanded, GROUP).await.unwrap() > 0 {
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    };
    tokio::time::timeout(Duration::from_mins(1), idle)
        .await
        .unwrap();
    stop.now();
    running.await.unwrap().unwrap();
}

async fn derived(log: &dyn EventLog) -> Vec<(String, Body)> {
    let messages = contents(log, Topic::ProductDerived).await.unwrap();
    messages
        .iter()
        .map(|message| message.event().unwrap())
        .map(|event| (event.trace, event.body))
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn each_landed_granule_is_followed_by_one_event_and_a_batch_by_one_derivation() {
    let year = wavy_year(&COARSE);
    let (_folder, store) = folder_store();
    let log: Arc<dyn EventLog> = Arc::new(EmbeddedLog::memory());
    for months in 1..=3 {
        let steps = &year[..months];
        let id = product("wavy");
        let manifest = land(&store, &id, Quantity::CarbonFlux, COARSE, steps).await;
        log.append(&[landed(&format!("t{months}"), &manifest)])
            .await
            .unwrap();
    }
    derive_until_idle(&store, &log).await;
    let told = derived(&*log).await;
    let traces: Vec<_> = told.iter().map(|(trace, _)| trace.as_str()).collect();
    assert_eq!(traces, ["t1", "t2", "t3"]);
    let Body::ProductDerived {
        manifest,
        derived_from,
    } = &told[0].1
    else {
        panic!("{told:?}")
    };
    assert_eq!((manifest.number, derived_from.number), (1, 3));
    assert!(told.iter().all(|(_, body)| *body == told[0].1));

    // Who comes after and reads something that nothing follows from tells nothing again.
    let newest = manifests::latest(&store, &product("wavy")).await;
    let unknown = Manifest {
        product: product("nobody"),
        ..newest.unwrap().unwrap()
    };
    log.append(&[landed("unknown", &unknown)]).await.unwrap();
    derive_until_idle(&store, &log).await;
    assert_eq!(derived(&*log).await.len(), 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_understood_or_derived_from_does_not_hold_up_the_rest() {
    let year = wavy_year(&COARSE);
    let (_folder, store) = folder_store();
    let log: Arc<dyn EventLog> = Arc::new(EmbeddedLog::memory());
    let sst = Quantity::SeaSurfaceTemperature;
    let warm = land(&store, &product("sst"), sst, COARSE, &year[..1]).await;
    let flux = Quantity::CarbonFlux;
    let wavy = land(&store, &product("wavy"), flux, COARSE, &year[..1]).await;
    let unknown = Manifest {
        product: product("nobody"),
        ..wavy.clone()
    };
    log.append_message(Topic::GranuleLanded, "wavy", "no json".into())
        .await
        .unwrap();
    log.append(&[
        landed("sst", &warm),
        landed("unknown", &unknown),
        landed("wavy", &wavy),
    ])
    .await
    .unwrap();
    derive_until_idle(&store, &log).await;
    let told = derived(&*log).await;
    assert_eq!(told.len(), 1);
    assert_eq!(told[0].0, "wavy");
    let refused = contents(&*log, Topic::GranuleRejected).await.unwrap();
    let refused = refused[0].event().unwrap().body;
    let Body::GranuleRejected { reason, origin, .. } = refused else {
        panic!("{refused:?}")
    };
    assert_eq!(reason, RejectReason::Message);
    assert_eq!(origin.unwrap().to_string(), "granule.landed/0/0");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_statistic_is_made_anew_and_told_of_when_something_lands_in_what_it_is_of() {
    let year = wavy_year(&COARSE);
    let (_folder, store) = folder_store();
    let log: Arc<dyn EventLog> = Arc::new(EmbeddedLog::memory());
    let (id, sst) = (product("sst"), Quantity::SeaSurfaceTemperature);
    land(&store, &id, sst, COARSE, &year[..2]).await;
    let engine = Engine::local(store.clone());
    let options = MapOptions::new(MapStatistic::Mean);
    derive_statistic(&engine, &id, &options, &|_| ())
        .await
        .unwrap();
    // Two that land together are one version of it, told of after each.
    for months in 3..=4 {
        let manifest = land(&store, &id, sst, COARSE, &year[..months]).await;
        let event = landed(&format!("t{months}"), &manifest);
        log.append(&[event]).await.unwrap();
    }
    derive_until_idle(&store, &log).await;
    let told = derived(&*log).await;
    let traces: Vec<_> = told.iter().map(|(trace, _)| trace.as_str()).collect();
    assert_eq!(traces, ["t3", "t4"]);
    for (_, body) in told {
        let Body::ProductDerived {
            manifest,
            derived_from,
        } = body
        else {
            panic!("{body:?}")
        };
        assert_eq!(
            (manifest.product.as_str(), manifest.number),
            ("sst-mean", 2)
        );
        assert_eq!((derived_from.product, derived_from.number), (id.clone(), 3));
    }
}
