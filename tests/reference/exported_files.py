#!/usr/bin/env python3
"""Opens an exported file with what others use for its format, and compares it with what was written, bit for bit.

    exported_files.py netcdf|geotiff|parquet PATH EXPECTED    EXPECTED is JSON: places, periods, and values as their bits

netCDF4 reads NetCDF (the C library, not HDF5's), GDAL reads GeoTIFF (rasterio), Arrow reads Parquet. Prints JSON: how many
values were compared.
"""

import json
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np


def same(found, bits, where):
    found = np.asarray(found, dtype=np.float32).ravel()
    wanted = np.array(bits, dtype=np.uint32).view(np.float32)
    assert found.shape == wanted.shape, (where, found.shape, wanted.shape)
    is_same = (found.view(np.uint32) == wanted.view(np.uint32)) | (np.isnan(found) & np.isnan(wanted))
    assert is_same.all(), (where, int((~is_same).sum()), "other values")
    return found.size


def netcdf(path, expected):
    import netCDF4

    with netCDF4.Dataset(path) as data:
        data.set_auto_mask(False)
        values = data[expected["variable"]]
        assert values.dimensions == ("time", "lat", "lon"), values.dimensions
        assert values.units == expected["units"] and values.long_name == expected["long_name"]
        assert values.grid_mapping == "crs" and data["crs"].grid_mapping_name == "latitude_longitude"
        assert np.isnan(values._FillValue) and values.dtype == np.float32
        assert data.Conventions == "CF-1.11" and data.title and data.references and data.id
        for name in ("lat", "lon"):
            assert (data[name][:] == np.array(expected[name])).all(), f"other {name}"
            edges = data[f"{name}_bnds"][:]
            assert edges.shape == (len(expected[name]), 2)
            assert np.abs(edges.mean(axis=1) - data[name][:]).max() < 1e-9
        assert data["lat"].units == "degrees_north" and data["lon"].units == "degrees_east"
        time = data["time"]
        assert time.bounds == "time_bnds" and time.calendar == "proleptic_gregorian"
        dates = netCDF4.num2date(data["time_bnds"][:], time.units, time.calendar)
        first = expected["steps"][0]["start_ms"]
        epoch = netCDF4.num2date(0, "seconds since 1970-01-01", time.calendar)
        count = 0
        for at, step in enumerate(expected["steps"]):
            start_ms = first if expected["is_sum"] else step["start_ms"]
            found = [round((date - epoch).total_seconds() * 1000) for date in dates[at]]
            assert found == [start_ms, step["end_ms"]], (at, found)
            middle = step["end_ms"] if expected["is_sum"] else (step["start_ms"] + step["end_ms"]) // 2
            assert round(float(time[at]) * 1000) == middle, (at, time[at])
            if expected["is_sum"]:
                assert round(float(data["step_start"][at]) * 1000) == step["start_ms"]
            count += same(values[at], step["bits"], at)
    changed(path, expected["variable"])
    placed(path, expected)
    return count


def changed(path, variable):
    """Other words in a copy of it, as who gets a file may want them: the library writes only in files that keep the order of their making."""
    import netCDF4

    with tempfile.TemporaryDirectory() as folder:
        copy = shutil.copy(path, folder)
        with netCDF4.Dataset(copy, "a") as data:
            data.title = "Another"
            data[variable].comment = "changed"
        with netCDF4.Dataset(copy) as data:
            assert (data.title, data[variable].comment) == ("Another", "changed")
            assert list(data.dimensions) == ["time", "lat", "lon", "bnds"], data.dimensions


def placed(path, expected):
    """GDAL puts it where it is, by name of its reference system."""
    import rasterio

    with rasterio.open(f"netcdf:{path}:{expected['variable']}") as data:
        assert data.crs.to_epsg() == 4326, data.crs
        found = [data.bounds.left, data.bounds.bottom, data.bounds.right, data.bounds.top]
        assert np.abs(np.array(found) - expected["edges"]).max() < 1e-9, found
        same(data.read(1), expected["steps"][0]["bits"], "GDAL")


def geotiff(path, expected):
    import rasterio

    files = sorted(Path(path).glob("*.tif"))
    assert len(files) == len(expected["steps"]) == len(list(Path(path).iterdir())), files
    count = 0
    for file, step in zip(files, expected["steps"]):
        with rasterio.open(file) as data:
            assert data.crs.to_epsg() == 4326 and data.dtypes == ("float32",) and np.isnan(data.nodata)
            found = [data.bounds.left, data.bounds.bottom, data.bounds.right, data.bounds.top]
            assert np.abs(np.array(found) - expected["edges"]).max() < 1e-9, found
            # Places are told to nine digits.
            for row, lat in enumerate(expected["lat"]):
                assert abs(data.xy(row, 0)[1] - lat) < 6e-10, (row, lat)
            for col, lon in enumerate(expected["lon"]):
                assert abs(data.xy(0, col)[0] - lon) < 6e-10, (col, lon)
            tags = data.tags()
            for name, ms in (("PERIOD_START", step["start_ms"]), ("PERIOD_END", step["end_ms"])):
                assert np.datetime64(tags[name].rstrip("Z"), "ms") == np.datetime64(ms, "ms"), (name, tags)
            assert tags["TITLE"] == "Flux <of> \"CO₂\" & more", tags
            assert data.units == (expected["units"],) and data.descriptions == (expected["long_name"],)
            count += same(data.read(1), step["bits"], file.name)
    return count


def parquet(path, expected):
    import pyarrow.parquet

    table = pyarrow.parquet.read_table(path)
    variable = expected["variable"]
    assert table.column_names == ["time_start", "time_end", "lat", "lon", variable], table.column_names
    assert str(table.schema.field("time_start").type) == "timestamp[ms, tz=UTC]"
    said = {name.decode(): text.decode() for name, text in table.schema.field(variable).metadata.items()}
    assert (said["units"], said["long_name"]) == (expected["units"], expected["long_name"]), said
    assert ("time: sum" in said.get("cell_methods", "")) == expected["is_sum"] and "grid_mapping" not in said, said
    column = {name: table[name].to_numpy() for name in table.column_names}
    lat, lon = np.array(expected["lat"]), np.array(expected["lon"])
    count = 0
    for step in expected["steps"]:
        of_step = column["time_start"] == np.datetime64(step["start_ms"], "ms")
        assert (column["time_end"][of_step] == np.datetime64(step["end_ms"], "ms")).all(), "another end"
        # Places are found by equality: a last digit that is another finds none.
        rows = np.searchsorted(-lat, -column["lat"][of_step])
        cols = np.searchsorted(lon, column["lon"][of_step])
        assert (lat[rows] == column["lat"][of_step]).all() and (lon[cols] == column["lon"][of_step]).all(), "other places"
        values = np.full((len(lat), len(lon)), np.nan, dtype=np.float32)
        assert len(set(zip(rows, cols))) == len(rows), "a cell twice"
        values[rows, cols] = column[variable][of_step]
        count += same(values, step["bits"], step["start_ms"])
    wanted = sum(int((~np.isnan(np.array(s["bits"], dtype=np.uint32).view(np.float32))).sum()) for s in expected["steps"])
    assert table.num_rows == wanted, (table.num_rows, wanted)
    return count


if __name__ == "__main__":
    kind, path, expected = sys.argv[1:]
    with open(expected) as told:
        compared = {"netcdf": netcdf, "geotiff": geotiff, "parquet": parquet}[kind](path, json.load(told))
    print(json.dumps({"values": compared}))
