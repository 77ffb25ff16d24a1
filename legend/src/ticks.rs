//! Round values of a range to mark, and their texts.

/// Most values marked, those at both ends included.
const MOST: f64 = 6.0;
/// Steps that are round, times a power of ten.
const ROUND: [f64; 5] = [1.0, 2.0, 2.5, 5.0, 10.0];
/// What is marked between powers of ten on a logarithmic scale.
const IN_A_DECADE: [f64; 2] = [1.0, 3.0];
/// Decimals that are written out; what needs more is written with an exponent.
const MOST_DECIMALS: usize = 5;
/// Numbers below this are written out.
const MOST_WRITTEN: f64 = 1e6;

/// Round values from `low` to `high`, which rise; the lower end alone where the range is too narrow for its numbers.
pub fn of(low: f64, high: f64) -> Vec<f64> {
    let rough = (high - low) / (MOST - 1.0);
    let power = 10f64.powf(rough.log10().floor());
    let is_wide_enough = |factor: &&f64| **factor * power >= rough * 0.999;
    let factor = ROUND.iter().find(is_wide_enough).unwrap_or(&10.0);
    let step = factor * power;
    let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
    if !(step > 0.0 && step.is_finite() && last - first < 2.0 * MOST) {
        return vec![low];
    }
    // Multiplied, not added up, and divided where the step is a fraction: 3 * 0.1 is not 0.3, 3 / 10 is.
    let value = |i: f64| {
        if power < 1.0 {
            i * factor / (1.0 / power).round()
        } else {
            i * step
        }
    };
    let count = (last - first).max(0.0) as u32;
    (0..=count)
        .map(|i| value(first + f64::from(i)) + 0.0)
        .collect()
}

/// 1 and 3 of every power of ten from `low` to `high`, which are above 0; powers alone, or every second or further one,
/// where there would be many; round values as on any other scale where there would be one.
pub fn of_decades(low: f64, high: f64) -> Vec<f64> {
    let (first, last) = (low.log10().floor() as i32, high.log10().floor() as i32);
    let inside = low * (1.0 - 1e-9)..=high * (1.0 + 1e-9);
    // Divided where it is a fraction: 3 * 0.1 is not 0.3, 3 / 10 is.
    let value = |figure: f64, power: i32| {
        if power < 0 {
            figure / 10f64.powi(-power)
        } else {
            figure * 10f64.powi(power)
        }
    };
    let marks = |figures: &[f64], every: usize| -> Vec<f64> {
        let powers = (first..=last).filter(|power| power.rem_euclid(every as i32) == 0);
        let all = powers.flat_map(|power| figures.iter().map(move |figure| value(*figure, power)));
        all.filter(|mark| inside.contains(mark)).collect()
    };
    let choices = (1..=64).map(|every| marks(&IN_A_DECADE[..1], every));
    let mut choices = std::iter::once(marks(&IN_A_DECADE, 1)).chain(choices);
    match choices.find(|marks| marks.len() as f64 <= MOST + 1.0) {
        Some(marks) if marks.len() > 1 => marks,
        _ => of(low, high),
    }
}

/// The values with as many decimals as any of them needs, a minus sign for a minus sign.
pub fn texts(ticks: &[f64]) -> Vec<String> {
    let largest = ticks
        .iter()
        .fold(0.0, |most: f64, tick| most.max(tick.abs()));
    let needed = |tick: &f64| {
        let is_enough = |digits: &usize| {
            let digits = *digits;
            let written: f64 = format!("{tick:.digits$}").parse().unwrap_or(f64::NAN);
            (written - tick).abs() <= largest * 1e-9
        };
        (0..=MOST_DECIMALS).find(is_enough)
    };
    let digits: Option<Vec<usize>> = ticks.iter().map(needed).collect();
    let digits = digits.filter(|_found| largest < MOST_WRITTEN);
    let digits = digits.and_then(|digits| digits.into_iter().max());
    let text = |tick: &f64| match digits {
        Some(digits) => format!("{tick:.digits$}"),
        None if *tick == 0.0 => "0".to_owned(),
        None => short(*tick),
    };
    ticks
        .iter()
        .map(|tick| text(tick).replace('-', "−"))
        .collect()
}

/// Six figures and an exponent.
fn short(number: f64) -> String {
    let text = format!("{number:.5e}");
    match text.split_once('e') {
        Some((figures, power)) => {
            let figures = figures.trim_end_matches('0').trim_end_matches('.');
            format!("{figures}e{power}")
        }
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(of(-40.0, 40.0), [-40.0, -20.0, 0.0, 20.0, 40.0]);
        assert_eq!(of(0.0, 2.0), [0.0, 0.5, 1.0, 1.5, 2.0]);
        assert_eq!(of(-1.5, 1.5), [-1.0, 0.0, 1.0]);
        assert_eq!(of(280.0, 440.0), [300.0, 350.0, 400.0]);
        assert_eq!(of(0.0, 0.5), [0.0, 0.1, 0.2, 0.3, 0.4, 0.5]);
        for (low, high) in [(3.0, 1e9), (1e-12, 5e-12), (-7.77, -7.76), (1e19, 1e20)] {
            let ticks = of(low, high);
            assert!((2..=7).contains(&ticks.len()), "{low} to {high}: {ticks:?}");
        }
    }

    #[test]
    fn logarithmic_ticks_are_round_and_few() {
        assert_eq!(of_decades(0.03, 10.0), [0.03, 0.1, 0.3, 1.0, 3.0, 10.0]);
        assert_eq!(of_decades(1.0, 1e5), [1.0, 10.0, 100.0, 1e3, 1e4, 1e5]);
        assert_eq!(of_decades(2.0, 6.0), of(2.0, 6.0));
        for (low, high) in [(1e-20, 1e20), (1.0, 1.001), (0.5, 70.0), (3e-7, 4e-2)] {
            let ticks = of_decades(low, high);
            assert!((2..=7).contains(&ticks.len()), "{low} to {high}: {ticks:?}");
        }
    }

    #[test]
    fn ranges_at_the_limits_of_numbers_have_a_tick_all_the_same() {
        for (low, high) in [
            (1.0, 1.0 + f64::EPSILON),
            (0.0, 1e-300),
            (-1e300, 1e300),
            (5.0, 5.0),
        ] {
            let ticks = of(low, high);
            assert!(
                !ticks.is_empty() && ticks.len() < 12,
                "{low} to {high}: {ticks:?}"
            );
            assert_eq!(texts(&ticks).len(), ticks.len());
        }
    }

    #[test]
    fn texts_have_the_decimals_that_all_of_them_need() {
        assert_eq!(texts(&[-1.0, 0.0, 0.5]), ["−1.0", "0.0", "0.5"]);
        assert_eq!(texts(&[-20.0, 0.0, 20.0]), ["−20", "0", "20"]);
        assert_eq!(texts(&[0.0, 2.5e-9]), ["0", "2.5e−9"]);
        assert_eq!(texts(&[0.0, 2e6]), ["0", "2e6"]);
        assert_eq!(texts(&of(0.0, 0.5)).join(" "), "0.0 0.1 0.2 0.3 0.4 0.5");
    }
}
