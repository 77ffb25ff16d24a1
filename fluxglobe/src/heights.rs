//! Whether all heights of a picture are drawn to scale: nothing is lifted or sunk beyond a limit.

use anyhow::Result;
use contract::job::RenderJob;
use contract::quantity::Quantity;
use render::plan::HEIGHT_LIMIT_M;
use storage::{Store, fields};

/// What to tell of a job some of whose columns end at the limit; nothing where all are to scale.
pub(crate) async fn note(store: &Store, job: &RenderJob) -> Result<Option<String>> {
    let Some(sample) = &job.accumulated else {
        return Ok(None);
    };
    let zero = vec![0.0; job.grid.cell_count()];
    let before = match &sample.before {
        Some(field) => fields::read(store, field, &job.grid).await?,
        None => zero,
    };
    let (after, weight) = match &sample.after {
        Some(after) => (
            fields::read(store, &after.field, &job.grid).await?,
            after.weight,
        ),
        None => (before.clone(), 0.0),
    };
    let sums = before.iter().zip(&after).map(|(before, after)| {
        let [before, after] = [before, after].map(|value| f64::from(*value));
        before + (after - before) * weight
    });
    Ok(note_of(most(sums), job.style.height_m_per_kg_m2))
}

/// The largest amount of either sign; what is no number has none.
fn most(sums: impl Iterator<Item = f64>) -> f64 {
    sums.map(f64::abs).fold(0.0, f64::max)
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
        assert_eq!(
            note_of(most([f64::NAN, -0.07, 0.05].into_iter()), 1e7),
            None
        );
        assert!(note_of(most([f64::NAN, -0.07].into_iter()), 2e7).is_some());
    }
}
