//! The order of notices: which of two files for one period was offered later. A file never replaces one that was offered
//! after it, however often its notice is read.

use std::fmt::{Display, Formatter};
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::time::TimeMs;

/// A file's place in the order of notices: the time at which its notice was given decides, and between notices of the
/// same millisecond their place in the log, and the file's in its notice.
///
/// It does not change when the notice is read again, nor when the message is sent twice. Written as
/// `TIME/PARTITION/OFFSET/FILE`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct NoticeOrder {
    /// When the notice was given; never later than its message came into the log.
    pub given: TimeMs,
    /// Partition of its message.
    pub partition: u32,
    /// Number of its message in that partition.
    pub offset: u64,
    /// Number of the file among those of its message.
    pub file: u32,
}

/// Consecutive steps whose files came with one notice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoticeRun {
    /// Index of the first step.
    pub first_step: u32,
    /// Number of steps.
    pub steps: u32,
    /// Place of their notice in the order.
    pub order: NoticeOrder,
}

impl NoticeRun {
    /// The runs of steps of which each has an order or none; pure.
    pub fn of(orders: &[Option<NoticeOrder>]) -> Vec<Self> {
        let mut runs: Vec<Self> = vec![];
        for (first_step, order) in (0..).zip(orders) {
            let Some(order) = *order else { continue };
            match runs.last_mut() {
                Some(run) if run.order == order && run.first_step + run.steps == first_step => {
                    run.steps += 1;
                }
                _ => runs.push(Self {
                    first_step,
                    steps: 1,
                    order,
                }),
            }
        }
        runs
    }

    /// The order of each of `steps` steps; none where no run tells. The other way round than [`Self::of`].
    pub fn orders(runs: &[Self], steps: usize) -> Vec<Option<NoticeOrder>> {
        let mut orders = vec![None; steps];
        for run in runs {
            let own = orders.iter_mut().skip(run.first_step as usize);
            own.take(run.steps as usize)
                .for_each(|order| *order = Some(run.order));
        }
        orders
    }
}

impl Display for NoticeOrder {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        let Self {
            given,
            partition,
            offset,
            file,
        } = self;
        write!(f, "{given}/{partition}/{offset}/{file}")
    }
}

impl FromStr for NoticeOrder {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || ContractError::invalid("notice order", s, "TIME/PARTITION/OFFSET/FILE");
        let parts: Vec<&str> = s.split('/').collect();
        let [given, partition, offset, file] = parts[..] else {
            return Err(bad());
        };
        Ok(Self {
            given: given.parse()?,
            partition: partition.parse().map_err(|_unparsed| bad())?,
            offset: offset.parse().map_err(|_unparsed| bad())?,
            file: file.parse().map_err(|_unparsed| bad())?,
        })
    }
}

impl TryFrom<String> for NoticeOrder {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<NoticeOrder> for String {
    fn from(order: NoticeOrder) -> Self {
        order.to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(text: &str) -> NoticeOrder {
        text.parse().unwrap()
    }

    #[test]
    fn the_time_decides_then_the_place_in_the_log_then_the_file() {
        let rising = [
            "2020-01-01T00:00:00Z/3/9/9",
            "2020-01-01T00:00:00.001Z/0/9/9",
            "2020-01-01T00:00:00.001Z/1/8/9",
            "2020-01-01T00:00:00.001Z/1/10/0",
            "2020-01-01T00:00:00.001Z/1/10/1",
        ];
        assert!(rising.map(order).is_sorted_by(|a, b| a < b));
        for text in rising {
            assert_eq!(order(text).to_string(), text);
        }
        for text in [
            "2020-01-01/0/1",
            "2020-01-01/0/1/0/0",
            "x/0/1/0",
            "2020-01-01/-1/1/0",
        ] {
            assert!(text.parse::<NoticeOrder>().is_err(), "{text}");
        }
    }

    #[test]
    fn steps_of_one_notice_are_one_run_and_gaps_stay_gaps() {
        let (a, b) = (order("2020-01-01/0/1/0"), order("2020-01-01/0/2/0"));
        let orders = [None, Some(a), Some(a), None, Some(a), Some(b), None];
        let runs = NoticeRun::of(&orders);
        assert_eq!(runs.len(), 3);
        assert_eq!(NoticeRun::orders(&runs, orders.len()), orders);
        assert_eq!(NoticeRun::orders(&runs, 2), orders[..2]);
    }
}
