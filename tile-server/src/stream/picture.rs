//! A state's picture: its address read as HTTP reads it, drawn as it is, or as large as can be had in time.

use std::time::Instant;

use axum::http::Uri;
use contract::encoding::Encoding;
use contract::job::RenderJob;

use super::message::{Header, Kind, Picture, State};
use super::pace::Detail;
use crate::error::ServerError;
use crate::extract::UrlQuery;
use crate::routes::globe::{self, GlobeQuery};
use crate::routes::picture::Shown;
use crate::state::AppState;

/// A state that is being drawn.
#[derive(Debug, Clone)]
pub(super) struct Wish {
    pub(super) state: State,
    pub(super) arrived: Instant,
}

impl Wish {
    /// The picture that the address names.
    pub(super) async fn full(self, server: AppState) -> Result<Picture, ServerError> {
        let (job, shown) = job(&server, &self.state.view).await?;
        let bytes = server.pictures.in_passing(&job, Encoding::Png).await?;
        Ok(self.picture(&job, job.view.size_px(), &shown, Encoding::Png, bytes))
    }

    /// The same for a moment, in less detail.
    pub(super) async fn moving(
        self,
        server: AppState,
        detail: Detail,
        quality: u8,
    ) -> Result<Picture, ServerError> {
        let (job, shown) = job(&server, &self.state.view).await?;
        let full_px = job.view.size_px();
        let job = detail.reduce(job);
        let encoding = Encoding::jpeg(quality)?;
        let bytes = server.pictures.in_passing(&job, encoding).await?;
        Ok(self.picture(&job, full_px, &shown, encoding, bytes))
    }

    fn picture(
        self,
        job: &RenderJob,
        [full_width, full_height]: [u32; 2],
        shown: &Shown,
        encoding: Encoding,
        bytes: bytes::Bytes,
    ) -> Picture {
        let [width, height] = job.view.size_px();
        let kind = if encoding.is_stored() {
            Kind::Full
        } else {
            Kind::Moving
        };
        let header = Header {
            id: self.state.id,
            kind,
            format: encoding.media_type(),
            width,
            height,
            full_width,
            full_height,
            view: self.state.view,
            time: shown.is_another().then_some(shown.time),
            took_ms: (self.arrived.elapsed().as_secs_f64() * 1e4).round() / 10.0,
        };
        Picture { header, bytes }
    }
}

/// The job of an address of a view.
async fn job(server: &AppState, address: &str) -> Result<(RenderJob, Shown), ServerError> {
    let uri: Uri = address.parse().map_err(|_bad| ServerError::Address {
        reason: "it is no address".to_owned(),
    })?;
    let path = uri.path().strip_prefix("/globe/");
    let (product, file) = path
        .and_then(|path| path.split_once('/'))
        .filter(|(product, file)| !product.is_empty() && !file.contains('/'))
        .ok_or_else(|| ServerError::Address {
            reason: "a stream shows /globe/PRODUCT/MODE.png?...".to_owned(),
        })?;
    let query: UrlQuery<GlobeQuery> = UrlQuery::of(&uri)?;
    globe::job(server, product, file, &query.0).await
}
