//! A gate that deals turns out by client: a few questions are worked at, others wait, and clients who wait take turns, each with
//! the question that it asked first. Who asks a thousand waits for them; who asks one beside it waits for one.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use prometheus::IntGauge;
use tokio::sync::oneshot;

use crate::client::Client;
use crate::error::ServerError;

/// Bounds how much is worked at and how much waits. Clones are the same gate.
#[derive(Debug, Clone)]
pub(crate) struct FairGate(Arc<Gate>);

#[derive(Debug)]
struct Gate {
    at_once: usize,
    queue: usize,
    /// How many wait, for who watches.
    waiting: IntGauge,
    state: Mutex<State>,
}

#[derive(Debug, Default)]
struct State {
    running: usize,
    waiting: usize,
    /// Those of whom some question waits, in the order of their next turn.
    order: VecDeque<Client>,
    /// Their questions, in the order that they were asked in.
    questions: HashMap<Client, VecDeque<oneshot::Sender<Pass>>>,
}

/// The right to work at a question; the next one has it when this is dropped.
#[derive(Debug)]
pub(crate) struct Pass(Option<Arc<Gate>>);

/// One who waits, and is not counted any more when it goes.
struct Waiting<'a>(&'a Gate);

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        let mut state = self.0.state();
        state.waiting -= 1;
        self.0.waiting.set(state.waiting as i64);
    }
}

impl Drop for Pass {
    fn drop(&mut self) {
        if let Some(gate) = self.0.take() {
            gate.next();
        }
    }
}

impl FairGate {
    /// A gate that `at_once` pass and at which `queue` may wait, half of them of one client; `waiting` shows how many do.
    pub(crate) fn new(at_once: u32, queue: u32, waiting: IntGauge) -> Self {
        Self(Arc::new(Gate {
            at_once: at_once as usize,
            queue: queue as usize,
            waiting,
            state: Mutex::default(),
        }))
    }

    /// Waits for a turn; `Busy` if as many wait as may, in all or of this client. Who stops waiting gives the place back.
    pub(crate) async fn enter(&self, client: Client) -> Result<Pass, ServerError> {
        let gate = &self.0;
        let (turn, _waiting) = {
            let mut state = gate.state();
            if state.running < gate.at_once {
                state.running += 1;
                return Ok(Pass(Some(Arc::clone(gate))));
            }
            let own = state.questions.get(&client).map_or(0, |own| {
                own.iter().filter(|asked| !asked.is_closed()).count()
            });
            if state.waiting >= gate.queue || own >= gate.queue.div_ceil(2) {
                return Err(ServerError::Busy);
            }
            let (sender, turn) = oneshot::channel();
            let questions = state.questions.entry(client).or_default();
            // Those that nobody waits for any more would be remembered until their turn.
            questions.retain(|asked| !asked.is_closed());
            questions.push_back(sender);
            if !state.order.contains(&client) {
                state.order.push_back(client);
            }
            state.waiting += 1;
            gate.waiting.set(state.waiting as i64);
            (turn, Waiting(gate))
        };
        turn.await.map_err(|_gone| ServerError::Busy)
    }
}

impl Gate {
    fn state(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives the turn that became free to the next question of the next client, if somebody still waits for one.
    fn next(self: Arc<Self>) {
        let mut pass = Pass(None);
        loop {
            let next = self.state().take_next();
            let Some(asked) = next else {
                return;
            };
            pass.0 = Some(Arc::clone(&self));
            match asked.send(pass) {
                Ok(()) => return,
                // Nobody waits for it any more. Dropped as it is, it would look for the next one by itself.
                Err(mut back) => {
                    back.0 = None;
                    pass = back;
                }
            }
        }
    }
}

impl State {
    /// The question whose turn it is. Without any, one less is worked at.
    fn take_next(&mut self) -> Option<oneshot::Sender<Pass>> {
        while let Some(client) = self.order.pop_front() {
            let Some(questions) = self.questions.get_mut(&client) else {
                continue;
            };
            let asked = questions.pop_front();
            if questions.is_empty() {
                self.questions.remove(&client);
            } else {
                self.order.push_back(client);
            }
            if asked.is_some() {
                return asked;
            }
        }
        self.running -= 1;
        None
    }
}

#[cfg(test)]
mod tests {
    use std::net::SocketAddr;
    use std::pin::Pin;

    use futures::FutureExt as _;

    use super::*;

    type Entering = Pin<Box<dyn Future<Output = Result<Pass, ServerError>>>>;

    /// One is worked at.
    fn gate(queue: u32) -> FairGate {
        let waiting = IntGauge::new("waiting", "Questions that wait.").unwrap();
        FairGate::new(1, queue, waiting)
    }

    fn client(number: u8) -> Client {
        Client::at(SocketAddr::from(([192, 0, 2, number], 1)))
    }

    fn waiting(gate: &FairGate, number: u8) -> Entering {
        let gate = gate.clone();
        let mut entering: Entering = Box::pin(async move { gate.enter(client(number)).await });
        assert!(entering.as_mut().now_or_never().is_none());
        entering
    }

    /// Is somebody sent away at once?
    fn is_busy(gate: &FairGate, number: u8) -> bool {
        let answer = gate.enter(client(number)).now_or_never();
        matches!(answer, Some(Err(ServerError::Busy)))
    }

    /// Lets those who wait in one after the other, and says in which order.
    fn order(mut first: Pass, mut all: Vec<(&'static str, Entering)>) -> Vec<&'static str> {
        let mut names = vec![];
        while !all.is_empty() {
            drop(first);
            let let_in = |(_, entering): &mut (&str, Entering)| entering.as_mut().now_or_never();
            let found = all.iter_mut().enumerate();
            let mut found: Vec<(usize, Pass)> = found
                .filter_map(|(at, one)| Some((at, let_in(one)?.unwrap())))
                .collect();
            assert_eq!(found.len(), 1, "one at a time");
            let (at, pass) = found.remove(0);
            names.push(all.remove(at).0);
            first = pass;
        }
        names
    }

    #[tokio::test]
    async fn clients_take_turns_each_with_its_questions_in_order() {
        let gate = gate(20);
        let first = gate.enter(client(1)).await.unwrap();
        let all = [
            ("a1", 1),
            ("a2", 1),
            ("a3", 1),
            ("b1", 2),
            ("b2", 2),
            ("c1", 3),
        ];
        let all = all.map(|(name, number)| (name, waiting(&gate, number)));
        assert_eq!(
            order(first, all.into()),
            ["a1", "b1", "c1", "a2", "b2", "a3"]
        );
        assert_eq!(gate.0.state().running, 0);
        assert!(
            gate.enter(client(9)).now_or_never().is_some(),
            "nobody is left"
        );
    }

    #[tokio::test]
    async fn one_client_fills_half_of_the_queue_and_others_the_rest() {
        let gate = gate(4);
        let _first = gate.enter(client(1)).await.unwrap();
        let _own: Vec<Entering> = (0..2).map(|_| waiting(&gate, 1)).collect();
        assert!(is_busy(&gate, 1));
        let _others = [waiting(&gate, 2), waiting(&gate, 3)];
        assert!(is_busy(&gate, 4));
    }

    #[tokio::test]
    async fn questions_that_nobody_waits_for_are_not_remembered() {
        let gate = gate(4);
        let first = gate.enter(client(1)).await.unwrap();
        for _ in 0..100 {
            drop(waiting(&gate, 2));
        }
        {
            let state = gate.0.state();
            let held: usize = state.questions.values().map(VecDeque::len).sum();
            assert_eq!((held, state.order.len(), state.waiting), (1, 1, 0));
        }
        // And they take no place from those that come.
        drop([waiting(&gate, 2), waiting(&gate, 2)]);
        let all = [("own", waiting(&gate, 2)), ("other", waiting(&gate, 3))];
        assert_eq!(order(first, all.into()), ["own", "other"]);
    }

    #[tokio::test]
    async fn who_stops_waiting_gives_the_place_back_and_is_passed_over() {
        let gate = gate(2);
        let first = gate.enter(client(1)).await.unwrap();
        let gone = waiting(&gate, 1);
        let stays = waiting(&gate, 2);
        assert!(is_busy(&gate, 3));
        drop(gone);
        let third = waiting(&gate, 3);
        // Let in, but gone before it looks.
        assert_eq!(
            order(first, vec![("second", stays), ("third", third)]),
            ["second", "third"]
        );
        let first = gate.enter(client(1)).await.unwrap();
        let (late, next) = (waiting(&gate, 2), waiting(&gate, 3));
        drop(first);
        drop(late);
        assert!(
            next.now_or_never().is_some(),
            "the turn of who went is given on"
        );
        let state = gate.0.state();
        assert_eq!((state.running, state.waiting), (0, 0));
    }
}
