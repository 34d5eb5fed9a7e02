"""The master: runs a coupled system of co-simulation FMUs with a constant communication step.

Between communication points every input is held. In Jacobi order all FMUs take the step from t to t + h with the
outputs at t; in Gauss-Seidel order each FMU, in the order of the system's components, sees the outputs at t + h of
those before it. Communication point k is at ``start + k * h``, counted and never accumulated.

The values travel through preallocated arrays that the FMUs read and write themselves: one get and one set call for each
type, FMU and step.
"""

from __future__ import annotations

import math
import re
import shutil
import signal
import sys
import tempfile
import threading
import time as clock
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, suppress
from ctypes import byref, c_double, c_int, c_size_t, c_uint32, c_void_p, memmove
from pathlib import Path
from typing import Any, Literal, NamedTuple

import fmpy  # type: ignore[import-untyped]
import numpy as np
from fmpy import fmi2
from fmpy.logging import addLoggerProxy  # type: ignore[import-untyped]

from .errors import ResultsError, RunStoppedError, SystemRefusedError, did_you_mean
from .interface import Interface, Value, Variable
from .recording import Recording, Results, write_csv
from .system import Component, Port, System, check, start_values

Order = Literal["jacobi", "gauss-seidel"]
Progress = Callable[[float], None]

_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
_WARNING, _ERROR, _FATAL = 1, 3, 4
_KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}
_COLUMN = {"Real": np.dtype(np.float64), "Integer": np.dtype(np.int32), "Boolean": np.dtype(np.bool_)}
_PYTHONFMU = "Fatal py exception encountered"
_SAFE_PATH = re.compile(r"[A-Za-z0-9_./\\:~-]+")
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
    record: Sequence[str] | None = None,
    interval: float | None = None,
    results: Path | None = None,
    progress: Progress | None = None,
    workspace: Path | None = None,
) -> Outcome:
    """Run a coupled system and record it.

    `stop_time` (s) defaults to the system's own, `step` (s) is the communication step; the last one is shortened to end
    at the stop time. `record` names what to record as ``component.variable``, with ``*`` for anything; all outputs by
    default. `interval` (s) between records is a multiple of the step; every step by default, and always the last.
    `results` is a CSV file, which is written however the run ends; an old one is removed first. `progress` is called
    with the time (s) now and then; a KeyboardInterrupt from it, or Ctrl-C, ends the run. FMUs are unpacked in
    `workspace`, else in a temporary folder.

    Raises `SystemRefusedError` for a system that cannot run, `RunStoppedError` when a run ends early.
    """
    interfaces = check(system)
    span = _Span.of(system, stop_time, step, interval)
    _check_last_step(span, interfaces)
    columns = _columns(record, interfaces)
    spill = None if results is None else spill_of(results)
    if results is not None:
        results.unlink(missing_ok=True)
    with (
        _folder(workspace) as folder,
        noted_interrupts() as interrupted,
        closing(_Coupled(system, interfaces, columns, folder)) as coupled,
    ):
        recording = Recording(coupled.dtype, span.rows, spill)
        try:
            elapsed = coupled.run(span, order, recording, _Watch(progress, interrupted))
        except RunStoppedError as error:
            error.results = _keep(recording, results)
            raise
        recorded = _keep(recording, results)
    return Outcome(recorded, elapsed, tuple(coupled.warnings()))


def spill_of(results: Path) -> Path:
    """Where a run keeps its rows until it can write them to the CSV file `results`."""
    return results.with_suffix(".partial.npy")


def _keep(recording: Recording, path: Path | None) -> Results:
    # written first: if the disk does not take the CSV, the rows in the recording's own file stay
    if path is not None and recording.length:
        write_csv(path, recording.results())
    return recording.close()


# --- time --------------------------------------------------------------------------------------------------------


class _Span(NamedTuple):
    start: float
    stop: float
    step: float
    steps: int
    last: float
    every: int

    @classmethod
    def of(cls, system: System, stop_time: float | None, step: float, interval: float | None) -> _Span:
        stop = system.stop_time if stop_time is None else stop_time
        if stop is None:
            raise SystemRefusedError(f"system {system.name} has no stop time of its own; give one")
        if not (math.isfinite(step) and step > 0.0):
            raise SystemRefusedError(f"step = {step:g} s: a positive time is wanted")
        if not (math.isfinite(stop) and stop > system.start_time):
            raise SystemRefusedError(
                f"stop time = {stop:g} s: later than the start at {system.start_time:g} s is wanted"
            )
        # a rest far below a step is the rounding of start + k * step, not a step of its own
        steps = max(1, math.ceil((stop - system.start_time) / step - 1e-6))
        last = stop - (system.start_time + (steps - 1) * step)
        if abs(last - step) <= 1e-6 * step:
            last = step
        every = 1 if interval is None else round(interval / step)
        if every < 1 or (interval is not None and abs(every * step - interval) > 1e-6 * step):
            raise SystemRefusedError(
                f"recording interval = {interval:g} s: a multiple of the step, {step:g} s, is wanted"
            )
        return cls(system.start_time, stop, step, steps, last, every)

    @property
    def rows(self) -> int:
        """The start, every n-th communication point, and the end."""
        return 1 + math.ceil(self.steps / self.every)

    def time(self, point: int) -> float:
        return self.stop if point == self.steps else self.start + point * self.step


def _check_last_step(span: _Span, interfaces: Mapping[str, Interface]) -> None:
    if span.last == span.step:
        return
    for name, interface in interfaces.items():
        if not interface.description.coSimulation.canHandleVariableCommunicationStepSize:
            raise SystemRefusedError(
                f"component {name} takes steps of one size only, and {span.stop - span.start:g} s is no multiple of "
                f"{span.step:g} s; choose another stop time or step"
            )


class _Watch:
    """Tells how far a run is, about two hundred times, and ends it when the user asks."""

    def __init__(self, progress: Progress | None, interrupted: list[bool]) -> None:
        self.progress = progress
        self.interrupted = interrupted

    def look(self, time: float) -> None:
        try:
            if self.progress is not None:
                self.progress(time)
        except KeyboardInterrupt:
            self.interrupted.append(True)
        if self.interrupted:
            raise RunStoppedError(f"stopped by the user at t = {time:.6g} s", time, interrupted=True)


@contextmanager
def noted_interrupts() -> Iterator[list[bool]]:
    """Note the first Ctrl-C instead of raising, which could strike inside an FMU that is written in Python.

    The list that it gives is empty until then. A second Ctrl-C raises as usual.
    """
    noted: list[bool] = []
    if threading.current_thread() is not threading.main_thread():
        yield noted
        return

    def note(number: int, frame: Any) -> None:
        noted.append(True)
        signal.signal(signal.SIGINT, before)

    before = signal.getsignal(signal.SIGINT)
    if before in (signal.SIG_IGN, None):
        yield noted
        return
    signal.signal(signal.SIGINT, note)
    try:
        yield noted
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _folder(workspace: Path | None) -> Iterator[Path]:
    """A folder for the unpacked FMUs, removed afterwards together with what it left in the interpreter."""
    folder = Path(tempfile.mkdtemp(prefix="attitude_fmu_", dir=safe_folder(workspace)))
    try:
        yield folder
    finally:
        _forget_modules(folder)
        shutil.rmtree(folder, ignore_errors=True)


def safe_folder(workspace: Path | None = None) -> Path:
    """A folder for temporary files whose name is plain: `workspace` if given, else the system's own or another.

    FMUs made with pythonfmu crash the host when their path needs escaping in a URI.
    Raises `ResultsError` if there is none.
    """
    candidates = [workspace] if workspace else [Path(tempfile.gettempdir()), Path("/tmp"), Path.cwd(), Path.home()]
    for candidate in candidates:
        if _SAFE_PATH.fullmatch(str(candidate.resolve())) and candidate.is_dir():
            return candidate.resolve()
    raise ResultsError(
        f"no folder for temporary files has a plain name (tried {candidates[0]}); set TMPDIR to one made of letters, "
        "digits, '-' and '_'"
    )


def _forget_modules(folder: Path) -> None:
    """Take back what FMUs in Python imported from `folder`, so that the next run gets its own code."""
    inside = str(folder)
    sys.path[:] = [entry for entry in sys.path if not entry.startswith(inside)]
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(inside):
            del sys.modules[name]


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


# --- one FMU -------------------------------------------------------------------------------------------------------


class _Call(NamedTuple):
    """One get or set call, ready to be made: the C function, its references, how many, and where the values lie."""

    name: str
    function: Callable[..., int]
    references: Any
    length: int
    values: int


class _Feed(NamedTuple):
    """How one type of an FMU's inputs is filled: gather `places` of `pool` into `buffer`, then call."""

    pool: np.ndarray[Any, np.dtype[Any]]
    places: np.ndarray[Any, np.dtype[np.intp]]
    buffer: np.ndarray[Any, np.dtype[Any]]
    truths: bool
    call: _Call


class _Slave:
    """One instance of an FMU.

    What it logs is kept for the message that explains a failure.
    """

    def __init__(self, component: Component, interface: Interface, folder: Path) -> None:
        self.name = component.name
        self.interface = interface
        self.log: deque[tuple[int, str]] = deque(maxlen=100)
        self.fatal = False
        self.ready = False
        self.fmu: Any = None
        self.gets: list[_Call] = []
        self.feeds: list[_Feed] = []
        try:
            fmpy.extract(str(component.fmu), unzipdir=str(folder))
            self.fmu = self._instance(folder)
        except Exception as error:  # FMPy raises bare Exception
            raise SystemRefusedError(
                f"{self.name} ({component.fmu.name}) cannot be loaded: {self._why(error)}"
            ) from error
        self.pointer = c_void_p(self.fmu.component)
        self.do_step = self._function("fmi2DoStep", [c_void_p, c_double, c_double, c_int])

    def _instance(self, folder: Path) -> Any:
        # fmpy.instantiate_fmu would name every instance after its model
        description = self.interface.description
        identifier = description.coSimulation.modelIdentifier
        fmu = fmi2.FMU2Slave(
            guid=description.guid, modelIdentifier=identifier, unzipDirectory=str(folder), instanceName=self.name
        )
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = fmi2.fmi2CallbackLoggerTYPE(self._logged)
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        addLoggerProxy(byref(callbacks))
        fmu.instantiate(callbacks=callbacks, loggingOn=True)
        return fmu

    def _logged(self, component: Any, instance: Any, status: int, category: Any, message: Any) -> None:
        text = message.decode("utf-8", "replace") if message else ""
        # pythonfmu puts a line of its own before the reason
        own, _, reason = text.partition("\n")
        self.log.append((int(status), " ".join((reason if own.startswith(_PYTHONFMU) and reason else text).split())))

    def _why(self, error: Exception) -> str:
        said = self.said(_ERROR)
        return f"{error}{': ' + said if said else ''}"

    def _function(self, name: str, arguments: list[Any]) -> Callable[..., int]:
        # by index: FMPy holds the attribute of this name with its own argument types
        function = self.fmu.dll[name]
        function.argtypes, function.restype = arguments, c_int
        return function  # type: ignore[no-any-return]

    def call(self, name: str, variables: Sequence[Variable], values: np.ndarray[Any, np.dtype[Any]]) -> _Call:
        """A get or set call for these variables, with `values` as its memory."""
        references = (c_uint32 * len(variables))(*[variable.reference for variable in variables])
        function = self._function(name, [c_void_p, c_void_p, c_size_t, c_void_p])
        return _Call(name, function, references, len(variables), values.ctypes.data)

    def said(self, at_least: int) -> str:
        """The last few things that the FMU logged with a status of `at_least` or worse."""
        texts = [text for status, text in self.log if status >= at_least and text]
        return "; ".join(dict.fromkeys(texts[-3:]))

    def failed(self, function: str, status: int, time: float) -> RunStoppedError:
        """The error for a call that returned a bad status."""
        self.fatal = self.fatal or status == _FATAL
        shown = _STATUS[status] if 0 <= status < len(_STATUS) else str(status)
        said = self.said(_WARNING) or self.said(0)
        reason = f": {said}" if said else " (the FMU gave no reason)"
        return RunStoppedError(f"{self.name}: {function} returned {shown} at t = {time:.6g} s{reason}", time)

    @contextmanager
    def starting(self, time: float) -> Iterator[Any]:
        """FMPy's own calls, which raise, with our message."""
        try:
            yield self.fmu
        except fmpy.fmi1.FMICallException as error:
            raise self.failed(error.function, error.status, time) from None

    def set_inputs(self, time: float) -> None:
        for pool, places, buffer, truths, call in self.feeds:
            pool.take(places, out=buffer, mode="clip")
            if truths:
                np.not_equal(buffer, 0, out=buffer, casting="unsafe")
            status = call.function(self.pointer, call.references, call.length, call.values)
            if status > _WARNING:
                raise self.failed(call.name, status, time)

    def step(self, time: float, size: float) -> None:
        status = self.do_step(self.pointer, time, size, 1)
        if status > _WARNING:
            raise self.failed("fmi2DoStep", status, time)

    def get_outputs(self, time: float) -> None:
        for name, function, references, length, values in self.gets:
            status = function(self.pointer, references, length, values)
            if status > _WARNING:
                raise self.failed(name, status, time)

    def set_value(self, variable: Variable, value: Value) -> None:
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        getattr(self.fmu, f"set{kind}")([variable.reference], [value])

    def close(self) -> None:
        """End and free the instance; one that returned fatal must not be touched again."""
        if self.fmu is None or self.fatal:
            return
        if self.ready:
            with suppress(Exception):
                self.fmu.terminate()
        with suppress(Exception):
            self.fmu.freeInstance()


# --- all of them ---------------------------------------------------------------------------------------------------


class _Copy(NamedTuple):
    """One block of a row: where it goes in the row, where it comes from, how long it is (bytes)."""

    offset: int
    source: int
    size: int


class _Coupled:
    """The instances of a system, the arrays through which they talk, and the row that is recorded."""

    def __init__(
        self, system: System, interfaces: Mapping[str, Interface], columns: Mapping[str, list[Variable]], folder: Path
    ) -> None:
        self.system = system
        self.slaves: list[_Slave] = []
        self.columns = columns
        try:
            for number, component in enumerate(system.components):
                self.slaves.append(_Slave(component, interfaces[component.name], folder / str(number)))
            self._wire(interfaces)
        except BaseException:
            self.close()
            raise

    def _wire(self, interfaces: Mapping[str, Interface]) -> None:
        sources = {connection.source for connection in self.system.connections}
        pools: dict[str, list[Port]] = {"Real": [], "Whole": []}
        asked: list[tuple[_Slave, str, list[Variable], int]] = []
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
        self.reals = np.zeros(max(1, len(pools["Real"])), np.float64)
        self.wholes = np.zeros(max(1, len(pools["Whole"])), np.int32)
        for slave, kind, variables, first in asked:
            pool_array = self.reals if kind == "Real" else self.wholes
            slave.gets.append(slave.call(f"fmi2Get{kind}", variables, pool_array[first:]))
        self._plan_rows(asked)
        for slave in self.slaves:
            self._feed(slave, pools, interfaces)

    def _plan_rows(self, asked: list[tuple[_Slave, str, list[Variable], int]]) -> None:
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
            self.copies.append(_Copy(offset, array[first:].ctypes.data, len(recorded) * array.itemsize))

    def _feed(self, slave: _Slave, pools: Mapping[str, list[Port]], interfaces: Mapping[str, Interface]) -> None:
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
            slave.feeds.append(_Feed(pool, index, buffer, kind == "Boolean" and not from_truths, call))

    def run(self, span: _Span, order: Order, recording: Recording, watch: _Watch) -> float:
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
            if point % often == 0 or watch.interrupted:
                watch.look(span.time(point + 1))
        if watch.progress is not None:
            watch.look(span.stop)
        return clock.perf_counter() - began

    def _initialise(self, span: _Span) -> None:
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
        for offset, source, size in self.copies:
            memmove(row + offset, source, size)
        for name, index in self.truths:
            recording.column(name)[place] = self.wholes[index]
        # last, because a row counts once it has its time
        recording.times[place] = time
        recording.length = place + 1

    def warnings(self) -> Iterator[str]:
        """What the FMUs warned of, once each."""
        for slave in self.slaves:
            yield from dict.fromkeys(f"{slave.name}: {text}" for status, text in slave.log if status == _WARNING)

    def close(self) -> None:
        """End and free every instance."""
        for slave in self.slaves:
            slave.close()
