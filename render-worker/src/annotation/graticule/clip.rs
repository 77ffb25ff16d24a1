//! What of a line lies in the picture.

/// The parts of a line within a picture of a size, pixels.
pub(super) fn to_picture(line: &[[f64; 2]], size: [f64; 2]) -> Vec<Vec<[f64; 2]>> {
    let mut parts: Vec<Vec<[f64; 2]>> = vec![];
    let mut is_open = false;
    for pair in line.windows(2) {
        let Some(([from, to], is_whole)) = segment(pair[0], pair[1], size) else {
            is_open = false;
            continue;
        };
        match parts.last_mut().filter(|_| is_open) {
            Some(part) => part.push(to),
            None => parts.push(vec![from, to]),
        }
        is_open = is_whole;
    }
    parts
}

/// What of a straight line between two places lies in the picture, and whether it reaches the second: Liang and Barsky
/// (1984).
fn segment(a: [f64; 2], b: [f64; 2], size: [f64; 2]) -> Option<([[f64; 2]; 2], bool)> {
    let (mut first, mut last) = (0.0f64, 1.0f64);
    for axis in 0..2 {
        let along = b[axis] - a[axis];
        for (toward, room) in [(-along, a[axis]), (along, size[axis] - a[axis])] {
            if toward == 0.0 {
                if room < 0.0 {
                    return None;
                }
            } else if toward < 0.0 {
                first = first.max(room / toward);
            } else {
                last = last.min(room / toward);
            }
        }
    }
    let at = |share: f64| [a[0] + (b[0] - a[0]) * share, a[1] + (b[1] - a[1]) * share];
    let from = if first > 0.0 { at(first) } else { a };
    let is_whole = last >= 1.0;
    let to = if is_whole { b } else { at(last) };
    (first < last).then_some(([from, to], is_whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 2] = [100.0, 50.0];

    #[test]
    fn what_is_outside_is_cut_off() {
        let line = [
            [-10.0, 20.0],
            [50.0, 20.0],
            [50.0, 90.0],
            [60.0, 90.0],
            [60.0, 10.0],
        ];
        let parts = to_picture(&line, SIZE);
        assert_eq!(
            parts,
            [
                vec![[0.0, 20.0], [50.0, 20.0], [50.0, 50.0]],
                vec![[60.0, 50.0], [60.0, 10.0]],
            ]
        );
        assert!(to_picture(&[[-5.0, 0.0], [-5.0, 50.0]], SIZE).is_empty());
        assert!(to_picture(&[[-5.0, 20.0], [5.0, 90.0]], SIZE).is_empty());
        assert_eq!(
            to_picture(&[[-100.0, -50.0], [200.0, 100.0]], SIZE),
            [vec![[0.0, 0.0], [100.0, 50.0]]]
        );
        let inside = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]];
        assert_eq!(to_picture(&inside, SIZE), [inside.to_vec()]);
    }
}
