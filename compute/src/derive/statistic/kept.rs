//! What a manifest keeps of how a statistic was asked for, and the request that it was.

use contract::ContractError;
use contract::analysis::{MapCorrelation, MapOptions, MapStatistic};
use contract::computed::{Computation, Computed, ComputedInput, MapRequest, Matching};
use contract::manifest::Manifest;
use contract::product::ProductId;
use contract::region::KeptRegion;

use super::sources::SourcesOf;

/// How a statistic of these versions is made.
pub(super) fn computed(sources: SourcesOf<'_>, options: &MapOptions) -> Computed {
    let how = match (options.statistic, &options.correlation) {
        (MapStatistic::Correlation(statistic), Some(asked)) => Computation::Correlation {
            statistic,
            lag_steps: asked.lag_steps,
            step: options.step,
            deseasonalised: asked.deseasonalise,
            least_percent: options.least_percent,
        },
        (statistic, _) => Computation::Statistic {
            statistic,
            step: options.step,
            least_percent: options.least_percent,
        },
    };
    let names: &[&str] = match sources.second {
        Some(_) => &["first", "second"],
        None => &["source"],
    };
    let input = |(name, manifest): (&&str, &Manifest)| ComputedInput {
        name: (*name).to_owned(),
        manifest: manifest.id(),
        matching: Matching::SamePeriod,
    };
    Computed {
        how,
        inputs: names.iter().zip(sources.all()).map(input).collect(),
        from: options.from,
        to: options.to,
        map: Some(MapRequest {
            base: options.base,
            bins: options.bins,
            anomaly_step: options.anomaly_step,
            region: options.region.as_ref().map(KeptRegion::of),
            crop: options.crop,
            once: options.once,
        }),
    }
}

/// A statistic that is made again of newer versions.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct StatisticRequest {
    /// The product that it is.
    pub(crate) target: ProductId,
    /// What it is of: the first of two.
    pub(crate) product: ProductId,
    /// What is asked, under its name.
    pub(crate) options: MapOptions,
}

impl StatisticRequest {
    /// The request that made a version; none of what is no statistic, and of one that follows nothing.
    ///
    /// # Errors
    /// What is kept makes no sense.
    pub(crate) fn of(manifest: &Manifest) -> Result<Option<Self>, ContractError> {
        let kept = manifest.computed.as_ref().filter(|it| it.follows());
        let Some((computed, map)) = kept.and_then(|it| Some((it, it.map.as_ref()?))) else {
            return Ok(None);
        };
        let bad = |reason: &str| {
            ContractError::invalid("statistic", manifest.product.as_str(), reason.to_owned())
        };
        let mut inputs = computed.inputs.iter().map(|it| it.manifest.product.clone());
        let (first, second) = (inputs.next(), inputs.next());
        let product = first.ok_or_else(|| bad("it is kept of no product"))?;
        let options = match (&computed.how, second) {
            (
                Computation::Correlation {
                    statistic,
                    lag_steps,
                    step,
                    deseasonalised,
                    least_percent,
                },
                Some(with),
            ) => MapOptions {
                step: *step,
                least_percent: *least_percent,
                ..MapOptions::of_two(
                    *statistic,
                    MapCorrelation {
                        with,
                        lag_steps: *lag_steps,
                        deseasonalise: *deseasonalised,
                    },
                )
            },
            (
                Computation::Statistic {
                    statistic,
                    step,
                    least_percent,
                },
                None,
            ) => MapOptions {
                step: *step,
                least_percent: *least_percent,
                ..MapOptions::new(*statistic)
            },
            _ => return Err(bad("it is kept of as many products as it cannot be of")),
        };
        let region = map.region.as_ref().map(KeptRegion::asked).transpose()?;
        Ok(Some(Self {
            target: manifest.product.clone(),
            product,
            options: MapOptions {
                base: map.base,
                bins: map.bins,
                anomaly_step: map.anomaly_step,
                from: computed.from,
                to: computed.to,
                region,
                crop: map.crop,
                name: Some(manifest.product.clone()),
                once: map.once,
                ..options
            },
        }))
    }

    /// What it is of, one product or two.
    pub(crate) fn sources(&self) -> impl Iterator<Item = &ProductId> {
        let second = self.options.correlation.as_ref().map(|own| &own.with);
        std::iter::once(&self.product).chain(second)
    }
}
