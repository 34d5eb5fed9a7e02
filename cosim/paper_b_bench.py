"""The bench of the 2010 paper: one ADIS16354 and a TMS320F2812 on a three-axis non-magnetic turntable.

The part. +-300 deg/s with 4 taps, which is how it powers up: the paper tells of no other setting. Each seed is another
piece, as the tolerances allow; the part is calibrated by its maker and the paper does nothing about what is left.

The processor. Its timer runs at the part's nominal 819.2 Hz: the paper gives no rate, but tells (cause of error 4) that
timer and part were meant to keep step. A precision null at power-up takes 30 s by the part's clock, which may be 3 %
slow; 2 s of levelling follow, and the table holds still for 36 s.

The filter. Its coefficients are those that `identification.fit_ar1` finds on 30 s of a nominal part at rest; how the
signal passes is not printed: the gain is an assumption.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from ..models.attitude.integration import INTEGRATION
from ..models.attitude_sensor import SIGNAL_FILTER, SOLVER
from ..models.filters.ar1_kalman import signal_variance_for
from ..models.scalar import PI
from ..models.sensors.adis16354_sheet import SAMPLING_FREQUENCY
from ..models.sensors.gyro import AUTONULL
from .devices import device_parameters
from .interface import Value
from .known_errors import known_compensation
from .master import Order
from .profiles import PAPER_B_BESIDE, ROOM_TEMPERATURE, Profile, profile_parameters
from .system import Component, ParameterSet, System, connect

DEVICE = "ADIS16354_300"
FMUS = ("Turntable", "AttitudeSensor")
RATE = SAMPLING_FREQUENCY.value
"""Hz, of the part by its sheet, and of the processor's timer."""

STEP = 0.01
"""s, communication step and the table's clock: at 1 deg/s all that the master holds back is 0.01 deg."""

INTERVAL = 0.02
"""s between records."""

ORDER: Order = "gauss-seidel"
"""The table steps first, so that the sensor is not told of a turn one step late."""

ANGLES = (0, 10, 20, 30, 40)
"""deg, of the axis that is turned."""

TABLE_AXIS = {"pitch": "middle", "roll": "inner"}
"""Which axis of the table turns which angle."""

# --- the sensor's settings -------------------------------------------------------------------------------------------

RATE_NOISE = (0.904, 9.6e-6)
"""AR(1) coefficient a and driving variance E (rad^2/s^2) of a rate, read at `RATE`."""

FORCE_NOISE = (0.904, 6.5e-5)
"""The same of a specific force (m^2/s^4)."""

SIGNAL_GAIN = 0.2
"""Settled gain of the filter on the readings: an assumption, which leaves a third of the noise and lags by 50 ms."""


def _channels(name: str, coefficient: float, driving: float) -> dict[str, Value]:
    values = {
        "coefficient": coefficient,
        "driving_variance": driving,
        "signal_variance": signal_variance_for(SIGNAL_GAIN, coefficient, driving),
    }
    stem = f"sensor.signal_filter.ar1.{name}"
    return {f"{stem}.{field}[{i}]": value for field, value in values.items() for i in (1, 2, 3)}


FILTERED: dict[str, Value] = {
    "sensor.signal_filter.kind": SIGNAL_FILTER.value("ar1_kalman"),
    **_channels("rate", *RATE_NOISE),
    **_channels("specific_force", *FORCE_NOISE),
}
"""The paper's filter on the readings."""

_NULLED: dict[str, Value] = {
    "sensor.gyro.autonull": AUTONULL.value("precision"),
    "sensor.alignment.null_gyro": False,
    "sensor.alignment.duration": 2.0,
}

_INTEGRATION: dict[str, Value] = {"sensor.solver.integration": INTEGRATION.value("runge_kutta_4")}

LEVELLED: dict[str, Value] = {
    **_NULLED,
    **FILTERED,
    **_INTEGRATION,
    "sensor.solver.kind": SOLVER.value("levelling"),
}
"""Tables 1 and 2: pitch and roll from the filtered specific force."""

INTEGRATED: dict[str, Value] = {**_NULLED, **FILTERED, **_INTEGRATION, "sensor.solver.kind": SOLVER.value("gyro")}
"""Tables 3 and 4: filtered rates integrated by fourth-order Runge-Kutta."""

# the processor averages as long as the part would, without the coarse steps of the part's offset register
_ALIGNED: dict[str, Value] = {"sensor.alignment.duration": 33.0}

OUR_GYRO: dict[str, Value] = {
    **_ALIGNED,
    "sensor.solver.kind": SOLVER.value("gyro"),
    "sensor.solver.integration": INTEGRATION.value("coning_compensated"),
}
"""The gyros alone as well as we can: a calibrated piece, its bias nulled by the processor, coning compensated."""

DEFAULT: dict[str, Value] = {**_ALIGNED, "sensor.solver.kind": SOLVER.value("fused")}
"""A calibrated piece and our fused solution with its default parameters, aligned for as long as the paper's null takes.
"""

TUNED: dict[str, Value] = {
    **DEFAULT,
    # the noise of this part, two-sided: 0.05 deg/s and 0.225 mg per root of hertz, over sqrt(2); the second with a
    # margin for its in-run instability
    "sensor.solver.fusion.gyro_noise": 6.5e-4,
    "sensor.solver.fusion.rate_noise": 2e-3,
    "sensor.solver.fusion.bias_walk": 1e-4,
    "sensor.solver.fusion.specific_force_noise": 2e-3,
    # a turntable goes nowhere: what is felt is gravity, but for noise
    "sensor.solver.fusion.velocity_bound": 1e-5,
    "sensor.solver.fusion.velocity_adaptation": 0.0,
    "sensor.solver.fusion.initial_tilt": 1e-3,
}
"""The fused solution of a calibrated piece, told the part's noise and that a turntable stays in place."""

OURS = (
    "default is the fused solution of a calibrated piece, aligned for 33 s, with its default parameters: they expect "
    "hand motion, so that a reading at rest is noisier than by levelling; tuned was told the part's noise, and that a "
    "turntable goes nowhere."
)


# --- the coupled system ----------------------------------------------------------------------------------------------


def _other_axis(angle: str) -> str:
    """The table's axis that stays at 20 deg while this angle is turned."""
    return TABLE_AXIS["roll" if angle == "pitch" else "pitch"]


def recorded(angle: str) -> tuple[str, ...]:
    """What a run of one table records: the angle as solved and as the table tells it, and where the profile is."""
    axis = f"table.axis_angle.{TABLE_AXIS[angle]}"
    return f"sensor.euler.{angle}", axis, "table.row", "table.resting", "table.turning"


def calibrated(seed: int) -> Mapping[str, float]:
    """The processor's compensation of a piece whose errors are known, with their change by temperature."""
    return known_compensation(DEVICE, seed, ROOM_TEMPERATURE, by_temperature=True)


def started_beside(angle: str) -> dict[str, Value]:
    """The table's parameters for a start with the axis that is not turned at 20 deg."""
    return {f"table.axis.{_other_axis(angle)}.initial_angle": PAPER_B_BESIDE * PI / 180.0}


def nominal() -> Mapping[str, Value]:
    """The part's numbers without any piece's tolerances."""
    return device_parameters(DEVICE).values


def bench(dist: Path, profile: Profile, seed: int, *values: Mapping[str, Value]) -> System:
    """Piece `seed` of the part on the table that runs `profile`, the FMUs from `dist`; later values win."""
    # noise is keyed by seed: the table has its own
    run: dict[str, Value] = {
        "sensor.seed": seed,
        "sensor.processor.period": 1.0 / RATE,
        "table.seed": 1000 + seed,
        "table.period": STEP,
    }
    system = System(
        "paper-b",
        tuple(Component(name, dist / f"{fmu}.fmu") for name, fmu in zip(("table", "sensor"), FMUS, strict=True)),
        (
            *connect("table", "sensor", "rate[:3]", "specific_force[:3]", "angular_acceleration[:3]", "temperature"),
            *connect("table", "sensor", ("euler.yaw", "heading_aid")),
        ),
        (device_parameters(DEVICE, seed), profile_parameters(profile), ParameterSet("run", run)),
        description="The 2010 paper: an ADIS16354 on a three-axis turntable",
    )
    for number, one in enumerate(values, 1):
        system = system.with_values(f"settings_{number}", one)
    return system
