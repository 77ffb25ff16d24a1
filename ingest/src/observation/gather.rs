//! Observations of one file as they are found, within the limits of the contract and of memory.

use contract::event::RejectReason;
use contract::grid::wrap_lon_deg;
use contract::observation::Observation;

use crate::rejection::Rejection;

/// Most observations of one file: about 300 MB.
pub(crate) const MAX_OBSERVATIONS: usize = 1 << 20;
/// Memory of one observation with its texts, bytes.
pub(crate) const OBSERVATION_BYTES: u64 = 300;

/// The observations of one file.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    found: Vec<Observation>,
    /// Those that break a limit of the contract: a place past a pole, say.
    broken: u64,
    /// What was wrong with the first of them.
    first_break: Option<String>,
}

impl Gathered {
    /// Takes an observation; one that breaks a limit is counted and left out.
    pub(super) fn take(&mut self, observation: Observation) -> Result<(), Rejection> {
        if self.found.len() >= MAX_OBSERVATIONS {
            let detail = format!(
                "holds more than {MAX_OBSERVATIONS} observations; give it in smaller pieces"
            );
            return Err(Rejection::new(RejectReason::TooLarge, "file", detail));
        }
        match observation.validate() {
            Ok(()) => self.found.push(Observation {
                lon_deg: wrap_lon_deg(observation.lon_deg),
                ..observation
            }),
            Err(error) => {
                self.broken += 1;
                self.first_break.get_or_insert_with(|| error.to_string());
            }
        }
        Ok(())
    }

    /// The observations; a file without any is refused, and `why` is the reason if none was found at all.
    pub(super) fn finish(self, why: Rejection) -> Result<Vec<Observation>, Rejection> {
        match self.first_break {
            Some(first) if self.found.is_empty() => {
                let detail = format!("holds no valid observation: {first}");
                Err(Rejection::new(RejectReason::Values, "file", detail))
            }
            Some(first) => {
                tracing::warn!(count = self.broken, first, "observations are left out");
                Ok(self.found)
            }
            None if self.found.is_empty() => Err(why),
            None => Ok(self.found),
        }
    }
}
