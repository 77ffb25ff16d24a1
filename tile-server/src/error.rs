//! The failures of this server, and the one place where a failure becomes a status and a text for users.

use std::any::Any;
use std::net::SocketAddr;
use std::sync::Arc;

use axum::Json;
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use contract::ContractError;
use contract::product::ProductId;
use legend::LegendError;
use serde::Serialize;
use storage::StorageError;
use utoipa::ToSchema;

use crate::backend::{BackendError, Class};

/// How long a client is asked to wait when there is too much to do, seconds: a picture takes well under one.
const RETRY_BUSY_S: u16 = 1;
/// How long a client is asked to wait when a part does not answer, seconds.
const RETRY_UNAVAILABLE_S: u16 = 5;

/// The body of every answer that is none.
#[derive(Debug, Serialize, ToSchema)]
pub(crate) struct Refusal {
    /// What failed, on which object, and what would be valid; one line for people.
    error: String,
}

/// What users are told of a store that may answer later.
const AWAY: &str = "the store does not answer at the moment";

/// Most names that a refusal lists.
const NAMES: usize = 20;

/// Names with commas, the first of many.
fn names(all: &[ProductId]) -> String {
    let shown: Vec<&str> = all.iter().take(NAMES).map(ProductId::as_str).collect();
    match all.len() - shown.len() {
        _ if all.is_empty() => "none".to_owned(),
        0 => shown.join(", "),
        more => format!("{} and {more} more", shown.join(", ")),
    }
}

/// Lies beside an answer that is none since a part is away or ends, and not since there is too much to do: both are 503.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Away;

/// Why a request has no answer.
#[derive(Debug, Clone, thiserror::Error)]
pub enum ServerError {
    /// A part of the address is no value of its type.
    #[error(transparent)]
    Contract(#[from] ContractError),
    /// The address cannot be taken apart.
    #[error("the address is not valid: {reason}")]
    Address { reason: String },
    /// A parameter that must be there is not.
    #[error("parameter {name:?} is missing: {wanted}")]
    Missing {
        name: &'static str,
        wanted: &'static str,
    },
    /// No such product.
    #[error("there is no product {name:?}; /api/products lists those there are")]
    UnknownProduct { name: String },
    /// A version stands where a product's name belongs.
    #[error(
        "{version:?} is a version and no product: name the product alone, {product}, and the version by the parameter manifest={version} \
         (with_manifest or minus_manifest for that of a second product); /api/openapi.json describes them"
    )]
    VersionInName { product: String, version: String },
    /// The product has no steps yet.
    #[error("product {name} has no steps yet")]
    EmptyProduct { name: String },
    /// No such version of a product.
    #[error(
        "there is no version {manifest:?}, or it is kept no more; /api/products names the newest ones"
    )]
    UnknownVersion { manifest: String },
    /// A product whose values lie in a store of others.
    #[error("{name} is attached to a store of others, which holds its values: {place}")]
    Attached { name: String, place: String },
    /// No such way of drawing the product.
    #[error("product {product} has no layer {mode:?}; it has {offered}")]
    UnknownMode {
        product: String,
        mode: String,
        offered: String,
    },
    /// Particles drift with a vector, and this product is a part of none.
    #[error(
        "product {product} is not drawn as a flow: that needs the eastward part of a current, NAME-east, and its northward part NAME-north on the same grid"
    )]
    NoVector { product: String },
    /// Nothing at the address.
    #[error("there is nothing at this address; /api/openapi.json describes those there are")]
    UnknownAddress,
    /// The value has none of the bytes that are asked for.
    #[error("there are {length} bytes here, and none of those in the header Range")]
    NoRange { length: u64 },
    /// The file is another one than the client wants.
    #[error(
        "the file here is not the one that the header If-Match or If-Unmodified-Since asks for; ask without it"
    )]
    Changed,
    /// This server has no observations.
    #[error("there are no observations here")]
    NoObservations,
    /// No observations of this data set.
    #[error("there is no data set {:?}; there are {}", .name.as_str(), names(.known))]
    UnknownDataset {
        name: ProductId,
        known: Vec<ProductId>,
    },
    /// More viewers wait for news than are served.
    #[error("too many viewers wait for news; please try again later")]
    TooManyListeners,
    /// More streams are open than are served.
    #[error("too many cameras are followed at the moment; please try again in a moment")]
    TooManyStreams,
    /// The address speaks WebSocket alone.
    #[error("this address is a WebSocket (RFC 6455): {reason}")]
    NoWebSocket { reason: String },
    /// This server ends.
    #[error("this server is stopping; please ask again in a moment")]
    Stopping,
    /// Only reading is possible.
    #[error("this address can be read only: use GET or HEAD")]
    ReadOnly,
    /// Only asking is possible, with a geometry or without.
    #[error("this address can be asked only: use GET or HEAD, or POST with GeoJSON")]
    AskedOnly,
    /// The request carries more than is read.
    #[error("requests to this address carry at most {limit_bytes} bytes")]
    BodyTooLarge { limit_bytes: u64 },
    /// What the request carries is said to be something else than a geometry.
    #[error(
        "geometries are sent as they are, as content-type application/geo+json or application/json"
    )]
    NoGeoJson,
    /// No form of an answer that there is suits who asks.
    #[error(
        "answers are sent as they are, or compressed by gzip: let the header Accept-Encoding allow one of both, without \"identity;q=0\" or \"*;q=0\", or leave it out"
    )]
    NoEncoding,
    /// What the request carries cannot be taken apart.
    #[error("the body is not valid: {reason}")]
    Body { reason: String },
    /// The client has the answer.
    #[error("the answer is still the one that has this tag")]
    Unchanged,
    /// More work than the queue takes.
    #[error("there is too much to do at the moment; please try again in a moment")]
    Busy,
    /// It took too long.
    #[error("the answer took longer than {limit_s} s")]
    TimedOut { limit_s: u64 },
    /// A backend failed.
    #[error(transparent)]
    Backend(#[from] BackendError),
    /// The store does not answer, and what is in memory is not enough.
    #[error("the store does not answer, and without it no picture was drawn within {limit_s} s")]
    StoreAway { limit_s: u64 },
    /// The store failed while a cube was read, and may answer later.
    #[error("{what}")]
    CubeAway { what: String },
    /// The store failed.
    #[error(transparent)]
    Storage(Arc<StorageError>),
    /// A defect of this server or of a backend.
    #[error("{what}")]
    Defect { what: String },
}

impl From<LegendError> for ServerError {
    fn from(error: LegendError) -> Self {
        Self::Defect {
            what: error.to_string(),
        }
    }
}

impl From<StorageError> for ServerError {
    fn from(error: StorageError) -> Self {
        Self::Storage(Arc::new(error))
    }
}

impl ServerError {
    /// A part of the address that is no value of its type.
    pub fn invalid(what: &'static str, text: &str, reason: impl Into<String>) -> Self {
        Self::Contract(ContractError::invalid(what, text, reason))
    }

    /// A panic of `what`, with what it said.
    pub(crate) fn panicked(what: &str, payload: &(dyn Any + Send)) -> Self {
        let text = payload.downcast_ref::<String>().map(String::as_str);
        let text = text
            .or_else(|| payload.downcast_ref::<&str>().copied())
            .unwrap_or("without a text");
        Self::Defect {
            what: format!("{what} panicked: {text}"),
        }
    }

    /// What it means for who asked.
    pub fn status(&self) -> StatusCode {
        match self {
            Self::Contract(_)
            | Self::Address { .. }
            | Self::Body { .. }
            | Self::Missing { .. }
            | Self::NoVector { .. } => StatusCode::BAD_REQUEST,
            Self::UnknownProduct { .. }
            | Self::VersionInName { .. }
            | Self::EmptyProduct { .. }
            | Self::UnknownVersion { .. }
            | Self::Attached { .. }
            | Self::UnknownMode { .. }
            | Self::UnknownAddress
            | Self::NoObservations
            | Self::UnknownDataset { .. } => StatusCode::NOT_FOUND,
            Self::ReadOnly | Self::AskedOnly => StatusCode::METHOD_NOT_ALLOWED,
            Self::NoGeoJson => StatusCode::UNSUPPORTED_MEDIA_TYPE,
            Self::NoEncoding => StatusCode::NOT_ACCEPTABLE,
            Self::Unchanged | Self::Changed => StatusCode::PRECONDITION_FAILED,
            Self::BodyTooLarge { .. } => StatusCode::PAYLOAD_TOO_LARGE,
            Self::NoRange { .. } => StatusCode::RANGE_NOT_SATISFIABLE,
            Self::Busy
            | Self::TooManyListeners
            | Self::TooManyStreams
            | Self::Stopping
            | Self::StoreAway { .. }
            | Self::CubeAway { .. } => StatusCode::SERVICE_UNAVAILABLE,
            Self::NoWebSocket { .. } => StatusCode::UPGRADE_REQUIRED,
            Self::TimedOut { .. } => StatusCode::GATEWAY_TIMEOUT,
            Self::Storage(error) if error.is_retryable() => StatusCode::SERVICE_UNAVAILABLE,
            Self::Storage(_) | Self::Defect { .. } => StatusCode::INTERNAL_SERVER_ERROR,
            Self::Backend(error) => match error.class {
                Class::BadRequest => StatusCode::BAD_REQUEST,
                Class::NotFound => StatusCode::NOT_FOUND,
                Class::Busy | Class::Unavailable => StatusCode::SERVICE_UNAVAILABLE,
                Class::Upstream => StatusCode::BAD_GATEWAY,
                Class::Internal => StatusCode::INTERNAL_SERVER_ERROR,
            },
        }
    }

    /// May the same request succeed later?
    pub fn is_retryable(&self) -> bool {
        self.retry_after_s().is_some()
    }

    /// Is who asked sent away for others who ask?
    fn is_full(&self) -> bool {
        match self {
            Self::Busy | Self::TooManyListeners | Self::TooManyStreams => true,
            Self::Backend(error) => error.class == Class::Busy,
            _ => false,
        }
    }

    fn retry_after_s(&self) -> Option<u16> {
        match self {
            Self::Busy => Some(RETRY_BUSY_S),
            Self::Backend(BackendError {
                retry_after: Some(pause),
                ..
            }) => Some(pause.as_secs_f64().ceil().clamp(1.0, 3600.0) as u16),
            Self::Backend(error) if error.class == Class::Busy => Some(RETRY_BUSY_S),
            Self::TimedOut { .. } => Some(RETRY_UNAVAILABLE_S),
            _ if self.status() == StatusCode::SERVICE_UNAVAILABLE => Some(RETRY_UNAVAILABLE_S),
            _ => None,
        }
    }

    /// The text for users: never that of a low-level error.
    pub(crate) fn text(&self) -> String {
        match self {
            Self::Storage(error) if error.is_retryable() => AWAY.to_owned(),
            Self::CubeAway { .. } => AWAY.to_owned(),
            _ if self.status() == StatusCode::INTERNAL_SERVER_ERROR => {
                "something went wrong on our side; the server's log says more".to_owned()
            }
            _ => self.to_string(),
        }
    }
}

impl IntoResponse for ServerError {
    fn into_response(self) -> Response {
        let status = self.status();
        if status.is_server_error() {
            let cause = std::error::Error::source(&self).map(ToString::to_string);
            tracing::warn!(status = status.as_u16(), error = %self, cause, "a request failed");
        }
        let mut response = (status, Json(Refusal { error: self.text() })).into_response();
        if status == StatusCode::SERVICE_UNAVAILABLE && !self.is_full() {
            response.extensions_mut().insert(Away);
        }
        let headers = response.headers_mut();
        headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
        if let Some(seconds) = self.retry_after_s() {
            headers.insert(header::RETRY_AFTER, seconds.into());
        }
        if let Self::NoRange { length } = &self {
            // What there is, so that who asks need not ask for all to know (RFC 9110, 15.5.17).
            let all = HeaderValue::try_from(format!("bytes */{length}"));
            headers.insert(header::CONTENT_RANGE, all.expect("digits are printable"));
        }
        if matches!(self, Self::TooManyStreams) {
            // Who has no stream keeps no connection from others either.
            headers.insert(header::CONNECTION, HeaderValue::from_static("close"));
        }
        if status == StatusCode::UPGRADE_REQUIRED {
            headers.insert(header::UPGRADE, HeaderValue::from_static("websocket"));
        }
        if status == StatusCode::METHOD_NOT_ALLOWED {
            let allowed = match self {
                Self::AskedOnly => "GET, HEAD, POST",
                _ => "GET, HEAD",
            };
            headers.insert(header::ALLOW, HeaderValue::from_static(allowed));
        }
        response
    }
}

/// Why the server does not start or stops.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// Somebody else listens there.
    #[error("port {} is in use by another program; choose another with --listen", address.port())]
    PortTaken { address: SocketAddr },
    /// The address cannot be listened on.
    #[error("cannot listen on {address}: {source}; choose another address with --listen")]
    Listen {
        address: SocketAddr,
        source: std::io::Error,
    },
    /// A metric is registered twice: two servers share one registry.
    #[error("cannot register metrics: {0}")]
    Metrics(#[from] prometheus::Error),
    /// The listening socket failed.
    #[error("the server stopped: {0}")]
    Stopped(#[source] std::io::Error),
}

impl ServeError {
    /// May the same start succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::PortTaken { .. } | Self::Stopped(_) => true,
            Self::Listen { .. } | Self::Metrics(_) => false,
        }
    }
}
