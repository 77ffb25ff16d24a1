// How much a cell whose gap was filled is to be uncertain, 0 where it was measured, and what that does to its colours.
// Reads `uncertainty_before` and `uncertainty_after`.

// At full uncertainty: share of a pale grey in a particle's colour, share of its depth that is left.
const PALENESS = 0.65;
const DEPTH_LEFT = 0.3;
const PALE = 200.0;
// Pixels from one line of a hatching to the next along a row or a column: a divisor of the side of every tile, so that
// its pixels are as good as those of its level.
const HATCH_PX = 8u;
// Share of the ink in the colour of a line at full uncertainty.
const HATCH_INK = 0.75;

fn uncertainty_of(cell: u32) -> f32 {
    if (!feature(HAS_UNCERTAINTY, values.has_uncertainty == 1u)) { return 0.0; }
    let before = uncertainty_before[cell];
    return before + (uncertainty_after[cell] - before) * values.weight;
}

fn paler(channel: u32, uncertainty: f32) -> u32 {
    let plain = f32(channel & 255u);
    return u32(nearest(plain + (PALE - plain) * (PALENESS * uncertainty)));
}

// Paler and more transparent.
fn uncertain(particle: Particle, uncertainty: f32) -> Particle {
    var faded = particle;
    faded.depth = particle.depth * (1.0 - (1.0 - DEPTH_LEFT) * uncertainty);
    let colour = particle.colour;
    faded.colour = paler(colour, uncertainty) | (paler(colour >> 8u, uncertainty) << 8u) | (paler(colour >> 16u, uncertainty) << 16u)
        | (colour & 0xff000000u);
    return faded;
}

// Share of a pixel that a line of the hatching covers: diagonals that go on in the next tile and part.
fn line_at(pixel: vec2<u32>) -> f32 {
    let along = pixel.x + pixel.y + u32(view.origin_px.x + view.origin_px.y);
    return max(1.0 - 0.5 * abs(f32(along % HATCH_PX) - 2.0), 0.0);
}

// A colour under the hatching: dark lines on light colours, light ones on dark.
fn hatched(rgb: vec3<f32>, uncertainty: f32, pixel: vec2<u32>) -> vec3<f32> {
    let luma = 0.2126 * rgb.x + 0.7152 * rgb.y + 0.0722 * rgb.z;
    let ink = select(1.0, 0.1, luma > 0.5);
    return rgb + (vec3(ink) - rgb) * (HATCH_INK * uncertainty * line_at(pixel));
}
