//! SQL over products: what it answers, what it reads for it, and what it refuses.

use std::sync::Arc;
use std::time::{Duration, Instant};

use compute::analysis::analyse;
use compute::budget::budget;
use compute::reduce::statistics;
use compute::sql::{Sql, SqlLimits};
use compute::{ComputeError, Engine, Objects};
use contract::analysis::{AnalysisOptions, AnalysisPart, SeriesAnalysis, SeriesWishes};
use contract::budget::BudgetQuery;
use contract::earth::Earth;
use contract::geometry::AskedGeometry;
use contract::grid::{Grid, LonLatDeg};
use contract::quantity::{Flag, OpenQuantity, OpenWords, Quantity};
use contract::statistics::StatisticsQuery;
use contract::time::{Period, TimeMs, TimeStep};
use datafusion::arrow::array::{Array as _, AsArray as _, RecordBatch};
use datafusion::arrow::compute::concat_batches;
use datafusion::arrow::datatypes::{Float32Type, Float64Type, Int64Type, TimestampMillisecondType};
use datafusion::arrow::util::display::array_value_to_string;
use object_store::ObjectStore;
use storage::Store;

use crate::fixture::{folder_store, land, months, parts, product, wavy_year};
use crate::reading::Counting;

/// A grid of 3 x 2 chunks, across the date line.
pub(crate) const GRID: Grid = Grid {
    rows: 130,
    cols: 150,
    north_deg: 65.0,
    west_deg: 160.0,
    dlat_deg: 1.0,
    dlon_deg: 0.5,
};

/// Kelvin: 280 + month + row / 100 + col / 10,000; no data in column 7.
fn value(month: usize, row: u32, col: u32) -> Option<f32> {
    let value = 280.0 + month as f32 + row as f32 / 100.0 + col as f32 / 10_000.0;
    (col != 7).then_some(value)
}

fn year() -> Vec<(Period, Vec<f32>)> {
    let step = |(month, period): (usize, Period)| {
        let cells = 0..GRID.cell_count() as u32;
        let own = cells.map(|at| value(month, at / GRID.cols, at % GRID.cols).unwrap_or(f32::NAN));
        (period, own.collect())
    };
    months(2010).into_iter().enumerate().map(step).collect()
}

async fn sst(store: &Store) {
    let quantity = Quantity::SeaSurfaceTemperature;
    land(store, &product("sst-test"), quantity, GRID, &year()).await;
}

pub(crate) const LIMITS: SqlLimits = SqlLimits {
    memory_bytes: 256 << 20,
    time: Duration::from_mins(2),
};

pub(crate) fn sql_of(engine: &Engine) -> Sql {
    Sql::new(engine, LIMITS).unwrap()
}

pub(crate) async fn ask(sql: &Sql, text: &str) -> Result<RecordBatch, ComputeError> {
    let mut rows = sql.ask(text).await?;
    let mut batches = vec![];
    while let Some(batch) = rows.next().await? {
        batches.push(batch);
    }
    Ok(concat_batches(rows.schema(), &batches).unwrap())
}

/// Rows as texts.
pub(crate) async fn texts(sql: &Sql, text: &str) -> Vec<Vec<String>> {
    let batch = ask(sql, text)
        .await
        .unwrap_or_else(|e| panic!("{text}: {e}"));
    let cell = |row, column: &datafusion::arrow::array::ArrayRef| {
        array_value_to_string(column, row).unwrap()
    };
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

pub(crate) async fn one(sql: &Sql, text: &str) -> String {
    let rows = texts(sql, text).await;
    assert_eq!((rows.len(), rows[0].len()), (1, 1), "{text}: {rows:?}");
    rows[0][0].clone()
}

/// The line of the plan that reads.
async fn scan_of(sql: &Sql, text: &str) -> String {
    let rows = texts(sql, &format!("EXPLAIN {text}")).await;
    let plan = rows.iter().find(|row| row[0] == "physical_plan").unwrap();
    let line = plan[1].lines().find(|line| line.contains("ProductScan"));
    line.unwrap_or_else(|| panic!("{}", plan[1]))
        .trim()
        .to_owned()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_cell_of_every_step_is_a_row_with_its_time_place_value_and_area() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let sql = sql_of(&Engine::in_process(store, parts(2)));
    let all = ask(&sql, "SELECT * FROM sst_test").await.unwrap();
    assert_eq!(all.num_rows(), 12 * GRID.cell_count());
    let instants = |at: usize| all.column(at).as_primitive::<TimestampMillisecondType>();
    let numbers = |at: usize| all.column(at).as_primitive::<Float64Type>();
    let values = all.column(4).as_primitive::<Float32Type>();
    let mut seen = vec![false; 12 * GRID.cell_count()];
    for at in 0..all.num_rows() {
        let start = TimeMs::new(instants(0).value(at)).unwrap();
        let month = start.year_month().1 as usize - 1;
        assert_eq!(instants(1).value(at), months(2010)[month].end.ms());
        let place = LonLatDeg::new(numbers(3).value(at), numbers(2).value(at)).unwrap();
        let (row, col) = GRID.cell_at(place).unwrap();
        let found = values.is_valid(at).then(|| values.value(at));
        assert_eq!(found, value(month, row, col), "{month} {row} {col}");
        let area_km2 = GRID.cell_area_m2(row, Earth::Wgs84) / 1e6;
        assert_eq!(numbers(5).value(at).to_bits(), area_km2.to_bits());
        let cell = month * GRID.cell_count() + (row * GRID.cols + col) as usize;
        assert!(
            !std::mem::replace(&mut seen[cell], true),
            "twice: {month} {row} {col}"
        );
    }
    // Units stand with the column.
    let field = all.schema().field(4).clone();
    assert_eq!(field.metadata()["units"], "K");
    assert_eq!(field.metadata()["standard_name"], "sea_surface_temperature");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_filter_of_any_form_gives_the_rows_that_it_holds_for() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let sql = sql_of(&Engine::in_process(store, parts(2)));
    // What hides the columns from the table is worked out row by row.
    let hidden = "(SELECT time_start, time_end, latitude, longitude, value, area_km2,
                   row_number() OVER () AS n FROM sst_test)";
    for filter in [
        "time_start = '2010-03-01'",
        "time_start >= '2010-11-01' AND latitude > 60",
        "time_end <= TIMESTAMP '2010-02-01'",
        "date_part('month', time_start) IN (12, 1) AND longitude < -170",
        "latitude BETWEEN 10 AND 12 AND longitude IN (160.25, 179.75, -179.75)",
        "longitude > 170 OR longitude < -100",
        "area_km2 < 3000 AND value > 285",
        "NOT (latitude < 64) AND time_start <> '2010-05-01'",
        "latitude = 64.5 AND value IS NULL",
        "latitude + longitude > 200",
        "latitude > 70",
        "time_start < time_end AND latitude = 64.5",
        "CASE WHEN latitude > 0 THEN NULL ELSE latitude < -63 END",
        "time_start IN ('2010-03-01', NULL)",
        "time_start NOT IN ('2010-03-01', NULL)",
        "latitude NOT IN (64.5, 63.5, NULL) AND time_start < '2010-03-01'",
        "longitude <> 160.25 AND (latitude > 60 AND NULL)",
        "time_end > time_start + INTERVAL '30 days' AND latitude > 63",
        "extract(epoch FROM time_end - time_start) < 30 * 86400 AND latitude > 63",
        "time_end - time_start >= INTERVAL '744 hours' AND latitude > 63",
    ] {
        let question = |from: &str| {
            format!(
                "SELECT count(*), count(value), min(value), max(value), min(longitude), max(latitude), sum(area_km2) FROM {from} WHERE {filter}"
            )
        };
        let pushed = texts(&sql, &question("sst_test")).await;
        let plain = texts(&sql, &question(hidden)).await;
        assert_eq!(pushed[0][..6], plain[0][..6], "{filter}");
    }
    // And the comparison can fail.
    let different = texts(&sql, "SELECT count(*) FROM sst_test WHERE latitude > 60").await;
    assert_eq!(different, [[(5 * 150 * 12).to_string()]]);
}

#[tokio::test(flavor = "multi_thread")]
async fn only_the_steps_and_chunks_that_are_asked_for_are_read_and_the_plan_says_so() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let (root, inner) = store.sql_root();
    let counting = Arc::new(Counting::of(inner));
    let objects = Objects::new(root, Arc::clone(&counting) as Arc<dyn ObjectStore>);
    let sql = sql_of(&Engine::in_process(store.clone(), parts(1)).reading(objects));
    let one_chunk = "SELECT avg(value) FROM sst_test
        WHERE time_start = '2010-03-01' AND latitude > 62 AND longitude BETWEEN 160 AND 161";
    let plan = scan_of(&sql, one_chunk).await;
    assert!(
        plan.contains("steps=1 of 12, cells=6 of 19500, chunks=1 of 6, reads=fields, bytes=28800"),
        "{plan}"
    );
    let plan = scan_of(&sql, "SELECT avg(value) FROM sst_test WHERE latitude > 62").await;
    assert!(
        plan.contains("steps=12 of 12, cells=450 of 19500, chunks=2 of 6"),
        "{plan}"
    );
    let plan = scan_of(&sql, "SELECT DISTINCT time_start FROM sst_test").await;
    assert!(plan.contains("reads=nothing, bytes=0"), "{plan}");
    assert_eq!(counting.requests(), 0, "a plan reads no values");

    let field_bytes = store
        .size_bytes(&latest(&store).await.steps[0].field)
        .await
        .unwrap();
    one(&sql, one_chunk).await;
    let read = counting.bytes();
    assert!(read > 0 && read < field_bytes, "{read} of {field_bytes}");
    one(
        &sql,
        "SELECT count(value) FROM sst_test WHERE latitude > -100 AND value > 0",
    )
    .await;
    let all = counting.bytes() - read;
    assert!(
        all > 11 * field_bytes && all < 17 * field_bytes,
        "{all} of 12 x {field_bytes}"
    );

    // What is known without values reads none of them.
    let before = counting.requests();
    let count = (12 * GRID.cell_count()).to_string();
    assert_eq!(one(&sql, "SELECT count(*) FROM sst_test").await, count);
    let with_data = (12 * GRID.cell_count() - 12 * 130).to_string();
    assert_eq!(
        one(&sql, "SELECT count(value) FROM sst_test").await,
        with_data
    );
    assert_eq!(
        one(&sql, "SELECT max(time_end) FROM sst_test").await,
        "2011-01-01T00:00:00Z"
    );
    texts(&sql, "SELECT DISTINCT latitude, area_km2 FROM sst_test").await;
    assert_eq!(counting.requests(), before);

    // A few rows do not read a product.
    assert_eq!(texts(&sql, "SELECT * FROM sst_test LIMIT 3").await.len(), 3);
    assert!(counting.bytes() - read - all < 2 * field_bytes);
}

async fn latest(store: &Store) -> contract::manifest::Manifest {
    let found = storage::manifests::latest(store, &product("sst-test")).await;
    found.unwrap().unwrap()
}

#[tokio::test(flavor = "multi_thread")]
async fn blocks_along_time_and_fields_give_the_same_rows() {
    const SMALL: Grid = Grid {
        rows: 70,
        cols: 130,
        north_deg: 41.0,
        west_deg: 100.0,
        dlat_deg: 0.5,
        dlon_deg: 0.5,
    };
    let day = |day: i64| {
        let at = |day: i64| TimeMs::new(day * 86_400_000).unwrap();
        let period = Period::new(at(day), at(day + 1)).unwrap();
        let value = |cell: usize| {
            let is_gap = (cell * 7 + day as usize).is_multiple_of(11);
            if is_gap {
                f32::NAN
            } else {
                280.0 + cell as f32 / 1000.0 + day as f32 / 100.0
            }
        };
        (period, (0..SMALL.cell_count()).map(value).collect())
    };
    let steps: Vec<(Period, Vec<f32>)> = (0..300).map(day).collect();
    let (_folder, store) = folder_store();
    let quantity = Quantity::SeaSurfaceTemperature;
    let manifest = land(&store, &product("daily"), quantity, SMALL, &steps).await;
    let questions = [
        "SELECT * FROM daily WHERE latitude = 40.75 AND longitude = 100.25 ORDER BY time_start",
        "SELECT * FROM daily WHERE latitude > 30 AND latitude < 36 AND longitude = 110.25
            AND time_start BETWEEN '1970-02-03' AND '1970-09-20' ORDER BY 1, 3, 4",
        "SELECT date_part('day', time_start) AS day, count(*), count(value), min(value), max(value) FROM daily
            WHERE longitude > 164.5 AND latitude < 7 AND date_part('month', time_start) IN (1, 5, 6) GROUP BY 1 ORDER BY 1",
    ];
    let mut before = vec![];
    let sql = sql_of(&Engine::in_process(store.clone(), parts(2)));
    for question in questions {
        assert!(scan_of(&sql, question).await.contains("reads=fields"));
        before.push(texts(&sql, question).await);
    }
    assert_eq!(before[0].len(), 300);
    cube::follow(&store, &manifest).await.unwrap();
    assert!(cube::compact(&store, "cubes/daily").await.unwrap() >= 2);
    let sql = sql_of(&Engine::in_process(store, parts(2)));
    for (question, before) in questions.iter().zip(before) {
        let plan = scan_of(&sql, question).await;
        assert!(plan.contains("blocks"), "{plan}");
        assert_eq!(texts(&sql, question).await, before, "{question}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_are_the_same_bits_at_any_parallelism_in_the_order_of_rows_too() {
    let (_folder, store) = folder_store();
    let (id, flux) = (product("wavy"), Quantity::CarbonFlux);
    land(&store, &id, flux, GRID, &wavy_year(&GRID)).await;
    let question = "SELECT latitude, sum(value), avg(value), stddev(value), corr(value, longitude),
        mean_weighted(value, area_km2), first_value(value) FROM wavy GROUP BY latitude";
    let answer = async |partitions| {
        let sql = sql_of(&Engine::in_process(store.clone(), parts(partitions)));
        texts(&sql, question).await
    };
    let first = answer(1).await;
    assert_eq!(first.len(), 130);
    assert_eq!(answer(2).await, first);
    assert_eq!(answer(7).await, first);
}

/// What is refused, and with which words.
const REFUSED: &[(&str, &str)] = &[
    (
        "INSERT INTO sst_test VALUES (1)",
        "INSERT is refused: SQL here reads only",
    ),
    ("UPDATE sst_test SET value = 1", "UPDATE is refused"),
    ("DELETE FROM sst_test", "DELETE is refused"),
    ("DROP TABLE sst_test", "DROP is refused"),
    ("TRUNCATE sst_test", "TRUNCATE is refused"),
    ("CREATE TABLE t AS SELECT 1", "CREATE is refused"),
    ("CREATE VIEW t AS SELECT 1", "CREATE is refused"),
    (
        "CREATE FUNCTION f() RETURNS INT RETURN 1",
        "CREATE is refused",
    ),
    ("SELECT * INTO t FROM sst_test", "reads only"),
    (
        "WITH t AS (SELECT 1) INSERT INTO sst_test SELECT * FROM t",
        "INSERT is refused",
    ),
    (
        "EXPLAIN ANALYZE INSERT INTO sst_test SELECT * FROM sst_test",
        "INSERT is refused",
    ),
    (
        "SET datafusion.execution.target_partitions = 9",
        "SET is refused",
    ),
    (
        "RESET datafusion.execution.target_partitions",
        "RESET is refused",
    ),
    ("PREPARE p AS SELECT 1", "PREPARE is refused"),
    ("BEGIN", "refused"),
    ("SELECT 1; SELECT 2", "more than one statement"),
    ("", "it is empty"),
    ("-- nothing", "it is empty"),
    (
        "SELECT * FROM sst-test",
        "a name with - in it is written with _",
    ),
    (
        "SELECT * FROM atlantis",
        "table 'fluxglobe.public.atlantis' not found; products are sst-test",
    ),
    (
        "SELECT * FROM \"sst-test@2\"",
        "sst-test has no version 2; the newest is 1",
    ),
    (
        "SELECT * FROM \"sst-test@1-00000000\"",
        "sst-test has no version 1-00000000; the newest is sst-test@1-",
    ),
    (
        "SELECT * FROM \"atlantis@2\"",
        "not found; products are sst-test",
    ),
    ("SELECT depth FROM sst_test", "depth"),
    (
        "SELECT value FROM sst_test WHERE time_start = '2000-07'",
        "write '2000-07-01'",
    ),
    ("SHOW FULL COLUMNS FROM sst_test", "ask DESCRIBE"),
    ("SHOW COLUMNS FROM sst_test LIKE 'v%'", "ask DESCRIBE"),
    ("SHOW COLUMNS FROM atlantis", "not found"),
    ("CHOOSE 1", "CHOOSE"),
    ("SELECT repeat('x', 2000000000)", "repeat is left out"),
    ("SELECT lpad('x', 2000000000)", "lpad is left out"),
    ("SELECT range(0, 2000000000)", "range is left out"),
    (
        "SELECT replace(replace('xxxx', 'x', 'xxxx'), 'x', 'xxxx')",
        "replace is left out",
    ),
    (
        "SELECT regexp_replace('xxxx', 'x', 'xxxx', 'g')",
        "regexp_replace is left out",
    ),
    (
        "SELECT concat_ws('xxxx', 'x', 'x')",
        "concat_ws is left out",
    ),
    (
        "SELECT array_replace_all(make_array(1, 1), 1, 2)",
        "array_replace_all is left out",
    ),
    (
        "SELECT list_to_string(make_array(1, 1), 'xxxx')",
        "list_to_string is left out",
    ),
    (
        "SELECT mean_weighted(value, -1) FROM sst_test",
        "is no weight",
    ),
    (
        "SELECT count(*) FROM sst_test TABLESAMPLE BERNOULLI (10)",
        "all rows would be read",
    ),
    (
        "EXPLAIN SELECT * FROM (SELECT value FROM sst_test PREWHERE latitude > 80) t",
        "write WHERE",
    ),
    (
        "SELECT count(*) FROM sst_test PARTITION (north)",
        "PARTITION of a table is not known",
    ),
    (
        "WITH t AS (SELECT latitude, count(*) FROM sst_test GROUP BY latitude WITH ROLLUP) SELECT * FROM t",
        "write GROUP BY ROLLUP",
    ),
    (
        "SELECT value FROM sst_test START WITH latitude > 80 CONNECT BY PRIOR latitude = longitude",
        "write WITH RECURSIVE",
    ),
    (
        "SELECT count(*) FROM sst_test WHERE latitude > ANY (SELECT latitude FROM sst_test WHERE latitude > 60)",
        "SELECT min(...)",
    ),
    (
        "SELECT count(*) FROM sst_test WHERE time_end - time_start > INTERVAL '2 days'",
        "48 hours are less than 2 days",
    ),
    (
        "SELECT time_start FROM sst_test WHERE time_end - time_start BETWEEN INTERVAL '1 day' AND INTERVAL '40 days'",
        "extract(epoch FROM time_end - time_start)",
    ),
    (
        "SELECT count(*) FROM sst_test a JOIN sst_test b ON b.time_start - a.time_start < INTERVAL '3 days'",
        "intervals have no order",
    ),
    ("SELECT 1 / 0", "ivide by zero"),
    ("SELECT * FROM stats('sst-test')", "stats takes texts"),
    ("SELECT * FROM stats('sst-test', 'atlantis')", "atlantis"),
    ("SELECT * FROM budget('sst-test')", "budget takes texts"),
    (
        "SELECT * FROM budget('sst-test', 'global', 'total', 'x')",
        "budget takes texts",
    ),
    (
        "SELECT * FROM budget('sst-test', 'global')",
        "only a carbon flux has a budget",
    ),
    (
        "SELECT * FROM budget('sst-test', 'global', 'fortnight')",
        "fortnight",
    ),
    ("SELECT * FROM budget('sst-test', 'atlantis')", "atlantis"),
    (
        "SELECT * FROM stats('sst-test', 'atlantis:1')",
        "product \"atlantis\" is unknown",
    ),
    (
        "SELECT * FROM analysis('sst-test', 'sst_test@1:1', 'anomaly')",
        "a mask is one map",
    ),
    (
        "SELECT * FROM budget('atlantis', 'global')",
        "product \"atlantis\" is unknown",
    ),
    (
        "SELECT * FROM analysis('sst-test', 'global')",
        "analysis takes texts",
    ),
    (
        "SELECT * FROM analysis('sst-test', 'global', 'season')",
        "climatology, anomaly or trend",
    ),
    (
        "SELECT * FROM analysis('sst-test', 'global', 'climatology', 'week')",
        "month, season or day",
    ),
    (
        "SELECT * FROM analysis('sst-test', '162.3,0.5', 'trend')",
        "a trend needs 5 years of values, and they span 1.0",
    ),
    (
        "SELECT * FROM analysis('sst-test', '162.3,0.5', 'climatology', 'day')",
        "day",
    ),
    (
        "SELECT * FROM stats('atlantis', 'global')",
        "product \"atlantis\" is unknown",
    ),
];

#[tokio::test(flavor = "multi_thread")]
async fn whatever_would_write_or_read_elsewhere_is_refused_with_the_reason() {
    let (folder, store) = folder_store();
    sst(&store).await;
    let outside = folder.path().join("outside.csv");
    std::fs::write(&outside, "a,b\n1,2\n").unwrap();
    let place = outside.to_str().unwrap();
    let sql = sql_of(&Engine::in_process(store, parts(1)));
    let files = format!("SELECT * FROM '{place}'");
    let copied = format!("COPY (SELECT 1) TO '{place}.parquet'");
    let external = format!("CREATE EXTERNAL TABLE t STORED AS CSV LOCATION '{place}'");
    let read = format!("SELECT * FROM read_csv('{place}')");
    let of_files = [
        (
            copied.as_str(),
            "COPY writes files: give --format and --output",
        ),
        (
            &external,
            "CREATE EXTERNAL TABLE reads files: land them with `fluxglobe ingest`",
        ),
        (&files, "not found; products are sst-test"),
        (&read, "read_csv"),
    ];
    for (text, reason) in of_files.iter().chain(REFUSED) {
        let error = ask(&sql, text).await.unwrap_err();
        let told = error.to_string();
        assert!(told.contains(reason), "{text}: {told}");
        assert!(!error.is_retryable(), "{text}: {told}");
    }
    let long = format!("SELECT '{}'", "x".repeat(300 << 10));
    let told = ask(&sql, &long).await.unwrap_err().to_string();
    assert!(told.contains("are more than the"), "{told}");
    let nested = format!("SELECT {}1{}", "(".repeat(5000), ")".repeat(5000));
    let told = ask(&sql, &nested).await.unwrap_err().to_string();
    assert!(told.contains("brackets one in another"), "{told}");
    let chained = format!("SELECT 1{}", " + 1".repeat(60_000));
    let told = ask(&sql, &chained).await.unwrap_err().to_string();
    assert!(told.contains("operators one in another"), "{told}");
    let joined = format!("SELECT 1 FROM sst_test{}", ", sst_test".repeat(20_000));
    let told = ask(&sql, &joined).await.unwrap_err().to_string();
    assert!(told.contains("queries, joins and tables"), "{told}");
    let twice = |at: usize| format!(", t{} AS (SELECT x.a FROM t{at} x, t{at} y)", at + 1);
    let steps: String = (0..30).map(twice).collect();
    let doubling = format!("WITH t0 AS (SELECT 1 AS a){steps} SELECT count(*) FROM t30");
    let told = ask(&sql, &doubling).await.unwrap_err().to_string();
    assert!(told.contains("is read"), "{told}");
    let there: Vec<_> = std::fs::read_dir(folder.path()).unwrap().collect();
    assert!(!outside.with_extension("csv.parquet").exists(), "{there:?}");
}

/// A text that is joined with itself so often, a query in another.
fn doubled(times: usize, joined: &str) -> String {
    let twice = |at: usize| format!(", t{} AS (SELECT {joined} AS x FROM t{at})", at + 1);
    let steps: String = (0..times).map(twice).collect();
    format!("WITH t0 AS (SELECT 'ab' AS x){steps} SELECT length(x) FROM t{times}")
}

#[tokio::test(flavor = "multi_thread")]
async fn texts_are_joined_and_those_that_would_double_without_end_are_refused() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let sql = sql_of(&Engine::in_process(store, parts(1)));
    for joined in ["x || x", "concat(x, x)", "concat(upper(x) || x)"] {
        assert_eq!(one(&sql, &doubled(5, joined)).await, "64", "{joined}");
        let error = ask(&sql, &doubled(40, joined)).await.unwrap_err();
        assert!(
            error.to_string().contains("may have more than 4 MiB"),
            "{joined}: {error}"
        );
    }
    let of_a_row = "SELECT max(CAST(latitude AS VARCHAR) || ' N, ' || CAST(value AS VARCHAR)) > '' FROM sst_test";
    assert_eq!(one(&sql, of_a_row).await, "true");
    let gathered =
        "SELECT length(string_agg(x || ' ' || x, ',')) FROM (VALUES ('a'), ('b')) AS t(x)";
    assert_eq!(one(&sql, gathered).await, "7");
    let branches =
        ["SELECT x || 'b' || x AS x FROM (VALUES ('c')) AS t(x)"; 30].join(" UNION ALL ");
    let count = format!("SELECT count(x) FROM ({branches})");
    assert_eq!(one(&sql, &count).await, "30");
    // What is compared is as long as it was.
    let chosen = |at: usize| {
        format!(
            ", t{} AS (SELECT * FROM t{at} WHERE a || ':' || a <> 'q' AND a || a <> 'z' AND a <> 'y')",
            at + 1
        )
    };
    let chosen: String = (0..8).map(chosen).collect();
    let chosen = format!(
        "WITH t0 AS (SELECT * FROM (VALUES ('a'), ('b')) AS t(a)){chosen} SELECT count(*) FROM t8"
    );
    assert_eq!(one(&sql, &chosen).await, "2");
    let months = "WITH RECURSIVE months AS (SELECT 1 AS m UNION ALL SELECT m + 1 FROM months WHERE concat(m, '-', m) <> '12-12') SELECT count(*) FROM months";
    assert_eq!(one(&sql, months).await, "12");
    for endless in [
        "WITH RECURSIVE t AS (SELECT 'ab' AS x UNION ALL SELECT x || x FROM t) SELECT max(x) FROM t",
        "SELECT length((SELECT string_agg(x || x, ',') FROM (SELECT string_agg(x || x, ',') AS x FROM (VALUES ('a')) AS t(x)) AS u))",
    ] {
        let error = ask(&sql, endless).await.unwrap_err().to_string();
        assert!(error.contains("may have more than 4 MiB"), "{error}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_long_text_that_would_stand_in_every_row_is_refused_and_others_are_taken() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let sql = sql_of(&Engine::in_process(store, parts(1)));
    let long = format!("'{}'", "a".repeat(200 << 10));
    let half = format!("'{}'", "a".repeat(20 << 10));
    for text in [
        format!("SELECT {long} FROM sst_test"),
        format!("SELECT max({long}) FROM sst_test"),
        format!("SELECT (SELECT {long}) FROM sst_test"),
        format!("SELECT coalesce(CAST(value AS VARCHAR), {long}) FROM sst_test"),
        format!("SELECT CASE WHEN value > 0 THEN {long} END FROM sst_test"),
        format!("SELECT 1 FROM sst_test WHERE length({long} || CAST(value AS VARCHAR)) > 5"),
        format!("SELECT x, value FROM sst_test, (VALUES ({long})) AS t(x)"),
        format!("WITH t AS (SELECT {half} AS x) SELECT x, x AS y FROM t, sst_test"),
        format!(
            "SELECT value FROM sst_test WHERE value IN (SELECT length(concat({long}, value::text)) FROM sst_test)"
        ),
    ] {
        let start: String = text.chars().take(60).collect();
        let error = ask(&sql, &text).await.unwrap_err();
        assert!(
            matches!(error, ComputeError::Sql { .. }),
            "{start}: {error}"
        );
        assert!(
            error.to_string().contains("more than 256 MiB"),
            "{start}: {error}"
        );
    }
    let label = "'a label of ordinary length, as people write them'";
    let listed: Vec<String> = (0..3000).map(|at| format!("'{at} K'")).collect();
    let listed = listed.join(", ");
    let columns: Vec<String> = (0..500)
        .map(|at| format!("value + {at} AS v{at}"))
        .collect();
    let columns = columns.join(", ");
    for (text, wanted) in [
        (format!("SELECT length({long})"), "204800"),
        (
            format!("SELECT max(length(x)) FROM (VALUES ('b'), ({long})) AS t(x)"),
            "204800",
        ),
        (
            format!("SELECT count(*) FROM sst_test WHERE CAST(value AS VARCHAR) = {long}"),
            "0",
        ),
        (
            format!("SELECT count(*) FROM sst_test WHERE CAST(value AS VARCHAR) IN ({listed})"),
            "0",
        ),
        (
            format!("SELECT count(x) FROM (SELECT {label} AS x FROM sst_test)"),
            "234000",
        ),
        (
            format!("SELECT count(*) FROM (SELECT {columns} FROM sst_test)"),
            "234000",
        ),
        (
            "SELECT count(*) FROM products p, products q, products r".to_owned(),
            "1",
        ),
        (
            "SELECT string_agg(name, ', ') FROM products GROUP BY quantity".to_owned(),
            "sst-test",
        ),
    ] {
        let start: String = text.chars().take(60).collect();
        assert_eq!(one(&sql, &text).await, wanted, "{start}");
    }
}

/// Columns each of which is computed so of the one before.
fn computed_of_computed(times: usize, computed: &str) -> String {
    let next = |at: usize| format!(", t{} AS (SELECT {computed} AS a FROM t{at})", at + 1);
    let steps: String = (0..times).map(next).collect();
    format!(
        "WITH t0 AS (SELECT column1 AS a FROM (VALUES (1), (2)) AS v){steps} SELECT count(*) FROM t{times} WHERE a > 1"
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn a_condition_that_doubles_where_columns_are_written_out_is_refused() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let sql = sql_of(&Engine::in_process(store, parts(1)));
    assert_eq!(one(&sql, &computed_of_computed(5, "a + a")).await, "2");
    assert_eq!(one(&sql, &computed_of_computed(40, "a + 0")).await, "1");
    let doubling = computed_of_computed(40, "a + a");
    let within = format!("SELECT (SELECT max(n) FROM ({doubling}) AS s(n))");
    let between = computed_of_computed(30, "(a BETWEEN 0 AND 1)::int");
    let listed = computed_of_computed(30, "(a IN (0, 1))::int");
    let of_one = "FROM (VALUES (1), (2)) AS v(a)";
    let nested = |before: &str, after: &str| {
        format!("SELECT {}a{} {of_one}", before.repeat(20), after.repeat(20))
    };
    let compared = nested("(", " BETWEEN 0 AND 1)::int");
    let filled = nested("ifnull(", ", 0)");
    // Nothing is written out where no condition asks for it.
    let class = |of: &str| {
        let branch = |at: usize| format!("WHEN {of} >= {at} AND {of} < {at} + 1 THEN {at}");
        let branches: Vec<String> = (0..40).map(branch).collect();
        format!("CASE {} ELSE -1 END", branches.join(" "))
    };
    let classes = |more: &str| {
        let (first, next) = (class("a"), class("b"));
        format!(
            "SELECT count(c) FROM (SELECT {} AS c FROM (SELECT {next} AS d FROM (SELECT {first} AS b {of_one}))) {more}",
            class("d")
        )
    };
    assert_eq!(one(&sql, &classes("")).await, "2");
    for text in [
        doubling,
        within,
        between,
        listed,
        compared,
        filled,
        classes("WHERE c > 1"),
    ] {
        let error = ask(&sql, &text).await.unwrap_err().to_string();
        assert!(error.contains("written out"), "{error}");
    }
}

/// They went on from the other end: a step after the largest was the smallest, and 3 less 5 was 4294967294.
#[tokio::test(flavor = "multi_thread")]
async fn whole_numbers_that_leave_their_type_are_refused_and_all_others_are_computed_as_before() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let sql = sql_of(&Engine::in_process(store, parts(2)));
    let of = "FROM (VALUES (9223372036854775807), (NULL), (3)) AS v(n)";
    for text in [
        "SELECT 9223372036854775807 + 1".to_owned(),
        "SELECT -9223372036854775807 - 2".to_owned(),
        "SELECT 4294967296 * 4294967296".to_owned(),
        format!("SELECT n + 1 {of}"),
        format!("SELECT count(*) {of} WHERE n * 2 > 0"),
        format!("SELECT max(n + n) {of} GROUP BY n - 3"),
        "SELECT step_count - step_count - step_count FROM stats('sst-test', '162.3,0.5')"
            .to_owned(),
    ] {
        let error = ask(&sql, &text).await.unwrap_err();
        assert!(!error.is_retryable(), "{text}: {error}");
        let told = error.to_string();
        assert!(told.contains("do not hold what comes of this"), "{told}");
    }
    let whole = "SELECT n + 1 AS a, n - 5, 2 * n + n * n FROM (VALUES (3), (NULL), (-4)) AS v(n)";
    assert_eq!(
        texts(&sql, whole).await,
        [["4", "-2", "15"], ["", "", ""], ["-3", "-9", "8"]]
    );
    // Columns are called as before, and questions are put together from them.
    let batch = ask(
        &sql,
        "SELECT 1 + 1, sum(n + 1) FROM (VALUES (3), (4)) AS v(n)",
    );
    let batch = batch.await.unwrap();
    let names: Vec<&String> = batch
        .schema_ref()
        .fields()
        .iter()
        .map(|f| f.name())
        .collect();
    assert_eq!(names, ["Int64(1) + Int64(1)", "sum(v.n + Int64(1))"]);
    let grouped = "SELECT n * 2, count(*), sum(n + 1) OVER (ORDER BY n * 2) FROM (VALUES (3), (4), (4)) AS v(n)
        GROUP BY n, n * 2 HAVING n * 2 > 0 ORDER BY n * 2 DESC LIMIT 1 + 1";
    assert_eq!(
        texts(&sql, grouped).await,
        [["8", "2", "9"], ["6", "1", "4"]]
    );
    let rolled = "SELECT n * 2, count(*) FROM (VALUES (3), (4), (4)) AS v(n) GROUP BY ROLLUP (n * 2) ORDER BY 2";
    assert_eq!(
        texts(&sql, rolled).await,
        [["6", "1"], ["8", "2"], ["", "3"]]
    );
    let counting = "WITH RECURSIVE t AS (SELECT 1 AS n UNION ALL SELECT n + 1 FROM t WHERE n < 9) SELECT sum(n) FROM t";
    assert_eq!(one(&sql, counting).await, "45");
    let joined = "SELECT count(*) FROM (VALUES (1), (2), (3)) AS a(n) JOIN (VALUES (2), (3), (4)) AS b(n) ON a.n + 1 = b.n
        WHERE a.n IN (SELECT n - 1 FROM (VALUES (3), (4)) AS c(n))";
    assert_eq!(one(&sql, joined).await, "2");
    // Numbers that are no whole ones, and instants, are none of this.
    assert_eq!(
        one(&sql, "SELECT 9223372036854775807 + 1.0e0").await,
        "9.223372036854776e18"
    );
    let chained = format!("SELECT 0{}", " + 1".repeat(490));
    assert_eq!(one(&sql, &chained).await, "490");
}

/// A sum of a largest number and 1 was the smallest, and so was the opposite of that.
#[tokio::test(flavor = "multi_thread")]
async fn sums_and_opposites_of_whole_numbers_that_leave_their_type_are_refused() {
    let (_folder, store) = folder_store();
    let sql = sql_of(&Engine::in_process(store, parts(2)));
    let of = "FROM (VALUES (1, 9223372036854775807), (1, 1), (2, 3), (2, NULL)) AS v(m, n)";
    let smallest = "CAST('-9223372036854775808' AS BIGINT)";
    for text in [
        format!("SELECT sum(n) {of}"),
        format!("SELECT m, sum(n) {of} GROUP BY m"),
        format!("SELECT sum(DISTINCT n) {of}"),
        format!("SELECT sum(n) OVER (ORDER BY m, n) {of}"),
        format!("SELECT sum(CAST('18446744073709551615' AS BIGINT UNSIGNED)) {of}"),
        format!("SELECT -({smallest})"),
        format!("SELECT -n FROM (VALUES ({smallest}), (1)) AS v(n)"),
    ] {
        let error = ask(&sql, &text).await.unwrap_err();
        assert!(!error.is_retryable(), "{text}: {error}");
        let told = error.to_string();
        assert!(told.contains("do not hold what comes of this"), "{told}");
    }
    // What comes back into its type on the way is a sum like any other.
    let back = "SELECT sum(n), sum(DISTINCT n), sum(n) FILTER (WHERE n > 1), sum(n) FILTER (WHERE n > 9223372036854775807)
        FROM (VALUES (9223372036854775807), (1), (-2), (-2)) AS v(n)";
    let all = "9223372036854775804";
    let distinct = "9223372036854775806";
    assert_eq!(
        texts(&sql, back).await,
        [[all, distinct, "9223372036854775807", ""]]
    );
    let grouped = format!("SELECT -m, sum(-m), sum(n) {of} WHERE n < 9 GROUP BY -m ORDER BY -m");
    assert_eq!(
        texts(&sql, &grouped).await,
        [["-2", "-2", "3"], ["-1", "-1", "1"]]
    );
    let sliding = "SELECT sum(n) OVER (ORDER BY n ROWS 1 PRECEDING) FROM (VALUES (1), (2), (4)) AS v(n) ORDER BY n";
    assert_eq!(texts(&sql, sliding).await, [["1"], ["3"], ["6"]]);
    assert_eq!(one(&sql, "SELECT -(2 + 3) + 1").await, "-4");
    assert_eq!(
        one(&sql, &format!("SELECT sum(n * 1.0e0) {of}")).await,
        "9.223372036854776e18"
    );
    let batch = ask(
        &sql,
        "SELECT sum(n), -n FROM (VALUES (3)) AS v(n) GROUP BY n",
    );
    let batch = batch.await.unwrap();
    let fields = batch.schema_ref().fields().iter();
    let told: Vec<String> = fields
        .map(|f| format!("{} {}", f.name(), f.data_type()))
        .collect();
    assert_eq!(told, ["sum(v.n) Int64", "(- v.n) Int64"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_that_never_ends_is_ended_and_so_is_one_that_nobody_waits_for() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let engine = Engine::in_process(store, parts(2));
    let limits = SqlLimits {
        time: Duration::from_millis(700),
        ..LIMITS
    };
    let sql = Sql::new(&engine, limits).unwrap();
    for endless in [
        "WITH RECURSIVE t AS (SELECT 1 AS n UNION ALL SELECT n + 0 FROM t) SELECT count(*) FROM t",
        "SELECT sum(a.value * b.value) FROM sst_test a, sst_test b, sst_test c",
        "SELECT max(a.value) FROM generate_series(1, 100000000000) AS a(value)",
    ] {
        let begun = Instant::now();
        let error = ask(&sql, endless).await.unwrap_err();
        assert!(
            matches!(error, ComputeError::QueryTime { .. }),
            "{endless}: {error}"
        );
        assert!(
            error.to_string().contains("after 0.7 s, its limit of time"),
            "{error}"
        );
        assert!(
            begun.elapsed() < Duration::from_secs(20),
            "{endless}: {:?}",
            begun.elapsed()
        );
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_question_that_must_hold_more_than_its_memory_is_ended_and_a_stream_is_not() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let engine = Engine::in_process(store, parts(2));
    let limits = SqlLimits {
        memory_bytes: 4 << 20,
        ..LIMITS
    };
    let sql = Sql::new(&engine, limits).unwrap();
    for large in [
        "SELECT a.value, b.value FROM sst_test a, sst_test b WHERE a.time_start = '2010-01-01' AND b.latitude = 0.5 ORDER BY a.value + b.value",
        "SELECT latitude, longitude, time_start, count(*) FROM sst_test GROUP BY 1, 2, 3",
        "SELECT array_agg(a.value) FROM sst_test a, sst_test b",
    ] {
        let error = ask(&sql, large).await.unwrap_err();
        assert!(
            matches!(error, ComputeError::QueryMemory { limit_mib: 4 }),
            "{large}: {error}"
        );
        assert!(!error.is_retryable());
    }
    // What streams needs no memory, however much it is; and with enough the same questions are answered.
    assert_eq!(
        ask(&sql, "SELECT * FROM sst_test")
            .await
            .unwrap()
            .num_rows(),
        12 * 19_500
    );
    let sql = sql_of(&engine);
    let groups = "SELECT latitude, longitude, time_start, count(*) FROM sst_test GROUP BY 1, 2, 3";
    assert_eq!(ask(&sql, groups).await.unwrap().num_rows(), 12 * 19_500);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_version_is_named_and_one_question_reads_one_version() {
    let (_folder, store) = folder_store();
    let (id, quantity) = (product("sst-test"), Quantity::SeaSurfaceTemperature);
    land(&store, &id, quantity, GRID, &year()[..2]).await;
    let second = land(&store, &id, quantity, GRID, &year()).await;
    let sql = sql_of(&Engine::in_process(store, parts(1)));
    let steps = async |name: &str| {
        let text = format!("SELECT count(DISTINCT time_start) FROM {name}");
        one(&sql, &text).await
    };
    assert_eq!(steps("\"sst-test\"").await, "12");
    assert_eq!(steps("\"sst-test@1\"").await, "2");
    assert_eq!(steps("\"sst_test@2\"").await, "12");
    assert_eq!(steps(&format!("\"{}\"", second.id())).await, "12");
    let wrong = ask(&sql, "SELECT 1 FROM \"sst-test@2-00000000\"").await;
    let wrong = wrong.unwrap_err().to_string();
    assert!(
        wrong.contains("sst-test has no version 2-00000000; the newest is sst-test@2-"),
        "{wrong}"
    );
    let listed = "SELECT name, version, quantity, unit, steps, first, last, rows, cols, west, east FROM products";
    let row = "sst-test 2 sea_surface_temperature K 12 2010-01-01T00:00:00Z 2011-01-01T00:00:00Z 130 150 160.0 235.0";
    let row: Vec<&str> = row.split(' ').collect();
    assert_eq!(texts(&sql, listed).await, [row]);
    let tables =
        "SELECT table_name FROM information_schema.tables WHERE table_schema = 'public' ORDER BY 1";
    assert_eq!(
        texts(&sql, tables).await,
        [["functions"], ["products"], ["sst-test"]]
    );
    let columns = texts(&sql, "DESCRIBE sst_test").await;
    assert_eq!(columns.len(), 6);
    for table in ["sst_test", "\"sst-test\"", "\"sst_test@2\""] {
        let shown = texts(&sql, &format!("SHOW COLUMNS FROM {table}")).await;
        assert_eq!(shown, columns, "{table}");
    }
    assert_eq!(
        texts(&sql, "SHOW TABLES")
            .await
            .iter()
            .filter(|row| row[1] == "public")
            .count(),
        3
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn functions_of_the_field_are_those_of_expressions_and_statistics_those_of_the_reduction() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let engine = Engine::in_process(store, parts(2));
    let sql = sql_of(&engine);
    let schmidt = one(&sql, "SELECT schmidt_wanninkhof2014(293.15)").await;
    let schmidt: f64 = schmidt.parse().unwrap();
    // Wanninkhof (2014), table 1: 668 for sea water at 20 °C.
    assert!((schmidt - 668.0).abs() < 0.5, "{schmidt}");
    let listed = "SELECT source FROM functions WHERE name = 'solubility_weiss1974'";
    assert!(one(&sql, listed).await.contains("Weiss (1974)"));
    // Of columns in single precision too.
    let of_column = "SELECT count(solubility_weiss1974(value, 35)) FROM sst_test WHERE latitude = 0.5 AND time_start = '2010-01-01'";
    assert_eq!(one(&sql, of_column).await, "149");

    let region: contract::region::AskedRegion = "162,-10,170,10".parse().unwrap();
    let query = StatisticsQuery {
        step: "month".parse().unwrap(),
        statistics: "mean,max".parse().unwrap(),
        ..StatisticsQuery::new(product("sst-test"), AskedGeometry::from(region))
    };
    let answer = statistics(&engine, &query).await.unwrap();
    let asked = "SELECT time_start, mean, max, unit FROM stats('sst_test', '162,-10,170,10', 'month', 'mean,max') ORDER BY 1";
    let rows = texts(&sql, asked).await;
    assert_eq!(rows.len(), 12);
    for (row, own) in rows.iter().zip(&answer.rows) {
        assert_eq!(row[0], own.start.to_string());
        let numbers = ["mean", "max"].map(|name| own.values[name].unwrap().to_string());
        assert_eq!(row[1..3], numbers);
        assert_eq!(row[3], "°C");
    }
    // What has several units says that of each statistic.
    for (asked, unit, units) in [
        ("mean,max", "°C", "mean: °C; max: °C"),
        ("std", "K", "std: K"),
        ("sum", "°C m²", "sum: °C m²"),
        ("count,coverage", "", "count: 1; coverage: %"),
        ("mean,std", "", "mean: °C; std: K"),
    ] {
        let asked = format!(
            "SELECT DISTINCT unit, units FROM stats('sst_test', '162,-10,170,10', 'month', '{asked}')"
        );
        assert_eq!(texts(&sql, &asked).await, [[unit, units]], "{asked}");
    }
    // The mean by area of whole cells is that of the reduction, up to the digits that floats have.
    let plain = "SELECT mean_weighted(value, area_km2) - 273.15 FROM sst_test
        WHERE longitude BETWEEN 162 AND 170 AND latitude BETWEEN -10 AND 10 GROUP BY time_start ORDER BY time_start";
    for (row, own) in texts(&sql, plain).await.iter().zip(&answer.rows) {
        let (found, own): (f64, f64) = (row[0].parse().unwrap(), own.values["mean"].unwrap());
        assert!((found - own).abs() < 1e-6, "{found} {own}");
    }
    for place in ["162.3,0.5", "162,0;170,5", "LINESTRING(162 0,170 5)"] {
        let asked = format!("SELECT count(mean) FROM stats('sst-test', '{place}')");
        assert_eq!(one(&sql, &asked).await, "12", "{place}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn budgets_are_tables_whose_sums_are_exact() {
    let (_folder, store) = folder_store();
    let flux = months(2010).into_iter().enumerate().map(|(month, period)| {
        let cell = |cell: usize| (1.0 + month as f32) * 1e-9 * ((cell % 13) as f32 - 5.0);
        (period, (0..GRID.cell_count()).map(cell).collect())
    });
    let flux: Vec<(Period, Vec<f32>)> = flux.collect();
    land(&store, &product("flux"), Quantity::CarbonFlux, GRID, &flux).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let sql = sql_of(&engine);
    let before = store.list("").await.unwrap();
    let columns = "time_start, budget_kg, budget_tg, coverage_percent, ocean_area_m2";
    let asked =
        format!("SELECT {columns} FROM budget('flux', '162,-10,170,10', 'month') ORDER BY 1");
    let rows = texts(&sql, &asked).await;
    assert_eq!(store.list("").await.unwrap(), before, "nothing is stored");
    let query = BudgetQuery {
        step: TimeStep::Month,
        ..BudgetQuery::new(product("flux"), "162,-10,170,10".parse().unwrap())
    };
    let answer = budget(&engine, &query).await.unwrap();
    assert_eq!((rows.len(), answer.rows.len()), (12, 12));
    let number = |text: &str| text.parse::<f64>().unwrap();
    for (row, own) in rows.iter().zip(&answer.rows) {
        assert_eq!(row[0], own.start.to_string());
        assert_eq!(number(&row[1]).to_bits(), number(&own.budget_kg).to_bits());
        let numbers = [own.budget_tg, own.coverage_percent, own.ocean_area_m2];
        for (text, own) in row[2..].iter().zip(numbers) {
            assert_eq!(number(text).to_bits(), own.to_bits());
        }
    }
    // Months sum to their year exactly, as decimals do.
    let closed = "SELECT (SELECT sum(budget_kg) FROM budget('flux', '162,-10,170,10', 'month'))
        = (SELECT budget_kg FROM budget('flux', '162,-10,170,10')) AS closed";
    assert_eq!(one(&sql, closed).await, "true");
}

/// Eight years of months that rise by some 1.2 kelvin a decade, with a season; and what is told of a region of them.
pub(crate) async fn analysed(store: &Store) -> (Engine, SeriesAnalysis) {
    let years = (2001..2009).flat_map(months).enumerate();
    let steps = years.map(|(month, period)| {
        let wave = (month % 12) as f32 + 0.01 * month as f32 + ((month * 7) % 5) as f32 * 0.1;
        let cell = |cell: usize| 280.0 + wave + cell as f32 * 1e-4;
        (period, (0..GRID.cell_count()).map(cell).collect())
    });
    let steps: Vec<(Period, Vec<f32>)> = steps.collect();
    let quantity = Quantity::SeaSurfaceTemperature;
    let manifest = land(store, &product("sst"), quantity, GRID, &steps).await;
    let engine = Engine::in_process(store.clone(), parts(2));
    let id = manifest.id();
    let of = SeriesWishes {
        region: Some("162,-10,170,10".parse().unwrap()),
        ..SeriesWishes::default()
    };
    let of = of.query(product("sst")).unwrap().unwrap();
    let options = AnalysisOptions::new(AnalysisPart::ALL.to_vec()).unwrap();
    let answer = analyse(&engine, (&manifest, &id), &of, &options).await;
    (engine, answer.unwrap())
}

/// The cells of a mask beside the box that they fill: the same rows, but for what areas are rounded to.
#[tokio::test(flavor = "multi_thread")]
async fn cells_of_a_mask_are_a_region_of_each_function() {
    const BOX: &str = "162,-10,170,10";
    let (_folder, store) = folder_store();
    let (engine, _answer) = analysed(&store).await;
    let flux = wavy_year(&GRID);
    land(&store, &product("flux"), Quantity::CarbonFlux, GRID, &flux).await;
    let code = |cell: usize| match (cell / 150, cell % 150) {
        (55..75, 4..20) => 3.0,
        _ => f32::NAN,
    };
    let codes: Vec<f32> = (0..GRID.cell_count()).map(code).collect();
    let flag = |value, meaning: &str| Flag {
        value,
        meaning: meaning.to_owned(),
    };
    let words = OpenWords {
        name: "basin".to_owned(),
        unit: "1".to_owned(),
        title: "Basin".to_owned(),
        range: None,
        flags: vec![flag(3, "filled"), flag(1, "rest")],
        is_standard_name: false,
    };
    let basin = Quantity::Open(OpenQuantity::new(words).unwrap());
    let year = [(Period::year(2000).unwrap(), codes)];
    land(&store, &product("my-basins"), basin, GRID, &year).await;
    let sql = sql_of(&engine);
    for (asked, rows) in [
        (
            "SELECT mean, max, coverage_percent FROM stats('sst', 'PLACE', 'year', 'mean,max')",
            8,
        ),
        (
            "SELECT budget_tg, ocean_area_m2 FROM budget('flux', 'PLACE', 'month')",
            12,
        ),
        (
            "SELECT mean, spread, count FROM analysis('sst', 'PLACE', 'climatology')",
            12,
        ),
    ] {
        let of = async |place: &str| -> Vec<f64> {
            let found = texts(&sql, &asked.replace("PLACE", place)).await;
            assert_eq!(found.len(), rows, "{asked}");
            let numbers = found.iter().flatten().map(|text| text.parse().unwrap());
            numbers.collect()
        };
        let (whole, filled) = (of("global").await, of(BOX).await);
        for place in ["my-basins:3", "my_basins@1:3", "my_basins:filled"] {
            let found = of(place).await;
            let is_near = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-9 * b.abs();
            assert!(
                found.iter().zip(&filled).all(is_near),
                "{asked}: {found:?} {filled:?}"
            );
            assert!(
                !found.iter().zip(&whole).all(is_near),
                "{asked}: it is everywhere"
            );
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_damaged_field_is_an_error_that_names_it_and_never_rows() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let field = latest(&store).await.steps[2].field.clone();
    let mut damaged = store.get(&field).await.unwrap().to_vec();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 1;
    store.put_over(&field, damaged.into()).await.unwrap();
    let sql = sql_of(&Engine::in_process(store, parts(2)));
    let error = ask(&sql, "SELECT sum(value) FROM sst_test")
        .await
        .unwrap_err();
    assert!(error.to_string().contains(field.as_str()), "{error}");
    let sound = "SELECT count(value) FROM sst_test WHERE value > 0 AND time_start > '2010-03-01'";
    assert_eq!(one(&sql, sound).await, (9 * 130 * 149).to_string());
}

#[tokio::test(flavor = "multi_thread")]
async fn nothing_is_stored_by_a_question() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    let before = store.list("").await.unwrap();
    let sql = sql_of(&Engine::in_process(store.clone(), parts(2)));
    texts(&sql, "SELECT avg(value) FROM sst_test").await;
    let polygon = "SELECT * FROM stats('sst-test', 'POLYGON((161 0,170 0,165 20,161 0))', 'year')";
    assert_eq!(texts(&sql, polygon).await.len(), 1);
    assert_eq!(store.list("").await.unwrap(), before);
}

#[tokio::test(flavor = "multi_thread")]
async fn two_products_are_joined_by_time_and_place() {
    let (_folder, store) = folder_store();
    sst(&store).await;
    land(
        &store,
        &product("wind"),
        Quantity::WindSpeed,
        GRID,
        &year()[..3],
    )
    .await;
    let sql = sql_of(&Engine::in_process(store, parts(2)));
    let joined =
        "SELECT count(*), count(a.value - b.value), max(abs(a.value - b.value)) FROM sst_test a
        JOIN wind b USING (time_start, latitude, longitude)";
    let expected = [
        (3 * 19_500).to_string(),
        (3 * 130 * 149).to_string(),
        "0.0".to_owned(),
    ];
    assert_eq!(texts(&sql, joined).await, [expected]);
    let count = ask(&sql, joined).await.unwrap();
    assert_eq!(count.column(0).as_primitive::<Int64Type>().value(0), 58_500);
    // What has no partner comes through no filter of the partner, on whichever side of the join it stands.
    let filtered = |tables: &str| {
        format!(
            "SELECT count(*), count(a.latitude) FROM {tables} ON a.time_start = b.time_start AND a.latitude = b.latitude
                AND a.longitude = b.longitude AND a.value > 285
            WHERE CASE WHEN a.latitude > 24.0 THEN a.longitude ELSE a.latitude END > 10"
        )
    };
    let right = texts(&sql, &filtered("sst_test a RIGHT JOIN sst_test b")).await;
    let left = texts(&sql, &filtered("sst_test b LEFT JOIN sst_test a")).await;
    assert_eq!(right, left);
    assert!(
        right[0][0] == right[0][1] && right[0][0] != "0",
        "{right:?}"
    );
}
