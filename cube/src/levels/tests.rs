//! Levels that are there and are nobody's: of other values, or of another layout.

use contract::chunk::Window;
use contract::grid::Grid;
use contract::quantity::Quantity;
use contract::time::Period;
use storage::Store;

use super::*;
use crate::{At, Edit, Repository};

/// A grid with one coarser level.
const GRID: Grid = Grid {
    rows: 2,
    cols: 600,
    north_deg: 1.0,
    west_deg: 0.0,
    dlat_deg: 0.5,
    dlon_deg: 0.5,
};
const WINDOW: Window = Window {
    row: 0,
    col: 0,
    rows: 1,
    cols: 150,
};

async fn put(repository: &Repository, month: u32) {
    let mut edit = Edit::begin(repository).await.unwrap();
    let values: Arc<[f32]> = vec![280.0 + month as f32; GRID.cell_count()].into();
    edit.put(Period::month(2000, month).unwrap(), values)
        .await
        .unwrap();
    edit.commit("a step").await.unwrap();
}

/// Does the array of what levels were made of refer to the digests of the steps themselves?
async fn shares_digests(repository: &Repository) -> bool {
    let session = repository.session().await.unwrap();
    let session = session.read().await;
    let first = ChunkIndices(vec![0, 0]);
    let [steps, levels] = ["values_sha256", "levels/steps_sha256"].map(|name| path(name).unwrap());
    let steps = session.get_chunk_ref(&steps, &first).await.unwrap();
    assert!(steps.is_some());
    steps == session.get_chunk_ref(&levels, &first).await.unwrap()
}

#[test]
fn levels_of_other_values_are_not_those_of_a_step() {
    let [own, other] = [b"a", b"b"].map(|bytes| Digest::of(bytes));
    let made_of = MadeOf {
        values_sha256: own,
        range: [1.0, 2.0],
    };
    let levels = Levels {
        made_of: vec![None, Some(made_of)],
        is_there: true,
        is_foreign: false,
    };
    let step = |values_sha256| Step {
        period: Period::month(2000, 1).unwrap(),
        values_sha256,
    };
    assert_eq!(levels.of(1, &step(own)), Some(made_of));
    assert_eq!(levels.of(1, &step(other)), None);
    assert_eq!(levels.of(0, &step(own)), None);
    assert_eq!(levels.of(2, &step(own)), None);
}

#[tokio::test]
async fn levels_of_another_layout_are_not_read_and_made_anew() {
    let store = Store::memory();
    let description = Description {
        product: "p".parse().unwrap(),
        title: "P".to_owned(),
        quantity: Quantity::SeaSurfaceTemperature,
        synthetic: true,
        source: "a test".to_owned(),
        grid: GRID,
        version: None,
        statistic: None,
    };
    let repository = Repository::create(&store, "p", &description).await.unwrap();
    put(&repository, 1).await;
    let cube = repository.at(&At::Newest).await.unwrap();
    assert!(cube.range_of(0).is_some());
    assert!(cube.window_at(1, WINDOW, 0).await.unwrap().is_some());
    assert!(shares_digests(&repository).await, "they are stored once");
    // Another program, which joins cells otherwise.
    let session = repository.session().await.unwrap();
    let mut session = session.write().await;
    let group = path(LEVELS).unwrap();
    let node = session.get_group(&group).await.unwrap();
    let mut other: Value = serde_json::from_slice(&node.user_data).unwrap();
    let layout = &mut other["attributes"][ATTRIBUTE]["layout"];
    assert_eq!(*layout, LAYOUT);
    *layout = (LAYOUT + 1).into();
    let other = other.to_string().into_bytes();
    session.update_group(&group, other.into()).await.unwrap();
    session.commit("another layout").execute().await.unwrap();
    drop(session);
    let cube = repository.at(&At::Newest).await.unwrap();
    assert!(cube.range_of(0).is_none());
    assert!(cube.window_at(1, WINDOW, 0).await.unwrap().is_none());
    put(&repository, 2).await;
    let cube = repository.at(&At::Newest).await.unwrap();
    let found = cube.window_at(1, WINDOW, 1).await.unwrap().unwrap();
    assert_eq!(found.values[0].to_bits(), 282f32.to_bits());
    // The first step has none.
    assert!(cube.window_at(1, WINDOW, 0).await.unwrap().is_none());
    assert!(!shares_digests(&repository).await);
}
