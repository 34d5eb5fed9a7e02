"""What an instance is expected to answer: the stage machine, the values and the clocks, in Python."""

from __future__ import annotations

import copy
import struct
from collections.abc import Sequence
from typing import Any, NamedTuple

from attitude_fmu.fmu_src.interface import Interface, Variable
from attitude_fmu.fmu_src.ports import limits_of
from attitude_fmu.fmu_src.saved_state import (
    INITIALISING,
    INSTANTIATED,
    STEPPING,
    STOPPED,
    TERMINATED,
    TIME_ROUNDING,
    TIME_SLACK,
)
from attitude_fmu.models.errors import AttitudeFmuError
from attitude_fmu.models.record import unflatten
from attitude_fmu.models.system import LATEST_TIME, TIME_TOLERANCE, Model, check_rules

STAGES_OF_CALL = {
    "SetupExperiment": (INSTANTIATED, INSTANTIATED),
    "EnterInitializationMode": (INSTANTIATED, INSTANTIATED),
    "ExitInitializationMode": (INITIALISING, INITIALISING),
    "DoStep": (STEPPING, STEPPING),
    "Set": (INSTANTIATED, STEPPING),
    "SetRealInputDerivatives": (INSTANTIATED, STEPPING),
}
"""First and last stage in which a call is allowed; others are in every one."""

KIND_OF = {"Enumeration": "Integer"}
HEAD_WORDS = 4


class Moment(NamedTuple):
    """The numbers in a saved state, in their order."""

    values: tuple[float, ...]
    slopes: tuple[float, ...]
    ticks: tuple[int, ...]
    start_time: float
    time: float
    stage: int
    is_sloped: int
    stale: int


class Layout:
    """Where these numbers lie."""

    def __init__(self, model: Model, interface: Interface) -> None:
        self.variables = len(interface.variables)
        self.inputs = interface.inputs.stop - interface.inputs.start
        self.clocks = len(model.clocks)
        self.form = struct.Struct(f"<{HEAD_WORDS}Q{self.variables + self.inputs + 1}d{self.clocks}q2d3qQ")

    def read(self, content: bytes) -> Moment:
        """The moment in a serialised state."""
        words = self.form.unpack(content)[HEAD_WORDS:]
        values, rest = words[: self.variables], words[self.variables :]
        slopes, rest = rest[: self.inputs + 1], rest[self.inputs + 1 :]
        ticks, last = rest[: self.clocks], rest[self.clocks : -1]
        return Moment(values, slopes, ticks, *last)


class Facts:
    """What all instances of an FMU have in common."""

    def __init__(self, model: Model, interface: Interface) -> None:
        self.model, self.interface = model, interface
        self.variables = interface.variables
        self.settable = interface.inputs.stop
        self.limits = [limits_of(variable) for variable in self.variables[: self.settable]]
        self.layout = Layout(model, interface)
        self.of_kind: dict[str, list[int]] = {"Real": [], "Integer": [], "Boolean": [], "String": []}
        for variable in interface.shown:
            self.of_kind[self.kind(variable)].append(variable.value_reference)

    @staticmethod
    def kind(variable: Variable) -> str:
        """The family of FMI functions that reaches a variable."""
        return KIND_OF.get(variable.kind, variable.kind)

    def reaches(self, kind: str, references: Sequence[int]) -> bool:
        """Whether all of these are variables of a kind."""
        known = len(self.variables)
        return all(
            r < known and self.kind(self.variables[r]) == kind and not self.variables[r].is_hidden for r in references
        )


class Twin:
    """The expected numbers of one instance. `is_wild` once anything far from the model's use was set."""

    def __init__(self, facts: Facts, name: str) -> None:
        self.facts, self.name = facts, name
        self.logs_errors = True
        self.begin_anew()

    def begin_anew(self) -> None:
        self.stage = INSTANTIATED
        self.values: list[float] = [float(v.start) for v in self.facts.variables[: self.facts.settable]]
        self.start_time = self.time = 0.0
        self.refused = 0
        self.is_wild = False
        self.ticks: tuple[int, ...] = (0,) * len(self.facts.model.clocks)
        self.slopes = [0.0] * self.facts.layout.inputs
        self.is_sloped = False

    def copied(self) -> Twin:
        """As it is now, to go back to."""
        twin = copy.copy(self)
        twin.values, twin.slopes = list(self.values), list(self.slopes)
        return twin

    def go_back(self, saved: Twin) -> None:
        for name in ("stage", "start_time", "time", "is_wild", "ticks", "is_sloped"):
            setattr(self, name, getattr(saved, name))
        self.values, self.slopes = list(saved.values), list(saved.slopes)

    def adopt(self, moment: Moment) -> None:
        """Go on from a moment that was tampered with."""
        self.stage, self.start_time, self.time = moment.stage, moment.start_time, moment.time
        self.values, self.ticks = list(moment.values[: self.facts.settable]), moment.ticks
        self.slopes, self.is_sloped = list(moment.slopes[:-1]), bool(moment.is_sloped)
        self.is_wild = True

    def may(self, call: str) -> bool:
        """Whether the stage allows a call."""
        first, last = STAGES_OF_CALL.get(call, (INSTANTIATED, TERMINATED))
        return first <= self.stage <= last

    def _parameters(self) -> Any:
        return unflatten(self.facts.model.Parameters, self.values[self.facts.interface.parameters])

    def obeys_rules(self) -> bool:
        """Whether the parameters go together."""
        try:
            check_rules(self.facts.model, self._parameters(), self.name)
        except AttitudeFmuError:
            return False
        return True

    # whether calls are legal

    def may_set(self, kind: str, references: Sequence[int], values: Sequence[float]) -> bool:
        if not self.may("Set") or not self.facts.reaches(kind, references):
            return False
        return all(self._may_set_one(r, value) for r, value in zip(references, values, strict=True))

    def _may_set_one(self, reference: int, value: float) -> bool:
        if reference >= self.facts.settable:
            return False
        low, high = self.facts.limits[reference]
        is_fixed = self.facts.variables[reference].variability == "fixed"
        return low <= value <= high and not (is_fixed and self.stage == STEPPING)

    def may_get(self, kind: str, references: Sequence[int]) -> bool:
        return self.facts.reaches(kind, references) and (self.obeys_rules() or not self._needs_rules(references))

    def _needs_rules(self, references: Sequence[int]) -> bool:
        interface = self.facts.interface
        first_free = interface.state.start if self.stage >= STEPPING else interface.refused
        return any(interface.outputs.start <= r < first_free for r in references)

    def may_step(self, time: float, size: float) -> bool:
        return (
            self.may("DoStep")
            and size >= 0.0
            and time + size <= LATEST_TIME
            and abs(time - self.time) <= TIME_SLACK * min(size, 1.0) + TIME_ROUNDING
            and self._stays_in_range(size)
            and self.obeys_rules()
        )

    def _stays_in_range(self, size: float) -> bool:
        """Whether inputs that follow a slope do."""
        first = self.facts.interface.inputs.start
        sloped = [(i, slope) for i, slope in enumerate(self.slopes, first) if self.is_sloped and slope]
        limits = self.facts.limits
        return all(limits[i][0] <= self.values[i] + slope * size <= limits[i][1] for i, slope in sloped)

    def may_derive(self, unknowns: Sequence[int], knowns: Sequence[int]) -> bool:
        interface = self.facts.interface
        return (
            self.facts.reaches("Real", [*unknowns, *knowns])
            and all(interface.outputs.start <= r < interface.state.start for r in unknowns)
            and all(r < self.facts.settable or (self.stage >= STEPPING and r >= interface.state.start) for r in knowns)
            and self.obeys_rules()
        )

    def may_slope(self, references: Sequence[int], orders: Sequence[int], slopes: Sequence[float]) -> bool:
        inputs = range(*self.facts.interface.inputs.indices(len(self.facts.variables)))
        return (
            self.may("SetRealInputDerivatives")
            and self.facts.reaches("Real", references)
            and all(r in inputs for r in references)
            and all(order == 1 for order in orders)
            and all(abs(slope) < float("inf") for slope in slopes)
        )

    # what legal calls do

    def store(self, references: Sequence[int], values: Sequence[float]) -> None:
        for reference, value in zip(references, values, strict=True):
            self.values[reference] = float(value)

    def set_slopes(self, references: Sequence[int], slopes: Sequence[float]) -> None:
        for reference, slope in zip(references, slopes, strict=True):
            self.slopes[reference - self.facts.interface.inputs.start] = slope
            self.is_sloped |= slope != 0.0

    def advance(self, until: float) -> None:
        self.time = max(until, self.time)
        if self.is_sloped:
            self.slopes, self.is_sloped = [0.0] * len(self.slopes), False
        if not self.is_wild:
            coefficients = self.facts.model.coefficients(self._parameters())
            periods = [float(clock.period(coefficients)) for clock in self.facts.model.clocks]
            limit = until + TIME_TOLERANCE * max(1.0, abs(until))
            self.ticks = tuple(
                max(before, _ticks_until(limit, self.start_time, period))
                for before, period in zip(self.ticks, periods, strict=True)
            )


def _ticks_until(limit: float, start_time: float, period: float) -> int:
    count = max(int((limit - start_time) / period) - 2, 0)
    while start_time + (count + 1) * period <= limit:
        count += 1
    return count


def essence(moment: Moment, facts: Facts) -> tuple[Any, ...]:
    """What a refused call must not change, bit for bit."""
    numbers = [*moment.values[: facts.settable], *moment.slopes, moment.start_time, moment.time]
    if moment.stage in (STEPPING, STOPPED):
        numbers += moment.values[facts.interface.state]
    return struct.pack(f"<{len(numbers)}d", *numbers), moment.ticks
