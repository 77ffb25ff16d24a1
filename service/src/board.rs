//! The parts that a service waits for, set as they come to be there.

use std::future::Future;
use std::pin::Pin;
use std::sync::{Arc, PoisonError, RwLock};

use async_trait::async_trait;

use crate::{Part, Readiness};

type Answer = Pin<Box<dyn Future<Output = Result<String, String>> + Send>>;
type Ask = Arc<dyn Fn() -> Answer + Send + Sync>;

/// Required parts of a service; one that has not been set is still waited for.
pub struct Board {
    parts: RwLock<Vec<(&'static str, Option<Ask>)>>,
}

impl Board {
    /// Parts that are all still waited for.
    pub fn waiting_for(names: &[&'static str]) -> Arc<Self> {
        let parts = names.iter().map(|name| (*name, None)).collect();
        Arc::new(Self {
            parts: RwLock::new(parts),
        })
    }

    /// Says how a part is asked from now on.
    pub fn set<F, E>(&self, name: &'static str, ask: impl Fn() -> F + Send + Sync + 'static)
    where
        F: Future<Output = Result<String, E>> + Send + 'static,
        E: std::fmt::Display,
    {
        let ask: Ask = Arc::new(move || {
            let asked = ask();
            Box::pin(async move { asked.await.map_err(|error| error.to_string()) })
        });
        // Whoever panicked while holding it left whole entries.
        let mut parts = self.parts.write().unwrap_or_else(PoisonError::into_inner);
        match parts.iter_mut().find(|(known, _)| *known == name) {
            Some(part) => part.1 = Some(ask),
            None => parts.push((name, Some(ask))),
        }
    }
}

#[async_trait]
impl Readiness for Board {
    async fn parts(&self) -> Vec<Part> {
        let parts = self
            .parts
            .read()
            .unwrap_or_else(PoisonError::into_inner)
            .clone();
        let asked = parts.into_iter().map(|(name, ask)| async move {
            match ask {
                Some(ask) => Part::required(name, ask()).await,
                None => Part {
                    name,
                    ok: false,
                    required: true,
                    detail: "it is still waited for".to_owned(),
                },
            }
        });
        futures::future::join_all(asked).await
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_part_is_away_until_it_is_set_and_then_as_it_says() {
        let board = Board::waiting_for(&["store", "log"]);
        board.set("store", || async {
            Ok::<_, String>("it answers".to_owned())
        });
        let oks = |parts: Vec<Part>| parts.iter().map(|part| part.ok).collect::<Vec<_>>();
        assert_eq!(oks(board.parts().await), [true, false]);
        board.set("log", || async { Err::<String, _>("away") });
        assert_eq!(oks(board.parts().await), [true, false]);
        board.set("log", || async { Ok::<_, String>(String::new()) });
        assert_eq!(oks(board.parts().await), [true, true]);
    }
}
