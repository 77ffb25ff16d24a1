#!/usr/bin/env python3
"""Makes a product's source file, and compares what xarray, zarr and Icechunk read of the product with it, exactly.

    interop.py make FILE [one]        writes a NetCDF file: three months of a temperature with gaps, on a grid that has two coarser levels;
                                      with `one` the last bit of one value is another
    interop.py compare FILE PLACE...  PLACE is zarr:CUBE or icechunk:REPOSITORY, a folder or s3://BUCKET/PREFIX with the variables
                                      AWS_ENDPOINT_URL, AWS_REGION, AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY;
                                      or zarrita:FOLDER, what tests/browser/zarrita.mjs read at an address of the server

Shares nothing with Fluxglobe: values, times, bounds and places are those of the file to the last bit; coarser levels, which a
repository and an address have, are means by area that numpy computes here by the rule of docs/decisions/032-levels.md, and lie where
the attributes of the multiscales convention say. Prints JSON: how much was compared.
"""

import json
import os
import sys
from urllib.parse import urlparse

import netCDF4
import numpy as np
import xarray as xr

ROWS, COLS, STEPS = 601, 2101, 3
# Eighths of a degree are exact in binary.
CELL_DEG, NORTH_DEG, WEST_DEG = 0.125, 37.5, -120.0
MONTHS = ["2001-01-01", "2001-02-01", "2001-03-01", "2001-04-01"]
FILL = np.float32(-999.0)
# Cells of a level along each side of one of the next, and the most cells a side of the coarsest one.
LEVEL_CELLS, COARSEST_SIDE = 4, 512
# Bits behind the leading one that means keep.
KEPT_BITS = 15
# WGS 84: semi-major axis, m, and flattening.
AXIS_M, FLATTENING = 6_378_137.0, 1 / 298.257223563


def make(file, is_one_other):
    """Values that differ in every cell and step, with gaps of single cells, of blocks and of whole rows."""
    generator = np.random.default_rng(20010101)
    row, col = np.meshgrid(np.arange(ROWS), np.arange(COLS), indexing="ij")
    with netCDF4.Dataset(file, "w", format="NETCDF4") as data:
        data.Conventions = "CF-1.8"
        for name, count in [("time", STEPS), ("lat", ROWS), ("lon", COLS), ("nv", 2)]:
            data.createDimension(name, count)
        lat = data.createVariable("lat", "f8", ("lat",))
        lat.setncatts({"units": "degrees_north", "standard_name": "latitude"})
        lat[:] = NORTH_DEG - CELL_DEG * (np.arange(ROWS) + 0.5)
        lon = data.createVariable("lon", "f8", ("lon",))
        lon.setncatts({"units": "degrees_east", "standard_name": "longitude"})
        lon[:] = WEST_DEG + CELL_DEG * (np.arange(COLS) + 0.5)
        days = (np.array(MONTHS, "datetime64[D]") - np.datetime64("2001-01-01")).astype(np.float64)
        time = data.createVariable("time", "f8", ("time",))
        time.setncatts({"units": "days since 2001-01-01", "standard_name": "time", "bounds": "time_bnds", "calendar": "standard"})
        time[:] = (days[:-1] + days[1:]) / 2
        data.createVariable("time_bnds", "f8", ("time", "nv"))[:] = np.stack([days[:-1], days[1:]], axis=1)
        sst = data.createVariable("sst", "f4", ("time", "lat", "lon"), fill_value=FILL, zlib=True)
        sst.setncatts({"units": "K", "standard_name": "sea_surface_temperature", "cell_methods": "time: mean"})
        for step in range(STEPS):
            values = (285 + 10 * np.cos(row / 90) * np.sin(col / 170 + step) + generator.random(row.shape)).astype(np.float32)
            gaps = generator.random(row.shape) < 0.05
            gaps |= (row // 37 + col // 53 + step) % 5 == 0
            gaps[200:216] = True
            values[gaps] = FILL
            if is_one_other and step == 1:
                row_of, col_of = np.argwhere(~gaps)[12345]
                values[row_of, col_of] = np.nextafter(values[row_of, col_of], np.float32(0))
            sst[step] = values


def opened(place, group=None):
    """A group of a place, with nothing but what xarray, zarr and Icechunk have."""
    kind, _, path = place.partition(":")
    if kind == "zarrita":
        return read_by_zarrita(path, group or "")
    address = urlparse(path)
    is_bucket = address.scheme == "s3"
    if kind == "zarr":
        if not is_bucket:
            return xr.open_zarr(path, consolidated=True)
        from obstore.store import S3Store
        from zarr.storage import ObjectStore

        store = S3Store(
            address.netloc,
            prefix=address.path.strip("/"),
            endpoint=os.environ["AWS_ENDPOINT_URL"],
            region=os.environ["AWS_REGION"],
            access_key_id=os.environ["AWS_ACCESS_KEY_ID"],
            secret_access_key=os.environ["AWS_SECRET_ACCESS_KEY"],
            client_options={"allow_http": True},
        )
        return xr.open_zarr(ObjectStore(store, read_only=True), consolidated=True)
    import icechunk

    if is_bucket:
        storage = icechunk.s3_storage(
            bucket=address.netloc,
            prefix=address.path.strip("/"),
            endpoint_url=os.environ["AWS_ENDPOINT_URL"],
            region=os.environ["AWS_REGION"],
            access_key_id=os.environ["AWS_ACCESS_KEY_ID"],
            secret_access_key=os.environ["AWS_SECRET_ACCESS_KEY"],
            allow_http=True,
            force_path_style=True,
        )
    else:
        storage = icechunk.local_filesystem_storage(path)
    session = icechunk.Repository.open(storage).readonly_session("main")
    return xr.open_zarr(session.store, group=group, consolidated=False)


def read_by_zarrita(folder, group):
    with open(f"{folder}/groups.json") as file:
        told = json.load(file)[group]
    variables = {}
    for name, array in told["arrays"].items():
        values = np.fromfile(array["values"], array["type"]).reshape(array["shape"])
        variables[name] = (array["dimensions"], values, array["attributes"])
    return xr.decode_cf(xr.Dataset(variables, attrs=told["attributes"]))


def same(found, expected, what):
    """Equal to the last bit, and no data in the same places."""
    assert found.shape == expected.shape and found.dtype == expected.dtype, (what, found.shape, found.dtype)
    assert np.array_equal(np.isnan(found), np.isnan(expected)), f"{what}: other cells have data"
    valid = ~np.isnan(expected)
    bits = np.int32 if expected.dtype == np.float32 else np.int64
    off = np.count_nonzero(found[valid].view(bits) != expected[valid].view(bits))
    assert off == 0, f"{what}: {off} other values"
    return int(valid.sum())


def source(file):
    with netCDF4.Dataset(file) as data:
        data.set_auto_mask(False)
        values = data["sst"][:]
        values[values == FILL] = np.nan
        return values, data["lat"][:], data["lon"][:]


def check_times(data, what):
    edges = np.array(MONTHS, "datetime64[ns]")
    bounds = np.stack([edges[:-1], edges[1:]], axis=1)
    assert np.array_equal(data["time_bnds"].values.astype("datetime64[ns]"), bounds), f"{what}: other bounds of time"
    middles = bounds[:, 0] + (bounds[:, 1] - bounds[:, 0]) // 2
    assert np.array_equal(data["time"].values.astype("datetime64[ns]"), middles), f"{what}: other times"


def edges_of(count, first, step, cells):
    """Edges of blocks of so many cells, the last one smaller where the side does not divide."""
    return first + step * np.minimum(np.arange(0, count + cells, cells), count)


def check_places(data, cells, what):
    for name, count, first, step in [("lat", ROWS, NORTH_DEG, -CELL_DEG), ("lon", COLS, WEST_DEG, CELL_DEG)]:
        edges = edges_of(count, first, step, cells)
        bounds = np.stack([edges[:-1], edges[1:]], axis=1)
        same(data[f"{name}_bnds"].values, bounds, f"{what} {name}_bnds")
        same(data[name].values, bounds.mean(axis=1), f"{what} {name}")


def zone_area(lat_deg):
    """Area between the equator and a latitude of a wedge of one radian on WGS 84, m2 (Snyder 1987, equation 3-12)."""
    squared = FLATTENING * (2 - FLATTENING)
    e, sine = np.sqrt(squared), np.sin(np.radians(lat_deg))
    return AXIS_M**2 * (1 - squared) / 2 * (sine / (1 - squared * sine**2) + np.log((1 + e * sine) / (1 - e * sine)) / (2 * e))


def joined(cells, side):
    """Sums over blocks of so many cells a side."""
    rows = np.add.reduceat(cells, np.arange(0, cells.shape[0], side), axis=0)
    return np.add.reduceat(rows, np.arange(0, cells.shape[1], side), axis=1)


def check_level(data, values, side, what):
    """Means by area over the cells that hold data, rounded to 15 bits behind the leading one; and the share that holds data."""
    edges = edges_of(ROWS, NORTH_DEG, -CELL_DEG, 1)
    area = np.broadcast_to((zone_area(edges[:-1]) - zone_area(edges[1:]))[:, None], values.shape[1:])
    whole, compared = joined(area, side), 0
    for step in range(STEPS):
        cells = values[step].astype(np.float64)
        weight = np.where(np.isnan(cells), 0.0, area)
        covered = joined(weight, side)
        with np.errstate(invalid="ignore"):
            mean = joined(np.nan_to_num(cells) * weight, side) / covered
        found = data[name_of(data)].isel(time=step).values
        assert found.dtype == np.float32 and found.shape == mean.shape, (what, found.shape)
        assert np.array_equal(np.isnan(found), covered == 0), f"{what}: other blocks have data"
        valid = covered > 0
        off = np.abs(found[valid].astype(np.float64) - mean[valid]) / np.abs(mean[valid])
        # Half a unit of the last kept bit, and half of the 32 bits before.
        assert off.max() <= 2.0 ** -(KEPT_BITS + 1) + 2.0**-24, f"{what}: a mean is off by {off.max()}"
        assert not (found[valid].view(np.int32) & ((1 << (23 - KEPT_BITS)) - 1)).any(), f"{what}: more bits than are kept"
        share = covered / whole
        steps = np.rint(data["coverage"].isel(time=step).values.astype(np.float64) * 255)
        # What holds any data keeps some, and what lacks any is not whole.
        some = (share > 0) & (share < 1 - 1e-9)
        expected = np.where(some, np.clip(np.rint(share * 255), 1, 254), np.where(share > 0, 255, 0))
        # Between two steps either is the nearest.
        is_between = np.abs(share * 255 % 1 - 0.5) < 1e-6
        off = np.abs(steps - expected)
        assert ((off == 0) | is_between & (off == 1)).all(), f"{what}: other coverage"
        compared += int(valid.sum())
    return compared


def check_lie(data, level, number, what):
    """Centres of whole blocks lie where scales and translations of indices of the multiscales convention lead, from level to level."""
    layout = data.attrs["multiscales"]["layout"]
    entry = layout[number]
    assert entry["asset"] == f"levels/{number}/{name_of(level)}", (what, entry)
    scale, translation = np.ones(3), np.zeros(3)
    assets = {entry["asset"]: entry for entry in layout}
    while "derived_from" in entry:
        own = entry["transform"]
        scale, translation = scale * own["scale"], translation * own["scale"] + own["translation"]
        entry = assets[entry["derived_from"]]
    assert entry["asset"] == name_of(data), (what, entry)
    for axis, name in enumerate(["lat", "lon"], start=1):
        whole = data[name].size // int(scale[axis])
        cells = np.arange(whole) * scale[axis] + translation[axis]
        expected = np.interp(cells, np.arange(data[name].size), data[name].values)
        off = np.abs(level[name].values[:whole] - expected).max()
        assert off < 1e-9, f"{what}: {name} is {off} degrees from where the attributes lead"


def name_of(data):
    """The one array of values: what lies along time and the map, and is no coverage."""
    (name,) = [name for name in data.data_vars if data[name].dims == ("time", "lat", "lon") and name != "coverage"]
    return name


def compare(file, places):
    values, lat, lon = source(file)
    told = {}
    for place in places:
        data = opened(place)
        array = data[name_of(data)]
        assert array.attrs["units"] == "K" and array.attrs["standard_name"] == "sea_surface_temperature", array.attrs
        compared = sum(same(array.isel(time=step).values, values[step], f"{place} step {step}") for step in range(STEPS))
        check_times(data, place)
        check_places(data, 1, place)
        same(data["lat"].values, lat, f"{place} lat of the file")
        same(data["lon"].values, lon, f"{place} lon of the file")
        levels = []
        side, count = LEVEL_CELLS, max(ROWS, COLS)
        while not place.startswith("zarr:") and count > COARSEST_SIDE:
            number, count = len(levels) + 1, -(-count // LEVEL_CELLS)
            what = f"{place} levels/{number}"
            level = opened(place, f"levels/{number}")
            check_times(level, what)
            check_places(level, side, what)
            check_lie(data, level, number, what)
            levels.append(check_level(level, values, side, what))
            side *= LEVEL_CELLS
        told[place] = {"values": compared, "levels": levels}
    print(json.dumps(told))


if __name__ == "__main__":
    if sys.argv[1] == "make":
        make(sys.argv[2], sys.argv[3:] == ["one"])
    else:
        compare(sys.argv[2], sys.argv[3:])
    # Threads of the package icechunk may call into an interpreter that is being taken down, which ends it by a segmentation fault.
    sys.stdout.flush()
    os._exit(0)
