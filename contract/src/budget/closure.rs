//! What budgets of parts come to beside that of the whole: months and years beside their period, regions beside what they are
//! parts of. Sums are of whole numbers, so that what does not close is a place or a time, never a rounding.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::BudgetRow;

/// The budget of one of several regions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RegionBudget {
    /// Its name.
    pub region: String,
    /// Its area, land included, m².
    pub region_area_m2: f64,
    /// Area of the sea in it, m².
    pub ocean_area_m2: f64,
    /// How it was taken where that may surprise.
    pub notes: Vec<String>,
    /// Rows in the order of time.
    pub rows: Vec<BudgetRow>,
}

/// Do parts sum to the whole?
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Closure {
    /// Sum of the rows, kg, exact.
    pub rows_kg: String,
    /// The budget of their whole period as one row, kg, exact.
    pub total_kg: String,
    /// The same of regions, if several were asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub regions: Option<RegionsClosure>,
}

/// Regions and what they are parts of, in all of the time: `regions_kg - overlap_kg + left_out_kg = whole_kg`, exactly.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RegionsClosure {
    /// Sum of the regions, kg.
    pub regions_kg: String,
    /// What of it is counted more than once since regions overlap, kg.
    pub overlap_kg: String,
    /// What lies in the whole and in none of the regions, kg.
    pub left_out_kg: String,
    /// The whole, kg.
    pub whole_kg: String,
    /// Area that regions share, counted as often as it is one too many, m².
    pub overlap_m2: f64,
    /// Area of the whole in none of them, land included, m².
    pub left_out_m2: f64,
    /// The regions overlap, or leave something of the whole out, in words.
    pub summary: String,
}
