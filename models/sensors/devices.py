"""Whole sensors by name: which parts they are made of, their parameters in SI with their sources, and single pieces.

``parameters("ADIS16354_150")`` is a nominal piece, all that differs from piece to piece being zero;
``parameters("ADIS16354_150", 3)`` is piece number 3 of all that the tolerances allow, the same on every machine.
Every number is a parameter of the attitude sensor and can be overridden. What belongs to the processor (its period,
the solver and its tuning, the ADIS16354's null on command) is not the sensor's and stays as it is.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import count
from typing import Any, NamedTuple

from ..errors import AttitudeFmuError
from ..noise import normals, philox4x64, stream_of
from ..record import Boolean, Enumeration, Fact, Integer, leaves
from .accelerometer import AccelerometerParameters
from .adis16354_sheet import ACCELEROMETERS, ACCELEROMETERS_75, GYROS_75, GYROS_150, GYROS_300
from .adxl355_sheet import ADXL355_2G, ADXL355_4G, ADXL355_8G
from .adxrs450_sheet import ADXRS450, ADXRS453
from .datasheet import Choice, Datum, Origin, Part, Tolerance, in_si
from .gyro import GyroParameters

BOARD_AROUND = Part(
    "board around the parts",
    {"supply.nominal": Datum(5.0, "V", "ADXRS450 Rev. 0 Table 1; ADIS16350/55 Rev. B Table 1, conditions")},
    {"processor.clock_error": Tolerance(50.0, "ppm", "limits", "crystals, 20 to 50 ppm", "recalled")},
)
"""What the parts need of their board."""

_OF_THE_RUN = {"self_test", "thermal.warmed_up"}
"""What no part has, but the experiment chooses."""


class UnknownDeviceError(AttitudeFmuError, KeyError):
    """No device is called so, or it has no such piece."""

    def __str__(self) -> str:
        return str(self.args[0])


class Device(NamedTuple):
    """A whole sensor."""

    name: str
    description: str
    gyro: Part
    accelerometer: Part


DEVICES = {
    device.name: device
    for device in (
        Device("ADXRS450_ADXL355", "three ADXRS450, one ADXL355 at +-2 g", ADXRS450, ADXL355_2G),
        Device("ADXRS450_ADXL355_4g", "three ADXRS450, one ADXL355 at +-4 g", ADXRS450, ADXL355_4G),
        Device("ADXRS450_ADXL355_8g", "three ADXRS450, one ADXL355 at +-8 g", ADXRS450, ADXL355_8G),
        Device("ADXRS453_ADXL355", "three ADXRS453, one ADXL355 at +-2 g", ADXRS453, ADXL355_2G),
        Device("ADIS16354_300", "one ADIS16354 at +-300 deg/s, 4 taps", GYROS_300, ACCELEROMETERS),
        Device("ADIS16354_150", "one ADIS16354 at +-150 deg/s, 4 taps", GYROS_150, ACCELEROMETERS),
        Device("ADIS16354_75", "one ADIS16354 at +-75 deg/s, 16 taps", GYROS_75, ACCELEROMETERS_75),
    )
}
DEFAULT = "ADXRS450_ADXL355"
"""The parts whose numbers the model has by default, there with the errors of one board (`board`)."""


def device_called(name: str) -> Device:
    """The device of this name.

    Raises `UnknownDeviceError` with the known ones.
    """
    if name not in DEVICES:
        raise UnknownDeviceError(f"there is no device called {name}; there are {', '.join(DEVICES)}")
    return DEVICES[name]


class _Field(NamedTuple):
    """A parameter: its name, its place in its part (from 1, the row for a matrix; none for a scalar), its part."""

    name: str
    key: str
    place: tuple[int, ...]
    fact: Fact | None
    part: Part


def _fields(device: Device) -> Iterator[_Field]:
    for prefix, part, record in (
        ("gyro", device.gyro, GyroParameters),
        ("accelerometer", device.accelerometer, AccelerometerParameters),
    ):
        for leaf in leaves(record):
            key, _, place = leaf.name.removesuffix("]").partition("[")
            if key not in _OF_THE_RUN:
                places = tuple(map(int, place.split(","))) if place else ()
                yield _Field(f"{prefix}.{leaf.name}", key, places, leaf.fact, part)
    for key in (*BOARD_AROUND.numbers, *BOARD_AROUND.tolerances):
        yield _Field(key, key, (), None, BOARD_AROUND)


def _origin(field: _Field) -> Origin:
    if field.key in field.part.tolerances:
        return field.part.tolerances[field.key]
    number = field.part.numbers[field.key]
    return number if isinstance(number, Datum | Choice) else number[field.place[0] - 1]


def origins(name: str) -> dict[str, Origin]:
    """Where each parameter of a device comes from."""
    return {field.name: _origin(field) for field in _fields(device_called(name))}


def _common(field: _Field, origin: Origin) -> Any:
    """What all pieces have in common; nothing, where they differ."""
    if isinstance(origin, Choice):
        assert isinstance(field.fact, Enumeration)
        return field.fact.value(origin.item)
    value = 0.0 if isinstance(origin, Tolerance) else origin.si
    whole = isinstance(field.fact, Integer | Boolean)
    return int(value) if whole else float(value)


def _deviation(tolerance: Tolerance, number: int, name: str) -> float:
    """What piece `number` has, in the tolerance's unit; keyed by name, so that other parameters do not move it."""
    key = (number, stream_of(tolerance.shared or name))
    if tolerance.reading == "limits":
        word = philox4x64((0, 0, 0, 0), key)[0]
        return tolerance.mean + tolerance.size * (2.0 * ((word >> 11) + 0.5) * 2.0**-53 - 1.0)
    is_limit = tolerance.reading == "three sigma"
    sigma, limit = (tolerance.size / 3.0, tolerance.size) if is_limit else (tolerance.size, tolerance.limit)
    drawn = (sigma * normals(key, call, 1)[0] for call in count())
    return tolerance.mean + next(x for x in drawn if abs(x) <= limit)


def _within_limits(datum: Datum, limits: tuple[float, float], number: int, name: str) -> float:
    """What piece `number` has, in the datum's unit: as likely below the typical number as above, evenly to the limits.

    That it is even is an assumption; the sheets print typical number and limits alone.
    """
    share = 2.0 * ((philox4x64((0, 0, 0, 0), (number, stream_of(name)))[0] >> 11) + 0.5) * 2.0**-53
    low, high = limits
    return low + share * (datum.value - low) if share < 1.0 else datum.value + (share - 1.0) * (high - datum.value)


def specimen(name: str, number: int) -> dict[str, float]:
    """What piece `number` of a device has of its own: errors drawn from its tolerances, all zero for number 0.

    Pieces from 1 on also have their own of the numbers that the sheet prints with limits.
    """
    if not 0 <= number < 2**31:
        raise UnknownDeviceError(f"there is no specimen {number} of {name} (allowed: 0 to {2**31 - 1})")
    drawn = {}
    for field in _fields(device_called(name)):
        origin = _origin(field)
        if isinstance(origin, Tolerance):
            # a reading's own axis is no other axis: its share is the scale error
            own = field.key == "cross_axis" and field.place[0] == field.place[1]
            drawn[field.name] = (
                0.0 if own or number == 0 else in_si(_deviation(origin, number, field.name), origin.unit)
            )
        elif isinstance(origin, Datum) and origin.limits is not None and number > 0:
            drawn[field.name] = in_si(_within_limits(origin, origin.limits, number, field.name), origin.unit)
    return drawn


def parameters(name: str, number: int = 0) -> dict[str, Any]:
    """Every parameter of a device, of piece `number`, by its structured name."""
    common = {field.name: _common(field, _origin(field)) for field in _fields(device_called(name))}
    return {**common, **specimen(name, number)}
