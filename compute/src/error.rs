//! What can go wrong in a computation, and whose turn it is then: the asker's, the operator's or nobody's.

use ballista_core::error::BallistaError;
use contract::ContractError;
use contract::product::ProductId;
use contract::quantity::Quantity;
use datafusion::error::DataFusionError;
use storage::StorageError;

use crate::close_name::close_name;
use crate::failure::{self, Failure};

/// A computation that gave no answer.
#[derive(Debug, thiserror::Error)]
pub enum ComputeError {
    /// No manifest for the product.
    #[error("product {product:?} is unknown{}; there is {}", meant(.product, .known), list(.known))]
    UnknownProduct {
        /// What was asked for.
        product: String,
        /// What there is.
        known: Vec<ProductId>,
    },
    /// A budget is asked of something that is no flux of carbon.
    #[error("{product} is no flux of carbon, nor accumulated from one, but {}", .quantity.without_budget())]
    NotAFlux {
        /// Product.
        product: ProductId,
        /// What it measures.
        quantity: Quantity,
    },
    /// A product is held against no observation.
    #[error(
        "there is no observation to compare {product} with: none is what was asked for; `fluxglobe observations list` tells which there are"
    )]
    NothingToCompare {
        /// Product.
        product: ProductId,
    },
    /// A budget is asked of an extreme of a flux.
    #[error(
        "{product} has no budget: it holds the {what} of each cell of {of}, which were there at different times, so that their sum never was; ask for the budget of {of}, or of its mean"
    )]
    NotSummed {
        /// Product.
        product: ProductId,
        /// What it holds of each cell.
        what: String,
        /// What it was made of.
        of: ProductId,
    },
    /// The region and the product's grid have no area in common.
    #[error("the region does not touch the grid of {product}, which covers {bounds}")]
    RegionOutside {
        /// Product.
        product: ProductId,
        /// West, south, east, north.
        bounds: String,
    },
    /// A region that cannot be one.
    #[error("region: {reason}")]
    Region {
        /// What is wrong and what to do.
        reason: String,
    },
    /// A product that cannot say what of a cell is sea, or not for the cells that are summed.
    #[error("{product} cannot say what is sea: {reason}")]
    OceanShares {
        /// Its name, or that of its field.
        product: String,
        /// What is wrong and what to do.
        reason: String,
    },
    /// Errors of a flux that cannot be those of a budget.
    #[error("uncertainty: {reason}")]
    Uncertainty {
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
    /// A computation over products that makes no sense as it is asked for.
    #[error("{reason}")]
    Expression {
        /// What is wrong and what to do.
        reason: String,
    },
    /// What was made again, since what it is made of changed, was asked for otherwise meanwhile: that stays.
    #[error("{product} was asked for otherwise while it was made again")]
    AskedOtherwise {
        /// Product.
        product: ProductId,
    },
    /// An executor computed as another version of the program does.
    #[error(
        "{product} was computed by an executor of another version, by method {theirs} and not {own}: replace the executors too, then it is computed again"
    )]
    OtherMethod {
        /// Product.
        product: ProductId,
        /// The executor's.
        theirs: u32,
        /// This program's.
        own: u32,
    },
    /// SQL that makes no sense, or would do more than read.
    #[error("SQL: {reason}")]
    Sql {
        /// What is wrong and what to do.
        reason: String,
    },
    /// SQL that would take longer than it may.
    #[error(
        "the question was ended after {limit_s} s, its limit of time; ask for less (times and places in WHERE are read alone) or allow more"
    )]
    QueryTime {
        /// The limit, s.
        limit_s: f64,
    },
    /// SQL that must hold more than it may.
    #[error(
        "the question must hold more than {limit_mib} MiB, its limit of memory; ask for less: groups, sorted rows and a side of a join are held"
    )]
    QueryMemory {
        /// The limit, MiB.
        limit_mib: usize,
    },
    /// What was worked out for somebody who has left; nobody is told.
    #[error("nobody waits for it any more")]
    NotAwaited,
    /// A server that anybody could ask, or a token that is none.
    #[error("access: {reason}")]
    Access {
        /// What is wrong and what to do.
        reason: String,
    },
    /// A value from outside that is not valid.
    #[error(transparent)]
    Contract(#[from] ContractError),
    /// Something durable could not be read or written.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// A cube could not be read.
    #[error(transparent)]
    Cube(#[from] cube::CubeError),
    /// The query engine failed.
    #[error("query engine, {what}: {source}")]
    Engine {
        /// What it was doing.
        what: &'static str,
        /// Its own words.
        source: Box<DataFusionError>,
    },
    /// The cluster, or this process as a part of it, failed.
    #[error("cluster, {what}: {source}")]
    Cluster {
        /// What was being done.
        what: &'static str,
        /// Ballista's words.
        source: Box<BallistaError>,
    },
    /// The cluster took a query and did not answer it.
    #[error(
        "the cluster of {scheduler} gave no answer within {limit_s} s: it has no executor with room for the query, or its scheduler \
         hangs; see its /readyz, or allow more time (--cluster-limit-s)"
    )]
    Overdue {
        /// Address of its scheduler.
        scheduler: String,
        /// How long it was waited for, s.
        limit_s: u64,
    },
    /// The cluster is away, or lost a query for as long as it was asked again.
    #[error("the cluster of {scheduler} (--cluster or FLUXGLOBE_CLUSTER) gave no answer: {source}")]
    ClusterAway {
        /// Address of its scheduler.
        scheduler: String,
        /// Why the last try failed.
        source: Box<Self>,
    },
    /// A scheduler's address that cannot be one.
    #[error("scheduler address {url:?}: {reason}; give host:port, such as scheduler:50050")]
    SchedulerUrl {
        /// As it was given.
        url: String,
        /// What is wrong.
        reason: String,
    },
    /// A file, a folder or an address of this machine cannot be used.
    #[error("{what}: {source}")]
    Machine {
        /// What was wanted.
        what: String,
        /// The system's words.
        source: std::io::Error,
    },
    /// A service's metrics cannot be registered.
    #[error(transparent)]
    Metrics(#[from] prometheus::Error),
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
            | Self::NotSummed { .. }
            | Self::NothingToCompare { .. }
            | Self::RegionOutside { .. }
            | Self::Region { .. }
            | Self::OceanShares { .. }
            | Self::Uncertainty { .. }
            | Self::RegionFile { .. }
            | Self::Expression { .. }
            | Self::Sql { .. }
            | Self::QueryTime { .. }
            | Self::QueryMemory { .. }
            | Self::Access { .. }
            | Self::SchedulerUrl { .. }
            | Self::Contract(_) => ErrorClass::BadRequest,
            Self::Storage(e) => retryable_if(e.is_retryable()),
            Self::Cube(e) => retryable_if(e.is_retryable()),
            Self::Engine { source, .. } => retryable_if(failure::of(source) == Failure::Passing),
            Self::Cluster { source, .. } => {
                retryable_if(failure::of_ballista(source) == Failure::Passing)
            }
            Self::ClusterAway { source, .. } => source.class(),
            Self::Overdue { .. }
            | Self::NotAwaited
            | Self::AskedOtherwise { .. }
            | Self::OtherMethod { .. } => ErrorClass::Retryable,
            Self::Machine { .. } | Self::Metrics(_) | Self::Inconsistent { .. } => {
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

    pub(crate) fn cluster(what: &'static str) -> impl FnOnce(BallistaError) -> Self {
        move |source| Self::Cluster {
            what,
            source: Box::new(source),
        }
    }

    pub(crate) fn machine(what: impl Into<String>) -> impl FnOnce(std::io::Error) -> Self {
        let what = what.into();
        move |source| Self::Machine { what, source }
    }

    pub(crate) fn inconsistent(what: impl Into<String>, reason: impl std::fmt::Display) -> Self {
        Self::Inconsistent {
            what: what.into(),
            reason: reason.to_string(),
        }
    }
}

fn retryable_if(may_pass: bool) -> ErrorClass {
    if may_pass {
        ErrorClass::Retryable
    } else {
        ErrorClass::Internal
    }
}

/// Which of those that there are was meant, if one is close.
fn meant(product: &str, known: &[ProductId]) -> String {
    let close = close_name(product, known.iter().map(ProductId::as_str));
    close.map_or_else(String::new, |name| format!(" (did you mean {name}?)"))
}

fn list(known: &[ProductId]) -> String {
    let names: Vec<_> = known.iter().map(ProductId::as_str).collect();
    if names.is_empty() {
        "none yet".to_owned()
    } else {
        names.join(", ")
    }
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
        let error = ComputeError::UnknownProduct {
            product: "flx".into(),
            known: vec!["flux".parse().unwrap(), "sst".parse().unwrap()],
        };
        let told = "product \"flx\" is unknown (did you mean flux?); there is flux, sst";
        assert_eq!(error.to_string(), told);
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
