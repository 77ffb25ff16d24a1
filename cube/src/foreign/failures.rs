//! Objects of others, with a note of each failure: the libraries that read arrays and repositories hand failures on as text, in which
//! it cannot be told any more whether they pass.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use async_trait::async_trait;
use bytes::Bytes;
use object_store::GetRange;

use super::error::ForeignError;
use super::objects::Objects;
use crate::error::first_lines;

/// Failures that are remembered: more than requests are under way at a time.
const REMEMBERED: usize = 64;

/// Objects whose failures are noted.
#[derive(Debug)]
pub(super) struct Noted {
    inner: Arc<dyn Objects>,
    failures: Arc<Failures>,
}

/// The last failures.
#[derive(Debug, Default)]
pub(super) struct Failures(Mutex<VecDeque<ForeignError>>);

impl Failures {
    fn note(&self, error: ForeignError) -> ForeignError {
        // Changed by single steps: a poisoned list is whole.
        let mut last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if last.len() == REMEMBERED {
            last.pop_front();
        }
        last.push_back(error.clone());
        error
    }

    /// The error of a library at something: what is behind it, or what it tells.
    pub(super) fn told(
        &self,
        place: &str,
        doing: &str,
        told: &dyn std::fmt::Display,
    ) -> ForeignError {
        match self.behind(told) {
            Some(failure) => failure.of(place),
            None => ForeignError::refused(place, format!("{doing}: {}", first_lines(told))),
        }
    }

    /// The failure that a library tells of; none if what it tells of is its own.
    pub(super) fn behind(&self, told: &dyn std::fmt::Display) -> Option<ForeignError> {
        let told = told.to_string();
        let last = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mut newest_first = last.iter().rev();
        newest_first
            .find(|error| told.contains(&error.to_string()))
            .cloned()
    }
}

impl Noted {
    /// The objects to read by, and where their failures are noted.
    pub(super) fn of(inner: Arc<dyn Objects>) -> (Arc<dyn Objects>, Arc<Failures>) {
        let failures = Arc::<Failures>::default();
        let noted = Self {
            inner,
            failures: Arc::clone(&failures),
        };
        (Arc::new(noted), failures)
    }
}

#[async_trait]
impl Objects for Noted {
    fn place(&self) -> String {
        self.inner.place()
    }

    async fn get(
        &self,
        name: &str,
        part: Option<GetRange>,
        most_bytes: u64,
    ) -> Result<Option<Bytes>, ForeignError> {
        let got = self.inner.get(name, part, most_bytes).await;
        got.map_err(|e| self.failures.note(e))
    }

    async fn size(&self, name: &str) -> Result<Option<u64>, ForeignError> {
        let size = self.inner.size(name).await;
        size.map_err(|e| self.failures.note(e))
    }

    async fn folders(&self, folder: &str) -> Result<Option<Vec<String>>, ForeignError> {
        let folders = self.inner.folders(folder).await;
        folders.map_err(|e| self.failures.note(e))
    }
}
