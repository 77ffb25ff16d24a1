//! What is told of files that were read anew, from the two newest versions alone, so that it can be told after any kill.

use std::collections::BTreeMap;

use contract::digest::Digest;
use contract::event::{Body, Event};
use contract::manifest::{Manifest, Step};
use contract::product::ProductId;
use storage::{Store, manifests};

use crate::error::IngestError;

/// One event for each file that the newest version has other values of than the one before, although both hold it; where nothing but
/// what is said of values is another, one in all.
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

/// The same values elsewhere, or of something else, are other values.
fn has_other_values(before: &Manifest, now: &Manifest) -> bool {
    before.grid != now.grid || !now.quantity.is_same_kind(before.quantity)
}

/// Is something else said of values?
fn says_otherwise(before: &Manifest, now: &Manifest) -> bool {
    before.title != now.title
        || (before.quantity, before.synthetic) != (now.quantity, now.synthetic)
}

fn told(before: &Manifest, now: &Manifest) -> Vec<Event> {
    let (old, new) = (by_file(before), by_file(now));
    // A version that brought a file is one of a landing, which told of itself.
    if now.derived_from.is_some() || new.keys().any(|file| !old.contains_key(file)) {
        return vec![];
    }
    let are_all = has_other_values(before, now);
    let all = new.iter();
    let others = all.filter(|(file, steps)| are_all || old.get(*file) != Some(*steps));
    let mut others: Vec<_> = others.collect();
    // Whoever makes something of it hears of it by one file: the last, whose title is that of all.
    if others.is_empty() && says_otherwise(before, now) {
        let last = now.steps.last().map(file_of);
        others.extend(last.and_then(|last| new.get_key_value(&last)));
    }
    let mut events = vec![];
    for (file, steps) in others {
        let (origin, raw_sha256) = *file;
        let periods: Vec<_> = steps.iter().map(|step| step.period).collect();
        let revised = are_all
            || old
                .get(file)
                .is_none_or(|before| !have_same_values(before, steps));
        let trace = format!("reread-{}", raw_sha256.short());
        events.push(Event::new(
            trace,
            Body::granule_landed(origin.to_owned(), raw_sha256, now.id(), &periods, revised)
                .with_masked(steps.iter().filter_map(|step| step.masked).sum()),
        ));
    }
    events
}

/// A file as steps name it.
type File<'a> = (&'a str, Digest);

fn file_of(step: &Step) -> File<'_> {
    (step.origin.as_str(), step.raw_sha256)
}

fn by_file(manifest: &Manifest) -> BTreeMap<File<'_>, Vec<&Step>> {
    let mut files: BTreeMap<_, Vec<&Step>> = BTreeMap::new();
    for step in &manifest.steps {
        files.entry(file_of(step)).or_default().push(step);
    }
    files
}

#[cfg(test)]
mod tests {
    use contract::grid::Grid;
    use contract::key::ObjectKey;
    use contract::manifest::MANIFEST_SCHEMA;
    use contract::quantity::Quantity;
    use contract::time::Period;

    use super::*;

    /// Two files of a month each.
    fn version(number: u64) -> Manifest {
        let product: ProductId = "p".parse().unwrap();
        let step = |(month, file): (u32, &str)| Step {
            masked: None,
            period: Period::month(2000, month).unwrap(),
            field: ObjectKey::field(&product, &Digest::of(file.as_bytes())),
            raw_sha256: Digest::of(file.as_bytes()),
            origin: format!("{file}.nc"),
            valid_cells: 1,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            product: product.clone(),
            number,
            title: "t".into(),
            quantity: Quantity::open("a", "m", "A").unwrap(),
            synthetic: false,
            source: "s".into(),
            grid: Grid {
                rows: 2,
                cols: 4,
                north_deg: 90.0,
                west_deg: -180.0,
                dlat_deg: 90.0,
                dlon_deg: 90.0,
            },
            steps: [(1, "first"), (2, "last")].map(step).to_vec(),
            domain: ObjectKey::domain(&product, &Digest::of(b"")),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
        }
    }

    /// Of each event the file, and whether its values are others.
    fn told_of(now: &Manifest) -> Vec<(String, bool)> {
        let of = |event: Event| match event.body {
            Body::GranuleLanded { path, revised, .. } => (path, revised),
            other => panic!("{other:?}"),
        };
        told(&version(1), now).into_iter().map(of).collect()
    }

    #[test]
    fn the_same_values_elsewhere_or_of_something_else_are_told_of_by_every_file() {
        let mut elsewhere = version(2);
        elsewhere.grid.west_deg = -179.5;
        let something_else = Manifest {
            quantity: Quantity::WaveHeight,
            ..version(2)
        };
        for now in [elsewhere, something_else] {
            let all = ["first.nc", "last.nc"].map(|file| (file.to_owned(), true));
            assert_eq!(told_of(&now), all);
        }
    }

    #[test]
    fn what_is_said_otherwise_of_values_is_told_once_and_nothing_of_the_same() {
        assert_eq!(told_of(&version(2)), []);
        let titled = Manifest {
            title: "Another".into(),
            ..version(2)
        };
        let synthetic = Manifest {
            synthetic: true,
            ..version(2)
        };
        let ranged = Manifest {
            quantity: version(2).quantity.over([0.0, 5.0]).unwrap(),
            ..version(2)
        };
        for now in [titled.clone(), synthetic, ranged] {
            assert_eq!(told_of(&now), [("last.nc".to_owned(), false)]);
        }
        // A file of other values tells of the title too.
        let mut both = titled;
        both.steps[0].field = both.steps[1].field.clone();
        assert_eq!(told_of(&both), [("first.nc".to_owned(), true)]);
    }
}
