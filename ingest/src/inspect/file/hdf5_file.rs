//! HDF5 files (NetCDF-4 is a use of HDF5): the datasets of the root group, with their dimension names.
//!
//! Only hard links inside the file are followed, so that a file cannot name another one; virtual and external storage
//! is refused for the same reason. Filters are those of the library itself (deflate, shuffle, Fletcher-32, n-bit,
//! scale-offset): the parent process starts this one with plugins switched off.

use std::path::Path;

use contract::event::RejectReason;
use hdf5::dataset::Layout;
use hdf5::filters::Filter;
use hdf5::types::VarLenArray;
use hdf5::{
    Dataset, File, LinkType, Location, LocationType, ObjectReference as _, ObjectReference1,
    ReferencedObject, SliceOrIndex,
};

use super::corrupt;
use super::description::{
    Attributes, Description, Dimension, Kind, MAX_NAME_BYTES, MAX_VARIABLES, Part, Variable,
};
use super::{hdf5_attribute, hdf5_text};
use crate::error::Rejection;

/// Decompressed chunks kept while a variable is read map by map, so that a chunk over many maps is unpacked once.
const CHUNK_CACHE_BYTES: usize = 256 << 20;
/// Slots of that cache: a prime, about a hundred for each of the few hundred chunks of a usual map.
const CHUNK_CACHE_SLOTS: usize = 12_421;
/// Largest single chunk, bytes: the library holds a chunk in memory whole.
const MAX_CHUNK_BYTES: u128 = 512 << 20;
/// How a netCDF dimension without a coordinate variable is marked.
const NO_VARIABLE: &str = "This is a netCDF dimension but not a netCDF variable";

/// An open HDF5 file.
pub(crate) struct Hdf5File {
    file: File,
    description: Description,
}

impl Hdf5File {
    pub(super) fn open(path: &Path) -> Result<Self, Rejection> {
        let file = open_with_cache(path, CHUNK_CACHE_BYTES)?;
        let (description, chunk_bytes) = describe(&file)?;
        if chunk_bytes <= CHUNK_CACHE_BYTES {
            return Ok(Self { file, description });
        }
        // A chunk larger than the cache is never in it, and would be unpacked again for every band of rows.
        drop(file);
        let file = open_with_cache(path, chunk_bytes)?;
        Ok(Self { file, description })
    }

    pub(super) fn description(&self) -> &Description {
        &self.description
    }

    pub(super) fn read(&mut self, name: &str, part: &[Part]) -> Result<Vec<f64>, Rejection> {
        let damaged = |e: hdf5::Error| {
            corrupt(
                name,
                format!(
                    "its values cannot be read ({}); the file is truncated or damaged, fetch it again",
                    first_line(&e)
                ),
            )
        };
        let dataset = self.file.dataset(name).map_err(damaged)?;
        check_storage(name, &dataset)?;
        let shape = dataset.shape();
        if part.len() != shape.len() {
            return Err(corrupt(
                name,
                format!("{} parts for {} dimensions", part.len(), shape.len()),
            ));
        }
        let kind = self.description.variable(name).map(|v| v.kind);
        if let Some(Kind::Text(_)) = kind {
            return if part.iter().all(|p| *p == Part::All) {
                hdf5_text::read(name, &dataset)
            } else {
                Err(corrupt(name, "is text, which is read whole"))
            };
        }
        if shape.is_empty() {
            return dataset
                .read_scalar::<f64>()
                .map(|v| vec![v])
                .map_err(damaged);
        }
        let selected = (part.iter().zip(&shape)).map(|(part, len)| {
            let (first, count) = part.span(*len as u64)?;
            Some(if part.is_dimension() {
                SliceOrIndex::SliceCount {
                    start: first as usize,
                    step: 1,
                    count: count as usize,
                    block: 1,
                }
            } else {
                SliceOrIndex::Index(first as usize)
            })
        });
        let selected: Option<Vec<SliceOrIndex>> = selected.collect();
        let past = || corrupt(name, "an index past its dimension");
        let selection = hdf5::Hyperslab::from(selected.ok_or_else(past)?);
        let whole_count = part.iter().filter(|p| p.is_dimension()).count();
        let values = match whole_count {
            1 => dataset
                .read_slice_1d::<f64, _>(selection)
                .map(|values| values.into_raw_vec_and_offset().0),
            2 => dataset
                .read_slice_2d::<f64, _>(selection)
                .map(|values| values.into_raw_vec_and_offset().0),
            _ => {
                return Err(corrupt(
                    name,
                    format!("{whole_count} dimensions asked for, 1 or 2 can be read"),
                ));
            }
        };
        values.map_err(damaged)
    }
}

fn open_with_cache(path: &Path, cache_bytes: usize) -> Result<File, Rejection> {
    let opened = File::with_options()
        .with_fapl(|access| access.chunk_cache(CHUNK_CACHE_SLOTS, cache_bytes, 1.0))
        .open(path);
    opened.map_err(|e| {
        let detail = format!(
            "cannot be opened as HDF5 ({}); it is truncated or damaged, fetch it again",
            first_line(&e)
        );
        corrupt("file", detail)
    })
}

fn first_line(error: &hdf5::Error) -> String {
    error
        .to_string()
        .lines()
        .next()
        .unwrap_or_default()
        .to_owned()
}

/// What is in a file, and bytes of the largest chunk that may be read.
fn describe(file: &File) -> Result<(Description, usize), Rejection> {
    let mut names = Vec::new();
    file.iter_visit_default(|name, link| {
        if link.link_type == LinkType::Hard
            && name.len() <= MAX_NAME_BYTES
            && names.len() < MAX_VARIABLES
        {
            names.push(name.to_owned());
        }
        Ok(())
    })
    .map_err(|e| {
        corrupt(
            "root group",
            format!(
                "cannot be listed ({}); the file is damaged, fetch it again",
                first_line(&e)
            ),
        )
    })?;
    let (mut variables, mut groups) = (Vec::new(), Vec::new());
    let (mut most_bytes, mut most_chunk_bytes) = (0, 0);
    for name in names {
        let damaged = |e: hdf5::Error| {
            let why = first_line(&e);
            let detail = format!("cannot be opened ({why}); the file is damaged, fetch it again");
            corrupt(&name, detail)
        };
        // A member that is no dataset (a group, a named type) is passed over. One that is damaged is not: it may be the flags of another.
        let kind = file.loc_type_by_name(&name).map_err(damaged)?;
        if kind == LocationType::Group {
            groups.push(name.clone());
        }
        if kind != LocationType::Dataset {
            continue;
        }
        let dataset = file.dataset(&name).map_err(damaged)?;
        if let Some(variable) = describe_dataset(file, &name, &dataset)? {
            most_bytes = most_bytes.max(library_bytes(&dataset, variable.cell_count()));
            most_chunk_bytes = most_chunk_bytes.max(chunk_bytes(&dataset).unwrap_or(0));
            variables.push(variable);
        }
    }
    let format = if file.attr("_NCProperties").is_ok() || variables.iter().any(is_scale) {
        "NetCDF-4"
    } else {
        "HDF5"
    };
    let description = Description {
        format: format.to_owned(),
        attributes: attributes_of("file", file)?,
        variables,
        library_bytes: most_bytes,
        groups: Description::some_groups(groups),
    };
    if description.variables.is_empty()
        && let Some(groups) = description.told_groups()
    {
        return Err(only_groups(&groups));
    }
    Ok((description, most_chunk_bytes as usize))
}

/// A refusal of a file whose variables, if it has any, lie in groups.
fn only_groups(told: &str) -> Rejection {
    let detail = format!(
        "holds nothing but groups ({told}), and variables outside of groups are read; take them out (ncks -G : IN OUT)"
    );
    Rejection::new(RejectReason::NoVariable, "file", detail)
}

/// What is said of the file or of a dataset, by its name.
fn attributes_of(name: &str, owner: &Location) -> Result<Attributes, Rejection> {
    hdf5_attribute::read_all(owner).map_err(|(what, e)| {
        let why = first_line(&e);
        let detail = format!("{what} cannot be read ({why}); the file is damaged, fetch it again");
        corrupt(name, detail)
    })
}

/// Most memory that the library takes to unpack values of a dataset: its cache, as far as there are chunks to fill it,
/// and one chunk as it lies in the file, as it comes out of a filter, and as the next filter leaves it.
fn library_bytes(dataset: &Dataset, cells: u128) -> u64 {
    const COPIES_OF_A_CHUNK: u128 = 3;
    let Some(chunk_bytes) = chunk_bytes(dataset) else {
        return 0;
    };
    let all_bytes = cells.saturating_mul(cell_bytes(dataset)).max(chunk_bytes);
    let cache_bytes = all_bytes.min(chunk_bytes.max(CHUNK_CACHE_BYTES as u128));
    u64::try_from(cache_bytes + COPIES_OF_A_CHUNK * chunk_bytes).unwrap_or(u64::MAX)
}

fn cell_bytes(dataset: &Dataset) -> u128 {
    dataset.dtype().map_or(8, |t| t.size()) as u128
}

/// Bytes of a chunk, none without chunks; a larger one than may be is refused before it is read.
fn chunk_bytes(dataset: &Dataset) -> Option<u128> {
    let cells = dataset.chunk()?.into_iter();
    let cells = cells.fold(1u128, |n, len| n.saturating_mul(len as u128));
    Some(
        cells
            .saturating_mul(cell_bytes(dataset))
            .min(MAX_CHUNK_BYTES),
    )
}

fn is_scale(variable: &Variable) -> bool {
    variable.attributes.text("CLASS") == Some("DIMENSION_SCALE")
}

fn describe_dataset(
    file: &File,
    name: &str,
    dataset: &Dataset,
) -> Result<Option<Variable>, Rejection> {
    let damaged = |e: hdf5::Error| {
        corrupt(
            name,
            format!(
                "its shape cannot be read ({}); the file is damaged",
                first_line(&e)
            ),
        )
    };
    let shape = dataset.get_shape().map_err(damaged)?;
    let attributes = attributes_of(name, dataset)?;
    if attributes
        .text("NAME")
        .is_some_and(|text| text.starts_with(NO_VARIABLE))
    {
        return Ok(None);
    }
    let kind = dataset.dtype().ok().and_then(|stored| {
        let text = || hdf5_text::kind(&stored.to_descriptor().ok()?);
        hdf5_attribute::kind(&stored).or_else(text)
    });
    let kind = kind.unwrap_or(Kind::Other);
    let names = dimension_names(file, name, dataset, &attributes, shape.len());
    let dimensions = names
        .into_iter()
        .zip(&shape)
        .map(|(name, len)| Dimension {
            name,
            len: *len as u64,
        })
        .collect();
    Ok(Some(Variable {
        name: name.to_owned(),
        dimensions,
        kind,
        attributes,
    }))
}

/// Names of the dimension scales attached to a dataset; a scale names its own dimension.
fn dimension_names(
    file: &File,
    name: &str,
    dataset: &Dataset,
    attributes: &Attributes,
    rank: usize,
) -> Vec<Option<String>> {
    if attributes.text("CLASS") == Some("DIMENSION_SCALE") && rank == 1 {
        return vec![Some(name.to_owned())];
    }
    let lists = dataset.attr("DIMENSION_LIST").and_then(|attribute| {
        if attribute.size() == rank {
            attribute.read_raw::<VarLenArray<ObjectReference1>>()
        } else {
            Ok(Vec::new())
        }
    });
    let lists = lists.unwrap_or_default();
    let scale_name =
        |list: &VarLenArray<ObjectReference1>| match list.first()?.dereference(file).ok()? {
            ReferencedObject::Dataset(scale) => {
                Some(scale.name().trim_start_matches('/').to_owned())
            }
            ReferencedObject::Group(_) | ReferencedObject::Datatype(_) => None,
        };
    (0..rank)
        .map(|i| lists.get(i).and_then(scale_name))
        .collect()
}

/// Refuses storage outside the file, chunks too large for memory, and filters that are not built in.
fn check_storage(name: &str, dataset: &Dataset) -> Result<(), Rejection> {
    let properties = dataset.dcpl().map_err(|e| corrupt(name, first_line(&e)))?;
    if dataset.layout() == Layout::Virtual || !properties.external().is_empty() {
        return Err(corrupt(
            name,
            "keeps its values in other files; give a file that holds its own",
        ));
    }
    let cell_bytes = dataset.dtype().map_or(1, |t| t.size().max(8)) as u128;
    let chunk_cells = dataset.chunk().map_or(0, |c| {
        c.iter()
            .fold(1u128, |n, len| n.saturating_mul(*len as u128))
    });
    if chunk_cells.saturating_mul(cell_bytes) > MAX_CHUNK_BYTES {
        let detail = format!(
            "chunks of {chunk_cells} cells, at most {MAX_CHUNK_BYTES} bytes are read; repack it in smaller chunks"
        );
        return Err(Rejection::new(RejectReason::TooLarge, name, detail));
    }
    for filter in dataset.filters() {
        // Szip is one of the library's own, and not every library has it.
        let what = match &filter {
            Filter::User(id, _) => format!("filter {id}"),
            Filter::SZip(..) if !filter.decode_enabled() => "szip".to_owned(),
            _ => continue,
        };
        let detail =
            format!("is compressed with {what}, which is not built in; repack it with deflate");
        return Err(Rejection::new(RejectReason::Unreadable, name, detail));
    }
    Ok(())
}
