#!/usr/bin/env python3
"""Statistics of short series by scipy, pymannkendall and numpy, and nothing of Fluxglobe.

    series_statistics.py

Prints what the tests of compute/src/analysis hold their numbers against; the series stand in both. Run with
scipy 1.18, pymannkendall 1.4 and numpy 2.5.
"""

import numpy as np
import pymannkendall
from scipy import stats

# A series that goes together with its next values and rises; two values are equal.
SERIES = np.array(
    [2.1, 2.6, 2.3, 1.7, 1.9, 2.8, 3.4, 3.1, 2.7, 2.2, 2.9, 3.6, 4.2, 3.9, 3.3, 2.8, 3.1, 3.8, 4.4, 4.9,
     4.1, 3.5, 3.8, 4.6, 5.2, 4.7, 4.3, 3.7, 4.4, 5.1]
)  # fmt: skip
OTHER = np.array(
    [0.4, 0.9, 1.8, 1.1, 0.2, 0.7, 1.9, 2.2, 1.4, 0.8, 0.3, 1.2, 2.4, 2.9, 1.8, 1.1, 0.9, 1.3, 2.2, 3.1,
     2.8, 1.6, 1.2, 1.9, 2.7, 3.3, 2.5, 1.4, 1.7, 2.6]
)  # fmt: skip
# A series that wanders: each value keeps most of the one before.
SLOW = np.array(
    [0.1, 0.5, 0.9, 1.4, 1.2, 1.5, 1.1, 0.8, 0.9, 0.4, 0.1, -0.4, -0.7, -0.5, -0.9, -0.6, -0.2, 0.3, 0.7, 1.1,
     1.6, 1.9, 1.7, 2.1, 1.8, 2.3, 2.2, 1.9, 2.4, 2.6]
)  # fmt: skip
A = np.array([1.0, 3.0, 0.5, 2.5, 1.5, 3.5, 0.0, 4.0])
B = np.array([2.0, 5.0, 3.0, 6.0, 2.5, 4.5])
SORTED = np.array([-2.5, -1.0, 0.0, 0.25, 4.0, 9.0, 11.5])


def acf(values, lag):
    z = values - values.mean()
    return float((z[: len(z) - lag] * z[lag:]).sum() / (z * z).sum())


def corrected(values, slope):
    """What the variance of Mann and Kendall's score is multiplied with (Hamed and Rao 1998, equation 16), z and p where that is more."""
    n = len(values)
    left = stats.rankdata(values - slope * np.arange(n))
    r = acf(left, 1)
    lags = np.arange(1, n)
    weights = (n - lags) * (n - lags - 1) * (n - lags - 2)
    correction = 1 + 2 / (n * (n - 1) * (n - 2)) * (weights * r**lags).sum() if abs(r) > stats.norm.ppf(0.975) / np.sqrt(n) else 1.0
    found = pymannkendall.original_test(values)
    z = (found.s - np.sign(found.s)) / np.sqrt(found.var_s * max(correction, 1))
    return r, correction, z, 2 * stats.norm.sf(abs(z))


def least_squares(x, y):
    fit = stats.linregress(x, y)
    left = y - fit.intercept - fit.slope * x
    r = acf(left, 1)
    n = len(y) * (1 - r) / (1 + r)
    error = np.sqrt((left**2).sum() / (n - 2) / ((x - x.mean()) ** 2).sum())
    reach = stats.t.ppf(0.975, n - 2) * error
    p = 2 * stats.t.sf(abs(fit.slope / error), n - 2)
    return fit.slope, error, fit.slope - reach, fit.slope + reach, p, r, n


def waves():
    """Months of 2001 to 2004: a line, two waves of known size, and noise that repeats; means over each month."""
    day = np.datetime64("2001-01") + np.arange(49)
    edges = (day.astype("datetime64[ms]").astype(np.int64) - 946_684_800_000) / (365.25 * 86_400_000.0)
    noise = np.array([0.3, -0.2, 0.1, -0.4, 0.25, -0.05, 0.0])
    columns = [np.ones(48), 0.5 * (edges[1:] + edges[:-1]) - 0.5 * (edges[0] + edges[-1])]
    for times in (1, 2):
        w = 2 * np.pi * times
        columns.append((np.sin(w * edges[1:]) - np.sin(w * edges[:-1])) / (w * np.diff(edges)))
        columns.append((np.cos(w * edges[:-1]) - np.cos(w * edges[1:])) / (w * np.diff(edges)))
    columns = np.array(columns).T
    values = columns @ [10.0, 0.2, 3.0, 4.0, -0.5, 1.2] + noise[np.arange(48) % 7]
    values[[5, 6, 20]] = np.nan
    here = ~np.isnan(values)
    factors, *_ = np.linalg.lstsq(columns[here], values[here], rcond=None)
    left = values[here] - columns[here] @ factors
    line, *_ = np.linalg.lstsq(columns[here, :2], values[here], rcond=None)
    without = values[here] - columns[here, :2] @ line
    explained = 100 * (1 - (left**2).sum() / (without**2).sum())
    for i, times in ((2, 1), (4, 2)):
        turns = np.arctan2(factors[i + 1], factors[i]) % (2 * np.pi) / (2 * np.pi)
        print("wave", times, np.hypot(factors[i], factors[i + 1]), turns * 365.25 / times)
    print("season", factors[0], explained, left.std(ddof=1))


def lagged(first, second, lag):
    a, b = (first[: len(first) - lag], second[lag:]) if lag >= 0 else (first[-lag:], second[:lag])
    r = np.corrcoef(a, b)[0, 1]
    together = max(acf(first, 1) * acf(second, 1), 0)
    n = len(a) * (1 - together) / (1 + together)
    p = 2 * stats.t.sf(abs(r) * np.sqrt((n - 2) / (1 - r * r)), n - 2)
    return len(a), r, n, p


def without(values, gaps):
    values = values.copy()
    values[gaps] = np.nan
    return values


def less_their_months(values):
    """Months from January on."""
    values = values.copy()
    for month in range(12):
        values[month::12] -= np.nanmean(values[month::12])
    return values


def next_step(values):
    """Autocorrelation at lag 1: the mean product over the pairs there are stands for all."""
    z = values - np.nanmean(values)
    return np.nanmean(z[1:] * z[:-1]) * (len(z) - 1) / len(z) / np.nanmean(z * z)


def lagged_with_gaps(first, second, lag):
    together = max(next_step(first) * next_step(second), 0)
    a, b = (first[: len(first) - lag], second[lag:]) if lag >= 0 else (first[-lag:], second[:lag])
    here = ~np.isnan(a) & ~np.isnan(b)
    found = stats.pearsonr(a[here], b[here])
    n = here.sum() * (1 - together) / (1 + together)
    r = found.statistic
    p = 2 * stats.t.sf(abs(r) * np.sqrt((n - 2) / (1 - r * r)), n - 2)
    return here.sum(), r, n, p


x = np.arange(len(SERIES), dtype=float)
print("normal", 2 * stats.norm.sf(1.0), 2 * stats.norm.sf(3.5), stats.norm.ppf(0.975))
print("student", 2 * stats.t.sf(2.0, 10), 2 * stats.t.sf(4.2, 3.7), stats.t.ppf(0.975, 10), stats.t.ppf(0.975, 3.7))
print("least squares", *least_squares(x, SERIES))
found = stats.theilslopes(SERIES, x)
print("theil-sen", found.slope, found.low_slope, found.high_slope)
gaps = np.delete(np.arange(len(SERIES)), [3, 4, 17])
found = stats.theilslopes(SERIES[gaps], x[gaps])
print("theil-sen with gaps", found.slope, found.low_slope, found.high_slope)
found = pymannkendall.original_test(SERIES)
print("mann-kendall", found.s, found.Tau, found.var_s, found.z, found.p)
for name, series in ("series", SERIES), ("slow", SLOW):
    # What values keep from step to step, and its powers, in the place of what is found at each lag.
    found = pymannkendall.hamed_rao_modification_test(series)
    print("hamed-rao", name, found.s, found.var_s, found.z, found.p, found.slope)
    print("corrected", name, *corrected(series, round(found.slope, 12)))
waves()
for lag in (-3, 0, 1, 2):
    print("lag", lag, *lagged(SERIES, OTHER, lag))
first, second = without(SERIES, [3, 4, 17]), without(OTHER, [0, 9, 17, 28])
for lag in (-1, 0, 2):
    print("gaps, lag", lag, *lagged_with_gaps(first, second, lag))
    print("seasons off, lag", lag, *lagged_with_gaps(less_their_months(first), less_their_months(second), lag))
test = stats.ttest_ind(A, B, equal_var=False)
print("welch", np.sqrt(A.var(ddof=1) / len(A) + B.var(ddof=1) / len(B)), test.pvalue)
print("percentiles", *np.percentile(SORTED, [0, 5, 50, 90, 99, 100]))
print("spread", SERIES.mean(), SERIES.std(ddof=1))
