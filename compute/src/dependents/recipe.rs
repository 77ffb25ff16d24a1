//! How a product is made of others: its newest manifest in, the request that made it out.

use contract::ContractError;
use contract::manifest::Manifest;
use contract::product::ProductId;

use crate::computed::Request;
use crate::derive::StatisticRequest;

/// How a product is made.
#[derive(Debug, Clone)]
pub(super) enum Recipe {
    /// Accumulated carbon of this flux.
    Accumulated(ProductId),
    /// An expression over products, or one brought to another grid.
    Computed(Box<Request>),
    /// A statistic of every cell of one product or of two.
    Statistic(Box<StatisticRequest>),
}

impl Recipe {
    /// The recipe that a manifest keeps; none of what is of no product, follows none, or is accumulated, which its source says.
    ///
    /// # Errors
    /// What is kept makes no sense.
    pub(super) fn of(manifest: &Manifest) -> Result<Option<Self>, ContractError> {
        if let Some(request) = Request::of(manifest) {
            return Ok(Some(Self::Computed(Box::new(request))));
        }
        let request = StatisticRequest::of(manifest)?;
        Ok(request.map(|request| Self::Statistic(Box::new(request))))
    }

    /// What it is made of.
    pub(super) fn sources(&self) -> impl Iterator<Item = &ProductId> {
        let sources: Vec<&ProductId> = match self {
            Self::Accumulated(source) => vec![source],
            Self::Computed(request) => request.inputs.iter().map(|it| &it.product).collect(),
            Self::Statistic(request) => request.sources().collect(),
        };
        sources.into_iter()
    }

    /// What of several that could be made is made first: what is read most, then what others may be of.
    pub(super) fn rank(&self) -> u8 {
        match self {
            Self::Accumulated(_) => 0,
            Self::Computed(_) => 1,
            Self::Statistic(_) => 2,
        }
    }

    /// Do two read the same cells, so that they are read once for both?
    pub(super) fn goes_with(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Statistic(one), Self::Statistic(other)) => {
                let (own, of_other) = (&one.options, &other.options);
                one.sources().eq(other.sources())
                    && (&own.region, own.crop) == (&of_other.region, of_other.crop)
            }
            _ => false,
        }
    }
}

/// In words, that a statistic stays as it is when what it was made of has a newer version, though nobody asked for that; none of
/// all else.
pub fn why_it_stays(manifest: &Manifest) -> Option<String> {
    let source = &manifest.derived_from.as_ref()?.product;
    let not_kept = "how it was asked for was not kept when it was made";
    let why = match &manifest.computed {
        None if source.accumulated().ok().as_ref() == Some(&manifest.product) => return None,
        None => not_kept,
        Some(computed) if computed.follows() => return None,
        Some(computed) => match &computed.map {
            None => not_kept,
            Some(map) if map.once => return None,
            Some(_) => "its region has too many corners to be kept with it",
        },
    };
    let product = &manifest.product;
    Some(format!(
        "{product} stays as it is when {source} has a newer version: {why}; `fluxglobe derive statistic` makes it anew"
    ))
}

#[cfg(test)]
mod tests {
    use contract::analysis::{MapOptions, MapStatistic};

    use super::*;

    #[test]
    fn what_lands_on_one_grid_is_read_together() {
        let recipe = |statistic, region: &str, crop| {
            Recipe::Statistic(Box::new(StatisticRequest {
                target: "target".parse().unwrap(),
                product: "sst".parse().unwrap(),
                options: MapOptions {
                    region: Some(region.parse().unwrap()),
                    crop,
                    ..MapOptions::new(statistic)
                },
            }))
        };
        let own = recipe(MapStatistic::Mean, "0,0,9,9", true);
        assert!(own.goes_with(&recipe(MapStatistic::Max, "0,0,9,9", true)));
        assert!(!own.goes_with(&recipe(MapStatistic::Max, "0,0,9,9", false)));
        assert!(!own.goes_with(&recipe(MapStatistic::Max, "0,0,9,8", true)));
    }
}
