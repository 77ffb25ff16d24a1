//! Instants for people: the day where that says all, with hour and minute where it does not; a column of them alike.

use contract::time::TimeMs;

const DAY_MS: i64 = 86_400_000;
/// `2000-01-31`.
const DAY_CHARS: usize = 10;
/// `2000-01-31T12:30`.
const MINUTE_CHARS: usize = 16;

/// How all instants of a column are written.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Instants {
    chars: usize,
}

impl Instants {
    /// As days where each is a midnight, UTC, to the minute otherwise.
    pub(crate) fn of(all: impl IntoIterator<Item = TimeMs>) -> Self {
        let is_midnight = |time: TimeMs| time.ms().rem_euclid(DAY_MS) == 0;
        let chars = if all.into_iter().all(is_midnight) {
            DAY_CHARS
        } else {
            MINUTE_CHARS
        };
        Self { chars }
    }

    /// One of them.
    pub(crate) fn text(self, time: TimeMs) -> String {
        time.to_string()[..self.chars].to_owned()
    }
}

/// One instant by itself.
pub(crate) fn shown(time: TimeMs) -> String {
    Instants::of([time]).text(time)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hours_are_told_where_days_would_not_tell_a_start_from_its_end() {
        let instant = |text: &str| -> TimeMs { text.parse().unwrap() };
        let days = ["2000-01-01", "2000-02-01"].map(instant);
        assert_eq!(
            days.map(|one| Instants::of(days).text(one)),
            ["2000-01-01", "2000-02-01"]
        );
        let halves = ["2000-01-01", "2000-01-01T12:00:00Z", "1969-12-31T23:30:59Z"].map(instant);
        assert_eq!(
            halves.map(|one| Instants::of(halves).text(one)),
            ["2000-01-01T00:00", "2000-01-01T12:00", "1969-12-31T23:30"]
        );
        assert_eq!(
            halves.map(shown),
            ["2000-01-01", "2000-01-01T12:00", "1969-12-31T23:30"]
        );
    }
}
