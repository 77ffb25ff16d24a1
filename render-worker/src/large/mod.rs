//! Scenes of products whose grids are too large to be held: a job in, the window of one of their coarser levels that its picture shows
//! out, as a scene like any other.
//!
//! Values are means by area of what holds data, heights and masses those of the area, and which level and window it is follows from
//! the job alone. Gaps cannot be filled from far away in a window: a whole level is filled, once, and what is missing in windows is
//! taken from it, so that neighbours agree about it.

mod choice;
mod domain;
mod gaps;
mod steps;

use std::sync::Arc;

use contract::grid::Grid;
use contract::job::RenderJob;
use contract::key::ObjectKey;
use contract::level::Level;
use contract::time_sample::{After, TimeSample};
use cube::LevelWindow;
use quick_cache::sync::Cache;
use render::Renderer;
use render::scene::{Field, Interval, Scene, Terrain};
use render::stages::fill::Form;
use storage::Store;

use crate::error::DrawError;
use crate::unfilled::Gaps;
use choice::Choice;
use domain::Domain;
use gaps::Coarse;
use steps::{Steps, product_of};

/// Fields of more cells are not held whole: 256 MiB of values.
pub(crate) const MOST_WHOLE_CELLS: u64 = 1 << 26;
/// Levels of at most so many cells are filled whole.
const MOST_FILLED_CELLS: usize = 1 << 22;
/// Most cells of a window: 512 MiB of values.
const MOST_WINDOW_CELLS: u64 = 1 << 27;
/// Filled levels that are kept, each of 32 MiB at most.
const MOST_COARSE: usize = 8;
/// Domains that are kept, each of a bit a cell at most.
const MOST_DOMAINS: usize = 4;

/// Makes scenes.
pub(crate) struct Large {
    store: Store,
    renderer: Arc<Renderer>,
    steps: Steps,
    domains: Cache<ObjectKey, Arc<Domain>>,
    /// By field and domain.
    coarse: Cache<(ObjectKey, ObjectKey), Arc<Coarse>>,
}

/// What of one product a picture is drawn from.
struct Part<'a> {
    grid: &'a Grid,
    choice: &'a Choice,
    sample: &'a TimeSample,
    gaps: Gaps,
    /// How much of each cell of the window holds data in some step of this product.
    shares: Arc<Vec<u32>>,
}

/// What sums of carbon that lift particles go by.
#[derive(Clone)]
struct Lifting {
    /// How much of each cell of the window the product holds data in that is drawn.
    drawn: Arc<Vec<u32>>,
    /// Smallest and largest sum of all of the fields.
    range: [f32; 2],
}

impl Large {
    pub(crate) fn new(store: Store, renderer: Arc<Renderer>) -> Self {
        Self {
            steps: Steps::new(store.clone()),
            store,
            renderer,
            domains: Cache::new(MOST_DOMAINS),
            coarse: Cache::new(MOST_COARSE),
        }
    }

    /// The scene of a job without its trails, over a terrain.
    pub(crate) async fn scene(
        &self,
        job: &RenderJob,
        terrain: Option<Terrain>,
    ) -> Result<Scene, DrawError> {
        let grid = &job.grid;
        // Before anything is laid out or read for as many cells as the job claims that there are.
        self.domain(grid, &job.value.domain).await?;
        let carbon = match &job.accumulated {
            Some(sample) => Some(self.range(grid, sample).await?),
            None => None,
        };
        let choice = choice::choose(job, carbon);
        check_size(job, &choice)?;
        let value = self
            .part(grid, &choice, (&job.value, Gaps::of(job)))
            .await?;
        let accumulated = match &job.accumulated {
            Some(sample) => Some(self.part(grid, &choice, (sample, Gaps::Filled)).await?),
            None => None,
        };
        let northward = job.flow.as_ref().map(|flow| &flow.northward);
        let northward = match northward {
            Some(sample) => Some(self.part(grid, &choice, (sample, Gaps::Filled)).await?),
            None => None,
        };
        let own = self.interval(&value, None).await?;
        let lifted = match &accumulated {
            Some(part) => {
                let lifting = Lifting {
                    drawn: Arc::clone(&value.shares),
                    range: carbon.unwrap_or_default(),
                };
                Some(self.interval(part, Some(&lifting)).await?)
            }
            None => None,
        };
        let northward = match &northward {
            Some(part) => Some(self.interval(part, None).await?),
            None => None,
        };
        let shares = Arc::unwrap_or_clone(value.shares);
        let domain = match choice.level {
            0 => Scene::domain_of(shares.into_iter().map(|share| share > 0)),
            _ => Scene::domain_of_blocks(shares),
        };
        Ok(Scene {
            grid: choice.window,
            domain,
            value: own,
            accumulated: lifted,
            terrain,
            northward,
            trails: None,
            whole: Some(choice.place()),
        })
    }

    /// Smallest and largest sum of a sample.
    async fn range(&self, grid: &Grid, sample: &TimeSample) -> Result<[f32; 2], DrawError> {
        // It starts at zero.
        let mut range = [0.0_f32; 2];
        let after = sample.after.as_ref().map(|after| &after.field);
        for field in sample.before.iter().chain(after) {
            let [least, most] = self.steps.range(grid, field).await?;
            range = [range[0].min(least), range[1].max(most)];
        }
        Ok(range)
    }

    async fn part<'a>(
        &self,
        grid: &'a Grid,
        choice: &'a Choice,
        (sample, gaps): (&'a TimeSample, Gaps),
    ) -> Result<Part<'a>, DrawError> {
        if sample.contributed.is_some() {
            return Err(DrawError::Large {
                product: sample.product().to_owned(),
                reason: "what sums lack is not drawn on so many cells: leave uncertainty out"
                    .to_owned(),
            });
        }
        Ok(Part {
            grid,
            choice,
            sample,
            gaps,
            shares: Arc::new(self.shares(grid, &sample.domain, choice).await?),
        })
    }

    /// Which cells of a grid hold data in some step; refused if it is of another number of cells.
    async fn domain(&self, grid: &Grid, key: &ObjectKey) -> Result<Arc<Domain>, DrawError> {
        let reading = async {
            let read = storage::domain::read_cells(&self.store, key).await;
            let cells = read.map_err(|source| DrawError::Store {
                what: "the domain",
                product: product_of(key).to_owned(),
                source: Box::new(source),
            })?;
            let domain = Domain::of(grid, cells);
            domain.map(Arc::new).ok_or_else(|| DrawError::mismatch(key))
        };
        let domain = self.domains.get_or_insert_async(key, reading).await?;
        if domain.is_of(grid) {
            Ok(domain)
        } else {
            Err(DrawError::mismatch(key))
        }
    }

    /// How much of each cell of a window holds data in some step.
    async fn shares(
        &self,
        grid: &Grid,
        key: &ObjectKey,
        choice: &Choice,
    ) -> Result<Vec<u32>, DrawError> {
        let domain = self.domain(grid, key).await?;
        let choice = *choice;
        let counting = tokio::task::spawn_blocking(move || domain.shares(&choice));
        counting.await.map_err(DrawError::Thread)
    }

    /// The fields around a sample.
    async fn interval(
        &self,
        part: &Part<'_>,
        lifting: Option<&Lifting>,
    ) -> Result<Interval, DrawError> {
        let before = if let Some(field) = &part.sample.before {
            self.field(part, field, lifting).await?
        } else {
            // All that is accumulated until the end of the first step is of that step.
            let zero = |share: &u32| if *share == 0 { f32::NAN } else { 0.0 };
            lifted(Field::new(part.shares.iter().map(zero).collect()), lifting)
        };
        let before = Arc::new(before);
        let (after, weight) = match &part.sample.after {
            Some(After { field, weight }) => {
                (Arc::new(self.field(part, field, lifting).await?), *weight)
            }
            None => (Arc::clone(&before), 0.0),
        };
        Ok(Interval {
            before,
            after,
            weight,
        })
    }

    /// The window of a field, gaps filled.
    async fn field(
        &self,
        part: &Part<'_>,
        field: &ObjectKey,
        lifting: Option<&Lifting>,
    ) -> Result<Field, DrawError> {
        let LevelWindow { values, .. } = self.steps.window(part.grid, field, part.choice).await?;
        if values.len() != part.shares.len() {
            return Err(DrawError::mismatch(field));
        }
        let is_gap = |(value, share): (&f32, &u32)| *share != 0 && !value.is_finite();
        let has_gaps = values.iter().zip(&*part.shares).any(is_gap);
        let coarse = if has_gaps && part.gaps == Gaps::Filled {
            Some(self.coarse(part, field).await?)
        } else {
            None
        };
        let (shares, lifting) = (Arc::clone(&part.shares), lifting.cloned());
        let (window, is_level) = (part.choice.window, part.choice.level > 0);
        let filling = tokio::task::spawn_blocking(move || {
            let mut values = values;
            let errors = coarse.map(|coarse| {
                let errors = fill(&mut values, &shares, &window, &coarse);
                (errors, coarse.largest_error)
            });
            if let (Some(lifting), true) = (&lifting, is_level) {
                spread(&mut values, &shares, &lifting.drawn);
            }
            let own = lifted(Field::new(values), lifting.as_ref());
            match errors {
                Some((errors, largest)) => own.with_errors_of(errors, largest),
                None => own,
            }
        });
        filling.await.map_err(DrawError::Thread)
    }

    /// The level of a field that is filled whole.
    async fn coarse(&self, part: &Part<'_>, field: &ObjectKey) -> Result<Arc<Coarse>, DrawError> {
        let key = (field.clone(), part.sample.domain.clone());
        let making = async {
            let level = filled_level(part.grid).ok_or_else(|| DrawError::Large {
                product: product_of(field).to_owned(),
                reason: format!(
                    "gaps of it cannot be filled: {} x {} cells are no whole number of blocks of 4 x 4 down to a pole or all round; \
                     land it on a grid whose sides are multiples of 16",
                    part.grid.rows, part.grid.cols
                ),
            })?;
            let all = Choice::all_of(&level);
            let found = self.steps.window(part.grid, field, &all);
            let shares = self.shares(part.grid, &part.sample.domain, &all);
            let (found, shares) = tokio::try_join!(found, shares)?;
            let renderer = Arc::clone(&self.renderer);
            let filling = tokio::task::spawn_blocking(move || {
                let filled = renderer.fill(Form::Window, &level.grid, &found.values, &shares)?;
                Ok::<_, DrawError>(Coarse::new(level.grid, filled))
            });
            let filled = filling.await.map_err(DrawError::Thread)??;
            Ok::<_, DrawError>(Arc::new(filled))
        };
        self.coarse.get_or_insert_async(&key, making).await
    }
}

/// The finest level that is filled whole.
fn filled_level(grid: &Grid) -> Option<Level> {
    let levels = choice::drawn_levels(grid);
    let mut small = levels.into_iter();
    small.find(|level| level.grid.cell_count() <= MOST_FILLED_CELLS)
}

/// Slices and light are laid out for all sums, whichever window is drawn.
fn lifted(field: Field, lifting: Option<&Lifting>) -> Field {
    match lifting {
        Some(lifting) => field.over(lifting.range),
        None => field,
    }
}

/// Fills gaps from a filled level; estimated errors of all values come back, 0 of what was measured.
fn fill(values: &mut [f32], shares: &[u32], window: &Grid, coarse: &Coarse) -> Vec<f32> {
    let cols = window.cols as usize;
    let mut errors = vec![f32::NAN; values.len()];
    for (cell, (value, error)) in values.iter_mut().zip(&mut errors).enumerate() {
        if value.is_finite() {
            *error = 0.0;
            continue;
        }
        if shares[cell] == 0 {
            continue;
        }
        let place = window.cell_center((cell / cols) as u32, (cell % cols) as u32);
        if let Some([filled, estimated]) = coarse.at(place.lat, place.lon) {
            (*value, *error) = (filled, estimated);
        }
    }
    errors
}

/// Sums of carbon over the area where they are known, spread over the area that is drawn: mass stays what it is.
fn spread(kg_m2: &mut [f32], known: &[u32], drawn: &[u32]) {
    for ((kg_m2, known), drawn) in kg_m2.iter_mut().zip(known).zip(drawn) {
        if known < drawn {
            *kg_m2 = (f64::from(*kg_m2) * f64::from(*known) / f64::from(*drawn)) as f32;
        }
    }
}

fn check_size(job: &RenderJob, choice: &Choice) -> Result<(), DrawError> {
    let cells = choice.window.cell_count() as u64;
    if cells <= MOST_WINDOW_CELLS {
        return Ok(());
    }
    Err(DrawError::Large {
        product: job.value.product().to_owned(),
        reason: format!(
            "the picture shows {cells} cells of it, and {MOST_WINDOW_CELLS} at most are held: ask for fewer pixels or from nearer; \
             grids whose sides are multiples of 16 are drawn in blocks of cells instead"
        ),
    })
}

#[cfg(test)]
mod tests {
    use render_proof::{ocean, views};

    use super::*;

    #[test]
    fn a_window_of_more_cells_than_are_held_is_refused() {
        let job = ocean::job(views::tile(0, 0, 0, 256));
        let of = |rows: u32| {
            let grid = Grid {
                rows,
                cols: 1 << 14,
                ..job.grid
            };
            let choice = Choice {
                level: 0,
                cells: [1; 2],
                whole: grid,
                corner: [0; 2],
                window: grid,
            };
            check_size(&job, &choice).map_err(|e| e.in_full())
        };
        assert!(of(1 << 13).is_ok());
        let refused = of((1 << 13) + 1).unwrap_err();
        assert!(refused.contains("134217728 at most are held"), "{refused}");
    }
}
