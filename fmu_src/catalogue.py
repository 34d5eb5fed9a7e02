"""The models that become FMUs."""

from __future__ import annotations

import hashlib
import importlib
import json
from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

from ..models.record import Boolean, Enumeration, Fact, allowed, check, defaults, flatten, leaves, with_defaults
from ..models.sensors.devices import DEFAULT, DEVICES, UnknownDeviceError, parameters
from ..models.system import Model, check_rules
from .errors import BuildError, did_you_mean

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


def with_device(entry: Entry, device: str, specimen: int = 0) -> Entry:
    """The entry with the parameters of a device, and of one piece of it, as start values.

    It is called after both, ``AttitudeSensor_ADIS16354_150_specimen_3``: file, modelIdentifier and binaries, so that
    several of them can lie in a folder and run in a process.
    """
    if not entry.device:
        raise BuildError(f"{entry.identifier} is no sensor, it cannot be a {device}")
    try:
        starts = parameters(device, specimen)
    except UnknownDeviceError as error:
        raise BuildError(f"{error}{'' if device in DEVICES else did_you_mean(device.upper(), DEVICES)}") from None
    suffix = f"_specimen_{specimen}" if specimen else ""
    about = f"{_piece(specimen)} of {device}: {DEVICES[device].description}. {entry.about}"
    return entry._replace(
        identifier=f"{entry.identifier}_{device}{suffix}", about=about, device=device, starts=tuple(starts.items())
    )


def with_values(entry: Entry, values: Mapping[str, Any]) -> Entry:
    """The entry with these start values as well: numbers, true or false, or names of choices.

    Eight digits of their digest end its name, so that other values make another file and do not replace it.
    """
    numbers = _numbers(entry, values)
    digest = hashlib.sha256(json.dumps(sorted(numbers.items())).encode()).hexdigest()[:8]
    starts = {**dict(entry.starts), **numbers}
    return entry._replace(identifier=f"{entry.identifier}_{digest}", starts=tuple(starts.items()))


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


def _numbers(entry: Entry, values: Mapping[str, Any]) -> dict[str, float]:
    """Values of the model's parameters as numbers."""
    facts = {leaf.name: leaf.fact for leaf in leaves(_written(entry).Parameters)}
    found = {}
    for name, value in values.items():
        if name not in facts:
            raise BuildError(f"{entry.identifier} has no parameter {name!r}{did_you_mean(name, facts)}")
        found[name] = _number(f"{entry.identifier}.{name}", value, facts[name])
    return found


def _number(where: str, value: Any, fact: Fact) -> float:
    if isinstance(fact, Enumeration) and value in [item.name for item in fact.items]:
        return fact.value(value)
    if isinstance(value, str) or not hasattr(value, "__float__"):
        kind = "choice" if isinstance(fact, Enumeration) else "switch" if isinstance(fact, Boolean) else "number"
        raise BuildError(f"{where} = {value!r}: not a {kind} (allowed: {allowed(fact)})")
    return float(value) if not isinstance(value, int) else int(value)


def model_of(entry: Entry) -> Model:
    """The model of an entry, with the entry's start values."""
    model = _written(entry)
    if not entry.starts:
        return model
    started = model._replace(Parameters=with_defaults(model.Parameters, _numbers(entry, dict(entry.starts))))
    if entry.device:
        parts = DEVICES[entry.device].description
        started = started._replace(description=f"Six-axis MEMS attitude sensor: {parts}, filters and attitude solver")
    wanted = defaults(started.Parameters)
    check(started.Parameters, flatten(wanted), entry.identifier)
    check_rules(started, wanted, entry.identifier)
    return started
