//! Prometheus scrapes the services under their names, our rules run on what it finds, and a service that is gone is told of.

use std::time::Duration;

use anyhow::{Context as _, Result};
use harness::cluster::{Cluster, Shape};
use harness::http;
use harness::servers::Servers;
use serde_json::Value;

use crate::alone;

const LIMIT: Duration = Duration::from_mins(1);
/// The service of each process.
const PROCESSES: [(&str, &str); 5] = [
    ("scheduler", "scheduler"),
    ("executor-1", "executor"),
    ("render-1", "render-worker"),
    ("ingestd-1", "ingestd"),
    ("tile-server", "tile-server"),
];

struct Prometheus {
    url: String,
    _server: Servers,
}

impl Prometheus {
    fn start(cluster: &Cluster) -> Self {
        let target = |(name, service): (&str, &str)| {
            let address = cluster.nodes[name].admin.trim_start_matches("http://");
            format!("{service}={address}")
        };
        let told = vec![
            (
                "FLUXGLOBE_PROMETHEUS_TARGETS",
                PROCESSES.map(target).join(","),
            ),
            ("FLUXGLOBE_PROMETHEUS_INTERVAL_S", "1".to_owned()),
        ];
        let server = Servers::start_told(&["prometheus"], told).unwrap();
        Self {
            url: server.setting("FLUXGLOBE_PROMETHEUS").unwrap().to_owned(),
            _server: server,
        }
    }

    fn ask(&self, what: &str) -> Result<Value> {
        let answer = http::get(&format!("{}/api/v1/{what}", self.url))?.json()?;
        Ok(answer["data"].clone())
    }

    /// Services of which a process answers.
    fn up(&self) -> Result<Vec<String>> {
        let found = self.ask("query?query=up%7Bjob%3D%22fluxglobe%22%7D%3D%3D1")?;
        let services = found["result"].as_array().context("no list")?.iter();
        let mut services: Vec<String> = services
            .filter_map(|sample| sample["metric"]["service"].as_str().map(ToOwned::to_owned))
            .collect();
        services.sort();
        Ok(services)
    }

    /// Services that are told of as gone, be it for a moment only.
    fn gone(&self) -> Result<Vec<String>> {
        let found = self.ask("alerts")?;
        let alerts = found["alerts"].as_array().context("no list")?.iter();
        let gone = alerts.filter(|alert| alert["labels"]["alertname"] == "FluxglobeServiceGone");
        Ok(gone
            .filter_map(|alert| alert["labels"]["service"].as_str().map(ToOwned::to_owned))
            .collect())
    }

    /// Rules that could not be worked out.
    fn broken(&self) -> Result<Vec<String>> {
        let found = self.ask("rules")?;
        let groups = found["groups"].as_array().context("no list")?.iter();
        let rules = groups
            .filter_map(|group| group["rules"].as_array())
            .flatten();
        let rules: Vec<&Value> = rules.collect();
        assert!(rules.len() > 20, "our rules are not there: {found}");
        let broken = rules.iter().filter(|rule| rule["health"] == "err");
        Ok(broken
            .map(|rule| format!("{}: {}", rule["name"], rule["lastError"]))
            .collect())
    }
}

#[test]
fn every_service_is_scraped_under_its_name_and_told_of_when_it_is_gone() {
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let shape = Shape {
        executors: 1,
        ingestds: 1,
        render_workers: 1,
    };
    let mut cluster = Cluster::start(shape, inbox.path()).unwrap();
    let prometheus = Prometheus::start(&cluster);
    let mut services = PROCESSES.map(|(_, service)| service);
    services.sort_unstable();
    let all_there = |_: &Cluster| {
        let is_so = prometheus.up()? == services && prometheus.gone()?.is_empty();
        Ok(is_so.then_some(()))
    };
    cluster
        .wait_for("five services that answer", LIMIT, all_there)
        .unwrap();
    assert_eq!(prometheus.broken().unwrap(), Vec::<String>::new());

    cluster.node("executor-1").unwrap().kill().unwrap();
    let told = |_: &Cluster| Ok((prometheus.gone()? == ["executor"]).then_some(()));
    cluster
        .wait_for("word of the executor", LIMIT, told)
        .unwrap();
    cluster.node("executor-1").unwrap().restart().unwrap();
    cluster
        .wait_for("five services again", LIMIT, all_there)
        .unwrap();
}
