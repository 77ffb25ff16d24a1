//! How far a connection is, from its bytes alone: waiting for a request's head, or for an answer, or no more HTTP.
//!
//! Left out on purpose: what the bytes mean. A head ends with an empty line, which is all that is looked for.

use std::time::Duration;

use tokio::time::Instant;

/// How far a connection is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Phase {
    /// No request has begun since the last answer.
    Between,
    /// A head has begun and not ended.
    Head { since: Instant },
    /// A head has ended and no answer begun. With `more`, bytes came behind it: of a body, or of the next request.
    Asked { more: bool },
    /// The answer was that both speak another protocol from here on (RFC 9110, 15.2.2).
    Switched,
}

/// Follows the bytes of one connection.
#[derive(Debug)]
pub(super) struct Progress {
    phase: Phase,
    moved: Instant,
    /// Bytes of the empty line that ends a head which came last: `\r\n\r\n`.
    matched: usize,
    /// Has the head more than the empty lines that may stand before it (RFC 9112, 2.2)?
    has_text: bool,
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
const END_OF_HEAD: &[u8] = b"\r\n\r\n";
/// How an answer begins after which both speak another protocol.
const SWITCHING: &[u8] = b"HTTP/1.1 101";

impl Progress {
    /// A connection that was just opened: its first request is due.
    pub(super) fn new(now: Instant) -> Self {
        Self {
            phase: Phase::Head { since: now },
            moved: now,
            matched: 0,
            has_text: false,
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
        self.advance(bytes, now);
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

    fn advance(&mut self, bytes: &[u8], now: Instant) {
        if self.phase == Phase::Switched {
            return;
        }
        if self.phase == Phase::Between {
            self.phase = Phase::Head { since: now };
        }
        if let Phase::Asked { more } = &mut self.phase {
            *more = true;
            return;
        }
        if let Some(end) = self.end_of_head(bytes) {
            (self.matched, self.has_text) = (0, false);
            let more = end < bytes.len();
            self.phase = Phase::Asked { more };
        }
    }

    /// Where the head ends in these bytes, if it does.
    fn end_of_head(&mut self, bytes: &[u8]) -> Option<usize> {
        for (at, byte) in bytes.iter().enumerate() {
            self.matched = match *byte {
                byte if byte == END_OF_HEAD[self.matched] => self.matched + 1,
                b'\r' => 1,
                // A lone line feed ends a line as well (RFC 9112, 2.2).
                b'\n' if self.matched == 0 => 2,
                b'\n' => 4,
                _ => 0,
            };
            self.has_text |= self.matched == 0;
            if self.matched == END_OF_HEAD.len() {
                if self.has_text {
                    return Some(at + 1);
                }
                self.matched = 2;
            }
        }
        None
    }

    /// Bytes went to the client.
    pub(super) fn wrote(&mut self, bytes: &[u8], now: Instant) {
        self.moved = now;
        if matches!(self.phase, Phase::Asked { .. }) && bytes.starts_with(SWITCHING) {
            self.phase = Phase::Switched;
            return;
        }
        if let Phase::Asked { more } = self.phase {
            // What came behind the head may be the next one's beginning: it is due like any other.
            self.phase = if more {
                Phase::Head { since: now }
            } else {
                Phase::Between
            };
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

        fn wrote(&mut self, second: u64) {
            self.wrote_text(second, "HTTP/1.1 200 OK");
        }

        fn wrote_text(&mut self, second: u64, text: &str) {
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
        clock.read(9, "\r\n\r");
        assert_eq!(clock.due(), (10, End::Slow));
        clock.read(9, "\n");
        assert_eq!(clock.due(), (109, End::Idle), "an answer may take its time");
    }

    #[test]
    fn the_next_head_is_due_from_its_own_beginning() {
        let mut clock = Clock::new();
        clock.read(1, "GET / HTTP/1.1\r\nhost: a\r\n\r\n");
        clock.wrote(2);
        assert_eq!(clock.due(), (102, End::Idle), "nothing was asked yet");
        clock.read(50, "G");
        clock.read(55, "ET");
        assert_eq!(clock.due(), (60, End::Slow));
    }

    #[test]
    fn what_comes_behind_a_head_is_due_from_its_answer_on() {
        let mut clock = Clock::new();
        clock.read(1, "GET / HTTP/1.1\r\n\r\nGET /sl");
        assert_eq!(clock.due(), (101, End::Idle));
        clock.wrote(30);
        assert_eq!(clock.due(), (40, End::Slow));
    }

    #[test]
    fn what_comes_after_a_switch_is_no_head() {
        let mut clock = Clock::new();
        clock.read(1, "GET /stream HTTP/1.1\r\nupgrade: websocket\r\n\r\n");
        clock.wrote_text(2, "HTTP/1.1 101 Switching Protocols\r\n\r\n");
        clock.read(50, "a frame");
        assert_eq!(clock.due(), (150, End::Idle));
        clock.wrote_text(60, "another");
        clock.read(61, "and more");
        assert_eq!(clock.due(), (161, End::Idle));
    }

    #[test]
    fn lone_line_feeds_end_a_head_and_near_misses_do_not() {
        for (text, ends) in [
            ("GET /\n\n", true),
            ("GET /\r\n\n", true),
            ("GET /\n\r\n", true),
            ("GET /\r\n\r\r\n", false),
            ("GET /\r\nhost: a\r\n", false),
            ("\r\n\r\n", false),
            ("\n\n\n", false),
            ("\r\n\r\nGET / HTTP/1.1\r\n", false),
            ("\r\n\r\nGET / HTTP/1.1\r\n\r\n", true),
        ] {
            let mut clock = Clock::new();
            clock.read(1, text);
            assert_eq!(clock.due().1 == End::Idle, ends, "{text:?}");
        }
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
