//! A render job as an answer: the PNG, or "your copy is still right", with the headers caches go by and those that say
//! what instant is shown.

use axum::body::{Body, Bytes};
use axum::http::{HeaderMap, HeaderName, HeaderValue, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use contract::digest::Digest;
use contract::job::RenderJob;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};

use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::metrics::Source;
use crate::pictures::Pictures;
use crate::request;

/// An address means "the newest version", so a copy may be used unasked only as long as nobody minds a late change.
pub(crate) const CACHE_CONTROL: &str = "public, max-age=60";
/// An address that names everything that shapes its answer has one answer for ever.
pub(crate) const CACHE_CONTROL_PINNED: &str = "public, max-age=31536000, immutable";

/// The instant that a picture shows.
pub(crate) const SHOWN_TIME: HeaderName = HeaderName::from_static("fluxglobe-time");
/// What the product covers; only where another instant was asked for than is shown.
pub(crate) const COVERED: HeaderName = HeaderName::from_static("fluxglobe-time-covered");

/// Accumulated carbon at which heights end; only where particles are lifted.
pub(crate) const HEIGHTS_END: HeaderName = HeaderName::from_static("fluxglobe-heights-end");
/// Pixels that heights end at; only on map tiles so deep that heights to scale may be more.
pub(crate) const HEIGHTS_WITHIN: HeaderName = HeaderName::from_static("fluxglobe-heights-within");

/// Largest tilt with some of the earth's surface in the picture; only where this one has none.
pub(crate) const TILT_WITH_GROUND: HeaderName =
    HeaderName::from_static("fluxglobe-tilt-with-ground");

/// Headers that layers add to an answer.
const MOST_LAYERED: usize = 10;

/// Which instant a picture shows of those that were asked for.
pub(crate) struct Shown {
    /// The instant.
    pub(crate) time: TimeMs,
    /// What there is, if the instant asked for lies outside.
    covered: Option<Period>,
}

impl Shown {
    pub(crate) fn of(layer: &Layer, asked: Option<TimeMs>) -> Self {
        let time = request::shown_time(layer, asked);
        Self {
            time,
            covered: asked
                .is_some_and(|asked| asked != time)
                .then_some(layer.extent),
        }
    }

    /// Is another instant shown than was asked for?
    pub(crate) fn is_another(&self) -> bool {
        self.covered.is_some()
    }

    fn headers(&self) -> HeaderMap {
        let value = |text: String| text.parse().expect("times are printable");
        let mut headers = HeaderMap::new();
        headers.insert(SHOWN_TIME, value(self.time.to_string()));
        if let Some(Period { start, end }) = self.covered {
            headers.insert(COVERED, value(format!("{start}/{end}")));
        }
        headers
    }
}

/// Where heights of a picture end, for those who read no height bar.
fn heights_headers(job: &RenderJob) -> HeaderMap {
    let value = |text: String| text.parse().expect("numbers and units are printable");
    let mut headers = HeaderMap::new();
    if let Some(kg_m2) = job.heights_end_kg_m2() {
        // A header holds no raised figures.
        let g_m2 = Quantity::AccumulatedCarbon.display().shown(kg_m2);
        headers.insert(
            HEIGHTS_END,
            value(format!("{} g C m-2", (g_m2 * 1e3).round() / 1e3)),
        );
    }
    if let Some(px) = job.heights_within_px() {
        headers.insert(HEIGHTS_WITHIN, value(format!("{px} px")));
    }
    headers
}

/// That nothing but sky, and what rises over the horizon, is to be seen, and how far a camera may be tilted to see more.
fn sky_headers(job: &RenderJob) -> HeaderMap {
    let mut headers = HeaderMap::new();
    if let Some(deg) = job.view.tilt_with_ground_deg() {
        let value = format!("{deg} degrees");
        let value = value.parse().expect("numbers are printable");
        headers.insert(TILT_WITH_GROUND, value);
    }
    headers
}

/// Everything of an answer but the picture. The entity tag is the job's digest: the same job is the same picture, byte for
/// byte, so a client that has it is answered without drawing or reading anything.
pub(crate) struct Head {
    digest: Digest,
    tag: String,
    headers: HeaderMap,
}

impl Head {
    pub(crate) fn of(job: &RenderJob, shown: &Shown, is_pinned: bool) -> Self {
        let digest = job.digest();
        let tag = format!("\"{digest}\"");
        let cache_control = if is_pinned {
            CACHE_CONTROL_PINNED
        } else {
            CACHE_CONTROL
        };
        let mut headers = shown.headers();
        headers.extend(heights_headers(job));
        headers.extend(sky_headers(job));
        let printable = tag.parse().expect("digits are printable");
        headers.insert(header::ETAG, printable);
        headers.insert(
            header::CACHE_CONTROL,
            HeaderValue::from_static(cache_control),
        );
        Self {
            digest,
            tag,
            headers,
        }
    }

    /// The answer to a client that has the picture.
    fn not_modified(&self, pictures: &Pictures, asked: &HeaderMap) -> Option<Response> {
        has_tag(asked, &self.tag).then(|| {
            pictures.hit(Source::Client);
            (StatusCode::NOT_MODIFIED, self.headers.clone()).into_response()
        })
    }

    fn over(&self, picture: Bytes) -> Response {
        let mut response = Response::new(Body::from(picture));
        let headers = response.headers_mut();
        // Those that layers add have room.
        headers.reserve(self.headers.len() + MOST_LAYERED);
        for (name, value) in &self.headers {
            headers.insert(name, value.clone());
        }
        headers.insert(header::CONTENT_TYPE, HeaderValue::from_static("image/png"));
        response
    }

    /// The answer, if nothing must be looked up or drawn for it.
    pub(crate) fn at_once(&self, pictures: &Pictures, asked: &HeaderMap) -> Option<Response> {
        self.not_modified(pictures, asked)
            .or_else(|| Some(self.over(pictures.remembered(&self.digest)?)))
    }

    /// The answer with the picture of a job, which is the one that this is the head of.
    pub(crate) async fn answer(
        &self,
        pictures: &Pictures,
        asked: &HeaderMap,
        job: RenderJob,
    ) -> Result<Response, ServerError> {
        if let Some(answer) = self.not_modified(pictures, asked) {
            return Ok(answer);
        }
        Ok(self.over(pictures.get(self.digest, job).await?))
    }
}

/// Does `If-None-Match` name the tag, or any? Weak comparison, as RFC 9110, 13.1.2 asks for.
pub(crate) fn has_tag(asked: &HeaderMap, tag: &str) -> bool {
    let tag = tag.trim_start_matches("W/");
    let lists = asked
        .get_all(header::IF_NONE_MATCH)
        .into_iter()
        .filter_map(|value| value.to_str().ok());
    lists
        .flat_map(|list| list.split(','))
        .map(str::trim)
        .any(|one| one == "*" || one.trim_start_matches("W/") == tag)
}
