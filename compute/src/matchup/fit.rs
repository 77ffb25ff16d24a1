//! Which observations are fit to be held against a product.

use contract::observation::{Observation, Quality};
use serde::{Deserialize, Serialize};

use super::LeftOut;

/// Deepest observation that is held against a product of the surface, m: where the depths of mixed layers are counted from (de Boyer
/// Montégut et al. 2004, doi:10.1029/2004JC002378).
const SURFACE_M: f64 = 10.0;

/// What an observation must be to count.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Fit {
    /// The worst quality that counts.
    pub worst: Quality,
    /// The greatest depth that counts, m below the surface.
    pub deepest_m: f64,
}

impl Default for Fit {
    /// Those that failed no test, in the upper 10 m and above the sea.
    fn default() -> Self {
        Self {
            worst: Quality::NotEvaluated,
            deepest_m: SURFACE_M,
        }
    }
}

impl Fit {
    /// Is an observation fit? One that is not is counted by the first reason that applies.
    pub fn takes(&self, observation: &Observation, left_out: &mut LeftOut) -> bool {
        if observation.quality > self.worst {
            left_out.quality += 1;
            return false;
        }
        if observation.depth_m > self.deepest_m {
            left_out.depth += 1;
            return false;
        }
        true
    }
}

/// `at most 10 m deep and of quality not_evaluated or better`.
impl std::fmt::Display for Fit {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (deepest_m, worst) = (self.deepest_m, self.worst);
        write!(f, "at most {deepest_m} m deep and of quality {worst}")?;
        match worst {
            Quality::Good => Ok(()),
            _ => f.write_str(" or better"),
        }
    }
}
