//! Options of statistics that become products.

use clap::Args;
use contract::analysis::{BasePeriod, CalendarBins, MapOptions, MapStatistic};
use contract::product::ProductId;
use contract::time::TimeMs;

/// `fluxglobe derive statistic`.
#[derive(Debug, Args)]
pub(crate) struct DeriveStatistic {
    /// Product, of any quantity.
    #[arg(long)]
    pub(crate) product: ProductId,
    /// mean, spread (standard deviation), climatology (a step a month or season), anomaly (every step less the
    /// climatology), amplitude and phase of the year's wave, trend (Theil-Sen), trend-p-value (Mann-Kendall, Hamed-Rao).
    #[arg(long, value_name = "NAME")]
    pub(crate) statistic: MapStatistic,
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
    /// Product that it becomes. PRODUCT-STATISTIC if absent.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) name: Option<ProductId>,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
}

impl DeriveStatistic {
    /// What is derived.
    pub(crate) fn asked(&self) -> MapOptions {
        MapOptions {
            base: self.base,
            bins: self.bins,
            from: self.from,
            to: self.to,
            least_percent: self.least_percent,
            name: self.name.clone(),
            ..MapOptions::new(self.statistic)
        }
    }
}
