//! What a notice is answered with: what became of its file, and the event that tells of it, if one is due.

use contract::digest::Digest;
use contract::event::{Body, Event};
use contract::manifest::ManifestId;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use contract::time::Period;

use super::{Outcome, PendingNotice};
use crate::error::Rejection;
use crate::observation::Stored;
use crate::put::StoredGranule;

/// What a notice is answered with.
#[derive(Debug, Clone)]
pub(crate) struct Answer {
    pub(crate) outcome: Outcome,
    /// None for a duplicate of a file that somebody else tells of, and for observations.
    pub(crate) event: Option<Event>,
}

/// A file, and the version of its product by which its notice is answered.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Versioned {
    pub(crate) manifest: ManifestId,
    pub(crate) raw_sha256: Digest,
    pub(crate) periods: Vec<Period>,
}

impl Versioned {
    fn body(&self, shown: &str, revised: bool) -> Body {
        let (shown, manifest) = (shown.to_owned(), self.manifest.clone());
        Body::granule_landed(shown, self.raw_sha256, manifest, &self.periods, revised)
    }
}

impl StoredGranule {
    /// The answer to a file that is in a version now.
    pub(crate) fn landed(&self, version: Versioned, revised: bool) -> Answer {
        let reading = &self.reading;
        let body = version.body(&self.notice.shown, revised);
        let body = body.assuming(&reading.assumptions).with_masked(self.masked);
        let outcome = Outcome::Landed {
            file: self.notice.path(),
            manifest: version.manifest,
            periods: version.periods,
            revised,
            profile: reading
                .recipe
                .profile
                .as_ref()
                .map(|used| used.name.clone()),
            assumptions: reading.assumptions.clone(),
            masked: self.masked,
        };
        self.notice.answer(outcome, Some(body))
    }
}

impl PendingNotice {
    fn answer(&self, outcome: Outcome, body: Option<Body>) -> Answer {
        Answer {
            outcome,
            event: body.map(|body| self.cause.followed_by(body)),
        }
    }

    /// The answer to a file that is refused.
    pub(crate) fn refused(&self, rejection: Rejection) -> Answer {
        let body = Body::GranuleRejected {
            path: self.shown.clone(),
            reason: rejection.reason,
            detail: rejection.to_string(),
            attempt: self.attempt,
            origin: Some(self.origin),
        };
        self.answer(Outcome::rejected(self.path(), rejection), Some(body))
    }

    /// The answer to a file of observations.
    pub(crate) fn observed(
        &self,
        dataset: ProductId,
        stored: Stored,
        (masked, passed_over): (MaskedCells, Vec<String>),
    ) -> Answer {
        let outcome = Outcome::Observed {
            file: self.path(),
            dataset,
            stored,
            masked,
            passed_over,
        };
        self.answer(outcome, None)
    }

    /// The answer to a file whose content was there; its notice tells of it only if that is still to be told.
    pub(crate) fn already_landed(
        &self,
        version: Versioned,
        masked: MaskedCells,
        is_due: bool,
    ) -> Answer {
        let body = is_due.then(|| version.body(&self.shown, false).with_masked(masked));
        let outcome = Outcome::AlreadyLanded {
            file: self.path(),
            manifest: version.manifest,
            periods: version.periods,
            masked,
        };
        self.answer(outcome, body)
    }

    /// The answer to a file of whose time files of later notices are in the newest version. If it was in a version before
    /// and nobody told of that yet, its notice tells of that version now.
    pub(crate) fn superseded(&self, newest: ManifestId, untold: Option<&Versioned>) -> Answer {
        let body = untold.map(|version| version.body(&self.shown, false));
        let outcome = Outcome::Superseded {
            file: self.path(),
            manifest: newest,
        };
        self.answer(outcome, body)
    }
}
