//! Who asks: what turns at analyses are dealt out by. Nobody logs in; an address stands for a client.

use std::net::{IpAddr, Ipv6Addr, SocketAddr};

use axum::extract::{Request, State};
use axum::http::{HeaderMap, HeaderName};
use axum::middleware::Next;
use axum::response::Response;

tokio::task_local! {
    /// Of the request that this task answers.
    static ASKING: Client;
}

/// An address, of IPv6 the network of a site: a host there has as many addresses as it likes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) struct Client(IpAddr);

impl Client {
    /// Who is at the other end of a connection.
    pub(crate) fn at(address: SocketAddr) -> Self {
        Self::of(address.ip())
    }

    fn of(address: IpAddr) -> Self {
        Self(match address.to_canonical() {
            IpAddr::V6(own) => {
                let site = u128::from(own) >> 64 << 64;
                IpAddr::V6(Ipv6Addr::from(site))
            }
            IpAddr::V4(own) => IpAddr::V4(own),
        })
    }

    /// Who asks for what this task works at; nobody in particular outside of requests.
    pub(crate) fn asking() -> Self {
        let nobody = Self(IpAddr::V6(Ipv6Addr::UNSPECIFIED));
        ASKING.try_with(|client| *client).unwrap_or(nobody)
    }

    /// Who asks, as the proxy next to us tells: the last address in its header, for those before it are what others say.
    fn told(headers: &HeaderMap, name: &HeaderName) -> Option<Self> {
        let last = headers.get_all(name).iter().next_back()?;
        let text = last.to_str().ok()?.rsplit(',').next()?.trim();
        let with_port = || text.parse().ok().map(|address: SocketAddr| address.ip());
        text.parse().ok().or_else(with_port).map(Self::of)
    }
}

/// Remembers who asks while a request is answered; `header` is that of a proxy that tells.
pub(crate) async fn remember(
    State(header): State<Option<HeaderName>>,
    request: Request,
    next: Next,
) -> Response {
    let peer = request.extensions().get::<Client>().copied();
    let told = header.and_then(|name| Client::told(request.headers(), &name));
    match told.or(peer) {
        Some(client) => ASKING.scope(client, next.run(request)).await,
        None => next.run(request).await,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn client(text: &str) -> Client {
        Client::of(text.parse().unwrap())
    }

    #[test]
    fn a_site_is_one_client_and_an_old_address_in_new_clothes_is_itself() {
        assert_eq!(client("2001:db8:1:2::3"), client("2001:db8:1:2:ffff::9"));
        assert_ne!(client("2001:db8:1:2::3"), client("2001:db8:1:3::3"));
        assert_eq!(client("::ffff:192.0.2.7"), client("192.0.2.7"));
        assert_ne!(client("192.0.2.7"), client("192.0.2.8"));
    }

    #[test]
    fn the_last_address_that_a_proxy_tells_counts_and_no_address_is_none() {
        let name = HeaderName::from_static("x-forwarded-for");
        let told = |values: &[&str]| {
            let mut headers = HeaderMap::new();
            for value in values {
                headers.append(name.clone(), value.parse().unwrap());
            }
            Client::told(&headers, &name)
        };
        assert_eq!(told(&["10.0.0.9, 192.0.2.7"]), Some(client("192.0.2.7")));
        assert_eq!(
            told(&["192.0.2.8", "192.0.2.7:4711"]),
            Some(client("192.0.2.7"))
        );
        assert_eq!(told(&["[2001:db8::1]:443"]), Some(client("2001:db8::1")));
        for none in [&[][..], &["unknown"], &["192.0.2.7, "]] {
            assert_eq!(told(none), None, "{none:?}");
        }
    }

    #[tokio::test]
    async fn who_asks_is_known_within_the_request_and_nobody_without() {
        let asked = ASKING.scope(client("192.0.2.7"), async { Client::asking() });
        assert_eq!(asked.await, client("192.0.2.7"));
        assert_eq!(Client::asking(), client("::"));
    }
}
