//! Recomputing what was derived from a product: a plan of what is stale or missing, then the work, again after any kill.
//!
//! Whatever is stored is named by the hash of its inputs, so that the plan follows from listings and manifests alone, and
//! a run that was killed is resumed by planning again. Readers see the old version until a new manifest is whole.

mod plan;
mod run;

use contract::digest::Digest;
use contract::manifest::ManifestId;
use contract::product::ProductId;
use contract::time::{Period, TimeMs};
use serde::Serialize;

use crate::budget::Measure;

pub use plan::plan;
pub use run::{Outcome, run};

/// A kind of derived thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub enum What {
    /// Accumulated fields, what they lack, and their series.
    #[serde(rename = "frames")]
    #[value(name = "frames")]
    Fields,
    /// Sums that means over named regions are made of.
    Statistics,
    /// Sums that budgets of named regions are made of.
    Budget,
}

/// What is to be recomputed.
#[derive(Debug, Clone, PartialEq)]
pub struct Request {
    /// The product that others are derived from.
    pub product: ProductId,
    /// First instant; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after the period; the product's end if absent.
    pub to: Option<TimeMs>,
    /// Kinds.
    pub what: Vec<What>,
    /// Whether also what is there and right by its name is computed again and compared.
    pub is_forced: bool,
    /// Whether what is there is read first, and taken for missing if it is damaged.
    pub is_verified: bool,
}

/// Why something is computed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Reason {
    /// It was never computed, or its object is gone.
    Missing,
    /// What it was computed from has changed.
    Stale,
    /// It was asked for.
    Forced,
}

/// One thing to compute.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Item {
    /// Kind.
    pub what: What,
    /// The product that it belongs to.
    pub product: ProductId,
    /// A region's name, or nothing.
    pub region: Option<String>,
    /// What it covers.
    pub period: Period,
    /// Why.
    pub reason: Reason,
    /// Hash of all that it is made of.
    pub input: Digest,
    /// What is summed, if anything is.
    #[serde(skip)]
    measure: Option<Measure>,
}

/// What would be done.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Plan {
    /// The version that it was made for.
    pub manifest: ManifestId,
    /// What is to be computed, in the order of work.
    pub items: Vec<Item>,
    /// How many things are right as they are.
    pub fresh_count: usize,
    /// Start of accumulation, if somebody chose one.
    #[serde(skip)]
    start: Option<TimeMs>,
    /// From when on fields are computed anew although they are there.
    #[serde(skip)]
    anew_from: Option<TimeMs>,
    #[serde(skip)]
    is_forced: bool,
}
