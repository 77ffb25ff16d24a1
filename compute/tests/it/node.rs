//! Services as processes of their own: this test program, started again with an order of what to be.

use std::io::{BufRead as _, BufReader, Read as _};
use std::net::SocketAddr;
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::{Arc, Condvar, Mutex};
use std::time::{Duration, Instant};

use compute::Objects;
use compute::service::{Executor, ExecutorSettings, Scheduler, SchedulerSettings};
use prometheus::Registry;
use serde::{Deserialize, Serialize};
use service::Stop;
use storage::Store;

use crate::troubled::Troubled;

/// Where a child finds its order.
const ORDER: &str = "FLUXGLOBE_TEST_NODE";
/// How long anything may take that a test waits for.
pub(crate) const LIMIT: Duration = Duration::from_mins(2);

/// What a child is to be.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) enum Order {
    Scheduler {
        store: String,
        listen: SocketAddr,
        lost_after_s: u64,
    },
    Executor {
        store: String,
        scheduler: String,
        work: String,
        /// Every read of the store takes so much longer.
        slow_ms: u64,
        /// Reads fail for so long after the first one.
        fail_ms: u64,
    },
}

#[derive(Debug, clap::Parser)]
struct SchedulerLine {
    #[command(flatten)]
    settings: SchedulerSettings,
}

#[derive(Debug, clap::Parser)]
struct ExecutorLine {
    #[command(flatten)]
    settings: ExecutorSettings,
}

/// The child's half: nothing at all unless a test of this program started it.
#[tokio::test(flavor = "multi_thread")]
async fn a_service_runs_here_when_a_test_starts_one() {
    let Some(order) = std::env::var_os(ORDER) else {
        return;
    };
    let order: Order = serde_json::from_str(order.to_str().unwrap()).unwrap();
    // The test that started this one is gone when nobody holds the other end any more; a word means an orderly end.
    let stop = Stop::new();
    let asked = stop.clone();
    std::thread::spawn(move || {
        let mut word = [0];
        match std::io::stdin().read(&mut word) {
            Ok(1) => asked.now(),
            _ => std::process::exit(0),
        }
    });
    let registry = Registry::new();
    match order {
        Order::Scheduler { .. } => run_scheduler(order, registry, stop).await,
        Order::Executor { .. } => run_executor(order, registry, stop).await,
    }
    println!("ENDED");
}

async fn run_scheduler(order: Order, registry: Registry, stop: Stop) {
    use clap::Parser as _;
    let Order::Scheduler {
        store,
        listen,
        lost_after_s,
    } = order
    else {
        unreachable!("the caller looked")
    };
    let (listen, lost_after_s) = (listen.to_string(), lost_after_s.to_string());
    let line = SchedulerLine::parse_from([
        "scheduler",
        "--scheduler-listen",
        &listen,
        "--executor-lost-after-s",
        &lost_after_s,
    ]);
    let store = Store::open(&store).unwrap();
    let scheduler = Scheduler::start(&line.settings, store, &registry)
        .await
        .unwrap();
    println!("READY {}", scheduler.address());
    tokio::spawn(async move {
        let mut shown = String::new();
        loop {
            let now = gauge(&registry, "fluxglobe_scheduler_executors");
            if now != shown {
                println!("EXECUTORS {now}");
                shown = now;
            }
            tokio::time::sleep(Duration::from_millis(20)).await;
        }
    });
    scheduler.run(stop).await.unwrap();
}

fn gauge(registry: &Registry, name: &str) -> String {
    let families = registry.gather();
    let family = families.iter().find(|family| family.name() == name);
    family.map_or_else(String::new, |family| {
        family.get_metric()[0].get_gauge().get_value().to_string()
    })
}

async fn run_executor(order: Order, registry: Registry, stop: Stop) {
    use clap::Parser as _;
    let Order::Executor {
        store,
        scheduler,
        work,
        slow_ms,
        fail_ms,
    } = order
    else {
        unreachable!("the caller looked")
    };
    let line = ExecutorLine::parse_from([
        "executor",
        "--scheduler",
        &scheduler,
        "--executor-listen",
        "127.0.0.1:0",
        "--executor-work",
        &work,
        "--executor-tasks",
        "1",
    ]);
    let store = Store::open(&store).unwrap();
    let (root, objects) = store.sql_root();
    let delay = Duration::from_millis(slow_ms);
    let troubled = Troubled::new(objects, delay, Duration::from_millis(fail_ms));
    let objects = Objects::new(root, Arc::new(troubled));
    let executor = Executor::start_over(&line.settings, store, objects, &registry)
        .await
        .unwrap();
    println!("READY {}", executor.address());
    println!("IDENTITY {}", executor.id());
    executor.run(stop).await.unwrap();
}

/// A service as a child of this process; it is killed with its owner.
pub(crate) struct Node {
    child: Child,
    stdin: Option<ChildStdin>,
    lines: Arc<Lines>,
}

#[derive(Default)]
struct Lines {
    lines: Mutex<Vec<(Instant, String)>>,
    more: Condvar,
}

impl Node {
    pub(crate) fn start(order: &Order) -> Self {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "node::a_service_runs_here_when_a_test_starts_one",
            ])
            .args(["--nocapture", "--test-threads=1"])
            .env(ORDER, serde_json::to_string(order).unwrap())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let lines = Arc::new(Lines::default());
        let (stdout, heard) = (child.stdout.take().unwrap(), Arc::clone(&lines));
        std::thread::spawn(move || {
            for line in BufReader::new(stdout).lines().map_while(Result::ok) {
                heard.lines.lock().unwrap().push((Instant::now(), line));
                heard.more.notify_all();
            }
        });
        Self {
            stdin: child.stdin.take(),
            child,
            lines,
        }
    }

    /// The end of the first line that begins so, from the `from`th line on, when it was heard, and where to go on.
    pub(crate) fn heard(&self, beginning: &str, from: usize) -> (Instant, String, usize) {
        let end = Instant::now() + LIMIT;
        let mut lines = self.lines.lines.lock().unwrap();
        loop {
            let rest = lines.iter().enumerate().skip(from);
            // The test runner may have begun the line.
            let mut found = rest.filter_map(|(index, (at, line))| {
                let (_, after) = line.split_once(beginning)?;
                Some((*at, after.to_owned(), index + 1))
            });
            if let Some(found) = found.next() {
                return found;
            }
            drop(found);
            let left = end.checked_duration_since(Instant::now());
            let left = left.unwrap_or_else(|| panic!("no {beginning:?} in {:#?}", *lines));
            lines = self.lines.more.wait_timeout(lines, left).unwrap().0;
        }
    }

    /// How many lines were heard so far.
    pub(crate) fn line_count(&self) -> usize {
        self.lines.lines.lock().unwrap().len()
    }

    pub(crate) fn address(&self) -> SocketAddr {
        self.heard("READY ", 0).1.parse().unwrap()
    }

    /// The identity of an executor's life.
    pub(crate) fn identity(&self) -> String {
        self.heard("IDENTITY ", 0).1
    }

    /// Ends it as a power cut would.
    pub(crate) fn kill(&mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Stops it in its tracks: it holds its port and answers nobody.
    pub(crate) fn freeze(&self) {
        let id = self.child.id().to_string();
        let stopped = Command::new("kill").args(["-STOP", &id]).status();
        assert!(stopped.unwrap().success());
    }

    /// Asks it to end and waits until it has.
    pub(crate) fn stop(&mut self) {
        use std::io::Write as _;
        self.stdin.as_mut().unwrap().write_all(b"s").unwrap();
        let end = Instant::now() + LIMIT;
        while self.child.try_wait().unwrap().is_none() {
            assert!(Instant::now() < end, "it does not stop");
            std::thread::sleep(Duration::from_millis(20));
        }
        self.heard("ENDED", 0);
    }
}

impl Drop for Node {
    fn drop(&mut self) {
        // It may be gone already.
        drop(self.child.kill());
        drop(self.child.wait());
    }
}

/// A scheduler and some executors over a store in a folder.
pub(crate) struct Cluster {
    pub(crate) scheduler: Node,
    pub(crate) address: SocketAddr,
    pub(crate) executors: Vec<Node>,
    store: String,
    work: tempfile::TempDir,
    lost_after_s: u64,
}

/// What a scheduler waits for a sign of life unless told otherwise, as services do.
const LOST_AFTER_S: u64 = 3;

impl Cluster {
    pub(crate) fn start(store: &Path) -> Self {
        Self::start_with(store, LOST_AFTER_S)
    }

    /// With a scheduler that waits so long for a sign of life of an executor.
    pub(crate) fn start_with(store: &Path, lost_after_s: u64) -> Self {
        let store = store.to_str().unwrap().to_owned();
        let scheduler = Node::start(&Order::Scheduler {
            store: store.clone(),
            listen: "127.0.0.1:0".parse().unwrap(),
            lost_after_s,
        });
        Self {
            address: scheduler.address(),
            scheduler,
            executors: vec![],
            store,
            work: tempfile::tempdir().unwrap(),
            lost_after_s,
        }
    }

    /// Starts executors and waits until the scheduler knows them.
    pub(crate) fn add(&mut self, count: usize, slow_ms: u64, fail_ms: u64) {
        let order = Order::Executor {
            store: self.store.clone(),
            scheduler: self.address.to_string(),
            work: self.work.path().to_str().unwrap().to_owned(),
            slow_ms,
            fail_ms,
        };
        self.executors
            .extend((0..count).map(|_| Node::start(&order)));
        self.scheduler
            .heard(&format!("EXECUTORS {}", self.executors.len()), 0);
    }

    /// Starts the scheduler again where it was.
    pub(crate) fn restart_scheduler(&mut self) {
        self.scheduler = Node::start(&Order::Scheduler {
            store: self.store.clone(),
            listen: self.address,
            lost_after_s: self.lost_after_s,
        });
        self.scheduler.address();
    }

    /// Waits until an executor has stored intermediate results of a query: it is in the middle of it.
    pub(crate) fn busy(&self, executor: usize) {
        let folder = self.work.path().join(self.executors[executor].identity());
        let end = Instant::now() + LIMIT;
        let is_busy = || std::fs::read_dir(&folder).is_ok_and(|mut jobs| jobs.next().is_some());
        while !is_busy() {
            assert!(Instant::now() < end, "executor {executor} never worked");
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}
