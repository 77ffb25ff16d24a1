#!/usr/bin/env python3
"""Makes the fluxes of FluxEngine's two verification runs and their budgets, and shares nothing with Fluxglobe but files.

    fluxengine_budgets.py DATA LAND [FOLDER]

DATA is `data/verification_data` of the FluxEngine 4.2.1 package, LAND its `data/onedeg_land.nc`. Prints JSON, a run each:
what its authors print (`verification_reference_netflux/*_FEv4`), that total made anew in their way, and the budgets that
Fluxglobe is held to. With FOLDER, writes there what Fluxglobe is to sum: `RUN.nc` of each run, NetCDF-3, twelve months; and
what it is to compute the second one from, `fluxengine-socatv4-inputs.nc`, whose files are HDF5 in five layouts.

The runs are those of `fe_verify_takahashi09.py` (bulk formula, k = 0.26 U^2) and `fe_verify_socatv4.py` (cool and salty
skin, Nightingale et al. 2000) with `configs/*.conf` of the package; the equations are those of its `core/fe_core.py`.

How their authors sum (`tools/lib_ofluxghg_flux_budgets.py`), which is not how Fluxglobe sums by itself:
- a cell counts by its share of sea, 1 less `land_proportion`;
- and by its share of open water: ice of up to 10 % does not count, at least 10 % of a cell are open;
- a cell's area is that of a sphere whose radius is the distance of the ellipsoid from the earth's centre at this latitude
  (6378.137 and 6356.7523 km): neither a sphere nor the ellipsoid, whose area is larger towards the poles;
- sea without a flux gets the mean flux of all sea with one ("missing flux", a part of "net flux");
- the year is the sum of twelve months of 30.5 days.
The first and the third can be asked of a budget (`--cells ocean-share --ocean`, `--earth local-radius`). Open water is made
a part of the flux that is written: the mean through the sea of a cell, ice and all. What a budget gives is then the net
flux less the missing one, in months of the calendar.
"""

import calendar
import csv
import json
import sys
from datetime import date
from pathlib import Path

import netCDF4
import numpy as np

MONTH_DAYS = 30.5
EQUATOR_M, POLE_M = 6_378_137.0, 6_356_752.3
CARBON_G_PER_MOL = 12.0107
UATM_PA = 0.101325
RUNS = {
    "fluxengine-takahashi09": (2000, "takahashi09_FEv4/_global.txt"),
    "fluxengine-socatv4": (2010, "socatv4_sst_salinity_N00_reference_FEv4/SST_Salinity_gradients-N00_global.txt"),
}


def grid(file, name, least=-np.inf, most=np.inf):
    """A variable, `[row, col]`, north up, NaN where it has no value or one out of bounds."""
    with netCDF4.Dataset(file) as data:
        values = np.ma.filled(data[name][0].astype(float), np.nan)
        latitudes = next(data[axis][:] for axis in ("lat", "latitude") if axis in data.variables)
    values = values if latitudes[0] > latitudes[-1] else values[::-1]
    return np.where((values >= least) & (values <= most), values, np.nan)


def one(files):
    found = sorted(files)
    if len(found) != 1:
        sys.exit(f"one file is wanted, found {found}")
    return found[0]


def schmidt(celsius):
    return 2073.1 - 125.62 * celsius + 3.6276 * celsius**2 - 0.043219 * celsius**3


def solubility(kelvin, salinity):
    """mol / (l atm)."""
    t = kelvin / 100
    return np.exp(
        -60.2409 + 93.4517 / t + 23.3585 * np.log(t) + salinity * (0.023517 - 0.023656 * t + 0.0047036 * t**2)
    )


def vapour_mbar(kelvin, salinity):
    t = kelvin / 100
    return 1013.25 * np.exp(24.4543 - 67.4509 / t - 4.8489 * np.log(t) - 0.000544 * salinity)


def in_water(pco2, celsius, measured_celsius):
    """A partial pressure at another temperature than it was measured at."""
    return pco2 * np.exp(
        0.0423 * (celsius - measured_celsius) - 0.0000435 * (celsius**2 - measured_celsius**2)
    )


def flux(k_cm_h, water_g_m3, air_g_m3):
    """g C m-2 a day, positive out of the sea."""
    return k_cm_h * 24 / 100 * (water_g_m3 - air_g_m3)


def concentration(solubility, uatm):
    """g C m-3."""
    return solubility * CARBON_G_PER_MOL / 1000 * uatm


def takahashi09(data, month):
    """Flux and share of ice of a month."""
    name = calendar.month_abbr[month].lower()
    file = one((data / "takahashi09").glob(f"M2001*{name}*.nc"))
    kelvin = (grid(file, "SST_t") + 273.15).astype(np.float32)
    kelvin = np.where((kelvin >= 271.15) & (kelvin <= 313.15), kelvin, np.nan).astype(float)
    celsius = kelvin - 273.15
    wind, pressure = grid(file, "wind_t", 0, 100), grid(file, "pressure", 0, 1500)
    salinity, own = grid(file, "salinity", 0, 45), grid(file, "SST_t", -2, 40)
    air, water = grid(file, "vCO2_air", 0, 600), grid(file, "pCO2_sw", 0, 2000)
    air = air * (pressure - vapour_mbar(kelvin, salinity)) / 1013.25
    water = in_water(water, celsius, own)
    k = 0.26 * wind**2 * np.sqrt(660 / schmidt(celsius))
    soluble = solubility(kelvin, salinity)
    # In 32 bits, as FluxEngine keeps it, a tenth is more than a tenth.
    ice = (grid(file, "sea_ice_coverage") / 100).astype(np.float32).astype(float)
    return flux(k, concentration(soluble, water), concentration(soluble, air)), ice


def socatv4_inputs(data, month):
    """What the other run reads of a month, in SI units: a share of ppm and of ice as 1, pressures in Pa, temperatures in K."""
    stamp = f"2010{month:02}"
    wind_file = data / f"globwave/2010/{stamp}_OCF-WSP-GLO-1M-100-MGD-GW-v2.nc"
    name = calendar.month_abbr[month].lower()
    gas = data / f"SOCATv4/{stamp}01_OCF-CO2-GLO-1M-KRG-CLIM.nc"
    own = grid(gas, "Tcl_2010")
    pressure = grid(data / f"air_pressure/2010/{stamp}_OCF-PRE-GLO-1M-100-ECMWF.nc", "msl_mean")
    return {
        "temperature": grid(data / f"SST/2010/{stamp}01_OCF-SST-GLO-1M-100-ATS-ARC.nc", "sst_skin_mean", 271.35, 400),
        "wind": grid(wind_file, "wind_speed_cor_mean", 0, 100),
        "wind_moment2": grid(wind_file, "wind_speed_cor_moment_2"),
        "pressure": pressure,
        "salinity": grid(one((data / "takahashi09").glob(f"M2001*{name}*.nc")), "salinity", 15, 40),
        "dry_mole_fraction": grid(gas, "vCO2", 0, 600) * 1e-6,
        "pco2_water": grid(gas, "pCO2_2010_interpolated_pred", 0, 2000) * UATM_PA,
        "temperature_of_pco2": np.where((own - 273.15 >= -1.8) & (own - 273.15 <= 30.5), own, np.nan),
        "ice": grid(data / f"ice/2010/{stamp}01_OCF-ICE-GLO-1M-100-MGD-SSMI.nc", "sea_ice_fraction_mean"),
    }


def socatv4(data, month):
    """The same with a cool and salty skin."""
    of = socatv4_inputs(data, month)
    kelvin, salinity = of["temperature"], of["salinity"]
    below, skin_salinity = kelvin + 0.17, salinity + 0.1
    air = of["dry_mole_fraction"] * 1e6 * (of["pressure"] * 0.01 - vapour_mbar(kelvin, skin_salinity)) / 1013.25
    water = in_water(of["pco2_water"] / UATM_PA, below - 273.15, of["temperature_of_pco2"] - 273.15)
    k = (0.222 * of["wind_moment2"] + 0.333 * of["wind"]) * np.sqrt(600 / schmidt(kelvin - 273.15))
    water = concentration(solubility(below, salinity), water)
    air = concentration(solubility(kelvin, skin_salinity), air)
    return flux(k, water, air), of["ice"]


def open_water(ice):
    """Share of a cell's sea that is open."""
    return np.where(ice > 0.1, np.maximum(1 - ice, 0.1), 1.0)


def zones(element):
    """Area of the cells of every row, m2, north to south, by quadrature of a surface element a radian both ways."""
    edges = np.radians(np.arange(90.0, -91.0, -1.0))
    half, middle = (edges[:-1] - edges[1:]) / 2, (edges[:-1] + edges[1:]) / 2
    nodes, weights = np.polynomial.legendre.leggauss(16)
    areas = sum(weight * element(middle + half * node) for node, weight in zip(nodes, weights, strict=True)) * half
    return (np.radians(1) * areas)[:, np.newaxis]


def element_local_radius(lat):
    c, s = EQUATOR_M * np.cos(lat), POLE_M * np.sin(lat)
    squared = ((EQUATOR_M * c) ** 2 + (POLE_M * s) ** 2) / (c**2 + s**2)
    return squared * np.cos(lat)


def element_wgs84(lat):
    flattening = 1 / 298.257223563
    squared = flattening * (2 - flattening)
    w = 1 - squared * np.sin(lat) ** 2
    return EQUATOR_M**2 * (1 - squared) / w**2 * np.cos(lat)


def element_sphere(lat):
    return 6_371_000.0**2 * np.cos(lat)


def printed(file):
    """What the authors print: net and missing flux of every month and of the year, Tg."""
    with open(file) as text:
        rows = list(csv.DictReader(text))
    numbers = [(float(row["NET FLUX TgC"]), float(row["MISSING FLUX TgC"])) for row in rows]
    return numbers[:12], numbers[12]


def as_its_authors(months, sea):
    """Their net and missing flux of the year, Tg: gaps at the mean of all sea with a flux."""
    held = missing_m2 = held_m2 = 0.0
    for per_day, ice in months:
        weights = sea * open_water(ice) * zones(element_local_radius)
        is_held = np.isfinite(per_day)
        held += np.sum((per_day * weights)[is_held])
        held_m2 += np.sum(weights[is_held])
        missing_m2 += np.sum(weights[~is_held])
    missing = held / held_m2 * missing_m2
    return [(held + missing) * MONTH_DAYS / 1e12, missing * MONTH_DAYS / 1e12]


def write(file, year, variables):
    """Twelve months of variables as NetCDF-3, north up, -999 without a value: by name the unit, more attributes, the months."""
    with netCDF4.Dataset(file, "w", format="NETCDF3_CLASSIC") as data:
        for name, size in (("time", 12), ("latitude", 180), ("longitude", 360)):
            data.createDimension(name, size)
        axes = {"latitude": np.arange(89.5, -90, -1), "longitude": np.arange(-179.5, 180)}
        for (name, values), unit in zip(axes.items(), ("degrees_north", "degrees_east"), strict=True):
            data.createVariable(name, "f8", (name,))[:] = values
            data[name].units, data[name].standard_name = unit, name
        starts = [(date(year + month // 12, month % 12 + 1, 1) - date(1970, 1, 1)).days for month in range(13)]
        data.createDimension("two", 2)
        data.createVariable("time", "f8", ("time",))[:] = starts[:-1]
        data["time"].units, data["time"].standard_name = "days since 1970-01-01", "time"
        data["time"].bounds = "time_bnds"
        data.createVariable("time_bnds", "f8", ("time", "two"))[:] = np.column_stack([starts[:-1], starts[1:]])
        for name, (attributes, months) in variables.items():
            variable = data.createVariable(name, "f4", ("time", "latitude", "longitude"), fill_value=-999.0)
            variable.setncatts(attributes)
            for step, values in enumerate(months):
                variable[step] = np.where(np.isfinite(values), values, -999.0)


def through_sea(months):
    """The mean flux through a cell's sea, ice and all."""
    attributes = {
        "units": "g C m-2 d-1",
        "standard_name": "surface_upward_mass_flux_of_carbon_dioxide_expressed_as_carbon",
    }
    return {"flux": (attributes, [per_day * open_water(ice) for per_day, ice in months])}


def main():
    data, land, *folder = map(Path, sys.argv[1:])
    with netCDF4.Dataset(land) as file:
        sea = 1 - np.asarray(file["land_proportion"][0], float)
    elements = {"local-radius": element_local_radius, "wgs84": element_wgs84, "sphere": element_sphere}
    answer = {}
    for (run, (year, reference)), of_month in zip(RUNS.items(), (takahashi09, socatv4), strict=True):
        months = [of_month(data, month) for month in range(1, 13)]
        by_month, by_year = printed(data / "verification_reference_netflux" / reference)
        days = [calendar.monthrange(year, month)[1] for month in range(1, 13)]
        budgets = {}
        for earth, element in elements.items():
            areas = zones(element)
            for cells, share in (("ocean-share", sea), ("whole", np.ones_like(sea))):
                each = [np.nansum(per_day * open_water(ice) * share * areas) / 1e12 for per_day, ice in months]
                budgets[f"{earth} {cells}"] = [round(float(tg * n), 6) for tg, n in zip(each, days, strict=True)]
        net, missing = as_its_authors(months, sea)
        answer[run] = {
            "year": year,
            "printed_net_tg": by_year[0],
            "printed_missing_tg": by_year[1],
            "printed_months_tg": [[net, missing] for net, missing in by_month],
            "made_anew_net_tg": round(float(net), 4),
            "made_anew_missing_tg": round(float(missing), 4),
            "months_tg": budgets,
        }
        if folder:
            write(folder[0] / f"{run}.nc", year, through_sea(months))
    if folder:
        inputs = [socatv4_inputs(data, month) for month in range(1, 13)]
        variables = {name: ({}, [month[name] for month in inputs]) for name in inputs[0]}
        write(folder[0] / "fluxengine-socatv4-inputs.nc", 2010, variables)
    print(json.dumps(answer, indent=2))


if __name__ == "__main__":
    if len(sys.argv) not in (3, 4):
        sys.exit(__doc__)
    main()
