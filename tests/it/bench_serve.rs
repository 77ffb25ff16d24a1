//! `fluxglobe bench serve` against a real server, and against ones that do what it must notice.

use std::io::{BufRead as _, BufReader, Cursor, Write as _};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use harness::server::Server;
use harness::{granule, program};
use serde_json::Value;

const PRODUCTS: &str = r#"{"products": [{"product": "p", "bounds_deg": [-180, -90, 180, 90], "modes": ["map"],
    "steps": [{"start": "2000-01-01T00:00:00Z", "end": "2000-02-01T00:00:00Z"}]}]}"#;

fn words<'a>(url: &'a str, more: &'a str) -> Vec<&'a str> {
    let usual = "--mode map --tiles 2 --seconds 3 --warm-up-seconds 0";
    let mut words = vec!["bench", "serve", "--url", url];
    words.extend(usual.split(' ').chain(more.split(' ')));
    words
}

fn stage<'a>(summary: &'a Value, name: &str) -> Option<&'a Value> {
    let stages = summary["stages"].as_array()?;
    stages.iter().find(|stage| stage["name"] == name)
}

#[test]
fn all_kinds_of_clients_are_measured_on_a_real_server() {
    let data = tempfile::tempdir().unwrap();
    // Between two months every instant is a picture of its own.
    for month in 0..2 {
        let file = granule::write(data.path(), month, 0).unwrap();
        let ingest = ["ingest", "--product", "flux", file.to_str().unwrap()];
        program::succeed(data.path(), &ingest).unwrap();
    }
    let server = Server::start(data.path(), &["serve"]).unwrap();
    let measured = |more: &str| {
        let summary = program::json(data.path(), &words(&server.url, &format!("{more} --json")));
        let summary = summary.unwrap();
        assert!(summary["answers"].as_u64().unwrap() > 0, "{summary}");
        assert_eq!(summary["bad_answers"], 0, "{summary}");
        let memory = &summary["servers"][0]["resident_bytes"];
        assert!(
            memory
                .as_array()
                .unwrap()
                .iter()
                .all(|bytes| bytes.as_u64() > Some(1 << 20))
        );
        summary
    };
    let new = measured("--clients 4");
    let answers = new["answers"].as_u64().unwrap();
    for name in [
        "look in the store",
        "wait for a turn",
        "load",
        "plan",
        "upload",
        "draw",
        "read back",
        "encode",
        "send",
    ] {
        let stage = stage(&new, name).unwrap_or_else(|| panic!("{name}: {new}"));
        // What was under way at the start or the end is in one of the two alone, and what was answered while they were read.
        let apart = 8 + answers / 50;
        assert!(
            stage["times"].as_u64().unwrap() + apart >= answers,
            "{name}: {new}"
        );
    }
    let warm = measured("--warm --set 4 --clients 4");
    assert!(warm["answers"].as_u64() > new["answers"].as_u64(), "{warm}");
    assert_eq!(stage(&warm, "encode"), None, "{warm}");
    let playback = measured("--playback --clients 3 --window 2x2 --period-s 0.2");
    let rates = &playback["viewers"]["instants_per_s_and_viewer"];
    let [slowest, median, quickest] = [0, 1, 2].map(|i| rates[i].as_f64().unwrap());
    assert!(
        0.0 < slowest && slowest <= median && median <= quickest,
        "{playback}"
    );
    // Nobody is quicker than time runs.
    assert!(quickest <= 5.5, "{playback}");
}

/// What a stub answers to the question of this number.
type Answer = Arc<dyn Fn(u64) -> Vec<u8> + Send + Sync>;

/// A server of one product whose tiles are what a test says, each drawn anew.
fn stub(tile: impl Fn(u64) -> Vec<u8> + Send + Sync + 'static) -> String {
    stub_that_draws(|asked| asked, tile)
}

/// The same where so many of those that were asked for were drawn.
fn stub_that_draws(
    drawn: fn(u64) -> u64,
    tile: impl Fn(u64) -> Vec<u8> + Send + Sync + 'static,
) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let url = format!("http://{}", listener.local_addr().unwrap());
    let (tile, asked): (Answer, Arc<AtomicU64>) = (Arc::new(tile), Arc::default());
    std::thread::spawn(move || {
        for client in listener.incoming().map_while(Result::ok) {
            let (tile, asked) = (Arc::clone(&tile), Arc::clone(&asked));
            std::thread::spawn(move || serve(&client, &tile, &asked, drawn));
        }
    });
    url
}

fn serve(client: &TcpStream, tile: &Answer, asked: &AtomicU64, drawn: fn(u64) -> u64) {
    let mut lines = BufReader::new(client).lines().map_while(Result::ok);
    while let Some(first) = lines.next() {
        // The head ends with an empty line.
        while lines.next().is_some_and(|line| !line.is_empty()) {}
        let answer = if first.contains("/api/products") {
            whole("200 OK", PRODUCTS.as_bytes())
        } else if first.contains("/metrics") {
            let count = drawn(asked.load(Ordering::SeqCst));
            let text = format!("fluxglobe_tile_server_cache_misses_total {count}\n");
            whole("200 OK", text.as_bytes())
        } else {
            tile(asked.fetch_add(1, Ordering::SeqCst))
        };
        let mut client = client;
        if client.write_all(&answer).is_err() {
            return;
        }
    }
}

/// An answer with its head.
fn whole(status: &str, body: &[u8]) -> Vec<u8> {
    let head = format!(
        "HTTP/1.1 {status}\r\ncontent-length: {}\r\n\r\n",
        body.len()
    );
    [head.as_bytes(), body].concat()
}

/// A tile of one grey.
fn tile(grey: u8) -> Vec<u8> {
    let image = image::RgbaImage::from_pixel(256, 256, image::Rgba([grey; 4]));
    let mut png = Cursor::new(vec![]);
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    whole("200 OK", png.get_ref())
}

fn said(url: &str, more: &str) -> String {
    program::fail(Path::new("/nonexistent"), &words(url, more)).unwrap()
}

#[test]
fn who_is_told_to_come_again_comes_again_in_time() {
    let url = stub(|number| match number {
        0..2 => b"HTTP/1.1 503 Busy\r\nretry-after: 1\r\ncontent-length: 0\r\n\r\n".to_vec(),
        _ => tile(7),
    });
    let words = words(
        &url,
        "--playback --clients 2 --window 1x1 --period-s 0.5 --json",
    );
    let summary = program::json(Path::new("/nonexistent"), &words).unwrap();
    assert_eq!(summary["bad_answers"], 0, "{summary}");
    assert_eq!(summary["sent_away"], 2, "{summary}");
    assert!(
        summary["longest_ms"].as_f64().unwrap() >= 1000.0,
        "{summary}"
    );
}

#[test]
fn whatever_is_no_picture_of_the_right_kind_is_a_failure_in_words() {
    let busy = stub(|_| whole("503 Busy", b"too much"));
    assert!(said(&busy, "--playback --clients 2").contains("503 without Retry-After: too much"));
    let broken = stub(|number| {
        if number == 5 {
            whole("500 No", b"oh")
        } else {
            tile(1)
        }
    });
    assert!(said(&broken, "--clients 2").contains("500"));
    let cut = stub(|_| {
        let whole_tile = tile(1);
        whole("200 OK", &whole_tile[whole_tile.len() - 40..])
    });
    assert!(said(&cut, "--clients 2").contains("no PNG"));
    // The same picture in other bytes.
    let other = stub_that_draws(|_| 0, |number| tile(if number < 20 { 1 } else { 2 }));
    let text = said(&other, "--warm --set 4 --clients 2");
    assert!(text.contains("came as other bytes"), "{text}");
    // Pictures that were to be there, and were drawn; and the other way round.
    let forgetful = stub(|_| tile(1));
    let text = said(&forgetful, "--warm --set 4 --clients 2");
    assert!(text.contains("were drawn anew"), "{text}");
    let stored = stub_that_draws(|_| 0, |_| tile(1));
    assert!(said(&stored, "--clients 2").contains("were stored pictures"));
}
