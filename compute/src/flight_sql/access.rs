//! Who may ask: whoever has the token, or, without one, who is on this machine.

use std::net::SocketAddr;
use std::sync::Arc;

use base64::Engine as _;
use base64::prelude::BASE64_STANDARD;
use contract::digest::Digest;
use tonic::metadata::MetadataMap;
use tonic::service::Interceptor;
use tonic::{Request, Status};

use crate::ComputeError;

/// Shortest token: 16 random bytes as hexadecimal digits are 32, as base64 22.
const LEAST_TOKEN: usize = 16;
const MOST_TOKEN: usize = 4096;

/// A word that whoever asks must know; it is shown nowhere.
#[derive(Clone)]
pub struct Token(Arc<str>);

impl std::fmt::Debug for Token {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a token")
    }
}

impl std::str::FromStr for Token {
    type Err = ComputeError;

    /// One word of 16 to 4096 printable characters.
    fn from_str(text: &str) -> Result<Self, ComputeError> {
        let text = text.trim();
        let is_word = text.bytes().all(|byte| byte.is_ascii_graphic());
        if is_word && (LEAST_TOKEN..=MOST_TOKEN).contains(&text.len()) {
            Ok(Self(text.into()))
        } else {
            let reason = "a token is one word of 16 to 4096 printable characters, such as `openssl rand -hex 32` makes";
            Err(ComputeError::Access {
                reason: reason.to_owned(),
            })
        }
    }
}

/// How a server knows who may ask.
#[derive(Debug, Clone)]
pub struct Access(Option<Token>);

impl Access {
    /// Access to a server that listens at an address.
    ///
    /// # Errors
    /// `Access`: others than this machine could ask, and there is no token.
    pub fn new(token: Option<Token>, address: SocketAddr) -> Result<Self, ComputeError> {
        if token.is_none() && !address.ip().is_loopback() {
            return Err(ComputeError::Access {
                reason: format!(
                    "{address} can be reached from other machines: give --token-file, or listen on 127.0.0.1"
                ),
            });
        }
        Ok(Self(token))
    }

    /// What a client is to send with every call after its handshake.
    pub(super) fn bearer(&self) -> Option<String> {
        self.0.as_ref().map(|token| format!("Bearer {}", token.0))
    }

    fn check(&self, metadata: &MetadataMap) -> Result<(), Status> {
        let Some(token) = &self.0 else {
            return Ok(());
        };
        let said = metadata
            .get("authorization")
            .and_then(|it| it.to_str().ok());
        let said = said.ok_or_else(|| {
            Status::unauthenticated("this server wants a token: send `authorization: Bearer TOKEN`")
        })?;
        let word = match said.split_once(' ') {
            Some(("Bearer", word)) => Some(word.to_owned()),
            // Drivers that know names and passwords only: any name, the token as password.
            Some(("Basic", pair)) => password(pair),
            _ => None,
        };
        // Digests take the same time to compare wherever they differ.
        let is_it =
            word.is_some_and(|word| Digest::of(word.as_bytes()) == Digest::of(token.0.as_bytes()));
        if is_it {
            Ok(())
        } else {
            Err(Status::unauthenticated(
                "that is not the token of this server",
            ))
        }
    }
}

fn password(pair: &str) -> Option<String> {
    let pair = String::from_utf8(BASE64_STANDARD.decode(pair).ok()?).ok()?;
    let (_name, password) = pair.split_once(':')?;
    Some(password.to_owned())
}

impl Interceptor for Access {
    fn call(&mut self, request: Request<()>) -> Result<Request<()>, Status> {
        self.check(request.metadata())?;
        Ok(request)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "0123456789abcdef";

    fn access(token: Option<&str>) -> Access {
        let token = token.map(|token| token.parse().unwrap());
        Access::new(token, "127.0.0.1:1".parse().unwrap()).unwrap()
    }

    fn is_let_in(access: &Access, said: Option<&str>) -> bool {
        let mut metadata = MetadataMap::new();
        if let Some(said) = said {
            metadata.insert("authorization", said.parse().unwrap());
        }
        access.check(&metadata).is_ok()
    }

    #[test]
    fn who_has_the_token_is_let_in_and_nobody_else() {
        let own = access(Some(TOKEN));
        assert!(is_let_in(&own, Some("Bearer 0123456789abcdef")));
        let basic = format!("Basic {}", BASE64_STANDARD.encode(format!("me:{TOKEN}")));
        assert!(is_let_in(&own, Some(&basic)));
        for wrong in [
            "Bearer 0123456789abcdeF",
            "Bearer ",
            "0123456789abcdef",
            "Basic x",
            "Basic bWU6bm8=",
        ] {
            assert!(!is_let_in(&own, Some(wrong)), "{wrong}");
        }
        assert!(!is_let_in(&own, None));
        assert!(is_let_in(&access(None), None));
    }

    #[test]
    fn a_server_that_others_can_reach_wants_a_token() {
        let refused = Access::new(None, "0.0.0.0:8815".parse().unwrap()).unwrap_err();
        assert!(refused.to_string().contains("--token-file"), "{refused}");
        assert!(Access::new(None, "[::1]:8815".parse().unwrap()).is_ok());
        assert!(Access::new(Some(TOKEN.parse().unwrap()), "0.0.0.0:1".parse().unwrap()).is_ok());
        for wrong in ["", "short", "with a space in it 12345", "ünprintable-12345"] {
            assert!(wrong.parse::<Token>().is_err(), "{wrong}");
        }
        assert_eq!(format!("{:?}", TOKEN.parse::<Token>().unwrap()), "a token");
    }
}
