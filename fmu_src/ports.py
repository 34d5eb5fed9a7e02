"""How an instance reads and writes its variables: one plan for each list of value references, made once.

A host asks for the same lists at every step, so the checks of type, causality and range are made ready beforehand.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from operator import itemgetter
from typing import Any, NamedTuple

from ..models.record import Boolean, Enumeration, Integer
from .errors import CallRefusedError
from .interface import Interface, Variable

OUTPUTS, COEFFICIENTS, STATE = 1, 2, 4
"""Bits of the groups of variables that are computed when asked for."""

EVERYTHING = OUTPUTS | COEFFICIENTS | STATE

REAL, INTEGER, BOOLEAN = ("Real",), ("Integer", "Enumeration"), ("Boolean",)
"""The kinds of variables that each family of FMI functions reaches."""

_PLAN_LIMIT = 1000
_LARGEST = sys.float_info.max
_INT32 = (-(2.0**31), 2.0**31 - 1.0)

References = tuple[int, ...]


class Reading(NamedTuple):
    """Takes the asked values out of all values; ``needs`` are the groups to compute before."""

    take: Callable[[list[Any]], list[Any]]
    needs: int


class Writing(NamedTuple):
    """Limits, conversions and variables of the values to come."""

    low: list[float]
    high: list[float]
    casts: list[Callable[[Any], Any]]
    variables: list[Variable]
    inputs_only: bool


def limits_of(variable: Variable) -> tuple[float, float]:
    """The smallest and the largest value that a variable takes."""
    fact = variable.fact
    if isinstance(fact, Boolean):
        return 0.0, 1.0
    if isinstance(fact, Enumeration):
        return 1.0, float(len(fact.items))
    low, high = _INT32 if isinstance(fact, Integer) else (-_LARGEST, _LARGEST)
    return low if fact.min is None else fact.min, high if fact.max is None else fact.max


def cast_of(variable: Variable) -> Callable[[Any], Any]:
    """Conversion of an incoming value to what the model is used to: the type of its start value."""
    return float if variable.kind == "Real" else type(variable.start)


def _taker(references: References) -> Callable[[list[Any]], list[Any]]:
    if len(references) < 2:  # itemgetter would not give a tuple
        return lambda values: [values[reference] for reference in references]
    take = itemgetter(*references)
    return lambda values: list(take(values))


class Ports:
    """The plans of one model, shared by its instances."""

    def __init__(self, interface: Interface) -> None:
        self.interface = interface
        settable = interface.variables[: interface.inputs.stop]
        self.starts = [variable.start for variable in settable]
        self.computed = len(interface.variables) - len(settable)
        self.casts = [cast_of(variable) for variable in settable]
        self.readings: dict[tuple[str, ...], dict[References, Reading]] = {REAL: {}, INTEGER: {}, BOOLEAN: {}}
        self.writings: dict[tuple[str, ...], dict[References, Writing]] = {REAL: {}, INTEGER: {}, BOOLEAN: {}}

    def variables(self, kinds: tuple[str, ...], references: References) -> list[Variable]:
        """The variables behind `references`; all must be of these kinds."""
        found = []
        for reference in references:
            if not 0 <= reference < len(self.interface.variables) or self.interface.variables[reference].is_hidden:
                raise CallRefusedError(f"there is no variable with value reference {reference}")
            variable = self.interface.variables[reference]
            if variable.kind not in kinds:
                raise CallRefusedError(f"{variable.name} is of type {variable.kind}, not {' or '.join(kinds)}")
            found.append(variable)
        return found

    def _group(self, reference: int) -> int:
        if reference < self.interface.inputs.stop or reference == self.interface.refused:
            return 0
        if reference < self.interface.outputs.stop:
            return OUTPUTS
        return COEFFICIENTS if reference < self.interface.coefficients.stop else STATE

    def reading(self, kinds: tuple[str, ...], references: References) -> Reading:
        """The plan for reading `references`, kept for the next time."""
        self.variables(kinds, references)
        needs = 0
        for reference in references:
            needs |= self._group(reference)
        plans = self.readings[kinds]
        if len(plans) >= _PLAN_LIMIT:
            plans.clear()
        plans[references] = Reading(_taker(references), needs)
        return plans[references]

    def writing(self, kinds: tuple[str, ...], references: References) -> Writing:
        """The plan for writing `references`, kept for the next time."""
        variables = self.variables(kinds, references)
        for variable in variables:
            if variable.causality not in ("parameter", "input"):
                raise CallRefusedError(f"{variable.name} cannot be set: its causality is {variable.causality}")
        limits = [limits_of(variable) for variable in variables]
        plans = self.writings[kinds]
        if len(plans) >= _PLAN_LIMIT:
            plans.clear()
        plans[references] = Writing(
            [low for low, _ in limits],
            [high for _, high in limits],
            [cast_of(variable) for variable in variables],
            variables,
            all(variable.causality == "input" for variable in variables),
        )
        return plans[references]
