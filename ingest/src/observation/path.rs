//! A path in, the observations of its file out: for the command line and for tests; the service has its own way to files.

use std::io::Read as _;
use std::path::Path;

use contract::event::RejectReason;
use contract::product::ProductId;

use super::{Found, MAX_TEXT_BYTES, Source, read, read_text, recognise, recognise_text};
use crate::inspect::reader::session::Session;
use crate::error::{IngestError, Rejection, Stop};
use crate::limits::Limits;
use crate::settings::Settings;

/// Bytes that tell of which kind a text file is.
const HEAD_BYTES: u64 = 256 << 10;

/// What a file is to observations.
#[derive(Debug, Clone, PartialEq)]
pub enum Reading {
    /// Its observations.
    Observations(Found),
    /// One of observations that cannot be read, or no file that can be read at all.
    Refused(Rejection),
    /// A file of something else: a grid, perhaps.
    Other,
}

/// Reads a file of observations; `dataset` is named by the file if absent.
pub async fn read_path(
    path: &Path,
    dataset: Option<&ProductId>,
    settings: &Settings,
) -> Result<Reading, IngestError> {
    match reading(path, dataset, settings).await {
        Ok(reading) => Ok(reading),
        Err(Stop::Rejected(rejection)) => Ok(Reading::Refused(rejection)),
        Err(Stop::Failed(error)) => Err(error),
    }
}

async fn reading(
    path: &Path,
    dataset: Option<&ProductId>,
    settings: &Settings,
) -> Result<Reading, Stop> {
    let file_name = path
        .file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned();
    let (owned, name, limits) = (path.to_owned(), file_name.clone(), settings.limits);
    let wanted = dataset.cloned();
    let text = tokio::task::spawn_blocking(move || {
        let source = Source {
            file_name: &name,
            dataset: wanted.as_ref(),
        };
        text(&owned, source, limits)
    })
    .await
    .map_err(IngestError::from)??;
    if let Some(found) = text {
        return Ok(Reading::Observations(found));
    }
    let (mut session, description) = Session::open(path, settings).await?;
    if recognise(&description).is_none() {
        return Ok(Reading::Other);
    }
    let source = Source {
        file_name: &file_name,
        dataset,
    };
    read(&mut session, &description, source)
        .await
        .map(Reading::Observations)
}

/// Observations of a text file; none if it is no text of observations.
fn text(path: &Path, source: Source<'_>, limits: Limits) -> Result<Option<Found>, Rejection> {
    let unreadable = |e: std::io::Error| {
        Rejection::new(
            RejectReason::Unreadable,
            "file",
            format!("cannot be read: {e}"),
        )
    };
    let metadata = std::fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(Rejection::new(
            RejectReason::Unreadable,
            "file",
            "is no regular file; give a file",
        ));
    }
    if metadata.len() > limits.file_bytes {
        let detail = format!(
            "has {} bytes, at most {} are read",
            metadata.len(),
            limits.file_bytes
        );
        return Err(Rejection::new(RejectReason::TooLarge, "file", detail));
    }
    let mut file = std::fs::File::open(path).map_err(unreadable)?;
    let mut content = vec![];
    (&mut file)
        .take(HEAD_BYTES)
        .read_to_end(&mut content)
        .map_err(unreadable)?;
    let Some(format) = recognise_text(&content) else {
        return Ok(None);
    };
    file.take(MAX_TEXT_BYTES + 1 - content.len() as u64)
        .read_to_end(&mut content)
        .map_err(unreadable)?;
    read_text(format, &content, source).map(Some)
}
