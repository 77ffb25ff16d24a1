//! The limits of a question for observations, and its answer a page at a time.

use contract::ContractError;
use contract::observation::{Filter, MAX_LIMIT, Observation, Page};
use contract::time::TimeMs;

use crate::area::Area;
use crate::key::Key;

/// Most names in one list of a question.
pub(crate) const MAX_NAMES: usize = 100;

/// A page of rows that are one more than the limit if there is a next page.
pub(crate) fn page(mut observations: Vec<Observation>, limit: u32) -> Page {
    let is_more = observations.len() > limit as usize;
    observations.truncate(limit as usize);
    let last = observations.last().filter(|_| is_more);
    Page {
        next: last.map(|last| Key::of(last).to_string()),
        observations,
    }
}

/// A question that was checked.
#[derive(Debug)]
pub(crate) struct CheckedFilter<'a> {
    pub(crate) filter: &'a Filter,
    pub(crate) area: Area,
    /// The last row of the page before.
    pub(crate) after: Option<Key>,
}

impl<'a> CheckedFilter<'a> {
    /// Checks every limit of a question that came from outside.
    ///
    /// # Errors
    /// The first limit that is broken, with what would be valid.
    pub(crate) fn new(filter: &'a Filter) -> Result<Self, ContractError> {
        if !(1..=MAX_LIMIT).contains(&filter.limit) {
            let text = filter.limit.to_string();
            return Err(ContractError::invalid(
                "limit",
                &text,
                format!("1 to {MAX_LIMIT}"),
            ));
        }
        check_span(filter.from, filter.to)?;
        let lists = [
            ("properties", filter.properties.len()),
            ("datasets", filter.datasets.len()),
            ("platforms", filter.platforms.len()),
            ("kinds", filter.kinds.len()),
        ];
        if let Some((what, len)) = lists.into_iter().find(|(_, len)| *len > MAX_NAMES) {
            let reason = format!("at most {MAX_NAMES} of them");
            return Err(ContractError::invalid(what, &len.to_string(), reason));
        }
        let names = filter.properties.iter().chain(&filter.platforms);
        if let Some(name) = names.into_iter().find(|name| !is_name(name)) {
            return Err(ContractError::invalid(
                "name",
                name,
                "1 to 64 printable bytes",
            ));
        }
        Ok(Self {
            filter,
            area: Area::new(&filter.region)?,
            after: filter.after.as_deref().map(str::parse).transpose()?,
        })
    }

    /// Is an observation wanted? The page and the limit are not looked at.
    pub(crate) fn wants(&self, o: &Observation) -> bool {
        let Filter {
            from,
            to,
            properties,
            datasets,
            platforms,
            kinds,
            worst,
            ..
        } = self.filter;
        from.is_none_or(|from| from <= o.time)
            && to.is_none_or(|to| o.time < to)
            && is_in(properties, &o.property)
            && is_in(datasets, &o.dataset)
            && is_in(platforms, &o.platform)
            && is_in(kinds, &o.kind)
            && o.quality <= *worst
            && self.area.contains(o.lon_deg, o.lat_deg)
    }
}

/// Checks a span of time.
pub(crate) fn check_span(from: Option<TimeMs>, to: Option<TimeMs>) -> Result<(), ContractError> {
    match (from, to) {
        (Some(from), Some(to)) if from >= to => {
            let text = format!("{from}/{to}");
            Err(ContractError::invalid(
                "time span",
                &text,
                "the end must come after the start",
            ))
        }
        _ => Ok(()),
    }
}

/// Can it be the name of a platform or property? Null characters cannot be asked of a database.
pub(crate) fn is_name(name: &str) -> bool {
    (1..=64).contains(&name.len()) && !name.chars().any(char::is_control)
}

fn is_in<T: PartialEq>(list: &[T], item: &T) -> bool {
    list.is_empty() || list.contains(item)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::batch::tests::observation;

    #[test]
    fn a_page_token_round_trips() {
        let rows = vec![observation("a\u{fc}", 1.0), observation("b", 2.0)];
        let cut = page(rows.clone(), 1);
        let token: Key = cut.next.unwrap().parse().unwrap();
        assert_eq!(token, Key::of(&rows[0]));
        assert_eq!(cut.observations.len(), 1);
        assert!(page(vec![observation("a", 1.0)], 1).next.is_none());
    }

    #[test]
    fn hostile_tokens_and_questions_are_refused() {
        for text in ["zz", "7", "7b7d", "\u{fc}\u{fc}", &"00".repeat(2000)] {
            assert!(text.parse::<Key>().is_err(), "{text}");
        }
        let broken: [fn(&mut Filter); 7] = [
            |f| f.after = Some("7".to_owned()),
            |f| f.limit = 0,
            |f| f.limit = MAX_LIMIT + 1,
            |f| f.platforms = vec!["a\0".to_owned()],
            |f| f.properties = vec![String::new()],
            |f| f.properties = vec!["p".to_owned(); MAX_NAMES + 1],
            |f| {
                f.from = Some("2001".parse().unwrap());
                f.to = f.from;
            },
        ];
        for change in broken {
            let mut filter = Filter::default();
            change(&mut filter);
            assert!(CheckedFilter::new(&filter).is_err(), "{filter:?}");
        }
        CheckedFilter::new(&Filter::default()).unwrap();
    }
}
