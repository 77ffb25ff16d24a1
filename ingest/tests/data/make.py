"""Makes the fixtures of this folder with the netCDF library (python netCDF4), so that reader and writer share no code.

Two hold the same: two months of sea-surface temperature on a 30-degree grid, packed in int16, south first, 0 to 360.
The third is compressed with szip.
"""
import netCDF4
import numpy as np

for name, model in [("packed-cdf5.nc", "NETCDF3_64BIT_DATA"), ("packed-netcdf4.nc", "NETCDF4")]:
    d = netCDF4.Dataset(name, "w", format=model)
    d.createDimension("time", None)
    d.createDimension("lat", 6)
    d.createDimension("lon", 12)
    lat = d.createVariable("lat", "f4", ("lat",))
    lat.units = "degrees_north"
    lat[:] = np.arange(-75, 76, 30)
    lon = d.createVariable("lon", "f4", ("lon",))
    lon.units = "degrees_east"
    lon[:] = np.arange(15, 360, 30)
    # The only record variable of the classic file: its records are 144 bytes, without padding.
    sst = d.createVariable("sst", "i2", ("time", "lat", "lon"), fill_value=np.int16(-32768))
    sst.standard_name = "sea_surface_temperature"
    sst.units = "degC"
    sst.scale_factor = np.float32(0.01)
    sst.add_offset = np.float32(20.0)
    sst.valid_min = np.int16(-2200)
    sst.valid_max = np.int16(2500)
    sst.set_auto_maskandscale(False)
    stored = np.arange(2 * 6 * 12).reshape(2, 6, 12) * 10 - 700
    stored[0, 0, 0] = -32768
    stored[1, 5, 11] = 3000  # past valid_max
    sst[:] = stored.astype("i2")
    d.time_coverage_start = "2003-05-01"
    if model == "NETCDF4":
        d.createDimension("nv", 2)
        time = d.createVariable("time", "f8", ("time",))
        time.units = "days since 2003-05-01"
        time.calendar = "noleap"
        time.bounds = "time_bnds"
        time[:] = [15, 45]
        bounds = d.createVariable("time_bnds", "f8", ("time", "nv"))
        bounds[:] = [[0, 31], [31, 61]]
    else:
        d.history = "no time variable: see the test"
    d.close()

d = netCDF4.Dataset("szip.nc", "w")
d.createDimension("lat", 4)
d.createDimension("lon", 8)
lat = d.createVariable("lat", "f4", ("lat",))
lat.units = "degrees_north"
lat[:] = [67.5, 22.5, -22.5, -67.5]
lon = d.createVariable("lon", "f4", ("lon",))
lon.units = "degrees_east"
lon[:] = np.arange(-157.5, 180, 45)
sst = d.createVariable("sst", "f4", ("lat", "lon"), compression="szip")
sst.units = "K"
sst.standard_name = "sea_surface_temperature"
sst[:] = 280
d.time_coverage_start = "2003-05-01"
d.time_coverage_end = "2003-05-31T23:59:59Z"
d.close()
