//! A step of a cube in, its values band by band from the north out: after the last one they are sure to be those of its digest.

use std::ops::Range;

use contract::digest::Digest;
use storage::fields::FieldDigest;

use crate::field_bands::CubeBands;
use crate::{Bands as _, Cube, CubeError, Layout, Step};

/// The bands of a step.
pub(crate) struct StepBands {
    bands: CubeBands,
    left: std::vec::IntoIter<Range<u32>>,
    /// Of the values that were given; none when it was compared.
    digest: Option<FieldDigest>,
}

impl StepBands {
    /// Of a step that the cube has, of at most so many cells each or one row of chunks.
    pub(crate) fn of(cube: &Cube, step: usize, most_cells: u64) -> Self {
        let grid = cube.description().grid;
        let bands: Vec<Range<u32>> = Layout::of(&grid).bands(&grid, most_cells).collect();
        Self {
            left: bands.into_iter(),
            digest: Some(FieldDigest::new(&grid, cube.steps()[step].period)),
            bands: CubeBands {
                cube: cube.clone(),
                step,
            },
        }
    }

    /// The next rows and their values, `[row, col]`, stored unit, NaN no data; none after the last.
    ///
    /// # Errors
    /// A chunk that is damaged or gone, by its name; after the last band `Step`, if all together are not those of the digest.
    pub(crate) async fn next(&mut self) -> Result<Option<(Range<u32>, Vec<f32>)>, CubeError> {
        let Some(rows) = self.left.next() else {
            let found = self.digest.take().map(FieldDigest::finish);
            return self.compared(found).map(|()| None);
        };
        let values = self.bands.rows(rows.clone()).await?;
        let Some(mut digest) = self.digest.take() else {
            return Ok(Some((rows, values)));
        };
        let digested = tokio::task::spawn_blocking(move || {
            digest.add(&values);
            (digest, values)
        });
        let (digest, values) = digested
            .await
            .map_err(|e| CubeError::library("a thread", "checking values", e))?;
        self.digest = Some(digest);
        Ok(Some((rows, values)))
    }

    fn compared(&self, found: Option<Digest>) -> Result<(), CubeError> {
        let CubeBands { cube, step } = &self.bands;
        let Step {
            period,
            values_sha256,
        } = cube.steps()[*step];
        if found.is_none_or(|found| found == values_sha256) {
            return Ok(());
        }
        Err(CubeError::Step {
            array: cube.array_name(),
            period,
        })
    }
}

#[cfg(test)]
mod tests {
    use contract::quantity::Quantity;
    use contract::time::Period;
    use storage::Store;

    use super::*;
    use crate::banded_field::{GRID, description, values};
    use crate::{At, Edit, Repository, WholeField};

    /// A cube of a step of these values that says this digest.
    async fn cube_of(store: &Store, values_sha256: Digest) -> Cube {
        let description = description(Quantity::CarbonFlux);
        let repository = Repository::create(store, "p", &description).await.unwrap();
        let mut edit = Edit::begin(&repository).await.unwrap();
        let mut bands = WholeField::new(values().into(), GRID.cols);
        let period = Period::month(2000, 1).unwrap();
        let put = edit.put_bands(period, values_sha256, &mut bands);
        put.await.unwrap();
        edit.commit("one").await.unwrap();
        repository.at(&At::Newest).await.unwrap()
    }

    #[tokio::test]
    async fn a_step_comes_in_rows_of_chunks_and_is_compared_at_the_end() {
        let own = storage::fields::digest_of(&GRID, &values(), Period::month(2000, 1).unwrap());
        for (digest, is_own) in [(own, true), (Digest::of(b"others"), false)] {
            let cube = cube_of(&Store::memory(), digest).await;
            for (most_cells, expected) in [
                (1, vec![0..344, 344..688, 688..1030]),
                (2 * 344 * 600, vec![0..688, 688..1030]),
                (
                    u64::MAX,
                    vec![Range {
                        start: 0,
                        end: 1030,
                    }],
                ),
            ] {
                let mut bands = StepBands::of(&cube, 0, most_cells);
                let (mut all, mut found) = (vec![], vec![]);
                let end = loop {
                    match bands.next().await {
                        Ok(Some((rows, values))) => {
                            assert_eq!(values.len(), rows.len() * GRID.cols as usize);
                            all.extend(values.iter().map(|value| value.to_bits()));
                            found.push(rows);
                        }
                        end => break end,
                    }
                };
                assert_eq!(found, expected);
                let bits = values()
                    .iter()
                    .map(|value| value.to_bits())
                    .collect::<Vec<_>>();
                assert!(all == bits, "{most_cells}");
                match end {
                    Ok(_) => assert!(is_own),
                    Err(error) => {
                        assert!(
                            matches!(error, CubeError::Step { .. }) && !is_own,
                            "{error}"
                        );
                    }
                }
            }
        }
    }
}
