//! Pictures with annotations: golden ones, the same bytes from every desk, and names apart from those without.
//!
//! `BLESS=1` rewrites what changed, for a new version of the drawing (`ANNOTATION_VERSION`).

use std::path::{Path, PathBuf};

use contract::annotation::{ANNOTATION_VERSION, AnnotationWishes};
use contract::camera::CameraAngles;
use contract::digest::Digest;
use contract::job::{Mode, RenderJob, View};
use contract::manifest::Manifest;
use contract::picture::{PictureOptions, PictureRequest, PictureSources};
use render::Backend;
use render_worker::annotation::{self, Lifted};
use storage::Store;

use crate::here::Here;
use crate::stored::two_months;

/// Largest golden file.
const MOST_BYTES: u64 = 256 << 10;
/// Largest difference of a channel from the golden picture, and share of pixels that differ by more than one: the maths
/// libraries of other systems.
const MOST_DIFF: u8 = 6;
const DIFF_PIXELS_PER_MILLE: usize = 5;

/// Columns of a height bar.
const LIFTED: Lifted = Lifted {
    up_kg_m2: 0.045,
    down_kg_m2: 0.062,
};

fn golden(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    folder.join(name)
}

#[expect(clippy::disallowed_methods, reason = "a test's own switch")]
fn blesses() -> bool {
    std::env::var("BLESS").is_ok_and(|value| !value.is_empty() && value != "0")
}

fn job(flux: &Manifest, carbon: &Manifest, mode: Mode, wishes: AnnotationWishes) -> RenderJob {
    let sources = PictureSources {
        accumulated: Some(carbon),
        ..PictureSources::of(flux)
    };
    let request = PictureRequest {
        mode,
        view: View::Globe {
            lon_deg: -150.0,
            lat_deg: -8.0,
            height_m: 4.5e6,
            width_px: 720,
            height_px: 405,
            angles: CameraAngles {
                heading_deg: 35.0,
                tilt_deg: 30.0,
                ..CameraAngles::NADIR
            },
        },
        time: "2000-02-05".parse().ok(),
        options: PictureOptions {
            globe_surface: true,
            annotations: wishes,
            ..PictureOptions::default()
        },
    };
    request.job(&sources).unwrap()
}

async fn products() -> (Store, Manifest, Manifest) {
    let store = Store::memory();
    let (mut flux, carbon) = two_months(&store).await;
    "Made-up flux".clone_into(&mut flux.title);
    let source = "Somebody & somebody else (2000), <Journal> 1, 1-2";
    source.clone_into(&mut flux.source);
    (store, flux, carbon)
}

fn decoded(png: &[u8]) -> image::RgbaImage {
    image::load_from_memory_with_format(png, image::ImageFormat::Png)
        .unwrap()
        .into_rgba8()
}

#[tokio::test]
async fn an_annotated_picture_is_as_it_was_and_the_same_from_every_desk() {
    let (store, flux, carbon) = products().await;
    let job = job(&flux, &carbon, Mode::Volume, AnnotationWishes::all());
    let first = Here::new(store.clone(), Backend::Cpu);
    let png = first.draw(&job).await.unwrap();
    let second = Here::new(store, Backend::Cpu);
    assert_eq!(second.draw(&job).await.unwrap(), png);
    let path = golden("annotated.png");
    if blesses() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, &png).unwrap();
    }
    let then = std::fs::read(&path).unwrap();
    assert!(then.len() as u64 <= MOST_BYTES, "{} bytes", then.len());
    let (now, then) = (decoded(&png), decoded(&then));
    assert_eq!(now.dimensions(), then.dimensions());
    let pairs = now.pixels().zip(then.pixels());
    let differ = |(a, b): (&image::Rgba<u8>, &image::Rgba<u8>)| {
        let channels = a.0.iter().zip(b.0);
        channels.map(|(a, b)| a.abs_diff(b)).max().unwrap()
    };
    let differences: Vec<u8> = pairs.map(differ).collect();
    let largest = differences.iter().max().unwrap();
    let count = differences
        .iter()
        .filter(|difference| **difference > 1)
        .count();
    assert!(
        *largest <= MOST_DIFF && count * 1000 <= DIFF_PIXELS_PER_MILLE * differences.len(),
        "{count} pixels differ, by up to {largest}: look at it, and bless it"
    );
}

/// The names of annotated pictures say which version drew them: another drawing under the same version would be taken for
/// the one that is stored.
#[tokio::test]
async fn another_drawing_is_another_version() {
    let (_store, flux, carbon) = products().await;
    let drawings: Vec<String> = Mode::SCALAR
        .into_iter()
        .filter_map(|mode| {
            let job = job(&flux, &carbon, mode, AnnotationWishes::all());
            annotation::drawing(&job, &LIFTED).unwrap()
        })
        .collect();
    assert_eq!(drawings.len(), Mode::SCALAR.len());
    let now = format!(
        "{ANNOTATION_VERSION} {}\n",
        Digest::of(drawings.concat().as_bytes())
    );
    let path = golden("annotations.txt");
    let then = std::fs::read_to_string(&path).unwrap_or_default();
    let is_new = !then.starts_with(&format!("{ANNOTATION_VERSION} "));
    if blesses() && is_new {
        std::fs::write(&path, &now).unwrap();
        return;
    }
    assert_eq!(
        now, then,
        "annotations are drawn differently: raise ANNOTATION_VERSION, then BLESS=1"
    );
}

#[tokio::test]
async fn pictures_without_annotations_are_drawn_as_before() {
    let (store, flux, carbon) = products().await;
    let plain = job(&flux, &carbon, Mode::Map, AnnotationWishes::default());
    let here = Here::new(store, Backend::Cpu);
    let scene = here.scene(&plain).await.unwrap();
    let bare = here.renderer().render(&plain, &scene).unwrap();
    let png = here.draw(&plain).await.unwrap();
    assert_eq!(png, bare.encode_png().unwrap());
    let dated = job(&flux, &carbon, Mode::Map, "date".parse().unwrap());
    assert_ne!(dated.key(), plain.key());
    assert_ne!(here.draw(&dated).await.unwrap(), png);
}
