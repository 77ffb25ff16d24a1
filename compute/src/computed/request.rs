//! What is asked of a computation: the product to land, what to do, and the products that it is done with.

use contract::computed::{Computation, ComputedInput, Matching};
use contract::grid::Grid;
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::TimeMs;

/// What is asked for.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The product to land.
    pub target: ProductId,
    /// Its title; made of the inputs if absent.
    pub title: Option<String>,
    /// What it measures; that of the input for regridding.
    pub quantity: Option<Quantity>,
    /// What to do.
    pub how: Computation,
    /// The grid of the result; that of the inputs if absent.
    pub grid: Option<Grid>,
    /// What with: name, product, which step of it.
    pub inputs: Vec<RequestedInput>,
    /// First instant; the first of the inputs if absent.
    pub from: Option<TimeMs>,
    /// First instant after the period.
    pub to: Option<TimeMs>,
}

impl Request {
    /// The request that a computed version was made by; none of what was made in another way. What it has of its inputs is what
    /// they have now: an expression their grid, what is brought to another grid its quantity.
    pub(crate) fn of(manifest: &Manifest) -> Option<Self> {
        let computed = manifest.computed.as_ref();
        let computed = computed.filter(|it| it.how.is_by_step())?;
        let input = |input: &ComputedInput| RequestedInput {
            name: input.name.clone(),
            product: input.manifest.product.clone(),
            matching: input.matching,
        };
        let is_regridded = matches!(computed.how, Computation::Regrid { .. });
        Some(Self {
            target: manifest.product.clone(),
            title: Some(manifest.title.clone()),
            quantity: (!is_regridded).then_some(manifest.quantity),
            how: computed.how.clone(),
            grid: is_regridded.then_some(manifest.grid),
            inputs: computed.inputs.iter().map(input).collect(),
            from: computed.from,
            to: computed.to,
        })
    }
}

/// A product under a name.
#[derive(Debug, Clone, PartialEq)]
pub struct RequestedInput {
    /// Name in the expression.
    pub name: String,
    /// Product; its newest version is read.
    pub product: ProductId,
    /// Which of its steps belongs to a period.
    pub matching: Matching,
}
