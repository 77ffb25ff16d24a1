//! A manifest as it is stored where it has many steps: all but the last ones in pages that never change, so that one more step
//! costs the same however many there are, and wherever it lies. Pure.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::page_ends::page_ends;
use super::{Manifest, ManifestId, Step};
use crate::ContractError;
use crate::computed::Computed;
use crate::digest::Digest;
use crate::grid::Grid;
use crate::index::DimensionIndex;
use crate::key::ObjectKey;
use crate::notice::NoticeRun;
use crate::quantity::Quantity;
use crate::time::TimeMs;

/// Manifests of fewer steps are stored whole.
pub const LEAST_PAGED_STEPS: usize = 128;
/// Version of the JSON of a manifest whose steps are in pages, as it is written. Those since [`OLDEST_PAGED_SCHEMA`] are read too.
///
/// 4: steps say by their starts where a page ends (`page_ends.rs`); pages of before had [`EVEN_PAGE_STEPS`] each, and a step before all
/// others changed every one.
pub const PAGED_SCHEMA: u32 = 4;
/// Oldest version that is read.
pub const OLDEST_PAGED_SCHEMA: u32 = 3;
/// Steps of each page of schema 3.
const EVEN_PAGE_STEPS: usize = 128;

/// Some consecutive steps, named by the digest of their JSON.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Page {
    /// That of the manifest it was written for: [`OLDEST_PAGED_SCHEMA`] to [`PAGED_SCHEMA`].
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
    /// [`OLDEST_PAGED_SCHEMA`] to [`PAGED_SCHEMA`].
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
    /// Names of pages, in the order of time.
    pub pages: Vec<Digest>,
    /// Steps after those, behind the last end of a page.
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
    /// Pages that end elsewhere than they must, or are more or fewer than it names: some other page was given.
    pub fn with_pages<'a>(
        self,
        pages: impl IntoIterator<Item = &'a Page>,
    ) -> Result<Manifest, ContractError> {
        let (mut steps, mut orders, mut ends) = (vec![], vec![], vec![]);
        let mut take = |page: &Page| {
            steps.extend_from_slice(&page.steps);
            orders.extend(NoticeRun::orders(&page.notices, page.steps.len()));
            steps.len()
        };
        ends.extend(pages.into_iter().map(&mut take));
        take(&self.rest);
        let expected = if self.schema == OLDEST_PAGED_SCHEMA {
            let even = (1..=self.pages.len()).map(|page| page * EVEN_PAGE_STEPS);
            even.collect()
        } else {
            page_ends(&steps)
        };
        if ends != expected || ends.len() != self.pages.len() {
            let other = ends.iter().zip(&expected).position(|(own, it)| own != it);
            let page = other.unwrap_or(ends.len().min(expected.len()));
            return Err(ContractError::invalid(
                "pages of a manifest",
                &format!("page {page} of {}", ends.len()),
                "those that it names, each ending where its steps say",
            ));
        }
        let ManifestId {
            product, number, ..
        } = self.id;
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

    /// The same, and of the pages, with their names, those alone that are not there `before`: that knows some by the start of their first step, with
    /// their names. To name one takes its whole JSON, to compare it takes little.
    pub fn paged_after(
        &self,
        before: impl Fn(TimeMs) -> Option<(Digest, Arc<Page>)>,
    ) -> Option<(PagedManifest, Vec<(Digest, Page)>)> {
        let orders = self.notice_orders();
        let is_plain = self.series.is_empty() && NoticeRun::of(&orders) == self.notices;
        if self.steps.len() < LEAST_PAGED_STEPS || !is_plain {
            return None;
        }
        let page = |steps: &[Step], notices| Page {
            schema: PAGED_SCHEMA,
            steps: steps.to_vec(),
            notices,
        };
        let (mut names, mut new) = (vec![], vec![]);
        let mut first = 0;
        for end in page_ends(&self.steps) {
            let (steps, notices) = (&self.steps[first..end], NoticeRun::of(&orders[first..end]));
            let is_there = |there: &Page| {
                there.schema == PAGED_SCHEMA && there.steps == steps && there.notices == notices
            };
            names.push(match before(steps[0].period.start) {
                Some((name, there)) if is_there(&there) => name,
                _ => {
                    let page = page(steps, notices);
                    let name = page.name();
                    new.push((name, page));
                    name
                }
            });
            first = end;
        }
        let rest = page(&self.steps[first..], NoticeRun::of(&orders[first..]));
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
mod tests;
