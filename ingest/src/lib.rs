//! A notice of a file in, landed product out: fetch, inspect, plan, decode, check, encode, put, commit.
//!
//! ```text
//! notice -> RawGranule -> InspectedGranule -> PlannedGranule -> DecodedGrid -> CheckedGrid -> EncodedGrid -> StoredGrid -> manifest
//!          fetch        inspect             plan              decode         check          encode         put           commit
//! ```
//! Files are parsed in a process of their own ([`decoder`]); all else here sees only checked descriptions and numbers.
//! Left out on purpose: swaths and irregular grids (refused).

mod answer;
mod blame;
mod boundary;
mod cf;
mod check;
mod commit;
mod decode;
pub mod decoder;
mod encode;
pub mod error;
mod fetch;
mod file;
mod gates;
mod gc;
mod generate;
mod ingestd;
mod inspect;
mod land;
mod landing_note;
mod limits;
mod memory;
mod metrics;
mod notice;
pub mod observation;
mod outcome;
mod pipeline;
mod plan;
mod profile;
mod progress;
mod put;
mod reading;
mod recipe;
mod rejection;
pub mod reread;
mod room;
mod settings;
mod source_wait;
mod superseded;
mod survey;
mod unit;

pub use error::IngestError;
pub use fetch::{AllowedHost, RetryLimits, Sources};
pub use gc::{LandingNotes, Readings};
pub use generate::{GeneratedSteps, generate_china_sea};
pub use ingestd::{IngestService, ServiceSettings};
pub use land::{Batch, land_files};
pub use limits::Limits;
pub use metrics::Metrics;
pub use outcome::Outcome;
pub use profile::{Profile, Profiles, shipped};
pub use progress::{Progress, Quiet, Stage};
pub use rejection::Rejection;
pub use settings::{DecoderCommand, Settings};
pub use survey::{Row, data_files, markdown, survey};
