//! How large a window of a map is.

use std::str::FromStr;

/// The most tiles of a side: a large screen in high resolution.
const MOST: u32 = 16;

/// Columns and rows of a window, tiles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct WindowSize {
    pub(crate) columns: u32,
    pub(crate) rows: u32,
}

impl FromStr for WindowSize {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=MOST).contains(side));
        let sides = text.split_once('x');
        let sides = sides.and_then(|(columns, rows)| side(columns).zip(side(rows)));
        let (columns, rows) = sides.ok_or_else(|| format!("COLUMNSxROWS, each 1 to {MOST}"))?;
        Ok(Self { columns, rows })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_columns_and_rows() {
        for wrong in ["", "4", "0x3", "17x1", "4x3x2", "-1x2"] {
            assert!(wrong.parse::<WindowSize>().is_err(), "{wrong}");
        }
    }
}
