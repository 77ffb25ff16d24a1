//! Vector fields: the product of the eastward part and that of the northward part in, one job of drifting particles out.
//!
//! A vector is two products on one grid with steps of the same periods, `NAME-east` and `NAME-north`.

use serde::{Deserialize, Serialize};

use crate::ContractError;
use crate::colour::{Palette, TransferFunction};
use crate::manifest::{Bracket, Manifest};
use crate::product::ProductId;
use crate::quantity::Quantity;
use crate::time::{Period, TimeMs};
use crate::time_sample::TimeSample;

/// Farthest a clock may be from 1970, s: beyond every year that has four digits.
const MOST_CLOCK_S: f64 = 1e12;

/// What makes a product the eastward part of a vector that particles drift with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Flow {
    /// The northward part.
    pub northward: TimeSample,
    /// How long particles have drifted, s: since 1970, so that between two instants they move as far as the water does.
    #[serde(with = "crate::exact")]
    pub clock_s: f64,
    /// How wide, how many and how dense trails are where they are not as usual.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub look: Option<TrailLook>,
}

/// What trails look like beside their colours.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TrailLook {
    /// Radius of a trail's head, pixels, 0.5 to 16.
    #[serde(with = "crate::exact")]
    pub radius_px: f64,
    /// Pixels for each trail, 4 to 1e6.
    #[serde(with = "crate::exact")]
    pub area_px: f64,
    /// Optical depth of a head where its opacity is 1, above 0 to 16.
    #[serde(with = "crate::exact")]
    pub depth: f64,
}

/// Is it a part of a vector, positive and negative?
fn is_component(quantity: Quantity) -> bool {
    quantity == Quantity::Current
}

/// The product that holds the northward part of the vector of which this one is the eastward part.
pub fn northward_of(eastward: &Manifest) -> Option<ProductId> {
    let is_part = is_component(eastward.quantity);
    eastward.product.northward().filter(|_| is_part)
}

/// The title of a vector from that of its eastward part: without the word that tells the parts apart.
pub fn title_of_vector(eastward: &str) -> String {
    let is_direction = |word: &str| word.eq_ignore_ascii_case("eastward");
    let words = eastward
        .split_whitespace()
        .filter(|word| !is_direction(word));
    let title = words.collect::<Vec<_>>().join(" ");
    let mut signs = title.trim_end_matches([',', ';', ':']).chars();
    match signs.next() {
        Some(first) => first.to_uppercase().chain(signs).collect(),
        None => eastward.to_owned(),
    }
}

/// Checks that two versions of products are the parts of one vector.
///
/// # Errors
/// The names, quantities or grids that do not belong together.
pub fn check_parts(eastward: &Manifest, northward: &Manifest) -> Result<(), ContractError> {
    let bad = |reason: String| {
        let name = format!("{} and {}", eastward.product, northward.product);
        Err(ContractError::invalid("vector", &name, reason))
    };
    if northward_of(eastward).as_ref() != Some(&northward.product)
        || northward.quantity != eastward.quantity
    {
        return bad("its parts are two products of currents, NAME-east and NAME-north".to_owned());
    }
    if eastward.grid != northward.grid {
        return bad("its parts do not lie on one grid".to_owned());
    }
    Ok(())
}

/// The eastward part of a vector at an instant, and what makes it a flow.
///
/// # Errors
/// Products that are no parts of one vector, an instant around which they have different steps.
pub(crate) fn drift(
    eastward: &Manifest,
    northward: &Manifest,
    time: TimeMs,
) -> Result<(TimeSample, Flow), ContractError> {
    check_parts(eastward, northward)?;
    let empty = || {
        let name = eastward.product.as_str();
        ContractError::invalid("product", name, "it has no steps")
    };
    if steps_around(eastward, time) != steps_around(northward, time) {
        let reason = format!(
            "{} and {} have different steps there; land both parts of every file",
            eastward.product, northward.product
        );
        let text = time.to_string();
        return Err(ContractError::invalid("instant of a flow", &text, reason));
    }
    let flow = Flow {
        northward: northward.time_sample(time).ok_or_else(empty)?,
        clock_s: time.ms() as f64 / 1000.0,
        look: None,
    };
    Ok((eastward.time_sample(time).ok_or_else(empty)?, flow))
}

/// Periods of the steps around an instant, the second only where it has weight.
fn steps_around(manifest: &Manifest, time: TimeMs) -> Option<(Option<Period>, Option<Period>)> {
    let Bracket {
        before,
        after,
        weight,
    } = manifest.bracket(time)?;
    let period = |step: usize| manifest.steps[step].period;
    Some((before.map(period), (weight > 0.0).then(|| period(after))))
}

impl TransferFunction {
    /// What the speed of a vector is drawn with whose parts are of this quantity.
    pub fn of_speed(quantity: Quantity) -> Self {
        let part = Self::default_for(quantity);
        Self {
            palette: Palette::Thermal,
            low: 0.0,
            high: part.low.abs().max(part.high.abs()),
            ..part
        }
    }
}

impl Flow {
    /// Checks a flow that came from outside.
    ///
    /// # Errors
    /// A limit that is broken.
    pub(crate) fn validate(&self) -> Result<(), ContractError> {
        if !(-MOST_CLOCK_S..=MOST_CLOCK_S).contains(&self.clock_s) {
            let text = format!("{self:?}");
            let reason = "its clock lies within 1e12 s of 1970";
            return Err(ContractError::invalid("flow", &text, reason));
        }
        self.look.map_or(Ok(()), TrailLook::validate)?;
        self.northward.validate()
    }
}

impl TrailLook {
    fn validate(self) -> Result<(), ContractError> {
        let limits = [
            (self.radius_px, 0.5..=16.0),
            (self.area_px, 4.0..=1e6),
            (self.depth, 1e-3..=16.0),
        ];
        if limits
            .iter()
            .all(|(number, limits)| limits.contains(number))
        {
            return Ok(());
        }
        let reason = "radii are 0.5 to 16 pixels, areas 4 to 1e6, depths above 0 to 16";
        Err(ContractError::invalid(
            "trails",
            &format!("{self:?}"),
            reason,
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::digest::Digest;
    use crate::grid::Grid;
    use crate::job::{Mode, RenderJob, Style, View};
    use crate::key::ObjectKey;
    use crate::manifest::{MANIFEST_SCHEMA, Step};

    #[test]
    fn a_vector_is_not_named_by_one_of_its_parts() {
        for (part, vector) in [
            ("Eastward surface current", "Surface current"),
            ("Current, eastward", "Current"),
            (
                "surface eastward current of a model",
                "Surface current of a model",
            ),
            ("GlobCurrent", "GlobCurrent"),
            ("Eastward", "Eastward"),
            ("", ""),
        ] {
            assert_eq!(title_of_vector(part), vector);
        }
    }

    const VIEW: View = View::Globe {
        lon_deg: 0.0,
        lat_deg: 0.0,
        height_m: 1e6,
        width_px: 10,
        height_px: 10,
        angles: crate::camera::CameraAngles::NADIR,
    };

    /// Days of January 2002.
    fn part(name: &str, days: std::ops::RangeInclusive<u32>) -> Manifest {
        let product: ProductId = name.parse().unwrap();
        let step = |day: u32| Step {
            masked: None,
            period: Period {
                start: TimeMs::from_ymd(2002, 1, day).unwrap(),
                end: TimeMs::from_ymd(2002, 1, day + 1).unwrap(),
            },
            field: ObjectKey::field(&product, &Digest::of(format!("{name}{day}").as_bytes())),
            raw_sha256: Digest::of(b""),
            origin: String::new(),
            valid_cells: 1,
            contributed: None,
        };
        Manifest {
            schema: MANIFEST_SCHEMA,
            number: 1,
            title: String::new(),
            quantity: Quantity::Current,
            synthetic: false,
            source: String::new(),
            grid: Grid {
                rows: 2,
                cols: 4,
                north_deg: 90.0,
                west_deg: -180.0,
                dlat_deg: 90.0,
                dlon_deg: 90.0,
            },
            steps: days.map(step).collect(),
            domain: ObjectKey::domain(&product, &Digest::of(b"d")),
            series: vec![],
            derived_from: None,
            computed: None,
            notices: vec![],
            indexes: vec![],
            product,
        }
    }

    fn job(north: &Manifest, time: &str) -> Result<RenderJob, ContractError> {
        let style = Style::of_flow(TransferFunction::of_speed(Quantity::Current));
        RenderJob::of_flow(
            &part("sea-east", 1..=9),
            north,
            time.parse().unwrap(),
            VIEW,
            style,
        )
    }

    #[test]
    fn the_northward_part_of_a_vector_is_found_by_its_name() {
        let of = |name: &str| northward_of(&part(name, 1..=1)).map(|id| id.to_string());
        assert_eq!(of("sea-east").as_deref(), Some("sea-north"));
        for other in ["sea-north", "sea", "beast", "east", "sea-eastern"] {
            assert_eq!(of(other), None, "{other}");
        }
        let mut scalar = part("sea-east", 1..=1);
        scalar.quantity = Quantity::Salinity;
        assert_eq!(northward_of(&scalar), None);
    }

    #[test]
    fn a_flow_names_both_parts_and_its_clock_is_the_instant() {
        let job = job(&part("sea-north", 1..=9), "2002-01-03T18:00:00Z").unwrap();
        let flow = job.flow.as_ref().unwrap();
        assert_eq!(flow.northward.product(), "sea-north");
        assert_eq!(
            job.value.after.as_ref().unwrap().weight.to_bits(),
            0.25f64.to_bits()
        );
        assert_eq!(
            flow.northward.after.as_ref().unwrap().weight.to_bits(),
            0.25f64.to_bits()
        );
        // 1 January 2002 was day 11 688.
        let expected = (11_688.0 + 2.75) * 86_400.0;
        assert!((flow.clock_s - expected).abs() < 1e-3, "{}", flow.clock_s);
        let json = serde_json::to_string(&job).unwrap();
        let back: RenderJob = serde_json::from_str(&json).unwrap();
        assert_eq!((back.digest(), &back), (job.digest(), &job));
    }

    #[test]
    fn parts_of_different_days_places_or_kinds_make_no_flow() {
        let reason = |north: &Manifest, time| job(north, time).unwrap_err().to_string();
        let short = part("sea-north", 1..=4);
        assert!(job(&short, "2002-01-03").is_ok());
        assert!(reason(&short, "2002-01-07").contains("different steps"));
        let mut shifted = part("sea-north", 1..=9);
        shifted.grid.west_deg = 0.0;
        assert!(reason(&shifted, "2002-01-03").contains("one grid"));
        assert!(reason(&part("lake-north", 1..=9), "2002-01-03").contains("NAME-north"));
        let mut wind = part("sea-north", 1..=9);
        wind.quantity = Quantity::WindSpeed;
        assert!(reason(&wind, "2002-01-03").contains("currents"));
    }

    #[test]
    fn a_job_says_flow_in_its_mode_and_in_its_parts_or_in_neither() {
        let good = job(&part("sea-north", 1..=9), "2002-01-03").unwrap();
        let is_refused = |change: &dyn Fn(&mut RenderJob)| {
            let mut job = good.clone();
            change(&mut job);
            job.validate().is_err()
        };
        assert!(!is_refused(&|_| ()));
        assert!(is_refused(&|job| job.mode = Mode::Points));
        assert!(is_refused(&|job| job.flow = None));
        assert!(is_refused(&|job| job.accumulated = Some(job.value.clone())));
        for clock_s in [f64::NAN, f64::INFINITY, 2e12, -2e12] {
            assert!(is_refused(
                &|job| job.flow.as_mut().unwrap().clock_s = clock_s
            ));
        }
        assert!(is_refused(&|job| {
            let domain = job.value.before.clone().unwrap();
            job.flow.as_mut().unwrap().northward.domain = domain;
        }));
    }

    #[test]
    fn a_job_without_a_flow_says_nothing_of_it() {
        let mut plain = job(&part("sea-north", 1..=9), "2002-01-03").unwrap();
        plain.flow = None;
        plain.mode = Mode::Map;
        plain.validate().unwrap();
        assert!(!serde_json::to_string(&plain).unwrap().contains("flow"));
    }

    #[test]
    fn the_clock_and_the_northward_part_are_in_the_name_of_the_picture() {
        let north = part("sea-north", 1..=9);
        let base = job(&north, "2002-01-03").unwrap();
        let mut later = base.clone();
        later.flow.as_mut().unwrap().clock_s += 1.0;
        let mut other = base.clone();
        other.flow.as_mut().unwrap().northward.before = None;
        assert_ne!(base.key(), later.key());
        assert_ne!(base.key(), other.key());
    }
}
