//! Messages that nobody understands, or that say what is not so.

use contract::digest::Digest;
use contract::event::Event;
use contract::topic::Topic;

use super::{Bad, Ground, PRODUCT, bad, notice, promised, until};

#[test]
fn a_file_that_is_not_the_promised_one_is_refused() {
    let ground = Ground::new();
    let file = ground.path("inbox/other.nc");
    let content = std::fs::read(ground.good()).unwrap();
    // Another file than the good one, so that its bytes would be seen in the store.
    std::fs::write(&file, [&content[..], b" "].concat()).unwrap();
    let path = file.to_str().unwrap();
    let bad = [
        bad(
            promised(path, Some(Digest::of(b"something else")), None).to_json(),
            "checksum",
            "SHA-256 digest",
        ),
        bad(
            promised(path, None, Some(content.len() as u64)).to_json(),
            "checksum",
            "bytes",
        ),
    ];
    ground.refuse(&[], &bad);
}

/// What a stranger might send to a topic of ours.
fn gibberish(of: &Event) -> [Vec<u8>; 5] {
    let text = of.to_json();
    [
        text.replace(&format!("\"schema\":{}", of.schema), "\"schema\":99")
            .into_bytes(),
        text.replace("\"trace\"", "\"extra\":1,\"trace\"")
            .into_bytes(),
        text.as_bytes()[..text.len() / 2].to_vec(),
        b"no JSON at all".to_vec(),
        b"\xff\xfe\x00".to_vec(),
    ]
}

#[test]
fn an_unknown_schema_version_and_gibberish_are_refused() {
    let ground = Ground::new();
    let file = ground.good();
    let of = notice(file.to_str().unwrap());
    let says = ["schema 99 is unknown", "extra", "EOF", "expected", "utf-8"];
    let bad: Vec<Bad> = gibberish(&of)
        .into_iter()
        .zip(says)
        .map(|(content, says)| bad(content, "message", says))
        .collect();
    ground.refuse(&[], &bad);
}

#[test]
fn files_that_are_cut_off_or_no_grids_are_refused() {
    let ground = Ground::new();
    let whole = std::fs::read(ground.good()).unwrap();
    let made = [
        ("cut.nc", &whole[..whole.len() / 2], "corrupt", ""),
        ("text.nc", b"this is no grid\n", "unreadable", ""),
        ("empty.nc", b"", "unreadable", ""),
    ];
    let bad = made.map(|(name, content, reason, says)| {
        let file = ground.path("inbox").join(name);
        std::fs::write(&file, content).unwrap();
        bad(notice(file.to_str().unwrap()).to_json(), reason, says)
    });
    ground.refuse(&[], &bad);
}

/// Each topic that a group works off: gibberish goes before what is good, and is told of with its place.
#[test]
fn gibberish_blocks_no_partition_of_observations_render_jobs_and_landed_granules() {
    let mut ground = Ground::new();
    let observation = r#"{"schema":1,"trace":"good","body":{"kind":"observation","observations":[{"dataset":"buoys",
        "platform":"B1","kind":"buoy","time":"2010-01-01T00:00:00Z","lon_deg":120.0,"lat_deg":20.0,"depth_m":1.0,
        "property":"sea_surface_temperature","value":290.0,"unit":"K","quality":"good"}]}}"#;
    let good = Event::from_json(observation).unwrap();
    let topics = [
        (Topic::Observation, "observations", "ingestd"),
        (Topic::RenderJob, "render", "render-worker"),
        (Topic::GranuleLanded, "derive", "scheduler"),
    ];
    for (topic, _, _) in topics {
        ground.send(topic, &gibberish(&good));
    }
    ground.send(Topic::Observation, &[observation.as_bytes().to_vec()]);
    let file = ground.good();
    ground.succeed(&["notice", "--product", PRODUCT, file.to_str().unwrap()]);
    ground.set("FLUXGLOBE_PARTITIONS", "1");
    let mut nodes = topics.map(|(_, _, service)| ground.start(service));
    let _executor = ground.start("executor");
    for ((topic, group, _), node) in topics.into_iter().zip(&mut nodes) {
        until(&format!("end of {topic}"), node, || {
            ground.lag(topic, group) == 0
        });
    }
    // The granule that landed behind the gibberish was read too: a reader that stopped would have left it.
    assert_eq!(
        ground.count(Topic::GranuleLanded),
        gibberish(&good).len() + 1
    );
    let stored = ground.succeed(&["observations", "query", "--dataset", "buoys", "--json"]);
    assert_eq!(stored.lines().count(), 1, "{stored}");
    let rejected = ground.rejected();
    for (topic, _, _) in topics {
        for offset in 0..gibberish(&good).len() {
            let origin = format!("{topic}/0/{offset}");
            let told: Vec<_> = rejected
                .iter()
                .filter(|about| about["origin"] == origin.as_str())
                .collect();
            assert_eq!(told.len(), 1, "{origin} in {rejected:#?}");
            assert_eq!(told[0]["reason"], "message");
        }
    }
    assert_eq!(rejected.len(), topics.len() * gibberish(&good).len());
    for node in &mut nodes {
        assert!(!node.has_ended(), "{}", node.talk());
    }
}
