//! Log lines on standard error.

use harness::program;

/// Journals and files are searched for words such as `service="executor"`, which colours would cut up.
#[test]
fn log_lines_have_no_colours_where_there_is_no_terminal() {
    let data = tempfile::tempdir().unwrap();
    // A service that says where its health is told, and ends: its store would be a folder where a file is.
    let file = data.path().join("file");
    std::fs::write(&file, "").unwrap();
    let store = format!("file:{}", file.display());
    let words = ["executor", "--admin", "127.0.0.1:0", "--log", "info"];
    let talk = program::fail(data.path(), &[&words[..], &["--store", &store]].concat()).unwrap();
    assert!(talk.contains(r#"service="executor""#), "{talk:?}");
    assert!(!talk.contains('\u{1b}'), "{talk:?}");
}

/// As a log on a full disk refuses them, or a reader that went away.
#[test]
fn lines_that_nobody_takes_are_lost_and_the_work_goes_on() {
    let place = tempfile::tempdir().unwrap();
    let data = place.path().join("data");
    let ended = |words: &[&str]| {
        let full = std::fs::File::options().write(true).open("/dev/full");
        let mut command = program::command(&data);
        let output = command.args(words).stderr(full.unwrap()).output().unwrap();
        (
            output.status.code(),
            String::from_utf8(output.stdout).unwrap(),
        )
    };
    let file = place.path().join("sea.h5");
    let file = file.to_str().unwrap();
    let (code, made) = ended(&["generate", "china-sea", "--scale", "0.02", "-o", file]);
    assert_eq!((code, made.trim()), (Some(0), file));
    let (code, landed) = ended(&["ingest", file]);
    assert!(
        landed.contains("landed in china-sea-synthetic@1-"),
        "{landed}"
    );
    assert_eq!(code, Some(0));
    // Refusals and log lines of services: an exit code that a panic does not have.
    assert_eq!(ended(&["budget", "--product", "nothing"]).0, Some(1));
    let store = format!("file:{file}");
    let service = [
        "executor",
        "--admin",
        "127.0.0.1:0",
        "--log",
        "info",
        "--store",
        &store,
    ];
    assert_eq!(ended(&service).0, Some(1));
}

/// The loader of drivers says that it was opened, when told to.
#[test]
fn with_the_processor_alone_no_driver_is_looked_for() {
    let place = tempfile::tempdir().unwrap();
    let data = place.path().join("data");
    let (file, picture) = (place.path().join("sea.h5"), place.path().join("a.png"));
    let file = file.to_str().unwrap();
    let generate = ["generate", "china-sea", "--scale", "0.02", "-o", file];
    program::succeed(&data, &generate).unwrap();
    program::succeed(&data, &["ingest", file]).unwrap();
    let talk = |words: &[&str]| {
        let mut command = program::command(&data);
        let output = command.env("VK_LOADER_DEBUG", "all").args(words).output();
        String::from_utf8_lossy(&output.unwrap().stderr).into_owned()
    };
    let is_opened = |talk: &str| talk.contains("Vulkan Loader Version");
    assert!(is_opened(&talk(&["adapters"])), "the loader is not heard");
    let words = "--cpu render globe --layer china-sea-synthetic --lon 115 --lat 20 --size 64x48 -o";
    let mut words: Vec<&str> = words.split(' ').collect();
    words.push(picture.to_str().unwrap());
    let drawn = talk(&words);
    assert!(picture.exists() && !is_opened(&drawn), "{drawn}");
}
