//! What a statistic of every cell was asked with, besides what is done and with what: enough to ask it again of newer versions.

use serde::{Deserialize, Serialize};

use crate::analysis::{BasePeriod, CalendarBins};
use crate::region::KeptRegion;
use crate::time::TimeStep;

/// The rest of a request.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MapRequest {
    /// Years of the climatology that were asked for; all that the product covers if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<BasePeriod>,
    /// Months or seasons, of what has bins.
    pub bins: CalendarBins,
    /// Means that anomalies are of; the product's own steps if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub anomaly_step: Option<TimeStep>,
    /// Where; everywhere if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<KeptRegion>,
    /// The product has the cells about the region, and not all of its source's.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub crop: bool,
    /// Made of the versions that were there, and by itself of none after them.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub once: bool,
}
