// A particle of a cell: place, height, mass, optical depth and colour. Reads `rows` and `palette`, whose second half holds
// opacity and size where users gave any.
struct ParticleParams {
    jitter_shift: u32, diverging: u32, strength_per_unit: f32, depth_floor: f32, optical_depth: f32,
    height_m_per_kg_m2: f32, height_limit_m: f32, sheet_m: f32, turns_per_kg_m2: f32, sea_per_m: f32,
}
@group(0) @binding(20) var<uniform> particles: ParticleParams;

const HALF_TURN = 0x80000000u; // 0.5 in 32 bits

// Output permutation of a 32-bit linear congruential generator (PCG-RXS-M-XS, O'Neill 2014).
fn hash(x: u32) -> u32 {
    let state = x * 747796405u + 2891336453u;
    let word = ((state >> ((state >> 28u) + 4u)) ^ state) * 277803737u;
    return (word >> 22u) ^ word;
}

// 32 random bits as a number in [0, 1).
fn unit(bits: u32) -> f32 {
    return f32(bits >> 8u) * 5.9604645e-8;
}

// Random bits spread evenly round 0 over the mode's share of a cell.
fn jittered(bits: u32) -> u32 {
    return (bits >> particles.jitter_shift) - (HALF_TURN >> particles.jitter_shift);
}

// Thin at both ends of a column, so that particles appear and vanish unseen; mean 1.
fn envelope(phase: f32) -> f32 {
    return clamp(min(phase, 1.0 - phase) * 24.0, 0.0, 1.0) * (24.0 / 23.0);
}

fn strength_of(value: f32, position: f32) -> f32 {
    if (!feature(IS_DIVERGING, particles.diverging == 1u)) { return position; }
    return clamp(abs(value) * particles.strength_per_unit, 0.0, 1.0);
}

// A colour seen through so much of the sea: what is lost of it is the water's own (Beer-Lambert).
fn through_water(colour: u32, depth_m: f32) -> u32 {
    let kept = exp(-particles.sea_per_m * depth_m);
    let water = vec3(WATER_RED, WATER_GREEN, WATER_BLUE) * 65025.0;
    let codes = codes_of(colour);
    return with_codes(colour, sqrt(water + (codes * codes - water) * kept));
}

// Row and column of a cell in the grid that this is a window of, which may go on beyond its last column.
fn in_whole(row: u32, col: u32) -> vec2<u32> {
    let own = grid.whole_col + col;
    return vec2(grid.whole_row + row, select(own, own - grid.whole_cols, own >= grid.whole_cols));
}

// Particle `k` of a cell with data; `slot` is its column in the table, `carbon` what it has accumulated, kg m-2.
fn particle_of(row: u32, slot: u32, k: u32, value: f32, carbon: f32) -> Particle {
    let place_in_whole = in_whole(row, cols[slot].index);
    let bits = hash(hash(place_in_whole.x * grid.whole_cols + place_in_whole.y) ^ (k * 0x9e3779b9u));
    // An additive sequence (R2, Roberts 2018) round the cell's centre, jittered by random numbers: little for clouds,
    // which then cover the sea evenly, wholly for dots, which must not stand in rows. Golden sections up the column; from
    // cell to cell the same sequence again, so that those that are thin at an instant lie apart.
    let place = vec2(HALF_TURN) + k * vec2(3242174889u, 2447445414u);
    let start = place_in_whole.x * 3242174889u + place_in_whole.y * 2447445414u + k * 2654435769u;
    var particle: Particle;
    particle.row = row;
    particle.slot = slot;
    particle.east = unit(place.x + jittered(bits));
    particle.south = unit(place.y + jittered(hash(bits)));
    let phase = fract(unit(start + (hash(bits ^ 0x85ebca6bu) >> 3u)) + particles.turns_per_kg_m2 * abs(carbon));
    let column_m = clamp(carbon * particles.height_m_per_kg_m2, -particles.height_limit_m, particles.height_limit_m);
    let position = place_in_range(value, values.transfer_low, values.transfer_per_unit, feature(IS_LOG, values.is_log == 1u));
    let strength = strength_of(value, position);
    particle.height_m = column_m * phase + particles.sheet_m * (phase - 0.5);
    particle.mass_kg = carbon * rows[row].area_m2 / cells.particle_shares;
    let at = u32(nearest(position * 255.0));
    var opacity = particles.depth_floor + (1.0 - particles.depth_floor) * sqrt(strength);
    var size = u32(nearest(strength * 255.0));
    if (feature(HAS_SHAPE, values.has_shape == 1u)) {
        let shape = palette[256u + at];
        opacity = f32(shape & 0xffffu) / 65535.0;
        size = shape >> 16u;
    }
    particle.depth = particles.optical_depth * opacity * envelope(phase);
    particle.colour = palette[at] | (size << 24u);
    if (feature(HAS_SEA_DEPTH, particles.sea_per_m > 0.0) && particle.height_m < 0.0) {
        particle.colour = through_water(particle.colour, -particle.height_m);
    }
    return particle;
}

// What a cell sends out that holds data in a part of its area: as many particles, each with that share of depth and mass.
fn covering(particle: Particle, share: f32) -> Particle {
    var thinner = particle;
    thinner.depth = particle.depth * share;
    thinner.mass_kg = particle.mass_kg * share;
    return thinner;
}
