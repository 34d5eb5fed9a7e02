"""Allan deviation of records of a sensor at rest, and what the terms of its noise make of it (IEEE Std 952 Annex C).

A record is one channel's readings at even intervals, shape (n,), in the channel's unit (rad/s or m/s^2); the deviation
is in the same unit. B, K and N are the coefficients of the standard; N is 1/sqrt(2) of a datasheet's density, which
counts positive frequencies only.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .identification import RecordUnusableError

Array = NDArray[np.float64]
PER_DECADE = 6
"""Cluster times in a decade, unless asked for others."""

FEWEST_CLUSTERS = 5
"""Clusters that the longest cluster time leaves, unless asked for others: the deviation is known to a third."""

FLICKER_FLOOR = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""0.664: the Allan deviation of flicker noise over its coefficient B."""


class AllanDeviation(NamedTuple):
    """Cluster times (s), deviations at them, the limits of their confidence interval, and degrees of freedom."""

    tau: Array
    deviation: Array
    low: Array
    high: Array
    freedom: Array


def allan_deviation(
    record: ArrayLike, rate: float, taus: ArrayLike | None = None, confidence: float = 0.95
) -> AllanDeviation:
    """sigma^2(tau) = <(mean of the next tau - mean of the last tau)^2>/2, over all clusters of a record at `rate` (Hz).

    Cluster times (s) are rounded to whole samples. The interval is chi-squared with the degrees of freedom that the
    noise of the local slope has.
    """
    x = np.asarray(record, dtype=np.float64)
    if x.ndim != 1 or len(x) < 2 * FEWEST_CLUSTERS or not np.all(np.isfinite(x)):
        raise RecordUnusableError(
            f"a record of shape {x.shape}: wanted is one channel of {2 * FEWEST_CLUSTERS} finite samples or more"
        )
    if not (math.isfinite(rate) and rate > 0.0):
        raise RecordUnusableError(f"rate = {rate} Hz: wanted is a positive number")
    sizes = _cluster_sizes(len(x), rate, taus)
    integral = np.concatenate(([0.0], np.cumsum(x - np.mean(x))))
    variance = np.array([_cluster_variance(integral, int(m)) for m in sizes])
    tau = sizes / rate
    freedom = np.array(
        [
            degrees_of_freedom(len(integral), int(m), slope)
            for m, slope in zip(sizes, _slopes(tau, variance), strict=True)
        ]
    )
    return _with_interval(tau, variance, freedom, confidence)


def pooled(parts: Sequence[AllanDeviation], confidence: float = 0.95) -> AllanDeviation:
    """sigma^2 = sum nu_i sigma_i^2 / sum nu_i: one deviation of independent records with the same cluster times."""
    freedom = np.sum([part.freedom for part in parts], axis=0)
    variance = np.sum([part.freedom * part.deviation**2 for part in parts], axis=0) / freedom
    return _with_interval(parts[0].tau, variance, freedom, confidence)


def _cluster_sizes(count: int, rate: float, taus: ArrayLike | None) -> NDArray[np.int64]:
    if taus is not None:
        sizes = np.unique(np.round(np.atleast_1d(np.asarray(taus, dtype=np.float64)) * rate).astype(np.int64))
        if not len(sizes) or sizes[0] < 1 or 2 * sizes[-1] > count:
            raise RecordUnusableError(
                f"cluster times of {1.0 / rate:g} to {count / (2.0 * rate):g} s fit a record of {count / rate:g} s"
            )
        return sizes
    longest = count // FEWEST_CLUSTERS
    return np.unique(np.round(np.geomspace(1, longest, max(2, round(PER_DECADE * math.log10(longest))))).astype(int))


def _cluster_variance(integral: Array, size: int) -> float:
    change = integral[2 * size :] - integral[size:-size]
    change -= integral[size:-size]
    change += integral[: -2 * size]
    return float(change @ change) / (2.0 * size * size * len(change))


def _slopes(tau: Array, variance: Array) -> Array:
    """d ln(variance) / d ln(tau), -1 where there is one cluster time alone."""
    if len(tau) < 2:
        return np.full(len(tau), -1.0)
    slopes: Array = np.gradient(np.log(np.maximum(variance, 1e-300)), np.log(tau))
    return slopes


def degrees_of_freedom(points: int, size: int, slope: float) -> float:
    """Equivalent chi-squared degrees of freedom of an overlapping Allan variance (NIST SP 1065, table 5).

    `points` of the integral, clusters of `size` samples, noise by the slope of the variance over the cluster time:
    -2 quantisation, -1 white, 0 flicker, +1 random walk.
    """
    n, m = float(points), float(size)
    if slope < -1.5:
        freedom = (n + 1.0) * (n - 2.0 * m) / (2.0 * (n - m))
    elif slope < -0.5:
        freedom = (1.5 * (n - 1.0) / m - 2.0 * (n - 2.0) / n) * 4.0 * m * m / (4.0 * m * m + 5.0)
    elif slope < 0.5:
        few = size == 1
        freedom = 2.0 * (n - 2.0) ** 2 / (2.3 * n - 4.9) if few else 5.0 * n * n / (4.0 * m * (n + 3.0 * m))
    else:
        freedom = (n - 2.0) / m * ((n - 1.0) ** 2 - 3.0 * m * (n - 1.0) + 4.0 * m * m) / (n - 3.0) ** 2
    return max(freedom, 1.0)


def chi_squared_bounds(freedom: ArrayLike, confidence: float) -> tuple[Array, Array]:
    """nu (1 - 2/(9 nu) -+ z sqrt(2/(9 nu)))^3: where chi^2 of nu degrees of freedom lies (Wilson and Hilferty)."""
    nu = np.asarray(freedom, dtype=np.float64)
    z = NormalDist().inv_cdf(0.5 + 0.5 * confidence)
    middle, width = 1.0 - 2.0 / (9.0 * nu), z * np.sqrt(2.0 / (9.0 * nu))
    return nu * np.maximum(middle - width, 0.05) ** 3, nu * (middle + width) ** 3


def _with_interval(tau: Array, variance: Array, freedom: Array, confidence: float) -> AllanDeviation:
    least, most = chi_squared_bounds(freedom, confidence)
    low, high = np.sqrt(variance * freedom / most), np.sqrt(variance * freedom / least)
    return AllanDeviation(tau, np.sqrt(variance), low, high, freedom)


# --- theory ----------------------------------------------------------------------------------------------------------


def white_noise(tau: ArrayLike, density: float) -> Array:
    """sigma(tau) = N/sqrt(tau), N = D/sqrt(2): white noise of a one-sided density D (unit/Hz^0.5)."""
    return density / np.sqrt(2.0 * np.asarray(tau, dtype=np.float64))


def bias_instability(tau: ArrayLike, instability: float) -> Array:
    """sigma = sqrt(2 ln 2/pi) B = 0.664 B at every cluster time: flicker noise without end."""
    return np.full_like(np.asarray(tau, dtype=np.float64), FLICKER_FLOOR * instability)


def gauss_markov(tau: ArrayLike, sigma: float, time_constant: float) -> Array:
    """sigma^2(tau) = (2 sigma^2 T/tau)(1 - (T/2 tau)(3 - 4 exp(-tau/T) + exp(-2 tau/T))): correlated over T (s)."""
    x = np.asarray(tau, dtype=np.float64) / time_constant
    # 2x - 3 + 4 exp(-x) - exp(-2x) cancels to 2/3 x^3 (1 - 3x/4 + 7x^2/20)
    small = x < 1e-2
    safe = np.where(small, 1.0, x)
    full = (2.0 * safe - 3.0 + 4.0 * np.exp(-safe) - np.exp(-2.0 * safe)) / safe**2
    series = 2.0 / 3.0 * x * (1.0 - 0.75 * x + 0.35 * x * x)
    return sigma * np.sqrt(np.where(small, series, full))


def modelled_instability(tau: ArrayLike, instability: float, time_constants: Sequence[float], share: float) -> Array:
    """sigma^2(tau) = sum sigma_i^2(tau) of Gauss-Markov processes of standard deviation share * B each."""
    parts = [gauss_markov(tau, share * instability, constant) for constant in time_constants]
    return combined(*parts)


def rate_random_walk(tau: ArrayLike, walk: float) -> Array:
    """sigma(tau) = K sqrt(tau/3): a bias that walks by K sqrt(t) (unit/s^0.5)."""
    return walk * np.sqrt(np.asarray(tau, dtype=np.float64) / 3.0)


def quantisation(tau: ArrayLike, step: float) -> Array:
    """sigma(tau) = sqrt(3) Q/tau, Q = step/sqrt(12): an integral (angle, velocity) that is told in steps."""
    return step / (2.0 * np.asarray(tau, dtype=np.float64))


def rounding(tau: ArrayLike, resolution: float, period: float) -> Array:
    """sigma(tau) = (q/sqrt(12)) sqrt(T/tau): readings rounded to q, every T s, that noise moves over many q."""
    return resolution * np.sqrt(period / (12.0 * np.asarray(tau, dtype=np.float64)))


def combined(*terms: Array) -> Array:
    """sigma^2 = sum sigma_i^2 of independent terms."""
    total: Array = np.sqrt(np.sum([term**2 for term in terms], axis=0))
    return total
