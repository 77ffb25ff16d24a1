#!/usr/bin/env python3
"""Makes the file of a map of 67.5 million cells, and compares windows of the product's cube with it, of all its levels.

    large_map.py make FILE                writes a NetCDF file: a month of a flux on cells of 1/100 degree from pole to pole, three chunks of
                                          which hold data; the others are not written, so that the file is small and soon read
    large_map.py compare REPOSITORY [AT]  AT is a chunk in the place of the first one, to see the comparison fail: ROW,COL

Shares nothing with Fluxglobe: values are those of the rule below to the last bit, coarser levels what numpy computes of them. Prints
JSON: values that were compared of each level, and the budget of BOX, Tg.
"""

import json
import os
import sys

import netCDF4
import numpy as np
import xarray as xr

from interop import KEPT_BITS, LEVEL_CELLS, zone_area

ROWS, COLS = 18_000, 3_750
CELL_DEG, NORTH_DEG, WEST_DEG = 0.01, 90.0, -30.0
FILL = np.float32(-999.0)
# Cells a side of what is written at once, and which are.
CHUNK = 1000
WRITTEN = [(4, 1), (4, 2), (9, 0)]
LEVELS = 3
WINDOW = 256
# Rows and columns of cells inside of the first two chunks: a box from 20 to 5 degrees west, from 40 to 50 north.
BOX = (slice(4000, 5000), slice(1000, 2500))
SECONDS = 31 * 86_400


def value(row, col):
    """The flux of a cell, kg m-2 s-1, upwards."""
    return (1e-9 * (1 + row // CHUNK) + 1e-12 * (row % CHUNK) + 1e-13 * (col % CHUNK)).astype(np.float32)


def cells_of(chunk):
    """Row and column of each cell of a chunk; the last ones are smaller."""
    rows, cols = [np.arange(at * CHUNK, min((at + 1) * CHUNK, side)) for at, side in zip(chunk, (ROWS, COLS))]
    return np.meshgrid(rows, cols, indexing="ij")


def make(file):
    with netCDF4.Dataset(file, "w", format="NETCDF4") as data:
        data.Conventions = "CF-1.8"
        for name, count in [("time", 1), ("lat", ROWS), ("lon", COLS), ("nv", 2)]:
            data.createDimension(name, count)
        lat = data.createVariable("lat", "f8", ("lat",))
        lat.setncatts({"units": "degrees_north", "standard_name": "latitude"})
        lat[:] = NORTH_DEG - CELL_DEG * (np.arange(ROWS) + 0.5)
        lon = data.createVariable("lon", "f8", ("lon",))
        lon.setncatts({"units": "degrees_east", "standard_name": "longitude"})
        lon[:] = WEST_DEG + CELL_DEG * (np.arange(COLS) + 0.5)
        time = data.createVariable("time", "f8", ("time",))
        time.setncatts({"units": "days since 2001-01-01", "standard_name": "time", "bounds": "time_bnds"})
        time[:] = 15.5
        data.createVariable("time_bnds", "f8", ("time", "nv"))[:] = [[0, 31]]
        chunks = (1, CHUNK, CHUNK)
        flux = data.createVariable("fgco2", "f4", ("time", "lat", "lon"), fill_value=FILL, zlib=True, chunksizes=chunks)
        name = "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon"
        flux.setncatts({"units": "kg m-2 s-1", "standard_name": name, "cell_methods": "time: mean"})
        for chunk in WRITTEN:
            row, col = cells_of(chunk)
            flux[0, row[0, 0] : row[-1, 0] + 1, col[0, 0] : col[0, -1] + 1] = value(row, col)


def areas(rows):
    """Area of a cell of each row, m2."""
    north = NORTH_DEG - CELL_DEG * rows
    return (zone_area(north) - zone_area(north - CELL_DEG)) * np.radians(CELL_DEG)


def level_of(written, side):
    """Mean by area of each block of so many cells a side, and the share of it that holds data."""
    shape = [-(-ROWS // side), -(-COLS // side)]
    sums, weights = np.zeros(shape), np.zeros(shape)
    for chunk in written:
        row, col = cells_of(chunk)
        area, blocks = areas(row), (row // side, col // side)
        np.add.at(sums, blocks, value(row, col).astype(np.float64) * area)
        np.add.at(weights, blocks, area)
    whole = np.add.reduceat(areas(np.arange(ROWS)), np.arange(0, ROWS, side))
    widths = np.add.reduceat(np.ones(COLS), np.arange(0, COLS, side))
    with np.errstate(invalid="ignore"):
        return sums / weights, weights / (whole[:, None] * widths)


def own_values(written, row, col):
    """A window of the map itself."""
    row, col = np.meshgrid(np.arange(row, row + WINDOW), np.arange(col, min(col + WINDOW, COLS)), indexing="ij")
    is_written = np.zeros(row.shape, bool)
    for chunk in written:
        is_written |= (row // CHUNK == chunk[0]) & (col // CHUNK == chunk[1])
    return np.where(is_written, value(row, col), np.float32(np.nan))


def windows(side):
    """Corners of windows of a level: over the corner of the first chunks, in the midst of them, at the third one's, and where nothing is."""
    for row, col in [(4000, 1000), (4500, 2000), (10_000, 1000), (2000, 500), (8900, 3200)]:
        yield max(row // side - WINDOW // 2, 0), max(col // side - WINDOW // 2, 0)


def compare(repository, written):
    import icechunk

    session = icechunk.Repository.open(icechunk.local_filesystem_storage(repository)).readonly_session("main")
    compared = []
    for number in range(LEVELS + 1):
        side = LEVEL_CELLS**number
        group = f"levels/{number}" if number else None
        data = xr.open_zarr(session.store, group=group, consolidated=False)
        assert data["carbon_flux"].attrs["units"] == "kg m-2 s-1", data["carbon_flux"].attrs
        mean, share = level_of(written, side) if number else (None, None)
        count = 0
        for row, col in windows(side):
            what = f"level {number} from {row}, {col}"
            place = {"time": 0, "lat": slice(row, row + WINDOW), "lon": slice(col, col + WINDOW)}
            found = data["carbon_flux"].isel(place).values
            own = mean[row : row + WINDOW, col : col + WINDOW] if number else own_values(written, row, col)
            assert found.shape == own.shape and found.dtype == np.float32, (what, found.shape, own.shape)
            assert np.array_equal(np.isnan(found), np.isnan(own)), f"{what}: other cells have data"
            valid = ~np.isnan(own)
            off = np.abs(found[valid] / own[valid].astype(np.float64) - 1).max(initial=0)
            # A level has half a unit of the last kept bit, and half of the 32 bits before; the map itself nothing.
            allowed = 2.0 ** -(KEPT_BITS + 1) + 2.0**-24 if number else 0
            assert off <= allowed, f"{what}: a value is off by {off}"
            if number:
                covered = data["coverage"].isel(place).values
                off = np.abs(covered - share[row : row + WINDOW, col : col + WINDOW]).max()
                assert off <= 1 / 255, f"{what}: coverage is off by {off}"
            count += int(valid.sum())
        compared.append(count)
    row, col = np.meshgrid(np.arange(ROWS)[BOX[0]], np.arange(COLS)[BOX[1]], indexing="ij")
    budget_tg = (value(row, col).astype(np.float64) * areas(row)).sum() * SECONDS / 1e9
    print(json.dumps({"compared": compared, "budget_tg": budget_tg}))


if __name__ == "__main__":
    if sys.argv[1] == "make":
        make(sys.argv[2])
    else:
        first = [tuple(int(at) for at in sys.argv[3].split(","))] if sys.argv[3:] else WRITTEN[:1]
        compare(sys.argv[2], first + WRITTEN[1:])
    # As in interop.py.
    sys.stdout.flush()
    os._exit(0)
