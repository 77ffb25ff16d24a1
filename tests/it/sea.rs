//! What of a cell is sea, from the command line and over HTTP: real files of FluxEngine, its totals, and questions of
//! strangers that leave nothing behind.

use std::path::Path;
use std::process::Command;

use harness::server::Server;
use harness::{granule, program};
use serde_json::Value;

/// The script's fluxes in a folder, and what it says of them.
fn fluxengine(folder: &Path) -> Value {
    let script = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/reference/fluxengine_budgets.py"
    );
    let printed = Command::new(test_data::python())
        .arg(script)
        .args([test_data::fluxengine(""), test_data::fluxengine_land()])
        .arg(folder)
        .output()
        .unwrap();
    let talk = String::from_utf8_lossy(&printed.stderr);
    assert!(printed.status.success(), "{talk}");
    serde_json::from_slice(&printed.stdout).unwrap()
}

/// Takahashi's run and the mask of 1 degree landed, and a flux of 5 degrees.
fn landed() -> (tempfile::TempDir, Value) {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let said = fluxengine(folder.path());
    let run = folder.path().join("fluxengine-takahashi09.nc");
    let land = |file: &Path, more: &[&str]| {
        let words = ["ingest", file.to_str().unwrap()];
        program::succeed(&data, &[&words[..], more].concat()).unwrap();
    };
    land(&run, &["--product", "run"]);
    land(&test_data::fluxengine_land(), &[]);
    let coarse = granule::write(folder.path(), 0, 0).unwrap();
    land(&coarse, &["--product", "coarse"]);
    (folder, said)
}

#[test]
#[expect(
    clippy::too_many_lines,
    reason = "one table of totals, asked of one store"
)]
fn fluxengines_budget_is_had_with_its_authors_choices_by_name() {
    let (folder, said) = landed();
    let data = folder.path().join("data");
    let ask = |product: &str, more: &[&str]| {
        let words = ["budget", "--product", product, "--step", "month", "--json"];
        program::json(&data, &[&words[..], more].concat()).unwrap()
    };
    let tg = |answer: &Value| -> Vec<f64> {
        let rows = answer["rows"].as_array().unwrap().iter();
        rows.map(|row| row["budget_tg"].as_f64().unwrap()).collect()
    };
    let theirs = [
        "--earth",
        "local-radius",
        "--cells",
        "ocean-share",
        "--ocean",
        "onedeg-land",
    ];
    let answer = ask("run", &theirs);
    assert_eq!(
        (&answer["earth"], &answer["cells"]),
        (&"local-radius".into(), &"ocean-share".into())
    );
    let source = answer["ocean_source"].as_str().unwrap();
    assert!(
        source.contains("onedeg-land@1") && source.contains("land_area_fraction"),
        "{source}"
    );
    let own = &said["fluxengine-takahashi09"];
    let months = own["months_tg"]["local-radius ocean-share"]
        .as_array()
        .unwrap();
    let printed = own["printed_months_tg"].as_array().unwrap();
    let ours = tg(&answer);
    assert_eq!((ours.len(), months.len()), (12, 12));
    for (ours, (independent, printed)) in ours.iter().zip(months.iter().zip(printed)) {
        let without_gaps = printed[0].as_f64().unwrap() - printed[1].as_f64().unwrap();
        for other in [independent.as_f64().unwrap(), without_gaps] {
            assert!((ours / other - 1.0).abs() < 1e-6, "{ours} {other}");
        }
    }
    // Each of the three choices makes another number.
    for other in [
        &["--cells", "ocean-share", "--ocean", "onedeg-land"][..],
        &[
            "--earth",
            "local-radius",
            "--cells",
            "whole",
            "--ocean",
            "onedeg-land",
        ],
        &["--earth", "local-radius", "--cells", "ocean-share"],
    ] {
        let apart = (tg(&ask("run", other))[0] / ours[0] - 1.0).abs();
        assert!(apart > 1e-4, "{other:?}: {apart:e}");
    }
    let words = [
        "stats",
        "polygon",
        "--product",
        "run",
        "--region",
        "-40,20,-30,30",
        "--json",
    ];
    let series = program::json(&data, &[&words[..], &["--ocean", "onedeg-land"]].concat()).unwrap();
    assert_eq!(series["ocean_source"], answer["ocean_source"]);
    for (product, ocean, reasons) in [
        (
            "coarse",
            "onedeg-land",
            &["36 x 72", "180 x 360", "coarse"][..],
        ),
        (
            "run",
            "run",
            &["run cannot say what is sea", "sea_area_fraction"],
        ),
        ("run", "nothing", &["there is no product nothing"]),
    ] {
        let words = ["budget", "--product", product, "--ocean", ocean];
        let refused = program::fail(&data, &words).unwrap();
        assert!(
            reasons.iter().all(|reason| refused.contains(reason)),
            "{refused}"
        );
    }
}

/// Files below a folder.
fn files(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).unwrap().map(Result::unwrap);
    entries
        .map(|entry| {
            let path = entry.path();
            if path.is_dir() { files(&path) } else { 1 }
        })
        .sum()
}

#[test]
fn regions_of_strangers_leave_no_file_behind() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let granule = granule::write(folder.path(), 0, 0).unwrap();
    let words = ["ingest", granule.to_str().unwrap(), "--product", "flux"];
    program::succeed(&data, &words).unwrap();
    let server = Server::start(&data, &["serve"]).unwrap();
    let before = files(&data);
    for i in 0..25 {
        let region = format!("{i},-{i}.5,{}.25,{i}.25", i + 20);
        for route in ["budget", "area"] {
            let path = format!("/api/products/flux/{route}?region={region}");
            let answer = server.get(&path).unwrap();
            assert_eq!(answer.status, 200, "{}", answer.text());
        }
    }
    assert_eq!(files(&data), before);
    let region = ["--region", "3,-3.5,23.25,3.25", "--step", "month", "--json"];
    let words = ["budget", "--product", "flux"];
    let own = program::json(&data, &[&words[..], &region].concat()).unwrap();
    let path = "/api/products/flux/budget?region=3,-3.5,23.25,3.25&step=month";
    let served = server.get(path).unwrap().json().unwrap();
    assert_eq!(served, own);
    assert!(
        files(&data) > before,
        "what is asked on this machine is stored"
    );
}
