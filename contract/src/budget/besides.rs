//! What is asked of a budget besides a region and a period, from words to a question: the same for a command line and an address.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::river::AskedRiver;
use super::uncertainty::{BudgetErrors, ErrorWords};
use super::{BudgetParts, BudgetQuery};
use crate::ContractError;
use crate::manifest::Manifest;
use crate::product::ProductId;
use crate::region::{AskedRegion, named_regions};

/// Words about a budget.
#[derive(Debug, Clone, Copy, Default)]
pub struct BudgetWords<'a> {
    /// About errors.
    pub errors: ErrorWords<'a>,
    /// Tg a year, or a product.
    pub river_flux: Option<&'a str>,
    /// Where the number is from.
    pub river_source: Option<&'a str>,
    /// A GeoJSON feature collection, or a product that is a mask.
    pub regions: Option<&'a str>,
}

/// What they mean; the versions of products in it are still to be looked up.
#[derive(Debug, Clone, PartialEq)]
pub struct Besides {
    errors: Option<BudgetErrors>,
    river: Option<AskedRiver>,
    regions: Option<Regions>,
}

#[derive(Debug, Clone, PartialEq)]
enum Regions {
    Named(Vec<AskedRegion>),
    Mask(ProductId),
}

impl BudgetWords<'_> {
    /// What they mean.
    ///
    /// # Errors
    /// Words that are not valid, or do not belong together.
    pub fn asked(&self) -> Result<Besides, ContractError> {
        let regions = match self.regions.map(str::trim) {
            None => None,
            Some(text) if text.starts_with('{') => Some(Regions::Named(named_regions(text)?)),
            Some(text) => Some(Regions::Mask(text.parse().map_err(|_no_product| {
                let reason = "use a GeoJSON FeatureCollection whose features have names, or a product that is a mask";
                ContractError::invalid("regions", text, reason)
            })?)),
        };
        let river = AskedRiver::asked(self.river_flux, self.river_source)?;
        Ok(Besides {
            errors: self.errors.asked()?,
            river,
            regions,
        })
    }
}

impl Besides {
    /// Products whose newest versions are to be looked up.
    pub fn products(&self) -> BTreeSet<ProductId> {
        let of_errors = self.errors.as_ref().and_then(BudgetErrors::product);
        let of_river = self.river.as_ref().and_then(AskedRiver::product);
        let of_regions = match &self.regions {
            Some(Regions::Mask(mask)) => Some(mask),
            Some(Regions::Named(_)) | None => None,
        };
        let all = [of_errors, of_river, of_regions].into_iter();
        all.flatten().cloned().collect()
    }

    /// A question with all this, `versions` being those of [`Self::products`].
    ///
    /// # Errors
    /// One of them is not there.
    pub fn of(
        self,
        query: BudgetQuery,
        versions: &BTreeMap<ProductId, Arc<Manifest>>,
    ) -> Result<BudgetQuery, ContractError> {
        let version = |product: &ProductId| {
            let found = versions.get(product).map(Arc::clone);
            found.ok_or_else(|| {
                ContractError::invalid("product", product.as_str(), "there is no version of it")
            })
        };
        let (mut errors, mut river) = (self.errors, self.river);
        if let Some(own) = &mut errors {
            own.of_product = own.product().map(version).transpose()?;
        }
        if let Some(own) = &mut river {
            own.of_product = own.product().map(version).transpose()?;
        }
        let parts = match self.regions {
            None => None,
            Some(Regions::Named(regions)) => Some(BudgetParts::Regions(regions)),
            Some(Regions::Mask(mask)) => Some(BudgetParts::Mask(version(&mask)?)),
        };
        Ok(BudgetQuery {
            errors,
            river,
            parts,
            ..query
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_all_words_are_to_be_looked_up() {
        let words = BudgetWords {
            errors: ErrorWords {
                error: Some("errors"),
                correlation_length_km: Some(1.0),
                ..ErrorWords::default()
            },
            river_flux: Some("rivers"),
            regions: Some("basins"),
            ..BudgetWords::default()
        };
        let besides = words.asked().unwrap();
        let products = besides.products();
        let names: Vec<_> = products.iter().map(ProductId::as_str).collect();
        assert_eq!(names, ["basins", "errors", "rivers"]);
        let query = BudgetQuery::new("flux".parse().unwrap(), "global".parse().unwrap());
        assert_eq!(
            BudgetWords::default()
                .asked()
                .unwrap()
                .of(query.clone(), &BTreeMap::new()),
            Ok(query.clone())
        );
        assert!(besides.of(query, &BTreeMap::new()).is_err());
        let bad = BudgetWords {
            regions: Some("A FILE"),
            ..BudgetWords::default()
        };
        assert!(bad.asked().unwrap_err().to_string().contains("a mask"));
    }
}
