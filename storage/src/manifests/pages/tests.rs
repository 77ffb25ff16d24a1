//! Which pages versions write and read, and those of before.

use std::time::Duration;

use contract::grid::Grid;
use contract::manifest::{MANIFEST_SCHEMA, OLDEST_PAGED_SCHEMA, Step};
use contract::notice::NoticeRun;
use contract::quantity::Quantity;
use contract::time::Period;

use super::*;
use crate::gc::{self, Keep, Versions};
use crate::manifests::{commit, latest, load, page_names};

/// A version of these days, each of a notice of its own.
fn of_days(number: u64, days: impl IntoIterator<Item = i64>) -> Manifest {
    let product: ProductId = "p".parse().unwrap();
    let start = |day: i64| TimeMs::new(day * 86_400_000).unwrap();
    let step = |day: i64| Step {
        period: Period::new(start(day), start(day + 1)).unwrap(),
        field: ObjectKey::field(&product, &Digest::of(&day.to_le_bytes())),
        raw_sha256: Digest::of(b""),
        origin: format!("{day}.nc"),
        valid_cells: 1,
        masked: None,
        contributed: None,
    };
    let days: Vec<i64> = days.into_iter().collect();
    let order = |day: &i64| {
        format!("2001-03-01T00:00:00Z/0/{}/0", day + 10)
            .parse()
            .ok()
    };
    let orders: Vec<_> = days.iter().map(order).collect();
    Manifest {
        schema: MANIFEST_SCHEMA,
        number,
        title: "P".to_owned(),
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
        steps: days.iter().map(|day| step(*day)).collect(),
        domain: ObjectKey::domain(&product, &Digest::of(b"")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: NoticeRun::of(&orders),
        indexes: vec![],
        product,
    }
}

async fn pages_there(store: &Store) -> Vec<ObjectKey> {
    store.list("manifest-pages").await.unwrap()
}

/// The same objects in a store of its own, of which nothing is held.
async fn copy(store: &Store) -> Store {
    let other = Store::memory();
    for key in store.list("").await.unwrap() {
        let content = store.get(&key).await.unwrap();
        other.put_over(&key, content).await.unwrap();
    }
    other
}

#[tokio::test]
async fn a_step_before_all_others_writes_two_pages_at_most_and_reads_none() {
    let store = Store::memory();
    commit(&store, &of_days(1, 0..2000)).await.unwrap();
    let mut revised = of_days(4, (-1..700).chain(701..2000));
    revised.steps[350].valid_cells += 1;
    let versions = [
        // One that comes, one that goes, one that is revised.
        of_days(2, -1..2000),
        of_days(3, (-1..700).chain(701..2000)),
        revised,
    ];
    for next in &versions {
        // By one who has seen nothing, and by one who has seen the version before.
        for (store, has_seen) in [(copy(&store).await, false), (store.clone(), true)] {
            let before = pages_there(&store).await.len();
            let (counted, traffic) = store.counted();
            if has_seen {
                latest(&counted, &next.product).await.unwrap();
            }
            let last = ObjectKey::manifest(&next.product, next.number - 1);
            let names = page_names(&counted, &last).await.unwrap();
            let held = held(&counted, &next.product, &names);
            assert_eq!(held.len(), if has_seen { names.len() } else { 0 });
            let earlier = traffic.counts();
            commit(&counted, next).await.unwrap();
            let counts = traffic.counts().since(earlier);
            let new = pages_there(&store).await.len() - before;
            assert!((1..=2).contains(&new), "version {}: {new}", next.number);
            assert_eq!(
                counts.writes,
                new as u64 + 2,
                "the version and the hint of it"
            );
            assert_eq!(counts.reads, 2, "the version before and its hint");
            let mine = load(&store, &next.id()).await.unwrap();
            assert_eq!(mine, *next);
        }
    }
    let other = copy(&store).await;
    for version in versions.iter().chain([&of_days(1, 0..2000)]) {
        assert_eq!(load(&other, &version.id()).await.unwrap(), *version);
    }
}

/// Stores a version as programs of before did, in pages of 128 steps each.
async fn commit_of_before(store: &Store, whole: &Manifest) {
    let (mut paged, _pages) = whole.paged().unwrap();
    let orders = whole.notice_orders();
    let page = |(steps, orders): (&[Step], &[_])| Page {
        schema: OLDEST_PAGED_SCHEMA,
        steps: steps.to_vec(),
        notices: NoticeRun::of(orders),
    };
    let (steps, orders) = (whole.steps.chunks(128), orders.chunks(128));
    let mut pages: Vec<Page> = steps.zip(orders).map(page).collect();
    paged.schema = OLDEST_PAGED_SCHEMA;
    paged.rest = pages.pop().unwrap();
    paged.pages = pages.iter().map(Page::name).collect();
    let named = paged.pages.iter().copied().zip(pages).collect();
    write(store, &whole.product, named, &[]).await.unwrap();
    let key = ObjectKey::manifest(&whole.product, whole.number);
    document::put_new(store, &key, &paged).await.unwrap();
}

#[tokio::test]
async fn a_version_of_even_pages_is_read_kept_by_clean_up_and_followed_by_one_of_now() {
    let store = Store::memory();
    let product: ProductId = "p".parse().unwrap();
    let first = of_days(1, 0..300);
    commit_of_before(&store, &first).await;
    let even = pages_there(&store).await;
    assert_eq!(even.len(), 2);
    let other = copy(&store).await;
    assert_eq!(latest(&other, &product).await.unwrap(), Some(first.clone()));
    let garbage = async |versions: usize| {
        let age = Duration::ZERO;
        let now = TimeMs::from_ymd(9000, 1, 1).unwrap();
        let plan = gc::plan(&store, &[&Versions], Keep { versions, age }, now);
        let keys = plan.await.unwrap().garbage.into_iter().map(|it| it.key);
        let is_list = |key: &ObjectKey| key.as_str().starts_with("manifest");
        keys.filter(is_list).collect::<Vec<_>>()
    };
    assert_eq!(garbage(1).await, []);
    let second = of_days(2, 0..301);
    commit(&store, &second).await.unwrap();
    let all = pages_there(&store).await;
    assert_eq!(all.len(), 2 + second.paged().unwrap().1.len());
    for version in [&first, &second] {
        assert_eq!(load(&store, &version.id()).await.unwrap(), *version);
    }
    // Those of both are in use while both are kept, and those of the first alone go with it.
    assert_eq!(garbage(2).await, []);
    let mut gone = vec![ObjectKey::manifest(&product, 1)];
    gone.extend(even);
    assert_eq!(garbage(1).await, gone);
}
