//! A revised file on a data folder, where nothing follows by itself: what is made of the older version is named.

use harness::program;

const PRODUCT: &str = "china-sea-synthetic";

#[test]
fn what_a_landing_leaves_behind_is_named_and_so_is_what_recompute_leaves() {
    let place = tempfile::tempdir().unwrap();
    let data = place.path().join("data");
    let generated = |name: &str, seed: &str| {
        let file = place.path().join(name).to_str().unwrap().to_owned();
        let words = "generate china-sea --scale 0.02 --seed";
        let mut words: Vec<&str> = words.split(' ').collect();
        words.extend([seed, "-o", &file]);
        program::succeed(&data, &words).unwrap();
        file
    };
    // What is said beside the result of a command that must succeed.
    let talk = |words: &[&str]| {
        let output = program::run(&data, words).unwrap();
        let talk = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{words:?}: {talk}");
        talk
    };
    let [first, revised] =
        [("first.h5", "1"), ("revised.h5", "2")].map(|(name, seed)| generated(name, seed));
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
