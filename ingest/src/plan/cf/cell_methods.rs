//! What `cell_methods` says of time: values at instants, or over intervals (CF 7.3 and 7.4).

/// What the values of a variable are along time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimeMethod {
    /// Values at the instants of the stamps.
    Point,
    /// Means, sums or extremes over intervals.
    Interval,
    /// Of the same hours of many days: a step is no single stretch of time.
    WithinDays,
}

/// The method along time; none if the text says nothing of it. `time` is the name of the time coordinate.
pub(crate) fn of_time(text: &str, time: &str) -> Option<TimeMethod> {
    let mut found = None;
    for said in all_of_time(text, time) {
        let is_within_days = said.windows(2).any(|pair| pair == ["within", "days"]);
        let method = match said[0].as_str() {
            _ if is_within_days => TimeMethod::WithinDays,
            "point" => TimeMethod::Point,
            _ => TimeMethod::Interval,
        };
        // Of a climatology, which has two methods, the first that is no interval counts.
        if found.is_none_or(|found| found == TimeMethod::Interval) {
            found = Some(method);
        }
    }
    found
}

/// What is said of each method along time, in small letters; the method is the first word.
pub(crate) fn all_of_time(text: &str, time: &str) -> Vec<Vec<String>> {
    let plain = without_comments(text);
    let mut words = plain.split_whitespace().peekable();
    let mut all = vec![];
    while words.peek().is_some() {
        let mut is_time = false;
        while let Some(name) = words.next_if(|word| word.ends_with(':')) {
            let name = name.trim_end_matches(':');
            is_time |= name == time || name.eq_ignore_ascii_case("time");
        }
        let mut said = vec![];
        while let Some(word) = words.next_if(|word| !word.ends_with(':')) {
            let word = word.trim_end_matches([',', ';', '.']);
            said.push(word.to_ascii_lowercase());
        }
        if is_time && !said.is_empty() {
            all.push(said);
        }
    }
    all
}

fn without_comments(text: &str) -> String {
    let mut depth = 0u32;
    let mut outside = |c: char| {
        match c {
            '(' => depth += 1,
            ')' => {
                depth = depth.saturating_sub(1);
                return None;
            }
            _ => {}
        }
        (depth == 0).then_some(c)
    };
    text.chars().filter_map(&mut outside).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_method_of_time_is_told_from_those_of_other_axes() {
        for (text, expected) in [
            ("time: point", Some(TimeMethod::Point)),
            ("area: mean time: point", Some(TimeMethod::Point)),
            ("area: time: mean", Some(TimeMethod::Interval)),
            ("time: area: mean", Some(TimeMethod::Interval)),
            ("time: lat: lon: point", Some(TimeMethod::Point)),
            (
                "time: mean (interval: 1 hour comment: time: point)",
                Some(TimeMethod::Interval),
            ),
            ("lat: lon: mean where sea", None),
            ("T: point", Some(TimeMethod::Point)),
            (
                "time: mean within years time: mean over years",
                Some(TimeMethod::Interval),
            ),
            (
                "time: maximum within days time: mean over days",
                Some(TimeMethod::WithinDays),
            ),
            ("", None),
            ("point", None),
            ("time:", None),
        ] {
            assert_eq!(of_time(text, "T"), expected, "{text}");
        }
    }
}
