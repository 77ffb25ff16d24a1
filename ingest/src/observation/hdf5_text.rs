//! Texts of HDF5 variables as numbers, so that they cross the border to the reader process as all values do.
//!
//! Each text becomes [`TEXT_BYTES`] numbers, its bytes and then zeros. NetCDF-4 keeps names either as one text each or as
//! letters, which are texts of one byte.

use hdf5::Dataset;
use hdf5::types::{FixedAscii, FixedUnicode, TypeDescriptor, VarLenAscii, VarLenUnicode};

/// Numbers that one text becomes: the longest name of a platform.
pub(crate) const TEXT_BYTES: usize = 64;
/// Longest fixed text that is looked at, bytes.
const MAX_FIXED_BYTES: usize = 1024;
/// Most texts of one variable.
const MAX_TEXTS: usize = 1 << 20;

/// The texts of a variable in the order of its dimensions; none if it holds no texts, or too many.
pub(crate) fn read(dataset: &Dataset) -> Option<Result<Vec<f64>, hdf5::Error>> {
    let kind = dataset.dtype().ok()?.to_descriptor().ok()?;
    if dataset.size() > MAX_TEXTS {
        return None;
    }
    match kind {
        TypeDescriptor::FixedAscii(len) if len <= MAX_FIXED_BYTES => Some(
            dataset
                .read_raw::<FixedAscii<MAX_FIXED_BYTES>>()
                .map(|texts| numbers(&texts, |t| t.as_bytes())),
        ),
        TypeDescriptor::FixedUnicode(len) if len <= MAX_FIXED_BYTES => Some(
            dataset
                .read_raw::<FixedUnicode<MAX_FIXED_BYTES>>()
                .map(|texts| numbers(&texts, |t| t.as_bytes())),
        ),
        TypeDescriptor::VarLenAscii => Some(
            dataset
                .read_raw::<VarLenAscii>()
                .map(|texts| numbers(&texts, |t| t.as_bytes())),
        ),
        TypeDescriptor::VarLenUnicode => Some(
            dataset
                .read_raw::<VarLenUnicode>()
                .map(|texts| numbers(&texts, |t| t.as_bytes())),
        ),
        _ => None,
    }
}

fn numbers<T>(texts: &[T], bytes: impl Fn(&T) -> &[u8]) -> Vec<f64> {
    let padded = |text: &T| {
        let own = bytes(text).iter().copied();
        own.chain(std::iter::repeat(0))
            .take(TEXT_BYTES)
            .map(f64::from)
            .collect::<Vec<_>>()
    };
    texts.iter().flat_map(padded).collect()
}
