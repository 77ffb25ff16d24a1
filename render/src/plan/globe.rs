//! Plans of globe views: a perspective camera over a place.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use contract::camera::CORE_DEPTH_M;
use contract::earth::SPHERE_RADIUS_M;
use contract::grid::Grid;
use contract::heights::{HEIGHT_LIMIT_M, SHEET_M};
use contract::job::{Mode, RenderJob};
use glam::{DVec3, UVec2};

use super::camera::Camera;
use super::extent::Extent;
use super::footprint::Footprint;
use super::look::{self, Look};
use super::{Plan, area_m2, cell_px, entry_shift, flow, height_range_m};
use crate::scene::Scene;
use crate::stages::interpolate::params::InterpolateParams;
use crate::stages::layout::{Col, LIGHT_OFF, Row, VIEW_GLOBE};
use crate::stages::params::Params;

/// Light texels at most, the side of their square: 192 layers of them are 79 MB.
const MOST_LIGHT_TEXELS: f64 = 320.0;
/// The same over a region, whose light does not reach round half the globe. Finer texels are hardly better and slower,
/// because neighbours share fewer: 4.5 M particles take 0.823, 0.833, 0.847 and 0.97 ms with 160, 192, 224 and 320.
const MOST_REGION_TEXELS: f64 = 160.0;
/// Most layers of the light: over a region in fine cells 128, 192 and 256 come to a mean FLIP of 0.034, 0.029 and 0.026.
const MOST_LAYERS: f64 = 192.0;
/// Parts of a light texel that positions are rounded to.
const LIGHT_UNIT: i32 = 256;

/// Where cells have this share of their width elsewhere, they crowd.
const CROWDED_COSINE: f64 = 0.25;
/// Largest particle on the screen over one on the ground below the camera.
const NEAREST_OVER_FARTHEST: f64 = 4.0;

// The core hides nothing that is drawn.
const _: () = assert!(CORE_DEPTH_M > HEIGHT_LIMIT_M + SHEET_M);

/// The part of the shell that is drawn; lengths in earth radii.
struct Cap<'a> {
    /// Lowest and highest particle, from the sea surface.
    heights: [f64; 2],
    /// Its middle.
    center: DVec3,
    /// From there to its edge, radians.
    angle: f64,
    /// Of a full-size particle.
    radius: f64,
    /// Where particles can be, of a regional product.
    extent: Option<&'a Extent>,
    footprint: &'a Footprint,
}

pub(super) fn plan(plan: &mut Plan, job: &RenderJob, scene: &Scene) {
    let Some(camera) = Camera::of(&job.view) else {
        return;
    };
    let [width_px, height_px] = job.view.size_px();
    let grid = &scene.grid;
    let cell_px = cell_px(&job.view, grid);
    let params = &mut plan.params;
    params.view.kind = VIEW_GLOBE;
    params.context.surface = u32::from(job.style.globe_surface);
    params.view.hides = camera.hides() as f32;
    params.thematic.edge_sharpness = cell_px.max(1.0) as f32;
    params.projection.per_earth_radius_m = (1.0 / SPHERE_RADIUS_M) as f32;
    params.view.center_px = UVec2::new(width_px, height_px).as_vec2() / 2.0;
    camera.write(&mut params.view);
    let sun = camera.sun(job);
    params.view.sun = sun.as_vec3();
    if job.mode == Mode::Map {
        // Isolines look two rows beyond the place of a pixel, which single precision puts a little beside itself.
        let margin = 3.0 * grid.dlat_deg.to_radians();
        interpolate_rows(plan, grid, &camera.footprint(job, [0.0; 2], margin));
        return;
    }
    let look = Look::of_job(job);
    let particles = look.particles_per_cell(cell_px, job.style.particles_per_cell);
    params.cells.set_particles(particles);
    let radius_px = look.radius_px(cell_px, particles);
    // Particles lifted close to the camera are left out rather than fill the picture.
    let widest_px = NEAREST_OVER_FARTHEST * radius_px + 16.0;
    params.projection.max_radius_px = widest_px as f32;
    params.lists.entry_shift = entry_shift(widest_px);
    let style_depth = job.style.optical_depth;
    let rows_of = |grid: &Grid| rows(grid, &look, &camera, particles, style_depth);
    plan.rows = rows_of(grid);
    plan.whole_rows = scene
        .whole
        .iter()
        .flat_map(|it| rows_of(&it.grid))
        .collect();
    let heights = height_range_m(job, scene).map(|height_m| height_m / SPHERE_RADIUS_M);
    let radius = radius_px / camera.focal_px * camera.nearest;
    // From a cell's middle to its corner, and from there as far as its particles drift.
    let half_cell = (grid.dlon_deg.hypot(grid.dlat_deg) / 2.0).to_radians();
    let margin = radius + half_cell + flow::plan(plan, job, scene);
    let footprint = camera.footprint(job, heights, margin);
    let all = scene.whole.as_ref().map_or(grid, |whole| &whole.grid);
    let extent = Extent::of(all, heights);
    let cap = |angle| Cap {
        heights,
        center: footprint.center,
        angle,
        radius,
        extent: extent.as_ref(),
        footprint: &footprint,
    };
    // What lies beyond the seen cap falls into the first or last slice, from where it shadows as it should.
    let half = slice_planes(plan, job, &camera, sun, &cap(footprint.seen));
    light_frame(plan, &camera, sun, half, &cap(footprint.seen));
    choose_cells(plan, scene, &camera, &footprint);
    plan.is_crowded = is_crowded(plan, &camera, &cap(footprint.seen));
}

/// Is there ground seen so flat, or so near a pole, that cells are many times narrower than elsewhere?
fn is_crowded(plan: &Plan, camera: &Camera, cap: &Cap<'_>) -> bool {
    if camera.is_below() {
        // All round, the sea surface is seen flatter the farther away it is.
        return true;
    }
    let is_flat = |normal: DVec3| {
        let sight = camera.place - normal;
        sight.dot(normal) < CROWDED_COSINE * sight.length()
    };
    let horizon = (1.0 / (1.0 + camera.height)).acos();
    let is_limb_seen = cap.extent.map_or(cap.angle >= horizon, |extent| {
        extent
            .places()
            .any(|place| is_flat(place.normalize_or_zero()))
    });
    let first = plan.params.cells.first_row as usize;
    let rows = &plan.rows[first..first + plan.params.cells.row_count as usize];
    let is_pole_seen = rows
        .iter()
        .any(|row| f64::from(row.cos_lat) < CROWDED_COSINE);
    is_limb_seen || is_pole_seen
}

/// Rows that are seen.
fn interpolate_rows(plan: &mut Plan, grid: &Grid, footprint: &Footprint) {
    let angle = footprint.seen;
    let below_deg = footprint.center.z.clamp(-1.0, 1.0).asin().to_degrees();
    let row = |lat_deg: f64| {
        ((grid.north_deg - lat_deg) / grid.dlat_deg).clamp(0.0, f64::from(grid.rows))
    };
    let first = row(below_deg + angle.to_degrees()).floor() as u32;
    let end = row(below_deg - angle.to_degrees()).ceil() as u32;
    plan.params.interpolation = InterpolateParams {
        first_cell: first * grid.cols,
        end_cell: end.max(first) * grid.cols,
    };
}

fn rows(grid: &Grid, look: &Look, camera: &Camera, particles: f64, style_depth: f64) -> Vec<Row> {
    (0..grid.rows)
        .map(|row| {
            let (north, south) = (
                grid.row_north_deg(row).to_radians(),
                grid.row_north_deg(row + 1).to_radians(),
            );
            let lat = 0.5 * (north + south);
            let area = (north.sin() - south.sin()) * grid.dlon_deg.to_radians();
            let per_radian_px = camera.focal_px / camera.nearest;
            let side = Look::side(area / (north - south), north - south);
            let radius = look.radius_px(side * per_radian_px, particles) / per_radian_px;
            Row {
                sin_lat: lat.sin() as f32,
                cos_lat: lat.cos() as f32,
                lat_span_rad: (north - south) as f32,
                radius: radius as f32,
                area_m2: area_m2(grid, row),
                depth_gain: look.depth_gain(area, radius, particles, style_depth) as f32,
                ..Row::default()
            }
        })
        .collect()
}

/// Slices across the half-way vector between light and view, over what is visible; the vector comes back.
fn slice_planes(
    plan: &mut Plan,
    job: &RenderJob,
    camera: &Camera,
    sun: DVec3,
    cap: &Cap<'_>,
) -> DVec3 {
    let toward = -camera.forward;
    let front_to_back = sun.dot(toward) >= 0.0;
    let view = if front_to_back { toward } else { -toward };
    let half = half_way(sun, view, camera);
    let [bottom, top] = reach_along(half, cap);
    let Params {
        view, projection, ..
    } = &mut plan.params;
    view.front_to_back = u32::from(front_to_back);
    projection.half = half.as_vec3();
    projection.slice_top = top as f32;
    projection.slices_per_unit = (f64::from(job.style.slices) / (top - bottom)) as f32;
    half
}

/// Least and largest coordinate along a direction of what is drawn.
fn reach_along(direction: DVec3, cap: &Cap<'_>) -> [f64; 2] {
    let Cap { heights, angle, .. } = *cap;
    let tilt = direction.dot(cap.center).clamp(-1.0, 1.0).acos();
    let reach = |cosine: f64| {
        if cosine > 0.0 {
            [1.0 + heights[0], 1.0 + heights[1]]
        } else {
            [1.0 + heights[1], 1.0 + heights[0]]
        }
    };
    let near = (tilt - angle).max(0.0).cos();
    let far = (tilt + angle).min(PI).cos();
    let (mut top, mut bottom) = (reach(near)[1] * near + 1e-4, reach(far)[0] * far - 1e-4);
    if let Some([low, high]) = cap.footprint.along(direction) {
        // Clouds reach into the picture from half a radius beyond its edge.
        (top, bottom) = (
            high + 0.5 * cap.radius + 1e-4,
            low - 0.5 * cap.radius - 1e-4,
        );
    }
    if let Some(extent) = cap.extent {
        let [low, high] = extent.along(direction);
        // A region that is not in sight leaves nothing to cut.
        let (own_top, own_bottom) = (top.min(high), bottom.max(low));
        if own_top - own_bottom > 1e-4 {
            (top, bottom) = (own_top, own_bottom);
        }
    }
    [bottom, top]
}

/// Half-way between two directions, but so near the line of sight that all sight lines of the picture meet the slices in
/// one order.
fn half_way(sun: DVec3, view: DVec3, camera: &Camera) -> DVec3 {
    let sum = sun + view;
    let half = sum / sum.length();
    let most = camera.most_half_angle();
    if camera.is_upright() || half.dot(view) >= most.cos() {
        return half;
    }
    let across = sun - view * sun.dot(view);
    view * most.cos() + across / across.length() * most.sin()
}

/// The light's texels and layers over what is seen, and how places are looked up in them.
fn light_frame(plan: &mut Plan, camera: &Camera, sun: DVec3, half: DVec3, cap: &Cap<'_>) {
    let Cap {
        heights,
        angle,
        radius,
        ..
    } = *cap;
    let Params {
        projection,
        lighting,
        ..
    } = &mut plan.params;
    if lighting.mode == LIGHT_OFF {
        return;
    }
    let across = if sun.cross(half).length() > 1e-6 {
        sun.cross(half)
    } else {
        camera.right
    };
    let axis_u = across / across.length();
    let axis_v = sun.cross(axis_u);
    // Every point of the cap lies within a chord of its middle.
    let chord = if angle >= FRAC_PI_2 {
        1.0 + heights[1]
    } else {
        2.0 * (angle / 2.0).sin() * (1.0 + heights[1])
    };
    let reach = chord + heights[1].max(-heights[0]);
    let [span_u, span_v] = [axis_u, axis_v].map(|axis| {
        // What shadows a place has its place in the light, however far it is towards the sun.
        let middle = cap.center.dot(axis);
        let seen = cap.footprint.along(axis);
        let [from, to] = seen.unwrap_or([middle - reach, middle + reach]);
        let [low, high] = cap.extent.map_or([-2.0, 2.0], |e| e.along(axis));
        // Clouds look their light up within their radius, and are seen from a radius beyond the edge.
        let low = (from - 2.0 * radius).max(low - radius);
        [low, (to + 2.0 * radius).min(high + radius).max(low)]
    });
    let lengths = [span_u, span_v].map(|[low, high]| high - low);
    let side = (lengths[0] * lengths[1]).sqrt();
    let most_texels = match cap.extent {
        Some(_) => MOST_REGION_TEXELS,
        None => MOST_LIGHT_TEXELS,
    };
    let texel = (look::TEXEL_PER_RADIUS * radius).max(side / most_texels);
    lighting.unit = LIGHT_UNIT;
    lighting.size = lengths
        .map(|length| (length / texel).ceil() as u32 + 2)
        .into();
    (projection.light_u, projection.light_v) = (axis_u.as_vec3(), axis_v.as_vec3());
    (projection.light_u0, projection.light_v0) = (span_u[0] as f32, span_v[0] as f32);
    projection.light_texels_per_unit = (1.0 / texel) as f32;
    projection.light_depth_gain = (look::LIGHT_DEPTH * PI / 3.0 / (texel * texel)) as f32;
    lighting.part = (texel / f64::from(LIGHT_UNIT)) as f32;
    places_in_light(plan, camera, half, [axis_u, axis_v, sun]);
    let lighting = &mut plan.params.lighting;
    let [bottom, top] = reach_along(sun, cap);
    let layer = (look::LAYER_PER_RADIUS * radius).max((top - bottom) / MOST_LAYERS);
    lighting.layers = ((top - bottom) / layer).ceil() as u32;
    (lighting.deeper, lighting.first_layer) = ((-1.0 / layer) as f32, (top / layer) as f32);
    lighting.look_power = look::LOOK_POWER_GLOBE as f32;
}

/// How places are counted in the light, with its axes across, down and towards the sun, and where eye and earth are there.
fn places_in_light(plan: &mut Plan, camera: &Camera, half: DVec3, axes: [DVec3; 3]) {
    let Params {
        projection,
        lighting,
        ..
    } = &mut plan.params;
    // Of a place v down the light and h along the half-way vector, that along the sun is (h - v (half . down)) / (half . sun).
    let [_across, down, along] = axes.map(|axis| half.dot(axis));
    let (u0, v0) = (
        f64::from(projection.light_u0),
        f64::from(projection.light_v0),
    );
    lighting.sunward = ((f64::from(projection.slice_top) - v0 * down) / along) as f32;
    lighting.sunward_per_part = (-f64::from(lighting.part) * down / along) as f32;
    lighting.sunward_per_slice = (-1.0 / (f64::from(projection.slices_per_unit) * along)) as f32;
    let in_light =
        |place: DVec3| DVec3::from(axes.map(|axis| place.dot(axis))) - DVec3::new(u0, v0, 0.0);
    let per_px = 1.0 / camera.focal_px;
    lighting.toward = (in_light(camera.place) * per_px).as_vec3();
    lighting.toward_pull = per_px as f32;
    lighting.earth = in_light(DVec3::ZERO).as_vec3();
}

/// Longitudes on either side of a cap's middle that it reaches; all of them round a pole.
fn half_width(center: DVec3, angle: f64) -> f64 {
    let lat = center.z.clamp(-1.0, 1.0).asin();
    if lat.abs() + angle >= FRAC_PI_2 {
        return PI;
    }
    // A little more, so that what is on the edge is left to the test of the cap.
    (angle.sin() / lat.cos()).clamp(0.0, 1.0).asin() + 1e-3
}

/// Rows and columns that a planned picture can show something of.
pub(super) fn seen(plan: &Plan, job: &RenderJob, grid: &Grid) -> [Vec<u32>; 2] {
    /// What single precision may put a place beside itself, radians.
    const SLACK: f64 = 1e-3;
    let (rows, center, angle) = if plan.mode == Mode::Map {
        let Some(camera) = Camera::of(&job.view) else {
            return [vec![], vec![]];
        };
        let shown = plan.params.interpolation;
        let footprint = camera.footprint(job, [0.0; 2], 3.0 * grid.dlat_deg.to_radians());
        let rows = shown.first_cell / grid.cols..shown.end_cell / grid.cols;
        (rows, footprint.center, footprint.seen)
    } else {
        let (cells, view) = (&plan.params.cells, &plan.params.view);
        let cap = view.cap.as_dvec3();
        let cosine = f64::from(view.cap_least) / cap.length();
        let angle = cosine.clamp(-1.0, 1.0).acos();
        let rows = cells.first_row..cells.first_row + cells.row_count;
        (rows, cap.normalize_or_zero(), angle)
    };
    let across = half_width(center, angle + SLACK) + grid.dlon_deg.to_radians();
    let middle = center.x.atan2(center.y);
    let is_near = |col: &u32| {
        let lon = (grid.col_west_deg(*col) + 0.5 * grid.dlon_deg).to_radians();
        ((lon - middle + PI).rem_euclid(TAU) - PI).abs() <= across
    };
    [rows.collect(), (0..grid.cols).filter(is_near).collect()]
}

/// Fills the table of columns and sets the rows and the cap that are drawn.
fn choose_cells(plan: &mut Plan, scene: &Scene, camera: &Camera, footprint: &Footprint) {
    let grid = &scene.grid;
    let Footprint { center, drawn, .. } = *footprint;
    let lon = |col: u32| (grid.col_west_deg(col) + 0.5 * grid.dlon_deg).to_radians();
    // A trail is many splats: columns that have no cell in the cap get no place for them.
    let across = if plan.mode == Mode::Flow {
        half_width(center, drawn)
    } else {
        PI
    };
    let middle = center.x.atan2(center.y);
    plan.cols = (0..grid.cols)
        .filter(|&col| ((lon(col) - middle + PI).rem_euclid(TAU) - PI).abs() <= across)
        .map(|col| Col {
            sin_lon: lon(col).sin() as f32,
            cos_lon: lon(col).cos() as f32,
            index: col,
            ..Col::default()
        })
        .collect();
    let distance = camera.place.length();
    let view = &mut plan.params.view;
    view.cap = (center * distance).as_vec3();
    view.cap_least = (drawn.cos() * distance) as f32;
    let cells = &mut plan.params.cells;
    cells.slot_count = plan.cols.len() as u32;
    // Rows with a middle in the cap, one more on either side: the cap itself is tested cell by cell.
    let below = center.z.clamp(-1.0, 1.0).asin();
    let is_near = |row: u32| {
        let lat = f64::from(plan.rows[row as usize].sin_lat).asin();
        (lat - below).abs() <= drawn + grid.dlat_deg.to_radians()
    };
    let first = (0..grid.rows).find(|&row| is_near(row));
    let last = (0..grid.rows).rfind(|&row| is_near(row));
    cells.first_row = first.unwrap_or(0);
    cells.row_count = last.map_or(0, |row| row + 1) - cells.first_row;
}
