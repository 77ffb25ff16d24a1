//! Which network addresses are public: a notice must not make the service ask its own neighbours.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::LazyLock;

use ipnet::IpNet;

/// Networks that are not public. IPv4: RFC 6890 and its updates, multicast and reserved, and the address at which one cloud
/// keeps its metadata outside of these. IPv6, inside [`GLOBAL_UNICAST`]: protocol assignments (Teredo among them),
/// documentation, 6to4.
static NOT_PUBLIC: LazyLock<Vec<IpNet>> = LazyLock::new(|| {
    let all = "0.0.0.0/8 10.0.0.0/8 100.64.0.0/10 127.0.0.0/8 168.63.129.16/32 169.254.0.0/16 172.16.0.0/12 192.0.0.0/24 \
               192.0.2.0/24 192.88.99.0/24 192.168.0.0/16 198.18.0.0/15 198.51.100.0/24 203.0.113.0/24 224.0.0.0/4 240.0.0.0/4 \
               2001::/23 2001:db8::/32 2002::/16 3fff::/20";
    all.split(' ').map(network).collect()
});
/// Where public IPv6 addresses are.
static GLOBAL_UNICAST: LazyLock<IpNet> = LazyLock::new(|| network("2000::/3"));
/// IPv4 addresses behind a translator (RFC 6052), which a network without IPv4 reaches the world through.
static TRANSLATED: LazyLock<IpNet> = LazyLock::new(|| network("64:ff9b::/96"));

fn network(text: &str) -> IpNet {
    text.parse()
        .expect("a network of this file, which a test reads")
}

/// Is it an address of the public network?
pub(super) fn is_public(address: IpAddr) -> bool {
    match address.to_canonical() {
        IpAddr::V6(v6) if TRANSLATED.contains(&address) => {
            is_public(Ipv4Addr::from_bits(v6.to_bits() as u32).into())
        }
        IpAddr::V6(_) if !GLOBAL_UNICAST.contains(&address) => false,
        plain => !NOT_PUBLIC.iter().any(|block| block.contains(&plain)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inner_addresses_are_not_public_in_any_notation() {
        for text in [
            "0.0.0.0",
            "10.1.2.3",
            "100.64.0.1",
            "100.100.100.200",
            "127.0.0.1",
            "127.255.255.254",
            "168.63.129.16",
            "169.254.169.254",
            "172.16.0.1",
            "172.31.255.255",
            "192.0.0.192",
            "192.168.1.1",
            "198.19.0.1",
            "224.0.0.1",
            "240.0.0.1",
            "255.255.255.255",
            "::",
            "::1",
            "::ffff:127.0.0.1",
            "::ffff:169.254.169.254",
            "::127.0.0.1",
            "64:ff9b::10.0.0.1",
            "64:ff9b:1::1",
            "100::1",
            "2001::1",
            "2001:db8::1",
            "2002:7f00:1::",
            "fc00::1",
            "fd00:ec2::254",
            "fe80::1",
            "fec0::1",
            "ff02::1",
        ] {
            assert!(!is_public(text.parse().unwrap()), "{text}");
        }
    }

    #[test]
    fn public_addresses_are_public() {
        for text in [
            "1.1.1.1",
            "9.255.255.255",
            "11.0.0.0",
            "100.128.0.1",
            "168.63.129.17",
            "172.32.0.1",
            "192.0.1.1",
            "223.255.255.255",
            "2606:4700::1111",
            "2001:4860:4860::8888",
            "64:ff9b::1.1.1.1",
            "::ffff:1.1.1.1",
        ] {
            assert!(is_public(text.parse().unwrap()), "{text}");
        }
    }
}
