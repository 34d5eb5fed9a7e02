"""Vibration of a bench: an oscillator pushed by white noise that is held from tick to tick.

    x'' + 2 zeta w x' + w^2 x = w^2 u,   u ~ N(0, s^2) anew at every tick

Between ticks the solution is exact, so that rate and acceleration are derivatives of x; s is such that x has rms 1 at
ticks of any period. One-sided spectrum of x for f well below the tick rate: (4 zeta / (pi f0)) / ((1 - r^2)^2 +
(2 zeta r)^2) with r = f/f0: flat up to the frequency for zeta 0.7, a peak there for small zeta. A frequency far above
the tick rate gives white ticks.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real, Vector3
from ..scalar import PI, Scalar, maximum, sqrt, where
from ..vectors import ZERO3
from .second_order import Transition, transition

_LEAST_SQUARE = 1e-30
"""Of the rate's own share at the start; keeps the root's slope finite where ticks are white."""


class Tilt(NamedTuple):
    """Small turns of the bench about the point where the axes meet."""

    rms: Annotated[
        Vector3, Real("rad", "about the bench's right, forward and up axes; 0: none", 0.0, 0.2, nominal=1e-5)
    ] = ZERO3
    frequency: Annotated[float, Real("Hz", "end of the flat band, or the resonance", 0.1, 1e4, None, 10.0)] = 10.0
    damping_ratio: Annotated[float, Real("1", "0.7: flat band; small: a resonance", 0.005, 1.0)] = 0.1  # assumption


class Shaking(NamedTuple):
    """Accelerations of the bench along straight lines."""

    rms: Annotated[
        Vector3, Real("m/s2", "along the bench's right, forward and up axes; 0: none", 0.0, 1e3, nominal=0.1)
    ] = ZERO3
    frequency: Annotated[float, Real("Hz", "end of the flat band, or the resonance", 0.1, 1e4, None, 10.0)] = 100.0
    damping_ratio: Annotated[float, Real("1", "0.7: flat band; small: a resonance", 0.005, 1.0)] = 0.7  # assumption


class Oscillation(NamedTuple):
    """One axis of the noise, of rms 1."""

    value: Annotated[float, Real("1", "value")] = 0.0
    rate: Annotated[float, Real("1/s", "its derivative")] = 0.0
    acceleration: Annotated[float, Real("1/s2", "its second derivative, at the end of the last period")] = 0.0


Oscillations = tuple[Oscillation, Oscillation, Oscillation]
QUIET = (Oscillation(), Oscillation(), Oscillation())


class Oscillator(NamedTuple):
    """The discrete process, its rate in units of w."""

    frequency: Annotated[float, Real("rad/s", "w")]
    damping_ratio: Annotated[float, Real("1", "zeta")]
    transition: Transition
    push: Annotated[float, Real("1", "rms of the pushes")]
    start: Annotated[Vector3, Real("1", "lower triangle of the stationary covariance's root: 11, 21, 22")]


def oscillator(frequency: Scalar, damping_ratio: Scalar, period: Scalar) -> Oscillator:
    """The process whose value has rms 1.

    Variances of the two ARMA(2, 1) processes that value and scaled rate are, of trace t and determinant D of Phi.
    """
    w = 2.0 * PI * frequency
    phi = transition(w, damping_ratio, period)
    a, b, c, d = phi
    trace, determinant = a + d, a * d - b * c
    left, right = 1.0 + determinant - trace, 1.0 + determinant + trace
    now, before = 1.0 - a, determinant - d
    squares = (now * now + before * before) * (1.0 + determinant) + 2.0 * now * before * trace
    value = squares / ((1.0 - determinant) * left * right)
    rate = 2.0 * c * c / ((1.0 - determinant) * right)
    both = (a * c * value + b * d * rate - c * now) / (1.0 - determinant - 2.0 * b * c)
    push = 1.0 / sqrt(value)
    shared = both / value
    alone = sqrt(maximum(rate / value - shared * shared, _LEAST_SQUARE))
    return Oscillator(w, damping_ratio, phi, push, (1.0, shared, alone))


def oscillated(c: Oscillator, now: Oscillation, is_first: Scalar, pair: tuple[Scalar, Scalar]) -> Oscillation:
    """The next tick from two standard normals; the first one draws the stationary distribution."""
    first, second = pair
    w, damping_ratio, phi, push, (n11, n21, n22) = c
    value = where(is_first, n11 * first, now.value)
    rate = where(is_first, n21 * first + n22 * second, now.rate / w)
    pushed = push * where(is_first, 0.0, first)
    off = value - pushed
    moved = where(is_first, off, phi.a * off + phi.b * rate)
    slipped = where(is_first, rate, phi.c * off + phi.d * rate)
    return Oscillation(pushed + moved, w * slipped, -w * w * (moved + 2.0 * damping_ratio * slipped))


def oscillated_axes(c: Oscillator, now: Oscillations, is_first: Scalar, normals: tuple[Scalar, ...]) -> Oscillations:
    """The next tick of three independent axes, from six standard normals."""
    x, y, z = now
    return (
        oscillated(c, x, is_first, (normals[0], normals[1])),
        oscillated(c, y, is_first, (normals[2], normals[3])),
        oscillated(c, z, is_first, (normals[4], normals[5])),
    )
