"""Shocks to a bench: half-sine pulses of acceleration, given by the speed that they have handed over so far.

A tick shows the mean over the period before it, so that the speed handed over is exact for any length of the pulse.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Integer, Real, Vector3
from ..scalar import PI, Scalar, clip, floor, maximum, where
from ..vectors import ZERO3, scale
from .pulses import half_sine_share

_LEAST_PERIOD = 1e-9


class Shock(NamedTuple):
    """One pulse or several."""

    peak: Annotated[
        Vector3, Real("m/s2", "along the bench's right, forward and up axes; 0: none", -1e4, 1e4, nominal=10.0)
    ] = ZERO3
    start: Annotated[float, Real("s", "first pulse, after the start of the run", 0.0, 1e6)] = 10.0
    duration: Annotated[float, Real("s", "of one half sine", 1e-4, 10.0)] = 0.011  # as in IEC 60068-2-27's tables
    pulses: Annotated[int, Integer("how many", 1, 1_000_000)] = 1
    period: Annotated[float, Real("s", "from one pulse to the next", 0.0, 1e6)] = 1.0
    rebound: Annotated[
        float,
        Real("1", "share of the peak that a half sine the other way has at once; 1: gives the speed back", 0.0, 10.0),
    ] = 0.0


def pulse_length(shock: Shock) -> Scalar:
    """How long a pulse lasts with its rebound, s."""
    return where(shock.rebound > 0.0, 2.0, 1.0) * shock.duration


def speed_felt(shock: Shock, time: Scalar) -> Scalar:
    """Speed handed over by `time` (s), in that of a half sine: each pulse leaves 1 - rebound."""
    since = time - shock.start
    cycles = clip(floor(since / maximum(shock.period, _LEAST_PERIOD)), 0.0, shock.pulses - 1.0)
    inside = since - cycles * shock.period
    back = shock.rebound * half_sine_share(inside - shock.duration, shock.duration)
    return cycles * (1.0 - shock.rebound) + half_sine_share(inside, shock.duration) - back


def mean_acceleration(shock: Shock, felt_before: Scalar, felt: Scalar, period: Scalar) -> Vector3:
    """Mean over `period` (s), m/s^2: the area of a half sine is 2/pi of peak times duration."""
    return scale((felt - felt_before) * (2.0 / PI) * shock.duration / period, shock.peak)
