//! What is told of files that were read anew, from the two newest versions alone, so that it can be told after any kill.

use std::collections::BTreeMap;

use contract::event::{Body, Event};
use contract::manifest::{Manifest, Step};
use contract::product::ProductId;
use storage::{Store, manifests};

use crate::error::IngestError;

/// One event for each file that the newest version has other values of than the one before, although both hold it.
///
/// They are the same each time, for [`storage::log::tell_once`]: a run may be killed between publishing and telling.
pub async fn events(store: &Store, product: &ProductId) -> Result<Vec<Event>, IngestError> {
    let read = IngestError::storage("read the newest manifest");
    let Some(now) = manifests::latest(store, product).await.map_err(read)? else {
        return Ok(vec![]);
    };
    let number = now.number.saturating_sub(1);
    let read = IngestError::storage("read a manifest");
    let Some(before) = manifests::numbered(store, product, number)
        .await
        .map_err(read)?
    else {
        return Ok(vec![]);
    };
    Ok(told(&before, &now))
}

/// A step may be other than it was in what is said of it alone.
fn have_same_values(before: &[&Step], now: &[&Step]) -> bool {
    let values = |step: &&Step| (step.period, step.field.clone());
    before.iter().map(values).eq(now.iter().map(values))
}

fn told(before: &Manifest, now: &Manifest) -> Vec<Event> {
    fn by_file(manifest: &Manifest) -> BTreeMap<(&str, contract::digest::Digest), Vec<&Step>> {
        let mut files: BTreeMap<_, Vec<&Step>> = BTreeMap::new();
        for step in &manifest.steps {
            let file = (step.origin.as_str(), step.raw_sha256);
            files.entry(file).or_default().push(step);
        }
        files
    }
    let old = by_file(before);
    // A version that brought a file is one of a landing, which told of itself.
    if now.derived_from.is_some() || by_file(now).keys().any(|file| !old.contains_key(file)) {
        return vec![];
    }
    let mut events = vec![];
    for (file, steps) in by_file(now) {
        if old.get(&file) == Some(&steps) {
            continue;
        }
        let (origin, raw_sha256) = file;
        let periods: Vec<_> = steps.iter().map(|step| step.period).collect();
        let revised = old
            .get(&file)
            .is_none_or(|before| !have_same_values(before, &steps));
        let trace = format!("reread-{}", raw_sha256.short());
        events.push(Event::new(
            trace,
            Body::granule_landed(origin.to_owned(), raw_sha256, now.id(), &periods, revised)
                .with_masked(steps.iter().filter_map(|step| step.masked).sum()),
        ));
    }
    events
}
