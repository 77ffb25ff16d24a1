//! The versions that a derived one was made from, as its manifest says it; and which products are made of one.

use contract::computed::Computation;
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use storage::{Store, manifests};

use crate::ComputeError;

/// The version that something was accumulated or a statistic made from, both of what is of two; none of anything else.
pub(crate) fn made_from(manifest: &Manifest) -> Vec<&ManifestId> {
    if is_by_step(manifest) {
        vec![]
    } else {
        inputs(manifest)
    }
}

fn is_by_step(manifest: &Manifest) -> bool {
    let computed = manifest.computed.as_ref();
    computed.is_some_and(|computed| computed.how.is_by_step())
}

/// The versions that anything was made from.
pub(crate) fn inputs(manifest: &Manifest) -> Vec<&ManifestId> {
    match &manifest.computed {
        None => manifest.derived_from.iter().collect(),
        Some(computed) => computed.inputs.iter().map(|it| &it.manifest).collect(),
    }
}

/// Was one version made from newer versions than another of the same products, and from none that is older? Both step by step, or neither.
pub(crate) fn is_from_newer(latest: &Manifest, derived: &Manifest) -> bool {
    if is_by_step(latest) != is_by_step(derived) {
        return false;
    }
    let (theirs, own) = (inputs(latest), inputs(derived));
    let is_of_same = theirs.iter().map(|id| &id.product);
    let is_of_same = is_of_same.eq(own.iter().map(|id| &id.product));
    let numbers = || theirs.iter().zip(&own).map(|(a, b)| (a.number, b.number));
    is_of_same && numbers().all(|(a, b)| a >= b) && numbers().any(|(a, b)| a > b)
}

/// Products whose newest versions are made of a product cell by cell, on its grid.
///
/// # Errors
/// What reading them meets.
pub(crate) async fn made_of(
    store: &Store,
    product: &ProductId,
) -> Result<Vec<ProductId>, ComputeError> {
    let mut found = vec![];
    for other in manifests::products(store).await? {
        let latest = manifests::latest(store, &other).await?;
        // Statistics of one product follow it to another grid.
        let is_of_it = |latest: Manifest| {
            let computed = latest.computed.filter(|computed| {
                !matches!(computed.how, Computation::Statistic { .. }) && computed.follows()
            });
            computed.is_some_and(|computed| {
                let mut inputs = computed.inputs.iter();
                inputs.any(|input| input.manifest.product == *product)
            })
        };
        if latest.is_some_and(is_of_it) {
            found.push(other);
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use contract::analysis::CorrelationStatistic;
    use contract::computed::{Computation, Computed, ComputedInput, Matching};
    use contract::digest::Digest;
    use contract::grid::Grid;
    use contract::key::ObjectKey;
    use contract::manifest::MANIFEST_SCHEMA;
    use contract::quantity::Quantity;
    use contract::time::TimeStep;

    use super::*;

    /// Made from versions with these numbers.
    fn made(numbers: [u64; 2], how: Computation) -> Manifest {
        let product: contract::product::ProductId = "both".parse().unwrap();
        let input = |(name, number): (&str, u64)| ComputedInput {
            name: name.to_owned(),
            manifest: format!("{name}@{number}-00000000").parse().unwrap(),
            matching: Matching::SamePeriod,
        };
        let inputs = ["first", "second"].into_iter().zip(numbers).map(input);
        let inputs: Vec<ComputedInput> = inputs.collect();
        Manifest {
            schema: MANIFEST_SCHEMA,
            number: 1,
            title: String::new(),
            quantity: Quantity::WindSpeed,
            synthetic: false,
            source: String::new(),
            grid: Grid {
                rows: 1,
                cols: 1,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: vec![],
            domain: ObjectKey::domain(&product, &Digest::of(b"")),
            series: vec![],
            derived_from: Some(inputs[0].manifest.clone()),
            computed: Some(Computed {
                how,
                inputs,
                from: None,
                to: None,
                map: None,
            }),
            notices: vec![],
            indexes: vec![],
            product,
        }
    }

    #[test]
    fn what_is_of_two_is_newer_by_either_and_never_where_the_other_is_older() {
        let of = |numbers| {
            let how = Computation::Correlation {
                statistic: CorrelationStatistic::Pairs,
                lag_steps: 0,
                step: TimeStep::Month,
                deseasonalised: false,
                least_percent: 50,
            };
            made(numbers, how)
        };
        let own = of([2, 5]);
        assert_eq!(made_from(&own).len(), 2);
        for (numbers, is_newer) in [
            ([2, 5], false),
            ([3, 5], true),
            ([2, 6], true),
            ([3, 4], false),
            ([1, 6], false),
            ([1, 1], false),
        ] {
            assert_eq!(is_from_newer(&of(numbers), &own), is_newer, "{numbers:?}");
        }
        // What is made step by step is compared with its like alone.
        let by_step = |numbers| {
            let expression = "first + second".to_owned();
            made(numbers, Computation::Expression { expression })
        };
        let newer = by_step([9, 9]);
        assert!(made_from(&newer).is_empty() && !is_from_newer(&newer, &own));
        for (numbers, is_newer) in [([9, 8], true), ([9, 9], false), ([8, 10], false)] {
            assert_eq!(
                is_from_newer(&newer, &by_step(numbers)),
                is_newer,
                "{numbers:?}"
            );
        }
    }
}
