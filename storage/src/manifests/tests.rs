use super::*;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};

pub(super) fn manifest(number: u64, title: &str) -> Manifest {
    let product: ProductId = "p".parse().unwrap();
    Manifest {
        schema: MANIFEST_SCHEMA,
        number,
        title: title.to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: false,
        source: String::new(),
        grid: Grid {
            rows: 1,
            cols: 1,
            north_deg: 1.0,
            west_deg: 0.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        },
        steps: vec![],
        domain: ObjectKey::domain(&product, &Digest::of(b"")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
        product,
    }
}

#[tokio::test]
async fn the_newest_number_wins_and_old_ones_stay_readable() {
    let store = Store::memory();
    let product = "p".parse().unwrap();
    assert!(latest(&store, &product).await.unwrap().is_none());
    for number in 1..=11 {
        commit(&store, &manifest(number, "t")).await.unwrap();
    }
    let newest = latest(&store, &product).await.unwrap().unwrap();
    assert_eq!(newest.number, 11);
    let old = manifest(2, "t");
    assert_eq!(load(&store, &old.id()).await.unwrap(), old);
    assert_eq!(products(&store).await.unwrap(), [product]);
}

#[tokio::test]
async fn the_newest_numbers_of_all_products_are_found_in_one_list() {
    let store = Store::memory();
    assert!(newest_numbers(&store).await.unwrap().is_empty());
    for (name, numbers) in [("q", 1..=12), ("p", 3..=3), ("a-b", 9..=10)] {
        for number in numbers {
            let mut own = manifest(number, name);
            own.product = name.parse().unwrap();
            commit(&store, &own).await.unwrap();
        }
    }
    let mut each = BTreeMap::new();
    for product in products(&store).await.unwrap() {
        let newest = latest(&store, &product).await.unwrap().unwrap();
        each.insert(product, newest.number);
    }
    assert_eq!(each.values().copied().collect::<Vec<_>>(), [10, 3, 12]);
    let (counted, traffic) = store.counted();
    assert_eq!(newest_numbers(&counted).await.unwrap(), each);
    let counts = traffic.counts();
    assert_eq!((counts.lists, counts.reads, counts.heads), (1, 0, 0));
}

/// A manifest of so many days.
fn of_days(number: u64, days: usize) -> Manifest {
    let mut manifest = manifest(number, "t");
    let day = |day: usize| TimeMs::new(day as i64 * 86_400_000).unwrap();
    manifest.steps = (0..days)
        .map(|at| Step {
            period: Period::new(day(at), day(at + 1)).unwrap(),
            field: ObjectKey::field(&manifest.product, &Digest::of(&at.to_le_bytes())),
            raw_sha256: Digest::of(b""),
            origin: format!("{at}.nc"),
            valid_cells: 1,
            masked: None,
            contributed: None,
        })
        .collect();
    manifest
}

async fn bytes(store: &Store) -> usize {
    let mut bytes = 0;
    for key in store.list("").await.unwrap() {
        bytes += store.get(&key).await.unwrap().len();
    }
    bytes
}

#[tokio::test]
async fn one_more_step_writes_no_page_again_and_all_versions_stay_readable() {
    let store = Store::memory();
    let product = "p".parse().unwrap();
    // Three more than end the ninth page.
    let days = 533;
    commit(&store, &of_days(1, days)).await.unwrap();
    let before = bytes(&store).await;
    commit(&store, &of_days(2, days + 1)).await.unwrap();
    let more = bytes(&store).await - before;
    assert!(more < 4000, "{more} bytes");
    // By one who has seen none of it, and by one who has.
    for store in [store.clone(), copy(&store).await] {
        let newest = latest(&store, &product).await.unwrap().unwrap();
        assert_eq!(newest, of_days(2, days + 1));
        let first = load(&store, &of_days(1, days).id()).await.unwrap();
        assert_eq!(first, of_days(1, days));
    }
    let keys = crate::verify::keys(&store, None).await.unwrap();
    let report = crate::verify::run(&store, &keys, &|_, _| ());
    let pages = report.await.unwrap().findings.into_iter();
    let pages = pages.filter(|it| it.key.as_str().starts_with("manifest-pages"));
    assert_eq!(pages.count(), 0);
    // A page that is gone is told by its name, and looked for by those who verify.
    let page = store.list("manifest-pages").await.unwrap().remove(2);
    store.remove(&page).await.unwrap();
    let other = copy(&store).await;
    let error = latest(&other, &product).await.unwrap_err().to_string();
    assert!(error.contains(page.as_str()), "{error}");
    let keys = crate::verify::keys(&other, None).await.unwrap();
    let report = crate::verify::run(&other, &keys, &|_, _| ()).await.unwrap();
    assert!(report.findings.iter().any(|it| it.key == page));
}

/// The same objects in a store of its own.
async fn copy(store: &Store) -> Store {
    let other = Store::memory();
    for key in store.list("").await.unwrap() {
        let content = store.get(&key).await.unwrap();
        other.put_over(&key, content).await.unwrap();
    }
    other
}

#[tokio::test]
async fn the_newest_is_found_whoever_publishes_or_takes_away() {
    let store = Store::memory();
    let product: ProductId = "p".parse().unwrap();
    let newest = async || latest(&store, &product).await.unwrap().map(|it| it.number);
    assert_eq!(newest().await, None);
    for number in 1..=3 {
        commit(&store, &manifest(number, "t")).await.unwrap();
    }
    assert_eq!(newest().await, Some(3));
    for number in 4..=6 {
        commit(&store, &manifest(number, "t")).await.unwrap();
    }
    assert_eq!(newest().await, Some(6));
    for number in [6, 5] {
        store
            .remove(&ObjectKey::manifest(&product, number))
            .await
            .unwrap();
    }
    assert_eq!(newest().await, Some(4));
}

/// An old version that is pinned stays while those after it go.
#[tokio::test]
async fn the_newest_is_found_behind_versions_that_are_gone() {
    let store = Store::memory();
    let product: ProductId = "p".parse().unwrap();
    for number in [1, 4] {
        commit(&store, &manifest(number, "t")).await.unwrap();
    }
    let found = async |known| {
        let found = newer(&store, &product, known).await.unwrap();
        found.map(|it| it.number)
    };
    assert_eq!(found(1).await, Some(4));
    // By what was seen just now, and again once that is long ago.
    assert_eq!(found(1).await, Some(4));
    store.newest.remove(&product);
    assert_eq!(found(1).await, Some(4));
    assert_eq!(found(4).await, None);
    commit(&store, &manifest(5, "t")).await.unwrap();
    assert_eq!(found(4).await, Some(5));
}

#[tokio::test]
async fn two_writers_cannot_take_one_number() {
    let store = Store::memory();
    commit(&store, &manifest(1, "mine")).await.unwrap();
    let second = commit(&store, &manifest(1, "yours")).await;
    assert!(matches!(second, Err(StorageError::Conflict { .. })));
}

#[tokio::test]
async fn a_manifest_with_a_flipped_bit_is_never_read_as_another_one() {
    let store = Store::memory();
    commit(&store, &manifest(1, "t")).await.unwrap();
    let key = ObjectKey::manifest(&"p".parse().unwrap(), 1);
    let whole = store.get(&key).await.unwrap();
    for at in 0..whole.len() * 8 {
        let mut flipped = whole.to_vec();
        flipped[at / 8] ^= 1 << (at % 8);
        store.put_over(&key, flipped.into()).await.unwrap();
        let error = latest(&store, &"p".parse().unwrap()).await.unwrap_err();
        assert!(
            error.to_string().contains(key.as_str()),
            "bit {at}: {error}"
        );
    }
}
