//! A notice of a file in, landed product out: fetch, inspect, plan, decode, check, encode, put, commit.
//!
//! ```text
//! PendingNotice
//!   fetch    RawGranule        the file is here, and its digest known
//!   inspect  InspectedGranule  what it holds
//!   plan     PlannedGranule    what of it is read, and what that becomes
//!   decode   DecodedGrid       values of one step
//!   check    CheckedGrid       those of them that can be true
//!   encode   EncodedGrid       bytes of a field
//!   put      StoredGranule     all fields are durable
//!   commit   Answer            a manifest names them
//! ```
//! Files are parsed in a process of their own ([`reader`]); all else here sees only checked descriptions and numbers.
//! Left out on purpose: swaths and irregular grids (refused).

pub mod attach;
mod check;
mod commit;
mod decode;
mod encode;
mod error;
mod fetch;
mod figures;
mod generate;
mod ingestd;
mod inspect;
mod limits;
mod notice;
pub mod observation;
mod pipeline;
mod plan;
mod put;
pub mod reread;
mod settings;
mod survey;

pub use commit::landing_note::LandingNotes;
pub use error::{IngestError, Rejection};
pub use fetch::{AllowedHost, RetryLimits, Sources};
pub use generate::{GeneratedSteps, generate_china_sea, generate_globe};
pub use ingestd::{IngestService, ServiceSettings};
pub use inspect::reader;
pub use limits::Limits;
pub use notice::{Outcome, Wishes};
pub use pipeline::metrics::Metrics;
pub use pipeline::progress::{Progress, Quiet, Stage};
pub use plan::profile::{Profile, Profiles, shipped};
pub use put::reading::Readings;
pub use settings::{DecoderCommand, Settings};
pub use survey::{DATA_ENDINGS, Row, data_files, markdown, survey};
