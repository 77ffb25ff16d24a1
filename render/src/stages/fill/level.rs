//! One level of a filling: its grid, and the weights of the cells around a cell as a table for every row.

use super::sphere::Sphere;

/// Most columns that a table reaches to either side; a shader's shared memory is made for it.
pub const MOST_REACH_COLS: u32 = 192;
/// Most rows that a table reaches.
const MOST_REACH_ROWS: u32 = 512;

shared_struct! {
    /// A level as shaders and twins see it.
    pub struct FillLevel {
        pub rows: u32,
        pub cols: u32,
        pub periodic: u32,
        /// Rows that the table reaches to either side.
        pub reach_rows: u32,
        /// Columns that the table reaches to either side.
        pub reach_cols: u32,
        pub coarser_rows: u32,
        pub coarser_cols: u32,
        /// Columns of the coarser level that lie west of this one.
        pub coarser_pad_cols: u32,
        /// 1 if only wanted cells are computed.
        pub is_masked: u32,
        /// 0 for the coarsest level.
        pub has_coarser: u32,
        /// Weight of the coarser level's answer, in weights of a neighbour.
        pub lean: f32,
        /// Always 0, which compilers of shaders cannot know.
        pub zero: u32,
    }
}

/// Where the rows and columns of a level lie on the sphere.
pub struct Places<'a> {
    pub sphere: &'a Sphere,
    /// Place of every row among the finest rows.
    pub rows: &'a [f64],
    pub cols: u32,
    /// Finest columns a column of this level is wide.
    pub stride: f64,
    pub periodic: bool,
}

/// The weights around the cells of every row: `weights[(row * (2 * reach_rows + 1) + dy) * (reach_cols + 1) + dx]`.
#[derive(Debug, Clone, Default)]
pub struct Table {
    pub reach_rows: u32,
    pub reach_cols: u32,
    pub weights: Vec<f32>,
    /// Columns met in each line of `weights`, the middle one included; 0 for none.
    pub spans: Vec<u32>,
}

/// How far a table reaches.
#[derive(Debug, Clone, Copy)]
pub enum Extent {
    /// As far as this chord, earth radii; what lies beyond the most rows and columns is left out if `may_clip`, else
    /// there is no table.
    Chord { radius: f64, may_clip: bool },
    /// Every cell of the level.
    All,
}

impl Table {
    /// The table of `weight`, a function of the squared chord; none if it would reach too far.
    pub fn new(places: &Places<'_>, extent: Extent, weight: &dyn Fn(f64) -> f64) -> Option<Self> {
        let all_cols = if places.periodic {
            places.cols / 2
        } else {
            places.cols.saturating_sub(1)
        };
        let (mut reach_rows, most_cols) = match extent {
            Extent::All => (places.rows.len() as u32 - 1, all_cols),
            Extent::Chord { radius, .. } => {
                (rows_within(places, radius), all_cols.min(MOST_REACH_COLS))
            }
        };
        if matches!(extent, Extent::Chord { may_clip: true, .. }) {
            reach_rows = reach_rows.min(MOST_REACH_ROWS);
        }
        if most_cols > MOST_REACH_COLS || reach_rows > MOST_REACH_ROWS {
            return None;
        }
        let radius_sq = match extent {
            Extent::All => f64::INFINITY,
            Extent::Chord { radius, .. } => radius * radius,
        };
        let half_sine_sq: Vec<f64> = (0..=most_cols)
            .map(|dx| {
                places
                    .sphere
                    .half_sine_sq_cols(f64::from(dx) * places.stride)
            })
            .collect();
        let mut lines = vec![];
        for (row, &at) in places.rows.iter().enumerate() {
            for step in 0..=2 * reach_rows as usize {
                let other = (row + step).checked_sub(reach_rows as usize);
                let other = other.and_then(|other| places.rows.get(other));
                let line = other.map_or_else(Vec::new, |&other| {
                    let (base, cosines) = (
                        places.sphere.half_sine_sq_rows(at - other),
                        places.sphere.lat_rad(at).cos() * places.sphere.lat_rad(other).cos(),
                    );
                    half_sine_sq
                        .iter()
                        .map(|sine_sq| 4.0 * (base + cosines * sine_sq))
                        .take_while(|chord_sq| *chord_sq < radius_sq)
                        .map(weight)
                        .collect()
                });
                lines.push(line);
            }
        }
        let clipped = |line: &Vec<f64>| line.len() as u32 > most_cols && most_cols < all_cols;
        if matches!(
            extent,
            Extent::Chord {
                may_clip: false,
                ..
            }
        ) && lines.iter().any(clipped)
        {
            return None;
        }
        Some(Self::of_lines(places, reach_rows, &lines))
    }

    fn of_lines(places: &Places<'_>, reach_rows: u32, lines: &[Vec<f64>]) -> Self {
        let spans: Vec<u32> = lines.iter().map(|line| line.len() as u32).collect();
        let reach_cols = spans.iter().max().map_or(0, |most| most.saturating_sub(1));
        let mut weights = vec![0.0; spans.len() * (reach_cols as usize + 1)];
        for (line, place) in lines
            .iter()
            .zip(weights.chunks_exact_mut(reach_cols as usize + 1))
        {
            for (dx, (weight, place)) in line.iter().zip(place).enumerate() {
                // Half a turn away, east and west are the same cell.
                let twice = places.periodic && dx > 0 && 2 * dx == places.cols as usize;
                *place = if twice { 0.5 * weight } else { *weight } as f32;
            }
        }
        Self {
            reach_rows,
            reach_cols,
            weights,
            spans,
        }
    }
}

fn rows_within(places: &Places<'_>, radius: f64) -> u32 {
    let spacing = places
        .rows
        .windows(2)
        .map(|pair| pair[1] - pair[0])
        .fold(f64::INFINITY, f64::min);
    if !spacing.is_finite() {
        return 0;
    }
    let angle = 2.0 * (0.5 * radius).min(1.0).asin();
    let rows = (angle / (spacing * places.sphere.row_rad())).ceil();
    (rows as u32).min(places.rows.len() as u32 - 1)
}
