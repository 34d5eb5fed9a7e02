"""Records: the parameters, inputs, state and outputs of a model, each field with its FMI facts written once.

A record is a `NamedTuple` whose fields are ``Annotated`` with a `Real`, `Integer`, `Boolean` or `Enumeration`.
Records nest, and fields may be tuples; the nesting is the structured FMI name::

    gyro.noise_density        a field of a record in a record
    gyro.bias[2]              the second of a tuple
    gyro.cross_axis[1,3]      a tuple of tuples
    gyro[3].scale             a tuple of records

Everything else (FMI variables, XML, C tables, reference pages, value checks) is derived from `leaves`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

from .errors import ValueRefusedError, digits
from .scalar import Scalar, where


class Real(NamedTuple):
    """A real number: unit in FMI notation, text, allowed range, display unit, magnitude, tunable while running.

    What is hidden is part of the state, and no FMI variable: long memories that nobody looks at.
    """

    unit: str
    description: str
    min: float | None = None
    max: float | None = None
    display: str | None = None
    nominal: float | None = None
    tunable: bool = False
    hidden: bool = False


class Integer(NamedTuple):
    """A whole number, held as a float in state and outputs."""

    description: str
    min: int | None = None
    max: int | None = None
    tunable: bool = False
    unit: str = "1"
    hidden: bool = False


class Boolean(NamedTuple):
    """A switch; 0.0 or 1.0 where it is computed with."""

    description: str
    tunable: bool = False
    unit: str = "1"


class Item(NamedTuple):
    """One choice of an enumeration; its number is its place, counted from 1."""

    name: str
    description: str


class Enumeration(NamedTuple):
    """A choice among named ways; the value is the item's number, counted from 1."""

    type_name: str
    items: tuple[Item, ...]
    description: str
    tunable: bool = False
    unit: str = "1"

    def value(self, name: str) -> int:
        """Number of the item called `name`."""
        return [item.name for item in self.items].index(name) + 1


Fact = Real | Integer | Boolean | Enumeration

Vector3 = tuple[Any, Any, Any]
Quaternion = tuple[Any, Any, Any, Any]
Matrix3 = tuple[Vector3, Vector3, Vector3]


class Leaf(NamedTuple):
    """One scalar of a record: its structured name, facts and start value (None where the record gives none)."""

    name: str
    fact: Fact
    start: Any


_MISSING = object()


def _fields(record: Any) -> list[tuple[str, Any, Any]]:
    defaults = record._field_defaults
    hints = get_type_hints(record, include_extras=True)
    return [(name, hints[name], defaults.get(name, _MISSING)) for name in record._fields]


def _is_record(kind: Any) -> bool:
    return isinstance(kind, type) and hasattr(kind, "_fields")


def _walk(prefix: str, kind: Any, fact: Fact | None, start: Any) -> Iterator[Leaf]:
    if hasattr(kind, "__metadata__"):
        kind, fact = get_args(kind)[0], kind.__metadata__[0]
    if _is_record(kind):
        for name, hint, default in _fields(kind):
            value = getattr(start, name) if start is not _MISSING else default
            yield from _walk(f"{prefix}.{name}" if prefix else name, hint, fact, value)
    elif get_origin(kind) is tuple:
        stem = f"{prefix[:-1]}," if prefix.endswith("]") else f"{prefix}["
        for i, element in enumerate(get_args(kind)):
            yield from _walk(f"{stem}{i + 1}]", element, fact, start[i] if start is not _MISSING else _MISSING)
    elif fact is None:
        raise TypeError(f"field {prefix} carries no FMI fact")
    else:
        yield Leaf(prefix, fact, None if start is _MISSING else start)


@cache
def leaves(record: type) -> tuple[Leaf, ...]:
    """Every scalar of a record class, in order, with its structured name."""
    return tuple(_walk("", record, None, _MISSING))


def flatten(value: Any) -> list[Any]:
    """The scalars of a record, in the order of `leaves`; a plain tuple in it holds scalars or tuples, not both."""
    flat: list[Any] = []
    for item in value:
        if not isinstance(item, tuple):
            flat.append(item)
        elif type(item) is tuple and item and not isinstance(item[0], tuple):
            flat += item  # long memories at once
        else:
            flat += flatten(item)
    return flat


def _builder(kind: Any) -> Callable[[Iterator[Any]], Any]:
    if hasattr(kind, "__metadata__"):
        kind = get_args(kind)[0]
    if _is_record(kind):
        parts = [_builder(hint) for _, hint, _ in _fields(kind)]
        return lambda values: kind(*[part(values) for part in parts])
    if get_origin(kind) is tuple:
        parts = [_builder(element) for element in get_args(kind)]
        return lambda values: tuple([part(values) for part in parts])
    return next


@cache
def _record_builder(record: type) -> Callable[[Iterator[Any]], Any]:
    return _builder(record)


def unflatten(record: type, values: Iterable[Any]) -> Any:
    """The record whose scalars are `values`, the inverse of `flatten`."""
    return _record_builder(record)(iter(values))


def choose(condition: Scalar, a: Any, b: Any) -> Any:
    """`where` for whole records and tuples: a's fields if the condition holds, else b's."""
    chosen = [
        choose(condition, x, y) if isinstance(x, tuple) else where(condition, x, y) for x, y in zip(a, b, strict=True)
    ]
    return a._make(chosen) if hasattr(a, "_make") else tuple(chosen)


def defaults(record: type) -> Any:
    """The record with every field at its start value."""
    return unflatten(record, [leaf.start for leaf in leaves(record)])


def with_defaults(record: type, values: Mapping[str, Any]) -> type:
    """A record class with other start values, by structured name.

    Raises `KeyError` for a name that is none of its scalars'.
    """
    unknown = set(values) - {leaf.name for leaf in leaves(record)}
    if unknown:
        raise KeyError(min(unknown))
    whole = unflatten(record, [values.get(leaf.name, leaf.start) for leaf in leaves(record)])
    own = {
        "__module__": record.__module__,
        "__doc__": record.__doc__,
        "__slots__": (),
        "_field_defaults": whole._asdict(),
    }
    return type(record.__name__, (record,), own)


def allowed(fact: Fact) -> str:
    """The allowed values of a field, for people."""
    if isinstance(fact, Boolean):
        return "true, false"
    if isinstance(fact, Enumeration):
        return ", ".join(f"{i} {item.name}" for i, item in enumerate(fact.items, 1))
    low, high = (fact.min, fact.max)
    return allowed_range(-math.inf if low is None else low, math.inf if high is None else high, fact.unit)


def allowed_range(low: float, high: float, unit: str) -> str:
    """What lies between two limits, for people; infinite limits are none."""
    shown = "" if unit == "1" else f" {unit}"
    if low == -math.inf and high == math.inf:
        return f"any finite number{shown}"
    if high == math.inf:
        return f"{digits(low)}{shown} or more"
    if low == -math.inf:
        return f"{digits(high)}{shown} or less"
    return f"{digits(low)} to {digits(high)}{shown}"


def refusal(leaf: Leaf, value: Any, instance: str) -> ValueRefusedError | None:
    """The error that `value` deserves for this field, or None if it is allowed."""
    fact = leaf.fact
    why = None
    if not math.isfinite(value):
        why = "not a finite number"
    elif isinstance(fact, Enumeration):
        if value not in range(1, len(fact.items) + 1):
            why = "no such choice"
    elif isinstance(fact, Boolean):
        if value not in (0, 1):
            why = "not a switch"
    elif fact.min is not None and value < fact.min:
        why = "too small" + (", kelvin wanted" if fact.unit == "K" else "")
    elif fact.max is not None and value > fact.max:
        why = "too large"
    if why is None:
        return None
    return ValueRefusedError(f"{instance}.{leaf.name}", value, fact.unit, why, allowed(fact))


def check(record: type, values: Iterable[Any], instance: str) -> None:
    """Raise `ValueRefusedError` for the first value outside its field's range."""
    for leaf, value in zip(leaves(record), values, strict=True):
        error = refusal(leaf, value, instance)
        if error is not None:
            raise error
