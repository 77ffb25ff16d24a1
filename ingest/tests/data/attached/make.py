"""Makes the Zarr stores beside this file, which tests attach, and expected.json, what xarray finds in them.

Made with Python 3.11 and the versions that expected.json names:
    python make.py
Values are of a formula, in degrees Celsius or kelvin; times are three days, the first at 2020-01-01.
"""

import json
import pathlib
import shutil

import numpy
import xarray
import zarr
from zarr.codecs import BloscCodec, BytesCodec, GzipCodec, ZstdCodec

HERE = pathlib.Path(__file__).parent
LAT = numpy.arange(-75.0, 90.0, 30.0)  # from the south
LON = numpy.arange(22.5, 360.0, 45.0)  # from Greenwich
TIME = numpy.array([0, 1, 2], dtype="int32")


def temperatures():
    """Three maps; every third cell of the first row has none."""
    time, lat, lon = numpy.meshgrid(TIME, LAT, LON, indexing="ij")
    values = 20.0 - 0.2 * numpy.abs(lat) + 0.01 * lon + 0.5 * time
    values[:, 0, ::3] = numpy.nan
    return values


def dataset(values, **attributes):
    time = ("time", TIME, {"units": "days since 2020-01-01", "standard_name": "time", "bounds": "time_bnds"})
    bounds = numpy.stack([TIME, TIME + 1], axis=1)
    return xarray.Dataset(
        {"sst": (("time", "lat", "lon"), values, attributes), "time_bnds": (("time", "bnds"), bounds)},
        {
            "time": time,
            "lat": ("lat", LAT, {"units": "degrees_north", "standard_name": "latitude"}),
            "lon": ("lon", LON, {"units": "degrees_east", "standard_name": "longitude"}),
        },
        {"title": "made-up temperatures", "source": "make.py"},
    )


def write(name, data, zarr_format, encoding, **options):
    path = HERE / name
    shutil.rmtree(path, ignore_errors=True)
    data.to_zarr(path, zarr_format=zarr_format, encoding=encoding, **options)
    return path


def found(path):
    """Maps in the order of time, each row by row from the north, from -180 on; kelvin, None for no data."""
    with xarray.open_zarr(path, decode_times=False) as data:
        values = data["sst"]
        kelvin = values.astype("float64") + (273.15 if values.attrs["units"] == "degC" else 0.0)
        kelvin = kelvin.assign_coords(lon=(kelvin.lon + 180) % 360 - 180)
        kelvin = kelvin.sortby("lon").sortby("lat", ascending=False)
        rows = kelvin.transpose("time", "lat", "lon").values
        return [[None if numpy.isnan(v) else float(v) for v in plane.ravel()] for plane in rows]


def main():
    name = {"standard_name": "sea_surface_temperature"}
    celsius = dataset(temperatures(), units="degC", **name)
    kelvin = dataset((temperatures() + 273.15).astype("float32"), units="K", **name)
    packed = {"dtype": "int16", "scale_factor": 0.01, "add_offset": 5.0, "_FillValue": -32768}
    floats = {"_FillValue": numpy.float32(numpy.nan), "dtype": "float32"}
    plain = {"compressors": None}
    coordinates = {key: {"compressors": None} for key in ("time", "lat", "lon", "time_bnds")}
    with_codec = lambda own, codec, **more: {"sst": {**own, "compressors": codec, **more}, **coordinates}
    stores = {
        "v2-blosc.zarr": write(
            "v2-blosc.zarr", celsius, 2, {"sst": {**packed, "chunks": (2, 3, 8)}}, consolidated=True
        ),
        "v2-plain.zarr": write(
            "v2-plain.zarr", kelvin, 2, {"sst": {**floats, "chunks": (1, 6, 8), **plain}}, consolidated=False
        ),
        "v3-zstd.zarr": write(
            "v3-zstd.zarr", celsius, 3, with_codec(packed, [ZstdCodec()], chunks=(2, 3, 8)), consolidated=True
        ),
        "v3-gzip.zarr": write(
            "v3-gzip.zarr", kelvin, 3, with_codec(floats, [GzipCodec()], chunks=(3, 2, 4)), consolidated=False
        ),
        "v3-sharded.zarr": write(
            "v3-sharded.zarr",
            kelvin.transpose("lat", "lon", "time", ...),
            3,
            with_codec(floats, [BloscCodec(cname="lz4")], chunks=(3, 4, 1), shards=(6, 8, 3)),
            consolidated=False,
        ),
    }
    expected = {
        "versions": {"xarray": xarray.__version__, "zarr": zarr.__version__, "numpy": numpy.__version__},
        "stores": {key: found(path) for key, path in stores.items()},
    }
    (HERE / "expected.json").write_text(json.dumps(expected) + "\n")


main()
