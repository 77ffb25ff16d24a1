//! Lines as bytes: the number of lines; for each the number of its places and their longitudes and latitudes in whole
//! [`PARTS_PER_DEG`], each less that of the place before. Numbers are LEB128, those with a sign zigzag.

/// Parts of a degree that places are rounded to: 111 m, a tenth of what a scale of 1:50 million resolves.
pub const PARTS_PER_DEG: f64 = 1000.0;
/// Most lines, and most places of one.
const MOST: u64 = 1 << 20;

/// Takes lines of places, `[lon, lat]` in parts of a degree, off the front of bytes; none if they are not whole.
pub fn take_lines(bytes: &mut &[u8]) -> Option<Vec<Vec<[i64; 2]>>> {
    let mut lines = vec![];
    for _ in 0..take_count(bytes)? {
        let mut line = vec![];
        let mut place = [0i64; 2];
        for _ in 0..take_count(bytes)? {
            for parts in &mut place {
                let step = take_number(bytes)?;
                *parts += (step >> 1) as i64 ^ -((step & 1) as i64);
            }
            line.push(place);
        }
        lines.push(line);
    }
    Some(lines)
}

fn take_count(bytes: &mut &[u8]) -> Option<u64> {
    take_number(bytes).filter(|count| *count <= MOST)
}

fn take_number(bytes: &mut &[u8]) -> Option<u64> {
    let mut number = 0;
    // Five bytes hold every difference of two longitudes.
    for shift in (0..35).step_by(7) {
        let (byte, rest) = bytes.split_first()?;
        *bytes = rest;
        number |= u64::from(byte & 0x7f) << shift;
        if byte & 0x80 == 0 {
            return Some(number);
        }
    }
    None
}
