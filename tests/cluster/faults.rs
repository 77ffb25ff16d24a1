//! kill -9 of every kind of process while granules land and are revised, budgets are asked for and tiles are drawn.
//!
//! `FLUXGLOBE_KILLS` is how many (in turn first, then at random), `FLUXGLOBE_SEED` makes the same choice again.

mod load;
mod truth;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::event::{Body, Event};
use contract::topic::Topic;
use harness::cluster::{Cluster, Shape};
use harness::{granule, program};
use kafka_log::{KafkaLog, KafkaSettings};
use serde_json::Value;
use storage::StorageError;
use storage::log::{EventLog as _, Message};

use crate::alone;
use load::{Load, Sent};
use truth::{EDITIONS, Truth};

pub(crate) const PRODUCT: &str = "killed-flux";
const ACCUMULATED: &str = "killed-flux-accumulated";
const LIMIT: Duration = Duration::from_mins(4);
/// The product that granules without a named one land in, by their variable.
const FOUGHT: &str = "fgco2";
/// Months that are there before the first kill.
const FIRST_MONTHS: usize = 4;
/// The error budget: how many questions may go without an answer, and for how long in a row. Two tile servers are asked,
/// one after the other, so that one of them always can answer: of 377 questions none went without. A few may, where a
/// machine is so slow that both are busy; a wrong answer is none too many. The time says that something stood still, not
/// how fast it has to be.
const MISSING_SHARE: f64 = 0.02;
const MISSING_FEW: f64 = 2.0;
const LONGEST_GAP: Duration = Duration::from_mins(1);
/// A place with data: longitude and latitude, degrees.
const PLACE: (&str, &str) = ("-150", "2");
const MAP_TILE: &str = "1/0/1";
const TILES: [&str; 3] = ["0/0/0", "1/0/1", "2/1/1"];
/// Between the middles of February and March.
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
    program::succeed(data, &[&["ingest"], &files[..]].concat()).unwrap();
    program::succeed(data, &["derive", "accumulated", "--product", FOUGHT]).unwrap();
    let words = ["budget", "--product", FOUGHT, "--step", "month", "--json"];
    let budget = program::json(data, &words).unwrap();
    let tile = |address: &str| truth::tile(data, "volume", address);
    (budget["rows"].clone(), TILES.map(tile).to_vec())
}

/// Notices as they are sent, which the test keeps so that it can send one twice.
struct Sender {
    inbox: PathBuf,
    sent: Sent,
    /// Of files that a newer edition replaced.
    stale: Vec<Event>,
}

impl Sender {
    fn file(&self, (month, edition): (usize, usize)) -> PathBuf {
        granule::write(&self.inbox, month, edition).unwrap()
    }

    /// Sends notices of some editions of months, at once. They name no product, so that they go to several partitions, and
    /// replicas fight over the product that they all land in, and over the month that two of them are of.
    fn send(&mut self, cluster: &Cluster, granules: &[(usize, usize)], again: Option<Event>) {
        let files: Vec<PathBuf> = granules.iter().map(|granule| self.file(*granule)).collect();
        let mut words = vec!["notice", "--print"];
        words.extend(files.iter().map(|file| file.to_str().unwrap()));
        let lines = cluster.succeed(&words).unwrap();
        let mut events: Vec<Event> = lines
            .lines()
            .map(|line| Event::from_json(line).unwrap())
            .collect();
        let mut sent = self.sent.lock().unwrap();
        for (&(month, edition), event) in granules.iter().zip(&events) {
            let count = sent.len().max(month + 1);
            sent.resize(count, 0);
            sent[month] = sent[month].max(edition);
            if edition + 1 < EDITIONS && granules.contains(&(month, edition + 1)) {
                self.stale.push(event.clone());
            }
        }
        drop(sent);
        events.extend(again);
        append_all(cluster, &events);
    }

    /// The files that count in the end.
    fn newest(&self) -> Vec<PathBuf> {
        let sent = self.sent.lock().unwrap().clone();
        let newest = sent.into_iter().enumerate();
        newest.map(|granule| self.file(granule)).collect()
    }
}

/// Victims: one of each kind first, then the others.
fn victims(cluster: &Cluster) -> Vec<String> {
    let kind = |name: &str| {
        let word = name.trim_end_matches(|c: char| c.is_ascii_digit() || c == '-');
        word.to_owned()
    };
    let (mut firsts, mut others): (Vec<String>, Vec<String>) = (vec![], vec![]);
    for name in cluster.nodes.keys() {
        if firsts.iter().any(|first| kind(first) == kind(name)) {
            others.push(name.clone());
        } else {
            firsts.push(name.clone());
        }
    }
    firsts.extend(others);
    firsts
}

/// What the others do while the victim is dead: all that is noticed lands; pictures are drawn and budgets computed anew
/// unless only the victim can.
fn until_taken_over(cluster: &Cluster, victim: &str, round: usize, sender: &Sender, truth: &Truth) {
    until_landed(cluster, victim, sender, truth);
    if victim.starts_with("render") {
        let (day, hour) = (1 + round % 28, round % 24);
        let path =
            format!("/tiles/{FOUGHT}/map/{MAP_TILE}.png?time=2000-02-{day:02}T{hour:02}:00:00Z");
        let drawn = |cluster: &Cluster| {
            let tile = cluster.get(&path)?;
            anyhow::ensure!(
                tile.status == 200,
                "{path}: {} {}",
                tile.status,
                tile.text()
            );
            Ok(Some(()))
        };
        cluster.wait_for("new picture", LIMIT, drawn).unwrap();
    }
    if victim.starts_with("executor") {
        until_derived(cluster);
    }
}

/// Waits until a tile server that lives shows the newest edition of each month.
fn until_landed(cluster: &Cluster, dead: &str, sender: &Sender, truth: &Truth) {
    let newest = sender.sent.lock().unwrap().clone();
    let (lon, lat) = PLACE;
    let path = format!("/api/products/{FOUGHT}/point?lon={lon}&lat={lat}");
    let server = cluster
        .nodes
        .values()
        .find(|node| node.name.starts_with("tile-server") && node.name != dead)
        .unwrap();
    let shown = |_: &Cluster| {
        let answer = server.get(&path)?.json()?;
        let series = answer["series"].as_array().cloned().unwrap_or_default();
        let is_newest = |(month, edition): (usize, &usize)| {
            let value = series.get(month).and_then(|row| row["value"].as_f64());
            value.and_then(|value| truth.of_value(month, value)) == Some(*edition)
        };
        Ok(newest.iter().enumerate().all(is_newest).then_some(()))
    };
    let what = format!("newest edition of each month while {dead} is dead");
    cluster.wait_for(&what, LIMIT, shown).unwrap();
}

/// Waits until what is derived is of the newest version.
fn until_derived(cluster: &Cluster) {
    let look = |cluster: &Cluster| {
        let products: Value = serde_json::from_str(&cluster.succeed(&["products", "--json"])?)?;
        let all = products.as_array().cloned().unwrap_or_default();
        let find = |name: &str| all.iter().find(|product| product["product"] == name);
        let (Some(flux), Some(derived)) = (find(FOUGHT), find(&format!("{FOUGHT}-accumulated")))
        else {
            return Ok(None);
        };
        Ok((derived["derived_from"] == flux["manifest"]).then_some(()))
    };
    cluster.wait_for("derived product", LIMIT, look).unwrap();
}

/// Waits until every notice is finished, duplicates included.
fn until_read(cluster: &Cluster) {
    let lag = |cluster: &Cluster| {
        let lag = on_log(cluster, async |log| {
            log.lag(Topic::GranuleNotice, "ingest").await
        })?;
        Ok((lag == 0).then_some(()))
    };
    cluster.wait_for("notices finished", LIMIT, lag).unwrap();
}

/// Kills one process after the other while granules land, are revised and are noticed twice, with clients that compare every
/// answer; each victim stays dead until the others did its work.
#[test]
fn killed_processes_lose_nothing_double_nothing_and_nobody_is_told_anything_wrong() {
    let _alone = alone();
    let kills = number("FLUXGLOBE_KILLS", 6) as usize;
    let seed = number("FLUXGLOBE_SEED", 20_261_121);
    say(&format!("kills: {kills}, seed: {seed}"));
    let mut dice = Dice(seed | 1);
    let inbox = tempfile::tempdir().unwrap();
    let truth = Arc::new(Truth::of(FIRST_MONTHS + kills, MAP_TILE));
    let shape = Shape {
        tile_servers: 2,
        ..Shape::default()
    };
    let mut cluster = Cluster::start(shape, inbox.path()).unwrap();
    let mut sender = Sender {
        inbox: inbox.path().to_owned(),
        sent: Sent::default(),
        stale: vec![],
    };
    let first: Vec<(usize, usize)> = (0..FIRST_MONTHS).map(|month| (month, 0)).collect();
    sender.send(&cluster, &first, None);
    until_landed(&cluster, "nobody", &sender, &truth);
    until_derived(&cluster);

    let load = Load::start(&cluster.tile_servers(), &truth, &sender.sent);
    let names = victims(&cluster);
    let mut recovery: BTreeMap<String, Vec<f64>> = BTreeMap::new();
    for round in 0..kills {
        let again = sender
            .stale
            .get(dice.below(sender.stale.len().max(1)))
            .cloned();
        let granules = [(FIRST_MONTHS + round, 0), (round, 1), (round, 2)];
        sender.send(&cluster, &granules, again);
        std::thread::sleep(Duration::from_millis(dice.below(1200) as u64));
        let victim = match names.get(round) {
            Some(name) => name,
            None => &names[dice.below(names.len())],
        };
        cluster.node(victim).unwrap().kill().unwrap();
        let begun = Instant::now();
        until_taken_over(&cluster, victim, round, &sender, &truth);
        let taken_over = begun.elapsed().as_secs_f64();
        let node = cluster.node(victim).unwrap();
        let begun = Instant::now();
        node.restart().unwrap();
        node.wait_until_ready().unwrap();
        let ready = begun.elapsed().as_secs_f64();
        say(&format!(
            "kill {round}: {victim}, others had done its work after {taken_over:.2} s, ready again in {ready:.2} s"
        ));
        let kind = victim.trim_end_matches(|c: char| c.is_ascii_digit() || c == '-');
        recovery
            .entry(kind.to_owned())
            .or_default()
            .push(taken_over);
    }
    until_landed(&cluster, "nobody", &sender, &truth);
    until_read(&cluster);
    until_derived(&cluster);
    assert_answered(load, &cluster);
    assert_as_undisturbed(&cluster, &sender);
    each_file_told_once(&cluster, &sender);
    for (kind, mut seconds) in recovery {
        seconds.sort_by(f64::total_cmp);
        say(&format!(
            "{kind}: {} kills, others had done its work after {:.2} s (median), {:.2} s (longest)",
            seconds.len(),
            seconds[seconds.len() / 2],
            seconds[seconds.len() - 1]
        ));
    }
}

/// No answer was wrong, and few were missing.
fn assert_answered(load: Load, cluster: &Cluster) {
    for tally in load.end() {
        assert!(
            tally.wrong.is_empty(),
            "{:?}\n{}",
            tally.wrong,
            refusals(cluster)
        );
        assert!(
            tally.right > 0,
            "nothing was answered: the load asked nothing"
        );
        let asked = (tally.right + tally.missing) as f64;
        let missing = tally.missing as f64;
        assert!(
            missing <= MISSING_FEW + MISSING_SHARE * asked,
            "{missing} of {asked} questions had no answer"
        );
        assert!(tally.longest_gap <= LONGEST_GAP, "{:?}", tally.longest_gap);
    }
}

/// What tile servers said of requests that failed: their folders go with the cluster.
fn refusals(cluster: &Cluster) -> String {
    let servers = cluster.nodes.values();
    let servers = servers.filter(|node| node.name.starts_with("tile-server"));
    let said = servers.map(harness::node::Node::said).collect::<String>();
    let failed = said
        .lines()
        .filter(|line| line.contains("a request failed"));
    failed.collect::<Vec<_>>().join("\n")
}

/// Budgets and tiles of the end have the bytes of a run in which each month landed once, in its newest edition.
fn assert_as_undisturbed(cluster: &Cluster, sender: &Sender) {
    let data = tempfile::tempdir().unwrap();
    let (rows, tiles) = undisturbed(data.path(), &sender.newest());
    let words = ["budget", "--product", FOUGHT, "--step", "month", "--json"];
    let budget: Value = serde_json::from_str(&cluster.succeed(&words).unwrap()).unwrap();
    assert_eq!(budget["rows"], rows);
    for (address, expected) in TILES.iter().zip(tiles) {
        let path = format!("/tiles/{FOUGHT}/volume/{address}.png?time={TIME}");
        let tile = cluster.get(&path).unwrap();
        assert_eq!(tile.status, 200, "{}", tile.text());
        assert_eq!(tile.body, expected, "{address}");
    }
}

/// One `granule.landed` for each file that counts in the end, at most one for each that a newer edition replaced, and
/// one `product.derived` for each of them.
fn each_file_told_once(cluster: &Cluster, sender: &Sender) {
    let told = |cluster: &Cluster| {
        let landed = landed_events(cluster).values().sum();
        Ok((derived_traces(cluster) >= landed).then_some(()))
    };
    cluster.wait_for("derivations told", LIMIT, told).unwrap();
    let landed = landed_events(cluster);
    let doubled: Vec<_> = landed.iter().filter(|(_, count)| **count > 1).collect();
    assert!(doubled.is_empty(), "{doubled:?}");
    for file in sender.newest() {
        let name = file.display().to_string();
        assert!(landed.contains_key(&name), "nobody told of {name}");
    }
    assert_eq!(events(cluster, Topic::GranuleRejected), vec![]);
    assert_eq!(
        derived_traces(cluster),
        landed.len(),
        "not one derivation for each granule"
    );
}

pub(crate) fn notice(cluster: &Cluster, files: &[PathBuf]) {
    let mut words = vec!["notice", "--product", PRODUCT];
    words.extend(files.iter().map(|file| file.to_str().unwrap()));
    // A broker that has just started beside a compiler is slow to open transactions: nothing was appended then.
    for _ in 0..12 {
        match cluster.succeed(&words) {
            Err(error) if format!("{error:#}").contains("opening transactions") => {}
            told => {
                told.unwrap();
                return;
            }
        }
    }
    panic!("the event log opens no transaction");
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
        let is_whole = flux["step_count"] == months && derived["derived_from"] == flux["manifest"];
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
///
/// A version is there before it is told of, longer so when a store that failed in between is asked again: events are waited
/// for, and are then neither fewer nor more.
pub(crate) fn each_event_once(cluster: &Cluster, files: &[PathBuf]) {
    let told = |cluster: &Cluster| Ok((derived_traces(cluster) >= files.len()).then_some(()));
    cluster.wait_for("derivations told", LIMIT, told).unwrap();
    let mut landed = landed_events(cluster);
    for file in files {
        let count = landed.remove(&file.display().to_string()).unwrap_or(0);
        assert_eq!(count, 1, "events of {}", file.display());
    }
    assert!(landed.is_empty(), "{landed:?}");
    assert_eq!(events(cluster, Topic::GranuleRejected), vec![]);
    assert_eq!(
        derived_traces(cluster),
        files.len(),
        "not one derivation for each granule"
    );
}

/// How often a file was told of as landed.
fn landed_events(cluster: &Cluster) -> BTreeMap<String, usize> {
    let mut landed = BTreeMap::new();
    for event in events(cluster, Topic::GranuleLanded) {
        if let Body::GranuleLanded { path, .. } = event.body {
            *landed.entry(path).or_default() += 1;
        }
    }
    landed
}

/// Of how many granules a derivation was told: granules that are derived together share a version; each still has its own
/// event, with its own trace.
fn derived_traces(cluster: &Cluster) -> usize {
    let derived = events(cluster, Topic::ProductDerived);
    let traces: BTreeSet<&str> = derived.iter().map(|event| event.trace.as_str()).collect();
    assert_eq!(
        derived.len(),
        traces.len(),
        "a derivation was told twice for one granule"
    );
    derived.len()
}

/// All events of a topic.
pub(crate) fn events(cluster: &Cluster, topic: Topic) -> Vec<Event> {
    let messages = on_log(cluster, async |log| {
        storage::log::contents(&log, topic).await
    });
    let event = |message: &Message| message.event().unwrap();
    messages.unwrap().iter().map(event).collect()
}

/// Appends an event as any client may.
pub(crate) fn append(cluster: &Cluster, event: Event) {
    append_all(cluster, &[event]);
}

fn append_all(cluster: &Cluster, events: &[Event]) {
    on_log(cluster, async |log| log.append(events).await).unwrap();
}

/// Does something with the cluster's event log.
fn on_log<T>(
    cluster: &Cluster,
    work: impl AsyncFnOnce(KafkaLog) -> Result<T, StorageError>,
) -> anyhow::Result<T> {
    let servers = cluster.servers.setting("FLUXGLOBE_KAFKA")?;
    let runtime = tokio::runtime::Runtime::new()?;
    let done = runtime.block_on(async {
        let log = KafkaLog::connect(&KafkaSettings::plain(servers)).await?;
        work(log).await
    });
    Ok(done?)
}
