"""Sums of sines that repeat, and what a system makes of them.

    u[n] = a sum_k cos(2 pi k n/N + phi_k),   U(k) = 2/N sum_n u[n] exp(-2 pi i k n/N),   n = 0 .. N-1

Over whole periods the lines k are orthogonal: nothing leaks, no window is wanted. Sines on odd lines only leave the
even ones for what an even nonlinearity makes, and the odd lines left out for an odd one (R. Pintelon, J. Schoukens,
*System Identification: A Frequency Domain Approach*, 2nd ed., 2012, chapter 4).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Bins = NDArray[np.int64]
Complex = NDArray[np.complex128]

_ROUNDING = 1e-12
"""Of the largest value: a change that means nothing."""
_SURELY = 0.98
"""A share that noise hardly has, even at one line."""


def schroeder_phases(count: int) -> Array:
    """phi_k = -pi k^2/n (M. R. Schroeder 1970): a low peak for sines of equal size on neighbouring lines."""
    return np.asarray(-np.pi * np.arange(count) ** 2 / count)


def multisine(length: int, bins: Bins, phases: Array) -> Array:
    """One period (length,) of a sum of equal sines on these lines, its largest value 1."""
    turns = np.outer(np.arange(length), bins) / length
    wave = np.cos(2.0 * np.pi * turns + phases).sum(axis=1)
    return np.asarray(wave / np.max(np.abs(wave)))


def odd_bins(length: int, lowest: int, highest: int, count: int) -> Bins:
    """Up to `count` odd lines, spread by equal ratios, every one of them below length/2."""
    spread = np.geomspace(lowest, min(highest, (length - 1) // 2), count)
    bins = np.unique(2 * np.round((spread - 1.0) / 2.0).astype(np.int64) + 1)
    return np.asarray(bins[bins <= (length - 1) // 2])


def without_drift(periods: Array) -> Array:
    """Periods (P, N, ...) less the ramp that their means follow, which is exact where the rest repeats."""
    count, length = periods.shape[:2]
    if count < 2:
        return periods
    means = periods.mean(axis=1)
    slope = (means[-1] - means[0]) / ((count - 1) * length)
    time = np.arange(count * length, dtype=np.float64).reshape(count, length, *([1] * (periods.ndim - 2)))
    return np.asarray(periods - slope * time)


def lines(periods: Array) -> Complex:
    """Complex amplitudes (P, N//2 + 1, ...) of all lines of periods (P, N, ...)."""
    return np.asarray(np.fft.rfft(periods, axis=1) * (2.0 / periods.shape[1]))


class Measured(NamedTuple):
    """Responses (bins, outputs), variance of their mean, coherence; and the size of lines beside the sines.

    `even`, `odd` and `noise` (outputs,) are rms sizes of a line, relative to those of the sines: on even and on odd
    multiples of the sines' greatest common divisor, where no sine is, and of what changes from period to period.

    `change` (bins, outputs) is the rms change from the first period to the last over the response, and `change_share`
    half its square over the summed squares of all periods' deviations from their mean: `is_settling` judges by it
    whether it is noise. Both want three periods, and are NaN with fewer.
    """

    response: Complex
    variance: Array
    coherence: Array
    even: Array
    odd: Array
    noise: Array
    change: Array
    change_share: Array


def measured(given: Array, shown: Array, bins: Bins) -> Measured:
    """The response at the lines `bins` from periods given (R, P, N) and shown (R, P, N, outputs) in R realisations.

    The variance E|error|^2 of the complex response is that of the scatter of periods, or of realisations where that is
    larger; NaN with one period only. Coherence over all records is 1/(R P) on average where nothing follows the input;
    NaN with one record, whose line always follows. Nonlinearity repeats with the period: R > 1 lowers it.
    """
    realisations, periods = given.shape[:2]
    driven = np.stack([lines(record) for record in given])[:, :, bins, None]
    spectra = np.stack([lines(without_drift(record)) for record in shown])
    answer = spectra[:, :, bins]
    ratio = answer / driven
    means = ratio.mean(axis=1)
    response = means.mean(axis=0)
    within = _scatter(ratio, 1).mean(axis=0) / (realisations * periods)
    between = _scatter(means, 0) / realisations
    cross = np.abs((answer * driven.conj()).sum(axis=(0, 1))) ** 2
    power = (np.abs(answer) ** 2).sum(axis=(0, 1)) * (np.abs(driven) ** 2).sum(axis=(0, 1))
    coherence = np.divide(cross, power, out=np.zeros_like(cross), where=power > 0.0)
    if realisations * periods < 2:
        coherence[:] = math.nan
    rounding = _ROUNDING * np.max(np.abs(shown), axis=(0, 1, 2)) / np.min(np.abs(driven), axis=(0, 1))
    change, share = _change(ratio, rounding)
    size = np.abs(response)
    change = np.divide(change, size, out=np.zeros_like(change), where=size > 0.0)
    return Measured(response, np.fmax(within, between), coherence, *_beside(spectra, bins), change, share)


def _change(ratio: Complex, rounding: Array) -> tuple[Array, Array]:
    """rms |last - first|, zero where that is rounding, and its share, of ratios (R, P, bins, outputs)."""
    if ratio.shape[1] < 3:
        return np.full(ratio.shape[2:], math.nan), np.full(ratio.shape[2:], math.nan)
    change = (np.abs(ratio[:, -1] - ratio[:, 0]) ** 2).sum(axis=0)
    scatter = (np.abs(ratio - ratio.mean(axis=1, keepdims=True)) ** 2).sum(axis=(0, 1))
    share = np.divide(0.5 * change, scatter, out=np.zeros_like(change), where=scatter > 0.0)
    size = np.sqrt(change / len(ratio))
    return np.where(size > rounding, size, 0.0), share


def is_settling(change_share: Array, realisations: int, periods: int) -> bool:
    """Whether periods change in one direction rather than at random, from the shares at some lines.

    Of noise the mean share is 1/(P - 1), of lines that follow a Beta distribution with R and R (P - 2); this asks for
    three deviations more. Of a transient that dies slowly it is 6 (P - 1)/(P (P + 1)), that is 1 for three periods. One
    that changes its sign from period to period is like noise, and like noise the scatter, so the variance, has it.
    """
    mean = 1.0 / (periods - 1)
    deviation = mean * math.sqrt((periods - 2) / (realisations * (periods - 1) + 1) / change_share.size)
    return float(np.mean(change_share)) > min(mean + 3.0 * deviation, _SURELY)


def _scatter(values: Complex, axis: int) -> Array:
    """Sample variance, NaN where there is but one sample."""
    if values.shape[axis] < 2:
        return np.full(np.delete(values.shape, axis), math.nan)
    return np.asarray(values.var(axis=axis, ddof=1))


def _beside(spectra: Complex, bins: Bins) -> tuple[Array, Array, Array]:
    divisor = int(np.gcd.reduce(bins))
    places = np.arange(divisor, min(2 * int(bins[-1]), spectra.shape[2] - 1) + 1, divisor)
    rest = np.setdiff1d(places, bins)
    is_even = (rest // divisor) % 2 == 0
    means = spectra.mean(axis=1)
    signal = _rms(means[:, bins])
    noise = _scatter(spectra[:, :, bins], 1).mean(axis=(0, 1)) / spectra.shape[1]
    sizes = (_rms(means[:, rest[is_even]]), _rms(means[:, rest[~is_even]]), np.sqrt(noise))
    even, odd, noisy = (np.divide(size, signal, out=np.zeros_like(size), where=signal > 0.0) for size in sizes)
    return even, odd, noisy


def _rms(values: Complex) -> Array:
    """Of realisations and lines; zero where there are no lines."""
    if not values.shape[1]:
        return np.zeros(values.shape[2])
    return np.asarray(np.sqrt(np.mean(np.abs(values) ** 2, axis=(0, 1))))
