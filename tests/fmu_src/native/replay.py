"""A recorded coupled run as calls for one FMU alone: it must give its part of the record again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from foreign import bits, getting, setting

from attitude_fmu.cosim.interface import Interface, Variable
from attitude_fmu.cosim.system import System, start_values

Records = np.ndarray[Any, np.dtype[Any]]


def _of_kind(variables: Sequence[Variable], *kinds: str) -> list[Variable]:
    return [variable for variable in variables if variable.type in kinds]


def _references(variables: Sequence[Variable]) -> list[int]:
    return [variable.reference for variable in variables]


class Replay(NamedTuple):
    """One component of a system, what it starts with, its connected inputs with their sources, and its outputs."""

    component: str
    interface: Interface
    parameters: dict[int, float]
    inputs: list[tuple[Variable, str]]
    records: Records

    @classmethod
    def of(cls, system: System, component: str, interfaces: Mapping[str, Interface], records: Records) -> Replay:
        """The part of a component in the Jacobi run that gave `records`."""
        variables = interfaces[component].variables
        parameters = {
            variables[port.variable].reference: float(value)
            for port, value in start_values(system, interfaces).items()
            if port.component == component
        }
        inputs = [
            (variables[wire.target.variable], str(wire.source))
            for wire in system.connections
            if wire.target.component == component
        ]
        return cls(component, interfaces[component], parameters, inputs, records)

    @property
    def reals(self) -> list[Variable]:
        """The real outputs."""
        return _of_kind(self._outputs, "Real")

    @property
    def wholes(self) -> list[Variable]:
        """The integer and enumeration outputs."""
        return _of_kind(self._outputs, "Integer", "Enumeration")

    @property
    def _outputs(self) -> list[Variable]:
        return [variable for variable in self.interface.variables.values() if variable.causality == "output"]

    def recorded(self, variables: Sequence[Variable], rows: slice) -> Records:
        """What the record says of some outputs."""
        return np.array([self.records[f"{self.component}.{variable.name}"][rows] for variable in variables]).T

    def feed(self, row: int) -> Iterator[str]:
        """Commands that set the inputs as they were at a row of the record."""
        reals = [pair for pair in self.inputs if pair[0].type == "Real"]
        others = [pair for pair in self.inputs if pair[0].type == "Boolean"]
        if reals:
            yield setting([one.reference for one, _ in reals], [self.records[source][row] for _, source in reals])
        if others:
            yield "boolean " + " ".join(f"{one.reference} {int(self.records[source][row])}" for one, source in others)

    def start(self) -> Iterator[str]:
        """Commands that initialise."""
        if self.parameters:
            yield setting(list(self.parameters), list(self.parameters.values()))
        yield from ("setup", "enter", *self.feed(0), "exit")

    def steps(self, first: int, last: int, size: float) -> Iterator[str]:
        """Commands for the steps that lead from one row to another."""
        for row in range(first, last):
            yield from self.feed(row)
            yield f"step {bits(row * size)} {bits(size)}"

    def read(self) -> Iterator[str]:
        """Commands that read all real and whole outputs."""
        yield getting("get-real", _references(self.reals))
        yield getting("get-integer", _references(self.wholes))

    def run(self, size: float, every: int) -> Iterator[str]:
        """Commands for the whole record, read at every so manieth row."""
        yield from self.start()
        yield from self.read()
        for first in range(0, len(self.records) - 1, every):
            yield from self.steps(first, first + every, size)
            yield from self.read()
