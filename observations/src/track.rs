//! The limits of a question for the way of one platform, and which places of a long way are its answer.

use contract::ContractError;
use contract::observation::{MAX_PLACES, TrackQuery};

use crate::filter::{MAX_NAMES, check_span, is_name};

/// Checks every limit of a question that came from outside.
///
/// # Errors
/// The first limit that is broken, with what would be valid.
pub(crate) fn check(query: &TrackQuery) -> Result<(), ContractError> {
    if !(1..=MAX_PLACES).contains(&query.limit) {
        let text = query.limit.to_string();
        return Err(ContractError::invalid(
            "limit",
            &text,
            format!("1 to {MAX_PLACES}"),
        ));
    }
    if !is_name(&query.platform) {
        let reason = "1 to 64 printable bytes";
        return Err(ContractError::invalid("platform", &query.platform, reason));
    }
    check_span(query.from, query.to)
}

/// Questions in their order, in parts that are about one dataset and one span of time, each of so many names as a filter may have.
pub(crate) fn together(queries: &[TrackQuery]) -> Vec<&[TrackQuery]> {
    let are_alike =
        |a: &TrackQuery, b: &TrackQuery| (&a.dataset, a.from, a.to) == (&b.dataset, b.from, b.to);
    queries
        .chunk_by(are_alike)
        .flat_map(|alike| alike.chunks(MAX_NAMES))
        .collect()
}

/// Of a way from its first to its last place at most `limit` places: every n-th, n as small as may be, and the last.
///
/// `question::track` says the same in SQL.
pub(crate) fn thinned<T>(way: Vec<T>, limit: u32) -> Vec<T> {
    let Some(last) = way.len().checked_sub(1) else {
        return way;
    };
    let gaps = limit.saturating_sub(1) as usize;
    let every = last.div_ceil(gaps.max(1)).max(1);
    let is_kept = |at: usize| at == last || gaps > 0 && at.is_multiple_of(every);
    let places = way.into_iter().enumerate();
    places
        .filter_map(|(at, place)| is_kept(at).then_some(place))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn questions_about_one_dataset_and_time_are_asked_together() {
        let of = |dataset: &str, year: &str| TrackQuery {
            from: Some(year.parse().unwrap()),
            ..TrackQuery::new(dataset.parse().unwrap(), "ship")
        };
        let mut all = vec![of("a", "2001"); 2 * MAX_NAMES + 1];
        all.extend([of("a", "2002"), of("b", "2002"), of("b", "2002")]);
        let parts = together(&all);
        let sizes: Vec<_> = parts.iter().map(|part| part.len()).collect();
        assert_eq!(sizes, [MAX_NAMES, MAX_NAMES, 1, 1, 2]);
        assert_eq!(parts.concat(), all, "in their order");
        assert!(together(&[]).is_empty());
    }

    #[test]
    fn a_way_keeps_its_ends_and_no_more_than_its_limit_between() {
        for count in [1_usize, 2, 3, 99, 100, 101, 199, 200, 5000] {
            for limit in [2_u32, 3, 100, 5000] {
                let kept = thinned((0..count).collect(), limit);
                assert!(kept.len() <= limit as usize, "{count} by {limit}");
                assert_eq!((kept[0], kept[kept.len() - 1]), (0, count - 1));
                let is_whole = kept.len() == count;
                assert_eq!(is_whole, count <= limit as usize, "{count} by {limit}");
            }
            assert_eq!(thinned((0..count).collect(), 1), [count - 1]);
        }
        assert!(thinned(Vec::<usize>::new(), 1).is_empty());
        let kept = thinned((0..10).collect(), 5);
        assert_eq!(kept, [0, 3, 6, 9]);
    }
}
