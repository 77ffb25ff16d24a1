//! A manifest as it is stored where it has many steps: all but the last ones in pages that never change, so that one more step
//! costs the same however many there are. Pure.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::{Manifest, ManifestId, Step};
use crate::ContractError;
use crate::computed::Computed;
use crate::digest::Digest;
use crate::grid::Grid;
use crate::index::DimensionIndex;
use crate::key::ObjectKey;
use crate::notice::NoticeRun;
use crate::quantity::Quantity;

/// Steps of a page: what a landing writes again is half of them on average, 20 kB, and 10,000 steps are 78 pages.
pub const PAGE_STEPS: usize = 128;
/// Version of the JSON of a manifest whose steps are in pages.
pub const PAGED_SCHEMA: u32 = 3;

/// Some consecutive steps, named by the digest of their JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Page {
    /// [`PAGED_SCHEMA`].
    pub schema: u32,
    /// Steps in the order of time.
    pub steps: Vec<Step>,
    /// Place of their files in the order of notices; steps are counted from the first of the page on.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notices: Vec<NoticeRun>,
}

impl Page {
    /// What it is named by.
    pub fn name(&self) -> Digest {
        Digest::of_json(self)
    }
}

/// A manifest without the steps that are in pages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PagedManifest {
    /// [`PAGED_SCHEMA`].
    pub schema: u32,
    /// The schema of the manifest itself, which its name depends on.
    pub of_schema: u32,
    /// Its name, which the digest of all steps is a part of.
    pub id: ManifestId,
    /// Title for people.
    pub title: String,
    /// Quantity; values are stored in its unit.
    pub quantity: Quantity,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// Where the data come from, as a citation.
    pub source: String,
    /// The one grid of all steps.
    pub grid: Grid,
    /// Names of pages of [`PAGE_STEPS`] steps each, in the order of time.
    pub pages: Vec<Digest>,
    /// Steps after those, too few for a page.
    pub rest: Page,
    /// Cells that hold data in some step.
    pub domain: ObjectKey,
    /// The manifest this one was derived from, if it was computed rather than ingested.
    pub derived_from: Option<ManifestId>,
    /// How, if it was by an expression, by regridding, as a statistic or a correlation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub computed: Option<Computed>,
    /// Which index of further dimensions its files are read at.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub indexes: Vec<DimensionIndex>,
}

impl PagedManifest {
    /// Keys of its pages.
    pub fn page_keys(&self) -> impl Iterator<Item = ObjectKey> + '_ {
        let product = &self.id.product;
        self.pages
            .iter()
            .map(move |page| ObjectKey::manifest_page(product, page))
    }

    /// The manifest, of its pages in their order.
    ///
    /// # Errors
    /// A page has not as many steps as it must: some other page was given.
    pub fn with_pages<'a>(
        self,
        pages: impl IntoIterator<Item = &'a Page>,
    ) -> Result<Manifest, ContractError> {
        let ManifestId {
            product, number, ..
        } = self.id;
        let (mut steps, mut orders): (Vec<Step>, Vec<_>) = (vec![], vec![]);
        let mut take = |page: &Page| {
            steps.extend_from_slice(&page.steps);
            orders.extend(NoticeRun::orders(&page.notices, page.steps.len()));
        };
        let mut count = 0;
        for page in pages {
            if page.steps.len() != PAGE_STEPS {
                let (found, expected) = (page.steps.len().to_string(), "a whole page of steps");
                return Err(ContractError::invalid(
                    "page of a manifest",
                    &found,
                    expected,
                ));
            }
            take(page);
            count += 1;
        }
        if count != self.pages.len() {
            let expected = "as many pages as it names";
            return Err(ContractError::invalid(
                "pages of a manifest",
                &count.to_string(),
                expected,
            ));
        }
        take(&self.rest);
        Ok(Manifest {
            schema: self.of_schema,
            product,
            number,
            title: self.title,
            quantity: self.quantity,
            synthetic: self.synthetic,
            source: self.source,
            grid: self.grid,
            notices: NoticeRun::of(&orders),
            steps,
            domain: self.domain,
            series: vec![],
            derived_from: self.derived_from,
            computed: self.computed,
            indexes: self.indexes,
        })
    }
}

impl Manifest {
    /// Cuts it into pages; none if it has no steps for one, or holds what pages do not.
    pub fn paged(&self) -> Option<(PagedManifest, Vec<Page>)> {
        let (paged, pages) = self.paged_after(|_at| None)?;
        Some((paged, pages.into_iter().map(|(_name, page)| page).collect()))
    }

    /// The same, and of the pages, with their names, those that are not `before` in the same place, where that knows a page and its name: to name one takes
    /// its whole JSON, to compare it takes little.
    pub fn paged_after(
        &self,
        before: impl Fn(usize) -> Option<(Digest, Arc<Page>)>,
    ) -> Option<(PagedManifest, Vec<(Digest, Page)>)> {
        let orders = self.notice_orders();
        let is_plain = self.series.is_empty() && NoticeRun::of(&orders) == self.notices;
        if self.steps.len() < PAGE_STEPS || !is_plain {
            return None;
        }
        let page = |steps: &[Step], notices| Page {
            schema: PAGED_SCHEMA,
            steps: steps.to_vec(),
            notices,
        };
        let (steps, orders) = (
            self.steps.chunks_exact(PAGE_STEPS),
            orders.chunks_exact(PAGE_STEPS),
        );
        let rest = page(steps.remainder(), NoticeRun::of(orders.remainder()));
        let (mut names, mut new) = (vec![], vec![]);
        for (at, (steps, orders)) in steps.zip(orders).enumerate() {
            let notices = NoticeRun::of(orders);
            let is_there = |there: &Page| {
                there.schema == PAGED_SCHEMA && there.steps == steps && there.notices == notices
            };
            names.push(match before(at) {
                Some((name, there)) if is_there(&there) => name,
                _ => {
                    let page = page(steps, notices);
                    let name = page.name();
                    new.push((name, page));
                    name
                }
            });
        }
        let paged = PagedManifest {
            schema: PAGED_SCHEMA,
            of_schema: self.schema,
            id: self.id(),
            title: self.title.clone(),
            quantity: self.quantity,
            synthetic: self.synthetic,
            source: self.source.clone(),
            grid: self.grid,
            pages: names,
            rest,
            domain: self.domain.clone(),
            derived_from: self.derived_from.clone(),
            computed: self.computed.clone(),
            indexes: self.indexes.clone(),
        };
        Some((paged, new))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifest::MANIFEST_SCHEMA;
    use crate::time::{Period, TimeMs};

    fn manifest(days: usize) -> Manifest {
        let product: crate::product::ProductId = "p".parse().unwrap();
        let day = |day: usize| TimeMs::new(day as i64 * 86_400_000).unwrap();
        let step = |at: usize| Step {
            period: Period::new(day(at), day(at + 1)).unwrap(),
            field: ObjectKey::field(&product, &Digest::of(&at.to_le_bytes())),
            raw_sha256: Digest::of(b""),
            origin: format!("{at}.nc"),
            valid_cells: at as u64,
            masked: None,
            contributed: None,
        };
        // Files of several steps, one of them over the end of a page; some of before orders were kept.
        let order = |at: usize| {
            let file = if (100..150).contains(&at) { 100 } else { at };
            let order = format!("2001-03-01T00:00:00Z/0/{file}/0").parse();
            (at >= 7).then(|| order.unwrap())
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            number: 12,
            title: "P".to_owned(),
            quantity: Quantity::CarbonFlux,
            synthetic: true,
            source: "s".to_owned(),
            grid: Grid {
                rows: 1,
                cols: 1,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: (0..days).map(step).collect(),
            domain: ObjectKey::domain(&product, &Digest::of(b"")),
            series: vec![],
            derived_from: Some("q@3-0a1b2c3d".parse().unwrap()),
            computed: None,
            notices: NoticeRun::of(&(0..days).map(order).collect::<Vec<_>>()),
            indexes: vec!["depth=3".parse().unwrap()],
            product,
        }
    }

    #[test]
    fn a_manifest_of_pages_is_the_same_and_has_the_same_name() {
        for days in [PAGE_STEPS, 2 * PAGE_STEPS - 1, 3 * PAGE_STEPS + 1] {
            let whole = manifest(days);
            let (paged, pages) = whole.paged().unwrap();
            assert_eq!(pages.len(), days / PAGE_STEPS);
            let text = serde_json::to_string(&paged).unwrap();
            let read: PagedManifest = serde_json::from_str(&text).unwrap();
            let again = read.with_pages(&pages).unwrap();
            assert_eq!((again.id(), &again), (whole.id(), &whole));
            assert_eq!(paged.id, whole.id());
            assert!(paged.clone().with_pages(&pages[1..]).is_err());
            let mut other = pages;
            other[0].steps.pop();
            assert!(paged.with_pages(&other).is_err());
        }
        assert_eq!(manifest(PAGE_STEPS - 1).paged(), None);
    }

    #[test]
    fn pages_that_are_known_are_compared_and_not_named_again() {
        let (days, name) = (3 * PAGE_STEPS + 5, Digest::of(b"known"));
        let (paged, pages) = manifest(days).paged().unwrap();
        // A name that no page has shows whose name was taken.
        let before = |at: usize| Some((name, Arc::new(pages[at].clone())));
        let (same, new) = manifest(days).paged_after(before).unwrap();
        assert_eq!((same.pages, new), (vec![name; 3], vec![]));
        let mut changed = manifest(days);
        changed.steps[PAGE_STEPS].valid_cells += 1;
        let (other, new) = changed.paged_after(before).unwrap();
        let page = changed.paged().unwrap().1[1].clone();
        assert_eq!(new, [(page.name(), page)]);
        assert_eq!(other.pages, [name, new[0].0, name]);
        // Another place in the order of notices is another page.
        let mut changed = manifest(days);
        let mut orders = changed.notice_orders();
        orders[0] = orders[7];
        changed.notices = NoticeRun::of(&orders);
        let (other, new) = changed.paged_after(before).unwrap();
        assert_eq!(new.len(), 1);
        assert_eq!(other.pages, [new[0].0, name, name]);
        assert_ne!(other.pages[0], paged.pages[0]);
    }

    #[test]
    fn one_more_step_leaves_all_pages_as_they_are() {
        let (before, _) = manifest(300).paged().unwrap();
        let (after, _) = manifest(301).paged().unwrap();
        assert_eq!(before.pages, after.pages);
        let bytes = |days| {
            serde_json::to_vec(&manifest(days).paged().unwrap().0)
                .unwrap()
                .len()
        };
        // 67 bytes a page are what grows, and digits of the steps that are in none.
        assert!(bytes(40 * PAGE_STEPS + 5) < bytes(PAGE_STEPS + 5) + 39 * 67 + 400);
    }
}
