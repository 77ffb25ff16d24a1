//! Stores of others in a bucket of a real S3 server, attached: read with credentials or as anybody, never written to; and what is refused,
//! damaged or gone there is an error that names it and no value.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::{Arc, OnceLock};

use harness::gate::{Gate, Refusal, Request};
use harness::program;
use harness::server::Server;
use harness::servers::Servers;
use object_store::path::Path as ObjectPath;
use object_store::{ObjectMeta, ObjectStore, ObjectStoreExt as _};
use serde_json::Value;
use storage::Store;
use storage::store::Settings;
use tempfile::TempDir;

const STORES: [&str; 5] = [
    "v2-blosc.zarr",
    "v2-plain.zarr",
    "v3-zstd.zarr",
    "v3-gzip.zarr",
    "v3-sharded.zarr",
];
const BUCKET: &str = "fluxglobe";
const TOKEN: &str = "c2Vzc2lvbi10b2tlbg";

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../ingest/tests/data/attached")
        .join(name)
}

/// One S3 server for all tests of this file, which never removes what another test reads.
fn server() -> &'static Servers {
    static SERVER: OnceLock<Servers> = OnceLock::new();
    SERVER.get_or_init(|| Servers::start(&["s3"]).unwrap())
}

/// A place in the bucket, a gate before it, and a data folder.
struct Bucket {
    gate: Gate,
    prefix: &'static str,
    data: TempDir,
    objects: Arc<dyn ObjectStore>,
}

impl Bucket {
    /// `prefix` is this test's own.
    fn new(prefix: &'static str) -> Self {
        let settings = Settings::from_variables(server().settings().iter().cloned());
        let store = Store::open_with(&format!("s3://{BUCKET}/{prefix}"), &settings).unwrap();
        Self {
            gate: Gate::start(server().setting("AWS_ENDPOINT_URL").unwrap()).unwrap(),
            prefix,
            data: tempfile::tempdir().unwrap(),
            objects: store.object_store(),
        }
    }

    fn with(prefix: &'static str, names: &[&str]) -> Self {
        let own = Self::new(prefix);
        for name in names {
            for file in files(&fixture(name)) {
                let inside = file.strip_prefix(fixture("")).unwrap().to_str().unwrap();
                own.put(inside, std::fs::read(&file).unwrap());
            }
        }
        own
    }

    fn put(&self, name: &str, content: Vec<u8>) {
        let path = ObjectPath::from(name);
        wait(self.objects.put(&path, content.into())).unwrap();
    }

    fn get(&self, name: &str) -> Vec<u8> {
        let path = ObjectPath::from(name);
        let got = async { self.objects.get(&path).await?.bytes().await };
        wait(got).unwrap().to_vec()
    }

    /// All that is there: names, sizes, digests and times.
    fn listed(&self) -> Vec<ObjectMeta> {
        use futures::TryStreamExt as _;
        let mut all: Vec<ObjectMeta> = wait(self.objects.list(None).try_collect()).unwrap();
        all.sort_by(|a, b| a.location.cmp(&b.location));
        all
    }

    fn url(&self, name: &str) -> String {
        format!("s3://{BUCKET}/{}/{name}", self.prefix)
    }

    /// The program behind the gate, with credentials.
    fn program(&self) -> Command {
        let mut program = program::command(self.data.path());
        program.envs(server().settings().iter().cloned());
        program.env("AWS_ENDPOINT_URL", self.gate.url());
        program
    }

    fn attach(&self, name: &str, product: &str) -> Command {
        let mut program = self.program();
        program.args(["attach", &self.url(name), "--variable", "sst", "--product"]);
        program.arg(product);
        program
    }

    fn products(&self) -> usize {
        let all = program::json(self.data.path(), &["products", "--json"]).unwrap();
        all.as_array().unwrap().len()
    }
}

fn wait<T>(future: impl Future<Output = T>) -> T {
    static RUNTIME: OnceLock<tokio::runtime::Runtime> = OnceLock::new();
    let runtime = RUNTIME.get_or_init(|| tokio::runtime::Runtime::new().unwrap());
    runtime.block_on(future)
}

fn files(folder: &Path) -> Vec<PathBuf> {
    let mut all = vec![];
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            all.extend(files(&path));
        } else {
            all.push(path);
        }
    }
    all
}

fn succeeded(command: &mut Command) -> String {
    let Output {
        status,
        stdout,
        stderr,
    } = command.output().unwrap();
    let talk = String::from_utf8_lossy(&stderr);
    assert!(status.success(), "{talk}");
    String::from_utf8(stdout).unwrap()
}

/// What a run that must fail says; nothing secret is in it.
fn failed(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let talk = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(!output.status.success(), "{talk}");
    assert!(!talk.contains("panicked"), "{talk}");
    let secret = server().setting("AWS_SECRET_ACCESS_KEY").unwrap();
    assert!(!talk.contains(secret) && !talk.contains(TOKEN), "{talk}");
    talk
}

/// Names of the fields of a product, which are digests of their values.
fn digests(data: &Path, product: &str) -> BTreeSet<String> {
    let folder = data.join("objects/frames").join(product);
    let name = |path: &PathBuf| path.file_name().unwrap().to_str().unwrap().to_owned();
    files(&folder).iter().map(name).collect()
}

fn code(code: &str) -> String {
    format!(
        "<Error><Code>{code}</Code><Message>So it is.</Message><Token-0>{TOKEN}</Token-0>\
         <CanonicalRequest>x-amz-security-token:{TOKEN}</CanonicalRequest></Error>"
    )
}

#[test]
fn values_in_a_bucket_are_those_of_the_same_store_in_a_folder_and_nothing_is_written_there() {
    let bucket = Bucket::with("values", &STORES);
    let before = bucket.listed();
    assert!(before.len() > 50, "{}", before.len());
    let here = tempfile::tempdir().unwrap();
    for name in STORES {
        let product = name.trim_end_matches(".zarr");
        let folder = fixture(name);
        let words = [
            "attach",
            folder.to_str().unwrap(),
            "--variable",
            "sst",
            "--product",
            product,
        ];
        program::succeed(here.path(), &words).unwrap();
        let told = succeeded(bucket.attach(name, product).arg("--json"));
        let told: Value = serde_json::from_str(&told).unwrap();
        assert_eq!(
            (&told["steps"], &told["store"]),
            (&3.into(), &bucket.url(name).into())
        );
        let (found, expected) = (
            digests(bucket.data.path(), product),
            digests(here.path(), product),
        );
        assert_eq!(found, expected, "{name}");
        assert_eq!(found.len(), 3, "{name}");
    }
    // All of it is read again, and every value is the one that was attached.
    succeeded(bucket.program().arg("verify"));
    assert_eq!(bucket.listed(), before);
    let passed = bucket.gate.passed();
    assert!(passed.len() > 100, "{}", passed.len());
    let is_reading = |request: &Request| matches!(request.method.as_str(), "GET" | "HEAD");
    assert!(passed.iter().all(is_reading), "{passed:?}");
    // No credential is here.
    let secret = server().setting("AWS_SECRET_ACCESS_KEY").unwrap();
    for file in files(bucket.data.path()) {
        let content = std::fs::read(&file).unwrap();
        let is_in = content
            .windows(secret.len())
            .any(|part| part == secret.as_bytes());
        assert!(!is_in, "{}", file.display());
    }
}

/// Lets everybody read objects of the bucket, and list them or not.
fn open_to_everybody(actions: &str) {
    let policy = format!(
        r#"{{"Version":"2012-10-17","Statement":[{{"Effect":"Allow","Principal":"*","Action":[{actions}],"Resource":["arn:aws:s3:::{BUCKET}/open/*"{}]}}]}}"#,
        if actions.contains("List") {
            format!(r#","arn:aws:s3:::{BUCKET}""#)
        } else {
            String::new()
        }
    );
    let setting = |name: &str| server().setting(name).unwrap().to_owned();
    let digest = contract::digest::Digest::of(policy.as_bytes());
    let mut curl = Command::new("curl")
        .args(["--config", "-", "--silent", "--show-error", "--fail"])
        .args([
            "--aws-sigv4",
            "aws:amz:us-east-1:s3",
            "--request",
            "PUT",
            "--data-raw",
            &policy,
        ])
        .args(["--header", &format!("x-amz-content-sha256: {digest}")])
        .args(["--header", "content-type: application/json"])
        .arg(format!("{}/{BUCKET}?policy=", setting("AWS_ENDPOINT_URL")))
        .stdin(Stdio::piped())
        .spawn()
        .unwrap();
    let (key, secret) = (
        setting("AWS_ACCESS_KEY_ID"),
        setting("AWS_SECRET_ACCESS_KEY"),
    );
    let config = format!("user = \"{key}:{secret}\"\n");
    std::io::Write::write_all(&mut curl.stdin.take().unwrap(), config.as_bytes()).unwrap();
    assert!(curl.wait().unwrap().success());
}

#[test]
fn what_is_open_to_everybody_is_read_without_credentials() {
    let bucket = Bucket::with("open", &["v2-plain.zarr", "v3-sharded.zarr"]);
    let without = |command: &mut Command| {
        command.env_remove("AWS_ACCESS_KEY_ID");
        command.env_remove("AWS_SECRET_ACCESS_KEY");
    };
    let mut closed = bucket.attach("v2-plain.zarr", "plain");
    without(&mut closed);
    let talk = failed(&mut closed);
    assert!(
        talk.contains("AccessDenied") && talk.contains("v2-plain.zarr"),
        "{talk}"
    );
    open_to_everybody("\"s3:GetObject\",\"s3:ListBucket\"");
    let mut plain = bucket.attach("v2-plain.zarr", "plain");
    without(&mut plain);
    succeeded(&mut plain);
    // Credentials that are there are not used where somebody says so.
    let mut unsigned = bucket.attach("v3-sharded.zarr", "sharded");
    unsigned.env("AWS_SKIP_SIGNATURE", "true");
    succeeded(&mut unsigned);
    let mut verify = bucket.program();
    verify.arg("verify");
    without(&mut verify);
    succeeded(&mut verify);
    let is_signed = |request: &Request| request.headers.to_lowercase().contains("authorization:");
    assert!(!bucket.gate.passed().iter().any(is_signed));
}

/// A bucket whose objects may be read and not listed answers 403 for what is not there.
#[test]
fn where_nothing_may_be_listed_what_is_there_is_read_all_the_same() {
    let bucket = Bucket::with(
        "unlisted",
        &["v2-plain.zarr", "v2-blosc.zarr", "v3-gzip.zarr"],
    );
    let there: BTreeSet<String> = bucket
        .listed()
        .iter()
        .map(|meta| format!("/{BUCKET}/{}/{}", bucket.prefix, meta.location))
        .collect();
    bucket.gate.refuse(move |request| {
        (!there.contains(&request.path)).then(|| Refusal {
            status: "403 Forbidden",
            body: code("AccessDenied"),
        })
    });
    for (name, product) in [
        ("v2-plain.zarr", "plain"),
        ("v2-blosc.zarr", "blosc"),
        ("v3-gzip.zarr", "gzip"),
    ] {
        succeeded(&mut bucket.attach(name, product));
        assert_eq!(digests(bucket.data.path(), product).len(), 3, "{name}");
    }
    assert!(!bucket.gate.refused().is_empty());
    // There is nothing, or nothing for us.
    let talk = failed(&mut bucket.attach("nothing.zarr", "nothing"));
    assert!(talk.contains("AccessDenied"), "{talk}");
}

/// Status and code of an answer to the chunks of the last rows, and what must be said.
const REFUSALS: [(&str, &str, &str); 5] = [
    (
        "403 Forbidden",
        "AccessDenied",
        "credentials of the environment",
    ),
    (
        "400 Bad Request",
        "ExpiredToken",
        "credentials of the environment",
    ),
    ("404 Not Found", "NoSuchBucket", "there is no such bucket"),
    (
        "404 Not Found",
        "InvalidAccessKeyId",
        "credentials of the environment",
    ),
    (
        "400 Bad Request",
        "AuthorizationHeaderMalformed",
        "set AWS_REGION",
    ),
];

/// Has chunks of the last rows answered so.
fn refuse_chunks(bucket: &Bucket, status: &'static str, name: &'static str) {
    bucket.gate.refuse(move |request| {
        request.path.contains("sst/c/0/2/").then(|| Refusal {
            status,
            body: code(name),
        })
    });
}

#[test]
fn credentials_that_end_and_buckets_that_go_are_errors_that_name_the_chunk_and_no_values() {
    let bucket = Bucket::with("ended", &["v3-gzip.zarr"]);
    let before = bucket.listed();
    let with_token = |mut command: Command| {
        command.env("AWS_REGION", "us-east-1");
        command
    };
    for (status, name, said) in REFUSALS {
        refuse_chunks(&bucket, status, name);
        let talk = failed(&mut with_token(bucket.attach("v3-gzip.zarr", "gzip")));
        for part in [
            "s3://fluxglobe/ended/v3-gzip.zarr",
            "array sst",
            "chunk [0, 2, ",
            name,
            said,
        ] {
            assert!(talk.contains(part), "{part}: {talk}");
        }
        assert!(!talk.contains("--refresh"), "{talk}");
        assert_eq!(bucket.products(), 0, "{name}");
    }
    assert!(bucket.gate.refused().len() >= REFUSALS.len());
    bucket.gate.open();
    succeeded(&mut bucket.attach("v3-gzip.zarr", "gzip"));
    // The same of what is read later; and who is not let in finds no damage.
    for (status, name, said) in REFUSALS {
        refuse_chunks(&bucket, status, name);
        for words in [
            &["verify"][..],
            &[
                "stats",
                "point",
                "--product",
                "gzip",
                "--lon",
                "0",
                "--lat",
                "0",
            ],
        ] {
            let talk = failed(bucket.program().args(words));
            for part in ["array sst", "chunk [0, 2, ", name, said, "step 2020-01-0"] {
                assert!(talk.contains(part), "{part} of {words:?}: {talk}");
            }
            assert!(
                !talk.contains("--refresh") && !talk.contains("sound"),
                "{talk}"
            );
            // How we came there is no part of what failed there.
            assert!(!talk.contains("attached store error"), "{talk}");
        }
    }
    bucket.gate.open();
    succeeded(bucket.program().arg("verify"));
    assert_eq!(bucket.listed(), before);
}

#[test]
fn damaged_missing_and_unknown_chunks_in_a_bucket_are_errors_that_name_them() {
    let bucket = Bucket::with("damaged", &["v3-sharded.zarr", "v2-plain.zarr"]);
    succeeded(&mut bucket.attach("v3-sharded.zarr", "sharded"));
    let (shard, whole) = (
        "v3-sharded.zarr/sst/c/0/0/0",
        bucket.get("v3-sharded.zarr/sst/c/0/0/0"),
    );
    let mut flipped = whole.clone();
    // In the index of the shard, which has a checksum.
    flipped[whole.len() - 10] ^= 1;
    bucket.put(shard, flipped);
    let ask = || {
        let mut program = bucket.program();
        program.args([
            "stats",
            "point",
            "--product",
            "sharded",
            "--lon",
            "0",
            "--lat",
            "0",
        ]);
        program
    };
    for talk in [
        failed(&mut ask()),
        failed(&mut bucket.attach("v3-sharded.zarr", "again")),
    ] {
        for part in [
            "s3://fluxglobe/damaged/v3-sharded.zarr",
            "array sst",
            "chunk [0, 0, 0]",
            "checksum",
        ] {
            assert!(talk.contains(part), "{part}: {talk}");
        }
    }
    assert!(failed(&mut ask()).contains("fluxglobe attach --refresh sharded"));
    assert_eq!(bucket.products(), 1, "nothing was published of it");
    bucket.put(shard, whole);
    succeeded(&mut ask());
    // A chunk that is not there, where that would be a value.
    let document = String::from_utf8(bucket.get("v2-plain.zarr/sst/.zarray")).unwrap();
    let mut document: Value = serde_json::from_str(&document).unwrap();
    document["fill_value"] = 300.0.into();
    bucket.put("v2-plain.zarr/sst/.zarray", document.to_string().into());
    let attributes = String::from_utf8(bucket.get("v2-plain.zarr/sst/.zattrs")).unwrap();
    let mut attributes: Value = serde_json::from_str(&attributes).unwrap();
    attributes["_FillValue"] = (-999.0).into();
    bucket.put("v2-plain.zarr/sst/.zattrs", attributes.to_string().into());
    wait(
        bucket
            .objects
            .delete(&ObjectPath::from("v2-plain.zarr/sst/1.0.0")),
    )
    .unwrap();
    let talk = failed(&mut bucket.attach("v2-plain.zarr", "plain"));
    assert!(
        talk.contains("array sst") && talk.contains("chunk [1, 0, 0]"),
        "{talk}"
    );
    assert!(talk.contains("is not there"), "{talk}");
    // A codec that this program does not have.
    document["compressor"] = serde_json::json!({"id": "lzma", "preset": 1});
    bucket.put("v2-plain.zarr/sst/.zarray", document.to_string().into());
    let talk = failed(&mut bucket.attach("v2-plain.zarr", "plain"));
    assert!(
        talk.contains("array sst") && talk.contains("lzma"),
        "{talk}"
    );
}

#[test]
fn a_service_reads_again_once_it_is_let_in_again() {
    let bucket = Bucket::with("again", &["v3-gzip.zarr"]);
    succeeded(&mut bucket.attach("v3-gzip.zarr", "gzip"));
    bucket.gate.refuse(|_request| {
        Some(Refusal {
            status: "403 Forbidden",
            body: code("ExpiredToken"),
        })
    });
    let mut settings = server().settings().to_vec();
    settings.retain(|(name, _)| name.starts_with("AWS_") && name != "AWS_ENDPOINT_URL");
    settings.push(("AWS_ENDPOINT_URL".to_owned(), bucket.gate.url()));
    let served = Server::start_with(bucket.data.path(), &["serve"], &settings).unwrap();
    let path = "/api/products/gzip/point?lon=0&lat=0";
    let refused = served.get(path).unwrap();
    assert_eq!(refused.status, 502, "{}", refused.text());
    assert!(
        refused.text().contains("ExpiredToken"),
        "{}",
        refused.text()
    );
    assert!(!refused.text().contains(TOKEN), "{}", refused.text());
    bucket.gate.open();
    let answer = served.get(path).unwrap();
    assert_eq!(answer.status, 200, "{}", answer.text());
}

/// The product's own cube in a bucket, as a repository of somebody else's whose branch moves.
#[test]
#[expect(clippy::too_many_lines, reason = "one story of a store that goes on")]
fn a_repository_in_a_bucket_is_read_as_it_was_attached_while_its_branch_moves() {
    let bucket = Bucket::new("moving");
    let owner = |words: &[&str]| {
        let mut program = program::unset();
        program.envs(server().settings().iter().cloned());
        program.args(["--data", bucket.data.path().join("owner").to_str().unwrap()]);
        program.args(["--store", &bucket.url("own")]).args(words);
        succeeded(&mut program)
    };
    let files = files(&test_data::fluxengine("takahashi09"));
    let mut files: Vec<&str> = files.iter().map(|file| file.to_str().unwrap()).collect();
    files.sort_unstable();
    owner(&["ingest", files[0], files[1]]);
    let mut attach = bucket.program();
    let cube = bucket.url("own/cubes/takahashi09-flux");
    attach.args([
        "attach",
        &cube,
        "--variable",
        "carbon_flux",
        "--product",
        "theirs",
        "--json",
    ]);
    let told: Value = serde_json::from_str(&succeeded(&mut attach)).unwrap();
    let state = told["snapshot"].as_str().unwrap().to_owned();
    assert_eq!(told["steps"], 2);
    let first = digests(bucket.data.path(), "theirs");
    owner(&["ingest", files[2]]);
    let before = bucket.listed();
    let ask = || {
        let mut program = bucket.program();
        program.args([
            "stats",
            "point",
            "--product",
            "theirs",
            "--lon=-150",
            "--lat",
            "0",
            "--json",
        ]);
        program
    };
    let answer: Value = serde_json::from_str(&succeeded(&mut ask())).unwrap();
    assert_eq!(digests(bucket.data.path(), "theirs"), first);
    // Let in no longer, it is told with the array.
    bucket.gate.refuse(|request| {
        request.path.contains("/chunks/").then(|| Refusal {
            status: "403 Forbidden",
            body: code("AccessDenied"),
        })
    });
    let talk = failed(&mut ask());
    for part in [
        cube.as_str(),
        "array carbon_flux",
        "chunk [0, 0, 0]",
        "AccessDenied",
    ] {
        assert!(talk.contains(part), "{part}: {talk}");
    }
    bucket.gate.open();
    assert_eq!(bucket.listed(), before);
    let mut refresh = bucket.program();
    refresh.args(["attach", "--refresh", "theirs", "--json"]);
    let told: Value = serde_json::from_str(&succeeded(&mut refresh)).unwrap();
    assert_eq!(
        (&told["steps"], &told["steps_read"]),
        (&3.into(), &1.into())
    );
    assert_ne!(told["snapshot"], state.as_str());
    assert_eq!(bucket.listed(), before);
    let later: Value = serde_json::from_str(&succeeded(&mut ask())).unwrap();
    assert_ne!(later, answer, "there is a step more");
    // Its owner lets the state go that is read.
    let state = told["snapshot"].as_str().unwrap();
    let object = format!("own/cubes/takahashi09-flux/snapshots/{state}");
    wait(bucket.objects.delete(&ObjectPath::from(object))).unwrap();
    let talk = failed(&mut ask());
    for part in [
        cube.as_str(),
        "array carbon_flux",
        state,
        "let go",
        "attach --refresh theirs",
    ] {
        assert!(talk.contains(part), "{part}: {talk}");
    }
    // What maintains our own store asks nobody there.
    let asked = bucket.gate.passed().len();
    let mut clean = bucket.program();
    let output = clean.args(["gc", "--dry-run"]).output().unwrap();
    let talk = String::from_utf8_lossy(&output.stderr).into_owned();
    let said =
        format!("theirs is attached to {cube} array carbon_flux: of it only references are here");
    assert!(output.status.success() && talk.contains(&said), "{talk}");
    let mut migrate = bucket.program();
    let output = migrate.arg("migrate").output().unwrap();
    let talk = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(
        output.status.success() && talk.contains("its values stay there"),
        "{talk}"
    );
    assert_eq!(bucket.gate.passed().len(), asked);
}
