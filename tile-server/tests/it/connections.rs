//! Clients on real sockets that do not get on with it: heads a byte at a time, silence, too many at once.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use tile_server::{Server, Settings};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::task::JoinHandle;

use crate::app::TestApp;

const REQUEST: &str = "GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n";
/// Longer than anything here takes, also on a busy machine.
const LIMIT: Duration = Duration::from_secs(30);

struct Running {
    app: TestApp,
    address: SocketAddr,
    task: JoinHandle<()>,
}

impl Running {
    /// A server that wants a head within a second, and bytes every two.
    async fn new(change: impl FnOnce(&mut Settings)) -> Self {
        let app = TestApp::with(|settings| {
            settings.listen = "127.0.0.1:0".parse().unwrap();
            (settings.head_limit_s, settings.idle_limit_s) = (1, 2);
            settings.request_limit_s = 1;
            change(settings);
        })
        .await;
        let server = Server::bind(&app.state.settings, app.state.clone())
            .await
            .unwrap();
        let address = server.address();
        let task = tokio::spawn(async {
            server.run(std::future::pending()).await.unwrap();
        });
        Self { app, address, task }
    }

    async fn connect(&self) -> TcpStream {
        TcpStream::connect(self.address).await.unwrap()
    }

    async fn ended(&self, why: &str) -> u64 {
        let name = "fluxglobe_tile_server_connections_ended_total";
        self.app.metric(&format!(r#"{name}{{why="{why}"}}"#)).await
    }

    async fn open(&self) -> u64 {
        self.app
            .metric("fluxglobe_tile_server_connections_count")
            .await
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.task.abort();
    }
}

/// The next answer's head and body, as far as it comes at once.
async fn answer(connection: &mut TcpStream) -> String {
    let mut bytes = vec![0; 65_536];
    let read = tokio::time::timeout(LIMIT, connection.read(&mut bytes)).await;
    let length = read.expect("something comes").unwrap_or(0);
    String::from_utf8_lossy(&bytes[..length]).into_owned()
}

/// Sends text a byte at a time until the server hangs up or it is through; how long that took.
async fn trickle(connection: &mut TcpStream, text: &str, pause: Duration) -> Duration {
    let begun = Instant::now();
    for byte in text.bytes() {
        let mut answer = [0; 1024];
        let hung_up = match connection.try_read(&mut answer) {
            Ok(length) => length == 0,
            Err(error) => error.kind() != std::io::ErrorKind::WouldBlock,
        };
        if hung_up || connection.write_all(&[byte]).await.is_err() {
            break;
        }
        tokio::time::sleep(pause).await;
    }
    begun.elapsed()
}

#[tokio::test]
async fn a_head_that_comes_a_byte_at_a_time_ends_the_connection() {
    let server = Running::new(|_settings| {}).await;
    let endless = format!("GET / HTTP/1.1\r\nx: {}", "y".repeat(2000));
    let pause = Duration::from_millis(50);
    // The first request of a connection, one after an answer, one after empty lines, and one behind another.
    for before in [
        "",
        REQUEST,
        "\r\n\r\n\r\n",
        "GET /healthz HTTP/1.1\r\nHost: a\r\n\r\nG",
    ] {
        let mut slow = server.connect().await;
        slow.write_all(before.as_bytes()).await.unwrap();
        if before.starts_with("GET") {
            assert!(
                answer(&mut slow).await.starts_with("HTTP/1.1 200"),
                "{before:?}"
            );
        }
        let took = trickle(&mut slow, &endless, pause).await;
        assert!(
            took < Duration::from_secs(50),
            "{before:?}: {took:?} of 100 s"
        );
    }
    assert_eq!(
        server.ended("slow").await,
        4,
        "the limit, and nothing else, ended them"
    );
    // Whoever is quick enough is answered, also in pieces.
    let mut quick = server.connect().await;
    let took = trickle(&mut quick, REQUEST, Duration::from_millis(5)).await;
    assert!(
        answer(&mut quick).await.starts_with("HTTP/1.1 200"),
        "{took:?}"
    );
}

#[tokio::test]
async fn a_connection_on_which_nothing_moves_is_ended_and_a_slow_answer_is_not() {
    let server = Running::new(|settings| settings.request_limit_s = 4).await;
    let mut silent = server.connect().await;
    silent.write_all(REQUEST.as_bytes()).await.unwrap();
    assert!(answer(&mut silent).await.starts_with("HTTP/1.1 200"));
    let drawer = Arc::clone(&server.app.drawer);
    drawer.is_slow.store(true, Ordering::SeqCst);
    let mut waiting = server.connect().await;
    let tile = "GET /tiles/flux/map/0/0/0.png HTTP/1.1\r\nHost: a\r\n\r\n";
    waiting.write_all(tile.as_bytes()).await.unwrap();
    tokio::time::sleep(Duration::from_secs(3)).await;
    drawer.turns.add_permits(1);
    let drawn = answer(&mut waiting).await;
    assert!(
        drawn.starts_with("HTTP/1.1 200"),
        "3 s are more than the head may take: {drawn}"
    );
    assert_eq!(server.ended("slow").await, 0);
    // Nine seconds: five more than a request may take.
    assert_eq!(answer(&mut silent).await, "", "hung up");
    assert_eq!(server.ended("idle").await, 1);
}

#[tokio::test]
async fn an_answer_to_a_request_that_came_with_another_may_take_its_time() {
    let server = Running::new(|settings| settings.request_limit_s = 6).await;
    let drawer = Arc::clone(&server.app.drawer);
    drawer.is_slow.store(true, Ordering::SeqCst);
    let mut both = server.connect().await;
    let tile = "GET /tiles/flux/map/0/0/0.png HTTP/1.1\r\nHost: a\r\n\r\n";
    let together = format!("{REQUEST}{tile}");
    both.write_all(together.as_bytes()).await.unwrap();
    assert!(answer(&mut both).await.starts_with("HTTP/1.1 200"));
    tokio::time::sleep(Duration::from_secs(3)).await;
    drawer.turns.add_permits(1);
    let drawn = answer(&mut both).await;
    assert!(
        drawn.starts_with("HTTP/1.1 200"),
        "3 s are more than a head may take, and this one was there: {drawn}"
    );
    assert_eq!(server.ended("slow").await, 0);
}

#[tokio::test]
async fn those_beyond_the_limit_are_told_to_come_again_and_find_room_when_others_go() {
    let server = Running::new(|settings| settings.connections = 3).await;
    let mut inside = vec![];
    for _ in 0..3 {
        let mut connection = server.connect().await;
        connection.write_all(REQUEST.as_bytes()).await.unwrap();
        assert!(answer(&mut connection).await.starts_with("HTTP/1.1 200"));
        inside.push(connection);
    }
    assert_eq!(server.open().await, 3);
    for number in 1..=5 {
        let mut beyond = server.connect().await;
        beyond.write_all(REQUEST.as_bytes()).await.unwrap();
        let told = answer(&mut beyond).await;
        assert!(told.starts_with("HTTP/1.1 503"), "{told}");
        assert!(told.contains("\r\nretry-after: 1\r\n"), "{told}");
        let (_, body) = told.split_once("\r\n\r\n").unwrap();
        assert!(
            told.contains(&format!("content-length: {}\r\n", body.len())),
            "{told}"
        );
        assert!(
            serde_json::from_str::<serde_json::Value>(body).is_ok(),
            "{body}"
        );
        assert_eq!(server.ended("full").await, number);
    }
    drop(inside.pop());
    let begun = Instant::now();
    loop {
        let mut next = server.connect().await;
        next.write_all(REQUEST.as_bytes()).await.unwrap();
        if answer(&mut next).await.starts_with("HTTP/1.1 200") {
            break;
        }
        assert!(begun.elapsed() < LIMIT, "no room although one went");
    }
}

#[tokio::test]
async fn http2_in_the_clear_is_hung_up_on() {
    let server = Running::new(|_settings| {}).await;
    let mut connection = server.connect().await;
    let opening = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n\0\0\0\x04\0\0\0\0\0";
    connection.write_all(opening).await.unwrap();
    assert_eq!(answer(&mut connection).await, "");
    assert_eq!(server.ended("http2").await, 1);
}
