//! What a store needs besides its location: variables that each cloud knows, and how long to wait for it.

use std::collections::BTreeMap;
use std::fmt::{Debug, Formatter};
use std::time::Duration;

use retry::Backoff;

/// How long a remote store is waited for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RetryLimits {
    /// For a connection.
    pub connect: Duration,
    /// For one request with its answer: a read of 16 MiB; a write of 64 MiB, or of a whole object that must be sent
    /// to a cloud in one.
    pub request: Duration,
    /// How long what may pass (no connection, no answer, throttling, errors of the server) is tried again.
    pub retries: Duration,
}

impl RetryLimits {
    /// When what may pass is tried again.
    pub(super) fn backoff(self) -> Backoff {
        Backoff::within(self.retries)
    }

    /// For those whom somebody waits for: a store that is away is told of within seconds.
    pub fn interactive() -> Self {
        Self {
            connect: Duration::from_secs(1),
            request: Duration::from_secs(10),
            retries: Duration::from_secs(2),
        }
    }
}

impl Default for RetryLimits {
    /// Outlasts a store that fails for a minute, and ends well before a group of readers takes its member for dead.
    fn default() -> Self {
        Self {
            connect: Duration::from_secs(5),
            request: Duration::from_mins(1),
            retries: Duration::from_secs(90),
        }
    }
}

/// Variables and retry limit; the values of variables are secrets and are never shown.
#[derive(Clone, Default)]
pub struct Settings {
    variables: BTreeMap<String, String>,
    /// How long the store is waited for.
    pub retry_limits: RetryLimits,
    /// Is a cloud asked without a signature where there are no credentials for it?
    pub(super) may_be_unsigned: bool,
}

impl Settings {
    /// The same; where there are no credentials, requests are not signed: for what is open to everybody.
    #[must_use]
    pub fn as_anybody(self) -> Self {
        Self {
            may_be_unsigned: true,
            ..self
        }
    }

    /// The variables of this process that a cloud's library knows (`AWS_*`, `GOOGLE_*`, `GCE_*`, `AZURE_*`,
    /// `IDENTITY_ENDPOINT`).
    pub fn from_environment() -> Self {
        Self::from_variables(std::env::vars_os().filter_map(|(name, value)| {
            Some((name.into_string().ok()?, value.into_string().ok()?))
        }))
    }

    /// Variables given by the caller; those that no cloud knows are left out.
    pub fn from_variables(variables: impl IntoIterator<Item = (String, String)>) -> Self {
        const KNOWN: [&str; 5] = ["AWS_", "GOOGLE_", "GCE_", "AZURE_", "IDENTITY_ENDPOINT"];
        let is_known = |name: &str| KNOWN.iter().any(|known| name.starts_with(known));
        Self {
            variables: variables
                .into_iter()
                // An empty variable is how shells and compose files say "not set".
                .filter(|(name, value)| is_known(name) && !value.is_empty())
                .collect(),
            retry_limits: RetryLimits::default(),
            may_be_unsigned: false,
        }
    }

    /// Options of one cloud: variables that begin with a prefix, in lower case, as its builder parses them.
    pub(super) fn options<'a, K: std::str::FromStr>(
        &'a self,
        prefix: &'a str,
    ) -> impl Iterator<Item = (K, &'a str)> {
        self.variables
            .iter()
            .filter(move |(name, _)| name.starts_with(prefix))
            .filter_map(|(name, value)| {
                let key = name.to_ascii_lowercase().parse().ok()?;
                Some((key, value.as_str()))
            })
    }

    /// Is any of these variables set?
    pub(super) fn has_any(&self, names: &[&str]) -> bool {
        names.iter().any(|name| self.variables.contains_key(*name))
    }

    /// Is this variable set to something that means yes?
    pub(super) fn is_on(&self, name: &str) -> bool {
        let value = self.variables.get(name).map(|v| v.to_ascii_lowercase());
        matches!(value.as_deref(), Some("1" | "true" | "on" | "yes" | "y"))
    }
}

impl Debug for Settings {
    fn fmt(&self, f: &mut Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Settings")
            .field("variables", &self.variables.keys())
            .field("retry_limits", &self.retry_limits)
            .field("may_be_unsigned", &self.may_be_unsigned)
            .finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settings_are_shown_without_their_values() {
        let of = |name: &str, value: &str| (name.to_owned(), value.to_owned());
        let settings = Settings::from_variables([
            of("AWS_SECRET_ACCESS_KEY", "hunter2"),
            of("AWS_REGION", ""),
            of("HOME", "somewhere"),
        ]);
        let shown = format!("{settings:?}");
        assert!(shown.contains("AWS_SECRET_ACCESS_KEY"), "{shown}");
        assert!(
            !shown.contains("hunter2") && !shown.contains("HOME"),
            "{shown}"
        );
        assert!(!settings.has_any(&["AWS_REGION", "HOME"]));
    }
}
