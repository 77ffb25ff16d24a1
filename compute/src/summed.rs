//! What may be summed over area and time, a flux of carbon and no extreme of one; and what may be averaged, no codes, and no directions and
//! days of a year, which go round.

use std::collections::BTreeSet;

use contract::ContractError;
use contract::analysis::MapStatistic;
use contract::computed::{Computation, ComputedInput, Matching, Regridding};
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::statistics::Percentile;
use storage::manifests::OverTime;
use storage::{Store, manifests};

use crate::ComputeError;
use crate::expression::computed_with;

/// Why directions have no means and no extremes.
pub(crate) const GO_ROUND: &str = "directions, which go round: the mean of 350 and 10 degrees would be 180, and none of them is the lowest or the highest";
/// What has, in their place.
pub(crate) const PARTS: &str = "land the eastward and the northward part of what they are of";

/// Has a product budgets, and is carbon accumulated of it?
///
/// # Errors
/// A version that it was made of and that cannot be read.
pub async fn has_budget(store: &Store, manifest: &Manifest) -> Result<bool, ComputeError> {
    if manifest.quantity != Quantity::CarbonFlux {
        return Ok(false);
    }
    match check_summed(store, manifest).await {
        Ok(()) => Ok(true),
        Err(ComputeError::NotSummed { .. }) => Ok(false),
        Err(error) => Err(error),
    }
}

/// # Errors
/// `NotSummed` of the highest or lowest values or a percentile of each cell, of these on another grid or averaged, and of what an expression
/// computes with any of them: cells of which each has its value from another time were never there together.
pub(crate) async fn check_summed(store: &Store, manifest: &Manifest) -> Result<(), ComputeError> {
    let mut seen = BTreeSet::from([manifest.product.clone()]);
    let mut behind: Option<Behind> = None;
    let mut left = vec![];
    loop {
        let own = behind.as_ref().map_or(manifest, |behind| &behind.manifest);
        let is_computed_with = behind
            .as_ref()
            .is_some_and(|behind| behind.is_computed_with);
        let over_time = manifests::over_time(store, own).await?;
        if let Some(OverTime { statistic, of }) = over_time.filter(OverTime::is_extreme) {
            let what = in_words(statistic);
            return Err(ComputeError::NotSummed {
                product: manifest.product.clone(),
                what: if is_computed_with {
                    format!("result of an expression over the {what}")
                } else {
                    what
                },
                of,
            });
        }
        for input in passed_on(own) {
            let found = manifests::of_kind(store, &input.manifest).await?;
            let found = found.filter(|found| seen.insert(found.product.clone()));
            left.extend(found.map(|manifest| Behind {
                is_computed_with: is_computed_with || is_expression(own),
                manifest,
            }));
        }
        behind = left.pop();
        if behind.is_none() {
            return Ok(());
        }
    }
}

/// A version whose values went into those of another.
struct Behind {
    manifest: Manifest,
    /// Does an expression lie between them?
    is_computed_with: bool,
}

fn is_expression(manifest: &Manifest) -> bool {
    let how = manifest.computed.as_ref().map(|computed| &computed.how);
    matches!(how, Some(Computation::Expression { .. }))
}

/// Inputs whose values are those of a version still, or make them.
fn passed_on(manifest: &Manifest) -> Vec<&ComputedInput> {
    let Some(computed) = &manifest.computed else {
        return vec![];
    };
    let inputs = computed.inputs.iter();
    match &computed.how {
        Computation::Expression { expression } => {
            let names: Vec<&str> = inputs.clone().map(|input| input.name.as_str()).collect();
            let names = computed_with(expression, &names);
            // Extremes have one step: what is of several steps, and of the same ones, is of none.
            let may_be_one = |input: &&ComputedInput| {
                manifest.steps.len() == 1 || input.matching != Matching::SamePeriod
            };
            let own = inputs.filter(|input| names.contains(&input.name));
            own.filter(may_be_one).collect()
        }
        Computation::Regrid { .. }
        | Computation::Statistic {
            statistic: MapStatistic::Mean | MapStatistic::Climatology,
            ..
        } => inputs.collect(),
        Computation::Statistic { .. } | Computation::Correlation { .. } => vec![],
    }
}

/// # Errors
/// Of the phase of the year's wave, on whichever grid and wherever it comes from: 31 December and 1 January are next to each other, and the mean of their numbers lies
/// in July. And of what [`check_averaged_in_a_cell`] refuses.
pub(crate) fn check_averaged(manifest: &Manifest) -> Result<(), ComputeError> {
    check_averaged_in_a_cell(manifest)?;
    if !manifest.quantity.is_day_of_year() {
        return Ok(());
    }
    let reason = "it holds days of the year, which go round: the mean of 1 January and 31 December is no day in July; ask for single places";
    let refused = ContractError::invalid("product", manifest.product.as_str(), reason);
    Err(refused.into())
}

/// The same over time alone.
///
/// # Errors
/// Of codes, whose mean is the code of something else or of nothing, and of directions, which have neither mean nor extremes.
pub(crate) fn check_averaged_in_a_cell(manifest: &Manifest) -> Result<(), ComputeError> {
    if manifest.quantity.is_direction() {
        let reason = format!("it holds {GO_ROUND}: ask for single places and steps, or {PARTS}");
        return Err(ContractError::invalid("product", manifest.product.as_str(), reason).into());
    }
    let Some(code) = manifest.quantity.flags().first() else {
        return Ok(());
    };
    let product = manifest.product.as_str();
    let reason = format!(
        "it holds codes, and the mean of two is the code of something else: ask for single places and steps, for the region {product}:{code} of another \
         product, or for the share of a code, which fluxglobe derive --expr \"CASE WHEN code = {code} THEN 1 ELSE 0 END\" makes",
        code = code.value,
    );
    Err(ContractError::invalid("product", product, reason).into())
}

/// # Errors
/// Of what no mean is to be taken, unless each cell has the value of one: codes of a mask, whose mean is another code, directions, and what
/// [`check_averaged`] refuses.
pub(crate) fn check_regridded(manifest: &Manifest, method: Regridding) -> Result<(), ComputeError> {
    match method {
        Regridding::Nearest => Ok(()),
        Regridding::Bilinear | Regridding::Conservative if holds_codes(manifest) => {
            let reason = format!(
                "{} holds codes, and the mean of two is the code of something else: bring it to another grid with --method {}",
                manifest.product,
                Regridding::Nearest,
            );
            Err(ComputeError::Expression { reason })
        }
        Regridding::Bilinear | Regridding::Conservative if manifest.quantity.is_direction() => {
            let reason = format!(
                "{} holds {GO_ROUND}: bring it to another grid with --method {}, or {PARTS}",
                manifest.product,
                Regridding::Nearest,
            );
            Err(ComputeError::Expression { reason })
        }
        Regridding::Bilinear | Regridding::Conservative => check_averaged(manifest),
    }
}

/// The method that brings a product to another grid with all that it holds: by means, or where there are none by single cells.
pub(crate) fn usual_regridding(manifest: &Manifest) -> Regridding {
    let quantity = manifest.quantity;
    if holds_codes(manifest) || quantity.is_day_of_year() || quantity.is_direction() {
        Regridding::Nearest
    } else {
        Regridding::Conservative
    }
}

/// Are its values those of a mask whose file says what they mean?
pub(crate) fn holds_codes(manifest: &Manifest) -> bool {
    !manifest.quantity.flags().is_empty()
}

fn in_words(statistic: MapStatistic) -> String {
    match statistic {
        MapStatistic::Min => "lowest values".to_owned(),
        MapStatistic::Max => "highest values".to_owned(),
        MapStatistic::Percentile(Percentile::MEDIAN) => "medians".to_owned(),
        other => format!("percentiles ({other})"),
    }
}

#[cfg(test)]
mod tests {
    use contract::computed::Computed;
    use contract::grid::Grid;
    use contract::manifest::MANIFEST_SCHEMA;
    use contract::quantity::{Flag, OpenQuantity, OpenWords};

    use super::*;

    /// A product that landed from a file: nothing but its quantity says what it is.
    fn landed(quantity: Quantity) -> Manifest {
        Manifest {
            schema: MANIFEST_SCHEMA,
            product: "p".parse().unwrap(),
            number: 1,
            title: "P".to_owned(),
            quantity,
            synthetic: true,
            source: "made by a test".to_owned(),
            grid: Grid {
                rows: 2,
                cols: 4,
                north_deg: 90.0,
                west_deg: -180.0,
                dlat_deg: 90.0,
                dlon_deg: 90.0,
            },
            steps: vec![],
            domain: "domain/p/d".parse().unwrap(),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
        }
    }

    fn computed(quantity: Quantity, how: Computation) -> Manifest {
        let computed = Computed {
            how,
            inputs: vec![],
            from: None,
            to: None,
            map: None,
        };
        Manifest {
            computed: Some(computed),
            ..landed(quantity)
        }
    }

    fn in_days(name: &str) -> Quantity {
        Quantity::open(name, "day", "A day").unwrap()
    }

    fn direction() -> Quantity {
        Quantity::open("wind_from_direction", "degree", "Wind direction").unwrap()
    }

    fn mask() -> Quantity {
        let Quantity::Open(plain) = Quantity::open("basin", "1", "Basin").unwrap() else {
            panic!("a basin is built in");
        };
        let flag = Flag {
            value: 5,
            meaning: "southern".to_owned(),
        };
        let words = OpenWords {
            flags: vec![flag],
            ..plain.words().clone()
        };
        Quantity::Open(OpenQuantity::new(words).unwrap())
    }

    #[test]
    fn what_has_no_means_is_brought_to_another_grid_by_single_cells_wherever_it_comes_from() {
        let phase = || in_days("sea_surface_temperature_annual_phase");
        let regridded = Computation::Regrid {
            method: Regridding::Nearest,
            min_coverage: 0.5,
        };
        let single = [
            landed(phase()),
            computed(phase(), regridded),
            landed(mask()),
            landed(direction()),
        ];
        for manifest in single {
            let usual = usual_regridding(&manifest);
            assert_eq!(usual, Regridding::Nearest, "{:?}", manifest.quantity);
            check_regridded(&manifest, usual).unwrap();
            for method in [Regridding::Bilinear, Regridding::Conservative] {
                let refused = check_regridded(&manifest, method);
                assert!(refused.is_err(), "{method} {:?}", manifest.quantity);
            }
        }
        for quantity in [Quantity::CarbonFlux, in_days("first_day_of_ice")] {
            let manifest = landed(quantity);
            assert_eq!(usual_regridding(&manifest), Regridding::Conservative);
            check_regridded(&manifest, Regridding::Conservative).unwrap();
        }
    }

    #[test]
    fn days_of_the_year_have_no_mean() {
        let phase = landed(in_days("sea_surface_temperature_annual_phase"));
        let refused = check_averaged(&phase).unwrap_err().to_string();
        assert!(refused.contains("which go round"), "{refused}");
        check_averaged(&landed(in_days("first_day_of_ice"))).unwrap();
        check_averaged_in_a_cell(&phase).unwrap();
    }

    #[test]
    fn directions_have_no_mean_over_an_area_or_over_time() {
        let wind = landed(direction());
        for refused in [check_averaged(&wind), check_averaged_in_a_cell(&wind)] {
            let refused = refused.unwrap_err().to_string();
            assert!(refused.contains("350 and 10 degrees"), "{refused}");
        }
        let zenith = Quantity::open("solar_zenith_angle", "degree", "Zenith angle").unwrap();
        check_averaged(&landed(zenith)).unwrap();
    }

    #[test]
    fn codes_have_no_mean_over_an_area_or_over_time() {
        let mask = landed(mask());
        for refused in [check_averaged(&mask), check_averaged_in_a_cell(&mask)] {
            let refused = refused.unwrap_err().to_string();
            assert!(refused.contains("the region p:5"), "{refused}");
            assert!(refused.contains("CASE WHEN code = 5"), "{refused}");
        }
        check_averaged(&landed(Quantity::CarbonFlux)).unwrap();
    }
}
