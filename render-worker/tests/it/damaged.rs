//! A bit flipped in what a picture is made of is an error that names it, never a picture; one in a picture itself is drawn
//! over.

use contract::key::ObjectKey;
use contract::kind::Kind;
use render::Backend;
use render_worker::desk::{Order, Origin};
use storage::Store;
use storage::sound::damage;

use crate::here::Here;
use crate::stored::{quick, two_months_in};
use crate::worker::{USUAL, Worker};

async fn flip(store: &Store, key: &ObjectKey, byte: usize) {
    let mut content = store.get(key).await.unwrap().to_vec();
    let byte = byte % content.len();
    content[byte] ^= 1 << (byte % 8);
    store.put_over(key, content.into()).await.unwrap();
}

#[tokio::test]
async fn a_flipped_bit_of_a_field_or_a_domain_is_no_picture() {
    let store = Store::memory();
    let job = quick(&two_months_in(&store).await, 1);
    let after = job.value.after.as_ref().unwrap();
    let named = [
        job.value.before.as_ref().unwrap(),
        &after.field,
        &job.value.domain,
    ];
    for key in named {
        let whole = store.get(key).await.unwrap();
        for byte in [5, 400, whole.len() / 2, whole.len() - 9] {
            flip(&store, key, byte).await;
            // One that has nothing in memory.
            let service = Here::new(store.clone(), Backend::Cpu);
            let error = service.draw(&job).await.unwrap_err().in_full();
            assert!(error.contains(key.as_str()), "byte {byte}: {error}");
            store.put_over(key, whole.clone()).await.unwrap();
        }
    }
    let service = Here::new(store, Backend::Cpu);
    assert!(service.draw(&job).await.is_ok());
}

#[tokio::test]
async fn a_flipped_bit_of_a_picture_is_drawn_over() {
    let store = Store::memory();
    let job = quick(&two_months_in(&store).await, 1);
    let worker = Worker::start(&store, 1, 4);
    let order = Order::on_demand(USUAL);
    let drawn = worker.desk.draw(&job, order).await.unwrap();
    assert_eq!(store.get(&job.key()).await.unwrap(), drawn.bytes);
    flip(&store, &job.key(), drawn.bytes.len() / 2).await;
    let before = damage::count(Kind::Tile);
    let again = worker.desk.draw(&job, order).await.unwrap();
    assert!(again.origin == Origin::Drawn && again.bytes == drawn.bytes);
    assert!(damage::count(Kind::Tile) > before);
    assert_eq!(store.get(&job.key()).await.unwrap(), drawn.bytes);
}
