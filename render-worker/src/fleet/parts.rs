//! Large pictures: every worker with a free turn draws an upright strip, and the strips are put together here. No seam is
//! seen, for a pixel is the same in whichever part it is drawn.

use std::sync::Arc;

use bytes::Bytes;
use contract::encoding::Encoding;
use contract::job::RenderJob;
use futures::stream::{FuturesUnordered, StreamExt as _};
use image::codecs::png::PngDecoder;
use image::{ColorType, ImageDecoder as _, Limits};
use prometheus::{IntCounter, Registry};
use render::Image;
use render::plan::Part;
use storage::Store;
use tokio::sync::{Semaphore, SemaphorePermit};
use tokio::time::Instant;

use super::member::Member;
use super::{FleetError, Inner, Picture};
use crate::annotation::Lifted;
use crate::desk::{self, Order, Origin, Storing};
use crate::encoding::Encoders;
use crate::error::DrawError;
use crate::wire::proto::{DrawRequest, Storing as StoringCode};

/// Workers that share a picture at most: each makes the light and the mask of all of it.
const MOST_PARTS: usize = 8;
/// Strips begin at multiples of this, as wide as the engine's screen tiles.
const STEP_PX: u32 = 16;
/// Pictures that are put together at the same time; more are drawn whole. One of 7680 x 4320 holds 133 MB of pixels here,
/// and at most as many again of strips.
const MOST_AT_ONCE: usize = 2;
/// Bytes that a decoder may use besides the pixels.
const DECODER_BYTES: u64 = 4 << 20;

/// What it takes to put pictures together.
pub(super) struct Parts {
    store: Store,
    encoders: Encoders,
    room: Semaphore,
    together: IntCounter,
}

/// A picture that several workers share.
pub(super) struct Sharing<'a> {
    /// Those who draw it first, then those who are asked if one of them does not.
    members: Vec<Arc<Member>>,
    strips: Vec<Part>,
    _room: SemaphorePermit<'a>,
}

impl Parts {
    pub(super) fn new(store: Store, registry: &Registry) -> Result<Self, prometheus::Error> {
        let together = IntCounter::new(
            "fluxglobe_render_fleet_put_together_total",
            "Large pictures put together from parts of several workers.",
        )?;
        registry.register(Box::new(together.clone()))?;
        Ok(Self {
            store,
            encoders: Encoders::on_all_cores(),
            room: Semaphore::new(MOST_AT_ONCE),
            together,
        })
    }
}

impl Inner {
    /// Who draws what of a picture, if it is large and several workers have a turn for it now.
    pub(super) fn sharing<'a>(
        &'a self,
        job: &RenderJob,
        order: Order,
        members: &[Arc<Member>],
    ) -> Option<Sharing<'a>> {
        let size_px = job.view.size_px();
        let [width, height] = size_px.map(u64::from);
        let is_large = width * height > u64::from(self.settings.render_parts_above);
        // Whoever has not looked in the store has a worker look there first.
        if !is_large || order.part.is_some() || order.storing == Storing::LookUpAndKeep {
            return None;
        }
        let (mut in_order, rest): (Vec<_>, Vec<_>) =
            members.iter().map(Arc::clone).partition(|m| m.is_ready());
        let strips = strips(size_px, in_order.len().min(MOST_PARTS));
        (strips.len() > 1).then_some(())?;
        in_order.extend(rest);
        Some(Sharing {
            members: in_order,
            strips,
            _room: self.parts.room.try_acquire().ok()?,
        })
    }

    /// Has the strips of a picture drawn, puts them together, and keeps the picture if it is to be.
    pub(super) async fn put_together(
        &self,
        job: &RenderJob,
        order: Order,
        sharing: &Sharing<'_>,
        request: &DrawRequest,
        deadline: Instant,
    ) -> Result<Picture, FleetError> {
        let drawn = |(turn, strip): (usize, &Part)| {
            let mut members = sharing.members.clone();
            members.rotate_left(turn);
            let (strip, request) = (*strip, strip_request(request, *strip));
            async move {
                let picture = self.ask(members, &request, deadline).await?;
                let decoding = move || decoded(&picture.bytes, strip.size_px);
                let strip_px = self.parts.encoders.run((), decoding).await;
                let rgba8 = strip_px.map_err(|e| failed(&e))??;
                Ok::<_, FleetError>((turn, strip, rgba8, picture.worker, picture.lifted))
            }
        };
        let mut drawing: FuturesUnordered<_> =
            sharing.strips.iter().enumerate().map(drawn).collect();
        let mut image = Image::transparent(job.view.size_px());
        let mut workers = vec![String::new(); sharing.strips.len()];
        let mut lifted = Lifted::default();
        while let Some(drawn) = drawing.next().await {
            let (turn, strip, rgba8, worker, of_all) = drawn?;
            // The same from all of them.
            lifted = of_all;
            image.paste(strip.origin_px, strip.size_px, &rgba8);
            workers[turn] = worker;
        }
        drop(drawing);
        workers.dedup();
        let worker = workers.join(", ");
        let annotated = job.annotations.as_ref().map(|_some| (job.clone(), lifted));
        let encoders = &self.parts.encoders;
        let encoding = encoders.encode(annotated, image, order.encoding, ());
        let bytes = encoding.await.map_err(|e| failed(&e))?;
        self.parts.together.inc();
        let (bytes, origin) = self.kept(job, order, bytes, &worker).await;
        Ok(Picture {
            bytes,
            origin,
            worker,
            lifted,
        })
    }

    async fn kept(
        &self,
        job: &RenderJob,
        order: Order,
        bytes: Bytes,
        worker: &str,
    ) -> (Bytes, Origin) {
        if order.storing == Storing::Nothing {
            return (bytes, Origin::Drawn);
        }
        match desk::keep(&self.parts.store, job, bytes.clone(), worker).await {
            Ok(None) => (bytes, Origin::Drawn),
            Ok(Some(theirs)) => (theirs, Origin::Stored),
            Err(error) => {
                let error = error.in_full();
                tracing::warn!(error, "a picture is given out but not kept");
                (bytes, Origin::Drawn)
            }
        }
    }
}

/// Upright strips of a picture, as many as there are to draw them and nearly equal.
fn strips([width, height]: [u32; 2], count: usize) -> Vec<Part> {
    let steps = width.div_ceil(STEP_PX);
    let count = u32::try_from(count)
        .unwrap_or(u32::MAX)
        .clamp(1, steps.max(1));
    let edge = |strip: u32| (steps * strip / count * STEP_PX).min(width);
    let strip = |number: u32| Part {
        origin_px: [edge(number), 0],
        size_px: [edge(number + 1) - edge(number), height],
    };
    (0..count).map(strip).collect()
}

fn strip_request(request: &DrawRequest, strip: Part) -> DrawRequest {
    DrawRequest {
        storing: StoringCode::from(Storing::Nothing).into(),
        jpeg_quality: crate::wire::jpeg_quality(Encoding::Png),
        part: Some(strip.into()),
        ..request.clone()
    }
}

/// Pixels of a strip as RGBA8.
fn decoded(png: &Bytes, size_px: [u32; 2]) -> Result<Vec<u8>, FleetError> {
    let bad = |e: image::ImageError| FleetError::Failed(format!("a part cannot be read: {e}"));
    let pixels_bytes = u64::from(size_px[0]) * u64::from(size_px[1]) * 4;
    let mut limits = Limits::no_limits();
    limits.max_alloc = Some(pixels_bytes + DECODER_BYTES);
    let decoder = PngDecoder::with_limits(std::io::Cursor::new(png), limits).map_err(bad)?;
    let (width, height) = decoder.dimensions();
    if [width, height] != size_px || decoder.color_type() != ColorType::Rgba8 {
        let text = format!(
            "a part of {width} x {height} pixels came for one of {} x {}",
            size_px[0], size_px[1]
        );
        return Err(FleetError::Failed(text));
    }
    let mut rgba8 = vec![0; pixels_bytes as usize];
    decoder.read_image(&mut rgba8).map_err(bad)?;
    Ok(rgba8)
}

fn failed(error: &DrawError) -> FleetError {
    FleetError::Failed(error.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_cover_a_picture_once_and_are_nearly_equal() {
        // Of a small picture not every worker has a strip.
        for (size_px, count, strip_count) in [
            ([3840, 2160], 2, 2),
            ([7680, 4320], 7, 7),
            ([4097, 1100], 3, 3),
            ([20, 9], 8, 2),
            ([1, 1], 3, 1),
        ] {
            let strips = strips(size_px, count);
            assert_eq!(strips.len(), strip_count, "{size_px:?}");
            let mut end = 0;
            for strip in &strips {
                assert_eq!(strip.origin_px, [end, 0], "{size_px:?}");
                assert_eq!(strip.size_px[1], size_px[1]);
                assert!(strip.is_within(size_px), "{strip:?} of {size_px:?}");
                end += strip.size_px[0];
            }
            assert_eq!(end, size_px[0]);
            let widths = strips.iter().map(|strip| strip.size_px[0]);
            let (least, most) = (widths.clone().min().unwrap(), widths.max().unwrap());
            assert!(
                most - least <= 2 * STEP_PX,
                "{size_px:?}: {least} to {most}"
            );
        }
        assert_eq!(strips([3840, 2160], 2)[1].origin_px, [1920, 0]);
    }

    #[test]
    fn what_is_no_part_of_the_asked_size_is_refused() {
        let png = Image::transparent([8, 4]).encode_png().unwrap();
        assert_eq!(decoded(&png, [8, 4]).unwrap().len(), 8 * 4 * 4);
        let other = decoded(&png, [4, 8]).unwrap_err().to_string();
        assert!(other.contains("8 x 4"), "{other}");
        assert!(decoded(&png.slice(..png.len() / 2), [8, 4]).is_err());
        assert!(decoded(&Bytes::from_static(b"no PNG"), [8, 4]).is_err());
    }
}
