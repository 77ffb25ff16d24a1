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

#[test]
fn a_rereading_that_is_killed_again_and_again_comes_to_the_bytes_of_an_undisturbed_one() {
    let folder = tempfile::tempdir().unwrap();
    let files: Vec<PathBuf> = (0..MONTHS)
        .map(|month| granule::write(folder.path(), month, 0).unwrap())
        .collect();
    let profile = write_profile(folder.path(), 1.0);
    let mut words = vec!["ingest", "--profile", profile.to_str().unwrap()];
    words.extend(files.iter().map(|file| file.to_str().unwrap()));
    let (calm, killed) = (folder.path().join("calm"), folder.path().join("killed"));
    program::succeed(&calm, &words).unwrap();
    assert_eq!(noted(&calm), MONTHS);
    for (below, content) in contents(&calm) {
        let path = killed.join(below);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }
    let before = version(&calm);

    let profiles = folder.path().join("profiles");
    std::fs::create_dir(&profiles).unwrap();
    write_profile(&profiles, 2.0);
    let spool = folder.path().join("spool");
    let recompute = [
        "recompute",
        "--product",
        PRODUCT,
        "--what",
        "frames",
        "--profiles",
        profiles.to_str().unwrap(),
        "--spool",
        spool.to_str().unwrap(),
        "--parallel-files",
        "1",
    ];
    let dry: Vec<&str> = recompute
        .iter()
        .copied()
        .chain(["--dry-run", "--json"])
        .collect();
    let plan = program::json(&calm, &dry).unwrap();
    assert_eq!(plan["files"]["items"].as_array().unwrap().len(), MONTHS);
    assert_eq!(version(&calm), before, "a dry run changes nothing");
    program::succeed(&calm, &recompute).unwrap();

    for kill_after in [1, 3, 6] {
        let mut child = program::command(&killed)
            .args(recompute)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let start = Instant::now();
        while noted(&killed) < MONTHS + kill_after {
            assert!(start.elapsed() < LIMIT, "nothing was read");
            assert!(
                child.try_wait().unwrap().is_none(),
                "it ended before it was killed"
            );
            std::thread::sleep(Duration::from_millis(1));
        }
        child.kill().unwrap();
        child.wait().unwrap();
        assert_eq!(
            version(&killed),
            before,
            "readers see the old version still"
        );
        let plan = program::json(&killed, &dry).unwrap();
        let items = plan["files"]["items"].as_array().unwrap();
        let read = items.iter().filter(|item| item["is_read"] == true).count();
        assert!((kill_after..MONTHS).contains(&read), "{read} are read");
    }
    program::succeed(&killed, &recompute).unwrap();

    let after = version(&killed);
    assert_ne!(after, before);
    assert_eq!(after, version(&calm));
    assert_eq!(
        contents(&calm.join("objects")),
        contents(&killed.join("objects"))
    );
    let events = told(&killed);
    assert_eq!(events, told(&calm));
    assert_eq!(events.len(), 2 * MONTHS, "landed, and read anew, each once");
    // What killed runs left in the spool is gone, and nothing is left to do.
    assert_eq!(std::fs::read_dir(&spool).unwrap().count(), 0);
    let plan = program::json(&killed, &dry).unwrap();
    assert!(
        plan["files"]["items"].as_array().unwrap().is_empty(),
        "{plan}"
    );
    assert!(plan["items"].as_array().unwrap().is_empty(), "{plan}");
}
