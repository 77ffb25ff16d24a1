//! Observations of a file that wait for their turn to be stored, as text: few in memory, many in a file without a name.

use std::io::Seek as _;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use contract::ContractError;
use contract::observation::Observation;
use tempfile::{SpooledTempFile, spooled_tempfile_in};

use super::gather::OBSERVATION_BYTES;
use crate::error::IngestError;

/// Bytes of a file's observations that are held; some thousand observations. Many files may wait.
const HELD_BYTES: usize = 1 << 20;

/// Observations that wait; clones are the same.
#[derive(Debug, Clone)]
pub(crate) struct Waiting {
    folder: PathBuf,
    rows: Arc<Mutex<SpooledTempFile>>,
    count: usize,
}

impl Waiting {
    /// Puts observations by; what is too large to be held goes to a file in `folder`.
    ///
    /// # Errors
    /// It cannot be written.
    pub(crate) fn of(folder: &Path, observations: &[Observation]) -> Result<Self, IngestError> {
        let mut file = spooled_tempfile_in(HELD_BYTES, folder);
        write(&mut file, observations).map_err(|error| failed(folder, error))?;
        Ok(Self {
            folder: folder.to_owned(),
            rows: Arc::new(Mutex::new(file)),
            count: observations.len(),
        })
    }

    /// How many they are.
    pub(crate) fn count(&self) -> usize {
        self.count
    }

    /// What they take once they are read, bytes.
    pub(crate) fn memory_bytes(&self) -> u64 {
        self.count as u64 * OBSERVATION_BYTES
    }

    /// All of them, as they were, to the bit.
    ///
    /// # Errors
    /// Their file cannot be read.
    pub(crate) fn read(&self) -> Result<Vec<Observation>, IngestError> {
        // Whoever panicked while reading left the file as it is.
        let mut file = self.rows.lock().unwrap_or_else(PoisonError::into_inner);
        read(&mut file, self.count).map_err(|error| failed(&self.folder, error))
    }
}

fn write(file: &mut SpooledTempFile, observations: &[Observation]) -> Result<(), csv::Error> {
    let mut rows = csv::Writer::from_writer(file);
    observations.iter().try_for_each(|it| rows.serialize(it))?;
    Ok(rows.flush()?)
}

fn read(file: &mut SpooledTempFile, count: usize) -> Result<Vec<Observation>, csv::Error> {
    file.rewind()?;
    let mut all = Vec::with_capacity(count);
    for row in csv::Reader::from_reader(file).deserialize() {
        all.push(row?);
    }
    Ok(all)
}

fn failed(folder: &Path, error: csv::Error) -> IngestError {
    match error.into_kind() {
        csv::ErrorKind::Io(source) => IngestError::Spool {
            folder: folder.to_owned(),
            source,
        },
        other => {
            let why = format!("{other:?}");
            ContractError::invalid("observation", "a row that waits", why).into()
        }
    }
}

#[cfg(test)]
mod tests {
    use contract::observation::{PlatformKind, Quality};
    use contract::time::TimeMs;

    use super::*;

    #[test]
    fn observations_come_back_as_they_were_wherever_they_waited() {
        let folder = tempfile::tempdir().unwrap();
        let observation = |index: usize| Observation {
            dataset: "made".parse().unwrap(),
            platform: ["44005", "a, \"b\"", " é "][index % 3].to_owned(),
            kind: PlatformKind::ALL[index % 4],
            time: TimeMs::new(1_325_376_000_007 + index as i64).unwrap(),
            lon_deg: -69.1 / 3.0,
            lat_deg: 0.1 + 0.2 * index as f64 / 1e7,
            depth_m: -4.999_999_999_999_999,
            property: "air_temperature".to_owned(),
            value: 293.15 * (1.0 + index as f64 * f64::EPSILON),
            unit: "K".to_owned(),
            quality: Quality::ALL[index % 4],
        };
        for count in [1, 3, 20_000] {
            let observations: Vec<Observation> = (0..count).map(observation).collect();
            let waiting = Waiting::of(folder.path(), &observations).unwrap();
            for _ in 0..2 {
                assert!(waiting.read().unwrap() == observations, "{count}");
            }
            assert_eq!(waiting.count(), count);
            let is_in_file = waiting.rows.lock().unwrap().is_rolled();
            assert_eq!(is_in_file, count == 20_000);
        }
        let many: Vec<Observation> = (0..20_000).map(observation).collect();
        let nowhere = Waiting::of(Path::new("/nowhere/at/all"), &many);
        assert!(
            matches!(nowhere, Err(IngestError::Spool { .. })),
            "{nowhere:?}"
        );
    }
}
