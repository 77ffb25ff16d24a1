//! Notice of a file in, landed product out: fetch, inspect, plan, decode, check, encode, put, commit.
//!
//! ```text
//! path -> RawGranule -> InspectedGranule -> PlannedGranule -> DecodedGrid -> CheckedGrid -> EncodedGrid -> StoredGrid -> manifest
//!        fetch        inspect             plan              decode         check          encode         put           commit
//! ```
//! Files are parsed in a process of their own ([`decoder`]); all else here sees only checked descriptions and numbers.
//! Left out on purpose: swaths and irregular grids (refused), observations, downloads.

mod cf;
mod check;
mod commit;
mod decode;
pub mod decoder;
mod encode;
pub mod error;
mod fetch;
mod file;
mod generate;
mod inspect;
mod land;
mod outcome;
mod pipeline;
mod plan;
mod profile;
mod progress;
mod put;
mod rejection;
mod service;
mod settings;
mod unit;

pub use error::IngestError;
pub use generate::generate_china_sea;
pub use land::{Batch, land_files};
pub use outcome::Outcome;
pub use profile::{Profile, shipped};
pub use progress::{Progress, Quiet, Stage};
pub use rejection::Rejection;
pub use service::IngestService;
pub use settings::{DecoderCommand, Limits, Settings};
