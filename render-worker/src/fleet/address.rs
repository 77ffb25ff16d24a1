//! Where render workers are: fixed addresses, or a name that is looked up again and again.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

/// One entry of the list of workers.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum WorkerAddress {
    /// `HOST:PORT`.
    Fixed(HostPort),
    /// `dns:NAME:PORT`: a worker at every address that the name has at the moment.
    Looked(HostPort),
}

/// A host and a port.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub struct HostPort {
    /// Name or address; an IPv6 address in brackets.
    pub host: String,
    /// Port.
    pub port: u16,
}

/// An entry that is no address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0:?} is no address of a render worker: HOST:PORT or dns:NAME:PORT")]
pub struct AddressError(String);

impl FromStr for WorkerAddress {
    type Err = AddressError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        match s.strip_prefix("dns:") {
            Some(name) => name.parse().map(Self::Looked),
            None => s.parse().map(Self::Fixed),
        }
        .map_err(|_part| AddressError(s.to_owned()))
    }
}

impl FromStr for HostPort {
    type Err = AddressError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || AddressError(s.to_owned());
        let (host, port) = s.rsplit_once(':').ok_or_else(bad)?;
        let port: u16 = port.parse().map_err(|_not_a_port| bad())?;
        let is_name = |c: u8| c.is_ascii_alphanumeric() || matches!(c, b'.' | b'-' | b'_');
        let bare = host.strip_prefix('[').and_then(|h| h.strip_suffix(']'));
        let valid = match bare {
            Some(v6) => v6.parse::<std::net::Ipv6Addr>().is_ok(),
            None => !host.is_empty() && host.len() <= 253 && host.bytes().all(is_name),
        };
        if port == 0 || !valid {
            return Err(bad());
        }
        Ok(Self {
            host: host.to_owned(),
            port,
        })
    }
}

impl Display for HostPort {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}:{}", self.host, self.port)
    }
}

impl Display for WorkerAddress {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Fixed(at) => write!(f, "{at}"),
            Self::Looked(at) => write!(f, "dns:{at}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_parse_as_themselves_and_everything_else_is_refused() {
        for text in [
            "worker-1:50061",
            "10.0.0.7:1",
            "[::1]:50061",
            "dns:render.svc:50061",
        ] {
            assert_eq!(text.parse::<WorkerAddress>().unwrap().to_string(), text);
        }
        for text in [
            "",
            "worker",
            "worker:0",
            "worker:99999",
            "http://worker:1",
            "user@worker:1",
            "worker:1/path",
            "dns:",
            "::1:50061",
            "[::g]:1",
            ":1",
        ] {
            assert!(text.parse::<WorkerAddress>().is_err(), "{text:?}");
        }
    }
}
