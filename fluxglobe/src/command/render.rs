//! `fluxglobe render`: a product, an instant and a view in, a PNG file out.

use anyhow::{Context as _, Result};
use contract::job::View;
use contract::tile::Tile;
use render_worker::desk::{Order, Storing};

use crate::cli::{Render, Settings};
use crate::command::legend;
use crate::picture::Extras;
use crate::{animation, deployment, heights, picture, progress, sky};

pub(crate) async fn run(settings: &Settings, options: Render) -> Result<()> {
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
