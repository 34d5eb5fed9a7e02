"""Fused attitude: an error-state Kalman filter that knows only that velocity stays bounded.

Specific force is integrated in navigation coordinates to a horizontal velocity; its boundedness, taken as a
measurement 0 = v + n, corrects tilt and gyro bias. Averaging thus happens in a frame that does not turn with the
body, so that linear acceleration, which has no mean, hurts little.

    q <- q (x) exp(w h),  w = gyro - b - C_nb' w_ie        phi' = -C_nb db
    v <- v + h (C_nb f)_xy                                  dv_x' = phi_y f_z,  dv_y' = -phi_x f_z

Error state: tilt phi_x, phi_y (navigation axes), velocity dv_x, dv_y, gyro bias db_x, db_y, db_z.
At rest, seen by both triads staying close to their low-passed selves, the velocity is known much better and the
low-passed gyro is the bias. The measurement noise grows with the velocity met lately, the tilt noise with the rate
(scale and misalignment of real gyros). Own derivation; rest detection after Laidig & Seel, "VQF", 2023.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Quaternion, Real, Vector3
from ..scalar import Scalar, both, exp, minimum, where
from ..vectors import add, dot, multiply, multiply_transposed, scale, subtract
from .integration import turned
from .rotations import earth_rate_n, matrix_from_quaternion, normalised, quaternion_product

STATES = 7
_PAIRS = tuple((i, j) for i in range(STATES) for j in range(i, STATES))
Covariance = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float, float, float, float, float, float, float,
]  # fmt: skip
"""Upper triangle of the symmetric 7x7, row by row."""

VELOCITY_MEMORY = 5.0
"""s over which the velocity met lately is averaged."""


class FusionParameters(NamedTuple):
    """Noise and bounds that the fused solution assumes (square roots of two-sided densities)."""

    gyro_noise: Annotated[float, Real("rad/s^0.5", "white noise of the rates", min=1e-9, tunable=True)] = 0.004
    rate_noise: Annotated[
        float, Real("s^0.5", "further noise by rad/s of rate: scale, misalignment", min=0.0, tunable=True)
    ] = 0.0045
    bias_walk: Annotated[float, Real("rad/s^1.5", "random walk of the gyro bias", min=0.0, tunable=True)] = 4e-4
    initial_bias: Annotated[float, Real("rad/s", "standard deviation of the bias at the start", min=0.0)] = 0.01
    initial_tilt: Annotated[
        float, Real("rad", "standard deviation of the tilt at the start", min=1e-9, display="deg")
    ] = 0.02
    velocity_bound: Annotated[
        float, Real("m/s^0.5", "noise of the statement that velocity is zero", min=1e-6, tunable=True)
    ] = 1.05
    velocity_adaptation: Annotated[
        float, Real("s2/m2", "growth of that noise with mean squared velocity", min=0.0, tunable=True)
    ] = 8.0
    rest_velocity: Annotated[float, Real("1", "share of that noise left at rest", min=1e-9, max=1.0, tunable=True)] = (
        1e-3
    )
    rest_rate_noise: Annotated[
        float, Real("rad/s^0.5", "noise of the gyro as bias at rest", min=1e-9, tunable=True)
    ] = 0.003
    rest_rate: Annotated[
        float, Real("rad/s", "rate about its mean that still is rest", min=0.0, display="deg/s", tunable=True)
    ] = 0.035
    rest_bias: Annotated[
        float, Real("rad/s", "mean rate about the bias that still is rest", min=0.0, display="deg/s", tunable=True)
    ] = 0.0087
    rest_specific_force: Annotated[
        float, Real("m/s2", "specific force about its mean that still is rest", min=0.0, tunable=True)
    ] = 0.5
    rest_time: Annotated[float, Real("s", "time of quiet after which it is rest", min=0.0, tunable=True)] = 1.5
    rest_memory: Annotated[float, Real("s", "time constant of those means", min=1e-3, tunable=True)] = 0.5


class RestState(NamedTuple):
    """Low-passed signals and the time of quiet."""

    rate: Annotated[Vector3, Real("rad/s", "low-passed rate")]
    specific_force: Annotated[Vector3, Real("m/s2", "low-passed specific force")]
    quiet: Annotated[float, Real("s", "time of quiet so far")]


class FusionState(NamedTuple):
    """What the fused solution carries beside attitude and bias."""

    velocity: Annotated[tuple[float, float], Real("m/s", "horizontal velocity, east and north")]
    mean_square_velocity: Annotated[float, Real("m2/s2", "mean squared velocity lately")]
    covariance: Annotated[Covariance, Real("1", "covariance of tilt, velocity and bias errors")]
    rest: RestState


class Fused(NamedTuple):
    """Attitude, bias and the filter's own state."""

    q_nb: Quaternion
    bias: Vector3
    fusion: FusionState


def initial_fusion(
    parameters: FusionParameters, bias_deviation: Scalar, force: Vector3, rate: Vector3, quiet: Scalar
) -> FusionState:
    """The filter at the end of an alignment."""
    tilt = parameters.initial_tilt * parameters.initial_tilt
    speed = 0.1 * 0.1
    bias = bias_deviation * bias_deviation
    diagonal = (tilt, tilt, speed, speed, bias, bias, bias)
    covariance = tuple(diagonal[i] if i == j else 0.0 for i, j in _PAIRS)
    return FusionState((0.0, 0.0), 0.0, covariance, RestState(rate, force, quiet))  # type: ignore[arg-type]


def _rest_after(
    rest: RestState, rate: Vector3, force: Vector3, bias: Vector3, p: FusionParameters, h: Scalar
) -> RestState:
    gain = 1.0 - exp(-h / p.rest_memory)
    mean_rate = add(rest.rate, scale(gain, subtract(rate, rest.rate)))
    mean_force = add(rest.specific_force, scale(gain, subtract(force, rest.specific_force)))
    turning, pushed = subtract(rate, mean_rate), subtract(force, mean_force)
    drift = subtract(mean_rate, bias)
    quiet = both(
        both(dot(turning, turning) < p.rest_rate * p.rest_rate, dot(drift, drift) < p.rest_bias * p.rest_bias),
        dot(pushed, pushed) < p.rest_specific_force * p.rest_specific_force,
    )
    return RestState(mean_rate, mean_force, where(quiet, minimum(rest.quiet + h, 2.0 * p.rest_time + 1.0), 0.0))


Rows = list[list[Scalar]]


def _plus_scaled(row: list[Scalar], k: Scalar, other: list[Scalar]) -> list[Scalar]:
    return [a + k * b for a, b in zip(row, other, strict=True)]


def _rows(covariance: Covariance) -> Rows:
    rows: Rows = [[0.0] * STATES for _ in range(STATES)]
    for (i, j), value in zip(_PAIRS, covariance, strict=True):
        rows[i][j] = rows[j][i] = value
    return rows


def _predicted(covariance: Covariance, c_nb: tuple[Vector3, ...], f_up: Scalar, h: Scalar) -> Rows:
    """F P F' with F = I + h A."""
    p = _rows(covariance)
    for _ in range(2):  # rows, then columns of the symmetric result
        phi_x, phi_y, v_x, v_y, b_x, b_y, b_z = p
        turned_x, turned_y = phi_x, phi_y
        for column, bias_row in ((0, b_x), (1, b_y), (2, b_z)):
            turned_x = _plus_scaled(turned_x, -h * c_nb[0][column], bias_row)
            turned_y = _plus_scaled(turned_y, -h * c_nb[1][column], bias_row)
        moved_x = _plus_scaled(v_x, h * f_up, phi_y)
        moved_y = _plus_scaled(v_y, -h * f_up, phi_x)
        p = [list(column) for column in zip(turned_x, turned_y, moved_x, moved_y, b_x, b_y, b_z, strict=True)]
    return p


def _measured(p: Rows, x: list[Scalar], index: int, residual: Scalar, variance: Scalar) -> tuple[Rows, list[Scalar]]:
    """Scalar Kalman update of error state `index` by `residual` = measured - (predicted + x[index])."""
    row = p[index]
    weight = 1.0 / (row[index] + variance)
    gain = [value * weight for value in row]
    return [_plus_scaled(p[i], -gain[i], row) for i in range(STATES)], _plus_scaled(x, residual - x[index], gain)


def fused_step(fused: Fused, rate: Vector3, force: Vector3, p: FusionParameters, latitude: Scalar, h: Scalar) -> Fused:
    """One sample of rate and specific force as read; the rate is taken as the mean since the sample before."""
    q, bias, fusion = fused
    earth = multiply_transposed(matrix_from_quaternion(q), earth_rate_n(latitude))
    known = add(bias, earth)
    turn = subtract(rate, known)
    q = turned(q, scale(h, turn))
    c_nb = matrix_from_quaternion(q)
    f_n = multiply(c_nb, force)
    v = fusion.velocity
    vx, vy = v[0] + h * f_n[0], v[1] + h * f_n[1]
    memory = 1.0 - exp(-h / VELOCITY_MEMORY)
    lately = fusion.mean_square_velocity + memory * (vx * vx + vy * vy - fusion.mean_square_velocity)
    rest = _rest_after(fusion.rest, rate, force, known, p, h)
    resting = rest.quiet > p.rest_time

    rows = _predicted(fusion.covariance, c_nb, f_n[2], h)
    tilt_noise = h * (p.gyro_noise * p.gyro_noise + p.rate_noise * p.rate_noise * dot(turn, turn))
    bias_noise = h * p.bias_walk * p.bias_walk
    for i in (0, 1):
        rows[i][i] = rows[i][i] + tilt_noise
    for i in (4, 5, 6):
        rows[i][i] = rows[i][i] + bias_noise

    bound = p.velocity_bound * p.velocity_bound * (1.0 + p.velocity_adaptation * lately) / h
    bound = bound * where(resting, p.rest_velocity, 1.0)
    still = p.rest_rate_noise * p.rest_rate_noise / h * where(resting, 1.0, 1e12)
    x: list[Scalar] = [0.0] * STATES
    rows, x = _measured(rows, x, 2, -vx, bound)
    rows, x = _measured(rows, x, 3, -vy, bound)
    drift = subtract(rest.rate, known)
    for axis in range(3):
        rows, x = _measured(rows, x, 4 + axis, drift[axis], still)

    q = normalised(quaternion_product((1.0, 0.5 * x[0], 0.5 * x[1], 0.0), q))
    covariance = tuple(rows[i][j] for i, j in _PAIRS)
    return Fused(
        q,
        (bias[0] + x[4], bias[1] + x[5], bias[2] + x[6]),
        FusionState((vx + x[2], vy + x[3]), lately, covariance, rest),
    )
