//! A map of a statistic follows what it is of when something lands there.

use std::time::Duration;

use harness::cluster::{Cluster, Shape};
use harness::granule;
use serde_json::Value;

use crate::alone;
use crate::faults::{PRODUCT, notice, until_whole};

const LIMIT: Duration = Duration::from_mins(2);
const SMALL: Shape = Shape {
    executors: 1,
    ingestds: 1,
    render_workers: 1,
    tile_servers: 1,
};

#[test]
fn the_deriver_makes_a_map_anew_when_a_month_lands_and_leaves_one_that_was_asked_for_once() {
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let file = |month| granule::write(inbox.path(), month, 0).unwrap();
    let cluster = Cluster::start(SMALL, inbox.path()).unwrap();
    notice(&cluster, &[file(0), file(1)]);
    until_whole(&cluster, 2);
    let statistic = ["derive", "statistic", "--product", PRODUCT];
    let region = ["--region", "-40,-30,40,30"];
    let follows = ["--statistic", "count", "--name", "follows"];
    let stays = ["--statistic", "count", "--name", "stays", "--once"];
    for more in [&follows[..], &stays[..]] {
        let words = [&statistic[..], &region, more].concat();
        cluster.succeed(&words).unwrap();
    }
    notice(&cluster, &[file(2)]);
    until_whole(&cluster, 3);
    let followed = |cluster: &Cluster| {
        let listed: Value = serde_json::from_str(&cluster.succeed(&["products", "--json"])?)?;
        let of = |name: &str| listed.as_array()?.iter().find(|it| it["product"] == name);
        let (Some(source), Some(map)) = (of(PRODUCT), of("follows")) else {
            return Ok(None);
        };
        let is_new = map["derived_from"] == source["manifest"];
        Ok(is_new.then(|| of("stays").cloned()))
    };
    let stays = cluster.wait_for("the map of three months", LIMIT, followed);
    let stays = stays.unwrap().unwrap();
    let version = stays["manifest"].as_str().unwrap();
    assert!(version.starts_with("stays@1-"), "{version}");
    let point = [
        "stats",
        "point",
        "--product",
        "follows",
        "--lon",
        "2",
        "--lat",
        "2",
        "--json",
    ];
    let answer: Value = serde_json::from_str(&cluster.succeed(&point).unwrap()).unwrap();
    assert_eq!(answer["series"][0]["value"], 3.0, "{answer}");
}
