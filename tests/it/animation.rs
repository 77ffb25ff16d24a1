//! The program as a maker of films: a generated product in, pictures that follow each other out.

use std::path::Path;

use harness::program;

/// A data folder with a small synthetic product and its accumulated carbon.
fn data(place: &Path) -> std::path::PathBuf {
    let (data, file) = (place.join("data"), place.join("synthetic.h5"));
    let file = file.to_str().unwrap();
    program::succeed(
        &data,
        &["generate", "china-sea", "--scale", "0.02", "-o", file],
    )
    .unwrap();
    program::succeed(&data, &["ingest", file]).unwrap();
    let product = ["--product", "china-sea-synthetic"];
    program::succeed(&data, &[&["derive", "accumulated"], &product[..]].concat()).unwrap();
    data
}

fn words<'a>(output: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let start = "--cpu render animation --layer china-sea-synthetic --lon 115 --lat 20 --height 5000 \
                 --size 96x64 --seconds 0.2 --fps 20 --from 2009-03-01 --to 2009-07-01 -o";
    let mut words: Vec<&str> = start.split_whitespace().collect();
    words.push(output);
    words.extend(more);
    words
}

#[test]
fn a_product_becomes_a_folder_of_pictures_that_goes_on_where_it_was_left_and_a_strip() {
    let place = tempfile::tempdir().unwrap();
    let data = data(place.path());
    let folder = place.path().join("film");
    let output = folder.to_str().unwrap();
    program::succeed(&data, &words(output, &[])).unwrap();
    let read =
        |number: u32| std::fs::read(folder.join(format!("picture-{number:05}.png"))).unwrap();
    let pictures: Vec<Vec<u8>> = (0..4).map(read).collect();
    for pair in pictures.windows(2) {
        assert_ne!(pair[0], pair[1], "time passes");
    }
    // One picture is lost: it alone is drawn again, to the same bytes.
    let lost = folder.join("picture-00002.png");
    std::fs::remove_file(&lost).unwrap();
    let kept = folder.join("picture-00001.png");
    std::fs::write(&kept, b"kept as it is").unwrap();
    program::succeed(&data, &words(output, &[])).unwrap();
    assert_eq!(read(2), pictures[2]);
    assert_eq!(read(1), b"kept as it is");
    // The same pictures as one file.
    let strip = place.path().join("film.png");
    program::succeed(&data, &words(strip.to_str().unwrap(), &[])).unwrap();
    let first = image::open(&strip).unwrap().into_rgba8();
    assert_eq!(
        first,
        image::load_from_memory(&pictures[0]).unwrap().into_rgba8()
    );
}

#[test]
fn an_animation_that_cannot_be_is_refused_with_what_can() {
    let place = tempfile::tempdir().unwrap();
    let data = data(place.path());
    let path = |name: &str| place.path().join(name).to_str().unwrap().to_owned();
    let cases: [(String, &[&str], &str); 6] = [
        (path("a.avi"), &[], ".mp4, .webm, .webp, .gif or .png"),
        (
            path("a.mp4"),
            &["--ffmpeg", "/nowhere/ffmpeg"],
            "install ffmpeg",
        ),
        (path("b"), &["--time", "2009-05-01"], "--from and --to"),
        (path("c"), &["--seconds", "100000"], "1 to 36000"),
        (path("d"), &["--to", "2009-02-01"], "not before"),
        (
            path("e"),
            &["--from", "1999-01-01", "--to", "2000-01-01"],
            "covers 2009",
        ),
    ];
    for (output, more, expected) in cases {
        // A later value of the same option takes the place of an earlier one.
        let mut words = words(&output, &[]);
        for pair in more.chunks(2) {
            if let Some(at) = words.iter().position(|word| *word == pair[0]) {
                words[at + 1] = pair[1];
            } else {
                words.extend(pair);
            }
        }
        let talk = program::fail(&data, &words).unwrap();
        assert!(talk.contains(expected), "{talk}");
        assert!(!Path::new(&output).exists(), "{output}");
    }
}

#[test]
fn pictures_of_two_runs_are_compared_on_the_command_line() {
    let place = tempfile::tempdir().unwrap();
    let data = data(place.path());
    let draw = |name: &str, slices: &str| {
        let path = place.path().join(name).to_str().unwrap().to_owned();
        let start = "--cpu render globe --layer china-sea-synthetic --lon 115 --lat 20 --height 5000 --size 96x64";
        let mut words: Vec<&str> = start.split_whitespace().collect();
        words.extend(["--slices", slices, "-o", &path]);
        program::succeed(&data, &words).unwrap();
        path
    };
    let (a, same, other) = (
        draw("a.png", "64"),
        draw("same.png", "64"),
        draw("other.png", "2"),
    );
    let compare = |b: &str| program::json(&data, &["bench", "compare", &a, b, "--json"]).unwrap();
    assert_eq!(compare(&same)["differing_bytes"], 0);
    assert_eq!(compare(&same)["mean_flip"], 0.0);
    let apart = compare(&other);
    assert!(apart["differing_bytes"].as_u64().unwrap() > 100, "{apart}");
    assert!(apart["psnr_db"].as_f64().unwrap() < 60.0, "{apart}");
    let strict = ["bench", "compare", &a, &other, "--least-within", "99.9"];
    let talk = program::fail(&data, &strict).unwrap();
    assert!(talk.contains("99.9 % are wanted"), "{talk}");
}
