//! What shapes a picture besides what its address says, as a short name: a version of a product and a request in, an edition
//! out. An address that names version, instant and edition is answered with the same bytes for ever, or no longer as one
//! that lasts.
//!
//! An edition is a digest of two things: the versions of all products that the picture is drawn from, and the jobs of the
//! same request for views that are always the same at an instant of the product that is always the same. So it changes
//! with the renderer's version, and with whatever an address leaves unsaid: palettes, ranges and styles of quantities,
//! the camera where none is given, how values between two steps come about. Nobody has to remember to raise a number.

use std::sync::Arc;

use contract::digest::Digest;
use contract::job::{Mode, RenderJob, View};
use contract::manifest::ManifestId;
use contract::picture::PictureRequest;
use contract::time::{Period, TimeMs};
use serde::Serialize;

use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::request::{self, Beside, VectorAt};

/// Hexadecimal digits of an edition: two of one product with the same name are met once in 2^32 releases.
const DIGITS: usize = 16;

/// The name of an edition.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub(crate) struct Edition(String);

/// What an edition is the digest of.
#[derive(Serialize)]
struct Shaped<'a> {
    layer: &'a ManifestId,
    /// What lifts particles, and until when it holds for the version.
    accumulated: Option<(&'a ManifestId, Option<TimeMs>)>,
    northward: Option<&'a ManifestId>,
    /// Both parts of the vector.
    trails: Option<[&'a ManifestId; 2]>,
    // A relief is a field, which its jobs name.
    jobs: Vec<RenderJob>,
}

impl Edition {
    /// That of a request, whatever its view and instant are.
    ///
    /// # Errors
    /// A request that cannot be drawn in `views` at the instant that editions go by.
    pub(crate) fn of(
        layer: &Layer,
        request: &PictureRequest,
        beside: &Beside,
        views: &[View],
    ) -> Result<Self, ServerError> {
        let time = Some(reference_time(layer));
        let trails = beside.trails.as_ref().map(|trails| VectorAt {
            layer: Arc::clone(&trails.layer),
            // Not every vector covers all that the layer does.
            time: trails.time.or(Some(reference_time(&trails.layer))),
        });
        let relief = beside.relief.clone();
        let beside = Beside { relief, trails };
        let job = |&view| {
            let request = PictureRequest {
                view,
                time,
                ..*request
            };
            request::job_of(layer, &request, &beside)
        };
        let is_lifted = !matches!(request.mode, Mode::Map | Mode::Flow);
        let accumulated = layer.accumulated.as_ref().filter(|_| is_lifted);
        let drifts = request.mode == Mode::Flow;
        let northward = layer.northward.as_ref().filter(|_| drifts);
        let trails = beside.trails.as_ref().and_then(|trails| {
            let northward = trails.layer.northward.as_ref()?;
            Some([&trails.layer.id, &northward.id])
        });
        let digest = Digest::of_json(&Shaped {
            layer: &layer.id,
            accumulated: accumulated.map(|lift| (&lift.id, lift.until)),
            northward: northward.map(|part| &part.id),
            trails,
            jobs: views.iter().map(job).collect::<Result<_, _>>()?,
        });
        Ok(Self(digest.to_string()[..DIGITS].to_owned()))
    }

    /// The parameters of an address that names everything that shapes its picture; `time` may be a place holder.
    pub(crate) fn parameters(&self, time: &str, layer: &Layer) -> [String; 3] {
        [
            format!("time={time}"),
            format!("manifest={}", layer.id),
            self.parameter(),
        ]
    }

    /// The parameter that names it.
    pub(crate) fn parameter(&self) -> String {
        format!("edition={}", self.0)
    }
}

/// Three quarters on from the first instant: hardly ever the middle of a step, so that what lies between two counts.
fn reference_time(layer: &Layer) -> TimeMs {
    let later_half = Period {
        start: layer.extent.mid(),
        end: layer.extent.end,
    };
    later_half.mid()
}

/// What an address names of everything that shapes its picture besides look and view.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Named<'a> {
    pub(crate) time: Option<TimeMs>,
    pub(crate) manifest: Option<&'a str>,
    pub(crate) edition: Option<&'a str>,
}

impl Named<'_> {
    /// Is the picture at the address the same for ever? `edition` is asked only where all else is named; one that cannot be
    /// told is none.
    ///
    /// # Errors
    /// An edition that is none.
    pub(crate) fn is_everything(
        &self,
        edition: impl FnOnce() -> Result<Edition, ServerError>,
    ) -> Result<bool, ServerError> {
        let Some(named) = self.edition else {
            return Ok(false);
        };
        let is_digit = |b: u8| matches!(b, b'0'..=b'9' | b'a'..=b'f');
        if named.len() != DIGITS || !named.bytes().all(is_digit) {
            let valid = "16 hexadecimal digits, as /api/products and TileJSON name it";
            return Err(ServerError::invalid("edition", named, valid));
        }
        if self.time.is_none() || self.manifest.is_none() {
            return Ok(false);
        }
        Ok(edition().is_ok_and(|edition| edition.0 == named))
    }
}
