//! Profiles: how a family of files that does not follow CF, or says what is not so, maps to a product.
//!
//! A profile is a TOML file (see `profiles/` for the shipped ones). Everything in it overrides what the file says.

mod catalogue;
pub(crate) mod pattern;
mod shipped;

use std::path::Path;

use contract::digest::Digest;
use contract::grid::Grid;
use contract::product::ProductId;
use contract::quantity::Quantity;
use serde::Deserialize;

use crate::error::IngestError;
use crate::inspect::file::description::{AttributeValue, Description};
use crate::plan::cf::axis::Registration;
use crate::plan::cf::period::{Covers, StampAt};
use crate::plan::cf::quantity::has_direction;

pub use catalogue::Profiles;
pub use shipped::shipped;

/// Largest profile, bytes.
const MAX_PROFILE_BYTES: u64 = 1 << 20;
/// Names of profiles that a message lists: a refusal of a file is cut at 300 characters.
const LISTED_BYTES: usize = 200;

/// How a family of files maps to a product.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Profile {
    /// Name, by which it is chosen.
    pub name: String,
    pub(crate) product: ProductId,
    pub(crate) title: String,
    /// Citation.
    pub(crate) source: String,
    pub(crate) quantity: Quantity,
    #[serde(default)]
    pub(crate) synthetic: bool,
    /// Which files it is chosen for by itself; never, if absent.
    #[serde(default, rename = "match")]
    matches: Option<Match>,
    pub(crate) variable: VariableRules,
    #[serde(default)]
    pub(crate) grid: GridRules,
    #[serde(default)]
    pub(crate) time: Option<TimeRules>,
    pub(crate) quality: Option<QualityRules>,
    /// Hash of all of it but the name and which files it is chosen for.
    #[serde(skip)]
    rules: Option<Digest>,
}

/// Which files a profile is for: all that is stated must hold.
#[derive(Debug, Clone, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct Match {
    /// Pattern of the file name: `*` any text, `?` any character.
    file_name: Option<String>,
    /// Variables that must be there.
    #[serde(default)]
    variables: Vec<String>,
    /// Variables that must not.
    #[serde(default)]
    absent: Vec<String>,
    /// Attributes of the file and the text (or number) they must have.
    #[serde(default)]
    attributes: std::collections::BTreeMap<String, toml::Value>,
    /// Collections, as notices of other systems name them, whose files are of this family whatever else is stated.
    #[serde(default)]
    collections: Vec<String>,
}

/// The variable to land, and what the file says wrong about it.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct VariableRules {
    pub(crate) name: String,
    pub(crate) unit: Option<String>,
    /// Is a positive value into the sea in this file? The standard name says, if absent.
    pub(crate) positive_into_sea: Option<bool>,
    pub(crate) fill_values: Option<Vec<f64>>,
    /// Values outside are no data; in the file's unit, unpacked.
    pub(crate) valid_range: Option<[f64; 2]>,
    pub(crate) scale_factor: Option<f64>,
    pub(crate) add_offset: Option<f64>,
}

/// Which cells are good enough, by another variable of the file; all that is stated must hold.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct QualityRules {
    /// The variable that says how good every cell is.
    pub(crate) variable: String,
    /// Lowest and highest level that is good enough; unpacked.
    pub(crate) at_least: Option<f64>,
    pub(crate) at_most: Option<f64>,
    /// Names of `flag_meanings`: at least one of these must be set,
    #[serde(default)]
    pub(crate) keep_flags: Vec<String>,
    /// and none of these.
    #[serde(default)]
    pub(crate) reject_flags: Vec<String>,
    /// Stored numbers that are not good enough, where names are missing or wrong.
    #[serde(default)]
    pub(crate) reject_values: Vec<f64>,
}

/// Where the cells are.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct GridRules {
    pub(crate) registration: Option<Registration>,
    /// Names of the coordinate variables.
    pub(crate) latitude: Option<String>,
    pub(crate) longitude: Option<String>,
    /// The grid of a file that has no axes.
    pub(crate) stated: Option<StatedGrid>,
}

/// A grid that is nowhere in the file.
#[derive(Debug, Clone, Deserialize)]
pub(crate) struct StatedGrid {
    /// Edges and cells, row 0 north.
    #[serde(flatten)]
    pub(crate) grid: Grid,
    /// Is the first row of the file the northernmost?
    pub(crate) north_first: bool,
    /// Names of the latitude and longitude dimensions, where the file names them; else the last two dimensions.
    pub(crate) dimensions: Option<[String; 2]>,
}

/// Where the time comes from.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct TimeRules {
    pub(crate) from: TimeSource,
    pub(crate) covers: Covers,
    /// Where in its step a stamp stands; if absent, at the start of days and hours, anywhere in a month or year.
    pub(crate) stamp: Option<StampAt>,
    /// The year that replaces the one of the file: the reference year of a climatology.
    pub(crate) year: Option<i32>,
}

/// A source of time.
#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub(crate) enum TimeSource {
    /// A variable, with the unit and calendar the file lacks or has wrong.
    Variable {
        name: String,
        unit: Option<String>,
        calendar: Option<String>,
    },
    /// An attribute of the file, such as `time_coverage_start`.
    Attribute(String),
    /// The name of the file, with `{year}`, `{month}`, `{day}`, `{day_of_year}`, `*` and `?`.
    FileName(String),
    /// The n-th step is the n-th month of `year`.
    MonthNumber,
    /// One step whose stamp is this.
    Fixed(contract::time::TimeMs),
}

impl Profile {
    /// Reads a profile from TOML.
    pub fn parse(name: &str, text: &str) -> Result<Self, IngestError> {
        let bad = |detail: String| IngestError::Profile {
            name: name.to_owned(),
            detail,
        };
        let not_toml = |e: toml::de::Error| bad(e.to_string().replace('\n', " "));
        let mut profile: Self = toml::from_str(text).map_err(not_toml)?;
        let mut rules: toml::Table = toml::from_str(text).map_err(not_toml)?;
        for beside in ["name", "match"] {
            rules.remove(beside);
        }
        profile.rules = Some(Digest::of_json(&rules));
        if let Some(unit) = &profile.variable.unit {
            let read = crate::plan::unit::of(profile.quantity, unit);
            read.map_err(|e| bad(format!("unit {unit:?} {e}")))?;
        }
        if let Some(TimeRules {
            from: TimeSource::FileName(pattern),
            year,
            ..
        }) = &profile.time
        {
            pattern::check(pattern, year.is_some()).map_err(bad)?;
        }
        if profile.variable.positive_into_sea == Some(true) && !has_direction(profile.quantity) {
            let quantity = profile.quantity.title().to_lowercase();
            return Err(bad(format!(
                "states positive_into_sea, which {quantity} cannot be; leave it out"
            )));
        }
        let empty = |rules: &QualityRules| {
            rules.at_least.or(rules.at_most).is_none()
                && rules.keep_flags.is_empty()
                && rules.reject_flags.is_empty()
                && rules.reject_values.is_empty()
        };
        if profile.quality.as_ref().is_some_and(empty) {
            let detail = "states no rule in [quality]; give at_least, at_most, keep_flags, reject_flags or reject_values";
            return Err(bad(detail.to_owned()));
        }
        if let Some(stated) = &profile.grid.stated {
            stated.grid.validate()?;
        }
        Ok(profile)
    }

    /// Reads a profile file.
    pub fn load(path: &Path) -> Result<Self, IngestError> {
        let name = path.display().to_string();
        let bad = |e: std::io::Error| IngestError::Profile {
            name: name.clone(),
            detail: format!("cannot be read: {e}"),
        };
        if std::fs::metadata(path).map_err(bad)?.len() > MAX_PROFILE_BYTES {
            return Err(IngestError::Profile {
                name,
                detail: format!("is larger than {MAX_PROFILE_BYTES} bytes"),
            });
        }
        let text = std::fs::read_to_string(path).map_err(bad)?;
        Self::parse(&name, &text)
    }

    /// A shipped profile by its name, or a profile file by its path.
    pub fn find(name_or_path: &str) -> Result<Self, IngestError> {
        if let Some(profile) = shipped().iter().find(|p| p.name == name_or_path) {
            return Ok(profile.clone());
        }
        if Path::new(name_or_path).is_file() {
            return Self::load(Path::new(name_or_path));
        }
        Err(IngestError::Profile {
            name: name_or_path.to_owned(),
            detail: format!("is no file and none of {}", listed(shipped())),
        })
    }

    /// Is the profile for the files of a collection?
    fn is_for_collection(&self, collection: &str) -> bool {
        let rules = self.matches.as_ref();
        rules.is_some_and(|rules| rules.collections.iter().any(|name| name == collection))
    }

    /// Hash of what it says of the files that are read by it: comments, order and layout do not matter.
    pub(crate) fn rules(&self) -> Digest {
        self.rules.expect("a profile is parsed from its text")
    }

    /// Is the profile for this file?
    pub(crate) fn is_for(&self, file_name: &str, file: &Description) -> bool {
        let Some(rules) = &self.matches else {
            return false;
        };
        let by_content = Match {
            collections: vec![],
            ..rules.clone()
        };
        if by_content == Match::default() {
            return false;
        }
        let attribute_is =
            |(name, wanted): (&String, &toml::Value)| match (file.attributes.0.get(name), wanted) {
                (Some(AttributeValue::Text(_)), toml::Value::String(wanted)) => file
                    .attributes
                    .text(name)
                    .is_some_and(|text| pattern::matches(wanted, text)),
                (Some(AttributeValue::Numbers { .. }), toml::Value::Integer(wanted)) => {
                    file.attributes.number(name) == Some(*wanted as f64)
                }
                (Some(AttributeValue::Numbers { .. }), toml::Value::Float(wanted)) => {
                    file.attributes.number(name) == Some(*wanted)
                }
                _ => false,
            };
        rules
            .file_name
            .as_ref()
            .is_none_or(|p| pattern::matches(p, file_name))
            && rules
                .variables
                .iter()
                .all(|name| file.variable(name).is_some())
            && rules
                .absent
                .iter()
                .all(|name| file.variable(name).is_none())
            && rules.attributes.iter().all(attribute_is)
    }
}

/// Names of profiles, as many whole ones as fit in a line.
fn listed(profiles: &[Profile]) -> String {
    let (mut text, mut left) = (String::new(), profiles.len());
    for profile in profiles {
        if text.len() + profile.name.len() > LISTED_BYTES {
            return format!("{text} and {left} more");
        }
        if !text.is_empty() {
            text.push_str(", ");
        }
        text.push_str(&profile.name);
        left -= 1;
    }
    text
}
