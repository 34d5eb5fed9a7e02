"""Sensors as parameter sets: `device_parameters` for a `System`, `write_device` for an ``.ssv`` file.

``device_parameters("ADIS16354_150", 3)`` makes the component ``sensor`` of a system piece 3 of that device; later
sets override single numbers. A set without component, ``component=""``, has the plain names of the FMU: so does an
``.ssv`` that an ``.ssp`` binds to the component itself, which every SSP tool reads.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from attitude_fmu.fmu_src.errors import did_you_mean

from ..fmu_src.units import BASE_UNITS, parse
from ..models.attitude_sensor import MODEL
from ..models.record import Boolean, Enumeration, Fact, Integer, leaves
from ..models.sensors.devices import DEVICES, parameters
from .errors import SystemRefusedError
from .interface import Interface, Item, Unit, Value, Variable
from .ssp import write_ssv
from .system import ParameterSet


def device_parameters(device: str, specimen: int = 0, component: str = "sensor") -> ParameterSet:
    """Every parameter of a device and of one piece of it, for the attitude sensor that is called `component`.

    Raises `SystemRefusedError` for a device that there is not, `UnknownDeviceError` for such a specimen.
    """
    known_device(device)
    name = f"{device}_specimen_{specimen}" if specimen else device
    return sensor_parameters(name, parameters(device, specimen), component)


def sensor_parameters(name: str, values: Mapping[str, Value], component: str = "sensor") -> ParameterSet:
    """Parameters of the attitude sensor as a set for the one that is called `component`, with their units."""
    prefix = f"{component}." if component else ""
    units = {f"{prefix}{key}": unit for key, unit in _units().items() if key in values}
    return ParameterSet(name, {f"{prefix}{key}": value for key, value in values.items()}, units)


def known_device(device: str) -> None:
    """Raise `SystemRefusedError`, with what may be meant, for a device that there is not."""
    if device not in DEVICES:
        hint = did_you_mean(device.upper(), DEVICES) or did_you_mean(device, DEVICES)
        raise SystemRefusedError(f"there is no device called {device!r}{hint} (devices: {', '.join(DEVICES)})")


def write_device(path: Path, device: str, specimen: int = 0, component: str = "sensor") -> Path:
    """Write those parameters, with their units, as an ``.ssv`` file.

    Raises `ResultsError` if the file cannot be written.
    """
    return write_sensor_parameters(path, device_parameters(device, specimen, component), component)


def write_sensor_parameters(path: Path, parameters: ParameterSet, component: str = "sensor") -> Path:
    """Write what `sensor_parameters` gave for this `component` as an ``.ssv`` file.

    Raises `ResultsError` if the file cannot be written.
    """
    variables = {name: _variable(name, fact) for name, fact in _facts().items()}
    return write_ssv(parameters, path, {component: Interface(MODEL.name, variables, {}, None)})


def _facts() -> dict[str, Fact]:
    return {leaf.name: leaf.fact for leaf in leaves(MODEL.Parameters)}


def _is_real(fact: Fact) -> bool:
    return not isinstance(fact, Integer | Boolean | Enumeration)


def _units() -> dict[str, Unit]:
    """Units of the parameters; not those that a set cannot define, with roots in them, nor the unit 1."""
    found = {}
    for name, fact in _facts().items():
        unit = parse(fact.unit)
        if _is_real(fact) and unit.exponents and unit.is_whole:
            exponents = tuple(int(unit.exponents.get(symbol, 0)) for symbol in BASE_UNITS)
            found[name] = Unit(fact.unit, exponents, unit.factor, 0.0)
    return found


def _variable(name: str, fact: Fact) -> Variable:
    items = tuple(Item(item.name, i) for i, item in enumerate(getattr(fact, "items", ()), 1))
    unit = fact.unit if _is_real(fact) else None
    kind = type(fact).__name__
    return Variable(name, 0, kind, "parameter", "fixed", "exact", unit, None, fact.description, None, items)
