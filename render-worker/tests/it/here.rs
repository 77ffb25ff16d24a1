//! A desk in this process that draws every job anew and stores nothing.

use std::ops::Deref;
use std::sync::Arc;

use bytes::Bytes;
use contract::job::RenderJob;
use prometheus::Registry;
use render::Backend;
use render_worker::desk::{DeskError, Order, Storing};
use render_worker::pipeline::Pipeline;
use render_worker::{Desk, DrawError, Limits};
use storage::Store;

#[derive(Clone)]
pub(crate) struct Here {
    pub(crate) desk: Desk,
}

impl Here {
    pub(crate) fn new(store: Store, backend: Backend) -> Self {
        Self::with_limits(store, backend, Limits::default())
    }

    pub(crate) fn with_limits(store: Store, backend: Backend, limits: Limits) -> Self {
        let desk = Desk::open(store, backend, &limits, &Registry::new()).unwrap();
        Self { desk }
    }

    pub(crate) async fn draw(&self, job: &RenderJob) -> Result<Bytes, Arc<DrawError>> {
        self.draw_in_turn(job, ()).await
    }

    /// The same with somebody's turn to draw.
    pub(crate) async fn draw_in_turn(
        &self,
        job: &RenderJob,
        turn: impl Send + Sync + 'static,
    ) -> Result<Bytes, Arc<DrawError>> {
        let order = Order::on_demand(Storing::Nothing);
        match self.desk.draw_in_turn(job, order, turn).await {
            Ok(drawn) => Ok(drawn.bytes),
            Err(DeskError::Render(error)) => Err(error),
            Err(other) => panic!("{other}"),
        }
    }
}

impl Deref for Here {
    type Target = Pipeline;

    fn deref(&self) -> &Pipeline {
        self.desk.pipeline()
    }
}
