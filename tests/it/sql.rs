//! SQL as analysts ask it: the examples of docs/sql.md, the forms of answers as others read them, refusals, Flight SQL.

use std::io::Read as _;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use harness::program;
use serde_json::Value;

use crate::end_to_end::demo_data;

/// A question of the page, and what stands below it.
struct Example {
    question: String,
    answer: String,
}

/// Questions are fenced as `sql`, answers right after them as `text`.
fn examples(page: &str) -> Vec<Example> {
    let mut found = vec![];
    let mut rest = page;
    while let Some((_before, after)) = rest.split_once("```sql\n") {
        let (question, after) = after.split_once("```\n").expect("a fence is closed");
        let answer = after.strip_prefix("```text\n").expect("an answer follows");
        let (answer, after) = answer.split_once("```").expect("a fence is closed");
        found.push(Example {
            question: question.to_owned(),
            answer: answer.to_owned(),
        });
        rest = after;
    }
    found
}

/// Lines without what stands at their ends, and without digests of versions, which say when a product landed.
fn told(text: &str) -> Vec<String> {
    let without_digest = |line: &str| match line.split_once("@1-") {
        Some((before, after)) => format!("{before}@1{}", after.get(8..).unwrap_or_default()),
        None => line.to_owned(),
    };
    let lines = text.lines().map(|line| without_digest(line.trim_end()));
    lines.filter(|line| !line.is_empty()).collect()
}

#[test]
fn the_examples_of_the_page_answer_what_stands_below_them() {
    let page = include_str!("../../docs/sql.md");
    let examples = examples(page);
    assert!(examples.len() >= 7, "{}", examples.len());
    for example in &examples {
        let answer = program::succeed(demo_data(), &["sql", &example.question]).unwrap();
        assert_eq!(told(&answer), told(&example.answer), "{}", example.question);
    }
    // The comparison sees another answer.
    let other = example_with_another_digit(&examples[1].answer);
    assert_ne!(told(&other), told(&examples[1].answer));
}

fn example_with_another_digit(answer: &str) -> String {
    answer.replacen('1', "2", 1)
}

const JULY: &str = "SELECT time_start, latitude, longitude, value, value IS NULL AS is_gap, 'x' AS word, 7 AS number
    FROM takahashi09_flux WHERE time_start = '2000-07-01' AND latitude BETWEEN 0 AND 4 AND longitude < -170
    ORDER BY latitude, longitude";

/// What Python's libraries find in an answer: its columns by name.
fn read_by_others(path: &Path) -> Value {
    let script = "
import json, sys
path = sys.argv[1]
if path.endswith('.nc'):
    import xarray
    data = xarray.open_dataset(path)
    assert list(data.sizes) == ['row'], data.sizes
    assert data.value.attrs['units'] == 'kg m-2 s-1', data.value.attrs
    assert data.time_start.encoding['dtype'] == 'int64', data.time_start.encoding
    table = data.to_dataframe()
elif path.endswith('.parquet'):
    import pyarrow.parquet
    table = pyarrow.parquet.read_table(path)
    assert table.schema.field('value').metadata[b'units'] == b'kg m-2 s-1'
    table = table.to_pandas()
elif path.endswith('.arrow'):
    import pyarrow.ipc
    table = pyarrow.ipc.open_file(path).read_all().to_pandas()
elif path.endswith('.csv'):
    import pandas
    table = pandas.read_csv(path)
else:
    import pandas
    table = pandas.DataFrame(json.load(open(path)))
columns = dict(
    time=[str(it)[:10] for it in table.time_start],
    latitude=[float(it) for it in table.latitude],
    longitude=[float(it) for it in table.longitude],
    value=[None if it != it else '%.6g' % it for it in table.value.astype('float32')],
    is_gap=[int(it in (True, 1, 'true')) for it in table.is_gap],
    word=sorted(set(table.word)), number=sorted(set(int(it) for it in table.number)))
print(json.dumps(columns))
";
    let run = Command::new(test_data::python())
        .args(["-c", script])
        .arg(path)
        .output()
        .unwrap();
    let talk = String::from_utf8_lossy(&run.stderr).into_owned();
    assert!(run.status.success(), "{}: {talk}", path.display());
    serde_json::from_slice(&run.stdout).unwrap()
}

#[test]
fn others_find_the_same_rows_in_every_form_of_an_answer() {
    let folder = tempfile::tempdir().unwrap();
    let mut first = None;
    for ending in ["csv", "json", "arrow", "parquet", "nc"] {
        let path = folder.path().join(format!("july.{ending}"));
        let words = ["sql", JULY, "--output", path.to_str().unwrap()];
        program::succeed(demo_data(), &words).unwrap();
        let found = read_by_others(&path);
        assert_eq!(found["time"].as_array().unwrap().len(), 40, "{ending}");
        assert_eq!(found["word"], serde_json::json!(["x"]), "{ending}");
        assert_eq!(found["number"], serde_json::json!([7]), "{ending}");
        let first = first.get_or_insert_with(|| found.clone());
        assert_eq!(*first, found, "{ending}");
        // Nothing is written over, and what fails leaves nothing.
        let again = program::fail(demo_data(), &words).unwrap();
        assert!(again.contains("is there"), "{again}");
        let broken = folder.path().join(format!("broken.{ending}"));
        let divided = "SELECT 1 / (value::bigint) AS value FROM takahashi09_flux";
        let words = ["sql", divided, "--output", broken.to_str().unwrap()];
        let failed = program::fail(demo_data(), &words).unwrap();
        assert!(failed.contains("ivide by zero"), "{failed}");
    }
    let left = std::fs::read_dir(folder.path()).unwrap().count();
    assert_eq!(left, 5, "files of failed answers are left");
}

#[test]
fn a_question_comes_from_a_file_or_standard_input_and_a_table_has_an_end() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("question.sql");
    std::fs::write(&file, "SELECT count(*) AS n\nFROM takahashi09_flux;\n").unwrap();
    let words = ["sql", "--file", file.to_str().unwrap(), "--format", "csv"];
    assert_eq!(
        program::succeed(demo_data(), &words).unwrap(),
        "n\n777600\n"
    );
    let child = program::command(demo_data())
        .args(["sql", "-", "--format", "json"])
        .stdin(std::fs::File::open(&file).unwrap())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(
        String::from_utf8(output.stdout).unwrap(),
        "[{\"n\":777600}]\n"
    );

    let all = [
        "sql",
        "SELECT latitude FROM takahashi09_flux",
        "--max-rows",
        "7",
    ];
    let output = program::run(demo_data(), &all).unwrap();
    assert!(output.status.success());
    assert_eq!(String::from_utf8(output.stdout).unwrap().lines().count(), 8);
    let talk = String::from_utf8(output.stderr).unwrap();
    assert!(talk.contains("the first 7 rows"), "{talk}");
}

#[test]
fn bad_questions_and_impossible_forms_are_told_in_a_line() {
    let limits = ["--memory-mib", "8", "--limit-s", "2"];
    for (text, more, reason) in [
        (
            "DROP TABLE products",
            &[][..],
            "DROP is refused: SQL here reads only",
        ),
        (
            "SELECT * FROM '/etc/passwd'",
            &[],
            "not found; products are",
        ),
        ("SELECT * FROM takahashi09-flux", &[], "is written with _"),
        (
            "SELECT array_agg(a.value) FROM takahashi09_flux a, takahashi09_flux b",
            &limits,
            "more than 8 MiB, its limit of memory",
        ),
        (
            "SELECT count(*) FROM takahashi09_flux a, takahashi09_flux b WHERE a.value < b.value",
            &limits,
            "limit of",
        ),
        ("SELECT 1", &["--output", "answer.txt"], "says no form"),
        ("SELECT 1", &["--format", "netcdf"], "give --output"),
        (
            "SELECT 1 AS a, 2 AS a",
            &["--output", "/nonexistent/a.nc"],
            "",
        ),
    ] {
        let words = [&["sql", text][..], more].concat();
        let told = program::fail(demo_data(), &words).unwrap();
        assert!(told.contains(reason), "{text}: {told}");
    }
}

const ENDLESS: &str =
    "SELECT a.value FROM takahashi09_flux a, takahashi09_flux b, takahashi09_flux c";

/// Interrupts a question as Ctrl-C does; what it tells at its end.
fn told_when_interrupted(child: Child) -> String {
    let interrupt = Command::new("kill")
        .args(["-INT", &child.id().to_string()])
        .status();
    assert!(interrupt.unwrap().success());
    let output = child.wait_with_output().unwrap();
    assert!(!output.status.success());
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn an_interrupted_question_leaves_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("all.csv");
    let child = program::command(demo_data())
        .args(["sql", ENDLESS, "--output", path.to_str().unwrap()])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    // It has begun to write.
    let begun = std::time::Instant::now();
    while std::fs::read_dir(folder.path()).unwrap().count() == 0 {
        assert!(begun.elapsed().as_secs() < 60, "nothing is written");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let told = told_when_interrupted(child);
    assert!(told.contains("nothing was written"), "{told}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn an_interrupted_question_says_that_rows_on_standard_output_are_not_all() {
    let mut child = program::command(demo_data())
        .args(["sql", ENDLESS, "--format", "csv"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut first = [0; 7];
    let rows = child.stdout.as_mut().unwrap();
    rows.read_exact(&mut first).unwrap();
    let told = told_when_interrupted(child);
    assert!(told.contains("may not be whole"), "{told}");
    assert!(!told.contains("nothing was written"), "{told}");
}

#[test]
fn flight_sql_is_served_to_whoever_may_ask() {
    let open = ["flight-sql", "--listen", "0.0.0.0:0"];
    let told = program::fail(demo_data(), &open).unwrap();
    assert!(told.contains("give --token-file"), "{told}");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("token");
    std::fs::write(&file, "short\n").unwrap();
    let words = ["flight-sql", "--token-file", file.to_str().unwrap()];
    let told = program::fail(demo_data(), &words).unwrap();
    assert!(told.contains("16 to 4096"), "{told}");
    assert!(!told.contains("short"), "a token is shown: {told}");
}
