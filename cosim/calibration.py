"""Calibration by least squares: what a triad of sensors makes of the truth, from its mean readings at rest and turning.

Axis i of a part (gyros or accelerometers) is taken to read

    y_i = v_i + c_i v_i^3 + b_i + b1_i d + b2_i d^2 + G_i f + u + e,    v_i = (1 + k_i d) S_i x,    d = T - 25 degC

of the true x (rate or specific force) at specific force f, T being what the part's own thermometer reads, its constant
error included. u is the same as long as the part stays switched on (turn-on bias, slow flicker), e is anew in every
interval. Their variances tau^2 and sigma^2/duration are estimated from the residuals (Henderson's method 3), and weigh
the fit: a calibration that took each interval for independent would believe its biases far too much. What the table
itself does wrong looks like an error of the part, time and again; standard errors count it by the table's accuracy.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..models.attitude.rotations import STANDARD_GRAVITY
from ..models.attitude_sensor import Coefficients, Parameters
from .identification import RecordUnusableError

Array = NDArray[np.float64]

_STEPS = 4
"""Gauss-Newton steps. Drift of scale and cubic are far below 1, the rest is linear: three reach rounding."""

_WORST_CONDITION = 1e8
"""Of the scaled equations: beyond it a coefficient is as good as undetermined."""


class Readings(NamedTuple):
    """Means over n intervals: truth and reading of a part (n, 3), specific force (n, 3, m/s^2).

    `warmth` (n, K) is its thermometer's reading above 25 degC, `duration` (n, s), `power_up` (n) tells switchings-on
    apart.
    """

    true: Array
    read: Array
    specific_force: Array
    warmth: Array
    duration: Array
    power_up: NDArray[np.int64]


class ErrorModel(NamedTuple):
    """Coefficients of a triad, or their standard errors; rows are the part's axes. Units: the part's own, and K.

    `sensitivity` (3, 3) is S, `scale_temperature_slope` (3) k, `cubic` (3) c, `bias`, `bias_temperature_slope` and
    `bias_temperature_curve` (3) the bias with temperature, `g_sensitivity` (3, 3) G.
    """

    sensitivity: Array
    scale_temperature_slope: Array
    cubic: Array
    bias: Array
    bias_temperature_slope: Array
    bias_temperature_curve: Array
    g_sensitivity: Array


class Fit(NamedTuple):
    """A triad's coefficients and their standard errors, and how well its readings determine them.

    `condition` (3) is that of each axis's weighted equations, columns scaled to one length. `noise` (3) is sigma, the
    standard deviation of a mean over 1 s with all that the model does not describe, `scatter` (3) is tau, that of the
    bias from one switching-on to the next.
    """

    coefficients: ErrorModel
    standard_errors: ErrorModel
    condition: Array
    noise: Array
    scatter: Array


def fit(readings: Readings, *, g_sensitivity: bool, table_error: float = 0.0) -> Fit:
    """The coefficients that bring model and readings together, weighted least squares; G is zero unless asked for.

    An attitude that is wrong by `table_error` (rad) turns the largest truth X by as much: it adds that to the standard
    errors of S, over X^2 to those of c and times X to those of b, as independent.

    Raises `RecordUnusableError` if the intervals do not determine them.
    """
    axes = [_fit_axis(axis, readings, g_sensitivity) for axis in range(3)]
    return Fit(
        _error_model([axis.value for axis in axes]),
        _with_table(_error_model([axis.error for axis in axes]), table_error, readings),
        np.array([axis.condition for axis in axes]),
        np.array([axis.noise for axis in axes]),
        np.array([axis.scatter for axis in axes]),
    )


def _with_table(errors: ErrorModel, table_error: float, r: Readings) -> ErrorModel:
    largest = float(np.max(np.linalg.norm(r.true, axis=1)))
    return errors._replace(
        sensitivity=np.hypot(errors.sensitivity, table_error),
        cubic=np.hypot(errors.cubic, table_error / largest**2),
        bias=np.hypot(errors.bias, table_error * largest),
    )


class Calibration(NamedTuple):
    """What was fitted to both parts of a sensor, and what they truly have."""

    gyro: Fit
    accelerometer: Fit
    true_gyro: ErrorModel
    true_accelerometer: ErrorModel

    def part(self, name: str) -> tuple[Fit, ErrorModel]:
        """Fit and truth of the ``gyro`` or the ``accelerometer``."""
        return getattr(self, name), getattr(self, f"true_{name}")


def calibrated(
    gyro: Readings, accelerometer: Readings, p: Parameters, k: Coefficients, table_error: float
) -> Calibration:
    """Both parts fitted, beside what a piece with these parameters and coefficients truly has.

    `table_error` (rad) is what the table's attitude may be wrong by; it is nothing beside the noise of gyros.
    Raises `RecordUnusableError` if the intervals do not determine the coefficients.
    """
    fits = fit(gyro, g_sensitivity=True), fit(accelerometer, g_sensitivity=False, table_error=table_error)
    return Calibration(*fits, *true_errors(p, k))


def compensation(gyro: ErrorModel, accelerometer: ErrorModel) -> dict[str, float]:
    """The sensor's parameters ``compensation.*`` that take these errors out: M = S^-1, the others as they are."""
    values = {
        **_of_part("gyro", gyro),
        **_matrix("g_sensitivity", gyro.g_sensitivity),
        **_of_part("accelerometer", accelerometer),
    }
    return {f"compensation.{name}": float(value) for name, value in values.items()}


def _of_part(part: str, found: ErrorModel) -> dict[str, float]:
    vectors = ("scale_temperature_slope", "cubic", "bias", "bias_temperature_slope", "bias_temperature_curve")
    values = _matrix(f"{part}_matrix", np.asarray(np.linalg.inv(found.sensitivity), dtype=np.float64))
    for name in vectors:
        values.update({f"{part}_{name}[{i}]": x for i, x in enumerate(getattr(found, name), 1)})
    return values


def _matrix(name: str, rows: Array) -> dict[str, float]:
    return {f"{name}[{i},{j}]": x for i, row in enumerate(rows, 1) for j, x in enumerate(row, 1)}


# --- what a modelled piece truly has ---------------------------------------------------------------------------------


def true_errors(p: Parameters, k: Coefficients) -> tuple[ErrorModel, ErrorModel]:
    """What a flawless fit would find for a modelled piece: gyros, accelerometers.

    Over a thermometer that reads e too much: S (1 - k e), k/(1 - k e), b - b1 e + b2 e^2, b1 - 2 b2 e. Where
    the part makes (1 - c1) v + c3 v^3 of v, c is c3/(1 - c1)^3; rectification counts as the bias that 1 g makes of it.
    """
    return (
        _true_of(p.gyro, k.gyro, np.array(k.gyro.g_sensitivity)),
        _true_of(p.accelerometer, k.accelerometer, np.zeros((3, 3))),
    )


def _true_of(part: Any, k: Any, pushed: Array) -> ErrorModel:
    error = part.thermometer.error
    bias, slope, curve = (np.array(x) for x in (part.bias, part.bias_temperature_slope, part.bias_temperature_curve))
    drift, sensitivity = np.array(part.scale_temperature_slope), np.array(k.sensitivity)
    linear, cubic = k.cubic[:2]
    gain, at_25 = 1.0 - linear, 1.0 - drift * error
    return ErrorModel(
        (gain * at_25)[:, None] * sensitivity,
        drift / at_25,
        np.full(3, cubic / gain**3),
        bias - slope * error + curve * error**2 + np.array(part.rectification) * STANDARD_GRAVITY**2,
        slope - 2.0 * curve * error,
        curve,
        pushed,
    )


# --- one axis --------------------------------------------------------------------------------------------------------


class _AxisFit(NamedTuple):
    """Of one axis: coefficients in the order S, k, c, b, b1, b2 and perhaps G, and what else `Fit` has of it."""

    value: Array
    error: Array
    condition: float
    noise: float
    scatter: float


def _error_model(axes: list[Array]) -> ErrorModel:
    rows = np.array([np.pad(axis, (0, 11 - len(axis))) for axis in axes])
    drift, cubic, *bias = rows[:, 3:8].T
    return ErrorModel(rows[:, :3], drift, cubic, bias[0], bias[1], bias[2], rows[:, 8:])


def _fit_axis(axis: int, r: Readings, g_sensitivity: bool) -> _AxisFit:
    """Gauss-Newton from a flawless axis; the weights follow from the residuals of each step."""
    value = np.zeros(11 if g_sensitivity else 8)
    value[axis] = 1.0
    for _ in range(_STEPS):
        jacobian, residual = _linearised(value, axis, r)
        noise, scatter = _variances(jacobian, residual, r)
        step, error, condition = _solved(jacobian, residual, r, noise, scatter)
        value = value + step
    return _AxisFit(value, error, condition, math.sqrt(noise), math.sqrt(scatter))


def _linearised(value: Array, axis: int, r: Readings) -> tuple[Array, Array]:
    """Derivative of the model by the coefficients (n, p), and readings without what the model says (n)."""
    d = r.warmth
    responded = r.true @ value[:3]
    scaled = 1.0 + value[3] * d
    v = scaled * responded
    slope = 1.0 + 3.0 * value[4] * v**2
    offsets = np.column_stack((np.ones_like(d), d, d**2))
    columns = [(slope * scaled)[:, None] * r.true, np.column_stack((slope * d * responded, v**3)), offsets]
    said = v + value[4] * v**3 + offsets @ value[5:8]
    if len(value) > 8:
        columns.append(r.specific_force)
        said = said + r.specific_force @ value[8:]
    return np.hstack(columns), r.read[:, axis] - said


def _variances(jacobian: Array, residual: Array, r: Readings) -> tuple[float, float]:
    """sigma^2 and tau^2: from what is left with a free bias for each switching-on, and what more is left without."""
    levels, weight = _levels(r), np.sqrt(r.duration)
    y, columns = weight * residual, weight[:, None] * jacobian / _lengths(jacobian)
    means = levels / _lengths(levels)
    within = _basis(columns - means @ (means.T @ columns))
    spare = len(y) - means.shape[1] - within.shape[1]
    if spare < 1:
        raise RecordUnusableError(f"{len(y)} intervals do not determine {len(y) - spare} coefficients and their errors")
    noise = _rest(within, y - means @ (means.T @ y)) / spare
    common = _basis(columns)
    total = float(np.sum(levels**2))
    shared = total - float(np.sum((common.T @ levels) ** 2))
    if shared < 1e-9 * total:
        # switched on once, its bias is the part's
        return noise, 0.0
    extra = _rest(common, y) - noise * (len(y) - common.shape[1])
    return noise, max(extra / shared, 0.0)


def _levels(r: Readings) -> Array:
    """A column for each switching-on, (n, m): the root of the duration in its own intervals, zero in the others."""
    own: Array = np.sqrt(r.duration)[:, None] * (r.power_up[:, None] == np.unique(r.power_up))
    return own


def _basis(a: Array) -> Array:
    """Orthonormal columns that span those of `a` (n, m)."""
    u, s, _ = np.linalg.svd(a, full_matrices=False)
    spanning: Array = u[:, s > 1e-10 * s[0]]
    return spanning


def _lengths(a: Array) -> Array:
    """Of the columns; 1 for one that is all zeros."""
    length: Array = np.linalg.norm(a, axis=0)
    return np.where(length > 0.0, length, 1.0)


def _rest(basis: Array, y: Array) -> float:
    """Squared length of what is left of `y` outside the span."""
    left = y - basis @ (basis.T @ y)
    return float(left @ left)


def _solved(jacobian: Array, residual: Array, r: Readings, noise: float, scatter: float) -> tuple[Array, Array, float]:
    """Step and standard errors (p) of the generalised least squares with V = sigma^2/duration + tau^2; condition."""
    levels = _levels(r)
    square = np.sum(levels**2, axis=0)
    ratio = scatter / noise if noise > 0.0 else 0.0
    # (1 + ratio q q')^-1/2 = 1 - share q q' for the column q of a switching-on
    share = (1.0 - 1.0 / np.sqrt(1.0 + ratio * square)) / square
    weighted = np.sqrt(r.duration)[:, None] * np.column_stack((jacobian, residual))
    whitened = weighted - levels @ (share[:, None] * (levels.T @ weighted))
    length = _lengths(whitened[:, :-1])
    u, s, vt = np.linalg.svd(whitened[:, :-1] / length, full_matrices=False)
    condition = float(s[0] / s[-1]) if s[-1] > 0.0 else math.inf
    if condition > _WORST_CONDITION:
        raise RecordUnusableError(
            f"the intervals do not determine all coefficients (condition {condition:.1g}): more positions, rates or "
            "temperatures are wanted"
        )
    step = vt.T @ ((u.T @ whitened[:, -1]) / s) / length
    error = math.sqrt(noise) * np.sqrt(np.sum((vt / s[:, None]) ** 2, axis=0)) / length
    return step, error, condition
