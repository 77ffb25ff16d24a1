//! The numbered list of what a product consists of: the only thing that changes, and it changes whole.

mod asked;
mod id;
mod inside;
mod page_ends;
mod paged;

use serde::{Deserialize, Serialize};

use crate::computed::Computed;
use crate::digest::Digest;
use crate::grid::Grid;
use crate::index::DimensionIndex;
use crate::key::ObjectKey;
use crate::masked::MaskedCells;
use crate::notice::{NoticeOrder, NoticeRun};
use crate::product::ProductId;
use crate::quantity::Quantity;
use crate::time::{Period, TimeMs};

pub use asked::AskedVersion;
pub use id::ManifestId;
pub use paged::{LEAST_PAGED_STEPS, OLDEST_PAGED_SCHEMA, PAGED_SCHEMA, Page, PagedManifest};

/// Version of the manifest's JSON as it is written. Those since [`OLDEST_MANIFEST_SCHEMA`] are read too.
///
/// 2: the order of the notices that brought the files; how complete accumulated sums are; a manifest is sealed when it is
/// stored.
pub const MANIFEST_SCHEMA: u32 = 2;
/// Oldest version that is read.
pub const OLDEST_MANIFEST_SCHEMA: u32 = 1;

/// One version of one product. Readers see it whole or not at all.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Manifest {
    /// [`MANIFEST_SCHEMA`].
    pub schema: u32,
    /// Product.
    pub product: ProductId,
    /// 1, 2, 3 ... in the order of commits.
    pub number: u64,
    /// Title for people.
    pub title: String,
    /// Quantity; values are stored in its unit.
    pub quantity: Quantity,
    /// Made up by a program rather than measured: shown on every page.
    pub synthetic: bool,
    /// Where the data come from, as a citation.
    pub source: String,
    /// The one grid of all steps.
    pub grid: Grid,
    /// Steps in the order of time, not overlapping.
    pub steps: Vec<Step>,
    /// Cells that hold data in some step: a set of their numbers, row-major.
    pub domain: ObjectKey,
    /// The same values time-major.
    pub series: Vec<SeriesSegment>,
    /// The manifest this one was derived from, if it was computed rather than ingested.
    pub derived_from: Option<ManifestId>,
    /// How, if it was by an expression, by regridding, as a statistic or a correlation; `derived_from` is the first of its inputs then. Absent
    /// of accumulated carbon, and of statistics of before it was kept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub computed: Option<Computed>,
    /// Place of the steps' files in the order of notices; of steps without one nothing is known, and any file is newer.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub notices: Vec<NoticeRun>,
    /// Which index of further dimensions its files are read at, in the order of their dimensions: those of another depth or member are another
    /// product. None of files without further dimensions, and of what is computed or attached.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub indexes: Vec<DimensionIndex>,
}

/// One time step of a product.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Step {
    /// What the values are a mean over (or, for accumulated carbon, what `end` they have reached).
    pub period: Period,
    /// Map-major chunks.
    #[serde(rename = "frame")]
    pub field: ObjectKey,
    /// Digest of the input file; of the job for derived steps.
    pub raw_sha256: Digest,
    /// Name of the input file, for people.
    pub origin: String,
    /// Cells with data.
    pub valid_cells: u64,
    /// Cells that the file gave a value for and that hold none here. None of steps that landed before these were counted
    /// (what they lack is not known), and of computed ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub masked: Option<MaskedCells>,
    /// How complete the sums of accumulated carbon are; none for means, and in versions that did not count it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contributed: Option<Contributed>,
}

/// What of the accumulated time each cell's sum holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contributed {
    /// Steps and time that contributed, map-major chunks.
    pub counts: ObjectKey,
    /// Cells that had data in all of the accumulated time: a sum over one month of twelve is not a complete one.
    pub complete_cells: u64,
    /// Of the first step alone: where accumulation was asked to begin, if the source had no step there; it does once that has landed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<TimeMs>,
}

/// A run of consecutive steps, stored time-major.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeriesSegment {
    /// Index of its first step.
    pub first_step: u32,
    /// Number of steps.
    pub steps: u32,
    /// Time-major chunks.
    pub series: ObjectKey,
}

impl Manifest {
    /// What was masked in its steps, as far as it was counted, and of how many steps it was not.
    pub fn masked(&self) -> (MaskedCells, usize) {
        let counted = self.steps.iter().filter_map(|step| step.masked);
        let uncounted = self
            .steps
            .iter()
            .filter(|step| step.masked.is_none())
            .count();
        (counted.sum(), uncounted)
    }

    /// Where accumulated carbon was asked to begin: before its first step where the source had none there.
    pub fn accumulated_since(&self) -> Option<TimeMs> {
        let first = self.steps.first()?;
        let since = first.contributed.as_ref().and_then(|it| it.since);
        Some(since.unwrap_or(first.period.start))
    }

    /// The name that answers cite.
    pub fn id(&self) -> ManifestId {
        ManifestId::new(
            self.product.clone(),
            self.number,
            Digest::of_json(self).short(),
        )
    }

    /// Of each step the place of its file in the order of notices, as far as it is known.
    pub fn notice_orders(&self) -> Vec<Option<NoticeOrder>> {
        NoticeRun::orders(&self.notices, self.steps.len())
    }

    /// Index of the step of exactly this period.
    pub fn step_of(&self, period: Period) -> Option<usize> {
        let found = self.steps.binary_search_by_key(&period, |step| step.period);
        found.ok()
    }

    /// First and last instant covered.
    pub fn extent(&self) -> Option<Period> {
        let (first, last) = (self.steps.first()?, self.steps.last()?);
        Some(Period {
            start: first.period.start,
            end: last.period.end,
        })
    }

    /// The two steps an instant lies between, and how far it has come from the first (0) to the second (1). Of values that have nothing
    /// between two of them it is one step: the one that the instant lies in, else the nearer one.
    ///
    /// A step's mean holds at the middle of its period; before the first middle and after the last the nearest
    /// step holds. Accumulated carbon holds at the *end* of its period and grows from zero at the first start.
    /// This is the weight of eq. 3 in docs/method.md.
    pub fn bracket(&self, time: TimeMs) -> Option<Bracket> {
        let accumulated = self.quantity == Quantity::AccumulatedCarbon;
        let at = |step: &Step| {
            if accumulated {
                step.period.end
            } else {
                step.period.mid()
            }
        };
        let after = self.steps.partition_point(|step| at(step) <= time);
        let last = self.steps.len().checked_sub(1)?;
        let share =
            |t1: TimeMs, t2: TimeMs| (time.ms() - t1.ms()) as f64 / (t2.ms() - t1.ms()) as f64;
        if after > last {
            return Some(Bracket {
                before: Some(last),
                after: last,
                weight: 0.0,
            });
        }
        if after == 0 {
            let Period { start, end } = self.steps[0].period;
            let weight = if accumulated {
                share(start, end).max(0.0)
            } else {
                0.0
            };
            return Some(Bracket {
                before: (!accumulated).then_some(0),
                after: 0,
                weight,
            });
        }
        let weight = share(at(&self.steps[after - 1]), at(&self.steps[after]));
        if !self.quantity.is_linear() {
            return Some(self.nearer(time, after, weight));
        }
        Some(Bracket {
            before: Some(after - 1),
            after,
            weight,
        })
    }

    /// One of two steps whose middles an instant lies between, the second of them `after`.
    fn nearer(&self, time: TimeMs, after: usize, weight: f64) -> Bracket {
        let holds = |step: usize| {
            let Period { start, end } = self.steps[step].period;
            start <= time && time < end
        };
        let is_second = holds(after) || (!holds(after - 1) && weight >= 0.5);
        let step = if is_second { after } else { after - 1 };
        Bracket {
            before: Some(step),
            after: step,
            weight: 0.0,
        }
    }
}

/// Two neighbouring steps and the weight of the second.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bracket {
    /// Index of the step before; none where accumulation starts, that is zero in every cell of the domain.
    pub before: Option<usize>,
    /// Index of the step after; the same as `before` at the ends.
    pub after: usize,
    /// 0 at `before`, towards 1 at `after`.
    pub weight: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    fn manifest(quantity: Quantity) -> Manifest {
        let product: ProductId = "p".parse().unwrap();
        let digest = Digest::of(b"");
        let step = |month| Step {
            masked: None,
            period: Period::month(2000, month).unwrap(),
            field: ObjectKey::field(&product, &digest),
            raw_sha256: digest,
            origin: "f.nc".into(),
            valid_cells: 1,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            number: 3,
            title: String::new(),
            quantity,
            synthetic: false,
            source: String::new(),
            grid: Grid {
                rows: 1,
                cols: 1,
                north_deg: 1.0,
                west_deg: 0.0,
                dlat_deg: 1.0,
                dlon_deg: 1.0,
            },
            steps: (1..=3).map(step).collect(),
            domain: ObjectKey::domain(&product, &digest),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        }
    }

    #[test]
    fn a_mean_holds_at_the_middle_of_its_month() {
        let m = manifest(Quantity::CarbonFlux);
        let at = |s: &str| m.bracket(s.parse().unwrap()).unwrap();
        assert_eq!(
            at("2000-01-16T12:00:00Z"),
            Bracket {
                before: Some(0),
                after: 1,
                weight: 0.0
            }
        );
        assert_eq!(
            at("1999-01-01"),
            Bracket {
                before: Some(0),
                after: 0,
                weight: 0.0
            }
        );
        assert_eq!(
            at("2009-01-01"),
            Bracket {
                before: Some(2),
                after: 2,
                weight: 0.0
            }
        );
        let half_way = at("2000-01-31T12:00:00Z"); // 15 of the 30 days between 16 Jan 12:00 and 15 Feb 12:00
        assert!((half_way.weight - 0.5).abs() < 1e-12);
    }

    #[test]
    fn codes_and_directions_are_those_of_one_step() {
        let direction = Quantity::open("wind_from_direction", "degree", "Wind direction").unwrap();
        let mut m = manifest(direction);
        // Of March nothing is there until its 20th.
        m.steps[2].period.start = "2000-03-20".parse().unwrap();
        for (time, step) in [
            ("1999-01-01", 0),
            ("2000-01-31T23:00:00Z", 0),
            ("2000-02-01", 1),
            ("2000-02-29T12:00:00Z", 1),
            // In no step: middles are 15 February 12:00 and 25 March 24:00.
            ("2000-03-05", 1),
            ("2000-03-10", 2),
            ("2000-03-20", 2),
            ("2009-01-01", 2),
        ] {
            let bracket = m.bracket(time.parse().unwrap()).unwrap();
            let one = Bracket {
                before: Some(step),
                after: step,
                weight: 0.0,
            };
            assert_eq!(bracket, one, "{time}");
        }
        assert!(Quantity::CarbonFlux.is_linear());
    }

    #[test]
    fn accumulated_carbon_holds_at_the_end_of_its_month() {
        let m = manifest(Quantity::AccumulatedCarbon);
        let at = |s: &str| m.bracket(s.parse().unwrap()).unwrap();
        assert_eq!(
            at("2000-02-01"),
            Bracket {
                before: Some(0),
                after: 1,
                weight: 0.0
            }
        );
        assert_eq!(
            at("1999-01-01"),
            Bracket {
                before: None,
                after: 0,
                weight: 0.0
            }
        );
        let in_the_first_month = at("2000-01-16T12:00:00Z");
        assert_eq!(
            in_the_first_month,
            Bracket {
                before: None,
                after: 0,
                weight: 0.5
            }
        );
    }

    /// Bytes as version 1 wrote them: they must keep their meaning and their name.
    #[test]
    fn a_manifest_of_version_1_is_read_and_keeps_its_name() {
        let json = r#"{"schema":1,"product":"p","number":3,"title":"","quantity":"carbon_flux","synthetic":false,"source":"","grid":{"rows":1,"cols":1,"north_deg":1.0,"west_deg":0.0,"dlat_deg":1.0,"dlon_deg":1.0},"steps":[{"period":{"start":"2000-01-01T00:00:00Z","end":"2000-02-01T00:00:00Z"},"frame":"frames/p/e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855","raw_sha256":"e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855","origin":"f.nc","valid_cells":1}],"domain":"domain/p/e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855","series":[],"derived_from":null}"#;
        let old: Manifest = serde_json::from_str(json).unwrap();
        assert_eq!(serde_json::to_string(&old).unwrap(), json);
        assert_eq!(old.id().to_string(), "p@3-56d19b9b");
        assert_eq!(old.notice_orders(), [None]);
    }

    #[test]
    fn what_is_masked_is_counted_apart_from_what_is_not_known() {
        let mut m = manifest(Quantity::CarbonFlux);
        let old = m.id();
        assert_eq!(m.masked(), (MaskedCells::default(), 3));
        let json = serde_json::to_string(&m).unwrap();
        assert!(
            !json.contains("masked"),
            "a step of old times is as it was: {json}"
        );
        m.steps[0].masked = Some(MaskedCells::default());
        m.steps[1].masked = Some(MaskedCells {
            implausible: 7,
            ..MaskedCells::default()
        });
        assert_eq!((m.masked().0.implausible, m.masked().1), (7, 1));
        let json = serde_json::to_string(&m).unwrap();
        assert_eq!(serde_json::from_str::<Manifest>(&json).unwrap(), m);
        assert_ne!(m.id(), old);
    }

    #[test]
    fn the_index_that_files_are_read_at_is_part_of_a_version_and_absent_where_there_is_none() {
        let mut m = manifest(Quantity::CarbonFlux);
        let flat = m.id();
        assert!(!serde_json::to_string(&m).unwrap().contains("indexes"));
        m.indexes = vec!["depth=3".parse().unwrap()];
        let json = serde_json::to_string(&m).unwrap();
        assert!(json.contains(r#""indexes":["depth=3"]"#), "{json}");
        assert_eq!(serde_json::from_str::<Manifest>(&json).unwrap(), m);
        assert_ne!(m.id(), flat);
    }

    #[test]
    fn a_manifest_and_its_name_round_trip_as_json() {
        let m = manifest(Quantity::CarbonFlux);
        let json = serde_json::to_string(&m).unwrap();
        assert_eq!(serde_json::from_str::<Manifest>(&json).unwrap(), m);
        assert_eq!(m.id().to_string().parse::<ManifestId>().unwrap(), m.id());
        let mut other = m.clone();
        other.steps[0].valid_cells = 2;
        assert_ne!(other.id(), m.id());
    }
}
