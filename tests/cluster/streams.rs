//! kill -9 of a render worker while it draws for fifty cameras: each is drawn for by the other one, and none is hung up on.

use std::path::PathBuf;
use std::time::{Duration, Instant};

use harness::camera::{Came, Camera};
use harness::cluster::{Cluster, Shape};
use harness::granule;

use crate::alone;
use crate::faults::{PRODUCT, notice, say, until_whole};

const CAMERAS: usize = 50;
/// How often a camera says what it sees.
const PAUSE: Duration = Duration::from_millis(250);
/// Every camera has another picture within this time: as slow as fifty are in software on two cores beside a compiler.
const LIMIT: Duration = Duration::from_mins(3);

/// A camera and when it had its pictures.
struct Viewer {
    camera: Camera,
    seen: usize,
    last: Instant,
    longest: Duration,
}

impl Viewer {
    fn listen(&mut self) {
        loop {
            match self.camera.hear().unwrap() {
                Came::Picture(header, bytes) => {
                    assert!(!bytes.is_empty(), "{header}");
                    self.seen += 1;
                    self.longest = self.longest.max(self.last.elapsed());
                    self.last = Instant::now();
                }
                // Nobody draws at the moment: it is tried again by itself.
                Came::Refused(why) => assert_eq!(why["status"], 503, "{why}"),
                Came::Nothing => return,
            }
        }
    }
}

/// Moves all cameras until each has seen one picture more.
fn fly(viewers: &mut [Viewer], what: &str) -> Duration {
    let begun = Instant::now();
    for viewer in &mut *viewers {
        viewer.seen = 0;
        (viewer.last, viewer.longest) = (begun, Duration::ZERO);
    }
    std::thread::scope(|scope| {
        for (number, viewer) in viewers.iter_mut().enumerate() {
            scope.spawn(move || {
                let mut step = 0;
                while viewer.seen == 0 {
                    assert!(
                        begun.elapsed() < LIMIT,
                        "camera {number}: no picture {what}"
                    );
                    step += 1;
                    let lon = (number * 7 + step) % 360;
                    let view = format!(
                        "/globe/{PRODUCT}/map.png?lon={lon}&height_km=9000&width=320&height=200"
                    );
                    viewer.camera.look(&view).unwrap();
                    std::thread::sleep(PAUSE);
                    viewer.listen();
                }
            });
        }
    });
    begun.elapsed()
}

#[test]
fn a_worker_that_is_killed_under_fifty_cameras_stops_none_of_them() {
    let _alone = alone();
    let inbox = tempfile::tempdir().unwrap();
    let shape = Shape {
        executors: 1,
        ingestds: 1,
        render_workers: 2,
        tile_servers: 1,
    };
    let mut cluster = Cluster::start(shape, inbox.path()).unwrap();
    let files: Vec<PathBuf> = (0..2)
        .map(|month| granule::write(inbox.path(), month, 0).unwrap())
        .collect();
    notice(&cluster, &files);
    until_whole(&cluster, files.len());
    let mut viewers: Vec<Viewer> = (0..CAMERAS)
        .map(|_| Viewer {
            camera: Camera::connect(&cluster.tiles).unwrap(),
            seen: 0,
            last: Instant::now(),
            longest: Duration::ZERO,
        })
        .collect();
    let before = fly(&mut viewers, "at first");

    // Whichever draws for this product: the other one has drawn little.
    let drawn = |cluster: &Cluster, name: &str| {
        let metric = r#"fluxglobe_render_worker_request_seconds_count{operation="call"}"#;
        cluster.nodes[name].metric(metric).unwrap()
    };
    let workers: Vec<String> = cluster
        .nodes
        .keys()
        .filter(|name| name.starts_with("render-"))
        .cloned()
        .collect();
    assert_eq!(workers.len(), 2, "{workers:?}");
    let busy = |a: &&String, b: &&String| drawn(&cluster, a).total_cmp(&drawn(&cluster, b));
    let victim = workers.iter().max_by(busy).unwrap().clone();
    assert!(drawn(&cluster, &victim) >= CAMERAS as f64 / 2.0);
    cluster.node(&victim).unwrap().kill().unwrap();
    let after = fly(&mut viewers, "after the kill");
    say(&format!(
        "{CAMERAS} cameras had a picture each in {:.1} s; after kill -9 of {victim} in {:.1} s",
        before.as_secs_f64(),
        after.as_secs_f64()
    ));
}
