//! Words of `fluxglobe flight-sql`.

use std::net::SocketAddr;
use std::num::NonZeroU16;
use std::path::PathBuf;

use clap::Args;

use super::sql::QuestionLimits;

/// `fluxglobe flight-sql`.
#[derive(Debug, Args)]
#[command(after_long_help = "\
The tables, functions and limits are those of `fluxglobe sql`. Then, in Python:
  import adbc_driver_flightsql.dbapi as flight
  with flight.connect(\"grpc://127.0.0.1:8815\", autocommit=True) as connection, connection.cursor() as cursor:
      cursor.execute(\"SELECT name, unit, steps FROM products\")
      print(cursor.fetch_df())

With a token: db_kwargs={\"adbc.flight.sql.authorization_header\": \"Bearer TOKEN\"}. Nothing is encrypted here: over a
network, put a proxy that ends TLS before it. docs/sql.md shows more.")]
pub(crate) struct FlightSql {
    /// Address to listen at. Others than this machine are let in with a token only.
    #[arg(
        long,
        env = "FLUXGLOBE_FLIGHT_SQL_LISTEN",
        default_value = "127.0.0.1:8815",
        value_parser = service::socket_address,
        value_name = "ADDRESS:PORT"
    )]
    pub(crate) listen: SocketAddr,
    /// File with the token that whoever asks must send: one word of 16 to 4096 characters.
    #[arg(long, env = "FLUXGLOBE_FLIGHT_SQL_TOKEN_FILE", value_name = "FILE")]
    pub(crate) token_file: Option<PathBuf>,
    /// Questions that are worked on at a time; others are told to ask again. Each may take --memory-mib.
    #[arg(long, default_value_t = NonZeroU16::new(4).expect("it is not 0"), value_name = "COUNT")]
    pub(crate) questions_at_once: NonZeroU16,
    /// Most rows of an answer; more are an error.
    #[arg(long, default_value_t = 100_000_000, value_name = "COUNT")]
    pub(crate) max_rows: u64,
    #[command(flatten)]
    pub(crate) limits: QuestionLimits,
}
