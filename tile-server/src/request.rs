//! From an address to a render job: a layer, a mode, an instant and a view in, everything that shapes the picture out.

use contract::colour::TransferFunction;
use contract::job::{Mode, RENDERER_VERSION, RenderJob, Style, View};
use contract::quantity::Quantity;
use contract::time::TimeMs;

use crate::catalogue::Layer;
use crate::error::ServerError;

/// The mode of an address, if the layer is drawn in it.
pub(crate) fn mode(layer: &Layer, text: &str) -> Result<Mode, ServerError> {
    let offered = layer.modes();
    let found = offered.iter().find(|mode| mode.as_str() == text);
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

/// The job of a picture. Without a time it shows the middle of the last step.
pub fn job(
    layer: &Layer,
    mode: Mode,
    view: View,
    time: Option<TimeMs>,
) -> Result<RenderJob, ServerError> {
    let manifest = &layer.manifest;
    let job = RenderJob {
        renderer_version: RENDERER_VERSION,
        product: layer.id.clone(),
        // A map has no particles to lift: without the accumulated carbon its name survives a new derivation.
        accumulated: layer.accumulated.clone().filter(|_| mode != Mode::Map),
        time: shown_time(layer, mode, time),
        mode,
        view,
        style: Style::with_transfer(TransferFunction::default_for(manifest.quantity)),
    };
    job.validate()?;
    Ok(job)
}

/// The instant that is drawn: inside what the product covers, so that equal pictures have one name.
///
/// A map before the middle of the first step, or after that of the last, shows that step unchanged; particles move
/// until the end of the last step.
fn shown_time(layer: &Layer, mode: Mode, time: Option<TimeMs>) -> TimeMs {
    let steps = &layer.manifest.steps;
    let (Some(first), Some(last)) = (steps.first(), steps.last()) else {
        return layer.extent.end;
    };
    let of_means = layer.manifest.quantity != Quantity::AccumulatedCarbon;
    let (earliest, latest) = if mode == Mode::Map && of_means {
        (first.period.mid(), last.period.mid())
    } else {
        (layer.extent.start, layer.extent.end)
    };
    time.unwrap_or_else(|| last.period.mid())
        .clamp(earliest, latest)
}
