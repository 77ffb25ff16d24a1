//! Answers of clouds in; those that refuse come out with their code and their sentence alone. Whole, they may repeat what a request
//! was signed with, a session's token among it, and errors are shown and logged. A store that does not answer is told of at once: the
//! library tries again for long, and says nothing of it.

use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use async_trait::async_trait;
use futures::TryStreamExt as _;
use object_store::ClientOptions;
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpService,
    ReqwestConnector,
};

use crate::refusal::element;

/// What of a refusal is read: codes and sentences come first and are short.
const READ_BYTES: usize = 64 << 10;
/// What is told of a refusal that is no XML, by a proxy for example.
const TOLD_CHARS: usize = 200;
/// Elements that are told.
const TOLD: [&str; 3] = ["Code", "Message", "Region"];

/// Makes clients of the kind that the library makes by itself.
#[derive(Debug)]
pub(super) struct Connector {
    /// How long requests are tried again.
    pub(super) retries: Duration,
}

impl HttpConnector for Connector {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        let inner = ReqwestConnector::default().connect(options)?;
        Ok(HttpClient::new(Service {
            inner,
            retries: self.retries,
            is_away: AtomicBool::new(false),
        }))
    }
}

#[derive(Debug)]
struct Service {
    inner: HttpClient,
    retries: Duration,
    /// Has it not answered since it last did?
    is_away: AtomicBool,
}

impl Service {
    /// Says once that a host does not answer, until it does again: whoever waits for a command is to see why.
    fn tell(&self, host: &str, error: &HttpError) {
        let is_silence = matches!(
            error.kind(),
            HttpErrorKind::Connect | HttpErrorKind::Timeout
        );
        if is_silence && !self.is_away.swap(true, Ordering::Relaxed) {
            let retries_s = self.retries.as_secs_f64();
            let why = innermost(error);
            tracing::warn!("{host} does not answer ({why}): tried again for at most {retries_s} s");
        }
    }
}

/// What an error is for in the end; what is around it tells of the request.
fn innermost(error: &HttpError) -> String {
    let mut innermost: &dyn std::error::Error = error;
    while let Some(source) = innermost.source() {
        innermost = source;
    }
    innermost.to_string()
}

#[async_trait]
impl HttpService for Service {
    async fn call(&self, request: HttpRequest) -> Result<HttpResponse, HttpError> {
        let host = request.uri().host().unwrap_or_default().to_owned();
        let answer = self.inner.execute(request).await;
        let answer = answer.inspect_err(|error| self.tell(&host, error))?;
        self.is_away.store(false, Ordering::Relaxed);
        let status = answer.status();
        if status.is_success() || status.is_informational() {
            return Ok(answer);
        }
        let (head, body) = answer.into_parts();
        let (mut read, mut pieces) = (vec![], body.bytes_stream());
        // Of what breaks off the status is enough.
        while let Ok(Some(piece)) = pieces.try_next().await {
            read.extend_from_slice(&piece);
            if read.len() > READ_BYTES {
                break;
            }
        }
        read.truncate(READ_BYTES);
        let told = told(&String::from_utf8_lossy(&read));
        Ok(HttpResponse::from_parts(head, told.into()))
    }
}

/// What of the body of a refusal may be shown.
fn told(body: &str) -> String {
    if !body.contains("<Code>") {
        // What is no refusal of a cloud repeats no request, unless it is XML or a page that does.
        let is_marked = body.trim_start().starts_with('<');
        let text = if is_marked { "" } else { body };
        return text.chars().take(TOLD_CHARS).collect();
    }
    let elements = TOLD.iter().filter_map(|name| {
        let text = element(body, name)?;
        Some(format!("<{name}>{text}</{name}>"))
    });
    format!("<Error>{}</Error>", elements.collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_refusal_is_told_without_what_it_repeats() {
        let body = "<?xml version=\"1.0\"?><Error><Code>ExpiredToken</Code><Message>The provided token has expired.</Message>\
                    <Token-0>c2VjcmV0</Token-0><AWSAccessKeyId>AKIAX</AWSAccessKeyId>\
                    <CanonicalRequest>GET x-amz-security-token:c2VjcmV0</CanonicalRequest></Error>";
        let short = told(body);
        assert_eq!(
            short,
            "<Error><Code>ExpiredToken</Code><Message>The provided token has expired.</Message></Error>"
        );
        assert_eq!(element(&short, "Code"), Some("ExpiredToken"));
        assert_eq!(element(&short, "Region"), None);
    }

    #[test]
    fn what_is_no_refusal_of_a_cloud_is_short() {
        assert_eq!(told("upstream is away"), "upstream is away");
        assert_eq!(told(&"x".repeat(5000)).len(), TOLD_CHARS);
        assert_eq!(told("<html>a page</html>"), "");
    }
}
