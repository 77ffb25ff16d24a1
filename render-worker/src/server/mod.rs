//! A render worker as a process: a desk behind gRPC.

mod answers;
mod settings;

use std::net::SocketAddr;
use std::time::Duration;

use ::service::Stop;
use tonic::transport::server::TcpIncoming;

use crate::desk::Desk;
use crate::wire::proto::renderer_server::RendererServer;
use crate::wire::{MOST_REQUEST_BYTES, Version};
use answers::Answers;

pub use settings::Settings;

/// Calls of one connection at the same time; more wait in the caller.
const MOST_STREAMS: u32 = 256;
/// Headers of one call, bytes.
const MOST_HEADER_BYTES: u32 = 16 << 10;
/// A caller that does not answer a ping for so long is gone, and so are his calls.
const PING: Duration = Duration::from_secs(10);

/// A server that cannot start or that ended by itself.
#[derive(Debug, thiserror::Error)]
pub enum ServerError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}; is another process there? Give another address")]
    Listen {
        address: SocketAddr,
        source: std::io::Error,
    },
    /// The server ended by itself.
    #[error("the render server stopped")]
    Stopped(#[source] tonic::transport::Error),
}

impl ServerError {
    /// May the same start succeed later?
    pub fn is_retryable(&self) -> bool {
        match self {
            Self::Listen { .. } => false,
            Self::Stopped(_) => true,
        }
    }
}

/// A server that holds its address but does not answer yet.
pub struct Server {
    desk: Desk,
    version: Version,
    incoming: TcpIncoming,
    address: SocketAddr,
    drain: Duration,
}

impl Server {
    /// Takes the address of the settings. Needs a runtime.
    pub fn bind(desk: Desk, settings: &Settings) -> Result<Self, ServerError> {
        let address = settings.render_listen;
        let listen = |source| ServerError::Listen { address, source };
        let incoming = TcpIncoming::bind(address).map_err(listen)?;
        let bound = incoming.local_addr().map_err(listen)?;
        Ok(Self {
            desk,
            version: Version::own(),
            incoming: incoming.with_nodelay(Some(true)),
            address: bound,
            drain: settings.drain(),
        })
    }

    /// The same as if it were another version, for tests of how versions meet.
    #[must_use]
    pub fn as_version(self, version: Version) -> Self {
        Self { version, ..self }
    }

    /// Where it listens; the port is the real one where port 0 was asked for.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Answers until asked to stop. Then it refuses what is new, so that callers go elsewhere, and ends with what is
    /// under way, at the latest after the time that the settings give.
    pub async fn run(self, stop: Stop) -> Result<(), ServerError> {
        let (desk, given_out) = (self.desk.clone(), self.desk.clone());
        let answers = Answers {
            desk: self.desk,
            version: self.version,
        };
        let service = RendererServer::new(answers).max_decoding_message_size(MOST_REQUEST_BYTES);
        let stopping = {
            let stop = stop.clone();
            async move {
                stop.said().await;
                desk.stop();
                tracing::info!("finishing what is under way");
            }
        };
        let serving = tonic::transport::Server::builder()
            .max_concurrent_streams(MOST_STREAMS)
            .http2_max_header_list_size(MOST_HEADER_BYTES)
            .http2_keepalive_interval(Some(PING))
            .http2_keepalive_timeout(Some(PING))
            .serve_with_incoming_shutdown(service, self.incoming, stopping);
        let given_up = async {
            stop.said().await;
            tokio::time::sleep(self.drain).await;
        };
        let served = async {
            let served = serving.await;
            // What was given out is stored too.
            given_out.settled().await;
            served
        };
        tokio::select! {
            served = served => served.map_err(ServerError::Stopped),
            () = given_up => {
                tracing::warn!("some callers are left without an answer");
                Ok(())
            }
        }
    }
}
