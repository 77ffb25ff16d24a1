//! Pictures to look at and times to read: written to the folder that `GALLERY` names, nothing without it.

use std::time::Instant;

use contract::job::Mode;
use render_worker::{Backend, Renderer};

use crate::scenes::{ONE_DEGREE, globe, job, ocean, tile};

#[test]
fn the_gallery_is_drawn_where_asked_for() {
    #[expect(clippy::disallowed_methods, reason = "a test's own switch")]
    let Ok(folder) = std::env::var("GALLERY") else { return };
    let renderer = Renderer::new(Backend::Gpu).unwrap();
    let scene = ocean(ONE_DEGREE);
    println!("{}", renderer.name());
    let views = [
        ("z0", tile(0, 0, 0, 256)),
        ("z1", tile(1, 0, 0, 256)),
        ("z2", tile(2, 0, 1, 256)),
        ("z3", tile(3, 1, 3, 256)),
        ("z4", tile(4, 3, 7, 256)),
        ("z6", tile(6, 12, 28, 256)),
        ("z8", tile(8, 48, 112, 256)),
        ("far", globe(-120.0, 10.0, 1.5e7, 512)),
        ("near", globe(-120.0, 10.0, 2.5e6, 512)),
    ];
    for mode in Mode::ALL {
        for (name, view) in views {
            let mut job = job(mode, view);
            job.style.globe_surface = true;
            renderer.render(&job, &scene).unwrap();
            let start = Instant::now();
            let image = renderer.render(&job, &scene).unwrap();
            let drawn = start.elapsed();
            let png = image.encode_png().unwrap();
            let all = start.elapsed();
            println!("{mode} {name}: {:.1} ms, with PNG {:.1} ms, {} bytes", drawn.as_secs_f64() * 1e3, all.as_secs_f64() * 1e3, png.len());
            std::fs::write(format!("{folder}/{mode}-{name}.png"), png).unwrap();
        }
    }
}
