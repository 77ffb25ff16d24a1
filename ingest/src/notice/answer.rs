//! What a notice is answered with: what became of its file, and the event that tells of it, if one is due.

use std::path::PathBuf;

use contract::digest::Digest;
use contract::event::{Body, Event};
use contract::manifest::ManifestId;
use contract::notice::NoticeOrder;
use contract::time::{Period, TimeMs};
use contract::topic::Origin;
use storage::Store;
use storage::log::Message;

use crate::commit::{self, Committed};
use crate::error::{IngestError, Rejection};
use crate::commit::landing_note;
use crate::notice::PendingNotice;
use crate::notice::Outcome;
use crate::pipeline::Prepared;
use crate::put::StoredGranule;
use crate::settings::Settings;
use crate::fetch::source_wait::SourceWait;
use crate::commit::superseded;

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
    pub(crate) notice: PendingNotice,
    pub(crate) origin: Option<Origin>,
    /// Number of the file among those of the message.
    pub(crate) file: u32,
    pub(crate) source_wait: SourceWait,
}

/// A file whose objects are durable, or its answer.
#[derive(Debug)]
pub(crate) enum Ready {
    ToCommit(StoredGranule),
    Answered(Answer),
}

impl Asked {
    /// The files of a message.
    pub(crate) fn of(message: &Message, settings: &Settings, now: TimeMs) -> Vec<Self> {
        let notices = PendingNotice::of(message, settings, now);
        let asked = |(file, notice)| Self {
            notice,
            origin: Some(message.origin),
            file,
            source_wait: SourceWait::default(),
        };
        (0..).zip(notices).map(asked).collect()
    }

    /// Its place in the order of notices; none of a file that no notice came for, which is newer than all that is there.
    pub(crate) fn order(&self) -> Option<NoticeOrder> {
        let Origin {
            partition, offset, ..
        } = self.origin?;
        Some(NoticeOrder {
            given: self.notice.given?,
            partition,
            offset,
            file: self.file,
        })
    }

    /// The name that people know the file by.
    pub(crate) fn path(&self) -> PathBuf {
        PathBuf::from(&self.notice.shown)
    }

    pub(crate) fn refused(&self, rejection: Rejection) -> Answer {
        self.answer(Outcome::rejected(self.path(), rejection), None, true)
    }

    /// The answer to a file of whose time files of later notices are. If it was in a version before and nobody told of
    /// that yet, its notice tells of that version now.
    fn superseded(
        &self,
        manifest: ManifestId,
        raw_sha256: Digest,
        periods: &[Period],
        held_by: Option<ManifestId>,
    ) -> Answer {
        let (file, shown) = (self.path(), self.notice.shown.clone());
        let event = held_by.map(|held_by| {
            let body = Body::granule_landed(shown, raw_sha256, held_by, periods, false);
            self.notice.cause.followed_by(body)
        });
        let outcome = Outcome::Superseded { file, manifest };
        Answer { outcome, event }
    }

    fn answer(&self, outcome: Outcome, raw_sha256: Option<Digest>, is_due: bool) -> Answer {
        let PendingNotice { attempt, cause, .. } = &self.notice;
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
                order: self.order(),
                ..granule
            }),
            Prepared::Rejected(rejection) => Ready::Answered(self.refused(rejection)),
            Prepared::Observed {
                dataset,
                stored,
                masked,
            } => {
                let outcome = Outcome::Observed {
                    file: self.path(),
                    dataset,
                    stored,
                    masked,
                };
                Ready::Answered(self.answer(outcome, None, true))
            }
            Prepared::AlreadyLanded {
                raw_sha256,
                manifest,
                periods,
                masked,
            } => {
                let is_due = match self.origin {
                    Some(origin) => {
                        landing_note::is_noted(store, &manifest.product, raw_sha256, origin).await?
                    }
                    None => true,
                };
                let outcome = Outcome::AlreadyLanded {
                    file: self.path(),
                    manifest,
                    periods,
                    masked,
                };
                Ready::Answered(self.answer(outcome, Some(raw_sha256), is_due))
            }
            Prepared::Superseded {
                raw_sha256,
                manifest,
                periods,
            } => {
                let product = &manifest.product;
                let held_by = match self.origin {
                    Some(origin) => {
                        let is_noted =
                            landing_note::is_noted(store, product, raw_sha256, origin).await?;
                        superseded::untold(store, &manifest, raw_sha256, &periods, is_noted).await?
                    }
                    None => None,
                };
                Ready::Answered(self.superseded(manifest, raw_sha256, &periods, held_by))
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
        if let Committed::Superseded {
            manifest,
            periods,
            held_by,
        } = committed
        {
            return asked.superseded(manifest, granule.raw_sha256, &periods, held_by);
        }
        let is_due = !matches!(committed, Committed::AlreadyLanded { is_due: false, .. });
        let raw_sha256 = Some(granule.raw_sha256);
        let outcome = outcome(asked.path(), committed, granule);
        asked.answer(outcome, raw_sha256, is_due)
    };
    Ok(committed.into_iter().zip(batch).map(answer).collect())
}

fn outcome(file: PathBuf, committed: Committed, granule: &StoredGranule) -> Outcome {
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
            assumptions: granule.assumptions.clone(),
            masked: granule.masked,
        },
        Committed::AlreadyLanded {
            manifest, periods, ..
        } => Outcome::AlreadyLanded {
            file,
            manifest,
            periods,
            masked: granule.masked,
        },
        Committed::Superseded { manifest, .. } => Outcome::Superseded { file, manifest },
        Committed::Rejected(rejection) => Outcome::rejected(file, rejection),
    }
}
