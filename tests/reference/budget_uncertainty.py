#!/usr/bin/env python3
"""Standard errors of budgets of the Takahashi et al. (2009) flux, pair by pair, and nothing of Fluxglobe.

    budget_uncertainty.py FOLDER    the folder `takahashi09` of the FluxEngine package's verification data

Prints JSON: of each question the budget of the year 2000 between 14 and 50 degrees north and its standard error, Tg C.
compute/tests/it/uncertainty.rs asks Fluxglobe the same and compares.

How:
- fluxes are read, and areas of cells taken, as in takahashi09_integral.py beside it;
- a month's flux is a mean over its seconds, so that a cell's mass is g C m-2 a month x area;
- the error of a cell is a share of that mass with its sign, or an error of the flux x area x seconds;
- rho of two cells is exp(-d / length), d from the angle between the directions of their middles on a sphere of 6371 km,
  by its chord: no haversine; rho of two months is exp(-t / days) between their middles;
- variance = the sum over all pairs of cells and all pairs of months: a matrix of every cell with every cell, a band of rows of it
  at a time, no transform and no recursion over months.
"""

import calendar
import json
import sys

import numpy as np

from takahashi09_integral import COLS, ROWS, cell_areas, element_wgs84, months

SPHERE_KM = 6371.0
DAY_S = 86_400.0
YEAR_S = 365.25 * DAY_S
GRAMS_PER_MOL = 12.011
SOUTH, NORTH = 14, 50
# Name, share of the flux or None, mol m-2 a year or None, length in km, days.
QUESTIONS = [
    ("relative", 0.2, None, 700.0, 0.0),
    ("relative, months together", 0.2, None, 700.0, 45.0),
    ("absolute", None, 0.5, 1500.0, 0.0),
    ("absolute, months together", None, 0.5, 400.0, 120.0),
    ("each cell by itself", 0.2, None, 0.0, 0.0),
]


def in_space(masses, length_km):
    """x_s R x_t of every two months, `[month, month]`, g2; `masses` is `[month, row, col]`, 0 without a flux."""
    here = np.any(masses != 0, axis=0)
    rows, cols = np.nonzero(here)
    x = masses[:, rows, cols]
    if length_km == 0:
        return x @ x.T
    lat, lon = np.radians(89.5 - rows), np.radians(cols - 179.5)
    directions = np.stack([np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)], axis=1)
    product = np.zeros_like(x)
    for first in range(0, len(lat), 500):
        part = slice(first, first + 500)
        chord = np.linalg.norm(directions[part, None, :] - directions[None, :, :], axis=2)
        rho = np.exp(-2 * SPHERE_KM * np.arcsin(np.clip(chord / 2, 0, 1)) / length_km)
        product[:, part] = (rho @ x.T).T
    return product @ x.T


def in_time(days):
    """rho of every two months."""
    lengths = np.array([calendar.monthrange(2000, month)[1] for month in range(1, 13)], float)
    middles = np.cumsum(lengths) - lengths / 2
    apart = np.abs(middles[:, None] - middles[None, :])
    return (np.exp(-apart / days) if days > 0 else (apart == 0).astype(float)), lengths * DAY_S


def main():
    areas = cell_areas("14n-50n", element_wgs84)
    inside = np.zeros((ROWS, COLS), bool)
    inside[90 - NORTH : 90 - SOUTH] = True
    fluxes = np.array([np.where(inside, flux, np.nan) for flux in months(sys.argv[1])])
    budget_tg = float(np.nansum(fluxes * areas)) / 1e12
    answers = []
    for name, share, absolute, length_km, days in QUESTIONS:
        time, seconds = in_time(days)
        if share is not None:
            masses = share * fluxes * areas
        else:
            grams = absolute * GRAMS_PER_MOL / YEAR_S * seconds[:, None, None] * areas
            masses = np.where(np.isnan(fluxes), np.nan, grams)
        masses = np.nan_to_num(masses)
        variance = float(np.sum(in_space(masses, length_km) * time))
        answers.append({"question": name, "budget_tg": round(budget_tg, 6), "sigma_tg": round(np.sqrt(variance) / 1e12, 9)})
    print(json.dumps(answers, indent=2))


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    main()
