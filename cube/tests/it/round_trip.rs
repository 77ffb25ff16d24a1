//! What is written is read again, bit for bit, from chunks and from shards.

use contract::chunk::Window;
use contract::quantity::Quantity;
use cube::{At, CubeError, Edit, Layout, Repository};
use storage::Store;

use crate::product::{bits, description, grid, month, stores, values};

#[tokio::test]
async fn fields_and_windows_are_those_that_were_put() {
    let (_folder, stores) = stores();
    for store in stores {
        let description = description(Quantity::CarbonFlux, grid(60, 90));
        let repository = Repository::create(&store, "cubes/p", &description)
            .await
            .unwrap();
        let mut edit = Edit::begin(&repository).await.unwrap();
        for number in 1..=3 {
            let put = edit
                .put(month(number), values(&description.grid, number))
                .await;
            assert_eq!(put.unwrap().period, month(number));
        }
        let committed = edit.commit("three months").await.unwrap();
        assert_eq!((committed.steps, committed.rebased), (3, 0));

        let repository = Repository::open(&store, "cubes/p").await.unwrap();
        let cube = repository.at(&At::Newest).await.unwrap();
        assert_eq!(cube.description(), &description);
        let periods: Vec<_> = cube.steps().iter().map(|step| step.period).collect();
        assert_eq!(periods, [month(1), month(2), month(3)]);
        for step in 0..3 {
            let field = cube.field(step).await.unwrap();
            let put = values(&description.grid, step as u32 + 1);
            assert_eq!(bits(&field), bits(&put), "step {step}");
        }
    }
}

#[tokio::test]
async fn a_window_across_chunks_holds_the_cells_of_the_field() {
    let grid = grid(700, 1500);
    let layout = Layout::of(&grid);
    assert_eq!((layout.chunk, layout.is_sharded()), ([350, 500], false));
    windows_agree(grid).await;
}

#[tokio::test]
async fn a_window_across_shards_holds_the_cells_of_the_field() {
    let grid = grid(4200, 4300);
    let layout = Layout::of(&grid);
    assert!(
        layout.is_sharded() && layout.objects(&grid) == [2, 2],
        "{layout:?}"
    );
    windows_agree(grid).await;
}

async fn windows_agree(grid: contract::grid::Grid) {
    let store = Store::memory();
    let description = description(Quantity::SeaSurfaceTemperature, grid);
    let repository = Repository::create(&store, "", &description).await.unwrap();
    let all = values(&grid, 5);
    let mut edit = Edit::begin(&repository).await.unwrap();
    edit.put(month(1), all.clone()).await.unwrap();
    edit.commit("one").await.unwrap();
    let cube = repository.at(&At::Newest).await.unwrap();
    let [chunk_rows, chunk_cols] = Layout::of(&grid).chunk;
    let windows = [
        (0, 0, 1, 1),
        (chunk_rows - 3, chunk_cols - 5, 7, 11),
        (grid.rows - 2, grid.cols - 3, 2, 3),
        (chunk_rows, 0, 1, grid.cols),
    ];
    for (row, col, rows, cols) in windows {
        let window = Window {
            row,
            col,
            rows,
            cols,
        };
        let put: Vec<f32> = window.cell_indices(&grid).map(|i| all[i]).collect();
        let read = cube.window(0, window).await.unwrap();
        assert_eq!(bits(&read), bits(&put), "{window:?}");
    }
    assert_eq!(bits(&cube.field(0).await.unwrap()), bits(&all));
    let outside = Window {
        row: grid.rows - 1,
        col: 0,
        rows: 2,
        cols: 1,
    };
    let refused = cube.window(0, outside).await;
    assert!(
        matches!(refused, Err(CubeError::Outside { .. })),
        "{refused:?}"
    );
}

#[tokio::test]
async fn a_step_is_replaced_inserted_and_left_alone_by_its_period() {
    let (_folder, stores) = stores();
    for store in stores {
        let description = description(Quantity::CarbonFlux, grid(20, 30));
        let grid = description.grid;
        let repository = Repository::create(&store, "p", &description).await.unwrap();
        let put = async |steps: &[(u32, u32)]| {
            let mut edit = Edit::begin(&repository).await.unwrap();
            for (number, seed) in steps {
                edit.put(month(*number), values(&grid, *seed))
                    .await
                    .unwrap();
            }
            edit.commit("steps").await.unwrap()
        };
        let first = put(&[(1, 1), (2, 2), (5, 5), (6, 6)]).await;
        repository.tag("1", &first.snapshot.unwrap()).await.unwrap();
        let second = put(&[(3, 3), (2, 22), (7, 7)]).await;
        assert_eq!(second.steps, 6);
        let same = put(&[(3, 3)]).await;
        assert_eq!((same.snapshot, same.steps), (None, 6));

        let expect = async |at: At, steps: &[(u32, u32)]| {
            let cube = repository.at(&at).await.unwrap();
            assert_eq!(cube.steps().len(), steps.len(), "{at:?}");
            for (place, (number, seed)) in steps.iter().enumerate() {
                assert_eq!(cube.steps()[place].period, month(*number), "{at:?}");
                let field = cube.field(place).await.unwrap();
                assert_eq!(
                    bits(&field),
                    bits(&values(&grid, *seed)),
                    "{at:?}, {number}"
                );
            }
        };
        let now = [(1, 1), (2, 22), (3, 3), (5, 5), (6, 6), (7, 7)];
        expect(At::Newest, &now).await;
        let version = At::Version("1".to_owned());
        expect(version, &[(1, 1), (2, 2), (5, 5), (6, 6)]).await;
        let Err(CubeError::NoVersion { there, .. }) =
            repository.at(&At::Version("2".to_owned())).await
        else {
            panic!("version 2 was never named");
        };
        assert_eq!(there, "1");
    }
}

#[tokio::test]
async fn sums_keep_their_steps_though_their_bounds_begin_with_the_first() {
    let store = Store::memory();
    let description = description(Quantity::AccumulatedCarbon, grid(4, 8));
    let repository = Repository::create(&store, "p", &description).await.unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    for number in 1..=3 {
        edit.put(month(number), values(&description.grid, number))
            .await
            .unwrap();
    }
    edit.commit("sums").await.unwrap();
    let cube = repository.at(&At::Newest).await.unwrap();
    let periods: Vec<_> = cube.steps().iter().map(|step| step.period).collect();
    assert_eq!(periods, [month(1), month(2), month(3)]);
}

#[tokio::test]
async fn a_step_without_any_data_is_no_object_and_reads_as_none() {
    let store = Store::memory();
    let description = description(Quantity::CarbonFlux, grid(20, 30));
    let repository = Repository::create(&store, "p", &description).await.unwrap();
    let put = async |values: std::sync::Arc<[f32]>| {
        let mut edit = Edit::begin(&repository).await.unwrap();
        edit.put(month(1), values).await.unwrap();
        edit.commit("one").await.unwrap();
        let cube = repository.at(&At::Newest).await.unwrap();
        cube.field(0).await.unwrap()
    };
    let some = put(values(&description.grid, 1)).await;
    assert!(some.iter().any(|value| !value.is_nan()));
    let none = put(vec![f32::NAN; 600].into()).await;
    assert!(none.iter().all(|value| value.is_nan()));
}

#[tokio::test]
async fn a_place_that_is_not_empty_or_not_there_is_refused() {
    let (_folder, stores) = stores();
    for store in stores {
        let description = description(Quantity::CarbonFlux, grid(4, 8));
        let missing = Repository::open(&store, "p")
            .await
            .map(|_it| ())
            .unwrap_err();
        assert!(matches!(missing, CubeError::Missing { .. }), "{missing}");
        Repository::create(&store, "p", &description).await.unwrap();
        let again = Repository::create(&store, "p", &description).await;
        let again = again.map(|_it| ()).unwrap_err();
        assert!(matches!(again, CubeError::Exists { .. }), "{again}");
        let plain =
            cube::PlainZarr::create(&store, "p", &description, cube::ZarrVersion::Three).await;
        assert!(matches!(plain.map(|_it| ()), Err(CubeError::Exists { .. })));
    }
}
