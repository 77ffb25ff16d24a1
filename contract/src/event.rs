//! Events: what services tell each other after the objects they speak of are durable. JSON with a schema version.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::digest::Digest;
use crate::job::RenderJob;
use crate::key::ObjectKey;
use crate::manifest::ManifestId;
use crate::product::ProductId;
use crate::time::Period;

/// Version of the events' JSON.
pub const EVENT_SCHEMA: u32 = 1;
/// Longest event, bytes.
pub const MAX_EVENT_BYTES: usize = 1 << 20;

/// An event with its schema version.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// [`EVENT_SCHEMA`].
    pub schema: u32,
    /// The same text on everything that follows from one notice.
    pub trace: String,
    /// What happened.
    pub body: Body,
}

/// What happened.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all_fields = "snake_case", deny_unknown_fields)]
pub enum Body {
    /// A file is there to be ingested.
    #[serde(rename = "granule.notice")]
    GranuleNotice {
        /// Path of the file.
        path: String,
        /// Name of the profile to read it with; found by itself if absent.
        profile: Option<String>,
        /// The product to land it in; named by the profile if absent.
        product: Option<ProductId>,
    },
    /// A file is in a product.
    #[serde(rename = "granule.landed")]
    GranuleLanded {
        /// Path of the file.
        path: String,
        /// Digest of the file.
        raw_sha256: Digest,
        /// Manifest that holds it.
        manifest: ManifestId,
        /// Periods it brought.
        periods: Vec<Period>,
        /// Did it replace values that were there?
        revised: bool,
    },
    /// A file was refused.
    #[serde(rename = "granule.rejected")]
    GranuleRejected {
        /// Path of the file.
        path: String,
        /// Class of the reason, for counting.
        reason: RejectReason,
        /// One line: the object in the file, what is wrong and what to do.
        detail: String,
        /// 1 for the first try.
        attempt: u32,
    },
    /// A product was computed from another.
    #[serde(rename = "product.derived")]
    ProductDerived {
        /// The new manifest.
        manifest: ManifestId,
        /// What it was computed from.
        derived_from: ManifestId,
    },
    /// A picture is wanted.
    #[serde(rename = "render.job")]
    RenderJob {
        /// The job.
        job: RenderJob,
    },
    /// A picture is there.
    #[serde(rename = "render.done")]
    RenderDone {
        /// Where.
        key: ObjectKey,
        /// Time it took, milliseconds.
        duration_ms: u64,
    },
}

/// Why a file was refused, as a class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RejectReason {
    /// The file cannot be read or has no known format.
    Unreadable,
    /// It ends early or its parts contradict each other.
    Corrupt,
    /// It, or something it declares, is larger than allowed.
    TooLarge,
    /// No variable to land, or no profile for it.
    NoVariable,
    /// A unit is missing, unknown or of the wrong kind.
    Unit,
    /// No time, or one that cannot be right.
    Time,
    /// No regular latitude-longitude grid: a swath, for example.
    Grid,
    /// No plausible value in it.
    Values,
    /// It does not fit the product that is there (other grid, other quantity, overlapping period).
    Conflict,
}

impl Body {
    /// Topic that events of this kind go to.
    pub fn topic(&self) -> &'static str {
        match self {
            Self::GranuleNotice { .. } => "granule.notice",
            Self::GranuleLanded { .. } => "granule.landed",
            Self::GranuleRejected { .. } => "granule.rejected",
            Self::ProductDerived { .. } => "product.derived",
            Self::RenderJob { .. } => "render.job",
            Self::RenderDone { .. } => "render.done",
        }
    }
}

impl Event {
    /// An event of this version.
    pub fn new(trace: impl Into<String>, body: Body) -> Self {
        Self {
            schema: EVENT_SCHEMA,
            trace: trace.into(),
            body,
        }
    }

    /// One line of JSON.
    ///
    /// # Panics
    /// Never: events have string keys only.
    pub fn to_json(&self) -> String {
        serde_json::to_string(self).expect("events have string keys only")
    }

    /// Reads one line of JSON.
    ///
    /// # Errors
    /// Too long, not JSON, another schema version, or unknown fields.
    pub fn from_json(text: &str) -> Result<Self, ContractError> {
        #[derive(Deserialize)]
        struct Version {
            schema: u32,
        }
        let bad = |reason: String| ContractError::invalid("event", text, reason);
        if text.len() > MAX_EVENT_BYTES {
            return Err(bad(format!("it is longer than {MAX_EVENT_BYTES} bytes")));
        }
        let version: Version = serde_json::from_str(text).map_err(|e| bad(e.to_string()))?;
        if version.schema != EVENT_SCHEMA {
            return Err(bad(format!(
                "schema {} is unknown, this program reads {EVENT_SCHEMA}",
                version.schema
            )));
        }
        serde_json::from_str(text).map_err(|e| bad(e.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Bytes as version 1 wrote them: they must parse for as long as version 1 is read.
    const NOTICE_V1: &str = r#"{"schema":1,"trace":"t","body":{"kind":"granule.notice","path":"a.nc","profile":null,"product":null}}"#;

    #[test]
    fn old_bytes_still_parse() {
        let event = Event::from_json(NOTICE_V1).unwrap();
        assert_eq!(event.body.topic(), "granule.notice");
        assert_eq!(event.to_json(), NOTICE_V1);
    }

    #[test]
    fn another_version_is_named_in_the_refusal() {
        let error =
            Event::from_json(&NOTICE_V1.replace("\"schema\":1", "\"schema\":2")).unwrap_err();
        assert!(error.to_string().contains("schema 2 is unknown"), "{error}");
    }

    #[test]
    fn unknown_fields_are_refused() {
        assert!(Event::from_json(&NOTICE_V1.replace("\"path\"", "\"extra\":1,\"path\"")).is_err());
    }
}
