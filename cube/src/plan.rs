//! Steps that are there and steps that were put in, where each of the next state comes from out. Pure.

use contract::time::{Period, TimeMs};

use crate::staged::AllStaged;
use crate::{CubeError, Step};

/// Where each step of the next state comes from.
pub(crate) struct Plan {
    pub(crate) steps: Vec<Step>,
    /// For each step of the next state its place in the state before.
    pub(crate) old_places: Vec<Option<usize>>,
    /// Places of steps with staged values.
    pub(crate) staged: Vec<(usize, TimeMs)>,
}

impl Plan {
    /// Lays steps that were put over those that are there.
    pub(crate) fn put(before: &[Step], staged: &AllStaged) -> Result<Self, CubeError> {
        let mut all: Vec<(Step, Option<usize>, bool)> = before
            .iter()
            .enumerate()
            .map(|(place, step)| (*step, Some(place), false))
            .collect();
        for staged in staged.values() {
            let step = staged.step;
            match before.binary_search_by_key(&step.period.start, |it| it.period.start) {
                Ok(place) if before[place].period == step.period => {
                    if before[place] != step {
                        all[place] = (step, Some(place), true);
                    }
                }
                _ => all.push((step, None, true)),
            }
        }
        all.sort_by_key(|(step, _, _)| step.period);
        for pair in all.windows(2) {
            let (one, next) = (pair[0].0.period, pair[1].0.period);
            if one.overlaps(next) {
                let is_new = pair[1].2;
                let (step, there) = if is_new { (next, one) } else { (one, next) };
                return Err(CubeError::Overlap { step, there });
            }
        }
        let staged = all
            .iter()
            .enumerate()
            .filter(|(_, (_, _, is_staged))| *is_staged)
            .map(|(place, (step, _, _))| (place, step.period.start))
            .collect();
        Ok(Self {
            old_places: all.iter().map(|(_, old, _)| *old).collect(),
            steps: all.into_iter().map(|(step, _, _)| step).collect(),
            staged,
        })
    }

    /// Exactly these steps, from those that are there and those that were put.
    ///
    /// # Errors
    /// The periods of those that are neither.
    pub(crate) fn exactly(
        wanted: &[Step],
        before: &[Step],
        staged: &AllStaged,
    ) -> Result<Self, Vec<Period>> {
        let (mut old_places, mut put, mut missing) = (vec![], vec![], vec![]);
        for (place, step) in wanted.iter().enumerate() {
            let start = step.period.start;
            let old = before.binary_search_by_key(&start, |it| it.period.start);
            let old = old.ok().filter(|old| before[*old] == *step);
            if old.is_none() {
                match staged.get(&start) {
                    Some(staged) if staged.step == *step => put.push((place, start)),
                    _ => missing.push(step.period),
                }
            }
            old_places.push(old);
        }
        if !missing.is_empty() {
            return Err(missing);
        }
        Ok(Self {
            steps: wanted.to_vec(),
            old_places,
            staged: put,
        })
    }

    /// The first step that differs from the state before, or the first that is gone; none if nothing is other than it was.
    pub(crate) fn first_change(&self, before: &[Step]) -> Option<usize> {
        let differs =
            |(place, step): (usize, &Step)| (before.get(place) != Some(step)).then_some(place);
        let is_shorter = self.steps.len() < before.len();
        let changed = self.steps.iter().enumerate().find_map(differs);
        changed.or(is_shorter.then_some(self.steps.len()))
    }

    /// Steps that lie elsewhere now: their places, and those before.
    pub(crate) fn moves(&self) -> impl Iterator<Item = (usize, usize)> {
        let places = self.old_places.iter().enumerate();
        places.filter_map(|(new, old)| old.filter(|old| *old != new).map(|old| (new, old)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parts::SentStep;
    use crate::staged::Staged;
    use contract::digest::Digest;

    fn step(month: u32, values: &str) -> Step {
        Step {
            period: Period::month(2000, month).unwrap(),
            values_sha256: Digest::of(values.as_bytes()),
        }
    }

    fn plan(before: &[Step], put: &[Step]) -> Result<Plan, CubeError> {
        let staged = put.iter().map(|step| {
            let staged = Staged {
                step: *step,
                sent: SentStep {
                    objects: vec![],
                    range: [0.0; 2],
                },
            };
            (step.period.start, staged)
        });
        Plan::put(before, &staged.collect())
    }

    #[test]
    fn steps_are_laid_in_the_order_of_time() {
        let before = [step(1, "a"), step(4, "d")];
        let plan = plan(&before, &[step(6, "f"), step(2, "b"), step(4, "new")]).unwrap();
        assert_eq!(
            plan.steps,
            [step(1, "a"), step(2, "b"), step(4, "new"), step(6, "f")]
        );
        assert_eq!(plan.old_places, [Some(0), None, Some(1), None]);
        assert_eq!(plan.first_change(&before), Some(1));
        assert_eq!(plan.moves().collect::<Vec<_>>(), [(2, 1)]);
        let places: Vec<usize> = plan.staged.iter().map(|(place, _)| *place).collect();
        assert_eq!(places, [1, 2, 3]);
    }

    #[test]
    fn what_is_there_already_is_no_change_and_an_append_moves_nothing() {
        let before = [step(1, "a"), step(2, "b")];
        assert_eq!(
            plan(&before, &[step(2, "b")])
                .unwrap()
                .first_change(&before),
            None
        );
        let appended = plan(&before, &[step(3, "c")]).unwrap();
        assert_eq!(appended.first_change(&before), Some(2));
        assert_eq!(appended.moves().count(), 0);
    }

    #[test]
    fn a_period_that_another_step_covers_in_part_is_refused_with_both() {
        let before = [step(1, "a")];
        let mut half = step(1, "x");
        half.period =
            Period::new("2000-01-16".parse().unwrap(), "2000-02-16".parse().unwrap()).unwrap();
        let Err(CubeError::Overlap { step, there }) = plan(&before, &[half]) else {
            panic!("it was taken");
        };
        assert_eq!((step, there), (half.period, before[0].period));
    }

    #[test]
    fn a_version_has_the_steps_it_names_and_no_others() {
        let before = [step(1, "a"), step(2, "b"), step(3, "c")];
        let wanted = [step(1, "a"), step(3, "c")];
        let Ok(dropped) = Plan::exactly(&wanted, &before, &AllStaged::new()) else {
            panic!("all are there");
        };
        assert_eq!(dropped.first_change(&before), Some(1));
        assert_eq!(dropped.moves().collect::<Vec<_>>(), [(1, 2)]);
        let last = Plan::exactly(&before[..2], &before, &AllStaged::new());
        assert_eq!(last.ok().and_then(|it| it.first_change(&before)), Some(2));
        let revised = [step(1, "a"), step(2, "new"), step(4, "d")];
        let missing = Plan::exactly(&revised, &before, &AllStaged::new()).err();
        assert_eq!(missing, Some(vec![revised[1].period, revised[2].period]));
    }
}
