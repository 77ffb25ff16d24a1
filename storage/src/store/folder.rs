//! Objects in a folder of this machine, durable when they are told of: file and folders are flushed to the disk.

use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write as _};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use contract::key::ObjectKey;

use super::flushed;
use crate::content::{Content, PIECE_BYTES};

/// How often a folder may vanish under a writer: a removal takes emptied folders along.
const ATTEMPTS: usize = 16;

/// Tells this process' half-written files apart.
static NEXT: AtomicU64 = AtomicU64::new(0);

/// Creates an object: `AlreadyExists` if there is one, and whole or not at all otherwise.
///
/// The content reaches the disk under another name first, so that after a power cut no half object bears the key.
pub(super) async fn create(
    root: PathBuf,
    key: ObjectKey,
    content: Content,
) -> Result<(), object_store::Error> {
    put(root, key, content, |from, to| fs::hard_link(from, to)).await
}

/// Puts an object in the place of what is there, whole or not at all.
pub(super) async fn replace(
    root: PathBuf,
    key: ObjectKey,
    content: Content,
) -> Result<(), object_store::Error> {
    put(root, key, content, |from, to| fs::rename(from, to)).await
}

/// The same at once, for who is on a thread that may wait.
pub(super) fn replace_now(root: &Path, path: &Path, content: &[u8]) -> io::Result<()> {
    let fill = |file: &mut File| file.write_all(content);
    write(path, fill, |from, to| fs::rename(from, to))?;
    flushed::flush(root, path)
}

/// How a file that is written gets its name.
type Naming = fn(&Path, &Path) -> io::Result<()>;

async fn put(
    root: PathBuf,
    key: ObjectKey,
    content: Content,
    name: Naming,
) -> Result<(), object_store::Error> {
    let path = root.join(key.as_str());
    let pieces = content.pieces(&key, PIECE_BYTES);
    let written = tokio::task::spawn_blocking(move || {
        let fill = |file: &mut File| {
            pieces
                .into_iter()
                .try_for_each(|piece| file.write_all(&piece?))
        };
        let written = write(&path, fill, name);
        if matches!(&written, Ok(()))
            || matches!(&written, Err(e) if e.kind() == ErrorKind::AlreadyExists)
        {
            // Another writer may have made the name and not yet flushed it.
            flushed::flush(&root, &path)?;
        }
        written
    });
    match written.await {
        Ok(Ok(())) => Ok(()),
        Ok(Err(e)) => Err(failed(&key, e)),
        Err(e) => Err(e.into()),
    }
}

fn write(
    path: &Path,
    fill: impl FnOnce(&mut File) -> io::Result<()>,
    name: Naming,
) -> io::Result<()> {
    let (mut file, staging) = stage(path)?;
    let written = fill(&mut file)
        .and_then(|()| file.sync_all())
        .and_then(|()| name(&staging, path));
    let removed = fs::remove_file(&staging);
    written?;
    // The object stands; a second name that stays behind is listed by nobody.
    if let Err(error) = removed
        && error.kind() != ErrorKind::NotFound
    {
        tracing::warn!(%error, file = %staging.display(), "a temporary file stays behind");
    }
    Ok(())
}

/// A new file beside the object, named as listings pass over (`NAME#DIGITS`).
fn stage(path: &Path) -> io::Result<(File, PathBuf)> {
    let folder = path.parent().ok_or(ErrorKind::InvalidInput)?;
    let mut last = io::Error::from(ErrorKind::NotFound);
    for _ in 0..ATTEMPTS {
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let mut name = path.as_os_str().to_owned();
        name.push(format!("#{}{number:06}", std::process::id()));
        let staging = PathBuf::from(name);
        match OpenOptions::new()
            .write(true)
            .create_new(true)
            .open(&staging)
        {
            Ok(file) => return Ok((file, staging)),
            Err(e) if e.kind() == ErrorKind::NotFound => fs::create_dir_all(folder)?,
            // Left by a killed process that had the same id.
            Err(e) if e.kind() == ErrorKind::AlreadyExists => last = e,
            Err(e) => return Err(e),
        }
    }
    // "Already exists" would say that the object does.
    Err(io::Error::other(format!(
        "no temporary file could be made: {last}"
    )))
}

/// Is this the name of a file that [`stage`] made?
pub(super) fn is_half_written(name: &str) -> bool {
    name.rsplit_once('#')
        .is_some_and(|(_, digits)| !digits.is_empty() && digits.bytes().all(|b| b.is_ascii_digit()))
}

pub(super) fn failed(key: &ObjectKey, source: io::Error) -> object_store::Error {
    let path = key.to_string();
    match source.kind() {
        ErrorKind::AlreadyExists => object_store::Error::AlreadyExists {
            path,
            source: source.into(),
        },
        ErrorKind::PermissionDenied | ErrorKind::ReadOnlyFilesystem => {
            object_store::Error::PermissionDenied {
                path,
                source: source.into(),
            }
        }
        // What is to be stored is not what its name says: no store could take it.
        ErrorKind::InvalidData => object_store::Error::NotSupported {
            source: source.into(),
        },
        _ => object_store::Error::Generic {
            store: "folder",
            source: source.into(),
        },
    }
}

#[cfg(test)]
mod tests {
    use super::super::flushed::tests::counts;
    use super::*;

    #[tokio::test]
    async fn a_file_of_a_killed_writer_is_neither_an_object_nor_in_the_way() {
        let folder = tempfile::tempdir().unwrap();
        let key: ObjectKey = "a/b".parse().unwrap();
        fs::create_dir(folder.path().join("a")).unwrap();
        for number in 0..3 {
            let name = format!("a/b#{}{number:06}", std::process::id());
            fs::write(folder.path().join(name), "half").unwrap();
        }
        let root = folder.path().to_owned();
        let content = |text: &'static str| Content::Bytes(text.into());
        create(root.clone(), key.clone(), content("whole"))
            .await
            .unwrap();
        assert_eq!(fs::read(folder.path().join("a/b")).unwrap(), b"whole");
        let again = create(root, key, content("other")).await;
        assert!(matches!(
            again,
            Err(object_store::Error::AlreadyExists { .. })
        ));
        let root = folder.path().to_owned();
        replace(root, "a/b".parse().unwrap(), content("over"))
            .await
            .unwrap();
        assert_eq!(fs::read(folder.path().join("a/b")).unwrap(), b"over");
        let left = fs::read_dir(folder.path().join("a")).unwrap().count();
        assert_eq!(left, 4, "the object and the three files that were there");
    }

    /// A name that lasts: also where somebody else made it and may not have flushed it.
    #[tokio::test]
    async fn the_folder_of_each_name_that_is_made_is_flushed() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let path = root.join("a/b");
        let content = || Content::Bytes("content".into());
        let key = || "a/b".parse::<ObjectKey>().unwrap();
        create(root.to_owned(), key(), content()).await.unwrap();
        assert_eq!(counts(root, &path), [1, 1]);
        let again = create(root.to_owned(), key(), content()).await;
        assert!(again.is_err(), "it is there");
        assert_eq!(counts(root, &path), [2, 1]);
        replace(root.to_owned(), key(), content()).await.unwrap();
        assert_eq!(counts(root, &path), [3, 1]);
        replace_now(root, &path, b"other").unwrap();
        assert_eq!(counts(root, &path), [4, 1]);
    }

    /// A device in its place, which cannot be flushed.
    #[test]
    fn a_file_has_no_name_before_its_content_is_flushed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let fill = |file: &mut File| {
            *file = OpenOptions::new().write(true).open("/dev/null")?;
            file.write_all(b"content")
        };
        assert!(write(&path, fill, |from, to| fs::rename(from, to)).is_err());
        let left = fs::read_dir(folder.path()).unwrap().count();
        assert_eq!(left, 0, "neither the object nor what it was written to");
    }

    #[tokio::test]
    async fn a_file_in_the_place_of_a_folder_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("a"), "file").unwrap();
        let key: ObjectKey = "a/b".parse().unwrap();
        let made = create(folder.path().to_owned(), key, Content::Bytes("x".into())).await;
        assert!(
            matches!(made, Err(object_store::Error::Generic { .. })),
            "{made:?}"
        );
    }
}
