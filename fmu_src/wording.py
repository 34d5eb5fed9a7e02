"""What is said of each variable: its field's description, and which of several it is.

Variables of one description (the elements of a tuple, a record used more than once) are told apart by what differs in
their names: ``true angular rate (forward)``, ``joint angle (pitch)``, ``full scale (gyro)``.
"""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..models.record import Real
from .interface import Variable

_AXES = ("right", "forward", "up")
_AXIS_UNITS = ("rad/s", "rad/s2", "m/s2", "m", "kg.m", "rad/(s.K)", "m/(s2.K)")
"""Three numbers in one of these units are a vector along the body's (or part's) own axes."""


def _is_along_axes(variable: Variable, group: Sequence[Variable]) -> bool:
    tuple_of_it = variable.name.rpartition("[")[0] + "["
    size = sum(other.name.startswith(tuple_of_it) for other in group)
    return size == 3 and isinstance(variable.fact, Real) and variable.fact.unit in _AXIS_UNITS


def _parts(variable: Variable, group: Sequence[Variable]) -> list[str]:
    """The parts of the name; an index at its end is a part of its own."""
    stem, _, index = variable.name.removesuffix("]").rpartition("[") if variable.name.endswith("]") else ("", "", "")
    parts = re.sub(r"\[(\d+)\]", r" \1", stem or variable.name).split(".")
    if "," in index:
        row, column = index.split(",")
        parts.append(f"row {row}, column {column}")
    elif index:
        parts.append(_AXES[int(index) - 1] if _is_along_axes(variable, group) else f"element {index}")
    return parts


def _differences(names: list[list[str]]) -> list[list[str]]:
    """What remains of each name without the parts that all have in common."""
    if len({len(name) for name in names}) > 1:
        common = set(names[0]).intersection(*names[1:])
        return [[part for part in name if part not in common] for name in names]
    telling = [place for place, parts in enumerate(zip(*names, strict=True)) if len(set(parts)) > 1]
    return [[name[place] for place in telling] for name in names]


def descriptions(variables: Sequence[Variable]) -> list[str]:
    """A description of each variable, different from all others of its causality."""
    groups: dict[tuple[str, str], list[Variable]] = {}
    for variable in variables:
        groups.setdefault((variable.causality, variable.fact.description), []).append(variable)
    texts = {}
    for (_, text), group in groups.items():
        places = _differences([_parts(variable, group) for variable in group])
        for variable, place in zip(group, places, strict=True):
            texts[variable.name] = f"{text} ({', '.join(place)})" if place else text
    return [texts[variable.name] for variable in variables]
