//! Trails of a vector over another layer: the parts of the vector and an instant in, what a job says of them out.
//!
//! They are drawn with the camera of the picture, on nothing, as any flow is; that picture is then laid on the sea surface
//! of the other one. So their grid and their instant are their own.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::colour::{Rgb, TransferFunction};
use crate::flow::{Flow, TrailLook, drift, title_of_vector};
use crate::grid::Grid;
use crate::manifest::Manifest;
use crate::product::ProductId;
use crate::quantity::Quantity;
use crate::time::TimeMs;
use crate::time_sample::TimeSample;

/// Trails of every cell at most, where cells are large on the screen.
pub(crate) const TRAILS_PER_CELL: u32 = 64;
/// One light colour without a hue: it stands for no value, and is told from the colours of any palette by its tone.
const COLOUR: Rgb = Rgb([250, 252, 255]);
/// Opacity by speed, as shares of the fastest: slow water is left to the layer below.
const OPACITY: [[f64; 2]; 3] = [[0.0, 0.06], [0.25, 0.6], [0.6, 1.0]];
/// Speed at which trails are longest over the top of the range of a flow's colours: with no colours to tell speeds by, their
/// length does, and the bulk of currents is far below that top.
const TOP: f64 = 0.7;
/// Fewer and no wider trails than of a flow alone, so that the layer below is seen between them.
const LOOK: TrailLook = TrailLook {
    radius_px: 1.6,
    area_px: 200.0,
    depth: 2.0,
};

/// A vector drawn as trails over the layer of a job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Trails {
    /// The grid of the vector's fields.
    #[serde(with = "crate::exact::grid")]
    pub grid: Grid,
    /// The eastward part.
    pub eastward: TimeSample,
    /// The northward part, the clock, and how wide, how many and how dense trails are.
    pub flow: Flow,
    /// Colour and opacity by speed.
    pub transfer: TransferFunction,
}

/// The versions of products that trails are drawn from.
#[derive(Debug, Clone, Copy)]
pub struct TrailSources<'a> {
    /// The eastward part of the vector.
    pub eastward: &'a Manifest,
    /// The northward part.
    pub northward: &'a Manifest,
    /// The instant of the vector; that of the picture unless another one is asked for.
    pub time: Option<TimeMs>,
}

/// The eastward part of a vector that is named by itself or by one of its parts: `NAME-east` of `NAME`.
///
/// # Errors
/// The longer name would be too long.
pub fn eastward_part(named: &ProductId) -> Result<ProductId, ContractError> {
    if named.northward().is_some() {
        return Ok(named.clone());
    }
    let part = named.eastward();
    part.map_or_else(|| format!("{named}-east").parse(), Ok)
}

/// Why a product that is no vector, or of which only one part has landed, leaves no trails.
pub fn no_vector(named: &ProductId) -> ContractError {
    let reason = "no vector of this name has landed; trails are drawn along currents, whose parts are two products, NAME-east and NAME-north";
    ContractError::invalid("trails", named.as_str(), reason)
}

impl TrailSources<'_> {
    /// What a picture of an instant says of the trails.
    ///
    /// # Errors
    /// Products that are no parts of one vector, an instant that the vector does not cover.
    pub fn trails(&self, shown: TimeMs) -> Result<Trails, ContractError> {
        let time = self.time.unwrap_or(shown);
        let name = self.eastward.product.as_str();
        let Some(extent) = self.eastward.extent() else {
            return Err(ContractError::invalid("trails", name, "it has no steps"));
        };
        if time < extent.start || time > extent.end {
            let (start, end) = (extent.start, extent.end);
            let reason = format!(
                "it covers {start} to {end}, and {time} is drawn; name an instant of its own for the trails, or leave them out"
            );
            return Err(ContractError::invalid("trails", name, reason));
        }
        let (eastward, flow) = drift(self.eastward, self.northward, time)?;
        Trails::of(self.eastward.grid, eastward, flow, self.eastward.quantity)
    }

    /// What a caption says of them: the vector, its instant if that is not the picture's, and whose data it is.
    pub fn caption(&self) -> String {
        let title = title_of_vector(&self.eastward.title);
        let date = self
            .time
            .map_or_else(String::new, |time| format!(" on {}", time.day_in_words()));
        let source = self.eastward.source.trim();
        let source = if source.is_empty() || source.starts_with(&title) {
            source.to_owned()
        } else {
            format!(" ({source})")
        };
        let made = if self.eastward.synthetic {
            " (made up, not measured)"
        } else {
            ""
        };
        format!("trails: {title}{date}{made}{source}")
    }
}

/// What trails over the speeds of a quantity look like.
fn light(quantity: Quantity) -> Result<TransferFunction, ContractError> {
    let usual = TransferFunction::of_speed(quantity);
    let speed = TransferFunction {
        high: TOP * usual.high,
        ..usual
    };
    let opacity = OPACITY.map(|[place, share]| format!("{}:{share}", speed.value_at(place)));
    Ok(TransferFunction {
        colours: format!("{}:{COLOUR},{}:{COLOUR}", speed.low, speed.high).parse()?,
        opacity: opacity.join(",").parse()?,
        ..speed
    })
}

impl Trails {
    /// Trails in their usual look over whichever layer: along a vector whose parts are of a quantity.
    ///
    /// # Errors
    /// A quantity whose speeds have no range.
    pub fn of(
        grid: Grid,
        eastward: TimeSample,
        flow: Flow,
        quantity: Quantity,
    ) -> Result<Self, ContractError> {
        Ok(Self {
            grid,
            eastward,
            flow: Flow {
                look: Some(LOOK),
                ..flow
            },
            transfer: light(quantity)?,
        })
    }
}

#[cfg(test)]
mod tests;
