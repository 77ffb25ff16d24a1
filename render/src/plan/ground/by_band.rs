//! Items and the rows of a picture that each reaches in, for every band of rows its own out.

/// Rows of a mask that are made as one, in memory that stays near a core; so few that cores end together.
pub(super) const BAND_PX: usize = 16;

/// What is drawn, by the bands of rows that it reaches; in each in the order it was given in, since sums of numbers round.
pub(super) struct ByBand<T> {
    /// For each band the end of its items.
    ends: Vec<usize>,
    items: Vec<T>,
}

impl<T: Copy> ByBand<T> {
    /// `reached`: the first and the last row that an item reaches, pixels; what is no number reaches none.
    pub(super) fn of(given: &[T], height_px: u32, reached: impl Fn(&T) -> [f64; 2]) -> Self {
        let count = (height_px as usize).div_ceil(BAND_PX);
        let bands = |item: &T| {
            let [first, last] = reached(item).map(|row| row / BAND_PX as f64);
            let is_seen = last >= 0.0 && first < count as f64;
            let end = if is_seen { last as usize + 1 } else { 0 };
            (first.max(0.0) as usize)..end.min(count)
        };
        // Where the items of each band begin, and then, as they are laid there, end.
        let mut ends = vec![0; count + 1];
        for item in given {
            for band in bands(item) {
                ends[band + 1] += 1;
            }
        }
        for band in 1..=count {
            ends[band] += ends[band - 1];
        }
        let mut items = match given.first() {
            Some(any) => vec![*any; ends[count]],
            None => vec![],
        };
        for item in given {
            for band in bands(item) {
                items[ends[band]] = *item;
                ends[band] += 1;
            }
        }
        ends.truncate(count);
        Self { ends, items }
    }

    pub(super) fn of_band(&self, number: usize) -> &[T] {
        let first = if number == 0 {
            0
        } else {
            self.ends[number - 1]
        };
        &self.items[first..self.ends[number]]
    }
}
