//! Pins: versions that somebody cites, which clean-up leaves whatever their age. An object a pin, created once and removed when
//! the version is released.

use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};

use crate::sound::damage;
use crate::{StorageError, Store, document, manifests, verify};

/// Version of what is written here.
const SCHEMA: u32 = 2;
/// Characters of a reason: a title and a DOI, and no paper.
pub const MOST_CHARACTERS: usize = 500;

/// A version that is kept until it is released.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pin {
    schema: u32,
    /// The version, as it is cited.
    pub version: ManifestId,
    /// When it was pinned.
    pub since: TimeMs,
    /// Why, if that was said.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub because: Option<String>,
}

/// What became of the wish to pin a version.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Pinned {
    /// It is pinned from now on.
    Now,
    /// It was pinned before, as this says, and stays so.
    Before(Pin),
    /// It is not pinned: what it lacks.
    Not(String),
}

/// A reason as it is stored.
///
/// # Errors
/// What is wrong with it.
pub fn reason(text: &str) -> Result<String, String> {
    let text = text.trim();
    let count = text.chars().count();
    if text.is_empty() || text.chars().any(char::is_control) {
        return Err("give one line of text".to_owned());
    }
    if count > MOST_CHARACTERS {
        return Err(format!(
            "give at most {MOST_CHARACTERS} characters, not {count}"
        ));
    }
    Ok(text.to_owned())
}

/// Pins a version, all of which must be there; `because` is a [`reason`].
///
/// # Errors
/// A store that does not answer; a pin of that version that is damaged.
pub async fn pin(
    store: &Store,
    manifest: &Manifest,
    because: Option<String>,
    now: TimeMs,
) -> Result<Pinned, StorageError> {
    let version = manifest.id();
    if let Some(lacking) = lacking(store, &version).await? {
        return Ok(Pinned::Not(lacking));
    }
    let key = ObjectKey::pin(&version.product, version.number);
    let pin = Pin {
        schema: SCHEMA,
        version,
        since: now,
        because,
    };
    match document::put_new(store, &key, &pin).await {
        Ok(_is_new) => {}
        Err(conflict @ StorageError::Conflict { .. }) => {
            let before = at(store, &key).await?;
            return before.map(Pinned::Before).ok_or(conflict);
        }
        Err(error) => return Err(error),
    }
    // Clean-up may have taken it before it could see the pin.
    let Some(lacking) = lacking(store, &pin.version).await? else {
        return Ok(Pinned::Now);
    };
    store.remove(&key).await?;
    Ok(Pinned::Not(lacking))
}

/// What a version lacks to be read; nothing where all that it names is there.
pub async fn lacking(store: &Store, version: &ManifestId) -> Result<Option<String>, StorageError> {
    let manifest = match manifests::load(store, version).await {
        Ok(manifest) => manifest,
        Err(error) if error.is_retryable() => return Err(error),
        Err(error) => return Ok(Some(error.to_string())),
    };
    let has_own = verify::has_own(store, &manifest).await?;
    Ok((!has_own).then(|| "fields of it, or its domain, are gone".to_owned()))
}

/// All pins, by product and number.
///
/// # Errors
/// `Damaged`, with what to do, if one of them is: nobody knows whether its version is still cited.
pub async fn all(store: &Store) -> Result<Vec<Pin>, StorageError> {
    let mut pins = vec![];
    for key in store.list(Kind::Pin.folder()).await? {
        pins.extend(at(store, &key).await?);
    }
    Ok(pins)
}

/// The pin of a version; none if it is not pinned.
///
/// # Errors
/// As [`all`].
pub async fn of_number(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<Option<Pin>, StorageError> {
    at(store, &ObjectKey::pin(product, number)).await
}

/// Releases a version: whether it was pinned. What the pin says is not read, so that a damaged one can be released.
pub async fn release(
    store: &Store,
    product: &ProductId,
    number: u64,
) -> Result<bool, StorageError> {
    let key = ObjectKey::pin(product, number);
    let was_pinned = store.exists(&key).await?;
    store.remove(&key).await?;
    Ok(was_pinned)
}

/// Is an object the manifest of a version that is pinned? Whether the pin is whole is not asked.
pub(crate) async fn holds(store: &Store, key: &ObjectKey) -> Result<bool, StorageError> {
    if Kind::of(key) != Some(Kind::Manifest) {
        return Ok(false);
    }
    let (manifests, pins) = (Kind::Manifest.folder(), Kind::Pin.folder());
    match key
        .as_str()
        .replacen(manifests, pins, 1)
        .parse::<ObjectKey>()
    {
        Ok(pin) => store.exists(&pin).await,
        Err(_too_long) => Ok(false),
    }
}

async fn at(store: &Store, key: &ObjectKey) -> Result<Option<Pin>, StorageError> {
    let pin: Pin = match document::get(store, key).await {
        Ok(Some(pin)) => pin,
        Ok(None) => return Ok(None),
        Err(StorageError::Damaged { object, reason }) => {
            let reason = format!("{reason}; {}", what_to_do(key));
            return Err(StorageError::Damaged { object, reason });
        }
        Err(error) => return Err(error),
    };
    let own = ObjectKey::pin(&pin.version.product, pin.version.number);
    if pin.schema != SCHEMA {
        // Whole, but of a program to come.
        let reason = format!(
            "schema {} is unknown, this program reads {SCHEMA}",
            pin.schema
        );
        Err(StorageError::damaged(key.as_str(), reason))
    } else if own != *key {
        let reason = format!("it pins {}; {}", pin.version, what_to_do(key));
        Err(damage::found(key, reason))
    } else {
        Ok(Some(pin))
    }
}

/// What to do about a damaged pin, by its name.
fn what_to_do(key: &ObjectKey) -> String {
    let version = key.as_str().split_once('/').and_then(|(_, version)| {
        let (product, name) = version.split_once('/')?;
        let number: u64 = name.strip_suffix(".json")?.parse().ok()?;
        Some(format!("{product}@{number}"))
    });
    match version {
        Some(version) => format!(
            "release it (`fluxglobe keep --release {version}`) and, if the version is still cited, pin it again"
        ),
        None => "it is of no version: remove it".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_reason_is_a_line_of_bounded_length() {
        assert_eq!(reason(" Table 2 of … "), Ok("Table 2 of …".to_owned()));
        assert!(reason(&"é".repeat(MOST_CHARACTERS)).is_ok());
        let long = reason(&"a".repeat(MOST_CHARACTERS + 1)).unwrap_err();
        assert!(long.contains("500 characters, not 501"), "{long}");
        for text in ["", "  ", "two\nlines", "\u{1b}[2J"] {
            assert!(reason(text).is_err(), "{text:?}");
        }
    }

    #[tokio::test]
    async fn a_pin_under_the_name_of_another_is_damaged() {
        let store = Store::memory();
        let product: ProductId = "p".parse().unwrap();
        let pin = |schema| Pin {
            schema,
            version: "p@2-0a1b2c3d".parse().unwrap(),
            since: "2001-01-01T00:00:00Z".parse().unwrap(),
            because: None,
        };
        for (number, schema, said) in [
            (1, SCHEMA, "keep --release p@1"),
            (2, SCHEMA + 1, "schema 3 is unknown"),
        ] {
            let key = ObjectKey::pin(&product, number);
            document::put_new(&store, &key, &pin(schema)).await.unwrap();
            let error = all(&store).await.unwrap_err().to_string();
            assert!(
                error.contains(key.as_str()) && error.contains(said),
                "{error}"
            );
            assert!(release(&store, &product, number).await.unwrap());
        }
        let key = ObjectKey::pin(&product, 2);
        document::put_new(&store, &key, &pin(SCHEMA)).await.unwrap();
        assert_eq!(all(&store).await.unwrap(), [pin(SCHEMA)]);
    }
}
