//! Which scenes are measured: a set and a part of a name in, views of generated oceans and of a landed product out.

use ::render::Scene;
use anyhow::{Context as _, Result, bail};
use contract::colour::TransferFunction;
use contract::grid::Grid;
use contract::job::{Mode, RenderJob, Style, View};
use contract::manifest::Manifest;
use contract::picture::PictureSources;
use render_proof::ocean;
use render_proof::views::{globe, looking_at, tile};
use render_worker::Desk;
use storage::Store;

use crate::cli::QualityScenes;
use crate::picture;

/// Side of map tiles, pixels.
const TILE_PX: u32 = 256;

/// Something to draw.
pub(super) struct Subject {
    pub(super) name: String,
    pub(super) job: RenderJob,
    pub(super) scene: Scene,
}

/// What a scene is drawn from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Source {
    /// Flux and carbon made up by formulas, in cells of a degree.
    Generated,
    /// The same in a region of cells of an eighth of a degree.
    Region,
    /// The product that was asked for.
    Landed,
}

/// A scene before it is made; `view` is that of pictures so many pixels wide and high.
pub(super) struct Outline {
    name: &'static str,
    set: QualityScenes,
    source: Source,
    view: fn(u32) -> View,
}

impl Outline {
    /// What people call it.
    fn name_of(&self, product: &str) -> String {
        match self.source {
            Source::Generated | Source::Region => format!("generated, {}", self.name),
            Source::Landed => format!("{product}, {}", self.name),
        }
    }

    /// Can it be drawn only where the product has landed?
    pub(super) fn needs_product(&self) -> bool {
        self.source == Source::Landed
    }
}

const fn usual(name: &'static str, source: Source, view: fn(u32) -> View) -> Outline {
    Outline {
        name,
        set: QualityScenes::Usual,
        source,
        view,
    }
}

const fn held_out(name: &'static str, source: Source, view: fn(u32) -> View) -> Outline {
    Outline {
        name,
        set: QualityScenes::HeldOut,
        source,
        view,
    }
}

/// Constants of the method (how far before and behind its centre a cloud looks its light up, by what power looks count)
/// were fitted to the usual scenes. To the held-out ones none is fitted, ever: they tell whether a constant is right
/// or merely suits.
const OUTLINES: [Outline; 12] = [
    usual("coast from 2200 km", Source::Generated, |px| {
        globe(-122.0, 27.0, 2.2e6, px)
    }),
    usual("equator from 4000 km", Source::Generated, |px| {
        globe(-150.0, 0.0, 4.0e6, px)
    }),
    usual("map tile 3/1/3", Source::Generated, |_px| {
        tile(3, 1, 3, TILE_PX)
    }),
    usual(
        "a region in fine cells from 5300 km",
        Source::Region,
        |px| globe(-135.0, 20.5, 5.3e6, px),
    ),
    usual("North Atlantic from 4000 km", Source::Landed, |px| {
        globe(-40.0, 45.0, 4.0e6, px)
    }),
    usual("map tile 3/0/3", Source::Landed, |_px| {
        tile(3, 0, 3, TILE_PX)
    }),
    held_out(
        "equatorial Pacific from 3000 km, tilt 60",
        Source::Landed,
        |px| looking_at([-140.0, 0.0], 3.0e6, [250.0, 60.0], px),
    ),
    held_out(
        "southern coast from 2500 km, tilt 45",
        Source::Generated,
        |px| looking_at([-82.0, -20.0], 2.5e6, [30.0, 45.0], px),
    ),
    held_out("limb from 2000 km, tilt 70", Source::Generated, |px| {
        looking_at([165.0, -45.0], 2.0e6, [110.0, 70.0], px)
    }),
    held_out(
        "a region in fine cells from 3000 km, tilt 50",
        Source::Region,
        |px| looking_at([-135.0, 22.0], 3.0e6, [200.0, 50.0], px),
    ),
    held_out("map tile 4/13/9", Source::Landed, |_px| {
        tile(4, 13, 9, TILE_PX)
    }),
    held_out("Indian Ocean from 12000 km", Source::Landed, |px| {
        globe(75.0, -25.0, 1.2e7, px)
    }),
];

/// The scenes of a set whose names hold a text, whatever its case.
///
/// # Errors
/// No name does; the error lists those of the set.
pub(super) fn outlines(
    set: QualityScenes,
    only: Option<&str>,
    product: &str,
) -> Result<Vec<&'static Outline>> {
    let of_set = || {
        OUTLINES
            .iter()
            .filter(move |outline| set == QualityScenes::All || outline.set == set)
    };
    let wanted = only.unwrap_or_default().to_lowercase();
    let is_wanted = |outline: &&Outline| outline.name_of(product).to_lowercase().contains(&wanted);
    let found: Vec<_> = of_set().filter(is_wanted).collect();
    if found.is_empty() {
        let names: Vec<_> = of_set().map(|outline| outline.name_of(product)).collect();
        bail!(
            "no scene has {wanted:?} in its name; there are:\n  {}",
            names.join("\n  ")
        );
    }
    Ok(found)
}

/// Makes a scene; none if it is one of a product that has not landed.
pub(super) async fn subject(
    outline: &Outline,
    desk: &Desk,
    store: &Store,
    manifest: Option<&Manifest>,
    size: u32,
) -> Result<Option<Subject>> {
    let view = (outline.view)(size);
    let generated = |grid: Grid, particles_per_cell: Option<u32>| {
        let mut job = ocean::job(view);
        job.style.particles_per_cell = particles_per_cell.unwrap_or(job.style.particles_per_cell);
        Subject {
            name: outline.name_of(""),
            job,
            scene: ocean::scene(grid),
        }
    };
    match (outline.source, manifest) {
        (Source::Generated, _) => Ok(Some(generated(ocean::ONE_DEGREE, None))),
        (Source::Region, _) => Ok(Some(generated(ocean::REGION, Some(1)))),
        (Source::Landed, None) => Ok(None),
        (Source::Landed, Some(manifest)) => {
            let (job, scene) = landed(desk, store, manifest, view).await?;
            let name = outline.name_of(manifest.product.as_str());
            Ok(Some(Subject { name, job, scene }))
        }
    }
}

/// A landed product at the middle of its last step.
pub(in crate::bench) async fn landed(
    desk: &Desk,
    store: &Store,
    manifest: &Manifest,
    view: View,
) -> Result<(RenderJob, Scene)> {
    let last = manifest.steps.last().context("the product has no step")?;
    let accumulated = picture::accumulated(store, manifest).await?;
    let style = Style::with_transfer(TransferFunction::default_for(manifest.quantity));
    let sources = PictureSources {
        accumulated: accumulated.as_ref(),
        ..PictureSources::of(manifest)
    };
    let job = sources.job(Mode::Volume, view, last.period.mid(), style)?;
    let scene = desk.pipeline().scene(&job).await?;
    Ok((job, scene))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_tilted(view: &View) -> bool {
        matches!(view, View::Globe { angles, .. } if angles.tilt_deg > 20.0)
    }

    #[test]
    fn half_of_the_held_out_scenes_at_least_are_tilted_and_none_is_a_usual_one() {
        let views = |set| -> Vec<View> {
            let found = outlines(set, None, "p").unwrap();
            found.iter().map(|outline| (outline.view)(160)).collect()
        };
        let (usual, held_out) = (views(QualityScenes::Usual), views(QualityScenes::HeldOut));
        assert_eq!((usual.len(), held_out.len()), (6, 6));
        assert_eq!(views(QualityScenes::All).len(), 12);
        assert!(held_out.iter().filter(|view| is_tilted(view)).count() >= 3);
        assert!(held_out.iter().all(|view| !usual.contains(view)));
        let tiles = held_out
            .iter()
            .filter(|view| matches!(view, View::Tile { .. }));
        assert_eq!(tiles.count(), 1);
    }

    #[test]
    fn a_part_of_a_name_picks_scenes_and_one_that_no_name_has_is_answered_with_all_names() {
        let found = outlines(QualityScenes::HeldOut, Some("LIMB"), "p").unwrap();
        assert_eq!(found.len(), 1);
        assert_eq!(
            found[0].name_of("p"),
            "generated, limb from 2000 km, tilt 70"
        );
        let found = outlines(QualityScenes::Usual, Some("takahashi"), "takahashi09-flux").unwrap();
        assert_eq!(found.len(), 2);
        let refused = outlines(QualityScenes::Usual, Some("limb"), "p")
            .err()
            .unwrap();
        let text = refused.to_string();
        assert!(text.contains("generated, map tile 3/1/3"), "{text}");
    }
}
