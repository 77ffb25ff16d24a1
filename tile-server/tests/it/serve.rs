//! The server on a real socket.

use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use storage::Store;
use tile_server::metrics::Registry;
use tile_server::{AppState, ServeError, Server, Settings, serve};
use tokio::io::{AsyncReadExt as _, AsyncWriteExt as _};
use tokio::net::TcpStream;
use tokio::sync::oneshot;

use crate::doubles::{Analyst, Drawer};

fn settings() -> Settings {
    Settings {
        listen: "127.0.0.1:0".parse().unwrap(),
        drain_limit_s: 1,
        ..Settings::default()
    }
}

fn state(settings: &Settings, drawer: &Arc<Drawer>) -> AppState {
    let analyst = Arc::new(Analyst::default());
    AppState::new(
        settings,
        Store::memory(),
        drawer.clone(),
        analyst,
        Registry::new(),
    )
    .unwrap()
}

async fn ask(server: std::net::SocketAddr, request: &str) -> String {
    let mut connection = TcpStream::connect(server).await.unwrap();
    connection.write_all(request.as_bytes()).await.unwrap();
    let mut answer = vec![];
    connection.read_to_end(&mut answer).await.unwrap();
    String::from_utf8_lossy(&answer).into_owned()
}

#[tokio::test]
async fn it_answers_until_it_is_told_to_stop() {
    let settings = settings();
    let server = Server::bind(&settings, state(&settings, &Arc::default()))
        .await
        .unwrap();
    let address = server.address();
    let (stop, stopped) = oneshot::channel::<()>();
    let running = tokio::spawn(server.run(async {
        stopped.await.unwrap();
    }));
    let answer = ask(
        address,
        "GET /healthz HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n",
    )
    .await;
    assert!(answer.starts_with("HTTP/1.1 200 OK"), "{answer}");
    // A connection that stays open and says nothing must not keep the server from ending.
    let _idle = TcpStream::connect(address).await.unwrap();
    let told_at = Instant::now();
    stop.send(()).unwrap();
    running.await.unwrap().unwrap();
    assert!(
        told_at.elapsed() < Duration::from_secs(30),
        "{:?}",
        told_at.elapsed()
    );
    assert!(TcpStream::connect(address).await.is_err());
}

#[tokio::test]
async fn a_request_under_way_is_finished_before_the_end() {
    let settings = Settings {
        drain_limit_s: 20,
        ..settings()
    };
    let app = crate::app::TestApp::new().await;
    let drawer = Arc::new(Drawer::over(&app.store));
    drawer.is_slow.store(true, Ordering::SeqCst);
    let state = AppState::new(
        &settings,
        app.store,
        drawer.clone(),
        Arc::new(Analyst::default()),
        Registry::new(),
    )
    .unwrap();
    let server = Server::bind(&settings, state).await.unwrap();
    let address = server.address();
    let (stop, stopped) = oneshot::channel::<()>();
    let running = tokio::spawn(server.run(async {
        stopped.await.unwrap();
    }));
    let request = "GET /tiles/flux/map/0/0/0.png HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n";
    let answer = tokio::spawn(ask(address, request));
    while drawer.drawn_count() == 0 {
        tokio::task::yield_now().await;
    }
    stop.send(()).unwrap();
    drawer.turns.add_permits(1);
    assert!(answer.await.unwrap().starts_with("HTTP/1.1 200 OK"));
    running.await.unwrap().unwrap();
}

#[tokio::test]
async fn a_port_that_is_taken_is_named_with_the_way_out() {
    let settings = settings();
    let first = Server::bind(&settings, state(&settings, &Arc::default()))
        .await
        .unwrap();
    let same = Settings {
        listen: first.address(),
        ..settings
    };
    let error = serve(&same, state(&same, &Arc::default()), std::future::pending())
        .await
        .unwrap_err();
    assert!(matches!(error, ServeError::PortTaken { .. }));
    let port = first.address().port();
    let expected =
        format!("port {port} is in use by another program; choose another with --listen");
    assert_eq!(error.to_string(), expected);
}

#[tokio::test]
async fn an_address_of_another_machine_is_refused_with_a_reason() {
    let settings = Settings {
        listen: "192.0.2.1:0".parse().unwrap(),
        ..settings()
    };
    let error = serve(
        &settings,
        state(&settings, &Arc::default()),
        std::future::pending(),
    )
    .await
    .unwrap_err();
    assert!(
        error
            .to_string()
            .starts_with("cannot listen on 192.0.2.1:0"),
        "{error}"
    );
}

#[tokio::test]
async fn bytes_that_are_no_request_end_the_connection_only() {
    let settings = settings();
    let server = Server::bind(&settings, state(&settings, &Arc::default()))
        .await
        .unwrap();
    let address = server.address();
    let running = tokio::spawn(server.run(std::future::pending()));
    for bytes in [
        "\0\0\0\0\r\n\r\n",
        "GET / HTTP/9.9\r\n\r\n",
        "GET /a b c HTTP/1.1\r\n\r\n",
        "\r\n\r\n\r\n\r\nX\r\n\r\n",
    ] {
        let answer = ask(address, bytes).await;
        assert!(
            answer.is_empty() || answer.starts_with("HTTP/1.1 400"),
            "{bytes:?}: {answer}"
        );
    }
    let answer = ask(
        address,
        "GET /healthz HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n",
    )
    .await;
    assert!(answer.starts_with("HTTP/1.1 200 OK"), "{answer}");
    running.abort();
}
