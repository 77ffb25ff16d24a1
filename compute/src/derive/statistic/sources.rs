//! The versions that statistics are made of: one product, or two of which each cell is compared.

use contract::ContractError;
use contract::analysis::MapOptions;
use contract::manifest::Manifest;
use contract::product::ProductId;

use crate::{ComputeError, Engine, catalogue, shared_grid};

/// One product, and the one that it is correlated with.
#[derive(Debug)]
pub(super) struct Sources {
    pub(super) first: Manifest,
    pub(super) second: Option<Manifest>,
}

impl Sources {
    /// The newest versions of the products that some statistics are asked of together.
    ///
    /// # Errors
    /// A product that is not there; correlations with several; a second product on another grid.
    pub(super) async fn read(
        engine: &Engine,
        product: &ProductId,
        options: &[MapOptions],
    ) -> Result<Self, ComputeError> {
        let first = catalogue::product(engine.store(), product).await?;
        let second = match one_second(options)? {
            Some(with) => {
                let second = catalogue::product(engine.store(), with).await?;
                shared_grid::check(&first, &second)?;
                Some(second)
            }
            None => None,
        };
        Ok(Self { first, second })
    }

    /// All of them, the first product's first.
    pub(super) fn all(&self) -> impl Iterator<Item = &Manifest> {
        std::iter::once(&self.first).chain(&self.second)
    }

    /// Those of one statistic.
    ///
    /// # Errors
    /// A correlation without a second product, anything else with one.
    pub(super) fn of(&self, options: &MapOptions) -> Result<SourcesOf<'_>, ContractError> {
        let refused = |reason: &str| {
            let name = options.statistic.to_string();
            Err(ContractError::invalid("statistic", &name, reason))
        };
        let second = match (options.statistic.is_of_two(), &options.correlation) {
            (true, Some(_)) => self.second.as_ref(),
            (false, None) => None,
            (true, None) => return refused("it is of two products: give the second, --with"),
            (false, Some(_)) => return refused("it is of one product, not of two"),
        };
        let first = &self.first;
        Ok(SourcesOf { first, second })
    }
}

/// The second product of all that is derived together.
fn one_second(options: &[MapOptions]) -> Result<Option<&ProductId>, ContractError> {
    let all = options.iter().filter_map(|one| one.correlation.as_ref());
    let mut all = all.map(|correlation| &correlation.with);
    let first = all.next();
    match all.find(|with| Some(*with) != first) {
        None => Ok(first),
        Some(other) => {
            let reason = "correlations that are derived together are with one product";
            Err(ContractError::invalid("product", other.as_str(), reason))
        }
    }
}

/// The versions that one statistic is made of.
#[derive(Debug, Clone, Copy)]
pub(super) struct SourcesOf<'a> {
    pub(super) first: &'a Manifest,
    pub(super) second: Option<&'a Manifest>,
}

impl SourcesOf<'_> {
    /// Their names.
    pub(super) fn products(&self) -> impl Iterator<Item = &ProductId> {
        self.all().map(|source| &source.product)
    }

    /// Their names, for people.
    pub(super) fn in_words(&self) -> String {
        let names: Vec<&str> = self.products().map(ProductId::as_str).collect();
        names.join(" and ")
    }

    /// What a title begins with.
    pub(super) fn title(&self) -> String {
        let titles: Vec<&str> = self.all().map(|source| source.title.as_str()).collect();
        titles.join(" and ")
    }

    /// Was any made up by a program?
    pub(super) fn is_synthetic(&self) -> bool {
        self.all().any(|source| source.synthetic)
    }

    /// Where the values come from, for people; of two products by their versions.
    pub(super) fn citation(&self) -> String {
        let Some(second) = self.second else {
            return self.first.source.clone();
        };
        let of = |source: &Manifest| format!("{} ({})", source.id(), source.source);
        format!("Correlated; {}; {}", of(self.first), of(second))
    }

    /// All of them, the first product's first.
    pub(super) fn all(&self) -> impl Iterator<Item = &Manifest> {
        std::iter::once(self.first).chain(self.second)
    }
}
