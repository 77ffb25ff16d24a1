//! Which variable is landed, as which product and quantity.

use contract::event::RejectReason;
use contract::product::ProductId;
use contract::quantity::Quantity;

use super::Target;
use crate::error::Rejection;
use crate::inspect::file::description::{Description, Variable};
use crate::plan::cf::coordinate::{self, Role};
use crate::plan::cf::packing::Packing;
use crate::plan::cf::projection;
use crate::plan::cf::quantity::{Named, directions, has_direction, of_standard_name};
use crate::plan::profile::Profile;
use crate::plan::unit::Substance;

/// Longest title and citation taken from a file, characters.
const MAX_TITLE_CHARS: usize = 200;

/// The variable to land and what it means.
pub(super) fn choose<'a>(
    file: &'a Description,
    profile: Option<&Profile>,
) -> Result<(&'a Variable, Named), Rejection> {
    let Some(profile) = profile else {
        let (variable, named) = choose_by_standard_name(file)?;
        let sign = sign(variable, named.quantity, None)?;
        return Ok((variable, Named { sign, ..named }));
    };
    let name = &profile.variable.name;
    let missing = || {
        let detail = format!(
            "is not in the file, which holds {}; give the profile that fits",
            listed(file.variables.iter())
        );
        Rejection::new(RejectReason::NoVariable, name, detail)
    };
    let variable = file
        .variable(name)
        .filter(|v| v.is_numeric())
        .ok_or_else(missing)?;
    let by_name = variable
        .attributes
        .text("standard_name")
        .and_then(of_standard_name);
    // The stored unit of a carbon flux is a mass of carbon, and a profile that states a mass means that, unless the
    // standard name says of what it is.
    let stated = profile.variable.unit.as_ref().map(|_| Substance::Carbon);
    let substance = by_name.and_then(|n| n.substance).or(stated);
    Ok((
        variable,
        Named {
            quantity: profile.quantity,
            sign: sign(
                variable,
                profile.quantity,
                profile.variable.positive_into_sea,
            )?,
            substance,
        },
    ))
}

/// What turns values to be positive out of the sea, or upwards: what the profile says and the file does not deny, else
/// what the file says. A flux of which nobody says it is refused.
fn sign(
    variable: &Variable,
    quantity: Quantity,
    positive_into_sea: Option<bool>,
) -> Result<f64, Rejection> {
    if !has_direction(quantity) {
        return Ok(1.0);
    }
    let text = |name: &str| variable.attributes.text(name).unwrap_or_default();
    let said = directions(text("standard_name"), text("positive"));
    let refused =
        |detail: String| Err(Rejection::new(RejectReason::Values, &variable.name, detail));
    let stated = positive_into_sea.map(|into| if into { -1.0 } else { 1.0 });
    let against = said
        .iter()
        .find(|(_, sign)| stated.is_some_and(|stated: f64| stated * sign < 0.0));
    if let (Some((attribute, _)), Some(into)) = (against, positive_into_sea) {
        return refused(format!(
            "has {attribute} {:?}, and its profile says positive_into_sea = {into}: they contradict each other; correct the profile, or the file if it is wrong",
            text(attribute)
        ));
    }
    match (stated, said.as_slice()) {
        (Some(stated), _) => Ok(stated),
        (None, [(_, first), (_, second)]) if first * second < 0.0 => refused(format!(
            "has standard_name {:?} and positive = {:?}, which contradict each other; correct the file",
            text("standard_name"),
            text("positive")
        )),
        (None, [(_, sign), ..]) => Ok(*sign),
        (None, []) if quantity == Quantity::CarbonFlux => refused(
            "is a flux, and nothing says which way it is positive: no upward or downward in a standard_name; say positive_into_sea = true or false in the profile".to_owned(),
        ),
        (None, []) => Ok(1.0),
    }
}

fn choose_by_standard_name(file: &Description) -> Result<(&Variable, Named), Rejection> {
    let is_data = |v: &&Variable| {
        v.is_numeric() && coordinate::role_of(v) == Role::Other && v.dimensions.len() >= 2
    };
    let data: Vec<&Variable> = file.variables.iter().filter(is_data).collect();
    let named = |v: &&'_ Variable| {
        v.attributes
            .text("standard_name")
            .and_then(of_standard_name)
    };
    let found: Vec<_> = data
        .iter()
        .filter_map(|v| named(v).map(|n| (*v, n)))
        .collect();
    let candidate = found.first().map(|(v, _)| *v).or(data.first().copied());
    // That a file is on another projection or a swath matters before what its variables are called.
    if let Some(candidate) = candidate {
        projection::check(file, candidate)?;
    }
    if let Some(first) = candidate.filter(|first| is_swath(file, first)) {
        return Err(coordinate::no_grid(file, first));
    }
    let refused = |detail: String| Err(Rejection::new(RejectReason::NoVariable, "file", detail));
    match found.as_slice() {
        [only] => Ok(*only),
        [] if data.is_empty() => {
            refused("holds no gridded variable; give a file with one".to_owned())
        }
        [] => refused(format!(
            "has no variable whose standard_name is one that is stored (it holds {}); say in a profile which one to land",
            listed(data.into_iter())
        )),
        several => refused(format!(
            "has several variables that could be landed ({}); say in a profile which one",
            listed(several.iter().map(|(v, _)| *v))
        )),
    }
}

/// Has the variable no latitude axis, and the file a latitude or longitude of two dimensions?
fn is_swath(file: &Description, variable: &Variable) -> bool {
    let on_axes = coordinate::axes(file, variable)
        .iter()
        .any(|a| a.role == Role::Latitude);
    let is_plane = |v: &&Variable| v.dimensions.len() >= 2;
    let mut planes = file
        .variables
        .iter()
        .filter(is_plane)
        .map(coordinate::role_of);
    !on_axes && planes.any(|role| matches!(role, Role::Latitude | Role::Longitude))
}

fn listed<'a>(variables: impl Iterator<Item = &'a Variable>) -> String {
    const SHOWN: usize = 8;
    let names: Vec<&str> = variables.map(|v| v.name.as_str()).collect();
    let more = if names.len() > SHOWN { ", ..." } else { "" };
    format!("{}{more}", names[..names.len().min(SHOWN)].join(", "))
}

/// What the variable becomes.
pub(super) fn target(
    file: &Description,
    variable: &Variable,
    profile: Option<&Profile>,
    quantity: Quantity,
    product: Option<&ProductId>,
) -> Result<Target, Rejection> {
    let marked = file.attributes.0.contains_key("synthetic")
        && file.attributes.number("synthetic") != Some(0.0);
    if let Some(profile) = profile {
        return Ok(Target {
            product: product.unwrap_or(&profile.product).clone(),
            title: profile.title.clone(),
            source: profile.source.clone(),
            quantity,
            synthetic: profile.synthetic || marked,
        });
    }
    let cut = |text: &str| {
        text.chars()
            .take(MAX_TITLE_CHARS)
            .map(|c| if c.is_control() { ' ' } else { c })
            .collect::<String>()
    };
    let text = |name: &str| {
        file.attributes
            .text(name)
            .filter(|t| !t.is_empty())
            .map(cut)
    };
    let title = text("title").or_else(|| variable.attributes.text("long_name").map(cut));
    let source = ["references", "source", "institution"]
        .into_iter()
        .find_map(text);
    let unnamed = || {
        Rejection::new(
            RejectReason::NoVariable,
            &variable.name,
            "gives no name for a product; state one",
        )
    };
    Ok(Target {
        product: product
            .cloned()
            .or_else(|| product_name(&variable.name))
            .ok_or_else(unnamed)?,
        title: title.unwrap_or_else(|| quantity.title().to_owned()),
        source: source.unwrap_or_else(|| "source not stated in the file".to_owned()),
        quantity,
        synthetic: marked,
    })
}

/// A product name from a variable name: `CO2_flux` becomes `co2-flux`.
fn product_name(variable: &str) -> Option<ProductId> {
    let plain: String = variable
        .to_ascii_lowercase()
        .chars()
        .map(|c| if c.is_ascii_alphanumeric() { c } else { '-' })
        .collect();
    let plain = plain
        .trim_start_matches(|c: char| !c.is_ascii_lowercase())
        .trim_end_matches('-');
    plain.chars().take(64).collect::<String>().parse().ok()
}

/// The packing of the file, with what the profile overrides.
pub(super) fn packing(
    variable: &Variable,
    profile: Option<&Profile>,
) -> Result<Packing, Rejection> {
    let mut packing = Packing::of(variable);
    if let Some(rules) = profile.map(|p| &p.variable) {
        packing.fills.extend(rules.fill_values.iter().flatten());
        packing.scale = rules.scale_factor.unwrap_or(packing.scale);
        packing.offset = rules.add_offset.unwrap_or(packing.offset);
        if let Some([low, high]) = rules.valid_range {
            packing = packing.with_valid_values(low, high);
        }
    }
    if !packing.scale.is_finite() || packing.scale == 0.0 || !packing.offset.is_finite() {
        let (scale, offset) = (packing.scale, packing.offset);
        let detail = format!(
            "has scale_factor {scale} and add_offset {offset}, which cannot be; state them in a profile"
        );
        return Err(Rejection::new(RejectReason::Values, &variable.name, detail));
    }
    Ok(packing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn variable_names_become_product_names() {
        let name = |v: &str| product_name(v).map(|p| p.to_string());
        assert_eq!(name("CO2_flux").as_deref(), Some("co2-flux"));
        assert_eq!(name("../2m temp!").as_deref(), Some("m-temp"));
        assert_eq!(name("___"), None);
        assert_eq!(name(&"x".repeat(300)).map(|n| n.len()), Some(64));
    }
}
