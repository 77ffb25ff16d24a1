//! Bad files and bad requests: one clear line each, the rest goes on, nothing lands twice.

use std::path::PathBuf;

use harness::program;
use harness::server::Server;

use crate::end_to_end::demo_data;

fn flux_files() -> Vec<PathBuf> {
    let entries = std::fs::read_dir(test_data::fluxengine("takahashi09")).unwrap();
    let mut files: Vec<_> = entries.map(|entry| entry.unwrap().path()).collect();
    files.sort();
    files
}

#[test]
fn a_batch_goes_on_past_bad_files_and_its_exit_code_says_so() {
    let files = flux_files();
    let data = tempfile::tempdir().unwrap();
    let make = |name: &str, content: &[u8]| {
        let path = data.path().join(name);
        std::fs::write(&path, content).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let whole = std::fs::read(&files[0]).unwrap();
    let truncated = make("truncated.nc", &whole[..whole.len() / 2]);
    let text = make("text.nc", b"this is no grid\n");
    let empty = make("empty.nc", b"");
    let good = files[0].to_str().unwrap();
    let talk = program::fail(
        data.path(),
        &["ingest", &truncated, &text, good, &empty, "/nonexistent.nc"],
    )
    .unwrap();
    for name in ["truncated.nc", "text.nc", "empty.nc", "nonexistent.nc"] {
        assert_eq!(
            talk.lines().filter(|line| line.contains(name)).count(),
            1,
            "{name}:\n{talk}"
        );
    }
    let products = program::json(data.path(), &["products", "--json"]).unwrap();
    assert_eq!(products[0]["step_count"], 1, "{products}");
}

#[test]
fn a_survey_of_nothing_and_one_in_which_nothing_would_land_fail() {
    let place = tempfile::tempdir().unwrap();
    let data = place.path().join("data");
    let folder = place.path().join("files");
    std::fs::create_dir(&folder).unwrap();
    let words = ["survey", folder.to_str().unwrap()];

    std::fs::write(folder.join("README.txt"), "no data").unwrap();
    let talk = program::fail(&data, &words).unwrap();
    assert!(talk.contains("holds no data files (.nc, "), "{talk}");
    assert!(talk.contains("there is nothing to survey"), "{talk}");

    std::fs::write(folder.join("text.nc"), "this is no grid").unwrap();
    let output = program::run(&data, &words).unwrap();
    let [table, talk] = [output.stdout, output.stderr].map(|it| String::from_utf8(it).unwrap());
    assert!(!output.status.success(), "{talk}");
    assert!(table.contains("refused (unreadable)"), "{table}");
    assert!(talk.contains("none of 1 files would land"), "{talk}");

    // What would land beside it is an answer.
    harness::granule::write(&folder, 0, 0).unwrap();
    let table = program::succeed(&data, &words).unwrap();
    assert!(table.contains("refused (unreadable)"), "{table}");
    assert!(table.contains("lands in"), "{table}");
}

#[test]
fn a_survey_warns_of_nothing_about_what_it_throws_away() {
    let place = tempfile::tempdir().unwrap();
    let folder = place.path().join("files");
    std::fs::create_dir(&folder).unwrap();
    for month in 0..36 {
        harness::granule::write(&folder, month, 0).unwrap();
    }
    let words = ["survey", folder.to_str().unwrap()];
    let output = program::run(&place.path().join("data"), &words).unwrap();
    let talk = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{talk}");
    for word in ["WARN", "cannot be read"] {
        assert!(!talk.contains(word), "{talk}");
    }
}

#[test]
fn the_same_file_twice_lands_once() {
    let files = flux_files();
    let data = tempfile::tempdir().unwrap();
    let good = files[3].to_str().unwrap();
    program::succeed(data.path(), &["ingest", good]).unwrap();
    let first = program::json(data.path(), &["products", "--json"]).unwrap();
    program::succeed(data.path(), &["ingest", good, good]).unwrap();
    assert_eq!(
        program::json(data.path(), &["products", "--json"]).unwrap(),
        first
    );
}

/// Values past the range of a profile, as the line of the file, the list of products and their JSON count them.
#[test]
fn what_is_masked_is_counted_where_people_look() {
    let data = tempfile::tempdir().unwrap();
    let file = harness::granule::write(data.path(), 0, 0).unwrap();
    let profile = |range: &str| {
        let path = data.path().join("own.toml");
        let text = format!(
            "name = \"own\"\nproduct = \"own-flux\"\ntitle = \"Flux\"\nsource = \"a test\"\n\
             quantity = \"carbon_flux\"\n[variable]\nname = \"fgco2\"\n{range}"
        );
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let land = |range: &str| {
        let words = [
            "ingest",
            file.to_str().unwrap(),
            "--profile",
            &profile(range),
            "--json",
        ];
        program::json(data.path(), &words).unwrap()
    };
    let listed = || {
        let all = program::json(data.path(), &["products", "--json"]).unwrap();
        let output = program::run(data.path(), &["products"]).unwrap();
        let talk = String::from_utf8(output.stderr).unwrap();
        (all[0]["masked"].clone(), talk)
    };
    assert_eq!(land("")["masked"], serde_json::json!({}));
    let (masked, talk) = listed();
    assert_eq!(
        (&masked["out_of_range"], &masked["steps"]),
        (&0.into(), &0.into())
    );
    assert!(!talk.contains("masked"), "{talk}");

    let line = land("valid_range = [-1e-8, 1e-8]\n");
    let count = line["masked"]["out_of_range"].as_u64().unwrap();
    assert!(count > 0, "{line}");
    let (masked, talk) = listed();
    assert_eq!(masked["out_of_range"], count);
    assert_eq!(
        (&masked["steps"], &masked["uncounted_steps"]),
        (&1.into(), &0.into())
    );
    assert_eq!(masked["most"]["cells"], count);
    let warning = format!("own-flux: {count} values masked ({count} outside the valid range)");
    assert!(talk.contains(&warning), "{talk}");
}

#[test]
fn what_is_no_observation_is_listed() {
    let data = tempfile::tempdir().unwrap();
    let file = data.path().join("44005h2012.txt");
    let line = |hour: usize| {
        let air_c = if hour == 7 { "87.5" } else { " 6.1" };
        format!("2012 01 01 {hour:02} 50  5.5  {air_c}\n")
    };
    let lines: String = (0..24).map(line).collect();
    std::fs::write(&file, format!("#YY  MM DD hh mm WSPD  ATMP\n{lines}")).unwrap();
    let words = ["ingest", file.to_str().unwrap(), "--json"];
    let landed = program::json(data.path(), &words).unwrap();
    assert_eq!(landed["masked"], serde_json::json!({"implausible": 1}));
    let listed = program::run(data.path(), &["observations", "list"]).unwrap();
    let talk = String::from_utf8(listed.stderr).unwrap();
    let warning =
        "ndbc: 1 value masked (1 implausible) in 1 of 1 files; most in 44005h2012.txt, 1 beside 47";
    assert!(talk.contains(warning), "{talk}");
}

#[test]
fn a_swath_is_refused_with_its_reason() {
    let Some(set) = test_data::set("wind_ascat_l2") else {
        return;
    };
    let data = tempfile::tempdir().unwrap();
    let swath = set.join("ascat_20150702_084200_metopa_45145_eps_o_250_2300_ovw.l2.nc");
    let talk = program::fail(data.path(), &["ingest", swath.to_str().unwrap()]).unwrap();
    assert!(talk.contains("swath"), "{talk}");
    assert_eq!(
        program::json(data.path(), &["products", "--json"]).unwrap(),
        serde_json::json!([])
    );
}

#[test]
fn commands_say_what_there_is() {
    let data = tempfile::tempdir().unwrap();
    let talk = program::fail(data.path(), &["budget", "--product", "takahashi09-flux"]).unwrap();
    assert!(talk.contains("no product"), "{talk}");
    let talk = program::fail(
        data.path(),
        &[
            "stats",
            "point",
            "--product",
            "Bad Name",
            "--lon",
            "0",
            "--lat",
            "0",
        ],
    );
    assert!(talk.unwrap().contains("a-z"));
    let data = demo_data();
    for (words, expected) in [
        (
            [
                "budget",
                "--product",
                "takahashi09-flux",
                "--region",
                "atlantis",
            ],
            "global",
        ),
        (
            ["budget", "--product", "sst-2010", "--region", "global"],
            "flux",
        ),
        (
            [
                "budget",
                "--product",
                "takahashi09-flux",
                "--from",
                "1999-13",
            ],
            "ISO 8601",
        ),
        (
            [
                "budget",
                "--product",
                "takahashi09-flux",
                "--region",
                "/nonexistent.geojson",
            ],
            "nonexistent",
        ),
    ] {
        let talk = program::fail(data, &words).unwrap();
        assert!(talk.contains(expected), "{words:?}: {talk}");
    }
}

/// A slip, or the command for something else, is told with what was meant.
#[test]
fn what_is_no_such_thing_is_told_with_what_there_is_and_which_command_takes_it() {
    let data = tempfile::tempdir().unwrap();
    let path = |name: &str| data.path().join(name).to_str().unwrap().to_owned();
    let (zarr, plain) = (path("flux.zarr"), path("plain"));
    for folder in [&zarr, &plain] {
        std::fs::create_dir(folder).unwrap();
    }
    std::fs::write(path("flux.zarr/zarr.json"), "{}").unwrap();
    let file = flux_files().swap_remove(0);
    let file = file.to_str().unwrap();
    let fails = |words: &[&str], parts: &[&str]| {
        let talk = program::fail(data.path(), words).unwrap();
        for part in parts {
            assert!(talk.contains(part), "{words:?}: {talk}");
        }
    };
    fails(&["ingest", &zarr], &["is a folder", "`fluxglobe attach`"]);
    fails(&["ingest", &plain], &["is a folder", "the files in it"]);
    let attach = ["attach", file, "--variable", "x"];
    fails(&attach, &["it is a file", "`fluxglobe ingest`"]);
    let profile = ["ingest", file, "--profile", "no-profile"];
    fails(
        &profile,
        &["is no file and none of", "takahashi09-flux, ", " more"],
    );
    let dataset = ["observations", "query", "--dataset", "none"];
    fails(&dataset, &["there is no dataset none"]);

    let of = |region| {
        let words = ["budget", "--product", "takahashi09-flux", "--region"];
        [&words[..], &[region, "--json"]].concat()
    };
    let talk = program::fail(demo_data(), &of("north-atlantic")).unwrap();
    for part in ["global", "MASK:CODE", ".geojson"] {
        assert!(talk.contains(part), "{talk}");
    }
    // Capitals are as small letters, and the answer has the one name.
    let [small, large] =
        ["14n-50n", "14N-50N"].map(|region| program::json(demo_data(), &of(region)).unwrap());
    assert_eq!(small, large);
}

#[test]
fn bad_requests_get_their_status_and_a_reason() {
    let data = demo_data();
    let server = Server::start(data, &["serve"]).unwrap();
    let cases = [
        ("/tiles/takahashi09-flux/volume/99/0/0.png", 400),
        ("/tiles/takahashi09-flux/volume/1/7/0.png", 400),
        ("/tiles/takahashi09-flux/volume/a/0/0.png", 400),
        ("/tiles/takahashi09-flux/volume/1/0/0.png?time=banana", 400),
        ("/tiles/takahashi09-flux/volume/1/0/0.png?size=100000", 400),
        ("/tiles/atlantis/volume/1/0/0.png", 404),
        ("/tiles/takahashi09-flux/hologram/1/0/0.png", 404),
        ("/api/products/takahashi09-flux/point?lon=nan&lat=0", 400),
        ("/api/products/takahashi09-flux/budget?region=atlantis", 400),
        ("/api/products/takahashi09-flux/budget?from=never", 400),
        ("/api/products/sst-2010/budget", 400),
        (
            "/globe/takahashi09-flux/volume.png?lon=0&lat=0&height_km=-0.5",
            400,
        ),
        (
            "/globe/takahashi09-flux/volume.png?lon=0&lat=0&width=1000000000",
            400,
        ),
        ("/no/such/page", 404),
        ("/..%2f..%2fetc/passwd", 404),
    ];
    for (path, status) in cases {
        let answer = server.get(path).unwrap();
        assert_eq!(answer.status, status, "{path}: {}", answer.text());
        if path.starts_with("/tiles") || path.starts_with("/api") {
            let reason = answer.json().unwrap()["error"].as_str().unwrap().to_owned();
            assert!(!reason.is_empty(), "{path}");
        }
    }
    let metrics = server.get("/metrics").unwrap().text();
    assert!(
        !metrics
            .lines()
            .any(|line| line.contains("panic") && line.ends_with(" 1")),
        "{metrics}"
    );
}

#[test]
fn settings_are_printed_without_secrets_and_with_where_they_come_from() {
    let data = tempfile::tempdir().unwrap();
    let secret = data.path().join("password");
    std::fs::write(&secret, "hush").unwrap();
    for service in [
        "ingestd",
        "scheduler",
        "executor",
        "render-worker",
        "tile-server",
    ] {
        let output = program::command(data.path())
            .args([service, "--print-settings"])
            .env("AWS_SECRET_ACCESS_KEY", "hush")
            .env("FLUXGLOBE_STORE", "s3://me:hush@bucket/prefix")
            .env("FLUXGLOBE_KAFKA_PASSWORD_FILE", &secret)
            .env("FLUXGLOBE_POSTGIS", "postgres://me:hush@host/db")
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stdout);
        assert!(output.status.success(), "{service}: {text}");
        assert!(
            text.contains("FLUXGLOBE_STORE=s3://me:***@bucket/prefix  # environment"),
            "{service}: {text}"
        );
        assert!(text.contains("# default"), "{service}: {text}");
        assert!(!text.contains("hush"), "{service}: {text}");
    }
}
