//! The one HDF5 type the safe interface cannot make: text of fixed length that ends with a null character.
//!
//! Dimension scales are recognised by an attribute of just this type, and the netCDF library by dimension scales.
#![expect(
    unsafe_code,
    reason = "two calls of the C library; the safe interface pads text and never ends it"
)]

use hdf5::globals::H5T_C_S1;
use hdf5::{Datatype, Error, Result, from_id};
use hdf5_sys::h5t::{H5Tcopy, H5Tset_size};

/// Text of `size_bytes`, the null character included.
pub(super) fn null_terminated(size_bytes: usize) -> Result<Datatype> {
    hdf5::sync::sync(|| {
        // SAFETY: the library is initialised and locked by `sync`; the copied type is owned by the `Datatype` made of it.
        unsafe {
            let id = H5Tcopy(*H5T_C_S1);
            if id < 0 || H5Tset_size(id, size_bytes) < 0 {
                return Err(Error::from("a text type cannot be made"));
            }
            from_id(id)
        }
    })
}
