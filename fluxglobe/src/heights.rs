//! Whether all heights of a picture, or of a film, are drawn to scale: nothing is lifted or sunk beyond a limit, and deep
//! map tiles are flattened.

use std::collections::BTreeMap;

use anyhow::Result;
use contract::grid::Grid;
use contract::heights::{HEIGHT_LIMIT_M, MOST_LIFT_PX, SHEET_M, kept_share, px_per_m};
use contract::job::{RenderJob, View};
use contract::key::ObjectKey;
use contract::quantity::Quantity;
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
    let between = Between::read(store, &job.grid, &pair).await?;
    let m_per_kg_m2 = job.style.height_m_per_kg_m2;
    let weight = after.map_or(0.0, |after| after.weight);
    let cut_off = note_of(between.most(weight), m_per_kg_m2);
    let flattened = match job.view {
        View::Tile { tile, size_px } => {
            // As the plan of tiles has it: by both fields, so that a level keeps its scale between them.
            let most_kg_m2 = between.most(0.0).max(between.most(1.0));
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
        let between = Between::read(store, &first.grid, &pair).await?;
        // Amounts change evenly between two fields: they are largest at an end of what is shown of that.
        most_kg_m2 = weights
            .into_iter()
            .map(|weight| between.most(weight))
            .fold(most_kg_m2, f64::max);
    }
    Ok(note_of(most_kg_m2, first.style.height_m_per_kg_m2))
}

/// Accumulated carbon of two fields, kg m⁻².
struct Between {
    before: Vec<f32>,
    after: Vec<f32>,
}

impl Between {
    async fn read(store: &Store, grid: &Grid, (before, after): &Pair) -> Result<Self> {
        let before = match before {
            Some(field) => fields::read(store, field, grid).await?,
            // Accumulation starts.
            None => vec![0.0; grid.cell_count()],
        };
        let after = match after {
            Some(field) => fields::read(store, field, grid).await?,
            None => before.clone(),
        };
        Ok(Self { before, after })
    }

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

    #[test]
    fn flattened_levels_are_told_with_the_scale_that_is_left() {
        // 390 km and half the sheet are 400 km.
        assert_eq!(flattened_note(120.0 / 4e5, 3.9e5), None);
        let told = flattened_note(480.0 / 4e5, 3.9e5).unwrap();
        assert!(told.contains("at 25.00 % of their scale"), "{told}");
        assert!(told.contains("more than 120 pixels"), "{told}");
    }
}
