//! A region as somebody asks for it: its shape, and what answers call it.

use super::{NamedRegion, Region};
use crate::ContractError;
use crate::geometry_text;
use crate::grid::rounded_deg;

/// A region and its name in answers.
#[derive(Debug, Clone, PartialEq)]
pub struct AskedRegion {
    /// Its shape.
    pub region: Region,
    /// Its name, `west,south,east,north`, or the text or file that it was asked for with; of a long text its digest.
    pub name: String,
}

impl std::str::FromStr for AskedRegion {
    type Err = ContractError;

    /// Parses what [`Region`] does.
    fn from_str(s: &str) -> Result<Self, Self::Err> {
        if let Some(named) = NamedRegion::find(s) {
            let (region, name) = (named.region(), named.name.to_owned());
            return Ok(Self { region, name });
        }
        let region: Region = s.parse()?;
        let name = match region {
            Region::Box {
                west,
                south,
                east,
                north,
            } => [west, south, east, north]
                .map(|edge| rounded_deg(edge).to_string())
                .join(","),
            _ => geometry_text::name(s),
        };
        Ok(Self { region, name })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_called_by_its_edges_and_all_else_as_it_is_written() {
        for (asked, name) in [
            ("14n-50n", "14n-50n"),
            ("14N-50N", "14n-50n"),
            ("Global", "global"),
            ("global", "global"),
            ("170,-10,-170,10", "170,-10,190,10"),
            ("POLYGON((0 0,1 0,0 1,0 0))", "POLYGON((0 0,1 0,0 1,0 0))"),
        ] {
            let own: AskedRegion = asked.parse().unwrap();
            assert_eq!(own.name, name);
            assert_eq!(own.region, asked.parse().unwrap());
        }
        assert!("atlantis".parse::<AskedRegion>().is_err());
    }
}
