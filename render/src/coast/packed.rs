//! The lines of two scales as bytes, one scale after the other.

use contract::land::packed::{PARTS_PER_DEG, take_lines};

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
    let mut scale = || {
        let lines = take_lines(&mut bytes)?.into_iter();
        Some(
            lines
                .map(|line| line.into_iter().map(Place).collect())
                .collect(),
        )
    };
    let scales = [scale()?, scale()?];
    bytes.is_empty().then_some(scales)
}

fn put(bytes: &mut Vec<u8>, mut number: u64) {
    while number >= 0x80 {
        bytes.push(number as u8 | 0x80);
        number >>= 7;
    }
    bytes.push(number as u8);
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
