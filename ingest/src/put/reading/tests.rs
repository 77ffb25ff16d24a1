//! Notes of readings as earlier versions wrote them (`storage/tests/frozen`).

use contract::masked::MaskedCells;
use contract::time::Period;
use test_data::frozen;

use super::*;
use crate::plan::recipe::Used;

const GRID: Grid = Grid {
    rows: 61,
    cols: 20,
    north_deg: 61.0,
    west_deg: 0.0,
    dlat_deg: 1.0,
    dlon_deg: 1.0,
};

fn product() -> ProductId {
    "fgco2".parse().unwrap()
}

/// A store with a copy of the frozen notes.
fn store(version: u32) -> (tempfile::TempDir, Store) {
    let folder = tempfile::tempdir().unwrap();
    frozen::copy(version, "objects/readings", &folder.path().join("readings"));
    let store = Store::open(folder.path().to_str().unwrap()).unwrap();
    (folder, store)
}

/// A note that says all that a note may say.
fn noted() -> Reading {
    let step = |month, valid_cells, masked| Step {
        period: Period::month(2001, month).unwrap(),
        field: ObjectKey::field(&product(), &Digest::of(&[month as u8])),
        raw_sha256: Digest::of(b"a file that nobody keeps"),
        origin: "frozen-flux.nc".to_owned(),
        valid_cells,
        masked: Some(masked),
        contributed: None,
    };
    let masked = MaskedCells {
        out_of_range: 1,
        poor_quality: 2,
        implausible: 3,
    };
    Reading {
        schema: 2,
        recipe: Recipe {
            decoder: 2,
            profile: Some(Used {
                name: "frozen".to_owned(),
                rules: Digest::of(b"what it says"),
            }),
            variable: None,
            indexes: vec![],
        },
        title: "Frozen flux".to_owned(),
        source: "made by a test".to_owned(),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        grid: GRID,
        steps: vec![step(1, 1109, masked), step(2, 1110, MaskedCells::default())],
        assumptions: vec!["stamps are starts of months".to_owned()],
    }
}

async fn the_one(store: &Store) -> (ObjectKey, Reading) {
    let keys = keys(store, &product()).await.unwrap();
    assert_eq!(keys.len(), 1);
    let reading = get(store, &keys[0]).await.unwrap().unwrap();
    (keys[0].clone(), reading)
}

#[tokio::test]
async fn frozen_notes_of_readings_say_what_they_said() {
    if let Some(folder) = frozen::to_freeze() {
        let objects = folder.join("objects");
        let store = Store::open(objects.to_str().unwrap()).unwrap();
        noted().put(&store, &product()).await.unwrap();
    }
    assert_eq!(SCHEMA, 2, "freeze a note of the new schema too");
    let (_folder, kept) = store(2);
    let now = Store::memory();
    noted().put(&now, &product()).await.unwrap();
    let (key, reading) = the_one(&kept).await;
    assert_eq!((&key, &reading), (&the_one(&now).await.0, &noted()));
    assert_eq!(raw_of(&key), Some(noted().steps[0].raw_sha256));
    // It is of this name because of what it was read by.
    let again = noted().put(&kept, &product()).await;
    assert!(again.is_ok(), "the same note is no conflict");
}

#[tokio::test]
async fn notes_of_version_1_are_read_and_those_of_programs_to_come_are_not() {
    let (_folder, kept) = store(1);
    let (key, reading) = the_one(&kept).await;
    assert_eq!((reading.schema, reading.recipe.decoder), (1, 1));
    assert_eq!(reading.recipe.profile, None);
    assert_eq!(
        (reading.title.as_str(), reading.grid),
        ("Frozen flux", GRID)
    );
    assert_eq!(reading.quantity, Quantity::CarbonFlux);
    let months = [1, 2].map(|month| Period::month(2001, month).unwrap());
    let periods = reading.steps.iter().map(|step| step.period);
    assert!(periods.eq(months));
    assert_eq!(raw_of(&key), Some(reading.steps[0].raw_sha256));
    assert!(reading.steps.iter().all(|step| step.masked.is_none()));
    let newer = Reading {
        schema: SCHEMA + 1,
        ..noted()
    };
    newer.put(&kept, &product()).await.unwrap();
    let mut found = 0;
    for key in keys(&kept, &product()).await.unwrap() {
        found += usize::from(get(&kept, &key).await.unwrap().is_some());
    }
    assert_eq!(found, 1);
}
