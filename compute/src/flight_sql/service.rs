//! The calls of Flight SQL: what a question would answer, its rows, what tables there are. What writes is refused.

use std::pin::Pin;
use std::sync::Arc;

use arrow_flight::flight_service_server::FlightService;
use arrow_flight::sql::metadata::{SqlInfoData, SqlInfoDataBuilder};
use arrow_flight::sql::server::{FlightSqlService, PeekableFlightDataStream};
use arrow_flight::sql::{
    ActionClosePreparedStatementRequest, ActionCreatePreparedStatementRequest,
    ActionCreatePreparedStatementResult, CommandGetCatalogs, CommandGetDbSchemas,
    CommandGetSqlInfo, CommandGetTableTypes, CommandGetTables, CommandPreparedStatementQuery,
    CommandStatementIngest, CommandStatementQuery, CommandStatementUpdate,
    DoPutPreparedStatementResult, ProstMessageExt, SqlInfo, TicketStatementQuery,
};
use arrow_flight::{
    Action, FlightDescriptor, FlightEndpoint, FlightInfo, HandshakeRequest, HandshakeResponse,
    IpcMessage, SchemaAsIpc, Ticket,
};
use bytes::Bytes;
use datafusion::arrow::datatypes::{Schema, SchemaRef};
use datafusion::arrow::ipc::writer::IpcWriteOptions;
use futures::{Stream, stream};
use prost::Message as _;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tonic::{Request, Response, Status, Streaming};

use super::access::Access;
use super::answers::{self, Answer, status};
use super::limits::FlightSqlLimits;
use crate::ComputeError;
use crate::sql::{CATALOG, SCHEMA, Sql};

const TABLE: &str = "TABLE";
const READS_ONLY: &str = "this server reads only: nothing is stored by SQL";

/// Answers calls.
pub(super) struct Questions {
    sql: Sql,
    limits: FlightSqlLimits,
    turns: Arc<Semaphore>,
    bearer: Option<String>,
    about: SqlInfoData,
}

type Handshake = Pin<Box<dyn Stream<Item = Result<HandshakeResponse, Status>> + Send>>;

impl Questions {
    pub(super) fn new(
        sql: Sql,
        limits: FlightSqlLimits,
        turns: Arc<Semaphore>,
        access: &Access,
    ) -> Result<Self, ComputeError> {
        Ok(Self {
            sql,
            limits,
            turns,
            bearer: access.bearer(),
            about: about()?,
        })
    }

    /// A turn, or the advice to come again.
    fn turn(&self) -> Result<OwnedSemaphorePermit, Status> {
        Arc::clone(&self.turns)
            .try_acquire_owned()
            .map_err(|_none_free| {
                let most = self.limits.questions_at_once;
                Status::unavailable(format!("{most} questions are worked on already; ask again"))
            })
    }

    async fn columns(&self, text: &str) -> Result<SchemaRef, Status> {
        let turn = self.turn()?;
        let columns = self.sql.columns_in_turn(text, Some(turn)).await;
        columns.map_err(|error| status(&error))
    }

    /// What a question answers, and the ticket that has it answered: its text.
    async fn info(
        &self,
        text: String,
        asked: Request<FlightDescriptor>,
    ) -> Result<Response<FlightInfo>, Status> {
        let columns = self.columns(&text).await?;
        let ticket = TicketStatementQuery {
            statement_handle: text.into(),
        };
        info(&columns, &ticket, asked)
    }

    async fn rows(&self, text: &str) -> Result<Response<Answer>, Status> {
        let turn = self.turn()?;
        let rows = self.sql.ask_in_turn(text, Some(turn)).await;
        let rows = rows.map_err(|error| status(&error))?;
        Ok(Response::new(answers::rows(rows, self.limits.max_rows)))
    }
}

fn about() -> Result<SqlInfoData, ComputeError> {
    let mut about = SqlInfoDataBuilder::new();
    about.append(SqlInfo::FlightSqlServerName, "fluxglobe");
    about.append(SqlInfo::FlightSqlServerVersion, env!("CARGO_PKG_VERSION"));
    about.append(SqlInfo::FlightSqlServerArrowVersion, "1.5");
    about.append(SqlInfo::FlightSqlServerReadOnly, true);
    about.append(SqlInfo::FlightSqlServerSql, true);
    about.append(SqlInfo::FlightSqlServerSubstrait, false);
    about.append(SqlInfo::FlightSqlServerTransaction, 0i32);
    about.append(SqlInfo::FlightSqlServerCancel, false);
    about.append(SqlInfo::SqlDdlCatalog, false);
    about.append(SqlInfo::SqlDdlSchema, false);
    about.append(SqlInfo::SqlDdlTable, false);
    about.append(SqlInfo::SqlIdentifierQuoteChar, "\"");
    let built = about.build();
    built.map_err(|e| ComputeError::inconsistent("what the server says of itself", e))
}

/// `asked` is what it was asked for with: clients written in C++, pyarrow's among them, take no answer without it.
fn info(
    columns: &Schema,
    ticket: &impl ProstMessageExt,
    asked: Request<FlightDescriptor>,
) -> Result<Response<FlightInfo>, Status> {
    let ticket = Ticket::new(ticket.as_any().encode_to_vec());
    let info = FlightInfo::new().try_with_schema(columns);
    let info = info.map_err(|e| Status::internal(e.to_string()))?;
    let info = info.with_descriptor(asked.into_inner());
    let endpoint = FlightEndpoint::new().with_ticket(ticket);
    Ok(Response::new(info.with_endpoint(endpoint)))
}

fn text_of(handle: &[u8]) -> Result<&str, Status> {
    let text = std::str::from_utf8(handle);
    text.map_err(|_no_text| Status::invalid_argument("that is no ticket of this server"))
}

#[tonic::async_trait]
impl FlightSqlService for Questions {
    type FlightService = Self;

    /// For drivers that know names and passwords; who comes here was let in.
    async fn do_handshake(
        &self,
        _request: Request<Streaming<HandshakeRequest>>,
    ) -> Result<Response<Handshake>, Status> {
        let bearer = self.bearer.clone().unwrap_or_default();
        let response = HandshakeResponse {
            protocol_version: 0,
            payload: Bytes::from(bearer.trim_start_matches("Bearer ").to_owned()),
        };
        let answer: Handshake = Box::pin(stream::once(async { Ok(response) }));
        let mut answer = Response::new(answer);
        if let Ok(value) = bearer.parse() {
            answer.metadata_mut().insert("authorization", value);
        }
        Ok(answer)
    }

    async fn get_flight_info_statement(
        &self,
        query: CommandStatementQuery,
        request: Request<FlightDescriptor>,
    ) -> Result<Response<FlightInfo>, Status> {
        self.info(query.query, request).await
    }

    async fn get_flight_info_prepared_statement(
        &self,
        query: CommandPreparedStatementQuery,
        request: Request<FlightDescriptor>,
    ) -> Result<Response<FlightInfo>, Status> {
        let text = text_of(&query.prepared_statement_handle)?.to_owned();
        self.info(text, request).await
    }

    async fn do_get_statement(
        &self,
        ticket: TicketStatementQuery,
        _request: Request<Ticket>,
    ) -> Result<Response<<Self as FlightService>::DoGetStream>, Status> {
        self.rows(text_of(&ticket.statement_handle)?).await
    }

    async fn do_get_prepared_statement(
        &self,
        query: CommandPreparedStatementQuery,
        _request: Request<Ticket>,
    ) -> Result<Response<<Self as FlightService>::DoGetStream>, Status> {
        self.rows(text_of(&query.prepared_statement_handle)?).await
    }

    async fn do_action_create_prepared_statement(
        &self,
        query: ActionCreatePreparedStatementRequest,
        _request: Request<Action>,
    ) -> Result<ActionCreatePreparedStatementResult, Status> {
        let columns = self.columns(&query.query).await?;
        let ipc = |schema: &Schema| {
            let message =
                IpcMessage::try_from(SchemaAsIpc::new(schema, &IpcWriteOptions::default()));
            message.map_err(|e| Status::internal(e.to_string()))
        };
        let IpcMessage(dataset_schema) = ipc(&columns)?;
        let IpcMessage(parameter_schema) = ipc(&Schema::empty())?;
        Ok(ActionCreatePreparedStatementResult {
            prepared_statement_handle: query.query.into(),
            dataset_schema,
            parameter_schema,
        })
    }

    /// There is nothing to close: a handle is a text.
    async fn do_action_close_prepared_statement(
        &self,
        _query: ActionClosePreparedStatementRequest,
        _request: Request<Action>,
    ) -> Result<(), Status> {
        Ok(())
    }

    async fn do_put_prepared_statement_query(
        &self,
        _query: CommandPreparedStatementQuery,
        _request: Request<PeekableFlightDataStream>,
    ) -> Result<DoPutPreparedStatementResult, Status> {
        let reason = "parameters are not taken: write values into the text of the question";
        Err(Status::invalid_argument(reason))
    }

    async fn do_put_statement_update(
        &self,
        _update: CommandStatementUpdate,
        _request: Request<PeekableFlightDataStream>,
    ) -> Result<i64, Status> {
        Err(Status::permission_denied(READS_ONLY))
    }

    async fn do_put_statement_ingest(
        &self,
        _rows: CommandStatementIngest,
        _request: Request<PeekableFlightDataStream>,
    ) -> Result<i64, Status> {
        Err(Status::permission_denied(READS_ONLY))
    }

    async fn get_flight_info_catalogs(
        &self,
        query: CommandGetCatalogs,
        request: Request<FlightDescriptor>,
    ) -> Result<Response<FlightInfo>, Status> {
        info(&query.into_builder().schema(), &query, request)
    }

    async fn do_get_catalogs(
        &self,
        query: CommandGetCatalogs,
        _request: Request<Ticket>,
    ) -> Result<Response<<Self as FlightService>::DoGetStream>, Status> {
        let mut listed = query.into_builder();
        listed.append(CATALOG);
        Ok(Response::new(answers::batch(listed.build()?)))
    }

    async fn get_flight_info_schemas(
        &self,
        query: CommandGetDbSchemas,
        request: Request<FlightDescriptor>,
    ) -> Result<Response<FlightInfo>, Status> {
        info(&query.clone().into_builder().schema(), &query, request)
    }

    async fn do_get_schemas(
        &self,
        query: CommandGetDbSchemas,
        _request: Request<Ticket>,
    ) -> Result<Response<<Self as FlightService>::DoGetStream>, Status> {
        let mut listed = query.into_builder();
        listed.append(CATALOG, SCHEMA);
        Ok(Response::new(answers::batch(listed.build()?)))
    }

    async fn get_flight_info_tables(
        &self,
        query: CommandGetTables,
        request: Request<FlightDescriptor>,
    ) -> Result<Response<FlightInfo>, Status> {
        info(&query.clone().into_builder().schema(), &query, request)
    }

    async fn do_get_tables(
        &self,
        query: CommandGetTables,
        _request: Request<Ticket>,
    ) -> Result<Response<<Self as FlightService>::DoGetStream>, Status> {
        let _turn = self.turn()?;
        let tables = self.sql.tables(query.include_schema).await;
        let mut listed = query.into_builder();
        for (name, columns) in tables.map_err(|error| status(&error))? {
            listed.append(CATALOG, SCHEMA, name, TABLE, &columns)?;
        }
        Ok(Response::new(answers::batch(listed.build()?)))
    }

    async fn get_flight_info_table_types(
        &self,
        query: CommandGetTableTypes,
        request: Request<FlightDescriptor>,
    ) -> Result<Response<FlightInfo>, Status> {
        info(&query.into_builder().schema(), &query, request)
    }

    async fn do_get_table_types(
        &self,
        query: CommandGetTableTypes,
        _request: Request<Ticket>,
    ) -> Result<Response<<Self as FlightService>::DoGetStream>, Status> {
        let mut listed = query.into_builder();
        listed.append(TABLE);
        Ok(Response::new(answers::batch(listed.build()?)))
    }

    async fn get_flight_info_sql_info(
        &self,
        query: CommandGetSqlInfo,
        request: Request<FlightDescriptor>,
    ) -> Result<Response<FlightInfo>, Status> {
        info(
            &query.clone().into_builder(&self.about).schema(),
            &query,
            request,
        )
    }

    async fn do_get_sql_info(
        &self,
        query: CommandGetSqlInfo,
        _request: Request<Ticket>,
    ) -> Result<Response<<Self as FlightService>::DoGetStream>, Status> {
        let listed = query.into_builder(&self.about);
        Ok(Response::new(answers::batch(listed.build()?)))
    }

    async fn register_sql_info(&self, _id: i32, _result: &SqlInfo) {}
}
