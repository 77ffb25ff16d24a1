//! Brokers leave themselves out of their own list: so answers the only broker of a cluster while it stops or starts. A
//! client that believes it has nobody left to ask, and would wait in silence for ever.

use std::collections::HashMap;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use storage::log::{EventLog as _, Follower, Start};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::tcp::{OwnedReadHalf, OwnedWriteHalf};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio::time::Instant;

use crate::events::{FROM, MOMENT, WAIT_LIMIT, finished, notice, paths};
use crate::own_topics::{end, open_on, servers};

/// Kafka's number of the request for metadata, and its first version with identities of topics; its lengths are variable.
const METADATA: u16 = 3;
const FIRST_COMPACT: u16 = 10;
/// Topics that nobody asked for, in an answer.
const UNKNOWN_TOPICS: u32 = 20_000;
/// How long nobody answers, and how long brokers are left out then: longer than a client takes to ask for them.
const AWAY: Duration = Duration::from_secs(3);
const LEFT_OUT: Duration = Duration::from_secs(6);

/// How much of an answer is searched, bytes.
const MOST_SEARCHED: usize = 4096;

/// Between clients and a broker. Clients take it for the broker.
struct Between {
    broker: String,
    port: u16,
    is_away: AtomicBool,
    leaves_out: AtomicBool,
    /// How many answers named no broker.
    left_out: std::sync::atomic::AtomicUsize,
    cut: watch::Sender<()>,
}

/// Requests under way in one connection: their versions by the number that the answer repeats.
type Asked = Arc<Mutex<HashMap<u32, u16>>>;

impl Between {
    async fn start(broker: String) -> Arc<Self> {
        let listener = TcpListener::bind("127.0.0.1:0").await.unwrap();
        let this = Arc::new(Self {
            broker,
            port: listener.local_addr().unwrap().port(),
            is_away: AtomicBool::new(false),
            leaves_out: AtomicBool::new(false),
            left_out: 0.into(),
            cut: watch::Sender::new(()),
        });
        let between = Arc::clone(&this);
        tokio::spawn(async move {
            while let Ok((client, _)) = listener.accept().await {
                let between = Arc::clone(&between);
                tokio::spawn(async move { between.carry(client).await });
            }
        });
        this
    }

    /// The broker is away, then there but in no list, then as before.
    async fn restart(&self) {
        self.is_away.store(true, Ordering::SeqCst);
        self.cut.send_replace(());
        tokio::time::sleep(AWAY).await;
        self.leaves_out.store(true, Ordering::SeqCst);
        self.is_away.store(false, Ordering::SeqCst);
        tokio::time::sleep(LEFT_OUT).await;
        self.leaves_out.store(false, Ordering::SeqCst);
        let count = self.left_out.load(Ordering::SeqCst);
        println!("{count} answers named no broker");
        assert!(count > 0, "nobody asked");
    }

    async fn carry(self: Arc<Self>, client: TcpStream) {
        let mut cut = self.cut.subscribe();
        if self.is_away.load(Ordering::SeqCst) {
            return;
        }
        let broker = TcpStream::connect(&self.broker).await.unwrap();
        let (from_client, to_client) = client.into_split();
        let (from_broker, to_broker) = broker.into_split();
        let asked = Asked::default();
        tokio::select! {
            () = requests(from_client, to_broker, &asked) => {}
            () = self.answers(from_broker, to_client, &asked) => {}
            _cut = cut.changed() => {}
        }
    }

    async fn answers(&self, mut from: OwnedReadHalf, mut to: OwnedWriteHalf, asked: &Asked) {
        while let Some(mut frame) = read_frame(&mut from).await {
            let number = u32::from_be_bytes(frame[..4].try_into().unwrap());
            let is_metadata = asked.lock().unwrap().remove(&number).is_some();
            if is_metadata && self.leaves_out.load(Ordering::SeqCst) {
                leave_out(&mut frame);
                self.left_out.fetch_add(1, Ordering::SeqCst);
            } else {
                self.stand_in(&mut frame);
            }
            if write_frame(&mut to, &frame).await.is_none() {
                return;
            }
        }
    }

    /// Wherever an answer says where the broker is, it is here.
    fn stand_in(&self, frame: &mut [u8]) {
        let (host, port) = self.broker.split_once(':').unwrap();
        let port: u32 = port.parse().unwrap();
        let address = [host.as_bytes(), &port.to_be_bytes()].concat();
        // An answer with messages in it says nothing of brokers.
        let last = frame.len().min(MOST_SEARCHED).saturating_sub(address.len());
        for at in 0..=last {
            if frame[at..].starts_with(&address) {
                let port_at = at + host.len();
                frame[port_at..port_at + 4].copy_from_slice(&u32::from(self.port).to_be_bytes());
            }
        }
    }
}

/// Takes the only broker out of an answer.
fn leave_out(frame: &mut Vec<u8>) {
    // Number of the request, no tags, throttle; then one more than the count of brokers.
    const COUNT_AT: usize = 4 + 1 + 4;
    assert_eq!(frame[COUNT_AT], 2, "one broker");
    let host_at = COUNT_AT + 1 + 4;
    let rack_at = host_at + usize::from(frame[host_at]) + 4;
    let end = rack_at + usize::from(frame[rack_at]).max(1) + 1;
    frame[COUNT_AT] = 1;
    frame.drain(COUNT_AT + 1..end);
    make_slow(frame, COUNT_AT + 1);
}

/// Puts unknown topics into an answer, so that its reader is still busy with it when the last broker has gone. The
/// library then takes back that it wanted to begin anew.
fn make_slow(frame: &mut Vec<u8>, cluster_at: usize) {
    let count_at = cluster_at + usize::from(frame[cluster_at]).max(1) + 4;
    let count = u32::from(frame[count_at]) - 1;
    assert!(count < 64, "one byte");
    // An error, a name, an identity, not internal, no partitions, no rights, no tags.
    let mut topics = compact_length(count + UNKNOWN_TOPICS);
    for number in 0..UNKNOWN_TOPICS {
        let name = format!("unknown-{number}");
        topics.extend(3_u16.to_be_bytes());
        topics.extend(compact_length(name.len() as u32));
        topics.extend(name.as_bytes());
        topics.extend(u128::from(number + 1).to_be_bytes());
        topics.extend([0, 1]);
        topics.extend(i32::MIN.to_be_bytes());
        topics.push(0);
    }
    frame.splice(count_at..=count_at, topics);
}

/// One more than a length, as a number of variable length.
fn compact_length(length: u32) -> Vec<u8> {
    let (mut rest, mut bytes) = (length + 1, vec![]);
    while rest >= 0x80 {
        bytes.push(rest as u8 | 0x80);
        rest >>= 7;
    }
    bytes.push(rest as u8);
    bytes
}

async fn requests(mut from: OwnedReadHalf, mut to: OwnedWriteHalf, asked: &Asked) {
    while let Some(frame) = read_frame(&mut from).await {
        let word = |at: usize| u16::from_be_bytes([frame[at], frame[at + 1]]);
        if word(0) == METADATA {
            assert!(word(2) >= FIRST_COMPACT, "version {}", word(2));
            let number = u32::from_be_bytes(frame[4..8].try_into().unwrap());
            asked.lock().unwrap().insert(number, word(2));
        }
        if write_frame(&mut to, &frame).await.is_none() {
            return;
        }
    }
}

async fn read_frame(from: &mut OwnedReadHalf) -> Option<Vec<u8>> {
    let bytes = from.read_u32().await.ok()?;
    let mut frame = vec![0; bytes as usize];
    from.read_exact(&mut frame).await.ok()?;
    Some(frame)
}

async fn write_frame(to: &mut OwnedWriteHalf, frame: &[u8]) -> Option<()> {
    to.write_u32(frame.len() as u32).await.ok()?;
    to.write_all(frame).await.ok()
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_client_that_was_told_of_no_brokers_finds_them_again() {
    let between = Between::start(servers()).await;
    let own = open_on(&format!("127.0.0.1:{}", between.port)).await;
    let log = &own.log;
    let mut follower = log.follow(FROM, Start::Now).await.unwrap();
    let mut reader = log.join(FROM, "g").await.unwrap();
    log.append(&[notice("before")]).await.unwrap();
    assert_eq!(followed(&mut *follower).await, ["before"]);
    let before = crate::events::read(&mut *reader, 1).await;
    reader.finish(vec![finished(&before[0])]).await.unwrap();

    between.restart().await;
    // Appended by somebody who was never cut off.
    let until = Instant::now() + WAIT_LIMIT;
    let mut settings = own.settings.clone();
    settings.kafka = Some(servers());
    let other = kafka_log::KafkaLog::connect(&settings).await.unwrap();
    other.append(&[notice("after")]).await.unwrap();
    assert_eq!(followed(&mut *follower).await, ["after"]);
    // As every service does: a reader's error is its end, another one joins.
    let read = loop {
        assert!(Instant::now() < until, "the reader waits in silence");
        match reader.next(1, MOMENT).await {
            Ok(messages) if messages.is_empty() => {}
            Ok(messages) => break messages,
            Err(error) => {
                println!("reader: {error}");
                reader = log.join(FROM, "g").await.unwrap();
            }
        }
    };
    assert_eq!(paths(&read), ["after"]);
    while let Err(error) = log.ready().await {
        assert!(Instant::now() < until, "never ready: {error}");
    }
    while let Err(error) = log.append(&[notice("again")]).await {
        println!("append: {error}");
        assert!(Instant::now() < until, "never appended: {error}");
    }
    reader.leave().await.unwrap();
    end(own).await;
}

async fn followed(follower: &mut dyn Follower) -> Vec<String> {
    let until = Instant::now() + WAIT_LIMIT;
    loop {
        assert!(Instant::now() < until, "the follower waits in silence");
        match follower.next(10, MOMENT).await {
            Ok(messages) if messages.is_empty() => {}
            Ok(messages) => return paths(&messages),
            Err(error) => println!("follower: {error}"),
        }
    }
}
