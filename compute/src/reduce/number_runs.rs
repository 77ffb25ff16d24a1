//! Increasing numbers as runs of consecutive ones, as they stand in the text of a task: blocks of a region are hundreds side by side.

use serde::de::Error as _;
use serde::{Deserialize as _, Deserializer, Serialize as _, Serializer};

/// Most numbers of a piece: chunks of the largest grid, ten times over.
const MOST: u64 = 1 << 20;

/// Writes `[first, count]` of each run.
///
/// # Errors
/// As the writer's.
pub(super) fn serialize<S: Serializer>(numbers: &[u32], to: S) -> Result<S::Ok, S::Error> {
    let runs = numbers.chunk_by(|before, next| before.checked_add(1) == Some(*next));
    let runs: Vec<(u32, u32)> = runs.map(|run| (run[0], run.len() as u32)).collect();
    runs.serialize(to)
}

/// The numbers back.
///
/// # Errors
/// They are too many, or beyond what a number holds.
pub(super) fn deserialize<'de, D, N>(from: D) -> Result<N, D::Error>
where
    D: Deserializer<'de>,
    N: FromIterator<u32>,
{
    let runs: Vec<(u32, u32)> = Vec::deserialize(from)?;
    let count: u64 = runs.iter().map(|(_, count)| u64::from(*count)).sum();
    let is_inside = |(first, count): &(u32, u32)| first.checked_add(*count).is_some();
    if count > MOST || !runs.iter().all(is_inside) {
        return Err(D::Error::custom("it has too many rows"));
    }
    Ok(runs
        .into_iter()
        .flat_map(|(first, count)| first..first + count)
        .collect())
}

#[cfg(test)]
mod tests {
    use serde::{Deserialize, Serialize};

    #[derive(Debug, PartialEq, Serialize, Deserialize)]
    struct Own(#[serde(with = "super")] Vec<u32>);

    #[test]
    fn numbers_are_read_as_they_are_written_and_many_are_refused() {
        for (numbers, text) in [
            (vec![], "[]"),
            (vec![7], "[[7,1]]"),
            (vec![0, 1, 2, 4, 8, 9], "[[0,3],[4,1],[8,2]]"),
        ] {
            let own = Own(numbers);
            assert_eq!(serde_json::to_string(&own).unwrap(), text);
            assert_eq!(serde_json::from_str::<Own>(text).unwrap(), own);
        }
        for text in ["[[0,1048577]]", "[[0,1048576],[5,1]]", "[[4294967295,2]]"] {
            assert!(serde_json::from_str::<Own>(text).is_err(), "{text}");
        }
    }
}
