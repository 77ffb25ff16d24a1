//! The whole cluster is stopped at work and started again, servers last; and one trace leads from a notice to a tile.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use contract::event::{Body, Event};
use contract::topic::Topic;
use harness::cluster::{Cluster, Shape};
use harness::granule;

use crate::alone;
use crate::faults::{PRODUCT, append, each_event_once, events, notice, say, until_whole};

const LIMIT: Duration = Duration::from_mins(2);
const SERVERS: [&str; 3] = ["s3", "postgis", "kafka"];
const ONE_OF_EACH: Shape = Shape {
    executors: 1,
    ingestds: 1,
    render_workers: 1,
    tile_servers: 1,
};

#[test]
fn a_cluster_stopped_at_work_and_started_before_its_servers_goes_on_where_it_was() {
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> = (0..6)
        .map(|month| granule::write(inbox.path(), month, 0).unwrap())
        .collect();
    let mut cluster = Cluster::start(ONE_OF_EACH, inbox.path()).unwrap();
    notice(&cluster, &files[..2]);
    until_whole(&cluster, 2);

    notice(&cluster, &files[2..]);
    for node in cluster.nodes.values_mut() {
        let begun = Instant::now();
        let code = node.stop().unwrap();
        say(&format!(
            "{} stopped after {:.1} s",
            node.name,
            begun.elapsed().as_secs_f64()
        ));
        assert_eq!(code, Some(0), "{}: {}", node.name, node.talk());
    }
    for server in SERVERS {
        cluster.servers.stop_one(server).unwrap();
    }
    // Those that ask others first.
    for node in cluster.nodes.values_mut().rev() {
        node.restart().unwrap();
    }
    for name in cluster.nodes.keys() {
        let waits = |cluster: &Cluster| {
            let node = &cluster.nodes[name];
            let (lives, ready) = (node.get("/healthz")?, node.get("/readyz")?);
            Ok((lives.status == 200 && ready.status == 503).then_some(()))
        };
        let what = format!("{name} that lives and waits");
        cluster.wait_for(&what, LIMIT, waits).unwrap();
    }
    for server in SERVERS {
        cluster.servers.start_one(server).unwrap();
    }
    let back = Instant::now();
    for node in cluster.nodes.values_mut() {
        node.wait_until_ready().unwrap();
    }
    say(&format!(
        "all ready {:.1} s after the servers",
        back.elapsed().as_secs_f64()
    ));
    until_whole(&cluster, files.len());
    each_event_once(&cluster, &files);
}

#[test]
fn one_trace_leads_from_the_notice_to_the_tile() {
    const TRACE: &str = "a-trace-to-follow";
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let file = |month| granule::write(inbox.path(), month, 0).unwrap();
    let cluster = Cluster::start(ONE_OF_EACH, inbox.path()).unwrap();
    notice(&cluster, &[file(0), file(1)]);
    until_whole(&cluster, 2);
    // Granules that are derived together share a version, which is told under the trace of the first: these are over.
    let over =
        |cluster: &Cluster| Ok((events(cluster, Topic::ProductDerived).len() == 2).then_some(()));
    cluster
        .wait_for("end of the first two", LIMIT, over)
        .unwrap();
    // Somebody looks at it: what touches this tile is drawn anew unasked.
    let hot = format!("/tiles/{PRODUCT}/volume/0/0/0.png?time=2000-01-20");
    assert_eq!(cluster.get(&hot).unwrap().status, 200);

    let revised = granule::write(inbox.path(), 0, 1).unwrap();
    let body = Body::GranuleNotice {
        path: revised.display().to_string(),
        profile: None,
        product: Some(PRODUCT.parse().unwrap()),
        variable: None,
        indexes: vec![],
        sha256: None,
        size_bytes: None,
        attempt: 1,
    };
    append(&cluster, Event::new(TRACE, body));
    for topic in [
        Topic::GranuleLanded,
        Topic::ProductDerived,
        Topic::RenderJob,
        Topic::RenderDone,
    ] {
        let told = |cluster: &Cluster| {
            let found = events(cluster, topic)
                .into_iter()
                .any(|event| event.trace == TRACE);
            Ok(found.then_some(()))
        };
        cluster
            .wait_for(&format!("{topic} with the trace"), LIMIT, told)
            .unwrap();
    }
    for name in ["ingestd-1", "scheduler", "tile-server"] {
        let said = cluster.nodes[name].said();
        assert!(said.contains(TRACE), "{name} says nothing of it: {said}");
    }
}
