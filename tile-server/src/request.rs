//! From an address to a render job: a layer, a mode, an instant and a view in, everything that shapes the picture out.

use std::sync::Arc;

use contract::context::Relief;
use contract::job::{Mode, RenderJob, View};
use contract::picture::{self, PictureOptions, PictureRequest, PictureSources};
use contract::time::TimeMs;
use contract::trails::TrailSources;

use crate::catalogue::Layer;
use crate::error::ServerError;

/// The mode of an address, if the layer is drawn in it.
pub(crate) fn mode(layer: &Layer, text: &str) -> Result<Mode, ServerError> {
    let offered = layer.modes();
    let found = offered.iter().find(|mode| mode.as_str() == text);
    if found.is_none() && text == Mode::Flow.as_str() {
        return Err(ServerError::NoVector {
            product: layer.manifest.product.to_string(),
        });
    }
    found.copied().ok_or_else(|| ServerError::UnknownMode {
        product: layer.manifest.product.to_string(),
        mode: text.chars().take(80).collect(),
        offered: offered
            .iter()
            .map(ToString::to_string)
            .collect::<Vec<_>>()
            .join(", "),
    })
}

/// The instant that is shown of a layer, see [`contract::picture::shown_time`].
pub(crate) fn shown_time(layer: &Layer, time: Option<TimeMs>) -> TimeMs {
    // A layer is a version with steps.
    picture::shown_time(&layer.manifest, time).unwrap_or(layer.extent.end)
}

/// The job of a picture in the usual look. Without a time it shows the middle of the last step.
pub fn job(
    layer: &Layer,
    mode: Mode,
    view: View,
    time: Option<TimeMs>,
) -> Result<RenderJob, ServerError> {
    let request = PictureRequest {
        mode,
        view,
        time,
        options: PictureOptions::default(),
    };
    job_of(layer, &request, &Beside::default())
}

/// Newest versions of products that are drawn with a layer.
#[derive(Debug, Default)]
pub(crate) struct Beside {
    /// Land and sea floor below.
    pub(crate) relief: Option<Relief>,
    /// The vector whose trails lie on the sea surface.
    pub(crate) trails: Option<VectorAt>,
}

/// The eastward part of a vector, with its northward one, and its instant if that is not the picture's.
#[derive(Debug)]
pub(crate) struct VectorAt {
    pub(crate) layer: Arc<Layer>,
    pub(crate) time: Option<TimeMs>,
}

impl VectorAt {
    fn sources(&self) -> Option<TrailSources<'_>> {
        let northward = self.layer.northward.as_ref()?;
        Some(TrailSources {
            eastward: &self.layer.manifest,
            northward: &northward.manifest,
            time: self.time,
        })
    }
}

/// The job of a picture of a layer with what is drawn beside it.
pub(crate) fn job_of(
    layer: &Layer,
    request: &PictureRequest,
    beside: &Beside,
) -> Result<RenderJob, ServerError> {
    let time = shown_time(layer, request.time);
    let accumulated = layer.accumulated.as_ref();
    let accumulated = accumulated.filter(|lift| lift.holds_at(time));
    let sources = PictureSources {
        product: &layer.manifest,
        accumulated: accumulated.map(|lift| &*lift.manifest),
        northward: layer.northward.as_ref().map(|part| &*part.manifest),
        trails: beside.trails.as_ref().and_then(VectorAt::sources),
        relief: beside.relief.clone(),
    };
    Ok(request.job(&sources)?)
}
