"""The motion that a table's controller asks an axis for: time-optimal under limits of rate and acceleration.

Every tick goes one period along the fastest way from the reference's angle and rate of now, so that a target may change
at any time. The switchings lie where they must, between ticks; the end is reached exactly, without overshoot.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real
from ..scalar import Scalar, absolute, maximum, minimum, sqrt, where

_LEAST_PEAK = 1e-12
"""rad/s; keeps the division by the cruising rate defined at the target."""

_LATE = 1.0 + 1e-6
"""A way that ends this much of a period after a tick ends on it: roundings would else cost a tick."""


class Reference(NamedTuple):
    """Where the controller wants an axis now."""

    angle: Annotated[float, Real("rad", "wanted angle")]
    rate: Annotated[float, Real("rad/s", "wanted rate")]


def toward_angle(now: Reference, target: Scalar, fastest: Scalar, acceleration: Scalar, period: Scalar) -> Reference:
    """One period of the fastest way to rest at `target` (rad).

    Counted along the way: from v to the peak sqrt(a d + v^2/2), `fastest` at most, cruise, and down to rest.
    """
    distance = target - now.angle
    stopping = 0.5 * now.rate * absolute(now.rate) / acceleration
    way = where(distance >= stopping, 1.0, -1.0)
    left, rate = way * distance, way * now.rate
    peak = minimum(sqrt(maximum(acceleration * left + 0.5 * rate * rate, 0.0)), fastest)
    to_peak, to_rest = absolute(peak - rate) / acceleration, peak / acceleration
    travelled = 0.5 * ((rate + peak) * to_peak + peak * to_rest)
    cruise = maximum(left - travelled, 0.0) / maximum(peak, _LEAST_PEAK)
    first = minimum(to_peak, period)
    second = minimum(cruise, period - first)
    third = period - first - second
    gained = where(peak >= rate, acceleration, -acceleration)
    moved = (rate + 0.5 * gained * first) * first + peak * second + (peak - 0.5 * acceleration * third) * third
    arrived = to_peak + cruise + to_rest <= _LATE * period
    return Reference(
        where(arrived, target, now.angle + way * moved),
        where(arrived, 0.0, way * (rate + gained * first - acceleration * third)),
    )


def toward_rate(now: Reference, target: Scalar, acceleration: Scalar, period: Scalar) -> Reference:
    """One period of the fastest way to the rate `target` (rad/s), and on at it."""
    missing = target - now.rate
    first = minimum(absolute(missing) / acceleration, period)
    gained = where(missing >= 0.0, acceleration, -acceleration)
    at_end = where(absolute(missing) <= acceleration * period, target, now.rate + gained * period)
    moved = (now.rate + 0.5 * gained * first) * first + target * (period - first)
    return Reference(now.angle + moved, at_end)
