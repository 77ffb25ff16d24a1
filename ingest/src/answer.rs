//! What a notice is answered with: what became of its file, and the event that tells of it, if one is due.

use std::path::PathBuf;

use contract::digest::Digest;
use contract::event::{Event, RejectReason};
use contract::topic::Origin;
use storage::Store;

use crate::commit::{self, Committed};
use crate::error::{Cause, IngestError};
use crate::landing_note;
use crate::notice::Notice;
use crate::outcome::Outcome;
use crate::pipeline::Prepared;
use crate::put::StoredGranule;
use crate::rejection::Rejection;

/// What a notice is answered with.
#[derive(Debug, Clone)]
pub(crate) struct Answer {
    pub(crate) outcome: Outcome,
    /// None for a duplicate of a file that somebody else tells of, and for observations.
    pub(crate) event: Option<Event>,
}

/// A notice and the message it came with; none for files that no notice came for.
#[derive(Debug, Clone)]
pub(crate) struct Asked {
    pub(crate) notice: Notice,
    pub(crate) origin: Option<Origin>,
}

/// A file whose objects are durable, or its answer.
#[derive(Debug)]
pub(crate) enum Ready {
    ToCommit(StoredGranule),
    Answered(Answer),
}

impl Asked {
    /// The name that people know the file by.
    pub(crate) fn file(&self) -> PathBuf {
        PathBuf::from(&self.notice.shown)
    }

    pub(crate) fn refused(&self, rejection: Rejection) -> Answer {
        self.answer(Outcome::rejected(self.file(), rejection), None, true)
    }

    fn answer(&self, outcome: Outcome, raw_sha256: Option<Digest>, is_due: bool) -> Answer {
        let Notice { attempt, cause, .. } = &self.notice;
        let body = outcome.event(raw_sha256, *attempt, self.origin);
        let event = body.filter(|_| is_due).map(|body| cause.followed_by(body));
        Answer { outcome, event }
    }

    /// The answer to a file that needs no commit.
    pub(crate) async fn settle(
        &self,
        store: &Store,
        prepared: Prepared,
    ) -> Result<Ready, IngestError> {
        Ok(match prepared {
            Prepared::Stored(granule) => Ready::ToCommit(StoredGranule {
                asked_by: self.origin,
                ..granule
            }),
            Prepared::Rejected(rejection) => Ready::Answered(self.refused(rejection)),
            Prepared::Observed(stored) => {
                let file = self.file();
                let outcome = Outcome::Observed { file, stored };
                Ready::Answered(self.answer(outcome, None, true))
            }
            Prepared::AlreadyLanded {
                raw_sha256,
                manifest,
                periods,
            } => {
                let is_due = match self.origin {
                    Some(origin) => {
                        landing_note::is_noted(store, &manifest.product, raw_sha256, origin).await?
                    }
                    None => true,
                };
                let outcome = Outcome::AlreadyLanded {
                    file: self.file(),
                    manifest,
                    periods,
                };
                Ready::Answered(self.answer(outcome, Some(raw_sha256), is_due))
            }
        })
    }
}

/// Publishes files of one product, in their order.
pub(crate) async fn commit(
    store: &Store,
    batch: &[(&Asked, &StoredGranule)],
) -> Result<Vec<Answer>, IngestError> {
    let Some((_, first)) = batch.first() else {
        return Ok(vec![]);
    };
    let product = &first.target.product;
    let granules: Vec<StoredGranule> = batch
        .iter()
        .map(|(_, granule)| (*granule).clone())
        .collect();
    let committed = commit::run(store, product, &granules).await?;
    let answer = |(committed, (asked, granule)): (Committed, &(&Asked, &StoredGranule))| {
        let is_due = !matches!(committed, Committed::AlreadyLanded { is_due: false, .. });
        let raw_sha256 = Some(granule.raw_sha256);
        asked.answer(outcome(asked.file(), committed), raw_sha256, is_due)
    };
    Ok(committed.into_iter().zip(batch).map(answer).collect())
}

fn outcome(file: PathBuf, committed: Committed) -> Outcome {
    match committed {
        Committed::Landed {
            manifest,
            periods,
            revised,
        } => Outcome::Landed {
            file,
            manifest,
            periods,
            revised,
        },
        Committed::AlreadyLanded {
            manifest, periods, ..
        } => Outcome::AlreadyLanded {
            file,
            manifest,
            periods,
        },
        Committed::Rejected(rejection) => Outcome::rejected(file, rejection),
    }
}

/// The refusal of a file that makes the program fail however often it is tried, so that others need not wait behind it.
pub(crate) fn blame(error: &IngestError) -> Rejection {
    let (reason, object, advice) = match error.cause() {
        Cause::Stored => (
            RejectReason::Conflict,
            "product",
            "mend what is stored, then send the notice again",
        ),
        Cause::Passing | Cause::Place | Cause::Granule => (
            RejectReason::Unreadable,
            "file",
            "this is a fault of the program: report it with the file",
        ),
    };
    Rejection::new(reason, object, format!("{error}; {advice}"))
}
