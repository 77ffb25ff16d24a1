//! What a file says and the indexes that are asked for in, the same without the dimensions of these out, and parts of its variables
//! as the reader of the file knows them.

use std::borrow::Cow;
use std::collections::BTreeMap;

use contract::event::RejectReason;
use contract::index::DimensionIndex;

use super::file::description::{Description, Dimension, Part};
use crate::error::Rejection;

/// The indexes that are read of variables, by their names: one for each of all their dimensions, none of those that stay.
#[derive(Debug, Default)]
pub(crate) struct Indexed(BTreeMap<String, Vec<Option<u64>>>);

impl Indexed {
    /// What a file says, without the dimensions of which one index is read.
    ///
    /// # Errors
    /// There is no such dimension, or no such index.
    pub(crate) fn of(
        mut description: Description,
        indexes: &[DimensionIndex],
    ) -> Result<(Description, Self), Rejection> {
        for one in indexes {
            let all = description.variables.iter().flat_map(|v| &v.dimensions);
            let own = all.filter(|own| own.name.as_ref() == Some(&one.dimension));
            check(one, own.map(|own| own.len), "a variable")?;
        }
        let mut all = BTreeMap::new();
        for variable in &mut description.variables {
            let dimensions = variable.dimensions.iter();
            let read: Vec<Option<u64>> = dimensions
                .map(|dimension| index(indexes, &variable.name, dimension))
                .collect();
            if read.iter().any(Option::is_some) {
                let mut each = read.iter();
                variable
                    .dimensions
                    .retain(|_| each.next().is_some_and(Option::is_none));
                all.insert(variable.name.clone(), read);
            }
        }
        Ok((description, Self(all)))
    }

    /// A part along the dimensions that a variable is described with, as one along all that it has.
    pub(crate) fn part<'a>(&self, variable: &str, part: &'a [Part]) -> Cow<'a, [Part]> {
        let Some(read) = self.0.get(variable) else {
            return Cow::Borrowed(part);
        };
        let mut described = part.iter().copied();
        let all = read.iter().filter_map(|index| match index {
            Some(index) => Some(Part::At(*index)),
            None => described.next(),
        });
        Cow::Owned(all.collect())
    }
}

/// The index that is read of a dimension of a variable; none of one that is its own coordinate, or not named.
fn index(indexes: &[DimensionIndex], variable: &str, dimension: &Dimension) -> Option<u64> {
    let name = dimension.name.as_deref().filter(|name| *name != variable)?;
    let one = indexes.iter().find(|one| one.dimension == name)?;
    Some(one.index)
}

/// Is there such an index?
///
/// - `lens`: how long the dimension is, wherever it is one
/// - `of`: what has dimensions, for people
pub(crate) fn check(
    asked: &DimensionIndex,
    lens: impl Iterator<Item = u64>,
    of: &str,
) -> Result<(), Rejection> {
    let detail = match lens.min() {
        None => format!("is no dimension of {of}"),
        Some(len) if asked.index >= len => {
            format!("has the indexes 0 to {}", len.saturating_sub(1))
        }
        Some(_) => return Ok(()),
    };
    Err(Rejection::new(RejectReason::Grid, &asked.dimension, detail))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::file::description::{Attributes, Kind, Variable};

    fn variable(name: &str, dimensions: &[(&str, u64)]) -> Variable {
        let dimension = |(name, len): &(&str, u64)| Dimension {
            name: Some((*name).to_owned()),
            len: *len,
        };
        Variable {
            name: name.to_owned(),
            dimensions: dimensions.iter().map(dimension).collect(),
            kind: Kind::Float(4),
            attributes: Attributes::default(),
        }
    }

    fn file() -> Description {
        Description {
            variables: vec![
                variable("depth", &[("depth", 3)]),
                variable("depth_bnds", &[("depth", 3), ("two", 2)]),
                variable(
                    "thetao",
                    &[("time", 5), ("depth", 3), ("lat", 4), ("lon", 8)],
                ),
                variable("zos", &[("time", 5), ("lat", 4), ("lon", 8)]),
            ],
            ..Description::default()
        }
    }

    fn indexed(asked: &str) -> Result<(Description, Indexed), Rejection> {
        Indexed::of(file(), &[asked.parse().unwrap()])
    }

    #[test]
    fn a_dimension_of_which_one_index_is_read_is_put_back_where_it_was() {
        let (described, indexed) = indexed("depth=2").unwrap();
        let rank = |name: &str| described.variable(name).unwrap().dimensions.len();
        // A coordinate keeps its labels.
        assert_eq!(["depth", "thetao", "zos"].map(rank), [1, 3, 3]);
        let map = [Part::At(4), Part::Some { first: 1, count: 2 }, Part::All];
        let [time, rows, cols] = map;
        assert_eq!(
            *indexed.part("thetao", &map),
            [time, Part::At(2), rows, cols]
        );
        assert_eq!(*indexed.part("zos", &map), map);
        assert_eq!(*indexed.part("depth", &[Part::All]), [Part::All]);
    }

    #[test]
    fn an_index_that_is_not_there_is_refused() {
        let said = |asked| indexed(asked).unwrap_err().to_string();
        assert!(said("depth=3").contains("has the indexes 0 to 2"));
        assert!(said("member=0").contains("is no dimension of a variable"));
    }
}
