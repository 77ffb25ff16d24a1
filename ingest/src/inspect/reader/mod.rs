//! Reading a file in a process of its own, with limits, so that a hostile file can kill only its reader.
//!
//! [`run_child`] is the whole reader process: it limits itself, opens the file, writes a description to its standard
//! output, then answers requests for values from its standard input until that ends. [`session::Session`] is the other
//! side. Every length that crosses the border is checked before anything is allocated for it.

mod child;
mod protocol;
pub(crate) mod session;

pub use child::run_child;

/// Exit code of a reader for what is its parent's doing and not the file's.
const EXIT_USAGE: u8 = 64;
