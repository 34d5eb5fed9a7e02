"""The master: runs a coupled system of co-simulation FMUs with a constant communication step.

Between communication points every input is held. In Jacobi order all FMUs take the step from t to t + h with the
outputs at t; in Gauss-Seidel order each FMU, in the order of the system's components, sees the outputs at t + h of
those before it. Communication point k is at ``start + k * h``, counted and never accumulated.

The values travel through preallocated arrays that the FMUs read and write themselves: one get and one set call for each
type, FMU and step.
"""

from __future__ import annotations

import re
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, nullcontext
from ctypes import c_size_t, c_void_p, memmove
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple, cast, get_args

import numpy as np

from attitude_fmu.fmu_src.errors import did_you_mean

from .errors import RunStoppedError, SystemRefusedError
from .interface import Interface, Variable
from .interrupts import Progress, Watch, noted_interrupts
from .recording import Recording, Results, keep
from .slave import WARNING, Feed, Slave
from .span import Span, check_last_step
from .system import Port, System, check, start_values
from .workspace import claimed, fmu_folder

Order = Literal["jacobi", "gauss-seidel"]
_KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}
_COLUMN = {"Real": np.dtype(np.float64), "Integer": np.dtype(np.int32), "Boolean": np.dtype(np.bool_)}
_MOST_PASSES = 100
"""Times that values are passed round at initialisation; loops of FMUs that settle at all do so sooner."""


class Outcome(NamedTuple):
    """What a run gave: FMPy's structured array, the wall-clock time of the steps (s), and the FMUs' warnings."""

    results: Results
    elapsed: float
    warnings: tuple[str, ...]


def simulate(
    system: System,
    *,
    stop_time: float | None = None,
    step: float = 1e-3,
    order: Order = "gauss-seidel",
    record: Sequence[str] | str | None = None,
    interval: float | None = None,
    results: Path | str | None = None,
    progress: Progress | None = None,
    workspace: Path | str | None = None,
) -> Outcome:
    """Run a coupled system and record it.

    `stop_time` (s) defaults to the system's own, `step` (s) is the communication step; the last one is shortened to end
    at the stop time. `record` names what to record as ``component.variable``, with ``*`` for anything; all outputs by
    default. `interval` (s) between records is a multiple of the step; every step by default, and always the last.
    `results` is a CSV file, which is written however the run ends, once there is a row. `progress` is called with the
    time (s) now and then; a KeyboardInterrupt from it, or Ctrl-C, ends the run. FMUs are unpacked in `workspace`, else
    in a temporary folder.

    Raises `SystemRefusedError` for a system that cannot run, `RunStoppedError` when a run ends early, `ResultsError`
    if the results find no room or another run is writing there.
    """
    plan = plan_run(system, stop_time, step, order, record, interval)
    path = None if results is None else Path(results)

    def close(recording: Recording) -> Results:
        if path is not None:
            keep(recording.filled(), path, recording.path)
        return recording.close()

    return run_plan(system, plan, path, progress, None if workspace is None else Path(workspace), close)


class Plan(NamedTuple):
    """What a run is to do, as far as it can be known before its FMUs are loaded."""

    interfaces: Mapping[str, Interface]
    span: Span
    order: Order
    columns: Mapping[str, list[Variable]]


def plan_run(
    system: System,
    stop_time: float | None,
    step: float,
    order: Order,
    record: Sequence[str] | str | None,
    interval: float | None,
) -> Plan:
    """Check a system and what is wanted of it, as `simulate` takes it, without touching any file.

    Raises `SystemRefusedError` for what cannot be run.
    """
    interfaces = check(system)
    span = Span.of(system, stop_time, step, interval)
    check_last_step(span, interfaces)
    if order not in get_args(Order):
        raise SystemRefusedError(f"order = {order}: not one of {', '.join(get_args(Order))}")
    patterns = (record,) if isinstance(record, str) else record
    return Plan(interfaces, span, order, _columns(patterns, interfaces))


def run_plan(
    system: System,
    plan: Plan,
    results: Path | None,
    progress: Progress | None,
    workspace: Path | None,
    close: Callable[[Recording], Results],
) -> Outcome:
    """Run what `plan_run` has checked; `close` gets the recording however the run ends, and gives what to pass on."""
    with (
        nullcontext() if results is None else claimed(results),
        fmu_folder(workspace) as folder,
        noted_interrupts() as interrupted,
        closing(_Coupled(system, plan, folder)) as coupled,
    ):
        recording = Recording(coupled.dtype, plan.span.rows, None if results is None else spill_of(results))
        try:
            elapsed = coupled.run(plan.span, plan.order, recording, Watch(progress, interrupted))
        except RunStoppedError as error:
            error.results = close(recording)
            raise
        except BaseException:  # a second Ctrl-C
            close(recording)
            raise
        return Outcome(close(recording), elapsed, tuple(coupled.warnings()))


def spill_of(results: Path) -> Path:
    """Where a run keeps its rows until it can write them to the CSV file `results`."""
    return results.with_suffix(".partial.npy")


# --- what is recorded ----------------------------------------------------------------------------------------------


def _columns(record: Sequence[str] | None, interfaces: Mapping[str, Interface]) -> dict[str, list[Variable]]:
    """The variables to record of each component: Reals, then whole numbers, then Booleans, as FMPy orders them."""
    wanted = None if record is None else _matching(record, interfaces)
    rank = ["Real", "Integer", "Boolean"]
    return {
        component: sorted(
            (
                variable
                for variable in interface.variables.values()
                if variable.type in _KINDS
                and (variable.causality == "output" if wanted is None else Port(component, variable.name) in wanted)
            ),
            key=lambda variable: rank.index(_KINDS[variable.type]),
        )
        for component, interface in interfaces.items()
    }


def _matching(patterns: Sequence[str], interfaces: Mapping[str, Interface]) -> set[Port]:
    names = {
        f"{component}.{variable.name}": Port(component, variable.name)
        for component, interface in interfaces.items()
        for variable in interface.variables.values()
        if variable.type in _KINDS
    }
    found: set[Port] = set()
    for pattern in patterns:
        # brackets belong to the names of vectors here, so this is no shell pattern
        matcher = re.compile(re.escape(pattern).replace(r"\*", ".*"))
        matches = {port for name, port in names.items() if matcher.fullmatch(name)}
        if not matches:
            raise SystemRefusedError(f"nothing to record is called {pattern}{did_you_mean(pattern, names)}")
        found |= matches
    return found


# --- all of them ---------------------------------------------------------------------------------------------------


class _Copy(NamedTuple):
    """One block of a row: where it goes in the row (bytes), the address to set to it, and the copying."""

    offset: int
    target: c_void_p
    make: Callable[[], object]


_Gather = Callable[[], np.ndarray[Any, Any]]


def _as_truths(gather: _Gather, buffer: np.ndarray[Any, Any]) -> _Gather:
    """Gather whole numbers as 0 and 1."""

    def gather_truths() -> np.ndarray[Any, Any]:
        np.not_equal(gather(), 0, out=buffer, casting="unsafe")
        return buffer

    return gather_truths


class _Coupled:
    """The instances of a system, the arrays through which they talk, and the row that is recorded."""

    def __init__(self, system: System, plan: Plan, folder: Path) -> None:
        self.system = system
        self.slaves: list[Slave] = []
        self.columns = plan.columns
        self.not_finite: dict[Port, float] = {}
        interfaces = plan.interfaces
        try:
            for number, component in enumerate(system.components):
                self.slaves.append(Slave(component, interfaces[component.name], folder / str(number)))
            self._wire(interfaces)
        except BaseException:
            self.close()
            raise

    def _wire(self, interfaces: Mapping[str, Interface]) -> None:
        sources = {connection.source for connection in self.system.connections}
        pools: dict[str, list[Port]] = {"Real": [], "Whole": []}
        asked: list[tuple[Slave, str, list[Variable], int]] = []
        fields: list[tuple[str, Any]] = [("time", np.dtype(np.float64))]
        for slave in self.slaves:
            recorded = self.columns[slave.name]
            fields += [(f"{slave.name}.{variable.name}", _COLUMN[_KINDS[variable.type]]) for variable in recorded]
            names = {variable.name for variable in recorded}
            others = [
                variable
                for variable in slave.interface.variables.values()
                if variable.name not in names and Port(slave.name, variable.name) in sources
            ]
            for kind in _COLUMN:
                variables = [variable for variable in (*recorded, *others) if _KINDS[variable.type] == kind]
                if variables:
                    pool = pools["Real" if kind == "Real" else "Whole"]
                    asked.append((slave, kind, variables, len(pool)))
                    pool += [Port(slave.name, variable.name) for variable in variables]
        self.dtype = np.dtype(fields)
        self.real_ports = pools["Real"]
        self.reals = np.zeros(max(1, len(pools["Real"])), np.float64)
        self.wholes = np.zeros(max(1, len(pools["Whole"])), np.int32)
        for slave, kind, variables, first in asked:
            pool_array = self.reals if kind == "Real" else self.wholes
            slave.gets.append(slave.call(f"fmi2Get{kind}", variables, pool_array[first:]))
        self._plan_rows(asked)
        for slave in self.slaves:
            self._feed(slave, pools, interfaces)

    def _plan_rows(self, asked: list[tuple[Slave, str, list[Variable], int]]) -> None:
        self.copies: list[_Copy] = []
        self.truths: list[tuple[str, int]] = []
        offsets: Mapping[str, Any] = self.dtype.fields or {}
        for slave, kind, variables, first in asked:
            recorded = [variable for variable in variables if f"{slave.name}.{variable.name}" in offsets]
            if not recorded:
                continue
            if kind == "Boolean":
                # four bytes in FMI, one in the array
                self.truths += [(f"{slave.name}.{variable.name}", first + i) for i, variable in enumerate(recorded)]
                continue
            array = self.reals if kind == "Real" else self.wholes
            offset = offsets[f"{slave.name}.{recorded[0].name}"][1]
            target, source = c_void_p(), array[first:].ctypes.data_as(c_void_p)
            size: Any = c_size_t(len(recorded) * array.itemsize)
            self.copies.append(_Copy(offset, target, partial(memmove, target, source, size)))

    def _feed(self, slave: Slave, pools: Mapping[str, list[Port]], interfaces: Mapping[str, Interface]) -> None:
        wires = {c.target.variable: c.source for c in self.system.connections if c.target.component == slave.name}
        inputs = [variable for name, variable in slave.interface.variables.items() if name in wires]
        for kind in _COLUMN:
            variables = [variable for variable in inputs if _KINDS[variable.type] == kind]
            if not variables:
                continue
            pool_name, pool = ("Real", self.reals) if kind == "Real" else ("Whole", self.wholes)
            places = {port: place for place, port in enumerate(pools[pool_name])}
            index = np.array([places[wires[variable.name]] for variable in variables], np.intp)
            buffer = np.zeros(len(variables), pool.dtype)
            call = slave.call(f"fmi2Set{kind}", variables, buffer)
            from_truths = all(
                interfaces[wires[v.name].component].variables[wires[v.name].variable].type == "Boolean"
                for v in variables
            )
            gather = cast(_Gather, partial(pool.take, index, None, buffer, "clip"))
            slave.feeds.append(Feed(gather if kind != "Boolean" or from_truths else _as_truths(gather, buffer), call))

    def run(self, span: Span, order: Order, recording: Recording, watch: Watch) -> float:
        """Initialise, take all steps, record; gives the wall-clock time of the steps (s)."""
        self._initialise(span)
        groups = [self.slaves] if order == "jacobi" else [[slave] for slave in self.slaves]
        often = max(1, span.steps // 200)
        self._record(recording, span.start)
        began = clock.perf_counter()
        for point in range(span.steps):
            time = span.start + point * span.step
            size = span.step if point < span.steps - 1 else span.last
            for group in groups:
                for slave in group:
                    slave.set_inputs(time)
                    slave.step(time, size)
                for slave in group:
                    slave.get_outputs(time)
            if (point + 1) % span.every == 0 or point + 1 == span.steps:
                self._record(recording, span.time(point + 1))
            if point % often == 0 or watch.interrupted or point + 1 == span.steps:
                self._look_for_not_finite(span.time(point + 1))
                if watch.stops(span.time(point + 1)):
                    # what is kept, not what was reached
                    last = float(recording.times[recording.length - 1])
                    raise RunStoppedError(f"stopped by the user at t = {last:.6g} s", last, interrupted=True)
        return clock.perf_counter() - began

    def _look_for_not_finite(self, time: float) -> None:
        for place in np.flatnonzero(~np.isfinite(self.reals)):
            self.not_finite.setdefault(self.real_ports[place], time)

    def _initialise(self, span: Span) -> None:
        values = start_values(self.system, {slave.name: slave.interface for slave in self.slaves})
        for slave in self.slaves:
            with slave.starting(span.start) as fmu:
                for port, value in values.items():
                    if port.component == slave.name:
                        slave.set_value(slave.interface.variables[port.variable], value)
                fmu.setupExperiment(startTime=span.start, stopTime=span.stop)
                fmu.enterInitializationMode()
        self._settle(span.start)
        for slave in self.slaves:
            with slave.starting(span.start) as fmu:
                fmu.exitInitializationMode()
                slave.ready = True
        for slave in self.slaves:
            slave.get_outputs(span.start)
            slave.started = True

    def _settle(self, time: float) -> None:
        """Pass outputs to inputs until nothing changes any more, whatever the order in which they depend."""
        for _ in range(_MOST_PASSES):
            before = self.reals.copy(), self.wholes.copy()
            for slave in self.slaves:
                slave.get_outputs(time)
                slave.set_inputs(time)
            # round robin within the pass lets a chain settle in few passes; a last full look tells whether it has
            for slave in self.slaves:
                slave.get_outputs(time)
            if np.array_equal(before[1], self.wholes) and np.allclose(before[0], self.reals, 1e-12, 1e-15, True):
                return
        for source, target in self.system.connections:
            if source.component != target.component:
                raise SystemRefusedError(
                    f"the connected start values do not settle in {_MOST_PASSES} passes: outputs depend on inputs in a "
                    f"closed loop without delay, for instance through {source} -> {target}; break the loop with a delay"
                )

    def _record(self, recording: Recording, time: float) -> None:
        place = recording.length
        row = recording.address + place * self.dtype.itemsize
        for offset, target, make in self.copies:
            target.value = row + offset
            make()
        for name, index in self.truths:
            recording.column(name)[place] = self.wholes[index]
        # last, because a row counts once it has its time
        recording.times[place] = time
        recording.length = place + 1

    def warnings(self) -> Iterator[str]:
        """What the FMUs warned of, once each, and the outputs that are NaN or infinite."""
        for slave in self.slaves:
            yield from dict.fromkeys(f"{slave.name}: {text}" for status, text in slave.log if status == WARNING)
        for port, time in self.not_finite.items():
            yield f"{port.component}: {port.variable} is not a finite number at t = {time:.6g} s"

    def close(self) -> None:
        """End and free every instance."""
        for slave in self.slaves:
            slave.close()
