//! A job and its finished picture in, the same picture with what explains it drawn over out.
//!
//! The drawing is one SVG, a pure function of the job and of how far its columns go: panels in the corners, lines and names where the camera of the
//! picture sees them (`render::plan::Projection`). What does not fit is left out, never squeezed over something else.

mod bars;
mod blend;
mod caption;
mod graticule;
mod key;
mod lifted;
mod names;
mod page;
mod panel;
mod seas;
mod text;

use contract::job::RenderJob;
use legend::LegendError;
use legend::raster;
use render::Image;
use render::plan::Projection;

pub use lifted::Lifted;
use page::Page;

/// Pictures with a shorter side than this have no room for anything, pixels.
const LEAST_SIDE_PX: u32 = 96;

/// The picture of a job, whose columns go so far, with its annotations; the same picture if it has none, or no room for any.
///
/// # Errors
/// None that a valid job has; defects of the drawing.
pub fn annotated(job: &RenderJob, lifted: &Lifted, image: Image) -> Result<Image, LegendError> {
    let Some(svg) = drawing(job, lifted)? else {
        return Ok(image);
    };
    Ok(blend::over(image, &raster::pixels(&svg)?))
}

/// What is drawn over the picture of a job, as SVG of its size.
///
/// # Errors
/// As [`annotated`].
pub fn drawing(job: &RenderJob, lifted: &Lifted) -> Result<Option<String>, LegendError> {
    let size_px = job.view.size_px();
    let (Some(annotations), Some(projection)) = (&job.annotations, Projection::of(&job.view))
    else {
        return Ok(None);
    };
    if size_px.into_iter().min() < Some(LEAST_SIDE_PX) {
        return Ok(None);
    }
    let mut page = Page::new(size_px);
    // What matters most comes first: what follows takes the room that is left.
    let lines = [&annotations.source, &annotations.trails];
    for line in lines.into_iter().flatten() {
        caption::draw(&mut page, line)?;
    }
    if let Some(quantity) = annotations.legend {
        key::draw(&mut page, job, quantity)?;
    }
    if let Some(date) = &annotations.date {
        key::draw_date(&mut page, date)?;
    }
    bars::draw(&mut page, job, lifted, annotations, &projection)?;
    let grid = annotations
        .graticule
        .map(|graticule| graticule::Lines::of(graticule, &projection, page.size()));
    let mut unnamed = vec![];
    if let Some(grid) = &grid {
        unnamed = grid.label_ends(&mut page, &projection)?;
    }
    if annotations.names {
        names::draw(&mut page, &projection)?;
    }
    if let Some(grid) = &grid {
        grid.label_inside(&mut page, &projection, &unnamed)?;
    }
    Ok(Some(page.into_svg()))
}

#[cfg(test)]
mod tests;
