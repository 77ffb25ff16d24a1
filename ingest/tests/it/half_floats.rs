//! Floating-point numbers of 16 bits, which HDF5 files may hold though NetCDF has no type for them.
#![expect(
    unsafe_code,
    reason = "the library in Rust has no name for the type, which is made of that of 32 bits by calls of the one in C"
)]

use hdf5::Datatype;
use hdf5::globals::H5T_IEEE_F32LE;
use hdf5_sys::h5t::{H5Tcopy, H5Tset_ebias, H5Tset_fields, H5Tset_size};

use crate::fixture::{Place, SmallFile, text};

/// IEEE 754 binary16.
fn half() -> Datatype {
    hdf5::sync::sync(|| {
        // SAFETY: a copy of a type of the library's own, which `sync` locks; what is made of it is its one owner.
        unsafe {
            let half = H5Tcopy(*H5T_IEEE_F32LE);
            assert!(H5Tset_fields(half, 15, 10, 5, 0, 10) >= 0);
            assert!(H5Tset_size(half, 2) >= 0);
            assert!(H5Tset_ebias(half, 15) >= 0);
            hdf5::from_id(half).unwrap()
        }
    })
}

#[tokio::test]
async fn numbers_of_16_bits_land_and_their_fill_value_is_none() {
    let place = Place::new();
    let path = place.path("half.h5");
    {
        let file = SmallFile::new().first_month().write_axes(&path);
        let mut values: Vec<f32> = (0..32).map(|cell| 280.0 + 0.25 * cell as f32).collect();
        values[3] = -999.0;
        let sst = file
            .new_dataset_builder()
            .empty_as(half())
            .shape([1, 4, 8])
            .create("sst")
            .unwrap();
        sst.write_raw(&values).unwrap();
        text(&sst, "units", "K");
        text(&sst, "standard_name", "sea_surface_temperature");
        let fill = sst.new_attr_builder().empty_as(half());
        fill.create("_FillValue")
            .unwrap()
            .write_scalar(&-999.0f32)
            .unwrap();
    }
    let outcome = place.land(&[path]).await.remove(0);
    assert!(!outcome.is_rejected(), "{outcome}");
    let manifest = place.newest("sst").await;
    let found = place.values(&manifest, 0).await;
    assert!(found[3].is_nan() && manifest.steps[0].valid_cells == 31);
    assert_eq!((found[0], found[31]), (280.0, 287.75));
}
