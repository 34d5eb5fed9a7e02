"""A test bench for one attitude sensor FMU: drives its inputs, reads the parts' registers, fast.

A record of a tick is made in steps that each hold one tick of the part's clock, with the input of the step set to the
truth at that tick: the part then samples exactly what was meant, whatever its clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from ctypes import c_int, c_size_t, c_uint32, c_void_p
from pathlib import Path
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from attitude_fmu.fmu_src.errors import did_you_mean

from .errors import SystemRefusedError
from .interface import Interface, Value, Variable
from .slave import WARNING, Slave
from .system import Component
from .workspace import fmu_folder

Array = NDArray[np.float64]
Progress = Callable[[float], None]
"""Called with the seconds simulated since the last call."""

RATE = ("rate[1]", "rate[2]", "rate[3]")
FORCE = ("specific_force[1]", "specific_force[2]", "specific_force[3]")
TEMPERATURE = ("temperature",)
_REGISTERS = (
    *(f"register.rate[{axis}]" for axis in (1, 2, 3)),
    *(f"register.acceleration[{axis}]" for axis in (1, 2, 3)),
    "register.gyro_temperature",
    "register.accelerometer_temperature",
)
_PROCESSOR_PERIOD = 0.1
"""s; the registers are read past the processor, whose attitude solution need not be computed more often."""

_TOLD = 20_000
"""Steps between two calls of the progress."""


class Record(NamedTuple):
    """What the registers held: time (s) of the tick of each row, codes of gyros and accelerometers (n, 3), of the
    two thermometers (n, 2)."""

    time: Array
    gyro: NDArray[np.int32]
    accelerometer: NDArray[np.int32]
    thermometers: NDArray[np.int32]


class Bench:
    """One initialised instance of the FMU with these parameter values; a context that frees it."""

    def __init__(
        self, fmu: Path, interface: Interface, folder: Path, values: Mapping[str, Value], progress: Progress
    ) -> None:
        self._progress = progress
        self._interface = interface
        self._slave = Slave(Component("sensor", fmu), interface, folder)
        self._tick = 0
        self._step = 0.0
        try:
            self._start({"processor.period": _PROCESSOR_PERIOD, **values})
        except BaseException:
            self._slave.close()
            raise

    def __enter__(self) -> Bench:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._slave.close()

    def _start(self, values: Mapping[str, Value]) -> None:
        with self._slave.starting(0.0) as fmu:
            for name, value in values.items():
                variable = settable(self._interface, name)
                self._slave.set_value(variable, variable.value(value))
            fmu.setupExperiment(startTime=0.0)
            fmu.enterInitializationMode()
            fmu.exitInitializationMode()
        self._slave.ready = self._slave.started = True

    def value(self, name: str) -> float:
        """The value of a variable now: a parameter, or what the FMU calculated from them."""
        variable = self._interface.variables[name]
        with self._slave.starting(0.0) as fmu:
            kind = "Integer" if variable.type == "Enumeration" else variable.type
            return float(getattr(fmu, f"get{kind}")([variable.reference])[0])

    def record(
        self,
        step: float,
        steps: int,
        names: tuple[str, ...] = (),
        inputs: Array | None = None,
    ) -> Record:
        """The registers after each of so many steps (s), tick k at k * step in the middle of its step.

        `inputs` (steps, len(names)) are the inputs `names` at these ticks, held where none are given. A bench records
        with one step only, as often as wanted: the ticks go on.
        """
        if self._tick == 0:
            self._advance_to_the_first_tick(step)
        elif step != self._step:
            raise ValueError(f"step = {step} s: this bench records every {self._step} s")
        codes = np.zeros((steps, len(_REGISTERS)), np.int32)
        values = np.zeros((steps, 0)) if inputs is None else np.ascontiguousarray(inputs, np.float64)
        self._run(steps, names, values, codes)
        time = np.asarray(step * np.arange(self._tick, self._tick + steps), np.float64)
        self._tick += steps
        return Record(time, codes[:, 0:3], codes[:, 3:6], codes[:, 6:8])

    def _advance_to_the_first_tick(self, step: float) -> None:
        self._slave.step(0.0, 0.5 * step)
        self._step, self._tick = step, 1

    def _run(self, steps: int, names: tuple[str, ...], values: Array, codes: NDArray[np.int32]) -> None:
        slave, step = self._slave, self._step
        feed, fed = self._call("fmi2SetReal", names)
        read, kept = self._call("fmi2GetInteger", _REGISTERS)
        first, stride, base = values.ctypes.data, values.strides[0], codes.ctypes.data
        row = codes.strides[0]
        start = (self._tick - 0.5) * step
        for block in range(0, steps, _TOLD):
            last = min(steps, block + _TOLD)
            for k in range(block, last):
                now = start + k * step
                if names:
                    fed.value = first + k * stride
                    status = feed()
                    if status > WARNING:
                        raise slave.failed("fmi2SetReal", status, now)
                slave.step(now, step)
                kept.value = base + k * row
                status = read()
                if status > WARNING:
                    raise slave.failed("fmi2GetInteger", status, now)
            self._progress((last - block) * step)

    def _call(self, function: str, names: tuple[str, ...]) -> tuple[Callable[[], int], c_void_p]:
        """A get or set call for these variables, and the place of its values, which can be moved."""
        variables = [self._interface.variables[name] for name in names]
        references = (c_uint32 * max(1, len(variables)))(*[variable.reference for variable in variables])
        count, place = c_size_t(len(variables)), c_void_p()
        made: Any = self._slave.fmu.dll[function]
        made.restype = c_int
        pointer = self._slave.pointer
        return lambda: made(pointer, references, count, place), place


class Benches:
    """Makes benches for one FMU file, which is unpacked once."""

    def __init__(self, fmu: Path, interface: Interface, folder: Path, progress: Progress) -> None:
        self.interface = interface
        self._fmu = fmu
        self._folder = folder
        self._progress = progress

    def bench(self, values: Mapping[str, Value]) -> Bench:
        """A bench with these parameter values.

        Raises `SystemRefusedError` for an unknown name, `RunStoppedError` for values that the FMU refuses.
        """
        return Bench(self._fmu, self.interface, self._folder, values, self._progress)


@contextmanager
def benches(fmu: Path, interface: Interface, progress: Progress = lambda _: None) -> Iterator[Benches]:
    """Benches for the FMU; `progress` hears of every second that they simulate.

    Raises `ResultsError` if there is no folder to unpack the FMU in.
    """
    with fmu_folder(None) as folder:
        yield Benches(fmu, interface, folder, progress)


def settable(interface: Interface, name: str) -> Variable:
    """The parameter or input of this name.

    Raises `SystemRefusedError` if there is none.
    """
    variable = interface.variables.get(name)
    if variable is None:
        hint = did_you_mean(name, interface.variables)
        raise SystemRefusedError(f"{interface.model_name} has no variable {name!r}{hint}")
    if not variable.settable or variable.causality not in ("parameter", "input"):
        raise SystemRefusedError(f"{name} is no parameter of {interface.model_name}: it cannot be set")
    return variable
