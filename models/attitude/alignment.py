"""Alignment at rest: pitch and roll from the mean specific force, yaw from outside, gyro bias from the mean rate.

After the 2010 paper, section 1.1 and the part's "precision automatic bias null" (30 s at rest). A body that moves
meanwhile spoils all three: `with_watched_sample` begins anew then.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean, Quaternion, Real, Vector3, choose
from ..scalar import Scalar, absolute, both, either, exp, floor, maximum, where
from ..sensors.adxrs450_sheet import NULL_ACCURACY
from ..vectors import ZERO3, add, dot, multiply_transposed, scale, subtract
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
    `AlignmentParameters.largest_null` alone. The three are assumptions: far above the default parts' noise averaged
    over `memory` (4e-4 rad/s, 4e-4 m/s^2), far below what a hand does to the sensor.
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
    """Sums of the samples since the body last moved, and what was read lately."""

    sums: AlignmentState
    rate_lately: Annotated[Vector3, Real("rad/s", "low-passed rate")]
    specific_force_lately: Annotated[Vector3, Real("m/s2", "low-passed specific force")]


NOTHING_SEEN = WatchedAlignment(AlignmentState(0.0, ZERO3, ZERO3), ZERO3, ZERO3)
"""The alignment before its first sample."""


def with_watched_sample(
    watched: WatchedAlignment, force: Vector3, rate: Vector3, p: MotionParameters, h: Scalar
) -> WatchedAlignment:
    """The sums after one more sample, h seconds after the one before; of this sample alone if the body has moved."""
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
    going_on = WatchedAlignment(sums, rate_lately, force_lately)
    anew = WatchedAlignment(AlignmentState(1.0, force, rate), rate, force)
    return WatchedAlignment(*choose(moved, anew, going_on))
