//! What is asked of a statistic of every cell of a product, and the product that it becomes.

use serde::Serialize;

use super::{
    AnalysisOptions, BasePeriod, CalendarBins, CorrelationStatistic, MapCorrelation, MapStatistic,
};
use crate::ContractError;
use crate::product::ProductId;
use crate::region::{AskedRegion, NamedRegion};
use crate::time::{TimeMs, TimeStep};

/// What is derived.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MapOptions {
    /// Of each cell.
    pub statistic: MapStatistic,
    /// Years of the climatology; all that the product covers if absent.
    pub base: Option<BasePeriod>,
    /// Months or seasons, of what has bins.
    pub bins: CalendarBins,
    /// First instant of the steps that are read, or of anomalies written; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after them; the product's end if absent.
    pub to: Option<TimeMs>,
    /// Share of the time, of a bin's steps or of the pairs that there could be that must hold data for a cell to have a value, percent.
    pub least_percent: u8,
    /// Means that trends are drawn through and correlations made of.
    #[serde(skip_serializing_if = "is_usual")]
    pub step: TimeStep,
    /// Means that anomalies are of; the product's own steps if absent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub anomaly_step: Option<TimeStep>,
    /// What a correlation is with; absent of everything else.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub correlation: Option<MapCorrelation>,
    /// Where: cells that lie in it, wholly or in part; everywhere if absent.
    #[serde(skip)]
    pub region: Option<AskedRegion>,
    /// Is what is stored the cells about the region? Else all cells are, without data outside of it.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub crop: bool,
    /// Product that it becomes; `PRODUCT-STATISTIC` if absent, `-WITH` after it of a correlation, `-STEP` of anomalies of means, and
    /// `-REGION` of a named one.
    #[serde(skip)]
    pub name: Option<ProductId>,
    /// Made of the versions that are there, and by itself of none after them.
    #[serde(skip)]
    pub once: bool,
}

impl MapOptions {
    /// The usual options.
    pub fn new(statistic: MapStatistic) -> Self {
        Self {
            statistic,
            base: None,
            bins: CalendarBins::default(),
            from: None,
            to: None,
            least_percent: 50,
            step: AnalysisOptions::USUAL_STEP,
            anomaly_step: None,
            correlation: None,
            region: None,
            crop: false,
            name: None,
            once: false,
        }
    }

    /// The usual options of a correlation with another product.
    pub fn of_two(statistic: CorrelationStatistic, correlation: MapCorrelation) -> Self {
        Self {
            correlation: Some(correlation),
            ..Self::new(MapStatistic::Correlation(statistic))
        }
    }

    /// The product that the statistic of a product becomes.
    ///
    /// # Errors
    /// The name would be too long, is that of a product it is made of, or is kept for accumulated carbon; a region without a name of
    /// its own, and none for the product.
    pub fn target(&self, product: &ProductId) -> Result<ProductId, ContractError> {
        let statistic = self.statistic.word();
        let with = self.correlation.as_ref().map(|own| &own.with);
        let of_both = match (with, self.anomaly_step) {
            (Some(with), _) => format!("{product}-{statistic}-{with}"),
            (None, Some(step)) => format!("{product}-{statistic}-{}", step.as_str()),
            (None, None) => format!("{product}-{statistic}"),
        };
        let name = match (&self.name, &self.region) {
            (Some(name), _) => name.clone(),
            (None, None) => made_up(&of_both)?,
            (None, Some(asked)) if NamedRegion::find(&asked.name).is_some() => {
                made_up(&format!("{of_both}-{}", asked.name))?
            }
            (None, Some(asked)) => {
                let reason = "a statistic of a region that has no name of its own needs a name for its product: --name";
                return Err(ContractError::invalid("region", &asked.name, reason));
            }
        };
        let is_taken = name == *product || with == Some(&name);
        if is_taken || name.as_str().ends_with("-accumulated") {
            let reason =
                "a statistic needs a name of its own, which does not end in -accumulated: --name";
            return Err(ContractError::invalid("product", name.as_str(), reason));
        }
        Ok(name)
    }
}

/// A name that was put together.
fn made_up(name: &str) -> Result<ProductId, ContractError> {
    name.parse().map_err(|_too_long: ContractError| {
        let reason =
            "it would be longer than the 64 letters that a name may have: give another, --name";
        ContractError::invalid("product", name, reason)
    })
}

#[expect(clippy::trivially_copy_pass_by_ref, reason = "serde calls it so")]
fn is_usual(step: &TimeStep) -> bool {
    *step == AnalysisOptions::USUAL_STEP
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn correlations_are_named_by_both_products() {
        let product: ProductId = "sst".parse().unwrap();
        let mut with = MapCorrelation::new("wind".parse().unwrap());
        let of =
            |with: &MapCorrelation| MapOptions::of_two(CorrelationStatistic::PValue, with.clone());
        let name = of(&with).target(&product).unwrap();
        assert_eq!(name.as_str(), "sst-correlation-p-value-wind");
        let in_region = MapOptions {
            region: Some("equatorial-pacific".parse().unwrap()),
            ..of(&with)
        };
        let name = in_region.target(&product).unwrap();
        assert_eq!(
            name.as_str(),
            "sst-correlation-p-value-wind-equatorial-pacific"
        );
        let taken = MapOptions {
            name: Some(with.with.clone()),
            ..of(&with)
        };
        assert!(taken.target(&product).is_err());
        let long = MapCorrelation::new("w".repeat(60).parse().unwrap());
        let refused = of(&long).target(&product).unwrap_err();
        assert!(refused.to_string().contains("--name"), "{refused}");
        with.lag_steps = -400;
        assert!(with.check().is_ok());
        with.lag_steps = -401;
        assert!(with.check().is_err());
    }

    /// Names of products that are there hang on these bytes.
    #[test]
    fn options_that_are_as_usual_are_written_as_they_always_were() {
        let json = serde_json::to_string(&MapOptions::new(MapStatistic::Trend)).unwrap();
        let always = r#"{"statistic":"trend","base":null,"bins":"month","from":null,"to":null,"least_percent":50}"#;
        assert_eq!(json, always);
    }

    #[test]
    fn anomalies_of_means_have_names_and_bytes_of_their_own() {
        let of = |anomaly_step| MapOptions {
            anomaly_step,
            ..MapOptions::new(MapStatistic::Anomaly)
        };
        let product: ProductId = "sst".parse().unwrap();
        let name = |step| of(step).target(&product).unwrap().to_string();
        assert_eq!(name(None), "sst-anomaly");
        assert_eq!(name(Some(TimeStep::Month)), "sst-anomaly-month");
        let json = |step| serde_json::to_string(&of(step)).unwrap();
        assert!(!json(None).contains("step"));
        assert!(json(Some(TimeStep::Month)).contains(r#""anomaly_step":"month""#));
    }

    #[test]
    fn products_of_statistics_are_named_by_them() {
        let percentile: MapStatistic = "p97.5".parse().unwrap();
        let product: ProductId = "sst".parse().unwrap();
        let mut options = MapOptions::new(MapStatistic::TrendPValue);
        assert_eq!(
            options.target(&product).unwrap().as_str(),
            "sst-trend-p-value"
        );
        options.region = Some("-10,20,30,40".parse().unwrap());
        assert!(options.target(&product).is_err());
        options.region = Some("equatorial-pacific".parse().unwrap());
        options.statistic = percentile;
        let name = options.target(&product).unwrap();
        assert_eq!(name.as_str(), "sst-p97-5-equatorial-pacific");
        for taken in ["sst", "flux-accumulated"] {
            options.name = Some(taken.parse().unwrap());
            assert!(options.target(&product).is_err(), "{taken}");
        }
    }
}
