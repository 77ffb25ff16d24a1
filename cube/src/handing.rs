//! Values at hand on their way into a cube: each of their steps map-major, with its levels, and their runs time-major.

use std::collections::BTreeSet;
use std::sync::Arc;

use contract::digest::Digest;
use contract::kind::Vouched;
use contract::manifest::Manifest;
use contract::time::Period;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};

use crate::at_hand::StepOfRun;
use crate::blocks::RunAxis;
use crate::field::SeriesEncoder;
use crate::layout::RUN_STEPS;
use crate::placing::{self, SentRun};
use crate::series::LEAST_NEW;
use crate::staged::Staged;
use crate::state::State;
use crate::{AtHand, CubeError, Description, Edit, RunValues, Step, run_shards};

/// Memory that steps on their way may take together, bytes.
const WAY_BYTES: usize = 128 << 20;
/// Bytes of a cell on its way: as a map, in its chunks, in levels, as it is compressed.
const CELL_BYTES: usize = 16;
/// Most steps on their way: they wait for the store most of the time.
const MOST_AT_ONCE: usize = 8;

/// What was sent: nothing names it yet.
#[derive(Default)]
pub(crate) struct Handed {
    pub(crate) steps: Vec<(Period, Staged)>,
    pub(crate) runs: Vec<SentRun>,
}

/// A version whose values are at hand.
pub(crate) struct Handing<'a> {
    manifest: &'a Manifest,
    description: Description,
    /// Of each step the digest of its values; none of those that are in the cube, or whose field does not tell it.
    absent: Vec<Option<Digest>>,
    /// Has the version a time-major copy without sums beside it? They are made of the map-major values else.
    has_runs: bool,
}

impl<'a> Handing<'a> {
    /// Over a state of its cube.
    pub(crate) fn of(manifest: &'a Manifest, description: &Description, state: &State) -> Self {
        let is_same = state.describes_same_cells(description);
        let there = state.steps.iter().filter(|_| is_same);
        let there: BTreeSet<(Period, Digest)> = there
            .map(|step| (step.period, step.values_sha256))
            .collect();
        let absent = |step: &contract::manifest::Step| match step.field.vouches() {
            Vouched::Values(digest) => {
                Some(digest).filter(|own| !there.contains(&(step.period, *own)))
            }
            Vouched::Bytes(_) | Vouched::Nothing => None,
        };
        Self {
            manifest,
            absent: manifest.steps.iter().map(absent).collect(),
            has_runs: state.sums.next_basis(description).is_none(),
            description: description.clone(),
        }
    }

    /// Sends the runs whose steps are all to be put: the next one is asked for while one is sent.
    pub(crate) async fn send(
        &self,
        edit: &Edit<'_>,
        at_hand: &dyn AtHand,
    ) -> Result<Handed, CubeError> {
        let encoder = Arc::new(SeriesEncoder::new(&self.description)?);
        let mut handed = Handed::default();
        let runs = self.absent.chunks(RUN_STEPS).enumerate();
        let runs = runs.filter(|(_, absent)| absent.iter().all(Option::is_some));
        let mut left = runs.collect::<Vec<_>>().into_iter();
        let mut coming = left.next();
        let mut values = self.values(at_hand, coming).await;
        while let Some((run, absent)) = coming {
            coming = left.next();
            let sent = async {
                let Some(values) = values else {
                    return Ok(None);
                };
                let steps = self.steps(edit, (run, absent), &values);
                let shards = self.shards(edit, (run, absent.len()), &values, &encoder);
                Ok::<_, CubeError>(Some(tokio::try_join!(steps, shards)?))
            };
            let (sent, next) = tokio::join!(sent, self.values(at_hand, coming));
            if let Some((steps, shards)) = sent? {
                handed.steps.extend(steps);
                handed.runs.extend(shards);
            }
            values = next;
        }
        Ok(handed)
    }

    async fn values(
        &self,
        at_hand: &dyn AtHand,
        run: Option<(usize, &[Option<Digest>])>,
    ) -> Option<Arc<RunValues>> {
        let (run, _absent) = run?;
        at_hand
            .run(run)
            .await
            .filter(RunValues::is_whole)
            .map(Arc::new)
    }

    /// Sends the steps of a run.
    async fn steps(
        &self,
        edit: &Edit<'_>,
        (run, absent): (usize, &[Option<Digest>]),
        values: &Arc<RunValues>,
    ) -> Result<Vec<(Period, Staged)>, CubeError> {
        let grid = self.manifest.grid;
        let own = &self.manifest.steps[run * RUN_STEPS..];
        let each = own.iter().zip(absent).enumerate();
        let each = each.filter_map(|(at, (step, digest))| digest.map(|own| (at, step.period, own)));
        let each: Vec<(usize, Period, Digest)> = each.collect();
        let send = |(at, period, values_sha256): (usize, Period, Digest)| async move {
            let mut bands = StepOfRun {
                run: Arc::clone(values),
                step: at,
                grid,
            };
            let step = Step {
                period,
                values_sha256,
            };
            Ok::<_, CubeError>((period, edit.send(step, &mut bands).await?))
        };
        let at_once = WAY_BYTES / (grid.cell_count() * CELL_BYTES).max(1);
        let sending = stream::iter(each).map(send);
        let sending = sending.buffered(at_once.clamp(1, MOST_AT_ONCE));
        sending.try_collect().await
    }

    /// Sends the shards of a run of so many steps; none of one that is too short to be made.
    async fn shards(
        &self,
        edit: &Edit<'_>,
        (run, steps): (usize, usize),
        values: &Arc<RunValues>,
        encoder: &Arc<SeriesEncoder>,
    ) -> Result<Option<SentRun>, CubeError> {
        if !self.has_runs || steps < LEAST_NEW {
            return Ok(None);
        }
        let path = placing::series_path(&self.description)?;
        let mut sent = SentRun {
            run,
            steps,
            shards: vec![],
        };
        for shard in encoder.shards() {
            let (values, blocks) = (Arc::clone(values), encoder.shard_blocks());
            let encoding = move || run_shards::shard(&values, shard, blocks);
            let content = tokio::task::spawn_blocking(encoding).await;
            let content =
                content.map_err(|e| CubeError::library("a thread", "encoding values", e))?;
            let at = (&path, RunAxis::First.index(shard, run));
            let payload = placing::send_shard(edit.uploads(), at, content?).await?;
            sent.shards.push((shard, payload));
        }
        Ok(Some(sent))
    }
}
