//! Which annotations a picture has: what was asked for, and what its products and its view have to tell.

use super::PictureSources;
use crate::ContractError;
use crate::annotation::{
    Annotation, AnnotationWishes, Annotations, DateLabel, Graticule, HeightScale, Label, Wanted,
};
use crate::flow::title_of_vector;
use crate::job::{RenderJob, View};
use crate::manifest::Manifest;
use crate::time::TimeMs;

impl PictureSources<'_> {
    /// A job of these versions at an instant with annotations over it. What is asked for by name and has nothing to tell
    /// is an error; with `all` it is left out.
    ///
    /// # Errors
    /// A map tile, a height bar where nothing is lifted, a limit that is broken.
    pub fn annotated(
        &self,
        job: RenderJob,
        time: TimeMs,
        wishes: AnnotationWishes,
    ) -> Result<RenderJob, ContractError> {
        if wishes.is_empty() {
            return Ok(job);
        }
        let View::Globe {
            height_m, angles, ..
        } = job.view
        else {
            return Err(Annotations::refused_on_tiles());
        };
        let since = self.height_since(&job, wishes.wanted(Annotation::Height))?;
        let has = |one| wishes.has(one);
        let annotations = Annotations {
            legend: has(Annotation::Legend).then_some(self.product.quantity),
            date: has(Annotation::Date)
                .then(|| DateLabel::of(self.product, time))
                .flatten(),
            graticule: has(Annotation::Graticule).then(|| {
                let suited = || Graticule::suited(height_m, &angles);
                wishes.graticule().unwrap_or_else(suited)
            }),
            names: has(Annotation::Names),
            scale: has(Annotation::Scale),
            height: since.map(|since| HeightScale { since }),
            source: has(Annotation::Source)
                .then(|| source(self.product, &self.title(&job)))
                .flatten(),
            trails: self.trails.and_then(|trails| Label::cut(&trails.caption())),
            ..Annotations::none()
        };
        let job = RenderJob {
            annotations: Some(annotations).filter(|them| !them.is_empty()),
            ..job
        };
        job.validate()?;
        Ok(job)
    }

    /// What is drawn: a product, or the vector of which it is a part.
    fn title(&self, job: &RenderJob) -> String {
        match job.flow {
            Some(_) => title_of_vector(&self.product.title),
            None => self.product.title.clone(),
        }
    }

    /// From when on the carbon was added up that lifts the particles of a job, where a height bar is wanted.
    fn height_since(
        &self,
        job: &RenderJob,
        wanted: Wanted,
    ) -> Result<Option<TimeMs>, ContractError> {
        let lift = self.accumulated.filter(|_| job.accumulated.is_some());
        let first = lift.and_then(|lift| lift.steps.first());
        match (wanted, first) {
            (Wanted::No, _) | (Wanted::WhereItFits, None) => Ok(None),
            (Wanted::WhereItFits | Wanted::ByName, Some(first)) => Ok(Some(first.period.start)),
            (Wanted::ByName, None) => {
                let name = self.product.product.as_str();
                let reason = format!(
                    "no carbon was added up that would lift what is drawn as {} at that instant; leave it out, or ask for all",
                    job.mode
                );
                Err(ContractError::invalid("height bar of", name, reason))
            }
        }
    }
}

/// Title and citation of what is drawn of a product; the title once where the citation begins with it.
fn source(product: &Manifest, title: &str) -> Option<Label> {
    let (title, source) = (title.trim(), product.source.trim());
    let made = if product.synthetic {
        " (made up, not measured)"
    } else {
        ""
    };
    let text = if source.is_empty() || title.is_empty() || source.starts_with(title) {
        format!("{}{made}", if source.is_empty() { title } else { source })
    } else {
        format!("{title}{made}: {source}")
    };
    Label::cut(&text)
}

#[cfg(test)]
mod tests;
