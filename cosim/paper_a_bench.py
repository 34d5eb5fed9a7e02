"""The bench of Jing & Gao 2021: their sensor on a three-axis turntable that shakes and is knocked against.

Shaking. The raw accelerometer angle scatters by 1.36 deg rms at their 50 Hz, a hundred times the ADXL355's noise: it
is true horizontal acceleration g tan(1.36 deg), which tilts the specific force by as much in any position of the table.
It is flat to 25 Hz, half the reader's rate (more would only fold back), and falls from there with damping 0.7: samples
at 50 Hz are then white within 5 %. Both horizontal axes shake alike; the vertical one would not show in an angle.

Knock. A half sine of horizontal acceleration whose peak tilts the specific force as far as the raw angle went, to
23.8 deg, and at once another one the other way, to 69.9 deg. Their length follows from how far RC 100 went at the
first, to 42.562 deg: 2/pi of peak times length, over the filter's 2 s. These three printed numbers set the knock. It
leaves the bench 0.13 m/s, and nothing in the record tells what takes that back.
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
"""deg rms of the raw angle, an assumption: the R with which Q = 0.018 deg^2 gives the Kalman filter a gain of 0.094."""

WIDE_NOISE = 1.68
"""deg rms, of which 80 s at 50 Hz have the printed largest error of 6.3 deg."""

HELD = 2.0
"""Hz, below which a bench is held in its place so that RC 100 errs by 0.104 deg at most; 12 Hz do little more."""

DENSITY = RAW_NOISE * math.sqrt(READ)
"""deg/Hz^0.5, two-sided: the mean of T seconds of white raw noise is known to DENSITY/sqrt(T)."""

_FREQUENCY, _DAMPING = 0.5 / READ, 0.7
_TAPS, _TAP_PERIOD = 8, 1.0 / 4000.0  # the ADXL355's sinc^2 decimator from 4 kHz to 500 Hz

KNOCKED_TO = (23.8, 69.9)
"""deg, where the raw angle went in the shock, one after the other."""

_TIME_CONSTANT = RcParameters().num * READ
KNOCK_DURATION = (INNER - 42.562) * _TIME_CONSTANT / (2.0 / PI * (INNER - KNOCKED_TO[0]))
"""s of a half sine, 0.15."""


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


def shaking(noise: float = RAW_NOISE, lower_frequency: float = 0.0) -> dict[str, Value]:
    """The table's parameters that make a reader at 50 Hz see white tilt noise (deg rms).

    It goes down to 0 Hz, which no bench can do, or fades below `lower_frequency` (Hz).
    """
    acceleration = STANDARD_GRAVITY * math.radians(noise) / share_read()
    return {
        "table.shaking.rms[1]": acceleration,
        "table.shaking.rms[2]": acceleration,
        "table.shaking.frequency": _FREQUENCY,
        "table.shaking.damping_ratio": _DAMPING,
        "table.shaking.lower_frequency": lower_frequency,
    }


def knock(start: float) -> dict[str, Value]:
    """The table's parameters for a knock at `start` (s) that drives the raw angle down, then up."""
    # to the right it lowers the roll: tan(gamma - angle) = a/g
    down, up = (math.tan(math.radians(abs(INNER - end))) for end in KNOCKED_TO)
    return {
        "table.shock.peak[1]": STANDARD_GRAVITY * down,
        "table.shock.start": start,
        "table.shock.duration": KNOCK_DURATION,
        "table.shock.rebound": up / down,
    }


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


DEFAULT: dict[str, Value] = {
    # or the alignment would wait for the shaking to end
    "sensor.motion.specific_force": 1.0,
    "sensor.solver.kind": SOLVER.value("fused"),
}
"""Our fused solution with its default parameters."""

TUNED: dict[str, Value] = {
    **DEFAULT,
    "sensor.alignment.duration": 3.0,
    "sensor.solver.fusion.rest_specific_force": 1.2,
    "sensor.solver.fusion.rest_bias": 3e-3,
    "sensor.solver.fusion.rest_time": 0.5,
    # five times the gyros' noise: a move is seen within 0.1 s, before it is 0.05 deg
    "sensor.solver.fusion.rest_rate": 0.014,
    "sensor.solver.fusion.rest_rate_noise": 1e-3,
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
"""The fused solution, told how hard the bench shakes and that a table at rest stays put."""

OURS = (
    "default is the fused solution with its default parameters (its alignment lets shaking up to 1 m/s2 pass): it "
    "takes shaking as hard as this for motion, and averages no longer than RC 100. tuned was told how hard the bench "
    "shakes, and that a table at rest keeps its attitude."
)


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
