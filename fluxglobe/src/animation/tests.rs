//! Animations without a store: instants, folders that go on, strips that hold what was drawn, encoders that fail.

use std::path::Path;

use contract::annotation::AnnotationWishes;
use contract::colour::TransferFunction;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::job::{Mode, Style, View};
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};
use render::Image;
use storage::{Store, manifests};

use super::encoder::{self, Container, Encoder};
use super::folder::Folder;
use super::shots::Shots;
use super::strip::Strip;
use crate::picture;

/// The twelve months of 2000 on a grid of one cell.
fn product() -> Manifest {
    let product: ProductId = "made-up".parse().unwrap();
    let step = |month| Step {
        masked: None,
        period: Period::month(2000, month).unwrap(),
        field: ObjectKey::field(&product, &Digest::of(&[month as u8])),
        raw_sha256: Digest::of(b"file"),
        origin: "file.nc".into(),
        valid_cells: 1,
        contributed: None,
    };
    Manifest {
        schema: MANIFEST_SCHEMA,
        number: 1,
        title: String::new(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: String::new(),
        grid: Grid {
            rows: 1,
            cols: 1,
            north_deg: 1.0,
            west_deg: 0.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        },
        steps: (1..=12).map(step).collect(),
        domain: ObjectKey::domain(&product, &Digest::of(b"domain")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
        product,
    }
}

fn shots(count: u32) -> Shots {
    let view = View::Globe {
        lon_deg: 170.0,
        lat_deg: 0.0,
        height_m: 1e7,
        width_px: 6,
        height_px: 4,
        angles: contract::camera::CameraAngles::NADIR,
    };
    Shots {
        product: product(),
        accumulated: None,
        accumulated_until: None,
        northward: None,
        vector: None,
        from: "2000-01-01".parse().unwrap(),
        mode: Mode::Volume,
        view,
        style: Style::with_transfer(TransferFunction::default_for(Quantity::CarbonFlux)),
        sun_of_time: false,
        annotations: AnnotationWishes::default(),
        relief: None,
        to: "2001-01-01".parse().unwrap(),
        fps: 25,
        count,
        turn_deg: 40.0,
        path: None,
    }
}

/// A picture of its own for every number.
fn picture(number: u32) -> Image {
    Image {
        width: 6,
        height: 4,
        rgba8: (0..6 * 4 * 4)
            .map(|i| (i * 7 + number * 31) as u8)
            .collect(),
    }
}

#[test]
fn instants_divide_the_span_and_a_whole_turn_closes_to_a_ring() {
    let shots = shots(366);
    let job = |number| shots.job(number).unwrap();
    let time = |number| shots.time(number).unwrap().to_string();
    assert_eq!(time(0), "2000-01-01T00:00:00Z");
    // 2000 has 366 days: a picture a day, and the last one is not the first of the next year.
    assert_eq!(time(31), "2000-02-01T00:00:00Z");
    assert_eq!(time(365), "2000-12-31T00:00:00Z");
    let lon = |number: u32| match job(number).view {
        View::Globe { lon_deg, .. } => lon_deg,
        View::Tile { .. } => panic!("a globe view"),
    };
    assert!((lon(0) - 170.0).abs() < 1e-9);
    // Past the date line: 170 + 40 * 183 / 366.
    assert!((lon(183) - -170.0).abs() < 1e-9, "{}", lon(183));
    assert_ne!(job(1).digest(), job(2).digest());
}

#[test]
fn every_picture_has_the_sun_of_its_own_instant_if_that_is_asked_for() {
    let sun_of = |shots: &Shots, number| shots.job(number).unwrap().style.sun.subsolar;
    let mut shots = shots(366);
    assert_eq!(sun_of(&shots, 7), None);
    shots.sun_of_time = true;
    // Midnight in Greenwich in January and in July: the sun over the date line, in the south and in the north.
    let [january, july] = [0, 182].map(|number| sun_of(&shots, number).unwrap());
    assert!(january.lon_deg.abs() > 175.0 && july.lon_deg.abs() > 175.0);
    assert!(january.lat_deg < -22.0 && july.lat_deg > 22.0);
}

#[test]
fn every_picture_has_the_date_of_its_own_instant() {
    let mut shots = shots(366);
    assert_eq!(shots.job(3).unwrap().annotations, None);
    shots.annotations = "date,graticule".parse().unwrap();
    let date_of = |number| {
        let annotations = shots.job(number).unwrap().annotations.unwrap();
        String::from(annotations.date.unwrap().shown)
    };
    assert_eq!(date_of(0), "1 January 2000");
    assert_eq!(date_of(182), "1 July 2000");
    assert_eq!(date_of(365), "31 December 2000");
    // What is read back from beside a folder of pictures goes on with the same.
    let text = serde_json::to_string(&shots).unwrap();
    let back: Shots = serde_json::from_str(&text).unwrap();
    assert_eq!(back, shots);
    shots.annotations = "height".parse().unwrap();
    let refused = shots.validate().unwrap_err().to_string();
    assert!(refused.contains("leave it out"), "{refused}");
}

#[test]
fn the_pictures_of_a_flow_drift_from_one_to_the_next() {
    let part = |name: &str| Manifest {
        product: name.parse().unwrap(),
        quantity: Quantity::Current,
        ..product()
    };
    let mut shots = Shots {
        product: part("sea-east"),
        northward: Some(part("sea-north")),
        mode: Mode::Flow,
        ..shots(366)
    };
    let clock_s = |number| shots.job(number).unwrap().flow.unwrap().clock_s;
    // A picture a day.
    assert!((clock_s(31) - clock_s(30) - 86_400.0).abs() < 1e-3);
    shots.northward = None;
    let refused = shots.job(0).unwrap_err().to_string();
    assert!(refused.contains("northward"), "{refused}");
}

#[tokio::test]
async fn what_was_added_up_from_a_version_before_lifts_what_is_equal_in_both() {
    let store = Store::memory();
    let now = Manifest {
        number: 2,
        ..product()
    };
    let before = Manifest {
        steps: now.steps[..6].to_vec(),
        ..product()
    };
    let derived = Manifest {
        product: before.product.accumulated().unwrap(),
        quantity: Quantity::AccumulatedCarbon,
        derived_from: Some(before.id()),
        ..before.clone()
    };
    for manifest in [&before, &now, &derived] {
        manifests::commit(&store, manifest).await.unwrap();
    }
    let until: TimeMs = "2000-07-01".parse().unwrap();
    let lift = async |of: &Manifest, mode| picture::lift(&store, of, mode, until).await.unwrap();
    assert_eq!(lift(&before, Mode::Volume).await.unwrap().until, None);
    assert_eq!(lift(&now, Mode::Map).await, None);
    let found = lift(&now, Mode::Volume).await.unwrap();
    assert_eq!(found.until, Some(until));
    // A picture a day.
    let shots = Shots {
        product: now.clone(),
        accumulated: Some(found.manifest),
        accumulated_until: found.until,
        ..shots(366)
    };
    let is_lifted = |number| shots.job(number).unwrap().accumulated.is_some();
    assert!(is_lifted(0) && is_lifted(182) && !is_lifted(183));
}

#[test]
fn too_many_pictures_and_too_many_pixels_are_refused() {
    assert_eq!(Shots::count_of(2.0, 25).unwrap(), 50);
    for (seconds, fps) in [
        (0.0, 25),
        (f64::NAN, 25),
        (-1.0, 25),
        (1e9, 25),
        (601.0, 60),
    ] {
        assert!(Shots::count_of(seconds, fps).is_err(), "{seconds} {fps}");
    }
    let mut many = shots(36_000);
    many.validate().unwrap();
    if let View::Globe {
        width_px,
        height_px,
        ..
    } = &mut many.view
    {
        (*width_px, *height_px) = (4096, 4096);
    }
    let refused = many.validate().unwrap_err().to_string();
    assert!(refused.contains("fewer or smaller"), "{refused}");
    let mut spinning = shots(2);
    spinning.turn_deg = f64::INFINITY;
    assert!(spinning.validate().is_err());
}

#[test]
fn a_folder_goes_on_where_it_was_left_and_takes_no_other_animation() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("film");
    let folder = Folder::open(&path, &shots(4)).unwrap();
    assert_eq!(folder.missing().unwrap(), [0, 1, 2, 3]);
    folder.add(0, b"first").unwrap();
    folder.add(2, b"third").unwrap();
    // What was being written when the power went is no picture.
    std::fs::write(path.join(".picture-00001.png.part"), b"hal").unwrap();
    let again = Folder::open(&path, &shots(4)).unwrap();
    assert_eq!(again.missing().unwrap(), [1, 3]);
    let refused = Folder::open(&path, &shots(5)).err().unwrap().to_string();
    assert!(refused.contains("another animation"), "{refused}");
}

#[test]
fn an_animated_png_holds_every_picture_to_the_byte() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("film.png");
    let write = || {
        let mut strip = Strip::open(&path, &shots(3)).unwrap();
        for number in 0..3 {
            strip.add(&picture(number).encode_png().unwrap()).unwrap();
        }
        strip.finish().unwrap();
        std::fs::read(&path).unwrap()
    };
    let bytes = write();
    assert_eq!(bytes, write(), "the same animation is the same bytes");
    let mut reader = png::Decoder::new(std::io::Cursor::new(&bytes))
        .read_info()
        .unwrap();
    let control = reader.info().animation_control.unwrap();
    assert_eq!((control.num_frames, control.num_plays), (3, 0));
    for number in 0..3 {
        let mut pixels = vec![0; 6 * 4 * 4];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, picture(number).rgba8, "picture {number}");
        let frame = reader.info().frame_control.unwrap();
        assert_eq!((frame.delay_num, frame.delay_den), (1, 25));
    }
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 1);
}

#[test]
fn a_picture_of_another_size_does_not_get_into_a_strip() {
    let place = tempfile::tempdir().unwrap();
    let path = place.path().join("film.png");
    let mut strip = Strip::open(&path, &shots(2)).unwrap();
    let mut other = picture(0);
    (other.width, other.height) = (4, 6);
    assert!(strip.add(&other.encode_png().unwrap()).is_err());
    assert!(strip.add(b"no picture").is_err());
    strip.abandon();
    assert_eq!(std::fs::read_dir(place.path()).unwrap().count(), 0);
}

#[test]
fn an_encoder_that_is_not_there_is_asked_for_by_name() {
    let place = tempfile::tempdir().unwrap();
    let output = place.path().join("film.mp4");
    let missing = Path::new("no-such-encoder");
    let error = Encoder::start(missing, Container::Mp4, &output, &shots(2));
    let text = error.err().unwrap().to_string();
    assert!(
        text.contains("install ffmpeg") && text.contains("FILE.png"),
        "{text}"
    );
    let early = encoder::check(missing, Container::Mp4).unwrap_err();
    assert_eq!(early.to_string(), text);
}

#[test]
fn an_encoder_that_cannot_write_the_kind_of_film_is_told_of_before_anything_is_drawn() {
    let place = tempfile::tempdir().unwrap();
    let program = place.path().join("encoder");
    let lists = "#!/bin/sh\n[ \"$4\" = -encoders ] && echo ' V....D libvpx-vp9 VP9'\n";
    script(&program, lists);
    encoder::check(&program, Container::Webm).unwrap();
    let refused = encoder::check(&program, Container::Mp4).unwrap_err();
    let text = refused.to_string();
    assert!(
        text.contains("no encoder libx264") && text.contains("FILE.png"),
        "{text}"
    );
}

#[tokio::test]
async fn what_an_encoder_complains_of_is_said_and_no_file_is_left() {
    let place = tempfile::tempdir().unwrap();
    let program = place.path().join("encoder");
    script(
        &program,
        "#!/bin/sh\ncat > /dev/null\necho broken pipe organ >&2\nexit 3\n",
    );
    let output = place.path().join("film.webm");
    let mut encoder = Encoder::start(&program, Container::Webm, &output, &shots(2)).unwrap();
    encoder
        .add(&picture(0).encode_png().unwrap())
        .await
        .unwrap();
    let text = encoder.finish().await.unwrap_err().to_string();
    assert!(
        text.contains("broken pipe organ") && text.contains('3'),
        "{text}"
    );
    assert!(!output.exists());
}

/// A program that a shell runs. A shell writes it too: were it open here for writing while another test starts a process,
/// that process would hold it open and nobody could run it.
fn script(program: &Path, text: &str) {
    let written = std::process::Command::new("sh")
        .args(["-c", "printf %s \"$2\" >\"$1\" && chmod +x \"$1\"", "sh"])
        .arg(program)
        .arg(text)
        .status()
        .unwrap();
    assert!(written.success());
}

#[test]
fn kinds_of_films_are_told_by_their_names() {
    assert_eq!(Container::named("mp4"), Some(Container::Mp4));
    assert_eq!(Container::named("webp"), Some(Container::Webp));
    assert_eq!(Container::named("exe"), None);
}
