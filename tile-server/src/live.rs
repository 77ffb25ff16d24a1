//! The stream to the end: what lands is shown, hot tiles that it touches are drawn before anybody asks, viewers are told.
//!
//! ```text
//! granule.landed, product.derived -> catalogue anew -> touched times -> render.job of hot tiles there
//!                                                \-> news to viewers (server-sent events)
//! a look at the list of products now and then, where there is no log -> news to viewers
//! render.done, or the first volume tile that is asked for -> how fresh it was
//! ```

mod freshness;
mod hot;
mod news;
mod seen;
mod service;
mod touched;
mod watch;

use std::sync::Arc;

use storage::log::EventLog;

use crate::state::AppState;
pub use freshness::Freshness;
pub use hot::{HotTile, HotTiles};
pub use news::{Item, Listener, News};
pub use service::LiveService;
pub use touched::touched;
pub use watch::Watch;

impl AppState {
    /// What keeps this server up with the event log.
    pub fn live(&self, log: Arc<dyn EventLog>) -> LiveService {
        self.log.get_or_init(|| Arc::clone(&log));
        self.catalogue.is_told();
        LiveService::new(self.clone(), log)
    }

    /// What keeps the viewers of this server up with the store, where there is no event log to follow.
    pub fn watch(&self) -> Watch {
        Watch::new(self.clone())
    }
}
