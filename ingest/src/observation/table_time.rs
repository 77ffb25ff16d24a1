//! When a row of a table was measured: one column or several, UTC unless the text says otherwise.

use contract::time::TimeMs;

use super::table_columns::Columns;

/// The time of a row of fields.
pub(super) fn of_row<'a>(
    columns: &Columns,
    field: impl Fn(usize) -> Option<&'a str>,
) -> Option<TimeMs> {
    if let Some(text) = columns.date_time.and_then(&field) {
        return of_text(text);
    }
    let number = |part: usize| -> Option<f64> {
        match columns.clock[part] {
            Some(at) => field(at)?.parse().ok(),
            // Hours, minutes and seconds may be absent: then the day or hour begins.
            None => (part >= 3).then_some(0.0),
        }
    };
    let whole = |part: usize, most: f64| {
        number(part)
            .filter(|n| (0.0..=most).contains(n) && n.fract() == 0.0)
            .map(|n| n as u32)
    };
    let year = i32::try_from(whole(0, 9999.0)?).ok()?;
    let midnight = TimeMs::from_ymd(year, whole(1, 12.0)?, whole(2, 31.0)?).ok()?;
    let minutes = whole(3, 23.0)? * 60 + whole(4, 59.0)?;
    let second = number(5).filter(|s| (0.0..=60.0).contains(s))?;
    let ms = midnight.ms() + i64::from(minutes) * 60_000 + (second * 1000.0).round() as i64;
    TimeMs::new(ms).ok()
}

/// `2015-01-28 10:00:00`, `2015-01-28T10:00`, `2015-01-28`, with an offset from UTC or without.
fn of_text(text: &str) -> Option<TimeMs> {
    let text = text.trim().replacen(' ', "T", 1);
    let is_day_and_minute = text.len() == 16 && text.as_bytes().get(13) == Some(&b':');
    if is_day_and_minute {
        return format!("{text}:00").parse().ok();
    }
    // A year alone is no time of a measurement.
    (text.len() >= 10).then(|| text.parse().ok()).flatten()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn spellings_of_one_instant() {
        for text in [
            "2015-01-28 10:00:00",
            "2015-01-28T10:00",
            "2015-01-28T12:00:00+02:00",
            "2015-01-28T10:00:00Z",
        ] {
            assert_eq!(
                of_text(text).unwrap().to_string(),
                "2015-01-28T10:00:00Z",
                "{text}"
            );
        }
        for text in ["2015", "", "28.01.2015 10:00", "NaN"] {
            assert_eq!(of_text(text), None, "{text}");
        }
    }

    #[test]
    fn columns_of_a_clock_are_one_instant() {
        let columns = Columns::of("yr\tmon\tday\thh\tmm\tss\tlat\tlon").unwrap();
        let at = |row: &'static str| {
            let fields: Vec<&str> = row.split(' ').collect();
            of_row(&columns, |at| fields.get(at).copied()).map(|t| t.to_string())
        };
        assert_eq!(
            at("2013 10 9 19 42 7.5").as_deref(),
            Some("2013-10-09T19:42:07.500Z")
        );
        for row in [
            "2013 13 9 19 42 7",
            "2013 2 30 0 0 0",
            "2013 1 1 24 0 0",
            "x 1 1 1 1 1",
            "2013 1",
        ] {
            assert_eq!(at(row), None, "{row}");
        }
    }
}
