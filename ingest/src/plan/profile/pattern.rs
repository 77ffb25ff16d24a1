//! Patterns of names: `*` is any text, `?` any character, `{year}` and its like are digits that mean a date.

/// Numbers that a pattern found.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Found {
    pub(crate) year: Option<u32>,
    pub(crate) month: Option<u32>,
    pub(crate) day: Option<u32>,
    pub(crate) day_of_year: Option<u32>,
    pub(crate) hour: Option<u32>,
}

/// Longest pattern and longest name, bytes: bounds the time that matching takes.
const MAX_BYTES: usize = 512;

#[derive(Debug, Clone, Copy, PartialEq)]
enum Piece {
    Literal(u8),
    AnyText,
    AnyByte,
    Number(PatternField),
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum PatternField {
    Year,
    Month,
    Day,
    DayOfYear,
    Hour,
}

impl PatternField {
    const ALL: [(&str, Self, usize); 5] = [
        ("{year}", Self::Year, 4),
        ("{month}", Self::Month, 2),
        ("{day}", Self::Day, 2),
        ("{day_of_year}", Self::DayOfYear, 3),
        ("{hour}", Self::Hour, 2),
    ];

    fn digits(self) -> usize {
        Self::ALL
            .iter()
            .find(|(_, field, _)| *field == self)
            .map_or(0, |(_, _, digits)| *digits)
    }
}

/// Is a pattern of a date well formed: known fields, a year unless it is known already?
pub(crate) fn check(pattern: &str, knows_year: bool) -> Result<(), String> {
    let pieces = pieces(pattern)?;
    let has = |field| pieces.contains(&Piece::Number(field));
    if (knows_year || has(PatternField::Year))
        && (has(PatternField::Month) || has(PatternField::DayOfYear))
    {
        Ok(())
    } else {
        Err(format!(
            "file_name pattern {pattern:?} needs {{year}} (or a year beside it) and {{month}} or {{day_of_year}}"
        ))
    }
}

/// Does a name fit a pattern?
pub(crate) fn matches(pattern: &str, name: &str) -> bool {
    pieces(pattern).is_ok_and(|pieces| find(&pieces, name).is_some())
}

/// The date in a name that fits a pattern.
pub(crate) fn date(pattern: &str, name: &str) -> Option<Found> {
    find(&pieces(pattern).ok()?, name)
}

fn pieces(pattern: &str) -> Result<Vec<Piece>, String> {
    if pattern.len() > MAX_BYTES {
        return Err(format!("a pattern is longer than {MAX_BYTES} bytes"));
    }
    let mut rest = pattern;
    let mut pieces = Vec::new();
    while let Some(first) = rest.bytes().next() {
        let field = PatternField::ALL
            .iter()
            .find(|(text, _, _)| rest.starts_with(text));
        let (piece, len) = match (first, field) {
            (_, Some((text, field, _))) => (Piece::Number(*field), text.len()),
            (b'{', None) => {
                return Err(format!(
                    "unknown field in pattern {pattern:?}; use {{year}}, {{month}}, {{day}}, {{day_of_year}}, {{hour}}"
                ));
            }
            (b'*', _) => (Piece::AnyText, 1),
            (b'?', _) => (Piece::AnyByte, 1),
            (byte, _) => (Piece::Literal(byte), 1),
        };
        pieces.push(piece);
        rest = rest.get(len..).unwrap_or_default();
        if piece == Piece::Literal(first) && !first.is_ascii() {
            return Err(format!("pattern {pattern:?} may hold ASCII only"));
        }
    }
    Ok(pieces)
}

/// Greedy matching with one place to come back to, so that time stays linear in pattern times name.
fn find(pieces: &[Piece], name: &str) -> Option<Found> {
    let bytes = name.as_bytes();
    if bytes.len() > MAX_BYTES {
        return None;
    }
    let (mut piece, mut at, mut found) = (0, 0, Found::default());
    let mut back: Option<(usize, usize, Found)> = None;
    loop {
        let step = match pieces.get(piece) {
            None if at == bytes.len() => return Some(found),
            None => None,
            Some(Piece::AnyText) => {
                back = Some((piece + 1, at, found));
                piece += 1;
                continue;
            }
            Some(Piece::AnyByte) => (at < bytes.len()).then_some(1),
            Some(Piece::Literal(byte)) => (bytes.get(at) == Some(byte)).then_some(1),
            Some(Piece::Number(field)) => number(bytes, at, *field, &mut found),
        };
        if let Some(len) = step {
            piece += 1;
            at += len;
            continue;
        }
        let (again, from, before) = back?;
        if from >= bytes.len() {
            return None;
        }
        back = Some((again, from + 1, before));
        (piece, at, found) = (again, from + 1, before);
    }
}

fn number(bytes: &[u8], at: usize, field: PatternField, found: &mut Found) -> Option<usize> {
    let len = field.digits();
    let digits = bytes.get(at..at + len)?;
    let value = digits.iter().try_fold(0, |n, b| {
        b.is_ascii_digit().then(|| n * 10 + u32::from(b - b'0'))
    })?;
    let slot = match field {
        PatternField::Year => &mut found.year,
        PatternField::Month if !(1..=12).contains(&value) => return None,
        PatternField::Month => &mut found.month,
        PatternField::Day if !(1..=31).contains(&value) => return None,
        PatternField::Day => &mut found.day,
        PatternField::DayOfYear if !(1..=366).contains(&value) => return None,
        PatternField::DayOfYear => &mut found.day_of_year,
        PatternField::Hour if value > 23 => return None,
        PatternField::Hour => &mut found.hour,
    };
    *slot = Some(value);
    Some(len)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_are_found_in_names() {
        let found = date(
            "{year}{month}*_OCF-CO2-*.nc",
            "20100301_OCF-CO2-GLO-1M-KRG-CLIM.nc",
        )
        .unwrap();
        assert_eq!((found.year, found.month), (Some(2010), Some(3)));
        let found = date(
            "*-{year}{month}-fv*.nc",
            "ESACCI-OC-1M_MONTHLY_1degree-201012-fv0.95.nc",
        )
        .unwrap();
        assert_eq!((found.year, found.month), (Some(2010), Some(12)));
        let found = date("M{year}{day_of_year}.*", "M2001032.1200.nc").unwrap();
        assert_eq!((found.year, found.day_of_year), (Some(2001), Some(32)));
        assert_eq!(date("{year}{month}*", "20101301.nc"), None);
    }

    #[test]
    fn stars_and_marks_match_as_in_a_shell() {
        assert!(
            matches("*.nc", "a.nc")
                && matches("a*b*c", "aXbXbXc")
                && matches("a?c", "abc")
                && matches("*", "")
        );
        assert!(!matches("*.nc", "a.ncx") && !matches("a?c", "ac") && !matches("", "a"));
    }

    #[test]
    fn a_hostile_pattern_takes_no_time() {
        let start = std::time::Instant::now();
        assert!(!matches(&"*a".repeat(100), &"a".repeat(99)));
        assert!(!matches(&"*a*b".repeat(60), &"a".repeat(500)));
        assert!(start.elapsed().as_secs() < 1);
    }

    #[test]
    fn patterns_without_a_date_are_refused() {
        for pattern in ["*.nc", "{year}.nc", "{month}.nc", "{yaer}{month}"] {
            assert!(check(pattern, false).is_err(), "{pattern}");
        }
        assert!(check("s{month}.nc", true).is_ok() && check("*.nc", true).is_err());
    }
}
