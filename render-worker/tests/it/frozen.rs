//! Pictures as earlier versions stored them (`storage/tests/frozen`), and a store of all kinds of objects with a flipped bit
//! in each.

use std::collections::BTreeSet;

use contract::colour::TransferFunction;
use contract::job::{Mode, RENDERER_VERSION, RenderJob, Style};
use contract::kind::Kind;
use contract::manifest::Manifest;
use render::Backend;
use render_worker::desk::{Order, Origin};
use storage::sound::damage;
use storage::{Store, manifests, verify};
use test_data::frozen;

use crate::here::Here;
use crate::scenes::{globe, tile};
use crate::worker::{USUAL, Worker};

/// The renderer that drew the picture. Another one gives it another name; a store keeps it until it is cleaned.
const RENDERER: u32 = 5;

fn store(version: u32) -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    frozen::copy(version, "objects", folder.path());
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

async fn newest(store: &Store, product: &str) -> Manifest {
    let latest = manifests::latest(store, &product.parse().unwrap()).await;
    latest.unwrap().unwrap()
}

/// A map of the frozen flux half a month after its first one.
async fn job(store: &Store) -> RenderJob {
    let flux = newest(store, "fgco2").await;
    let style = Style::with_transfer(TransferFunction::default_for(flux.quantity));
    let time = "2001-02-01".parse().unwrap();
    RenderJob::of(&flux, None, time, Mode::Map, tile(1, 1, 0, 256), style).unwrap()
}

#[tokio::test]
async fn a_frozen_picture_is_found_under_the_name_of_its_job() {
    if let Some(folder) = frozen::to_freeze() {
        let store = Store::open(folder.join("objects").to_str().unwrap()).unwrap();
        let worker = Worker::start(&store, 1, 4);
        let job = job(&store).await;
        worker
            .desk
            .draw(&job, Order::on_demand(USUAL))
            .await
            .unwrap();
    }
    let (_folder, kept) = store(2);
    let of_now = job(&kept).await;
    let of_then = RenderJob {
        renderer_version: RENDERER,
        ..of_now.clone()
    };
    assert_eq!(kept.list("tiles").await.unwrap(), [of_then.key()]);
    let png = kept.get(&of_then.key()).await.unwrap();
    let picture = image::load_from_memory_with_format(&png, image::ImageFormat::Png);
    let picture = picture.unwrap().into_rgba8();
    assert_eq!(picture.dimensions(), (256, 256));
    // The product lies in the west of the tile, north of the equator; nothing is drawn elsewhere.
    let is_drawn = |x, y| picture.get_pixel(x, y).0[3] > 0;
    assert!(is_drawn(10, 240) && !is_drawn(100, 240) && !is_drawn(10, 20));
    if RENDERER_VERSION == RENDERER {
        let worker = Worker::start(&kept, 1, 4);
        let found = worker
            .desk
            .draw(&of_now, Order::on_demand(USUAL))
            .await
            .unwrap();
        assert!(found.origin == Origin::Stored && found.bytes == png);
    }
    let (_folder, old) = store(1);
    for key in old.list("tiles").await.unwrap() {
        let png = old.get(&key).await.unwrap();
        let format = image::ImageFormat::Png;
        image::load_from_memory_with_format(&png, format).unwrap();
    }
}

/// Small pictures of all that there is to draw: a flux lifted by what it adds up to, and those sums with their gaps.
async fn pictures(store: &Store) -> Result<Vec<Vec<u8>>, String> {
    let mut drawn = vec![];
    // One that has nothing in memory.
    let service = Here::new(store.clone(), Backend::Cpu);
    let latest = async |product: &str| {
        let latest = manifests::latest(store, &product.parse().unwrap()).await;
        latest.map(Option::unwrap).map_err(|e| e.to_string())
    };
    let (flux, carbon) = (latest("fgco2").await?, latest("fgco2-accumulated").await?);
    for (product, accumulated, mode) in [
        (&flux, Some(&carbon), Mode::Points),
        (&carbon, None, Mode::Map),
    ] {
        let mut style = Style::with_transfer(TransferFunction::default_for(product.quantity));
        (style.slices, style.particles_per_cell, style.uncertainty) = (1, 1, true);
        let (time, view) = ("2001-02-01".parse().unwrap(), globe(10.0, 30.0, 2e7, 64));
        let job = RenderJob::of(product, accumulated, time, mode, view, style).unwrap();
        let picture = service.draw(&job).await.map_err(|e| e.in_full())?;
        drawn.push(picture.to_vec());
    }
    Ok(drawn)
}

#[tokio::test]
async fn a_flipped_bit_of_any_object_of_a_store_is_no_other_picture() {
    let (_folder, whole) = store(2);
    let right = pictures(&whole).await.unwrap();
    let mut refused = BTreeSet::new();
    for key in verify::keys(&whole, None).await.unwrap() {
        let kind = Kind::of(&key).unwrap();
        let (_folder, store) = store(2);
        let mut flipped = store.get(&key).await.unwrap().to_vec();
        let at = flipped.len() * 3 / 8;
        flipped[at] ^= 1 << (at % 8);
        store.put_over(&key, flipped.into()).await.unwrap();
        let before = damage::count(kind);
        match pictures(&store).await {
            Ok(now) => assert!(now == right, "{key}: another picture"),
            Err(error) => {
                assert!(error.contains(key.as_str()), "{key}: {error}");
                assert!(damage::count(kind) > before, "{key} is not counted");
                refused.insert(kind);
            }
        }
    }
    let needed = [Kind::Field, Kind::Contributed, Kind::Domain, Kind::Manifest];
    assert_eq!(refused, needed.into(), "what is not drawn tests nothing");
}
