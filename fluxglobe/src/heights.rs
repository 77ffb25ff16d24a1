//! Whether all heights of a picture, or of a film, are drawn to scale: nothing is lifted or sunk beyond a limit, and deep
//! map tiles are flattened.

use std::collections::BTreeMap;

use anyhow::Result;
use contract::chunk::BAND_CELLS;
use contract::grid::Grid;
use contract::heights::{HEIGHT_LIMIT_M, MOST_LIFT_PX, SHEET_M, kept_share, px_per_m};
use contract::job::{RenderJob, View};
use contract::key::ObjectKey;
use contract::quantity::Quantity;
use storage::fields::Bands;
use storage::{Store, fields};

/// The fields that amounts lie between.
type Pair = (Option<ObjectKey>, Option<ObjectKey>);

/// What to tell of a picture some of whose columns are not drawn to scale; nothing where all are.
pub(crate) async fn note(store: &Store, job: &RenderJob) -> Result<Option<String>> {
    let Some(sample) = &job.accumulated else {
        return Ok(None);
    };
    let after = sample.after.as_ref();
    let pair = (
        sample.before.clone(),
        after.map(|after| after.field.clone()),
    );
    let weight = after.map_or(0.0, |after| after.weight);
    let weights = [weight, 0.0, 1.0];
    let most = most_between((store, BAND_CELLS), &job.grid, &pair, weights).await?;
    let [most_shown_kg_m2, most_before_kg_m2, most_after_kg_m2] = most;
    let m_per_kg_m2 = job.style.height_m_per_kg_m2;
    let cut_off = note_of(most_shown_kg_m2, m_per_kg_m2);
    let flattened = match job.view {
        View::Tile { tile, size_px } => {
            // As the plan of tiles has it: by both fields, so that a level keeps its scale between them.
            let most_kg_m2 = most_before_kg_m2.max(most_after_kg_m2);
            let lifted_m = (most_kg_m2 * m_per_kg_m2).min(HEIGHT_LIMIT_M);
            flattened_note(px_per_m(tile, size_px), lifted_m)
        }
        View::Globe { .. } => None,
    };
    let notes: Vec<_> = [cut_off, flattened].into_iter().flatten().collect();
    Ok((!notes.is_empty()).then(|| notes.join("; ")))
}

/// The same of the pictures of a film.
pub(crate) async fn note_of_film(store: &Store, jobs: &[RenderJob]) -> Result<Option<String>> {
    let mut spans: BTreeMap<Pair, [f64; 2]> = BTreeMap::new();
    for sample in jobs.iter().filter_map(|job| job.accumulated.as_ref()) {
        let after = sample.after.as_ref();
        let pair = (
            sample.before.clone(),
            after.map(|after| after.field.clone()),
        );
        let weight = after.map_or(0.0, |after| after.weight);
        let span = spans.entry(pair).or_insert([weight; 2]);
        *span = [span[0].min(weight), span[1].max(weight)];
    }
    let Some(first) = jobs.first() else {
        return Ok(None);
    };
    let mut most_kg_m2: f64 = 0.0;
    for (pair, weights) in spans {
        // Amounts change evenly between two fields: they are largest at an end of what is shown of that.
        let most = most_between((store, BAND_CELLS), &first.grid, &pair, weights).await?;
        most_kg_m2 = most.into_iter().fold(most_kg_m2, f64::max);
    }
    Ok(note_of(most_kg_m2, first.style.height_m_per_kg_m2))
}

/// The largest amounts of either sign between two fields at weights of the second one, kg m⁻². Fields are read in bands of at most so
/// many cells.
async fn most_between<const N: usize>(
    (store, most_cells): (&Store, u64),
    grid: &Grid,
    (before, after): &Pair,
    weights: [f64; N],
) -> Result<[f64; N]> {
    let mut of_before = match before {
        Some(field) => Some(fields::bands(store, field, grid, most_cells).await?),
        None => None,
    };
    let mut of_after = match after {
        Some(field) => Some(fields::bands(store, field, grid, most_cells).await?),
        None => None,
    };
    let mut most = [0.0; N];
    loop {
        let (before, after) = (next(&mut of_before).await?, next(&mut of_after).await?);
        let between = match (before, after) {
            (Some(before), Some(after)) => Between { before, after },
            (Some(before), None) => Between {
                after: before.clone(),
                before,
            },
            // Accumulation starts.
            (None, Some(after)) => Between {
                before: vec![0.0; after.len()],
                after,
            },
            (None, None) => return Ok(most),
        };
        for (most, weight) in most.iter_mut().zip(weights) {
            *most = f64::max(*most, between.most(weight));
        }
    }
}

/// Values of the next rows; none after the last, or of no field.
async fn next(bands: &mut Option<Bands>) -> Result<Option<Vec<f32>>> {
    let Some(bands) = bands else { return Ok(None) };
    let found = bands.next().await?;
    Ok(found.map(|(_rows, values)| values))
}

/// Accumulated carbon of the same rows of two fields, kg m⁻².
struct Between {
    before: Vec<f32>,
    after: Vec<f32>,
}

impl Between {
    /// The largest amount of either sign at a weight of the second field; what is no number has none.
    fn most(&self, weight: f64) -> f64 {
        let sums = self.before.iter().zip(&self.after).map(|(before, after)| {
            let [before, after] = [before, after].map(|value| f64::from(*value));
            before + (after - before) * weight
        });
        sums.map(f64::abs).fold(0.0, f64::max)
    }
}

fn note_of(most_kg_m2: f64, m_per_kg_m2: f64) -> Option<String> {
    if most_kg_m2 * m_per_kg_m2 <= HEIGHT_LIMIT_M {
        return None;
    }
    let display = Quantity::AccumulatedCarbon.display();
    let [most, limit] =
        [most_kg_m2, HEIGHT_LIMIT_M / m_per_kg_m2].map(|kg_m2| display.shown(kg_m2));
    let unit = display.unit;
    // Rounded down, so that it does fit.
    let power = 10f64.powf((HEIGHT_LIMIT_M / most_kg_m2).log10().floor() - 1.0);
    let fits = (HEIGHT_LIMIT_M / most_kg_m2 / power).floor() * power;
    Some(format!(
        "heights end at {limit:.0} {unit}: of as much as {most:.0} that there is here, more is drawn no higher or deeper; \
         --height-exaggeration {fits:e} draws all of it to scale"
    ))
}

fn flattened_note(px_per_m: f64, lifted_m: f64) -> Option<String> {
    let kept = kept_share(px_per_m, lifted_m + 0.5 * SHEET_M);
    (kept < 1.0).then(|| {
        let percent = 100.0 * kept;
        format!(
            "heights of this zoom level are drawn at {percent:.2} % of their scale, so that none ends more than \
             {MOST_LIFT_PX:.0} pixels from its place"
        )
    })
}

#[cfg(test)]
mod tests {
    use contract::product::ProductId;
    use contract::time::Period;

    use super::*;

    #[test]
    fn columns_beyond_the_limit_are_told_with_an_exaggeration_that_draws_them_to_scale() {
        // 62 g C m⁻², at 1200 km from 60 on, and at 600 km.
        assert_eq!(note_of(0.062, 1e7), None);
        let told = note_of(0.062, 2e7).unwrap();
        assert!(told.starts_with("heights end at 60 g C"), "{told}");
        assert!(told.contains("as much as 62"), "{told}");
        assert!(told.contains("--height-exaggeration 1.9e7 draws"), "{told}");
        assert_eq!(note_of(0.062, 1.9e7), None);
        assert_eq!(note_of(0.0, 1e9), None);
    }

    #[test]
    fn the_most_is_of_either_sign_between_the_fields_and_what_is_no_number_is_none() {
        let between = Between {
            before: vec![f32::NAN, -0.07, 0.05],
            after: vec![0.9, -0.03, f32::NAN],
        };
        assert!((between.most(0.0) - 0.07).abs() < 1e-6);
        assert!((between.most(0.5) - 0.05).abs() < 1e-6);
        assert!((between.most(1.0) - 0.03).abs() < 1e-6);
    }

    #[tokio::test]
    async fn the_most_between_fields_is_the_same_in_bands_of_any_size() {
        // Three rows of chunks.
        let grid = Grid {
            rows: 130,
            cols: 125,
            north_deg: 65.0,
            west_deg: 0.0,
            dlat_deg: 1.0,
            dlon_deg: 1.0,
        };
        let (store, product) = (Store::memory(), "p".parse::<ProductId>().unwrap());
        let write = async |month: u32, first: f32, last: f32| {
            let mut values = vec![f32::NAN; grid.cell_count()];
            values[0] = first;
            values[grid.cell_count() - 1] = last;
            let period = Period::month(2000, month).unwrap();
            let written = fields::write(&store, &product, &grid, &values, period);
            Some(written.await.unwrap())
        };
        let before = write(1, -0.5, 0.25).await;
        let after = write(2, -0.125, 1.0).await;
        for most_cells in [1, u64::MAX] {
            for (before, after, expected) in [
                (&before, &after, [0.5, 0.625, 1.0]),
                (&before, &None, [0.5; 3]),
                (&None, &after, [0.0, 0.5, 1.0]),
                (&None, &None, [0.0; 3]),
            ] {
                let pair = (before.clone(), after.clone());
                let weights = [0.0, 0.5, 1.0];
                let most = most_between((&store, most_cells), &grid, &pair, weights).await;
                assert_eq!(most.unwrap().to_vec(), expected, "{pair:?}");
            }
        }
    }

    #[test]
    fn flattened_levels_are_told_with_the_scale_that_is_left() {
        // 390 km and half the sheet are 400 km.
        assert_eq!(flattened_note(120.0 / 4e5, 3.9e5), None);
        let told = flattened_note(480.0 / 4e5, 3.9e5).unwrap();
        assert!(told.contains("at 25.00 % of their scale"), "{told}");
        assert!(told.contains("more than 120 pixels"), "{told}");
    }
}
