//! HTTP as clients see it: an address in; status, headers and body out.

use std::time::Duration;

use anyhow::{Context as _, Result};

/// An answer: its status, header lookup and body.
pub struct Answer {
    /// HTTP status.
    pub status: u16,
    /// Content type.
    pub content_type: String,
    /// `ETag`, if any.
    pub etag: Option<String>,
    /// Body.
    pub body: Vec<u8>,
}

impl Answer {
    /// Body as text.
    pub fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    /// Body as JSON.
    pub fn json(&self) -> Result<serde_json::Value> {
        serde_json::from_slice(&self.body).with_context(|| self.text())
    }
}

/// Fetches an address; every status is an answer.
pub fn get(url: &str) -> Result<Answer> {
    read(agent().get(url).call()?)
}

/// Asks an address with a body of GeoJSON; every status is an answer.
pub fn post_geojson(url: &str, body: &str) -> Result<Answer> {
    let request = agent()
        .post(url)
        .header("content-type", "application/geo+json");
    read(request.send(body)?)
}

fn agent() -> ureq::Agent {
    ureq::Agent::config_builder()
        .http_status_as_error(false)
        .timeout_global(Some(Duration::from_mins(2)))
        .build()
        .into()
}

fn read(mut response: ureq::http::Response<ureq::Body>) -> Result<Answer> {
    let header = |name: &str| {
        let value = response.headers().get(name)?;
        value.to_str().ok().map(ToOwned::to_owned)
    };
    let (content_type, etag) = (header("content-type").unwrap_or_default(), header("etag"));
    Ok(Answer {
        status: response.status().as_u16(),
        content_type,
        etag,
        body: response
            .body_mut()
            .with_config()
            .limit(64 << 20)
            .read_to_vec()?,
    })
}
