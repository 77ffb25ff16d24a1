//! The cluster's answers are those of one process, byte for byte.

use std::path::Path;
use std::time::Duration;

use anyhow::Result;
use harness::cluster::{Cluster, Shape};
use harness::program;
use serde_json::Value;

use crate::alone;
use crate::granules::{self, Granules};

const LIMIT: Duration = Duration::from_mins(3);

/// An answer without what names the version: the two landed the same files in other groups.
fn values(text: &str) -> String {
    let mut answer: Value = serde_json::from_str(text).unwrap();
    let fields = answer.as_object_mut().unwrap();
    assert!(fields.remove("manifest").is_some(), "{fields:?}");
    answer.to_string()
}

fn questions(granules: &Granules) -> Vec<Vec<&str>> {
    let product = ["--product", granules.product, "--json"];
    let budget = |words: &[&'static str]| [&["budget"], &product[..], words].concat();
    vec![
        budget(&["--step", "month"]),
        budget(&["--step", "month", "--earth", "sphere"]),
        budget(&["--region", "100,-10,130.3,41.7"]),
        budget(&["--region", "equatorial-pacific", "--step", "year"]),
        [
            &["stats", "point"],
            &product[..],
            &["--lon", "125.5", "--lat", "20.5"],
        ]
        .concat(),
    ]
}

fn embedded(data: &Path, granules: &Granules) -> Result<()> {
    let files: Vec<&str> = granules
        .files
        .iter()
        .map(|file| file.to_str().unwrap())
        .collect();
    program::succeed(data, &[&["ingest"], &files[..]].concat())?;
    program::succeed(
        data,
        &["derive", "accumulated", "--product", granules.product],
    )?;
    Ok(())
}

#[test]
fn budgets_series_and_tiles_equal_those_of_one_process() {
    let _alone = alone();
    let (inbox, data) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    let granules = granules::some(inbox.path());
    embedded(data.path(), &granules).unwrap();
    let cluster = Cluster::start(Shape::default(), inbox.path()).unwrap();
    cluster.notice(&granules.files).unwrap();
    until_derived(&cluster, &granules).unwrap();

    for words in questions(&granules) {
        let ours = cluster.succeed(&words).unwrap();
        let theirs = program::succeed(data.path(), &words).unwrap();
        assert_eq!(values(&ours), values(&theirs), "{words:?}");
    }
    for (z, x, y) in granules.tiles {
        for mode in ["map", "volume"] {
            let path = format!(
                "/tiles/{}/{mode}/{z}/{x}/{y}.png?time={}",
                granules.product, granules.time
            );
            let tile = cluster.get(&path).unwrap();
            assert_eq!(tile.status, 200, "{path}: {}", tile.text());
            let file = data.path().join("tile.png");
            let [z, x, y] = [z, x, y].map(ToString::to_string);
            let words = [
                "render",
                "tile",
                "--layer",
                granules.product,
                "--mode",
                mode,
                "--time",
                granules.time,
                "--z",
                &z,
                "--x",
                &x,
                "--y",
                &y,
                "-o",
                file.to_str().unwrap(),
            ];
            program::succeed(data.path(), &words).unwrap();
            assert_eq!(tile.body, std::fs::read(&file).unwrap(), "{path}");
        }
    }
}

/// Waits until everything noticed has landed and is accumulated.
fn until_derived(cluster: &Cluster, granules: &Granules) -> Result<()> {
    cluster.wait_for("derived product", LIMIT, |cluster| {
        let text = cluster.succeed(&["products", "--json"])?;
        let products: Value = serde_json::from_str(&text)?;
        let find = |name: &str| {
            let all = products.as_array()?;
            all.iter().find(|product| product["product"] == name)
        };
        let (Some(flux), Some(derived)) = (
            find(granules.product),
            find(&format!("{}-accumulated", granules.product)),
        ) else {
            return Ok(None);
        };
        let is_whole = flux["step_count"] == 12 && derived["derived_from"] == flux["manifest"];
        Ok(is_whole.then_some(()))
    })
}
