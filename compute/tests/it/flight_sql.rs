//! Flight SQL as clients see it: the rows of the session, who is let in, limits, what is refused.

use std::net::SocketAddr;
use std::num::NonZeroUsize;
use std::sync::Arc;
use std::time::{Duration, Instant};

use arrow_flight::error::FlightError;
use arrow_flight::sql::client::FlightSqlServiceClient;
use arrow_flight::sql::{CommandGetDbSchemas, CommandGetTables, SqlInfo};
use compute::Engine;
use compute::flight_sql::{Access, FlightSqlLimits, FlightSqlServer, Token};
use compute::sql::{Sql, SqlLimits};
use contract::grid::Grid;
use contract::quantity::Quantity;
use datafusion::arrow::array::{ArrayRef, AsArray as _, Int64Array, RecordBatch};
use datafusion::arrow::compute::concat_batches;
use datafusion::arrow::util::display::array_value_to_string;
use futures::TryStreamExt as _;
use tonic::transport::{Channel, Endpoint};

use crate::fixture::{folder_store, land, parts, product, wavy_year};

const GRID: Grid = Grid {
    rows: 60,
    cols: 90,
    north_deg: 30.0,
    west_deg: 100.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};
const TOKEN: &str = "a-token-of-some-length";

/// A server in this process; it ends with the test.
struct Serving {
    address: SocketAddr,
    sql: Sql,
    _folder: tempfile::TempDir,
}

struct Asked {
    token: Option<&'static str>,
    questions_at_once: usize,
    max_rows: u64,
    time: Duration,
}

const OPEN: Asked = Asked {
    token: None,
    questions_at_once: 4,
    max_rows: 1_000_000,
    time: Duration::from_mins(1),
};

async fn serve(asked: Asked) -> Serving {
    let (folder, store) = folder_store();
    land(
        &store,
        &product("wavy"),
        Quantity::CarbonFlux,
        GRID,
        &wavy_year(&GRID),
    )
    .await;
    let limits = SqlLimits {
        memory_bytes: 8 << 20,
        time: asked.time,
    };
    let sql = Sql::new(&Engine::in_process(store, parts(2)), limits).unwrap();
    let address: SocketAddr = "127.0.0.1:0".parse().unwrap();
    let token = asked.token.map(|token| token.parse::<Token>().unwrap());
    let access = Access::new(token, address).unwrap();
    let limits = FlightSqlLimits {
        questions_at_once: NonZeroUsize::new(asked.questions_at_once).unwrap(),
        max_rows: asked.max_rows,
    };
    let server = FlightSqlServer::bind(address, access, sql.clone(), limits)
        .await
        .unwrap();
    let address = server.address();
    tokio::spawn(server.run(std::future::pending()));
    Serving {
        address,
        sql,
        _folder: folder,
    }
}

impl Serving {
    async fn client(&self) -> FlightSqlServiceClient<Channel> {
        let endpoint = Endpoint::from_shared(format!("http://{}", self.address)).unwrap();
        FlightSqlServiceClient::new(endpoint.connect().await.unwrap())
    }
}

type Client = FlightSqlServiceClient<Channel>;

async fn ask(client: &mut Client, text: &str) -> Result<RecordBatch, FlightError> {
    let info = client.execute(text.to_owned(), None).await?;
    rows(client, info).await
}

async fn rows(
    client: &mut Client,
    info: arrow_flight::FlightInfo,
) -> Result<RecordBatch, FlightError> {
    // Clients written in C++ take no answer that does not say what it is the answer to.
    assert!(info.flight_descriptor.is_some());
    let ticket = info.endpoint[0].ticket.clone().unwrap();
    let stream = client.do_get(ticket).await?;
    let batches: Vec<RecordBatch> = stream.try_collect().await?;
    let schema = info.try_decode_schema()?;
    Ok(concat_batches(&Arc::new(schema), &batches)?)
}

fn texts(batch: &RecordBatch) -> Vec<Vec<String>> {
    let cell = |row, column| array_value_to_string(column, row).unwrap();
    (0..batch.num_rows())
        .map(|row| {
            batch
                .columns()
                .iter()
                .map(|column| cell(row, column))
                .collect()
        })
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_are_those_of_the_session_prepared_or_not() {
    let serving = serve(OPEN).await;
    let mut client = serving.client().await;
    let question = "SELECT latitude, count(value), sum(value), mean_weighted(value, area_km2) FROM wavy GROUP BY latitude";
    let over_network = ask(&mut client, question).await.unwrap();
    let mut own = serving.sql.ask(question).await.unwrap();
    let mut batches = vec![];
    while let Some(batch) = own.next().await.unwrap() {
        batches.push(batch);
    }
    let own = concat_batches(own.schema(), &batches).unwrap();
    assert_eq!(own.num_rows(), 60);
    assert_eq!(texts(&over_network), texts(&own));

    let mut prepared = client.prepare(question.to_owned(), None).await.unwrap();
    assert_eq!(prepared.dataset_schema().unwrap().fields().len(), 4);
    let info = prepared.execute().await.unwrap();
    assert_eq!(texts(&rows(&mut client, info).await.unwrap()), texts(&own));
    prepared.close().await.unwrap();
    let mut asked = client
        .prepare("SELECT $1 + 1".to_owned(), None)
        .await
        .unwrap();
    let seven =
        RecordBatch::try_from_iter([("seven", Arc::new(Int64Array::from(vec![7])) as ArrayRef)]);
    asked.set_parameters(seven.unwrap()).unwrap();
    let told = asked.execute().await.unwrap_err().to_string();
    assert!(told.contains("parameters are not taken"), "{told}");
    // A large answer comes in many messages.
    let all = ask(&mut client, "SELECT * FROM wavy").await.unwrap();
    assert_eq!(all.num_rows(), 12 * GRID.cell_count());
    assert_eq!(all.schema().field(4).metadata()["units"], "kg m-2 s-1");
}

#[tokio::test(flavor = "multi_thread")]
async fn tables_and_the_server_itself_are_listed() {
    let serving = serve(OPEN).await;
    let mut client = serving.client().await;
    let info = client.get_catalogs().await.unwrap();
    assert_eq!(
        texts(&rows(&mut client, info).await.unwrap()),
        [["fluxglobe"]]
    );
    let info = client
        .get_db_schemas(CommandGetDbSchemas::default())
        .await
        .unwrap();
    assert_eq!(
        texts(&rows(&mut client, info).await.unwrap()),
        [["fluxglobe", "public"]]
    );
    let info = client.get_table_types().await.unwrap();
    assert_eq!(texts(&rows(&mut client, info).await.unwrap()), [["TABLE"]]);
    let asked = CommandGetTables {
        include_schema: true,
        table_name_filter_pattern: Some("wa%".to_owned()),
        ..CommandGetTables::default()
    };
    let info = client.get_tables(asked).await.unwrap();
    let tables = rows(&mut client, info).await.unwrap();
    assert_eq!(
        texts(&tables)[0][..4],
        ["fluxglobe", "public", "wavy", "TABLE"]
    );
    assert!(!tables.column(4).as_binary::<i32>().value(0).is_empty());
    let info = client
        .get_sql_info(vec![SqlInfo::FlightSqlServerReadOnly])
        .await
        .unwrap();
    assert_eq!(rows(&mut client, info).await.unwrap().num_rows(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn who_has_no_token_is_not_answered() {
    let asked = Asked {
        token: Some(TOKEN),
        ..OPEN
    };
    let serving = serve(asked).await;
    let mut client = serving.client().await;
    let told = ask(&mut client, "SELECT 1").await.unwrap_err().to_string();
    assert!(told.contains("wants a token"), "{told}");
    assert!(client.get_catalogs().await.is_err());
    client.set_token("another-token-of-length".to_owned());
    let told = ask(&mut client, "SELECT 1").await.unwrap_err().to_string();
    assert!(told.contains("not the token"), "{told}");
    client.set_token(TOKEN.to_owned());
    assert_eq!(texts(&ask(&mut client, "SELECT 1").await.unwrap()), [["1"]]);
    // By name and password, as drivers do that know no tokens.
    let mut client = serving.client().await;
    assert!(client.handshake("anybody", "wrong").await.is_err());
    assert_eq!(
        client.handshake("anybody", TOKEN).await.unwrap(),
        TOKEN.as_bytes()
    );
    assert_eq!(texts(&ask(&mut client, "SELECT 1").await.unwrap()), [["1"]]);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_writes_is_refused_and_an_answer_too_large_is_an_error_and_no_part() {
    let asked = Asked {
        max_rows: 1000,
        time: Duration::from_secs(2),
        ..OPEN
    };
    let serving = serve(asked).await;
    let mut client = serving.client().await;
    for (text, reason) in [
        ("DROP TABLE wavy", "DROP is refused: SQL here reads only"),
        ("INSERT INTO wavy VALUES (1)", "INSERT is refused"),
        ("COPY (SELECT 1) TO '/tmp/a.csv'", "COPY writes files"),
        ("SELECT * FROM atlantis", "not found; products are wavy"),
        (
            "SELECT * FROM wavy",
            "more than 1000 rows, the limit of this server",
        ),
        (
            "WITH RECURSIVE t AS (SELECT 1 AS n UNION ALL SELECT n + 0 FROM t) SELECT count(*) FROM t",
            "after 2 s, its limit of time",
        ),
        (
            "SELECT array_agg(a.value) FROM wavy a, wavy b",
            "more than 8 MiB, its limit of memory",
        ),
    ] {
        let told = ask(&mut client, text).await.unwrap_err().to_string();
        assert!(told.contains(reason), "{text}: {told}");
    }
    let told = client
        .execute_update("DELETE FROM wavy".to_owned(), None)
        .await;
    assert!(told.unwrap_err().to_string().contains("reads only"));
    assert_eq!(
        ask(&mut client, "SELECT value FROM wavy LIMIT 1000")
            .await
            .unwrap()
            .num_rows(),
        1000
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_holds_its_turn_until_its_client_goes() {
    let asked = Asked {
        questions_at_once: 1,
        ..OPEN
    };
    let serving = serve(asked).await;
    let mut first = serving.client().await;
    let mut second = serving.client().await;
    // Its first rows come at once, its last ones never.
    let endless = "SELECT a.value FROM wavy a, wavy b, wavy c";
    let info = first.execute(endless.to_owned(), None).await.unwrap();
    let mut stream = first
        .do_get(info.endpoint[0].ticket.clone().unwrap())
        .await
        .unwrap();
    assert!(stream.try_next().await.unwrap().is_some());
    let told = ask(&mut second, "SELECT 1").await.unwrap_err().to_string();
    assert!(told.contains("1 questions are worked on already"), "{told}");
    drop((stream, first));
    let begun = Instant::now();
    while ask(&mut second, "SELECT 1").await.is_err() {
        assert!(
            begun.elapsed() < Duration::from_secs(20),
            "the turn is still held"
        );
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}
