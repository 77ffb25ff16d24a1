//! What the store has to do with a picture, as it was ordered: looked for or not, kept or not, and other bytes there.

use contract::job::RenderJob;
use render_worker::desk::{Drawn, Order, Origin, Storing};
use storage::Store;

use crate::stored::{quick, two_months_in};
use crate::worker::Worker;

async fn drawn(worker: &Worker, job: &RenderJob, storing: Storing) -> Drawn {
    let order = Order::on_demand(storing);
    worker.desk.draw(job, order).await.unwrap()
}

/// For nobody who waits: it is stored before it is given out.
async fn drawn_ahead(worker: &Worker, job: &RenderJob) -> Drawn {
    let order = Order {
        storing: Storing::Keep,
        ..Order::batch()
    };
    worker.desk.draw(job, order).await.unwrap()
}

fn pictures(worker: &Worker, origin: &str) -> u64 {
    worker.metric(
        "fluxglobe_render_worker_pictures_total",
        &[("origin", origin)],
    )
}

#[tokio::test]
async fn a_picture_is_looked_for_and_kept_as_it_was_ordered() {
    let store = Store::memory();
    let job = quick(&two_months_in(&store).await, 1);
    let worker = Worker::start(&store, 1, 4);
    let aside = drawn(&worker, &job, Storing::Nothing).await;
    assert_eq!((aside.origin, aside.kept), (Origin::Drawn, false));
    assert!(!store.exists(&job.key()).await.unwrap());
    let kept = drawn(&worker, &job, Storing::Keep).await;
    assert_eq!((kept.origin, kept.kept), (Origin::Drawn, false));
    worker.desk.settled().await;
    assert_eq!(store.get(&job.key()).await.unwrap(), kept.bytes);
    assert_eq!(kept.bytes, aside.bytes);
    // It is there now: whoever looks finds it, whoever does not draws it again.
    let found = drawn(&worker, &job, Storing::LookUpAndKeep).await;
    assert_eq!((found.origin, found.kept), (Origin::Stored, true));
    let again = drawn_ahead(&worker, &job).await;
    assert_eq!((again.origin, again.kept), (Origin::Drawn, true));
    assert_eq!((found.bytes, again.bytes), (kept.bytes.clone(), kept.bytes));
    assert_eq!(
        (pictures(&worker, "drawn"), pictures(&worker, "stored")),
        (3, 1)
    );
}

#[tokio::test]
async fn a_picture_that_contradicts_the_store_is_counted_and_the_stored_one_is_given_to_who_does_not_wait()
 {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let (job, other) = (quick(&job, 1), quick(&job, 2));
    let worker = Worker::start(&store, 1, 4);
    // What another adapter drew under the same name.
    let theirs = drawn(&worker, &other, Storing::Nothing).await.bytes;
    store.put_new(&job.key(), theirs.clone()).await.unwrap();
    let given = drawn_ahead(&worker, &job).await;
    assert_eq!((given.origin, given.kept), (Origin::Stored, true));
    assert_eq!(given.bytes, theirs);
    assert_eq!(pictures(&worker, "conflict"), 1);
    // Who waits has it before the store is asked.
    let given = drawn(&worker, &job, Storing::Keep).await;
    assert_eq!((given.origin, given.kept), (Origin::Drawn, false));
    worker.desk.settled().await;
    assert_eq!(pictures(&worker, "conflict"), 2);
    assert_eq!(store.get(&job.key()).await.unwrap(), theirs);
    let aside = drawn(&worker, &job, Storing::Nothing).await;
    assert_ne!(aside.bytes, theirs);
}

#[tokio::test]
async fn whoever_joins_a_job_under_way_has_its_picture_kept_as_he_ordered() {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let worker = Worker::start(&store, 1, 4);
    for (number, storing) in [(1, Storing::Keep), (2, Storing::LookUpAndKeep)] {
        let job = quick(&job, number);
        let (aside, kept) = tokio::join!(
            drawn(&worker, &job, Storing::Nothing),
            drawn(&worker, &job, storing)
        );
        let count = pictures(&worker, "drawn");
        assert_eq!(count, u64::from(number), "both are one job: {storing:?}");
        assert_eq!((aside.origin, aside.kept), (Origin::Drawn, false));
        assert_eq!(kept.origin, Origin::Drawn);
        worker.desk.settled().await;
        assert_eq!(store.get(&job.key()).await.unwrap(), kept.bytes);
    }
    // Another one is there meanwhile: it is given to whoever has it kept before he has it, and to nobody else.
    let [job, other] = [3, 1].map(|number| quick(&job, number));
    let theirs = store.get(&other.key()).await.unwrap();
    store.put_new(&job.key(), theirs.clone()).await.unwrap();
    let (aside, given) = tokio::join!(
        drawn(&worker, &job, Storing::Nothing),
        drawn_ahead(&worker, &job)
    );
    assert_eq!(pictures(&worker, "drawn"), 3);
    assert_eq!((given.origin, given.kept), (Origin::Stored, true));
    assert!(given.bytes == theirs && aside.bytes != theirs);
}

#[tokio::test]
async fn whoever_joins_a_job_under_way_and_ordered_nothing_kept_leaves_the_store_as_it_is() {
    let store = Store::memory();
    let job = quick(&two_months_in(&store).await, 1);
    let worker = Worker::start(&store, 1, 4);
    let both = tokio::join!(
        drawn(&worker, &job, Storing::Nothing),
        drawn(&worker, &job, Storing::Nothing)
    );
    assert_eq!(pictures(&worker, "drawn"), 1, "both are one job");
    assert!(!both.0.kept && !both.1.kept);
    assert!(!store.exists(&job.key()).await.unwrap());
}
