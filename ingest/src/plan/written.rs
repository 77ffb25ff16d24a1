//! What a cube or an export of this program says of its own values, beyond what the conventions have names for.

use contract::analysis::MapStatistic;
use contract::event::RejectReason;
use contract::quantity::Quantity;
use cube::Description;
use serde_json::{Map, Value};

use crate::error::Rejection;
use crate::inspect::file::description::{self, Variable};
use crate::plan::cf::quantity::{Named, directions, has_direction};
use crate::plan::unit::Substance;

/// What it is of, if it was written by this program and this variable holds values of the quantity: means of them are such, the highest ones
/// of a flux are none.
pub(crate) fn description(attributes: &Map<String, Value>, variable: &str) -> Option<Description> {
    read(attributes, variable).filter(is_of_values)
}

/// In the stored unit, positive as everything stored is.
pub(crate) fn meaning(own: &Description) -> Named {
    let is_carbon = own.quantity == Quantity::CarbonFlux;
    Named {
        quantity: own.quantity,
        sign: 1.0,
        substance: is_carbon.then_some(Substance::Carbon),
    }
}

/// What a variable of a file means that `fluxglobe export` wrote. What was changed in such a file since says so by `units` and
/// `positive`, as in any other.
pub(crate) fn of_file(file: &description::Description, variable: &Variable) -> Option<Named> {
    let own = exported(file, variable).filter(is_of_values)?;
    let positive = variable.attributes.text("positive").unwrap_or_default();
    let said = directions("", positive);
    let sign = said.first().filter(|_| has_direction(own.quantity));
    Some(Named {
        sign: sign.map_or(1.0, |(_, sign)| *sign),
        ..meaning(&own)
    })
}

/// # Errors
/// A percentile over time of a quantity that is built in, under the standard name of that: conventions have no method for it in
/// `cell_methods`, which tell of other extremes.
pub(crate) fn check(
    file: &description::Description,
    variable: &Variable,
    quantity: Quantity,
) -> Result<(), Rejection> {
    let statistic = exported(file, variable).and_then(|own| own.statistic);
    let (false, Some(MapStatistic::Percentile(_))) =
        (matches!(quantity, Quantity::Open(_)), statistic)
    else {
        return Ok(());
    };
    let detail = format!(
        "holds a percentile over time (its file was exported as such) and would be taken for {} itself; land it by a profile that gives it a quantity of its own, or give means",
        quantity.title()
    );
    Err(Rejection::new(RejectReason::Values, &variable.name, detail))
}

/// What is told of an export whose values are not those of its quantity. Climatologies of quantities that are not built in, which have no
/// budget anyhow, are told by [`climatology`] alone.
pub(crate) fn note(file: &description::Description, variable: &Variable) -> Option<String> {
    let own = exported(file, variable).filter(|own| !is_of_values(own))?;
    let statistic = own.statistic?;
    let without = match own.quantity {
        Quantity::Open(_) if matches!(statistic, MapStatistic::Climatology) => return None,
        Quantity::Open(_) => "",
        _ => "; it has no budget",
    };
    Some(format!(
        "{}: holds the statistic {statistic} over time of {} and not that itself{without}",
        variable.name,
        own.quantity.title()
    ))
}

/// What is told of the cube or the export of a climatology: its periods are those of one year, its values are not.
pub(crate) fn climatology(file: &description::Description, variable: &Variable) -> Option<String> {
    let own = exported(file, variable)?;
    matches!(own.statistic, Some(MapStatistic::Climatology)).then(|| {
        format!(
            "{}: holds a climatology ({}); its steps are means over years and not those of the year that they lie in",
            variable.name, own.title
        )
    })
}

/// Does a cube or an export of this program say of its values, whatever they are, that they are made up?
pub(crate) fn is_synthetic(attributes: &Map<String, Value>) -> bool {
    Description::read(attributes, "").is_ok_and(|own| own.synthetic)
}

/// The same of a file.
pub(crate) fn is_file_synthetic(file: &description::Description) -> bool {
    said(file).is_some_and(|attributes| is_synthetic(&attributes))
}

fn read(attributes: &Map<String, Value>, variable: &str) -> Option<Description> {
    let own = Description::read(attributes, "").ok()?;
    (cube::cf::variable(own.quantity) == variable).then_some(own)
}

/// Trends and whatever else has a quantity of its own is of that; extremes and the like keep that of what they are of.
fn is_of_values(own: &Description) -> bool {
    use MapStatistic::{Climatology, Max, Min, Percentile};
    !matches!(own.statistic, Some(Min | Max | Percentile(_) | Climatology))
}

/// What an exported file, or a store, says of a variable.
fn exported(file: &description::Description, variable: &Variable) -> Option<Description> {
    read(&said(file)?, &variable.name)
}

/// The attribute of an exported file that holds it, as a cube has it.
fn said(file: &description::Description) -> Option<Map<String, Value>> {
    let text = file.attributes.text(Description::ATTRIBUTE)?;
    let said: Value = serde_json::from_str(text).ok()?;
    Some(Map::from_iter([(Description::ATTRIBUTE.to_owned(), said)]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{AttributeValue, Kind};
    use contract::grid::Grid;

    /// A file that an export of a flux could be, and its variable.
    fn file(
        statistic: Option<MapStatistic>,
        positive: &str,
    ) -> (description::Description, Variable) {
        let own = of_flux(statistic);
        let text = |name: &str, text: String| (name.to_owned(), AttributeValue::Text(text));
        let said = own.attributes()[Description::ATTRIBUTE].to_string();
        let variable = Variable {
            name: "carbon_flux".to_owned(),
            dimensions: vec![],
            kind: Kind::Float(4),
            attributes: [text("positive", positive.to_owned())]
                .into_iter()
                .collect(),
        };
        let file = description::Description {
            attributes: [text(Description::ATTRIBUTE, said)].into_iter().collect(),
            variables: vec![variable.clone()],
            ..description::Description::default()
        };
        (file, variable)
    }

    fn of_flux(statistic: Option<MapStatistic>) -> Description {
        Description {
            product: "p".parse().unwrap(),
            title: "P".to_owned(),
            quantity: Quantity::CarbonFlux,
            synthetic: false,
            source: "S".to_owned(),
            grid: Grid {
                rows: 2,
                cols: 3,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            version: None,
            statistic,
        }
    }

    #[test]
    fn what_is_made_up_says_so_whatever_is_made_of_it() {
        for statistic in [None, Some(MapStatistic::Max)] {
            for synthetic in [false, true] {
                let own = Description {
                    synthetic,
                    ..of_flux(statistic)
                };
                let attributes = own.attributes();
                assert_eq!(is_synthetic(&attributes), synthetic);
                let text = AttributeValue::Text(attributes[Description::ATTRIBUTE].to_string());
                let name = Description::ATTRIBUTE.to_owned();
                let file = description::Description {
                    attributes: [(name, text)].into_iter().collect(),
                    ..description::Description::default()
                };
                assert_eq!(is_file_synthetic(&file), synthetic);
            }
        }
        assert!(!is_file_synthetic(&description::Description::default()));
    }

    #[test]
    fn what_has_a_quantity_of_its_own_is_of_that_and_a_percentile_is_refused_as_another() {
        let trend = Quantity::open("sst_trend", "K year-1", "Trend").unwrap();
        let of = |quantity, statistic: &str| Description {
            quantity,
            ..of_flux(Some(statistic.parse().unwrap()))
        };
        let attributes = of(trend, "trend").attributes();
        let own = description(&attributes, "sst_trend").unwrap();
        assert_eq!(own.quantity, trend);
        let highest = of(trend, "max").attributes();
        assert!(description(&highest, "sst_trend").is_none());
        for (statistic, is_fine) in [("p90", false), ("mean", true), ("climatology", true)] {
            let (file, variable) = file(Some(statistic.parse().unwrap()), "up");
            let found = check(&file, &variable, Quantity::CarbonFlux);
            assert_eq!(found.is_ok(), is_fine, "{statistic}");
            assert!(check(&file, &variable, trend).is_ok(), "{statistic}");
        }
    }

    #[test]
    fn a_climatology_is_told_and_nothing_else_is() {
        for (statistic, is_told) in [("climatology", true), ("mean", false), ("max", false)] {
            let (file, mut variable) = file(Some(statistic.parse().unwrap()), "up");
            let told = climatology(&file, &variable);
            assert_eq!(told.is_some(), is_told, "{statistic}: {told:?}");
            variable.name = "another".to_owned();
            assert_eq!(climatology(&file, &variable), None, "{statistic}");
        }
        let (file, variable) = file(None, "up");
        assert_eq!(climatology(&file, &variable), None);
    }

    #[test]
    fn extremes_of_open_quantities_are_told_and_their_climatologies_once() {
        let open = Quantity::open("mixed_layer", "m", "Mixed layer").unwrap();
        for (statistic, is_told) in [
            ("max", true),
            ("p90", true),
            ("mean", false),
            ("climatology", false),
        ] {
            let own = Description {
                quantity: open,
                ..of_flux(Some(statistic.parse().unwrap()))
            };
            let text = AttributeValue::Text(own.attributes()[Description::ATTRIBUTE].to_string());
            let (mut file, mut variable) = file(None, "");
            file.attributes = [(Description::ATTRIBUTE.to_owned(), text)]
                .into_iter()
                .collect();
            variable.name = "mixed_layer".to_owned();
            let told = note(&file, &variable);
            assert_eq!(told.is_some(), is_told, "{statistic}: {told:?}");
            let told = told.unwrap_or_default();
            assert!(!told.contains("budget"), "{told}");
            let also = climatology(&file, &variable);
            assert_eq!(also.is_some(), statistic == "climatology", "{also:?}");
        }
    }

    #[test]
    fn an_export_is_what_it_was_and_an_extreme_of_it_is_not() {
        for statistic in [None, Some(MapStatistic::Mean)] {
            for (positive, sign) in [("up", 1.0), ("", 1.0), ("down", -1.0)] {
                let (file, variable) = file(statistic, positive);
                let named = of_file(&file, &variable).unwrap();
                let found = (named.quantity, named.substance);
                assert_eq!(found, (Quantity::CarbonFlux, Some(Substance::Carbon)));
                assert!((named.sign - sign).abs() < f64::EPSILON, "{positive}");
                assert_eq!(note(&file, &variable), None);
            }
        }
        let (file, mut variable) = file(Some(MapStatistic::Max), "up");
        assert_eq!(of_file(&file, &variable), None);
        // Nor is the cube of it that is attached.
        let text = file.attributes.text(Description::ATTRIBUTE).unwrap();
        let said: Value = serde_json::from_str(text).unwrap();
        let attributes = Map::from_iter([(Description::ATTRIBUTE.to_owned(), said)]);
        assert!(read(&attributes, "carbon_flux").is_some());
        assert!(description(&attributes, "carbon_flux").is_none());
        let told = note(&file, &variable).unwrap();
        assert!(told.contains("statistic max"), "{told}");
        variable.name = "another".to_owned();
        assert_eq!(note(&file, &variable), None);
    }
}
