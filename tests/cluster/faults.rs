//! kill -9 of every kind of process while granules land, budgets are asked for and tiles are drawn.
//!
//! `FLUXGLOBE_KILLS` is how many (in turn first, then at random), `FLUXGLOBE_SEED` makes the same choice again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use contract::event::{Body, Event};
use contract::topic::Topic;
use harness::cluster::{Cluster, Shape};
use harness::{granule, http, program};
use kafka_log::{KafkaLog, KafkaSettings};
use serde_json::Value;
use storage::log::EventLog as _;

use crate::alone;

pub(crate) const PRODUCT: &str = "killed-flux";
const ACCUMULATED: &str = "killed-flux-accumulated";
const LIMIT: Duration = Duration::from_mins(4);
/// Granules noticed before each kill.
const GRANULES_A_KILL: usize = 2;
const TILES: [&str; 3] = ["0/0/0", "1/0/1", "2/1/1"];
const TIME: &str = "2000-03-10T12:00:00Z";

/// xorshift64*: enough to choose victims, and the same choice for the same seed.
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_F491_4F6C_DD1D)
    }

    fn below(&mut self, limit: usize) -> usize {
        (self.next() >> 33) as usize % limit
    }
}

#[expect(
    clippy::disallowed_methods,
    reason = "tests have no command line of their own"
)]
pub(crate) fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable)
        .ok()
        .and_then(|text| text.parse().ok())
        .unwrap_or(default)
}

#[expect(
    clippy::print_stderr,
    reason = "seeds and times are what the test is for"
)]
pub(crate) fn say(line: &str) {
    eprintln!("{line}");
}

/// The same granules through one process that nobody disturbs: budget rows and tiles.
fn undisturbed(data: &Path, files: &[PathBuf]) -> (Value, Vec<Vec<u8>>) {
    let files: Vec<&str> = files.iter().map(|file| file.to_str().unwrap()).collect();
    program::succeed(
        data,
        &[&["ingest", "--product", PRODUCT], &files[..]].concat(),
    )
    .unwrap();
    program::succeed(data, &["derive", "accumulated", "--product", PRODUCT]).unwrap();
    let budget = program::json(
        data,
        &["budget", "--product", PRODUCT, "--step", "month", "--json"],
    )
    .unwrap();
    let tile = |address: &str| {
        let file = data.join("tile.png");
        let [z, x, y] = address.split('/').collect::<Vec<_>>()[..] else {
            panic!("{address}")
        };
        let words = [
            "render",
            "tile",
            "--layer",
            PRODUCT,
            "--time",
            TIME,
            "--z",
            z,
            "--x",
            x,
            "--y",
            y,
            "-o",
            file.to_str().unwrap(),
        ];
        program::succeed(data, &words).unwrap();
        std::fs::read(&file).unwrap()
    };
    (budget["rows"].clone(), TILES.map(tile).to_vec())
}

/// Asks for tiles and budgets all the time, as people do; what fails must say that it may be asked again.
struct Load {
    stop: Arc<AtomicBool>,
    answered: Arc<AtomicU64>,
    wrong: Arc<Mutex<Vec<String>>>,
    thread: Option<std::thread::JoinHandle<()>>,
}

impl Load {
    fn start(tiles: &str) -> Self {
        let (stop, answered) = (
            Arc::new(AtomicBool::new(false)),
            Arc::new(AtomicU64::new(0)),
        );
        let wrong = Arc::new(Mutex::new(vec![]));
        let asked = [
            format!("{tiles}/tiles/{PRODUCT}/volume/0/0/0.png?time={TIME}"),
            format!("{tiles}/tiles/{PRODUCT}/volume/2/1/1.png?time=2000-02"),
            format!("{tiles}/api/products/{PRODUCT}/budget?step=month"),
            format!("{tiles}/api/products/{PRODUCT}/point?lon=-150&lat=2"),
        ];
        let (stop_too, answered_too, wrong_too) =
            (Arc::clone(&stop), Arc::clone(&answered), Arc::clone(&wrong));
        let thread = std::thread::spawn(move || {
            for url in asked.iter().cycle() {
                if stop_too.load(Ordering::Relaxed) {
                    return;
                }
                match http::get(url) {
                    Ok(answer) if answer.status == 200 => {
                        answered_too.fetch_add(1, Ordering::Relaxed);
                    }
                    // Not there yet, or away for the moment: both are said.
                    Ok(answer) if matches!(answer.status, 404 | 503 | 504) => {}
                    Ok(answer) => wrong_too.lock().unwrap().push(format!(
                        "{url}: {} {}",
                        answer.status,
                        answer.text()
                    )),
                    // The tile server itself was killed.
                    Err(_away) => {}
                }
                std::thread::sleep(Duration::from_millis(50));
            }
        });
        Self {
            stop,
            answered,
            wrong,
            thread: Some(thread),
        }
    }

    fn end(mut self) -> (u64, Vec<String>) {
        self.stop.store(true, Ordering::Relaxed);
        self.thread.take().unwrap().join().unwrap();
        let wrong = self.wrong.lock().unwrap().clone();
        (self.answered.load(Ordering::Relaxed), wrong)
    }
}

#[test]
fn killed_processes_lose_nothing_and_double_nothing() {
    let _alone = alone();
    let kills = number("FLUXGLOBE_KILLS", 9) as usize;
    let seed = number("FLUXGLOBE_SEED", 20_261_121);
    say(&format!("kills: {kills}, seed: {seed}"));
    let mut dice = Dice(seed | 1);
    let inbox = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> = (0..kills * GRANULES_A_KILL)
        .map(|month| granule::write(inbox.path(), month, 0).unwrap())
        .collect();
    let mut cluster = Cluster::start(Shape::default(), inbox.path()).unwrap();
    let load = Load::start(&cluster.tiles);
    let names: Vec<String> = cluster.nodes.keys().cloned().collect();
    let mut recovery: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for (kill, batch) in files.chunks(GRANULES_A_KILL).enumerate() {
        notice(&cluster, batch);
        std::thread::sleep(Duration::from_millis(dice.below(1200) as u64));
        let victim = if kill < names.len() {
            &names[kill]
        } else {
            &names[dice.below(names.len())]
        };
        let begun = Instant::now();
        let node = cluster.node(victim).unwrap();
        node.kill().unwrap();
        node.restart().unwrap();
        node.wait_until_ready().unwrap();
        let seconds = begun.elapsed().as_secs_f64();
        say(&format!(
            "kill {kill}: {victim}, ready again after {seconds:.2} s"
        ));
        let kind = victim
            .trim_end_matches(|c: char| c.is_ascii_digit() || c == '-')
            .to_owned();
        recovery.entry(kind).or_default().push(seconds);
    }
    until_whole(&cluster, files.len());
    let (answered, wrong) = load.end();
    assert!(wrong.is_empty(), "{wrong:?}");
    assert!(
        answered > 0,
        "nothing was answered meanwhile: the load asked nothing"
    );

    let data = tempfile::tempdir().unwrap();
    let (rows, tiles) = undisturbed(data.path(), &files);
    let budget = cluster
        .succeed(&["budget", "--product", PRODUCT, "--step", "month", "--json"])
        .unwrap();
    let budget: Value = serde_json::from_str(&budget).unwrap();
    assert_eq!(budget["rows"], rows);
    for (address, expected) in TILES.iter().zip(tiles) {
        let tile = cluster
            .get(&format!(
                "/tiles/{PRODUCT}/volume/{address}.png?time={TIME}"
            ))
            .unwrap();
        assert_eq!(tile.status, 200, "{}", tile.text());
        assert_eq!(tile.body, expected, "{address}");
    }
    each_event_once(&cluster, &files);
    for (kind, mut seconds) in recovery {
        seconds.sort_by(f64::total_cmp);
        say(&format!(
            "recovery of {kind}: {} kills, median {:.2} s, longest {:.2} s",
            seconds.len(),
            seconds[seconds.len() / 2],
            seconds[seconds.len() - 1]
        ));
    }
}

pub(crate) fn notice(cluster: &Cluster, files: &[PathBuf]) {
    let mut words = vec!["notice", "--product", PRODUCT];
    words.extend(files.iter().map(|file| file.to_str().unwrap()));
    cluster.succeed(&words).unwrap();
}

/// Waits until everything has landed and what is derived is of the newest version.
pub(crate) fn until_whole(cluster: &Cluster, months: usize) {
    let look = |cluster: &Cluster| {
        let products: Value = serde_json::from_str(&cluster.succeed(&["products", "--json"])?)?;
        let find = |name: &str| {
            products
                .as_array()?
                .iter()
                .find(|product| product["product"] == name)
                .cloned()
        };
        let (Some(flux), Some(derived)) = (find(PRODUCT), find(ACCUMULATED)) else {
            return Ok(None);
        };
        let is_whole = flux["steps"] == months && derived["derived_from"] == flux["manifest"];
        Ok(is_whole.then_some(()))
    };
    cluster.wait_for("whole product", LIMIT, look).unwrap();
    // The tile server looks for itself.
    let derived = |cluster: &Cluster| {
        let point = cluster
            .get(&format!("/api/products/{PRODUCT}/point?lon=-150&lat=2"))?
            .json()?;
        Ok((point["series"].as_array().map(Vec::len) == Some(months)).then_some(()))
    };
    cluster
        .wait_for("tile server that knows all of it", LIMIT, derived)
        .unwrap();
}

/// One `granule.landed` and one `product.derived` for each granule.
pub(crate) fn each_event_once(cluster: &Cluster, files: &[PathBuf]) {
    let mut landed: BTreeMap<String, usize> = BTreeMap::new();
    for event in events(cluster, Topic::GranuleLanded) {
        if let Body::GranuleLanded { path, .. } = event.body {
            *landed.entry(path).or_default() += 1;
        }
    }
    for file in files {
        let count = landed.remove(&file.display().to_string()).unwrap_or(0);
        assert_eq!(count, 1, "events of {}", file.display());
    }
    assert!(landed.is_empty(), "{landed:?}");
    assert_eq!(events(cluster, Topic::GranuleRejected), vec![]);
    // Granules that are derived together share a version; each still has its own event, with its own trace.
    let mut derived: Vec<String> = events(cluster, Topic::ProductDerived)
        .into_iter()
        .map(|event| event.trace)
        .collect();
    derived.sort();
    let told = derived.len();
    derived.dedup();
    assert_eq!(
        derived.len(),
        told,
        "a derivation was told twice for one granule"
    );
    assert_eq!(told, files.len(), "a granule has no derivation");
}

/// All events of a topic.
pub(crate) fn events(cluster: &Cluster, topic: Topic) -> Vec<Event> {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let servers = cluster.servers.setting("FLUXGLOBE_KAFKA").unwrap();
        let log = KafkaLog::connect(&KafkaSettings::plain(servers))
            .await
            .unwrap();
        let messages = storage::log::contents(&log, topic).await.unwrap();
        messages
            .iter()
            .map(|message| message.event().unwrap())
            .collect()
    })
}

/// Appends an event as any client may.
pub(crate) fn append(cluster: &Cluster, event: Event) {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    runtime.block_on(async {
        let servers = cluster.servers.setting("FLUXGLOBE_KAFKA").unwrap();
        let log = KafkaLog::connect(&KafkaSettings::plain(servers))
            .await
            .unwrap();
        log.append(&[event]).await.unwrap();
    });
}
