"""Labels of python-control's signals as structured FMI names."""

from __future__ import annotations

import keyword
import re
import unicodedata
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import NamedTuple, TypeVar

from attitude_fmu.fmu_src.errors import did_you_mean
from attitude_fmu.fmu_src.units import UnknownUnitError, parse, quantity_of
from attitude_fmu.models.linear_controller import Signal
from attitude_fmu.models.record import Real

from ..errors import ExportRefusedError

_UNIT = re.compile(r"(.*\S)\s*\[([^\[\]]+)\]\s*")
_INDEX = re.compile(r"(.*?)\[(\d+)\]")
_TAKEN = {"count", "index"}
"""What a NamedTuple needs for itself."""

Given = TypeVar("Given")


class Named(NamedTuple):
    """A signal's label, its legal name, and the unit that the label tells."""

    label: str
    name: str
    unit: str


def _is_unit(text: str) -> bool:
    if text.isdecimal():
        return False
    try:
        parse(text)
    except UnknownUnitError:
        return False
    return True


def _word(text: str) -> str:
    plain = unicodedata.normalize("NFKD", text)
    word = re.sub(r"\W+", "_", plain.encode("ascii", "ignore").decode()).strip("_")
    if not word or word[0].isdigit():
        word = f"signal_{word}".rstrip("_")
    return f"{word}_" if keyword.iskeyword(word) or word in _TAKEN else word


def _dotted(text: str) -> str:
    return ".".join(_word(part) for part in text.split("."))


def named(labels: Sequence[str]) -> list[Named]:
    """Legal names: words joined by dots, with one index at the end where all of a vector are there.

    ``u[0], u[1]`` become ``u[1], u[2]``, ``rate error [rad/s]`` becomes ``rate_error`` in rad/s.
    """
    parts: list[tuple[str, int | None, str]] = []
    for label in labels:
        with_unit = _UNIT.fullmatch(label)
        text, unit = (with_unit[1], with_unit[2]) if with_unit and _is_unit(with_unit[2]) else (label, "")
        indexed = _INDEX.fullmatch(text)
        parts.append((_dotted(indexed[1]), int(indexed[2]), unit) if indexed else (_dotted(text), None, unit))
    found = []
    for label, (stem, index, unit) in zip(labels, parts, strict=True):
        indices = sorted(other for name, other, _ in parts if name == stem and other is not None)
        first, whole = (indices[:1] or [1])[0], list(range(len(indices)))
        is_vector = first in (0, 1) and indices == [first + i for i in whole]
        if index is None:
            name = stem
        elif is_vector:
            name = f"{stem}[{index + 1 - first}]"
        else:
            name = f"{stem}_{index}"
        found.append(Named(label, name, unit))
    return found


def matching(name: Named, given: Mapping[str, Given]) -> Given | None:
    """What is given for a signal by its label, its name, or the record or vector that it lies in; the nearest wins."""
    keys = [key for key in given if key in (name.label, name.name) or name.name.startswith((f"{key}.", f"{key}["))]
    return given[max(keys, key=len)] if keys else None


def check_keys(given: Iterable[str], names: Sequence[Named], what: str) -> None:
    """Raise `ExportRefusedError` for a key that means none of the signals."""
    for key in given:
        if not any(matching(name, {key: True}) for name in names):
            known = [one.name for one in names]
            raise ExportRefusedError(
                f"{what}: there is no signal {key}{did_you_mean(key, known)} (signals: {', '.join(known)})"
            )


def unit_of(name: Named, units: Mapping[str, str]) -> str:
    """A signal's unit: the given one, else its label's, else 1.

    Raises `ExportRefusedError` for an unknown unit.
    """
    unit = matching(name, units) or name.unit or "1"
    try:
        parse(unit)
    except UnknownUnitError as error:
        raise ExportRefusedError(f"units: {name.name}: {error}; write it in these, such as rad/s, N.m, m/s2") from None
    return unit


def check_names(groups: Mapping[str, Sequence[Signal]], reserved: Collection[str]) -> None:
    """Raise `ExportRefusedError` for two signals of one name, or one whose first word is `reserved`."""
    remedy = "; give other names with inputs=[...], outputs=[...], or label the states anew"
    quantities = [quantity_of(Real(signal.unit, "")) for signals in groups.values() for signal in signals]
    types = {quantity.name for quantity in quantities if quantity is not None}
    before: list[tuple[str, str]] = []
    for kind, signals in groups.items():
        for signal in signals:
            name = signal.name
            if re.split(r"[.\[]", name)[0] in reserved or name in types:
                raise ExportRefusedError(f"the {kind} {name} has a name that the FMU needs for itself{remedy}")
            for other_kind, other in before:
                outer, inner = sorted((name, other), key=len)
                if name == other or (kind == other_kind and inner.startswith((f"{outer}.", f"{outer}["))):
                    raise ExportRefusedError(f"the {kind} {name} collides with the {other_kind} {other}{remedy}")
            before.append((kind, name))
