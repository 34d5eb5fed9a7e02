"""The models that become FMUs."""

from __future__ import annotations

from typing import Literal, NamedTuple

from .errors import BuildError

Kind = Literal["native", "python"]
"""Compiled C, or Python sources run by pythonfmu; variables and value references are the same."""

KINDS: tuple[Kind, ...] = ("native", "python")


class Entry(NamedTuple):
    """One FMU: the module that defines its ``MODEL``, the experiment it proposes, and its first page."""

    identifier: str
    module: str
    stop_time: float = 10.0
    step_size: float = 1e-3
    icon: str = "fmu.png"
    about: str = ""


CATALOGUE = (
    Entry(
        "AttitudeSensor",
        "attitude_fmu.models.attitude_sensor",
        60.0,
        icon="attitude_sensor.png",
        about="Give it the true angular rate, specific force and ambient temperature at its place; read yaw, pitch "
        "and roll as the real device would report them, and every signal on the way. Its attitude has settled when "
        "the alignment time is over.",
    ),
    Entry(
        "TripodGimbal",
        "attitude_fmu.models.tripod_gimbal",
        60.0,
        icon="tripod_gimbal.png",
        about="Give it the motor torques; read the camera's true attitude, rate and the specific force at the "
        "sensor's place, and the joint angles.",
    ),
    Entry(
        "GimbalController",
        "attitude_fmu.models.gimbal_controller",
        60.0,
        icon="gimbal_controller.png",
        about="Give it the attitude sensor's signals; read the motor torques that hold the line of sight.",
    ),
)


def entry(identifier: str) -> Entry:
    """The entry called `identifier`."""
    for candidate in CATALOGUE:
        if candidate.identifier == identifier:
            return candidate
    known = ", ".join(candidate.identifier for candidate in CATALOGUE)
    raise BuildError(f"there is no FMU called {identifier}; there are {known}")
