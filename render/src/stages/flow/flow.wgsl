// Particles that drift: where the water takes each of them in its life, and the trail that it leaves. Reads `velocity`,
// `rows`, `cols` and `palette`. Places are columns east and rows south of the corner of the cell of birth.
//
// A particle is at its birthplace in the middle of its life and comes from upstream, which halves how far particles
// must be looked for beyond the edge of a picture.
struct FlowParams {
    turn: f32, cycle: u32, share: u32, lead_steps: u32, cols_per_m_s: f32, rows_per_m_s: f32, most_cols: f32,
    most_m_s: f32, px_per_m_s: f32, transfer_low: f32, transfer_per_unit: f32, has_shape: u32, is_log: u32,
}
@group(0) @binding(21) var<uniform> flow: FlowParams;

// Longest trail, lives.
const TRAIL = 0.5;
// The last of its life in which a particle fades: 1 over this.
const FADING = 8.0;
// Dots that lie closer together are paler, down to a least share: slow water is seen as faint dots.
const FULL_SPACING_PX = 0.6;
const LEAST_SHARE = 0.12;

// Velocity east and north and 1, or zeros where there is no data.
fn cell_velocity(row: i32, col: i32) -> vec3<f32> {
    var x = col;
    let cols = i32(grid.cols);
    if (grid.periodic == 1u) { x = (x % cols + cols) % cols; }
    if (x < 0 || x >= cols || row < 0 || row >= i32(grid.rows)) { return vec3(0.0); }
    let own = velocity[u32(row) * grid.cols + u32(x)];
    if (is_missing(own.east)) { return vec3(0.0); }
    return vec3(own.east, own.north, 1.0);
}

// Columns and rows a life, speed in m/s, and how open the sea is: 0 where half of the nearest cells have no data, so
// that particles fade before the coast.
struct Drift { rate: vec2<f32>, speed: f32, open: f32 }

fn drift_at(row: u32, col: u32, place: vec2<f32>) -> Drift {
    let corner = floor(place - 0.5);
    let part = place - 0.5 - corner;
    let west = i32(col) + i32(corner.x);
    let north = i32(row) + i32(corner.y);
    let upper = mix(cell_velocity(north, west), cell_velocity(north, west + 1), part.x);
    let lower = mix(cell_velocity(north + 1, west), cell_velocity(north + 1, west + 1), part.x);
    let sum = mix(upper, lower, part.y);
    let found = sum.xy / max(sum.z, 1.0e-6);
    let speed = length(found);
    let drawn = found * min(1.0, flow.most_m_s / max(speed, 1.0e-6));
    let cos_lat = turned(rows[row].sin_lat, rows[row].cos_lat, (0.5 - place.y) * rows[row].lat_span_rad).y;
    // Meridians meet at the poles.
    let east = clamp(drawn.x * flow.cols_per_m_s / max(cos_lat, 1.0e-3), -flow.most_cols, flow.most_cols);
    return Drift(vec2(east, -drawn.y * flow.rows_per_m_s), speed, clamp(4.0 * sum.z - 2.0, 0.0, 1.0));
}

// A particle on its way: `open` is the least that it met, 0 where it is not drawn.
struct Trail { col: u32, place: vec2<f32>, age: f32, open: f32 }

// A step of some share of a life from where the drift is `here` (the midpoint method).
fn stepped(row: u32, trail: Trail, here: Drift, share: f32) -> Trail {
    let middle = drift_at(row, trail.col, trail.place + 0.5 * share * here.rate);
    return Trail(trail.col, trail.place + share * middle.rate, trail.age, min(trail.open, min(here.open, middle.open)));
}

// Where the trail ends of particle `number` of a cell, at the age of the particle.
fn trail_of(row: u32, slot: u32, number: u32) -> Trail {
    var trail: Trail;
    trail.col = cols[slot].index;
    let cell = row * grid.cols + trail.col;
    if (is_missing(velocity[cell].east)) { return trail; }
    let place_in_whole = in_whole(row, trail.col);
    let bits = hash(hash(place_in_whole.x * grid.whole_cols + place_in_whole.y) ^ (number * 0x9e3779b9u));
    let turn = unit(bits) + flow.turn;
    trail.age = turn - floor(turn);
    // Every life begins somewhere else.
    let life = hash(bits ^ ((flow.cycle + u32(turn)) * 0x85ebca6bu));
    if (hash(life ^ 0x68bc21ebu) > flow.share) { return trail; }
    let start = vec2(HALF_TURN) + number * vec2(3242174889u, 2447445414u);
    trail.place = vec2(unit(start.x + jittered(life)), unit(start.y + jittered(hash(life))));
    trail.open = 1.0;
    let share = (max(trail.age - TRAIL, 0.0) - 0.5) / f32(flow.lead_steps);
    for (var step = 0u; step < flow.lead_steps; step++) {
        trail = stepped(row, trail, drift_at(row, trail.col, trail.place), share);
    }
    return trail;
}

// The share of a life between two dots of a trail.
fn dot_share(age: f32) -> f32 {
    return min(age, TRAIL) / f32(cells.particles_each - 1u);
}

// Dot `number` of a trail, from its end on, at the trail's place.
fn dot_of(row: u32, slot: u32, number: u32, trail: Trail, speed: f32) -> Particle {
    let at = clamp(i32(row) + i32(floor(trail.place.y)), 0, i32(grid.rows) - 1);
    let taper = f32(number + 1u) / f32(cells.particles_each);
    let position = place_in_range(speed, flow.transfer_low, flow.transfer_per_unit, flow.is_log == 1u);
    // A trail grows out of nothing, so that its dots are as dense at any age.
    let alive = min(trail.age / TRAIL, 1.0) * clamp((1.0 - trail.age) * FADING, 0.0, 1.0);
    var particle: Particle;
    particle.row = u32(at);
    particle.slot = slot;
    particle.east = trail.place.x;
    particle.south = trail.place.y - f32(at - i32(row));
    // As much for each pixel of a trail, whatever its length.
    let spacing_px = min(speed, flow.most_m_s) * flow.px_per_m_s * dot_share(trail.age);
    let at_colour = u32(nearest(position * 255.0));
    var opacity = particles.depth_floor + (1.0 - particles.depth_floor) * sqrt(position);
    if (flow.has_shape == 1u) { opacity = f32(palette[256u + at_colour] & 0xffffu) / 65535.0; }
    opacity *= clamp(spacing_px / FULL_SPACING_PX, LEAST_SHARE, 1.0);
    particle.depth = particles.optical_depth * opacity * taper * taper * alive * trail.open;
    particle.colour = palette[at_colour] | (u32(nearest(taper * 255.0)) << 24u);
    return particle;
}
