//! Lines as bytes: differences of whole thousandths of a degree, in as few bytes as they need.
//!
//! For each of two scales: the number of lines; for each line the number of its places and their longitudes and
//! latitudes, each less that of the place before. Numbers are LEB128, those with a sign zigzag.

/// Parts of a degree that places are rounded to: 111 m, a tenth of what the finer scale resolves.
const PARTS_PER_DEG: f64 = 1000.0;
/// Most places of one line, and most lines of one scale.
const MOST: u64 = 1 << 20;

/// A place in thousandths of a degree: longitude and latitude.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Place(pub [i64; 2]);

impl Place {
    /// The nearest one.
    pub fn near(degrees: [f64; 2]) -> Self {
        Self(degrees.map(|degrees| (degrees * PARTS_PER_DEG).round() as i64))
    }

    /// Longitude and latitude, degrees.
    pub fn degrees(self) -> [f64; 2] {
        self.0.map(|parts| parts as f64 / PARTS_PER_DEG)
    }
}

/// Bytes of the lines of both scales.
pub fn pack(scales: &[Vec<Vec<Place>>; 2]) -> Vec<u8> {
    let mut bytes = vec![];
    for lines in scales {
        put(&mut bytes, lines.len() as u64);
        for line in lines {
            put(&mut bytes, line.len() as u64);
            let mut before = [0; 2];
            for place in line {
                for (parts, before) in place.0.iter().zip(before) {
                    let step = parts - before;
                    put(&mut bytes, ((step << 1) ^ (step >> 63)) as u64);
                }
                before = place.0;
            }
        }
    }
    bytes
}

/// The lines of both scales; none if the bytes are not whole.
pub fn unpack(mut bytes: &[u8]) -> Option<[Vec<Vec<Place>>; 2]> {
    let mut scales = [vec![], vec![]];
    for lines in &mut scales {
        for _ in 0..take(&mut bytes)? {
            let mut line = vec![];
            let mut place = Place::default();
            for _ in 0..take(&mut bytes)? {
                for parts in &mut place.0 {
                    let step = take_number(&mut bytes)?;
                    *parts += (step >> 1) as i64 ^ -((step & 1) as i64);
                }
                line.push(place);
            }
            lines.push(line);
        }
    }
    bytes.is_empty().then_some(scales)
}

fn put(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
}

/// A count.
fn take(bytes: &mut &[u8]) -> Option<u64> {
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

#[cfg(test)]
mod tests {
    use super::*;

    fn scales() -> [Vec<Vec<Place>>; 2] {
        let line = |places: &[[f64; 2]]| places.iter().map(|place| Place::near(*place)).collect();
        [
            vec![line(&[[-180.0, 85.0], [180.0, -90.0], [0.001, -0.001]])],
            vec![line(&[[12.345_6, 54.321]]), line(&[])],
        ]
    }

    #[test]
    fn lines_are_read_as_they_were_written() {
        let bytes = pack(&scales());
        assert_eq!(unpack(&bytes).unwrap(), scales());
        let [lon, _] = scales()[1][0][0].degrees();
        assert!((lon - 12.346).abs() < 1e-12);
    }

    #[test]
    fn lines_that_are_cut_or_followed_by_more_are_none() {
        let mut bytes = pack(&scales());
        for end in 0..bytes.len() {
            assert_eq!(unpack(&bytes[..end]), None, "{end}");
        }
        bytes.push(0);
        assert_eq!(unpack(&bytes), None);
        assert_eq!(unpack(&[0xff; 64]), None);
    }
}
