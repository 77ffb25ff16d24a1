//! How long the steps of a picture took on the thread that draws it.

use std::cell::Cell;
use std::time::{Duration, Instant};

/// A step of drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// What the view makes of the job: tables, lists.
    Plan,
    /// Waiting for the mask of the ground, which is made on other cores while the device begins.
    Mask,
    /// Recording commands and sending what they read.
    Upload,
    /// From the submission until the picture can be read.
    Device,
    /// Copying it out of the device's memory.
    ReadBack,
}

/// Steps in the order of [`Step`], each with its name in metrics.
const NAMES: [&str; 5] = ["plan", "mask", "upload", "device", "read_back"];

thread_local! {
    static TAKEN: Cell<[Duration; NAMES.len()]> = const { Cell::new([Duration::ZERO; NAMES.len()]) };
}

/// Does something and adds its time to that of a step, less the time of steps within it.
pub(crate) fn timed<T>(step: Step, work: impl FnOnce() -> T) -> T {
    let before: Duration = TAKEN.get().iter().sum();
    let begun = Instant::now();
    let done = work();
    let mut taken = TAKEN.get();
    let within = taken.iter().sum::<Duration>().saturating_sub(before);
    taken[step as usize] += begun.elapsed().saturating_sub(within);
    TAKEN.set(taken);
    done
}

/// What the steps took on this thread since this was last asked, by name.
pub fn taken() -> [(&'static str, Duration); NAMES.len()] {
    let taken = TAKEN.replace([Duration::ZERO; NAMES.len()]);
    std::array::from_fn(|step| (NAMES[step], taken[step]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_a_step_add_up_until_they_are_asked_for() {
        let pause = Duration::from_millis(2);
        for _time in 0..2 {
            assert_eq!(
                timed(Step::Device, || {
                    std::thread::sleep(pause);
                    5
                }),
                5
            );
        }
        let [plan, mask, upload, device, read_back] = taken();
        assert_eq!(
            [plan, mask, upload, read_back].map(|(_, took)| took),
            [Duration::ZERO; 4]
        );
        assert!(device.0 == "device" && device.1 >= 2 * pause);
        assert!(taken().iter().all(|(_, took)| took.is_zero()));
    }

    #[test]
    fn a_step_within_another_counts_once() {
        let pause = Duration::from_millis(20);
        let begun = Instant::now();
        timed(Step::Upload, || {
            timed(Step::Mask, || std::thread::sleep(pause));
        });
        let whole = begun.elapsed();
        let [_, mask, upload, ..] = taken().map(|(_, took)| took);
        assert!(
            mask >= pause && mask + upload <= whole,
            "{mask:?} {upload:?}"
        );
    }
}
