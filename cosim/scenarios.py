"""Ready-made coupled systems, by name."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from attitude_fmu.fmu_src.build import folder_of
from attitude_fmu.fmu_src.build_messages import build_and_tell
from attitude_fmu.fmu_src.catalogue import Kind
from attitude_fmu.fmu_src.errors import did_you_mean
from attitude_fmu.models.attitude.rotations import REFERENCE_LATITUDE, STANDARD_GRAVITY, earth_rate_n

from .errors import SystemRefusedError
from .interface import Value
from .ssp import open_ssp
from .system import Component, ParameterSet, System, connect

WIND_SPEED = 10.0
"""m/s, a fresh breeze. In a light wind the tripod alone is steadier than what a loop closed through MEMS gyros can be:
their white noise alone turns the line of sight by about 100 urad within a second."""

VELOCITY_BOUND = 0.02
"""m/s^0.5: a camera on a tripod moves by centimetres a second; the sensor's default is for a hand or a vehicle."""


class Scenario(NamedTuple):
    """A coupled system that the project offers.

    `fmus` are the FMUs that it needs, `system` makes it of those in a folder, `record` is what is worth recording,
    `attitude` the true yaw, pitch and roll (rad) where no component tells them.
    """

    name: str
    description: str
    fmus: tuple[str, ...]
    system: Callable[[Path], System]
    record: tuple[str, ...]
    attitude: tuple[float, float, float] | None = None


def gimbal(dist: Path) -> System:
    """A camera on a three-axis gimbal on a windy tripod, stabilised from the attitude sensor on the camera."""
    components = (
        Component("plant", dist / "TripodGimbal.fmu"),
        Component("sensor", dist / "AttitudeSensor.fmu"),
        Component("controller", dist / "GimbalController.fmu"),
    )
    axes = ("yaw", "pitch", "roll")
    joints = [f"{group}.{axis}" for group in ("joint", "joint_rate") for axis in axes]
    euler = [f"euler.{axis}" for axis in axes]
    connections = (
        *connect("plant", "sensor", "rate[:3]", "specific_force[:3]", "angular_acceleration[:3]", "temperature"),
        *connect("plant", "sensor", ("euler.yaw", "heading_aid")),
        *connect("sensor", "controller", *euler, ("rate_corrected[:3]", "rate[:3]"), ("aligned", "attitude_valid")),
        *connect("plant", "controller", *joints),
        *connect("controller", "plant", *[f"motor_torque.{axis}" for axis in axes]),
    )
    values: dict[str, Value] = {
        "plant.wind.speed": WIND_SPEED,
        "sensor.solver.fusion.velocity_bound": VELOCITY_BOUND,
    }
    return System(
        "gimbal",
        components,
        connections,
        (ParameterSet("gimbal", values),),
        stop_time=60.0,
        description=gimbal.__doc__ or "",
    )


def static(dist: Path) -> System:
    """The attitude sensor alone, level and at rest on a bench, its forward axis to the north."""
    values: dict[str, Value] = {"sensor.specific_force[3]": STANDARD_GRAVITY}
    for axis, rate in enumerate(earth_rate_n(REFERENCE_LATITUDE), 1):
        values[f"sensor.rate[{axis}]"] = rate
    return System(
        "static",
        (Component("sensor", dist / "AttitudeSensor.fmu"),),
        (),
        (ParameterSet("static", values),),
        stop_time=60.0,
        description=static.__doc__ or "",
    )


_SENSOR = (
    "sensor.euler.*",
    "sensor.rate_measured*",
    "sensor.rate_corrected*",
    "sensor.specific_force_measured*",
    "sensor.gyro_bias*",
    "sensor.aligned",
    "sensor.status",
)
_PLANT = (
    "plant.euler.*",
    "plant.rate*",
    "plant.specific_force*",
    "plant.joint.*",
    "plant.motor_current.*",
    "plant.tripod_deflection.*",
    "plant.head_deflection.*",
    "plant.wind_speed",
)

SCENARIOS = (
    Scenario(
        "gimbal",
        gimbal.__doc__ or "",
        ("TripodGimbal", "AttitudeSensor", "GimbalController"),
        gimbal,
        (*_PLANT, *_SENSOR, "controller.motor_torque.*", "controller.status"),
    ),
    Scenario("static", static.__doc__ or "", ("AttitudeSensor",), static, _SENSOR, (0.0, 0.0, 0.0)),
)


def scenario_called(name: str) -> Scenario:
    """The scenario of this name. Raises `SystemRefusedError` if there is none."""
    known = {scenario.name: scenario for scenario in SCENARIOS}
    if name not in known:
        raise SystemRefusedError(
            f"there is no scenario called {name!r}{did_you_mean(name, known)} "
            f"(scenarios: {', '.join(known)}; or give an .ssp file, to info also an .fmu file)"
        )
    return known[name]


@contextmanager
def opened(what: str, dist: Path, kind: Kind) -> Iterator[tuple[System, Scenario | None]]:
    """The system that `what` names: an .ssp file, or a scenario, whose FMUs are built into `dist` where stale.

    Raises `SystemRefusedError` if it is neither, `BuildError` if an FMU cannot be built.
    """
    if what.lower().endswith(".ssp"):
        with open_ssp(Path(what)) as system:
            yield system, None
        return
    if Path(what).exists() and what not in [scenario.name for scenario in SCENARIOS]:
        found = "a folder" if Path(what).is_dir() else "no .ssp file"
        raise SystemRefusedError(f"{what} is {found}; give the .ssp file of a system, or the name of a scenario")
    scenario = scenario_called(what)
    console = Console(stderr=True)
    build_and_tell(dist, scenario.fmus, console, kinds=kind, only_built=True, option="--fmu")
    yield scenario.system(folder_of(dist, kind)), scenario
