"""What the datasheets say of the parts' digital filters, setting by setting."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .bench import Array
from .characteristics import Part, Sensor

ADXL355_DECIBELS = (-3.63, -2.26, -1.93, *([-1.83] * 8))
"""Gain at a quarter of the output data rate, full path, 4000 Hz first (ADXL355 Rev. D p. 26)."""

ADXL355_DELAYS = (0.63, 1.00, 1.78, 3.26, 6.27, 12.34, 24.18, 47.59, 96.25, 189.58, 384.31)
"""ms, by output data rate, 4000 Hz first (ADXL355 Rev. D p. 26)."""

HALF_POWER = -10.0 * math.log10(2.0)
"""dB at the -3 dB frequency."""

_ADIS16354_RATE = 819.2
_ADIS16354_BANDWIDTH = 350.0


class FilterClaim(NamedTuple):
    """Gain `decibels` at `frequency` (Hz), `delay` (s) with its limits, noise bandwidth (Hz); where it is said.

    `frequency` is NaN where it lies beyond half the `word_rate` (Hz). White noise has
    `density_gain` times the part's density in the words.
    """

    frequency: float
    decibels: float
    delay: float
    delay_limits: tuple[float, float] | None
    noise_bandwidth: float
    word_rate: float
    density_gain: float
    source: str
    confidence: str

    @property
    def reference(self) -> float:
        """About the -3 dB frequency (Hz), to measure a response by."""
        return self.frequency if math.isfinite(self.frequency) else 0.25 * self.word_rate


def filter_claim(sensor: Sensor, part: Part, clock: float = 1.0) -> FilterClaim:
    """What is said of the filter as it is set, at a clock that goes so fast, 1 being nominal."""
    kind = sensor.item(f"{part}.filter")
    if kind == "cic":
        return _cic(clock)
    if kind == "decimator":
        return _decimator(round(sensor.number(f"{part}.output_data_rate")) - 1, clock)
    return _bartlett(int(kind.removeprefix("bartlett_")), sensor.number(f"{part}.divider"), clock)


def _cic(clock: float) -> FilterClaim:
    """[(1 - z^-64)/(64 (1 - z^-1))]^2 at 16 kHz: -3 dB at 79.7 Hz, which Table 1 rounds to f0/200."""
    source = "ADXRS450 Rev. 0 p. 11, transfer function; Table 1: 80 Hz, 4 ms"
    limits = (3.25e-3, 4.75e-3)
    return FilterClaim(
        79.7 * clock, HALF_POWER, 4e-3 / clock, limits, 83.3 * clock, 500.0 * clock, 1.0, source, "datasheet"
    )


def _decimator(code: int, clock: float) -> FilterClaim:
    """sinc^2 decimation by R = 2^code behind the first stage; noise bandwidth (2 R^2 + 1)/(6 R^2) of the rate."""
    ratio = 2.0**code
    rate = 4000.0 / ratio * clock
    bandwidth = rate * (2.0 * ratio**2 + 1.0) / (6.0 * ratio**2)
    delay = 1e-3 * ADXL355_DELAYS[code] / clock
    source = "ADXL355 Rev. D p. 26, table"
    return FilterClaim(0.25 * rate, ADXL355_DECIBELS[code], delay, None, bandwidth, rate, 1.0, source, "datasheet")


def bartlett_gain(taps: int, frequency: Array) -> Array:
    """(sin(pi N f)/(N sin(pi f)))^2 of a Bartlett window, f in parts of the sampling rate."""
    gain: Array = (np.sin(np.pi * taps * frequency) / (taps * np.sin(np.pi * frequency))) ** 2
    return gain


def _bartlett(taps: int, divider: float, clock: float) -> FilterClaim:
    """(sin(pi N f t)/(N sin(pi f t)))^2 / sqrt(1 + (f/350 Hz)^2); the window delays by (N - 1) t, the pole by 0.45 ms.

    White noise of the full conversion rate keeps sqrt((2 N^2 + 1)/(3 N^3)) of its rms. With a divider the window takes
    every so many conversions: the rms is the same, in a narrower band, so that the density grows by sqrt(divider). The
    pole is analogue, the clock does not move it.
    """
    rate = _ADIS16354_RATE / divider * clock
    frequency = np.linspace(1e-4, 0.5, 200_000) * rate
    pole = 1.0 + (frequency / _ADIS16354_BANDWIDTH) ** 2
    decibels = 20.0 * np.log10(np.maximum(bartlett_gain(taps, frequency / rate), 1e-9)) - 10.0 * np.log10(pole)
    below = np.flatnonzero(decibels <= HALF_POWER)
    cutoff = float(frequency[below[0]]) if len(below) else math.nan
    delay = (taps - 1) / rate + 1.0 / (2.0 * math.pi * _ADIS16354_BANDWIDTH)
    noise = 0.5 * rate * divider * (2.0 * taps**2 + 1.0) / (3.0 * taps**3)
    source = "ADIS16350/55 Rev. B p. 19, formula and 350 Hz pole"
    return FilterClaim(cutoff, HALF_POWER, delay, None, noise, rate, math.sqrt(divider), source, "sister")
