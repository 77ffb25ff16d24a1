//! A Ballista cluster elsewhere, as its clients see it: where its scheduler is and how long they wait for it.

use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::Duration;

use ballista::extension::SessionStateExt as _;
use ballista_core::serde::protobuf::scheduler_grpc_client::SchedulerGrpcClient;
use ballista_core::utils::{GrpcClientConfig, create_grpc_client_endpoint};
use datafusion::error::DataFusionError;
use datafusion::execution::runtime_env::RuntimeEnv;
use datafusion::execution::session_state::SessionState;
use url::{Host, Url};

use crate::{ComputeError, Objects, state};

/// How long a question is asked again while the cluster is away.
pub const RETRY_LIMIT: Duration = Duration::from_mins(2);
/// How long a cluster may take for one query unless told otherwise: no executor has been there, none has room for it, or its
/// scheduler hangs.
pub const QUERY_LIMIT: Duration = Duration::from_hours(1);
/// The port of a scheduler that is named without one.
const DEFAULT_PORT: u16 = 50050;
/// A scheduler that does not answer within this is not there.
const CONNECT_LIMIT: Duration = Duration::from_secs(2);

/// A scheduler's address: `http://host:port`; `df://` and no scheme mean the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SchedulerUrl(String);

impl SchedulerUrl {
    /// A connection that is made when it is first used, and again whenever it was lost.
    pub(crate) fn endpoint(&self) -> Result<tonic::transport::Endpoint, ComputeError> {
        let config = GrpcClientConfig {
            connect_timeout_seconds: CONNECT_LIMIT.as_secs(),
            http2_keepalive_interval_seconds: 5,
            max_message_size: state::MESSAGE_BYTES,
            ..GrpcClientConfig::default()
        };
        create_grpc_client_endpoint(self.0.clone(), Some(&config))
            .map_err(|e| ComputeError::cluster("reaching the scheduler")(e.into()))
    }

    /// Does a scheduler answer there?
    pub(crate) async fn answers(&self) -> Result<(), ComputeError> {
        let connected = self.endpoint()?.connect().await;
        let lost =
            |e: tonic::transport::Error| ComputeError::cluster("reaching the scheduler")(e.into());
        drop(SchedulerGrpcClient::new(connected.map_err(lost)?));
        Ok(())
    }
}

impl std::fmt::Display for SchedulerUrl {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::str::FromStr for SchedulerUrl {
    type Err = ComputeError;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let bad = |reason: &str| ComputeError::SchedulerUrl {
            url: text.to_owned(),
            reason: reason.to_owned(),
        };
        let with_scheme = if text.contains("://") {
            text.to_owned()
        } else {
            format!("http://{text}")
        };
        // `df` is no scheme that has a host by the URL standard's rules, `http` is.
        let url = match with_scheme.strip_prefix("df://") {
            Some(rest) => Url::parse(&format!("http://{rest}")),
            None => Url::parse(&with_scheme),
        };
        let url = url.map_err(|e| bad(&e.to_string()))?;
        if url.scheme() != "http" {
            return Err(bad("the scheme must be http or df"));
        }
        if !url.username().is_empty() || url.password().is_some() {
            return Err(bad("a scheduler takes no user and no password"));
        }
        if !matches!(url.path(), "" | "/") || url.query().is_some() {
            return Err(bad("give a host and a port and nothing after them"));
        }
        let host = url.host().ok_or_else(|| bad("it names no host"))?;
        // An address without a port means Ballista's own, not the web's.
        let has_port = with_scheme.trim_end_matches('/').ends_with(":80");
        let port = url
            .port()
            .unwrap_or(if has_port { 80 } else { DEFAULT_PORT });
        Ok(Self(match host {
            Host::Ipv6(address) => format!("http://[{address}]:{port}"),
            other => format!("http://{other}:{port}"),
        }))
    }
}

/// A cluster and how its clients deal with it.
#[derive(Debug, Clone)]
pub(crate) struct Cluster {
    pub(crate) scheduler: SchedulerUrl,
    pub(crate) retry_limit: Duration,
    pub(crate) query_limit: Duration,
}

impl Cluster {
    /// A failure of it, with the address that it was given by: a name may be wrong.
    pub(crate) fn away(&self, error: ComputeError) -> ComputeError {
        ComputeError::ClusterAway {
            scheduler: self.scheduler.to_string(),
            source: Box::new(error),
        }
    }

    /// The session whose queries go to the scheduler. Nothing is connected yet: each query connects by itself.
    pub(crate) fn session(
        &self,
        objects: &Objects,
        runtime: Arc<RuntimeEnv>,
        partitions: NonZeroUsize,
    ) -> Result<SessionState, DataFusionError> {
        let config = state::ballista_config(partitions);
        let state = state::session_state(config, runtime, objects)?;
        let mut state = state.upgrade_for_ballista(self.scheduler.0.clone())?;
        // The upgrade to a Ballista session resets the functions to the built-in ones.
        state::register_functions(&mut state, objects)?;
        Ok(state)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scheduler_is_named_in_the_usual_ways() {
        for (text, url) in [
            ("scheduler", "http://scheduler:50050"),
            ("scheduler:80", "http://scheduler:80"),
            ("df://10.0.0.1", "http://10.0.0.1:50050"),
            ("http://[::1]:7/", "http://[::1]:7"),
        ] {
            assert_eq!(text.parse::<SchedulerUrl>().unwrap().to_string(), url);
        }
        for text in [
            "",
            "https://a",
            "file:///etc/passwd",
            "http://user:secret@a",
            "http://a/path",
            "http://a?b=c",
        ] {
            let refused = text.parse::<SchedulerUrl>().unwrap_err();
            assert!(!refused.is_retryable(), "{text}");
        }
    }
}
