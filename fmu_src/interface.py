"""A model's records as FMI variables.

======================  =====================  ==================================================
record                  FMI name               causality, variability
======================  =====================  ==================================================
``Parameters``          as in the record       parameter; fixed or tunable
``Inputs``              as in the record       input; continuous if real, otherwise discrete
``Outputs``             as in the record       output; continuous if real, otherwise discrete
``Coefficients``        ``coefficient.`` + it  calculatedParameter; tunable if any parameter is
``State``               ``state.`` + it        local; discrete, for it moves at the ticks of clocks
none                    ``refused_calls``      output; for masters that do not look at the status of their calls
======================  =====================  ==================================================

A variable's value reference is its place in this order, from 0. Hidden state keeps its place and is no FMI variable.
"""

from __future__ import annotations

from functools import cache
from typing import Any, NamedTuple

from ..models.record import Boolean, Enumeration, Fact, Integer, Leaf, Real, leaves, refusal
from ..models.system import Model
from .errors import InterfaceError


class Variable(NamedTuple):
    """One FMI variable. ``start`` is None where the FMU calculates it."""

    name: str
    value_reference: int
    fact: Fact
    causality: str
    variability: str
    initial: str | None
    start: Any

    @property
    def is_hidden(self) -> bool:
        """Whether it is state that no host sees."""
        return not isinstance(self.fact, Boolean | Enumeration) and self.fact.hidden

    @property
    def kind(self) -> str:
        """FMI type: Real, Integer, Boolean or Enumeration."""
        return type(self.fact).__name__


class Interface(NamedTuple):
    """All numbers of a model by value reference, and the value references of each record."""

    variables: tuple[Variable, ...]
    parameters: slice
    inputs: slice
    outputs: slice
    coefficients: slice
    state: slice
    refused: int

    @property
    def shown(self) -> tuple[Variable, ...]:
        """The FMI variables: all that is not hidden."""
        return tuple(variable for variable in self.variables if not variable.is_hidden)


_REFUSED = Leaf(
    "refused_calls", Integer("calls refused since the instance was made or reset; the log tells why", min=0), None
)


def _continuous(fact: Fact) -> str:
    return "continuous" if isinstance(fact, Real) else "discrete"


def _start(leaf: Leaf) -> Any:
    if leaf.start is None:
        raise InterfaceError(f"{leaf.name} needs a start value in its record")
    error = refusal(leaf, leaf.start, "start")
    if error is not None:
        raise InterfaceError(f"the start value is out of range: {error}")
    return leaf.start


class _Builder:
    def __init__(self) -> None:
        self.variables: list[Variable] = []

    def add(self, leaf: Leaf, prefix: str, causality: str, variability: str, initial: str | None) -> None:
        start = None if initial == "calculated" else _start(leaf)
        reference = len(self.variables)
        self.variables.append(
            Variable(prefix + leaf.name, reference, leaf.fact, causality, variability, initial, start)
        )

    def end_of(self, begin: int) -> slice:
        return slice(begin, len(self.variables))

    def parameters(self, record: type) -> slice:
        begin = len(self.variables)
        for leaf in leaves(record):
            self.add(leaf, "", "parameter", "tunable" if leaf.fact.tunable else "fixed", "exact")
        return self.end_of(begin)

    def signals(self, record: type, causality: str, initial: str | None) -> slice:
        begin = len(self.variables)
        for leaf in leaves(record):
            self.add(leaf, "", causality, _continuous(leaf.fact), initial)
        return self.end_of(begin)

    def inner(self, record: type, prefix: str, causality: str, variability: str) -> slice:
        begin = len(self.variables)
        for leaf in leaves(record):
            self.add(leaf, prefix, causality, variability, "calculated")
        return self.end_of(begin)


@cache
def _interface(parameters: type, inputs: type, outputs: type, coefficients: type, state: type) -> Interface:
    builder = _Builder()
    tunable = any(leaf.fact.tunable for leaf in leaves(parameters))
    slices = (
        builder.parameters(parameters),
        builder.signals(inputs, "input", None),
        builder.signals(outputs, "output", "calculated"),
        builder.inner(coefficients, "coefficient.", "calculatedParameter", "tunable" if tunable else "fixed"),
        builder.inner(state, "state.", "local", "discrete"),
    )
    builder.add(_REFUSED, "", "output", "discrete", "calculated")
    seen: set[str] = set()
    for variable in builder.variables:
        if variable.name in seen:
            raise InterfaceError(f"two records have a variable {variable.name}")
        seen.add(variable.name)
    return Interface(tuple(builder.variables), *slices, len(builder.variables) - 1)


def interface_of(model: Model) -> Interface:
    """The FMI variables of ``model``."""
    return _interface(model.Parameters, model.Inputs, model.Outputs, model.Coefficients, model.State)
