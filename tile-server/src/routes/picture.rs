//! A render job as an answer: the PNG, or "your copy is still right", with the headers caches go by and those that say
//! what instant is shown.

use axum::http::{HeaderMap, HeaderName, StatusCode, header};
use axum::response::{IntoResponse as _, Response};
use contract::job::RenderJob;
use contract::quantity::Quantity;
use contract::time::{Period, TimeMs};

use crate::catalogue::Layer;
use crate::error::ServerError;
use crate::metrics::Source;
use crate::request;
use crate::state::AppState;

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

/// The picture of a job. The entity tag is the job's digest: the same job is the same picture, byte for byte, so a
/// client that has it is answered without drawing or reading anything.
pub(crate) async fn respond(
    state: &AppState,
    asked: &HeaderMap,
    job: RenderJob,
    shown: Shown,
    is_pinned: bool,
) -> Result<Response, ServerError> {
    let digest = job.digest();
    let tag = format!("\"{digest}\"");
    let cache_control = if is_pinned {
        CACHE_CONTROL_PINNED
    } else {
        CACHE_CONTROL
    };
    let headers = [
        (header::ETAG, tag.clone()),
        (header::CACHE_CONTROL, cache_control.to_owned()),
    ];
    let told = (shown.headers(), heights_headers(&job));
    if has_tag(asked, &tag) {
        state.metrics.hit(Source::Client);
        return Ok((StatusCode::NOT_MODIFIED, headers, told.0, told.1).into_response());
    }
    let picture = state.pictures.get(digest, job).await?;
    let content = [(header::CONTENT_TYPE, "image/png")];
    Ok((headers, told.0, told.1, content, picture).into_response())
}

/// Does `If-None-Match` name the tag? Weak comparison, as RFC 9110, 13.1.2 asks for.
pub(crate) fn has_tag(asked: &HeaderMap, tag: &str) -> bool {
    let tag = tag.trim_start_matches("W/");
    let lists = asked
        .get_all(header::IF_NONE_MATCH)
        .into_iter()
        .filter_map(|value| value.to_str().ok());
    lists
        .flat_map(|list| list.split(','))
        .any(|one| one.trim().trim_start_matches("W/") == tag)
}
