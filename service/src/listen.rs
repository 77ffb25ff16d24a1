//! A text in, an address to listen on out.

use std::net::SocketAddr;

/// Reads an address and a port, as options of services and servers are.
///
/// # Errors
/// What it is not, with one that is.
pub fn socket_address(text: &str) -> Result<SocketAddr, String> {
    let unread = |_| "an address and a port are wanted, such as 127.0.0.1:8080".to_owned();
    text.parse().map_err(unread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_address_and_port_is_told_what_one_looks_like() {
        let read = socket_address("[::1]:80").unwrap();
        assert_eq!((read.port(), read.is_ipv6()), (80, true));
        for text in ["8080", "localhost:8080", "127.0.0.1", ""] {
            let refused = socket_address(text).unwrap_err();
            assert!(refused.contains("such as 127.0.0.1:8080"), "{text}");
        }
    }
}
