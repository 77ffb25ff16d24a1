//! What pictures are drawn from, read from a store that takes its time: given up with those who wait, and shared by them.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use bytes::Bytes;
use contract::context::Relief;
use contract::job::RenderJob;
use contract::time_sample::TimeSample;
use render::Backend;
use render_worker::desk::{DeskError, Drawn, Order, Storing};
use render_worker::server::Settings;
use render_worker::wire::Version;
use storage::Store;
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::Notify;
use tokio::task::JoinHandle;

use crate::stored::{quick, two_months_in};
use crate::worker::{LIMIT, Worker, settings, until};

/// As much of S3 as readers use, over the objects of another store. Fields are held back while that is asked for.
struct SlowStore {
    objects: BTreeMap<String, Bytes>,
    holds: AtomicBool,
    go: Notify,
    /// Questions for fields that are not answered and whose asker has not hung up.
    held: AtomicUsize,
    /// Questions for fields.
    asked: AtomicUsize,
}

impl SlowStore {
    async fn over(store: &Store) -> (Arc<Self>, Store) {
        let mut objects = BTreeMap::new();
        for key in store.list("").await.unwrap() {
            objects.insert(key.to_string(), store.get(&key).await.unwrap());
        }
        let slow = Arc::new(Self {
            objects,
            holds: AtomicBool::new(true),
            go: Notify::new(),
            held: AtomicUsize::new(0),
            asked: AtomicUsize::new(0),
        });
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let endpoint = format!("http://{}", listener.local_addr().unwrap());
        let serving = Arc::clone(&slow);
        tokio::spawn(async move {
            while let Ok((connection, _)) = listener.accept().await {
                tokio::spawn(Arc::clone(&serving).serve(connection));
            }
        });
        let variables = [
            ("AWS_ENDPOINT", endpoint.as_str()),
            ("AWS_ACCESS_KEY_ID", "a"),
            ("AWS_SECRET_ACCESS_KEY", "a"),
            ("AWS_REGION", "us-east-1"),
            ("AWS_ALLOW_HTTP", "true"),
        ];
        let owned = variables.map(|(name, value)| (name.to_owned(), value.to_owned()));
        let mut settings = storage::store::Settings::from_variables(owned);
        // Nobody asks again because it takes long: who asks twice gave up once.
        settings.retry_limits.request = 4 * LIMIT;
        (slow, Store::open_with("s3://bucket", &settings).unwrap())
    }

    async fn serve(self: Arc<Self>, mut connection: TcpStream) {
        let mut head = vec![];
        loop {
            let mut bytes = [0; 4096];
            match connection.read(&mut bytes).await {
                Ok(0) | Err(_) => return,
                Ok(length) => head.extend_from_slice(&bytes[..length]),
            }
            if !head.ends_with(b"\r\n\r\n") {
                continue;
            }
            let text = String::from_utf8(std::mem::take(&mut head)).unwrap();
            let path = text.split(' ').nth(1).unwrap();
            let key = path.trim_start_matches("/bucket/");
            if key.starts_with("frames/") && !self.lets_through(&mut connection).await {
                return;
            }
            let (status, content) = match self.objects.get(key) {
                Some(content) => ("200 OK", content.clone()),
                None => ("404 Not Found", Bytes::new()),
            };
            let dated = "last-modified: Sat, 01 Jan 2000 00:00:00 GMT\r\netag: \"1\"";
            let answer = format!(
                "HTTP/1.1 {status}\r\n{dated}\r\ncontent-length: {}\r\n\r\n",
                content.len()
            );
            let answer = [answer.as_bytes(), &content].concat();
            if connection.write_all(&answer).await.is_err() {
                return;
            }
        }
    }

    /// Is a question for a field still one when it may be answered?
    async fn lets_through(&self, connection: &mut TcpStream) -> bool {
        self.asked.fetch_add(1, Ordering::SeqCst);
        let go = self.go.notified();
        if !self.holds.load(Ordering::SeqCst) {
            return true;
        }
        self.held.fetch_add(1, Ordering::SeqCst);
        let mut nothing = [0];
        let may_go = tokio::select! {
            () = go => true,
            _hung_up = connection.read(&mut nothing) => false,
        };
        self.held.fetch_sub(1, Ordering::SeqCst);
        may_go
    }

    fn held(&self) -> usize {
        self.held.load(Ordering::SeqCst)
    }

    fn asked(&self) -> usize {
        self.asked.load(Ordering::SeqCst)
    }

    fn release(&self) {
        self.holds.store(false, Ordering::SeqCst);
        self.go.notify_waiters();
    }
}

/// A worker that reads nothing ahead, over a slow store with two months of a product, and a job of it.
async fn slow_worker(draws_at_once: u8) -> (Arc<SlowStore>, Worker, RenderJob) {
    let store = Store::memory();
    let job = two_months_in(&store).await;
    let (slow, store) = SlowStore::over(&store).await;
    let settings = Settings {
        fields_ahead: 0,
        ..settings(draws_at_once, 4)
    };
    let worker = Worker::start_with(&store, &settings, Backend::Cpu, Version::own());
    (slow, worker, job)
}

/// Fields that a job names.
fn fields(job: &RenderJob) -> usize {
    let samples = [Some(&job.value), job.accumulated.as_ref()];
    let of = |sample: &TimeSample| {
        usize::from(sample.before.is_some()) + usize::from(sample.after.is_some())
    };
    samples.into_iter().flatten().map(of).sum()
}

fn ask(worker: &Worker, job: &RenderJob) -> JoinHandle<Result<Drawn, DeskError>> {
    let (desk, job) = (worker.desk.clone(), job.clone());
    tokio::spawn(async move { desk.draw(&job, Order::on_demand(Storing::Nothing)).await })
}

fn loads(worker: &Worker, outcome: &str) -> u64 {
    worker.metric(
        "fluxglobe_render_worker_requests_total",
        &[("operation", "load"), ("outcome", outcome)],
    )
}

#[tokio::test(flavor = "multi_thread")]
async fn what_all_have_given_up_is_not_read_on_and_its_turn_is_free_at_once() {
    let (slow, worker, job) = slow_worker(1).await;
    let (job, count) = (quick(&job, 1), fields(&job));
    assert!(count >= 2, "between two steps");
    let (one, other) = (ask(&worker, &job), ask(&worker, &job));
    until("all its fields are asked for", || slow.held() == count).await;
    let waiting = ask(&worker, &quick(&job, 2));
    worker
        .until("another waits for the turn", |w| {
            w.desk.condition().waiting_on_demand == 1
        })
        .await;
    one.abort();
    assert!(one.await.unwrap_err().is_cancelled());
    // Whoever would be given up with him had the time to.
    for _ in 0..100 {
        tokio::task::yield_now().await;
    }
    assert_eq!(slow.held(), count, "the other still waits for it");
    assert_eq!(loads(&worker, "dropped"), 0);
    other.abort();
    until("the store is asked for the next one's", || {
        slow.asked() == 2 * count && slow.held() == count
    })
    .await;
    assert_eq!(loads(&worker, "dropped"), 1);
    slow.release();
    waiting.await.unwrap().unwrap();
    assert_eq!(loads(&worker, "ok"), 1);
    assert_eq!(
        worker.metric("fluxglobe_render_worker_pictures_total", &[]),
        1
    );
}

#[tokio::test(flavor = "multi_thread")]
async fn fields_that_two_pictures_want_are_read_once_and_by_the_other_if_one_is_given_up() {
    let (slow, worker, job) = slow_worker(2).await;
    let count = fields(&job);
    let [first, second] = [1, 2].map(|number| quick(&job, number));
    let reads = ask(&worker, &first);
    until("the first reads", || slow.held() == count).await;
    let waits = ask(&worker, &second);
    let in_flight = "fluxglobe_render_worker_in_flight";
    worker
        .until("both are loaded", |w| {
            w.metric(in_flight, &[("operation", "load")]) == 2
        })
        .await;
    for _ in 0..100 {
        tokio::task::yield_now().await;
    }
    assert_eq!(slow.asked(), count, "nobody reads what is being read");
    reads.abort();
    until("the second reads in its place", || {
        slow.asked() == 2 * count && slow.held() == count
    })
    .await;
    let joins = ask(&worker, &quick(&job, 3));
    slow.release();
    waits.await.unwrap().unwrap();
    joins.await.unwrap().unwrap();
    assert_eq!(slow.asked(), 2 * count, "read once for both");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_relief_that_two_pictures_want_is_read_once() {
    let (slow, worker, job) = slow_worker(2).await;
    // A field of its own, whatever its values are.
    let field = job.value.before.clone().unwrap();
    let over = |number| RenderJob {
        relief: Some(Relief {
            field: field.clone(),
            grid: job.grid,
            exaggeration: 15.0,
        }),
        ..quick(&job, number)
    };
    let both = [1, 2].map(|number| ask(&worker, &over(number)));
    let in_flight = "fluxglobe_render_worker_in_flight";
    worker
        .until("both are loaded", |w| {
            w.metric(in_flight, &[("operation", "load")]) == 2
        })
        .await;
    let count = fields(&job) + 1;
    until("the relief is asked for", || slow.held() == count).await;
    for _ in 0..100 {
        tokio::task::yield_now().await;
    }
    slow.release();
    for one in both {
        one.await.unwrap().unwrap();
    }
    assert_eq!(slow.asked(), count);
}
