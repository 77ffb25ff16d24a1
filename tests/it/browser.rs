//! The viewer in a real headless browser, over a server with the real data, observations, and data that land meanwhile.

use std::ffi::OsStr;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{Mutex, PoisonError};

use harness::program;
use harness::server::Server;

use crate::end_to_end::demo_data;

const BROWSER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/browser");
/// What `package.json` asks for.
const PACKAGES: [&str; 5] = ["playwright-core", "maplibre-gl", "ol", "leaflet", "zarrita"];
const PROFILE: &str = concat!(
    env!("CARGO_MANIFEST_DIR"),
    "/../ingest/profiles/takahashi09-flux.toml"
);

/// What the demo left, for this test to change.
fn own_copy(from: &Path) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    let copied = Command::new("cp")
        .arg("-r")
        .arg(from.join("."))
        .arg(folder.path())
        .status()
        .unwrap();
    assert!(copied.success());
    folder
}

/// A day of a station and of a ship, as a table of their measurements.
fn observations(folder: &Path) -> PathBuf {
    let mut table = "Expocode\tyr\tmon\tday\thh\tmm\tss\tlongitude [dec.deg.E]\tlatitude [dec.deg.N]\tSST [deg.C]\n".to_owned();
    for hour in 0..24 {
        let sst = 26.0 + f64::from(hour % 12) / 10.0;
        let at = format!("2000\t1\t15\t{hour}\t0\t0");
        writeln!(table, "STATION\t{at}\t-160.0\t10.0\t{sst}").unwrap();
        let lon = -140.0 + f64::from(hour) / 5.0;
        writeln!(table, "SHIP\t{at}\t{lon}\t-15.0\t{sst}").unwrap();
    }
    let file = folder.join("observed.tsv");
    std::fs::write(&file, table).unwrap();
    file
}

/// The line by which a person lands a correction in the product on show, beside the running server: February's file as
/// January's, and what follows from it.
fn land_a_correction(data: &Path, file: &Path) -> String {
    let shipped = std::fs::read_to_string(PROFILE).unwrap();
    let corrected = shipped
        .replace("name = \"takahashi09-flux\"", "name = \"correction\"")
        .replace(
            "from = { variable = { name = \"time\" } }",
            "from = { fixed = \"2000-01\" }",
        )
        .replace("year = 2000\n", "");
    assert!(corrected.contains("fixed = ") && corrected.contains("name = \"correction\""));
    let profile = data.join("correction.toml");
    std::fs::write(&profile, corrected).unwrap();
    let fluxglobe = format!(
        "env -i PATH=\"$PATH\" HOME=\"$HOME\" '{}' --data '{}'",
        program::path().display(),
        data.display()
    );
    format!(
        "{fluxglobe} ingest --profile '{}' '{}' && {fluxglobe} derive accumulated --product takahashi09-flux",
        profile.display(),
        file.display()
    )
}

#[test]
fn the_page_shows_tiles_series_budgets_observations_and_news_without_an_error() {
    let demo = demo_data();
    let folder = own_copy(demo);
    let data = folder.path();
    let observed = observations(data);
    program::succeed(data, &["ingest", observed.to_str().unwrap()]).unwrap();
    let february = test_data::fluxengine("takahashi09")
        .join("M2001032.1200.a7.all_products.BIN.01feb011200.v1.20132321228.data.nc");
    let server = Server::start(data, &["serve"]).unwrap();
    let correction = land_a_correction(data, &february);
    run(
        "viewer.test.mjs",
        &[
            ("FLUXGLOBE_URL", server.url.as_ref()),
            ("FLUXGLOBE_LAND", correction.as_ref()),
            // Nothing may be passed over here: all that the page can show is there.
            ("FLUXGLOBE_LOOK_AT_ALL", "1".as_ref()),
            ("FLUXGLOBE_SCREENSHOTS", demo.join("screenshots").as_ref()),
        ],
    );
}

#[test]
fn example_pages_of_map_libraries_play_a_year_and_ask_for_nothing_twice() {
    let demo = demo_data();
    let server = Server::start(demo, &["serve"]).unwrap();
    run(
        "map-clients.test.mjs",
        &[
            ("FLUXGLOBE_URL", server.url.as_ref()),
            ("FLUXGLOBE_SCREENSHOTS", demo.join("screenshots").as_ref()),
        ],
    );
}

/// Installs what a browser test imports, once for all tests of this process: one that came second would find the first
/// packages, take them for all of them, and start while the rest is still written.
fn install_packages(folder: &Path) {
    static INSTALLING: Mutex<()> = Mutex::new(());
    let _one_at_a_time = INSTALLING.lock().unwrap_or_else(PoisonError::into_inner);
    // What is there may be of before a package was added.
    let is_there = |package| {
        let package = folder.join("node_modules").join(package);
        package.join("package.json").exists()
    };
    if PACKAGES.into_iter().all(is_there) {
        return;
    }
    let install = Command::new("npm")
        .args(["install", "--no-save", "--no-audit", "--no-fund"])
        .current_dir(folder)
        .output()
        .unwrap();
    assert!(
        install.status.success(),
        "{}",
        String::from_utf8_lossy(&install.stderr)
    );
}

/// Runs a script of this folder in Node, without a browser, with the packages it needs.
pub(crate) fn script(file: &str, words: &[&str]) {
    let folder = Path::new(BROWSER);
    install_packages(folder);
    let output = Command::new("node")
        .arg(file)
        .args(words)
        .current_dir(folder)
        .output()
        .unwrap();
    let talk = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{file} {words:?}: {talk}");
}

/// Runs a file of tests in a browser, with the packages it needs.
fn run(file: &str, variables: &[(&str, &OsStr)]) {
    let folder = Path::new(BROWSER);
    install_packages(folder);
    let output = Command::new("node")
        .args(["--test", file])
        .current_dir(folder)
        .envs(variables.iter().copied())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{text}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(text.contains("pass"), "the runner ran nothing:\n{text}");
    assert!(!text.contains("not looked at"), "{text}");
}
