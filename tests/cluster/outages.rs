//! Kafka, PostGIS and S3 go away for a while and come back: nothing is dropped, work resumes, memory stays bounded.
//!
//! `FLUXGLOBE_OUTAGE_S` is how long each is away.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use contract::event::{Body, Event};
use contract::observation::{Observation, PlatformKind, Quality};
use harness::cluster::{Cluster, Shape};
use harness::granule;

use crate::alone;
use crate::faults::{PRODUCT, append, each_event_once, notice, number, say, until_whole};

/// Resident memory that no service exceeds while it waits, bytes.
const MEMORY_BYTES: u64 = 1 << 30;
const LIMIT: Duration = Duration::from_mins(2);

struct Outage<'a> {
    cluster: Cluster,
    inbox: &'a Path,
    files: Vec<PathBuf>,
    observed: usize,
    seconds: u64,
}

#[test]
fn what_goes_away_and_comes_back_costs_nothing_but_time() {
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let shape = Shape {
        executors: 1,
        ingestds: 1,
        render_workers: 1,
        tile_servers: 1,
    };
    let mut outage = Outage {
        cluster: Cluster::start(shape, inbox.path()).unwrap(),
        inbox: inbox.path(),
        files: vec![],
        observed: 0,
        seconds: number("FLUXGLOBE_OUTAGE_S", 8),
    };
    outage.more();
    until_whole(&outage.cluster, outage.files.len());

    outage.while_away(
        "kafka",
        |c| c.servers.stop_one("kafka").unwrap(),
        |c| c.servers.start_one("kafka").unwrap(),
    );
    outage.while_away(
        "postgis",
        |c| c.servers.stop_one("postgis").unwrap(),
        |c| c.servers.start_one("postgis").unwrap(),
    );
    outage.while_away("s3", |c| c.s3.fail(true), |c| c.s3.fail(false));
    assert!(
        outage.cluster.s3.refused() > 0,
        "nobody asked S3 while it failed"
    );

    each_event_once(&outage.cluster, &outage.files);
    let product = outage
        .cluster
        .get(&format!("/tiles/{PRODUCT}/volume/0/0/0.png?time=2000-02"))
        .unwrap();
    assert_eq!(product.status, 200, "{}", product.text());
}

impl Outage<'_> {
    /// Waits for all observations that were sent.
    fn until_observed(&self) {
        let observed = self.observed;
        let stored = |cluster: &Cluster| {
            let text =
                cluster.succeed(&["observations", "query", "--dataset", "outage", "--json"])?;
            Ok((text.lines().count() == observed).then_some(()))
        };
        self.cluster
            .wait_for("observations", LIMIT, stored)
            .unwrap();
    }

    /// Three more granules and five more observations.
    fn more(&mut self) {
        let months = self.files.len()..self.files.len() + 3;
        let new: Vec<PathBuf> = months
            .map(|month| granule::write(self.inbox, month, 0).unwrap())
            .collect();
        notice(&self.cluster, &new);
        self.files.extend(new);
        let observations = (0..5).map(|i| observation(self.observed + i)).collect();
        self.observed += 5;
        append(
            &self.cluster,
            Event::new("outage", Body::Observations { observations }),
        );
    }

    /// Work is sent and the part goes away, more is sent to what still answers, and the part comes back.
    ///
    /// Kafka takes nothing while it is away: what is sent when it is back tells whether everybody listens again.
    fn while_away(
        &mut self,
        part: &str,
        take_away: impl Fn(&Cluster),
        bring_back: impl Fn(&Cluster),
    ) {
        let takes_work = part != "kafka";
        self.more();
        take_away(&self.cluster);
        if takes_work {
            // What was sent before may have landed before: of this neither granules without S3 can have, nor observations without PostGIS.
            self.more();
        }
        let mut most_bytes = 0;
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_secs(self.seconds) {
            for node in self.cluster.nodes.values_mut() {
                assert!(
                    !node.has_ended(),
                    "{} ended while {part} was away:\n{}",
                    node.name,
                    node.talk()
                );
                most_bytes = most_bytes.max(node.memory_bytes().unwrap());
                // It lives, whatever else does not.
                assert_eq!(node.get("/healthz").unwrap().status, 200, "{}", node.name);
            }
            std::thread::sleep(Duration::from_millis(500));
        }
        assert!(
            most_bytes < MEMORY_BYTES,
            "{most_bytes} bytes while {part} was away"
        );
        bring_back(&self.cluster);
        let back = Instant::now();
        if !takes_work {
            self.more();
        }
        until_whole(&self.cluster, self.files.len());
        self.until_observed();
        say(&format!(
            "{part} away for {} s: all landed, derived and stored {:.1} s after it was back, at most {} MiB in one process",
            self.seconds,
            back.elapsed().as_secs_f64(),
            most_bytes >> 20
        ));
    }
}

fn observation(number: usize) -> Observation {
    Observation {
        dataset: "outage".parse().unwrap(),
        platform: "B1".to_owned(),
        kind: PlatformKind::Buoy,
        time: format!("2010-01-01T{:02}:{:02}:00Z", number / 60, number % 60)
            .parse()
            .unwrap(),
        lon_deg: 120.0,
        lat_deg: 20.0,
        depth_m: 1.0,
        property: "sea_surface_temperature".to_owned(),
        value: 290.0 + number as f64,
        unit: "K".to_owned(),
        quality: Quality::Good,
    }
}
