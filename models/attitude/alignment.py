"""Alignment at rest: pitch and roll from the mean specific force, yaw from outside, gyro bias from the mean rate.

After the 2010 paper, section 1.1 and the part's "precision automatic bias null" (30 s at rest). A body that moves
meanwhile spoils all three: `with_watched_sample` begins anew then, and keeps what tells how good the means are.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean, Quaternion, Real, Vector3, choose
from ..scalar import Scalar, absolute, atan2, both, cos, either, exp, floor, hypot, maximum, sin, sqrt, where
from ..sensors.adxrs450_sheet import NULL_ACCURACY
from ..vectors import ZERO3, add, dot, each_axis, multiply_transposed, scale, subtract
from .rotations import (
    Euler,
    earth_rate_n,
    matrix_from_quaternion,
    quaternion_from_euler,
    tilt_from_specific_force,
)


class AlignmentParameters(NamedTuple):
    """How the attitude starts."""

    duration: Annotated[float, Real("s", "time at rest over which the accelerometer is averaged", min=0.0)] = 2.0
    null_gyro: Annotated[bool, Boolean("take the mean rate at rest as gyro bias")] = True
    largest_null: Annotated[
        float, Real("rad/s", "mean rate that may still be bias; beyond it the body turns", min=0.0, display="deg/s")
    ] = NULL_ACCURACY.si


class AlignmentState(NamedTuple):
    """Sums of the samples so far."""

    samples: Annotated[float, Real("1", "samples averaged")]
    specific_force: Annotated[Vector3, Real("m/s2", "sum of the specific force")]
    rate: Annotated[Vector3, Real("rad/s", "sum of the rate")]


def samples_for(duration: Scalar, period: Scalar) -> Scalar:
    """Whole samples that cover the duration, at least one."""
    return maximum(-floor(-(duration / period - 1e-9)), 1.0)


def with_sample(alignment: AlignmentState, force: Vector3, rate: Vector3) -> AlignmentState:
    """The sums after one more sample."""
    n, f, w = alignment
    return AlignmentState(
        n + 1.0,
        (f[0] + force[0], f[1] + force[1], f[2] + force[2]),
        (w[0] + rate[0], w[1] + rate[1], w[2] + rate[2]),
    )


def levelled(force: Vector3, yaw: Scalar) -> Quaternion:
    """q_nb with pitch and roll from specific force at rest and the given yaw."""
    pitch, roll = tilt_from_specific_force(force)
    return quaternion_from_euler(Euler(yaw, pitch, roll))


def resting_bias(rate: Vector3, q_nb: Quaternion, latitude: Scalar) -> Vector3:
    """w - C_nb' w_ie_n: what a gyro at rest reads beyond the Earth's rotation.

    An outside yaw that is wrong by d leaves 2 w_ie cos(lat) sin(d/2) of the Earth's rotation in it.
    """
    return subtract(rate, multiply_transposed(matrix_from_quaternion(q_nb), earth_rate_n(latitude)))


def nulled_bias(
    alignment: AlignmentState, q_nb: Quaternion, latitude: Scalar, p: AlignmentParameters
) -> tuple[Vector3, Scalar]:
    """Bias by the mean rate, and whether it could be had: zero where not asked for or where the body turns."""
    mean = scale(1.0 / maximum(alignment.samples, 1.0), alignment.rate)
    bias = resting_bias(mean, q_nb, latitude)
    largest = maximum(maximum(absolute(bias[0]), absolute(bias[1])), absolute(bias[2]))
    found = both(p.null_gyro > 0.5, largest <= p.largest_null)
    return choose(found, bias, ZERO3), where(found, 1.0, 0.0)


# --- watching for motion ---------------------------------------------------------------------------------------------


class MotionParameters(NamedTuple):
    """What counts as motion during the alignment: readings of the last moment away from the mean so far.

    Vibration passes, having no mean; tilting, turning and pushing do not. A steady turn about the vertical is seen by
    `AlignmentParameters.largest_null` alone.
    """

    restart: Annotated[bool, Boolean("begin the averaging anew when the body moves")] = True
    rate: Annotated[
        float, Real("rad/s", "change of the rate that is motion", min=1e-9, display="deg/s", tunable=True)
    ] = 0.01
    specific_force: Annotated[
        float, Real("m/s2", "change of the specific force that is motion; 0.2: 1.2 deg of tilt", min=1e-9, tunable=True)
    ] = 0.2
    memory: Annotated[float, Real("s", "time over which readings are averaged before that", min=1e-4, tunable=True)] = (
        0.1
    )


class WatchedAlignment(NamedTuple):
    """Sums of the samples since the body last moved, and how far they scatter."""

    sums: AlignmentState
    rate_squares: Annotated[Vector3, Real("rad2/s2", "squared deviations of the rate from its mean, summed")]
    specific_force_squares: Annotated[Vector3, Real("m2/s4", "those of the specific force")]
    rate_lately: Annotated[Vector3, Real("rad/s", "low-passed rate")]
    specific_force_lately: Annotated[Vector3, Real("m/s2", "low-passed specific force")]
    restarts: Annotated[float, Real("1", "times that the averaging began anew")]


NOTHING_SEEN = WatchedAlignment(AlignmentState(0.0, ZERO3, ZERO3), ZERO3, ZERO3, ZERO3, ZERO3, 0.0)
"""The alignment before its first sample."""


def _scatter(squares: Vector3, deviation: Vector3, n: Scalar) -> Vector3:
    """Sum of squared deviations after one more sample, `deviation` away from the mean of the n before (Welford)."""
    share = n / (n + 1.0)
    return each_axis(lambda i: squares[i] + share * deviation[i] * deviation[i])


def with_watched_sample(
    watched: WatchedAlignment, force: Vector3, rate: Vector3, p: MotionParameters, h: Scalar
) -> WatchedAlignment:
    """The sums after one more sample, h seconds after the one before; of this sample alone if the body has moved."""
    n, f, w = watched.sums
    share = 1.0 / maximum(n, 1.0)
    mean_force, mean_rate = scale(share, f), scale(share, w)
    sums = with_sample(watched.sums, force, rate)
    # a plain mean, that of the sums, until the memory is full: a few samples scatter too much to tell of motion
    gain = maximum(1.0 / sums.samples, 1.0 - exp(-h / p.memory))
    force_lately = add(watched.specific_force_lately, scale(gain, subtract(force, watched.specific_force_lately)))
    rate_lately = add(watched.rate_lately, scale(gain, subtract(rate, watched.rate_lately)))
    whole = 1.0 / sums.samples
    pushed = subtract(force_lately, scale(whole, sums.specific_force))
    turned = subtract(rate_lately, scale(whole, sums.rate))
    beyond = either(
        dot(pushed, pushed) > p.specific_force * p.specific_force,
        dot(turned, turned) > p.rate * p.rate,
    )
    moved = both(p.restart > 0.5, beyond)
    going_on = WatchedAlignment(
        sums,
        _scatter(watched.rate_squares, subtract(rate, mean_rate), n),
        _scatter(watched.specific_force_squares, subtract(force, mean_force), n),
        rate_lately,
        force_lately,
        watched.restarts,
    )
    anew = WatchedAlignment(AlignmentState(1.0, force, rate), ZERO3, ZERO3, rate, force, watched.restarts + 1.0)
    return WatchedAlignment(*choose(moved, anew, going_on))


def standard_error(squares: Vector3, samples: Scalar) -> Vector3:
    """sqrt(sum of squared deviations / (n (n - 1))) of each axis: how well n samples know their mean.

    For independent samples; noise that is AR(1) with coefficient a knows it worse by sqrt((1 + a)/(1 - a)).
    """
    n = maximum(samples, 2.0)
    return each_axis(lambda i: sqrt(squares[i] / (n * (n - 1.0))))


def tilt_error(force: Vector3, error: Vector3) -> tuple[Scalar, Scalar]:
    """Standard deviations of pitch and roll (rad) whose specific force has the `error` (standard deviations, m/s^2).

    d theta = (h df_y - f_y (f_x df_x + f_z df_z)/h)/|f|^2,  d gamma = (f_x df_z - f_z df_x)/h^2,  h^2 = f_x^2 + f_z^2.
    """
    x, y, z = force
    level = maximum(hypot(x, z), 1e-9)  # straight up or down roll means nothing
    square = level * level
    ex, ey, ez = error
    pitch = hypot(level * ey, y / level * hypot(x * ex, z * ez)) / (square + y * y)
    return pitch, hypot(x * ez, z * ex) / square


# --- heading ---------------------------------------------------------------------------------------------------------


def heading_from_magnetic(m_b: Vector3, pitch: Scalar, roll: Scalar) -> Scalar:
    """psi_m = atan2(-m_x, m_y), m = Rx(theta) Ry(gamma) m_b: heading against magnetic north of a tilted body.

    m_b is the Earth's magnetic field in body axes, in any unit; -pi to pi. True yaw is psi_m and the declination (east
    positive). Tilt known wrongly by d tips the vertical part of the field in: tan(dip) d, 2 d at 63 deg of dip.
    Source: the 2010 paper, section 1.1, in words.
    """
    x, y, z = m_b
    st, ct, sg, cg = sin(pitch), cos(pitch), sin(roll), cos(roll)
    across = cg * x + sg * z
    along = ct * y - st * (cg * z - sg * x)
    return atan2(-across, along)
