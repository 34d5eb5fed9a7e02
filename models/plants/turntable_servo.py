"""The servo of a table's axis: theta'' + 2 zeta w theta' + w^2 theta = w^2 r, r a parabola from tick to tick.

Long after, theta = r - (2 zeta/w) r' + ((4 zeta^2 - 1)/w^2) r''; what is left of the deviation from it decays. Exact at
any period, so that the rate and the acceleration are the derivatives of the angle.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real
from ..scalar import Scalar, absolute, maximum, where
from .second_order import Transition, natural_frequency, transition
from .turntable_reference import Reference

_STILL = 1e-15
"""Part of the reference (at least of 1 rad) below which a deviation is rounding: the axis is then in its place."""


class AxisMotion(NamedTuple):
    """How an axis turns."""

    angle: Annotated[float, Real("rad", "angle, as the encoder tells it")]
    rate: Annotated[float, Real("rad/s", "rate")]
    acceleration: Annotated[float, Real("rad/s2", "acceleration")]


class Servo(NamedTuple):
    """The constants of the equation above."""

    frequency: Annotated[float, Real("rad/s", "natural frequency w")]
    lag: Annotated[float, Real("s", "2 zeta/w, by which a ramp is followed late")]
    lead: Annotated[float, Real("s2", "(4 zeta^2 - 1)/w^2, of an acceleration")]
    transition: Transition


def servo(bandwidth: Scalar, damping_ratio: Scalar, period: Scalar) -> Servo:
    """The servo whose gain is 3 dB down at `bandwidth` (Hz), for ticks of `period` (s)."""
    w = natural_frequency(bandwidth, damping_ratio)
    lead = (4.0 * damping_ratio * damping_ratio - 1.0) / (w * w)
    return Servo(w, 2.0 * damping_ratio / w, lead, transition(w, damping_ratio, period))


def followed(constants: Servo, now: AxisMotion, before: Reference, after: Scalar, period: Scalar) -> AxisMotion:
    """One period in which the reference goes from `before` to the angle `after` (rad)."""
    w, lag, lead, phi = constants
    gained = 2.0 * ((after - before.angle) / period - before.rate) / period
    end_rate = before.rate + gained * period
    off = now.angle - before.angle + lag * before.rate - lead * gained
    slip = (now.rate - before.rate + lag * gained) / w
    still = absolute(off) + absolute(slip) < _STILL * maximum(absolute(after), 1.0)
    behind = where(still, 0.0, phi.a * off + phi.b * slip) - lag * end_rate + lead * gained
    rate = where(still, 0.0, phi.c * off + phi.d * slip) * w + end_rate - lag * gained
    return AxisMotion(after + behind, rate, -w * w * (behind + lag * rate))
