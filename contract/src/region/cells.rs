//! How cells on the coast count in a sum over a region.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ContractError;

/// How much of a cell with data counts.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Cells {
    /// All of it that lies in the region, its land too: as climatologies on coarse grids are integrated.
    #[default]
    Whole,
    /// The sea in it.
    OceanShare,
}

impl Cells {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::Whole, Self::OceanShare];

    /// As people write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Whole => "whole",
            Self::OceanShare => "ocean-share",
        }
    }

    /// What it means, for an answer.
    pub fn title(self) -> &'static str {
        match self {
            Self::Whole => "cells with data count whole, land on the coast too",
            Self::OceanShare => "cells with data count by their share of sea",
        }
    }
}

impl std::fmt::Display for Cells {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for Cells {
    type Err = ContractError;

    fn from_str(s: &str) -> Result<Self, Self::Err> {
        Self::ALL
            .into_iter()
            .find(|cells| cells.name() == s)
            .ok_or_else(|| ContractError::invalid("cells", s, "use whole or ocean-share"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_they_are_written() {
        for cells in Cells::ALL {
            assert_eq!(cells.to_string().parse::<Cells>().unwrap(), cells);
            let json = serde_json::to_string(&cells).unwrap();
            assert_eq!(json, format!("\"{cells}\""));
        }
        assert!("half".parse::<Cells>().is_err());
    }
}
