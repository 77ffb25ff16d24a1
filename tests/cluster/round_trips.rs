//! A store that is far away: how often it is waited for between a question and its picture, and that its writes are not.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use harness::cluster::{Cluster, Shape};
use harness::granule;
use harness::node::Node;
use harness::proxy::{Passed, rounds};
use test_data::free_port;

use crate::alone;
use crate::faults::{PRODUCT, notice, say, until_whole};

/// How long the store takes to answer.
const DELAY: Duration = Duration::from_millis(25);
/// Waits for the store that a picture may take: a look whether it was drawn before, and all of its fields at once.
const MOST_ROUNDS: usize = 2;
const MONTHS: usize = 6;
const QUIET: Duration = Duration::from_secs(2);
const LIMIT: Duration = Duration::from_mins(1);
/// The same while somebody is asked to stop: long beside what else that takes.
const LONG_DELAY: Duration = Duration::from_millis(700);

/// A question with what passed to the store before its answer, and when that came.
struct Asked {
    before: Vec<Passed>,
    begun: Instant,
    answered: Instant,
}

/// Is it more than a look whether something new has landed? Those go on beside all else, and nobody waits for them where servers are
/// told of what lands.
fn is_work(one: &Passed) -> bool {
    !one.line.contains("list-type") && !one.line.starts_with("HEAD")
}

/// Waits until nobody reads or writes any more: sums of regions go on after all has landed. That is longer, too, than a list
/// of products is taken for new.
fn until_quiet(cluster: &Cluster) {
    let quiet = |cluster: &Cluster| {
        let passed = cluster.s3.passed();
        let last = passed
            .iter()
            .filter(|one| is_work(one))
            .map(|one| one.begun);
        Ok(last.max().filter(|last| last.elapsed() > QUIET))
    };
    cluster.wait_for("rest", LIMIT, quiet).unwrap();
}

fn ask(cluster: &Cluster, tile: &str, time: &str) -> Asked {
    until_quiet(cluster);
    let begun = Instant::now();
    let path = format!("/tiles/{PRODUCT}/volume/{tile}.png?time={time}");
    let answer = cluster.get(&path).unwrap();
    let answered = Instant::now();
    assert_eq!(answer.status, 200, "{}", answer.text());
    let during = |one: &Passed| one.begun >= begun && one.answered.is_some_and(|at| at <= answered);
    let passed = cluster.s3.passed().into_iter();
    Asked {
        before: passed.filter(during).filter(is_work).collect(),
        begun,
        answered,
    }
}

impl Asked {
    fn lines(&self) -> Vec<&str> {
        self.before.iter().map(|one| one.line.as_str()).collect()
    }

    /// The picture was looked for once, and is stored once, after its answer.
    fn assert_stored_behind(&self, cluster: &Cluster) {
        let is_tile = |one: &&Passed| one.line.contains("/tiles/");
        let is_write = |one: &&Passed| one.line.starts_with("PUT") && is_tile(one);
        let looks = self.before.iter().filter(is_tile).count();
        assert_eq!(looks, 1, "looks for the picture: {:?}", self.lines());
        assert!(
            !self.before.iter().any(|one| is_write(&one)),
            "stored before the answer: {:?}",
            self.lines()
        );
        let written = |cluster: &Cluster| {
            let passed = cluster.s3.passed();
            let written = passed
                .iter()
                .filter(is_write)
                .filter_map(|one| one.answered);
            Ok(written.max().filter(|at| *at > self.answered))
        };
        cluster.wait_for("stored picture", LIMIT, written).unwrap();
        let passed = cluster.s3.passed();
        let of_this = passed.iter().filter(|one| one.begun >= self.begun);
        let of_tile: Vec<&str> = of_this
            .filter(is_tile)
            .map(|one| one.line.as_str())
            .collect();
        assert_eq!(of_tile.len(), 2, "one look and one write: {of_tile:?}");
    }
}

#[test]
fn a_new_tile_waits_for_a_store_far_away_twice_at_most_and_for_no_write() {
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let shape = Shape {
        executors: 1,
        ingestds: 1,
        render_workers: 2,
        tile_servers: 1,
    };
    let mut cluster = Cluster::start(shape, inbox.path()).unwrap();
    let files: Vec<PathBuf> = (0..MONTHS)
        .map(|month| granule::write(inbox.path(), month, 0).unwrap())
        .collect();
    notice(&cluster, &files);
    until_whole(&cluster, files.len());
    // Nobody who draws has anything in memory.
    for worker in ["render-1", "render-2"] {
        let node = cluster.node(worker).unwrap();
        node.stop().unwrap();
        node.restart().unwrap();
        node.wait_until_ready().unwrap();
    }
    let up = |cluster: &Cluster| {
        let workers = r#"fluxglobe_render_fleet_workers{health="up"}"#;
        let up = cluster.nodes["tile-server"].metric(workers)?;
        Ok((up >= 2.0).then_some(()))
    };
    cluster.wait_for("both workers", LIMIT, up).unwrap();
    cluster.s3.delay(DELAY);
    for (tile, time, most, what) in [
        ("1/0/1", "2000-03-20", MOST_ROUNDS, "fields that nobody has"),
        ("1/1/0", "2000-03-21", 1, "fields in memory"),
        ("2/1/1", "2000-05-20", MOST_ROUNDS, "other fields"),
    ] {
        let asked = ask(&cluster, tile, time);
        let count = rounds(&asked.before);
        say(&format!("{what}: {count} rounds, {:?}", asked.lines()));
        // It was slow, and it was asked: else this measures nothing.
        assert!(count >= 1, "{what}: {:?}", asked.lines());
        assert!(count <= most, "{what}: {count} rounds: {:?}", asked.lines());
        asked.assert_stored_behind(&cluster);
    }
    assert_stores_before_it_ends(&cluster, inbox.path());
}

/// A server that draws by itself and is asked to stop when it has just given out a picture has that stored when it ends.
fn assert_stores_before_it_ends(cluster: &Cluster, folder: &Path) {
    let address = format!("127.0.0.1:{}", free_port());
    let mut settings = cluster.settings().to_vec();
    // It draws and computes by itself.
    settings.retain(|(name, _)| name.starts_with("AWS_") || name == "FLUXGLOBE_STORE");
    let words = ["serve", "--listen", &address];
    let mut server = Node::start(folder, "serve", &words, &address, &settings).unwrap();
    server.wait_until_ready().unwrap();
    cluster.s3.delay(LONG_DELAY);
    let tile = format!("/tiles/{PRODUCT}/map/2/1/2.png?time=2000-03-25");
    let given = server.get(&tile).unwrap();
    assert_eq!(given.status, 200, "{}", given.text());
    let asked_to_stop = Instant::now();
    assert_eq!(server.stop().unwrap(), Some(0));
    let ended = Instant::now();
    let passed = cluster.s3.passed();
    let is_write = |one: &&Passed| one.line.starts_with("PUT") && one.line.contains("/tiles/");
    let last = passed.iter().rfind(is_write);
    let stored = last.and_then(|one| one.answered);
    assert!(
        stored.is_some_and(|at| at > asked_to_stop && at < ended),
        "not stored while it ended: {last:?}"
    );
}
