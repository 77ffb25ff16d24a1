//! An instant as ISO 8601 text. Answers and manifests hold thousands: written digit by digit they take a tenth of what the
//! library's formatter takes, which was most of the time of a long answer.

use chrono::{DateTime, Datelike as _, Timelike as _, Utc};

/// `2000-01-16T12:00:00Z`, with milliseconds where there are any; no longer than `2000-01-16T12:00:00.250Z`.
pub(super) struct IsoText {
    bytes: [u8; 24],
    length: usize,
}

impl IsoText {
    /// Of an instant in the years 1 to 9999.
    pub(super) fn of(utc: DateTime<Utc>) -> Self {
        let mut text = Self {
            bytes: [0; 24],
            length: 0,
        };
        text.put(utc.year().unsigned_abs(), 4, b'-');
        text.put(utc.month(), 2, b'-');
        text.put(utc.day(), 2, b'T');
        text.put(utc.hour(), 2, b':');
        text.put(utc.minute(), 2, b':');
        match utc.timestamp_subsec_millis() {
            0 => text.put(utc.second(), 2, b'Z'),
            ms => {
                text.put(utc.second(), 2, b'.');
                text.put(ms, 3, b'Z');
            }
        }
        text
    }

    /// Adds a number of so many digits, and what stands behind it.
    fn put(&mut self, number: u32, digits: usize, behind: u8) {
        let end = self.length + digits;
        let mut left = number;
        for byte in self.bytes[self.length..end].iter_mut().rev() {
            *byte = b'0' + (left % 10) as u8;
            left /= 10;
        }
        self.bytes[end] = behind;
        self.length = end + 1;
    }

    /// The text.
    pub(super) fn as_str(&self) -> &str {
        str::from_utf8(&self.bytes[..self.length]).expect("digits and signs are ASCII")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use chrono::SecondsFormat;

    #[test]
    fn the_text_is_that_of_the_library() {
        let mut ms: i64 = -62_135_596_800_000; // the start of year 1
        let mut count = 0;
        while let Some(utc) = DateTime::from_timestamp_millis(ms).filter(|t| t.year() <= 9999) {
            let own = IsoText::of(utc);
            assert_eq!(
                own.as_str(),
                utc.to_rfc3339_opts(SecondsFormat::AutoSi, true)
            );
            // Some 30 days, now with and now without milliseconds.
            ms += 2_592_000_000 + [0, 1, 999, 86_399_000][count % 4];
            count += 1;
        }
        assert!(count > 100_000, "{count}");
    }
}
