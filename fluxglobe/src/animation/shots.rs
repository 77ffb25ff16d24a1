//! The pictures of an animation: which job is the one of each number.

use anyhow::{Result, bail};
use contract::annotation::AnnotationWishes;
use contract::context::Relief;
use contract::job::{Mode, RenderJob, Style, View};
use contract::manifest::Manifest;
use contract::picture::{PictureSources, shown_time};
use contract::sun::SunChoice;
use contract::time::TimeMs;
use serde::{Deserialize, Serialize};

use super::path::CameraPath;
use crate::picture::Vector;

/// Most pictures: ten minutes at 60 a second.
const MOST_SHOTS: u32 = 36_000;
/// Most pixels of all pictures: those of ten minutes of 4K at 60 a second.
const MOST_PIXELS: u64 = 36_000 * 3840 * 2160;

/// An animation as numbered jobs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Shots {
    /// The version of the product that is drawn.
    pub(super) product: Manifest,
    /// Its accumulated carbon.
    pub(super) accumulated: Option<Manifest>,
    /// The last instant at which that holds; none where it was derived from this version.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) accumulated_until: Option<TimeMs>,
    /// The northward part of its vector, in the mode flow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) northward: Option<Manifest>,
    /// The vector whose trails lie on the sea surface.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) vector: Option<Vector>,
    /// Instant of picture 0.
    pub(super) from: TimeMs,
    /// First instant after the animation.
    pub(super) to: TimeMs,
    pub(super) mode: Mode,
    /// View of picture 0.
    pub(super) view: View,
    pub(super) style: Style,
    /// Each picture has the sun of its own instant.
    #[serde(default)]
    pub(super) sun_of_time: bool,
    /// What is drawn over each picture, with the date of its own instant.
    #[serde(default, skip_serializing_if = "AnnotationWishes::is_empty")]
    pub(super) annotations: AnnotationWishes,
    /// What lies below.
    #[serde(default)]
    pub(super) relief: Option<Relief>,
    pub(super) fps: u16,
    pub(super) count: u32,
    /// Degrees that the camera moves east in all.
    pub(super) turn_deg: f64,
    /// The way of the camera, instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) path: Option<CameraPath>,
}

impl Shots {
    /// Pictures of so many seconds.
    pub(super) fn count_of(seconds: f64, fps: u16) -> Result<u32> {
        let count = (seconds * f64::from(fps)).round();
        if !(1.0..=f64::from(MOST_SHOTS)).contains(&count) {
            bail!(
                "{seconds} s at {fps} pictures a second are {count} pictures; an animation has 1 to {MOST_SHOTS}"
            );
        }
        Ok(count as u32)
    }

    pub(super) fn count(&self) -> u32 {
        self.count
    }

    /// Checks the size of the whole and the first and last job.
    pub(super) fn validate(&self) -> Result<()> {
        if !self.turn_deg.is_finite() || self.turn_deg.abs() > 36_000.0 {
            bail!(
                "the camera moves at most 36000 degrees, not {}",
                self.turn_deg
            );
        }
        self.job(0)?;
        let [width, height] = self.view.size_px().map(u64::from);
        let pixels = width * height * u64::from(self.count);
        if pixels > MOST_PIXELS {
            bail!(
                "{} pictures of {width} x {height} are {pixels} pixels, at most {MOST_PIXELS} are drawn; make them fewer or smaller",
                self.count
            );
        }
        self.job(self.count - 1)?;
        Ok(())
    }

    /// The instant of a picture: whole milliseconds, so that the same animation is always the same jobs.
    pub(super) fn time(&self, number: u32) -> Result<TimeMs> {
        let (from_ms, to_ms) = (i128::from(self.from.ms()), i128::from(self.to.ms()));
        let ms = from_ms + (to_ms - from_ms) * i128::from(number) / i128::from(self.count);
        Ok(TimeMs::new(i64::try_from(ms)?)?)
    }

    /// The view of a picture.
    fn view(&self, number: u32) -> Result<View> {
        if let Some(path) = &self.path {
            let seconds = f64::from(number) / f64::from(self.fps);
            return path.view(seconds, self.view.size_px());
        }
        let mut view = self.view;
        if let View::Globe { lon_deg, .. } = &mut view {
            let turned = *lon_deg + self.turn_deg * f64::from(number) / f64::from(self.count);
            // A camera that does not move keeps its longitude to the bit.
            if self.turn_deg != 0.0 {
                *lon_deg = (turned + 180.0).rem_euclid(360.0) - 180.0;
            }
        }
        Ok(view)
    }

    /// The job of a picture.
    pub(super) fn job(&self, number: u32) -> Result<RenderJob> {
        let view = self.view(number)?;
        let time = self.time(number)?;
        let mut style = self.style;
        if self.sun_of_time {
            style.sun = SunChoice::OfTime.instead_of(style.sun, time);
        }
        // As the picture alone has it: the nearest instant that the product covers.
        let shown = shown_time(&self.product, Some(time))?;
        let holds = self.accumulated_until.is_none_or(|until| shown <= until);
        let sources = PictureSources {
            product: &self.product,
            accumulated: self.accumulated.as_ref().filter(|_| holds),
            northward: self.northward.as_ref(),
            trails: self.vector.as_ref().map(Vector::trails),
            relief: self.relief.clone(),
        };
        let job = sources.job(self.mode, view, time, style)?;
        Ok(sources.annotated(job, shown, self.annotations)?)
    }
}
