//! Files behind `http:` and `https:` addresses of the public network, and of hosts that the settings name.
//!
//! Each address is checked where it is used: names when they are resolved, by the resolver of the very connection, and
//! numbers before the request. Redirects are followed here, so that each goes through the same checks.

use std::net::{IpAddr, SocketAddr};
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use contract::event::RejectReason;
use reqwest::dns::{Addrs, Name, Resolve, Resolving};
use reqwest::header::{LOCATION, RANGE};
use reqwest::{Client, Method, Response, StatusCode, redirect};
use url::{Host, Url};

use super::address::is_public;
use super::location::shown;
use super::retry::Miss;
use crate::error::{IngestError, Rejection, Stop};

/// Redirects that are followed.
const MAX_REDIRECTS: usize = 5;
/// Time to connect.
const CONNECT_LIMIT: Duration = Duration::from_secs(10);
/// Longest silence within an answer.
const SILENCE_LIMIT: Duration = Duration::from_secs(30);

/// A host that may be asked although its address is not public: `NAME`, `NAME:PORT`, or an address in place of the name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AllowedHost {
    host: Host,
    /// Any port if absent.
    port: Option<u16>,
}

/// Whoever fetches over HTTP.
#[derive(Debug)]
pub(super) struct Web {
    allowed: Vec<AllowedHost>,
    /// Resolves names to public addresses only.
    public: Client,
    /// For allowed hosts.
    trusting: Client,
}

/// Names to public addresses.
struct PublicOnly;

/// A name that has no public address.
#[derive(Debug, thiserror::Error)]
#[error("{0} has no public address")]
struct NotPublic(String);

impl FromStr for AllowedHost {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let bad = || format!("{text:?} is no HOST or HOST:PORT");
        let url = Url::parse(&format!("http://{text}/")).map_err(|_unparsed| bad())?;
        let is_host_alone = url.path() == "/" && url.username().is_empty() && url.query().is_none();
        let host = url
            .host()
            .map(|host| host.to_owned())
            .filter(|_| is_host_alone);
        // A URL does not tell the port of its scheme from none.
        let port = if text.ends_with(":80") {
            Some(80)
        } else {
            url.port()
        };
        Ok(Self {
            host: host.ok_or_else(bad)?,
            port,
        })
    }
}

impl AllowedHost {
    /// The host and port of an address that the user gives.
    pub(super) fn of(url: &Url) -> Option<Self> {
        Some(Self {
            host: url.host()?.to_owned(),
            port: url.port_or_known_default(),
        })
    }

    fn is(&self, url: &Url) -> bool {
        url.host().is_some_and(|host| host.to_owned() == self.host)
            && self
                .port
                .is_none_or(|port| url.port_or_known_default() == Some(port))
    }
}

impl Resolve for PublicOnly {
    fn resolve(&self, name: Name) -> Resolving {
        Box::pin(async move {
            let found = tokio::net::lookup_host((name.as_str(), 0)).await?;
            let public: Vec<SocketAddr> = found.filter(|a| is_public(a.ip())).collect();
            if public.is_empty() {
                return Err(NotPublic(name.as_str().to_owned()).into());
            }
            Ok(Box::new(public.into_iter()) as Addrs)
        })
    }
}

impl Web {
    pub(super) fn new(allowed: Vec<AllowedHost>) -> Result<Self, IngestError> {
        let client = || {
            Client::builder()
                .user_agent(concat!("fluxglobe/", env!("CARGO_PKG_VERSION")))
                // A proxy of the environment would look names up in our place.
                .no_proxy()
                .redirect(redirect::Policy::none())
                .referer(false)
                .connect_timeout(CONNECT_LIMIT)
                .read_timeout(SILENCE_LIMIT)
        };
        let built = |client: reqwest::ClientBuilder| {
            client
                .build()
                .map_err(|source| IngestError::Client { source })
        };
        Ok(Self {
            allowed,
            public: built(client().dns_resolver(Arc::new(PublicOnly)))?,
            trusting: built(client())?,
        })
    }

    /// The answer that holds the file.
    pub(super) async fn get(&self, url: &Url) -> Result<Response, Miss> {
        let response = self.answer(url, Method::GET, None).await?;
        match response.status() {
            StatusCode::OK => Ok(response),
            status => Err(miss(status)),
        }
    }

    /// The answer at the end of all redirects, whatever it says; `range` is what its header asks for.
    pub(super) async fn answer(
        &self,
        url: &Url,
        method: Method,
        range: Option<&str>,
    ) -> Result<Response, Miss> {
        let mut url = url.clone();
        for _ in 0..=MAX_REDIRECTS {
            let response = self.ask(&url, method.clone(), range).await?;
            if !is_redirect(response.status()) {
                return Ok(response);
            }
            url = next(&url, &response)?;
        }
        let detail = format!(
            "leads over more than {MAX_REDIRECTS} redirects; give the address of the file itself"
        );
        Err(refused(detail).into())
    }

    async fn ask(&self, url: &Url, method: Method, range: Option<&str>) -> Result<Response, Miss> {
        let is_allowed = self.allowed.iter().any(|allowed| allowed.is(url));
        if !is_allowed && is_inner(url) {
            return Err(internal(url).into());
        }
        let client = if is_allowed {
            &self.trusting
        } else {
            &self.public
        };
        let request = client.request(method, url.clone());
        let request = match range {
            Some(range) => request.header(RANGE, range),
            None => request,
        };
        request.send().await.map_err(|error| {
            if is_not_public(&error) {
                internal(url).into()
            } else {
                away(error)
            }
        })
    }
}

/// Is it plain from the address alone that it is not public? Other names are looked up.
fn is_inner(url: &Url) -> bool {
    match url.host() {
        Some(Host::Ipv4(v4)) => !is_public(IpAddr::V4(v4)),
        Some(Host::Ipv6(v6)) => !is_public(IpAddr::V6(v6)),
        // RFC 6761: a resolver may not know these, and they are this machine all the same.
        Some(Host::Domain(name)) => {
            let name = name.trim_end_matches('.');
            name == "localhost" || name.ends_with(".localhost")
        }
        None => true,
    }
}

fn is_redirect(status: StatusCode) -> bool {
    matches!(status.as_u16(), 301 | 302 | 303 | 307 | 308)
}

/// Where a redirect leads; only to where a notice may lead too.
fn next(url: &Url, response: &Response) -> Result<Url, Rejection> {
    let target = response
        .headers()
        .get(LOCATION)
        .and_then(|value| value.to_str().ok());
    let target = target.and_then(|text| url.join(text).ok());
    let target = target.ok_or_else(|| refused("redirects to nowhere".to_owned()))?;
    match (url.scheme(), target.scheme()) {
        ("https", "http") => Err(refused(format!(
            "redirects from https to {}, which is not encrypted",
            shown(&target)
        ))),
        (_, "http" | "https") => Ok(target),
        (_, other) => Err(refused(format!("redirects to the scheme {other:?}"))),
    }
}

/// What an answer without the file means.
pub(super) fn miss(status: StatusCode) -> Miss {
    let text = format!("the server answered {status}");
    match status.as_u16() {
        408 | 425 | 429 | 500..=599 => Miss::Away(text),
        _ => Miss::Absent(text),
    }
}

/// A failure of the connection, without the address: it may hold a signature.
pub(super) fn away(error: reqwest::Error) -> Miss {
    let error = error.without_url();
    let mut text = error.to_string();
    let mut source = std::error::Error::source(&error);
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    Miss::Away(text)
}

fn is_not_public(error: &reqwest::Error) -> bool {
    let mut source: Option<&(dyn std::error::Error + 'static)> = Some(error);
    while let Some(cause) = source {
        if cause.is::<NotPublic>() {
            return true;
        }
        source = cause.source();
    }
    false
}

fn internal(url: &Url) -> Stop {
    let host = url.host_str().unwrap_or_default();
    refused(format!(
        "leads to {host}, which is no address of the public network; allow it with --allow-host"
    ))
    .into()
}

fn refused(detail: String) -> Rejection {
    Rejection::new(RejectReason::Location, "path", detail)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allowed(text: &str, url: &str) -> bool {
        let host: AllowedHost = text.parse().unwrap();
        host.is(&url.parse().unwrap())
    }

    #[test]
    fn an_allowed_host_is_meant_whole() {
        assert!(allowed("files.internal", "https://files.internal/x"));
        assert!(allowed("files.internal", "http://FILES.internal:8080/x"));
        assert!(allowed("127.0.0.1:80", "http://127.1/x"), "the same number");
        assert!(allowed("[::1]:9000", "http://[::1]:9000/x"));
        assert!(!allowed("files.internal", "http://evil.files.internal/"));
        assert!(!allowed("files.internal", "http://files.internal.evil/"));
        assert!(!allowed("127.0.0.1:80", "http://127.0.0.1:81/"));
        assert!(!allowed("127.0.0.1:80", "https://127.0.0.1/"), "port 443");
        for text in ["", "a/b", "user@host", "a?b", "http://a"] {
            assert!(text.parse::<AllowedHost>().is_err(), "{text}");
        }
    }

    #[tokio::test]
    async fn the_resolver_gives_no_inner_address() {
        let found = PublicOnly.resolve("localhost".parse().unwrap()).await;
        let error = found.map(Iterator::count).unwrap_err();
        assert!(error.is::<NotPublic>(), "{error}");
    }
}
