//! Steps of the inputs that belong together: periods matched, grids compared, and a refusal that says what to write.

use contract::computed::{Computation, Matching};
use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{Manifest, Step};
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};

use crate::expression::computed_with;
use crate::summed::holds_codes;
use crate::{ComputeError, shared_grid};

/// An input as it is read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Input {
    pub(super) name: String,
    pub(super) manifest: Manifest,
    pub(super) matching: Matching,
}

/// A step of the result and what it is made of.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Matched {
    pub(super) period: Period,
    /// A field an input, in their order.
    pub(super) fields: Vec<ObjectKey>,
    /// Files of the first input that is matched by period, for people.
    pub(super) origin: String,
}

/// Steps that all inputs have, and how many those matched by period lack.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Matches {
    pub(super) steps: Vec<Matched>,
    /// Steps of some input that another one has nothing for.
    pub(super) left_out: usize,
}

fn refused(reason: String) -> ComputeError {
    ComputeError::Expression { reason }
}

/// The grid that all inputs share.
///
/// # Errors
/// They do not: which do not, and how to bring one to the grid of the other.
pub(super) fn shared_grid(inputs: &[Input]) -> Result<Grid, ComputeError> {
    let [first, rest @ ..] = inputs else {
        return Err(refused("it names no product".to_owned()));
    };
    for other in rest {
        shared_grid::check(&first.manifest, &other.manifest)?;
    }
    Ok(first.manifest.grid)
}

/// Partial pressure and fugacity of CO2 are both in Pa and differ by 0.4 %, a tenth of what lies between water and air: they
/// enter one expression through a conversion only, and never under the name of the other.
///
/// # Errors
/// They are mixed: which, and what brings one to the other.
pub(super) fn pressures_of_a_kind(inputs: &[Input], how: &Computation) -> Result<(), ComputeError> {
    let Computation::Expression { expression } = how else {
        return Ok(());
    };
    let of = |quantity: Quantity| {
        let mut named = inputs.iter().map(|it| (&it.name, it.manifest.quantity));
        named
            .find(|(_, own)| *own == quantity)
            .map(|(name, _)| name)
    };
    for (quantity, wrong) in [(Quantity::Pco2, "fco2"), (Quantity::Fco2, "pco2")] {
        if let Some(name) = of(quantity).filter(|name| name.starts_with(wrong)) {
            let right = name.replacen(wrong, quantity.word(), 1);
            return Err(refused(format!(
                "{name} holds {}: give it as {right} (derive co2-flux: --{}), and water and air as pressures or as fugacities both",
                quantity.title(),
                right.replace('_', "-")
            )));
        }
    }
    let is_converted = ["fco2_of_pco2", "pco2_of_fco2"]
        .iter()
        .any(|conversion| expression.contains(conversion));
    match (of(Quantity::Pco2), of(Quantity::Fco2)) {
        (Some(pco2), Some(fco2)) if !is_converted => Err(refused(format!(
            "{pco2} is a partial pressure and {fco2} a fugacity: bring one to the other by \
             fco2_of_pco2_weiss1974(pco2, temperature, pressure) or pco2_of_fco2_weiss1974"
        ))),
        _ => Ok(()),
    }
}

/// Codes are compared, and no value of theirs goes into that of a result: twice a code is the code of something else, and whatever comes out
/// no longer says that no mean is to be taken of it.
///
/// # Errors
/// One does: of which product, and how a code is compared.
pub(super) fn codes_are_compared(inputs: &[Input], how: &Computation) -> Result<(), ComputeError> {
    let Computation::Expression { expression } = how else {
        return Ok(());
    };
    let names: Vec<&str> = inputs.iter().map(|input| input.name.as_str()).collect();
    let computed_with = computed_with(expression, &names);
    let of_codes = |input: &&Input| holds_codes(&input.manifest);
    let mut of_codes = inputs.iter().filter(of_codes);
    let Some(input) = of_codes.find(|input| computed_with.contains(&input.name)) else {
        return Ok(());
    };
    let code = input.manifest.quantity.flags().first();
    Err(refused(format!(
        "{} holds codes, and what is computed with them is the code of something else or of nothing: compare them, as in \
         CASE WHEN \"{}\" = {} THEN 1 ELSE 0 END",
        input.manifest.product,
        input.name,
        code.map_or(1, |code| code.value),
    )))
}

/// Names of the CO₂ flux (`derive co2-flux`) say what a product is of: water or air, the skin or what lies below. Where products say it as
/// well, by quantity or standard name, they are not taken for each other.
///
/// # Errors
/// One is given in the place of the other: which.
pub(super) fn places_of_a_kind(inputs: &[Input]) -> Result<(), ComputeError> {
    let of = |name: &str| inputs.iter().find(|it| it.name == name);
    let is = |name: &str, what: Quantity| of(name).is_some_and(|it| it.manifest.quantity == what);
    let is_flux = ["pco2_water", "fco2_water"]
        .iter()
        .any(|name| of(name).is_some());
    if !is_flux {
        return Ok(());
    }
    for (name, elsewhere, place) in [
        ("pco2_water", "_in_air", "air"),
        ("fco2_water", "_in_air", "air"),
        ("pco2_air", "_in_sea_water", "sea water"),
        ("fco2_air", "_in_sea_water", "sea water"),
    ] {
        let wrong = of(name).filter(|it| it.manifest.quantity.word().ends_with(elsewhere));
        if let Some(wrong) = wrong {
            let product = &wrong.manifest.product;
            return Err(refused(format!(
                "{product} is given as {name} and is of {place} ({}): water and air are given the other way round",
                wrong.manifest.quantity.title()
            )));
        }
    }
    let Some(below) = of("below") else {
        return Ok(());
    };
    if is("below", Quantity::SeaSurfaceSkinTemperature) {
        let product = &below.manifest.product;
        return Err(refused(format!(
            "{product} is given as the temperature below the skin and is that of the skin itself: give it as --temperature"
        )));
    }
    let deep = Quantity::SeaSurfaceFoundationTemperature;
    let skin = of("temperature").filter(|it| it.manifest.quantity == deep);
    match skin {
        Some(skin) => Err(refused(format!(
            "{} is given as the temperature of the skin, beside one below it, and is {}: give it as --below",
            skin.manifest.product,
            skin.manifest.quantity.title()
        ))),
        None => Ok(()),
    }
}

/// Steps of the result, inside a window, in the order of time.
///
/// # Errors
/// No input gives the periods, or there is no period that all have.
pub(super) fn steps(
    inputs: &[Input],
    window: (Option<TimeMs>, Option<TimeMs>),
) -> Result<Matches, ComputeError> {
    let by_period = |input: &&Input| input.matching == Matching::SamePeriod;
    let Some(lead) = inputs.iter().find(by_period) else {
        let reason = "one input must say which periods the result has: leave containing, climatology and any-time away from it";
        return Err(refused(reason.to_owned()));
    };
    inputs.iter().try_for_each(fits_its_matching)?;
    let (_window, inside) = lead.manifest.steps_inside(window.0, window.1)?;
    let mut found = vec![];
    for step in &inside {
        let fields: Option<Vec<ObjectKey>> = inputs
            .iter()
            .map(|input| field_of(input, step.period))
            .collect();
        if let Some(fields) = fields {
            found.push(Matched {
                period: step.period,
                fields,
                origin: step.origin.clone(),
            });
        }
    }
    if found.is_empty() {
        return Err(refused(format!(
            "there is no period that all inputs have: {}; \
             an input whose steps hold in shorter ones is marked containing, one of one year that holds in every year \
             climatology, one that holds always any-time",
            inputs
                .iter()
                .map(extent_in_words)
                .collect::<Vec<_>>()
                .join(", ")
        )));
    }
    Ok(Matches {
        left_out: inside.len() - found.len(),
        steps: found,
    })
}

fn extent_in_words(input: &Input) -> String {
    let (name, steps) = (&input.name, &input.manifest.steps);
    match (steps.first(), input.manifest.extent()) {
        (Some(first), Some(extent)) => format!(
            "{name} has {} from {} to {}, the first of {:.0} days",
            steps.len(),
            extent.start,
            extent.end,
            first.period.seconds() / 86_400.0
        ),
        _ => format!("{name} has none"),
    }
}

/// A climatology is twelve months of one year, and what holds at any time one step.
fn fits_its_matching(input: &Input) -> Result<(), ComputeError> {
    let (name, steps) = (&input.name, &input.manifest.steps);
    match input.matching {
        Matching::SamePeriod | Matching::Containing => Ok(()),
        Matching::AnyTime if steps.len() == 1 => Ok(()),
        Matching::AnyTime => Err(refused(format!(
            "{name} has {} steps; any-time takes a product of one",
            steps.len()
        ))),
        Matching::MonthOfYear => {
            let months: Vec<_> = steps.iter().filter_map(month_of).collect();
            let is_year = months.len() == 12
                && steps.len() == 12
                && months
                    .iter()
                    .zip(1..)
                    .all(|(&(year, month), n)| (year, month) == (months[0].0, n));
            if is_year {
                Ok(())
            } else {
                Err(refused(format!(
                    "{name} is no climatology: that is January to December of one year, twelve steps of a month"
                )))
            }
        }
    }
}

/// Year and month of a step that is a calendar month.
fn month_of(step: &Step) -> Option<(i32, u32)> {
    let (year, month) = step.period.start.year_month();
    (Period::month(year, month) == Ok(step.period)).then_some((year, month))
}

/// Does one period hold all of another?
fn holds(one: Period, other: Period) -> bool {
    one.start <= other.start && other.end <= one.end
}

/// The field of an input that belongs to a period.
fn field_of(input: &Input, period: Period) -> Option<ObjectKey> {
    let steps = &input.manifest.steps;
    let step = match input.matching {
        Matching::SamePeriod => &steps[input.manifest.step_of(period)?],
        Matching::Containing => {
            let after = steps.partition_point(|step| step.period.start <= period.start);
            let step = &steps[after.checked_sub(1)?];
            holds(step.period, period).then_some(step)?
        }
        Matching::AnyTime => steps.first()?,
        Matching::MonthOfYear => {
            let (year, month) = period.start.year_month();
            let is_inside = Period::month(year, month).is_ok_and(|own| holds(own, period));
            steps.get(month as usize - 1).filter(|_| is_inside)?
        }
    };
    Some(step.field.clone())
}

/// The name of what a step is made of: the computation and the content of every field.
pub(super) fn made_of(computation: Digest, step: &Matched) -> Digest {
    Digest::of_json(&("computed", computation, step.period, &step.fields))
}

#[cfg(test)]
mod tests;
