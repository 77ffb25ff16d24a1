//! Our budgets beside what a paper and another program say: as the comparison is kept, and as it is shown.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A comparison and where the values beside ours come from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Check {
    /// In the order they are shown.
    pub rows: Vec<CheckRow>,
    /// Where the paper's numbers come from.
    pub note: String,
    /// Where the other program's numbers come from.
    pub method: String,
}

/// One line of the comparison: what a paper says, what an independent integration of its grid says, what we say.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CheckRow {
    /// Region, and the figure of the earth where it is not WGS84.
    pub what: String,
    /// Year or month.
    pub period: String,
    /// Unit of the values.
    pub unit: String,
    /// The paper; none where it prints no such value.
    #[schema(required)]
    pub paper: Option<AgainstPaper>,
    /// Integral of the same grid by another program: what ours is held to.
    pub independent: f64,
    /// Ours.
    pub ours: f64,
    /// Ours less the independent one.
    pub difference: f64,
    /// Is that no more than rounding explains?
    pub agrees: bool,
}

/// A value as a paper prints it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Stated {
    /// The value.
    pub value: f64,
    /// Decimals that are printed.
    pub decimals: usize,
    /// Its uncertainty, where the paper states one.
    #[schema(required)]
    pub uncertainty: Option<f64>,
}

/// Ours against a printed value.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AgainstPaper {
    /// As printed.
    pub stated: Stated,
    /// Ours less the printed value.
    pub difference: f64,
    /// What the paper's uncertainty says of it.
    pub verdict: Verdict,
}

/// What a paper's own uncertainty says of a difference.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// It is no larger.
    Within,
    /// It is larger.
    Outside,
    /// The paper states none: a difference is shown and not judged.
    NoUncertaintyStated,
}

impl Verdict {
    /// For people.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Within => "within",
            Self::Outside => "outside",
            Self::NoUncertaintyStated => "no uncertainty stated",
        }
    }
}
