//! Objects of a store in, the same out, but for references, which are read as the fields that they refer to.

use std::fmt::{Debug, Display, Formatter};
use std::ops::Range;
use std::sync::Arc;

use async_trait::async_trait;
use bytes::Bytes;
use contract::digest::Digest;
use contract::key::ObjectKey;
use contract::kind::Kind;
use contract::product::ProductId;
use futures::stream::{self, BoxStream, StreamExt as _};
use object_store::path::Path;
use object_store::{
    Attributes, CopyOptions, Error, GetOptions, GetResult, GetResultPayload, ListResult,
    MultipartUpload, ObjectMeta, ObjectStore, ObjectStoreExt as _, PutMultipartOptions, PutOptions,
    PutPayload, PutResult, Result,
};
use quick_cache::sync::{Cache, DefaultLifecycle};
use quick_cache::{DefaultHashBuilder, OptionsBuilder, Weighter};

use super::attachment::{Attachment, MAX_ATTACHMENT_BYTES};
use super::field::{Rows, is_large};
use super::reference::{MAX_REFERENCE_BYTES, Reference, named};
use super::source::Source;
use crate::StorageError;
use crate::content::{Content, PIECE_BYTES};
use crate::failure::{Cause, Failure};
use crate::off_thread::off_thread;

/// Fields that were read from elsewhere and are kept, bytes of them as fields.
const KEPT_BYTES: u64 = 256 << 20;
/// The same of large ones, in files: who reads a field of many bands asks for each by itself.
const KEPT_FILE_BYTES: u64 = 8 << 30;
/// Of these at least so many are kept, however large they are.
const KEPT_FILES: u64 = 4;
/// Fields that are known to be here, by name.
const KNOWN_FIELDS: usize = 1 << 16;
/// Attachments that are kept.
const KEPT_ATTACHMENTS: usize = 64;
/// The layer in errors.
const NAME: &str = "attached store";

/// What is kept of other stores, for all paths to the same objects.
pub(super) struct Held {
    source: Arc<dyn Source>,
    /// By their path, the bytes that a field of them would be: what one store holds says nothing of another that is to hold the same.
    fields: Cache<String, Content, BySize>,
    /// The same of large ones.
    large: Cache<String, Content, BySize>,
    /// Paths where fields themselves are.
    here: Cache<String, ()>,
    attachments: Cache<(ProductId, Digest), Arc<Attachment>>,
}

#[derive(Clone)]
struct BySize;

impl Weighter<String, Content> for BySize {
    fn weight(&self, _path: &String, content: &Content) -> u64 {
        content.size_bytes().min(KEPT_FILE_BYTES / KEPT_FILES)
    }
}

/// Fields of so many bytes. In one shard: in several, of which there are more the more processors there are, each would have a part of
/// the room that a field may not fit into.
fn kept(bytes: u64) -> Cache<String, Content, BySize> {
    let options = OptionsBuilder::new()
        .shards(1)
        .estimated_items_capacity(KNOWN_FIELDS)
        .weight_capacity(bytes)
        .build()
        .expect("both capacities are given");
    let (hasher, lifecycle) = (DefaultHashBuilder::default(), DefaultLifecycle::default());
    Cache::with_options(options, BySize, hasher, lifecycle)
}

impl Held {
    pub(super) fn new(source: Arc<dyn Source>) -> Self {
        Self {
            source,
            fields: kept(KEPT_BYTES),
            large: kept(KEPT_FILE_BYTES),
            here: Cache::new(KNOWN_FIELDS),
            attachments: Cache::new(KEPT_ATTACHMENTS),
        }
    }
}

/// The layer over what is stored.
pub(super) struct Layer {
    inner: Arc<dyn ObjectStore>,
    held: Arc<Held>,
}

/// A path that may have a reference in its place.
struct Place {
    key: ObjectKey,
    product: ProductId,
    digest: Digest,
    /// What stands before the key.
    before: String,
}

/// The field that a path may be of.
fn place(at: &Path) -> Option<Place> {
    let path = at.as_ref();
    let folder = format!("{}/", Kind::Field.folder());
    let start = path
        .rfind(&format!("/{folder}"))
        .map_or(0, |slash| slash + 1);
    let key: ObjectKey = path.get(start..)?.parse().ok()?;
    let (product, digest) = named(&key)?;
    let before = path[..start].to_owned();
    Some(Place {
        key,
        product,
        digest,
        before,
    })
}

fn failed(failure: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Error {
    Error::Generic {
        store: NAME,
        source: failure.into(),
    }
}

impl Layer {
    pub(super) fn new(inner: Arc<dyn ObjectStore>, held: Arc<Held>) -> Self {
        Self { inner, held }
    }

    /// The reference at a path; none if something else is there.
    async fn reference(&self, at: &Path, place: &Place) -> Result<Option<(ObjectMeta, Reference)>> {
        let found = self.inner.get(at).await?;
        let meta = found.meta.clone();
        if meta.size > MAX_REFERENCE_BYTES {
            self.held.here.insert(at.to_string(), ());
            return Ok(None);
        }
        let content = found.bytes().await?;
        let reference = Reference::of_bytes(&place.key, &content);
        let reference = reference.map_err(|e| {
            let (place, reason) = (place.key.to_string(), e.to_string());
            failed(Failure {
                place,
                reason,
                cause: Cause::Content,
                folder: None,
            })
        })?;
        if reference.is_none() {
            self.held.here.insert(at.to_string(), ());
        }
        Ok(reference.map(|reference| (meta, reference)))
    }

    /// The bytes of the field that a reference refers to.
    async fn content(&self, at: &Path, place: &Place, reference: Reference) -> Result<Content> {
        let read = self.read(place, reference);
        let Held { fields, large, .. } = &*self.held;
        let kept = if is_large(&reference) { large } else { fields };
        kept.get_or_insert_async(at.as_ref(), read).await
    }

    async fn read(&self, place: &Place, reference: Reference) -> Result<Content> {
        let attachment = self.attachment(place, reference.attachment).await?;
        let source = &self.held.source;
        let read = || encoded(&**source, &attachment, &reference, place.digest);
        let mut found = read().await?;
        let may_be_old = match &found {
            Ok(content) => content.is_none(),
            Err(failure) => failure.cause == Cause::Content,
        };
        if may_be_old && source.let_go(&attachment) {
            found = read().await?;
        }
        if let Some(content) = found.map_err(failed)? {
            return Ok(content);
        }
        let period = reference.period;
        // Where a store is gone, each of its chunks is not there, which may mean no data.
        let gone = self.held.source.gone(&attachment, &reference).await;
        let changed = || Failure {
            place: format!("{} step {period}", attachment.place()),
            reason: format!(
                "the store has changed since it was attached: run `fluxglobe attach --refresh {}`",
                place.product
            ),
            cause: Cause::Content,
            folder: attachment.folder().map(str::to_owned),
        };
        Err(failed(gone.unwrap_or_else(changed)))
    }

    async fn attachment(&self, place: &Place, digest: Digest) -> Result<Arc<Attachment>> {
        let name = (place.product.clone(), digest);
        let read = async {
            let key = ObjectKey::raw(&place.product, &digest);
            let path = Path::from(format!("{}{key}", place.before));
            let found = self.inner.get(&path).await?;
            let broken = |reason: String| {
                failed(Failure {
                    place: key.to_string(),
                    reason,
                    cause: Cause::Content,
                    folder: None,
                })
            };
            if found.meta.size > MAX_ATTACHMENT_BYTES {
                return Err(broken("it is damaged: it is too large".to_owned()));
            }
            let content = found.bytes().await?;
            if Digest::of(&content) != digest {
                return Err(broken("it is damaged: its name is another".to_owned()));
            }
            let read = Attachment::of_bytes(&key, &content);
            read.map(Arc::new).map_err(|e| broken(e.to_string()))
        };
        self.held.attachments.get_or_insert_async(&name, read).await
    }

    /// The field at a path and what is known of its object, if a reference is there.
    async fn attached(&self, at: &Path) -> Result<Option<(ObjectMeta, Content)>> {
        let Some(place) = place(at) else {
            return Ok(None);
        };
        if self.held.here.get(at.as_ref()).is_some() {
            return Ok(None);
        }
        let Some((mut meta, reference)) = self.reference(at, &place).await? else {
            return Ok(None);
        };
        let content = self.content(at, &place, reference).await?;
        meta.size = content.size_bytes();
        Ok(Some((meta, content)))
    }
}

/// The bytes of the field of a step, which is read band by band if it is large; none if its values are others than those of its name.
async fn encoded(
    source: &dyn Source,
    attachment: &Arc<Attachment>,
    reference: &Reference,
    digest: Digest,
) -> Result<std::result::Result<Option<Content>, Failure>> {
    let bands = if is_large(reference) {
        source.bands(attachment, reference).await
    } else {
        Ok(std::iter::once(0..reference.rows).collect())
    };
    let bands = match bands {
        Ok(bands) => bands,
        Err(failure) => return Ok(Err(failure)),
    };
    let mut field = Rows::none(reference).map_err(unwritten)?;
    for rows in bands {
        let cells = rows.len() * reference.cols as usize;
        let values = match source.values(attachment, reference, rows).await {
            Ok(values) if values.len() == cells => values,
            Ok(_others) => return Ok(Ok(None)),
            Err(failure) => return Ok(Err(failure)),
        };
        let written = off_thread(move || field.and(values)).await;
        field = written.map_err(unwritten)?;
    }
    let named = off_thread(move || field.named(digest)).await;
    named.map(Ok).map_err(unwritten)
}

fn unwritten(error: StorageError) -> Error {
    failed(Box::new(error))
}

/// Some bytes of a field; those of a file are read on a thread that nobody waits for.
async fn part(content: Content, range: Range<u64>) -> Result<Bytes> {
    if let Content::Bytes(_) = content {
        return content.part(range).map_err(failed);
    }
    let read = tokio::task::spawn_blocking(move || content.part(range));
    read.await.map_err(failed)?.map_err(failed)
}

/// The part of a field that is asked for.
fn answer(meta: ObjectMeta, content: &Content, options: &GetOptions) -> Result<GetResult> {
    options.check_preconditions(&meta)?;
    let whole = 0..meta.size;
    let range = match &options.range {
        Some(range) => range.as_range(meta.size).map_err(|e| failed(Box::new(e)))?,
        None => whole,
    };
    let piece_bytes = match content {
        Content::Bytes(_) => meta.size.max(1),
        Content::File(..) => PIECE_BYTES,
    };
    let asked = if options.head { 0..0 } else { range.clone() };
    let end = asked.end;
    let starts = asked.step_by(piece_bytes as usize);
    let pieces: Vec<_> = starts
        .map(|start| start..end.min(start + piece_bytes))
        .collect();
    let content = content.clone();
    let pieces = stream::iter(pieces).then(move |piece| part(content.clone(), piece));
    Ok(GetResult {
        payload: GetResultPayload::Stream(pieces.boxed()),
        meta,
        range,
        attributes: Attributes::default(),
    })
}

impl Debug for Layer {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        Display::fmt(self, f)
    }
}

impl Display for Layer {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}, with attached stores", self.inner)
    }
}

#[async_trait]
impl ObjectStore for Layer {
    async fn put_opts(&self, at: &Path, what: PutPayload, o: PutOptions) -> Result<PutResult> {
        self.inner.put_opts(at, what, o).await
    }

    async fn put_multipart_opts(
        &self,
        at: &Path,
        o: PutMultipartOptions,
    ) -> Result<Box<dyn MultipartUpload>> {
        self.inner.put_multipart_opts(at, o).await
    }

    /// Fields that are here cost no request more: only what is as small as a reference is looked into.
    async fn get_opts(&self, at: &Path, o: GetOptions) -> Result<GetResult> {
        if place(at).is_none() || self.held.here.get(at.as_ref()).is_some() {
            return self.inner.get_opts(at, o).await;
        }
        let first = self.inner.get_opts(at, o.clone()).await;
        match &first {
            Ok(found) if found.meta.size > MAX_REFERENCE_BYTES => {
                self.held.here.insert(at.to_string(), ());
                return first;
            }
            // A part that lies behind the end of a reference.
            Err(_) if o.range.is_none() => return first,
            Err(Error::NotFound { .. }) => return first,
            Ok(_) | Err(_) => {}
        }
        match self.attached(at).await? {
            Some((meta, content)) => answer(meta, &content, &o),
            None => first,
        }
    }

    async fn get_ranges(&self, at: &Path, ranges: &[Range<u64>]) -> Result<Vec<Bytes>> {
        let Some((_meta, content)) = self.attached(at).await? else {
            return self.inner.get_ranges(at, ranges).await;
        };
        let mut parts = vec![];
        for range in ranges {
            let size_bytes = content.size_bytes();
            if range.start > range.end || range.end > size_bytes {
                let beyond = format!("bytes {range:?} of {size_bytes} were asked for");
                return Err(failed(beyond));
            }
            parts.push(part(content.clone(), range.clone()).await?);
        }
        Ok(parts)
    }

    fn delete_stream(
        &self,
        at: BoxStream<'static, Result<Path>>,
    ) -> BoxStream<'static, Result<Path>> {
        self.inner.delete_stream(at)
    }

    fn list(&self, prefix: Option<&Path>) -> BoxStream<'static, Result<ObjectMeta>> {
        self.inner.list(prefix)
    }

    async fn list_with_delimiter(&self, prefix: Option<&Path>) -> Result<ListResult> {
        self.inner.list_with_delimiter(prefix).await
    }

    async fn copy_opts(&self, from: &Path, to: &Path, o: CopyOptions) -> Result<()> {
        self.inner.copy_opts(from, to, o).await
    }
}
