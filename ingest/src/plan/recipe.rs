//! What a reading of a file follows from, besides the file: this program's way of decoding, and the profile.

use contract::digest::Digest;
use contract::index::DimensionIndex;
use serde::{Deserialize, Serialize};

use super::Wish;
use crate::plan::profile::Profile;

/// Version of the way from a file's bytes to a field's. It is raised with every change that gives other values or other
/// fields for some file; what was read by an older one is then stale. A test compares the bytes of a known file.
///
/// 2: masked cells are counted, valid ranges are read as CF says.
/// 3: fugacity is told from partial pressure, and temperatures of the sea surface by their depth.
/// 4: cells lie where the bounds of axes say, and extremes and spreads over time are not taken for the quantity.
/// 5: steps of calendars of models are counted in these, codes that values cannot hold are refused, salinity is read in the units that
///    the conventions have for it, and notes tell of all this and of labels that are not evenly spaced; what this program exported is what it was, and a flux of CO2 that
///    no standard name names is one where unit, names and `positive` say all.
/// 6: composites of days end with their year, a stated length and the coverage of one step must agree, coverage ends after the month or
///    year that it names, numbers in units are decimal, codes of floating point are held to what values can hold, cells that nobody wrote
///    hold no data beside a `missing_value` too, and when a forecast was begun is no time of its values.
/// 7: scales, offsets and fill values count that are written as text, what is made of synthetic products is synthetic, and notes tell how
///    far before the poles a grid ends whose latitudes are evened.
/// 8: places in degrees west and south are turned, bounds and the time coordinate that cannot be read are not taken for none, valid ranges
///    count that are written as text, packed bounds of times are unpacked, weeks are not counted from 1 January, differences of
///    temperatures and percentiles are not taken for the quantity, and notes tell of steps without any value and of climatologies.
/// 9: axes of single precision lie at the round numbers that they stand for, bounds of axes are read in every shape that has one
///    meaning, and axes of one label whose bounds say how wide their cell is are read.
/// 10: axes lie where their labels say, as exactly as these do, and at round numbers only as far as labels leave room for them.
pub(crate) const DECODER: u32 = 10;

/// How a file was read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Recipe {
    /// [`DECODER`] of the program that read it.
    pub(crate) decoder: u32,
    /// The profile; none for a file that follows CF.
    pub(crate) profile: Option<Used>,
    /// The variable that was asked for, of a file that no profile was for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) variable: Option<String>,
    /// Which index was read of dimensions beside time and the map, in the order of their names.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) indexes: Vec<DimensionIndex>,
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
    /// How this program reads a file by a profile, or else by itself and maybe a variable that is asked for.
    pub(crate) fn of(wish: Wish<'_>) -> Self {
        let used = |profile: &Profile| Used {
            name: profile.name.clone(),
            rules: profile.rules(),
        };
        let variable = wish.variable.filter(|_| wish.profile.is_none());
        Self {
            decoder: DECODER,
            profile: wish.profile.map(used),
            variable: variable.map(str::to_owned),
            indexes: wish.indexes.to_vec(),
        }
    }

    /// Hash of everything that shapes the reading of a file: its bytes, its name (which may hold its date) and this.
    pub(crate) fn input(&self, raw_sha256: Digest, file_name: &str) -> Digest {
        let rules = self.profile.as_ref().map(|used| used.rules);
        let basis = ("reading", raw_sha256, file_name, self.decoder, rules);
        match (&self.variable, self.indexes.as_slice()) {
            (None, []) => Digest::of_json(&basis),
            (Some(variable), []) => Digest::of_json(&(basis, variable)),
            (variable, indexes) => Digest::of_json(&(basis, variable, indexes)),
        }
    }
}
