//! Where a file is, as a notice says it: a path or a URL; shown without what is secret in it.

use std::fmt::{Display, Formatter, Write as _};
use std::path::{Path, PathBuf};

use contract::event::RejectReason;
use url::Url;

use crate::error::Rejection;

/// Longest path or URL, bytes: the longest path of the system.
const MAX_BYTES: usize = 4096;

/// Where a file is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Location {
    /// On a disk of this machine.
    File(PathBuf),
    /// Behind `http:` or `https:`.
    Web(Url),
    /// In an object store.
    Object(Url),
}

impl Location {
    /// Reads a path or a URL.
    pub(crate) fn parse(text: &str) -> Result<Self, Rejection> {
        let refuse = |detail: String| Rejection::new(RejectReason::Location, "path", detail);
        if text.is_empty() || text.len() > MAX_BYTES || text.contains('\0') {
            return Err(refuse(format!("is no path: give 1 to {MAX_BYTES} bytes")));
        }
        if !text.contains("://") && !text.starts_with("file:") {
            return Ok(Self::File(PathBuf::from(text)));
        }
        let url = Url::parse(text).map_err(|e| refuse(format!("is no URL: {e}")))?;
        match url.scheme() {
            "file" => url
                .to_file_path()
                .map(Self::File)
                .map_err(|()| refuse("names another machine; give file:///FOLDER/FILE".to_owned())),
            "http" | "https" if url.has_host() => Ok(Self::Web(url)),
            "s3" | "gs" | "az" | "hdfs" if url.has_host() => Ok(Self::Object(url)),
            "http" | "https" | "s3" | "gs" | "az" | "hdfs" => {
                Err(refuse("is a URL without a host or bucket".to_owned()))
            }
            other => Err(refuse(format!(
                "has the scheme {other:?}; give a path, file:, http:, https:, s3:, gs:, az: or hdfs:"
            ))),
        }
    }

    /// What is asked for the file: a host and port, a bucket, or the disks of this machine.
    pub(super) fn source(&self) -> String {
        match self {
            Self::File(_) => "file".to_owned(),
            Self::Web(url) | Self::Object(url) => {
                let host = url.host_str().unwrap_or_default();
                match url.port_or_known_default() {
                    Some(port) => format!("{}://{host}:{port}", url.scheme()),
                    None => format!("{}://{host}", url.scheme()),
                }
            }
        }
    }

    /// Last part of the path, for people and for patterns of file names.
    pub(crate) fn file_name(&self) -> String {
        match self {
            Self::File(path) => file_name(path),
            Self::Web(url) | Self::Object(url) => {
                let last = url.path_segments().and_then(|mut parts| parts.next_back());
                decoded(last.unwrap_or_default())
            }
        }
    }
}

/// Last part of a path, for people.
pub(super) fn file_name(path: &Path) -> String {
    path.file_name()
        .unwrap_or(path.as_os_str())
        .to_string_lossy()
        .into_owned()
}

/// A part of a URL with its escapes undone. Only ever shown and matched with patterns, never opened.
fn decoded(part: &str) -> String {
    let query = part.replace('+', "%2B").replace('&', "%26");
    url::form_urlencoded::parse(query.as_bytes())
        .next()
        .map_or_else(String::new, |(name, value)| {
            if value.is_empty() {
                name.into_owned()
            } else {
                format!("{name}={value}")
            }
        })
}

/// A URL without what may be secret: user, password, query (which is where signatures are) and fragment.
pub(super) fn shown(url: &Url) -> String {
    let host = url.host_str().unwrap_or_default();
    let port = url
        .port()
        .map_or_else(String::new, |port| format!(":{port}"));
    format!("{}://{host}{port}{}", url.scheme(), url.path())
}

impl Display for Location {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            // A path may hold anything but a zero: a line break would make a line of a log of its own.
            Self::File(path) => {
                let clean = |c: char| if c.is_control() { '?' } else { c };
                path.to_string_lossy()
                    .chars()
                    .try_for_each(|c| f.write_char(clean(c)))
            }
            Self::Web(url) | Self::Object(url) => f.write_str(&shown(url)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_and_urls_are_told_apart() {
        let file = |path: &str| Location::File(path.into());
        assert_eq!(Location::parse("/a/b c.nc").unwrap(), file("/a/b c.nc"));
        assert_eq!(
            Location::parse("file:///a/b%20c.nc").unwrap(),
            file("/a/b c.nc")
        );
        assert!(matches!(
            Location::parse("HTTPS://h/x"),
            Ok(Location::Web(_))
        ));
        assert!(matches!(
            Location::parse("s3://b/x"),
            Ok(Location::Object(_))
        ));
        for text in [
            "",
            "a\0b",
            "ftp://h/x",
            "javascript://h/x",
            "file://other-machine/x",
            "s3:///x",
            "http://",
            &"x".repeat(5000),
        ] {
            let refused = Location::parse(text).unwrap_err();
            assert_eq!(refused.reason, RejectReason::Location, "{text}");
        }
    }

    #[test]
    fn what_is_shown_holds_no_secret() {
        let text = "https://user:hunter2@h:8443/a/b%2B1=2.nc?X-Signature=hunter2#hunter2";
        let location = Location::parse(text).unwrap();
        assert_eq!(location.to_string(), "https://h:8443/a/b%2B1=2.nc");
        assert_eq!(location.file_name(), "b+1=2.nc");
        let location = Location::parse("/a/b\nrefused \u{1b}[2J").unwrap();
        assert_eq!(location.to_string(), "/a/b?refused ?[2J");
    }
}
