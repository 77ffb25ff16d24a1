//! Which variable is landed, as which product and quantity.

use contract::event::RejectReason;
use contract::product::ProductId;
use contract::quantity::Quantity;

use super::{Planning, Target, Wish, written};
use crate::error::Rejection;
use crate::inspect::file::description::{Description, Variable};
use crate::plan::cf::main_variable::{self, listed};
use crate::plan::cf::packing::{self, Packing};
use crate::plan::cf::quantity::{Named, directions, has_direction, of_standard_name};
use crate::plan::cf::{carbon_flux, open};
use crate::plan::profile::{Profile, Profiles};
use crate::plan::unit::Substance;

/// Longest title and citation taken from a file, characters.
const MAX_TITLE_CHARS: usize = 200;

/// The variable to land, what it means, and what is taken for granted with that. Where there is none, groups of the file are told:
/// it may lie in one.
pub(super) fn choose<'a>(
    file: &'a Description,
    wish: Wish<'_>,
) -> Result<(&'a Variable, Named, Option<String>), Rejection> {
    chosen(file, wish).map_err(|refused| match file.told_groups() {
        Some(groups) if refused.reason == RejectReason::NoVariable => {
            let more = format!(
                "variables in its groups ({groups}) are not read; take them out (ncks -G : IN OUT)"
            );
            let more = Rejection::new(refused.reason, &refused.object, more);
            let detail = format!("{}; {}", refused.detail, more.detail);
            Rejection { detail, ..refused }
        }
        _ => refused,
    })
}

fn chosen<'a>(
    file: &'a Description,
    wish: Wish<'_>,
) -> Result<(&'a Variable, Named, Option<String>), Rejection> {
    if let (Some(meaning), Some(name)) = (wish.meaning, wish.variable) {
        return Ok((main_variable::asked(file, name)?, meaning, None));
    }
    let Some(profile) = wish.profile else {
        return choose_by_file(file, wish.variable);
    };
    let (variable, named) = choose_by_profile(file, profile)?;
    Ok((variable, named, None))
}

/// Is the variable that is asked for the one that the profile of the file reads? Landing another one in its place would tell
/// nobody.
pub(super) fn read_by(found: &Profile, asked: &str, all: &Profiles) -> Result<(), Rejection> {
    let (name, reads) = (&found.name, &found.variable.name);
    if asked == reads {
        return Ok(());
    }
    let others = all.iter().filter(|other| other.variable.name == asked);
    let others: Vec<&str> = others.map(|other| other.name.as_str()).collect();
    let advice = if others.is_empty() {
        "give a profile of your own for it".to_owned()
    } else {
        format!("one by this name is read by {}", others.join(", "))
    };
    let detail = format!(
        "is not what is read of this file: the profile {name} is for it, and reads {reads}; say --profile in the place of --variable: {advice}"
    );
    Err(Rejection::new(RejectReason::NoVariable, asked, detail))
}

/// Without a profile: the variable that is asked for, or else the one that the file is about, as its standard name or, if
/// that is none of ours, this program's own export or the variable's own words say.
fn choose_by_file<'a>(
    file: &'a Description,
    asked: Option<&str>,
) -> Result<(&'a Variable, Named, Option<String>), Rejection> {
    let (variable, assumption) = match asked {
        Some(name) => (main_variable::asked(file, name)?, None),
        None => main_variable::of(file)?,
    };
    let standard_name = variable.attributes.text("standard_name");
    let by_name = standard_name.and_then(of_standard_name);
    if by_name.is_none()
        && let Some(named) = written::of_file(file, variable)
    {
        return Ok((variable, named, assumption));
    }
    let is_statistic = written::note(file, variable).is_some();
    let by_words = || carbon_flux::told(variable)?.ok().filter(|_| !is_statistic);
    let named = match by_name.or_else(by_words) {
        Some(named) => named,
        None => Named {
            quantity: open::quantity(variable)?,
            sign: 1.0,
            substance: None,
        },
    };
    let sign = sign(variable, named.quantity, None)?;
    Ok((variable, Named { sign, ..named }, assumption))
}

fn choose_by_profile<'a>(
    file: &'a Description,
    profile: &Profile,
) -> Result<(&'a Variable, Named), Rejection> {
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

/// What the variable becomes. Files of one variable make one product, but for what holds at any time: of that each file is
/// one of its own, called as the file is.
pub(super) fn target(
    planning: &Planning<'_>,
    variable: &Variable,
    wish: Wish<'_>,
    quantity: Quantity,
) -> Result<Target, Rejection> {
    let file = planning.file;
    let Wish {
        profile, product, ..
    } = wish;
    let marked = file.attributes.0.contains_key("synthetic")
        && file.attributes.number("synthetic") != Some(0.0)
        || written::is_file_synthetic(file);
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
            .or_else(|| {
                let stem = planning.file_name.split('.').next();
                let stem = stem.filter(|_| planning.holds_always);
                stem.and_then(product_name)
            })
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
pub(crate) fn packing(
    variable: &Variable,
    profile: Option<&Profile>,
) -> Result<Packing, Rejection> {
    let mut packing = Packing::of(variable);
    if let Some(rules) = profile.map(|p| &p.variable) {
        if let Some(fills) = &rules.fill_values {
            let fills = fills.iter();
            packing =
                packing.with_fills(fills.map(|fill| packing::as_stored(variable.kind, *fill)));
        }
        packing.scale = rules.scale_factor.unwrap_or(packing.scale);
        packing.offset = rules.add_offset.unwrap_or(packing.offset);
        if let Some([low, high]) = rules.valid_range {
            packing = packing.with_valid_values(low, high);
        }
    }
    packing.checked(variable)
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
