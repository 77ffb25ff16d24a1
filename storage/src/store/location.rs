//! Where a store is: the text that people give, taken apart and checked before anything is opened.

use std::path::PathBuf;

use contract::key::ObjectKey;
use object_store::path::Path;
use url::Url;

/// A place that can hold objects.
#[derive(Debug, PartialEq)]
pub(super) enum Location {
    /// Gone with the process.
    Memory,
    /// A folder of this machine.
    Folder(PathBuf),
    /// A bucket (a container, in Azure's words) of a cloud.
    Bucket {
        cloud: Cloud,
        name: String,
        prefix: Path,
    },
    /// A Hadoop file system: its name node as `HOST:PORT`, or the name of a name service.
    Hdfs { node: String, prefix: Path },
}

/// Who serves a bucket.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Cloud {
    S3,
    Google,
    Azure,
}

impl Cloud {
    /// The scheme that its URLs begin with.
    pub(super) fn scheme(self) -> &'static str {
        match self {
            Self::S3 => "s3",
            Self::Google => "gs",
            Self::Azure => "az",
        }
    }
}

const ACCEPTED: &str = "give a folder, file:FOLDER, memory:, s3://BUCKET/PREFIX, gs://BUCKET/PREFIX, \
                        az://CONTAINER/PREFIX or hdfs://HOST:PORT/PREFIX";

/// Takes a location apart.
///
/// # Errors
/// What to give instead, in words; the text itself is not repeated, it may hold a secret.
pub(super) fn parse(text: &str) -> Result<Location, String> {
    if matches!(text, "memory:" | "memory:/" | "memory://" | "memory:///") {
        return Ok(Location::Memory);
    }
    if let Some(folder) = text.strip_prefix("file:") {
        return folder_of_url(folder);
    }
    let Some((scheme, _)) = text.split_once("://") else {
        let scheme = text.split(':').next().unwrap_or_default();
        let is_scheme = cloud(scheme).is_some() || scheme == "hdfs";
        let is_half_a_url = is_scheme && text.contains(':');
        return match text {
            "" => Err(ACCEPTED.to_owned()),
            _ if is_half_a_url => Err(format!("{ACCEPTED} (with two slashes)")),
            folder => Ok(Location::Folder(folder.into())),
        };
    };
    if !matches!(scheme, "hdfs") && cloud(scheme).is_none() {
        return Err(ACCEPTED.to_owned());
    }
    let url = Url::parse(text).map_err(|e| format!("it is no URL ({e}); {ACCEPTED}"))?;
    if !url.username().is_empty() || url.password().is_some() {
        return Err("a URL is shown and logged: give credentials through the environment".into());
    }
    if url.query().is_some() || url.fragment().is_some() {
        return Err("settings come through the environment, not behind ? or #".into());
    }
    let host = url.host_str().unwrap_or_default();
    let is_safe = |b: u8| b.is_ascii_alphanumeric() || matches!(b, b'.' | b'_' | b'-');
    if host.is_empty() || !host.bytes().all(is_safe) {
        return Err(format!("its bucket or host is missing or odd; {ACCEPTED}"));
    }
    let prefix = prefix(url.path())?;
    match (cloud(scheme), url.port()) {
        (Some(_), Some(_)) => Err("a bucket has no port; name another server by its endpoint \
             variable, AWS_ENDPOINT_URL for s3"
            .to_owned()),
        (Some(cloud), None) => Ok(Location::Bucket {
            cloud,
            name: host.to_owned(),
            prefix,
        }),
        (None, port) => Ok(Location::Hdfs {
            node: port.map_or(host.to_owned(), |port| format!("{host}:{port}")),
            prefix,
        }),
    }
}

fn cloud(scheme: &str) -> Option<Cloud> {
    match scheme {
        "s3" | "s3a" => Some(Cloud::S3),
        "gs" => Some(Cloud::Google),
        "az" => Some(Cloud::Azure),
        _ => None,
    }
}

/// The folder behind `file:`, as it is: signs are not escaped, so that any name can be given.
fn folder_of_url(folder: &str) -> Result<Location, String> {
    let names_a_host = folder.starts_with("//") && !folder.starts_with("///");
    if folder.is_empty() || names_a_host {
        return Err("write file:FOLDER or file:///FOLDER".to_owned());
    }
    let path = folder.strip_prefix("//").unwrap_or(folder);
    Ok(Location::Folder(path.into()))
}

/// A prefix obeys the rule of keys, so that no store and no URL has to escape anything.
fn prefix(path: &str) -> Result<Path, String> {
    let path = path.trim_matches('/');
    if path.is_empty() {
        return Ok(Path::default());
    }
    let key: ObjectKey = path.parse().map_err(|_invalid| {
        "its prefix must be parts of A-Z a-z 0-9 . _ - joined by single slashes".to_owned()
    })?;
    Ok(Path::from(key.as_str()))
}

/// A location as it may be shown: without what stands where a URL has its credentials and settings.
pub(super) fn shown(text: &str) -> String {
    let Some((scheme, rest)) = text.split_once("://") else {
        return text.to_owned();
    };
    if scheme == "file" {
        return text.to_owned();
    }
    let rest = rest.split(['?', '#']).next().unwrap_or_default();
    match rest.rsplit_once('@') {
        Some((_hidden, rest)) => format!("{scheme}://***@{rest}"),
        None => format!("{scheme}://{rest}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bucket(cloud: Cloud, name: &str, prefix: &str) -> Location {
        Location::Bucket {
            cloud,
            name: name.to_owned(),
            prefix: Path::from(prefix),
        }
    }

    #[test]
    fn every_kind_of_place_is_told_by_its_scheme() {
        let hdfs = |node: &str, prefix: &str| Location::Hdfs {
            node: node.to_owned(),
            prefix: Path::from(prefix),
        };
        for (text, location) in [
            ("memory:", Location::Memory),
            ("data", Location::Folder("data".into())),
            ("file:data", Location::Folder("data".into())),
            ("file:/a/b%20c", Location::Folder("/a/b%20c".into())),
            ("file:///a/b c", Location::Folder("/a/b c".into())),
            ("s3://b", bucket(Cloud::S3, "b", "")),
            ("s3a://B_1/p/q/", bucket(Cloud::S3, "B_1", "p/q")),
            ("gs://b/p", bucket(Cloud::Google, "b", "p")),
            ("az://c/p", bucket(Cloud::Azure, "c", "p")),
            ("hdfs://node:8020/p", hdfs("node:8020", "p")),
            ("hdfs://service", hdfs("service", "")),
        ] {
            assert_eq!(parse(text), Ok(location), "{text}");
        }
    }

    #[test]
    fn what_is_no_place_is_refused_with_advice() {
        for (text, advice) in [
            ("", "give a folder"),
            ("ftp://a/b", "give a folder"),
            ("https://host/bucket", "give a folder"),
            ("s3:bucket", "two slashes"),
            ("file://host/folder", "file:///FOLDER"),
            ("s3://", "bucket or host"),
            ("s3://bucket:9000/p", "AWS_ENDPOINT_URL"),
            ("s3://b/a%2Fb", "prefix must be"),
            ("s3://b/a//b", "prefix must be"),
            ("s3://b/p?key=1", "environment"),
            ("hdfs://h:1/a b", "prefix must be"),
            ("hdfs://h:99999/a", "no URL"),
        ] {
            let reason = parse(text).unwrap_err();
            assert!(reason.contains(advice), "{text}: {reason}");
        }
    }

    #[test]
    fn a_prefix_cannot_climb_out_of_its_bucket() {
        // The URL library resolves dots; what is left stays below the bucket's root.
        assert_eq!(parse("s3://b/a/../../c"), Ok(bucket(Cloud::S3, "b", "c")));
        assert!(parse("s3://b/%2e%2e%2fc").is_err());
    }

    #[test]
    fn credentials_in_a_url_are_refused_and_not_shown() {
        let text = "s3://KEY:SECRET@bucket/p";
        assert!(parse(text).unwrap_err().contains("environment"));
        assert_eq!(shown(text), "s3://***@bucket/p");
        assert_eq!(shown("az://c/p?sig=SECRET"), "az://c/p");
        assert_eq!(shown("file:///a@b?c"), "file:///a@b?c");
    }
}
