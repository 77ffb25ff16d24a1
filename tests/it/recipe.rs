//! The recipe of docs/regional-budgets.md as somebody follows it: its commands one after the other in one folder, and what they print.

use std::os::unix::fs::PermissionsExt as _;
use std::path::{Path, PathBuf};
use std::process::Command;

use harness::program;

const PAGE: &str = include_str!("../../docs/regional-budgets.md");
/// A line that stands for any others.
const LEFT_OUT: &str = "...";
/// Where the demo keeps what it fetched, as the page has it.
const CACHE: &str = "~/.cache/fluxglobe/demo";

/// What is fenced on the page: its kind, its text, and what stands as `text` right after it.
struct Block {
    kind: String,
    text: String,
    answer: Option<String>,
}

fn blocks(page: &str) -> Vec<Block> {
    let mut found: Vec<Block> = vec![];
    let mut rest = page;
    while let Some((_before, after)) = rest.split_once("```") {
        let (kind, after) = after.split_once('\n').expect("a fence says its kind");
        let (text, after) = after.split_once("```\n").expect("a fence is closed");
        let text = text.to_owned();
        match found.last_mut() {
            Some(above) if kind == "text" => above.answer = Some(text),
            _ => found.push(Block {
                kind: kind.to_owned(),
                text,
                answer: None,
            }),
        }
        rest = after;
    }
    found
}

/// A folder to follow the page in: this program and the tests' Python by the names that it calls them, and the demo's files.
struct Place {
    folder: tempfile::TempDir,
    cache: PathBuf,
}

impl Place {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (programs, cache) = (folder.path().join("bin"), folder.path().join("cache"));
        for made in [&programs, &cache, &folder.path().join("work")] {
            std::fs::create_dir(made).unwrap();
        }
        std::os::unix::fs::symlink(program::path(), programs.join("fluxglobe")).unwrap();
        std::os::unix::fs::symlink(test_data::fluxengine(""), cache.join("files")).unwrap();
        // By a link it would not find the libraries that are installed beside it.
        let python = format!("#!/bin/sh\nexec {} \"$@\"\n", test_data::python().display());
        std::fs::write(programs.join("python3"), python).unwrap();
        let runs = std::fs::Permissions::from_mode(0o755);
        std::fs::set_permissions(programs.join("python3"), runs).unwrap();
        Self { folder, cache }
    }

    fn work(&self) -> PathBuf {
        self.folder.path().join("work")
    }

    /// What some lines of a shell print, on both outputs.
    fn run(&self, lines: &str) -> String {
        let of_caller = std::env::var_os("PATH").unwrap();
        let own = [self.folder.path().join("bin")];
        let path = std::env::join_paths(own.into_iter().chain(std::env::split_paths(&of_caller)));
        let mut shell = Command::new("bash");
        for (name, _value) in std::env::vars_os() {
            if name
                .to_str()
                .is_some_and(|name| name.starts_with("FLUXGLOBE_"))
            {
                shell.env_remove(name);
            }
        }
        let output = shell
            .args(["-eu", "-c", &format!("exec 2>&1\n{lines}")])
            .current_dir(self.work())
            .env("PATH", path.unwrap())
            .env("FLUXGLOBE_DATA", self.folder.path().join("data"))
            .env("FLUXGLOBE_CACHE", &self.cache)
            .env("FLUXGLOBE_OFFLINE", "true")
            .output()
            .unwrap();
        let printed = String::from_utf8(output.stdout).unwrap();
        assert!(output.status.success(), "{lines}\n{printed}");
        let printed = printed.replace(&format!("{}/", self.work().display()), "");
        printed.replace(&self.cache.display().to_string(), CACHE)
    }
}

/// Lines as they are compared: without digests of versions and instants of landings, which are those of a run, and with one blank
/// between words.
fn told(text: &str) -> Vec<String> {
    let word = |word: &str| {
        let is_instant = word.len() == 24 && word.ends_with('Z') && word.contains('.');
        match word.split_once('@') {
            _ if is_instant => "INSTANT".to_owned(),
            Some((product, version)) => match version.split_once('-') {
                Some((number, digest)) => {
                    let after = digest.get(8..).unwrap_or_default();
                    format!("{product}@{number}{after}")
                }
                None => word.to_owned(),
            },
            None => word.to_owned(),
        }
    };
    let line = |line: &str| -> String {
        let words: Vec<String> = line.split_whitespace().map(word).collect();
        words.join(" ")
    };
    let lines = text.lines().map(line);
    lines.filter(|line| !line.is_empty()).collect()
}

/// Are the lines those that were printed, with any others where some are left out?
fn agree(answer: &[String], printed: &[String]) -> bool {
    match (answer, printed) {
        ([], printed) => printed.is_empty(),
        ([first, rest @ ..], printed) if first == LEFT_OUT => {
            (0..=printed.len()).any(|skipped| agree(rest, &printed[skipped..]))
        }
        ([first, rest @ ..], [line, others @ ..]) => first == line && agree(rest, others),
        (_, []) => false,
    }
}

fn picture(file: &Path) -> [u32; 2] {
    let picture = image::open(file).unwrap();
    let pixels = picture.to_rgb8();
    let colours: std::collections::BTreeSet<[u8; 3]> = pixels.pixels().map(|it| it.0).collect();
    assert!(colours.len() > 100, "{} is empty", file.display());
    [pixels.width(), pixels.height()]
}

#[test]
fn the_recipe_of_a_regional_budget_can_be_followed_and_prints_what_it_says() {
    let place = Place::new();
    let blocks = blocks(PAGE);
    let commands = blocks.iter().filter(|block| block.kind == "sh");
    assert!(commands.count() >= 9, "blocks are lost");
    for block in &blocks {
        if block.kind == "python" {
            let name = block.text.lines().next().unwrap();
            let name = name.strip_prefix("# ").expect("a script says its name");
            std::fs::write(place.work().join(name), &block.text).unwrap();
            continue;
        }
        assert_eq!(block.kind, "sh", "nothing else is on the page");
        let printed = place.run(&block.text);
        let answer = block.answer.as_ref().expect("an answer follows");
        let (wanted, found) = (told(answer), told(&printed));
        assert!(agree(&wanted, &found), "{}\n{printed}", block.text);
        // The comparison sees another number.
        let other = told(&answer.replace('8', "9"));
        assert!(other == wanted || !agree(&other, &found), "{}", block.text);
    }
    for figure in ["southern-year.png", "southern-trend.png"] {
        let [width, height] = picture(&place.work().join(figure));
        assert!(
            width >= 800 && height >= 400,
            "{figure}: {width} x {height}"
        );
    }
    let drawn = std::fs::read_to_string(place.work().join("southern.svg")).unwrap();
    assert!(drawn.contains("globe-synthetic@1"), "no version is on it");
}

#[test]
fn lines_that_are_left_out_are_any_and_others_are_none() {
    let lines = |text: &str| told(text);
    let printed = lines("a\nb 1\nc x@3-01234567:5 done\nd 2026-11-27T03:42:37.971Z");
    for same in [
        "...\nb  1\n...",
        "a\n...\nd 2025-01-01T00:00:00.000Z",
        "...",
        "a\n...\nb 1\nc x@3-89abcdef:5 done\n...",
    ] {
        assert!(agree(&lines(same), &printed), "{same}");
    }
    for other in [
        "a",
        "...\nb 2\n...",
        "b 1\n...",
        "...\nc x@3-01234567:6 done\n...",
        "...\na\n..b",
    ] {
        assert!(!agree(&lines(other), &printed), "{other}");
    }
}
