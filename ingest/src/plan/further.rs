//! The indexes that are asked for of further dimensions in, refused where they are none of these, and told with what they stand for, out.

use contract::event::RejectReason;
use contract::index::DimensionIndex;

use super::Planning;
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::{Description, Variable};
use crate::plan::cf::coordinate::{self, Role};

/// Refuses an index of what is an axis of the map: a row of it is no map.
pub(super) fn check(file: &Description, indexes: &[DimensionIndex]) -> Result<(), Rejection> {
    for DimensionIndex { dimension, .. } in indexes {
        match role_of(file, dimension) {
            Role::Latitude => return Err(refused(dimension, "latitudes")),
            Role::Longitude => return Err(refused(dimension, "longitudes")),
            Role::Time | Role::Other => {}
        }
    }
    Ok(())
}

/// Refuses an index of the only time of a variable: a map without its time would be taken for one of another.
pub(super) fn check_time(
    file: &Description,
    variable: &Variable,
    indexes: &[DimensionIndex],
) -> Result<(), Rejection> {
    let axes = coordinate::axes(file, variable);
    let mut names = indexes.iter().map(|one| &one.dimension);
    match names.find(|name| role_of(file, name) == Role::Time) {
        Some(name) if axes.iter().all(|axis| axis.role != Role::Time) => {
            Err(refused(name, "times"))
        }
        Some(_) | None => Ok(()),
    }
}

fn refused(dimension: &str, what: &str) -> Rejection {
    let detail = format!(
        "holds the {what}, all of which are read; give an index of a further dimension, such as a depth or a member"
    );
    Rejection::new(RejectReason::Grid, dimension, detail)
}

/// What a dimension is, by its coordinate, or else by its name.
fn role_of(file: &Description, dimension: &str) -> Role {
    let coordinate = file.variable(dimension).filter(|own| own.is_coordinate());
    match coordinate {
        Some(coordinate) => coordinate::role_of(coordinate),
        None if dimension.eq_ignore_ascii_case("time") => Role::Time,
        None => Role::Other,
    }
}

/// Notes which index is read of what, with its label where there is one.
pub(super) async fn tell(
    planning: &mut Planning<'_>,
    variable: &Variable,
    indexes: &[DimensionIndex],
) -> Result<(), Stop> {
    for one in indexes {
        let label = label(planning, one).await?;
        let label = label.map_or_else(String::new, |label| format!(", which is {label}"));
        planning.assume(format!(
            "{}: is read at index {} of {}{label}",
            variable.name, one.index, one.dimension
        ));
    }
    Ok(())
}

/// The number and the unit that an index stands for; none where nothing says it.
async fn label(planning: &mut Planning<'_>, one: &DimensionIndex) -> Result<Option<String>, Stop> {
    let own = planning.file.variable(&one.dimension);
    let Some(own) = own.filter(|own| own.is_coordinate() && own.is_numeric()) else {
        return Ok(None);
    };
    let labels = match planning.coordinate(&own.name).await {
        Ok(labels) => labels,
        // What cannot be read of it does not shape the map.
        Err(Stop::Rejected(_)) => return Ok(None),
        Err(failed @ Stop::Failed(_)) => return Err(failed),
    };
    let number = usize::try_from(one.index)
        .ok()
        .and_then(|index| labels.get(index))
        .filter(|number| number.is_finite());
    let units = own.attributes.text("units").unwrap_or_default();
    // Its digits are those of single precision, in which most files hold it.
    Ok(number.map(|number| format!("{} {units}", *number as f32).trim_end().to_owned()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{AttributeValue, Attributes, Dimension, Kind};

    /// `units`: none, if empty.
    fn variable(name: &str, dimensions: &[&str], units: &str) -> Variable {
        let dimension = |name: &&str| Dimension {
            name: Some((*name).to_owned()),
            len: 2,
        };
        let units = (!units.is_empty()).then(|| {
            let text = AttributeValue::Text(units.to_owned());
            ("units".to_owned(), text)
        });
        Variable {
            name: name.to_owned(),
            dimensions: dimensions.iter().map(dimension).collect(),
            kind: Kind::Float(8),
            attributes: units.into_iter().collect::<Attributes>(),
        }
    }

    #[test]
    fn an_index_of_the_map_or_of_the_only_time_is_refused() {
        let since = "days since 2001-01-01";
        let file = Description {
            variables: vec![
                variable("lat", &["lat"], ""),
                variable("lon", &["lon"], ""),
                variable("depth", &["depth"], "m"),
                variable("valid", &["valid"], since),
                variable("begun", &["begun"], since),
            ],
            ..Description::default()
        };
        let said = |asked: &str, dimensions: &[&str]| {
            let own = variable("v", dimensions, "");
            let asked = [asked.parse().unwrap()];
            let checked = check(&file, &asked).and_then(|()| check_time(&file, &own, &asked));
            checked.err().map(|refused| refused.to_string())
        };
        for (asked, word) in [
            ("lat=0", "latitudes"),
            ("lon=0", "longitudes"),
            ("time=1", "times"),
            ("begun=1", "times"),
        ] {
            let said = said(asked, &["lat", "lon"]);
            assert!(said.unwrap().contains(word), "{asked}");
        }
        assert_eq!(said("depth=1", &["lat", "lon"]), None);
        // Of a forecast that was begun at several times one is read.
        assert_eq!(said("begun=1", &["valid", "lat", "lon"]), None);
    }
}
