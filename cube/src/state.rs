//! The newest state of a cube, as a change builds on it.

use std::sync::Arc;

use icechunk::format::Path;
use icechunk::session::{Session, SessionErrorKind};
use tokio::sync::RwLock;
use zarrs_icechunk::AsyncIcechunkStore;

use crate::arrays::SERIES;
use crate::levels::Levels;
use crate::series::Runs;
use crate::sums::Sums;
use crate::{CubeError, Description, Repository, Step, axis, cf, held_steps};

/// What is there, and a session that changes it.
pub(crate) struct State {
    pub(crate) session: Arc<RwLock<Session>>,
    /// Names it.
    pub(crate) snapshot: String,
    /// None of a repository that was made and never committed to.
    pub(crate) description: Option<Description>,
    pub(crate) steps: Vec<Step>,
    /// Are the starts of steps there beside the bounds of sums?
    pub(crate) has_step_start: bool,
    /// Runs of the time-major copy.
    pub(crate) runs: Runs,
    /// Sums of blocks.
    pub(crate) sums: Sums,
    /// Coarser levels.
    pub(crate) levels: Levels,
}

impl State {
    pub(crate) async fn newest(repository: &Repository) -> Result<Self, CubeError> {
        let session = repository.session().await?;
        let root = session.read().await.get_group(&Path::root()).await;
        let is_empty = match root {
            Ok(_group) => false,
            Err(e) if matches!(e.kind, SessionErrorKind::NodeNotFound { .. }) => true,
            Err(e) => return Err(repository.failed("reading the newest state", &e)),
        };
        let snapshot = session.read().await.snapshot_id().to_string();
        let arrays = Arc::new(AsyncIcechunkStore::from(Arc::clone(&session)));
        let (description, steps, runs, sums, levels) = if is_empty {
            (
                None,
                vec![],
                Runs::default(),
                Sums::default(),
                Levels::default(),
            )
        } else {
            let description = Description::of_group(&arrays, &repository.place).await?;
            let steps = match held_steps::of(&repository.place, &snapshot) {
                Some(steps) => steps,
                None => axis::read(&arrays, &description, &repository.place).await?,
            };
            let own = session.read().await;
            let runs = Runs::read(&own, &arrays, SERIES, &repository.place).await?;
            let sums = Sums::read(&own, &arrays, &description, &repository.place).await?;
            let levels =
                Levels::read(&own, &arrays, &description, &steps, &repository.place).await?;
            drop(own);
            (Some(description), steps, runs, sums, levels)
        };
        let has_step_start = match &description {
            Some(description) => axis::has_step_start(&arrays, description).await?,
            None => false,
        };
        Ok(Self {
            session,
            snapshot,
            description,
            steps,
            has_step_start,
            runs,
            sums,
            levels,
        })
    }

    /// Do its chunks hold the same cells of the same quantity, and does it say the same of what they are?
    pub(crate) fn describes_same_cells(&self, other: &Description) -> bool {
        let own = self.description.as_ref();
        own.is_some_and(|own| {
            own.grid == other.grid
                && own.quantity.is_same_kind(other.quantity)
                && cf::method(own) == cf::method(other)
        })
    }
}
