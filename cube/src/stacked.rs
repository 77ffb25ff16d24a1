//! A run of steps of a cube in, the values of its shards as maps hold them out: what the time-major copy is made of, and compared with.

use futures::stream::{self, StreamExt as _, TryStreamExt as _};

use crate::field::SeriesEncoder;
use crate::layout::RUN_STEPS;
use crate::{Cube, CubeError, series};

/// Steps whose windows are read at a time.
const STEPS_AT_ONCE: usize = 16;

/// Does the time-major copy of a run hold the values of its steps, and are the sums of it those of these values?
///
/// # Errors
/// `Chunk` with the first shard that does not.
pub(crate) async fn compare(cube: &Cube, run: usize) -> Result<(), CubeError> {
    let encoder = SeriesEncoder::new(cube.description())?;
    let held = cube.runs().held_count(run, cube.steps());
    let basis = cube.sums().basis.clone();
    let basis = basis.filter(|_| cube.is_summed(run));
    for shard in encoder.shards() {
        let told = cube.shard(run, shard).await?;
        let own = stacked(cube, &encoder, (run, held), shard).await?;
        let is_same = match &told {
            Some(told) => {
                let bits = |value: &f32| value.to_bits();
                told.iter().map(bits).eq(own.iter().map(bits))
            }
            None => own.iter().all(|value| value.is_nan()),
        };
        let differs = |array: Option<String>, what: &str| CubeError::Chunk {
            array: array.unwrap_or_default(),
            chunk: vec![shard[0].into(), shard[1].into(), run as u64],
            reason: what.to_owned(),
        };
        if !is_same {
            let what = "its values are not those of its steps";
            return Err(differs(cube.series_name(), what));
        }
        let Some(basis) = &basis else { continue };
        let told = cube.records_of_shard(run, shard).await?;
        let own = encoder.records(&own, shard, basis);
        let is_same = match told {
            Some(told) => told == own,
            None => own.iter().all(|byte| *byte == 0),
        };
        if !is_same {
            let what = "its sums are not those of its steps";
            return Err(differs(cube.sums_name(), what));
        }
    }
    Ok(())
}

/// Values of a shard of the first `held` steps of a run, `[step, row, col]`, read map-major.
pub(crate) async fn stacked(
    cube: &Cube,
    encoder: &SeriesEncoder,
    (run, held): (usize, usize),
    shard: [u32; 2],
) -> Result<Vec<f32>, CubeError> {
    let (window, cols) = (encoder.window(shard), encoder.shard_cols());
    let mut stacked = vec![f32::NAN; encoder.shard_values()];
    let all: Vec<usize> = series::steps_of(run, cube.steps()).take(held).collect();
    let maps = stream::iter(all).map(|step| cube.window(step, window));
    let mut maps = maps.buffered(STEPS_AT_ONCE);
    for map in stacked.chunks_exact_mut(encoder.shard_values() / RUN_STEPS) {
        let Some(found) = maps.try_next().await? else {
            break;
        };
        let rows = found.chunks_exact(window.cols as usize);
        for (row, found) in map.chunks_exact_mut(cols).zip(rows) {
            row[..found.len()].copy_from_slice(found);
        }
    }
    Ok(stacked)
}
