//! Events: what services tell each other after the objects they speak of are durable. JSON with a schema version.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::digest::Digest;
use crate::index::DimensionIndex;
use crate::job::RenderJob;
use crate::key::ObjectKey;
use crate::manifest::ManifestId;
use crate::masked::MaskedCells;
use crate::observation::Observation;
use crate::product::ProductId;
use crate::time::{Period, TimeMs};
use crate::topic::{Origin, Topic};

/// Version of the events' JSON. Those since [`OLDEST_EVENT_SCHEMA`] are read too.
///
/// 2: a landed file of very many steps tells the runs of its periods.
pub const EVENT_SCHEMA: u32 = 2;
/// Oldest version that is read.
pub const OLDEST_EVENT_SCHEMA: u32 = 1;
/// Most periods that an event lists.
pub const MAX_PERIODS: usize = 1000;
/// Longest event, bytes.
pub const MAX_EVENT_BYTES: usize = 1 << 20;
/// Longest trace, bytes.
pub const MAX_TRACE_BYTES: usize = 128;
/// Most observations of one event.
pub const MAX_OBSERVATIONS: usize = 1000;

/// An event with its schema version.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Event {
    /// [`EVENT_SCHEMA`].
    pub schema: u32,
    /// The same text on everything that follows from one notice.
    pub trace: String,
    /// When the notice was given that all of this follows from: how fresh a tile is counts from here.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub noticed: Option<TimeMs>,
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
        /// Path or URL of the file.
        path: String,
        /// Name of the profile to read it with; found by itself if absent.
        profile: Option<String>,
        /// The product to land it in; named by the profile if absent.
        product: Option<ProductId>,
        /// The variable to land, of a file that no profile is for; the one that the file is about, if absent.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        variable: Option<String>,
        /// Which index is read of dimensions beside time, latitude and longitude; none, if absent.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        indexes: Vec<DimensionIndex>,
        /// What the file's digest must be, if the sender knows.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        sha256: Option<Digest>,
        /// What the file's size must be, bytes, if the sender knows.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        size_bytes: Option<u64>,
        /// 1 for the first try, more for a notice that was refused and sent again.
        #[serde(default = "first", skip_serializing_if = "is_first")]
        attempt: u32,
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
        /// Periods it brought, in order. More than [`MAX_PERIODS`] are told as the runs without a gap that they make
        /// up, and if those are still too many as the one period from the first to the last.
        periods: Vec<Period>,
        /// How many steps they are, where `periods` does not list each; the manifest does.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        step_count: Option<u64>,
        /// Did it replace values that were there?
        revised: bool,
        /// What was taken for granted when it was read, because nothing in the file says it. One line each.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        assumptions: Vec<String>,
        /// Cells of all its steps that it gave a value for and that hold none; the manifest has them step by step.
        #[serde(default, skip_serializing_if = "MaskedCells::is_none")]
        masked: MaskedCells,
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
        /// Where the refused message lies.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        origin: Option<Origin>,
    },
    /// Measurements of buoys, ships, stations and profiles.
    #[serde(rename = "observation")]
    Observations {
        /// At most [`MAX_OBSERVATIONS`].
        observations: Vec<Observation>,
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
        job: Box<RenderJob>,
    },
    /// A picture is there.
    #[serde(rename = "render.done")]
    RenderDone {
        /// Where.
        key: ObjectKey,
        /// Time it took, milliseconds.
        duration_ms: u64,
        /// Why there is no picture; the job will not be tried again.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        failure: Option<String>,
    },
}

fn first() -> u32 {
    1
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_first(attempt: &u32) -> bool {
    *attempt == first()
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
    /// Its digest or size is not the one that its notice gave.
    Checksum,
    /// Its path or address is not one that may be read.
    Location,
    /// It could not be had, however often it was tried.
    Unavailable,
    /// The message itself cannot be understood: no JSON, an unknown schema, a field out of its limits.
    Message,
}

impl Body {
    /// A file is in a product: an event of bounded length, however many `periods` (in order) it brought.
    pub fn granule_landed(
        path: String,
        raw_sha256: Digest,
        manifest: ManifestId,
        periods: &[Period],
        revised: bool,
    ) -> Self {
        let folded = folded(periods);
        Self::GranuleLanded {
            path,
            raw_sha256,
            manifest,
            step_count: folded.as_ref().map(|_runs| periods.len() as u64),
            periods: folded.unwrap_or_else(|| periods.to_vec()),
            revised,
            assumptions: vec![],
            masked: MaskedCells::default(),
        }
    }

    /// The same, of a landed file that was read with assumptions.
    #[must_use]
    pub fn assuming(mut self, lines: &[String]) -> Self {
        if let Self::GranuleLanded { assumptions, .. } = &mut self {
            *assumptions = lines.to_vec();
        }
        self
    }

    /// The same news of a file with what was masked of it.
    #[must_use]
    pub fn with_masked(mut self, cells: MaskedCells) -> Self {
        if let Self::GranuleLanded { masked, .. } = &mut self {
            *masked = cells;
        }
        self
    }

    /// Topic that events of this kind go to.
    pub fn topic(&self) -> Topic {
        match self {
            Self::GranuleNotice { .. } => Topic::GranuleNotice,
            Self::GranuleLanded { .. } => Topic::GranuleLanded,
            Self::GranuleRejected { .. } => Topic::GranuleRejected,
            Self::Observations { .. } => Topic::Observation,
            Self::ProductDerived { .. } => Topic::ProductDerived,
            Self::RenderJob { .. } => Topic::RenderJob,
            Self::RenderDone { .. } => Topic::RenderDone,
        }
    }

    /// What events share that must be read in their order: the product, else what the event speaks of.
    pub fn order_key(&self) -> String {
        match self {
            Self::GranuleNotice { path, product, .. } => product
                .as_ref()
                .map_or(path.as_str(), |p| p.as_str())
                .to_owned(),
            Self::GranuleLanded { manifest, .. } | Self::ProductDerived { manifest, .. } => {
                manifest.product.to_string()
            }
            Self::GranuleRejected { path, .. } => path.clone(),
            Self::Observations { observations } => observations
                .first()
                .map_or_else(String::new, |o| o.platform.clone()),
            Self::RenderJob { job } => job.digest().to_string(),
            Self::RenderDone { key, .. } => key.to_string(),
        }
    }
}

/// Periods in order as runs without a gap, or as one if those are too many as well; none if they can be listed.
fn folded(periods: &[Period]) -> Option<Vec<Period>> {
    if periods.len() <= MAX_PERIODS {
        return None;
    }
    let mut runs: Vec<Period> = vec![];
    for period in periods {
        match runs.last_mut() {
            Some(last) if last.end >= period.start => last.end = last.end.max(period.end),
            _ => runs.push(*period),
        }
    }
    if let (true, Some(first), Some(last)) = (runs.len() > MAX_PERIODS, runs.first(), runs.last()) {
        runs = vec![Period {
            start: first.start,
            end: last.end,
        }];
    }
    Some(runs)
}

impl Event {
    /// An event of this version.
    pub fn new(trace: impl Into<String>, body: Body) -> Self {
        Self {
            schema: EVENT_SCHEMA,
            trace: trace.into(),
            noticed: None,
            body,
        }
    }

    /// An event that follows from this one: same trace, same notice.
    #[must_use]
    pub fn followed_by(&self, body: Body) -> Self {
        Self {
            schema: EVENT_SCHEMA,
            trace: self.trace.clone(),
            noticed: self.noticed,
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
        if !(OLDEST_EVENT_SCHEMA..=EVENT_SCHEMA).contains(&version.schema) {
            return Err(bad(format!(
                "schema {} is unknown, this program reads {OLDEST_EVENT_SCHEMA} to {EVENT_SCHEMA}",
                version.schema
            )));
        }
        let event: Self = serde_json::from_str(text).map_err(|e| bad(e.to_string()))?;
        if event.trace.len() > MAX_TRACE_BYTES || event.trace.chars().any(char::is_control) {
            return Err(bad(format!(
                "a trace is at most {MAX_TRACE_BYTES} printable bytes"
            )));
        }
        match &event.body {
            Body::Observations { observations } if observations.len() > MAX_OBSERVATIONS => Err(
                bad(format!("it has more than {MAX_OBSERVATIONS} observations")),
            ),
            Body::Observations { observations } => {
                observations.iter().try_for_each(Observation::validate)?;
                Ok(event)
            }
            Body::RenderJob { job } => job.validate().map(|()| event),
            _ => Ok(event),
        }
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
        assert_eq!(event.body.topic(), Topic::GranuleNotice);
        assert_eq!(event.to_json(), NOTICE_V1);
    }

    #[test]
    fn a_notice_says_which_index_is_read_of_a_further_dimension() {
        let json = NOTICE_V1.replace(
            "\"product\":null",
            "\"product\":null,\"indexes\":[\"depth=2\"]",
        );
        let event = Event::from_json(&json).unwrap();
        let Body::GranuleNotice { indexes, .. } = &event.body else {
            panic!("{event:?}")
        };
        assert_eq!(indexes[0].to_string(), "depth=2");
        assert_eq!(event.to_json(), json);
        assert!(Event::from_json(&json.replace("depth=2", "depth")).is_err());
    }

    const LANDED_V1: &str = r#"{"schema":1,"trace":"t","body":{"kind":"granule.landed","path":"a.nc","raw_sha256":"e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855","manifest":"p@1-00000000","periods":[{"start":"2000-01-01T00:00:00Z","end":"2000-02-01T00:00:00Z"}],"revised":false}}"#;

    #[test]
    fn a_landed_file_of_version_1_still_parses() {
        let event = Event::from_json(LANDED_V1).unwrap();
        assert_eq!(event.to_json(), LANDED_V1);
    }

    fn landed(periods: &[Period]) -> (Vec<Period>, Option<u64>) {
        let (sha, manifest) = (Digest::of(b""), "p@1-00000000".parse().unwrap());
        let body = Body::granule_landed("a".repeat(4096), sha, manifest, periods, false);
        let event = Event::new("t".repeat(MAX_TRACE_BYTES), body);
        let json = event.to_json();
        assert!(json.len() < MAX_EVENT_BYTES / 4, "{} bytes", json.len());
        assert_eq!(Event::from_json(&json).unwrap(), event);
        match event.body {
            Body::GranuleLanded {
                periods,
                step_count,
                ..
            } => (periods, step_count),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn a_landed_file_of_very_many_steps_is_told_in_a_bounded_event() {
        let hour = 3_600_000;
        let at = |ms: i64| TimeMs::new(ms).unwrap();
        let every = |hours: i64, count: i64| -> Vec<Period> {
            let hourly = (0..count).map(|n| n * hours * hour);
            hourly
                .map(|ms| Period::new(at(ms), at(ms + hour)).unwrap())
                .collect()
        };
        let few = every(1, MAX_PERIODS as i64);
        assert_eq!(landed(&few), (few, None));
        let whole = Period::new(at(0), at(100_000 * hour)).unwrap();
        assert_eq!(landed(&every(1, 100_000)), (vec![whole], Some(100_000)));
        let mut gap = every(1, 100_000);
        gap.remove(50_000);
        let told = landed(&gap);
        assert_eq!((told.0.len(), told.1), (2, Some(99_999)));
        let gaps = every(2, 100_000);
        let extent = Period::new(at(0), gaps[99_999].end).unwrap();
        assert_eq!(landed(&gaps), (vec![extent], Some(100_000)));
    }

    #[test]
    fn another_version_is_named_in_the_refusal() {
        let error =
            Event::from_json(&NOTICE_V1.replace("\"schema\":1", "\"schema\":99")).unwrap_err();
        assert!(
            error.to_string().contains("schema 99 is unknown"),
            "{error}"
        );
    }

    #[test]
    fn what_follows_keeps_trace_and_notice() {
        let mut notice = Event::from_json(NOTICE_V1).unwrap();
        notice.noticed = Some("2020-01-01".parse().unwrap());
        let body = Body::ProductDerived {
            manifest: "p@1-00000000".parse().unwrap(),
            derived_from: "q@1-00000000".parse().unwrap(),
        };
        let derived = notice.followed_by(body);
        assert_eq!(
            (derived.trace.as_str(), derived.noticed),
            ("t", notice.noticed)
        );
        assert_eq!(Event::from_json(&derived.to_json()).unwrap(), derived);
    }

    #[test]
    fn a_job_beyond_its_limits_does_not_enter_as_an_event() {
        let text = r#"{"schema":1,"trace":"\u0007","body":{"kind":"granule.notice","path":"a","profile":null,"product":null}}"#;
        assert!(
            Event::from_json(text).is_err(),
            "control characters in a trace"
        );
    }

    #[test]
    fn unknown_fields_are_refused() {
        assert!(Event::from_json(&NOTICE_V1.replace("\"path\"", "\"extra\":1,\"path\"")).is_err());
    }
}
