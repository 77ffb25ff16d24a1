//! Settings of the observation store: flags and environment variables of the same names.

use std::num::{NonZeroU16, NonZeroU32};
use std::path::{Path, PathBuf};
use std::time::Duration;

use openssl::ssl::{SslConnector, SslMethod, SslVerifyMode};
use postgres_openssl::MakeTlsConnector;
use tokio_postgres::config::{Host, SslMode};

use crate::error::ObservationError;

/// Largest password file, bytes.
const MAX_PASSWORD_BYTES: u64 = 4096;
/// Longest time for a connection to be made.
const CONNECT: Duration = Duration::from_secs(5);
/// A peer that acknowledges nothing for so long is gone.
const SILENCE: Duration = Duration::from_secs(10);

/// Where observations are kept.
#[derive(Debug, Clone, clap::Args)]
pub struct ObservationSettings {
    /// PostGIS database for observations, such as `postgres://fluxglobe@db:5432/fluxglobe?sslmode=verify-full`. sslmode is
    /// disable, require (encrypted, the server is not checked) or verify-full; verify-full if not said, but prefer for
    /// this machine. No password in it. Without this setting observations are GeoParquet files in the object store.
    #[arg(long, env = "FLUXGLOBE_POSTGIS", value_name = "URL")]
    pub postgis: Option<String>,

    /// File with the database password, one line, at most 4096 bytes. Without it none is sent.
    #[arg(long, env = "FLUXGLOBE_POSTGIS_PASSWORD_FILE", value_name = "FILE")]
    pub postgis_password_file: Option<PathBuf>,

    /// File with the certificates (PEM) that the database's may be signed by; the system's if absent.
    #[arg(long, env = "FLUXGLOBE_POSTGIS_CA_FILE", value_name = "FILE")]
    pub postgis_ca_file: Option<PathBuf>,

    /// Schema that the tables are made in: 1 to 63 of a-z, 0-9 and _.
    #[arg(long, env = "FLUXGLOBE_POSTGIS_SCHEMA", default_value = "fluxglobe", value_parser = schema)]
    pub postgis_schema: String,

    /// Most connections to the database at a time, 1 to 64.
    #[arg(long, env = "FLUXGLOBE_POSTGIS_CONNECTIONS", default_value = "8", value_parser = connections)]
    pub postgis_connections: NonZeroU16,

    /// Longest time for one statement, seconds, 1 to 600.
    #[arg(long, env = "FLUXGLOBE_POSTGIS_STATEMENT_S", default_value = "30", value_parser = statement_s)]
    pub postgis_statement_s: NonZeroU32,
}

/// A database that observations are kept in, ready to be connected to.
#[derive(Clone)]
pub struct DatabaseSettings {
    pub(crate) config: tokio_postgres::Config,
    pub(crate) tls: MakeTlsConnector,
    pub(crate) schema: String,
    pub(crate) connections: usize,
    pub(crate) statement: Duration,
    /// Host and port for people.
    pub(crate) address: String,
}

impl std::fmt::Debug for DatabaseSettings {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(
            f,
            "DatabaseSettings({}, schema {})",
            self.address, self.schema
        )
    }
}

/// How much the connection is protected.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Protection {
    Disable,
    /// Encrypted if the server can.
    Prefer,
    Require,
    VerifyFull,
}

impl ObservationSettings {
    /// Observations in files of the object store.
    pub fn files() -> Self {
        Self {
            postgis: None,
            postgis_password_file: None,
            postgis_ca_file: None,
            postgis_schema: "fluxglobe".to_owned(),
            postgis_connections: NonZeroU16::new(8).expect("eight is not zero"),
            postgis_statement_s: NonZeroU32::new(30).expect("thirty is not zero"),
        }
    }

    /// The database that the settings name, if they name one; the password file is read now.
    pub fn database(&self) -> Result<Option<DatabaseSettings>, ObservationError> {
        let Some(url) = self.postgis.as_deref().filter(|url| !url.is_empty()) else {
            return Ok(None);
        };
        let (mut config, protection) = parse(url)?;
        if let Some(file) = &self.postgis_password_file {
            config.password(password(file)?);
        }
        let schema = schema(&self.postgis_schema).map_err(ObservationError::setup)?;
        let statement = Duration::from_secs(self.postgis_statement_s.get().into());
        // The time zone and the search path are set for each connection: no statement depends on the server's own.
        let options = format!(
            "-c statement_timeout={} -c lock_timeout={} -c search_path={schema},public -c timezone=UTC -c client_min_messages=warning",
            statement.as_millis(),
            statement.as_millis()
        );
        config
            .options(options)
            .application_name("fluxglobe")
            .connect_timeout(CONNECT)
            .tcp_user_timeout(SILENCE)
            .keepalives_idle(SILENCE)
            .ssl_mode(match protection {
                Protection::Disable => SslMode::Disable,
                Protection::Prefer => SslMode::Prefer,
                Protection::Require | Protection::VerifyFull => SslMode::Require,
            });
        Ok(Some(DatabaseSettings {
            tls: connector(protection, self.postgis_ca_file.as_deref())?,
            address: address(&config),
            config,
            schema,
            connections: usize::from(self.postgis_connections.get()),
            statement,
        }))
    }
}

/// Reads a URL; errors never show it, since a password may have been put into it.
fn parse(url: &str) -> Result<(tokio_postgres::Config, Protection), ObservationError> {
    let bad = |reason: &str| ObservationError::setup(format!("--postgis: {reason}"));
    if !(url.starts_with("postgres://") || url.starts_with("postgresql://")) {
        return Err(bad("give postgres://USER@HOST:PORT/DATABASE"));
    }
    // The library knows fewer modes than servers do, so the mode is taken out before it reads the rest.
    let (base, query) = url.split_once('?').unwrap_or((url, ""));
    let mut mode = None;
    let mut rest = vec![];
    for pair in query.split('&').filter(|pair| !pair.is_empty()) {
        match pair.strip_prefix("sslmode=") {
            Some(value) => mode = Some(value),
            None => rest.push(pair),
        }
    }
    let config: tokio_postgres::Config = format!(
        "{base}{}{}",
        if rest.is_empty() { "" } else { "?" },
        rest.join("&")
    )
    .parse()
    .map_err(|_unparsed| bad("it is no address of a database, or has unknown parameters"))?;
    if config.get_password().is_some() {
        return Err(bad(
            "no password in it; put it into a file and give --postgis-password-file",
        ));
    }
    if config.get_hosts().is_empty() {
        return Err(bad("it names no host"));
    }
    let protection = match mode {
        Some("disable") => Protection::Disable,
        Some("require") => Protection::Require,
        None if config.get_hosts().iter().all(is_this_machine) => Protection::Prefer,
        Some("verify-full") | None => Protection::VerifyFull,
        Some(_) => return Err(bad("sslmode is disable, require or verify-full")),
    };
    Ok((config, protection))
}

fn is_this_machine(host: &Host) -> bool {
    match host {
        Host::Tcp(name) => {
            name == "localhost"
                || name
                    .trim_matches(['[', ']'])
                    .parse::<std::net::IpAddr>()
                    .is_ok_and(|ip| ip.is_loopback())
        }
        Host::Unix(_) => true,
    }
}

fn connector(
    protection: Protection,
    ca: Option<&Path>,
) -> Result<MakeTlsConnector, ObservationError> {
    let bad = |e: openssl::error::ErrorStack| ObservationError::setup(format!("TLS: {e}"));
    let mut builder = SslConnector::builder(SslMethod::tls_client()).map_err(bad)?;
    if let Some(ca) = ca {
        let unread =
            |e| ObservationError::setup(format!("--postgis-ca-file {}: {e}", ca.display()));
        builder.set_ca_file(ca).map_err(unread)?;
    }
    let is_checked = protection == Protection::VerifyFull;
    if !is_checked {
        builder.set_verify(SslVerifyMode::NONE);
    }
    let mut connector = MakeTlsConnector::new(builder.build());
    connector.set_callback(move |ssl, _domain| {
        ssl.set_verify_hostname(is_checked);
        Ok(())
    });
    Ok(connector)
}

fn password(file: &Path) -> Result<Vec<u8>, ObservationError> {
    use std::io::Read as _;
    let bad = |e: String| {
        ObservationError::setup(format!("--postgis-password-file {}: {e}", file.display()))
    };
    let mut content = Vec::new();
    std::fs::File::open(file)
        .and_then(|open| open.take(MAX_PASSWORD_BYTES + 1).read_to_end(&mut content))
        .map_err(|e| bad(e.to_string()))?;
    if content.len() as u64 > MAX_PASSWORD_BYTES {
        return Err(bad(format!("it is longer than {MAX_PASSWORD_BYTES} bytes")));
    }
    let line = content
        .split(|byte| *byte == b'\n')
        .next()
        .unwrap_or_default();
    let line = line.strip_suffix(b"\r").unwrap_or(line);
    if line.is_empty() {
        return Err(bad("its first line is empty".to_owned()));
    }
    Ok(line.to_vec())
}

fn address(config: &tokio_postgres::Config) -> String {
    let host = match config.get_hosts().first() {
        Some(Host::Tcp(name)) => name.clone(),
        Some(Host::Unix(path)) => path.display().to_string(),
        None => String::new(),
    };
    let port = config.get_ports().first().copied().unwrap_or(5432);
    format!("{host}:{port}/{}", config.get_dbname().unwrap_or_default())
}

/// The name stands in statements as it is, so it must be nothing but a name.
fn schema(text: &str) -> Result<String, String> {
    let is_plain = |b: u8| matches!(b, b'a'..=b'z' | b'0'..=b'9' | b'_');
    let starts = text.starts_with(|c: char| c.is_ascii_lowercase());
    if starts && text.len() <= 63 && text.bytes().all(is_plain) && !text.starts_with("pg_") {
        Ok(text.to_owned())
    } else {
        Err("1 to 63 of a-z, 0-9 and _, starting with a letter, not with pg_".to_owned())
    }
}

fn connections(text: &str) -> Result<NonZeroU16, String> {
    let number = text.parse().ok().filter(|n: &NonZeroU16| n.get() <= 64);
    number.ok_or_else(|| "1 to 64".to_owned())
}

fn statement_s(text: &str) -> Result<NonZeroU32, String> {
    let number = text.parse().ok().filter(|n: &NonZeroU32| n.get() <= 600);
    number.ok_or_else(|| "1 to 600".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn settings(url: &str) -> ObservationSettings {
        ObservationSettings {
            postgis: Some(url.to_owned()),
            ..ObservationSettings::files()
        }
    }

    #[test]
    fn without_a_database_observations_are_files() {
        assert!(ObservationSettings::files().database().unwrap().is_none());
        assert!(settings("").database().unwrap().is_none());
    }

    #[test]
    fn another_machine_is_checked_unless_it_is_said_otherwise() {
        let protection = |url: &str| parse(url).unwrap().1;
        assert_eq!(protection("postgres://u@db/d"), Protection::VerifyFull);
        assert_eq!(
            protection("postgres://u@127.0.0.1:5432/d"),
            Protection::Prefer
        );
        assert_eq!(
            protection("postgres://u@db/d?sslmode=disable"),
            Protection::Disable
        );
        assert_eq!(
            protection("postgres://u@127.0.0.1/d?sslmode=require"),
            Protection::Require
        );
    }

    #[test]
    fn a_password_in_a_url_is_refused_and_never_shown() {
        for url in [
            "postgres://u:geheim@db/d",
            "postgres://u@db/d?password=geheim",
            "postgres://u@db/d?geheim=1",
            "mysql://geheim@db/d",
            "postgres://u@db/d?sslmode=geheim",
        ] {
            let error = settings(url).database().unwrap_err().to_string();
            assert!(!error.contains("geheim"), "{error}");
        }
    }

    #[test]
    fn a_password_file_is_one_line_and_not_shown() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("password");
        std::fs::write(&file, "geheim\r\nmore\n").unwrap();
        assert_eq!(password(&file).unwrap(), b"geheim");
        let database = ObservationSettings {
            postgis_password_file: Some(file.clone()),
            ..settings("postgres://u@db:5433/d")
        };
        let shown = format!("{:?} {database:?}", database.database().unwrap().unwrap());
        assert!(
            shown.contains("db:5433/d") && !shown.contains("geheim"),
            "{shown}"
        );
        for content in [String::new(), "\nx".to_owned(), "x".repeat(5000)] {
            std::fs::write(&file, content).unwrap();
            assert!(password(&file).is_err());
        }
        assert!(password(&folder.path().join("absent")).is_err());
    }

    #[test]
    fn a_schema_is_nothing_but_a_name() {
        for text in [
            "",
            "a b",
            "a;drop",
            "A",
            "1a",
            "pg_catalog",
            "a\"",
            &"a".repeat(64),
        ] {
            assert!(schema(text).is_err(), "{text}");
        }
        assert!(schema("fluxglobe_2").is_ok());
    }
}
