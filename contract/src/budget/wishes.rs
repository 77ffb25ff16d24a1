//! What is asked of a budget, from options to a question: the same for a command line and an address. What is absent is as usual.

use std::sync::Arc;

use super::BudgetQuery;
use crate::earth::Earth;
use crate::manifest::Manifest;
use crate::product::ProductId;
use crate::region::{AskedRegion, Cells, Region};
use crate::time::{TimeMs, TimeStep};

/// Where, when and how a flux is summed.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct BudgetWishes {
    /// Where; the globe if absent.
    pub region: Option<AskedRegion>,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant after the asked period.
    pub to: Option<TimeMs>,
    /// What a row covers.
    pub step: Option<TimeStep>,
    /// Figure of the earth.
    pub earth: Option<Earth>,
    /// How cells on the coast count.
    pub cells: Option<Cells>,
    /// A version of a product that says how much of every cell is sea.
    pub ocean: Option<Arc<Manifest>>,
}

impl BudgetWishes {
    /// The budget of a product, without what is asked [besides](super::Besides).
    pub fn query(self, product: ProductId) -> BudgetQuery {
        let region = self.region.unwrap_or_else(|| AskedRegion {
            region: Region::Global,
            name: "global".to_owned(),
        });
        BudgetQuery {
            from: self.from,
            to: self.to,
            step: self.step.unwrap_or(BudgetQuery::USUAL_STEP),
            earth: self.earth.unwrap_or_default(),
            cells: self.cells.unwrap_or_default(),
            ocean: self.ocean,
            ..BudgetQuery::new(product, region)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_asked_is_all_there_is() {
        let product: ProductId = "flux".parse().unwrap();
        let usual = BudgetQuery::new(product.clone(), "global".parse().unwrap());
        assert_eq!(BudgetWishes::default().query(product), usual);
    }

    #[test]
    fn what_is_asked_is_in_the_question() {
        let wishes = BudgetWishes {
            region: Some("14n-50n".parse().unwrap()),
            from: "2001".parse().ok(),
            to: "2002".parse().ok(),
            step: Some(TimeStep::Month),
            earth: Some(Earth::Sphere),
            cells: Some(Cells::OceanShare),
            ocean: None,
        };
        let query = wishes.clone().query("flux".parse().unwrap());
        assert_eq!((query.from, query.to), (wishes.from, wishes.to));
        assert_eq!(query.region_name, "14n-50n");
        let how = (query.step, query.earth, query.cells);
        assert_eq!(how, (TimeStep::Month, Earth::Sphere, Cells::OceanShare));
    }
}
