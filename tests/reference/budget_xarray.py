#!/usr/bin/env python3
"""Budgets of a gridded flux by xarray and dask, as somebody who knows them writes it; shares nothing with Fluxglobe.

    budget_xarray.py land FILE ZARR        rechunks FILE to a Zarr store in blocks of all steps
    budget_xarray.py budget SOURCE REGION  prints the budget of a GeoJSON polygon as JSON; SOURCE is a file or a Zarr store

`fluxglobe bench budget --python` runs both and compares the answers with ours. The file is what `fluxglobe generate
china-sea` writes: `co2_flux`, mmol m-2 d-1, on cell centres. A cell counts by its share of the region on a sphere of
6371 km: whole cells by their edges, those that an edge cuts by shapely, in the plane of longitude and sine of latitude.
Shares are kept beside SOURCE and used again. Only the cells around the region are read.
"""

import hashlib
import json
import sys
from pathlib import Path

import dask
import numpy as np
import xarray as xr

RADIUS_M = 6_371_000.0
KG_PER_MMOL = 0.012011 / 1000
PIECE_DEG = 0.01
# All steps of a block lie together.
BLOCK_CELLS = 64


def opened(source):
    if source.endswith("zarr"):
        return xr.open_zarr(source)
    return xr.open_dataset(source, engine="netcdf4", chunks={"time": 30})


def land(file, target):
    data = xr.open_dataset(file, engine="netcdf4", chunks={"time": 30})
    blocks = {"time": -1, "lat": BLOCK_CELLS, "lon": BLOCK_CELLS}
    data = data.chunk(blocks).drop_encoding()
    data.to_zarr(target + ".part", mode="w")
    Path(target + ".part").rename(target)


def edges(centres):
    half = (centres[1] - centres[0]) / 2
    return np.append(centres - half, centres[-1] + half)


def areas_m2(lat, lon, polygon):
    """Of a polygon's share of every cell, `[lat, lon]`."""
    import shapely

    south, north = np.sort(np.stack([edges(lat)[:-1], edges(lat)[1:]]), axis=0)
    west, east = edges(lon)[:-1], edges(lon)[1:]
    zones = np.sin(np.radians(north)) - np.sin(np.radians(south))
    whole = RADIUS_M**2 * zones[:, None] * np.radians(east - west)[None, :]
    cells = shapely.box(*np.broadcast_arrays(west[None, :], south[:, None], east[None, :], north[:, None]))
    shapely.prepare(polygon)
    held = shapely.covers(polygon, cells)
    cut = shapely.intersects(polygon, cells) & ~held
    parts = shapely.segmentize(shapely.intersection(polygon, cells[cut]), PIECE_DEG)

    def equal_area(corners):
        return RADIUS_M * np.column_stack([np.radians(corners[:, 0]), np.sin(np.radians(corners[:, 1]))])

    areas = np.where(held, whole, 0.0)
    areas[cut] = shapely.area(shapely.transform(parts, equal_area))
    return areas


def shares(source, region, data):
    text = Path(region).read_text()
    kept = Path(f"{source}-{hashlib.sha256(text.encode()).hexdigest()[:16]}.npy")
    if kept.exists():
        return np.load(kept)
    import shapely

    areas = areas_m2(data["lat"].values, data["lon"].values, shapely.from_geojson(text))
    np.save(kept, areas)
    return areas


def budget(source, region):
    data = opened(source)
    areas = shares(source, region, data)
    rows, cols = np.flatnonzero(areas.any(axis=1)), np.flatnonzero(areas.any(axis=0))
    part = {"lat": slice(rows[0], rows[-1] + 1), "lon": slice(cols[0], cols[-1] + 1)}
    flux = data["co2_flux"].isel(part)
    weights = xr.DataArray(areas[part["lat"], part["lon"]], dims=("lat", "lon"))
    bounds = data["time_bnds"].load()
    days = (bounds[:, 1] - bounds[:, 0]).values
    if np.issubdtype(days.dtype, np.timedelta64):
        days = days / np.timedelta64(1, "D")
    mmol_a_day = xr.dot(flux.fillna(0.0), weights, dim=("lat", "lon")).values
    return float(np.sum(mmol_a_day * days) * KG_PER_MMOL / 1e9)


def main():
    dask.config.set(scheduler="threads")
    match sys.argv[1:]:
        case ["land", file, target]:
            land(file, target)
        case ["budget", source, region]:
            print(json.dumps({"rows": [{"budget_tg": budget(source, region)}]}))
        case _:
            sys.exit(__doc__)


if __name__ == "__main__":
    main()
