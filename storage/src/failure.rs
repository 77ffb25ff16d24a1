//! Why a field of an attached product cannot be read.

use std::error::Error;

/// Why a field of an attached product cannot be read.
#[derive(Debug, Clone, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct Failure {
    /// Store, array and, as far as it is known, step or chunk.
    pub place: String,
    /// What is wrong, and what to do.
    pub reason: String,
    /// Where that lies.
    pub cause: Cause,
    /// The folder of this machine that the store is, if it is one.
    pub folder: Option<String>,
}

/// Where it lies that something of a store of others cannot be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cause {
    /// In what is there: it is not what can be read rightly, or not what was attached.
    Content,
    /// In who asks: the store does not give it with these credentials, or not from there.
    Access,
    /// In what may pass: no answer, or too many requests.
    Away,
}

impl Cause {
    /// May the same succeed later, with nothing changed?
    pub fn is_retryable(self) -> bool {
        match self {
            Self::Away => true,
            Self::Content | Self::Access => false,
        }
    }
}

impl Failure {
    /// May the same succeed later?
    pub fn is_retryable(&self) -> bool {
        self.cause.is_retryable()
    }

    /// A text about it, for who asks from elsewhere: a folder of this machine is of no use to them, and none of their business.
    pub fn for_strangers(&self, text: &str) -> String {
        let folder = self.folder.as_deref().unwrap_or_default();
        match folder.trim_end_matches('/') {
            "" => text.to_owned(),
            folder => text.replace(folder, "a folder of the server"),
        }
    }

    /// The failure that an error came from, if it came from one.
    pub fn behind<'a>(error: &'a (dyn Error + 'static)) -> Option<&'a Self> {
        let mut next = Some(error);
        while let Some(error) = next {
            if let Some(found) = error.downcast_ref() {
                return Some(found);
            }
            next = error.source();
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strangers_are_told_no_folder_of_this_machine_and_every_address() {
        let failure = |store: &str, folder: Option<&str>| Failure {
            place: format!("step 2000-01, {store} array sst"),
            reason: format!("object {store}/c/0 is not there"),
            cause: Cause::Content,
            folder: folder.map(str::to_owned),
        };
        let here = failure("/data/my sst.zarr", Some("/data/my sst.zarr"));
        let told = here.for_strangers(&format!("reading: {here}"));
        assert_eq!(
            told,
            "reading: step 2000-01, a folder of the server array sst: object a folder of the server/c/0 is not there"
        );
        for there in [failure("s3://b/x", None), failure("/", Some("/"))] {
            let text = there.to_string();
            assert_eq!(there.for_strangers(&text), text);
        }
    }
}
