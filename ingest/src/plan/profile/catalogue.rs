//! The profiles that files are tried with: the user's own first, then those of the program.

use std::path::Path;
use std::sync::Arc;

use super::{Profile, listed, shipped};
use crate::error::IngestError;

/// Most profiles of a folder.
const MAX_PROFILES: usize = 1000;

/// All profiles, in the order in which they are tried.
#[derive(Debug, Clone)]
pub struct Profiles(Arc<[Profile]>);

impl FromIterator<Profile> for Profiles {
    /// Those, in their order, and no others.
    fn from_iter<I: IntoIterator<Item = Profile>>(profiles: I) -> Self {
        Self(profiles.into_iter().collect())
    }
}

impl Profiles {
    /// Those that come with the program.
    pub fn shipped() -> Self {
        shipped().iter().cloned().collect()
    }

    /// Those in a folder (`*.toml`, in the order of their names), then those that come with the program.
    pub fn with_folder(folder: &Path) -> Result<Self, IngestError> {
        let bad = |detail: String| IngestError::Setting {
            setting: "profiles",
            detail: format!("{}: {detail}", folder.display()),
        };
        let entries = std::fs::read_dir(folder).map_err(|e| bad(e.to_string()))?;
        let mut files = entries
            .map(|entry| entry.map(|entry| entry.path()))
            .collect::<Result<Vec<_>, _>>()
            .map_err(|e| bad(e.to_string()))?;
        files.retain(|file| {
            file.extension()
                .is_some_and(|extension| extension == "toml")
        });
        files.sort();
        if files.len() > MAX_PROFILES {
            return Err(bad(format!("has more than {MAX_PROFILES} profiles")));
        }
        let own = files.iter().map(|file| Profile::load(file));
        let own = own.collect::<Result<Vec<_>, _>>()?;
        Ok(own.into_iter().chain(shipped().iter().cloned()).collect())
    }

    pub(crate) fn iter(&self) -> impl Iterator<Item = &Profile> {
        self.0.iter()
    }

    /// The profile of a name.
    ///
    /// # Errors
    /// There is none; the names that there are.
    pub fn named(&self, name: &str) -> Result<Profile, IngestError> {
        let found = self.iter().find(|profile| profile.name == name);
        found.cloned().ok_or_else(|| IngestError::Profile {
            name: name.to_owned(),
            detail: format!("is none of {}", listed(&self.0)),
        })
    }

    /// The profile for files of a collection, as notices of other systems name it.
    pub(crate) fn of_collection(&self, collection: &str) -> Option<&Profile> {
        self.iter()
            .find(|profile| profile.is_for_collection(collection))
    }
}
