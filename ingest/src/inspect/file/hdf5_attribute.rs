//! Attributes of HDF5 objects: bounded numbers and texts out; references and compounds are passed over.

use hdf5::types::{FixedAscii, FixedUnicode, TypeDescriptor, VarLenAscii, VarLenUnicode};
use hdf5::{Attribute, Datatype, Location};

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

/// All attributes that are numbers or text; one that cannot be read is left out, as if it were not there.
pub(super) fn read_all(owner: &Location) -> Attributes {
    let names = owner.attr_names().unwrap_or_default();
    let wanted = names
        .into_iter()
        .filter(|n| n.len() <= MAX_NAME_BYTES && !INTERNAL.contains(&n.as_str()));
    wanted
        .take(MAX_ATTRIBUTES)
        .filter_map(|name| Some((name.clone(), read(&owner.attr(&name).ok()?)?)))
        .collect()
}

fn read(attribute: &Attribute) -> Option<AttributeValue> {
    let count = attribute.space().ok()?.size();
    if count == 0 || count > MAX_ATTRIBUTE_NUMBERS {
        return None;
    }
    let stored = attribute.dtype().ok()?;
    if let Some(kind) = kind(&stored) {
        return numbers(attribute, kind);
    }
    match stored.to_descriptor().ok()? {
        TypeDescriptor::FixedAscii(_) => {
            let texts = attribute
                .read_raw::<FixedAscii<MAX_ATTRIBUTE_TEXT_BYTES>>()
                .ok()?;
            Some(joined(&texts, |t| t.as_bytes()))
        }
        TypeDescriptor::FixedUnicode(_) => {
            let texts = attribute
                .read_raw::<FixedUnicode<MAX_ATTRIBUTE_TEXT_BYTES>>()
                .ok()?;
            Some(joined(&texts, |t| t.as_bytes()))
        }
        TypeDescriptor::VarLenAscii => {
            Some(joined(&attribute.read_raw::<VarLenAscii>().ok()?, |t| {
                t.as_bytes()
            }))
        }
        TypeDescriptor::VarLenUnicode => {
            Some(joined(&attribute.read_raw::<VarLenUnicode>().ok()?, |t| {
                t.as_bytes()
            }))
        }
        _ => None,
    }
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

fn numbers(attribute: &Attribute, kind: Kind) -> Option<AttributeValue> {
    let numbers = attribute.read_raw::<f64>().ok()?;
    Some(AttributeValue::Numbers {
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
