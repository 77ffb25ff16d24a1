//! The years that a climatology stands for: `1991/2020`.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;
use crate::time::Period;

/// The first and the last year of a base period, both part of it.
#[derive(
    Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize, ToSchema,
)]
#[serde(try_from = "String", into = "String")]
#[schema(value_type = String, example = "1991/2020", description = "First and last year, both part of it.")]
pub struct BasePeriod([i32; 2]);

impl BasePeriod {
    /// From the first to the last year.
    ///
    /// # Errors
    /// The last lies before the first, or one is outside the years 1 to 9998.
    pub fn new(first: i32, last: i32) -> Result<Self, ContractError> {
        let years = 1..=9998;
        if first <= last && years.contains(&first) && years.contains(&last) {
            Ok(Self([first, last]))
        } else {
            Err(bad(&format!("{first}/{last}")))
        }
    }

    /// The years that a period touches.
    pub fn around(period: Period) -> Self {
        let (first, _) = period.start.year_month();
        // The end is the first instant that is no part of it.
        let (last, month) = period.end.year_month();
        let is_whole = Period::year(last).is_ok_and(|year| year.start == period.end);
        let last = if is_whole && month == 1 {
            last - 1
        } else {
            last
        };
        Self([first, last.max(first)])
    }

    /// Those of its years, from the first to the last, that a period touches; none if it touches none.
    pub fn touched_by(self, period: Period) -> Option<Self> {
        let [first, last] = Self::around(period).0;
        Self::new(self.0[0].max(first), self.0[1].min(last)).ok()
    }

    /// From the first instant of the first year to the end of the last.
    pub fn period(self) -> Period {
        let [first, last] = self.0.map(Period::year);
        Period {
            start: first.expect("checked at construction").start,
            end: last.expect("checked at construction").end,
        }
    }

    /// Its years.
    pub fn years(self) -> std::ops::RangeInclusive<i32> {
        self.0[0]..=self.0[1]
    }

    /// The year in its middle, the earlier of two.
    pub fn middle_year(self) -> i32 {
        self.0[0] + (self.0[1] - self.0[0]) / 2
    }
}

fn bad(text: &str) -> ContractError {
    ContractError::invalid(
        "base period",
        text,
        "FIRST/LAST: two years, both part of it, such as 1991/2020",
    )
}

impl Display for BasePeriod {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{:04}/{:04}", self.0[0], self.0[1])
    }
}

impl FromStr for BasePeriod {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let year = |text: &str| {
            let digits = text.len() == 4 && text.bytes().all(|byte| byte.is_ascii_digit());
            digits.then(|| text.parse().ok()).flatten()
        };
        let years = s.split_once('/');
        let years = years.and_then(|(first, last)| Some((year(first)?, year(last)?)));
        let (first, last) = years.ok_or_else(|| bad(s))?;
        Self::new(first, last)
    }
}

impl TryFrom<String> for BasePeriod {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<BasePeriod> for String {
    fn from(base: BasePeriod) -> Self {
        base.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_years_are_part_of_it() {
        let base: BasePeriod = "1991/2020".parse().unwrap();
        let period = base.period();
        assert_eq!(period.start.to_string(), "1991-01-01T00:00:00Z");
        assert_eq!(period.end.to_string(), "2021-01-01T00:00:00Z");
        assert_eq!(
            (base.to_string().as_str(), base.middle_year()),
            ("1991/2020", 2005)
        );
        assert_eq!(BasePeriod::around(period), base);
        let month = Period::month(2000, 12).unwrap();
        assert_eq!(BasePeriod::around(month).to_string(), "2000/2000");
        assert_eq!(base.touched_by(month), Some(BasePeriod::around(month)));
        assert_eq!(base.touched_by(period), Some(base));
        assert_eq!(base.touched_by(Period::month(1990, 12).unwrap()), None);
        for wrong in [
            "",
            "1991",
            "2020/1991",
            "1991-2020",
            "91/20",
            "1991/2020/1",
            "0000/2000",
            "+991/2020",
        ] {
            assert!(wrong.parse::<BasePeriod>().is_err(), "{wrong}");
        }
    }
}
