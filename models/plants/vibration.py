"""Vibration of a bench: an oscillator pushed by white noise that is held from tick to tick.

    x'' + 2 zeta w x' + w^2 x = w^2 u,   u ~ N(0, s^2) anew at every tick

Between ticks the solution is exact, so that rate and acceleration are derivatives of x; s is such that x has rms 1 at
ticks of any period. One-sided spectrum of x for f well below the tick rate: (4 zeta / (pi f0)) / ((1 - r^2)^2 +
(2 zeta r)^2) with r = f/f0: flat up to the frequency for zeta 0.7, a peak there for small zeta. A frequency far above
the tick rate gives white ticks.

A bench that stays in its place cannot be shaken so down to 0 Hz: it would walk away. Held by a spring and a damper, and
pushed by a force that would give it the acceleration x if it were free, it feels

    d'' = x - 2 zeta w d' - w^2 d,   w = 2 pi lower_frequency,   zeta = 1/sqrt(2),   d = d' = 0 at the start

which fades with the square of the frequency below w.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real, Vector3
from ..scalar import PI, Scalar, maximum, sqrt, where
from ..vectors import ZERO3
from .second_order import Transition, transition

_LEAST_SQUARE = 1e-30
"""Of the rate's own share at the start; keeps the root's slope finite where ticks are white."""

_LEAST_TURN = 1e-12
"""rad in a period, of a bench that is not held."""


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
    lower_frequency: Annotated[
        float,
        Real("Hz", "below it the bench is held in its place, which takes its share of the rms; 0: it is not", 0.0, 1e3),
    ] = 0.0


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


# --- a bench that is held in its place -------------------------------------------------------------------------------


class Held(NamedTuple):
    """One axis of a bench on its spring, pushed by noise of rms 1."""

    spring: Annotated[float, Real("1", "w^2 d, acceleration by the spring")] = 0.0
    speed: Annotated[float, Real("1", "w d', the speed as an acceleration")] = 0.0
    acceleration: Annotated[float, Real("1", "mean of d'' over the last period")] = 0.0


HELD_STILL = (Held(), Held(), Held())


class Holder(NamedTuple):
    """The spring and the damper over one period, during which the push stays."""

    turn: Annotated[float, Real("rad", "w times the period; 0: not held")]
    transition: Transition


def holder(shaking: Shaking, period: Scalar) -> Holder:
    """The discrete equations of the held bench."""
    w = 2.0 * PI * shaking.lower_frequency
    return Holder(w * period, transition(w, sqrt(0.5), period))


def held(c: Holder, now: Held, push: Scalar) -> Held:
    """The bench at the next tick; one that is not held feels the push."""
    off = now.spring - push
    spring = push + c.transition.a * off + c.transition.b * now.speed
    speed = c.transition.c * off + c.transition.d * now.speed
    # its mean, so that speed and way are exactly those of the bench
    mean = (speed - now.speed) / maximum(c.turn, _LEAST_TURN)
    return Held(spring, speed, where(c.turn > 0.0, mean, push))
