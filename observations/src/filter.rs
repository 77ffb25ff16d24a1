//! A question for observations, its limits, and its answer a page at a time.

use contract::ContractError;
use contract::observation::{Observation, PlatformKind, Quality};
use contract::product::ProductId;
use contract::region::Region;
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};

use crate::area::Area;
use crate::key::Key;

/// Most rows of one answer.
pub const MAX_LIMIT: u32 = 10_000;
/// Rows of an answer if nothing is said.
const DEFAULT_LIMIT: u32 = 1000;
/// Most names in one list of a question.
const MAX_NAMES: usize = 100;
/// Longest page token, bytes.
const MAX_TOKEN_BYTES: usize = 1024;

/// Which observations are wanted. An empty list means all.
#[derive(Debug, Clone, PartialEq)]
pub struct Filter {
    /// Where; edges belong to it.
    pub region: Region,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant that is too late.
    pub to: Option<TimeMs>,
    /// Properties, such as `sea_surface_temperature`.
    pub properties: Vec<String>,
    /// Datasets.
    pub datasets: Vec<ProductId>,
    /// Names of platforms.
    pub platforms: Vec<String>,
    /// Kinds of platforms.
    pub kinds: Vec<PlatformKind>,
    /// The worst quality that is still wanted.
    pub worst: Quality,
    /// Most rows of the answer, 1 to [`MAX_LIMIT`].
    pub limit: u32,
    /// Where the page before ended.
    pub after: Option<PageToken>,
}

impl Default for Filter {
    fn default() -> Self {
        Self {
            region: Region::Global,
            from: None,
            to: None,
            properties: vec![],
            datasets: vec![],
            platforms: vec![],
            kinds: vec![],
            worst: Quality::Bad,
            limit: DEFAULT_LIMIT,
            after: None,
        }
    }
}

/// Observations in the order of time, dataset, platform, property and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Page {
    /// The rows.
    pub observations: Vec<Observation>,
    /// For the next page, if there is one.
    pub next: Option<PageToken>,
}

impl Page {
    /// A page of rows that are one more than the limit if there is a next page.
    pub(crate) fn cut(mut observations: Vec<Observation>, limit: u32) -> Self {
        let is_more = observations.len() > limit as usize;
        observations.truncate(limit as usize);
        let last = observations.last().filter(|_| is_more);
        Self {
            next: last.map(|last| PageToken(Key::of(last))),
            observations,
        }
    }
}

/// Where a page ended; shown as hexadecimal text.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct PageToken(pub(crate) Key);

impl std::fmt::Display for PageToken {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let json = serde_json::to_string(&self.0).map_err(|_never| std::fmt::Error)?;
        json.bytes().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl std::str::FromStr for PageToken {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        let bad = || ContractError::invalid("page token", s, "the `next` of an answer");
        if s.len() > MAX_TOKEN_BYTES || !s.len().is_multiple_of(2) || !s.is_ascii() {
            return Err(bad());
        }
        let byte = |at: usize| u8::from_str_radix(&s[at..at + 2], 16);
        let json: Result<Vec<u8>, _> = (0..s.len()).step_by(2).map(byte).collect();
        let json = json.map_err(|_no_hex| bad())?;
        let key: Key = serde_json::from_slice(&json).map_err(|_no_key| bad())?;
        Ok(Self(key))
    }
}

impl TryFrom<String> for PageToken {
    type Error = ContractError;

    fn try_from(s: String) -> Result<Self, Self::Error> {
        s.parse()
    }
}

impl From<PageToken> for String {
    fn from(token: PageToken) -> Self {
        token.to_string()
    }
}

/// A question that was checked.
#[derive(Debug)]
pub(crate) struct CheckedFilter<'a> {
    pub(crate) filter: &'a Filter,
    pub(crate) area: Area,
}

impl Filter {
    /// Checks every limit of a question that came from outside.
    ///
    /// # Errors
    /// The first limit that is broken, with what would be valid.
    pub fn validate(&self) -> Result<(), ContractError> {
        self.checked().map(|_checked| ())
    }

    pub(crate) fn checked(&self) -> Result<CheckedFilter<'_>, ContractError> {
        if !(1..=MAX_LIMIT).contains(&self.limit) {
            let text = self.limit.to_string();
            return Err(ContractError::invalid(
                "limit",
                &text,
                format!("1 to {MAX_LIMIT}"),
            ));
        }
        check_span(self.from, self.to)?;
        let lists = [
            ("properties", self.properties.len()),
            ("datasets", self.datasets.len()),
            ("platforms", self.platforms.len()),
            ("kinds", self.kinds.len()),
        ];
        if let Some((what, len)) = lists.into_iter().find(|(_, len)| *len > MAX_NAMES) {
            let reason = format!("at most {MAX_NAMES} of them");
            return Err(ContractError::invalid(what, &len.to_string(), reason));
        }
        let names = self.properties.iter().chain(&self.platforms);
        if let Some(name) = names.into_iter().find(|name| !is_name(name)) {
            return Err(ContractError::invalid(
                "name",
                name,
                "1 to 64 printable bytes",
            ));
        }
        let area = Area::new(&self.region)?;
        Ok(CheckedFilter { filter: self, area })
    }
}

impl CheckedFilter<'_> {
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
        let page = Page::cut(vec![observation("a\u{fc}", 1.0), observation("b", 2.0)], 1);
        let token = page.next.unwrap();
        assert_eq!(token.to_string().parse::<PageToken>().unwrap(), token);
        assert_eq!(page.observations.len(), 1);
        assert!(Page::cut(vec![observation("a", 1.0)], 1).next.is_none());
    }

    #[test]
    fn hostile_tokens_and_questions_are_refused() {
        for text in ["zz", "7", "7b7d", "\u{fc}\u{fc}", &"00".repeat(2000)] {
            assert!(text.parse::<PageToken>().is_err(), "{text}");
        }
        let broken: [fn(&mut Filter); 6] = [
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
            assert!(filter.validate().is_err(), "{filter:?}");
        }
        Filter::default().validate().unwrap();
    }
}
