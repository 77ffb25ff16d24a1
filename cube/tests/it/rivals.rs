//! Two writers of one cube: both are in it afterwards, and neither sends its values twice.

use std::time::Duration;

use contract::quantity::Quantity;
use cube::{At, CubeError, Edit, Repository};
use storage::Store;

use crate::product::{bits, description, grid, month, stores, values};

async fn chunks(store: &Store) -> usize {
    store.list("p/chunks").await.unwrap().len()
}

#[tokio::test]
async fn the_second_of_two_writers_is_laid_on_top_and_sends_no_values_anew() {
    let (_folder, stores) = stores();
    for store in stores {
        let description = description(Quantity::CarbonFlux, grid(60, 90));
        let grid = description.grid;
        let repository = Repository::create(&store, "p", &description).await.unwrap();
        let before = chunks(&store).await;
        let other = Repository::open(&store, "p").await.unwrap();
        let (mut one, mut two) = (
            Edit::begin(&repository).await.unwrap(),
            Edit::begin(&other).await.unwrap(),
        );
        // Both would be the first step; the second writer's lies before the first's.
        one.put(month(2), values(&grid, 2)).await.unwrap();
        two.put(month(1), values(&grid, 1)).await.unwrap();
        assert_eq!(one.commit("one").await.unwrap().steps, 1);
        assert_eq!(two.commit("two").await.unwrap().steps, 2);
        let cube = repository.at(&At::Newest).await.unwrap();
        for (place, number) in [(0, 1), (1, 2)] {
            assert_eq!(cube.steps()[place].period, month(number));
            let field = cube.field(place).await.unwrap();
            assert_eq!(bits(&field), bits(&values(&grid, number)));
        }
        // Digests and times of few steps are so small that they lie in the manifests.
        let made = chunks(&store).await - before;
        assert_eq!(made, 2, "a field of each");
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn four_writers_at_once_lose_no_step() {
    const WRITERS: u32 = 4;
    const EACH: u32 = 5;
    let (_folder, stores) = stores();
    for store in stores {
        let description = description(Quantity::CarbonFlux, grid(20, 30));
        let grid = description.grid;
        Repository::create(&store, "p", &description).await.unwrap();
        let writer = |number: u32| {
            let store = store.clone();
            async move {
                let repository = Repository::open(&store, "p").await.unwrap();
                let mut rebased = 0;
                for step in 0..EACH {
                    let number = 1 + number + step * WRITERS;
                    let mut edit = Edit::begin(&repository).await.unwrap();
                    edit.put(month(number), values(&grid, number))
                        .await
                        .unwrap();
                    rebased += edit.commit("a step").await.unwrap().rebased;
                }
                rebased
            }
        };
        let writers: Vec<_> = (0..WRITERS).map(|it| tokio::spawn(writer(it))).collect();
        let mut rebased = 0;
        for writer in writers {
            rebased += writer.await.unwrap();
        }
        assert!(rebased > 0, "they never met, so that nothing was shown");
        let repository = Repository::open(&store, "p").await.unwrap();
        let cube = repository.at(&At::Newest).await.unwrap();
        assert_eq!(cube.steps().len(), (WRITERS * EACH) as usize);
        for place in 0..cube.steps().len() {
            let number = place as u32 + 1;
            assert_eq!(cube.steps()[place].period, month(number));
            let field = cube.field(place).await.unwrap();
            assert_eq!(bits(&field), bits(&values(&grid, number)), "{number}");
        }
    }
}

#[tokio::test]
async fn a_rival_that_took_a_part_of_the_period_is_an_error_and_changes_nothing() {
    let store = Store::memory();
    let description = description(Quantity::CarbonFlux, grid(20, 30));
    let grid = description.grid;
    let repository = Repository::create(&store, "p", &description).await.unwrap();
    let (mut one, mut two) = (
        Edit::begin(&repository).await.unwrap(),
        Edit::begin(&repository).await.unwrap(),
    );
    one.put(month(1), values(&grid, 1)).await.unwrap();
    let half =
        contract::time::Period::new("2000-01-16".parse().unwrap(), "2000-02-16".parse().unwrap());
    two.put(half.unwrap(), values(&grid, 2)).await.unwrap();
    one.commit("one").await.unwrap();
    let refused = two.commit("two").await;
    assert!(
        matches!(refused, Err(CubeError::Overlap { .. })),
        "{refused:?}"
    );
    let cube = repository.at(&At::Newest).await.unwrap();
    assert_eq!(cube.steps().len(), 1);
}

/// Somebody asks for a version in the very moment in which it is named: it is there, or it is not.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_version_that_is_named_just_then_is_there_or_is_not() {
    const VERSIONS: u32 = 100;
    let store = Store::memory();
    let description = description(Quantity::CarbonFlux, grid(20, 30));
    let grid = description.grid;
    let repository = Repository::create(&store, "p", &description).await.unwrap();
    let mut edit = Edit::begin(&repository).await.unwrap();
    edit.put(month(1), values(&grid, 1)).await.unwrap();
    let snapshot = edit.commit("a step").await.unwrap().snapshot.unwrap();
    let asking = tokio::spawn(async move {
        let mut too_early = 0;
        for version in 1..=VERSIONS {
            let version = At::Version(version.to_string());
            loop {
                match repository.at(&version).await {
                    Ok(cube) => break assert_eq!(cube.steps().len(), 1),
                    Err(CubeError::NoVersion { .. }) => too_early += 1,
                    Err(error) => panic!("{error}"),
                }
            }
        }
        too_early
    });
    let naming = Repository::open(&store, "p").await.unwrap();
    for version in 1..=VERSIONS {
        tokio::time::sleep(Duration::from_millis(2)).await;
        naming.tag(&version.to_string(), &snapshot).await.unwrap();
    }
    assert!(asking.await.unwrap() > VERSIONS, "nobody asked too early");
}
