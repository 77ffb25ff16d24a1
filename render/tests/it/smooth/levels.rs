//! No popping between zoom levels: a map tile against its four children, halved.

use std::ops::RangeInclusive;

use contract::job::{Mode, RenderJob, View};
use contract::tile::Tile;
use render::{Backend, Image, Renderer, Scene};
use render_proof::ocean::{ONE_DEGREE, REGION};

use crate::scenes::{job, ocean};

const TILE_PX: u32 = 256;

/// Four tiles of the next level as one picture, each pixel the mean of four; premultiplied channels, levels.
fn halved(children: &[Image; 4]) -> Vec<f64> {
    let half = TILE_PX / 2;
    let pixel = |x: u32, y: u32| {
        let child = &children[(y / half * 2 + x / half) as usize];
        let corner = [x % half * 2, y % half * 2];
        let four = [[0, 0], [1, 0], [0, 1], [1, 1]];
        let four = four.map(|[dx, dy]| premultiplied(child.pixel(corner[0] + dx, corner[1] + dy)));
        std::array::from_fn::<f64, 4, _>(|i| four.iter().map(|p| p[i]).sum::<f64>() / 4.0)
    };
    let pixels = (0..TILE_PX).flat_map(|y| (0..TILE_PX).map(move |x| (x, y)));
    pixels.flat_map(|(x, y)| pixel(x, y)).collect()
}

fn premultiplied(rgba8: [u8; 4]) -> [f64; 4] {
    let alpha = f64::from(rgba8[3]) / 255.0;
    std::array::from_fn(|i| {
        if i == 3 {
            255.0 * alpha
        } else {
            f64::from(rgba8[i]) * alpha
        }
    })
}

/// A level of the map over a place, and how far its tile is from its children.
struct Step {
    z: u8,
    /// Over all channels, levels of 8 bits.
    mean: f64,
    /// Which one channel in a thousand is beyond.
    most: f64,
}

/// Where steps are looked at: shares of the map's width and height, in cells of a degree with coasts, and in cells of an
/// eighth of one, which are joined at far levels.
#[derive(Debug, Clone, Copy)]
enum Sea {
    Ocean,
    Region,
}

impl Sea {
    fn scene(self) -> Scene {
        match self {
            Self::Ocean => ocean(ONE_DEGREE),
            Self::Region => ocean(REGION),
        }
    }

    fn place(self) -> [f64; 2] {
        match self {
            Self::Ocean => [0.16, 0.42],
            Self::Region => [0.13, 0.44],
        }
    }
}

const LEVELS: RangeInclusive<u8> = 2..=7;

/// The steps between levels; `change` is what children are drawn with that the tile is not.
fn steps(mode: Mode, sea: Sea, change: impl Fn(&mut RenderJob)) -> Vec<Step> {
    let renderer = Renderer::new(Backend::Cpu).unwrap();
    let scene = sea.scene();
    let job_of = |tile: Tile| {
        let view = View::Tile {
            tile,
            size_px: TILE_PX,
        };
        let mut job = job(mode, view);
        // Low enough that no level is flattened: those have a scale of their own, as docs/method.md says.
        job.style.height_m_per_kg_m2 = 1e6;
        job
    };
    let step = |z: u8| {
        let side = f64::from(1u32 << z);
        let [x, y] = sea.place().map(|share| (share * side) as u32);
        let whole = renderer.render(&job_of(Tile { z, x, y }), &scene).unwrap();
        let children = [[0, 0], [1, 0], [0, 1], [1, 1]].map(|[east, south]| {
            let mut job = job_of(Tile {
                z: z + 1,
                x: 2 * x + east,
                y: 2 * y + south,
            });
            change(&mut job);
            renderer.render(&job, &scene).unwrap()
        });
        let pixels = whole.rgba8.chunks_exact(4);
        let whole = pixels.flat_map(|p| premultiplied([p[0], p[1], p[2], p[3]]));
        let apart = whole.zip(halved(&children)).map(|(a, b)| (a - b).abs());
        let mut apart: Vec<f64> = apart.collect();
        apart.sort_unstable_by(f64::total_cmp);
        Step {
            z,
            mean: apart.iter().sum::<f64>() / apart.len() as f64,
            most: apart[apart.len() * 999 / 1000],
        }
    };
    LEVELS.map(step).collect()
}

/// What is allowed at each level: a third more than was measured. Far levels have coasts and edges of data, a pixel of which
/// is one of the next level's four; in the region the number of clouds a cell goes from one to several from level 4 to 6.
fn bounds(mode: Mode, sea: Sea) -> [[f64; 2]; 6] {
    match (mode, sea) {
        (Mode::Map, Sea::Ocean) => [
            [0.28, 12.0],
            [0.29, 10.0],
            [0.14, 9.0],
            [0.10, 6.0],
            [0.05, 2.0],
            [0.03, 2.0],
        ],
        (Mode::Map, Sea::Region) => [
            [0.22, 60.0],
            [0.16, 20.0],
            [0.11, 2.0],
            [0.09, 2.0],
            [0.04, 2.0],
            [0.02, 2.0],
        ],
        (_, Sea::Ocean) => [
            [2.6, 56.0],
            [0.39, 2.6],
            [0.26, 1.7],
            [0.22, 1.4],
            [0.13, 1.4],
            [0.06, 1.4],
        ],
        (_, Sea::Region) => [
            [0.8, 35.0],
            [0.63, 15.0],
            [2.6, 23.0],
            [4.1, 19.0],
            [0.57, 2.6],
            [0.37, 1.8],
        ],
    }
}

/// The steps that are larger than what is allowed.
fn pops(mode: Mode, sea: Sea, change: impl Fn(&mut RenderJob)) -> Vec<String> {
    let steps = steps(mode, sea, change);
    let mut found = vec![];
    for (step, [mean, most]) in steps.iter().zip(bounds(mode, sea)) {
        let Step {
            z,
            mean: own,
            most: own_most,
        } = step;
        let told = format!(
            "{mode} {sea:?}, level {z}: {own:.3} levels in the mean, {own_most:.2} at most"
        );
        println!("{told}");
        if *own > mean || *own_most > most {
            found.push(format!("{told}; {mean} and {most} are allowed"));
        }
    }
    found
}

#[test]
fn a_tile_is_nearly_the_mean_of_its_four_children() {
    for mode in [Mode::Map, Mode::Volume] {
        for sea in [Sea::Ocean, Sea::Region] {
            let found = pops(mode, sea, |_job| ());
            assert!(found.is_empty(), "{found:#?}");
        }
    }
}

#[test]
fn children_of_another_depth_or_in_another_light_pop() {
    // A twentieth more depth; light from five degrees lower.
    let deeper = |job: &mut RenderJob| job.style.optical_depth *= 1.05;
    let lower = |job: &mut RenderJob| job.style.sun.elevation_deg -= 5.0;
    for (name, change) in [("depth", deeper as fn(&mut RenderJob)), ("light", lower)] {
        let found = pops(Mode::Volume, Sea::Ocean, change);
        // Coasts of far levels differ more than that.
        assert!(found.len() >= 5, "{name}: {found:#?}");
    }
    let paler = |job: &mut RenderJob| job.style.transfer.high *= 1.05;
    let found = pops(Mode::Map, Sea::Ocean, paler);
    assert!(found.len() >= 5, "{found:#?}");
}
