//! A text in, an address to listen on out.

use std::net::{Ipv4Addr, SocketAddr};

/// Reads an address and a port, as options of services and servers are. Of names `localhost` alone is one, and stands for 127.0.0.1: what
/// another one stands for is for whoever resolves names, and may be several addresses.
///
/// # Errors
/// What it is not, with one that is.
pub fn socket_address(text: &str) -> Result<SocketAddr, String> {
    let of_this_machine = text.rsplit_once(':').and_then(|(name, port)| {
        let port: u16 = port.parse().ok()?;
        let is_it = name.eq_ignore_ascii_case("localhost");
        is_it.then(|| SocketAddr::from((Ipv4Addr::LOCALHOST, port)))
    });
    if let Some(address) = of_this_machine {
        return Ok(address);
    }
    let unread =
        |_| "an address and a port are wanted, such as 127.0.0.1:8080 or localhost:8080".to_owned();
    text.parse().map_err(unread)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_address_and_port_is_told_what_one_looks_like() {
        let read = socket_address("[::1]:80").unwrap();
        assert_eq!((read.port(), read.is_ipv6()), (80, true));
        for text in ["8080", "ocean:8080", "localhost", "127.0.0.1", ""] {
            let refused = socket_address(text).unwrap_err();
            assert!(refused.contains("such as 127.0.0.1:8080"), "{text}");
        }
    }

    #[test]
    fn this_machine_may_be_called_by_its_name() {
        for text in ["localhost:8793", "LocalHost:8793"] {
            let read = socket_address(text).unwrap();
            assert_eq!(read, SocketAddr::from(([127, 0, 0, 1], 8793)), "{text}");
        }
        for text in [
            "localhost:",
            "localhost:65536",
            "localhost:x",
            "my.localhost:80",
        ] {
            assert!(socket_address(text).is_err(), "{text}");
        }
    }
}
