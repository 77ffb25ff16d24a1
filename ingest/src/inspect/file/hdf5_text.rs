//! Text variables of HDF5 files as numbers, so that names cross the border to the parent process as all values do.
//!
//! A text becomes the numbers of its bytes, filled up with zeros to the length that [`kind`] states. NetCDF-4 keeps
//! names as letters (texts of one byte) or as texts of any length.
#![expect(
    unsafe_code,
    reason = "one call of the C library: the safe interface does not tell how long texts are before it reads them"
)]

use contract::event::RejectReason;
use hdf5::Dataset;
use hdf5::types::{FixedAscii, FixedUnicode, H5Type, TypeDescriptor, VarLenAscii, VarLenUnicode};
use hdf5_sys::h5d::H5Dvlen_get_buf_size;

use super::corrupt;
use super::description::{Kind, TEXT_BYTES};
use crate::error::Rejection;

/// Longest text of fixed length that is looked at, bytes; what is beyond [`TEXT_BYTES`] is cut off.
const MAX_FIXED_BYTES: usize = 4096;
/// Most texts of one variable.
const MAX_TEXTS: usize = 1 << 17;
/// Most letters of one variable.
const MAX_LETTERS: usize = 1 << 25;
/// Most bytes of all texts of free length together.
const MAX_FREE_BYTES: u64 = 64 << 20;
const LENGTH: usize = TEXT_BYTES as usize;

/// How a text type is read; none if it is no text, or one that nobody would give a name in.
pub(super) fn kind(stored: &TypeDescriptor) -> Option<Kind> {
    match stored {
        TypeDescriptor::FixedAscii(1) | TypeDescriptor::FixedUnicode(1) => Some(Kind::Text(1)),
        TypeDescriptor::FixedAscii(bytes) | TypeDescriptor::FixedUnicode(bytes) => {
            (*bytes <= MAX_FIXED_BYTES).then_some(Kind::Text(TEXT_BYTES))
        }
        TypeDescriptor::VarLenAscii | TypeDescriptor::VarLenUnicode => Some(Kind::Text(TEXT_BYTES)),
        _ => None,
    }
}

/// All texts of a variable, in the order of its dimensions.
pub(super) fn read(name: &str, dataset: &Dataset) -> Result<Vec<f64>, Rejection> {
    let damaged = |e: hdf5::Error| {
        let detail = format!("its texts cannot be read ({e}); the file is damaged, fetch it again");
        corrupt(name, detail)
    };
    let stored = dataset
        .dtype()
        .and_then(|t| t.to_descriptor())
        .map_err(damaged)?;
    let is_letters = kind(&stored) == Some(Kind::Text(1));
    let (count, most) = (
        dataset.size(),
        if is_letters { MAX_LETTERS } else { MAX_TEXTS },
    );
    if count > most {
        return Err(too_large(name, &format!("{count} texts, at most {most}")));
    }
    let read = match stored {
        TypeDescriptor::FixedAscii(1) => numbers::<FixedAscii<1>>(dataset, 1, FixedAscii::as_bytes),
        TypeDescriptor::FixedUnicode(1) => {
            numbers::<FixedUnicode<1>>(dataset, 1, FixedUnicode::as_bytes)
        }
        TypeDescriptor::FixedAscii(_) => {
            numbers::<FixedAscii<LENGTH>>(dataset, LENGTH, FixedAscii::as_bytes)
        }
        TypeDescriptor::FixedUnicode(_) => {
            numbers::<FixedUnicode<LENGTH>>(dataset, LENGTH, FixedUnicode::as_bytes)
        }
        TypeDescriptor::VarLenAscii => {
            check_length(name, dataset)?;
            numbers::<VarLenAscii>(dataset, LENGTH, VarLenAscii::as_bytes)
        }
        TypeDescriptor::VarLenUnicode => {
            check_length(name, dataset)?;
            numbers::<VarLenUnicode>(dataset, LENGTH, VarLenUnicode::as_bytes)
        }
        _ => return Err(corrupt(name, "holds no text")),
    };
    read.map_err(damaged)
}

fn too_large(name: &str, what: &str) -> Rejection {
    let detail = format!("{what} are read; give it in smaller pieces");
    Rejection::new(RejectReason::TooLarge, name, detail)
}

/// Refuses texts of free length that would fill the memory: a file may say of each that it is as long as it likes.
fn check_length(name: &str, dataset: &Dataset) -> Result<(), Rejection> {
    let length_bytes = || {
        let (kind, space) = (dataset.dtype()?, dataset.space()?);
        let mut bytes = 0;
        // The library counts with one text in memory at a time, the longest of which the process's own limit bounds.
        let status = hdf5::sync::sync(|| {
            // SAFETY: three open objects of the library, which `sync` locks, and a number that outlives the call.
            unsafe { H5Dvlen_get_buf_size(dataset.id(), kind.id(), space.id(), &raw mut bytes) }
        });
        if status < 0 {
            return Err(hdf5::Error::from("the lengths of its texts are wrong"));
        }
        Ok(bytes)
    };
    match length_bytes() {
        Ok(bytes) if bytes <= MAX_FREE_BYTES => Ok(()),
        Ok(bytes) => {
            let what = format!("{bytes} bytes of text, at most {MAX_FREE_BYTES}");
            Err(too_large(name, &what))
        }
        Err(e) => Err(corrupt(name, format!("{e}; the file is damaged"))),
    }
}

fn numbers<T: H5Type>(
    dataset: &Dataset,
    length: usize,
    bytes: impl Fn(&T) -> &[u8],
) -> hdf5::Result<Vec<f64>> {
    let texts = dataset.read_raw::<T>()?;
    let mut numbers = Vec::with_capacity(texts.len() * length);
    for text in &texts {
        let own = bytes(text).iter().copied().chain(std::iter::repeat(0));
        numbers.extend(own.take(length).map(f64::from));
    }
    Ok(numbers)
}
