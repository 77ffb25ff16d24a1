// Shared by the forms of gap filling: the struct of one level, arithmetic that rounds alike on every device, and the
// weighted sum over the cells around each cell.
struct FillLevel {
    rows: u32, cols: u32, periodic: u32, reach_rows: u32, reach_cols: u32, coarser_rows: u32, coarser_cols: u32,
    coarser_pad_cols: u32, is_masked: u32, has_coarser: u32, lean: f32, zero: u32,
}

const MISSING = -1.0e30;
const COARSER_PAD = 2u;
const WIDTH = 128u;
const SEGMENT = 512u; // WIDTH + 2 * MOST_REACH_COLS

@group(0) @binding(0) var<uniform> level: FillLevel;

fn is_missing(value: f32) -> bool {
    return value < 0.5 * MISSING;
}

// A product that no compiler joins with the sum it goes into: a joined one rounds once, not twice, and then devices
// differ. Nobody can know before the run that `zero` is 0.
fn product(a: f32, b: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(a * b) ^ level.zero);
}

fn products(a: f32, b: vec3<f32>) -> vec3<f32> {
    return bitcast<vec3<f32>>(bitcast<vec3<u32>>(a * b) ^ vec3<u32>(level.zero));
}

// `a / b` for positive `b` by Newton's iteration: devices may divide with an error that is up to them.
fn quotient(a: f32, b: f32) -> f32 {
    var inverse = bitcast<f32>(0x7ef311c7u - bitcast<u32>(b));
    inverse *= 2.0 - product(b, inverse);
    inverse *= 2.0 - product(b, inverse);
    inverse *= 2.0 - product(b, inverse);
    return product(a, inverse);
}
