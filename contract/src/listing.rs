//! What a list of products says of each: as the command line prints it, and as the catalogue over HTTP begins.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::manifest::{Manifest, ManifestId, Step};
use crate::masked::MaskedCells;
use crate::product::ProductId;
use crate::quantity::Quantity;
use crate::time::TimeMs;

/// One product in its newest version.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ListedProduct {
    /// Name.
    pub product: ProductId,
    /// For people.
    pub title: String,
    /// What its values are.
    pub quantity: Quantity,
    /// Unit that people read: that of series, means and legends.
    pub unit: String,
    /// Made up by a program rather than measured.
    pub synthetic: bool,
    /// Who made it, to be cited.
    pub source: String,
    /// Its newest version.
    #[schema(value_type = String)]
    pub manifest: ManifestId,
    /// The version it was computed from; none where it was ingested.
    #[schema(value_type = Option<String>, required)]
    pub derived_from: Option<ManifestId>,
    /// Rows of its grid.
    pub rows: u32,
    /// Columns of its grid.
    pub cols: u32,
    /// West, south, east, north, degrees; east may pass 180.
    #[schema(value_type = (f64, f64, f64, f64))]
    pub bounds_deg: [f64; 4],
    /// Number of its steps.
    pub step_count: usize,
    /// First instant that it covers; none without steps.
    #[schema(required)]
    pub start: Option<TimeMs>,
    /// First instant after it.
    #[schema(required)]
    pub end: Option<TimeMs>,
    /// Cells that files gave a value for and that hold none.
    pub masked: MaskedSummary,
}

/// Cells of a product that files gave a value for and that hold none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MaskedSummary {
    /// Outside the valid range that the file or its profile states.
    pub out_of_range: u64,
    /// Not good enough, by the quality that the file states and its profile asks for.
    pub poor_quality: u64,
    /// Outside what the quantity can be.
    pub implausible: u64,
    /// Steps that have any.
    pub steps: usize,
    /// Steps of files that landed before masked cells were counted.
    pub uncounted_steps: usize,
    /// The step that lost most.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(nullable = false)]
    pub most: Option<MostMasked>,
}

/// The step that lost most cells.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MostMasked {
    /// First instant of the step.
    pub start: TimeMs,
    /// Cells that hold none.
    pub cells: u64,
    /// Of the cells that the file gave a value for.
    pub share: f64,
}

impl ListedProduct {
    /// What there is to say of a version; `id` is its name, which is costly to compute.
    pub fn of(manifest: &Manifest, id: ManifestId) -> Self {
        let extent = manifest.extent();
        Self {
            product: manifest.product.clone(),
            title: manifest.title.clone(),
            quantity: manifest.quantity,
            unit: manifest.quantity.display().unit.to_owned(),
            synthetic: manifest.synthetic,
            source: manifest.source.clone(),
            manifest: id,
            derived_from: manifest.derived_from.clone(),
            rows: manifest.grid.rows,
            cols: manifest.grid.cols,
            bounds_deg: manifest.grid.shown_bounds_deg(),
            step_count: manifest.steps.len(),
            start: extent.map(|period| period.start),
            end: extent.map(|period| period.end),
            masked: MaskedSummary::of(manifest),
        }
    }
}

impl MaskedSummary {
    fn of(manifest: &Manifest) -> Self {
        let (sum, uncounted_steps) = match manifest.derived_from {
            // What is computed has no file.
            Some(_) => (MaskedCells::default(), 0),
            None => manifest.masked(),
        };
        let counted = |step: &Step| step.masked.map_or(0, MaskedCells::total);
        let most = manifest.steps.iter().max_by_key(|step| counted(step));
        let most = most.filter(|step| counted(step) > 0);
        let with_any = manifest.steps.iter().filter(|step| counted(step) > 0);
        Self {
            out_of_range: sum.out_of_range,
            poor_quality: sum.poor_quality,
            implausible: sum.implausible,
            steps: with_any.count(),
            uncounted_steps,
            most: most.map(|step| MostMasked {
                start: step.period.start,
                cells: counted(step),
                share: counted(step) as f64 / (counted(step) + step.valid_cells) as f64,
            }),
        }
    }

    /// The counts by reason.
    pub fn cells(&self) -> MaskedCells {
        MaskedCells {
            out_of_range: self.out_of_range,
            poor_quality: self.poor_quality,
            implausible: self.implausible,
        }
    }
}
