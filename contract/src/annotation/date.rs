//! When a picture is: the instant in plain words, and what its values are means over.

use serde::{Deserialize, Serialize};

use super::Label;
use crate::analysis::MapStatistic;
use crate::computed::{Computation, Computed};
use crate::manifest::Manifest;
use crate::quantity::Quantity;
use crate::time::{Period, TimeMs};

/// The date of a picture.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DateLabel {
    /// The instant, or the one step that a product has.
    pub shown: Label,
    /// What the values are means over, which other statistic of that time they are, or from when on they were added up.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<Label>,
}

impl DateLabel {
    /// That of an instant of a product. Where steps are a day or longer it has no time of day: values between them are
    /// interpolated, and a minute would promise more than there is. None of a product without steps.
    pub fn of(product: &Manifest, time: TimeMs) -> Option<Self> {
        let bracket = product.bracket(time)?;
        let period = product.steps.get(bracket.after)?.period;
        let statistic = product.computed.as_ref().and_then(over_time);
        let is_sum = product.quantity == Quantity::AccumulatedCarbon;
        let accumulated = is_sum && statistic.is_none();
        let mean_over = period
            .adjective()
            .filter(|_length| may_be_means(product.quantity));
        let (shown, note) = match product.steps.as_slice() {
            // There is one picture, whatever the instant.
            [_only] if !accumulated => {
                let note = match statistic {
                    None | Some(MapStatistic::Mean) => {
                        mean_over.map(|length| format!("{length} mean"))
                    }
                    Some(other) => of_all_time(other),
                };
                (period.in_words(), note)
            }
            steps => {
                let day = if period.has_days() {
                    let told = if accumulated {
                        time
                    } else {
                        within(product, time)
                    };
                    told.day_in_words()
                } else {
                    time.in_words()
                };
                let note = match (accumulated, statistic) {
                    (true, _) => {
                        let first = steps.first()?.period.start.day_in_words();
                        Some(format!("added up since {first}"))
                    }
                    (false, Some(MapStatistic::Climatology)) => {
                        let asked = product.computed.as_ref().and_then(|c| c.map.as_ref());
                        let base = asked.and_then(|asked| asked.base);
                        let of = |base| format!("climatology of {base}");
                        Some(base.map_or_else(|| "climatology".to_owned(), of))
                    }
                    (false, _) => mean_over.map(|length| format!("{length} means")),
                };
                (day, note)
            }
        };
        Some(Self {
            shown: Label::cut(&shown)?,
            note: note.and_then(|note| Label::cut(&note)),
        })
    }
}

/// An instant of the last day of a product in the place of its end, with which a day begins that no step holds: it is what is shown of all
/// that was asked for beyond.
fn within(product: &Manifest, time: TimeMs) -> TimeMs {
    let is_end = product
        .extent()
        .is_some_and(|Period { end, .. }| end == time);
    let before = TimeMs::new(time.ms() - 1).ok();
    before.filter(|_| is_end).unwrap_or(time)
}

/// May values of a step be means over it? Codes have none, and heights and shares of land hold at any time.
fn may_be_means(quantity: Quantity) -> bool {
    let holds_at_any_time = matches!(
        quantity,
        Quantity::Elevation | Quantity::SeaAreaFraction | Quantity::LandAreaFraction
    );
    quantity.flags().is_empty() && !quantity.is_day_of_year() && !holds_at_any_time
}

/// The statistic over time that the values are, of one product or of two.
fn over_time(computed: &Computed) -> Option<MapStatistic> {
    match computed.how {
        Computation::Statistic { statistic, .. } => Some(statistic),
        Computation::Correlation { statistic, .. } => Some(MapStatistic::Correlation(statistic)),
        Computation::Expression { .. } | Computation::Regrid { .. } => None,
    }
}

/// What values are of all the time that is shown, where they keep the quantity and so nothing else of the picture says it. The
/// quantities of the others are called by what they are.
fn of_all_time(statistic: MapStatistic) -> Option<String> {
    match statistic {
        MapStatistic::Min => Some("lowest of this time".to_owned()),
        MapStatistic::Max => Some("highest of this time".to_owned()),
        MapStatistic::Percentile(_) => Some(format!("{statistic} of this time")),
        MapStatistic::Mean
        | MapStatistic::MinTime
        | MapStatistic::MaxTime
        | MapStatistic::Count
        | MapStatistic::Coverage
        | MapStatistic::Spread
        | MapStatistic::Climatology
        | MapStatistic::Anomaly
        | MapStatistic::Amplitude
        | MapStatistic::Phase
        | MapStatistic::Trend
        | MapStatistic::TrendPValue
        | MapStatistic::LeastSquaresTrend
        | MapStatistic::LeastSquaresTrendPValue
        | MapStatistic::Correlation(_) => None,
    }
}
