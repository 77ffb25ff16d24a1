//! Cubes that follow the versions of a product: exactly what differs is put, older ones change nothing, and whoever is
//! killed on the way leaves nothing that the next one cannot make good.

use std::future::{Future as _, poll_fn};
use std::pin::pin;
use std::sync::Arc;
use std::task::Poll;

use contract::digest::Digest;
use contract::grid::Grid;
use contract::key::ObjectKey;
use contract::manifest::{MANIFEST_SCHEMA, Manifest, Step};
use contract::quantity::Quantity;
use cube::{At, Cube, CubeError, Repository, follow};
use storage::{Store, fields};

use crate::product::{bits, grid, month, stores, values};

/// Months and the seeds of their values.
type Steps<'a> = &'a [(u32, u32)];

/// A version of a product whose fields are stored.
pub(crate) async fn version(store: &Store, grid: Grid, number: u64, steps: Steps<'_>) -> Manifest {
    let product = "p".parse().unwrap();
    let mut all = vec![];
    for (of, seed) in steps {
        let values = values(&grid, *seed);
        let field = fields::write(store, &product, &grid, &values, month(*of)).await;
        all.push(Step {
            period: month(*of),
            field: field.unwrap(),
            raw_sha256: Digest::of(b""),
            origin: "f.nc".to_owned(),
            valid_cells: 1,
            masked: None,
            contributed: None,
        });
    }
    Manifest {
        schema: MANIFEST_SCHEMA,
        number,
        title: format!("version {number}"),
        quantity: Quantity::CarbonFlux,
        synthetic: true,
        source: "a test".to_owned(),
        grid,
        steps: all,
        domain: ObjectKey::domain(&product, &Digest::of(b"")),
        series: vec![],
        derived_from: None,
        computed: None,
        notices: vec![],
        indexes: vec![],
        product,
    }
}

async fn cube(store: &Store, at: At) -> Cube {
    let repository = Repository::open(store, "cubes/p").await.unwrap();
    repository.at(&at).await.unwrap()
}

/// Is this state that version, with those values?
pub(crate) async fn holds(store: &Store, at: At, manifest: &Manifest, steps: Steps<'_>) {
    let cube = cube(store, at).await;
    assert_eq!(cube.description().version, Some(manifest.id()));
    assert_eq!(cube.description().title, manifest.title);
    assert_eq!(cube.steps().len(), steps.len());
    for (place, (of, seed)) in steps.iter().enumerate() {
        assert_eq!(cube.steps()[place].period, month(*of));
        let field = cube.field(place).await.unwrap();
        assert_eq!(bits(&field), bits(&values(&manifest.grid, *seed)), "{of}");
    }
}

async fn objects(store: &Store) -> usize {
    store.list("cubes").await.unwrap().len()
}

#[tokio::test]
async fn a_cube_has_the_steps_of_each_version_and_only_those_that_differ_are_put() {
    let (_folder, stores) = stores();
    for store in stores {
        let grid = grid(60, 90);
        let of: [Steps<'_>; 4] = [
            &[(1, 1), (2, 2), (4, 4)],
            // One revised, one before another.
            &[(1, 1), (2, 20), (3, 3), (4, 4)],
            // One dropped in the middle, and the last.
            &[(1, 1), (3, 3)],
            &[(1, 1), (3, 3), (5, 5)],
        ];
        let mut versions = vec![];
        for (at, (steps, put_count)) in of.iter().zip([3, 2, 0, 1]).enumerate() {
            let manifest = version(&store, grid, at as u64 + 1, steps).await;
            let followed = follow(&store, &manifest).await.unwrap();
            assert_eq!(followed.put_count, put_count, "version {}", at + 1);
            assert_eq!(followed.version, manifest.id());
            holds(&store, At::Newest, &manifest, steps).await;
            versions.push(manifest);
        }
        for (manifest, steps) in versions.iter().zip(of) {
            let tag = At::Version(manifest.number.to_string());
            holds(&store, tag, manifest, steps).await;
        }
        // Neither the same again nor an older one changes anything.
        let before = objects(&store).await;
        for manifest in versions.iter().rev() {
            let followed = follow(&store, manifest).await.unwrap();
            assert_eq!(
                (followed.put_count, &followed.version),
                (0, &versions[3].id())
            );
        }
        assert_eq!(objects(&store).await, before);
        holds(&store, At::Newest, &versions[3], of[3]).await;
        assert!(store.list("cubes/p/overwritten").await.unwrap().is_empty());
    }
}

#[tokio::test]
async fn another_grid_begins_anew_and_versions_of_before_keep_theirs() {
    let store = Store::memory();
    let steps: Steps<'_> = &[(1, 1), (2, 2)];
    let old = version(&store, grid(60, 90), 1, steps).await;
    let new = version(&store, grid(700, 800), 2, steps).await;
    follow(&store, &old).await.unwrap();
    assert_eq!(follow(&store, &new).await.unwrap().put_count, 2);
    holds(&store, At::Newest, &new, steps).await;
    holds(&store, At::Version("1".to_owned()), &old, steps).await;
}

#[tokio::test]
async fn another_version_of_the_same_number_is_an_error_and_changes_nothing() {
    let store = Store::memory();
    let mine = version(&store, grid(20, 30), 1, &[(1, 1)]).await;
    let other = version(&store, grid(20, 30), 1, &[(1, 2)]).await;
    follow(&store, &mine).await.unwrap();
    let error = follow(&store, &other).await.unwrap_err();
    assert!(matches!(error, CubeError::Foreign { .. }), "{error}");
    holds(&store, At::Newest, &mine, &[(1, 1)]).await;
}

/// A follower that gets no further than to so many answers of the store, as if it were killed then; was it done?
async fn killed_after(answers: usize, store: &Store, manifest: &Manifest) -> bool {
    let mut following = pin!(follow(store, manifest));
    let mut count = 0;
    poll_fn(|context| {
        if count == answers {
            return Poll::Ready(false);
        }
        count += 1;
        let polled = following.as_mut().poll(context);
        polled.map(|followed| followed.map(|_of| true).unwrap())
    })
    .await
}

#[tokio::test]
async fn a_follower_killed_anywhere_leaves_what_the_next_one_makes_good() {
    const ROUNDS: u32 = 50;
    let grid = grid(20, 30);
    let (first, second): (Steps<'_>, Steps<'_>) = (&[(1, 1)], &[(1, 10), (2, 2)]);
    let (mut answers, mut is_done) = (0, false);
    let mut untagged = 0;
    let mut rounds = 0;
    while !is_done || (untagged == 0 && rounds < ROUNDS) {
        if is_done {
            // Where exactly an answer finds it is chance: once more over the last ones.
            (answers, rounds) = (answers - 12, rounds + 1);
        }
        let folder = tempfile::tempdir().unwrap();
        let store = Store::open(folder.path().to_str().unwrap()).unwrap();
        let one = version(&store, grid, 1, first).await;
        let two = version(&store, grid, 2, second).await;
        is_done = killed_after(answers, &store, &one).await;
        if let Ok(repository) = Repository::open(&store, "cubes/p").await {
            let newest = repository.at(&At::Newest).await.unwrap();
            let versions = repository.versions().await.unwrap();
            let of = newest.description().version.clone().unwrap();
            if !versions.contains(&of.number.to_string()) {
                untagged += 1;
                // Named by the next one who comes with the same version, or with an older one.
                follow(&store, &one).await.unwrap();
                holds(&store, At::Version("1".to_owned()), &one, first).await;
            }
        }
        // Killed again over the same version, and then over the next one.
        killed_after(answers / 2, &store, &one).await;
        killed_after(answers, &store, &two).await;
        follow(&store, &two).await.unwrap();
        holds(&store, At::Newest, &two, second).await;
        holds(&store, At::Version("2".to_owned()), &two, second).await;
        let repository = Repository::open(&store, "cubes/p").await.unwrap();
        if repository
            .versions()
            .await
            .unwrap()
            .contains(&"1".to_owned())
        {
            holds(&store, At::Version("1".to_owned()), &one, first).await;
        }
        answers += 1;
    }
    assert!(answers > 20, "{answers}");
    assert!(untagged > 0, "nobody was killed between commit and tag");
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn of_followers_at_once_the_newest_version_stays() {
    const VERSIONS: u32 = 6;
    let (_folder, stores) = stores();
    for store in stores {
        let grid = grid(20, 30);
        let steps: Vec<Vec<(u32, u32)>> = (1..=VERSIONS)
            .map(|number| (1..=number).map(|of| (of, of + 100 * number)).collect())
            .collect();
        let mut versions = vec![];
        for (at, steps) in steps.iter().enumerate() {
            versions.push(version(&store, grid, at as u64 + 1, steps).await);
        }
        let versions = Arc::new(versions);
        let follower = |writer: usize| {
            let (store, versions) = (store.clone(), Arc::clone(&versions));
            async move {
                for turn in 0..versions.len() {
                    // Each in another order.
                    let at = (turn * (2 * writer + 1) + writer) % versions.len();
                    let followed = follow(&store, &versions[at]).await.unwrap();
                    assert!(followed.version.number >= versions[at].number);
                }
            }
        };
        let followers: Vec<_> = (0..4).map(|it| tokio::spawn(follower(it))).collect();
        for follower in followers {
            follower.await.unwrap();
        }
        let (newest, newest_steps) = (&versions[5], &steps[5]);
        holds(&store, At::Newest, newest, newest_steps).await;
        let repository = Repository::open(&store, "cubes/p").await.unwrap();
        for tag in repository.versions().await.unwrap() {
            let at = tag.parse::<usize>().unwrap() - 1;
            holds(&store, At::Version(tag), &versions[at], &steps[at]).await;
        }
    }
}

/// Bytes that one more step writes, when there are so many.
async fn bytes_of_a_step(count: u32) -> u64 {
    let store = Store::memory();
    let grid = grid(40, 60);
    let mut steps: Vec<(u32, u32)> = (1..=count).map(|of| (of, of)).collect();
    let before = version(&store, grid, 1, &steps).await;
    follow(&store, &before).await.unwrap();
    let bytes = async || {
        let objects = store.object_store();
        let listed = objects.list(Some(&"cubes".into()));
        let all: Vec<_> = futures::TryStreamExt::try_collect(listed).await.unwrap();
        all.iter().map(|meta| meta.size).sum::<u64>()
    };
    let there = bytes().await;
    steps.push((count + 1, count + 1));
    let next = version(&store, grid, 2, &steps).await;
    assert_eq!(follow(&store, &next).await.unwrap().put_count, 1);
    bytes().await - there
}

#[tokio::test]
async fn one_more_step_costs_the_same_however_many_there_are() {
    // Where the last chunks of times, of digests and of references are as full in both.
    let (few, many) = (bytes_of_a_step(10).await, bytes_of_a_step(1024 + 10).await);
    assert!(many < few + few / 4 + 4096, "{few} and {many} bytes");
}
