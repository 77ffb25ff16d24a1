//! A change of a cube: steps are put, each with its values on the way at once, and committed together.
//!
//! Where a step lies in time is decided at the commit. If somebody else committed before, it is decided anew over the state
//! that is there then; the values are in the store already and are not sent again.

use std::collections::BTreeMap;
use std::sync::Arc;

use contract::digest::Digest;
use contract::time::Period;
use futures::future::BoxFuture;
use icechunk::session::Session;
use tokio::sync::RwLock;

use crate::bands::{Bands, WholeField};
use crate::layer::Layer;
use crate::parts::{Parts, Sent};
use crate::plain;
use crate::plan::Plan;
use crate::staged::{AllStaged, Staged};
use crate::state::State;
use crate::{CubeError, Description, Repository, Step, held_steps};

/// How often a commit is laid on top of those of others.
pub(crate) const ATTEMPTS: u32 = 50;

/// A change that is being made.
pub struct Edit<'a> {
    repository: &'a Repository,
    /// What the cube is of when it is committed.
    description: Description,
    /// Sends chunks; what it knows of the newest state may be old by the time of the commit.
    uploads: Arc<RwLock<Session>>,
    parts: Parts,
    staged: AllStaged,
}

/// What a commit came to.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Committed {
    /// Names the state; [`Repository::tag`] gives it a name for people. None if all that was put was there already.
    pub snapshot: Option<String>,
    /// Steps that the cube has now.
    pub steps: usize,
    /// How often others had committed before it.
    pub rebased: u32,
}

impl<'a> Edit<'a> {
    /// Begins a change: nothing of it is seen before its commit.
    pub fn begin(repository: &'a Repository) -> BoxFuture<'a, Result<Self, CubeError>> {
        Box::pin(async move { Self::describing(repository, repository.description.clone()).await })
    }

    /// Begins a change after which the cube is of something else, or of another version of it.
    pub(crate) async fn describing(
        repository: &'a Repository,
        description: Description,
    ) -> Result<Self, CubeError> {
        Ok(Self {
            repository,
            uploads: repository.session().await?,
            parts: Parts::new(&description)?,
            description,
            staged: BTreeMap::new(),
        })
    }

    /// Puts a step, in the place of one of the same period if there is one: `values` `[row, col]`, stored unit, NaN no data.
    /// They are in the store when this returns, and seen by nobody.
    pub fn put(
        &mut self,
        period: Period,
        values: Arc<[f32]>,
    ) -> BoxFuture<'_, Result<Step, CubeError>> {
        Box::pin(async move {
            let (grid, own) = (self.description.grid, Arc::clone(&values));
            plain::check_length(&values, grid.cell_count())?;
            let digested = tokio::task::spawn_blocking(move || {
                storage::fields::digest_of(&grid, &own, period)
            });
            let digested = digested.await;
            let step = Step {
                period,
                values_sha256: digested
                    .map_err(|e| self.repository.failed("naming the values", &e))?,
            };
            let mut bands = WholeField::new(values, grid.cols);
            let staged = self.send(step, &mut bands).await?;
            self.stage(staged);
            Ok(step)
        })
    }

    /// The same of a field that comes in bands of rows and is not held whole: a row of objects at a time, 144 MB of 18,000 x 36,000
    /// cells. `values_sha256` is the digest of its values and period, [`storage::fields::digest_of`], which is not compared here.
    pub fn put_bands<'b>(
        &'b mut self,
        period: Period,
        values_sha256: Digest,
        bands: &'b mut dyn Bands,
    ) -> BoxFuture<'b, Result<Step, CubeError>> {
        Box::pin(async move {
            let step = Step {
                period,
                values_sha256,
            };
            let staged = self.send(step, bands).await?;
            self.stage(staged);
            Ok(step)
        })
    }

    /// Sends the values of a step whose digest is known. Several may be on the way at once.
    pub(crate) async fn send(
        &self,
        step: Step,
        bands: &mut dyn Bands,
    ) -> Result<Staged, CubeError> {
        let sent = self.parts.send(&self.uploads, bands, Sent::All).await?;
        Ok(Staged { step, sent })
    }

    /// Takes a step that was sent into the change.
    pub(crate) fn stage(&mut self, staged: Staged) {
        self.staged.insert(staged.step.period.start, staged);
    }

    /// Commits all that was put, whole or not at all: what was there before stays beside it.
    ///
    /// # Errors
    /// `Overlap` if a step covers a part of another one's period: nothing is committed then.
    pub async fn commit(self, message: &str) -> Result<Committed, CubeError> {
        for rebased in 0..ATTEMPTS {
            let state = State::newest(self.repository).await?;
            let plan = Plan::put(&state.steps, &self.staged)?;
            if plan.first_change(&state.steps).is_none() {
                return Ok(Committed {
                    snapshot: None,
                    steps: state.steps.len(),
                    rebased,
                });
            }
            if let Some(snapshot) = self.lay(&state, &plan, message).await? {
                return Ok(Committed {
                    snapshot: Some(snapshot),
                    steps: plan.steps.len(),
                    rebased,
                });
            }
        }
        Err(self.contended())
    }

    /// Commits a plan over a state; none if others committed since that was read.
    pub(crate) async fn lay(
        &self,
        state: &State,
        plan: &Plan,
        message: &str,
    ) -> Result<Option<String>, CubeError> {
        let committed = self.layer(state, plan).commit(message).await?;
        if let Some(snapshot) = &committed {
            let snapshots = (state.snapshot.as_str(), snapshot.as_str());
            held_steps::committed(&self.repository.place, snapshots, &plan.steps);
        }
        Ok(committed)
    }

    /// Commits a plan over a state as a state of its own, which nothing leads to before it is named.
    pub(crate) async fn lay_beside(
        &self,
        state: &State,
        plan: &Plan,
        message: &str,
    ) -> Result<String, CubeError> {
        let mut layer = self.layer(state, plan);
        layer.is_beside = true;
        // Nobody else changes it.
        let committed = layer.commit(message).await?;
        committed.ok_or_else(|| self.contended())
    }

    fn layer<'b>(&'b self, state: &'b State, plan: &'b Plan) -> Layer<'b> {
        Layer {
            repository: self.repository,
            description: &self.description,
            parts: &self.parts,
            state,
            plan,
            staged: &self.staged,
            is_beside: false,
        }
    }

    /// What sends chunks.
    pub(crate) fn uploads(&self) -> &RwLock<Session> {
        &self.uploads
    }

    pub(crate) fn staged(&self) -> &AllStaged {
        &self.staged
    }

    pub(crate) fn contended(&self) -> CubeError {
        CubeError::Contended {
            place: self.repository.place.clone(),
            attempts: ATTEMPTS,
        }
    }
}
