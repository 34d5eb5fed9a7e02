"""What an FMU offers: its variables, their types and units, and the values that they take.

A typed view of FMPy's model description, so that the rest of the package need not know it.
"""

from __future__ import annotations

import math
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from fmpy import read_model_description  # type: ignore[import-untyped]

from .errors import SystemRefusedError

Value = float | int | bool | str

_INT32 = (-(2**31), 2**31 - 1)
_TRUTHS = {"true": True, "1": True, "false": False, "0": False}


class Unit(NamedTuple):
    """A unit in SI base units: ``SI value = factor * value + offset``; `exponents` of kg, m, s, A, K, mol, cd, rad."""

    name: str
    exponents: tuple[int, ...]
    factor: float
    offset: float

    def same_quantity(self, other: Unit) -> bool:
        """Whether values in the two units are equal numbers for equal quantities."""
        return self[1:] == other[1:]


class Item(NamedTuple):
    """One choice of an enumeration."""

    name: str
    value: int


class Variable(NamedTuple):
    """One scalar variable of an FMU, as its model description declares it.

    `type` is Real, Integer, Boolean, String or Enumeration; `items` are the choices of an Enumeration, `minimum` and
    `maximum` the allowed range where one is declared (the 32 bits of an Integer are its widest).
    """

    name: str
    reference: int
    type: str
    causality: str
    variability: str
    initial: str | None
    unit: str | None
    start: str | None
    description: str
    type_name: str | None
    items: tuple[Item, ...]
    minimum: float | None = None
    maximum: float | None = None

    @property
    def settable(self) -> bool:
        """Whether a start value may be given before initialisation."""
        if self.causality == "input":
            return True
        return self.variability != "constant" and self.initial in {"exact", "approx"}

    @property
    def start_value(self) -> Value | None:
        """The declared start value, None where there is none."""
        return None if self.start is None else self._parsed(self.start.strip(), self.start)

    def value(self, given: Value) -> Value:
        """The value of this variable's type that `given` means: a number, true or false, or the name of a choice.

        Raises `SystemRefusedError` for a value that the variable cannot take.
        """
        text = str(given).strip()
        try:
            value = self._parsed(text, given)
        except (ValueError, KeyError):
            raise SystemRefusedError(f"{self.name} = {text}: not {self._wanted()}") from None
        if self.type in ("Real", "Integer"):
            self._check_range(float(value))
        return value

    def _check_range(self, value: float) -> None:
        below = self.minimum is not None and value < self.minimum
        if below or (self.maximum is not None and value > self.maximum):
            unit = f" {self.unit}" if self.unit and self.unit != "1" else ""
            why = "small" if below else "large"
            raise SystemRefusedError(f"{self.name} = {_digits(value)}{unit}: too {why} (allowed: {self.allowed})")

    @property
    def allowed(self) -> str:
        """The declared range in words with its unit, nothing where none is declared."""
        unit = f" {self.unit}" if self.unit and self.unit != "1" else ""
        if self.minimum is not None and self.maximum is not None:
            return f"{_digits(self.minimum)} to {_digits(self.maximum)}{unit}"
        if self.minimum is not None:
            return f"{_digits(self.minimum)}{unit} or more"
        return "" if self.maximum is None else f"{_digits(self.maximum)}{unit} or less"

    def _parsed(self, text: str, given: Value) -> Value:
        if self.type == "Real":
            number = float(text)
            if not math.isfinite(number):
                raise ValueError
            return number
        if self.type == "Integer":
            return int(text)
        if self.type == "Boolean":
            return _TRUTHS[text.lower()]
        if self.type == "Enumeration":
            by_name = {item.name: item.value for item in self.items}
            number = by_name[text] if text in by_name else int(text)
            if number not in by_name.values():
                raise ValueError
            return number
        return str(given)

    def _wanted(self) -> str:
        if self.type == "Enumeration":
            return "one of " + ", ".join(f"{item.name} ({item.value})" for item in self.items)
        return {
            "Real": f"a finite number{f' ({self.unit})' if self.unit else ''}",
            "Integer": "a whole number",
            "Boolean": "true or false",
        }.get(self.type, f"a {self.type}")


class Interface(NamedTuple):
    """What one FMU offers; `description` is FMPy's own model description."""

    model_name: str
    variables: Mapping[str, Variable]
    units: Mapping[str, Unit]
    description: Any


def _digits(value: float) -> str:
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else f"{value:.9g}"


def read_interface(fmu: Path | str) -> Interface:
    """Read what an FMU file offers.

    Raises `SystemRefusedError` if the file is missing, is no FMU, or is not an FMI 2.0 co-simulation FMU.
    """
    fmu = Path(fmu)
    if not fmu.is_file():
        raise SystemRefusedError(f"FMU not found: {fmu}")
    try:
        description = read_model_description(str(fmu), validate=False)
    except (zipfile.BadZipFile, KeyError) as error:
        raise SystemRefusedError(f"{fmu.name} is not an FMU ({error})") from None
    except Exception as error:  # FMPy raises bare Exception for whatever else it finds
        raise SystemRefusedError(f"{fmu.name} cannot be read: {error}") from error
    if description.fmiVersion != "2.0":
        raise SystemRefusedError(f"{fmu.name} is an FMI {description.fmiVersion} FMU; FMI 2.0 is wanted")
    if description.coSimulation is None:
        raise SystemRefusedError(f"{fmu.name} is for model exchange only; export it for co-simulation")
    return Interface(
        description.modelName,
        {variable.name: _variable(variable) for variable in description.modelVariables},
        {unit.name: _unit(unit) for unit in description.unitDefinitions or []},
        description,
    )


def _variable(variable: Any) -> Variable:
    declared = variable.declaredType
    items = [] if declared is None else declared.items or []
    return Variable(
        variable.name,
        int(variable.valueReference),
        variable.type,
        variable.causality or "local",
        variable.variability or "continuous",
        variable.initial,
        variable.unit or getattr(declared, "unit", None),
        variable.start,
        variable.description or "",
        None if declared is None else declared.name,
        tuple(Item(item.name, int(item.value)) for item in items),
        *_range(variable),
    )


def _range(variable: Any) -> tuple[float | None, float | None]:
    places = (variable, variable.declaredType)
    bounds = [next((b for p in places if (b := getattr(p, side, None)) is not None), None) for side in ("min", "max")]
    if variable.type == "Integer":
        low, high = _INT32
        return float(low if bounds[0] is None else bounds[0]), float(high if bounds[1] is None else bounds[1])
    least, most = (None if bound is None else float(bound) for bound in bounds)
    return least, most


def _unit(unit: Any) -> Unit:
    base = unit.baseUnit
    if base is None:
        # only the name tells such units apart
        return Unit(unit.name, (0,) * 8, 1.0, 0.0)
    exponents = tuple(int(getattr(base, name)) for name in ("kg", "m", "s", "A", "K", "mol", "cd", "rad"))
    return Unit(unit.name, exponents, float(base.factor), float(base.offset))
