"""What a flawless calibration would give the processor: a piece's own errors, taken from its parameters.

    M = (diag(1 + k_s (T - 25 degC)) S)^-1,   b = b0 + k_b (T - 25 degC)   at the temperature of the calibration

It stands for a laboratory's calibration where an experiment is not about calibrating.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..models.attitude.rotations import STANDARD_GRAVITY
from ..models.attitude_sensor import MODEL, Coefficients, Parameters
from ..models.record import defaults, with_defaults
from ..models.sensors.accelerometer import AccelerometerParameters
from ..models.sensors.datasheet import REFERENCE_TEMPERATURE
from ..models.sensors.devices import parameters
from ..models.sensors.gyro import GyroParameters

Part = GyroParameters | AccelerometerParameters


def known_compensation(
    device: str, specimen: int, enclosure: float, *, by_temperature: bool, component: str = "sensor"
) -> dict[str, float]:
    """The processor's ``compensation.*`` for a piece that was calibrated in an `enclosure` (K) around it.

    With `by_temperature` the offsets' slopes are known too, over the parts' own thermometers; without, the offsets are
    those of the calibration's temperature. Raises `UnknownDeviceError` for a piece that there is not.
    """
    p: Parameters = defaults(with_defaults(Parameters, parameters(device, specimen)))
    k: Coefficients = MODEL.coefficients(p)
    linear, cubic = k.accelerometer.cubic
    # the straight line that fits x + c3 x^3 - c1 x best over +-1 g
    gain = 1.0 - linear + 0.6 * cubic * STANDARD_GRAVITY**2
    values = {
        **_matrix("accelerometer_matrix", _inverse(p.accelerometer, k.accelerometer.sensitivity, enclosure) / gain),
        **_matrix("gyro_matrix", _inverse(p.gyro, k.gyro.sensitivity, enclosure)),
        **_matrix("g_sensitivity", k.gyro.g_sensitivity),
        **_offsets("accelerometer_bias", p.accelerometer, enclosure, by_temperature),
        **_offsets("gyro_bias", p.gyro, enclosure, by_temperature),
    }
    return {f"{component}.compensation.{name}": float(value) for name, value in values.items()}


def _warmer(part: Part, enclosure: float) -> float:
    """The die above the temperature that the sheets' numbers hold at, K."""
    return enclosure + part.thermal.self_heating - REFERENCE_TEMPERATURE


def _inverse(part: Part, sensitivity: Any, enclosure: float) -> NDArray[np.float64]:
    factor = 1.0 + np.array(part.scale_temperature_slope) * _warmer(part, enclosure)
    return np.asarray(np.linalg.inv(factor[:, None] * np.array(sensitivity)))


def _offsets(name: str, part: Part, enclosure: float, by_temperature: bool) -> Mapping[str, float]:
    bias, slope = np.array(part.bias), np.array(part.bias_temperature_slope)
    if not by_temperature:
        return _vector(name, bias + slope * _warmer(part, enclosure))
    # over what the thermometer reads, its own error included
    return {**_vector(name, bias - slope * part.thermometer.error), **_vector(f"{name}_temperature_slope", slope)}


def _vector(name: str, values: Any) -> dict[str, float]:
    return {f"{name}[{i}]": value for i, value in enumerate(values, 1)}


def _matrix(name: str, rows: Any) -> dict[str, float]:
    return {f"{name}[{i},{j}]": value for i, row in enumerate(rows, 1) for j, value in enumerate(row, 1)}
