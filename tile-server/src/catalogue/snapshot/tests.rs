//! What a look at the store asks of it, however many versions there are.

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::MANIFEST_SCHEMA;
use contract::quantity::Quantity;
use prometheus::Registry;
use storage::store::Counts;

use super::*;

async fn publish(store: &Store, product: &str, number: u64) {
    let product: ProductId = product.parse().unwrap();
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        number,
        title: "t".to_owned(),
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
    };
    manifests::commit(store, &manifest).await.unwrap();
}

/// A reader of a store, and what a look asks of it.
struct Looking {
    reader: Reader,
    traffic: Arc<storage::store::Traffic>,
    snapshot: Snapshot,
}

impl Looking {
    fn at(store: &Store) -> Self {
        let (store, traffic) = store.counted();
        let metrics = Metrics::register(&Registry::new()).unwrap();
        Self {
            reader: Reader {
                versions: Versions::new(store.clone(), &metrics.panics),
                metrics,
                store,
            },
            traffic,
            snapshot: Snapshot::default(),
        }
    }

    async fn look(&mut self) -> Counts {
        let before = self.traffic.counts();
        self.snapshot = self.reader.read(&self.snapshot).await.unwrap();
        self.traffic.counts().since(before)
    }

    fn newest(&self, product: &str) -> u64 {
        self.snapshot.known[&product.parse().unwrap()].0.number
    }
}

/// Requests of a look that finds nothing new, of one after a landing, and of all of them names that were listed.
async fn looks(versions: u64) -> (Counts, Counts, Counts) {
    let store = Store::memory();
    for product in ["a", "b"] {
        for number in 1..=versions {
            publish(&store, product, number).await;
        }
    }
    let mut looking = Looking::at(&store);
    looking.look().await;
    assert_eq!(looking.newest("a"), versions);
    let idle = looking.look().await;
    publish(&store, "b", versions + 1).await;
    let landed = looking.look().await;
    assert_eq!(
        (looking.newest("a"), looking.newest("b")),
        (versions, versions + 1)
    );
    let before = looking.traffic.counts();
    for _look in 0..LOOKS {
        looking.look().await;
    }
    (idle, landed, looking.traffic.counts().since(before))
}

#[tokio::test]
async fn a_look_asks_the_same_at_ten_and_at_a_thousand_versions() {
    let (idle, landed, many) = looks(10).await;
    let of_a_thousand = looks(1000).await;
    assert_eq!(of_a_thousand.0, idle);
    assert_eq!(of_a_thousand.2, many);
    // One listing of folders, and one question a product; what landed is read besides.
    assert_eq!(
        (idle.lists, idle.listed, idle.heads, idle.reads),
        (1, 2, 2, 0)
    );
    assert_eq!((landed.lists, landed.heads, landed.reads), (1, 3, 1));
    assert_eq!((of_a_thousand.1.heads, of_a_thousand.1.reads), (3, 1));
    // Now and then, whether the newest is there.
    assert_eq!((many.heads, many.reads), (2 * u64::from(LOOKS) + 2, 0));
}

#[tokio::test]
async fn many_versions_at_once_and_a_newest_one_that_was_taken_away_are_found() {
    let store = Store::memory();
    publish(&store, "a", 1).await;
    let mut looking = Looking::at(&store);
    looking.look().await;
    for number in 2..=100 {
        publish(&store, "a", number).await;
    }
    let far = looking.look().await;
    assert_eq!(looking.newest("a"), 100);
    assert!(far.heads <= 16 && far.lists == 2, "{far:?}");
    store
        .remove(&ObjectKey::manifest(&"a".parse().unwrap(), 100))
        .await
        .unwrap();
    for _look in 0..LOOKS {
        looking.look().await;
    }
    assert_eq!(looking.newest("a"), 99);
    publish(&store, "c", 3).await;
    looking.look().await;
    assert_eq!(looking.newest("c"), 3);
}
