//! What pictures are held to: measured scenes in, those that miss a bound out.

use anyhow::{Result, bail, ensure};

use super::Measured;

/// Bounds of both measures over what is drawn, for every scene and number of slices.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Bounds {
    pub(super) least_psnr_db: Option<f64>,
    pub(super) most_flip: Option<f64>,
}

impl Bounds {
    pub(super) fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Checks that they are bounds at all.
    pub(super) fn validate(&self) -> Result<()> {
        if let Some(db) = self.least_psnr_db {
            ensure!(
                db.is_finite() && db > 0.0,
                "--least-psnr {db}: decibels over 0"
            );
        }
        if let Some(flip) = self.most_flip {
            ensure!((0.0..=1.0).contains(&flip), "--most-flip {flip}: 0 to 1");
        }
        Ok(())
    }

    /// An error that names the scenes that miss them, if any does.
    pub(super) fn hold(&self, scenes: &[Measured]) -> Result<()> {
        let missed: Vec<String> = scenes
            .iter()
            .flat_map(|scene| self.missed_by(scene))
            .collect();
        if missed.is_empty() {
            return Ok(());
        }
        let wanted = [
            self.least_psnr_db.map(|db| format!("{db} dB or more")),
            self.most_flip
                .map(|flip| format!("a mean FLIP of {flip} or less")),
        ];
        let wanted: Vec<String> = wanted.into_iter().flatten().collect();
        bail!(
            "too far from the reference over what is drawn, where {} is wanted:\n  {}",
            wanted.join(" and "),
            missed.join("\n  ")
        );
    }

    fn missed_by(&self, scene: &Measured) -> impl Iterator<Item = String> {
        scene.rows.iter().filter_map(|row| {
            // A scene that shows nothing says nothing, and misses what it was to show.
            let (psnr_db, flip) = match row.difference.covered {
                Some(covered) => (covered.psnr_db.unwrap_or(f64::INFINITY), covered.mean_flip),
                None => (0.0, 1.0),
            };
            let misses = self.least_psnr_db.is_some_and(|least| psnr_db < least)
                || self.most_flip.is_some_and(|most| flip > most);
            let slices = row.slices;
            misses.then(|| {
                format!(
                    "{}, {slices} slices: {psnr_db:.2} dB, mean FLIP {flip:.4}",
                    scene.name
                )
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use render_proof::{Covered, Difference, QualityRow};

    fn scene(name: &str, rows: &[(u32, f64, f64)]) -> Measured {
        let row = |(slices, psnr_db, mean_flip): &(u32, f64, f64)| QualityRow {
            slices: *slices,
            difference: Difference {
                // Over the whole picture all is well.
                psnr_db: Some(70.0),
                mean_flip: 0.001,
                most_levels: 1.0,
                within_one_level_percent: 100.0,
                covered: Some(Covered {
                    percent: 20.0,
                    psnr_db: Some(*psnr_db),
                    mean_flip: *mean_flip,
                }),
            },
        };
        Measured {
            name: name.to_owned(),
            rows: rows.iter().map(row).collect(),
        }
    }

    #[test]
    fn scenes_that_miss_a_bound_are_named_with_what_they_have() {
        let bounds = Bounds {
            least_psnr_db: Some(40.0),
            most_flip: Some(0.03),
        };
        let good = scene("coast", &[(64, 45.0, 0.03), (128, 40.0, 0.01)]);
        bounds.hold(&[good]).unwrap();
        let scenes = [
            scene("coast", &[(64, 45.0, 0.02)]),
            scene("limb", &[(64, 39.96, 0.02), (128, 41.0, 0.02)]),
            scene("disc", &[(64, 45.0, 0.0304)]),
        ];
        let told = bounds.hold(&scenes).unwrap_err().to_string();
        assert!(!told.contains("coast"), "{told}");
        assert!(told.contains("limb, 64 slices: 39.96 dB"), "{told}");
        assert!(!told.contains("128 slices"), "{told}");
        assert!(
            told.contains("disc, 64 slices: 45.00 dB, mean FLIP 0.0304"),
            "{told}"
        );
        // Each bound alone.
        let psnr = Bounds {
            most_flip: None,
            ..bounds
        };
        let told = psnr.hold(&scenes).unwrap_err().to_string();
        assert!(told.contains("limb") && !told.contains("disc"), "{told}");
        Bounds::default().hold(&scenes).unwrap();
    }

    #[test]
    fn equal_pictures_meet_every_bound_and_empty_ones_none() {
        let bounds = Bounds {
            least_psnr_db: Some(90.0),
            most_flip: Some(0.0),
        };
        let mut equal = scene("equal", &[(64, 1.0, 0.0)]);
        let covered = equal.rows[0].difference.covered.as_mut().unwrap();
        covered.psnr_db = None;
        bounds.hold(&[equal]).unwrap();
        let mut empty = scene("empty", &[(64, 99.0, 0.0)]);
        empty.rows[0].difference.covered = None;
        assert!(bounds.hold(&[empty]).is_err());
    }

    #[test]
    fn bounds_that_are_none_are_refused() {
        for (least_psnr_db, most_flip) in [
            (Some(f64::NAN), None),
            (Some(-3.0), None),
            (None, Some(1.5)),
        ] {
            let bounds = Bounds {
                least_psnr_db,
                most_flip,
            };
            assert!(bounds.validate().is_err(), "{bounds:?}");
        }
    }
}
