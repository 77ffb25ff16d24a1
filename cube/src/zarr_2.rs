//! The arrays of a cube as Zarr version 2, for programs that read no other, such as GDAL 3.10 and what is built on it.
//!
//! Chunks are those of version 3 without their checksum, for which version 2 has no codec that GDAL knows; shards, which version 2 does
//! not have, are the chunks in them. Levels, the copy along time and sums are left out. Left out on purpose: reading and writing.

use std::collections::BTreeMap;

use bytes::Bytes;
use serde_json::{Map, Value, json};

use crate::cf;

/// Bytes of the checksum behind each chunk of version 3.
pub(crate) const CHECKSUM_BYTES: usize = 4;
/// Bytes of an entry of a shard's index: where a chunk begins, and how long it is.
const ENTRY_BYTES: usize = 16;
/// Metadata of the group and of all arrays; whoever finds it asks for no other.
pub(crate) const CONSOLIDATED: &str = ".zmetadata";
/// Attributes of the group that say where levels lie.
const OF_LEVELS: [&str; 2] = ["zarr_conventions", "multiscales"];

/// Of which version of Zarr a key is, or what is written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ZarrVersion {
    /// For programs that read no other.
    Two,
    /// As cubes lie in the store.
    Three,
}

/// One array.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Array2 {
    name: String,
    /// Cells of a chunk along each side.
    chunk: Vec<u64>,
    /// Chunks along each side of the array.
    chunks: Vec<u64>,
    /// The same of a shard; none where an object is a chunk.
    in_shard: Option<Vec<u64>>,
    /// Bytes of a chunk of zeros, where that is what a chunk that is not there holds: readers of version 2 take the fill value for
    /// no data, so that arrays of whole numbers have none.
    blank_bytes: Option<usize>,
    zstd_level: i32,
    /// `.zarray` and `.zattrs`.
    metadata: [Value; 2],
}

/// A chunk in the objects of version 3.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct InShard {
    /// Its number in the shard's index.
    pub(crate) number: usize,
    /// Chunks of the shard.
    pub(crate) chunks: usize,
}

impl InShard {
    /// Bytes of the index, its checksum included, at the end of the shard.
    pub(crate) fn index_bytes(self) -> usize {
        self.chunks * ENTRY_BYTES + CHECKSUM_BYTES
    }

    /// Where the chunk lies in its shard: its first byte and its length; none if it is not stored.
    ///
    /// # Errors
    /// The index is not whole.
    pub(crate) fn place(self, index: &[u8]) -> Result<Option<[u64; 2]>, String> {
        let entries = checked(index).ok_or("the index of its shard fails its checksum")?;
        let entry = entries.chunks_exact(ENTRY_BYTES).nth(self.number);
        let entry = entry.ok_or("the index of its shard is too short")?;
        let number = |part: &[u8]| part.try_into().map_or(u64::MAX, u64::from_le_bytes);
        let (start, length) = (number(&entry[..8]), number(&entry[8..]));
        Ok((start != u64::MAX || length != u64::MAX).then_some([start, length]))
    }
}

/// What stands before a checksum; none if it is another one's.
pub(crate) fn checked(content: &[u8]) -> Option<&[u8]> {
    let (content, sum) = content.split_last_chunk::<CHECKSUM_BYTES>()?;
    (crc32c::crc32c(content).to_le_bytes() == *sum).then_some(content)
}

impl Array2 {
    /// An array by what version 3 says of it.
    ///
    /// # Errors
    /// What this program does not write.
    pub(crate) fn of(name: &str, metadata: &Value) -> Result<Self, String> {
        let unknown = |what: &str| format!("{name}: {what} of version 3 that version 2 has not");
        let sides = |value: &Value| -> Option<Vec<u64>> {
            value.as_array()?.iter().map(Value::as_u64).collect()
        };
        let shape = sides(&metadata["shape"]).ok_or_else(|| unknown("a shape"))?;
        let object = sides(&metadata["chunk_grid"]["configuration"]["chunk_shape"]);
        let object = object.ok_or_else(|| unknown("chunks"))?;
        let mut codecs = &metadata["codecs"];
        let mut chunk = object.clone();
        let is_sharded = codecs[0]["name"] == "sharding_indexed";
        if is_sharded {
            let shard = &codecs[0]["configuration"];
            chunk = sides(&shard["chunk_shape"]).ok_or_else(|| unknown("shards"))?;
            codecs = &shard["codecs"];
        }
        let named = |codec: &Value| codec["name"].as_str().or(codec.as_str()).map(str::to_owned);
        let names: Option<Vec<_>> = codecs.as_array().into_iter().flatten().map(named).collect();
        if names.is_none_or(|names| names != ["bytes", "zstd", "crc32c"]) {
            return Err(unknown("codecs"));
        }
        let zstd_level = codecs[1]["configuration"]["level"].as_i64().unwrap_or(0) as i32;
        let (kind, number_bytes) = match metadata["data_type"].as_str() {
            Some("float32") => ("<f4", 4),
            Some("float64") => ("<f8", 8),
            Some("int32") => ("<i4", 4),
            Some("int64") => ("<i8", 8),
            Some("uint8") => ("|u1", 1),
            _ => return Err(unknown("a type of numbers")),
        };
        let is_whole = !kind.starts_with("<f");
        let of_sides = |all: &[u64], parts: &[u64]| -> Vec<u64> {
            let sides = all.iter().zip(parts);
            sides
                .map(|(all, part)| all.div_ceil((*part).max(1)))
                .collect()
        };
        let described = json!({
            "zarr_format": 2,
            "shape": shape,
            "chunks": chunk,
            "dtype": kind,
            "compressor": { "id": "zstd", "level": zstd_level },
            "fill_value": if is_whole { Value::Null } else { "NaN".into() },
            "order": "C",
            "filters": null,
            "dimension_separator": ".",
        });
        let mut attributes = match &metadata["attributes"] {
            Value::Object(own) => own.clone(),
            _ => Map::new(),
        };
        // What version 2 says by the fill value.
        attributes.remove("_FillValue");
        // GDAL knows the ellipsoid by this alone for what it is.
        if attributes.contains_key("grid_mapping_name") {
            attributes.insert("crs_wkt".to_owned(), cf::WGS84_WKT.into());
        }
        let dimensions = match &metadata["dimension_names"] {
            Value::Array(names) => names.clone(),
            _ => vec![],
        };
        attributes.insert("_ARRAY_DIMENSIONS".to_owned(), dimensions.into());
        Ok(Self {
            name: name.to_owned(),
            chunks: of_sides(&shape, &chunk),
            in_shard: is_sharded.then(|| of_sides(&object, &chunk)),
            blank_bytes: is_whole.then(|| chunk.iter().product::<u64>() as usize * number_bytes),
            chunk,
            zstd_level,
            metadata: [described, attributes.into()],
        })
    }

    /// A chunk that is not stored in version 3, as version 2 needs it; none where it is read as no data.
    ///
    /// # Errors
    /// It cannot be compressed.
    pub(crate) fn blank(&self) -> Result<Option<Bytes>, String> {
        let blank = self.blank_bytes.map(|bytes| vec![0; bytes]);
        let packed = blank.map(|zeros| zstd::bulk::compress(&zeros, self.zstd_level));
        let packed = packed
            .transpose()
            .map_err(|e| format!("{}: {e}", self.name))?;
        Ok(packed.map(Bytes::from))
    }

    /// The object of version 3 that holds a chunk, and where in it; none if there is no such chunk.
    fn object(&self, index: &str) -> Option<(String, Option<InShard>)> {
        let mut places = vec![];
        if !self.chunks.is_empty() {
            for text in index.split('.') {
                let place: u64 = text.parse().ok()?;
                // Another spelling is another key, which is not there.
                (place.to_string() == text).then(|| places.push(place))?;
            }
        } else if index != "0" {
            return None;
        }
        let is_inside = places.len() == self.chunks.len()
            && places.iter().zip(&self.chunks).all(|(own, all)| own < all);
        if !is_inside {
            return None;
        }
        let mut shard = None;
        if let Some(sides) = &self.in_shard {
            let number = places
                .iter()
                .zip(sides)
                .fold(0, |number, (place, side)| number * side + place % side);
            shard = Some(InShard {
                number: number as usize,
                chunks: sides.iter().product::<u64>() as usize,
            });
            for (place, side) in places.iter_mut().zip(sides) {
                *place /= side;
            }
        }
        Some((key_of_3(&self.name, &places), shard))
    }
}

/// The key of an object of version 3.
fn key_of_3(name: &str, places: &[u64]) -> String {
    places
        .iter()
        .fold(format!("{name}/c"), |key, place| format!("{key}/{place}"))
}

/// The key of a chunk in version 2 that is an object by this key in version 3.
pub(crate) fn key_of_2(key: &str) -> String {
    let (name, places) = match key.strip_suffix("/c") {
        Some(name) => (name, "0"),
        None => key.split_once("/c/").unwrap_or((key, "0")),
    };
    format!("{name}/{}", places.replace('/', "."))
}

/// What a key of version 2 names.
#[derive(Debug, PartialEq)]
pub(crate) enum Named<'a> {
    Metadata(&'a Bytes),
    /// A chunk: its array, the key of its object in version 3, and where in it.
    Chunk(&'a Array2, String, Option<InShard>),
}

/// A group of arrays by the keys of version 2.
#[derive(Debug)]
pub(crate) struct Group2 {
    arrays: BTreeMap<String, Array2>,
    /// By their keys.
    metadata: BTreeMap<String, Bytes>,
}

impl Group2 {
    /// A group by its attributes and what version 3 says of the arrays; those of groups in it are left out.
    ///
    /// # Errors
    /// As [`Array2::of`].
    pub(crate) fn new<'a>(
        attributes: &Value,
        all: impl IntoIterator<Item = (&'a String, &'a Value)>,
    ) -> Result<Self, String> {
        let own = all
            .into_iter()
            .filter(|(name, metadata)| !name.contains('/') && metadata["node_type"] == "array");
        let own = own.map(|(name, metadata)| Ok((name.clone(), Array2::of(name, metadata)?)));
        let arrays: BTreeMap<String, Array2> = own.collect::<Result<_, String>>()?;
        let mut all = Map::new();
        all.insert(".zgroup".to_owned(), json!({ "zarr_format": 2 }));
        let mut attributes = attributes.as_object().cloned().unwrap_or_default();
        attributes.retain(|name, _| !OF_LEVELS.contains(&name.as_str()));
        all.insert(".zattrs".to_owned(), attributes.into());
        for (name, array) in &arrays {
            let [described, attributes] = array.metadata.clone();
            all.insert(format!("{name}/.zarray"), described);
            all.insert(format!("{name}/.zattrs"), attributes);
        }
        let text = |value: &Value| Bytes::from(value.to_string());
        let each = all.iter().map(|(key, value)| (key.clone(), text(value)));
        let mut metadata: BTreeMap<String, Bytes> = each.collect();
        let whole = json!({ "zarr_consolidated_format": 1, "metadata": all });
        metadata.insert(CONSOLIDATED.to_owned(), text(&whole));
        Ok(Self { arrays, metadata })
    }

    /// Keys of metadata and what is there.
    pub(crate) fn metadata(&self) -> impl Iterator<Item = (&String, &Bytes)> {
        self.metadata.iter()
    }

    /// What a key names; none if there is no such key.
    pub(crate) fn named(&self, key: &str) -> Option<Named<'_>> {
        if let Some(content) = self.metadata.get(key) {
            return Some(Named::Metadata(content));
        }
        let (name, index) = key.split_once('/')?;
        let array = self.arrays.get(name)?;
        let (object, shard) = array.object(index)?;
        Some(Named::Chunk(array, object, shard))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn array(shape: &[u64], object: &[u64], inner: Option<&[u64]>, kind: &str) -> Value {
        let codecs = json!([
            { "name": "bytes", "configuration": { "endian": "little" } },
            { "name": "zstd", "configuration": { "level": 3, "checksum": false } },
            { "name": "crc32c" },
        ]);
        let codecs = match inner {
            None => codecs,
            Some(chunk) => {
                json!([{ "name": "sharding_indexed", "configuration": { "chunk_shape": chunk, "codecs": codecs } }])
            }
        };
        json!({
            "node_type": "array",
            "shape": shape,
            "data_type": kind,
            "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": object } },
            "codecs": codecs,
            "attributes": { "units": "K", "_FillValue": "AADAfw==" },
            "dimension_names": ["time", "lat", "lon"],
        })
    }

    #[test]
    fn metadata_are_those_of_version_2() {
        let of = Array2::of("sst", &array(&[3, 5, 9], &[1, 4, 4], None, "float32")).unwrap();
        let [described, attributes] = &of.metadata;
        assert_eq!(
            (
                &described["dtype"],
                &described["chunks"],
                &described["fill_value"]
            ),
            (&json!("<f4"), &json!([1, 4, 4]), &json!("NaN"))
        );
        let expected = json!({ "units": "K", "_ARRAY_DIMENSIONS": ["time", "lat", "lon"] });
        assert_eq!(attributes, &expected);
        assert_eq!(of.blank(), Ok(None));
        // Zeros of whole numbers are values, and no missing ones.
        let time = Array2::of("time", &array(&[3], &[1024], None, "int64")).unwrap();
        assert_eq!(time.metadata[0]["fill_value"], Value::Null);
        let blank = time.blank().unwrap().unwrap();
        assert_eq!(
            zstd::bulk::decompress(&blank, 1 << 20).unwrap(),
            vec![0; 8192]
        );
        let mut other = array(&[3], &[1024], None, "int64");
        other["codecs"][1] = json!({ "name": "gzip" });
        let refused = Array2::of("time", &other).unwrap_err();
        assert!(refused.contains("codecs"), "{refused}");
        assert!(Array2::of("time", &array(&[3], &[1024], None, "uint16")).is_err());
    }

    #[test]
    fn keys_name_the_objects_of_version_3() {
        let mut all = Map::new();
        all.insert(
            "sst".to_owned(),
            array(&[3, 5, 9], &[1, 4, 4], None, "float32"),
        );
        let sharded = array(&[3, 50, 90], &[1, 20, 40], Some(&[1, 10, 10]), "float32");
        all.insert("large".to_owned(), sharded);
        all.insert("crs".to_owned(), array(&[], &[], None, "int32"));
        all.insert("levels/1/sst".to_owned(), json!({}));
        let group = Group2::new(&json!({ "title": "T" }), &all).unwrap();
        let of = |key: &str| match group.named(key)? {
            Named::Metadata(_) => Some(("metadata".to_owned(), None)),
            Named::Chunk(_array, object, shard) => Some((object, shard.map(|it| it.number))),
        };
        for key in [
            ".zgroup",
            ".zattrs",
            ".zmetadata",
            "sst/.zarray",
            "crs/.zattrs",
        ] {
            assert_eq!(of(key), Some(("metadata".to_owned(), None)), "{key}");
        }
        assert_eq!(of("sst/2.1.2"), Some(("sst/c/2/1/2".to_owned(), None)));
        assert_eq!(of("crs/0"), Some(("crs/c".to_owned(), None)));
        // Two rows of four chunks a shard: the second row and the third column of the first shard, and the first of the last one.
        assert_eq!(
            of("large/1.1.2"),
            Some(("large/c/1/0/0".to_owned(), Some(6)))
        );
        assert_eq!(
            of("large/2.4.8"),
            Some(("large/c/2/2/2".to_owned(), Some(0)))
        );
        for none in [
            "sst/3.0.0",
            "sst/0.2.0",
            "sst/0.0.3",
            "sst/0.0",
            "sst/0.0.0.0",
            "sst/00.0.0",
            "sst/+1.0.0",
            "sst/",
            "sst",
            "sst/c/0/0/0",
            "crs/",
            "crs/1",
            "crs/0.0",
            "zarr.json",
            "levels/1/sst/.zarray",
            "/.zgroup",
            "",
            "sst/0/0/0",
        ] {
            assert_eq!(of(none), None, "{none}");
        }
        for (of_3, of_2) in [
            ("sst/c/2/1/2", "sst/2.1.2"),
            ("crs/c", "crs/0"),
            ("time/c/0", "time/0"),
        ] {
            assert_eq!(key_of_2(of_3), of_2);
        }
    }

    #[test]
    fn a_chunk_is_found_by_the_index_of_its_shard_which_has_a_checksum() {
        let shard = InShard {
            number: 1,
            chunks: 2,
        };
        let mut index: Vec<u8> = [u64::MAX, u64::MAX, 7, 30]
            .iter()
            .flat_map(|it| it.to_le_bytes())
            .collect();
        let sum = crc32c::crc32c(&index).to_le_bytes();
        index.extend(sum);
        assert_eq!(shard.index_bytes(), index.len());
        assert_eq!(shard.place(&index), Ok(Some([7, 30])));
        assert_eq!(InShard { number: 0, ..shard }.place(&index), Ok(None));
        assert!(InShard { number: 2, ..shard }.place(&index).is_err());
        index[20] ^= 1;
        assert!(shard.place(&index).unwrap_err().contains("checksum"));
        assert!(shard.place(&[]).is_err());
    }
}
