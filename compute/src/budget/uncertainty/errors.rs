//! Standard errors of the flux in every cell of a step: stated for all, or read from a product.

use std::sync::Arc;

use contract::budget::{BudgetErrors, StatedError};
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::quantity::CARBON_KG_PER_MOL;
use contract::time::Period;
use storage::{Store, fields};

use crate::ComputeError;
use crate::expression::unit::{Scaled, Unit};
use crate::region::shares::{are_same_cells, grid_text};

/// Where standard errors come from.
#[derive(Debug)]
pub(super) enum Source<'a> {
    /// Share of the size of the flux, 1.
    Relative(f64),
    /// The same everywhere, kg m⁻² s⁻¹.
    Absolute(f64),
    Product(Stored<'a>),
}

/// Errors of a product.
#[derive(Debug)]
pub(super) struct Stored<'a> {
    manifest: &'a Manifest,
    /// Makes kg m⁻² s⁻¹ of a stored value.
    factor: f64,
    /// The field that was read last: one map may hold for all steps.
    last: Option<(ObjectKey, Arc<Vec<f32>>)>,
}

/// Standard errors of one step.
#[derive(Debug, Clone)]
pub(super) enum Errors {
    Relative(f64),
    Absolute(f64),
    /// `[row, col]`, and what makes kg m⁻² s⁻¹ of them.
    Cells(Arc<Vec<f32>>, f64),
}

impl Errors {
    /// The error of a cell with a flux, kg m⁻² s⁻¹, NaN where nothing says it. A share of the flux has its sign: what is wrong with
    /// a factor makes sources and sinks larger together.
    pub(super) fn of(&self, cell: usize, flux_kg_m2_s: f64) -> f64 {
        match self {
            Self::Relative(share) => share * flux_kg_m2_s,
            Self::Absolute(error) => *error,
            Self::Cells(values, factor) => factor * f64::from(values[cell]),
        }
    }
}

impl<'a> Source<'a> {
    /// That of the errors that are asked for, for a version of a flux.
    ///
    /// # Errors
    /// `Uncertainty` for a unit that is none of a flux of carbon, or another grid.
    pub(super) fn of(errors: &'a BudgetErrors, flux: &Manifest) -> Result<Self, ComputeError> {
        match (&errors.stated, &errors.of_product) {
            (StatedError::Relative { percent }, _) => Ok(Self::Relative(percent / 100.0)),
            (StatedError::Absolute { value, unit }, _) => {
                let factor = factor_of(unit).ok_or_else(|| refused(unit, NO_FLUX))?;
                Ok(Self::Absolute(value * factor))
            }
            (StatedError::Product(_), Some(manifest)) => stored(manifest, flux).map(Self::Product),
            (StatedError::Product(product), None) => Err(ComputeError::inconsistent(
                product.as_str(),
                "no version of the errors was looked up",
            )),
        }
    }

    /// The errors of a step.
    ///
    /// # Errors
    /// `Uncertainty` where the product has no map for it, or one with values below 0.
    pub(super) async fn read(
        &mut self,
        store: &Store,
        period: Period,
    ) -> Result<Errors, ComputeError> {
        match self {
            Self::Relative(share) => Ok(Errors::Relative(*share)),
            Self::Absolute(error) => Ok(Errors::Absolute(*error)),
            Self::Product(stored) => {
                let factor = stored.factor;
                Ok(Errors::Cells(stored.read(store, period).await?, factor))
            }
        }
    }
}

const NO_FLUX: &str = "it is no unit of a flux of carbon that is understood; write it such as g m-2 year-1, mol m-2 year-1, \
                       mmol m-2 d-1 or kg m-2 s-1";

fn refused(what: &str, reason: &str) -> ComputeError {
    ComputeError::Uncertainty {
        reason: format!("{what:?}: {reason}"),
    }
}

/// What makes kg m⁻² s⁻¹ of carbon of a number in a unit; a word `C` says that mass is of carbon, which it is anyway.
fn factor_of(unit: &str) -> Option<f64> {
    let words: Vec<&str> = unit
        .split_whitespace()
        .filter(|word| *word != "C")
        .collect();
    let scaled = Scaled::parse(&words.join(" ")).filter(|scaled| scaled.offset == 0.0)?;
    if Some(scaled.unit) == Unit::stored("kg m-2 s-1") {
        Some(scaled.factor)
    } else if Some(scaled.unit) == Unit::stored("mol m-2 s-1") {
        Some(scaled.factor * CARBON_KG_PER_MOL)
    } else {
        None
    }
}

fn stored<'a>(manifest: &'a Manifest, flux: &Manifest) -> Result<Stored<'a>, ComputeError> {
    let name = manifest.product.as_str();
    let unit = manifest.quantity.unit();
    let Some(factor) = factor_of(unit) else {
        let reason = format!(
            "its unit {unit:?} is none of a flux of carbon, as standard errors of one have"
        );
        return Err(refused(name, &reason));
    };
    if !are_same_cells(&manifest.grid, &flux.grid) {
        let reason = format!(
            "its grid is {}, that of {} is {}; bring it there first: fluxglobe derive regrid",
            grid_text(&manifest.grid),
            flux.product,
            grid_text(&flux.grid)
        );
        return Err(refused(name, &reason));
    }
    Ok(Stored {
        manifest,
        factor,
        last: None,
    })
}

impl Stored<'_> {
    /// The map of exactly a period, or the only one there is.
    fn step(&self, period: Period) -> Result<&Step, ComputeError> {
        let steps = &self.manifest.steps;
        let own = self.manifest.step_of(period).and_then(|at| steps.get(at));
        let only = || Some(steps).filter(|steps| steps.len() == 1)?.first();
        own.or_else(only).ok_or_else(|| {
            let reason = format!(
                "it has no step of exactly {period}, as the flux has, and is no single map"
            );
            refused(self.manifest.product.as_str(), &reason)
        })
    }

    async fn read(&mut self, store: &Store, period: Period) -> Result<Arc<Vec<f32>>, ComputeError> {
        let key = self.step(period)?.field.clone();
        if let Some((_, values)) = self.last.as_ref().filter(|(last, _)| *last == key) {
            return Ok(Arc::clone(values));
        }
        let values = Arc::new(fields::read(store, &key, &self.manifest.grid).await?);
        let below = values.iter().filter(|value| **value < 0.0).count();
        if below > 0 {
            let reason = format!("{below} cells of {key} are below 0, which no standard error is");
            return Err(refused(self.manifest.product.as_str(), &reason));
        }
        self.last = Some((key, Arc::clone(&values)));
        Ok(values)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_a_flux_of_carbon_have_their_factors() {
        let year_s = 365.25 * 86_400.0;
        for (unit, factor) in [
            ("kg m-2 s-1", 1.0),
            ("g C m-2 year-1", 1e-3 / year_s),
            ("mol m-2 yr-1", 0.012_011 / year_s),
            ("mmol m-2 d-1", 0.012_011e-3 / 86_400.0),
        ] {
            let own = factor_of(unit).unwrap();
            assert!((own / factor - 1.0).abs() < 1e-14, "{unit}: {own}");
        }
        for unit in ["g", "K", "µatm", "g CO2 m-2 year-1", "kg s-1", "furlong"] {
            assert_eq!(factor_of(unit), None, "{unit}");
        }
    }
}
