//! The harness itself: what it must notice, it notices.

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use harness::program;
use harness::servers::Servers;

/// Whoever sets it wants a server that is never stopped in an orderly way.
const SERVE: &str = "FLUXGLOBE_TEST_SERVE";
const ANNOUNCED: &str = "server of ";
/// How long a server may take until it has stopped.
const STOP_LIMIT: Duration = Duration::from_mins(1);

#[test]
fn a_failing_command_is_not_taken_for_a_success() {
    let data = tempfile::tempdir().unwrap();
    let words = ["budget", "--product", "nothing"];
    assert!(program::succeed(data.path(), &words).is_err());
    assert!(program::fail(data.path(), &words).is_ok());
}

#[test]
fn a_succeeding_command_is_not_taken_for_a_failure() {
    let data = tempfile::tempdir().unwrap();
    assert!(program::fail(data.path(), &["products"]).is_err());
}

#[test]
fn output_that_is_no_json_is_reported() {
    let data = tempfile::tempdir().unwrap();
    assert!(program::json(data.path(), &["--version"]).is_err());
}

/// The child's side of the test below; run as a test it stops its server at once, to see that this is how it ends.
#[test]
fn a_server_stops_with_the_test_that_started_it() {
    #[expect(
        clippy::disallowed_methods,
        reason = "how the parent test tells its child"
    )]
    let is_child = std::env::var(SERVE).is_ok();
    let servers = Servers::start(&["s3"]).unwrap();
    let process = std::fs::read_to_string(servers.folder().join("s3/pid")).unwrap();
    if is_child {
        let folder = servers.folder().display();
        println!("{ANNOUNCED}{} {folder}", process.trim());
        loop {
            std::thread::park();
        }
    }
    let folder = servers.folder().to_owned();
    assert!(is_there(&process));
    drop(servers);
    assert!(!is_there(&process) && !folder.exists());
}

#[test]
fn a_server_of_a_test_that_is_killed_ends_too() {
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args([
            "--exact",
            "harness_self::a_server_stops_with_the_test_that_started_it",
            "--nocapture",
        ])
        .env(SERVE, "true")
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let said = BufReader::new(child.stdout.take().unwrap()).lines();
    let told = said
        .map_while(Result::ok)
        .find_map(|line| line.split_once(ANNOUNCED).map(|(_, told)| told.to_owned()));
    let told = told.expect("the child says which server it started");
    let (process, folder) = told.split_once(' ').unwrap();
    assert!(is_there(process));
    child.kill().unwrap();
    child.wait().unwrap();
    let since = Instant::now();
    while is_there(process) || std::path::Path::new(folder).exists() {
        assert!(
            since.elapsed() < STOP_LIMIT,
            "{process} goes on, or {folder} is left"
        );
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Does a process run? One that has ended and was not waited for does not.
fn is_there(process: &str) -> bool {
    let state = std::fs::read_to_string(format!("/proc/{}/stat", process.trim()));
    // After the name, which may hold anything and ends with the last bracket.
    state.is_ok_and(|text| {
        text.rsplit_once(") ")
            .is_some_and(|(_, rest)| !rest.starts_with('Z'))
    })
}
