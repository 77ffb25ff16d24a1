//! From an address to a render job: a layer, a mode, an instant and a view in, everything that shapes the picture out.

use contract::job::{Mode, RenderJob, Style, View};
use contract::time::TimeMs;

use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::look::Look;

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

/// The instant that is shown: the one asked for, or the nearest that the product covers; the middle of its last step
/// unless one is asked for.
pub(crate) fn shown_time(layer: &Layer, time: Option<TimeMs>) -> TimeMs {
    let last = layer.manifest.steps.last();
    let middle = last.map_or(layer.extent.end, |last| last.period.mid());
    time.unwrap_or(middle)
        .clamp(layer.extent.start, layer.extent.end)
}

/// The job of a picture in the usual style. Without a time it shows the middle of the last step.
pub fn job(
    layer: &Layer,
    mode: Mode,
    view: View,
    time: Option<TimeMs>,
) -> Result<RenderJob, ServerError> {
    let style = Look::default().style(layer.manifest.quantity, mode)?;
    job_in_style(layer, mode, view, time, &style)
}

/// The same in a style.
pub(crate) fn job_in_style(
    layer: &Layer,
    mode: Mode,
    view: View,
    time: Option<TimeMs>,
    style: &Style,
) -> Result<RenderJob, ServerError> {
    let manifest = &layer.manifest;
    let time = shown_time(layer, time);
    if let (Mode::Flow, Some(part)) = (mode, &layer.northward) {
        let northward = &part.manifest;
        return Ok(RenderJob::of_flow(manifest, northward, time, view, *style)?);
    }
    let accumulated = layer.accumulated.as_ref();
    let accumulated = accumulated.filter(|lift| lift.holds_at(time));
    let lift = accumulated.map(|lift| &*lift.manifest);
    Ok(RenderJob::of(manifest, lift, time, mode, view, *style)?)
}
