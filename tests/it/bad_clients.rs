//! Clients at a real server that do what nobody should: each is told so or ended, the server stays small, and somebody who
//! behaves has his pictures all the while.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use harness::camera::{Came, Camera};
use harness::raw_stream::{self, Frame, RawStream, frame};
use harness::server::Server;
use harness::{granule, program};
use rlimit::Resource;
use serde_json::json;

/// Longer than anything here takes, also on a busy machine.
const LIMIT: Duration = Duration::from_mins(1);
/// The longest that somebody who behaves has no new picture: as slow as software is on a machine with other work.
const LONGEST_GAP: Duration = Duration::from_secs(15);
/// What a server may grow by, whoever does what: 500 streams and 4000 connections hold some 100 MiB between them.
const MOST_GROWTH_BYTES: u64 = 400 << 20;
const STATES_PER_S: usize = 10_000;
const FLOOD_S: usize = 3;
const CROWD: usize = 5000;
const OPENERS: usize = 20;
/// `--streams` unless told otherwise.
const STREAMS: usize = 512;
/// Open files that a server is started with: fewer than its connections need, as on many machines.
const FEW_FILES: u64 = 1024;
/// Within which a connection is answered that is let in at once: less than until an idle one makes room.
const PROMPT: Duration = Duration::from_secs(10);
const MONTHS: usize = 6;

/// A data folder with a flux, and another one that will be removed.
fn landed(data: &Path) {
    for product in ["flux", "gone"] {
        let files: Vec<_> = (0..MONTHS)
            .map(|month| granule::write(data, month, usize::from(product == "gone")).unwrap())
            .collect();
        let mut words = vec!["ingest", "--product", product];
        words.extend(files.iter().map(|file| file.to_str().unwrap()));
        program::succeed(data, &words).unwrap();
    }
}

fn view(lon: usize, time: &str) -> String {
    let lon = lon % 360;
    format!("/globe/flux/map.png?lon={lon}&height_km=9000&width=320&height=200&time={time}")
}

fn state(id: usize, view: &str) -> String {
    json!({"id": id, "view": view}).to_string()
}

/// Somebody who behaves: moves his camera, looks at what comes.
struct Viewer {
    pictures: AtomicUsize,
    is_over: AtomicBool,
}

impl Viewer {
    /// Looks until it is over; the longest time without a picture.
    fn watch(&self, url: &str) -> Duration {
        let mut camera = Camera::connect(url).unwrap();
        let (mut last, mut longest) = (Instant::now(), Duration::ZERO);
        for step in 0.. {
            if self.is_over.load(Ordering::SeqCst) {
                break;
            }
            camera.look(&view(step, "2000-02-10")).unwrap();
            match camera.hear().unwrap() {
                Came::Picture(header, bytes) => {
                    assert!(!bytes.is_empty(), "{header}");
                    self.pictures.fetch_add(1, Ordering::SeqCst);
                    longest = longest.max(last.elapsed());
                    last = Instant::now();
                }
                Came::Refused(why) => panic!("somebody who behaves was refused: {why}"),
                Came::Nothing => {}
            }
        }
        longest.max(last.elapsed())
    }

    /// What a bad client does while pictures keep coming.
    fn while_served<T>(&self, server: &Server, what: &str, work: impl FnOnce() -> T) -> T {
        let before = self.pictures.load(Ordering::SeqCst);
        let done = work();
        let begun = Instant::now();
        while self.pictures.load(Ordering::SeqCst) == before {
            assert!(begun.elapsed() < LONGEST_GAP, "no picture beside {what}");
            std::thread::sleep(Duration::from_millis(20));
        }
        let tile = server.get("/tiles/flux/map/1/0/1.png").unwrap();
        assert_eq!(tile.status, 200, "beside {what}: {}", tile.text());
        done
    }
}

/// Ends the viewer however the test ends: who watches is waited for.
struct Over<'a>(&'a Viewer);

impl Drop for Over<'_> {
    fn drop(&mut self) {
        self.0.is_over.store(true, Ordering::SeqCst);
    }
}

/// Sends many times what can be drawn; its newest state is what it is shown.
fn flood(url: &str) {
    let mut stream = RawStream::open(url).unwrap();
    let mut writer = stream.writer().unwrap();
    let last = STATES_PER_S * FLOOD_S;
    let writing = std::thread::spawn(move || {
        let begun = Instant::now();
        for id in 1..=last {
            let text = state(id, &view(id, "2000-02-11"));
            writer.write_all(&frame(&text)).unwrap();
            // Ahead of its time: that many a second and no more.
            let due = Duration::from_secs_f64(id as f64 / STATES_PER_S as f64);
            if id % 100 == 0 {
                std::thread::sleep(due.saturating_sub(begun.elapsed()));
            }
        }
        begun.elapsed()
    });
    let (begun, mut pictures) = (Instant::now(), 0);
    loop {
        assert!(begun.elapsed() < LIMIT, "the newest state was not shown");
        match stream.hear().unwrap() {
            Some(Frame::Picture(header)) => {
                pictures += 1;
                if header["id"] == last && header["kind"] == "full" {
                    break;
                }
            }
            Some(Frame::Text(text)) => panic!("refused: {text}"),
            Some(Frame::Close(code, reason)) => panic!("closed: {code} {reason}"),
            Some(Frame::Other) | None => {}
        }
    }
    let took = writing.join().unwrap();
    assert!(
        took < 4 * Duration::from_secs(FLOOD_S as u64),
        "states were taken slowly: {took:?}"
    );
    assert!(pictures < last / 10, "{pictures} pictures of {last} states");
}

/// A picture larger than any is refused everywhere in the same words.
fn hundred_million_pixels(server: &Server) {
    let globe = "/globe/flux/map.png?width=10000&height=10000";
    let tile = server.get("/tiles/flux/map/0/0/0.png?size=10000").unwrap();
    assert_eq!(tile.status, 400, "{}", tile.text());
    assert!(tile.text().contains("256 or 512"), "{}", tile.text());
    let whole = server.get(globe).unwrap();
    assert_eq!(whole.status, 400, "{}", whole.text());
    assert!(whole.text().contains("7680"), "{}", whole.text());
    let mut camera = Camera::connect(&server.url).unwrap();
    let id = camera.look(globe).unwrap();
    let begun = Instant::now();
    loop {
        assert!(begun.elapsed() < LIMIT, "no refusal");
        match camera.hear().unwrap() {
            Came::Refused(why) => {
                assert_eq!((&why["id"], &why["status"]), (&json!(id), &json!(400)));
                assert_eq!(why["error"], whole.json().unwrap()["error"]);
                break;
            }
            Came::Picture(header, _) => panic!("drawn: {header}"),
            Came::Nothing => {}
        }
    }
    // The stream goes on.
    camera.look(&view(1, "2000-02-12")).unwrap();
    let begun = Instant::now();
    while !matches!(camera.hear().unwrap(), Came::Picture(..)) {
        assert!(begun.elapsed() < LIMIT, "no picture after a refusal");
    }
}

/// Asks for thousands of streams at once: some are granted, all others told to come again.
fn crowd(url: &str) {
    let open = |count: usize| {
        let url = url.to_owned();
        std::thread::spawn(move || -> Vec<_> {
            // All ask before any of them listens.
            let asked: Vec<TcpStream> = (0..count)
                .map(|_| {
                    let mut socket = raw_stream::connect(&url).unwrap();
                    socket.write_all(raw_stream::REQUEST.as_bytes()).unwrap();
                    socket
                })
                .collect();
            let opened = |socket| raw_stream::opened(socket, LIMIT);
            asked.into_iter().map(opened).collect()
        })
    };
    let openers: Vec<_> = (0..OPENERS).map(|_| open(CROWD / OPENERS)).collect();
    let all: Vec<_> = openers
        .into_iter()
        .flat_map(|opener| opener.join().unwrap())
        .collect();
    assert_eq!(all.len(), CROWD);
    let (mut granted, mut told) = (0, 0);
    for opened in &all {
        match opened {
            Ok(opened) if opened.status == 101 => granted += 1,
            Ok(opened) if opened.status == 503 => {
                assert!(opened.head.contains("\r\nretry-after: "), "{}", opened.head);
                told += 1;
            }
            Ok(opened) => panic!("{}", opened.head),
            Err(error) => panic!("neither a stream nor told to come again: {error:#}"),
        }
    }
    assert!(
        granted < STREAMS && granted > STREAMS / 2,
        "{granted} streams"
    );
    assert_eq!(granted + told, CROWD);
}

/// Twice as many connections as the server had open files at its start: all are answered while all of them stay.
fn more_than_files(url: &str) {
    let mut open: Vec<TcpStream> = vec![];
    for number in 0..2 * FEW_FILES {
        let mut socket = raw_stream::connect(url).unwrap();
        socket
            .write_all(b"GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n")
            .unwrap();
        socket.set_read_timeout(Some(PROMPT)).unwrap();
        let mut status = [0; 12];
        if let Err(error) = socket.read_exact(&mut status) {
            panic!("no answer beside {number} connections: {error}");
        }
        assert_eq!(&status, b"HTTP/1.1 200", "beside {number}");
        open.push(socket);
    }
}

/// A product whose objects are removed while it is looked at.
fn removed(server: &Server, data: &Path) {
    let mut camera = Camera::connect(&server.url).unwrap();
    let view = |time: &str| format!("/globe/gone/map.png?width=320&height=200&time={time}");
    camera.look(&view("2000-01-20")).unwrap();
    let begun = Instant::now();
    while !matches!(camera.hear().unwrap(), Came::Picture(..)) {
        assert!(begun.elapsed() < LIMIT, "no picture");
    }
    for folder in ["frames", "manifests"] {
        std::fs::remove_dir_all(data.join("objects").join(folder).join("gone")).unwrap();
    }
    camera.look(&view("2000-05-30")).unwrap();
    let begun = Instant::now();
    let reason = loop {
        assert!(begun.elapsed() < LIMIT, "the stream goes on");
        match camera.hear() {
            Ok(Came::Picture(..) | Came::Nothing) => {}
            Ok(Came::Refused(why)) => panic!("told, and goes on: {why}"),
            Err(closed) => break closed.to_string(),
        }
    };
    assert!(
        reason.contains("Policy") && reason.contains("gone"),
        "{reason}"
    );
}

/// A client on a thread of its own that waits for its end, and what it was told.
fn waits(what: &'static str, mut stream: RawStream) -> JoinHandle<(u16, String)> {
    std::thread::spawn(move || {
        let begun = Instant::now();
        loop {
            assert!(begun.elapsed() < LIMIT, "{what}: nobody ended it");
            match stream.hear() {
                Ok(Some(Frame::Close(code, reason))) => return (code, reason),
                Ok(_) => {}
                Err(error) => panic!("{what}: cut off without a reason: {error:#}"),
            }
        }
    })
}

fn ended(server: &Server, label: &str) -> f64 {
    let metrics = server.get("/metrics").unwrap().text();
    let mut lines = metrics.lines().filter(|line| !line.starts_with('#'));
    let line = lines.find(|line| line.contains(label));
    line.and_then(|line| line.rsplit(' ').next()?.parse().ok())
        .unwrap_or(0.0)
}

/// Asks until a count is reached.
fn until_ended(server: &Server, label: &str, count: f64) {
    let begun = Instant::now();
    while ended(server, label) < count {
        assert!(begun.elapsed() < LIMIT, "{label} is less than {count}");
        std::thread::sleep(Duration::from_millis(200));
    }
}

/// Half a request, and nothing after it, is cut off in time.
fn half_a_head(server: &Server) {
    let mut half = raw_stream::connect(&server.url).unwrap();
    half.write_all(b"GET /tiles/flux/map/0/0/0.png HTTP/1.1\r\nHos")
        .unwrap();
    let (begun, mut byte) = (Instant::now(), [0]);
    half.set_read_timeout(Some(LIMIT)).unwrap();
    let read = half.read(&mut byte);
    assert!(!matches!(read, Ok(1..)), "an answer to half a question");
    assert!(
        begun.elapsed() < Duration::from_secs(20),
        "{:?}",
        begun.elapsed()
    );
}

#[test]
#[expect(
    clippy::too_many_lines,
    reason = "one server, what its clients do in turn"
)]
fn whatever_clients_do_they_are_told_so_and_others_have_their_pictures() {
    let data = tempfile::tempdir().unwrap();
    landed(data.path());
    let (_, hard) = rlimit::getrlimit(Resource::NOFILE).unwrap();
    rlimit::setrlimit(Resource::NOFILE, FEW_FILES.min(hard), hard).unwrap();
    let words = "serve --head-limit-s 2 --request-limit-s 15 --idle-limit-s 5";
    let words: Vec<&str> = words.split(' ').collect();
    let server = Server::start(data.path(), &words).unwrap();
    let own = rlimit::increase_nofile_limit(CROWD as u64 + 1024).unwrap();
    assert!(
        own >= CROWD as u64 + 512,
        "ulimit -Hn is {own}: this test opens {CROWD} sockets"
    );
    let viewer = Viewer {
        pictures: AtomicUsize::new(0),
        is_over: AtomicBool::new(false),
    };
    // Kernels are compiled and fields are in memory.
    server.get(&view(0, "2000-02-10")).unwrap();
    let small = server.memory_bytes().unwrap();
    let (most, longest) = std::thread::scope(|scope| {
        let watching = scope.spawn(|| viewer.watch(&server.url));
        let weighing = scope.spawn(|| {
            let mut most = 0;
            while !viewer.is_over.load(Ordering::SeqCst) {
                most = most.max(server.memory_bytes().unwrap());
                std::thread::sleep(Duration::from_millis(100));
            }
            most
        });
        let over = Over(&viewer);
        // What ends by itself, in its time, meanwhile.
        let open = || RawStream::open(&server.url).unwrap();
        let mut half_a_frame = open();
        half_a_frame.send(&frame(&state(1, "/globe"))[..9]).unwrap();
        let silent = [
            waits("half a frame", half_a_frame),
            // Without a FIN, and without an answer to a ping.
            waits("a silent client", open()),
        ];
        let mut deaf = open();
        for id in 1..200 {
            deaf.send(&frame(&state(id, &view(id, "2000-02-13"))))
                .unwrap();
        }
        let mut idle = raw_stream::connect(&server.url).unwrap();
        idle.write_all(b"GET /healthz HTTP/1.1\r\nHost: a\r\n\r\n")
            .unwrap();

        let serve = |what, work: &mut dyn FnMut()| viewer.while_served(&server, what, work);
        serve("half a head", &mut || half_a_head(&server));
        serve("a flood of states", &mut || flood(&server.url));
        serve("large pictures", &mut || hundred_million_pixels(&server));
        serve("a removed product", &mut || removed(&server, data.path()));
        serve("thousands of streams", &mut || crowd(&server.url));
        serve("more connections than files", &mut || {
            more_than_files(&server.url);
        });
        for silent in silent {
            let (code, reason) = silent.join().unwrap();
            assert_eq!((code, &*reason), (1008, "no answer within 30 s"));
        }
        serve("a deaf client", &mut || {
            // Either nothing was taken for long, or no ping was answered.
            let by = |reason: &str| {
                ended(
                    &server,
                    &format!(r#"stream_ended_total{{reason="{reason}"}}"#),
                )
            };
            let begun = Instant::now();
            while by("slow") + by("silent") < 3.0 {
                assert!(begun.elapsed() < LIMIT, "a deaf client is kept");
                std::thread::sleep(Duration::from_millis(200));
            }
        });
        until_ended(&server, r#"connections_ended_total{why="slow"}"#, 1.0);
        until_ended(&server, r#"connections_ended_total{why="idle"}"#, 1.0);
        drop((deaf, idle));
        drop(over);
        (weighing.join().unwrap(), watching.join().unwrap())
    });
    assert!(longest < LONGEST_GAP, "no picture for {longest:?}");
    let growth = most.saturating_sub(small);
    assert!(
        growth < MOST_GROWTH_BYTES,
        "from {} to {} MiB",
        small >> 20,
        most >> 20
    );
    let stale = ended(&server, "fluxglobe_tile_server_stream_stale_total ");
    assert!(stale > 0.9 * (STATES_PER_S * FLOOD_S) as f64, "{stale}");
}
