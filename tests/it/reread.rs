//! Files read anew by `fluxglobe recompute --what frames`: killed half way and run again, it comes to the same bytes.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::time::{Duration, Instant};

use harness::{granule, program};

const PRODUCT: &str = "own-flux";
const MONTHS: usize = 8;
const LIMIT: Duration = Duration::from_mins(2);

fn write_profile(folder: &Path, factor: f64) -> PathBuf {
    let path = folder.join("own.toml");
    let text = format!(
        "name = \"own\"\nproduct = \"{PRODUCT}\"\ntitle = \"Flux\"\nsource = \"a test\"\n\
         quantity = \"carbon_flux\"\n[variable]\nname = \"fgco2\"\nscale_factor = {factor:.1}\n"
    );
    std::fs::write(&path, text).unwrap();
    path
}

/// Everything below a folder but files of killed writers: path and content.
fn contents(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let (mut all, mut folders) = (BTreeMap::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if !path.to_str().unwrap().contains('#') {
                let below = path.strip_prefix(folder).unwrap().to_owned();
                all.insert(below, std::fs::read(&path).unwrap());
            }
        }
    }
    all
}

/// Stored objects but those of cubes, which their library names by chance.
fn objects(data: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut all = contents(&data.join("objects"));
    all.retain(|path, _content| !path.starts_with("cubes"));
    all
}

/// How many readings are noted.
fn noted(data: &Path) -> usize {
    std::fs::read_dir(data.join("objects/readings").join(PRODUCT)).map_or(0, |files| {
        let whole = |name: &str| !name.contains('#');
        files
            .filter(|file| whole(file.as_ref().unwrap().file_name().to_str().unwrap()))
            .count()
    })
}

fn version(data: &Path) -> String {
    let products = program::json(data, &["products", "--json"]).unwrap();
    let own = products.as_array().unwrap().iter();
    let mut own = own.filter(|product| product["product"] == PRODUCT);
    own.next().unwrap()["manifest"].as_str().unwrap().to_owned()
}

/// Events of files that landed, in the order of their text.
fn told(data: &Path) -> Vec<String> {
    let journal = std::fs::read_to_string(data.join("events/journal.jsonl")).unwrap();
    let mut bodies = vec![];
    for line in journal.lines() {
        let entry: serde_json::Value = serde_json::from_str(line).unwrap();
        for message in entry["messages"].as_array().into_iter().flatten() {
            if message[0] == "granule.landed" {
                let text = message[1].as_str().unwrap();
                let mut event: serde_json::Value = serde_json::from_str(text).unwrap();
                event.as_object_mut().unwrap().remove("noticed");
                event.as_object_mut().unwrap().remove("trace");
                bodies.push(event.to_string());
            }
        }
    }
    bodies.sort();
    bodies
}

/// Lands the months in one data folder by the profile in `folder`, and copies that to another.
fn land_twice(folder: &Path, calm: &Path, killed: &Path) {
    let files: Vec<PathBuf> = (0..MONTHS)
        .map(|month| granule::write(folder, month, 0).unwrap())
        .collect();
    let profile = write_profile(folder, 1.0);
    let mut words = vec!["ingest", "--profile", profile.to_str().unwrap()];
    words.extend(files.iter().map(|file| file.to_str().unwrap()));
    program::succeed(calm, &words).unwrap();
    assert_eq!(noted(calm), MONTHS);
    for (below, content) in contents(calm) {
        let path = killed.join(below);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }
}

/// Starts the program and kills it as soon as so many readings are noted.
fn kill_when_noted(data: &Path, words: &[&str], readings: usize) {
    let mut child = program::command(data)
        .args(words)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let start = Instant::now();
    while noted(data) < readings {
        assert!(start.elapsed() < LIMIT, "nothing was read");
        let has_ended = child.try_wait().unwrap().is_some();
        assert!(!has_ended, "it ended before it was killed");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

/// What a dry run says: the plan of the files, and of what is computed.
fn plan(data: &Path, words: &[&str]) -> (Vec<serde_json::Value>, Vec<serde_json::Value>) {
    let plan = program::json(data, &[words, &["--dry-run", "--json"]].concat()).unwrap();
    let items = |plan: &serde_json::Value| plan["items"].as_array().unwrap().clone();
    (items(&plan["files"]), items(&plan))
}

#[test]
fn a_rereading_that_is_killed_again_and_again_comes_to_the_bytes_of_an_undisturbed_one() {
    let folder = tempfile::tempdir().unwrap();
    let below = |name: &str| folder.path().join(name);
    let (calm, killed) = (below("calm"), below("killed"));
    land_twice(folder.path(), &calm, &killed);
    let before = version(&calm);
    let (profiles, spool) = (below("profiles"), below("spool"));
    std::fs::create_dir(&profiles).unwrap();
    write_profile(&profiles, 2.0);
    let what = "recompute --what frames --parallel-files 1 --product";
    let mut recompute: Vec<&str> = what.split(' ').chain([PRODUCT]).collect();
    recompute.extend(["--profiles", profiles.to_str().unwrap()]);
    recompute.extend(["--spool", spool.to_str().unwrap()]);
    let (files, _computed) = plan(&calm, &recompute);
    assert_eq!(files.len(), MONTHS);
    assert_eq!(version(&calm), before, "a dry run changes nothing");
    program::succeed(&calm, &recompute).unwrap();

    for kill_after in [1, 3, 6] {
        kill_when_noted(&killed, &recompute, MONTHS + kill_after);
        assert_eq!(version(&killed), before, "readers see the old one still");
        let (files, _computed) = plan(&killed, &recompute);
        let read = files.iter().filter(|item| item["is_read"] == true).count();
        assert!((kill_after..MONTHS).contains(&read), "{read} are read");
    }
    program::succeed(&killed, &recompute).unwrap();

    let after = version(&killed);
    assert_ne!(after, before);
    assert_eq!(after, version(&calm));
    assert_eq!(objects(&calm), objects(&killed));
    // What is in the cube is compared with its fields.
    program::succeed(&killed, &["verify", "--product", PRODUCT]).unwrap();
    let events = told(&killed);
    assert_eq!(events, told(&calm));
    assert_eq!(events.len(), 2 * MONTHS, "landed, and read anew, each once");
    // What killed runs left in the spool is gone, and nothing is left to do.
    assert_eq!(std::fs::read_dir(&spool).unwrap().count(), 0);
    assert_eq!(plan(&killed, &recompute), (vec![], vec![]));
}
