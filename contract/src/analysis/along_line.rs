//! What a series along a line is asked for.

use crate::earth::Earth;
use crate::geometry::AskedLine;
use crate::product::ProductId;
use crate::statistics::StatisticsQuery;
use crate::time::TimeMs;

/// The mean along a line by length, step by step.
#[derive(Debug, Clone, PartialEq)]
pub struct LineSeriesQuery {
    /// Product.
    pub product: ProductId,
    /// The line.
    pub line: AskedLine,
    /// First instant; the product's first if absent.
    pub from: Option<TimeMs>,
    /// First instant after the asked period; the product's end if absent.
    pub to: Option<TimeMs>,
    /// Figure of the earth for lengths.
    pub earth: Earth,
}

impl LineSeriesQuery {
    /// The question about all steps.
    pub fn new(product: ProductId, line: AskedLine) -> Self {
        Self {
            product,
            line,
            from: None,
            to: None,
            earth: Earth::default(),
        }
    }

    /// The same question of statistics: the mean at every step, whatever it covers.
    pub fn statistics(&self) -> StatisticsQuery {
        StatisticsQuery {
            from: self.from,
            to: self.to,
            earth: self.earth,
            ..StatisticsQuery::new(self.product.clone(), self.line.clone().into())
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::{Statistic, Statistics};
    use crate::time::TimeStep;

    #[test]
    fn it_is_the_mean_at_every_step() {
        let line: AskedLine = "0,0;10,20".parse().unwrap();
        let query = LineSeriesQuery {
            from: "2001".parse().ok(),
            earth: Earth::Sphere,
            ..LineSeriesQuery::new("sst".parse().unwrap(), line.clone())
        };
        let asked = query.statistics();
        assert_eq!(asked.statistics, Statistics::default());
        assert_eq!(
            asked.statistics.iter().collect::<Vec<_>>(),
            [Statistic::Mean]
        );
        assert_eq!((asked.step, asked.earth), (TimeStep::Native, Earth::Sphere));
        assert_eq!((asked.from, asked.to), (query.from, None));
        assert_eq!(asked.geometry_name, line.name);
    }
}
