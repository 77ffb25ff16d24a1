//! Kafka and PostGIS over TLS with logins: work with the right certificate, and are refused with another one.

use std::path::Path;
use std::process::Command;

use harness::program;
use harness::servers::Servers;
use serde_json::Value;
use test_data::free_port;

use super::{PRODUCT, refused_start, start, until};
use crate::together;

/// A certificate that has signed nobody's.
fn stranger(folder: &Path) -> String {
    let file = folder.join("stranger.pem").display().to_string();
    let key = folder.join("stranger.key").display().to_string();
    let words = [
        "req",
        "-x509",
        "-newkey",
        "rsa:2048",
        "-nodes",
        "-days",
        "2",
        "-subj",
        "/CN=stranger",
        "-keyout",
        &key,
        "-out",
        &file,
    ];
    let made = Command::new("openssl").args(words).output().unwrap();
    assert!(
        made.status.success(),
        "{}",
        String::from_utf8_lossy(&made.stderr)
    );
    file
}

/// Everything that the program is told.
struct Told(Vec<(String, String)>);

impl Told {
    fn with(&self, name: &str, value: &str) -> Self {
        let mut told = self.0.clone();
        told.retain(|(known, _)| known != name);
        told.push((name.to_owned(), value.to_owned()));
        Self(told)
    }

    fn run(&self, words: &[&str]) -> (bool, String, String) {
        let output = program::unset()
            .args(words)
            .envs(self.0.iter().map(|(name, value)| (name, value)))
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        (
            output.status.success(),
            text(output.stdout),
            text(output.stderr),
        )
    }

    fn succeed(&self, words: &[&str]) -> String {
        let (is_fine, text, talk) = self.run(words);
        assert!(is_fine, "{words:?}: {talk}");
        text
    }
}

fn told(servers: &Servers, folder: &Path) -> Told {
    let given = |name: &str| servers.setting(name).unwrap().to_owned();
    let inbox = folder.join("inbox").display().to_string();
    let settings = [
        ("FLUXGLOBE_KAFKA", given("FLUXGLOBE_KAFKA_SASL")),
        ("FLUXGLOBE_KAFKA_SECURITY", "sasl_ssl".to_owned()),
        ("FLUXGLOBE_KAFKA_USER", "fluxglobe".to_owned()),
        (
            "FLUXGLOBE_KAFKA_PASSWORD_FILE",
            given("FLUXGLOBE_KAFKA_SASL_PASSWORD_FILE"),
        ),
        (
            "FLUXGLOBE_KAFKA_CA_FILE",
            given("FLUXGLOBE_KAFKA_SASL_CERTIFICATE"),
        ),
        ("FLUXGLOBE_POSTGIS", given("FLUXGLOBE_POSTGIS")),
        (
            "FLUXGLOBE_POSTGIS_PASSWORD_FILE",
            given("FLUXGLOBE_POSTGIS_PASSWORD_FILE"),
        ),
        (
            "FLUXGLOBE_POSTGIS_CA_FILE",
            given("FLUXGLOBE_POSTGIS_CA_FILE"),
        ),
        (
            "FLUXGLOBE_STORE",
            format!("file:{}", folder.join("store").display()),
        ),
        ("FLUXGLOBE_ALLOW_FOLDER", inbox),
        (
            "FLUXGLOBE_SPOOL",
            folder.join("spool").display().to_string(),
        ),
        ("FLUXGLOBE_LOG", "warn".to_owned()),
    ];
    Told(
        settings
            .map(|(name, value)| (name.to_owned(), value))
            .to_vec(),
    )
}

#[test]
fn granules_and_observations_go_over_tls_and_a_wrong_certificate_is_refused() {
    let _together = together();
    let folder = tempfile::tempdir().unwrap();
    let inbox = folder.path().join("inbox");
    std::fs::create_dir(&inbox).unwrap();
    let more = vec![
        ("FLUXGLOBE_KAFKA_SASL_PORT", free_port().to_string()),
        ("FLUXGLOBE_POSTGIS_TLS", "true".to_owned()),
    ];
    let servers = Servers::start_told(&["kafka", "postgis"], more).unwrap();
    let told = told(&servers, folder.path());
    told.succeed(&["topics", "create"]);
    let granule = harness::granule::write(&inbox, 0, 0).unwrap();
    // A station's hourly lines, as buoys of the NDBC have them.
    let buoy = inbox.join("44005h2010.txt");
    std::fs::write(&buoy, BUOY).unwrap();
    told.succeed(&["notice", "--product", PRODUCT, granule.to_str().unwrap()]);
    told.succeed(&["notice", buoy.to_str().unwrap()]);
    let mut ingestd = start(folder.path(), "ingestd", &told.0);
    ingestd.wait_until_ready().unwrap();
    until("observations over TLS", &mut ingestd, || {
        !told
            .succeed(&["observations", "query", "--json"])
            .is_empty()
            && told.succeed(&["products", "--json"]).contains(PRODUCT)
    });
    let scram = told.with("FLUXGLOBE_KAFKA_SASL_MECHANISM", "PLAIN");
    assert_eq!(scram.succeed(&["rejected", "list", "--json"]), "");

    let other = stranger(folder.path());
    let wrong = told.with("FLUXGLOBE_KAFKA_CA_FILE", &other);
    for service in ["scheduler", "ingestd"] {
        let talk = refused_start(folder.path(), service, &wrong.0);
        assert!(
            talk.contains("certificate verify failed"),
            "{service}: {talk}"
        );
    }
    let wrong = told.with("FLUXGLOBE_POSTGIS_CA_FILE", &other);
    let (is_fine, _, talk) = wrong.run(&["observations", "query"]);
    assert!(!is_fine && talk.contains("--postgis-ca-file"), "{talk}");
    // A database may be mended while the service runs: it waits, says so, and stores nothing meanwhile.
    let waiting = start(folder.path(), "ingestd", &wrong.0);
    let parts = until_told(&waiting);
    assert!(!waiting.talk().is_empty(), "{parts}");
    let (is_fine, _, talk) = told
        .with(
            "FLUXGLOBE_POSTGIS",
            &plain(servers.setting("FLUXGLOBE_POSTGIS").unwrap()),
        )
        .run(&["observations", "query"]);
    assert!(!is_fine && talk.contains("no encryption"), "{talk}");
}

/// The address without its TLS.
fn plain(url: &str) -> String {
    url.replace("verify-full", "disable")
}

/// What /readyz says once it says that observations cannot be stored and why stands in the log.
fn until_told(node: &harness::node::Node) -> Value {
    let begun = std::time::Instant::now();
    loop {
        assert!(begun.elapsed() < super::LIMIT, "{}", node.talk());
        let Ok(answer) = node.get("/readyz") else {
            continue;
        };
        let parts = answer.json().unwrap();
        let part = parts["checks"].as_array().unwrap().iter();
        let part = part
            .filter(|part| part["name"] == "observations")
            .any(|part| part["ok"] == false);
        if answer.status == 503 && part && node.talk().contains("certificate is not trusted") {
            return parts;
        }
        std::thread::sleep(std::time::Duration::from_millis(100));
    }
}

const BUOY: &str = "\
#YY  MM DD hh mm WDIR WSPD GST  WVHT   DPD   APD MWD   PRES  ATMP  WTMP  DEWP  VIS  TIDE
#yr  mo dy hr mn degT m/s  m/s     m   sec   sec degT   hPa  degC  degC  degC   mi    ft
2010 01 01 00 50 200  5.0  6.0  1.00  8.00  5.00 190 1015.0  20.0  21.0  15.0 99.0 99.00
2010 01 01 01 50 210  5.5  6.5  1.10  8.10  5.10 195 1015.2  20.1  21.1  15.1 99.0 99.00
";
