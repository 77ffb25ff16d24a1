//! A disk that is full, and has room again later: work waits and says so, nothing is lost, and it goes on by itself.

use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use contract::event::Body;
use contract::topic::Topic;
use harness::cluster::{Cluster, Shape};
use harness::small_disk::SmallDisk;
use harness::{granule, program};
use storage::Store;

use crate::alone;
use crate::faults::{PRODUCT, events, say, until_whole};

const LIMIT: Duration = Duration::from_mins(2);
/// How long a full disk is looked at: longer than the pause between two tries.
const FULL: Duration = Duration::from_secs(8);
/// Resident memory that ingest does not exceed while it waits, bytes.
const MEMORY_BYTES: u64 = 512 << 20;

fn until(what: &str, mut is_so: impl FnMut() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < LIMIT, "no {what} within {LIMIT:?}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Months that are in a product on a data folder.
fn months(data: &Path) -> u64 {
    let products = program::json(data, &["products", "--json"]).unwrap();
    let all = products.as_array().unwrap().iter();
    let mut own = all.filter(|product| product["product"] == PRODUCT);
    own.next()
        .map_or(0, |product| product["step_count"].as_u64().unwrap())
}

/// How often each file was told of as landed in the journal of a data folder.
fn told(data: &Path, files: &[PathBuf]) -> Vec<usize> {
    let journal = std::fs::read_to_string(data.join("events/journal.jsonl")).unwrap();
    let mut paths = vec![];
    for line in journal.lines() {
        let entry: serde_json::Value = serde_json::from_str(line).unwrap();
        for message in entry["messages"].as_array().into_iter().flatten() {
            if message[0] == "granule.landed" {
                let event: contract::event::Event =
                    serde_json::from_str(message[1].as_str().unwrap()).unwrap();
                if let Body::GranuleLanded { path, .. } = event.body {
                    paths.push(PathBuf::from(path));
                }
            }
        }
    }
    let count = |file| paths.iter().filter(|path| *path == file).count();
    files.iter().map(count).collect()
}

#[test]
fn one_process_on_a_full_disk_waits_and_lands_everything_when_there_is_room() {
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let Some(disk) = SmallDisk::make(8).unwrap() else {
        return;
    };
    let files: Vec<PathBuf> = (0..6)
        .map(|month| granule::write(inbox.path(), month, 0).unwrap())
        .collect();
    // Room for the journal and some of the files, not for all.
    disk.fill(48 << 10).unwrap();
    let data = disk.path().join("data");
    let talk = inbox.path().join("talk.txt");
    let mut words = vec!["ingest", "--product", PRODUCT];
    words.extend(files.iter().map(|file| file.to_str().unwrap()));
    let mut child = program::command(&data)
        .args(&words)
        .stdout(Stdio::null())
        .stderr(std::fs::File::create(&talk).unwrap())
        .spawn()
        .unwrap();
    let said = || std::fs::read_to_string(&talk).unwrap();
    until("word about the full disk", || {
        said().contains("disk is full")
    });
    std::thread::sleep(FULL);
    assert!(
        child.try_wait().unwrap().is_none(),
        "it did not wait:\n{}",
        said()
    );
    assert!(months(&data) < 6, "the disk was not full");
    let full = Instant::now();
    disk.empty().unwrap();
    let status = child.wait().unwrap();
    assert!(status.success(), "{}", said());
    say(&format!(
        "disk full, one process: all landed {:.1} s after there was room",
        full.elapsed().as_secs_f64()
    ));
    assert_eq!(months(&data), 6);
    assert_eq!(told(&data, &files), [1; 6]);

    // No room for the journal itself: nothing is begun, and the command says why. So many notices do not fit into what
    // is left of the journal's last block.
    disk.fill(0).unwrap();
    let late: Vec<PathBuf> = (6..46)
        .map(|month| granule::write(inbox.path(), month, 0).unwrap())
        .collect();
    let mut words = vec!["ingest", "--product", PRODUCT];
    words.extend(late.iter().map(|file| file.to_str().unwrap()));
    let refused = program::fail(&data, &words).unwrap();
    assert!(refused.contains("No space left"), "{refused}");
    disk.empty().unwrap();
    program::succeed(&data, &words).unwrap();
    assert_eq!(months(&data), 46);
    assert_eq!(told(&data, &late), [1; 40]);
}

#[test]
fn an_ingest_service_whose_spool_is_full_waits_and_lands_everything_when_there_is_room() {
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let shape = Shape {
        executors: 1,
        ingestds: 1,
        render_workers: 1,
        tile_servers: 1,
    };
    let mut cluster = Cluster::start(shape, inbox.path()).unwrap();
    let spool = cluster.setting("FLUXGLOBE_SPOOL").unwrap().to_owned();
    cluster.node("ingestd-1").unwrap().stop().unwrap();
    let Some(disk) = SmallDisk::over(Path::new(&spool), 2).unwrap() else {
        return;
    };
    let ingestd = cluster.node("ingestd-1").unwrap();
    ingestd.restart().unwrap();
    ingestd.wait_until_ready().unwrap();
    // A first one shows that the way through the spool is open.
    let sent = |cluster: &Cluster, months: std::ops::Range<usize>| {
        let addresses = stored(cluster, inbox.path(), months);
        let mut words = vec!["notice", "--product", PRODUCT];
        words.extend(addresses.iter().map(String::as_str));
        cluster.succeed(&words).unwrap();
        addresses
    };
    let mut addresses = sent(&cluster, 0..1);
    until_whole(&cluster, 1);

    disk.fill(0).unwrap();
    addresses.extend(sent(&cluster, 1..6));
    let ready = |cluster: &mut Cluster| {
        let answer = cluster.node("ingestd-1").unwrap().get("/readyz").unwrap();
        (answer.status, answer.text())
    };
    until("word about the full spool", || {
        let (status, text) = ready(&mut cluster);
        // Which part it is, is told to everybody; why, to the log.
        let report: serde_json::Value = serde_json::from_str(&text).unwrap();
        let mut parts = report["checks"].as_array().unwrap().iter();
        let is_ingest = parts.any(|part| part["name"] == "ingest" && part["ok"] == false);
        let talk = cluster.node("ingestd-1").unwrap().talk();
        status != 200 && is_ingest && talk.contains("No space left")
    });
    let full = Instant::now();
    let mut most_bytes = 0;
    while full.elapsed() < FULL {
        let node = cluster.node("ingestd-1").unwrap();
        assert!(!node.has_ended(), "it gave up:\n{}", node.talk());
        assert_eq!(node.get("/healthz").unwrap().status, 200);
        most_bytes = most_bytes.max(node.memory_bytes().unwrap());
        std::thread::sleep(Duration::from_millis(500));
    }
    assert!(most_bytes < MEMORY_BYTES, "{most_bytes} bytes");
    assert_eq!(
        events(&cluster, Topic::GranuleLanded).len(),
        1,
        "the disk was not full"
    );
    let room = Instant::now();
    disk.empty().unwrap();
    until_whole(&cluster, 6);
    say(&format!(
        "spool full: all landed and derived {:.1} s after there was room, at most {} MiB",
        room.elapsed().as_secs_f64(),
        most_bytes >> 20
    ));
    let (status, text) = ready(&mut cluster);
    assert_eq!(status, 200, "{text}");
    assert_eq!(landed_paths(&cluster), addresses, "each once");
    assert_eq!(events(&cluster, Topic::GranuleRejected), vec![]);
}

/// What every event of a file that landed names, sorted.
fn landed_paths(cluster: &Cluster) -> Vec<String> {
    let mut landed = vec![];
    for event in events(cluster, Topic::GranuleLanded) {
        if let Body::GranuleLanded { path, .. } = event.body {
            landed.push(path);
        }
    }
    landed.sort();
    landed
}

/// Puts granules where only the network leads to, and so through the spool; their addresses, sorted.
fn stored(cluster: &Cluster, inbox: &Path, months: std::ops::Range<usize>) -> Vec<String> {
    let place = cluster.setting("FLUXGLOBE_ALLOW_STORE").unwrap();
    let settings = storage::store::Settings::from_variables(cluster.settings().iter().cloned());
    let store = Store::open_with(place, &settings).unwrap();
    let runtime = tokio::runtime::Runtime::new().unwrap();
    months
        .map(|month| {
            let file = granule::write(inbox, month, 0).unwrap();
            let name = file.file_name().unwrap().to_str().unwrap();
            let content = std::fs::read(&file).unwrap();
            let key = name.parse().unwrap();
            runtime
                .block_on(store.put_new(&key, content.into()))
                .unwrap();
            format!("{place}/{name}")
        })
        .collect()
}
