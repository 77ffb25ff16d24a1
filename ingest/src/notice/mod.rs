//! Message in, [`PendingNotice`]s out: which files there are to land, in our own words or in those of other systems; and
//! what each is answered with.

mod answer;
mod cnm;
mod outcome;

use std::path::PathBuf;

use contract::event::{Body, Event, MAX_EVENT_BYTES, RejectReason};
use contract::index::DimensionIndex;
use contract::notice::NoticeOrder;
use contract::product::ProductId;
use contract::time::TimeMs;
use contract::topic::Origin;
use contract::{ContractError, digest::Digest};
use storage::log::Message;

use crate::error::{IngestError, Rejection, boundary};
use crate::fetch::{Expected, Location, SourceWait};
use crate::plan::Wish;
use crate::plan::profile::Profile;
use crate::settings::Settings;

pub(crate) use answer::{Answer, Versioned};
pub use outcome::Outcome;

/// A file that there is to land, from the moment its message is read to its answer.
#[derive(Debug)]
pub(crate) struct PendingNotice {
    /// Where it is, as it is shown and told.
    pub(crate) shown: String,
    /// What is to be done, or why it cannot be.
    pub(crate) order: Result<Order, Rejection>,
    /// 1 for the first try.
    pub(crate) attempt: u32,
    /// What every event about it follows from.
    pub(crate) cause: Event,
    /// Its message.
    pub(crate) origin: Origin,
    /// Its place among all notices. It was given when its sender says, but never later than its message came: the same
    /// however often it is read, and when it is sent twice.
    pub(crate) place: NoticeOrder,
    pub(crate) source_wait: SourceWait,
}

/// How a file is to be landed.
#[derive(Debug, Clone)]
pub(crate) struct Order {
    pub(crate) location: Location,
    pub(crate) expected: Expected,
    pub(crate) profile: Option<Profile>,
    pub(crate) product: Option<ProductId>,
    pub(crate) variable: Option<String>,
    /// Each of another dimension, in the order of their names.
    pub(crate) indexes: Vec<DimensionIndex>,
}

impl Order {
    pub(crate) fn wish(&self) -> Wish<'_> {
        Wish {
            profile: self.profile.as_ref(),
            product: self.product.as_ref(),
            variable: self.variable.as_deref(),
            meaning: None,
            indexes: &self.indexes,
        }
    }
}

/// What a message says of one file.
struct Said {
    shown: String,
    order: Result<Order, Rejection>,
    attempt: u32,
    cause: Event,
}

impl PendingNotice {
    /// The notices of a message: at least one, so that every message is answered.
    pub(crate) fn of(message: &Message, settings: &Settings, now: TimeMs) -> Vec<Self> {
        let came = message.time.unwrap_or(now);
        let said = boundary::called(|| read(message, settings, came));
        // What the panic says may quote the message, like the text of an error below.
        let fault = "makes this program fail: report it with the message";
        let said = match said.unwrap_or_else(|_panic| Err(bad(fault))) {
            Ok(said) => said,
            Err(rejection) => vec![Said::nothing(message, rejection, came)],
        };
        let notice = |(file, said): (u32, Said)| Self {
            place: NoticeOrder {
                given: said.cause.noticed.unwrap_or(came).min(came),
                partition: message.origin.partition,
                offset: message.origin.offset,
                file,
            },
            shown: said.shown,
            order: said.order,
            attempt: said.attempt,
            cause: said.cause,
            origin: message.origin,
            source_wait: SourceWait::default(),
        };
        (0..).zip(said).map(notice).collect()
    }

    /// The name that people know the file by.
    pub(crate) fn path(&self) -> PathBuf {
        PathBuf::from(&self.shown)
    }

    /// What must keep its order is worked on in the order of its messages.
    pub(crate) fn order_key(&self) -> String {
        self.cause.body.order_key()
    }
}

impl Said {
    /// A message that says nothing is refused under its own place: its words are not to be trusted.
    fn nothing(message: &Message, rejection: Rejection, came: TimeMs) -> Self {
        let shown = message.origin.to_string();
        let trace = format!("message-{}", Digest::of(&message.content).short());
        let mut cause = Event::new(trace, notice_body(&shown, &Wishes::default()));
        cause.noticed = Some(came);
        Self {
            shown,
            order: Err(rejection),
            attempt: 1,
            cause,
        }
    }

    fn of_event(mut cause: Event, settings: &Settings, came: TimeMs) -> Result<Self, Rejection> {
        cause.noticed = cause.noticed.or(Some(came));
        let Body::GranuleNotice {
            path,
            profile,
            product,
            variable,
            indexes,
            sha256,
            size_bytes,
            attempt,
        } = &cause.body
        else {
            return Err(bad(&format!("is an event for {}", cause.body.topic())));
        };
        let location = Location::parse(path);
        let profile = profile
            .as_deref()
            .map(|name| find(name, settings))
            .transpose();
        let indexes = DimensionIndex::sorted(indexes.clone());
        let order = || {
            Ok(Order {
                location: location.clone()?,
                expected: Expected {
                    sha256: *sha256,
                    size_bytes: *size_bytes,
                    other: None,
                },
                profile: profile?,
                product: product.clone(),
                variable: variable.clone(),
                indexes: indexes.map_err(|error| bad(&error.to_string()))?,
            })
        };
        Ok(Self {
            shown: location.as_ref().map_or_else(
                |_| "a path that cannot be read".to_owned(),
                ToString::to_string,
            ),
            order: order(),
            attempt: *attempt,
            cause,
        })
    }
}

/// How files are to be landed, as a command says it.
#[derive(Debug, Clone, Default)]
pub struct Wishes {
    /// Name of the profile, or its file; found by itself if absent.
    pub profile: Option<String>,
    /// The product, if not the profile's.
    pub product: Option<ProductId>,
    /// The variable to land of files that no profile is for.
    pub variable: Option<String>,
    /// Which index is read of dimensions beside time, latitude and longitude; files are refused where a dimension is named twice.
    pub indexes: Vec<DimensionIndex>,
}

/// The event of a first notice.
pub(crate) fn notice_body(path: &str, wishes: &Wishes) -> Body {
    let Wishes {
        profile,
        product,
        variable,
        indexes,
    } = wishes.clone();
    Body::GranuleNotice {
        path: path.to_owned(),
        profile,
        product,
        variable,
        indexes,
        sha256: None,
        size_bytes: None,
        attempt: 1,
    }
}

fn read(message: &Message, settings: &Settings, came: TimeMs) -> Result<Vec<Said>, Rejection> {
    if message.content.len() > MAX_EVENT_BYTES {
        return Err(bad(&format!("is longer than {MAX_EVENT_BYTES} bytes")));
    }
    if cnm::is_one(&message.content) {
        return cnm::notices(&message.content, &settings.profiles, came);
    }
    // The text of the error is left out where it quotes the message: there may be a signed address in it.
    let event = message.event().map_err(|error| match error {
        ContractError::Invalid { reason, .. } => bad(&reason),
    })?;
    Ok(vec![Said::of_event(event, settings, came)?])
}

/// A profile by its name; a file of one only where the user names it, and not whoever sends a message.
fn find(name: &str, settings: &Settings) -> Result<Profile, Rejection> {
    let Settings {
        profiles, sources, ..
    } = settings;
    let found = match profiles.named(name) {
        Err(_) if !sources.is_guarded() => Profile::find(name),
        found => found,
    };
    let refused =
        |e: IngestError| Rejection::new(RejectReason::NoVariable, "profile", e.to_string());
    found.map_err(refused)
}

fn bad(detail: &str) -> Rejection {
    Rejection::new(RejectReason::Message, "message", detail)
}

#[cfg(test)]
mod tests;
