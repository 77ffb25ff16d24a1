//! How long the steps of a picture took on the thread that draws it.

use std::cell::Cell;
use std::time::{Duration, Instant};

/// A step of drawing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Step {
    /// What the view makes of the job: tables, masks of the ground.
    Plan,
    /// Recording commands and sending what they read.
    Upload,
    /// From the submission until the picture can be read.
    Device,
    /// Copying it out of the device's memory.
    ReadBack,
}

/// Steps in the order of [`Step`], each with its name in metrics.
const NAMES: [&str; 4] = ["plan", "upload", "device", "read_back"];

thread_local! {
    static TAKEN: Cell<[Duration; NAMES.len()]> = const { Cell::new([Duration::ZERO; NAMES.len()]) };
}

/// Does something and adds its time to that of a step.
pub(crate) fn timed<T>(step: Step, work: impl FnOnce() -> T) -> T {
    let begun = Instant::now();
    let done = work();
    let mut taken = TAKEN.get();
    taken[step as usize] += begun.elapsed();
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
        let [plan, upload, device, read_back] = taken();
        assert_eq!(
            [plan, upload, read_back].map(|(_, took)| took),
            [Duration::ZERO; 3]
        );
        assert!(device.0 == "device" && device.1 >= 2 * pause);
        assert!(taken().iter().all(|(_, took)| took.is_zero()));
    }
}
