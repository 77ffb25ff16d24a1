//! How far a connection is: waiting for a request, for the rest of its head, or for an answer, or no more HTTP.
//!
//! That a request is being answered is told by who answers it. Left out on purpose: what the bytes mean, which is why
//! requests that came together, and bodies, need no telling apart here.

use std::time::Duration;

use tokio::time::Instant;

/// How far a connection is while nothing of it is answered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// No request has begun since the last answer.
    Between,
    /// A head has begun and not ended.
    Head { since: Instant },
    /// The answer was that both speak another protocol from here on (RFC 9110, 15.2.2).
    Switched,
}

/// Follows one connection.
#[derive(Debug)]
pub(super) struct Progress {
    phase: Phase,
    moved: Instant,
    /// Bytes of HTTP/2's opening that the connection began with; none once it began otherwise.
    opening: Option<usize>,
}

/// Why a connection is ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum End {
    /// The head takes too long.
    Slow,
    /// Nothing moves.
    Idle,
    /// It speaks HTTP/2, whose requests have no head that could be seen to end. Proxies that speak it to clients speak
    /// HTTP/1.1 to servers.
    Http2,
}

impl End {
    pub(super) fn label(self) -> &'static str {
        match self {
            Self::Slow => "slow",
            Self::Idle => "idle",
            Self::Http2 => "http2",
        }
    }
}

/// How every HTTP/2 connection begins (RFC 9113, 3.4).
const HTTP2: &[u8] = b"PRI * HTTP/2.0\r\n";
/// How an answer begins after which both speak another protocol.
const SWITCHING: &[u8] = b"HTTP/1.1 101";

impl Progress {
    /// A connection that was just opened: its first request is due.
    pub(super) fn new(now: Instant) -> Self {
        Self {
            phase: Phase::Head { since: now },
            moved: now,
            opening: Some(0),
        }
    }

    /// Bytes came from the client. Some mean the end.
    pub(super) fn read(&mut self, bytes: &[u8], now: Instant) -> Option<End> {
        if bytes.is_empty() {
            return None;
        }
        self.moved = now;
        if self.is_http2(bytes) {
            return Some(End::Http2);
        }
        if self.phase == Phase::Between {
            self.phase = Phase::Head { since: now };
        }
        None
    }

    fn is_http2(&mut self, bytes: &[u8]) -> bool {
        let Some(known) = self.opening else {
            return false;
        };
        let rest = &HTTP2[known..];
        let shared = rest.len().min(bytes.len());
        self.opening = (rest[..shared] == bytes[..shared]).then_some(known + shared);
        self.opening == Some(HTTP2.len())
    }

    /// A request is being answered, so its head has ended.
    pub(super) fn answering(&mut self) {
        if self.phase != Phase::Switched {
            self.phase = Phase::Between;
        }
    }

    /// Bytes of an answer went to the client, or wait to.
    pub(super) fn wrote(&mut self, bytes: &[u8], now: Instant) {
        self.moved = now;
        self.answering();
        if bytes.starts_with(SWITCHING) {
            self.phase = Phase::Switched;
        }
    }

    /// When the connection is ended unless something moves, and why.
    pub(super) fn due(&self, head: Duration, idle: Duration) -> (Instant, End) {
        let idle_at = self.moved + idle;
        match self.phase {
            Phase::Head { since } if since + head < idle_at => (since + head, End::Slow),
            _ => (idle_at, End::Idle),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: Duration = Duration::from_secs(10);
    const IDLE: Duration = Duration::from_secs(100);

    struct Clock {
        start: Instant,
        progress: Progress,
    }

    impl Clock {
        fn new() -> Self {
            let start = Instant::now();
            let progress = Progress::new(start);
            Self { start, progress }
        }

        fn read(&mut self, second: u64, text: &str) {
            let now = self.start + Duration::from_secs(second);
            assert_eq!(self.progress.read(text.as_bytes(), now), None);
        }

        fn wrote(&mut self, second: u64, text: &str) {
            let now = self.start + Duration::from_secs(second);
            self.progress.wrote(text.as_bytes(), now);
        }

        fn due(&self) -> (u64, End) {
            let (at, why) = self.progress.due(HEAD, IDLE);
            ((at - self.start).as_secs(), why)
        }
    }

    #[test]
    fn a_head_is_due_from_its_beginning_however_often_a_byte_comes() {
        let mut clock = Clock::new();
        assert_eq!(clock.due(), (10, End::Slow));
        for second in 1..9 {
            clock.read(second, "x");
        }
        assert_eq!(clock.due(), (10, End::Slow));
        clock.read(9, "\r\n\r\n");
        clock.progress.answering();
        assert_eq!(clock.due(), (109, End::Idle), "an answer may take its time");
    }

    #[test]
    fn the_next_head_is_due_from_its_own_beginning() {
        let mut clock = Clock::new();
        clock.read(1, "GET / HTTP/1.1\r\nhost: a\r\n\r\n");
        clock.progress.answering();
        clock.wrote(2, "HTTP/1.1 200 OK");
        assert_eq!(clock.due(), (102, End::Idle), "nothing was asked yet");
        clock.read(50, "G");
        clock.read(55, "ET");
        assert_eq!(clock.due(), (60, End::Slow));
    }

    #[test]
    fn what_came_with_a_request_that_is_answered_is_no_slow_head() {
        let mut clock = Clock::new();
        clock.read(1, "GET / HTTP/1.1\r\n\r\nGET /slow HTTP/1.1\r\n\r\n");
        clock.progress.answering();
        clock.wrote(2, "HTTP/1.1 200 OK");
        clock.progress.answering();
        assert_eq!(clock.due(), (102, End::Idle), "the second is answered");
        clock.wrote(30, "HTTP/1.1 200 OK");
        assert_eq!(clock.due(), (130, End::Idle));
        clock.read(40, "G");
        assert_eq!(clock.due(), (50, End::Slow));
    }

    #[test]
    fn what_comes_after_a_switch_is_no_head() {
        let mut clock = Clock::new();
        clock.read(1, "GET /stream HTTP/1.1\r\nupgrade: websocket\r\n\r\n");
        clock.wrote(2, "HTTP/1.1 101 Switching Protocols\r\n\r\n");
        clock.read(50, "a frame");
        assert_eq!(clock.due(), (150, End::Idle));
        clock.wrote(60, "another");
        clock.read(61, "and more");
        assert_eq!(clock.due(), (161, End::Idle));
    }

    #[test]
    fn http2_is_told_by_how_it_opens_in_whatever_pieces_it_comes() {
        let now = Instant::now();
        for size in 1..=HTTP2.len() {
            let mut progress = Progress::new(now);
            let ends: Vec<_> = HTTP2
                .chunks(size)
                .map(|part| progress.read(part, now))
                .collect();
            let (last, before) = ends.split_last().unwrap();
            assert_eq!(*last, Some(End::Http2), "{size}");
            assert!(before.iter().all(Option::is_none), "{size}");
        }
        let mut progress = Progress::new(now);
        assert_eq!(progress.read(b"GET / HTTP/1.1\r\n\r\n", now), None);
        assert_eq!(progress.read(HTTP2, now), None, "that is a body");
    }
}
