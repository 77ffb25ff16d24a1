//! What a reading of a file follows from, besides the file: this program's way of decoding, and the profile.

use contract::digest::Digest;
use serde::{Deserialize, Serialize};

use crate::plan::profile::Profile;

/// Version of the way from a file's bytes to a field's. It is raised with every change that gives other values or other
/// fields for some file; what was read by an older one is then stale. A test compares the bytes of a known file.
///
/// 2: masked cells are counted, valid ranges are read as CF says.
pub(crate) const DECODER: u32 = 2;

/// How a file was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Recipe {
    /// [`DECODER`] of the program that read it.
    pub(crate) decoder: u32,
    /// The profile; none for a file that follows CF.
    pub(crate) profile: Option<Used>,
}

/// The profile that a file was read by.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Used {
    /// Its name.
    pub(crate) name: String,
    /// Hash of what it says of such files.
    pub(crate) rules: Digest,
}

impl Recipe {
    /// How this program reads a file by a profile.
    pub(crate) fn of(profile: Option<&Profile>) -> Self {
        let used = |profile: &Profile| Used {
            name: profile.name.clone(),
            rules: profile.rules(),
        };
        Self {
            decoder: DECODER,
            profile: profile.map(used),
        }
    }

    /// Hash of everything that shapes the reading of a file: its bytes, its name (which may hold its date) and this.
    pub(crate) fn input(&self, raw_sha256: Digest, file_name: &str) -> Digest {
        let rules = self.profile.as_ref().map(|used| used.rules);
        Digest::of_json(&("reading", raw_sha256, file_name, self.decoder, rules))
    }
}
