//! File handles of a server: as many connections as it is told to take in, as many as this process may hold out.

use tile_server::config::Settings;

/// Handles for everything else: files of the store, connections to other services, the graphics device, logs.
const OTHERS: u64 = 512;

/// Raises this process's limit of open files, as far as it may, so that all connections fit; if they do not, fewer are
/// taken: a connection that is refused in words is better than one that nobody accepts.
pub(crate) fn fit(settings: &mut Settings) {
    let wanted = u64::from(settings.connections) + OTHERS;
    let limit = match rlimit::increase_nofile_limit(wanted) {
        Ok(limit) => limit,
        Err(error) => {
            tracing::warn!(%error, "the limit of open files cannot be looked at");
            return;
        }
    };
    let connections = fitting(settings.connections, limit);
    if connections < settings.connections {
        let asked = settings.connections;
        tracing::warn!(
            limit,
            asked,
            connections,
            "the limit of open files (ulimit -n) holds fewer connections than --connections says"
        );
        settings.connections = connections;
    }
}

/// Connections that a limit has room for, at least one.
fn fitting(asked: u32, limit: u64) -> u32 {
    let others = OTHERS.min(limit / 2);
    let room = u32::try_from(limit - others).unwrap_or(u32::MAX);
    asked.min(room).max(1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn connections_are_as_many_as_there_are_handles_for() {
        assert_eq!(fitting(4096, 20_000), 4096);
        assert_eq!(fitting(4096, 4608), 4096);
        assert_eq!(fitting(4096, 4096), 3584);
        // A small limit is shared half and half.
        assert_eq!(fitting(4096, 256), 128);
        assert_eq!(fitting(1, 0), 1);
    }
}
