"""Noise models from records of a sensor at rest: AR(1) fit, power spectrum, cross-correlation (the 2010 paper's steps).

A record is one channel's readings at even intervals, shape (n,), in the channel's unit. Its mean is taken off; a drift
is not: take it off before.
"""

from __future__ import annotations

import math
from statistics import NormalDist
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from attitude_fmu.models.errors import AttitudeFmuError

Array = NDArray[np.float64]
SEGMENTS = 16
"""Half-overlapping segments that a spectrum averages over unless told otherwise: it scatters by 26 % or so."""


class RecordUnusableError(AttitudeFmuError, ValueError):
    """A record, or a question about it, that has no answer: too short, not finite, without any variation."""


class Ar1Fit(NamedTuple):
    """n_k = a n_(k-1) + e_k, var e = E: `coefficient` a, `driving_variance` E, each with its standard error.

    They are `coefficient` and `driving_variance` of the sensor's AR(1)-Kalman filter, at the rate of the record.
    """

    coefficient: float
    driving_variance: float
    coefficient_error: float
    driving_variance_error: float


class Spectrum(NamedTuple):
    """One-sided power spectral density: frequencies (Hz) and density (unit^2/Hz), both of shape (m,)."""

    frequency: Array
    density: Array


class Correlation(NamedTuple):
    """Correlation r(l) of a(k) with b(k + l), -1 to 1: lags l in samples, values, and the bound of no correlation."""

    lags: NDArray[np.int64]
    values: Array
    bound: float


def _fluctuation(record: ArrayLike, fewest: int = 3) -> Array:
    x = np.asarray(record, dtype=np.float64)
    if x.ndim != 1 or len(x) < fewest:
        raise RecordUnusableError(f"a record of shape {x.shape}: wanted is one channel of {fewest} samples or more")
    if not np.all(np.isfinite(x)):
        raise RecordUnusableError("a record with samples that are no finite numbers")
    if np.ptp(x) == 0.0:
        raise RecordUnusableError("a record that never changes has no noise to model")
    return x - np.mean(x)


def fit_ar1(record: ArrayLike) -> Ar1Fit:
    """a = sum x_k x_(k-1) / sum x_(k-1)^2,  E = sum (x_k - a x_(k-1))^2 / (n - 3): least squares on the record (n,).

    Standard errors sqrt(E / sum x_(k-1)^2) of a and E sqrt(2/n) of E, for Gaussian noise. The estimate of a is low by
    (1 + 3a)/n, far inside them.
    """
    x = _fluctuation(record, fewest=10)
    before, now = x[:-1], x[1:]
    power = float(before @ before)
    coefficient = float(before @ now) / power
    fresh = now - coefficient * before
    driving = float(fresh @ fresh) / (len(x) - 3)  # the coefficient and the mean are fitted
    return Ar1Fit(coefficient, driving, math.sqrt(driving / power), driving * math.sqrt(2.0 / len(x)))


def ar1_density(fit: Ar1Fit, frequency: ArrayLike, rate: float) -> Array:
    """2 E / (rate |1 - a exp(-2 pi i f/rate)|^2): the one-sided density (unit^2/Hz) of a fit, to lay on a spectrum."""
    turn = np.exp(-2j * np.pi * np.asarray(frequency, dtype=np.float64) / rate)
    density: Array = 2.0 * fit.driving_variance / (rate * np.abs(1.0 - fit.coefficient * turn) ** 2)
    return density


def power_spectrum(record: ArrayLike, rate: float, segments: int = SEGMENTS) -> Spectrum:
    """S(f) = 2/(rate sum w^2) <|FFT(w x)|^2>: Welch's one-sided density of a record (n,) taken at `rate` (Hz).

    Averaged over `segments` Hann-windowed segments that overlap by half; more of them scatter less and resolve less.
    Summed times the frequency step it is the record's variance, but for what the windows leave out.
    """
    if not (math.isfinite(rate) and rate > 0.0):
        raise RecordUnusableError(f"rate = {rate} Hz: wanted is a positive number")
    x = _fluctuation(record, fewest=4)
    if segments < 1 or len(x) < 4 * (segments + 1):
        raise RecordUnusableError(f"segments = {segments}: wanted are 1 to {len(x) // 4 - 1} for {len(x)} samples")
    length = len(x) if segments == 1 else 2 * len(x) // (segments + 1)
    window = np.sin(np.pi * np.arange(length) / length) ** 2
    pieces = np.lib.stride_tricks.sliding_window_view(x, length)[:: max(length // 2, 1)][:segments]
    lines = np.fft.rfft(window * pieces, axis=1)
    power: Array = np.mean(np.abs(lines) ** 2, axis=0) / (rate * (window @ window))
    power[1 : (length + 1) // 2] *= 2.0  # negative frequencies; zero and the highest of an even length have no twin
    return Spectrum(np.asarray(np.fft.rfftfreq(length, 1.0 / rate), dtype=np.float64), power)


def cross_correlation(a: ArrayLike, b: ArrayLike, most_lag: int, confidence: float = 0.95) -> Correlation:
    """r(l) = sum a_k b_(k+l) / sqrt(sum a^2 sum b^2), |l| <= most_lag, of records a and b (n,), their means taken off.

    `bound`: a single value of two independent records, one of them white, lies within it with this confidence; it is
    z/sqrt(n). Of many lags some lie beyond. For a record with itself (r(0) = 1) it tells whiteness.
    """
    x, y = _fluctuation(a), _fluctuation(b)
    if len(x) != len(y):
        raise RecordUnusableError(f"records of {len(x)} and {len(y)} samples: wanted are equally many")
    if not 0 <= most_lag < len(x):
        raise RecordUnusableError(f"most_lag = {most_lag}: wanted are 0 to {len(x) - 1} for {len(x)} samples")
    if not 0.0 < confidence < 1.0:
        raise RecordUnusableError(f"confidence = {confidence}: wanted is a probability between 0 and 1")
    size = 2 ** math.ceil(math.log2(len(x) + most_lag + 1))
    products = np.fft.irfft(np.conj(np.fft.rfft(x, size)) * np.fft.rfft(y, size), size)
    lags = np.arange(-most_lag, most_lag + 1)
    values = products[lags] / math.sqrt(float(x @ x) * float(y @ y))
    return Correlation(lags, values, NormalDist().inv_cdf(0.5 + 0.5 * confidence) / math.sqrt(len(x)))
