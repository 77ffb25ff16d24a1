//! What any object store must do, whichever it is.

use bytes::Bytes;
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use futures::{StreamExt as _, TryStreamExt as _, stream};
use object_store::ObjectStoreExt as _;
use object_store::path::Path;
use storage::{StorageError, Store, domain, fields, manifests, weights};

fn key(text: &str) -> ObjectKey {
    text.parse().unwrap()
}

async fn put(store: &Store, name: &str) {
    store
        .put_new(&key(name), Bytes::from(name.to_owned()))
        .await
        .unwrap();
}

/// Bytes that no compression shortens, the same for the same seed.
pub(crate) fn noise(len: usize, seed: u64) -> Bytes {
    let mut state = seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1;
    let mut content = Vec::with_capacity(len + 8);
    while content.len() < len {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        content.extend_from_slice(&state.to_le_bytes());
    }
    content.truncate(len);
    Bytes::from(content)
}

pub(crate) async fn one_of_many_writers_creates_an_object(store: &Store) {
    let key = key("race/object");
    let content = |writer: usize| Bytes::from(format!("writer {writer:02}"));
    let write = |writer| {
        let (store, key) = (store.clone(), key.clone());
        tokio::spawn(async move { store.put_new(&key, content(writer)).await })
    };
    let writers: Vec<_> = (0..32).map(write).collect();
    let mut winners = vec![];
    for (writer, ended) in writers.into_iter().enumerate() {
        match ended.await.unwrap() {
            Ok(true) => winners.push(writer),
            Err(StorageError::Conflict { .. }) => {}
            other => panic!("writer {writer}: {other:?}"),
        }
    }
    assert_eq!(winners.len(), 1, "{winners:?}");
    assert_eq!(store.get(&key).await.unwrap(), content(winners[0]));
}

/// Each writer adds one to a number, over and over: one that replaced what it had not seen would take one away.
pub(crate) async fn no_exchange_of_many_writers_is_lost(store: &Store) {
    const WRITERS: u32 = 4;
    const EACH: u32 = 8;
    let key = key("exchange/repo");
    let created = store.swap(&key, None, Bytes::from("0")).await.unwrap();
    assert!(created.is_some());
    assert_eq!(
        store.swap(&key, None, Bytes::from("1")).await.unwrap(),
        None
    );
    let number = |content: &[u8]| -> u32 {
        let text = std::str::from_utf8(content).unwrap();
        text.split(' ').next().unwrap().parse().unwrap()
    };
    let write = |writer| {
        let (store, key) = (store.clone(), key.clone());
        tokio::spawn(async move {
            for time in 0..EACH {
                loop {
                    let (content, seen) = store.read_changing(&key).await.unwrap().unwrap();
                    let next = format!("{} by {writer}, {time}", number(&content) + 1);
                    let swapped = store.swap(&key, Some(&seen), next.into()).await;
                    if swapped.unwrap().is_some() {
                        break;
                    }
                }
            }
        })
    };
    let writers: Vec<_> = (0..WRITERS).map(write).collect();
    for writer in writers {
        writer.await.unwrap();
    }
    let (content, _) = store.read_changing(&key).await.unwrap().unwrap();
    assert_eq!(number(&content), WRITERS * EACH);
    let late = store
        .swap(&key, created.as_ref(), Bytes::from("late"))
        .await;
    assert_eq!(late.unwrap(), None);
}

pub(crate) async fn writers_of_equal_content_agree(store: &Store) {
    let key = key("race/equal");
    let content = noise(100_000, 1);
    let write = |_writer| {
        let (store, key, content) = (store.clone(), key.clone(), content.clone());
        tokio::spawn(async move { store.put_new(&key, content).await.unwrap() })
    };
    let writers: Vec<_> = (0..32).map(write).collect();
    let mut wrote = 0;
    for writer in writers {
        wrote += u32::from(writer.await.unwrap());
    }
    assert_eq!(wrote, 1);
    assert_eq!(store.get(&key).await.unwrap(), content);
}

const GRID: Grid = Grid {
    rows: 70,
    cols: 130,
    north_deg: 35.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

fn manifest(product: &ProductId, number: u64, title: &str) -> Manifest {
    Manifest {
        schema: MANIFEST_SCHEMA,
        product: product.clone(),
        number,
        title: title.to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: false,
        source: String::new(),
        grid: GRID,
        steps: vec![],
        domain: ObjectKey::domain(product, &Digest::of(b"")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
    }
}

pub(crate) async fn two_writers_race_for_one_manifest_number(store: &Store) {
    let product: ProductId = "p".parse().unwrap();
    for number in 1..=8 {
        let (mine, yours) = (
            manifest(&product, number, "mine"),
            manifest(&product, number, "yours"),
        );
        let both = tokio::join!(
            manifests::commit(store, &mine),
            manifests::commit(store, &yours)
        );
        let (name, winner) = match both {
            (Ok(name), Err(StorageError::Conflict { .. })) => (name, mine),
            (Err(StorageError::Conflict { .. }), Ok(name)) => (name, yours),
            other => panic!("number {number}: {other:?}"),
        };
        assert_eq!(name, winner.id());
        let latest = manifests::latest(store, &product).await.unwrap();
        assert_eq!(latest.as_ref(), Some(&winner));
        assert_eq!(manifests::load(store, &winner.id()).await.unwrap(), winner);
    }
    assert_eq!(manifests::products(store).await.unwrap(), [product]);
}

pub(crate) async fn a_listing_of_2500_keys_is_whole_and_sorted(store: &Store) {
    let names: Vec<String> = (0..2500)
        .map(|i| format!("many/{}/{i:04}", i % 7))
        .collect();
    stream::iter(&names)
        .map(|name| put(store, name))
        .buffer_unordered(32)
        .collect::<Vec<()>>()
        .await;
    for beside in ["many2/x", "man/x", "many.x"] {
        put(store, beside).await;
    }
    let mut expected = names;
    expected.sort();
    let listed = store.list("many").await.unwrap();
    let listed: Vec<&str> = listed.iter().map(ObjectKey::as_str).collect();
    assert!(listed == expected, "{} keys came", listed.len());
    let third = store.list("many/3").await.unwrap();
    assert_eq!(third.len(), 357);
    let folders = store.folders("many").await.unwrap();
    assert_eq!(folders, ["0", "1", "2", "3", "4", "5", "6"]);
    assert_eq!(store.folders("").await.unwrap(), ["man", "many", "many2"]);
    assert!(store.list("nothing").await.unwrap().is_empty());
    assert!(store.folders("nothing").await.unwrap().is_empty());
    assert_eq!(store.list("").await.unwrap().len(), 2503);
}

pub(crate) async fn parts_of_an_object_are_read(store: &Store) {
    let key = key("parts/object");
    let content = noise(1_000_000, 2);
    store.put_new(&key, content.clone()).await.unwrap();
    for (start, end) in [
        (0, 1),
        (999_999, 1_000_000),
        (0, 1_000_000),
        (65_535, 131_073),
        (7, 7),
    ] {
        let part = store.get_range(&key, start as u64..end as u64).await;
        assert_eq!(part.unwrap(), content[start..end], "{start}..{end}");
    }
    let beyond = store.get_range(&key, 999_999..1_000_001).await.unwrap_err();
    assert!(matches!(beyond, StorageError::Damaged { .. }), "{beyond}");
    assert_eq!(store.size_bytes(&key).await.unwrap(), 1_000_000);
    let missing = store.get_range(&"parts/none".parse().unwrap(), 0..1).await;
    assert!(missing.unwrap_err().is_not_found());
}

pub(crate) async fn large_objects_come_back_as_they_went(store: &Store) {
    let content = noise(200 << 20, 3);
    let by_content = ObjectKey::raw(&"p".parse().unwrap(), &Digest::of(&content));
    for key in [by_content, key("weights/by-name.parquet")] {
        assert!(store.put_new(&key, content.clone()).await.unwrap());
        assert!(!store.put_new(&key, content.clone()).await.unwrap());
        assert!(store.get(&key).await.unwrap() == content);
        let part = store.get_range(&key, (150 << 20)..(151 << 20)).await;
        assert!(part.unwrap() == content.slice((150 << 20)..(151 << 20)));
    }
    let mut other = content.to_vec();
    other[199 << 20] ^= 1;
    let taken = store
        .put_new(&key("weights/by-name.parquet"), Bytes::from(other))
        .await;
    assert!(matches!(taken, Err(StorageError::Conflict { .. })));
}

pub(crate) async fn every_allowed_sign_may_stand_in_a_key(store: &Store) {
    let longest = format!("long/{}", vec!["d".repeat(100); 5].join("/"));
    let names = [
        "ABCDEFGHIJKLMNOPQRSTUVWXYZ/abcdefghijklmnopqrstuvwxyz/0123456789._-",
        ".hidden",
        "-dash/_under/.dot/..two/three...",
        "one",
        &longest,
    ];
    for name in names {
        put(store, name).await;
    }
    for name in names {
        assert_eq!(store.get(&key(name)).await.unwrap(), name);
        assert!(store.exists(&key(name)).await.unwrap());
    }
    let mut expected = names.to_vec();
    expected.sort_unstable();
    let listed = store.list("").await.unwrap();
    let listed: Vec<&str> = listed.iter().map(ObjectKey::as_str).collect();
    assert_eq!(listed, expected);
}

pub(crate) async fn an_object_may_be_empty(store: &Store) {
    let key = key("empty/object");
    assert!(store.put_new(&key, Bytes::new()).await.unwrap());
    assert!(!store.put_new(&key, Bytes::new()).await.unwrap());
    assert!(store.get(&key).await.unwrap().is_empty());
    assert_eq!(store.size_bytes(&key).await.unwrap(), 0);
    let other = store.put_new(&key, Bytes::from("x")).await;
    assert!(matches!(other, Err(StorageError::Conflict { .. })));
}

pub(crate) async fn grids_and_manifests_round_trip(store: &Store) {
    let product: ProductId = "p".parse().unwrap();
    let value = |i: usize| {
        if i.is_multiple_of(7) {
            f32::NAN
        } else {
            i as f32
        }
    };
    let values: Vec<f32> = (0..GRID.cell_count()).map(value).collect();
    let period = Period::month(2000, 1).unwrap();
    let field = fields::write(store, &product, &GRID, &values, period)
        .await
        .unwrap();
    let back = fields::read(store, &field, &GRID).await.unwrap();
    let bits = |values: &[f32]| values.iter().map(|it| it.to_bits()).collect::<Vec<_>>();
    assert!(bits(&back) == bits(&values), "{} values", back.len());
    let areas = vec![(3, vec![0.1, 0.0, 1e12]), (7, vec![2.0 / 3.0])];
    let weights_key = ObjectKey::weights(&Digest::of(b"job"));
    weights::write(store, &weights_key, &areas).await.unwrap();
    assert_eq!(weights::read(store, &weights_key).await.unwrap(), areas);
    let cells: Vec<bool> = values.iter().map(|v| v.is_nan()).collect();
    let domain_key = domain::write(store, &product, &cells).await.unwrap();
    assert_eq!(domain::read(store, &domain_key).await.unwrap(), cells);
    // Written a second time, everything is found to be there.
    let again = fields::write(store, &product, &GRID, &values, period).await;
    assert_eq!(again.unwrap(), field);
    for number in 1..=11 {
        let next = manifest(&product, number, "t");
        manifests::commit(store, &next).await.unwrap();
        manifests::commit(store, &next).await.unwrap();
    }
    let newest = manifests::latest(store, &product).await.unwrap().unwrap();
    assert_eq!(newest, manifest(&product, 11, "t"));
    let old = manifest(&product, 2, "t");
    assert_eq!(manifests::load(store, &old.id()).await.unwrap(), old);
}

pub(crate) async fn a_removed_object_is_gone_with_its_folder(store: &Store) {
    for name in ["gone/a/1", "gone/a/2", "gone/b/1"] {
        put(store, name).await;
    }
    store.remove(&key("gone/a/1")).await.unwrap();
    assert_eq!(store.folders("gone").await.unwrap(), ["a", "b"]);
    store.remove(&key("gone/a/2")).await.unwrap();
    store.remove(&key("gone/a/2")).await.unwrap();
    let missing = store.get(&key("gone/a/2")).await.unwrap_err();
    assert!(missing.is_not_found(), "{missing}");
    assert!(!store.exists(&key("gone/a/2")).await.unwrap());
    assert_eq!(store.folders("gone").await.unwrap(), ["b"]);
    let listed = store.list("gone").await.unwrap();
    assert_eq!(listed, [key("gone/b/1")]);
    // The name is free again, also while its folder comes and goes.
    let writers = (0..40).map(|i| async move {
        let name = key(&format!("gone/c/{i}"));
        store.put_new(&name, Bytes::from("x")).await.unwrap();
        store.remove(&name).await.unwrap();
    });
    stream::iter(writers)
        .buffer_unordered(8)
        .collect::<Vec<()>>()
        .await;
    put(store, "gone/a/2").await;
}

pub(crate) async fn a_probe_finds_the_store_usable_and_leaves_nothing(store: &Store) {
    store.check_writable().await.unwrap();
    assert!(store.list("").await.unwrap().is_empty());
    assert!(store.folders("").await.unwrap().is_empty());
}

pub(crate) async fn scans_find_objects_by_address(store: &Store) {
    put(store, "scan/a.parquet").await;
    put(store, "scan/b.parquet").await;
    let (root_url, root) = store.sql_root();
    let url = store.sql_url(&key("scan/a.parquet"));
    assert!(url.as_str().starts_with(root_url.as_str()), "{url}");
    let path = Path::from_url_path(url.path()).unwrap();
    let found = root.get(&path).await.unwrap();
    assert_eq!(found.meta.location, path);
    assert_eq!(found.bytes().await.unwrap(), "scan/a.parquet");
    let ranges = root.get_ranges(&path, &[0..4, 5..14]).await.unwrap();
    assert_eq!(ranges, ["scan", "a.parquet"]);
    let folder = store.sql_url(&key("scan"));
    let folder = Path::from_url_path(folder.path()).unwrap();
    let listed: Vec<_> = root.list(Some(&folder)).try_collect().await.unwrap();
    assert_eq!(listed.len(), 2);
}
