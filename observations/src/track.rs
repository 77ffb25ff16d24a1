//! The way of one platform: where it was, when.

use contract::ContractError;
use contract::product::ProductId;
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};

use crate::filter::{check_span, is_name};

/// Most places of one track.
const MAX_PLACES: u32 = 100_000;

/// Whose way is wanted, and when.
#[derive(Debug, Clone, PartialEq)]
pub struct TrackQuery {
    /// Dataset of the platform.
    pub dataset: ProductId,
    /// Name of the platform.
    pub platform: String,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant that is too late.
    pub to: Option<TimeMs>,
    /// Most places, 1 to 100 000; the first ones are given.
    pub limit: u32,
}

/// A place of a platform at one time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TrackPoint {
    /// When.
    pub time: TimeMs,
    /// Longitude, degrees east, in [-180, 180).
    pub lon_deg: f64,
    /// Latitude, degrees north.
    pub lat_deg: f64,
}

impl TrackQuery {
    /// The whole way of a platform.
    pub fn new(dataset: ProductId, platform: impl Into<String>) -> Self {
        Self {
            dataset,
            platform: platform.into(),
            from: None,
            to: None,
            limit: MAX_PLACES,
        }
    }

    /// Checks every limit of a question that came from outside.
    ///
    /// # Errors
    /// The first limit that is broken, with what would be valid.
    pub fn validate(&self) -> Result<(), ContractError> {
        if !(1..=MAX_PLACES).contains(&self.limit) {
            let text = self.limit.to_string();
            return Err(ContractError::invalid(
                "limit",
                &text,
                format!("1 to {MAX_PLACES}"),
            ));
        }
        if !is_name(&self.platform) {
            let reason = "1 to 64 printable bytes";
            return Err(ContractError::invalid("platform", &self.platform, reason));
        }
        check_span(self.from, self.to)
    }
}
