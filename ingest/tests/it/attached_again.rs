//! Products that are attached again: what is kept of the version before, what is read anew, and what is refused.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use contract::grid::Grid;
use contract::kind::Vouched;
use contract::manifest::Manifest;
use contract::quantity::Quantity;
use contract::time::Period;
use cube::{Description, Edit, Repository};
use ingest::attach::{Attached, Request, refresh};
use serde_json::{Value, json};
use storage::attached::{Attachment, Reference};
use storage::{Store, domain, fields, manifests};

use crate::attached::{Own, assert_same, copy, expected, readable, request};

const PLAIN: &str = "v2-plain.zarr";
const GRID: Grid = Grid {
    rows: 2,
    cols: 3,
    north_deg: 1.0,
    west_deg: 10.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// Longer than anything here takes, also on a busy machine.
const LIMIT: Duration = Duration::from_secs(30);

async fn again(own: &Own) -> Result<Attached, String> {
    let product = "sst".parse().unwrap();
    let attached = refresh(&own.store, &product, &|_, _| ()).await;
    attached.map_err(|e| e.to_string())
}

/// A cube of somebody else's in a folder.
struct Cube {
    own: Own,
    repository: Repository,
}

impl Cube {
    async fn of(quantity: Quantity, synthetic: bool) -> Self {
        let own = Own::new();
        let store = Store::open(own.path().to_str().unwrap()).unwrap();
        let description = Description {
            product: "theirs".parse().unwrap(),
            title: "Theirs".to_owned(),
            quantity,
            synthetic,
            source: "a test".to_owned(),
            grid: GRID,
            version: None,
            statistic: None,
        };
        let repository = Repository::create(&store, "cube", &description).await;
        Self {
            own,
            repository: repository.unwrap(),
        }
    }

    async fn put(&self, month: u32, values: [f32; 6]) {
        let mut edit = Edit::begin(&self.repository).await.unwrap();
        let period = Period::month(2000, month).unwrap();
        edit.put(period, Arc::from(values)).await.unwrap();
        edit.commit("a step").await.unwrap();
    }

    async fn attach(&self, variable: &str) -> Attached {
        let folder = self.own.path().join("cube");
        let request = Request {
            product: Some("sst".parse().unwrap()),
            ..request(folder.to_str().unwrap(), variable)
        };
        self.own.ask(&request).await.unwrap()
    }

    /// Values of all steps, read by somebody who has read nothing of them yet.
    async fn values(&self, version: &Manifest) -> Vec<Vec<f32>> {
        let fresh = readable(&self.own.store.bare());
        let mut all = vec![];
        for step in &version.steps {
            let values = fields::read(&fresh, &step.field, &GRID).await;
            all.push(values.unwrap());
        }
        all
    }
}

const FIRST: [f32; 6] = [281.0, f32::NAN, f32::NAN, 282.0, 283.0, f32::NAN];
const SECOND: [f32; 6] = [f32::NAN, 284.0, f32::NAN, 285.0, f32::NAN, f32::NAN];

#[tokio::test]
async fn cells_of_steps_that_are_kept_stay_in_the_domain() {
    let cube = Cube::of(Quantity::SeaSurfaceTemperature, false).await;
    cube.put(1, FIRST).await;
    cube.attach("sea_surface_temperature").await;
    cube.put(2, SECOND).await;
    let next = again(&cube.own).await.unwrap();
    assert_eq!((next.steps, next.read), (2, 1));
    let newest = cube.own.newest().await;
    assert!(!newest.synthetic);
    let cells = domain::read(&cube.own.store, &newest.domain).await.unwrap();
    assert_eq!(cells, [true, true, false, true, true, false]);
    let found = cube.values(&newest).await;
    assert_same(&found[0], &FIRST, "kept");
    assert_same(&found[1], &SECOND, "new");
}

#[tokio::test]
async fn a_synthetic_cube_stays_one_and_the_range_of_what_is_kept_counts() {
    let quantity = Quantity::open("river_dic", "mol m-2 s-1", "River DIC").unwrap();
    let cube = Cube::of(quantity, true).await;
    cube.put(1, [-3.0, 7.0, f32::NAN, 1.0, 2.0, 3.0]).await;
    cube.attach("river_dic").await;
    let range = async || {
        let newest = cube.own.newest().await;
        assert!(newest.synthetic);
        let Quantity::Open(open) = newest.quantity else {
            panic!("{:?}", newest.quantity)
        };
        open.words().range
    };
    assert_eq!(range().await, Some([-3.0, 7.0]));
    cube.put(2, [0.5; 6]).await;
    assert_eq!(again(&cube.own).await.unwrap().read, 1);
    assert_eq!(range().await, Some([-3.0, 7.0]));
}

/// Publishes the newest version with another attachment or other references to it.
async fn tampered(
    own: &Own,
    reading: impl FnOnce(&mut Value),
    conversion: impl Fn(usize) -> [f64; 2],
) {
    let newest = own.newest().await;
    let store = own.store.bare();
    let first = &newest.steps[0];
    let before = store.attachment(&newest.product, &first.raw_sha256).await;
    let before = before.unwrap();
    let mut json = before.reading.clone();
    reading(&mut json);
    let place = (before.store.clone(), before.kind, before.snapshot.clone());
    let other = Attachment::new(newest.product.clone(), place, before.array.clone(), json);
    let name = store.put_attachment(&other).await.unwrap();
    let mut steps = newest.steps.clone();
    for (at, step) in steps.iter_mut().enumerate() {
        let own = (at as u64, step.period);
        let reference = Reference::new(name, own, [GRID.rows, GRID.cols], conversion(at));
        let Vouched::Values(digest) = step.field.vouches() else {
            panic!("it is named by its values")
        };
        let put = store.put_reference(&newest.product, &digest, &reference);
        put.await.unwrap();
        step.raw_sha256 = name;
    }
    let next = Manifest {
        number: newest.number + 1,
        steps,
        ..newest
    };
    manifests::commit(&store, &next).await.unwrap();
}

#[tokio::test]
async fn steps_that_were_read_otherwise_are_read_anew() {
    let cube = Cube::of(Quantity::SeaSurfaceTemperature, false).await;
    cube.put(1, FIRST).await;
    cube.put(2, SECOND).await;
    cube.attach("sea_surface_temperature").await;
    // As it is: nothing is read.
    tampered(&cube.own, |_same| (), |_| [1.0, 0.0]).await;
    assert_eq!(again(&cube.own).await.unwrap().read, 0);
    // In another unit: the step that is.
    let converted = |at| if at == 1 { [2.0, 0.0] } else { [1.0, 0.0] };
    tampered(&cube.own, |_same| (), converted).await;
    assert_eq!(again(&cube.own).await.unwrap().read, 1);
    // With another packing: all.
    let packed = |reading: &mut Value| {
        let scale = reading["packing"]["scale"].take();
        reading["packing"]["scale"] = reading["packing"]["offset"].take();
        reading["packing"]["offset"] = scale;
    };
    tampered(&cube.own, packed, |_| [1.0, 0.0]).await;
    assert_eq!(again(&cube.own).await.unwrap().read, 2);
    let newest = cube.own.newest().await;
    let found = cube.values(&newest).await;
    assert_same(&found[0], &FIRST, "first");
    assert_same(&found[1], &SECOND, "second");
}

#[tokio::test]
async fn a_version_of_which_some_fields_are_here_is_attached_all_the_same() {
    for landed in [0, 2] {
        let own = Own::with(PLAIN);
        own.attach().await.unwrap();
        let newest = own.newest().await;
        let field = &newest.steps[landed].field;
        let content = own.store.get(field).await.unwrap();
        own.store.bare().put_over(field, content).await.unwrap();
        let fresh = readable(&own.store.bare());
        let attached = fresh.attached_to(&newest).await.unwrap();
        assert_eq!(attached.unwrap().array, "sst", "step {landed}");
        assert_eq!(again(&own).await.unwrap().steps, 3);
    }
}

#[tokio::test]
async fn what_no_longer_fits_the_product_is_refused_and_the_version_stays() {
    type Change = fn(&Own);
    let smaller: Change = |own| {
        own.edit("sst/.zarray", |it| it["shape"] = json!([3, 5, 8]));
        own.edit("lat/.zarray", |it| it["shape"] = json!([5]));
    };
    let other: Change = |own| {
        own.edit("sst/.zattrs", |it| {
            it["standard_name"] = json!("air_temperature");
        });
    };
    for (change, said) in [
        (smaller, "lies on another grid"),
        (other, "holds another quantity"),
    ] {
        let own = Own::with(PLAIN);
        own.attach().await.unwrap();
        let before = own.newest().await;
        change(&own);
        let error = again(&own).await.unwrap_err();
        assert!(error.contains(said), "{error}");
        assert_eq!(own.newest().await, before);
    }
}

/// A profile in a file beside the store.
fn profile(own: &Own, more: &str) -> PathBuf {
    let path = own.path().with_file_name("mine.toml");
    let text = format!(
        "name = \"mine\"\nproduct = \"sst\"\ntitle = \"Mine\"\nsource = \"me\"\nquantity = \"sea_surface_temperature\"\n\
         [variable]\nname = \"sst\"\nunit = \"K\"\n{more}"
    );
    std::fs::write(&path, text).unwrap();
    path
}

fn by_profile(own: &Own, profile: &Path) -> Request {
    Request {
        profile: Some(profile.to_str().unwrap().to_owned()),
        variable: None,
        ..request(own.path().to_str().unwrap(), "sst")
    }
}

#[tokio::test]
async fn the_profile_is_asked_again_and_a_layer_of_quality_is_refused() {
    let own = Own::with(PLAIN);
    own.edit("sst/.zattrs", |it| {
        it.as_object_mut().unwrap().remove("units");
    });
    let error = own.attach().await.unwrap_err();
    assert!(error.contains("unit"), "{error}");
    let graded = profile(&own, "[quality]\nvariable = \"sst\"\nat_least = 280\n");
    let error = own.ask(&by_profile(&own, &graded)).await.unwrap_err();
    assert!(error.contains("[quality]"), "{error}");
    let plain = profile(&own, "");
    own.ask(&by_profile(&own, &plain)).await.unwrap();
    let newest = own.newest().await;
    assert_eq!(newest.title, "Mine");
    let next = again(&own).await.unwrap();
    assert_eq!((next.is_new, next.steps), (false, 3));
}

/// Two depths: those of the second come in the other order of time.
pub(crate) fn deep() -> Own {
    let own = Own::with(PLAIN);
    own.edit("sst/.zarray", |it| {
        it["shape"] = json!([3, 2, 6, 8]);
        it["chunks"] = json!([1, 1, 6, 8]);
    });
    own.edit("sst/.zattrs", |it| {
        it["_ARRAY_DIMENSIONS"] = json!(["time", "depth", "lat", "lon"]);
    });
    let path = |name: String| own.path().join("sst").join(name);
    for step in 0..3 {
        std::fs::copy(path(format!("{step}.0.0")), path(format!("{step}.0.0.0"))).unwrap();
        let turned = path(format!("{}.0.0", 2 - step));
        std::fs::copy(turned, path(format!("{step}.1.0.0"))).unwrap();
    }
    own
}

#[tokio::test]
async fn what_a_product_is_attached_to_is_replaced_only_where_that_is_said() {
    let own = deep();
    let of_depth = |address: &Path, variable: &str, depth: u64| Request {
        product: Some("sst".parse().unwrap()),
        indexes: vec![("depth".to_owned(), depth)],
        ..request(address.to_str().unwrap(), variable)
    };
    let here = own.path();
    own.ask(&of_depth(&here, "sst", 0)).await.unwrap();
    let before = own.newest().await;
    let moved = here.with_file_name("moved.zarr");
    copy(&here, &moved);
    copy(&here.join("sst"), &here.join("skin"));
    let was = format!("{} array sst --index depth=0", here.display());
    for (next, is) in [
        (
            of_depth(&moved, "sst", 0),
            format!("{} array sst --index depth=0", moved.display()),
        ),
        (
            of_depth(&here, "skin", 0),
            format!("{} array skin --index depth=0", here.display()),
        ),
        (
            of_depth(&here, "sst", 1),
            format!("{} array sst --index depth=1", here.display()),
        ),
    ] {
        let error = own.ask(&next).await.unwrap_err();
        for part in [&was[..], &is[..], "--product", "--replace"] {
            assert!(error.contains(part), "{part}: {error}");
        }
        assert_eq!(own.newest().await, before);
    }
    let replacing = Request {
        replace: true,
        ..of_depth(&moved, "sst", 0)
    };
    let attached = own.ask(&replacing).await.unwrap();
    assert_eq!((attached.is_new, attached.version.number), (true, 2));
    // From now on that is what it is attached to.
    std::fs::remove_dir_all(&here).unwrap();
    let next = again(&own).await.unwrap();
    assert_eq!((next.is_new, next.steps), (false, 3));
    assert_eq!(next.place, moved.display().to_string());
}

#[tokio::test]
async fn two_indexes_of_one_dimension_are_refused() {
    let own = deep();
    let request = Request {
        indexes: [0, 1].map(|depth| ("depth".to_owned(), depth)).to_vec(),
        ..request(own.path().to_str().unwrap(), "sst")
    };
    let error = own.ask(&request).await.unwrap_err();
    assert!(error.contains("one index of each dimension"), "{error}");
}

#[tokio::test]
async fn of_other_dimensions_the_same_index_is_read_again() {
    for depth in [0, 1] {
        let own = deep();
        let request = Request {
            indexes: vec![("depth".to_owned(), depth)],
            ..request(own.path().to_str().unwrap(), "sst")
        };
        own.ask(&request).await.unwrap();
        assert!(!again(&own).await.unwrap().is_new);
        let newest = own.newest().await;
        let fresh = readable(&own.store.bare());
        for (step, field) in newest.steps.iter().map(|step| &step.field).enumerate() {
            let values = fields::read(&fresh, field, &newest.grid).await.unwrap();
            let at = if depth == 0 { step } else { 2 - step };
            let what = format!("depth {depth}, step {step}");
            assert_same(&values, &expected(PLAIN)[at], &what);
        }
    }
}

/// Writes a value into a chunk that is stored as it is: rows from the south, columns from Greenwich.
fn write(own: &Own, step: usize, cell: usize, value: f32) {
    let path = own.path().join(format!("sst/{step}.0.0"));
    let mut chunk = std::fs::read(&path).unwrap();
    chunk[4 * cell..4 * cell + 4].copy_from_slice(&value.to_le_bytes());
    std::fs::write(path, chunk).unwrap();
}

#[tokio::test]
async fn a_step_without_values_is_none_and_the_domain_is_of_all_others() {
    let own = Own::with(PLAIN);
    for cell in 0..48 {
        write(&own, 1, cell, f32::NAN);
    }
    write(&own, 2, 20, f32::NAN);
    write(&own, 0, 21, f32::NAN);
    assert_eq!(own.attach().await.unwrap().steps, 2);
    let newest = own.newest().await;
    let periods: Vec<String> = newest
        .steps
        .iter()
        .map(|s| s.period.start.to_string())
        .collect();
    assert_eq!(periods, ["2020-01-01T00:00:00Z", "2020-01-03T00:00:00Z"]);
    let cells = domain::read(&own.store, &newest.domain).await.unwrap();
    let with_data = expected(PLAIN)[0]
        .iter()
        .map(|value| !value.is_nan())
        .collect::<Vec<_>>();
    assert_eq!(cells, with_data);
}

#[tokio::test]
async fn what_cannot_be_true_is_masked_when_it_is_attached_and_whenever_it_is_read() {
    let own = Own::with(PLAIN);
    // A cell of the second row from the south.
    write(&own, 0, 8 + 4, 1000.0);
    own.attach().await.unwrap();
    let newest = own.newest().await;
    assert_eq!(
        newest.steps[0].masked.map(|masked| masked.implausible),
        Some(1)
    );
    let mut wanted = expected(PLAIN).swap_remove(0);
    wanted[4 * 8] = f32::NAN;
    let fresh = readable(&own.store.bare());
    let values = fields::read(&fresh, &newest.steps[0].field, &newest.grid).await;
    assert_same(&values.unwrap(), &wanted, "masked");
}

#[tokio::test]
async fn a_valid_range_in_json_is_of_stored_numbers_unless_it_has_a_fraction() {
    for (highest, most_kelvin) in [(json!(1000), 288.15), (json!(15.5), 288.65)] {
        let own = Own::with("v2-blosc.zarr");
        own.edit(".zmetadata", |it| {
            it["metadata"]["sst/.zattrs"]["valid_max"] = highest.clone();
        });
        let told = own.attach().await.unwrap().assumptions;
        assert!(
            !told.iter().any(|line| line.contains("valid_max")),
            "{told:?}"
        );
        let newest = own.newest().await;
        let mut wanted = expected("v2-blosc.zarr").swap_remove(0);
        for value in &mut wanted {
            if *value > most_kelvin {
                *value = f32::NAN;
            }
        }
        assert!(wanted.iter().filter(|value| value.is_nan()).count() > 3);
        assert_same(
            &own.values(&newest, 0).await.unwrap(),
            &wanted,
            &highest.to_string(),
        );
    }
}

#[tokio::test]
async fn who_has_read_a_store_before_it_is_attached_anew_reads_what_is_there_now() {
    let own = Own::with(PLAIN);
    own.attach().await.unwrap();
    let before = own.newest().await;
    // A server keeps the store open, and what it has read of it.
    let server = readable(&own.store.bare());
    for step in &before.steps {
        let read = fields::read(&server, &step.field, &before.grid).await;
        read.unwrap();
    }
    let chunk = own.path().join("sst/1.0.0");
    let mut values = std::fs::read(&chunk).unwrap();
    for number in values.chunks_exact_mut(4) {
        let value = f32::from_le_bytes((&*number).try_into().unwrap());
        number.copy_from_slice(&(value + 0.5).to_le_bytes());
    }
    std::fs::write(&chunk, values).unwrap();
    again(&own).await.unwrap();
    let newest = own.newest().await;
    let field = &newest.steps[1].field;
    assert_ne!(*field, before.steps[1].field, "it has other values");
    // For a moment it takes what it has just read for what is there.
    let begun = Instant::now();
    let read = loop {
        match fields::read(&server, field, &newest.grid).await {
            Ok(values) => break values,
            Err(error) => assert!(begun.elapsed() < LIMIT, "{error}"),
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    let anew = readable(&own.store.bare());
    let there = fields::read(&anew, field, &newest.grid).await.unwrap();
    assert_same(&read, &there, "what is there now");
}
