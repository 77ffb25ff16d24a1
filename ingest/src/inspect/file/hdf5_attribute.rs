//! Attributes of HDF5 objects: bounded numbers and texts out; references and compounds are passed over.

use hdf5::types::{FixedAscii, FixedUnicode, TypeDescriptor, VarLenAscii, VarLenUnicode};
use hdf5::{Attribute, Datatype, H5Type, Location};

use super::description::{
    AttributeValue, Attributes, Kind, MAX_ATTRIBUTE_NUMBERS, MAX_ATTRIBUTE_TEXT_BYTES,
    MAX_ATTRIBUTES, MAX_NAME_BYTES,
};

/// Attributes of the netCDF library's own, which say nothing about the data.
const INTERNAL: [&str; 6] = [
    "REFERENCE_LIST",
    "DIMENSION_LIST",
    "_Netcdf4Dimid",
    "_Netcdf4Coordinates",
    "_NCProperties",
    "_nc3_strict",
];

/// All attributes that are numbers or text.
///
/// # Errors
/// What cannot be read, in words, and why: as if it were not there, packed numbers would be taken for values.
pub(super) fn read_all(owner: &Location) -> Result<Attributes, (String, hdf5::Error)> {
    let names = owner.attr_names();
    let names = names.map_err(|e| ("the list of its attributes".to_owned(), e))?;
    let wanted = names
        .into_iter()
        .filter(|n| n.len() <= MAX_NAME_BYTES && !INTERNAL.contains(&n.as_str()));
    let mut all = vec![];
    for name in wanted.take(MAX_ATTRIBUTES) {
        let value = owner.attr(&name).and_then(|attribute| read(&attribute));
        // The library gives names of a damaged file as they are, which may be no text.
        let shown = || String::from_utf8_lossy(name.as_bytes());
        let value = value.map_err(|e| (format!("its attribute {:?}", shown()), e))?;
        all.extend(value.map(|value| (name, value)));
    }
    Ok(all.into_iter().collect())
}

/// The value of an attribute; none of one that is neither numbers nor text, or holds too many.
fn read(attribute: &Attribute) -> Result<Option<AttributeValue>, hdf5::Error> {
    let count = attribute.space()?.size();
    if count == 0 || count > MAX_ATTRIBUTE_NUMBERS {
        return Ok(None);
    }
    let stored = attribute.dtype()?;
    if let Some(kind) = kind(&stored) {
        return numbers(attribute, kind).map(Some);
    }
    // Types that the library has no name for are none of text.
    let Ok(descriptor) = stored.to_descriptor() else {
        return Ok(None);
    };
    match descriptor {
        TypeDescriptor::FixedAscii(_) => {
            texts::<FixedAscii<MAX_ATTRIBUTE_TEXT_BYTES>>(attribute, &stored, FixedAscii::as_bytes)
        }
        TypeDescriptor::FixedUnicode(_) => texts::<FixedUnicode<MAX_ATTRIBUTE_TEXT_BYTES>>(
            attribute,
            &stored,
            FixedUnicode::as_bytes,
        ),
        TypeDescriptor::VarLenAscii => {
            texts::<VarLenAscii>(attribute, &stored, VarLenAscii::as_bytes)
        }
        TypeDescriptor::VarLenUnicode => {
            texts::<VarLenUnicode>(attribute, &stored, VarLenUnicode::as_bytes)
        }
        _ => Ok(None),
    }
}

/// The texts of an attribute; none where the library does not turn its type into this one.
fn texts<T: H5Type>(
    attribute: &Attribute,
    stored: &Datatype,
    bytes: impl Fn(&T) -> &[u8],
) -> Result<Option<AttributeValue>, hdf5::Error> {
    if stored.conv_to::<T>().is_none() {
        return Ok(None);
    }
    Ok(Some(joined(&attribute.read_raw::<T>()?, bytes)))
}

/// How numbers of a type are stored; none if it is no type of numbers.
pub(super) fn kind(stored: &Datatype) -> Option<Kind> {
    match stored.to_descriptor() {
        Ok(TypeDescriptor::Integer(size)) => Some(Kind::Integer(size as u8)),
        Ok(TypeDescriptor::Unsigned(size)) => Some(Kind::Unsigned(size as u8)),
        Ok(TypeDescriptor::Float(size)) => Some(Kind::Float(size as u8)),
        Ok(_) => None,
        // The library has no name for floating-point numbers of two bytes, and reads them as float64 all the same.
        Err(_unnamed) => {
            let is_number = stored.size() == 2 && stored.conv_to::<f64>().is_some();
            is_number.then_some(Kind::Float(2))
        }
    }
}

fn numbers(attribute: &Attribute, kind: Kind) -> Result<AttributeValue, hdf5::Error> {
    let numbers = attribute.read_raw::<f64>()?;
    Ok(AttributeValue::Numbers {
        kind,
        bits: numbers.into_iter().map(Into::into).collect(),
    })
}

/// Several texts are joined by spaces; bytes that are no UTF-8 are replaced.
fn joined<T>(texts: &[T], bytes: impl Fn(&T) -> &[u8]) -> AttributeValue {
    let mut text = texts
        .iter()
        .map(|t| String::from_utf8_lossy(bytes(t)).into_owned())
        .collect::<Vec<_>>()
        .join(" ");
    let end = text.floor_char_boundary(MAX_ATTRIBUTE_TEXT_BYTES);
    text.truncate(end);
    AttributeValue::Text(text)
}
