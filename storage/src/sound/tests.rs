//! One bit of a stored object flipped, whichever object and whichever bit: it is found, named and counted.

use super::*;
use crate::{Store, contributed, document, domain, fields, manifests, verify, weights};
use contract::grid::Grid;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, SeriesSegment, Step};
use contract::product::ProductId;
use contract::quantity::Quantity;
use contract::time::Period;

const GRID: Grid = Grid {
    rows: 3,
    cols: 5,
    north_deg: 3.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

/// An object of each kind, whoever writes it.
async fn store() -> Store {
    let store = Store::memory();
    let product: ProductId = "p".parse().unwrap();
    let values: Vec<f32> = (0..15)
        .map(|i| if i == 4 { f32::NAN } else { i as f32 })
        .collect();
    let raw = Bytes::from("an input file");
    let period = Period::month(2000, 1).unwrap();
    let raw_sha256 = Digest::of(&raw);
    let key = ObjectKey::raw(&product, &raw_sha256);
    store.put_new(&key, raw).await.unwrap();
    let field = fields::write(&store, &product, &GRID, &values, period).await;
    // As programs of before stored them: a sealed table that nobody reads.
    let series = ObjectKey::series(&product, &raw_sha256);
    let table = weights::encode(&[(0, vec![0.5; 15])]).unwrap();
    store.put_new(&series, table).await.unwrap();
    let manifest = Manifest {
        schema: MANIFEST_SCHEMA,
        product: product.clone(),
        number: 1,
        title: "t".to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: "s".to_owned(),
        grid: GRID,
        steps: vec![Step {
            period,
            field: field.unwrap(),
            raw_sha256,
            origin: "a.nc".to_owned(),
            valid_cells: 14,
            contributed: None,
            masked: None,
        }],
        domain: domain::write(&store, &product, &[true; 15]).await.unwrap(),
        series: vec![SeriesSegment {
            first_step: 0,
            steps: 1,
            series,
        }],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
    };
    manifests::commit(&store, &manifest).await.unwrap();
    put_others(&store, &product, raw_sha256, period).await;
    store
}

/// The kinds that no manifest of an input's product names.
async fn put_others(store: &Store, product: &ProductId, raw_sha256: Digest, period: Period) {
    let areas = [(0, vec![1.5; 15])];
    weights::write(store, &ObjectKey::weights(&raw_sha256), &areas)
        .await
        .unwrap();
    let mut counts = contributed::Contributed::nothing(&GRID, period.start);
    counts.add(period, &[true; 15]);
    contributed::write(store, product, &GRID, &counts)
        .await
        .unwrap();
    let sums = format!("accumulating/{raw_sha256}.parquet");
    let table = weights::encode(&areas).unwrap();
    store.put_new(&sums.parse().unwrap(), table).await.unwrap();
    let rows = Bytes::from("rows of measurements");
    let key = ObjectKey::observations(product, &Digest::of(&rows));
    store.put_new(&key, rows).await.unwrap();
    let picture = Bytes::from_static(png::PIXEL);
    let key = ObjectKey::tile(&raw_sha256);
    store.put_new(&key, picture).await.unwrap();
    for name in [
        "sums/p/a.json",
        "observation-files/p/a",
        "readings/p/a",
        "checks/a.json",
        "observation-indexes/p/1.json",
        "manifest-pages/p/a.json",
        "pins/p/0000000001.json",
        "protocol/current.json",
    ] {
        let document = serde_json::json!({"schema": 2, "name": name});
        document::put_new(store, &name.parse().unwrap(), &document)
            .await
            .unwrap();
    }
    let chunk = [
        b"values".as_slice(),
        &crc32c::crc32c(b"values").to_le_bytes(),
    ]
    .concat();
    let metadata = super::cube::sealed("repo", b"compressed").unwrap();
    for (name, content) in [("chunks/A", chunk), ("repo", metadata)] {
        let key = format!("cubes/p/{name}").parse().unwrap();
        store.put_new(&key, content.into()).await.unwrap();
    }
    let note = format!("landings/p/{raw_sha256}-0-17");
    let origin = Bytes::from("granule.notice/0/17");
    store.put_new(&note.parse().unwrap(), origin).await.unwrap();
}

#[tokio::test]
async fn a_bit_flipped_in_any_object_is_found_named_and_counted() {
    let store = store().await;
    let keys = verify::keys(&store, None).await.unwrap();
    let kinds = keys.iter().map(|key| Kind::of(key).unwrap().folder());
    let kinds: std::collections::BTreeSet<&str> = kinds.collect();
    assert_eq!(kinds.len(), Kind::ALL.len(), "{kinds:?}");
    let sound = verify::run(&store, &keys, &|_, _| ()).await.unwrap();
    assert_eq!((sound.sound_count, sound.findings), (keys.len(), vec![]));
    for key in &keys {
        let whole = store.get(key).await.unwrap();
        let kind = Kind::of(key).unwrap();
        let before = damage::count(kind);
        for at in 0..whole.len() * 8 {
            let mut flipped = whole.to_vec();
            flipped[at / 8] ^= 1 << (at % 8);
            let error = of_object(key, &Bytes::from(flipped)).map(|_sound| ());
            let error = error.expect_err(&format!("{key}, bit {at}")).to_string();
            assert!(error.contains(key.as_str()), "bit {at}: {error}");
        }
        // Tests beside this one count, too.
        let counted = damage::count(kind) - before;
        assert!(counted >= whole.len() as u64 * 8, "{key}: {counted}");
    }
}

#[tokio::test]
async fn a_damaged_and_a_missing_object_are_findings_of_a_whole_store() {
    let store = store().await;
    let keys = verify::keys(&store, None).await.unwrap();
    let of = |kind| keys.iter().find(|key| Kind::of(key) == Some(kind)).unwrap();
    let (series, field) = (of(Kind::Series), of(Kind::Field));
    let mut flipped = store.get(series).await.unwrap().to_vec();
    flipped[9] ^= 1;
    let before = damage::count(Kind::Series);
    store.put_over(series, flipped.into()).await.unwrap();
    store.remove(field).await.unwrap();
    let keys = verify::keys(&store, Some(&"p".parse().unwrap()))
        .await
        .unwrap();
    let told = std::sync::Mutex::new(vec![]);
    let tell = |_, finding: Option<&verify::Finding>| told.lock().unwrap().extend(finding.cloned());
    let report = verify::run(&store, &keys, &tell).await.unwrap();
    let found: Vec<_> = report.findings.iter().map(|f| (&f.key, f.fault)).collect();
    assert_eq!(
        found,
        [
            (field, verify::Fault::Missing),
            (series, verify::Fault::Damaged)
        ]
    );
    assert_eq!(told.into_inner().unwrap().len(), 2);
    assert!(damage::count(Kind::Series) > before);
    let error = verify::sound(&store, series).await.unwrap_err().to_string();
    assert!(error.contains(series.as_str()), "{error}");
    let mend = verify::damaged(&store, keys).await.unwrap();
    assert_eq!(mend, [series.clone()].into());
}

#[tokio::test]
async fn documents_of_before_they_were_sealed_are_read_and_later_ones_are_not() {
    let store = Store::memory();
    let key: ObjectKey = "sums/p/a.json".parse().unwrap();
    let put = async |text: &'static str| {
        store.put_over(&key, Bytes::from(text)).await.unwrap();
        document::get::<serde_json::Value>(&store, &key).await
    };
    assert!(put(r#"{"schema":1,"a":1}"#).await.is_ok());
    let error = put(r#"{"schema":2,"a":1}"#).await.unwrap_err();
    assert!(error.to_string().contains("seal"), "{error}");
}
