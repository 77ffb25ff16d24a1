#!/usr/bin/env python3
"""Integrates the Takahashi et al. (2009) air-sea CO2 flux grids, and shares nothing with Fluxglobe but the files.

    takahashi09_integral.py FOLDER    the folder `takahashi09` of the FluxEngine package's verification data

Prints JSON: years in Pg C, months in Tg C, positive out of the sea. What it prints is kept in
compute/src/published/takahashi09.json, the second column of the check table; a test runs this script over the files and
compares. `make test` installs numpy and netCDF4, pinned, for it (deploy/install-tools.sh).

How, step by step, in whole numpy arrays and floats of 64 bits:
- a file is a month: `CO2flux`, g C m-2 a month, -999 where there is no value, so that a month's length is not needed;
- labels are the cells' north-west corners: the row labelled 90 reaches from 89 to 90 degrees north;
- the area of a zone of latitude comes from quadrature of the surface element (Gauss and Legendre, 16 nodes a zone), on
  the ellipsoid M(lat) N(lat) cos(lat), radii of curvature from the WGS84 axis and flattening (NIMA TR8350.2), on the
  sphere R^2 cos(lat) with R = 6371 km: no closed formula of an authalic latitude is used;
- a region cuts cells: each row of cells is cut into 400 zones, and in each zone the lengths of the parts of every cell
  inside the region are found where the region's edges, straight in longitude and latitude, cross its middle.
"""

import json
import sys
from pathlib import Path

import netCDF4
import numpy as np

WGS84_A_M = 6_378_137.0
WGS84_FLATTENING = 1 / 298.257223563
SPHERE_M = 6_371_000.0
ZONES_PER_ROW = 400
ROWS, COLS = 180, 360

# Corners as (longitude, latitude). The bands are those of the paper's table; its equatorial Pacific has no drawn limits:
# coasts to coasts, from the Philippines and New Guinea to the Americas.
BANDS = {
    "global": (-90, 90),
    "14n-50n": (14, 50),
    "14s-50s": (-50, -14),
    "50s-62s": (-62, -50),
}
EQUATORIAL_PACIFIC = [
    (125.5, 14), (126.5, 7.5), (127.5, 4), (128, 1), (131, -0.8), (134, -3), (138, -4.5), (141, -6), (143.5, -9),
    (142.5, -11), (143.5, -14), (284.5, -14), (282, -8), (280.5, -5), (281, -1), (283, 4), (283, 7.5), (280.5, 9),
    (279, 9.2), (276.5, 10.5), (275, 13), (272, 14),
]  # fmt: skip


def element_wgs84(lat):
    """Area of the surface a radian of latitude and a radian of longitude, m2."""
    squared = WGS84_FLATTENING * (2 - WGS84_FLATTENING)
    w = 1 - squared * np.sin(lat) ** 2
    meridian = WGS84_A_M * (1 - squared) / w**1.5
    prime_vertical = WGS84_A_M / np.sqrt(w)
    return meridian * prime_vertical * np.cos(lat)


def element_sphere(lat):
    return SPHERE_M**2 * np.cos(lat)


def zone_areas(element):
    """Area of every zone a degree of longitude, m2, `[row, zone]`, north to south."""
    edges = np.radians(np.linspace(90, -90, ROWS * ZONES_PER_ROW + 1))
    half, middle = (edges[:-1] - edges[1:]) / 2, (edges[:-1] + edges[1:]) / 2
    nodes, weights = np.polynomial.legendre.leggauss(16)
    areas = sum(weight * element(middle + half * node) for node, weight in zip(nodes, weights, strict=True)) * half
    return np.radians(1) * areas.reshape(ROWS, ZONES_PER_ROW)


def inside(corners, lats):
    """Degrees of longitude of every cell that lie in a polygon at some latitudes, `[lat, col]`."""
    lons = np.zeros((len(lats), COLS))
    starts, ends = np.array(corners, float), np.roll(np.array(corners, float), -1, axis=0)
    for index, lat in enumerate(lats):
        is_crossed = (starts[:, 1] > lat) != (ends[:, 1] > lat)
        (lon1, lat1), (lon2, lat2) = starts[is_crossed].T, ends[is_crossed].T
        crossings = np.sort(lon1 + (lat - lat1) / (lat2 - lat1) * (lon2 - lon1))
        for west, east in crossings.reshape(-1, 2):
            for turn in (-360, 0, 360):
                cells = np.arange(-180, 180) + turn
                lons[index] += np.clip(np.minimum(east, cells + 1) - np.maximum(west, cells), 0, None)
    return lons


def cell_areas(region, element):
    """Area of every cell inside a region, m2, `[row, col]`."""
    zones = zone_areas(element)
    lats = (90 - (np.arange(ROWS * ZONES_PER_ROW) + 0.5) / ZONES_PER_ROW).reshape(ROWS, ZONES_PER_ROW)
    if region in BANDS:
        south, north = BANDS[region]
        rows = np.sum(zones * ((lats > south) & (lats < north)), axis=1)
        return np.repeat(rows[:, np.newaxis], COLS, axis=1)
    return np.array([zone @ inside(EQUATORIAL_PACIFIC, at) for zone, at in zip(zones, lats, strict=True)])


def months(folder):
    """Fluxes of January to December, g C m-2 a month, `[row, col]`, NaN without a value."""
    files = sorted(Path(folder).glob("M2001*.nc"))  # the day of the year is in the name
    if len(files) != 12:
        sys.exit(f"{folder}: {len(files)} files M2001*.nc, one a month is wanted")
    fluxes = []
    for file in files:
        with netCDF4.Dataset(file) as data:
            labels = [(data["latitude"][:], np.arange(90, -90, -1)), (data["longitude"][:], np.arange(-180, 180))]
            if not all(np.allclose(found, wanted, rtol=0, atol=1e-4) for found, wanted in labels):
                sys.exit(f"{file}: its labels are not 90 to -89 and -180 to 179")
            fluxes.append(np.ma.filled(data["CO2flux"][0].astype(float), np.nan))
    return fluxes


def budgets(fluxes, region, element):
    """Carbon given off in every month, Tg."""
    areas = cell_areas(region, element)
    return [float(np.nansum(flux * areas)) / 1e12 for flux in fluxes]


def main():
    fluxes = months(sys.argv[1])
    years = []
    for region in [*BANDS, "equatorial-pacific"]:
        earths = {"wgs84": element_wgs84, "sphere": element_sphere} if region == "global" else {"wgs84": element_wgs84}
        for earth, element in earths.items():
            total = sum(budgets(fluxes, region, element)) / 1000
            years.append({"region": region, "earth": earth, "pg": round(total, 9)})
    by_month = [round(month, 6) for month in budgets(fluxes, "global", element_wgs84)]
    print(json.dumps({"years": years, "months_tg": by_month}, indent=2))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main()
