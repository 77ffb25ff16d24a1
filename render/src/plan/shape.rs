//! Opacity and size over the range of a transfer function, as a table for the stages where users gave stops of either.

use contract::colour::{Scale, TransferFunction};
use contract::job::Mode;

use super::look::{self, Look};

/// Is the table there at all?
pub(super) fn is_given(transfer: &TransferFunction) -> bool {
    !transfer.opacity.is_empty() || !transfer.size.is_empty()
}

/// Radius of a particle without strength is smaller by this share: all of it where the table says how large it is.
pub(super) fn size_spread(transfer: &TransferFunction, look: &Look) -> f32 {
    if transfer.size.is_empty() {
        look.size_spread
    } else {
        1.0
    }
}

/// Do values of the range lie on both sides of zero?
pub(super) fn is_diverging(transfer: &TransferFunction) -> bool {
    transfer.low < 0.0 && transfer.high > 0.0
}

/// The low end of a range and the places for each unit, in the numbers that the stages place values by: binary
/// logarithms on a logarithmic scale.
pub(super) fn place_params(transfer: &TransferFunction) -> (f32, f32) {
    let TransferFunction { low, high, .. } = *transfer;
    let [low, high] = match transfer.scale {
        Scale::Linear => [low, high],
        Scale::Log => [low.log2(), high.log2()],
    };
    (low as f32, (1.0 / (high - low)) as f32)
}

/// Share of the optical depth that a value without strength keeps.
pub(super) fn depth_floor(transfer: &TransferFunction) -> f32 {
    if is_diverging(transfer) {
        look::FLOOR_DIVERGING
    } else {
        look::FLOOR_SEQUENTIAL
    }
}

/// 256 words of opacity (low 16 bits) and size or, without stops of size, strength (next 8); none without stops.
pub(super) fn table(mode: Mode, transfer: &TransferFunction) -> Vec<u32> {
    if !is_given(transfer) {
        return vec![];
    }
    let word = |i: u32| {
        let value = transfer.value_at(f64::from(i) / 255.0);
        let strength = strength(transfer, value);
        let usual = match mode {
            // Maps are as opaque everywhere unless told otherwise.
            Mode::Map => 1.0,
            Mode::Points | Mode::Sprites | Mode::Volume | Mode::Flow => {
                let floor = f64::from(depth_floor(transfer));
                floor + (1.0 - floor) * strength.sqrt()
            }
        };
        let opacity = transfer.opacity(value).unwrap_or(usual);
        let size = transfer.size(value).unwrap_or(strength);
        (opacity * 65535.0).round() as u32 | ((size * 255.0).round() as u32) << 16
    };
    (0..256).map(word).collect()
}

/// Magnitude of a value over the largest of the range; its place in the range where that has no sign.
fn strength(transfer: &TransferFunction, value: f64) -> f64 {
    if is_diverging(transfer) {
        let largest = transfer.low.abs().max(transfer.high.abs());
        (value.abs() / largest).clamp(0.0, 1.0)
    } else {
        transfer.position(value)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use contract::colour::Palette;

    fn with(opacity: &str, size: &str) -> TransferFunction {
        let list = |text: &str| {
            if text.is_empty() {
                Ok(contract::colour::Stops::default())
            } else {
                text.parse()
            }
        };
        TransferFunction {
            opacity: list(opacity).unwrap(),
            size: list(size).unwrap(),
            ..TransferFunction::linear(Palette::Balance, -1.0, 1.0)
        }
    }

    fn entry(mode: Mode, transfer: &TransferFunction, at: usize) -> (f64, f64) {
        let word = table(mode, transfer)[at];
        (
            f64::from(word & 0xffff) / 65535.0,
            f64::from(word >> 16) / 255.0,
        )
    }

    #[test]
    fn without_stops_there_is_no_table() {
        assert!(table(Mode::Volume, &with("", "")).is_empty());
    }

    #[test]
    fn what_was_not_given_stays_as_usual() {
        let near = |(a, b): (f64, f64), (c, d): (f64, f64)| {
            assert!(
                (a - c).abs() < 2e-5 && (b - d).abs() < 3e-3,
                "{a} {b}, {c} {d}"
            );
        };
        let opacity = with("-1:0.25,1:0.75", "");
        near(entry(Mode::Volume, &opacity, 0), (0.25, 1.0));
        near(entry(Mode::Volume, &opacity, 255), (0.75, 1.0));
        let size = with("", "-1:0.5,1:0.75");
        near(entry(Mode::Volume, &size, 0), (1.0, 0.5));
        let floor = f64::from(look::FLOOR_DIVERGING);
        let middle = floor + (1.0 - floor) * (1.0f64 / 255.0).sqrt();
        near(
            entry(Mode::Volume, &size, 128),
            (middle, 0.625 + 0.125 / 255.0),
        );
        near(entry(Mode::Map, &size, 128), (1.0, 0.625 + 0.125 / 255.0));
        let look = Look::of(Mode::Volume);
        assert!((size_spread(&size, &look) - 1.0).abs() < f32::EPSILON);
        assert!((size_spread(&opacity, &look) - look.size_spread).abs() < f32::EPSILON);
    }
}
