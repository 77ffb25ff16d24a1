//! An attachment whose values did not come in, whether there is a store at all where it says out.

use cube::foreign::{ForeignError, Found};
use storage::attached::Attachment;

use super::address;
use super::reading::Reading;

/// Why there is no store any more where one was attached, and what to do; none where there is one, and where that cannot be told.
pub(super) async fn gone(attachment: &Attachment) -> Option<ForeignError> {
    let found = match address::open(&attachment.store) {
        Ok(objects) => Found::at(&objects).await.err(),
        Err(error) => Some(error),
    };
    let error = found.filter(|error| error.is_absent)?;
    let reason = format!(
        "its store is no longer there: {}; if it was moved, attach it at its new address: `fluxglobe attach URL{} --product {} --replace`",
        error.reason,
        words(attachment),
        attachment.product
    );
    Some(ForeignError { reason, ..error })
}

/// The words that attach the same of another store, each with a space before it.
fn words(attachment: &Attachment) -> String {
    let array = format!(" --variable {}", quoted(&attachment.array));
    let Ok(reading) = Reading::of(attachment) else {
        return array;
    };
    let profile = reading.profile.as_ref();
    let array = profile.map_or(array, |name| format!(" --profile {}", quoted(name)));
    array + &reading.index_words()
}

/// A word as a shell reads it: names of arrays are whatever others call them.
fn quoted(word: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_alphanumeric() || b"_./-".contains(&byte);
    if word.bytes().all(is_plain) {
        word.to_owned()
    } else {
        format!("'{}'", word.replace('\'', r"'\''"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_that_a_shell_would_read_otherwise_is_quoted() {
        assert_eq!(quoted("group/sst_4"), "group/sst_4");
        assert_eq!(quoted("sst; rm -r x"), "'sst; rm -r x'");
        assert_eq!(quoted("it's"), r"'it'\''s'");
    }
}
