//! A version of a product in, its cube with that version's steps and name out: exactly what differs is put.
//!
//! A manifest comes first and its cube follows, so that a cube may be behind: whoever was killed in between left it so. The
//! next who follows makes good whatever is missing, from the manifest that it has alone. A version that was never followed
//! has no name in the cube.

use std::collections::BTreeMap;
use std::num::NonZeroUsize;
use std::sync::Arc;

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::kind::{Kind, Vouched};
use contract::manifest::{Manifest, ManifestId};
use contract::product::ProductId;
use contract::time::Period;
use futures::future::BoxFuture;
use futures::stream::{self, StreamExt as _, TryStreamExt as _};
use storage::{Store, fields, manifests};

use crate::bands::WholeField;
use crate::edit::ATTEMPTS;
use crate::field_bands::FieldBands;
use crate::handing::{Handed, Handing};
use crate::plan::Plan;
use crate::staged::Staged;
use crate::state::State;
use crate::{AtHand, CubeError, Description, Edit, Repository, Step, background, placing};

/// Memory that fields on their way may take together, bytes.
const WAY_BYTES: usize = 128 << 20;
/// Bytes of a cell on its way: as it is stored, in its pages, as a map and in its chunks.
const CELL_BYTES: usize = 16;
/// Most fields on their way.
const MOST_AT_ONCE: usize = 8;
/// Of these how many may wait for the store while processors work on others: more only wait for each other.
const WAITING: usize = 2;

/// Fields of a grid that are read, encoded and sent at a time.
fn at_once(grid: &Grid) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    let most = MOST_AT_ONCE.min(processors + WAITING);
    (WAY_BYTES / (grid.cell_count() * CELL_BYTES).max(1)).clamp(1, most)
}

async fn digest_of(grid: Grid, values: &Arc<[f32]>, period: Period) -> Result<Digest, CubeError> {
    let values = Arc::clone(values);
    let digested = tokio::task::spawn_blocking(move || fields::digest_of(&grid, &values, period));
    digested
        .await
        .map_err(|e| CubeError::library("a thread", "naming values", e))
}

/// Where the cube of a product lies in a store.
pub fn folder(product: &ProductId) -> String {
    format!("{}/{product}", Kind::Cube.folder())
}

/// Brings the cube of a product in its store to a version; see [`Follower::run`].
pub fn follow<'a>(
    store: &'a Store,
    manifest: &'a Manifest,
) -> BoxFuture<'a, Result<Followed, CubeError>> {
    follow_with(store, manifest, manifest.id(), None)
}

/// The same for who knows the name of the version, and has values of it at hand: what of them is not in the cube yet is put there and
/// no field is read for it, and runs of steps are time-major at once.
///
/// # Errors
/// As there.
pub fn follow_with<'a>(
    store: &'a Store,
    manifest: &'a Manifest,
    version: ManifestId,
    at_hand: Option<&'a dyn AtHand>,
) -> BoxFuture<'a, Result<Followed, CubeError>> {
    Box::pin(async move { follow_as(store, manifest, version, at_hand).await })
}

async fn follow_as(
    store: &Store,
    manifest: &Manifest,
    version: ManifestId,
    at_hand: Option<&dyn AtHand>,
) -> Result<Followed, CubeError> {
    let follower = Follower {
        store,
        folder: &folder(&manifest.product),
        fields: store,
        told: &|_period| (),
    };
    follower.run_as(manifest, version, at_hand).await
}

/// The same for whoever has just published a version, or found that it was published before and not told of.
///
/// Versions are what is true, and a cube is made from them: one that cannot follow is said in the log and left behind, and
/// is no reason to fail a landing. The next version brings it up, and so does `fluxglobe recompute --verify`.
///
/// A product that is attached to a store of others ([`storage::attached`]) has no cube.
///
/// Complete runs of steps are then made time-major, which nobody waits for but [`crate::compacted`].
pub fn keep_up<'a>(store: &'a Store, manifest: &'a Manifest) -> BoxFuture<'a, ()> {
    Box::pin(async move { keep_up_as(store, manifest, &manifest.id()).await })
}

/// The same for who knows the name of the version, which takes longer to compute the more steps there are.
pub fn keep_up_as<'a>(
    store: &'a Store,
    manifest: &'a Manifest,
    version: &'a ManifestId,
) -> BoxFuture<'a, ()> {
    keep_up_with(store, manifest, version, None)
}

/// The same for who has values of the version at hand.
pub fn keep_up_with<'a>(
    store: &'a Store,
    manifest: &'a Manifest,
    version: &'a ManifestId,
    at_hand: Option<Arc<dyn AtHand>>,
) -> BoxFuture<'a, ()> {
    Box::pin(async move {
        match store.attached_to(manifest).await {
            // A cube is a copy of values, and these are not to be copied.
            Ok(Some(attachment)) => {
                let place = attachment.place();
                tracing::debug!(%version, place, "an attached product has no cube");
                return;
            }
            Ok(None) => {}
            Err(error) => {
                tracing::warn!(%version, %error, "the cube stays behind");
                return;
            }
        }
        let (own, steps, name) = (store.clone(), manifest.clone(), version.clone());
        // A task of its own: a panic over a damaged cube ends there.
        let followed =
            tokio::spawn(async move { follow_as(&own, &steps, name, at_hand.as_deref()).await });
        let error = match followed.await {
            Ok(Ok(_followed)) => {
                return background::begin(store.clone(), folder(&manifest.product));
            }
            Ok(Err(error)) => error.to_string(),
            Err(error) => error.to_string(),
        };
        tracing::warn!(%version, %error, "the cube stays behind; its next version, or `fluxglobe recompute --product PRODUCT --verify`, brings it up");
    })
}

/// Brings a cube to versions of a product.
pub struct Follower<'a> {
    /// Where the cube is, or is made.
    pub store: &'a Store,
    /// Its folder there; `""` is the whole store.
    pub folder: &'a str,
    /// Where the fields are that versions name.
    pub fields: &'a Store,
    /// Is told of each step that is put.
    pub told: &'a (dyn Fn(Period) + Send + Sync),
}

/// What became of a cube.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Followed {
    /// The version that it is of now; a newer one than was asked for if it was there already.
    pub version: ManifestId,
    /// Steps whose values were stored.
    pub put_count: usize,
}

impl Follower<'_> {
    /// Puts the steps whose period or values differ, drops those that the version does not have, commits, and names the
    /// state by the version's number. An older version than the cube is of changes nothing.
    ///
    /// # Errors
    /// `Foreign` if the cube is of another version of this number, or of another product. A field that cannot be read.
    pub fn run<'a>(&'a self, manifest: &'a Manifest) -> BoxFuture<'a, Result<Followed, CubeError>> {
        self.run_as(manifest, manifest.id(), None)
    }

    /// The same for who knows the name of the version, and has values of it at hand.
    fn run_as<'a>(
        &'a self,
        manifest: &'a Manifest,
        version: ManifestId,
        mut at_hand: Option<&'a dyn AtHand>,
    ) -> BoxFuture<'a, Result<Followed, CubeError>> {
        Box::pin(async move {
            let described = Description::named(self.fields, manifest, version.clone());
            let description = described.await?;
            let repository = Repository::for_change(self.store, self.folder, &description).await?;
            let mut edit = Edit::describing(&repository, description.clone()).await?;
            let mut handed = Handed::default();
            for _attempt in 0..ATTEMPTS {
                let state = State::newest(&repository).await?;
                if let Some(there) = self.settled(&repository, &state, &version).await? {
                    return Ok(Followed {
                        version: there,
                        put_count: edit.staged().len(),
                    });
                }
                if let Some(at_hand) = at_hand.take() {
                    let handing = Handing::of(manifest, &description, &state);
                    handed = handing.send(&edit, at_hand).await?;
                    for (period, staged) in std::mem::take(&mut handed.steps) {
                        (self.told)(period);
                        edit.stage(staged);
                    }
                }
                let plan = self.plan(manifest, &description, &state, &mut edit).await?;
                let committed = edit.lay(&state, &plan, &version.to_string()).await?;
                if let Some(snapshot) = committed {
                    let tag = version.number.to_string();
                    repository.tag(&tag, &snapshot).await?;
                    // The version is there: what of its time-major copy is not is made behind whoever publishes.
                    let placed =
                        placing::place(&repository, &description, (&plan.steps, handed.runs)).await;
                    if let Err(error) = placed {
                        tracing::warn!(%version, %error, "runs of steps are made time-major later");
                    }
                    return Ok(Followed {
                        version,
                        put_count: edit.staged().len(),
                    });
                }
            }
            Err(edit.contended())
        })
    }

    /// The same as [`Follower::run`], and an older version than the cube is of gets its name too, if it has none: its state is
    /// made beside the newest one, which stays what it is, and shares with it the steps that both hold.
    ///
    /// Killed before it is named, such a state is nothing that anybody finds; clean-up removes it.
    ///
    /// # Errors
    /// As [`Follower::run`].
    pub async fn keep(&self, manifest: &Manifest) -> Result<Followed, CubeError> {
        let followed = self.run(manifest).await?;
        let tag = manifest.number.to_string();
        if followed.version.number <= manifest.number {
            return Ok(followed);
        }
        let version = manifest.id();
        let message = version.to_string();
        let description = Description::named(self.fields, manifest, version).await?;
        let repository = Repository::for_change(self.store, self.folder, &description).await?;
        if repository.has_version(&tag).await? {
            return Ok(followed);
        }
        let mut edit = Edit::describing(&repository, description.clone()).await?;
        let state = State::newest(&repository).await?;
        let plan = self.plan(manifest, &description, &state, &mut edit).await?;
        let snapshot = edit.lay_beside(&state, &plan, &message).await?;
        repository.tag(&tag, &snapshot).await?;
        Ok(Followed {
            version: followed.version,
            put_count: edit.staged().len(),
        })
    }

    /// Where each step of a version comes from over a state; those that are not in it are put.
    async fn plan(
        &self,
        manifest: &Manifest,
        description: &Description,
        state: &State,
        edit: &mut Edit<'_>,
    ) -> Result<Plan, CubeError> {
        let before: &[Step] = if state.describes_same_cells(description) {
            &state.steps
        } else {
            &[]
        };
        let wanted = self.wanted(manifest, state, before, edit).await?;
        let plan = Plan::exactly(&wanted, before, edit.staged());
        plan.map_err(|missing| CubeError::Foreign {
            place: self.folder.to_owned(),
            array: "time".to_owned(),
            reason: format!("steps of {missing:?} are neither there nor put"),
        })
    }

    /// Names the state that is there, in case somebody was killed before that. The version it is of, if there is nothing
    /// more to do.
    async fn settled(
        &self,
        repository: &Repository,
        state: &State,
        version: &ManifestId,
    ) -> Result<Option<ManifestId>, CubeError> {
        let there = state.description.as_ref();
        let Some(there) = there.and_then(|it| it.version.as_ref()) else {
            return Ok(None);
        };
        let is_other = there.number == version.number && there != version;
        if there.product != version.product || is_other {
            return Err(CubeError::Foreign {
                place: repository.place.clone(),
                array: "the group".to_owned(),
                reason: format!("it is of {there}, not of {version}"),
            });
        }
        let tag = there.number.to_string();
        // What was committed since is the same version: its time-major copy.
        if !repository.has_version(&tag).await? {
            repository.tag(&tag, &state.snapshot).await?;
        }
        Ok((there.number >= version.number).then(|| there.clone()))
    }

    /// The steps of a version as the cube names them; those that are not in it are put.
    async fn wanted(
        &self,
        manifest: &Manifest,
        state: &State,
        before: &[Step],
        edit: &mut Edit<'_>,
    ) -> Result<Vec<Step>, CubeError> {
        let there: BTreeMap<Period, Digest> = before
            .iter()
            .map(|step| (step.period, step.values_sha256))
            .collect();
        let known = self.known_fields(manifest, state).await?;
        let mut wanted: Vec<Option<Step>> = Vec::with_capacity(manifest.steps.len());
        let mut absent = vec![];
        for (place, step) in manifest.steps.iter().enumerate() {
            let period = step.period;
            let named = match step.field.vouches() {
                Vouched::Values(digest) => Some(digest),
                // Named by its bytes: its values are known if the version before named the same.
                Vouched::Bytes(_) | Vouched::Nothing => (known.get(&period) == Some(&step.field))
                    .then(|| there.get(&period).copied())
                    .flatten(),
            };
            let is_there = named.is_some() && there.get(&period).copied() == named;
            let put = edit.staged().get(&period.start).map(|put| put.step);
            let put = put.filter(|put| {
                put.period == period && named.is_none_or(|named| named == put.values_sha256)
            });
            match (named, put) {
                (Some(values_sha256), _) if is_there => wanted.push(Some(Step {
                    period,
                    values_sha256,
                })),
                (_, Some(put)) => wanted.push(Some(put)),
                _ => {
                    wanted.push(None);
                    absent.push((place, period, &step.field));
                }
            }
        }
        for (place, staged) in self.sent(manifest, edit, absent).await? {
            wanted[place] = Some(staged.step);
            edit.stage(staged);
        }
        Ok(wanted.into_iter().flatten().collect())
    }

    /// Reads fields of a version and sends their values, several at a time.
    async fn sent(
        &self,
        manifest: &Manifest,
        edit: &Edit<'_>,
        absent: Vec<(usize, Period, &ObjectKey)>,
    ) -> Result<Vec<(usize, Staged)>, CubeError> {
        let grid = manifest.grid;
        let send = |(place, period, field): (usize, Period, &ObjectKey)| {
            let (store, field) = (self.fields, field.clone());
            async move {
                let step = |values_sha256| Step {
                    period,
                    values_sha256,
                };
                let staged = match field.vouches() {
                    // It is compared with its name when it is read.
                    Vouched::Values(digest) => {
                        let mut bands = FieldBands::new(store, &field, &grid);
                        edit.send(step(digest), &mut bands).await?
                    }
                    Vouched::Bytes(_) | Vouched::Nothing => {
                        let values: Arc<[f32]> = fields::read(store, &field, &grid).await?.into();
                        let digest = digest_of(grid, &values, period).await?;
                        let mut bands = WholeField::new(values, grid.cols);
                        edit.send(step(digest), &mut bands).await?
                    }
                };
                Ok::<_, CubeError>((place, staged))
            }
        };
        let mut sending = stream::iter(absent).map(send).buffered(at_once(&grid));
        let mut sent = vec![];
        while let Some((place, staged)) = sending.try_next().await? {
            (self.told)(staged.step.period);
            sent.push((place, staged));
        }
        Ok(sent)
    }

    /// Fields of the version that the cube is of, by their periods: none if that version is gone, or not needed.
    async fn known_fields(
        &self,
        manifest: &Manifest,
        state: &State,
    ) -> Result<BTreeMap<Period, ObjectKey>, CubeError> {
        let is_named = |field: &ObjectKey| matches!(field.vouches(), Vouched::Values(_));
        let version = state.description.as_ref().and_then(|it| it.version.clone());
        let (Some(version), false) = (
            version,
            manifest.steps.iter().all(|step| is_named(&step.field)),
        ) else {
            return Ok(BTreeMap::new());
        };
        let before = manifests::numbered(self.fields, &version.product, version.number).await?;
        let before = before.filter(|before| before.id() == version);
        let steps = before.into_iter().flat_map(|before| before.steps);
        Ok(steps.map(|step| (step.period, step.field)).collect())
    }
}
