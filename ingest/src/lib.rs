//! A notice of a file in, landed product out: fetch, inspect, plan, decode, check, encode, put, commit.
//!
//! ```text
//! notice -> RawGranule -> InspectedGranule -> PlannedGranule -> DecodedGrid -> CheckedGrid -> EncodedGrid -> StoredGrid -> manifest
//!          fetch        inspect             plan              decode         check          encode         put           commit
//! ```
//! Files are parsed in a process of their own ([`reader`]); all else here sees only checked descriptions and numbers.
//! Left out on purpose: swaths and irregular grids (refused).

mod check;
mod commit;
mod decode;
mod encode;
mod error;
mod fetch;
mod gc;
mod generate;
mod ingestd;
mod inspect;
mod land;
mod limits;
mod notice;
pub mod observation;
mod pipeline;
mod plan;
mod put;
pub mod reread;
mod settings;
mod survey;

pub use error::{IngestError, Rejection};
pub use fetch::{AllowedHost, RetryLimits, Sources};
pub use gc::{LandingNotes, Readings};
pub use generate::{GeneratedSteps, generate_china_sea};
pub use ingestd::{IngestService, ServiceSettings};
pub use inspect::reader;
pub use land::{Batch, land_files};
pub use limits::Limits;
pub use notice::Outcome;
pub use pipeline::metrics::Metrics;
pub use pipeline::progress::{Progress, Quiet, Stage};
pub use plan::profile::{Profile, Profiles, shipped};
pub use settings::{DecoderCommand, Settings};
pub use survey::{Row, data_files, markdown, survey};
