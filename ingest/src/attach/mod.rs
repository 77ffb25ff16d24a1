//! A store of others in, a product of its values out that are not copied: each step is read once and named by its digest, and
//! in the place of its field lies where it is ([`storage::attached`]).
//!
//! ```text
//! Request
//!   address   Objects      what may be read, read only
//!   survey    Plan         what is read and what that becomes: as of a file (plan)
//!   steps     NewStep      each decoded and checked as of a file, in bands of its chunks, its digest taken, a reference stored
//!   publish   Manifest     names them
//! ```
//! What is read later goes the same way back ([`ForeignFields`]), and values that are not those of the digest never come out.

mod address;
mod bands;
mod fields;
mod kept;
mod moved;
mod publish;
mod reading;
mod steps;
mod survey;

use contract::manifest::ManifestId;
use contract::masked::MaskedCells;
use contract::product::ProductId;
use storage::Store;
use storage::attached::{Attachment, StoreKind};

use crate::error::{IngestError, Rejection, Stop};
use crate::limits::Limits;
use crate::plan::profile::Profile;

pub use fields::ForeignFields;

use survey::Survey;

/// What is to be attached, and as what.
#[derive(Debug, Clone)]
pub struct Request {
    /// A folder, or a URL of a bucket.
    pub address: String,
    /// The array of the values; a profile names it by itself.
    pub variable: Option<String>,
    /// Name of a shipped profile or a profile file, where the CF conventions do not say enough.
    pub profile: Option<String>,
    /// The product; by the name of the variable or the profile's, if absent.
    pub product: Option<ProductId>,
    /// Which index is read of dimensions beside time and the map.
    pub indexes: Vec<(String, u64)>,
    /// May it follow on what the product was attached to before, where that was another store, array or index?
    pub replace: bool,
}

/// What came of it.
#[derive(Debug, Clone)]
pub struct Attached {
    /// The version of the product.
    pub version: ManifestId,
    /// Was it published now, or there already?
    pub is_new: bool,
    /// Where the values lie.
    pub place: String,
    /// What kind of store it is.
    pub kind: StoreKind,
    /// Of a repository the state that is read.
    pub snapshot: Option<String>,
    /// Steps of the version.
    pub steps: usize,
    /// Steps that were read.
    pub read: usize,
    /// Bytes that were stored for them: references, what they refer to, and the domain.
    pub stored_bytes: u64,
    /// What was masked in the steps that were read.
    pub masked: MaskedCells,
    /// What was taken for granted, because nothing there says it, and which steps are left out. One line each.
    pub assumptions: Vec<String>,
}

/// Why nothing was attached.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// What lies there is not what can be read rightly.
    #[error("{0}")]
    Refused(Rejection),
    /// The program, the store or the store of others failed.
    #[error(transparent)]
    Failed(#[from] IngestError),
}

impl From<Stop> for AttachError {
    fn from(stop: Stop) -> Self {
        match stop {
            Stop::Rejected(rejection) => Self::Refused(rejection),
            Stop::Failed(error) => Self::Failed(error),
        }
    }
}

/// Attaches a store of others; `told` is called with the number of steps that are done and of all.
///
/// The product keeps the versions it has. A product that was landed or computed is refused, so that what is copied and what is
/// not stays apart; so is one that is attached to something else, unless the request says that it is to be replaced.
///
/// # Errors
/// `Refused` with what in the store cannot be read rightly, before anything is published.
pub async fn attach(
    store: &Store,
    request: &Request,
    told: &(dyn Fn(usize, usize) + Send + Sync),
) -> Result<Attached, AttachError> {
    let profile = request.profile.as_deref().map(Profile::find).transpose()?;
    let survey = Survey::of(request, profile.as_ref(), Limits::default()).await?;
    let attached = publish::publish(store, survey, request.replace, told).await?;
    Ok(attached)
}

/// Attaches anew what a product is attached to: steps that came since, and those that were revised, become its next version.
///
/// # Errors
/// As [`attach`]; and a product that is not attached. Of a store that is no longer there it is said how it is attached elsewhere.
pub async fn refresh(
    store: &Store,
    product: &ProductId,
    told: &(dyn Fn(usize, usize) + Send + Sync),
) -> Result<Attached, AttachError> {
    let refused = |detail: &str| IngestError::Attach {
        product: product.to_string(),
        detail: detail.to_owned(),
    };
    let newest = storage::manifests::latest(store, product).await;
    let newest = newest
        .map_err(IngestError::storage("read the newest manifest"))?
        .ok_or_else(|| refused("there is no such product"))?;
    let before = store.attached_to(&newest).await;
    let before = before.map_err(IngestError::storage("read what it is attached to"))?;
    let Some(before) = before else {
        let detail = "its values are here: nothing of it is attached";
        return Err(refused(detail).into());
    };
    match attach(store, &request_of(&before)?, told).await {
        // What is gone from its address cannot be refreshed.
        Err(AttachError::Refused(refused)) => {
            let gone = moved::gone(&before).await;
            let gone = gone.map(|gone| Rejection::new(refused.reason, gone.place, gone.reason));
            Err(AttachError::Refused(gone.unwrap_or(refused)))
        }
        attached => attached,
    }
}

/// The request that led to an attachment.
fn request_of(before: &Attachment) -> Result<Request, IngestError> {
    let reading = reading::Reading::of(before).map_err(|detail| IngestError::Attach {
        product: before.product.to_string(),
        detail,
    })?;
    Ok(Request {
        address: before.store.clone(),
        variable: Some(before.array.clone()),
        profile: reading.profile,
        product: Some(before.product.clone()),
        indexes: reading.indexes.into_iter().collect(),
        // It is what was attached, however its address may be written by now.
        replace: true,
    })
}
