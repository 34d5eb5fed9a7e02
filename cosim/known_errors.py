"""What a flawless calibration would give the processor: a piece's own errors, taken from its parameters.

It stands for a laboratory's calibration where an experiment is not about calibrating.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..models.attitude_sensor import MODEL, Coefficients, Parameters
from ..models.record import defaults, with_defaults
from ..models.sensors.accelerometer import AccelerometerParameters
from ..models.sensors.datasheet import REFERENCE_TEMPERATURE
from ..models.sensors.devices import parameters
from ..models.sensors.gyro import GyroParameters
from .calibration import ErrorModel, compensation, true_errors


def known_compensation(
    device: str, specimen: int, enclosure: float, *, by_temperature: bool, component: str = "sensor"
) -> dict[str, float]:
    """The processor's ``compensation.*`` for a piece that was calibrated in an `enclosure` (K) around it.

    With `by_temperature` the change of scale and bias is known too, over the parts' own thermometers; without, the
    errors are those of the calibration's temperature. Raises `UnknownDeviceError` for a piece that there is not.
    """
    p: Parameters = defaults(with_defaults(Parameters, parameters(device, specimen)))
    k: Coefficients = MODEL.coefficients(p)
    gyro, accelerometer = true_errors(p, k)
    if not by_temperature:
        gyro = _at_one_temperature(gyro, _warmth(p.gyro, enclosure))
        accelerometer = _at_one_temperature(accelerometer, _warmth(p.accelerometer, enclosure))
    return {f"{component}.{name}": value for name, value in compensation(gyro, accelerometer).items()}


def _warmth(part: GyroParameters | AccelerometerParameters, enclosure: float) -> float:
    """What the part's thermometer reads above 25 degC once the die is warm, K."""
    return enclosure + part.thermal.self_heating + part.thermometer.error - REFERENCE_TEMPERATURE


def _at_one_temperature(found: ErrorModel, warmth: float) -> ErrorModel:
    """The errors as they are at `warmth` (K above 25 degC), not changing."""
    none: Any = np.zeros(3)
    return found._replace(
        sensitivity=(1.0 + found.scale_temperature_slope * warmth)[:, None] * found.sensitivity,
        scale_temperature_slope=none,
        bias=found.bias + found.bias_temperature_slope * warmth + found.bias_temperature_curve * warmth**2,
        bias_temperature_slope=none,
        bias_temperature_curve=none,
    )
