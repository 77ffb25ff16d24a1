//! What can go wrong in a computation, and whose turn it is then: the asker's, the operator's or nobody's.

use contract::ContractError;
use contract::grid::LonLatDeg;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;
use datafusion::error::DataFusionError;
use storage::StorageError;

/// A computation that gave no answer.
#[derive(Debug, thiserror::Error)]
pub enum ComputeError {
    /// No manifest for the product.
    #[error("product {product:?} is unknown; there is {}", list(.known))]
    UnknownProduct {
        /// What was asked for.
        product: String,
        /// What there is.
        known: Vec<ProductId>,
    },
    /// A budget is asked of something that is no flux of carbon.
    #[error("{product} holds {:?}, budgets need a carbon flux", .quantity)]
    NotAFlux {
        /// Product.
        product: ProductId,
        /// What it measures.
        quantity: Quantity,
    },
    /// The asked period holds no step.
    #[error("{product} has no step in {asked}; it covers {}", extent(*.covered))]
    NoStep {
        /// Product.
        product: ProductId,
        /// Asked period.
        asked: String,
        /// What the product covers.
        covered: Option<Period>,
    },
    /// The region and the product's grid have no area in common.
    #[error("the region does not touch the grid of {product}, which covers {bounds}")]
    RegionOutside {
        /// Product.
        product: ProductId,
        /// West, south, east, north.
        bounds: String,
    },
    /// The place lies outside the product's grid.
    #[error("{},{} lies outside the grid of {product}, which covers {bounds}", .place.lon, .place.lat)]
    PlaceOutside {
        /// Product.
        product: ProductId,
        /// Asked place.
        place: LonLatDeg,
        /// West, south, east, north.
        bounds: String,
    },
    /// A region that cannot be one.
    #[error("region: {reason}")]
    Region {
        /// What is wrong and what to do.
        reason: String,
    },
    /// A region file that cannot be read or holds no region.
    #[error("region file {file}: {reason}")]
    RegionFile {
        /// Its path.
        file: String,
        /// What is wrong and what to do.
        reason: String,
    },
    /// A value from outside that is not valid.
    #[error(transparent)]
    Contract(#[from] ContractError),
    /// Something durable could not be read or written.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// The query engine failed.
    #[error("query engine, {what}: {source}")]
    Engine {
        /// What it was doing.
        what: &'static str,
        /// Its own words.
        source: Box<DataFusionError>,
    },
    /// Stored things contradict each other.
    #[error("{what} does not fit: {reason}")]
    Inconsistent {
        /// The object.
        what: String,
        /// How.
        reason: String,
    },
}

/// Whose turn it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ErrorClass {
    /// The asked thing does not exist.
    NotFound,
    /// The question makes no sense as it was asked.
    BadRequest,
    /// The same question may succeed later.
    Retryable,
    /// A fault of the program or of what is stored.
    Internal,
}

impl ComputeError {
    /// Whose turn it is; a server maps this to its status.
    pub fn class(&self) -> ErrorClass {
        match self {
            Self::UnknownProduct { .. } => ErrorClass::NotFound,
            Self::NotAFlux { .. }
            | Self::NoStep { .. }
            | Self::RegionOutside { .. }
            | Self::PlaceOutside { .. }
            | Self::Region { .. }
            | Self::RegionFile { .. }
            | Self::Contract(_) => ErrorClass::BadRequest,
            Self::Storage(e) if e.is_retryable() => ErrorClass::Retryable,
            Self::Engine { source, .. } if engine_may_recover(source) => ErrorClass::Retryable,
            Self::Storage(_) | Self::Engine { .. } | Self::Inconsistent { .. } => {
                ErrorClass::Internal
            }
        }
    }

    /// May the same call succeed later?
    pub fn is_retryable(&self) -> bool {
        self.class() == ErrorClass::Retryable
    }

    pub(crate) fn engine(what: &'static str) -> impl FnOnce(DataFusionError) -> Self {
        move |source| Self::Engine {
            what,
            source: Box::new(source),
        }
    }

    pub(crate) fn inconsistent(what: impl Into<String>, reason: impl std::fmt::Display) -> Self {
        Self::Inconsistent {
            what: what.into(),
            reason: reason.to_string(),
        }
    }
}

fn engine_may_recover(error: &DataFusionError) -> bool {
    matches!(
        error.find_root(),
        DataFusionError::ObjectStore(_)
            | DataFusionError::IoError(_)
            | DataFusionError::ResourcesExhausted(_)
    )
}

fn list(known: &[ProductId]) -> String {
    let names: Vec<_> = known.iter().map(ProductId::as_str).collect();
    if names.is_empty() {
        "none yet".to_owned()
    } else {
        names.join(", ")
    }
}

fn extent(covered: Option<Period>) -> String {
    covered.map_or_else(|| "nothing".to_owned(), |period| period.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unknown_product_is_answered_with_the_known_ones() {
        let known = vec!["a".parse().unwrap(), "b".parse().unwrap()];
        let error = ComputeError::UnknownProduct {
            product: "c".into(),
            known,
        };
        assert_eq!(error.to_string(), "product \"c\" is unknown; there is a, b");
        assert_eq!(error.class(), ErrorClass::NotFound);
    }

    #[test]
    fn a_full_memory_pool_may_recover_and_a_bad_plan_may_not() {
        let engine = |source| ComputeError::engine("test")(source);
        assert!(engine(DataFusionError::ResourcesExhausted("memory".into())).is_retryable());
        assert_eq!(
            engine(DataFusionError::Plan("no".into())).class(),
            ErrorClass::Internal
        );
    }
}
