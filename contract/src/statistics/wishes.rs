//! What is asked besides a product and a place, from options to a question: the same for a command line and an address.

use std::sync::Arc;

use super::{MinCoverage, Statistics, StatisticsQuery};
use crate::earth::Earth;
use crate::geometry::{AskedGeometry, Sampling};
use crate::grid::LonLatDeg;
use crate::manifest::Manifest;
use crate::product::ProductId;
use crate::region::{AskedRegion, Cells};
use crate::series::RegionSeriesQuery;
use crate::time::{TimeMs, TimeStep};

/// Options of a question; what is absent is as usual.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct StatisticsWishes {
    /// Which.
    pub statistics: Option<Statistics>,
    /// What a row covers.
    pub step: Option<TimeStep>,
    /// Rows whose coverage is below this have no values.
    pub min_coverage: Option<MinCoverage>,
    /// First instant.
    pub from: Option<TimeMs>,
    /// First instant after the asked period.
    pub to: Option<TimeMs>,
    /// Figure of the earth.
    pub earth: Option<Earth>,
    /// How cells on the coast count, in regions.
    pub cells: Option<Cells>,
    /// What the value at a point is.
    pub sampling: Option<Sampling>,
    /// A version of a product that says how much of every cell is sea, in regions.
    pub ocean: Option<Arc<Manifest>>,
}

/// What a question about a point asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum PointQuestion {
    /// The whole series of the cell at the place.
    Series(LonLatDeg),
    /// Statistics of it.
    Statistics(StatisticsQuery),
}

/// What a question about a region asks for.
#[derive(Debug, Clone, PartialEq)]
pub enum RegionQuestion {
    /// The mean at every step.
    Series(RegionSeriesQuery),
    /// Statistics of it.
    Statistics(StatisticsQuery),
}

impl StatisticsWishes {
    /// Statistics over a geometry.
    pub fn query(self, product: ProductId, asked: AskedGeometry) -> StatisticsQuery {
        StatisticsQuery {
            statistics: self.statistics.unwrap_or_default(),
            step: self.step.unwrap_or(StatisticsQuery::USUAL_STEP),
            from: self.from,
            to: self.to,
            earth: self.earth.unwrap_or_default(),
            cells: self.cells.unwrap_or_default(),
            ocean: self.ocean,
            min_coverage: self.min_coverage.unwrap_or_default(),
            ..StatisticsQuery::new(product, asked)
        }
    }

    /// The series of the cell at a place, or statistics at the place where anything is asked that a whole series has not.
    pub fn at_point(self, product: ProductId, place: LonLatDeg) -> PointQuestion {
        let is_cut = self.from.is_some() || self.to.is_some();
        if !is_cut && self.sampling.is_none() && !self.are_statistics() {
            return PointQuestion::Series(place);
        }
        let point = AskedGeometry::point(place, self.sampling.unwrap_or_default());
        PointQuestion::Statistics(self.query(product, point))
    }

    /// The mean over a region at every step, or statistics of the region where anything is asked that a series has not.
    pub fn over_region(self, product: ProductId, region: AskedRegion) -> RegionQuestion {
        if self.cells.is_some() || self.are_statistics() {
            return RegionQuestion::Statistics(self.query(product, region.into()));
        }
        RegionQuestion::Series(RegionSeriesQuery {
            from: self.from,
            to: self.to,
            earth: self.earth.unwrap_or_default(),
            ocean: self.ocean,
            ..RegionSeriesQuery::new(product, region)
        })
    }

    /// Is anything asked that a series has not, wherever it is taken?
    fn are_statistics(&self) -> bool {
        self.statistics.is_some() || self.step.is_some() || self.min_coverage.is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn product() -> ProductId {
        "sst".parse().unwrap()
    }

    #[test]
    fn a_place_alone_asks_for_its_series() {
        let place = LonLatDeg::new(-30.0, 10.0).unwrap();
        let earth = StatisticsWishes {
            earth: Some(Earth::Sphere),
            ..StatisticsWishes::default()
        };
        assert_eq!(
            earth.clone().at_point(product(), place),
            PointQuestion::Series(place)
        );
        let RegionQuestion::Series(series) =
            earth.over_region(product(), "global".parse().unwrap())
        else {
            panic!("statistics");
        };
        assert_eq!(series.earth, Earth::Sphere);
    }

    #[test]
    fn what_a_series_has_not_asks_for_statistics() {
        let usual = StatisticsWishes::default;
        let place = LonLatDeg::new(-30.0, 10.0).unwrap();
        let from = StatisticsWishes {
            from: Some("2000".parse().unwrap()),
            ..usual()
        };
        let PointQuestion::Statistics(cut) = from.clone().at_point(product(), place) else {
            panic!("a series");
        };
        assert_eq!(cut.from, from.from);
        assert_eq!(cut.step, TimeStep::Native);
        // A series over a region may be cut.
        let region: AskedRegion = "global".parse().unwrap();
        let is_series =
            |wishes: StatisticsWishes| match wishes.over_region(product(), region.clone()) {
                RegionQuestion::Series(_) => true,
                RegionQuestion::Statistics(_) => false,
            };
        assert!(is_series(from));
        for wishes in [
            StatisticsWishes {
                step: Some(TimeStep::Month),
                ..usual()
            },
            StatisticsWishes {
                cells: Some(Cells::Whole),
                ..usual()
            },
            StatisticsWishes {
                min_coverage: Some(MinCoverage::default()),
                ..usual()
            },
            StatisticsWishes {
                statistics: Some(Statistics::default()),
                ..usual()
            },
        ] {
            assert!(!is_series(wishes));
        }
    }

    #[test]
    fn an_end_and_a_sampling_alone_ask_for_statistics_of_a_place_too() {
        let place = LonLatDeg::new(-30.0, 10.0).unwrap();
        for wishes in [
            StatisticsWishes {
                to: "2000".parse().ok(),
                ..StatisticsWishes::default()
            },
            StatisticsWishes {
                sampling: Some(Sampling::Cell),
                ..StatisticsWishes::default()
            },
        ] {
            let asked = wishes.clone().at_point(product(), place);
            let PointQuestion::Statistics(query) = asked else {
                panic!("a series");
            };
            assert_eq!(query.to, wishes.to);
        }
    }

    #[test]
    fn what_is_asked_is_in_the_question() {
        let wishes = StatisticsWishes {
            statistics: "max,p90".parse().ok(),
            step: Some(TimeStep::Season),
            min_coverage: "7".parse().ok(),
            from: "2001".parse().ok(),
            to: "2002".parse().ok(),
            earth: Some(Earth::Sphere),
            cells: Some(Cells::OceanShare),
            ..StatisticsWishes::default()
        };
        let region: AskedRegion = "global".parse().unwrap();
        let asked = wishes.clone().over_region(product(), region);
        let RegionQuestion::Statistics(query) = asked else {
            panic!("a series");
        };
        assert_eq!((query.from, query.to), (wishes.from, wishes.to));
        let how = (query.step, query.earth, query.cells);
        assert_eq!(how, (TimeStep::Season, Earth::Sphere, Cells::OceanShare));
        assert_eq!(Some(query.statistics), wishes.statistics);
        assert_eq!(Some(query.min_coverage), wishes.min_coverage);
    }
}
