//! Is a whole object what it must be: its bytes, and what they hold?

use bytes::Bytes;
use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use contract::topic::Origin;
use parquet::file::metadata::ParquetMetaDataReader;

use super::{DOCUMENTS, Soundness, check_document, damage, of_bytes};
use crate::{StorageError, contributed, domain, fields};

/// All that can be known of an object from itself: its bytes, its values where these name it, and what a domain says of itself.
pub fn of_object(key: &ObjectKey, content: &Bytes) -> Result<Soundness, StorageError> {
    let found = of_bytes(key, content)?;
    match (key.vouches(), Kind::of(key)) {
        // Nobody reads its values any more: what says that it is whole is its seal.
        (Vouched::Values(_), Some(Kind::Series)) => {}
        (Vouched::Values(_), Some(Kind::Contributed)) => {
            contributed::check(key, content.clone())?;
        }
        (Vouched::Values(_), _) => fields::check_values(key, content.clone())?,
        (Vouched::Bytes(_), Some(Kind::Domain)) => domain::check(key, content)?,
        (Vouched::Nothing, Some(kind)) if DOCUMENTS.contains(&kind) => {
            check_document(key, content, found)?;
        }
        (Vouched::Nothing, Some(Kind::Weights | Kind::Accumulating)) => {
            // Where the end of a file is damaged, no seal is found either.
            ParquetMetaDataReader::new()
                .parse_and_finish(content)
                .map_err(|e| damage::found(key, e))?;
        }
        (Vouched::Nothing, Some(Kind::Landing)) => {
            // The name of a note ends in the place that it holds.
            let told = std::str::from_utf8(content)
                .ok()
                .and_then(|text| text.parse::<Origin>().ok())
                .map(|origin| format!("-{}-{}", origin.partition, origin.offset));
            if !told.is_some_and(|told| key.as_str().ends_with(&told)) {
                return Err(damage::found(key, "it is not of the notice in its name"));
            }
            return Ok(Soundness::Sound);
        }
        _ => {}
    }
    Ok(found)
}
