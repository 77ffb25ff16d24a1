//! `fluxglobe render`: a product, an instant and a view in, a PNG file out.

use std::path::Path;

use anyhow::{Context as _, Result, bail};
use contract::job::View;
use contract::tile::Tile;
use render_worker::desk::{Order, Storing};

use crate::cli::{Render, RenderGlobe, RenderTile, Settings};
use crate::command::legend;
use crate::picture::Extras;
use crate::{animation, deployment, heights, picture, progress, sky};

pub(crate) async fn run(settings: &Settings, options: Render) -> Result<()> {
    if let Render::Tile(RenderTile { picture, .. }) | Render::Globe(RenderGlobe { picture, .. }) =
        &options
    {
        check(&picture.output)?;
    }
    let store = deployment::store(settings)?;
    let (asked, view, extras) = match options {
        Render::Tile(tile) => {
            let address = Tile::new(tile.z, tile.x, tile.y)?;
            (
                tile.picture,
                View::Tile {
                    tile: address,
                    size_px: tile.size,
                },
                Extras::default(),
            )
        }
        Render::Globe(globe) => {
            let view = picture::view_of(&globe)?;
            let extras = Extras::of(&globe);
            (globe.picture, view, extras)
        }
        Render::Animation(animation) => return animation::run(settings, store, animation).await,
        Render::Legend(options) => return legend::run(settings, &store, &options).await,
    };
    let job = picture::job(&store, settings, &asked, view, extras).await?;
    let notes = [sky::note(&job.view), heights::note(&store, &job).await?];
    for note in notes.into_iter().flatten() {
        progress::say(&note);
    }
    let bar = progress::bar("draw", 1);
    let desk = deployment::single_desk(settings, store).await?;
    let order = Order::on_demand(Storing::Nothing);
    let png = desk.draw(&job, order).await?.bytes;
    std::fs::write(&asked.output, &png)
        .with_context(|| format!("cannot write {}", asked.output.display()))?;
    progress::done(&bar, &format!("{} bytes", png.len()));
    progress::result(&asked.output.display().to_string())
}

/// Does a file's name say what is written? Asked before anything is drawn.
fn check(output: &Path) -> Result<()> {
    let ending = output.extension();
    if ending.is_some_and(|ending| ending.eq_ignore_ascii_case("png")) {
        return Ok(());
    }
    bail!(
        "{}: a picture is written as PNG: give a name that ends in .png",
        output.display()
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_not_written_under_the_name_of_another_form() {
        for name in ["a.png", "b/A.PNG", "year.2.png"] {
            check(Path::new(name)).unwrap();
        }
        for name in ["a.jpg", "a.webp", "a", "png", ".png", "a.png.tif"] {
            let refused = check(Path::new(name)).unwrap_err().to_string();
            assert!(
                refused.starts_with(name) && refused.contains("ends in .png"),
                "{refused}"
            );
        }
    }
}
