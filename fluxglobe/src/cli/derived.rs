//! Options of statistics that become products.

use anyhow::Result;
use clap::Args;
use contract::analysis::{BasePeriod, CalendarBins, MapOptions, MapStatistic};
use contract::product::ProductId;
use contract::region::AskedRegion;
use contract::time::TimeMs;

/// `fluxglobe derive statistic`.
#[derive(Debug, Args)]
pub(crate) struct DeriveStatistic {
    /// Product, of any quantity.
    #[arg(long)]
    pub(crate) product: ProductId,
    /// One or more, separated by commas; the product is read once for all: mean, min, max, median, p97.5 and the like,
    /// min-time and max-time (when), count and coverage (steps and share of the time with data), spread (standard deviation),
    /// climatology (a step a month or season), anomaly (every step less the climatology), amplitude and phase of the year's wave,
    /// trend (Theil-Sen), trend-p-value (Mann-Kendall, Hamed-Rao), least-squares-trend, least-squares-trend-p-value.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', required = true)]
    pub(crate) statistic: Vec<MapStatistic>,
    /// Only the cells that lie in it, wholly or in part: `global`, a named region, a box WEST,SOUTH,EAST,NORTH, a GeoJSON or WKT
    /// file, the text of one, or PRODUCT:CODE of a landed mask. Every cell if absent.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) region: Option<String>,
    /// Years of the climatology, both part of it: 1991/2020. All that the product covers if absent.
    #[arg(long, value_name = "FIRST/LAST")]
    pub(crate) base: Option<BasePeriod>,
    /// Parts of the year of climatology and anomaly.
    #[arg(long, default_value_t, value_name = "month|season")]
    pub(crate) bins: CalendarBins,
    /// First instant of the steps that are read, or of anomalies that are written. The product's first if absent.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after them. The product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// Share of the time, or of a bin's steps, that must hold data for a cell to have a value, percent.
    #[arg(long, default_value_t = 50, value_name = "PERCENT", value_parser = clap::value_parser!(u8).range(0..=100))]
    pub(crate) least_percent: u8,
    /// Product that it becomes; of several statistics what their names begin with: NAME-STATISTIC. PRODUCT-STATISTIC if absent,
    /// and -REGION after it where that is a named one.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) name: Option<ProductId>,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
}

impl DeriveStatistic {
    /// What is derived, in a region or everywhere.
    ///
    /// # Errors
    /// A name that would be too long.
    pub(crate) fn asked(&self, region: Option<&AskedRegion>) -> Result<Vec<MapOptions>> {
        let one = |statistic: &MapStatistic| -> Result<MapOptions> {
            let name = match &self.name {
                Some(name) if self.statistic.len() > 1 => {
                    Some(format!("{name}-{}", statistic.word()).parse()?)
                }
                name => name.clone(),
            };
            Ok(MapOptions {
                base: self.base,
                bins: self.bins,
                from: self.from,
                to: self.to,
                least_percent: self.least_percent,
                region: region.cloned(),
                name,
                ..MapOptions::new(*statistic)
            })
        };
        self.statistic.iter().map(one).collect()
    }
}
