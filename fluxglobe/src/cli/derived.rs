//! Options of statistics that become products.

use anyhow::{Result, bail};
use clap::Args;
use contract::analysis::{
    AnalysisOptions, BasePeriod, CalendarBins, MapCorrelation, MapOptions, MapStatistic,
};
use contract::product::ProductId;
use contract::region::AskedRegion;
use contract::time::{TimeMs, TimeStep};

use super::brokers::brokers_alone;
use super::follow::Follow;
use super::steps::STEPS;

/// What the long help ends with.
const MORE: &str = "\
How two products go together in each cell, over the months that both have:

  fluxglobe derive statistic --product sst --with wind --deseasonalise \\
    --statistic correlation,correlation-p-value,correlation-pairs

makes sst-correlation-wind and so on, each cell what `fluxglobe stats correlate --at` says of it:
Pearson's r, -1 to 1; p by effective pairs, which allow for autocorrelation (Bretherton et al.
1999); pairs of months, each of which holds data in half of its time (of seasons and years in half
of each of their months). Seasons alone make most pairs of products go together: --deseasonalise takes them off
first. With --lag 2 the second is read two months after the first, with --lag=-2 before it; give
maps of several lags a --name each.
Both lie on one grid: `fluxglobe derive regrid` brings one to that of the other.

What a statistic was made from and how it was asked for is in its manifest (`computed`). When
something lands in that, in either of two, or in what that was made from, the deriver of a cluster
(in the scheduler's process) makes it anew, with all else that was made from it; asked again, the
same is done at once. What a command derives anew takes nothing along that was made from it: the
command names what is of an older version then, and with --follow makes that anew too, each after
what it was made from. Steps that come are read too where --to leaves that open; a region stays
what it was. One that is made with --once stays as it is until it is asked for again.";

/// `fluxglobe derive statistic`.
#[derive(Debug, Args)]
#[command(after_long_help = MORE, mut_args(brokers_alone))]
pub(crate) struct DeriveStatistic {
    /// Product, of any quantity.
    #[arg(long)]
    pub(crate) product: ProductId,
    /// One or more, separated by commas; the product is read once for all: mean, min, max, median, p97.5 and the like,
    /// min-time and max-time (when), count and coverage (steps and share of the time with data), spread (standard deviation of
    /// the steps as of a sample, divisor n - 1),
    /// climatology (a step a month or season), anomaly (every step, or every mean of a --step, less the climatology), amplitude and
    /// phase of the year's wave,
    /// trend (Theil-Sen), trend-p-value (Mann-Kendall, Hamed-Rao with the autocorrelation of neighbouring steps), least-squares-trend, least-squares-trend-p-value; together with
    /// the product --with: correlation, correlation-p-value, correlation-pairs, correlation-effective-pairs.
    #[arg(long, value_name = "NAME,...", value_delimiter = ',', required = true)]
    pub(crate) statistic: Vec<MapStatistic>,
    /// The second product of correlations, on the same grid.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) with: Option<ProductId>,
    /// Steps that the second product is read after the first, at most 400; before it below zero. None if absent.
    #[arg(
        long,
        value_name = "STEPS",
        requires = "with",
        allow_negative_numbers = true
    )]
    pub(crate) lag: Option<i32>,
    /// Take the mean of each calendar month off both products of a correlation first: two with seasons always go together.
    #[arg(long, visible_alias = "deseasonalize", requires = "with")]
    pub(crate) deseasonalise: bool,
    /// Means that trends are drawn through, and correlations and anomalies made of. Of trends steps as they are where those are longer;
    /// `native` correlations need the same periods of both. If absent months, and of anomalies every step.
    #[arg(long, visible_alias = "step", value_name = STEPS)]
    pub(crate) trend_step: Option<TimeStep>,
    /// Only the cells that lie in it, wholly or in part: `global`, a named region, a box WEST,SOUTH,EAST,NORTH, a GeoJSON or WKT
    /// file, the text of one, or PRODUCT:CODE of a landed mask. Every cell if absent.
    #[arg(long, allow_hyphen_values = true)]
    pub(crate) region: Option<String>,
    /// Store only the cells about the region, out to whole blocks of 8 x 8: less to land and to keep of a small one. The product has a
    /// grid of its own then, part of its source's: what was computed of it on another grid follows it no more, so give it a --name of its own
    /// where it was there with all cells. All cells of the source if absent, without data outside the region.
    #[arg(long, requires = "region")]
    pub(crate) crop: bool,
    /// Years of the climatology, both part of it: 1991/2020; of climatology and anomaly alone. If absent those of --from and --to, of anomalies
    /// all that the product covers.
    #[arg(long, value_name = "FIRST/LAST")]
    pub(crate) base: Option<BasePeriod>,
    /// Parts of the year of climatology and anomaly.
    #[arg(long, default_value_t, value_name = "month|season")]
    pub(crate) bins: CalendarBins,
    /// First instant of the steps that are read, or of anomalies that are written; not of a climatology with a --base, which says it. The
    /// product's first if absent. Every step that reaches into the period counts, and whole: of months --from 2004-08-02 has all of August.
    #[arg(long)]
    pub(crate) from: Option<TimeMs>,
    /// First instant after them; a step that it lies in counts whole. The product's end if absent.
    #[arg(long)]
    pub(crate) to: Option<TimeMs>,
    /// Share of the time, of a bin's steps or of all pairs of steps that must hold data for a cell to have a value, percent.
    #[arg(long, default_value_t = 50, value_name = "PERCENT", value_parser = clap::value_parser!(u8).range(0..=100))]
    pub(crate) least_percent: u8,
    /// Product that it becomes; of several statistics what their names begin with: NAME-STATISTIC. PRODUCT-STATISTIC if absent,
    /// PRODUCT-STATISTIC-WITH of correlations, and -REGION after it where that is a named one.
    #[arg(long, value_name = "PRODUCT")]
    pub(crate) name: Option<ProductId>,
    /// Made of the versions that are there now, and by itself of none after them.
    #[arg(long)]
    pub(crate) once: bool,
    #[command(flatten)]
    pub(crate) follow: Follow,
    #[command(flatten, next_help_heading = "Kafka")]
    pub(crate) kafka: kafka_log::KafkaSettings,
}

impl DeriveStatistic {
    /// What is derived, in a region or everywhere.
    ///
    /// # Errors
    /// A name that would be too long; a correlation without a second product, or one that nothing is correlated with; a base period, or a
    /// period, that nothing is made of.
    pub(crate) fn asked(&self, region: Option<&AskedRegion>) -> Result<Vec<MapOptions>> {
        let correlation = self.with.clone().map(|with| MapCorrelation {
            lag_steps: self.lag.unwrap_or_default(),
            deseasonalise: self.deseasonalise,
            ..MapCorrelation::new(with)
        });
        self.check_base()?;
        let is_any_of_two = self.statistic.iter().any(|one| one.is_of_two());
        match &self.with {
            None if is_any_of_two => {
                bail!("a correlation is of two products: give the second, --with")
            }
            Some(with) if !is_any_of_two => {
                bail!(
                    "nothing is made of {with}: --with is for correlations, such as --statistic correlation"
                );
            }
            _ => {}
        }
        let has_step = |one: &MapStatistic| one.is_trend() || one.is_of_two();
        let is_anomaly = |one: &MapStatistic| *one == MapStatistic::Anomaly;
        if let Some(step) = self.trend_step
            && !self
                .statistic
                .iter()
                .any(|one| has_step(one) || is_anomaly(one))
        {
            bail!(
                "nothing is made of means of a {step}: --step is for trends, correlations and anomalies"
            );
        }
        let one = |statistic: &MapStatistic| -> Result<MapOptions> {
            let name = match &self.name {
                Some(name) if self.statistic.len() > 1 => {
                    Some(format!("{name}-{}", statistic.word()).parse()?)
                }
                name => name.clone(),
            };
            Ok(MapOptions {
                base: self.base.filter(|_| statistic.has_bins()),
                bins: self.bins,
                from: self.from,
                to: self.to,
                least_percent: self.least_percent,
                step: self
                    .trend_step
                    .filter(|_| has_step(statistic))
                    .unwrap_or(AnalysisOptions::USUAL_STEP),
                anomaly_step: self
                    .trend_step
                    .filter(|step| is_anomaly(statistic) && *step != TimeStep::Native),
                correlation: correlation.clone().filter(|_| statistic.is_of_two()),
                region: region.cloned(),
                crop: self.crop,
                name,
                once: self.once,
                ..MapOptions::new(*statistic)
            })
        };
        self.statistic.iter().map(one).collect()
    }

    /// Is something made of the base period, and of the period beside it?
    fn check_base(&self) -> Result<()> {
        let Some(base) = self.base else {
            return Ok(());
        };
        if !self.statistic.iter().any(|one| one.has_bins()) {
            bail!(
                "nothing is made of the base period {base}: --base is for climatology and anomaly; which steps others are made of say --from and --to"
            );
        }
        let is_climatology = self.statistic.contains(&MapStatistic::Climatology);
        if is_climatology && (self.from.is_some() || self.to.is_some()) {
            bail!(
                "a climatology is made of all steps in its base period {base}, and of --from and --to nothing: leave out either, and ask for \
                 other statistics of that period by a command of their own"
            );
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        options: DeriveStatistic,
    }

    fn asked(words: &str) -> Result<Vec<MapOptions>> {
        let line = ["statistic", "--product", "sst", "--statistic"];
        let line = line.into_iter().chain(words.split(' '));
        Line::try_parse_from(line)?.options.asked(None)
    }

    #[test]
    fn correlations_have_a_second_product_and_nothing_else_has() {
        let all =
            asked("trend,correlation,correlation-pairs --with wind --lag -2 --step year").unwrap();
        let lags = all
            .iter()
            .map(|one| one.correlation.as_ref().map(|with| with.lag_steps));
        assert_eq!(lags.collect::<Vec<_>>(), [None, Some(-2), Some(-2)]);
        assert!(all.iter().all(|one| one.step == TimeStep::Year));
        let mixed = asked("mean,trend --trend-step year").unwrap();
        assert_eq!(
            [mixed[0].step, mixed[1].step],
            [TimeStep::Month, TimeStep::Year]
        );
        assert_eq!(asked("trend").unwrap()[0].step, TimeStep::Month);
        for (words, step) in [
            ("anomaly", None),
            ("anomaly --step native", None),
            (
                "anomaly,climatology,trend --step month",
                Some(TimeStep::Month),
            ),
            ("anomaly,trend --step year", Some(TimeStep::Year)),
        ] {
            let all = asked(words).unwrap();
            assert_eq!(all[0].anomaly_step, step, "{words}");
            assert!(all[1..].iter().all(|one| one.anomaly_step.is_none()));
            // What is asked of anomalies is not asked of them as of trends: their products' bytes hang on it.
            assert_eq!(all[0].step, TimeStep::Month, "{words}");
        }
        for (words, reason) in [
            ("correlation", "give the second"),
            ("mean --with wind", "for correlations"),
            ("mean --lag 1", "--with"),
            ("mean --trend-step year", "for trends"),
            ("climatology --step month", "anomalies"),
            ("mean --deseasonalise", "--with"),
            ("mean --crop", "--region"),
        ] {
            let refused = asked(words).unwrap_err().to_string();
            assert!(refused.contains(reason), "{words}: {refused}");
        }
        let named = asked("correlation,correlation-p-value --with wind --name both").unwrap();
        let names = named
            .iter()
            .map(|one| one.target(&"sst".parse().unwrap()).unwrap());
        let names: Vec<String> = names.map(|name| name.to_string()).collect();
        assert_eq!(names, ["both-correlation", "both-correlation-p-value"]);
    }

    #[test]
    fn a_base_period_is_of_what_has_a_climatology_and_alone_says_what_that_is_made_of() {
        for (words, reason) in [
            (
                "mean,trend --base 1991/2020",
                "is for climatology and anomaly",
            ),
            (
                "climatology --base 1991/2020 --from 2000",
                "leave out either",
            ),
            (
                "anomaly,climatology --base 1991/2020 --to 2000",
                "leave out either",
            ),
        ] {
            let refused = asked(words).unwrap_err().to_string();
            assert!(refused.contains(reason), "{words}: {refused}");
        }
        let base: Option<BasePeriod> = "1991/2020".parse().ok();
        let all = asked("mean,climatology,anomaly --base 1991/2020").unwrap();
        let bases = all.iter().map(|one| one.base);
        assert_eq!(bases.collect::<Vec<_>>(), [None, base, base]);
        assert!(asked("anomaly --base 1991/2020 --from 2000").is_ok());
        assert!(asked("climatology --from 2000 --to 2010").is_ok());
    }
}
