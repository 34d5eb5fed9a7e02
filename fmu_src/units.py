"""Units: every unit that a record may carry, as a product of powers of the SI's base units; and what they measure.

A unit is written as in FMI and Modelica: ``rad/s``, ``m/s2``, ``N.m``, ``rad/(s.Hz^0.5)``. Whatever the table below
cannot explain is refused when the FMU is built.
"""

from __future__ import annotations

import math
import re
from fractions import Fraction
from typing import NamedTuple

from ..models.errors import AttitudeFmuError
from ..models.record import Real

BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
"""The base units of FMI 2.0, in its order."""

_SYMBOLS: dict[str, tuple[float, str]] = {
    # what one of it is: factor and unit
    "Hz": (1.0, "1/s"),
    "N": (1.0, "kg.m/s2"),
    "Pa": (1.0, "kg/(m.s2)"),
    "J": (1.0, "kg.m2/s2"),
    "W": (1.0, "kg.m2/s3"),
    "C": (1.0, "A.s"),
    "V": (1.0, "kg.m2/(A.s3)"),
    "Ohm": (1.0, "kg.m2/(A2.s3)"),
    "F": (1.0, "A2.s4/(kg.m2)"),
    "H": (1.0, "kg.m2/(A2.s2)"),
    "Wb": (1.0, "kg.m2/(A.s2)"),
    "T": (1.0, "kg/(A.s2)"),
    "deg": (math.pi / 180.0, "rad"),
    "mrad": (1e-3, "rad"),
    "urad": (1e-6, "rad"),
    "rpm": (2.0 * math.pi / 60.0, "rad/s"),
    "min": (60.0, "s"),
    "h": (3600.0, "s"),
    "ms": (1e-3, "s"),
    "us": (1e-6, "s"),
    "kHz": (1e3, "1/s"),
    "mm": (1e-3, "m"),
    "km": (1e3, "m"),
    "mN": (1e-3, "kg.m/s2"),
    "mW": (1e-3, "kg.m2/s3"),
    "mV": (1e-3, "kg.m2/(A.s3)"),
    "hPa": (1e2, "kg/(m.s2)"),
    "degC": (1.0, "K"),
    "ppm": (1e-6, "1"),
    "%": (1e-2, "1"),
}

_OFFSETS = {"degC": -273.15}


class Quantity(NamedTuple):
    """What a unit measures: its name, usual magnitude, the unit to show it in; whether offsets do not apply."""

    name: str
    nominal: float
    display: str | None = None
    relative: bool = False


_QUANTITIES = {
    "rad": Quantity("Angle", 0.1, "deg"),
    "rad/s": Quantity("AngularVelocity", 1.0, "deg/s"),
    "rad/s2": Quantity("AngularAcceleration", 1.0, "deg/s2"),
    "m": Quantity("Length", 0.1),
    "m2": Quantity("Area", 0.1),
    "m/s": Quantity("Velocity", 1.0),
    "m/s2": Quantity("Acceleration", 10.0),
    "s": Quantity("Time", 1.0),
    "Hz": Quantity("Frequency", 100.0),
    "kg": Quantity("Mass", 1.0),
    "kg/m3": Quantity("Density", 1.0),
    "kg.m2": Quantity("MomentOfInertia", 0.01),
    "N.m": Quantity("Torque", 0.1),
    "N.m.s": Quantity("AngularMomentum", 0.01),
    "N.m/rad": Quantity("RotationalStiffness", 1e3),
    "N.m.s/rad": Quantity("RotationalDamping", 1.0),
    "K": Quantity("TemperatureDifference", 10.0, relative=True),
}
_TEMPERATURE = Quantity("Temperature", 300.0, "degC")
"""What is in K and shown in degC; anything else in K is a difference, which no offset must touch."""


def quantity_of(fact: Real) -> Quantity | None:
    """The physical quantity of a field, None if its unit is not a common one."""
    if fact.unit == "K" and fact.display == _TEMPERATURE.display:
        return _TEMPERATURE
    return _QUANTITIES.get(fact.unit)


def completed(fact: Real) -> Real:
    """The field with its quantity's display unit and magnitude where it gives none of its own."""
    quantity = quantity_of(fact)
    if quantity is None:
        return fact
    return fact._replace(
        display=quantity.display if fact.display is None else fact.display,
        nominal=quantity.nominal if fact.nominal is None else fact.nominal,
    )


_DOT = re.compile(r"\.(?=[A-Za-z%])")  # not the one inside an exponent such as ^0.5
_FACTOR = re.compile(r"([A-Za-z%]+)(?:\^?(-?\d+(?:\.\d+)?))?")


class UnknownUnitError(AttitudeFmuError, ValueError):
    """A unit that is not in the table."""


class Unit(NamedTuple):
    """``factor`` times a product of powers of the base units."""

    factor: float
    exponents: dict[str, Fraction]

    @property
    def is_whole(self) -> bool:
        """Whether FMI can write the exponents, which it wants whole."""
        return all(exponent.denominator == 1 for exponent in self.exponents.values())


def _multiply(a: Unit, b: Unit, power: Fraction) -> Unit:
    exponents = dict(a.exponents)
    for symbol, exponent in b.exponents.items():
        exponents[symbol] = exponents.get(symbol, Fraction(0)) + exponent * power
    return Unit(a.factor * b.factor ** float(power), {s: e for s, e in exponents.items() if e})


def _symbol(name: str, whole: str) -> Unit:
    if name in BASE_UNITS:
        return Unit(1.0, {name: Fraction(1)})
    if name not in _SYMBOLS:
        raise UnknownUnitError(f"unit {whole!r}: {name!r} is not in the table of fmu_src/units.py")
    factor, definition = _SYMBOLS[name]
    return _multiply(Unit(factor, {}), parse(definition), Fraction(1))


def _product(text: str, sign: int, whole: str) -> Unit:
    product = Unit(1.0, {})
    for factor in _DOT.split(text.removeprefix("(").removesuffix(")")):
        if factor == "1":
            continue
        match = _FACTOR.fullmatch(factor)
        if match is None:
            raise UnknownUnitError(f"unit {whole!r}: cannot read {factor!r}")
        power = Fraction(match[2] or "1") * sign
        product = _multiply(product, _symbol(match[1], whole), power)
    return product


def parse(text: str) -> Unit:
    """The unit written as ``text``."""
    # an exponent such as ^0.5 holds the same dot as a product
    parts = text.split("/")
    if len(parts) > 2:
        raise UnknownUnitError(f"unit {text!r}: only one '/' allowed, write a/(b.c)")
    unit = Unit(1.0, {})
    for part, sign in zip(parts, (1, -1), strict=False):
        unit = _multiply(unit, _product(part, sign, text), Fraction(1))
    return unit


def display_of(display: str, unit: str) -> tuple[float, float]:
    """Factor and offset that show a value: ``shown = factor * value + offset``."""
    shown, held = parse(display), parse(unit)
    if shown.exponents != held.exponents:
        raise UnknownUnitError(f"display unit {display!r} is not of the kind of {unit!r}")
    return held.factor / shown.factor, _OFFSETS.get(display, 0.0)
