//! Pictures to look at and times to read: written to the folder that `GALLERY` names, nothing without it.

use std::time::Instant;

use contract::job::Mode;
use render::{Backend, Image, Renderer};
use render_proof::currents;

use crate::scenes::{ONE_DEGREE, globe, job, ocean, tile};

#[test]
fn the_gallery_is_drawn_where_asked_for() {
    #[expect(clippy::disallowed_methods, reason = "a test's own switch")]
    let Ok(folder) = std::env::var("GALLERY") else {
        return;
    };
    #[expect(clippy::disallowed_methods, reason = "a test's own switch")]
    let backend = if std::env::var("GALLERY_CPU").is_ok() {
        Backend::Cpu
    } else {
        Backend::Gpu
    };
    let renderer = Renderer::new(backend).unwrap();
    let scene = stored().unwrap_or_else(|| ocean(ONE_DEGREE));
    let gyres = currents::gyres(ONE_DEGREE);
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
        let mut sheet = Sheet::default();
        for (name, view) in views {
            let (mut job, scene) = if mode == Mode::Flow {
                (currents::job(view, 1e7), &gyres)
            } else {
                (job(mode, view), &scene)
            };
            job.style.globe_surface = true;
            renderer.render(&job, scene).unwrap();
            let busy = busy_ms();
            let start = Instant::now();
            let image = renderer.render(&job, scene).unwrap();
            let drawn = start.elapsed();
            let busy = busy_ms() - busy;
            let png = image.encode_png().unwrap();
            let all = start.elapsed();
            println!(
                "{mode} {name}: {busy} ms of processor, {:.1} ms, with PNG {:.1} ms, {} bytes",
                drawn.as_secs_f64() * 1e3,
                all.as_secs_f64() * 1e3,
                png.len()
            );
            std::fs::write(format!("{folder}/{mode}-{name}.png"), png).unwrap();
            sheet.add(&image);
        }
        sheet.write(&format!("{folder}/{mode}.png"));
    }
}

/// Pictures side by side over a dark ground.
#[derive(Default)]
struct Sheet {
    pictures: Vec<Image>,
}

impl Sheet {
    fn add(&mut self, image: &Image) {
        self.pictures.push(image.clone());
    }

    fn write(&self, path: &str) {
        let across = 4;
        let side = 264;
        let flat: Vec<_> = self.pictures.iter().flat_map(quarters).collect();
        let (width, height) = (side * across, side * flat.len().div_ceil(across));
        let mut sheet = vec![90u8; width * height * 4];
        for (i, (image, at_x, at_y)) in flat.iter().enumerate() {
            for y in 0..256u32 {
                for x in 0..256u32 {
                    let [r, g, b, a] = image.pixel(at_x + x, at_y + y);
                    let to =
                        ((i / across * side + y as usize) * width + i % across * side + x as usize)
                            * 4;
                    let over = |c: u8, ground: f32| {
                        (f32::from(c) * f32::from(a) / 255.0
                            + ground * (1.0 - f32::from(a) / 255.0)) as u8
                    };
                    sheet[to..to + 4].copy_from_slice(&[
                        over(r, 14.0),
                        over(g, 24.0),
                        over(b, 40.0),
                        255,
                    ]);
                }
            }
        }
        let sheet = Image {
            width: width as u32,
            height: height as u32,
            rgba8: sheet,
        };
        std::fs::write(path, sheet.encode_png().unwrap()).unwrap();
    }
}

fn quarters(image: &Image) -> Vec<(&Image, u32, u32)> {
    if image.width == 256 {
        vec![(image, 0, 0)]
    } else {
        vec![
            (image, 0, 0),
            (image, 256, 0),
            (image, 0, 256),
            (image, 256, 256),
        ]
    }
}

/// Processor time of this process: what a picture costs also while other programs run.
fn busy_ms() -> i64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let ticks: Vec<i64> = stat
        .rsplit(')')
        .next()
        .unwrap()
        .split_whitespace()
        .filter_map(|field| field.parse().ok())
        .collect();
    (ticks[10] + ticks[11]) * 10
}

/// The scene of a climatology in a store, if `GALLERY_STORE` names the folder.
fn stored() -> Option<render::Scene> {
    #[expect(clippy::disallowed_methods, reason = "a test's own switch")]
    let store = storage::Store::open(
        &std::env::var("GALLERY_STORE")
            .ok()
            .filter(|folder| !folder.is_empty())?,
    )
    .unwrap();
    let renderer = std::sync::Arc::new(Renderer::new(Backend::Cpu).unwrap());
    let runtime = tokio::runtime::Builder::new_current_thread()
        .build()
        .unwrap();
    runtime.block_on(async {
        let newest = async |product: &str| {
            storage::manifests::latest(&store, &product.parse().unwrap())
                .await
                .unwrap()
        };
        let flux = newest("takahashi09-flux").await?;
        let carbon = newest("takahashi09-flux-accumulated").await?;
        let job = crate::stored::at(&flux, &carbon, "2000-10-20");
        Some(
            render_worker::Source::new(store.clone(), renderer, 1 << 30)
                .scene(&job)
                .await
                .unwrap(),
        )
    })
}
