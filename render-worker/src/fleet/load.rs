//! What a worker has to do, and when that is enough for pictures to go to another one.

/// Turns that may be waiting for each that is drawn before pictures go elsewhere. Fewer would leave the worker idle while
/// the next request travels, more would leave others idle that could draw.
const WAITING_TURNS: usize = 1;

/// The pictures asked of one worker.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Load {
    /// Those that it draws and those that wait.
    pub(super) pictures: usize,
    /// Those that it draws at the same time.
    pub(super) draws_at_once: usize,
}

impl Load {
    /// Would one more picture be drawn soon?
    fn has_room(self) -> bool {
        self.pictures < self.draws_at_once * (1 + WAITING_TURNS)
    }

    /// Would one more picture be begun at once?
    pub(super) fn has_turn(self) -> bool {
        self.pictures < self.draws_at_once
    }

    /// Turns before one more picture is drawn, in thousandths.
    fn turns(self) -> usize {
        self.pictures * 1000 / self.draws_at_once.max(1)
    }
}

/// Workers in the order in which a picture is asked of them. They come in the order of the rendezvous, which keeps pictures
/// from the same fields together; those with room stay so, and the others follow, the one with the fewest turns first: a
/// popular instant is drawn by all.
pub(super) fn in_order<T>(ranked: Vec<T>, load: impl Fn(&T) -> Load) -> Vec<T> {
    let with_load = ranked.into_iter().map(|worker| (load(&worker), worker));
    let (mut roomy, mut full): (Vec<_>, Vec<_>) = with_load.partition(|(load, _)| load.has_room());
    full.sort_by_key(|(load, _worker)| load.turns());
    roomy.append(&mut full);
    roomy.into_iter().map(|(_load, worker)| worker).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(loads: &[(usize, usize)]) -> Vec<usize> {
        let load = |&at: &usize| Load {
            pictures: loads[at].0,
            draws_at_once: loads[at].1,
        };
        in_order((0..loads.len()).collect(), load)
    }

    #[test]
    fn a_worker_with_room_is_asked_in_the_order_of_the_rendezvous() {
        assert_eq!(order(&[(1, 1), (0, 1), (0, 8)]), [0, 1, 2]);
        assert_eq!(order(&[(15, 8), (0, 1)]), [0, 1]);
    }

    #[test]
    fn a_worker_without_room_is_passed_over_and_the_fewest_turns_go_first() {
        assert_eq!(order(&[(2, 1), (0, 1), (1, 1)]), [1, 2, 0]);
        assert_eq!(order(&[(16, 8), (2, 1), (3, 2)]), [2, 0, 1]);
        assert_eq!(order(&[(9, 1), (40, 8), (9, 2)]), [2, 1, 0]);
    }
}
