"""The models that become FMUs."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import Literal, NamedTuple

from ..models.record import check, defaults, flatten, with_defaults
from ..models.sensors.devices import DEFAULT, DEVICES, UnknownDeviceError, parameters
from ..models.system import Model, check_rules
from .errors import BuildError

Kind = Literal["native", "python"]
"""Compiled C, or Python sources run by pythonfmu; variables and value references are the same."""

KINDS: tuple[Kind, ...] = ("native", "python")


class Entry(NamedTuple):
    """One FMU: the module that defines its ``MODEL``, the experiment it proposes, and its first page.

    `device` is the sensor whose sheets its parameters come from, `starts` are start values other than the model's.
    """

    identifier: str
    module: str
    stop_time: float = 10.0
    step_size: float = 1e-3
    icon: str = "fmu.png"
    about: str = ""
    device: str = ""
    starts: tuple[tuple[str, float], ...] = ()


CATALOGUE = (
    Entry(
        "AttitudeSensor",
        "attitude_fmu.models.attitude_sensor",
        60.0,
        icon="attitude_sensor.png",
        about="Give it the true angular rate, specific force and ambient temperature at its place; read yaw, pitch "
        "and roll as the real device would report them, and every signal on the way. Its attitude has settled when "
        "the alignment time is over.",
        device=DEFAULT,
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
    Entry(
        "Turntable",
        "attitude_fmu.models.turntable",
        60.0,
        icon="turntable.png",
        about="Give it a profile of moves, rests and turns; read the true attitude, rate and specific force of a "
        "sensor on its plate, and when a rest is one to take results from.",
    ),
)


def with_device(entry: Entry, device: str, specimen: int = 0, values: Mapping[str, float] | None = None) -> Entry:
    """The entry with the parameters of a device, and of one piece of it, as start values; `values` win over them.

    It is called after both, ``AttitudeSensor_ADIS16354_150_specimen_3``: file, modelIdentifier and binaries, so that
    several of them can lie in a folder and run in a process.
    """
    if not entry.device:
        raise BuildError(f"{entry.identifier} is no sensor, it cannot be a {device}")
    try:
        starts = {**parameters(device, specimen), **(values or {})}
    except UnknownDeviceError as error:
        raise BuildError(str(error)) from None
    suffix = f"_specimen_{specimen}" if specimen else ""
    about = f"{_piece(specimen)} of {device}: {DEVICES[device].description}. {entry.about}"
    return entry._replace(
        identifier=f"{entry.identifier}_{device}{suffix}", about=about, device=device, starts=tuple(starts.items())
    )


def _piece(specimen: int) -> str:
    return f"Specimen {specimen}, drawn from the tolerances," if specimen else "A nominal piece, without errors,"


def entry(identifier: str) -> Entry:
    """The entry called `identifier`, which may name a device and a specimen (`with_device`)."""
    for candidate in CATALOGUE:
        if candidate.identifier == identifier:
            return candidate
        before, found, rest = identifier.partition(f"{candidate.identifier}_")
        device, numbered, specimen = rest.partition("_specimen_")
        is_piece = specimen.isdecimal() if numbered else True
        if candidate.device and found and not before and device in DEVICES and is_piece:
            return with_device(candidate, device, int(specimen or 0))
    known = ", ".join(candidate.identifier for candidate in CATALOGUE)
    devices = ", ".join(f"_{device}" for device in DEVICES)
    raise BuildError(f"there is no FMU called {identifier}; there are {known}, and AttitudeSensor with {devices}")


def _written(entry: Entry) -> Model:
    """The model as its module defines it."""
    try:
        model = importlib.import_module(entry.module).MODEL
    except Exception as error:  # whatever a module of the user's raises
        raise BuildError(f"module {entry.module}: {type(error).__name__}: {error}") from error
    if not isinstance(model, Model):
        raise BuildError(f"module {entry.module}: its MODEL is no Model of attitude_fmu.models.system")
    return model


def model_of(entry: Entry) -> Model:
    """The model of an entry, with the entry's start values."""
    model = _written(entry)
    if not entry.starts:
        return model
    try:
        started = model._replace(Parameters=with_defaults(model.Parameters, dict(entry.starts)))
    except KeyError as error:
        raise BuildError(f"{entry.identifier} has no parameter {error}") from None
    if entry.device:
        parts = DEVICES[entry.device].description
        started = started._replace(description=f"Six-axis MEMS attitude sensor: {parts}, filters and attitude solver")
    wanted = defaults(started.Parameters)
    check(started.Parameters, flatten(wanted), entry.identifier)
    check_rules(started, wanted, entry.identifier)
    return started
