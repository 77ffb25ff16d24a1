//! Prometheus scrapes the services under their names, our rules run on what it finds, and a service that is gone is told of.

use std::path::Path;
use std::time::Duration;

use anyhow::{Context as _, Result};
use harness::cluster::{Cluster, Shape};
use harness::servers::Servers;
use harness::{granule, http};
use serde_json::Value;

use crate::alone;
use crate::faults::{PRODUCT, notice, until_whole};

const LIMIT: Duration = Duration::from_mins(1);
/// The service of each process.
const PROCESSES: [(&str, &str); 5] = [
    ("scheduler", "scheduler"),
    ("executor-1", "executor"),
    ("render-1", "render-worker"),
    ("ingestd-1", "ingestd"),
    ("tile-server", "tile-server"),
];

/// What counts under a name of its own: those services, and parts of their processes.
const COUNTING: [&str; 7] = [
    "ingestd",
    "scheduler",
    "deriver",
    "executor",
    "render_worker",
    "render_fleet",
    "tile_server",
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

    /// Names of all metrics of ours.
    fn names(&self) -> Result<Vec<String>> {
        let found = self.ask("label/__name__/values")?;
        let names = found.as_array().context("no list")?.iter();
        let ours = names
            .filter_map(Value::as_str)
            .filter(|name| name.starts_with("fluxglobe_"));
        Ok(ours.map(ToOwned::to_owned).collect())
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
        tile_servers: 1,
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
    counts_are_there(&cluster, &prometheus, inbox.path());

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

/// Once there was work, every service tells rate, errors and duration of it, and all metrics have one scheme of names.
fn counts_are_there(cluster: &Cluster, prometheus: &Prometheus, inbox: &Path) {
    let file = granule::write(inbox, 0, 0).unwrap();
    notice(cluster, &[file]);
    until_whole(cluster, 1);
    let tile = format!("/tiles/{PRODUCT}/volume/0/0/0.png?time=2000-01-20");
    assert_eq!(cluster.get(&tile).unwrap().status, 200);
    let wanted = COUNTING.iter().flat_map(|service| {
        ["requests_total", "request_seconds_count", "in_flight"]
            .map(|what| format!("fluxglobe_{service}_{what}"))
    });
    let wanted: Vec<String> = wanted.collect();
    let counted = |_: &Cluster| {
        let names = prometheus.names()?;
        let missing: Vec<&String> = wanted.iter().filter(|name| !names.contains(name)).collect();
        anyhow::ensure!(missing.is_empty(), "nobody counts {missing:?}");
        Ok(Some(()))
    };
    cluster
        .wait_for("count of every service", LIMIT, counted)
        .unwrap();
    let schemes = COUNTING.iter().copied().chain([
        "observations",
        "build_info",
        "render_adapter_info",
        "storage",
    ]);
    let schemes: Vec<String> = schemes.map(|part| format!("fluxglobe_{part}")).collect();
    for name in prometheus.names().unwrap() {
        assert!(
            schemes.iter().any(|scheme| name.starts_with(scheme)),
            "{name}"
        );
    }
}
