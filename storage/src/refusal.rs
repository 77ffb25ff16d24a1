//! Why a store did not give an object, as the kind, the status and the code of its answer tell.

use object_store::Error;

/// Codes of S3, Google and Azure for an object that is not there.
const ABSENT: [&str; 5] = [
    "NoSuchKey",
    "NoSuchVersion",
    "BlobNotFound",
    "ResourceNotFound",
    "PathNotFound",
];
/// Codes for a bucket that is not there, or a container.
const BUCKET: [&str; 5] = [
    "NoSuchBucket",
    "ContainerNotFound",
    "ContainerBeingDeleted",
    "AllAccessDisabled",
    "AccountIsDisabled",
];
/// Codes for credentials that are not or no longer good; besides them whatever comes with the status 401 or 403.
const CREDENTIALS: [&str; 6] = [
    "ExpiredToken",
    "InvalidToken",
    "TokenRefreshRequired",
    "InvalidAccessKeyId",
    "SignatureDoesNotMatch",
    "InvalidSecurity",
];
/// Codes for a bucket of another region than the one that was asked.
const REGION: [&str; 4] = [
    "AuthorizationHeaderMalformed",
    "PermanentRedirect",
    "IllegalLocationConstraintException",
    "IncorrectEndpoint",
];

/// Why a store did not give an object. The text is what it said, without what it repeated of the request.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Refusal {
    /// It is not there.
    Absent,
    /// Not to whoever asks with these credentials, or with none.
    Credentials(String),
    /// There is no such bucket.
    Bucket(String),
    /// The bucket is elsewhere.
    Region(String),
    /// The request is not one that it takes.
    Request(String),
}

impl Refusal {
    /// The refusal that a request ended with; none if it failed otherwise, and may succeed later or not.
    pub fn of(error: &Error) -> Option<Self> {
        let text = told(error);
        let code = element(&text, "Code");
        let is_of = |codes: &[&str]| code.is_some_and(|code| codes.contains(&code));
        let said = || said(&text);
        let by_code = || {
            if is_of(&BUCKET) {
                Some(Self::Bucket(said()))
            } else if is_of(&CREDENTIALS) {
                Some(Self::Credentials(said()))
            } else if is_of(&REGION) || text.contains("redirect without LOCATION") {
                Some(Self::Region(said()))
            } else {
                None
            }
        };
        match error {
            // A 404 that says nothing more is of the object: so it is for HEAD, and for stores without codes.
            Error::NotFound { .. } if code.is_none() || is_of(&ABSENT) => Some(Self::Absent),
            Error::NotFound { .. } => by_code().or_else(|| Some(Self::Request(said()))),
            Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
                by_code().or_else(|| Some(Self::Credentials(said())))
            }
            Error::Generic { .. } if !crate::error::may_pass(error) => {
                let is_answer = text.contains("status code: ");
                by_code().or_else(|| is_answer.then(|| Self::Request(said())))
            }
            Error::Generic { .. } => by_code(),
            _ => None,
        }
    }
}

/// The text of the first element of a name.
pub(crate) fn element<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let (_, rest) = text.split_once(&format!("<{name}>"))?;
    rest.split_once(&format!("</{name}>")).map(|(text, _)| text)
}

/// An error with all that led to it.
fn told(error: &Error) -> String {
    let first: &(dyn std::error::Error + 'static) = error;
    let chain = std::iter::successors(Some(first), |error| error.source());
    let texts: Vec<String> = chain.map(ToString::to_string).collect();
    texts.join(" ")
}

/// Status, code and sentence of an answer, as far as they are there.
fn said(text: &str) -> String {
    let status = text.split("status code: ").nth(1);
    let status = status.and_then(|rest| rest.split(':').next());
    let code = element(text, "Code");
    let message = element(text, "Message").map(|text| text.trim_end_matches('.'));
    let region = element(text, "Region").map(|region| format!("its region is {region}"));
    let words: Vec<&str> = [status, code].into_iter().flatten().collect();
    let words = words.join(" ");
    let parts = [Some(words.as_str()), message, region.as_deref()];
    let parts: Vec<&str> = parts.into_iter().flatten().collect();
    parts.join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn generic(status: &str, body: &str) -> Error {
        Error::Generic {
            store: "S3",
            source: format!("Server returned non-2xx status code: {status}: {body}").into(),
        }
    }

    fn not_found(body: &str) -> Error {
        Error::NotFound {
            path: "p".to_owned(),
            source: format!("Server returned non-2xx status code: 404 Not Found: {body}").into(),
        }
    }

    fn code(code: &str) -> String {
        format!("<Error><Code>{code}</Code><Message>So it is.</Message></Error>")
    }

    #[test]
    fn only_an_object_that_is_not_there_is_absent() {
        for body in [String::new(), code("NoSuchKey"), code("BlobNotFound")] {
            assert_eq!(
                Refusal::of(&not_found(&body)),
                Some(Refusal::Absent),
                "{body}"
            );
        }
        let gone = Refusal::of(&not_found(&code("NoSuchBucket")));
        let said = "404 Not Found NoSuchBucket, So it is".to_owned();
        assert_eq!(gone, Some(Refusal::Bucket(said)));
        // As some servers answer a key that they do not know.
        let key = Refusal::of(&not_found(&code("InvalidAccessKeyId")));
        assert!(matches!(key, Some(Refusal::Credentials(_))), "{key:?}");
        let other = Refusal::of(&not_found(&code("NoSuchUpload")));
        assert!(matches!(other, Some(Refusal::Request(_))), "{other:?}");
    }

    #[test]
    fn a_bucket_that_is_elsewhere_is_told_with_its_region() {
        let body = "<Error><Code>PermanentRedirect</Code><Message>Ask there.</Message><Region>eu-central-1</Region></Error>";
        let moved = Refusal::of(&generic("400 Bad Request", body));
        let said = "400 Bad Request PermanentRedirect, Ask there, its region is eu-central-1";
        assert_eq!(moved, Some(Refusal::Region(said.to_owned())));
        let without_words = Error::Generic {
            store: "S3",
            source: "Received redirect without LOCATION, this normally indicates an incorrectly configured region".into(),
        };
        let moved = Refusal::of(&without_words);
        assert!(matches!(moved, Some(Refusal::Region(_))), "{moved:?}");
    }

    #[test]
    fn a_token_that_has_ended_is_no_wrong_request() {
        let of = |status: &str, name: &str| Refusal::of(&generic(status, &code(name)));
        let ended = of("400 Bad Request", "ExpiredToken");
        assert!(matches!(ended, Some(Refusal::Credentials(_))), "{ended:?}");
        let elsewhere = of("400 Bad Request", "AuthorizationHeaderMalformed");
        assert!(
            matches!(elsewhere, Some(Refusal::Region(_))),
            "{elsewhere:?}"
        );
        let other = of("400 Bad Request", "EntityTooSmall");
        assert!(matches!(other, Some(Refusal::Request(_))), "{other:?}");
        // What may pass is no refusal.
        assert_eq!(of("503 Slow Down", "SlowDown"), None);
        let denied = Error::PermissionDenied {
            path: "p".to_owned(),
            source: "status code: 403 Forbidden: ".into(),
        };
        assert!(matches!(
            Refusal::of(&denied),
            Some(Refusal::Credentials(_))
        ));
    }
}
