//! A revised file on a data folder, where nothing follows by itself: what is made of the older version is named, and brought along on demand.

use std::path::Path;

use harness::program;

const PRODUCT: &str = "china-sea-synthetic";

/// A file of the product, and the one that revises it.
fn files(place: &Path, data: &Path) -> [String; 2] {
    [("first.h5", "1"), ("revised.h5", "2")].map(|(name, seed)| {
        let file = place.join(name).to_str().unwrap().to_owned();
        let words = "generate china-sea --scale 0.02 --seed";
        let mut words: Vec<&str> = words.split(' ').collect();
        words.extend([seed, "-o", &file]);
        program::succeed(data, &words).unwrap();
        file
    })
}

/// The result of a command that must succeed, and what is said beside it.
fn outcome(data: &Path, words: &[&str]) -> (String, String) {
    let output = program::run(data, words).unwrap();
    let talk = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success(), "{words:?}: {talk}");
    (String::from_utf8(output.stdout).unwrap(), talk)
}

#[test]
fn what_a_landing_leaves_behind_is_named_and_so_is_what_recompute_leaves() {
    let place = tempfile::tempdir().unwrap();
    let data = place.path().join("data");
    let talk = |words: &[&str]| outcome(&data, words).1;
    let [first, revised] = files(place.path(), &data);
    let said = "made of an older version";
    let not_added_up = format!("`fluxglobe derive accumulated --product {PRODUCT}`");
    let landed = talk(&["ingest", &first]);
    assert!(!landed.contains(said), "{landed}");
    assert!(landed.contains(&not_added_up), "{landed}");
    talk(&["derive", "accumulated", "--product", PRODUCT]);
    talk(&[
        "derive",
        "statistic",
        "--product",
        PRODUCT,
        "--statistic",
        "mean",
    ]);
    assert!(!talk(&["ingest", &first]).contains(said), "nothing came");

    let landed = talk(&["ingest", &revised]);
    let both = format!("{said}: {PRODUCT}-accumulated, {PRODUCT}-mean;");
    let recompute = format!("`fluxglobe recompute --product {PRODUCT}`");
    assert!(
        landed.contains(&both) && landed.contains(&recompute) && !landed.contains(&not_added_up),
        "{landed}"
    );

    let spool = place.path().join("spool");
    let words = [
        "recompute",
        "--product",
        PRODUCT,
        "--what",
        "frames",
        "--spool",
    ];
    let made = talk(&[&words[..], &[spool.to_str().unwrap()]].concat());
    assert!(made.contains(&format!("{said}: {PRODUCT}-mean;")), "{made}");
    talk(&[
        "derive",
        "statistic",
        "--product",
        PRODUCT,
        "--statistic",
        "mean",
    ]);
    let made = talk(&[&words[..], &[spool.to_str().unwrap()]].concat());
    assert!(!made.contains(said), "{made}");
}

#[test]
fn what_is_made_of_what_is_derived_is_brought_along_where_that_is_asked_for() {
    let place = tempfile::tempdir().unwrap();
    let data = place.path().join("data");
    let [first, revised] = files(place.path(), &data);
    let input = format!("flux={PRODUCT}");
    let twice = [
        "derive",
        "--name",
        "twice",
        "--quantity",
        "carbon_flux",
        "--input",
        &input,
        "--expr",
        "2 * flux",
    ];
    let statistics = ["derive", "statistic", "--statistic", "max", "--product"];
    let accumulated = ["derive", "accumulated", "--product", "twice"];
    let said = "made of an older version";
    outcome(&data, &["ingest", &first]);
    outcome(&data, &twice);
    outcome(&data, &accumulated);
    for product in ["twice", "twice-accumulated"] {
        outcome(&data, &[&statistics[..], &[product]].concat());
    }
    outcome(&data, &["ingest", &revised]);
    let (made, talk) = outcome(&data, &twice);
    assert!(
        made.starts_with("twice@2-") && made.lines().count() == 1,
        "{made}"
    );
    let left = format!("{said}: twice-accumulated, twice-accumulated-max, twice-max;");
    assert!(
        talk.contains(&left) && talk.contains("the same command with `--follow`"),
        "{talk}"
    );

    // Accumulated carbon brings along what is made of it, and not what else is made of its flux.
    let follow = ["--follow"];
    let (made, talk) = outcome(&data, &[&accumulated[..], &follow].concat());
    let made: Vec<&str> = made.lines().collect();
    assert!(made[0].starts_with("twice-accumulated@2-"), "{made:?}");
    assert!(made[1].starts_with("twice-accumulated-max@2-"), "{made:?}");
    assert_eq!(made.len(), 2);
    assert!(!talk.contains(said), "{talk}");

    let (made, talk) = outcome(&data, &[&twice[..], &follow].concat());
    let made: Vec<&str> = made.lines().collect();
    assert!(made[0].starts_with("twice@2-"), "{made:?}");
    assert!(
        made.iter().any(|id| id.starts_with("twice-max@2-")),
        "{made:?}"
    );
    assert!(
        talk.contains("3 products") && !talk.contains(said),
        "{talk}"
    );
    let (_made, talk) = outcome(&data, &twice);
    assert!(!talk.contains(said), "{talk}");
}
