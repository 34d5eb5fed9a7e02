"""One initialised instance of a co-simulation FMU, its ports as vectors of floats: set, step, read, save, load."""

from __future__ import annotations

import weakref
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from ctypes import byref, c_void_p
from functools import partial
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from attitude_fmu.fmu_src.errors import did_you_mean

from ..bench import settable
from ..errors import SystemRefusedError
from ..interface import Interface, Value, Variable, read_interface
from ..slave import WARNING, Feed, Slave
from ..system import Component
from ..workspace import fmu_folder

Array = NDArray[np.float64]

Signals = Mapping[str, str] | Sequence[str] | str | None
"""Names of variables; a stem stands for all its scalars, ``rate`` for ``rate[1]`` to ``rate[3]``. A mapping gives each
the label that it has in python-control, where no label may hold a dot; without one, dots become ``_``."""

_KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}


class Port(NamedTuple):
    """A variable of the FMU and its label in python-control."""

    variable: Variable
    label: str


def input_ports(interface: Interface, wanted: Signals) -> tuple[Port, ...]:
    """The inputs, all by default; tunable parameters are inputs as well where they are named.

    Raises `SystemRefusedError` for what is no input.
    """
    offered = [v for v in interface.variables.values() if v.causality == "input"]
    tunable = [v for v in interface.variables.values() if v.causality == "parameter" and v.variability == "tunable"]
    return _ports(interface, "input", wanted, offered, tunable)


def output_ports(interface: Interface, wanted: Signals) -> tuple[Port, ...]:
    """The outputs, all by default; whatever else can be read is an output as well where it is named.

    Raises `SystemRefusedError` for what is not there.
    """
    offered = [v for v in interface.variables.values() if v.causality == "output"]
    others = [v for v in interface.variables.values() if v.causality != "output"]
    return _ports(interface, "output", wanted, offered, others)


def _ports(
    interface: Interface, what: str, wanted: Signals, offered: Sequence[Variable], others: Sequence[Variable]
) -> tuple[Port, ...]:
    numbers = [variable for variable in offered if variable.type in _KINDS]
    if wanted is None:
        found = [Port(variable, _label(variable.name)) for variable in numbers]
    else:
        known = {v.name: v for v in (*numbers, *others) if v.type in _KINDS}
        names = [wanted] if isinstance(wanted, str) else list(wanted)
        found = [port for name in names for port in _named(interface, what, name, known)]
        if isinstance(wanted, Mapping):
            found = [Port(variable, wanted.get(variable.name, label)) for variable, label in found]
    for port in found:
        if sum(other.label == port.label for other in found) > 1:
            raise SystemRefusedError(
                f"{interface.model_name}: two {what}s are called {port.label}; name each once, and give labels of your "
                f"own as {{{port.variable.name!r}: label}}"
            )
    return tuple(found)


def _named(interface: Interface, what: str, name: str, known: Mapping[str, Variable]) -> list[Port]:
    if name in known:
        return [Port(known[name], _label(name))]
    found = [Port(v, _label(v.name)) for v in known.values() if v.name.startswith((f"{name}[", f"{name}."))]
    if not found:
        raise SystemRefusedError(f"{interface.model_name} has no {what} {name!r}{did_you_mean(name, known)}")
    return found


def _label(name: str) -> str:
    return name.replace(".", "_")


def check_step(dt: float, interface: Interface) -> float:
    """The sampling time (s) as a float.

    Raises `SystemRefusedError` for one that the FMU cannot be stepped with.
    """
    if isinstance(dt, bool) or not 0.0 < float(dt) < float("inf"):
        raise SystemRefusedError(
            f"dt = {dt}: an FMU for co-simulation is a sampled system; give its communication step in s, for instance "
            "dt=0.001"
        )
    experiment = interface.description.defaultExperiment
    own = None if experiment is None or experiment.stepSize is None else float(experiment.stepSize)
    is_fixed = not interface.description.coSimulation.canHandleVariableCommunicationStepSize
    if is_fixed and own is not None and abs(dt - own) > 1e-9 * own:
        raise SystemRefusedError(
            f"dt = {dt} s: {interface.model_name} takes steps of {own} s only; give dt={own}, and sample the other "
            "systems at that time as well"
        )
    return float(dt)


class DrivenFmu:
    """An FMU initialised at `start_time` (s) with these parameters and start values of inputs; steps are `dt` (s) long.

    A context that frees it; it is freed as well when nothing refers to it any more. After a failed step the instance
    is where the FMU left it: load a state before going on.

    Raises `SystemRefusedError` for a file, name or value that is refused, `RunStoppedError` if it does not initialise.
    """

    def __init__(
        self,
        path: Path | str,
        dt: float,
        inputs: Signals = None,
        outputs: Signals = None,
        parameters: Mapping[str, Value] | None = None,
        start_time: float = 0.0,
    ) -> None:
        self.path = Path(path)
        self.interface = read_interface(self.path)
        self.dt = check_step(dt, self.interface)
        self.start_time = start_time
        self.inputs = input_ports(self.interface, inputs)
        self.outputs = output_ports(self.interface, outputs)
        values = {settable(self.interface, name): value for name, value in (parameters or {}).items()}
        starts = {variable: variable.value(value) for variable, value in values.items()}
        self.start_inputs = np.array([float(starts.get(v, v.start_value or 0.0)) for v, _ in self.inputs])
        self._over = ""
        with ExitStack() as scope:
            folder = scope.enter_context(fmu_folder(None))
            self._slave = Slave(Component(self.path.stem, self.path), self.interface, folder)
            scope.callback(self._slave.close)
            self._saved: dict[int, c_void_p] = {}
            scope.callback(_freed, self._slave, self._saved)
            self._initialise(starts)
            self._close = weakref.finalize(self, scope.pop_all().close)

    def _initialise(self, values: Mapping[Variable, Value]) -> None:
        slave = self._slave
        with slave.starting(self.start_time) as fmu:
            for variable, value in values.items():
                slave.set_value(variable, value)
            fmu.setupExperiment(startTime=self.start_time)
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
        slave.ready = slave.started = True
        self._given = self.start_inputs.copy()
        self._read: list[tuple[NDArray[np.intp], NDArray[Any]]] = []
        for kind in ("Real", "Integer", "Boolean"):
            self._feed(kind)
            places = np.array([i for i, (v, _) in enumerate(self.outputs) if _KINDS[v.type] == kind], np.intp)
            if len(places):
                buffer = np.zeros(len(places), np.float64 if kind == "Real" else np.int32)
                slave.gets.append(slave.call(f"fmi2Get{kind}", [self.outputs[i].variable for i in places], buffer))
                self._read.append((places, buffer))
        if self.can_restore:
            self._get_state = partial(slave.function("fmi2GetFMUstate"), slave.pointer)
            self._set_state = partial(slave.function("fmi2SetFMUstate"), slave.pointer)

    def _feed(self, kind: str) -> None:
        places = np.array([i for i, (v, _) in enumerate(self.inputs) if _KINDS[v.type] == kind], np.intp)
        if not len(places):
            return
        variables = [self.inputs[i].variable for i in places]
        buffer: NDArray[Any] = np.zeros(len(places), np.float64 if kind == "Real" else np.int32)
        gather: Callable[[], NDArray[Any]]
        if kind == "Real":
            gather = partial(self._given.take, places, None, buffer, "clip")
        else:
            gather = partial(_whole, self._given, places, buffer, variables)
        self._slave.feeds.append(Feed(gather, self._slave.call(f"fmi2Set{kind}", variables, buffer)))

    def __enter__(self) -> DrivenFmu:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()

    def close(self) -> None:
        """End and free the instance."""
        self._over = self._over or "closed"
        self._close()

    @property
    def name(self) -> str:
        """What the instance is called."""
        return self._slave.name

    # --- running

    def step(self, time: float, given: Array) -> None:
        """From `time` (s) to time + dt with the inputs held.

        Raises `RunStoppedError` if the FMU does not.
        """
        self._check_open()
        self._given[:] = given
        try:
            self._slave.set_inputs(time)
            self._slave.step(time, self.dt)
        except Exception:
            self._note_fatal()
            raise

    def set(self, time: float, given: Array) -> None:
        """Set the inputs without a step."""
        self._check_open()
        self._given[:] = given
        self._slave.set_inputs(time)

    def shown(self, time: float) -> Array:
        """The outputs now."""
        self._check_open()
        self._slave.get_outputs(time)
        if len(self._read) == 1:
            return self._read[0][1].astype(np.float64)
        values = np.empty(len(self.outputs))
        for places, buffer in self._read:
            values[places] = buffer
        return values

    def run(self, first: int, given: Array, coupling_delay: int = 1) -> Array:
        """Outputs (n, outputs) of steps `first` and following with the inputs (n, inputs).

        Row k shows the outputs before step k with `coupling_delay` 1, after it with 0.
        """
        outputs = np.empty((len(given), len(self.outputs)))
        for k, row in enumerate(given):
            time = self.start_time + (first + k) * self.dt
            if coupling_delay:
                outputs[k] = self.shown(time)
            self.step(time, row)
            if not coupling_delay:
                outputs[k] = self.shown(time)
        return outputs

    # --- states

    @property
    def can_restore(self) -> bool:
        """Whether it says that its state can be saved and loaded."""
        return bool(self.interface.description.coSimulation.canGetAndSetFMUstate)

    @property
    def can_serialize(self) -> bool:
        """Whether it says that a saved state can be had as bytes."""
        return bool(self.interface.description.coSimulation.canSerializeFMUstate)

    def is_saved(self, key: int) -> bool:
        """Whether a state is kept under this key."""
        return key in self._saved

    def save(self, key: int, time: float) -> None:
        """Keep the state under a key."""
        self._check_open()
        slot = c_void_p()
        self._checked("fmi2GetFMUstate", self._get_state(byref(slot)), time)
        self.forget(key)
        self._saved[key] = slot

    def load(self, key: int, time: float) -> None:
        """Go back to a kept state."""
        self._check_open()
        self._checked("fmi2SetFMUstate", self._set_state(self._saved[key]), time)

    def forget(self, key: int) -> None:
        """Free a kept state."""
        slot = self._saved.pop(key, None)
        if slot is not None:
            _free(self._slave, slot)

    def serialized(self, key: int) -> bytes:
        """A kept state as bytes."""
        self._check_open()
        with self._slave.starting(self.start_time) as fmu:
            return bytes(fmu.serializeFMUstate(self._saved[key]))

    def keep(self, key: int, data: bytes) -> None:
        """Keep the state that these bytes are."""
        self._check_open()
        with self._slave.starting(self.start_time) as fmu:
            self._saved[key] = fmu.deSerializeFMUstate(data)

    # --- derivatives

    def derivatives(self, unknowns: Sequence[Variable], knowns: Sequence[Variable]) -> Array:
        """d unknown / d known, a row for each unknown, by fmi2GetDirectionalDerivative.

        Raises `RunStoppedError` if the FMU has none.
        """
        self._check_open()
        rows = [variable.reference for variable in unknowns]
        with self._slave.starting(self.start_time) as fmu:
            columns = [fmu.getDirectionalDerivative(rows, [known.reference], [1.0]) for known in knowns]
        return np.array(columns, np.float64).reshape(len(knowns), len(rows)).T

    def _checked(self, function: str, status: int, time: float) -> None:
        if status > WARNING:
            error = self._slave.failed(function, status, time)
            self._note_fatal()
            raise error

    def _note_fatal(self) -> None:
        if self._slave.fatal:
            self._over = "at an end: it returned fatal"

    def _check_open(self) -> None:
        if self._over:
            raise SystemRefusedError(f"{self._slave.name} is {self._over}; make the system anew")


def _whole(
    given: Array, places: NDArray[np.intp], buffer: NDArray[np.int32], variables: Sequence[Variable]
) -> NDArray[np.int32]:
    values = given[places]
    for variable, value in zip(variables, values, strict=True):
        if value != np.floor(value):
            raise SystemRefusedError(f"{variable.name} = {value:.9g}: not a whole number, which a {variable.type} is")
    buffer[:] = values if variables[0].type != "Boolean" else values != 0.0
    return buffer


def _free(slave: Slave, slot: c_void_p) -> None:
    if not slave.fatal:
        slave.function("fmi2FreeFMUstate")(slave.pointer, byref(slot))


def _freed(slave: Slave, saved: dict[int, c_void_p]) -> None:
    for slot in saved.values():
        _free(slave, slot)
    saved.clear()
