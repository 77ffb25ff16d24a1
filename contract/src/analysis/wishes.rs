//! What is asked of series, from options to questions: the same for a command line and an address. What is absent is as usual.

use std::sync::Arc;

use super::{
    Along, AnalysisOptions, AnalysisPart, BasePeriod, CalendarBins, CorrelationQuery,
    HovmollerQuery, LineSeriesQuery, SeriesQuery,
};
use crate::ContractError;
use crate::earth::Earth;
use crate::geometry::AskedLine;
use crate::grid::LonLatDeg;
use crate::manifest::Manifest;
use crate::product::ProductId;
use crate::region::AskedRegion;
use crate::series::RegionSeriesQuery;
use crate::statistics::MinCoverage;
use crate::time::{TimeMs, TimeStep};

/// Where a series is taken, and when.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SeriesWishes {
    /// In the cell that holds a place.
    pub place: Option<LonLatDeg>,
    /// As the mean over a region.
    pub region: Option<AskedRegion>,
    /// As the mean along a line.
    pub line: Option<AskedLine>,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant after the asked period.
    pub to: Option<TimeMs>,
    /// Figure of the earth, in regions and along lines.
    pub earth: Option<Earth>,
    /// A version of a product that says how much of every cell is sea, in regions.
    pub ocean: Option<Arc<Manifest>>,
}

impl SeriesWishes {
    /// The series of a product; none unless one of a place, a region and a line is given.
    ///
    /// # Errors
    /// A figure of the earth of a cell, whose value has no area, or a mask of the sea of anything but a region.
    pub fn query(self, product: ProductId) -> Result<Option<SeriesQuery>, ContractError> {
        let (from, to) = (self.from, self.to);
        if let Some(earth) = self.earth
            && self.place.is_some()
        {
            let reason = "areas and lengths are of regions and lines, and a cell is taken as it is: leave it out";
            return Err(ContractError::invalid("earth", &earth.to_string(), reason));
        }
        if let (Some(ocean), None) = (&self.ocean, &self.region)
            && (self.place.is_some() || self.line.is_some())
        {
            let reason = "how much of a cell is sea counts in regions alone: leave it out";
            return Err(ContractError::invalid(
                "ocean",
                ocean.product.as_str(),
                reason,
            ));
        }
        Ok(match (self.place, self.region, self.line) {
            (Some(place), None, None) => Some(SeriesQuery::Cell {
                product,
                place,
                from,
                to,
            }),
            (None, Some(region), None) => Some(SeriesQuery::Region(RegionSeriesQuery {
                from,
                to,
                earth: self.earth.unwrap_or_default(),
                ocean: self.ocean,
                ..RegionSeriesQuery::new(product, region)
            })),
            (None, None, Some(line)) => Some(SeriesQuery::Line(LineSeriesQuery {
                from,
                to,
                earth: self.earth.unwrap_or_default(),
                ..LineSeriesQuery::new(product, line)
            })),
            _ => None,
        })
    }
}

/// What is made of a series.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct AnalysisWishes {
    /// What, in any order.
    pub parts: Vec<AnalysisPart>,
    /// Years of the climatology.
    pub base: Option<BasePeriod>,
    /// Parts of the year.
    pub bins: Option<CalendarBins>,
    /// Means that a trend is drawn through.
    pub trend_step: Option<TimeStep>,
    /// Least share of a region's sea, or of a line, that a step must hold data over.
    pub min_coverage: Option<MinCoverage>,
}

impl AnalysisWishes {
    /// It with what is usual in place of what is absent.
    ///
    /// # Errors
    /// No part at all, or an option of parts that are not asked for.
    pub fn options(self) -> Result<AnalysisOptions, ContractError> {
        self.check_options()?;
        Ok(AnalysisOptions {
            base: self.base,
            bins: self.bins.unwrap_or_default(),
            trend_step: self.trend_step.unwrap_or(AnalysisOptions::USUAL_STEP),
            min_coverage: self.min_coverage.unwrap_or_default(),
            ..AnalysisOptions::new(self.parts)?
        })
    }

    /// # Errors
    /// An option that changes nothing of what is asked for.
    fn check_options(&self) -> Result<(), ContractError> {
        let is_asked = |part| self.parts.contains(&part);
        if !is_asked(AnalysisPart::Climatology) && !is_asked(AnalysisPart::Anomaly) {
            let reason = "it belongs to the climatology and the anomaly: ask for one of them, or leave it out";
            if let Some(base) = self.base {
                return Err(ContractError::invalid("base", &base.to_string(), reason));
            }
            if let Some(bins) = self.bins {
                return Err(ContractError::invalid("bins", bins.as_str(), reason));
            }
        }
        match self.trend_step {
            Some(step) if !is_asked(AnalysisPart::Trend) => {
                let reason = "it belongs to the trend: ask for that, or leave it out";
                Err(ContractError::invalid("trend step", step.as_str(), reason))
            }
            _ => Ok(()),
        }
    }
}

/// How two series are compared.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct CorrelationWishes {
    /// What they are compared in.
    pub step: Option<TimeStep>,
    /// Is the mean of each calendar month taken off both first?
    pub deseasonalise: Option<bool>,
    /// Most steps that one is moved against the other.
    pub max_lag: Option<u32>,
    /// Least share of a region's sea, or of a line, that a step of either must hold data over.
    pub min_coverage: Option<MinCoverage>,
}

impl CorrelationWishes {
    /// A series beside the same of another product.
    ///
    /// # Errors
    /// A lag beyond 400 steps.
    pub fn query(
        self,
        series: SeriesQuery,
        with: ProductId,
    ) -> Result<CorrelationQuery, ContractError> {
        Ok(CorrelationQuery {
            step: self.step.unwrap_or(AnalysisOptions::USUAL_STEP),
            deseasonalise: self.deseasonalise.unwrap_or_default(),
            min_coverage: self.min_coverage.unwrap_or_default(),
            ..CorrelationQuery::new(series, with, self.max_lag.unwrap_or_default())?
        })
    }
}

/// Years that are compared.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct DifferenceWishes {
    /// Years of the first side; all that the series covers if absent.
    pub period: Option<BasePeriod>,
    /// Years of what is taken off; those of the first side if absent.
    pub minus_period: Option<BasePeriod>,
}

impl DifferenceWishes {
    /// Both sides: a series, and the same of the product that is taken off.
    pub fn sides(self, all: &SeriesQuery, minus: ProductId) -> [SeriesQuery; 2] {
        let minus_period = self.minus_period.or(self.period);
        let minus = all.of_product(minus).in_years(minus_period);
        [all.in_years(self.period), minus]
    }
}

/// Bands and steps of a Hovmöller diagram.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HovmollerWishes {
    /// Height or width of a band, degrees.
    pub band_deg: Option<f64>,
    /// A box, of which cells count whose middles lie in it, or polygons, which count by their share of every cell.
    pub region: Option<AskedRegion>,
    /// What a row covers.
    pub step: Option<TimeStep>,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant after the asked period.
    pub to: Option<TimeMs>,
    /// Figure of the earth.
    pub earth: Option<Earth>,
    /// Least coverage of a mean of a band.
    pub min_coverage: Option<MinCoverage>,
}

impl HovmollerWishes {
    /// Bands of a product that lie along latitude or longitude.
    pub fn query(self, product: ProductId, along: Along) -> HovmollerQuery {
        HovmollerQuery {
            product,
            along,
            band_deg: self.band_deg,
            region: self.region,
            step: self.step.unwrap_or(AnalysisOptions::USUAL_STEP),
            from: self.from,
            to: self.to,
            earth: self.earth.unwrap_or_default(),
            min_coverage: self.min_coverage.unwrap_or_default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn series() -> SeriesQuery {
        let wishes = SeriesWishes {
            region: Some("global".parse().unwrap()),
            ..SeriesWishes::default()
        };
        wishes.query("sst".parse().unwrap()).unwrap().unwrap()
    }

    #[test]
    fn a_series_is_of_a_place_or_of_a_region_or_of_a_line() {
        let of = |has_place: bool, has_region: bool, has_line: bool| {
            let wishes = SeriesWishes {
                place: has_place.then(|| LonLatDeg::new(1.0, 2.0).unwrap()),
                region: has_region.then(|| "global".parse().unwrap()),
                line: has_line.then(|| "0,0;1,1".parse().unwrap()),
                earth: (!has_place).then_some(Earth::Sphere),
                to: "2001".parse().ok(),
                ..SeriesWishes::default()
            };
            wishes.query("sst".parse().unwrap()).unwrap()
        };
        assert!(matches!(
            of(true, false, false),
            Some(SeriesQuery::Cell { .. })
        ));
        assert!(matches!(
            of(false, true, false),
            Some(SeriesQuery::Region(_))
        ));
        let Some(SeriesQuery::Line(line)) = of(false, false, true) else {
            panic!("no line");
        };
        assert_eq!((line.earth, line.to), (Earth::Sphere, "2001".parse().ok()));
        let along = SeriesQuery::Line(line);
        let later = along
            .of_product("ice".parse().unwrap())
            .in_years("2003/2004".parse().ok());
        assert_eq!(later.product().as_str(), "ice");
        let [from, to] = ["2003", "2005"].map(|year| year.parse().ok());
        assert_eq!(later.window(), (from, to));
        for (place, region, line) in [
            (true, true, false),
            (true, false, true),
            (false, true, true),
            (true, true, true),
            (false, false, false),
        ] {
            assert_eq!(of(place, region, line), None);
        }
    }

    #[test]
    fn what_is_taken_off_is_of_the_same_years_unless_told() {
        let years = |text: &str| -> Option<BasePeriod> { Some(text.parse().unwrap()) };
        let first = |query: &SeriesQuery| query.window().0.unwrap().to_string();
        let mut wishes = DifferenceWishes {
            period: years("1991/1995"),
            minus_period: None,
        };
        let [of, minus] = wishes.sides(&series(), "other".parse().unwrap());
        assert_eq!(first(&of), first(&minus));
        assert_eq!(minus.product().as_str(), "other");
        wishes.minus_period = years("2001/2005");
        let [of, minus] = wishes.sides(&series(), "sst".parse().unwrap());
        assert_eq!(first(&of), "1991-01-01T00:00:00Z");
        assert_eq!(first(&minus), "2001-01-01T00:00:00Z");
    }

    #[test]
    fn what_is_absent_is_as_usual() {
        let parts = vec![AnalysisPart::Trend];
        let wishes = AnalysisWishes {
            parts: parts.clone(),
            ..AnalysisWishes::default()
        };
        assert_eq!(wishes.options(), AnalysisOptions::new(parts));
        assert!(AnalysisWishes::default().options().is_err());
        let with: ProductId = "ice".parse().unwrap();
        let query = CorrelationWishes::default().query(series(), with.clone());
        assert_eq!(query, CorrelationQuery::new(series(), with, 0));
        let whole = HovmollerWishes::default().query("sst".parse().unwrap(), Along::Lat);
        assert_eq!((whole.region, whole.min_coverage.percent()), (None, 0.0));
    }

    #[test]
    fn what_would_change_nothing_is_refused() {
        let asked = |parts: &[AnalysisPart], change: fn(&mut AnalysisWishes)| {
            let mut wishes = AnalysisWishes {
                parts: parts.to_vec(),
                ..AnalysisWishes::default()
            };
            change(&mut wishes);
            wishes.options().map_err(|refused| refused.to_string())
        };
        let base: fn(&mut AnalysisWishes) = |wishes| wishes.base = "1991/2020".parse().ok();
        let bins: fn(&mut AnalysisWishes) = |wishes| wishes.bins = Some(CalendarBins::Month);
        let step: fn(&mut AnalysisWishes) = |wishes| wishes.trend_step = Some(TimeStep::Month);
        let all = AnalysisPart::ALL;
        for (change, said) in [
            (base, "the climatology and the anomaly"),
            (bins, "the climatology and the anomaly"),
            (step, "the trend"),
        ] {
            assert!(asked(&all, change).is_ok(), "{said}");
            let of_others = [AnalysisPart::Season, AnalysisPart::Extremes];
            for parts in [&of_others[..], &[]] {
                let refused = asked(parts, change).unwrap_err();
                assert!(refused.contains(said), "{refused}");
            }
        }
        assert!(asked(&[AnalysisPart::Trend], base).is_err());
        assert!(asked(&[AnalysisPart::Climatology], step).is_err());
        assert!(asked(&[AnalysisPart::Anomaly], bins).is_ok());
        let cell = SeriesWishes {
            place: Some(LonLatDeg::new(1.0, 2.0).unwrap()),
            earth: Some(Earth::Wgs84),
            ..SeriesWishes::default()
        };
        let refused = cell.query("sst".parse().unwrap()).unwrap_err();
        assert!(refused.to_string().contains("a cell"), "{refused}");
    }

    #[test]
    fn what_is_asked_is_in_the_question() {
        let asked = AnalysisWishes {
            parts: vec![AnalysisPart::Trend, AnalysisPart::Anomaly],
            base: "1991/2000".parse().ok(),
            bins: Some(CalendarBins::Season),
            trend_step: Some(TimeStep::Year),
            min_coverage: "7".parse().ok(),
        };
        let options = asked.clone().options().unwrap();
        assert_eq!(
            (options.base, options.bins),
            (asked.base, CalendarBins::Season)
        );
        assert_eq!(options.trend_step, TimeStep::Year);
        assert_eq!(Some(options.min_coverage), asked.min_coverage);
        let compared = CorrelationWishes {
            step: Some(TimeStep::Year),
            deseasonalise: Some(true),
            max_lag: Some(3),
            min_coverage: "8".parse().ok(),
        };
        let query = compared.clone().query(series(), "ice".parse().unwrap());
        let query = query.unwrap();
        let how = (query.step, query.deseasonalise, query.max_lag);
        assert_eq!(how, (TimeStep::Year, true, 3));
        assert_eq!(Some(query.min_coverage), compared.min_coverage);
        let polygon: AskedRegion = "POLYGON((0 0,9 0,0 9,0 0))".parse().unwrap();
        let bands = HovmollerWishes {
            region: Some(polygon.clone()),
            min_coverage: "9".parse().ok(),
            ..HovmollerWishes::default()
        };
        let query = bands.query("sst".parse().unwrap(), Along::Lon);
        assert_eq!(
            (query.region, Some(query.min_coverage)),
            (Some(polygon), "9".parse().ok())
        );
        let taken = SeriesWishes {
            region: Some("14n-50n".parse().unwrap()),
            from: "2001".parse().ok(),
            to: "2002".parse().ok(),
            earth: Some(Earth::Sphere),
            ..SeriesWishes::default()
        };
        let window = (taken.from, taken.to);
        let taken = taken.query("sst".parse().unwrap());
        let Ok(Some(SeriesQuery::Region(query))) = taken else {
            panic!("no region");
        };
        assert_eq!(
            ((query.from, query.to), query.earth),
            (window, Earth::Sphere)
        );
    }
}
