//! `fluxglobe flight-sql`: answers SQL over the network until it is asked to stop.

use std::path::Path;

use anyhow::{Context as _, Result};
use compute::flight_sql::{Access, FlightSqlLimits, FlightSqlServer, Token};
use compute::sql::Sql;

use crate::cli::{FlightSql, Settings};
use crate::command::serve;
use crate::{deployment, progress};

pub(crate) async fn run(settings: &Settings, options: &FlightSql) -> Result<()> {
    let token = options.token_file.as_deref().map(token).transpose()?;
    let access = Access::new(token, options.listen)?;
    serve::check_free(options.listen)?;
    let store = deployment::interactive_store(settings)?;
    let sql = Sql::new(
        &deployment::in_process(settings, store),
        options.limits.limits(),
    )?;
    let limits = FlightSqlLimits {
        questions_at_once: options.questions_at_once.into(),
        max_rows: options.max_rows,
    };
    let stop = service::when_asked_to_stop()?;
    let server = FlightSqlServer::bind(options.listen, access, sql, limits).await?;
    progress::say(&format!("{:>24} grpc://{}", "open", server.address()));
    server.run(stop.said()).await?;
    Ok(())
}

fn token(path: &Path) -> Result<Token> {
    let text = std::fs::read_to_string(path);
    let text = text.with_context(|| format!("cannot read the token in {}", path.display()))?;
    text.parse()
        .with_context(|| format!("the token in {}", path.display()))
}
