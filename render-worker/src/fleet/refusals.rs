//! What workers that brought no picture said, and what that means together.

use std::time::Duration;

use super::FleetError;
use super::member::Refusal;

/// Workers that may fail at a picture before it is the picture's fault.
const MOST_FAILURES: usize = 2;

/// Why no worker has drawn so far.
#[derive(Default)]
pub(super) struct Refusals {
    busy: Option<Duration>,
    elsewhere: Option<String>,
    failures: Vec<String>,
}

impl Refusals {
    /// Notes a refusal; an error if asking on is no use.
    pub(super) fn add(&mut self, refusal: Refusal) -> Result<(), FleetError> {
        match refusal {
            Refusal::Final(error) => return Err(error),
            Refusal::Busy(wait) => {
                self.busy = Some(self.busy.map_or(wait, |shortest| shortest.min(wait)));
            }
            Refusal::Elsewhere(text) => self.elsewhere = Some(text),
            Refusal::Failed(text) => {
                self.failures.push(text);
                if self.failures.len() >= MOST_FAILURES {
                    return Err(self.verdict());
                }
            }
        }
        Ok(())
    }

    /// What to say after the last one. A full worker comes first: it draws the picture if asked again.
    pub(super) fn verdict(&mut self) -> FleetError {
        match (self.busy, self.failures.pop(), self.elsewhere.take()) {
            (_, Some(text), _) => FleetError::Failed(text),
            (Some(retry_after), None, _) => FleetError::Busy { retry_after },
            (None, None, Some(text)) => FleetError::Unavailable(text),
            (None, None, None) => FleetError::Unavailable("no render worker is known".to_owned()),
        }
    }
}

impl Refusal {
    pub(super) fn label(&self) -> &'static str {
        match self {
            Self::Final(_) => "refused",
            Self::Busy(_) => "busy",
            Self::Elsewhere(_) => "elsewhere",
            Self::Failed(_) => "failed",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_worker_counts_more_than_a_lost_one_and_a_failure_more_than_both() {
        let mut refusals = Refusals::default();
        assert!(matches!(refusals.verdict(), FleetError::Unavailable(_)));
        let away = |text: &str| Refusal::Elsewhere(text.to_owned());
        refusals.add(away("lost")).unwrap();
        assert_eq!(
            refusals.verdict(),
            FleetError::Unavailable("lost".to_owned())
        );
        for wait_ms in [900, 300, 600] {
            let wait = Duration::from_millis(wait_ms);
            refusals.add(Refusal::Busy(wait)).unwrap();
        }
        let retry_after = Duration::from_millis(300);
        assert_eq!(refusals.verdict(), FleetError::Busy { retry_after });
        refusals.add(Refusal::Failed("once".to_owned())).unwrap();
        let twice = refusals.add(Refusal::Failed("twice".to_owned()));
        assert_eq!(twice, Err(FleetError::Failed("twice".to_owned())));
        let last = Refusal::Final(FleetError::NotFound("no such".to_owned()));
        assert!(refusals.add(last).is_err());
    }
}
