//! One version of a product as it is shown, with the accumulated carbon that lifts its particles and the northward part
//! of the vector that they drift with.

use std::sync::Arc;

use contract::job::Mode;
use contract::manifest::{Manifest, ManifestId};
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};

/// One version of a product.
#[derive(Debug, Clone)]
pub struct Layer {
    /// Its name, which is costly to compute.
    pub id: ManifestId,
    /// Its manifest.
    pub manifest: Arc<Manifest>,
    /// What it covers; a manifest without steps is no layer.
    pub extent: Period,
    /// The accumulated carbon that lifts its particles.
    pub accumulated: Option<Accumulated>,
    /// The northward part of the vector whose eastward part it is, in its newest version.
    pub northward: Option<Northward>,
}

/// The northward part of a vector.
#[derive(Debug, Clone)]
pub struct Northward {
    /// Its name, which is costly to compute.
    pub id: ManifestId,
    /// Its manifest.
    pub manifest: Arc<Manifest>,
}

/// Accumulated carbon of one version of a product.
#[derive(Debug, Clone)]
pub struct Accumulated {
    /// Its name, which is costly to compute.
    pub id: ManifestId,
    /// Its manifest.
    pub manifest: Arc<Manifest>,
    /// The last instant at which it holds for that version: none if it was derived from exactly that one.
    pub until: Option<TimeMs>,
}

impl Accumulated {
    /// What was derived from a version, for that version.
    pub fn new(id: ManifestId, manifest: Arc<Manifest>) -> Self {
        let until = None;
        Self {
            id,
            manifest,
            until,
        }
    }

    /// Does it hold at an instant?
    pub(crate) fn holds_at(&self, time: TimeMs) -> bool {
        self.until.is_none_or(|until| time <= until)
    }
}

impl Layer {
    /// Is it made of the same versions?
    pub(super) fn is_as(&self, other: &Self) -> bool {
        let lift = |layer: &Self| {
            let lift = layer.accumulated.as_ref();
            lift.map(|lift| (lift.id.clone(), lift.until))
        };
        let northward = |layer: &Self| layer.northward.as_ref().map(|part| part.id.clone());
        self.id == other.id && lift(self) == lift(other) && northward(self) == northward(other)
    }

    /// Modes it can be drawn in. Accumulated carbon lifts the particles of another product; it has none of its own.
    /// Particles drift with both parts of a vector.
    pub fn modes(&self) -> &'static [Mode] {
        if self.manifest.quantity == Quantity::AccumulatedCarbon {
            &[Mode::Map]
        } else if self.northward.is_some() {
            &Mode::ALL
        } else {
            &Mode::SCALAR
        }
    }
}

/// The end of the steps at the start of both versions that are equal in both; none if what was summed up from one says
/// nothing of the other.
pub fn equal_until(before: &Manifest, now: &Manifest) -> Option<TimeMs> {
    if before.product != now.product || before.grid != now.grid || before.domain != now.domain {
        return None;
    }
    let pairs = before.steps.iter().zip(&now.steps);
    let equal = pairs.take_while(|(old, new)| old.period == new.period && old.field == new.field);
    equal.last().map(|(_, new)| new.period.end)
}
