//! How many parts a query is cut into: as many as the executors there are work on at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use datafusion::prelude::SessionConfig;

/// Tasks that all executors together work on at once; clones share the number.
#[derive(Debug, Clone, Default)]
pub(super) struct Room {
    tasks: Arc<AtomicU32>,
}

impl Room {
    pub(super) fn set(&self, tasks: u32) {
        self.tasks.store(tasks, Ordering::Relaxed);
    }

    /// A query's settings with as many parts as there is room for, and no fewer than its client asked for: executors may
    /// come while it waits.
    pub(super) fn fill(&self, config: SessionConfig) -> SessionConfig {
        let tasks = self.tasks.load(Ordering::Relaxed) as usize;
        let parts = tasks.max(config.target_partitions());
        config.with_target_partitions(parts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_query_has_as_many_parts_as_there_is_room_for() {
        let (room, asked) = (
            Room::default(),
            SessionConfig::new().with_target_partitions(2),
        );
        assert_eq!(room.fill(asked.clone()).target_partitions(), 2);
        room.clone().set(24);
        assert_eq!(room.fill(asked.clone()).target_partitions(), 24);
        room.set(1);
        assert_eq!(room.fill(asked).target_partitions(), 2);
    }
}
