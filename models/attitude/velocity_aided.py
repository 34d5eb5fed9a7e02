"""Fused attitude: an error-state Kalman filter that knows only that velocity stays bounded.

Specific force is integrated in navigation coordinates to a horizontal velocity; its boundedness, taken as a
measurement 0 = v + n, corrects tilt and gyro bias. Averaging thus happens in a frame that does not turn with the
body, so that linear acceleration, which has no mean, hurts little.

    q <- integrated,  w = gyro - b - C_nb' w_ie             phi' = -C_nb db
    v <- v + h (C_nb f)_xy                                  dv_x' = phi_y f_z,  dv_y' = -phi_x f_z

Error state: tilt phi_x, phi_y (navigation axes), velocity dv_x, dv_y, gyro bias db_x, db_y, db_z.
At rest, seen by both triads staying close to their low-passed selves, the velocity is known much better and the
low-passed gyro is the bias. A slow steady turn looks the same, so rest is believed only while the mean rate stays near
the bias found in the alignment, which the filter cannot move. The measurement noise grows with the velocity met
lately, the tilt noise with the rate (scale and misalignment of real gyros).

Three more statements can be made, and are not by default. `rest_tilt_noise`: a body at rest keeps its attitude, gyros
are not integrated then; specific force is averaged without end, at the price of what a move turns before it is seen.
`specific_force_noise`: shaking that is white, whose velocity is a random walk. `push_noise`: a knock leaves a velocity
that is not known. Own derivation; rest detection after Laidig & Seel, "VQF", 2023.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from ..record import Matrix3, Quaternion, Real, Vector3, choose
from ..scalar import Scalar, both, exp, minimum, where
from ..vectors import ZERO3, add, dot, multiply, multiply_transposed, scale, subtract
from .rotations import earth_rate_n, matrix_from_quaternion, normalised, quaternion_product

STATES = 7
_PAIRS = tuple((i, j) for i in range(STATES) for j in range(i, STATES))
_ROW = tuple(tuple(_PAIRS.index((min(i, j), max(i, j))) for j in range(STATES)) for i in range(STATES))
Covariance = tuple[
    float, float, float, float, float, float, float, float, float, float, float, float, float, float,
    float, float, float, float, float, float, float, float, float, float, float, float, float, float,
]  # fmt: skip
"""Upper triangle of the symmetric 7x7, row by row."""

VELOCITY_MEMORY = 5.0
"""s over which the velocity met lately is averaged: assumption, longer than a swing of the hand."""

_INITIAL_SPEED = 0.1
"""m/s, standard deviation of the velocity at the end of an alignment: assumption, a body at rest but for trembling."""


class FusionParameters(NamedTuple):
    """Noise and bounds that the fused solution assumes (square roots of two-sided densities).

    The gyro noise is the ADXRS450's with a margin (N = D/sqrt(2)); the bias walk stands for its flicker; the others
    are tuned on recorded hand motion (BROAD). A body that cannot travel far wants a tighter `velocity_bound`.
    """

    gyro_noise: Annotated[float, Real("rad/s^0.5", "white noise of the rates", min=1e-9, tunable=True)] = 3e-4
    rate_noise: Annotated[
        float, Real("s^0.5", "further noise by rad/s of rate: scale, misalignment", min=0.0, tunable=True)
    ] = 0.015
    bias_walk: Annotated[float, Real("rad/s^1.5", "random walk of the gyro bias", min=0.0, tunable=True)] = 2e-4
    initial_bias: Annotated[float, Real("rad/s", "standard deviation of the bias at the start", min=0.0)] = 0.01
    initial_tilt: Annotated[
        float, Real("rad", "standard deviation of the tilt at the start", min=1e-9, display="deg")
    ] = 0.005
    specific_force_noise: Annotated[
        float,
        Real(
            "m/s^1.5",
            "white noise of the specific force beyond bounded velocity: a bench that shakes",
            0.0,
            tunable=True,
        ),
    ] = 0.0
    push_noise: Annotated[
        float,
        Real(
            "s^0.5",
            "further noise by m/s2 away from the mean specific force, unless at rest: knocks",
            0.0,
            tunable=True,
        ),
    ] = 0.0
    velocity_bound: Annotated[
        float, Real("m/s^0.5", "noise of the statement that velocity is zero", min=1e-6, tunable=True)
    ] = 1.05
    velocity_adaptation: Annotated[
        float, Real("s2/m2", "growth of that noise with mean squared velocity", min=0.0, tunable=True)
    ] = 8.0
    rest_velocity: Annotated[
        float, Real("1", "share of its variance left at rest", min=1e-9, max=1.0, tunable=True)
    ] = 1e-3
    rest_rate_noise: Annotated[
        float, Real("rad/s^0.5", "noise of the mean rate taken as bias at rest", min=1e-9, tunable=True)
    ] = 3e-3
    rest_rate: Annotated[
        float, Real("rad/s", "rate about its mean that still is rest", min=0.0, display="deg/s", tunable=True)
    ] = 0.035
    rest_bias: Annotated[
        float,
        Real(
            "rad/s",
            "mean rate about the aligned bias still taken as rest; 0: none",
            min=0.0,
            display="deg/s",
            tunable=True,
        ),
    ] = 1e-3
    rest_specific_force: Annotated[
        float, Real("m/s2", "specific force about its mean that still is rest", min=0.0, tunable=True)
    ] = 0.5
    rest_time: Annotated[float, Real("s", "time of quiet after which it is rest", min=0.0, tunable=True)] = 1.5
    rest_memory: Annotated[float, Real("s", "time constant of those means", min=1e-3, tunable=True)] = 0.5
    rest_tilt_noise: Annotated[
        float,
        Real(
            "rad/s^0.5",
            "random walk of the attitude at rest, which is held then; 0: gyros are integrated at rest too",
            min=0.0,
            tunable=True,
        ),
    ] = 0.0


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
    anchor: Annotated[Vector3, Real("rad/s", "gyro bias found in the alignment", display="deg/s")]
    doubt: Annotated[float, Real("rad/s", "how far from it the bias may be")]


class Fused(NamedTuple):
    """Attitude, bias and the filter's own state."""

    q_nb: Quaternion
    bias: Vector3
    fusion: FusionState


def initial_fusion(
    a: FusionParameters, bias: Vector3, deviation: Scalar, doubt: Scalar, rest: RestState
) -> FusionState:
    """The filter at the end of an alignment that found `bias` with a standard `deviation`, sure within `doubt`."""
    tilt = a.initial_tilt * a.initial_tilt
    speed = _INITIAL_SPEED * _INITIAL_SPEED
    variance = deviation * deviation
    diagonal = (tilt, tilt, speed, speed, variance, variance, variance)
    covariance: Any = tuple(diagonal[i] if i == j else 0.0 for i, j in _PAIRS)
    return FusionState((0.0, 0.0), 0.0, covariance, rest, bias, doubt)


def _rest_after(
    fusion: FusionState, rate: Vector3, force: Vector3, known: Vector3, a: FusionParameters, h: Scalar
) -> RestState:
    """The means and the time of quiet after a sample."""
    rest = fusion.rest
    gain = 1.0 - exp(-h / a.rest_memory)
    mean_rate = add(rest.rate, scale(gain, subtract(rate, rest.rate)))
    mean_force = add(rest.specific_force, scale(gain, subtract(force, rest.specific_force)))
    turning, pushed, drift = subtract(rate, mean_rate), subtract(force, mean_force), subtract(mean_rate, known)
    far = where(a.rest_bias > 0.0, a.rest_bias + fusion.doubt, 0.0)
    quiet = both(
        both(dot(turning, turning) < a.rest_rate * a.rest_rate, dot(drift, drift) < far * far),
        dot(pushed, pushed) < a.rest_specific_force * a.rest_specific_force,
    )
    return RestState(mean_rate, mean_force, where(quiet, minimum(rest.quiet + h, 2.0 * a.rest_time + 1.0), 0.0))


Triangle = Sequence[Scalar]


def _row(p: Triangle, index: int) -> list[Scalar]:
    return [p[n] for n in _ROW[index]]


def _predicted(p: Triangle, c_nb: Matrix3, f_up: Scalar, h: Scalar, free: Scalar) -> list[Scalar]:
    """Upper triangle of F P F' with F = I + h A: first the changed rows of G = F P, then G F'.

    Of the h seconds the gyros, and with them their bias, turn the attitude for `free`.
    """
    phi_x, phi_y, v_x, v_y, b_x, b_y, b_z = [_row(p, index) for index in range(STATES)]
    (xx, xy, xz), (yx, yy, yz), _ = c_nb
    push = h * f_up
    g0 = [a - free * (xx * u + xy * v + xz * w) for a, u, v, w in zip(phi_x, b_x, b_y, b_z, strict=True)]
    g1 = [a - free * (yx * u + yy * v + yz * w) for a, u, v, w in zip(phi_y, b_x, b_y, b_z, strict=True)]
    g2 = [a + push * b for a, b in zip(v_x, phi_y, strict=True)]
    g3 = [a - push * b for a, b in zip(v_y, phi_x, strict=True)]
    return [
        g0[0] - free * (xx * g0[4] + xy * g0[5] + xz * g0[6]),
        g0[1] - free * (yx * g0[4] + yy * g0[5] + yz * g0[6]),
        g0[2] + push * g0[1],
        g0[3] - push * g0[0],
        *g0[4:],
        g1[1] - free * (yx * g1[4] + yy * g1[5] + yz * g1[6]),
        g1[2] + push * g1[1],
        g1[3] - push * g1[0],
        *g1[4:],
        g2[2] + push * g2[1],
        g2[3] - push * g2[0],
        *g2[4:],
        g3[3] - push * g3[0],
        *g3[4:],
        *b_x[4:],
        *b_y[5:],
        b_z[6],
    ]


def _measured(
    p: Triangle, x: list[Scalar], index: int, residual: Scalar, variance: Scalar
) -> tuple[list[Scalar], list[Scalar]]:
    """Scalar Kalman update of error state `index` by `residual` = measured - (predicted + x[index])."""
    row = _row(p, index)
    weight = 1.0 / (row[index] + variance)
    gain = [value * weight for value in row]
    surprise = residual - x[index]
    return (
        [value - gain[i] * row[j] for value, (i, j) in zip(p, _PAIRS, strict=True)],
        [value + surprise * k for value, k in zip(x, gain, strict=True)],
    )


def with_rest(
    fusion: FusionState,
    q_nb: Quaternion,
    rate: Vector3,
    force: Vector3,
    a: FusionParameters,
    latitude: Scalar,
    h: Scalar,
) -> FusionState:
    """The filter's state that has looked for rest in a sample, before the attitude is integrated to it."""
    earth = multiply_transposed(matrix_from_quaternion(q_nb), earth_rate_n(latitude))
    return fusion._replace(rest=_rest_after(fusion, rate, force, add(fusion.anchor, earth), a, h))


def is_held(fusion: FusionState, a: FusionParameters) -> Scalar:
    """Whether the attitude is held instead of integrated: at rest, where rest is to count as knowledge."""
    return both(fusion.rest.quiet > a.rest_time, a.rest_tilt_noise > 0.0)


def corrected(fused: Fused, rate: Vector3, force: Vector3, a: FusionParameters, latitude: Scalar, h: Scalar) -> Fused:
    """The solution corrected by a sample as read, to which q_nb has been integrated, after `with_rest`."""
    q, bias, fusion = fused
    c_nb = matrix_from_quaternion(q)
    earth = multiply_transposed(c_nb, earth_rate_n(latitude))
    known = add(bias, earth)
    rest = fusion.rest
    resting, held = rest.quiet > a.rest_time, is_held(fusion, a)
    turn = choose(held, ZERO3, subtract(rate, known))
    f_n = multiply(c_nb, force)
    v = fusion.velocity
    vx, vy = v[0] + h * f_n[0], v[1] + h * f_n[1]
    memory = 1.0 - exp(-h / VELOCITY_MEMORY)
    lately = fusion.mean_square_velocity + memory * (vx * vx + vy * vy - fusion.mean_square_velocity)

    p = _predicted(fusion.covariance, c_nb, f_n[2], h, where(held, 0.0, h))
    white = where(held, a.rest_tilt_noise, a.gyro_noise)
    tilt_noise = h * (white * white + a.rate_noise * a.rate_noise * dot(turn, turn))
    pushed = subtract(force, rest.specific_force)
    push = where(resting, 0.0, a.push_noise * a.push_noise * dot(pushed, pushed))
    force_noise = h * (a.specific_force_noise * a.specific_force_noise + push)
    bias_noise = h * a.bias_walk * a.bias_walk
    noises = (tilt_noise, tilt_noise, force_noise, force_noise, bias_noise, bias_noise, bias_noise)
    for index, noise in enumerate(noises):
        p[_ROW[index][index]] = p[_ROW[index][index]] + noise

    bound = a.velocity_bound * a.velocity_bound * (1.0 + a.velocity_adaptation * lately) / h
    bound = bound * where(resting, a.rest_velocity, 1.0)
    still = a.rest_rate_noise * a.rest_rate_noise / h * where(resting, 1.0, 1e12)
    x: list[Scalar] = [0.0] * STATES
    p, x = _measured(p, x, 2, -vx, bound)
    p, x = _measured(p, x, 3, -vy, bound)
    drift = subtract(rest.rate, known)
    for axis in range(3):
        p, x = _measured(p, x, 4 + axis, drift[axis], still)

    q = normalised(quaternion_product((1.0, 0.5 * x[0], 0.5 * x[1], 0.0), q))
    return Fused(
        q,
        (bias[0] + x[4], bias[1] + x[5], bias[2] + x[6]),
        FusionState((vx + x[2], vy + x[3]), lately, tuple(p), rest, fusion.anchor, fusion.doubt),
    )
