//! SQL over the network: Flight SQL, so that ADBC, JDBC and pandas ask what `fluxglobe sql` asks, in the same session with the
//! same limits.
//!
//! A server holds nothing between two calls: a ticket is the text of its question. Left out on purpose: transactions,
//! parameters of prepared statements, plans by Substrait, and all that writes.

mod access;
mod answers;
mod limits;
mod server;
mod service;

pub use access::{Access, Token};
pub use limits::FlightSqlLimits;
pub use server::FlightSqlServer;
