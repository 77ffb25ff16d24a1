//! Messages of NASA's Cloud Notification Mechanism, versions 1.x: a granule of a collection and its files.
//!
//! Source: the JSON schema of versions 1.0 to 1.6. Only files of type `data` are landed. A checksum without a type is MD5;
//! one of an unknown type is left aside, and a line of the log says so.

use contract::event::{Event, MAX_TRACE_BYTES};
use contract::time::TimeMs;
use serde::Deserialize;

use super::{Order, Said, Wishes, bad, notice_body};
use crate::error::Rejection;
use crate::fetch::{Expected, Location, Method};
use crate::plan::profile::Profiles;

/// Most files of one message.
const MAX_FILES: usize = 256;

/// Only what is needed here: other fields differ from version to version.
#[derive(Debug, Deserialize)]
struct Message {
    version: String,
    identifier: String,
    collection: Collection,
    #[serde(rename = "submissionTime")]
    submission_time: Option<String>,
    product: Option<Product>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Collection {
    Name(String),
    /// Since version 1.6.1.
    Object {
        name: String,
    },
}

#[derive(Debug, Deserialize)]
struct Product {
    #[serde(default)]
    files: Vec<File>,
    #[serde(default)]
    filegroups: Vec<Group>,
}

#[derive(Debug, Deserialize)]
struct Group {
    #[serde(default)]
    files: Vec<File>,
}

#[derive(Debug, Clone, Deserialize)]
struct File {
    #[serde(rename = "type")]
    kind: String,
    uri: String,
    #[serde(rename = "checksumType")]
    checksum_type: Option<String>,
    checksum: Option<String>,
    size: Option<f64>,
}

/// Does a message look like one of these?
pub(super) fn is_one(content: &[u8]) -> bool {
    #[derive(Deserialize)]
    struct Sign {
        schema: Option<serde::de::IgnoredAny>,
        version: Option<serde::de::IgnoredAny>,
        collection: Option<serde::de::IgnoredAny>,
    }
    serde_json::from_slice::<Sign>(content).is_ok_and(|sign| {
        sign.schema.is_none() && sign.version.is_some() && sign.collection.is_some()
    })
}

/// A notice for each data file.
pub(super) fn notices(
    content: &[u8],
    profiles: &Profiles,
    came: TimeMs,
) -> Result<Vec<Said>, Rejection> {
    let message: Message = serde_json::from_slice(content)
        .map_err(|e| bad(&format!("is no cloud notification: {e}")))?;
    if !is_known(&message.version) {
        let version: String = message.version.chars().take(20).collect();
        return Err(bad(&format!(
            "is a cloud notification of version {version:?}, this program reads 1.x"
        )));
    }
    let Some(product) = message.product else {
        return Err(bad(
            "is a cloud notification without a product: an answer to one, perhaps",
        ));
    };
    let all = product
        .files
        .iter()
        .chain(product.filegroups.iter().flat_map(|g| &g.files));
    let mut data: Vec<&File> = Vec::new();
    for file in all.filter(|file| file.kind == "data") {
        // A file may be in several groups.
        if !data.iter().any(|other| other.uri == file.uri) {
            data.push(file);
        }
        if data.len() > MAX_FILES {
            return Err(bad(&format!("names more than {MAX_FILES} files")));
        }
    }
    if data.is_empty() {
        return Err(bad(
            "is a cloud notification without a file of type \"data\"",
        ));
    }
    let (Collection::Name(collection) | Collection::Object { name: collection }) =
        &message.collection;
    let profile = profiles.of_collection(collection);
    let trace = printable(&message.identifier);
    let submitted = message.submission_time.as_deref().and_then(time);
    let noticed = submitted.or(Some(came));
    let notice = |file: &&File| {
        let location = Location::parse(&file.uri);
        let shown = location.as_ref().map_or_else(
            |_| "an address that cannot be read".to_owned(),
            ToString::to_string,
        );
        let wishes = Wishes {
            profile: profile.map(|p| p.name.clone()),
            ..Wishes::default()
        };
        let body = notice_body(&shown, &wishes);
        let mut cause = Event::new(trace.clone(), body);
        cause.noticed = noticed;
        let order = || {
            Ok(Order {
                location: location?,
                expected: expected(file)?,
                profile: profile.cloned(),
                product: None,
                variable: None,
                indexes: vec![],
            })
        };
        Said {
            shown,
            order: order(),
            attempt: 1,
            cause,
        }
    };
    Ok(data.iter().map(notice).collect())
}

/// `1.0`, `v1.5` or `1.6.1`.
fn is_known(version: &str) -> bool {
    let number = version.strip_prefix(['v', 'V']).unwrap_or(version);
    let is_number =
        |part: &str| !part.is_empty() && part.len() < 6 && part.bytes().all(|b| b.is_ascii_digit());
    let parts: Vec<&str> = number.split('.').collect();
    parts.first() == Some(&"1") && parts.len() <= 3 && parts.iter().all(|part| is_number(part))
}

/// Senders write the time with an offset or without.
fn time(text: &str) -> Option<TimeMs> {
    text.parse().ok()
}

fn printable(text: &str) -> String {
    let mut clean: String = text.chars().filter(|c| !c.is_control()).collect();
    let mut end = clean.len().min(MAX_TRACE_BYTES);
    while !clean.is_char_boundary(end) {
        end -= 1;
    }
    clean.truncate(end);
    clean
}

fn expected(file: &File) -> Result<Expected, Rejection> {
    let size_bytes = match file.size {
        None => None,
        Some(size) if size >= 0.0 && size.fract() == 0.0 && size < 9e15 => Some(size as u64),
        Some(size) => return Err(bad(&format!("gives {size} as the size of a file"))),
    };
    let mut expected = Expected {
        size_bytes,
        ..Expected::default()
    };
    let Some(checksum) = file.checksum.as_deref().map(str::to_ascii_lowercase) else {
        return Ok(expected);
    };
    let name = file.checksum_type.as_deref().unwrap_or("md5");
    let mut name = name.to_ascii_lowercase();
    name.retain(|c| c.is_ascii_alphanumeric());
    let digits = match name.as_str() {
        "md5" => 32,
        "sha1" => 40,
        "sha256" => 64,
        "sha512" => 128,
        _ => {
            tracing::info!(method = name, "a checksum of an unknown type is left aside");
            return Ok(expected);
        }
    };
    if checksum.len() != digits || !checksum.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(bad(&format!(
            "has a checksum that is no {name} digest: {digits} hexadecimal digits"
        )));
    }
    match name.as_str() {
        "md5" => expected.other = Some((Method::Md5, checksum)),
        "sha1" => expected.other = Some((Method::Sha1, checksum)),
        "sha512" => expected.other = Some((Method::Sha512, checksum)),
        _ => expected.sha256 = checksum.parse().ok(),
    }
    Ok(expected)
}
