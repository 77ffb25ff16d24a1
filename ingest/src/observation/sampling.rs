//! How the samples of a file belong to its platforms (CF conventions, chapter 9.3): ragged one behind the other, ragged by
//! index, in rows, or all of one platform; and what the platforms are called. Samples of casts of ships and stations belong to
//! their casts, and these to the ships or stations.

use contract::event::RejectReason;

use super::argo;
use super::recognise::Feature;
use super::values::{MAX_VALUES, read, read_stored};
use super::{Source, name};
use crate::error::{Rejection, Stop};
use crate::inspect::file::description::{Description, Dimension, Kind, Part, Variable};
use crate::inspect::reader::session::Session;

/// Most platforms of one file.
const MAX_INSTANCES: u64 = 100_000;
/// Most letters of one name.
const MAX_LETTERS: u64 = 256;

/// Which samples belong to which platform.
#[derive(Debug, Default)]
pub(super) struct Sampling {
    /// Dimension that runs over platforms, if there is one.
    instance: Option<String>,
    /// Ragged files: the dimension that runs over samples, and the platform of each.
    ragged: Option<(String, Vec<u32>)>,
    /// Files of casts: the dimension that runs over the ships or stations, and whose each cast (the platforms above) is.
    owners: Option<(String, Vec<u32>)>,
    /// Names, in their order.
    names: Vec<String>,
    named: Named,
}

/// Who has the names of a file.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Named {
    /// The platforms.
    #[default]
    Instances,
    /// The ships or stations whose casts these are.
    Owners,
    /// The one ship or station of all samples.
    One,
    /// Nobody: there is no variable of names, and the file or its name says what all of it is of.
    File,
}

impl Sampling {
    /// Does nothing in the file tell its platforms apart?
    pub(super) fn is_nameless(&self) -> bool {
        self.named == Named::File
    }

    /// The dimension that runs over ships or stations whose casts these are.
    pub(super) fn owner_dimension(&self) -> Option<&str> {
        self.owners
            .as_ref()
            .map(|(dimension, _)| dimension.as_str())
    }

    /// The ship or station of a cast.
    pub(super) fn owner_of(&self, instance: usize) -> usize {
        let of = |(_, owners): &(String, Vec<u32>)| owners.get(instance).copied();
        self.owners.as_ref().and_then(of).unwrap_or(0) as usize
    }

    pub(super) fn instance_dimension(&self) -> Option<&str> {
        self.instance.as_deref()
    }

    pub(super) fn sample_dimension(&self) -> Option<&str> {
        self.ragged
            .as_ref()
            .map(|(dimension, _)| dimension.as_str())
    }

    /// The platform of a sample of a ragged file.
    pub(super) fn instance_of(&self, sample: usize) -> usize {
        let of = |(_, instances): &(String, Vec<u32>)| instances.get(sample).copied();
        self.ragged.as_ref().and_then(of).unwrap_or(0) as usize
    }

    /// Name of the platform of a cell of a measured variable.
    pub(super) fn name(&self, measured: &Variable, cell: &[usize]) -> String {
        let place = |wanted: Option<&str>| {
            let is_it = |name: Option<&str>| name.is_some() && name == wanted;
            measured
                .dimensions
                .iter()
                .position(|d| is_it(d.name.as_deref()))
        };
        let own = place(self.instance_dimension()).map(|at| cell[at]);
        let through = || place(self.sample_dimension()).map(|at| self.instance_of(cell[at]));
        let instance = || own.or_else(through);
        let index = match self.named {
            Named::Instances | Named::File => instance().unwrap_or(0),
            Named::Owners => {
                let owner = place(self.owner_dimension()).map(|at| cell[at]);
                let of_cast = || instance().map(|cast| self.owner_of(cast));
                owner.or_else(of_cast).unwrap_or(0)
            }
            Named::One => 0,
        };
        self.names
            .get(index)
            .cloned()
            .unwrap_or_else(|| (index + 1).to_string())
    }

    /// Reads what a file says of its platforms.
    pub(super) async fn of(
        session: &mut Session,
        file: &Description,
        feature: Feature,
        source: Source<'_>,
    ) -> Result<Self, Stop> {
        let mut sampling = Self::default();
        let counts = attributed(file, "sample_dimension");
        let indices = attributed(file, "instance_dimension");
        if let Some((variable, samples)) = counts {
            sampling.instance = dimension(variable);
            let counts = read(session, variable).await?;
            let instances = contiguous(&variable.name, &counts, length(file, &samples))?;
            sampling.ragged = Some((samples, instances));
            let of_casts = indices.filter(|(index, _)| dimension(index) == sampling.instance);
            if let Some((variable, owner)) = of_casts {
                let indices = read(session, variable).await?;
                sampling.owners = Some((owner, indexed(&variable.name, &indices)?));
            }
        } else if let Some((variable, instance)) = indices {
            sampling.instance = Some(instance);
            if let Some(samples) = dimension(variable) {
                let indices = read(session, variable).await?;
                sampling.ragged = Some((samples, indexed(&variable.name, &indices)?));
            }
        }
        let id = identifier(file, feature);
        sampling.names = match id {
            Some(id) => names(session, file, id).await?,
            None => lone_name(file, source),
        };
        if let (Some(id), None) = (id, &sampling.instance) {
            // Rows: the first dimension of the names is that of the platforms. A lone name has only its letters.
            let rows = id.dimensions.first().map_or(1, |d| d.len);
            let is_rows =
                sampling.names.len() as u64 == rows && rows > 1 || id.dimensions.len() == 2;
            sampling.instance = if is_rows { dimension(id) } else { None };
        }
        sampling.named = match id {
            Some(id) => sampling.named_by(id)?,
            None => Named::File,
        };
        Ok(sampling)
    }

    /// Who has the names of a variable.
    fn named_by(&self, id: &Variable) -> Result<Named, Rejection> {
        let own = dimension(id);
        let is_along = |other: Option<&str>| own.is_some() && own.as_deref() == other;
        if is_along(self.owner_dimension()) {
            return Ok(Named::Owners);
        }
        if self.names.len() == 1 && !is_along(self.instance_dimension()) {
            return Ok(Named::One);
        }
        let rows = id.dimensions.first().map(|d| d.len);
        if let (Some(own), Some(instance), Some((_, of_samples))) =
            (&own, &self.instance, &self.ragged)
            && own != instance
            && of_samples
                .iter()
                .any(|of| u64::from(*of) >= rows.unwrap_or(0))
        {
            let detail = format!(
                "names platforms along {own:?}, and nothing says which of them each of {instance:?} belongs to; give its index in a \
                 variable with instance_dimension = {own:?}"
            );
            return Err(corrupt(&id.name, detail));
        }
        Ok(Named::Instances)
    }
}

/// The variable with an attribute that names a dimension, and that dimension.
fn attributed<'a>(file: &'a Description, attribute: &str) -> Option<(&'a Variable, String)> {
    let of = |v: &'a Variable| Some((v, v.attributes.text(attribute)?.to_owned()));
    file.variables.iter().find_map(of)
}

fn dimension(variable: &Variable) -> Option<String> {
    variable.dimensions.first()?.name.clone()
}

/// Length of a dimension, as some variable has it.
fn length(file: &Description, dimension: &str) -> Option<u64> {
    let all = file.variables.iter().flat_map(|v| &v.dimensions);
    let mut of_name = all.filter(|d| d.name.as_deref() == Some(dimension));
    of_name.next().map(|d| d.len)
}

fn corrupt(object: &str, detail: impl AsRef<str>) -> Rejection {
    Rejection::new(RejectReason::Corrupt, object, detail)
}

/// The platform of each sample from the number of samples of each platform.
fn contiguous(name: &str, counts: &[f64], samples: Option<u64>) -> Result<Vec<u32>, Rejection> {
    let samples =
        samples.ok_or_else(|| corrupt(name, "names a sample dimension that no variable has"))?;
    if samples > MAX_VALUES {
        let detail = format!("speaks of {samples} samples, at most {MAX_VALUES} are read");
        return Err(Rejection::new(RejectReason::TooLarge, name, detail));
    }
    let mut instances = vec![];
    for (instance, count) in counts.iter().enumerate() {
        // A platform without a count has no samples.
        let count = if count.is_nan() { 0.0 } else { *count };
        let left = samples - instances.len() as u64;
        if count < 0.0 || count.fract() != 0.0 || count > left as f64 {
            let detail =
                format!("gives {count} samples to a platform where {left} are left of {samples}");
            return Err(corrupt(name, detail));
        }
        instances.resize(instances.len() + count as usize, instance as u32);
    }
    if (instances.len() as u64) < samples {
        let detail = format!(
            "gives {} of {samples} samples to platforms",
            instances.len()
        );
        return Err(corrupt(name, detail));
    }
    Ok(instances)
}

/// The platform of each sample from its index.
fn indexed(name: &str, indices: &[f64]) -> Result<Vec<u32>, Rejection> {
    let index = |index: &f64| {
        let is_index = (0.0..MAX_INSTANCES as f64).contains(index) && index.fract() == 0.0;
        is_index.then_some(*index as u32).ok_or_else(|| {
            corrupt(
                name,
                format!("says {index}, which is no index of a platform"),
            )
        })
    };
    indices.iter().map(index).collect()
}

/// The variable that names platforms: of a station's or ship's casts it is the station or ship that is the platform. Single
/// samples have no role for it; a variable of names says so by its standard name. Argo's has neither.
fn identifier(file: &Description, feature: Feature) -> Option<&Variable> {
    let with = |attribute: &'static str, text: &'static str| {
        let mut all = file.variables.iter();
        all.find(move |v| v.attributes.text(attribute) == Some(text))
    };
    let by_role = ["timeseries_id", "trajectory_id", "profile_id"]
        .into_iter()
        .find_map(|role| with("cf_role", role));
    let by_name = || {
        ["platform_id", "platform_name"]
            .into_iter()
            .find_map(|name| with("standard_name", name))
    };
    by_role.or_else(|| match feature {
        Feature::Point => by_name(),
        _ if feature.is_of_casts() => file.variable(argo::PLATFORM),
        _ => None,
    })
}

/// Names of platforms: numbers, letters by platform, or texts.
async fn names(
    session: &mut Session,
    file: &Description,
    id: &Variable,
) -> Result<Vec<String>, Stop> {
    let (rows, letters) = match id.dimensions.as_slice() {
        [] => (1, 1),
        // One dimension is that of the letters of a lone name, unless something measured has it too.
        [one] if id.kind == Kind::Text(1) && !is_of_platforms(file, one) => (1, one.len),
        [one] => (one.len, 1),
        [rows, letters] if id.kind == Kind::Text(1) => (rows.len, letters.len),
        _ => return Err(corrupt(&id.name, "has too many dimensions for names").into()),
    };
    if rows > MAX_INSTANCES || letters > MAX_LETTERS {
        let detail = format!(
            "names {rows} platforms with {letters} letters, at most {MAX_INSTANCES} with {MAX_LETTERS} are read"
        );
        return Err(Rejection::new(RejectReason::TooLarge, &id.name, detail).into());
    }
    let texts: Vec<String> = match id.kind {
        Kind::Integer(_) | Kind::Unsigned(_) | Kind::Float(_) => {
            let numbers = read_stored(session, id).await?;
            numbers.iter().map(ToString::to_string).collect()
        }
        // Without a platform or a letter there is nothing to read.
        Kind::Text(_) if rows * letters == 0 => vec![],
        Kind::Text(bytes) => {
            let in_name = letters * u64::from(bytes);
            let parts = vec![Part::All; id.dimensions.len()];
            let numbers = session.read(&id.name, &parts, rows * in_name).await?;
            numbers.chunks(in_name as usize).map(text).collect()
        }
        Kind::Other => {
            let detail = "names platforms by neither numbers nor text; name them by one of these";
            return Err(Rejection::new(RejectReason::Unreadable, &id.name, detail).into());
        }
    };
    let named = |(index, text): (usize, String)| {
        name::platform(&text).unwrap_or_else(|| (index + 1).to_string())
    };
    Ok(texts.into_iter().enumerate().map(named).collect())
}

/// Is a dimension one that numbers are given for?
fn is_of_platforms(file: &Description, dimension: &Dimension) -> bool {
    let mut numeric = file.variables.iter().filter(|v| v.is_numeric());
    dimension.name.is_some() && numeric.any(|v| v.dimensions.contains(dimension))
}

/// A text from its bytes and the zeros behind them; a letter that was cut in two is left out.
fn text(numbers: &[f64]) -> String {
    let bytes: Vec<u8> = numbers
        .iter()
        .map(|b| *b as u8)
        .take_while(|b| *b != 0)
        .collect();
    let text = String::from_utf8_lossy(&bytes);
    text.trim_end_matches(char::REPLACEMENT_CHARACTER)
        .to_owned()
}

/// The name of the one platform of a file without names.
fn lone_name(file: &Description, source: Source<'_>) -> Vec<String> {
    let stated = [
        "platform_code",
        "site_code",
        "wmo_platform_code",
        "platform_name",
        "platform",
        "id",
    ];
    let name = stated
        .into_iter()
        .filter_map(|attribute| file.attributes.text(attribute))
        .find_map(name::platform)
        .or_else(|| name::platform(name::stem(source.file_name)));
    name.into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_and_indices_give_every_sample_its_platform() {
        assert_eq!(
            contiguous("n", &[2.0, 0.0, 1.0], Some(3)).unwrap(),
            [0, 0, 2]
        );
        assert_eq!(indexed("n", &[1.0, 0.0, 1.0]).unwrap(), [1, 0, 1]);
    }

    #[test]
    fn counts_that_do_not_fit_are_refused() {
        for (counts, samples) in [
            (vec![2.0, 2.0], Some(3)),
            (vec![2.0], Some(3)),
            (vec![-1.0, 4.0], Some(3)),
            (vec![1e300], Some(3)),
            (vec![1.5, 1.5], Some(3)),
            (vec![3.0], None),
        ] {
            let refused = contiguous("n", &counts, samples).unwrap_err();
            assert_eq!(refused.reason, RejectReason::Corrupt, "{counts:?}");
        }
        for index in [-1.0, 0.5, f64::NAN, 1e9] {
            assert!(indexed("n", &[index]).is_err(), "{index}");
        }
    }
}
