//! The same few pictures on every machine, and folders of them compared.

use std::path::PathBuf;

use anyhow::{Context as _, Result};
use contract::tile::Tile;
use render::{Backend, Image, Renderer};

use crate::bench::report::{in_words, say};
use crate::bench::scenery;
use crate::{Difference, Picture, differing_bytes};

/// Draws the same pictures on every machine.
pub(super) fn draw(folder: &PathBuf) -> Result<()> {
    std::fs::create_dir_all(folder)?;
    let renderer = Renderer::new(Backend::Gpu)?;
    let scene = scenery::scene(&scenery::grid(200_000));
    let mut globe = scenery::job([640, 480], 64, 0.0)?;
    globe.style.particles_per_cell = 4;
    let mut jobs = vec![("globe", globe)];
    for (name, z, x, y) in [
        ("tile-4", 4, 13, 7),
        ("tile-5", 5, 26, 14),
        ("tile-7", 7, 104, 56),
    ] {
        let mut job = scenery::job([256, 256], 64, 0.0)?;
        job.style.particles_per_cell = 16;
        job.view = contract::job::View::Tile {
            tile: Tile::new(z, x, y)?,
            size_px: 256,
        };
        jobs.push((name, job));
    }
    for (name, job) in jobs {
        let image = renderer.render(&job, &scene)?;
        std::fs::write(folder.join(format!("{name}.png")), image.encode_png()?)?;
    }
    say(&format!(
        "{}: pictures in {}",
        renderer.name(),
        folder.display()
    ));
    Ok(())
}

/// Says how far the pictures of two folders are from one another.
pub(super) fn compare(a: &PathBuf, b: &PathBuf) -> Result<()> {
    let mut names: Vec<_> = std::fs::read_dir(a)?
        .map(|entry| entry.map(|e| e.file_name()))
        .collect::<Result<_, _>>()?;
    names.sort();
    for name in names {
        let read = |folder: &PathBuf| -> Result<Image> {
            let path = folder.join(&name);
            let picture = image::open(&path)
                .with_context(|| path.display().to_string())?
                .into_rgba8();
            Ok(Image {
                width: picture.width(),
                height: picture.height(),
                rgba8: picture.into_raw(),
            })
        };
        let pair = [read(a)?, read(b)?];
        let [one, other] = [0, 1].map(|i: usize| Picture::from(&pair[i]));
        let d = Difference::of(&one, &other).context("the sizes differ")?;
        say(&format!(
            "{}: {}, {} bytes differ",
            name.display(),
            in_words(&d),
            differing_bytes(&pair[0], &pair[1])
        ));
    }
    Ok(())
}
