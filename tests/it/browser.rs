//! The viewer in a real headless browser, over a server with the real data.

use std::path::Path;
use std::process::Command;

use harness::server::Server;

use crate::end_to_end::demo_data;

#[test]
fn the_page_shows_tiles_series_and_budgets_without_an_error() {
    let Some(data) = demo_data() else { return };
    let server = Server::start(data, &["serve"]).unwrap();
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/browser"));
    if !folder.join("node_modules").exists() {
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
    let output = Command::new("node")
        .args(["--test", "viewer.test.mjs"])
        .current_dir(folder)
        .env("FLUXGLOBE_URL", &server.url)
        .env("FLUXGLOBE_SCREENSHOTS", data.join("screenshots"))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success(),
        "{text}\n{}",
        String::from_utf8_lossy(&output.stderr)
    );
    assert!(text.contains("pass"), "the runner ran nothing:\n{text}");
}
