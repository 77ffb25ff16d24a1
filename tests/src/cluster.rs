//! A whole cluster of a test's own: real servers, and every service as a process that can be killed.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Output, Stdio};
use std::time::{Duration, Instant};

use anyhow::{Context as _, Result, bail, ensure};
use tempfile::TempDir;
use test_data::free_port;

use crate::http::{self, Answer};
use crate::node::Node;
use crate::program;
use crate::proxy::Proxy;
use crate::servers::Servers;

/// How many of each service.
#[derive(Debug, Clone, Copy)]
pub struct Shape {
    /// Ballista executors.
    pub executors: usize,
    /// Ingest replicas.
    pub ingestds: usize,
    /// Render workers.
    pub render_workers: usize,
    /// Tile servers.
    pub tile_servers: usize,
}

impl Default for Shape {
    fn default() -> Self {
        Self {
            executors: 2,
            ingestds: 2,
            render_workers: 2,
            tile_servers: 1,
        }
    }
}

/// Running servers and services.
pub struct Cluster {
    /// Services by name; dropped, and so killed, before the servers.
    pub nodes: BTreeMap<String, Node>,
    /// Address of the first tile server.
    pub tiles: String,
    /// What stands before S3.
    pub s3: Proxy,
    /// Kafka, PostGIS and S3.
    pub servers: Servers,
    settings: Vec<(String, String)>,
    folder: TempDir,
}

/// What is still to be started: name, words, health address.
type Planned = (String, Vec<String>, String);

impl Cluster {
    /// Starts everything and waits until it is ready. `inbox` is the folder that notices may name files of.
    pub fn start(shape: Shape, inbox: &Path) -> Result<Self> {
        let servers = Servers::start(&["kafka", "postgis", "s3"])?;
        let folder = tempfile::tempdir()?;
        let (planned, scheduler, renderers) = plan(shape);
        let mut settings = servers.settings().to_vec();
        let s3 = before_s3(&servers)?;
        settings.retain(|(name, _)| name != "AWS_ENDPOINT_URL");
        let mut set = |name: &str, value: String| settings.push((name.to_owned(), value));
        set("FLUXGLOBE_STORE", "s3://fluxglobe/cluster".to_owned());
        set("AWS_ENDPOINT_URL", format!("http://{}", s3.address));
        set("FLUXGLOBE_CLUSTER", format!("http://{scheduler}"));
        set("FLUXGLOBE_RENDER_WORKERS", renderers.join(","));
        set("FLUXGLOBE_ALLOW_FOLDER", inbox.display().to_string());
        set("FLUXGLOBE_ALLOW_STORE", "s3://fluxglobe/inbox".to_owned());
        set(
            "FLUXGLOBE_SPOOL",
            folder.path().join("spool").display().to_string(),
        );
        set(
            "FLUXGLOBE_EXECUTOR_WORK",
            folder.path().join("work").display().to_string(),
        );
        set("FLUXGLOBE_LOG", "info".to_owned());
        set("NODEVICE_SELECT", "1".to_owned());
        let mut cluster = Self {
            nodes: BTreeMap::new(),
            tiles: String::new(),
            s3,
            servers,
            settings,
            folder,
        };
        cluster.succeed(&["topics", "create"])?;
        for (name, words, address) in planned {
            let words: Vec<&str> = words.iter().map(String::as_str).collect();
            let mut settings = cluster.settings.clone();
            settings.push(("FLUXGLOBE_KAFKA_INSTANCE".to_owned(), name.clone()));
            let node = Node::start(cluster.folder.path(), &name, &words, &address, &settings)?;
            if name == "tile-server" {
                cluster.tiles = format!("http://{address}");
            }
            cluster.nodes.insert(name, node);
        }
        for node in cluster.nodes.values_mut() {
            node.wait_until_ready()?;
        }
        Ok(cluster)
    }

    /// Addresses of all tile servers.
    pub fn tile_servers(&self) -> Vec<String> {
        let nodes = self.nodes.values();
        let servers = nodes.filter(|node| node.name.starts_with("tile-server"));
        servers.map(|node| node.admin.clone()).collect()
    }

    /// Settings that every process of the cluster has.
    pub fn settings(&self) -> &[(String, String)] {
        &self.settings
    }

    /// One of them.
    pub fn setting(&self, name: &str) -> Result<&str> {
        let mut all = self.settings.iter();
        let found = all.find(|(known, _)| known == name);
        found
            .map(|(_, value)| value.as_str())
            .with_context(|| format!("{name} is not set"))
    }

    /// A service.
    pub fn node(&mut self, name: &str) -> Result<&mut Node> {
        self.nodes
            .get_mut(name)
            .with_context(|| format!("there is no {name}"))
    }

    /// Runs a command against the cluster, whatever its exit code.
    pub fn run(&self, words: &[&str]) -> Result<Output> {
        program::unset()
            .args(words)
            .envs(self.settings.iter().map(|(name, value)| (name, value)))
            .env("FLUXGLOBE_LOG", "warn")
            .stdin(Stdio::null())
            .output()
            .context("cannot start fluxglobe")
    }

    /// Standard output of a command that must succeed.
    pub fn succeed(&self, words: &[&str]) -> Result<String> {
        let output = self.run(words)?;
        let talk = String::from_utf8_lossy(&output.stderr);
        ensure!(
            output.status.success(),
            "fluxglobe {words:?} failed ({}):\n{talk}",
            output.status
        );
        Ok(String::from_utf8(output.stdout)?)
    }

    /// Sends notices of files.
    pub fn notice(&self, files: &[PathBuf]) -> Result<()> {
        let files: Vec<String> = files
            .iter()
            .map(|file| file.display().to_string())
            .collect();
        let words: Vec<&str> = std::iter::once("notice")
            .chain(files.iter().map(String::as_str))
            .collect();
        self.succeed(&words).map(|_text| ())
    }

    /// Fetches a path of the tile server.
    pub fn get(&self, path: &str) -> Result<Answer> {
        http::get(&format!("{}{path}", self.tiles))
    }

    /// What every service said last: for a test that failed.
    pub fn talk(&self) -> String {
        let talk = |node: &Node| format!("--- {}\n{}\n", node.name, node.talk());
        self.nodes.values().map(talk).collect()
    }

    /// Asks until there is an answer.
    ///
    /// # Errors
    /// None within the limit: with what the services said.
    pub fn wait_for<T>(
        &self,
        what: &str,
        limit: Duration,
        mut ask: impl FnMut(&Self) -> Result<Option<T>>,
    ) -> Result<T> {
        let start = Instant::now();
        let mut last = None;
        while start.elapsed() < limit {
            match ask(self) {
                Ok(Some(found)) => return Ok(found),
                Ok(None) => last = None,
                Err(error) => last = Some(error),
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        bail!(
            "no {what} within {limit:?} (last error: {last:?})\n{}",
            self.talk()
        )
    }
}

fn before_s3(servers: &Servers) -> Result<Proxy> {
    let endpoint = servers.setting("AWS_ENDPOINT_URL")?;
    let address = endpoint.trim_start_matches("http://").trim_end_matches('/');
    Proxy::start(
        address
            .parse()
            .with_context(|| format!("{endpoint} is no address"))?,
    )
}

fn plan(shape: Shape) -> (Vec<Planned>, String, Vec<String>) {
    let address = || format!("127.0.0.1:{}", free_port());
    let (scheduler, mut planned, mut renderers) = (address(), vec![], vec![]);
    let mut add = |name: String, words: &[&str], with_admin: bool| {
        let admin = address();
        let mut words: Vec<String> = words.iter().map(ToString::to_string).collect();
        words.extend([
            if with_admin { "--admin" } else { "--listen" }.to_owned(),
            admin.clone(),
        ]);
        planned.push((name, words, admin));
    };
    add(
        "scheduler".to_owned(),
        &["scheduler", "--scheduler-listen", &scheduler],
        true,
    );
    for i in 1..=shape.executors {
        add(
            format!("executor-{i}"),
            &["executor", "--executor-listen", &address()],
            true,
        );
    }
    for i in 1..=shape.render_workers {
        let listen = address();
        add(
            format!("render-{i}"),
            &["render-worker", "--render-listen", &listen],
            true,
        );
        renderers.push(listen);
    }
    for i in 1..=shape.ingestds {
        add(format!("ingestd-{i}"), &["ingestd"], true);
    }
    for i in 1..=shape.tile_servers {
        let number = if i == 1 {
            String::new()
        } else {
            format!("-{i}")
        };
        add(format!("tile-server{number}"), &["tile-server"], false);
    }
    (planned, scheduler, renderers)
}
