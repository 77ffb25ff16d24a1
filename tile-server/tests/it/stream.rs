//! Cameras that are followed over a WebSocket, and clients that do not behave.

use std::net::SocketAddr;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::http::StatusCode;
use contract::job::RenderJob;
use futures::{SinkExt as _, StreamExt as _};
use serde_json::{Value, json};
use tile_server::backend::{BackendError, Class};
use tile_server::{Server, Settings};
use tokio::net::TcpStream;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;
use tokio_tungstenite::tungstenite::protocol::CloseFrame;
use tokio_tungstenite::tungstenite::protocol::frame::Frame;
use tokio_tungstenite::tungstenite::protocol::frame::coding::{CloseCode, Data, OpCode};
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

use crate::app::TestApp;
use crate::doubles::{Drawer, Mood};

/// Longer than anything here takes, also on a busy machine.
const LIMIT: Duration = Duration::from_secs(30);
const VIEW: &str = "/globe/flux/volume.png?lon=10&lat=20&width=1600&height=800&tilt=30&heading=45";

struct Running {
    app: TestApp,
    address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    task: JoinHandle<()>,
}

impl Running {
    async fn new(change: impl FnOnce(&mut Settings)) -> Self {
        let app = TestApp::with(|settings| {
            settings.listen = "127.0.0.1:0".parse().unwrap();
            change(settings);
        })
        .await;
        let server = Server::bind(&app.state.settings, app.state.clone())
            .await
            .unwrap();
        let address = server.address();
        let (stop, stopped) = oneshot::channel();
        let task = tokio::spawn(async {
            let told = async { drop(stopped.await) };
            server.run(told).await.unwrap();
        });
        Self {
            app,
            address,
            stop: Some(stop),
            task,
        }
    }

    async fn try_connect(&self) -> Result<Camera, Error> {
        let (socket, _answer) = connect_async(format!("ws://{}/stream", self.address)).await?;
        Ok(Camera { socket })
    }

    async fn connect(&self) -> Camera {
        self.try_connect().await.unwrap()
    }

    async fn drawn_until(&self, count: usize) {
        let drawn = async {
            while self.app.drawer.drawn_count() < count {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        };
        let in_time = tokio::time::timeout(LIMIT, drawn).await;
        in_time.expect("pictures are drawn");
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        self.task.abort();
    }
}

struct Camera {
    socket: WebSocketStream<MaybeTlsStream<TcpStream>>,
}

/// What came.
#[derive(Debug)]
enum Came {
    Picture(Value, Bytes),
    Text(Value),
    Closed(u16, String),
}

impl Camera {
    async fn say(&mut self, text: impl ToString) {
        self.socket
            .send(Message::text(text.to_string()))
            .await
            .unwrap();
    }

    async fn look(&mut self, id: u64, view: &str) {
        self.say(json!({"id": id, "view": view})).await;
    }

    async fn next(&mut self) -> Came {
        let came = tokio::time::timeout(LIMIT, self.any()).await;
        came.expect("something comes")
    }

    async fn any(&mut self) -> Came {
        loop {
            match self.socket.next().await.expect("an end is told") {
                Ok(Message::Binary(bytes)) => {
                    let length = u32::from_be_bytes(bytes[..4].try_into().unwrap()) as usize;
                    let header = serde_json::from_slice(&bytes[4..4 + length]).unwrap();
                    return Came::Picture(header, bytes.slice(4 + length..));
                }
                Ok(Message::Text(text)) => return Came::Text(serde_json::from_str(&text).unwrap()),
                Ok(Message::Close(frame)) => {
                    let frame = frame.expect("a reason");
                    return Came::Closed(frame.code.into(), frame.reason.to_string());
                }
                Ok(_ping) => {}
                Err(error) => panic!("{error}"),
            }
        }
    }

    async fn picture(&mut self) -> (Value, Bytes) {
        match self.next().await {
            Came::Picture(header, bytes) => (header, bytes),
            other => panic!("{other:?}"),
        }
    }

    async fn full(&mut self) -> (Value, Bytes) {
        loop {
            let (header, bytes) = self.picture().await;
            if header["kind"] == "full" {
                return (header, bytes);
            }
        }
    }

    async fn error(&mut self) -> Value {
        loop {
            match self.next().await {
                Came::Text(text) => return text,
                Came::Picture(..) => {}
                closed @ Came::Closed(..) => panic!("{closed:?}"),
            }
        }
    }

    async fn closed(&mut self) -> (u16, String) {
        loop {
            if let Came::Closed(code, reason) = self.next().await {
                return (code, reason);
            }
        }
    }
}

#[tokio::test]
async fn a_camera_that_moves_is_drawn_quickly_and_one_that_rests_as_its_address_says() {
    let running = Running::new(|_usual| {}).await;
    let mut camera = running.connect().await;
    camera.look(7, VIEW).await;
    let (header, jpeg) = camera.picture().await;
    assert_eq!(header["kind"], "moving");
    assert_eq!(header["format"], "image/jpeg");
    assert_eq!((&header["id"], &header["view"]), (&json!(7), &json!(VIEW)));
    assert_eq!(header["full_width"], 1600);
    let [width, height] = ["width", "height"].map(|side| header[side].as_u64().unwrap());
    assert!(width < 1600 && width == 2 * height, "{header}");
    let quick = running.app.drawer.last_job();
    assert_eq!(jpeg, Drawer::jpeg_of(&quick));
    assert_eq!(quick.view.size_px().map(u64::from), [width, height]);

    let (header, png) = camera.full().await;
    assert_eq!((&header["id"], &header["width"]), (&json!(7), &json!(1600)));
    let by_http = running.app.get(VIEW).await;
    assert_eq!(png, by_http.body, "the same bytes as over HTTP");
    let full = running.app.drawer.last_job();
    let same_camera = RenderJob {
        view: full.view,
        style: full.style,
        ..quick
    };
    assert_eq!(same_camera, full);
    assert!(by_http.header("etag").contains(&full.digest().to_string()));
}

#[tokio::test]
async fn what_is_overtaken_is_not_drawn_and_numbers_only_rise() {
    let running = Running::new(|_usual| {}).await;
    let drawer = &running.app.drawer;
    drawer.is_slow.store(true, Ordering::SeqCst);
    let mut camera = running.connect().await;
    for id in 1..=1000 {
        camera.look(id, &format!("{VIEW}&roll={}", id % 100)).await;
    }
    running.drawn_until(2).await;
    drawer.is_slow.store(false, Ordering::SeqCst);
    drawer.turns.add_permits(100);
    let mut ids = vec![];
    loop {
        let (header, _bytes) = camera.picture().await;
        ids.push(header["id"].as_u64().unwrap());
        if header["kind"] == "full" {
            break;
        }
    }
    assert_eq!(ids.last(), Some(&1000));
    assert!(ids.is_sorted(), "{ids:?}");
    assert!(drawer.drawn_count() < 20, "{}", drawer.drawn_count());
    let stale = running
        .app
        .metric("fluxglobe_tile_server_stream_stale_total")
        .await;
    assert!(stale > 980, "{stale}");
}

#[tokio::test]
async fn nobody_who_does_not_look_is_drawn_for() {
    let running = Running::new(|_usual| {}).await;
    let mut camera = running.connect().await;
    camera.say(r#"{"seen": 0}"#).await;
    for id in 1..=50 {
        camera.look(id, &format!("{VIEW}&roll={id}")).await;
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    // Three that it has not seen, and what rests.
    let (header, _png) = camera.full().await;
    assert_eq!(header["id"], 50);
    let drawn = running.app.drawer.drawn_count();
    assert!(drawn <= 3 + 3 + 1, "{drawn}");
}

#[tokio::test]
async fn who_speaks_and_never_listens_is_cut_off() {
    let running = Running::new(|_usual| {}).await;
    // More than what lies between two sockets can hold.
    let padding_bytes = &running.app.drawer.padding_bytes;
    padding_bytes.store(16 << 20, Ordering::SeqCst);
    let mut deaf = running.connect().await;
    let ended = async |reason: &str| {
        let name = "fluxglobe_tile_server_stream_ended_total";
        running
            .app
            .metric(&format!(r#"{name}{{reason="{reason}"}}"#))
            .await
    };
    let begun = Instant::now();
    for id in 1.. {
        let state = json!({"id": id, "view": format!("{VIEW}&roll={}", id % 90)});
        // Nothing is read here; the server may have hung up.
        let said = deaf.socket.send(Message::text(state.to_string())).await;
        if said.is_err() || ended("slow").await > 0 {
            break;
        }
        assert!(begun.elapsed() < LIMIT, "who takes nothing is kept");
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    assert_eq!((ended("slow").await, ended("silent").await), (1, 0));
}

#[tokio::test]
async fn a_wrong_address_is_answered_and_the_stream_goes_on() {
    let running = Running::new(|_usual| {}).await;
    let mut camera = running.connect().await;
    for (id, view, status, word) in [
        (1, "/globe/flux/volume.png?lat=95", 400, "latitude"),
        (2, "/globe/flux/volume.png?width=9000", 400, "7680"),
        (3, "/globe/nothing/volume.png", 404, "nothing"),
        (4, "/globe/flux/volume.jpg", 404, "address"),
        (5, "/tiles/flux/map/0/0/0.png", 400, "/globe/"),
        (6, "http://[", 400, "address"),
        (
            7,
            "http://169.254.169.254/globe/flux/volume.png?lon=3",
            200,
            "",
        ),
    ] {
        camera.look(id, view).await;
        if status == 200 {
            // Only path and query of an address mean anything: nothing is fetched from anywhere.
            camera.full().await;
            continue;
        }
        let error = camera.error().await;
        assert_eq!(
            (&error["id"], &error["status"]),
            (&json!(id), &json!(status))
        );
        let text = error["error"].as_str().unwrap();
        assert!(text.contains(word), "{view}: {text}");
    }
    camera.look(8, VIEW).await;
    camera.full().await;
}

#[tokio::test]
async fn who_closes_is_answered_in_kind() {
    let running = Running::new(|_usual| {}).await;
    let mut camera = running.connect().await;
    camera.look(1, VIEW).await;
    camera.full().await;
    let why = CloseFrame {
        code: CloseCode::Normal,
        reason: "seen enough".into(),
    };
    camera.socket.close(Some(why)).await.unwrap();
    assert_eq!(camera.closed().await.0, 1000);
}

#[tokio::test]
async fn who_breaks_the_rules_is_told_why_and_others_are_served() {
    let running = Running::new(|_usual| {}).await;
    let mut good = running.connect().await;
    let long = format!(r#"{{"id": 1, "view": "{}"}}"#, "x".repeat(9000));
    let no_text = Frame::message(vec![0xFF, 0xFE], OpCode::Data(Data::Text), true);
    for (message, code, word) in [
        (Message::text("look left"), 1007, "neither"),
        (Message::text(r#"{"id": 1}"#), 1007, "neither"),
        (Message::binary(vec![0; 10]), 1003, "text"),
        (Message::text(long), 1009, "8 KiB"),
        (Message::Frame(no_text), 1007, "UTF-8"),
    ] {
        let mut bad = running.connect().await;
        bad.socket.send(message).await.unwrap();
        let (told, reason) = bad.closed().await;
        assert!(told == code && reason.contains(word), "{told} {reason}");
    }
    let mut twice = running.connect().await;
    twice.look(3, VIEW).await;
    twice.look(3, VIEW).await;
    let (code, reason) = twice.closed().await;
    assert!(code == 1007 && reason.contains("id 3"), "{code} {reason}");
    good.look(1, VIEW).await;
    good.full().await;
}

#[tokio::test]
async fn streams_beyond_the_limit_are_asked_to_come_again_and_places_are_given_back() {
    let running = Running::new(|settings| settings.streams = 2).await;
    let (first, _second) = (running.connect().await, running.connect().await);
    let Err(Error::Http(refused)) = running.try_connect().await else {
        panic!("a third stream");
    };
    assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert!(refused.headers().contains_key("retry-after"));
    drop(first);
    let begun = Instant::now();
    while running.try_connect().await.is_err() {
        assert!(begun.elapsed() < LIMIT, "the place is not given back");
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    let plain = running.app.get("/stream").await;
    assert_eq!(plain.status, StatusCode::UPGRADE_REQUIRED);
    assert_eq!(plain.header("upgrade"), "websocket");
}

#[tokio::test]
async fn while_nobody_draws_the_last_picture_stays_and_the_stream_goes_on_by_itself() {
    let running = Running::new(|_usual| {}).await;
    let mut camera = running.connect().await;
    camera.look(1, VIEW).await;
    camera.full().await;
    running
        .app
        .drawer
        .set(Mood::fails(Class::Unavailable, "no worker"));
    let turned = format!("{VIEW}&roll=5");
    camera.look(2, &turned).await;
    let error = camera.error().await;
    assert_eq!((&error["id"], &error["status"]), (&json!(2), &json!(503)));
    // Longer than until it is tried in full because it rests.
    tokio::time::sleep(Duration::from_millis(700)).await;
    running.app.drawer.set(Mood::Well);
    let (header, _png) = camera.full().await;
    assert_eq!(header["id"], 2, "tried again without being asked");
    running.app.drawer.set(Mood::Fails(
        BackendError::new(Class::Busy, "too much").after(Duration::from_secs(1)),
    ));
    camera.look(3, VIEW).await;
    assert_eq!(camera.error().await["status"], 503);
    // A newer state takes the place of the one that could not be drawn.
    running.app.drawer.set(Mood::Well);
    camera.look(4, &turned).await;
    assert_eq!(camera.full().await.0["id"], 4);
}

#[tokio::test]
async fn a_product_that_is_removed_ends_its_streams_by_name() {
    let running = Running::new(|_usual| {}).await;
    let mut camera = running.connect().await;
    camera.look(1, VIEW).await;
    camera.full().await;
    let gone = Mood::fails(Class::NotFound, "there is no field of flux any more");
    running.app.drawer.set(gone);
    camera.look(2, &format!("{VIEW}&roll=1")).await;
    let (code, reason) = camera.closed().await;
    assert!(code == 1008 && reason.contains("flux"), "{code} {reason}");
}

#[tokio::test]
async fn a_product_that_never_was_there_is_a_state_that_is_wrong() {
    let running = Running::new(|_usual| {}).await;
    let mut camera = running.connect().await;
    camera.look(1, VIEW).await;
    camera.full().await;
    camera.look(2, &VIEW.replace("/flux/", "/flx/")).await;
    let error = camera.error().await;
    assert_eq!((&error["id"], &error["status"]), (&json!(2), &json!(404)));
    camera.look(3, &format!("{VIEW}&roll=1")).await;
    assert_eq!(camera.full().await.0["id"], 3, "the stream goes on");
}

#[tokio::test]
async fn a_server_that_stops_says_so_and_does_not_wait_for_cameras() {
    let mut running = Running::new(|_usual| {}).await;
    let mut camera = running.connect().await;
    camera.look(1, VIEW).await;
    camera.full().await;
    running.stop.take().unwrap().send(()).unwrap();
    let (code, reason) = camera.closed().await;
    assert!(code == 1001 && reason.contains("again"), "{code} {reason}");
    let ended = tokio::time::timeout(LIMIT, &mut running.task).await;
    ended.expect("it ends").unwrap();
}

#[tokio::test]
async fn frames_of_a_stream_are_not_taken_for_slow_heads() {
    let running = Running::new(|settings| settings.head_limit_s = 1).await;
    let mut camera = running.connect().await;
    for id in 1..=25 {
        camera.look(id, &format!("{VIEW}&roll={id}")).await;
        tokio::time::sleep(Duration::from_millis(100)).await;
    }
    // What was drawn before a head would have been late proves nothing: the last state is.
    while camera.full().await.0["id"] != 25 {}
}
