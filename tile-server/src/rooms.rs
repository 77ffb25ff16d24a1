//! Room in memory by bytes: what is held for those who ask stays within a limit, half of it for one client.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use prometheus::IntGauge;
use tokio::sync::Notify;

use crate::client::Client;
use crate::error::ServerError;

/// Most that wait for room of one client: whoever takes nothing of what he asked for must not fill the queue of all.
const MOST_WAITING: u32 = 256;

/// Bounds what is held. Clones are the same bounds.
#[derive(Debug, Clone)]
pub(crate) struct Rooms(Arc<Held>);

#[derive(Debug)]
struct Held {
    /// Bytes of all clients at most.
    limit_bytes: u64,
    /// Bytes by client.
    clients: Mutex<HashMap<Client, u64>>,
    /// Those of all clients, for who watches.
    bytes: IntGauge,
    /// How many wait, by client.
    waiting: Mutex<HashMap<Client, u32>>,
    /// Told when some room is free again.
    freed: Notify,
}

impl Held {
    fn clients(&self) -> MutexGuard<'_, HashMap<Client, u64>> {
        self.clients.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn give_back(&self, client: Client, bytes: u64) {
        let mut clients = self.clients();
        if let Some(own) = clients.get_mut(&client) {
            *own -= bytes;
            if *own == 0 {
                clients.remove(&client);
            }
        }
        self.bytes.set(clients.values().sum::<u64>() as i64);
        drop(clients);
        self.freed.notify_waiters();
    }

    fn waiting(&self) -> MutexGuard<'_, HashMap<Client, u32>> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// One that waits; counted until this is dropped.
struct Waiting<'a> {
    held: &'a Held,
    client: Client,
}

impl<'a> Waiting<'a> {
    /// None if as many wait of this client as may.
    fn of(held: &'a Held, client: Client) -> Option<Self> {
        let mut waiting = held.waiting();
        let own = waiting.entry(client).or_default();
        if *own >= MOST_WAITING {
            return None;
        }
        *own += 1;
        Some(Self { held, client })
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        let mut waiting = self.held.waiting();
        if let Some(own) = waiting.get_mut(&self.client) {
            *own -= 1;
            if *own == 0 {
                waiting.remove(&self.client);
            }
        }
    }
}

/// Room for some bytes; free again when this is dropped.
#[derive(Debug)]
pub(crate) struct Room {
    held: Arc<Held>,
    client: Client,
    bytes: u64,
}

impl Room {
    /// Gives back what is not needed.
    pub(crate) fn shrink_to(&mut self, bytes: u64) {
        let spare = self.bytes.saturating_sub(bytes);
        self.bytes -= spare;
        self.held.give_back(self.client, spare);
    }
}

impl Drop for Room {
    fn drop(&mut self) {
        self.held.give_back(self.client, self.bytes);
    }
}

impl Rooms {
    /// Nothing is held; `bytes` shows how much is.
    pub(crate) fn new(limit_bytes: u64, bytes: IntGauge) -> Self {
        Self(Arc::new(Held {
            limit_bytes,
            clients: Mutex::default(),
            bytes,
            waiting: Mutex::default(),
            freed: Notify::new(),
        }))
    }

    /// Bytes that one client may hold.
    pub(crate) fn client_limit_bytes(&self) -> u64 {
        self.0.limit_bytes / 2
    }

    /// # Errors
    /// `Busy` if more would be held than may be, in all or of this client.
    pub(crate) fn enter(&self, client: Client, bytes: u64) -> Result<Room, ServerError> {
        let mut clients = self.0.clients();
        let all: u64 = clients.values().sum();
        let own = clients.get(&client).copied().unwrap_or_default();
        if all + bytes > self.0.limit_bytes || own + bytes > self.client_limit_bytes() {
            return Err(ServerError::Busy);
        }
        clients.insert(client, own + bytes);
        self.0.bytes.set((all + bytes) as i64);
        Ok(Room {
            held: Arc::clone(&self.0),
            client,
            bytes,
        })
    }

    /// Waits for room.
    ///
    /// # Errors
    /// `Busy` if as many of this client wait as may.
    pub(crate) async fn wait(&self, client: Client, bytes: u64) -> Result<Room, ServerError> {
        let _waiting = Waiting::of(&self.0, client).ok_or(ServerError::Busy)?;
        loop {
            // Heard from here on: what is given back before it is looked for is not missed.
            let mut freed = std::pin::pin!(self.0.freed.notified());
            freed.as_mut().enable();
            match self.enter(client, bytes) {
                Err(ServerError::Busy) => freed.await,
                entered => return entered,
            }
        }
    }

    /// Bytes that are held.
    #[cfg(test)]
    pub(crate) fn held_bytes(&self) -> u64 {
        self.0.clients().values().sum()
    }
}

#[cfg(test)]
mod tests {
    use std::net::SocketAddr;

    use super::*;
    use futures::FutureExt as _;

    fn client(number: u8) -> Client {
        Client::at(SocketAddr::from(([192, 0, 2, number], 1)))
    }

    #[tokio::test]
    async fn who_waits_has_room_when_some_is_given_back_and_few_of_one_client_wait() {
        let rooms = Rooms::new(
            400,
            IntGauge::new("held_bytes", "Bytes that are held.").unwrap(),
        );
        let own = rooms.enter(client(1), 200).unwrap();
        let mut waiting = Box::pin(rooms.wait(client(1), 150));
        assert!(waiting.as_mut().now_or_never().is_none());
        drop(own);
        let room = waiting.await.unwrap();
        let wait = || Box::pin(rooms.wait(client(1), 100));
        let mut all: Vec<_> = (0..MOST_WAITING).map(|_| wait()).collect();
        for one in &mut all {
            assert!(one.as_mut().now_or_never().is_none());
        }
        assert!(matches!(wait().await, Err(ServerError::Busy)));
        assert!(rooms.wait(client(2), 100).await.is_ok(), "another client");
        drop((all, room));
        assert!(rooms.0.waiting().is_empty() && rooms.held_bytes() == 0);
    }

    #[test]
    fn one_client_has_half_of_the_room_and_all_together_have_no_more_than_there_is() {
        let gauge = IntGauge::new("held_bytes", "Bytes that are held.").unwrap();
        let rooms = Rooms::new(400, gauge.clone());
        let enter = |number| rooms.enter(client(number), 100);
        let own = [enter(1).unwrap(), enter(1).unwrap()];
        assert!(matches!(enter(1), Err(ServerError::Busy)));
        let mut others = [enter(2).unwrap(), enter(3).unwrap()];
        assert!(matches!(enter(4), Err(ServerError::Busy)));
        assert_eq!(gauge.get(), 400);
        // What turns out smaller leaves room for others.
        others[0].shrink_to(90);
        assert!(rooms.enter(client(4), 11).is_err());
        drop(rooms.enter(client(4), 10).unwrap());
        drop((own, others));
        assert_eq!((gauge.get(), rooms.held_bytes()), (0, 0));
        assert!(rooms.0.clients().is_empty(), "clients are remembered");
    }
}
