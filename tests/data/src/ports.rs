//! Ports for servers that tests start, stop and start again.

use std::net::TcpListener;
use std::sync::Mutex;

/// Below the range that Linux gives to outgoing connections (32,768 on): any of those, of whatever process, could take the
/// port of a server that is down for a moment, and the server would not come back.
const FIRST: u16 = 10_000;
const COUNT: u16 = 22_000;
/// As far apart as test programs begin that run at once.
const STRIDE: u16 = 1_000;

/// The last port that this process was given.
static GIVEN: Mutex<Option<u16>> = Mutex::new(None);

/// A port that is free and that no other caller in this process was given.
///
/// # Panics
/// If none of them is free.
pub fn free_port() -> u16 {
    let mut given = GIVEN.lock().expect("nobody panics while holding it");
    for _ in 0..COUNT {
        let next = given.map_or_else(first, after);
        *given = Some(next);
        if TcpListener::bind(("127.0.0.1", next)).is_ok() {
            return next;
        }
    }
    panic!("none of the {COUNT} ports from {FIRST} is free");
}

fn first() -> u16 {
    let block = std::process::id() % u32::from(COUNT / STRIDE);
    FIRST + u16::try_from(block).expect("there are few blocks") * STRIDE
}

fn after(port: u16) -> u16 {
    FIRST + (port - FIRST + 1) % COUNT
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ports_are_new_free_and_not_of_outgoing_connections() {
        let first = free_port();
        let taken = TcpListener::bind(("127.0.0.1", after(first)));
        let second = free_port();
        assert_ne!(first, second);
        if taken.is_ok() {
            assert_ne!(second, after(first));
        }
        for port in [first, second] {
            assert!((FIRST..FIRST + COUNT).contains(&port), "{port}");
        }
        assert_eq!(after(FIRST + COUNT - 1), FIRST);
    }
}
