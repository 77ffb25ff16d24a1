//! What a bench of one scene measured, and how it is told.

use contract::job::RenderJob;
use serde::Serialize;

use crate::Difference;
use crate::bench::served::Joined;
use crate::bench::stats::Times;
use crate::bench::{encode, frames};

/// One scene in one size, number of slices and tilt.
#[derive(Serialize)]
pub(super) struct Row {
    pub(super) adapter: String,
    pub(super) particles: u64,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) slices: u32,
    pub(super) tilt_deg: f64,
    pub(super) joined: Option<Joined>,
    pub(super) measured: frames::Measured,
    pub(super) classic: Option<Against>,
    pub(super) twins: Option<(Times, usize)>,
    pub(super) encoded: Option<encode::Encoded>,
    pub(super) reference: Option<Difference>,
}

/// The classic renderer beside ours.
#[derive(Serialize)]
pub(super) struct Against {
    pub(super) series: frames::Series,
    pub(super) clock: Clock,
    pub(super) times_faster: f64,
    /// Format of the light's picture.
    pub(super) light: String,
    pub(super) difference: Option<Difference>,
    pub(super) note: &'static str,
}

/// What two series are compared by.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Clock {
    Device,
    Wall,
}

/// How many times faster we are, by the device's clock if both series have it, else by the wall clock.
pub(super) fn times_faster(ours: &frames::Measured, theirs: &frames::Series) -> (Clock, f64) {
    if ours.frame.runs > 0 && theirs.frame.runs > 0 {
        let ratio = theirs.frame.median_ms / ours.frame.median_ms.max(1e-9);
        return (Clock::Device, ratio);
    }
    let ratio = theirs.frame_wall_ms / ours.frame_wall_ms.max(1e-9);
    (Clock::Wall, ratio)
}

/// Prints what was measured: as a table for people, or as a line of JSON.
pub(super) fn report(is_json: bool, job: &RenderJob, row: &Row) {
    if is_json {
        say(&serde_json::to_string(row).unwrap_or_default());
        return;
    }
    let m = &row.measured;
    report_frames(job, row.particles, m);
    if let Some(joined) = &row.joined {
        say(&format!(
            "  as served, tilt {}: from {} cells, joined in {:.0} ms; mean levels of the sea {:.1?} in all cells, {:.1?} as served; from the picture of all cells: {}",
            row.tilt_deg,
            joined.cells,
            joined.once_ms,
            joined.mean_levels[0],
            joined.mean_levels[1],
            joined
                .from_all_cells
                .as_ref()
                .map_or_else(|| "none joined".to_owned(), in_words)
        ));
    }
    if let Some(c) = &row.classic {
        let clock = match c.clock {
            Clock::Device => "device",
            Clock::Wall => "wall",
        };
        say(&format!(
            "  classic: median {:.3} ms, p99 {:.3} ms, wall {:.3} ms, light in {}; {:.1} times by the {clock} clock; {}",
            c.series.frame.median_ms,
            c.series.frame.p99_ms,
            c.series.frame_wall_ms,
            c.light,
            c.times_faster,
            c.difference.as_ref().map_or_else(String::new, in_words)
        ));
        say(&format!("  ({})", c.note));
    }
    if let Some((times, cores)) = &row.twins {
        let splat = m
            .stages
            .iter()
            .find(|(name, _)| name == "splat")
            .map_or(0.0, |(_, t)| t.median_ms);
        say(&format!(
            "  interpolation and particles on {cores} cores {:.1} ms, {:.0} times the pass that also lights and counts",
            times.median_ms,
            times.median_ms / splat.max(1e-9)
        ));
    }
    if let Some(d) = &row.reference {
        say(&format!("  from the reference: {}", in_words(d)));
    }
    if let Some(e) = &row.encoded {
        say(&format!(
            "  read back and encoded on {} cores: {:.1} frames/s, PNG {} bytes",
            e.cores, e.frames_per_s, e.png_bytes
        ));
    }
}

pub(super) fn report_frames(job: &RenderJob, particles: u64, m: &frames::Measured) {
    let [width, height] = job.view.size_px();
    say(&format!(
        "{particles:>9} particles {width}x{height} {:>3} slices: frame median {:.3} ms, p99 {:.3} ms, wall {:.3} ms; {} entries, {:.1} times the mean in the fullest tile, {} in the longest list",
        job.style.slices,
        m.frame.median_ms,
        m.frame.p99_ms,
        m.frame_wall_ms,
        m.entries,
        m.fullest_over_mean,
        m.longest_list
    ));
    let stages = m.stages.iter();
    let stages: Vec<_> = stages
        .map(|(name, t)| format!("{name} {:.3}", t.median_ms))
        .collect();
    say(&format!("  {}", stages.join(", ")));
}

/// A difference of pictures as a line.
pub(super) fn in_words(d: &Difference) -> String {
    let psnr = d
        .psnr_db
        .map_or_else(|| "equal".to_owned(), |db| format!("PSNR {db:.1} dB"));
    let covered = d.covered.map_or_else(String::new, |covered| {
        let psnr = covered
            .psnr_db
            .map_or_else(|| "equal".to_owned(), |db| format!("PSNR {db:.1} dB"));
        format!(
            "; over the {:.1} % of pixels that are drawn {psnr}, mean FLIP {:.4}",
            covered.percent, covered.mean_flip
        )
    });
    format!(
        "{psnr}, mean FLIP {:.4}, {:.3} % of pixels within one level, at most {:.1} levels{covered}",
        d.mean_flip, d.within_one_level_percent, d.most_levels
    )
}

#[expect(clippy::print_stdout, reason = "results of a command")]
pub(super) fn say(line: &str) {
    println!("{line}");
}

#[expect(clippy::print_stderr, reason = "talk of a command")]
pub(super) fn talk(line: &str) {
    eprintln!("{line}");
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_renderers_are_compared_by_one_clock() {
        let series = |device_s: Vec<f64>, frame_wall_ms| frames::Series {
            frame: Times::of(device_s),
            frame_wall_ms,
        };
        let ours = |series: frames::Series| frames::Measured {
            frame: series.frame,
            frame_wall_ms: series.frame_wall_ms,
            stages: vec![],
            entries: 0,
            fullest_over_mean: 0.0,
            longest_list: 0,
        };
        let both = times_faster(
            &ours(series(vec![0.001; 3], 5.0)),
            &series(vec![0.01; 3], 7.0),
        );
        assert_eq!(both.0, Clock::Device);
        assert!((both.1 - 10.0).abs() < 1e-9);
        // A clock that one of them lacks says nothing about the other.
        for (fast, slow) in [
            (vec![0.001; 3], vec![]),
            (vec![], vec![0.01; 3]),
            (vec![], vec![]),
        ] {
            let (clock, ratio) = times_faster(&ours(series(fast, 5.0)), &series(slow, 15.0));
            assert_eq!(clock, Clock::Wall);
            assert!((ratio - 3.0).abs() < 1e-9);
        }
    }
}
