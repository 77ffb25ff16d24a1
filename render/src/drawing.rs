//! One planned picture, or a part of it, piece by piece: on one device, or on all that have nothing else to do.

use std::thread;

use crate::device::Device;
use crate::device_slot::{self, DeviceSlot, Taken};
use crate::error::RenderError;
use crate::frame_cpu;
use crate::image::Image;
use crate::plan::{Part, Plan};
use crate::scene::Scene;
use crate::stages::layout::{LIGHT_GIVEN, LIGHT_OWN};

/// A picture that is planned.
pub(crate) struct Drawing<'a> {
    pub(crate) plan: &'a Plan,
    pub(crate) scene: &'a Scene,
    /// Asked between the pieces.
    pub(crate) is_wanted: &'a (dyn Fn() -> bool + Sync),
}

/// A piece of a picture and its pixels as RGBA8, red lowest.
type Piece = (Part, Vec<u8>);

impl Drawing<'_> {
    /// Draws a part of it on the device that was taken, or with the twins if none is; a large one also on the devices of
    /// `slots` that are idle.
    pub(crate) fn draw(
        &self,
        part: Part,
        taken: Option<Taken<'_>>,
        slots: &[DeviceSlot],
    ) -> Result<Image, RenderError> {
        let pieces = part.pieces();
        let mut drawn = match taken {
            None => self.with_twins(&pieces)?,
            Some(taken) => {
                let others = device_slot::idle(slots, pieces.len() - 1);
                self.on_devices(&taken, &others, &pieces)?
            }
        };
        let [width, height] = part.size_px;
        if let [(_whole, rgba8)] = &mut drawn[..] {
            let rgba8 = std::mem::take(rgba8);
            return Ok(Image {
                width,
                height,
                rgba8,
            });
        }
        let mut image = Image::transparent(part.size_px);
        for (piece, rgba8) in &drawn {
            let [x, y] = piece.origin_px;
            let [left, top] = part.origin_px;
            image.paste([x - left, y - top], piece.size_px, rgba8);
        }
        Ok(image)
    }

    fn with_twins(&self, pieces: &[Part]) -> Result<Vec<Piece>, RenderError> {
        self.each(pieces, |piece| {
            frame_cpu::draw(self.plan, piece, self.scene)
        })
    }

    /// One device for this thread, whose steps are timed, and others beside it: each draws a run of pieces.
    fn on_devices(
        &self,
        own: &Taken<'_>,
        others: &[Taken<'_>],
        pieces: &[Part],
    ) -> Result<Vec<Piece>, RenderError> {
        let mut runs = pieces.chunks(pieces.len().div_ceil(1 + others.len()));
        let first = runs.next().unwrap_or_default();
        let drawn: Vec<Result<Vec<Piece>, RenderError>> = thread::scope(|scope| {
            let begin = |(taken, run)| {
                let taken: &Taken<'_> = taken;
                scope.spawn(move || self.on_device(&taken.device, run))
            };
            let begun: Vec<_> = others.iter().zip(runs).map(begin).collect();
            let own = self.on_device(&own.device, first);
            let end = |thread: thread::ScopedJoinHandle<'_, _>| match thread.join() {
                Ok(drawn) => drawn,
                Err(panic) => std::panic::resume_unwind(panic),
            };
            std::iter::once(own)
                .chain(begun.into_iter().map(end))
                .collect()
        });
        let drawn: Vec<Vec<Piece>> = drawn.into_iter().collect::<Result<_, _>>()?;
        Ok(drawn.into_iter().flatten().collect())
    }

    fn on_device(&self, device: &Device, pieces: &[Part]) -> Result<Vec<Piece>, RenderError> {
        let Self { plan, scene, .. } = *self;
        if pieces.len() == 1 || plan.params.lighting.mode != LIGHT_OWN {
            return self.each(pieces, |piece| device.draw(plan, piece, scene, None));
        }
        // Pieces of one picture lie in one light.
        let light = device.light(plan, scene)?;
        let mut lit = plan.clone();
        lit.params.lighting.mode = LIGHT_GIVEN;
        self.each(pieces, |piece| {
            device.draw(&lit, piece, scene, Some(&light))
        })
    }

    fn each(
        &self,
        pieces: &[Part],
        draw: impl Fn(Part) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Vec<Piece>, RenderError> {
        let draw = |&piece: &Part| {
            if !(self.is_wanted)() {
                return Err(RenderError::NotWanted);
            }
            Ok((piece, draw(piece)?))
        };
        pieces.iter().map(draw).collect()
    }
}
