//! What makes an HDF5 file one that the netCDF library opens: dimensions by their scales, texts as attributes, and no time
//! of making, so that the same values are the same bytes.

mod text_type;

use std::path::Path;

use hdf5::file::LinkCreationOrder;
use hdf5::types::{FixedAscii, VarLenArray, VarLenUnicode};
use hdf5::{Dataset, File, H5Type, Location, ObjectReference as _, ObjectReference1};

use text_type::null_terminated;

/// A new file.
///
/// # Errors
/// It cannot be made there.
pub fn create(path: &Path) -> hdf5::Result<File> {
    File::with_options()
        .with_fcpl(|create| {
            create
                // No object may carry the time of its making: the same values give the same bytes.
                .obj_track_times(false)
                // Without it the netCDF library opens a file to read and never to write (`Can't write file`).
                .link_creation_order(LinkCreationOrder::Indexed)
        })
        // Nobody else knows of it yet. A program that is started meanwhile inherits the open file (HDF5 asks for no
        // close-on-exec) and would hold its lock on, so that no other could open what is long written.
        .with_fapl(|access| access.file_locking(false))
        .create(path)
}

/// Texts as attributes.
///
/// # Errors
/// A text with a null character, or an attribute that cannot be written.
pub fn texts(owner: &Location, attributes: &[(&str, &str)]) -> hdf5::Result<()> {
    for (name, value) in attributes {
        let value: VarLenUnicode = value
            .parse()
            .map_err(|e| hdf5::Error::from(format!("{name}: {e}")))?;
        owner
            .new_attr::<VarLenUnicode>()
            .create(*name)?
            .write_scalar(&value)?;
    }
    Ok(())
}

/// A coordinate variable, which is also the dimension's scale.
///
/// # Errors
/// It cannot be written.
pub fn scale<T: H5Type>(file: &File, name: &str, values: &[T]) -> hdf5::Result<Dataset> {
    let dataset = file
        .new_dataset::<T>()
        .obj_track_times(false)
        .shape([values.len()])
        .create(name)?;
    dataset.write_raw(values)?;
    mark(&dataset, name)?;
    Ok(dataset)
}

/// Makes a dataset a dimension's scale.
fn mark(dataset: &Dataset, name: &str) -> hdf5::Result<()> {
    fixed(dataset, "CLASS", "DIMENSION_SCALE")?;
    fixed(dataset, "NAME", name)
}

/// Values of a chunk of what grows.
const GROWING_CHUNK: usize = 1 << 16;
/// Level of deflate: higher ones gain little on measurements.
const DEFLATE_LEVEL: u8 = 4;

/// A variable of one dimension that grows, empty yet, compressed.
///
/// # Errors
/// It cannot be made.
pub fn growing<T: H5Type>(file: &File, name: &str) -> hdf5::Result<Dataset> {
    file.new_dataset::<T>()
        .obj_track_times(false)
        .chunk([GROWING_CHUNK])
        .shuffle()
        .deflate(DEFLATE_LEVEL)
        .shape((0..,))
        .create(name)
}

/// The same as a coordinate variable, which is also the dimension's scale.
///
/// # Errors
/// It cannot be made.
pub fn growing_scale<T: H5Type>(file: &File, name: &str) -> hdf5::Result<Dataset> {
    let dataset = growing::<T>(file, name)?;
    mark(&dataset, name)?;
    Ok(dataset)
}

/// Adds values behind the first `count` of a variable that grows.
///
/// # Errors
/// They cannot be written.
pub fn grow<T: H5Type>(dataset: &Dataset, count: usize, values: &[T]) -> hdf5::Result<()> {
    let end = count + values.len();
    dataset.resize([end])?;
    dataset.write_slice(values, count..end)
}

/// A text as the dimension scales of HDF5 want it: of fixed length, with a null character at its end.
fn fixed(owner: &Location, name: &str, value: &str) -> hdf5::Result<()> {
    let text = FixedAscii::<32>::from_ascii(value)
        .map_err(|e| hdf5::Error::from(format!("{name}: {e}")))?;
    let attribute = owner
        .new_attr_builder()
        .empty_as(null_terminated(value.len() + 1)?)
        .create(name)?;
    attribute
        .as_writer()
        .conversion(hdf5::Conversion::Soft)
        .write_scalar(&text)
}

/// Names the dimensions of a dataset by their scales.
///
/// # Errors
/// A scale is not in the file, or the attribute cannot be written.
pub fn attach(file: &File, dataset: &Dataset, scales: &[&Dataset]) -> hdf5::Result<()> {
    let lists: Vec<VarLenArray<ObjectReference1>> = scales
        .iter()
        .map(|scale| {
            let reference = ObjectReference1::create(file, &scale.name())?;
            Ok(VarLenArray::from_slice(&[reference]))
        })
        .collect::<hdf5::Result<_>>()?;
    dataset
        .new_attr::<VarLenArray<ObjectReference1>>()
        .shape([scales.len()])
        .create("DIMENSION_LIST")?
        .write_raw(&lists)
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    #[test]
    fn programs_that_are_started_meanwhile_keep_no_file_from_its_readers() {
        let folder = std::env::temp_dir().join(format!("netcdf4-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("file.nc");
        let file = super::create(&path).unwrap();
        // It inherits what is open now.
        let mut other = Command::new("sleep").arg("60").spawn().unwrap();
        super::scale(&file, "lat", &[1.0_f64, 2.0]).unwrap();
        file.close().unwrap();
        let read = hdf5::File::open(&path)
            .and_then(|file| file.dataset("lat"))
            .and_then(|lat| lat.read_raw::<f64>());
        other.kill().unwrap();
        other.wait().unwrap();
        std::fs::remove_dir_all(&folder).unwrap();
        assert_eq!(read.unwrap(), [1.0, 2.0]);
    }
}
