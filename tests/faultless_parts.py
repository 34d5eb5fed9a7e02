"""Sensors without errors of their own, to which a test gives the one it looks at."""

from __future__ import annotations

import math
from typing import Any

from attitude_fmu.models.attitude_sensor import MODEL, Inputs, Parameters
from attitude_fmu.models.record import defaults, with_defaults
from attitude_fmu.models.sensors import devices
from attitude_fmu.models.system import Run

NO_ERRORS = {
    f"{part}.{name}": 0.0
    for part in ("gyro", "accelerometer")
    for name in ("noise_density", "bias_instability", "nonlinearity", "supply_sensitivity", "thermal.self_heating")
} | {f"gyro.rectification[{axis}]": 0.0 for axis in (1, 2, 3)}
"""What even a nominal piece has, and the default's processor."""

AS_FINE_AS_CAN_BE = {
    "gyro.range": math.radians(300.0),
    "gyro.resolution": 2.5e-9,
    "gyro.code_limit": 2**31 - 1,
    "accelerometer.range": 20.0,
    "accelerometer.resolution": 1e-8,
    "accelerometer.code_limit": 2**31 - 1,
}
"""Registers that do not round within what these tests can tell."""

GYRO, ADIS = "ADXRS450_ADXL355", "ADIS16354_300"


def faultless(device: str = GYRO, fine: bool = False, **values: Any) -> Parameters:
    """A nominal piece of a device without errors; ``gyro__bias=(...)`` sets gyro.bias, tuples of tuples too."""
    wanted = {**devices.parameters(device), **NO_ERRORS, **(AS_FINE_AS_CAN_BE if fine else {})}
    wanted["processor.clock_error"] = 0.0
    whole: Parameters = defaults(with_defaults(Parameters, wanted))
    for key, value in values.items():
        whole = _with(whole, key.split("__"), value)
    return whole


def _with(record: Any, names: list[str], value: Any) -> Any:
    if not names:
        return value
    return record._replace(**{names[0]: _with(getattr(record, names[0]), names[1:], value)})


def run_of(parameters: Parameters, inputs: Inputs, until: float) -> Run:
    """The sensor at these inputs until then."""
    run = Run(MODEL, parameters, inputs)
    run.advance(inputs, until)
    return run


def only_slow(device: str = GYRO, **values: Any) -> Parameters:
    """A sensor that does little but to step temperatures and offsets: parts stand still, readings are rare."""
    return faultless(device, ideal=True, processor__period=10.0, **values)


STILL = Inputs(rate=(0.0, 0.0, 0.0), specific_force=(0.0, 0.0, 0.0))
"""Nothing to be felt at 25 degC and 5 V."""
