//! Stores that others wrote (tests/data/attached, by zarr and xarray), attached: values are those that xarray finds, nothing of
//! them is copied or changed, and what cannot be read rightly is refused.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::SystemTime;

use contract::digest::Digest;
use contract::kind::{Kind, Vouched};
use contract::manifest::Manifest;
use ingest::attach::{Attached, ForeignFields, Request, attach, refresh};
use serde_json::{Value, json};
use storage::{Store, domain, fields};
use tempfile::TempDir;

use crate::fixture::{Place, SmallFile};

const STORES: [&str; 5] = [
    "v2-blosc.zarr",
    "v2-plain.zarr",
    "v3-zstd.zarr",
    "v3-gzip.zarr",
    "v3-sharded.zarr",
];

pub(crate) fn fixture(name: &str) -> PathBuf {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/attached");
    Path::new(folder).join(name)
}

/// A store, and a copy of somebody else's that may be changed.
pub(crate) struct Own {
    folder: TempDir,
    pub(crate) store: Store,
}

impl Own {
    pub(crate) fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            store: readable(&Store::memory()),
        }
    }

    pub(crate) fn with(name: &str) -> Self {
        let own = Self::new();
        copy(&fixture(name), &own.path());
        own
    }

    /// Where the other's store is.
    pub(crate) fn path(&self) -> PathBuf {
        self.folder.path().join("other.zarr")
    }

    /// Changes a document of it.
    pub(crate) fn edit(&self, name: &str, change: impl FnOnce(&mut Value)) {
        let path = self.path().join(name);
        let mut document: Value = serde_json::from_slice(&std::fs::read(&path).unwrap()).unwrap();
        let before = document.clone();
        change(&mut document);
        assert_ne!(document, before, "the change took place");
        std::fs::write(path, document.to_string()).unwrap();
    }

    pub(crate) fn request(&self) -> Request {
        request(self.path().to_str().unwrap(), "sst")
    }

    pub(crate) async fn attach(&self) -> Result<Attached, String> {
        self.ask(&self.request()).await
    }

    pub(crate) async fn ask(&self, request: &Request) -> Result<Attached, String> {
        let attached = attach(&self.store, request, &|_, _| ()).await;
        attached.map_err(|e| e.to_string())
    }

    pub(crate) async fn newest(&self) -> Manifest {
        let product = "sst".parse().unwrap();
        let newest = storage::manifests::latest(&self.store, &product).await;
        newest.unwrap().unwrap()
    }

    pub(crate) async fn values(
        &self,
        manifest: &Manifest,
        step: usize,
    ) -> Result<Vec<f32>, String> {
        let field = &manifest.steps[step].field;
        let values = fields::read(&self.store, field, &manifest.grid).await;
        values.map_err(|e| e.to_string())
    }
}

pub(crate) fn readable(store: &Store) -> Store {
    store.with_attached(Arc::new(ForeignFields::default()))
}

pub(crate) fn request(address: &str, variable: &str) -> Request {
    Request {
        address: address.to_owned(),
        variable: Some(variable.to_owned()),
        profile: None,
        product: None,
        indexes: vec![],
        replace: false,
    }
}

pub(crate) fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let to = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &to);
        } else {
            std::fs::copy(entry.path(), to).unwrap();
        }
    }
}

/// All files of a folder: content, and when it was written last.
fn snapshot(folder: &Path) -> BTreeMap<PathBuf, (Vec<u8>, SystemTime)> {
    let mut all = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(folder) = folders.pop() {
        let changed = folder.metadata().unwrap().modified().unwrap();
        all.insert(folder.clone(), (vec![], changed));
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let changed = path.metadata().unwrap().modified().unwrap();
                all.insert(path.clone(), (std::fs::read(&path).unwrap(), changed));
            }
        }
    }
    all
}

pub(crate) fn expected(name: &str) -> Vec<Vec<f32>> {
    let text = std::fs::read(fixture("expected.json")).unwrap();
    let found: Value = serde_json::from_slice(&text).unwrap();
    let maps = found["stores"][name].as_array().unwrap().iter();
    let value = |value: &Value| value.as_f64().map_or(f32::NAN, |value| value as f32);
    maps.map(|map| map.as_array().unwrap().iter().map(value).collect())
        .collect()
}

pub(crate) fn assert_same(found: &[f32], expected: &[f32], what: &str) {
    assert_eq!(found.len(), expected.len(), "{what}");
    for (cell, (found, expected)) in found.iter().zip(expected).enumerate() {
        // xarray unpacks in float64 and rounds in other places than here: one unit in the last place.
        let is_same = (found - expected).abs() <= 4e-5 || (found.is_nan() && expected.is_nan());
        assert!(is_same, "{what} cell {cell}: {found}, xarray {expected}");
    }
}

#[tokio::test]
async fn values_are_those_that_xarray_finds_and_nothing_is_written_there() {
    for name in STORES {
        let own = Own::with(name);
        let before = snapshot(&own.path());
        let attached = own.attach().await.unwrap();
        assert_eq!((attached.steps, attached.read), (3, 3), "{name}");
        assert!(
            attached.is_new && attached.stored_bytes < 6000,
            "{attached:?}"
        );
        let newest = own.newest().await;
        assert_eq!(newest.quantity.unit(), "K");
        assert_eq!(
            newest.steps[0].period.to_string(),
            "2020-01-01T00:00:00Z/2020-01-02T00:00:00Z"
        );
        for (step, expected) in expected(name).iter().enumerate() {
            let values = own.values(&newest, step).await.unwrap();
            assert_same(&values, expected, &format!("{name} step {step}"));
        }
        let cells = domain::read(&own.store, &newest.domain).await.unwrap();
        let first = expected(name).swap_remove(0);
        let with_data = first.iter().map(|value| !value.is_nan());
        assert!(cells.into_iter().eq(with_data), "{name}");
        assert_eq!(snapshot(&own.path()), before, "{name} is only read");
        // No value is here: not as a field, and not as a cube.
        let bare = own.store.bare();
        for step in &newest.steps {
            assert!(bare.size_bytes(&step.field).await.unwrap() < 400, "{name}");
        }
        let cubes = own.store.list(Kind::Cube.folder()).await.unwrap();
        assert_eq!(cubes, [], "{name}");
        // The same again is the same version.
        let again = own.attach().await.unwrap();
        assert_eq!(
            (again.is_new, again.version),
            (false, newest.id()),
            "{name}"
        );
    }
}

/// Numbers that JSON does not have, as the library for Python writes them in attributes, of arrays beside each other and consolidated.
#[tokio::test]
async fn nan_in_the_attributes_of_a_store_is_read() {
    type Place = fn(&mut Value) -> &mut Value;
    let cases: [(&str, &str, Place); 3] = [
        ("v2-plain.zarr", "sst/.zattrs", |it| it),
        (
            "v2-blosc.zarr",
            ".zmetadata",
            |it| &mut it["metadata"]["sst/.zattrs"],
        ),
        ("v3-gzip.zarr", "sst/zarr.json", |it| &mut it["attributes"]),
    ];
    for (name, document, attributes) in cases {
        let own = Own::with(name);
        own.edit(document, |it| {
            attributes(it)["missing_value"] = json!("no number");
        });
        let path = own.path().join(document);
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.replace("\"no number\"", "NaN")).unwrap();
        own.attach().await.unwrap();
        let newest = own.newest().await;
        for (step, expected) in expected(name).iter().enumerate() {
            let values = own.values(&newest, step).await.unwrap();
            assert_same(&values, expected, &format!("{name} step {step}"));
        }
    }
}

/// Our own cube of a landed product is an Icechunk store like any other.
#[tokio::test]
#[expect(clippy::too_many_lines, reason = "one story of a store that goes on")]
async fn an_attached_cube_is_what_was_landed_digest_by_digest_and_stays_so() {
    let mut place = Place::new();
    place.store = Store::open(place.path("data").to_str().unwrap()).unwrap();
    let file = place.path("a.nc");
    SmallFile::new().write_classic(&file);
    place.land(std::slice::from_ref(&file)).await;
    let landed = place.newest("fgco2").await;
    let own = Own::new();
    let cube = place.path("data/cubes/fgco2");
    let before = snapshot(&cube);
    let request = Request {
        product: Some("sst".parse().unwrap()),
        ..request(cube.to_str().unwrap(), "carbon_flux")
    };
    let attached = own.ask(&request).await.unwrap();
    assert!(attached.snapshot.is_some());
    assert_eq!(snapshot(&cube), before, "it is only read");
    let newest = own.newest().await;
    assert_eq!(
        (newest.grid, newest.quantity),
        (landed.grid, landed.quantity)
    );
    for (step, (own_step, landed_step)) in newest.steps.iter().zip(&landed.steps).enumerate() {
        assert_eq!(own_step.period, landed_step.period);
        let (ours, theirs) = (own_step.field.vouches(), landed_step.field.vouches());
        assert_eq!(ours, theirs, "the same digest is the same values");
        assert!(matches!(ours, Vouched::Values(_)));
        let values = own.values(&newest, step).await.unwrap();
        assert_same(&values, &place.values(&landed, step).await, "read again");
    }
    // A file replaces another and one comes: the branch moves, and what was attached is what it was.
    let revised = SmallFile {
        values: SmallFile::new()
            .values
            .iter()
            .map(|v| if *v > 0.0 { v + 1.0 } else { *v })
            .collect(),
        ..SmallFile::new()
    };
    revised.write_classic(&file);
    let later = SmallFile {
        time_unit: Some("days since 2001-03-01"),
        ..SmallFile::new()
    };
    later.write_classic(&place.path("b.nc"));
    place.land(&[file, place.path("b.nc")]).await;
    let fresh = readable(&own.store.bare());
    let still = fields::read(&fresh, &newest.steps[0].field, &newest.grid)
        .await
        .unwrap();
    assert_same(&still, &own.values(&newest, 0).await.unwrap(), "pinned");
    // And comes when it is asked for, as a new version.
    let product = "sst".parse().unwrap();
    let next = refresh(&own.store, &product, &|_, _| ()).await.unwrap();
    assert_eq!((next.steps, next.version.number), (4, 2));
    assert_eq!(next.read, 4, "two are revised, two are new");
    let (landed, newest) = (place.newest("fgco2").await, own.newest().await);
    let digests = |manifest: &Manifest| -> Vec<Vouched> {
        manifest
            .steps
            .iter()
            .map(|step| step.field.vouches())
            .collect()
    };
    assert_eq!(digests(&newest), digests(&landed));
    // Of what is only longer the new steps alone are read.
    let last = SmallFile {
        time_unit: Some("days since 2001-05-01"),
        ..SmallFile::new()
    };
    last.write_classic(&place.path("c.nc"));
    place.land(&[place.path("c.nc")]).await;
    let next = refresh(&own.store, &product, &|_, _| ()).await.unwrap();
    assert_eq!((next.steps, next.read, next.version.number), (6, 2, 3));
    let (landed, newest) = (place.newest("fgco2").await, own.newest().await);
    assert_eq!(digests(&newest), digests(&landed));
    let fresh = readable(&own.store.bare());
    for (step, landed_step) in newest.steps.iter().zip(&landed.steps) {
        let values = fields::read(&fresh, &step.field, &newest.grid)
            .await
            .unwrap();
        let landed = fields::read(&place.store, &landed_step.field, &newest.grid).await;
        assert_same(&values, &landed.unwrap(), "of the new state");
    }
    let none = refresh(&own.store, &product, &|_, _| ()).await.unwrap();
    assert!(!none.is_new && none.version == next.version, "{none:?}");
}

#[tokio::test]
async fn what_changed_upstream_is_an_error_and_never_a_number() {
    // A chunk with other values: a store that was written anew.
    let own = Own::with("v2-plain.zarr");
    own.attach().await.unwrap();
    let newest = own.newest().await;
    let chunk = |step: usize| own.path().join(format!("sst/{step}.0.0"));
    std::fs::copy(chunk(0), chunk(1)).unwrap();
    let changed = readable(&own.store.bare());
    let read = |step: usize| fields::read(&changed, &newest.steps[step].field, &newest.grid);
    let error = read(1).await.unwrap_err();
    assert!(!error.is_retryable(), "{error}");
    let text = error.to_string();
    for part in [
        "other.zarr array sst",
        "2020-01-02",
        "has changed since it was attached",
        "fluxglobe attach --refresh sst",
    ] {
        assert!(text.contains(part), "{part}: {text}");
    }
    assert!(read(0).await.is_ok(), "others are as they were");
    // A chunk that is gone.
    std::fs::remove_file(chunk(2)).unwrap();
    let error = read(2).await.unwrap_err().to_string();
    assert!(error.contains("attach --refresh sst"), "{error}");
    // A chunk that its own check finds damaged names itself.
    let own = Own::with("v3-gzip.zarr");
    own.attach().await.unwrap();
    let newest = own.newest().await;
    let path = own.path().join("sst/c/0/1/1");
    let mut bytes = std::fs::read(&path).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    std::fs::write(&path, bytes).unwrap();
    let changed = readable(&own.store.bare());
    let error = fields::read(&changed, &newest.steps[0].field, &newest.grid).await;
    let error = error.unwrap_err().to_string();
    assert!(error.contains("array sst chunk [0, 1, 1]"), "{error}");
    assert!(
        own.ask(&own.request())
            .await
            .unwrap_err()
            .contains("chunk [0, 1, 1]")
    );
    // The store is gone.
    std::fs::remove_dir_all(own.path()).unwrap();
    let changed = readable(&own.store.bare());
    let error = fields::read(&changed, &newest.steps[0].field, &newest.grid).await;
    assert!(
        error
            .unwrap_err()
            .to_string()
            .contains("there is no such folder")
    );
}

/// A damaged reference or attachment is damage of our own store.
#[tokio::test]
async fn damaged_references_are_found() {
    let own = Own::with("v2-plain.zarr");
    own.attach().await.unwrap();
    let newest = own.newest().await;
    let (bare, field) = (own.store.bare(), &newest.steps[0].field);
    let whole = std::fs::read(own.path().join("sst/0.0.0")).unwrap();
    assert!(!whole.is_empty());
    let object = bare.object_store();
    let path = object_store_path(field.as_str());
    let reference = object_store::ObjectStoreExt::get(&object, &path)
        .await
        .unwrap();
    let reference = reference.bytes().await.unwrap();
    for bit in (0..reference.len() * 8).step_by(7) {
        let mut flipped = reference.to_vec();
        flipped[bit / 8] ^= 1 << (bit % 8);
        bare.put_over(field, flipped.into()).await.unwrap();
        let read = fields::read(&readable(&bare), field, &newest.grid).await;
        assert!(read.is_err(), "bit {bit}");
    }
    bare.put_over(field, reference).await.unwrap();
    assert!(
        fields::read(&readable(&bare), field, &newest.grid)
            .await
            .is_ok()
    );
    // Without what reads other stores it is an error that says so, and no field.
    let error = fields::read(&bare, field, &newest.grid).await.unwrap_err();
    assert!(error.to_string().contains("attached"), "{error}");
    // What it refers to.
    let raw = contract::key::ObjectKey::raw(&newest.product, &newest.steps[0].raw_sha256);
    let content = bare.get(&raw).await.unwrap();
    let other = String::from_utf8(content.to_vec())
        .unwrap()
        .replace("\"sst\"", "\"sss\"");
    bare.put_over(&raw, other.into()).await.unwrap();
    let error = fields::read(&readable(&bare), field, &newest.grid).await;
    assert!(error.unwrap_err().to_string().contains("damaged"));
}

fn object_store_path(key: &str) -> object_store::path::Path {
    object_store::path::Path::from(key)
}

/// What is done to a store, and what must be in the refusal.
type Fault = (&'static str, fn(&Own), &'static [&'static str]);

const FAULTS: [Fault; 17] = [
    (
        "v2-plain.zarr",
        |own| {
            own.edit("sst/.zarray", |it| {
                it["compressor"] = json!({"id": "lzma", "preset": 1});
            });
        },
        &["array sst", "lzma"],
    ),
    (
        "v3-gzip.zarr",
        |own| {
            own.edit("sst/zarr.json", |it| {
                it["codecs"][1]["name"] = json!("numcodecs.pcodec");
            });
        },
        &["array sst", "pcodec"],
    ),
    (
        "v2-plain.zarr",
        |own| {
            own.edit("sst/.zarray", |it| {
                it["dtype"] = json!(">f4");
                it["filters"] = json!([{
                    "id": "fixedscaleoffset",
                    "offset": 0,
                    "scale": 1,
                    "dtype": ">f4",
                    "astype": "<i4",
                }]);
            });
        },
        &["array sst", "codec fixedscaleoffset is not supported"],
    ),
    (
        "v3-gzip.zarr",
        |own| {
            let scaled = json!({
                "name": "numcodecs.fixedscaleoffset",
                "configuration": {"offset": 0, "scale": 1, "dtype": "<f4", "astype": "<f4"},
            });
            own.edit("sst/zarr.json", |it| {
                it["codecs"].as_array_mut().unwrap().insert(0, scaled);
            });
        },
        &["array sst", "codec fixedscaleoffset is not supported"],
    ),
    (
        "v2-plain.zarr",
        |own| {
            own.edit("sst/.zarray", |it| it["fill_value"] = json!(300.0));
            own.edit("sst/.zattrs", |it| it["_FillValue"] = json!(-999.0));
            std::fs::remove_file(own.path().join("sst/1.0.0")).unwrap();
        },
        &[
            "array sst chunk [1, 0, 0]: is not there",
            "the fill value 300 (fill_value of .zarray)",
            "_FillValue of its attributes, or a profile, names another",
        ],
    ),
    (
        "v2-plain.zarr",
        |own| own.edit("sst/.zattrs", |it| it["_FillValue"] = json!("abc")),
        &["sst", "has _FillValue \"abc\"", "correct the fill value"],
    ),
    (
        "v3-gzip.zarr",
        |own| {
            own.edit("sst/zarr.json", |it| {
                it["attributes"]["valid_range"] = json!({"low": 0});
            });
        },
        &["sst", "has valid_range", "correct the valid range"],
    ),
    (
        "v2-plain.zarr",
        |own| {
            own.edit("sst/.zarray", |it| it["fill_value"] = json!(null));
            std::fs::remove_file(own.path().join("sst/1.0.0")).unwrap();
        },
        &[
            "array sst chunk [1, 0, 0]: is not there",
            "fill_value of its array (.zarray) is null",
        ],
    ),
    (
        "v3-gzip.zarr",
        |own| {
            own.edit("sst/zarr.json", |it| it["fill_value"] = json!(0.0));
            std::fs::remove_file(own.path().join("sst/c/0/2/0")).unwrap();
        },
        &[
            "array sst chunk [0, 2, 0]",
            "fill value 0, which is no missing value",
            "say \"_FillValue\": 0 in the attributes",
        ],
    ),
    (
        "v2-plain.zarr",
        |own| {
            own.edit("sst/.zattrs", |it| {
                it["_ARRAY_DIMENSIONS"] = json!(["time", "y", "x"]);
            });
        },
        &["sst"],
    ),
    (
        "v2-plain.zarr",
        |own| own.edit("lat/.zattrs", |it| it["units"] = json!("m")),
        &["lat: has units \"m\", so it is no latitude"],
    ),
    (
        "v2-plain.zarr",
        |own| {
            own.edit("sst/.zarray", |it| {
                it["shape"] = json!([3, 1_000_000, 1_000_000]);
                it["chunks"] = json!([1, 1_000_000, 1_000_000]);
            });
        },
        &["1000000 x 1000000 cells"],
    ),
    (
        "v3-gzip.zarr",
        |own| {
            own.edit("sst/zarr.json", |it| {
                it["chunk_grid"]["configuration"]["chunk_shape"] = json!([100_000_000, 6, 8]);
            });
        },
        &["array sst", "bytes unpacked, at most"],
    ),
    (
        "v2-plain.zarr",
        |own| own.edit("sst/.zattrs", |it| it["units"] = json!("furlong")),
        &["furlong"],
    ),
    (
        "v3-gzip.zarr",
        |own| std::fs::write(own.path().join("zarr.json"), vec![b' '; 17 << 20]).unwrap(),
        &["17825792 bytes, at most 16777216 are read"],
    ),
    (
        "v3-gzip.zarr",
        |own| std::fs::write(own.path().join("sst/c/0/0/0"), vec![0; 2 << 20]).unwrap(),
        &["chunk [0, 0, 0]", "has 2097152 bytes"],
    ),
    (
        "v3-gzip.zarr",
        |own| std::fs::remove_file(own.path().join("zarr.json")).unwrap(),
        &["neither a Zarr group (zarr.json, .zgroup) nor an Icechunk repository"],
    ),
];

#[tokio::test]
async fn what_cannot_be_read_rightly_is_refused_and_nothing_is_published() {
    for (name, fault, said) in FAULTS {
        let own = Own::with(name);
        fault(&own);
        let error = own.attach().await.unwrap_err();
        for part in said {
            assert!(error.contains(part), "{part:?} of {name}: {error}");
        }
        let manifests = own.store.list(Kind::Manifest.folder()).await.unwrap();
        assert_eq!(manifests, [], "{error}");
    }
}

#[tokio::test]
async fn a_chunk_that_is_not_there_is_no_data_where_the_conventions_say_so() {
    let own = Own::with("v2-blosc.zarr");
    std::fs::remove_file(own.path().join("sst/0.1.0")).unwrap();
    own.attach().await.unwrap();
    let newest = own.newest().await;
    // Chunks are of three rows from the south: the northern half of the first two steps.
    for step in 0..3 {
        let mut expected = expected("v2-blosc.zarr").swap_remove(step);
        if step < 2 {
            expected[..3 * 8].fill(f32::NAN);
        }
        assert_same(
            &own.values(&newest, step).await.unwrap(),
            &expected,
            "a half",
        );
    }
}

/// A place or a time that was lost would be the fill value of its array, which is one like any other.
#[tokio::test]
async fn a_chunk_of_a_coordinate_that_is_not_there_is_refused_with_its_name() {
    for (name, chunk, said) in [
        ("v2-plain.zarr", "time/0", "array time chunk [0]"),
        ("v2-plain.zarr", "lat/0", "array lat chunk [0]"),
        ("v3-gzip.zarr", "lon/c/0", "array lon chunk [0]"),
        (
            "v3-gzip.zarr",
            "time_bnds/c/0/0",
            "array time_bnds chunk [0, 0]",
        ),
    ] {
        let own = Own::with(name);
        std::fs::remove_file(own.path().join(chunk)).unwrap();
        let error = own.attach().await.unwrap_err();
        assert!(
            error.contains(said) && error.contains("is not there"),
            "{name}: {error}"
        );
        let manifests = own.store.list(Kind::Manifest.folder()).await.unwrap();
        assert_eq!(manifests, [], "{error}");
    }
}

/// A chunk of nothing but the fill value may have been left out by its writer: how to have it written is said.
#[tokio::test]
async fn a_time_of_zero_that_was_not_written_is_refused_with_what_to_do() {
    let own = Own::with("v3-gzip.zarr");
    own.edit("time/zarr.json", |it| {
        it["chunk_grid"]["configuration"]["chunk_shape"] = json!([1]);
    });
    let chunk = |step: i32| own.path().join(format!("time/c/{step}"));
    for step in 0..3_i32 {
        std::fs::write(chunk(step), step.to_le_bytes()).unwrap();
    }
    own.attach().await.unwrap();
    std::fs::remove_file(chunk(0)).unwrap();
    let error = own.attach().await.unwrap_err();
    for part in [
        "array time chunk [0]",
        "the fill value 0",
        "{\"time\": {\"write_empty_chunks\": True}}",
    ] {
        assert!(error.contains(part), "{part}: {error}");
    }
}

/// As programs write a store of one step: its time is 0 since itself, which is the fill value.
#[tokio::test]
async fn the_one_time_of_a_store_that_was_not_written_is_zero_and_told() {
    let own = Own::with("v3-gzip.zarr");
    for array in ["time", "time_bnds", "sst"] {
        own.edit(&format!("{array}/zarr.json"), |it| {
            it["shape"][0] = json!(1);
        });
    }
    std::fs::remove_file(own.path().join("time/c/0")).unwrap();
    let attached = own.attach().await.unwrap();
    assert_eq!(attached.steps, 1);
    let told = "time: its one value is not there and is taken for the fill value, 0";
    assert!(
        attached.assumptions.iter().any(|own| own.contains(told)),
        "{:?}",
        attached.assumptions
    );
}

#[tokio::test]
async fn a_group_without_arrays_says_which_groups_it_has() {
    for (name, document, content) in [
        (
            "v3-gzip.zarr",
            "zarr.json",
            json!({"zarr_format": 3, "node_type": "group"}),
        ),
        ("v2-plain.zarr", ".zgroup", json!({"zarr_format": 2})),
    ] {
        let own = Own::new();
        copy(&fixture(name), &own.path().join("ocean"));
        std::fs::write(own.path().join(document), content.to_string()).unwrap();
        let error = own.attach().await.unwrap_err();
        let inner = own.path().join("ocean");
        for part in [
            "no array \"sst\"",
            "groups (ocean)",
            inner.to_str().unwrap(),
        ] {
            assert!(error.contains(part), "{part}: {error}");
        }
        let mut request = own.request();
        request.address = inner.to_str().unwrap().to_owned();
        own.ask(&request).await.unwrap();
    }
}

/// 288 and -999.5 in half precision.
const HALVES: [u16; 2] = [0x5c80, 0xe3cf];

#[tokio::test]
async fn values_of_half_precision_are_read_and_what_is_no_number_is_refused_by_its_type() {
    let own = Own::with("v2-plain.zarr");
    own.edit("sst/.zarray", |it| it["dtype"] = json!("<f2"));
    // In the digits of an attribute, and not in those that are stored.
    own.edit("sst/.zattrs", |it| it["_FillValue"] = json!(-999.6));
    for step in 0..3 {
        let mut cells = [HALVES[0]; 48];
        cells[0] = HALVES[1];
        let bytes: Vec<u8> = cells.iter().flat_map(|cell| cell.to_le_bytes()).collect();
        std::fs::write(own.path().join(format!("sst/{step}.0.0")), bytes).unwrap();
    }
    let attached = own.attach().await.unwrap();
    assert!(attached.masked.is_none(), "{attached:?}");
    let newest = own.newest().await;
    let values = own.values(&newest, 1).await.unwrap();
    assert_eq!(values.iter().filter(|value| value.is_nan()).count(), 1);
    let is_288 = |value: &f32| value.is_nan() || value.to_bits() == 288f32.to_bits();
    assert!(values.iter().all(is_288), "{values:?}");
    let own = Own::with("v3-gzip.zarr");
    own.edit("sst/zarr.json", |it| {
        it["data_type"] = json!("complex64");
        it["fill_value"] = json!([0.0, 0.0]);
    });
    let error = own.attach().await.unwrap_err();
    assert!(
        error.contains("array sst") && error.contains("\"complex64\""),
        "{error}"
    );
}

#[tokio::test]
async fn of_other_dimensions_one_index_is_read() {
    let own = Own::with("v2-plain.zarr");
    own.edit("sst/.zarray", |it| {
        it["shape"] = json!([3, 1, 6, 8]);
        it["chunks"] = json!([1, 1, 6, 8]);
    });
    own.edit("sst/.zattrs", |it| {
        it["_ARRAY_DIMENSIONS"] = json!(["time", "depth", "lat", "lon"]);
    });
    for step in 0..3 {
        let from = own.path().join(format!("sst/{step}.0.0"));
        std::fs::rename(from, own.path().join(format!("sst/{step}.0.0.0"))).unwrap();
    }
    // Two depths, of which the second is not there.
    own.edit("sst/.zarray", |it| it["shape"] = json!([3, 2, 6, 8]));
    let error = own.attach().await.unwrap_err();
    assert!(
        error.contains("2 levels along dimension \"depth\"")
            && error.contains("--index depth=N (0 to 1)"),
        "{error}"
    );
    let mut request = own.request();
    request.indexes = vec![("depth".to_owned(), 2)];
    let error = own.ask(&request).await.unwrap_err();
    assert!(
        error.contains("depth") && error.contains("indexes 0 to 1"),
        "{error}"
    );
    request.indexes = vec![("deep".to_owned(), 0)];
    let error = own.ask(&request).await.unwrap_err();
    assert!(
        error.contains("deep") && error.contains("no dimension"),
        "{error}"
    );
    request.indexes = vec![("depth".to_owned(), 0), ("depth".to_owned(), 1)];
    let error = own.ask(&request).await.unwrap_err();
    assert!(
        error.contains("\"depth=1\"") && error.contains("one index of each dimension"),
        "{error}"
    );
    request.indexes = vec![("depth".to_owned(), 0)];
    own.ask(&request).await.unwrap();
    let newest = own.newest().await;
    let values = own.values(&newest, 2).await.unwrap();
    assert_same(&values, &expected("v2-plain.zarr")[2], "depth 0");
}

#[tokio::test]
async fn a_product_that_was_landed_is_not_attached_over() {
    let own = Own::with("v2-plain.zarr");
    let place = Place {
        store: own.store.clone(),
        ..Place::new()
    };
    let file = place.path("a.nc");
    SmallFile::new().write_classic(&file);
    place.land(&[file]).await;
    let request = Request {
        product: Some("fgco2".parse().unwrap()),
        ..own.request()
    };
    let error = own.ask(&request).await.unwrap_err();
    assert!(error.contains("landed or computed here"), "{error}");
    let product = "fgco2".parse().unwrap();
    let error = refresh(&own.store, &product, &|_, _| ()).await.unwrap_err();
    assert!(
        error.to_string().contains("nothing of it is attached"),
        "{error}"
    );
    let error = own.ask(&request_of_nothing()).await.unwrap_err();
    assert!(error.contains("no such folder"), "{error}");
    assert!(!Path::new("/nowhere/at/all").exists());
}

fn request_of_nothing() -> Request {
    request("/nowhere/at/all", "sst")
}

#[tokio::test]
async fn clean_up_and_checks_know_references() {
    let own = Own::with("v2-plain.zarr");
    own.attach().await.unwrap();
    let newest = own.newest().await;
    let keys = storage::verify::keys(&own.store, None).await.unwrap();
    let report = storage::verify::run(&own.store, &keys, &|_, _| ())
        .await
        .unwrap();
    assert_eq!(report.findings, []);
    std::fs::copy(own.path().join("sst/0.0.0"), own.path().join("sst/1.0.0")).unwrap();
    let later = readable(&own.store.bare());
    let report = storage::verify::run(&later, &keys, &|_, _| ())
        .await
        .unwrap();
    let found: Vec<_> = report.findings.iter().map(|finding| &finding.key).collect();
    assert_eq!(found, [&newest.steps[1].field]);
    assert!(
        report.findings[0].reason.contains("has changed"),
        "{report:?}"
    );
    assert_eq!(Digest::of(b"").to_string().len(), 64);
}

/// What one store holds says nothing of another that is to hold the same.
#[tokio::test]
async fn a_store_that_is_damaged_is_not_vouched_for_by_another() {
    let own = Own::with("v2-plain.zarr");
    own.attach().await.unwrap();
    let twin = own.folder.path().join("twin.zarr");
    copy(&own.path(), &twin);
    let mut request = request(twin.to_str().unwrap(), "sst");
    request.product = Some("twin".parse().unwrap());
    own.ask(&request).await.unwrap();
    std::fs::remove_file(twin.join("sst/0.0.0")).unwrap();
    let changed = readable(&own.store.bare());
    let newest = async |product: &str| {
        let product = product.parse().unwrap();
        let newest = storage::manifests::latest(&changed, &product).await;
        newest.unwrap().unwrap()
    };
    let (first, second) = (newest("sst").await, newest("twin").await);
    let read = |of: Manifest| {
        let changed = changed.clone();
        async move { fields::read(&changed, &of.steps[0].field, &of.grid).await }
    };
    read(first).await.unwrap();
    let error = read(second).await.unwrap_err().to_string();
    assert!(error.contains("twin.zarr"), "{error}");
}
