//! CPU twin of `eye.wgsl`. Every entry visits only the pixels it can reach: the order inside a slice cannot matter.

use glam::{UVec2, Vec2, Vec3, Vec4};

use crate::plan::Plan;
use crate::stages::compose::in_context::hidden_share;
use crate::stages::layout::{
    BEYOND_BIT, Entry, KERNEL_BALL, KERNEL_CLOUD, KERNEL_RIMMED, RADIUS_BITS, SCREEN_TILE_PX,
    SLOPE_ONE, SUBPIXELS, VIEW_TILE,
};
use crate::stages::params::Params;

const MOST_SUM: u32 = 0x7fff_ffff;
/// Where this much is covered, what lies behind is left out: it would change a byte by a fifteenth at most.
const OPAQUE: f32 = 1.0 - 1.0 / 4096.0;
/// Light 1 of a channel in the whole numbers that [`light_of`] gives: 255 squared over 16.
const LIGHT_ONE: f32 = 4064.0625;
/// Depth times light, as a share of what is added with it: an entry gives less than 2^24 to a sum.
const MOST_BRIGHT: f32 = 65_535.0;
const TILE: usize = SCREEN_TILE_PX as usize;

/// Sums of red, green, blue and optical depth of every pixel of a screen tile.
type Sums = [[u32; 4]; TILE * TILE];

/// Share of a splat's depth at a squared distance of `q` squared radii from its centre.
pub fn weight_at(kernel: u32, q: f32, radius_px: f32) -> f32 {
    if kernel == KERNEL_CLOUD {
        let inside = (1.0 - q).max(0.0);
        return inside * inside;
    }
    ((1.0 - q.sqrt()) * radius_px).clamp(0.0, 1.0)
}

/// Linear light of a channel's code in 12 bits.
fn light_of(code: u32) -> u32 {
    (code * code + 8) >> 4
}

fn ball_light(offset: Vec2) -> f32 {
    let toward = (1.0 - offset.dot(offset)).max(0.0).sqrt();
    0.4 + 0.6 * (-0.45 * offset.x - 0.55 * offset.y + 0.70 * toward).clamp(0.0, 1.0)
}

const RIM_PX: f32 = 0.7;

/// Colour of a dot whose rim stands out from the ground.
fn rimmed(params: &Params, rgb: [u32; 3], q: f32, radius_px: f32) -> [u32; 3] {
    let colour = Vec3::from(rgb.map(|channel| channel as f32));
    let inside = ((1.0 - q.sqrt()) * radius_px - RIM_PX).clamp(0.0, 1.0);
    let lists = &params.lists;
    let rim = colour * lists.rim_kept + LIGHT_ONE * lists.rim_added;
    (rim * (1.0 - inside) + colour * inside + 0.5)
        .to_array()
        .map(|channel| channel as u32)
}

/// Linear light with alpha, premultiplied, once the slice with these sums is blended into it.
pub fn blended(params: &Params, picture: Vec4, sums: [u32; 4]) -> Vec4 {
    let front_to_back = params.view.front_to_back == 1;
    if sums[3] == 0 || (front_to_back && picture.w > OPAQUE) {
        return picture;
    }
    let depth = sums[3] as f32;
    let alpha = 1.0 - (-depth / params.lists.depth_one).exp();
    let rgb = Vec4::new(
        sums[0] as f32,
        sums[1] as f32,
        sums[2] as f32,
        depth * (LIGHT_ONE / 16.0),
    ) / (depth * (LIGHT_ONE / 16.0));
    let slice = rgb * alpha;
    if front_to_back {
        picture + slice * (1.0 - picture.w)
    } else {
        picture * (1.0 - alpha) + slice
    }
}

/// What hides something beyond the sea surface, of the whole picture: its mask of land, and its trails, where it has them.
#[derive(Clone, Copy, Default)]
pub struct Hiding<'a> {
    pub coast: &'a [u32],
    pub trails: &'a [u32],
}

impl<'a> Hiding<'a> {
    /// What hides it in a planned picture.
    pub fn of(plan: &'a Plan) -> Self {
        Self {
            coast: &plan.coast,
            trails: &plan.trails,
        }
    }
}

/// What pixels of a screen tile keep of something beyond the sea surface: all where nothing hides it.
type Kept = [f32; TILE * TILE];

fn kept_beyond(params: &Params, hiding: Hiding<'_>, corner: [u32; 2]) -> Kept {
    let mut kept = [1.0; TILE * TILE];
    if params.in_context && params.context.land_hides + params.context.trails_on > 0 {
        for (at, kept) in (0..).zip(&mut kept) {
            let pixel = UVec2::from(corner) + UVec2::new(at % SCREEN_TILE_PX, at / SCREEN_TILE_PX);
            if pixel.cmplt(params.view.size_px).all() {
                let share = hidden_share(params, hiding.coast, hiding.trails, pixel.into());
                *kept = (255 - share) as f32 * 0.003_921_569;
            }
        }
    }
    kept
}

/// Every pixel from the lists that end where `list_ends` says.
pub fn eye(
    params: &Params,
    list_ends: &[u32],
    entries: &[Entry],
    hiding: Hiding<'_>,
    picture: &mut [Vec4],
) {
    for tile_y in 0..params.view.tiles.y {
        for tile_x in 0..params.view.tiles.x {
            let first_list =
                ((tile_y * params.view.tiles.x + tile_x) * params.view.slices) as usize;
            let first = if first_list == 0 {
                0
            } else {
                list_ends[first_list - 1] as usize
            };
            let ends = &list_ends[first_list..first_list + params.view.slices as usize];
            let [left, top] = [tile_x, tile_y].map(|tile| tile * SCREEN_TILE_PX);
            let tile = ScreenTile {
                corner: UVec2::new(left, top),
                kept: kept_beyond(params, hiding, [left, top]),
            };
            let slices = ends.iter().scan(first, |start, &end| {
                let begin = std::mem::replace(start, end as usize);
                Some(&entries[begin..end as usize])
            });
            let colours = tile.seen(params, slices);
            for y in top..(top + SCREEN_TILE_PX).min(params.view.size_px.y) {
                for x in left..(left + SCREEN_TILE_PX).min(params.view.size_px.x) {
                    picture[(y * params.view.size_px.x + x) as usize] =
                        colours[(y - top) as usize * TILE + (x - left) as usize];
                }
            }
        }
    }
}

/// Where a screen tile lies, and what it keeps.
struct ScreenTile {
    corner: UVec2,
    kept: Kept,
}

impl ScreenTile {
    fn seen<'a>(
        &self,
        params: &Params,
        slices: impl Iterator<Item = &'a [Entry]>,
    ) -> [Vec4; TILE * TILE] {
        let mut colours = [Vec4::ZERO; TILE * TILE];
        for slice in slices.filter(|slice| !slice.is_empty()) {
            let mut sums = [[0u32; 4]; TILE * TILE];
            for entry in slice {
                add(params, entry, self, &mut sums);
            }
            for (colour, sums) in colours.iter_mut().zip(sums) {
                *colour = blended(params, *colour, sums);
            }
        }
        colours
    }

    /// How a cloud's light rises across it, for each radius: away from the middle of the earth as it is seen.
    fn slope(&self, params: &Params, entry: &Entry, place: Vec2) -> Vec2 {
        let view = &params.view;
        if params.lists.kernel != KERNEL_CLOUD || view.kind == VIEW_TILE {
            return Vec2::ZERO;
        }
        let middle = Vec2::new(-view.eye.dot(view.right), view.eye.dot(view.up)) * view.focal_px;
        let corner = (self.corner.as_ivec2() + view.origin_px).as_vec2();
        let up = middle + (corner + place - view.center_px) * view.eye.dot(view.forward);
        let slope = ((entry.colour >> 24) as i32 - 128) as f32 / SLOPE_ONE;
        -up / up.dot(up).max(1.0e-12).sqrt() * slope
    }
}

fn add(params: &Params, entry: &Entry, tile: &ScreenTile, sums: &mut Sums) {
    let pixel_units = SUBPIXELS as f32 / (1u32 << params.lists.entry_shift) as f32;
    let radius = (entry.size & RADIUS_BITS) as f32;
    let inverse_radius = 1.0 / radius;
    let depth = (entry.size >> 16) as f32;
    let is_beyond = entry.size & BEYOND_BIT != 0;
    let rgb = [0, 8, 16].map(|shift| light_of((entry.colour >> shift) & 255));
    let [east, south] =
        [(entry.place << 16) as i32 >> 16, entry.place as i32 >> 16].map(|place| place as f32);
    // A pixel more on either side: what lies outside the radius adds nothing.
    let reach = |place: f32| {
        let low = ((place - radius) / pixel_units - 1.5).max(0.0) as usize;
        let end = ((place + radius) / pixel_units + 1.5).clamp(0.0, TILE as f32) as usize;
        low.min(end)..end
    };
    let slope = tile.slope(params, entry, Vec2::new(east, south) / pixel_units);
    for y in reach(south) {
        for x in reach(east) {
            let center = Vec2::new(x as f32 + 0.5, y as f32 + 0.5) * pixel_units;
            let offset = (center - Vec2::new(east, south)) * inverse_radius;
            let q = offset.dot(offset);
            let weight = weight_at(params.lists.kernel, q, radius / pixel_units);
            let kept = if is_beyond {
                tile.kept[y * TILE + x]
            } else {
                1.0
            };
            let share = depth * weight * kept;
            let amount = (share + 0.5) as u32;
            let bright = ((share * (1.0 + slope.dot(offset))).min(MOST_BRIGHT) + 0.5) as u32;
            let sum = &mut sums[y * TILE + x];
            let own = if params.lists.kernel == KERNEL_RIMMED {
                rimmed(params, rgb, q, radius / pixel_units)
            } else {
                rgb
            };
            for (channel, plain) in own.into_iter().enumerate() {
                let lit = if params.lists.kernel == KERNEL_BALL {
                    (plain as f32 * ball_light(offset) + 0.5) as u32
                } else {
                    plain
                };
                sum[channel] = (sum[channel] + ((lit * bright + 8) >> 4)).min(MOST_SUM);
            }
            sum[3] = (sum[3] + amount).min(MOST_SUM);
        }
    }
}
