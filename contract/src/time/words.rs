//! Instants and periods as people say them: `15 July 2000`, `July 2000`, `monthly`.

use chrono::Datelike as _;

use super::{Period, TimeMs};

const HOUR_MS: i64 = 3_600_000;
const DAY_MS: i64 = 24 * HOUR_MS;

impl TimeMs {
    /// Its day: `15 July 2000`.
    pub fn day_in_words(self) -> String {
        let t = self.utc();
        format!("{} {} {}", t.day(), t.format("%B"), t.year())
    }

    /// Its day and time: `15 July 2000, 06:30 UTC`.
    pub fn in_words(self) -> String {
        format!(
            "{}, {} UTC",
            self.day_in_words(),
            self.utc().format("%H:%M")
        )
    }

    fn is_midnight(self) -> bool {
        self.ms().rem_euclid(DAY_MS) == 0
    }
}

impl Period {
    /// Is it as long as a day, or longer?
    pub fn has_days(self) -> bool {
        self.end.ms() - self.start.ms() >= DAY_MS
    }

    /// A year, month or day by its name, else from when to when; the day of the end is part of it.
    pub fn in_words(self) -> String {
        let (year, month) = self.start.year_month();
        if Self::year(year) == Ok(self) {
            return year.to_string();
        }
        if Self::month(year, month) == Ok(self) {
            return self.start.utc().format("%B %-Y").to_string();
        }
        if !(self.start.is_midnight() && self.end.is_midnight()) {
            return format!("{} to {}", self.start.in_words(), self.end.in_words());
        }
        let first = self.start.day_in_words();
        let last = TimeMs(self.end.ms() - DAY_MS).day_in_words();
        if first == last {
            first
        } else {
            format!("{first} to {last}")
        }
    }

    /// What a mean over it is called: `yearly`, `monthly`, `daily`, `8-day`, `hourly`, `3-hour`; none of an odd length.
    pub fn adjective(self) -> Option<String> {
        let (year, month) = self.start.year_month();
        if Self::year(year) == Ok(self) {
            return Some("yearly".to_owned());
        }
        if Self::month(year, month) == Ok(self) {
            return Some("monthly".to_owned());
        }
        let length_ms = self.end.ms() - self.start.ms();
        for (unit_ms, one, many) in [(DAY_MS, "daily", "day"), (HOUR_MS, "hourly", "hour")] {
            match (length_ms % unit_ms, length_ms / unit_ms) {
                (0, 1) => return Some(one.to_owned()),
                (0, count) => return Some(format!("{count}-{many}")),
                _ => (),
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn time(text: &str) -> TimeMs {
        text.parse().unwrap()
    }

    fn period(start: &str, end: &str) -> Period {
        Period::new(time(start), time(end)).unwrap()
    }

    #[test]
    fn instants_are_said_as_people_say_them() {
        assert_eq!(time("2000-07-15T06:30:59Z").day_in_words(), "15 July 2000");
        assert_eq!(
            time("2000-07-05T06:30:59Z").in_words(),
            "5 July 2000, 06:30 UTC"
        );
        assert_eq!(
            time("1969-12-31T23:59:59Z").in_words(),
            "31 December 1969, 23:59 UTC"
        );
        assert_eq!(time("0099-01-01").day_in_words(), "1 January 99");
    }

    #[test]
    fn periods_have_their_names() {
        for (start, end, words, adjective) in [
            ("2000", "2001", "2000", Some("yearly")),
            ("2000-02", "2000-03", "February 2000", Some("monthly")),
            (
                "2000-02-29",
                "2000-03-01",
                "29 February 2000",
                Some("daily"),
            ),
            (
                "2000-02-26",
                "2000-03-05",
                "26 February 2000 to 4 March 2000",
                Some("8-day"),
            ),
            (
                "2000-02-26T03:00:00",
                "2000-02-26T06:00:00",
                "26 February 2000, 03:00 UTC to 26 February 2000, 06:00 UTC",
                Some("3-hour"),
            ),
            (
                "2000-02-26T03:00:00",
                "2000-02-26T04:00:00",
                "26 February 2000, 03:00 UTC to 26 February 2000, 04:00 UTC",
                Some("hourly"),
            ),
            (
                "2000-02-26T03:00:00",
                "2000-02-26T03:07:00",
                "26 February 2000, 03:00 UTC to 26 February 2000, 03:07 UTC",
                None,
            ),
        ] {
            let period = period(start, end);
            assert_eq!(period.in_words(), words);
            assert_eq!(period.adjective().as_deref(), adjective, "{words}");
        }
    }
}
