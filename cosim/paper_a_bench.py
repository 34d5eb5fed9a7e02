"""The bench of Jing & Gao 2021: their sensor on a three-axis turntable that shakes and is knocked against.

Shaking. The raw accelerometer angle scatters by 1.36 deg rms at their 50 Hz, a hundred times the ADXL355's noise: it
is true horizontal acceleration g tan(1.36 deg), which tilts the specific force by as much in any position of the table.
It is flat to 25 Hz, half the reader's rate (more would only fold back), and falls from there with damping 0.7: samples
at 50 Hz are then white within 5 %. Both horizontal axes shake alike; the vertical one would not show in an angle.

Knock. A half sine of horizontal acceleration whose peak tilts the specific force as far as the raw angle went: to
69.9 deg one way, to 23.8 deg the other. Its length follows from how far RC 100 went at the second, to 42.562 deg:
2/pi of peak times length, over the filter's 2 s. The table's shock has one sign, so that each way is a run of its own.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import numpy as np

from ..models.attitude.rotations import STANDARD_GRAVITY
from ..models.attitude_sensor import FILTER, SOLVER
from ..models.filters.rc import RcParameters
from ..models.scalar import PI
from .devices import device_parameters
from .interface import Value
from .known_errors import known_compensation
from .master import Order
from .profiles import ROOM_TEMPERATURE, Profile, profile_parameters
from .system import Component, ParameterSet, System, connect

DEVICE = "ADXRS450_ADXL355"
FMUS = ("Turntable", "AttitudeSensor")
INNER = 43.5
"""deg, of the static run."""

STEP = 5e-3
"""s, communication step and the table's clock: eight points in the fastest cycle of the shaking."""

ORDER: Order = "gauss-seidel"
"""The sensor feels what the table did in the same step."""

READ = 0.02
"""s between two readings of the angle: at 50 Hz RC 100 and RC 1000 settle as printed (the paper gives no rate)."""

RAW_NOISE = math.sqrt(1.84)
"""deg rms of the raw angle: the R with which Q = 0.018 deg^2 gives the printed Kalman its gain of 0.094."""

DENSITY = RAW_NOISE * math.sqrt(READ)
"""deg/Hz^0.5, two-sided: the mean of T seconds of white raw noise is known to DENSITY/sqrt(T)."""

_FREQUENCY, _DAMPING = 0.5 / READ, 0.7
_TAPS, _TAP_PERIOD = 8, 1.0 / 4000.0  # the ADXL355's sinc^2 decimator from 4 kHz to 500 Hz

Way = Literal["up", "down"]
KNOCKED_TO: dict[Way, float] = {"up": 69.9, "down": 23.8}
"""deg, the ends of the raw angle in the shock."""

_TIME_CONSTANT = RcParameters().num * READ
KNOCK_DURATION = (INNER - 42.562) * _TIME_CONSTANT / (2.0 / PI * (INNER - KNOCKED_TO["down"]))
"""s, 0.15."""


def share_read() -> float:
    """What the held steps and the ADXL355's decimator leave of the shaking's rms at a reading."""
    w, z = 2.0 * PI * _FREQUENCY, _DAMPING
    turn = w * STEP * math.sqrt(1.0 - z * z)
    alike = math.exp(-z * w * STEP) * (math.cos(turn) + z / math.sqrt(1.0 - z * z) * math.sin(turn))
    box = np.ones(_TAPS) / _TAPS
    passed = np.cumsum(np.convolve(box, box))
    # a step may fall between any two of the taps; the others fall within one step
    torn = float(np.sum(2.0 * passed * (1.0 - passed))) * _TAP_PERIOD / STEP
    return math.sqrt(1.0 - torn * (1.0 - alike))


def shaking() -> dict[str, Value]:
    """The table's parameters that make a reader at 50 Hz see white tilt noise of `RAW_NOISE`."""
    acceleration = STANDARD_GRAVITY * math.radians(RAW_NOISE) / share_read()
    return {
        "table.shaking.rms[1]": acceleration,
        "table.shaking.rms[2]": acceleration,
        "table.shaking.frequency": _FREQUENCY,
        "table.shaking.damping_ratio": _DAMPING,
    }


def knock(way: Way, start: float) -> dict[str, Value]:
    """The table's parameters for a knock at `start` (s) that drives the raw angle up or down."""
    # to the right it lowers the roll: tan(gamma - angle) = a/g
    acceleration = STANDARD_GRAVITY * math.tan(math.radians(INNER - KNOCKED_TO[way]))
    return {"table.shock.peak[1]": acceleration, "table.shock.start": start, "table.shock.duration": KNOCK_DURATION}


# --- the sensor's settings -------------------------------------------------------------------------------------------

_LEVELLING: dict[str, Value] = {
    "sensor.solver.kind": SOLVER.value("levelling"),
    "sensor.alignment.duration": 0.0,
    "sensor.filter.divider": 10,
}


def as_printed(
    kind: Literal["none", "rc", "kalman"], num: float = 100.0, *, from_zero: bool = True
) -> dict[str, Value]:
    """The paper's way: the angle of each accelerometer reading, then one of its filters at 50 Hz, started at zero."""
    return {
        **_LEVELLING,
        "sensor.filter.kind": FILTER.value(kind),
        "sensor.filter.from_zero": from_zero and kind != "none",
        "sensor.filter.rc.num": num,
    }


OURS: dict[str, Value] = {
    # a reading may be pushed about by the shaking without the table having moved
    "sensor.motion.specific_force": 1.0,
    "sensor.alignment.duration": 3.0,
    "sensor.solver.kind": SOLVER.value("fused"),
    "sensor.solver.fusion.rest_specific_force": 1.2,
    "sensor.solver.fusion.rest_bias": 3e-3,
    "sensor.solver.fusion.rest_time": 0.5,
    # what the alignment's 3 s leave, and what the shaking is: DENSITY
    "sensor.solver.fusion.initial_tilt": math.radians(DENSITY) / math.sqrt(3.0),
    "sensor.solver.fusion.specific_force_noise": STANDARD_GRAVITY * math.radians(DENSITY),
    # what a knock's speed is worth afterwards
    "sensor.solver.fusion.push_noise": 0.3,
    # the gyros' scale and axes are calibrated
    "sensor.solver.fusion.rate_noise": 2e-3,
    # at rest the table stands: its attitude is held, and velocity is truly none
    "sensor.solver.fusion.rest_tilt_noise": 1e-5,
    "sensor.solver.fusion.rest_velocity": 1e-5,
}
"""Our best on a bench that shakes: the fused solution, told how hard it shakes and that a table at rest stays put."""


# --- the coupled system ----------------------------------------------------------------------------------------------


def bench(
    dist: Path, profile: Profile, seed: int, values: Mapping[str, Value], calibration: Mapping[str, float] | None = None
) -> System:
    """Piece `seed` of the sensor on the table that runs `profile`, the FMUs from `dist`.

    The piece is calibrated at room temperature, as the paper's was; `calibration` replaces that.
    """
    known = calibration or known_compensation(DEVICE, seed, ROOM_TEMPERATURE, by_temperature=False)
    # noise is keyed by seed: the table has its own
    run: dict[str, Value] = {"sensor.seed": seed, "table.seed": 1000 + seed, "table.period": STEP}
    return System(
        "paper-a",
        tuple(Component(name, dist / f"{fmu}.fmu") for name, fmu in zip(("table", "sensor"), FMUS, strict=True)),
        (
            *connect("table", "sensor", "rate[:3]", "specific_force[:3]", "angular_acceleration[:3]", "temperature"),
            *connect("table", "sensor", ("euler.yaw", "heading_aid")),
        ),
        (
            device_parameters(DEVICE, seed),
            ParameterSet("calibration", known),
            profile_parameters(profile),
            ParameterSet("run", {**run, **values}),
        ),
        description="Jing & Gao 2021: their sensor on a three-axis turntable",
    )
