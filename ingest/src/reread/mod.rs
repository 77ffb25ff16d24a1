//! Files that landed, read anew from the store: after a change of the decoder or of a profile, without their source.
//!
//! The plan follows from the manifest and from what is noted of every reading; what is read is noted in turn, so that a
//! run that was killed goes on where it was. Readers see the old version until all files are read; then the next
//! manifest is published, whole. Old versions stay until they are cleaned up. Left out on purpose: files of
//! observations, which replace themselves when they are sent again.

mod mend;
mod plan;
mod run;
mod told;

use std::path::PathBuf;
use std::sync::Arc;

use contract::digest::Digest;
use contract::index::DimensionIndex;
use contract::manifest::ManifestId;
use contract::product::ProductId;
use contract::time::{Period, TimeMs};
use serde::Serialize;

use crate::limits::gates::Gates;
use crate::plan::profile::Profile;
use crate::settings::Settings;

pub use mend::mend;
pub use plan::plan;
pub use run::run;
pub use told::events;

/// What is to be read anew.
#[derive(Debug, Clone)]
pub struct Request {
    /// The product that the files landed in.
    pub product: ProductId,
    /// First instant; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after the period; the product's end if absent.
    pub to: Option<TimeMs>,
    /// How to read them; as before, by the profile of the same name as it is now, if absent.
    pub profile: Option<Profile>,
    /// Whether also what is right by its name is read again and compared.
    pub is_forced: bool,
    /// Whether what is there is read first, and taken for missing if it is damaged.
    pub is_verified: bool,
}

/// What runs work with; clones share its limits.
#[derive(Debug, Clone)]
pub struct Workplace {
    /// How files are read.
    pub settings: Settings,
    /// Folder for files while they are read.
    spool: PathBuf,
    /// Most bytes in it.
    spool_bytes: u64,
    /// Bounds what is worked on at the same time.
    gates: Arc<Gates>,
}

impl Workplace {
    /// A place to work, with at most `spool_bytes` of files in the folder `spool` while they are read.
    pub fn new(settings: Settings, spool: PathBuf, spool_bytes: u64) -> Self {
        Self {
            gates: Arc::new(Gates::new(&settings)),
            settings,
            spool,
            spool_bytes,
        }
    }
}

/// Why a file is read.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Reason {
    /// It is not known how it was read, or what it was read as is gone.
    Missing,
    /// It was read in another way than it would be now.
    Stale,
    /// It was asked for.
    Forced,
}

/// One file.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Item {
    /// Name that it came with.
    pub file: String,
    /// Its digest.
    pub raw_sha256: Digest,
    /// Its steps in the product, in the order of time.
    pub periods: Vec<Period>,
    /// Why.
    pub reason: Reason,
    /// Has it been read already, and only waits for the others?
    pub is_read: bool,
    #[serde(skip)]
    by: By,
}

/// How a file is read.
#[derive(Debug, Clone, PartialEq)]
enum By {
    /// By whichever profile fits what is in it, else by the CF conventions.
    Found,
    /// By the profile that the request gives.
    Given,
    /// By a known profile of this name.
    Named(String),
    /// By the CF conventions, the variable of this name.
    Variable(String),
}

/// What would be done.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// The version that it was made for.
    pub manifest: ManifestId,
    /// Files in the order of time.
    pub items: Vec<Item>,
    /// How many files are right as they are.
    pub fresh_count: usize,
    /// The indexes of further dimensions that all of the product's files are read at.
    #[serde(skip)]
    indexes: Vec<DimensionIndex>,
}

impl Plan {
    /// How many files are still to be read.
    pub fn unread_count(&self) -> usize {
        self.items.iter().filter(|item| !item.is_read).count()
    }
}
