"""How a part's numbers are written down: value and unit as its datasheet has them, source, and how sure they are.

A `Part` says something about every parameter of its record, under the parameter's own name: what all pieces have in
common (`numbers`) and how they differ (`tolerances`). What no sheet gives is there as well, as the assumption it is.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, NamedTuple

from ..attitude.rotations import STANDARD_GRAVITY
from ..scalar import PI

CELSIUS_ZERO = 273.15
REFERENCE_TEMPERATURE = 25.0 + CELSIUS_ZERO
"""Temperature of the datasheets' typical numbers, K."""

CONFIDENCE = {
    "datasheet": "read in the text of the part's datasheet",
    "figure": "read by eye off a figure of it, +-20 % or worse",
    "driver": "read in driver source for the part",
    "calculated": "follows from such numbers",
    "sister": "from the datasheet of a sister part",
    "recalled": "from memory, not seen",
    "assumption": "engineering judgement, or zero where nothing is given",
}
"""How sure a number is."""

UNSURE = frozenset({"sister", "recalled", "assumption"})
"""Numbers that the part's own sheet may contradict."""

READINGS = {
    "sigma": "normal, with the number as standard deviation",
    "three sigma": "normal, with a third of the number as standard deviation, and none beyond it",
    "limits": "anything from minus to plus the number, equally likely",
}
"""What a tolerance is taken to say about the pieces."""

_DEGREE = PI / 180.0
_G = STANDARD_GRAVITY
_MINIMUM_TO_INSTABILITY = 1.0 / 0.664
"""B = (minimum of the Allan deviation) / sqrt(2 ln 2 / pi), IEEE Std 952 Annex C."""

_LARGEST_TO_RMS = 0.378
"""rms over the largest deviation of the cubic that the model bends its readings by, 0.1512/0.4 (`sensitivity`)."""

_FACTOR = {
    "1": 1.0,
    "%": 1e-2,
    "ppm": 1e-6,
    "%/degC": 1e-2,
    "%/degC2": 1e-2,
    "ppm/degC": 1e-6,
    "% FS rms": 1e-2,
    "% FS largest": 1e-2 * _LARGEST_TO_RMS,
    "Hz": 1.0,
    "s": 1.0,
    "ms": 1e-3,
    "K": 1.0,
    "K/W": 1.0,
    "V": 1.0,
    "LSB": 1.0,
    "LSB/degC": 1.0,
    "mV/LSB": 1e-3,
    "deg": _DEGREE,
    "deg/s": _DEGREE,
    "deg/s/LSB": _DEGREE,
    "deg/s/rtHz": _DEGREE,
    "deg/s/rts": _DEGREE,
    "deg/s/degC": _DEGREE,
    "deg/s/degC2": _DEGREE,
    "deg/s/V": _DEGREE,
    "deg/s/g": _DEGREE / _G,
    "deg/s/g2": _DEGREE / _G**2,
    "deg/h RAV minimum": _DEGREE / 3600.0 * _MINIMUM_TO_INSTABILITY,
    "deg/s RAV minimum": _DEGREE * _MINIMUM_TO_INSTABILITY,
    "g": _G,
    "mg": 1e-3 * _G,
    "mg/LSB": 1e-3 * _G,
    "ug/rtHz": 1e-6 * _G,
    "mg/rtHz": 1e-3 * _G,
    "mg/rts": 1e-3 * _G,
    "mg/degC": 1e-3 * _G,
    "mg/degC2": 1e-3 * _G,
    "mg/V": 1e-3 * _G,
    "g/g2": 1.0 / _G,
    "ug RAV minimum": 1e-6 * _G * _MINIMUM_TO_INSTABILITY,
    "mg RAV minimum": 1e-3 * _G * _MINIMUM_TO_INSTABILITY,
}
_OF_ONE_LSB = {"LSB/(deg/s)": _DEGREE, "LSB/g": _G, "degC/LSB": 1.0}
"""Units whose reciprocal a parameter wants."""


def in_si(value: float, unit: str) -> float:
    """A number of a datasheet as the parameter wants it: SI units; for a word length in bits, its largest code."""
    if unit == "bit":
        return float(2 ** int(value - 1))
    if unit == "degC":
        return value + CELSIUS_ZERO
    return _OF_ONE_LSB[unit] / value if unit in _OF_ONE_LSB else value * _FACTOR[unit]


class Datum(NamedTuple):
    """A number of a datasheet, with the lowest and highest that pieces may have where it prints them."""

    value: float
    unit: str
    source: str
    confidence: str = "datasheet"
    limits: tuple[float, float] | None = None

    @property
    def si(self) -> float:
        """The number as the parameter wants it (`in_si`)."""
        return in_si(self.value, self.unit)

    @property
    def text(self) -> str:
        """The number as the datasheet has it."""
        within = f" ({self.limits[0]:g} to {self.limits[1]:g})" if self.limits else ""
        return f"{self.value:.10g}" if self.unit == "1" else f"{self.value:.10g} {self.unit}{within}"


class Choice(NamedTuple):
    """An enumeration's item that a part has or is set to."""

    item: str
    source: str
    confidence: str = "datasheet"

    @property
    def text(self) -> str:
        """The item's name."""
        return self.item


class Tolerance(NamedTuple):
    """How a number differs from piece to piece: about `mean`, by `size` read as `reading` says, within +-`limit` of it.

    Parameters whose tolerances have the same `shared` name have the same deviation.
    """

    size: float
    unit: str
    reading: str
    source: str
    confidence: str = "datasheet"
    mean: float = 0.0
    limit: float = inf
    shared: str = ""

    @property
    def text(self) -> str:
        """The tolerance in words."""
        about = f"{self.mean:g} " if self.mean else ""
        within = f", within {self.limit:g}" if self.limit < inf else ""
        return f"{about}+-{self.size:g} {self.unit} ({self.reading}{within})"


Number = Datum | Choice | tuple[Datum, Datum, Datum]
"""The same on all axes, or one for each."""

Origin = Datum | Choice | Tolerance


def differs_from_piece_to_piece(origin: Origin) -> bool:
    """Whether a specimen has its own value."""
    return isinstance(origin, Tolerance) or (isinstance(origin, Datum) and origin.limits is not None)


class Part(NamedTuple):
    """What is known about a part; a parameter is in one of the two mappings."""

    name: str
    numbers: Mapping[str, Number]
    tolerances: Mapping[str, Tolerance]

    def datum(self, name: str) -> Datum:
        """The number of a parameter that is the same on all axes."""
        number = self.numbers[name]
        if not isinstance(number, Datum):
            raise TypeError(f"{self.name}: {name} is not one number")
        return number

    def si(self, name: str) -> float:
        """That number as the model wants it."""
        return self.datum(name).si

    def of_each_axis(self, name: str) -> tuple[float, float, float]:
        """The numbers of the three axes as the model wants them."""
        number = self.numbers[name]
        if isinstance(number, Choice):
            raise TypeError(f"{self.name}: {name} is no number")
        x, y, z = (number, number, number) if isinstance(number, Datum) else number
        return x.si, y.si, z.si

    def varied(
        self, name: str, numbers: Mapping[str, Number], tolerances: Mapping[str, Tolerance] | None = None
    ) -> Part:
        """Another version of the part, with other numbers here and there."""
        return Part(name, {**self.numbers, **numbers}, {**self.tolerances, **(tolerances or {})})

    def as_sister(self, name: str) -> Part:
        """The part as far as another one may be expected to be like it: no number is surer than that."""

        def weakened(number: Any) -> Any:
            if not hasattr(number, "confidence"):
                return tuple(weakened(datum) for datum in number)
            if number.confidence in UNSURE:
                return number
            return number._replace(source=f"{self.name} {number.source}", confidence="sister")

        return Part(
            name,
            {key: weakened(number) for key, number in self.numbers.items()},
            {key: weakened(tolerance) for key, tolerance in self.tolerances.items()},
        )


def not_given(unit: str, instead: str = "the sheet gives no number") -> Datum:
    """Zero, for a term that no sheet gives."""
    return Datum(0.0, unit, instead, "assumption")
