"""Alignment at rest: pitch and roll from the mean specific force, yaw from outside, gyro bias from the mean rate."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean, Quaternion, Real, Vector3, choose
from ..scalar import Scalar, absolute, both, floor, maximum, where
from ..sensors.devices import ADXRS450
from ..vectors import ZERO3, multiply_transposed, scale, subtract
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
    ] = ADXRS450.null_accuracy.si


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
    """w - C_nb' w_ie_n: what a gyro at rest reads beyond the Earth's rotation."""
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
