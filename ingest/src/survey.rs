//! Files in, a table out: which of them land, as what, and why the others do not. Nothing is kept.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use async_trait::async_trait;
use contract::index::DimensionIndex;
use contract::observation::Observation;
use storage::Store;
use storage::log::EmbeddedLog;

use crate::error::IngestError;
use crate::ingestd::IngestService;
use crate::notice::{Outcome, Wishes};
use crate::observation::{ObservationSink, SinkError, Stored};
use crate::pipeline::metrics::class;
use crate::pipeline::progress::Quiet;
use crate::settings::Settings;

/// Endings of files that may hold data; documentation beside them is passed over.
pub const DATA_ENDINGS: [&str; 10] = [
    "nc", "nc4", "cdf", "h5", "hdf", "hdf5", "csv", "tsv", "tab", "dat",
];
/// Folders below a folder that are looked into.
const MAX_DEPTH: usize = 16;

/// What became of a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// The folder that it lies in.
    pub set: String,
    /// Its name.
    pub file: String,
    /// The profile that it was read with; none if it follows CF, holds observations, or was refused before that was known.
    pub profile: Option<String>,
    /// What became of it.
    pub outcome: Outcome,
}

/// Data files of a folder and the folders below it, sorted; a file is itself.
///
/// # Errors
/// A folder cannot be read.
pub fn data_files(path: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    gather(path, MAX_DEPTH, &mut found)?;
    found.sort();
    Ok(found)
}

fn gather(path: &Path, depth: usize, found: &mut Vec<PathBuf>) -> std::io::Result<()> {
    if !path.is_dir() {
        found.push(path.to_owned());
        return Ok(());
    }
    for entry in std::fs::read_dir(path)? {
        let entry = entry?;
        let (path, kind) = (entry.path(), entry.file_type()?);
        let ending = path
            .extension()
            .unwrap_or_default()
            .to_string_lossy()
            .to_lowercase();
        if kind.is_dir() && depth > 0 {
            gather(&path, depth - 1, found)?;
        } else if kind.is_file() && DATA_ENDINGS.contains(&ending.as_str()) {
            found.push(path);
        }
    }
    Ok(())
}

/// Lands each file in a store that is thrown away, one store for the files of a folder, and tells what became of it. Of further
/// dimensions all of them are read at `indexes`.
pub async fn survey(
    files: &[PathBuf],
    indexes: &[DimensionIndex],
    settings: &Settings,
) -> Result<Vec<Row>, IngestError> {
    let wishes = Wishes {
        indexes: indexes.to_vec(),
        ..Wishes::default()
    };
    let mut sets: BTreeMap<&Path, Vec<PathBuf>> = BTreeMap::new();
    for file in files {
        let folder = file.parent().unwrap_or(Path::new(""));
        sets.entry(folder).or_default().push(file.clone());
    }
    let folders: Vec<&Path> = sets.keys().copied().collect();
    let mut rows = Vec::with_capacity(files.len());
    for (folder, files) in &sets {
        let log = Arc::new(EmbeddedLog::memory());
        let service = IngestService::new(Store::memory(), log, settings.clone())
            .with_observations(Arc::new(Passing));
        service.notify_of(files, &wishes).await?;
        let outcomes = service.drain(&Quiet).await?;
        let set = set_name(folder, &folders);
        rows.extend(outcomes.into_iter().map(|outcome| Row {
            set: set.clone(),
            file: name_of(outcome.file()),
            profile: match &outcome {
                Outcome::Landed { profile, .. } => profile.clone(),
                _ => None,
            },
            outcome,
        }));
    }
    Ok(rows)
}

fn name_of(file: &Path) -> String {
    let name = file.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// The last parts of a folder's path that tell it from the others; a year alone is no name.
fn set_name(folder: &Path, folders: &[&Path]) -> String {
    // That of a name alone, without a folder before it.
    if folder.as_os_str().is_empty() {
        return ".".to_owned();
    }
    let parts: Vec<_> = folder.components().collect();
    let name = |parts: &[std::path::Component<'_>]| parts.iter().collect::<PathBuf>();
    for first in (0..parts.len()).rev() {
        let own = name(&parts[first..]);
        let is_shared = folders.iter().filter(|other| other.ends_with(&own)).count() > 1;
        let text = own.display().to_string();
        if !is_shared && !text.bytes().all(|b| b.is_ascii_digit()) {
            return text;
        }
    }
    folder.display().to_string()
}

/// Keeps no observations.
struct Passing;

#[async_trait]
impl ObservationSink for Passing {
    async fn put(&self, observations: Vec<Observation>) -> Result<Stored, SinkError> {
        let new = observations.len() as u64;
        Ok(Stored {
            new,
            ..Stored::default()
        })
    }
}

/// The rows as a Markdown table: files of one set that fared alike are one line.
pub fn markdown(rows: &[Row]) -> String {
    let mut lines: Vec<(String, String, usize)> = Vec::new();
    for row in rows {
        let (how, result) = cells(row);
        let known = lines
            .iter_mut()
            .find(|(set, told, _)| *set == row.set && *told == format!("{how} | {result}"));
        match known {
            Some((_, _, files)) => *files += 1,
            None => lines.push((row.set.clone(), format!("{how} | {result}"), 1)),
        }
    }
    let mut text = "| set | files | read by | result |\n|---|---|---|---|\n".to_owned();
    for (set, told, files) in lines {
        writeln!(text, "| `{}` | {files} | {told} |", plain(&set))
            .expect("a string takes everything");
    }
    text
}

/// How a file was read, and what became of it.
fn cells(row: &Row) -> (String, String) {
    let by = row
        .profile
        .as_ref()
        .map_or_else(|| "CF".to_owned(), |name| format!("`{name}`"));
    match &row.outcome {
        Outcome::Landed { manifest, .. }
        | Outcome::AlreadyLanded { manifest, .. }
        | Outcome::Superseded { manifest, .. } => (by, format!("lands in `{}`", manifest.product)),
        Outcome::Observed { .. } => (
            "observations".to_owned(),
            "stored as observations".to_owned(),
        ),
        Outcome::Rejected {
            reason,
            object,
            detail,
            ..
        } => {
            let why = plain(&format!("{object}: {detail}"));
            (
                "-".to_owned(),
                format!("refused ({}): {why}", class(*reason)),
            )
        }
    }
}

/// Text that cannot end a cell of a table.
fn plain(text: &str) -> String {
    text.replace('|', "\\|")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::error::Rejection;
    use contract::event::RejectReason;

    #[test]
    fn sets_are_told_apart_by_the_last_parts_of_their_paths() {
        let folders = ["/a/SST/2010", "/a/wind/2010", "/a/ice/2011", "/a/x"].map(Path::new);
        let names = folders.map(|folder| set_name(folder, &folders));
        assert_eq!(names, ["SST/2010", "wind/2010", "ice/2011", "x"]);
        assert_eq!(set_name(Path::new(""), &[Path::new("")]), ".");
    }

    #[test]
    fn files_that_fared_alike_are_one_line() {
        let refused = |file: &str| {
            let rejection = Rejection::new(RejectReason::Grid, "lon", "is a swath | grid it first");
            Row {
                set: "swaths".to_owned(),
                file: file.to_owned(),
                profile: None,
                outcome: Outcome::rejected(file.into(), rejection),
            }
        };
        let text = markdown(&[refused("a.nc"), refused("b.nc")]);
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert_eq!(
            lines[2],
            "| `swaths` | 2 | - | refused (grid): lon: is a swath \\| grid it first |"
        );
    }
}
