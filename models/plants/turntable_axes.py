"""How three axes and their errors carry a sensor: a chain of turns about single axes, each with rate and acceleration.

Outer axis down to inner: azimuth about -z, middle about x, inner about y, so that a perfect table's angles are yaw,
pitch and roll. Each axis wobbles: before it spins, it tilts across itself by

    u = A1 cos(phi + a1) + A2 cos(2 phi + a2),   v = A1 sin(phi + a1) + A2 sin(2 phi + a2)

about the two axes that follow it in the order x, y, z; and where its encoder tells phi it stands at

    phi + E0 + E1 sin(phi + e1) + E2 sin(2 phi + e2)
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Quaternion, Real, Vector3
from ..scalar import PI, Scalar, cos, sin
from .turntable_servo import AxisMotion

_ARCSEC = PI / 648000.0
_LARGEST_ERROR = 0.2
"""rad"""


class Harmonic(NamedTuple):
    """A wave of an axis's angle."""

    amplitude: Annotated[float, Real("rad", "amplitude", 0.0, _LARGEST_ERROR, nominal=1e-5)] = 0.0
    phase: Annotated[float, Real("rad", "phase", -10.0, 10.0)] = 0.0


class PositionError(NamedTuple):
    """Of an axis, true minus told by its encoder."""

    offset: Annotated[float, Real("rad", "of the zero", -_LARGEST_ERROR, _LARGEST_ERROR, nominal=1e-5)] = 0.0
    once: Harmonic = Harmonic(5.0 * _ARCSEC)  # 2 to 15 arcsec, engineering judgement
    twice: Harmonic = Harmonic(2.0 * _ARCSEC)


class Wobble(NamedTuple):
    """Tilt of an axis, once and twice a turn."""

    once: Harmonic = Harmonic(2.0 * _ARCSEC)  # 1 to 5 arcsec, engineering judgement
    twice: Harmonic = Harmonic(1.0 * _ARCSEC)


class NonOrthogonality(NamedTuple):
    """What neighbouring axes miss of a right angle. Default: 1 to 5 arcsec, engineering judgement."""

    middle: Annotated[
        float,
        Real("rad", "of the middle axis to the outer, + right end down", -_LARGEST_ERROR, _LARGEST_ERROR, nominal=1e-5),
    ] = 3.0 * _ARCSEC
    inner: Annotated[
        float,
        Real("rad", "of the inner axis to the middle, + front end left", -_LARGEST_ERROR, _LARGEST_ERROR, nominal=1e-5),
    ] = 3.0 * _ARCSEC


class Wave(NamedTuple):
    """Amplitude times cosine and sine of the phase."""

    cosine: Annotated[float, Real("rad", "amplitude times cosine of the phase")]
    sine: Annotated[float, Real("rad", "amplitude times sine of the phase")]


class AxisErrors(NamedTuple):
    """Waves of one axis."""

    offset: Annotated[float, Real("rad", "of the zero")]
    position_once: Wave
    position_twice: Wave
    wobble_once: Wave
    wobble_twice: Wave


def _wave(harmonic: Harmonic) -> Wave:
    return Wave(harmonic.amplitude * cos(harmonic.phase), harmonic.amplitude * sin(harmonic.phase))


def axis_errors(position: PositionError, wobble: Wobble) -> AxisErrors:
    """The errors of an axis, ready for every angle."""
    return AxisErrors(
        position.offset, _wave(position.once), _wave(position.twice), _wave(wobble.once), _wave(wobble.twice)
    )


class Motion(NamedTuple):
    """Attitude, angular rate and angular acceleration of a frame against n, the last two in the frame itself."""

    attitude: Quaternion
    rate: Vector3
    acceleration: Vector3


AT_REST = Motion((1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Turn(NamedTuple):
    """An angle and its first two derivatives by time."""

    angle: Scalar
    rate: Scalar = 0.0
    acceleration: Scalar = 0.0


def turned(motion: Motion, axis: int, turn: Turn) -> Motion:
    """The frame that is turned against another one about its x, y or z (`axis` 0, 1, 2).

    q = q (cos(a/2), sin(a/2) e);  w = R'w + a' e;  w' = R'w' + (R'w) x a' e + a'' e
    """
    angle, rate, acceleration = turn
    sine, cosine = sin(0.5 * angle), cos(0.5 * angle)
    s, c = 2.0 * sine * cosine, 1.0 - 2.0 * sine * sine
    i, j, k = axis, (axis + 1) % 3, (axis + 2) % 3
    q0, qi, qj, qk = (motion.attitude[n] for n in (0, 1 + i, 1 + j, 1 + k))
    q = (cosine * q0 - sine * qi, cosine * qi + sine * q0, cosine * qj + sine * qk, cosine * qk - sine * qj)
    w, alpha = motion.rate, motion.acceleration
    wj, wk = c * w[j] + s * w[k], c * w[k] - s * w[j]
    along = (alpha[i] + acceleration, c * alpha[j] + s * alpha[k] + wk * rate, c * alpha[k] - s * alpha[j] - wj * rate)
    x, y, z = (-axis) % 3, (1 - axis) % 3, (2 - axis) % 3  # places of x, y, z in the order i, j, k
    spun = (w[i] + rate, wj, wk)
    return Motion((q[0], q[1 + x], q[1 + y], q[1 + z]), (spun[x], spun[y], spun[z]), (along[x], along[y], along[z]))


def _over_time(slope: Scalar, curvature: Scalar, axis: AxisMotion) -> tuple[Scalar, Scalar]:
    """Rate and acceleration of a function of the axis's angle."""
    return slope * axis.rate, curvature * axis.rate * axis.rate + slope * axis.acceleration


def _waves(once: Wave, twice: Wave, s: Scalar, c: Scalar, axis: AxisMotion) -> tuple[Turn, Turn]:
    """Sum of the cosine waves, and of the sine waves, at an angle of sine s and cosine c."""
    s2, c2 = 2.0 * s * c, 1.0 - 2.0 * s * s
    cosine1, sine1 = once.cosine * c - once.sine * s, once.cosine * s + once.sine * c
    cosine2, sine2 = twice.cosine * c2 - twice.sine * s2, twice.cosine * s2 + twice.sine * c2
    cosines = _over_time(-(sine1 + 2.0 * sine2), -(cosine1 + 4.0 * cosine2), axis)
    sines = _over_time(cosine1 + 2.0 * cosine2, -(sine1 + 4.0 * sine2), axis)
    return Turn(cosine1 + cosine2, *cosines), Turn(sine1 + sine2, *sines)


def spun(motion: Motion, direction: int, axis: AxisMotion, errors: AxisErrors, sign: float = 1.0) -> Motion:
    """The frame behind a real axis along x, y or z (`direction` 0, 1, 2): wobble first, then the spin, `sign` times."""
    s, c = sin(axis.angle), cos(axis.angle)
    u, v = _waves(errors.wobble_once, errors.wobble_twice, s, c, axis)
    _, off = _waves(errors.position_once, errors.position_twice, s, c, axis)
    true = (axis.angle + errors.offset + off.angle, axis.rate + off.rate, axis.acceleration + off.acceleration)
    tilted = turned(turned(motion, (direction + 1) % 3, u), (direction + 2) % 3, v)
    return turned(tilted, direction, Turn(*[sign * part for part in true]))


def plate_motion(
    base: Motion,
    axes: tuple[AxisMotion, AxisMotion, AxisMotion],
    errors: tuple[AxisErrors, AxisErrors, AxisErrors],
    nonorthogonality: NonOrthogonality,
) -> Motion:
    """Motion of the inner axis's plate on a base that moves."""
    outer = spun(base, 2, axes[0], errors[0], -1.0)
    middle = spun(turned(outer, 1, Turn(nonorthogonality.middle)), 0, axes[1], errors[1])
    return spun(turned(middle, 2, Turn(nonorthogonality.inner)), 1, axes[2], errors[2])
