//! Numbered manifests: the newest of a product, one by its name, and the commit of the next.

mod hint;
mod over_time;
mod pages;
mod published;

use std::collections::BTreeMap;

use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{
    LEAST_PAGED_STEPS, MANIFEST_SCHEMA, Manifest, ManifestId, OLDEST_MANIFEST_SCHEMA,
    OLDEST_PAGED_SCHEMA, PAGED_SCHEMA, PagedManifest, Step,
};
use contract::product::ProductId;

use crate::sound::damage;
use crate::{StorageError, Store, document, fields};

pub use over_time::{OverTime, of_kind, over_time};
pub use published::{AtInstant, as_of, published};

/// Versions that were published since the last look, up to which each is asked for.
const MOST_ASKED: u64 = 16;

/// Products that have a manifest, sorted by name.
pub async fn products(store: &Store) -> Result<Vec<ProductId>, StorageError> {
    let names = store.folders(Kind::Manifest.folder()).await?;
    Ok(names.iter().filter_map(|name| name.parse().ok()).collect())
}

/// The newest manifest of a product, if it has one.
///
/// The next number is asked for behind the one that this process has seen a short while ago, else behind that of the hint, and nothing is
/// listed: three small requests where the hint says the newest.
pub async fn latest(store: &Store, product: &ProductId) -> Result<Option<Manifest>, StorageError> {
    if let Some(known) = store.newest.get(product) {
        let newest = follow(store, product, known).await?;
        if let Some(manifest) = numbered(store, product, newest).await? {
            store.newest.insert(product.clone(), newest);
            return Ok(Some(manifest));
        }
        // Somebody took it away.
        store.newest.remove(product);
    } else if let Some(newest) = hinted(store, product).await?
        && let Some(manifest) = numbered(store, product, newest).await?
    {
        store.newest.insert(product.clone(), newest);
        return Ok(Some(manifest));
    }
    let Some(newest) = numbers(store, product).await?.pop() else {
        return Ok(None);
    };
    store.newest.insert(product.clone(), newest);
    numbered(store, product, newest).await
}

/// Products that have a manifest, sorted by name, with the number of their newest one: one list for all, and not one for each.
pub async fn newest_numbers(store: &Store) -> Result<BTreeMap<ProductId, u64>, StorageError> {
    let mut newest: BTreeMap<ProductId, u64> = BTreeMap::new();
    for key in store.list(Kind::Manifest.folder()).await? {
        if let (Some(product), Some(number)) = (product_of(&key), number_of(&key)) {
            let own = newest.entry(product).or_insert(number);
            *own = number.max(*own);
        }
    }
    Ok(newest)
}

/// The newest manifest of a product if it is newer than the number that the caller knows: one small request where it is not and
/// was looked for a short while ago, else two where the hint says so.
///
/// That the one it knows is still there is not asked; see [`is_there`].
pub async fn newer(
    store: &Store,
    product: &ProductId,
    known: u64,
) -> Result<Option<Manifest>, StorageError> {
    let newest = match store.newest.get(product) {
        Some(seen) => follow(store, product, known.max(seen)).await?,
        None => match hinted(store, product).await? {
            Some(newest) if newest == known => known,
            Some(newest) if newest > known && is_there(store, product, newest).await? => newest,
            // Of those that followed it some may be gone.
            _ => last(store, product, known).await?,
        },
    };
    store.newest.insert(product.clone(), newest);
    if newest == known {
        return Ok(None);
    }
    numbered(store, product, newest).await
}

/// Is the manifest of a number there?
pub async fn is_there(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<bool, StorageError> {
    store.exists(&ObjectKey::manifest(product, number)).await
}

/// The newest number by the hint of a product; none where it leads nowhere and a list must tell. Whether that manifest is there is for
/// the caller to see.
async fn hinted(store: &Store, product: &ProductId) -> Result<Option<u64>, StorageError> {
    let Some(hint) = hint::read(store, product).await? else {
        return Ok(None);
    };
    let newest = follow(store, product, hint).await?;
    // Behind one that is gone others may be gone too.
    let leads = newest == hint || is_there(store, product, hint).await?;
    Ok(leads.then_some(newest))
}

/// Has the hint of a product say its newest number: before versions of it are removed.
///
/// # Errors
/// It could not be written: none may be removed.
pub(crate) async fn bring_hint_up(store: &Store, product: &ProductId) -> Result<(), StorageError> {
    match numbers(store, product).await?.pop() {
        Some(newest) => hint::tell(store, product, newest).await,
        None => Ok(()),
    }
}

/// The last number of those that follow a known one: each is asked for, up to some, behind which it is faster to list.
async fn follow(store: &Store, product: &ProductId, known: u64) -> Result<u64, StorageError> {
    for newest in known..known + MOST_ASKED {
        if !is_there(store, product, newest + 1).await? {
            return Ok(newest);
        }
    }
    last(store, product, known).await
}

/// The last number that is there; the known one where none is newer.
async fn last(store: &Store, product: &ProductId, known: u64) -> Result<u64, StorageError> {
    let last = numbers(store, product).await?.pop();
    Ok(last.map_or(known, |last| last.max(known)))
}

/// Numbers of the manifests that a product has, ascending.
pub async fn numbers(store: &Store, product: &ProductId) -> Result<Vec<u64>, StorageError> {
    let keys = store
        .list(&format!("{}/{product}", Kind::Manifest.folder()))
        .await?;
    Ok(keys.iter().filter_map(number_of).collect())
}

/// The product whose manifest has a key.
pub(crate) fn product_of(key: &ObjectKey) -> Option<ProductId> {
    let own = key.as_str().strip_prefix(Kind::Manifest.folder())?;
    let (product, _name) = own.strip_prefix('/')?.split_once('/')?;
    product.parse().ok()
}

/// The number that the key of a manifest ends in.
fn number_of(key: &ObjectKey) -> Option<u64> {
    let name = key.as_str().rsplit('/').next()?;
    name.strip_suffix(".json")?.parse().ok()
}

/// The manifest of a product with a number; none if there is none (any more).
pub async fn numbered(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<Option<Manifest>, StorageError> {
    at(store, &ObjectKey::manifest(product, number)).await
}

/// The manifest of a name, which must still hold what it held when it was named.
pub async fn load(store: &Store, id: &ManifestId) -> Result<Manifest, StorageError> {
    let key = ObjectKey::manifest(&id.product, id.number);
    let Some(manifest) = at(store, &key).await? else {
        let path = key.to_string();
        return Err(StorageError::Object {
            key: path.clone(),
            source: object_store::Error::NotFound {
                path,
                source: "it was cleaned up, or never published".into(),
            },
        });
    };
    if manifest.id() == *id {
        Ok(manifest)
    } else {
        let reason = format!("it is {}, not {id}", manifest.id());
        Err(damage::found(&key, reason))
    }
}

/// Publishes a manifest whose objects are all durable; its name, which takes longer to compute the more steps there are.
///
/// # Errors
/// `Conflict` if another writer took the number: read the newest one again and build on it.
pub async fn commit(store: &Store, manifest: &Manifest) -> Result<ManifestId, StorageError> {
    let id = put(store, manifest).await?;
    hint::tell_published(store, &id.product, id.number).await;
    Ok(id)
}

async fn put(store: &Store, manifest: &Manifest) -> Result<ManifestId, StorageError> {
    let key = ObjectKey::manifest(&manifest.product, manifest.number);
    if manifest.schema != MANIFEST_SCHEMA {
        let reason = format!("to write, it is of schema {}", manifest.schema);
        return Err(StorageError::damaged(key.as_str(), reason));
    }
    // What the version before names is durable; all else is made so now, whoever may have had it once.
    let before = ObjectKey::manifest(&manifest.product, manifest.number.saturating_sub(1));
    let named_before = if manifest.steps.len() < LEAST_PAGED_STEPS {
        vec![]
    } else {
        page_names(store, &before).await?
    };
    let held = pages::held(store, &manifest.product, &named_before);
    let Some((paged, pages)) = manifest.paged_after(|start| held.get(&start).cloned()) else {
        document::put_new(store, &key, manifest).await?;
        return Ok(manifest.id());
    };
    pages::write(store, &manifest.product, pages, &named_before).await?;
    document::put_new(store, &key, &paged).await?;
    Ok(paged.id)
}

/// Keys of the pages that a stored manifest names; nothing if it has none, or is not there.
pub async fn page_keys(store: &Store, key: &ObjectKey) -> Result<Vec<ObjectKey>, StorageError> {
    match stored(store, key).await? {
        Some(Stored::Paged(paged)) => Ok(paged.page_keys().collect()),
        Some(Stored::Whole(_)) | None => Ok(vec![]),
    }
}

/// Names of the pages of a stored manifest, in their order; nothing if it has none, or is not there.
async fn page_names(store: &Store, key: &ObjectKey) -> Result<Vec<Digest>, StorageError> {
    match stored(store, key).await? {
        Some(Stored::Paged(paged)) => Ok(paged.pages),
        Some(Stored::Whole(_)) | None => Ok(vec![]),
    }
}

/// Gives what the next version holds the names that the newest one has for the same values: what was named by its bytes
/// is no other object for being named by its values.
pub async fn settle(
    store: &Store,
    newest: &Manifest,
    next: &mut Manifest,
) -> Result<(), StorageError> {
    if newest.grid != next.grid {
        return Ok(());
    }
    for step in &mut next.steps {
        let start = step.period.start;
        let there = newest
            .steps
            .binary_search_by_key(&start, |it| it.period.start);
        let there = there.ok().map(|at| &newest.steps[at]);
        let is_renamed = |there: &&Step| there.period == step.period && there.field != step.field;
        if let Some(there) = there.filter(is_renamed) {
            step.field = fields::settle(store, &there.field, &step.field, &next.grid).await?;
        }
    }
    Ok(())
}

/// The manifest under a key; none if there is none (any more).
pub async fn at(store: &Store, key: &ObjectKey) -> Result<Option<Manifest>, StorageError> {
    let manifest = match stored(store, key).await? {
        None => return Ok(None),
        Some(Stored::Whole(manifest)) => manifest,
        Some(Stored::Paged(paged)) => pages::assemble(store, key, paged).await?,
    };
    manifest
        .grid
        .validate()
        .map_err(|e| damage::found(key, e))?;
    Ok(Some(manifest))
}

/// A manifest as it is stored.
enum Stored {
    Whole(Manifest),
    Paged(PagedManifest),
}

async fn stored(store: &Store, key: &ObjectKey) -> Result<Option<Stored>, StorageError> {
    #[derive(serde::Deserialize)]
    struct Schema {
        schema: u32,
    }
    let Some(text) = document::text(store, key).await? else {
        return Ok(None);
    };
    let damaged = |e: serde_json::Error| damage::found(key, e);
    let Schema { schema } = serde_json::from_slice(&text).map_err(damaged)?;
    match schema {
        OLDEST_MANIFEST_SCHEMA..=MANIFEST_SCHEMA => serde_json::from_slice(&text)
            .map(|manifest| Some(Stored::Whole(manifest)))
            .map_err(damaged),
        OLDEST_PAGED_SCHEMA..=PAGED_SCHEMA => serde_json::from_slice(&text)
            .map(|paged| Some(Stored::Paged(paged)))
            .map_err(damaged),
        schema => {
            // Whole, but of a program to come.
            let reason = format!(
                "schema {schema} is unknown, this program reads {OLDEST_MANIFEST_SCHEMA} to {PAGED_SCHEMA}"
            );
            Err(StorageError::damaged(key.as_str(), reason))
        }
    }
}

#[cfg(test)]
mod tests {
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
}
