//! What landing notes down, for clean-up.

use std::time::Duration;

use contract::key::ObjectKey;
use contract::kind::Kind;
use storage::gc::Owner;

use crate::put::reading;

/// What is known of the reading of raw files: in use as long as that file is.
#[derive(Debug)]
pub struct Readings;

impl Owner for Readings {
    fn kinds(&self) -> &'static [Kind] {
        &[Kind::Reading]
    }

    fn is_made_again(&self) -> bool {
        true
    }

    fn lives_with(&self, key: &ObjectKey) -> Option<ObjectKey> {
        if Kind::of(key) != Some(Kind::Reading) {
            return None;
        }
        let product = key.as_str().split('/').nth(1)?.parse().ok()?;
        Some(ObjectKey::raw(&product, &reading::raw_of(key)?))
    }
}

/// Notes by which a notice that comes again is known.
#[derive(Debug)]
pub struct LandingNotes;

impl Owner for LandingNotes {
    fn kinds(&self) -> &'static [Kind] {
        &[Kind::Landing]
    }

    /// Longer than any log keeps a notice (30 days).
    fn least_age(&self) -> Duration {
        Duration::from_hours(24 * 45)
    }

    fn is_made_again(&self) -> bool {
        true
    }
}
