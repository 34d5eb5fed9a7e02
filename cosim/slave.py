"""One FMU that takes part in a run."""

from __future__ import annotations

import itertools
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from ctypes import byref, c_double, c_int, c_size_t, c_uint32, c_void_p
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import fmpy  # type: ignore[import-untyped]
import numpy as np
from fmpy import fmi2
from fmpy.logging import addLoggerProxy  # type: ignore[import-untyped]

from .errors import RunStoppedError, SystemRefusedError
from .interface import Interface, Value, Variable
from .system import Component

_STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING, _ERROR, _FATAL = 1, 3, 4
_PYTHONFMU = "Fatal py exception encountered"

_listening: dict[int, Slave] = {}
"""Who hears what is logged, by the environment that an FMU hands back. FMPy's logger proxy calls the logger that was
set last, whichever instance logs: there is one for all."""
_numbers = itertools.count(1)
_abandoned: list[Any] = []
"""Instances that returned fatal cannot be freed; nothing that they point to may go."""


def _heard(environment: Any, instance: Any, status: int, category: Any, message: Any) -> None:
    named = (slave for slave in _listening.values() if slave.name.encode() == instance)
    slave = _listening.get(environment or 0) or next(named, None)
    if slave is not None:
        slave.logged(status, message)


_LOGGER = fmi2.fmi2CallbackLoggerTYPE(_heard)


class Call(NamedTuple):
    """One call of an FMU, ready to be made: its arguments are made once, which is most of what ctypes costs."""

    name: str
    make: Callable[[], int]


class Feed(NamedTuple):
    """How one type of an FMU's inputs is filled: gather the values, then call."""

    gather: Callable[[], np.ndarray[Any, Any]]
    call: Call


class Slave:
    """One instance of an FMU, which is unpacked in the folder unless it lies there already.

    What it logs is kept for the message that explains a failure.
    """

    def __init__(self, component: Component, interface: Interface, folder: Path) -> None:
        self.name = component.name
        self.interface = interface
        self.log: deque[tuple[int, str]] = deque(maxlen=100)
        self.fatal = False
        self.ready = False
        self.started = False
        self.number = next(_numbers)
        _listening[self.number] = self
        self.fmu: Any = None
        self.gets: list[Call] = []
        self.feeds: list[Feed] = []
        try:
            if not (folder / "modelDescription.xml").is_file():
                fmpy.extract(str(component.fmu), unzipdir=str(folder))
            self.fmu = self._instance(folder)
        except Exception as error:  # FMPy raises bare Exception
            del _listening[self.number]
            raise SystemRefusedError(
                f"{self.name} ({component.fmu.name}) cannot be loaded: {self._why(error)}"
            ) from error
        self.pointer = c_void_p(self.fmu.component)
        self._time, self._size = c_double(), c_double()
        self._do_step = partial(self.function("fmi2DoStep"), self.pointer, self._time, self._size, c_int(1))

    def _instance(self, folder: Path) -> Any:
        # fmpy.instantiate_fmu would name every instance after its model
        description = self.interface.description
        identifier = description.coSimulation.modelIdentifier
        fmu = fmi2.FMU2Slave(
            guid=description.guid, modelIdentifier=identifier, unzipDirectory=str(folder), instanceName=self.name
        )
        callbacks = fmi2.fmi2CallbackFunctions()
        callbacks.logger = _LOGGER
        callbacks.componentEnvironment = self.number
        callbacks.allocateMemory = fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
        callbacks.freeMemory = fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
        addLoggerProxy(byref(callbacks))
        fmu.instantiate(callbacks=callbacks, loggingOn=True)
        return fmu

    def logged(self, status: int, message: bytes | None) -> None:
        """Take note of what the FMU logs."""
        text = message.decode("utf-8", "replace") if message else ""
        # pythonfmu puts a line of its own before the reason
        own, _, reason = text.partition("\n")
        self.log.append((int(status), " ".join((reason if own.startswith(_PYTHONFMU) and reason else text).split())))

    def _why(self, error: Exception) -> str:
        said = self.said(_ERROR)
        return f"{error}{': ' + said if said else ''}"

    def function(self, name: str) -> Callable[..., int]:
        """A function of the FMU's library, its arguments to be given as ctypes has them."""
        # by index: FMPy holds the attribute of this name with its own argument types
        function = self.fmu.dll[name]
        function.restype = c_int
        return function  # type: ignore[no-any-return]

    def call(self, name: str, variables: Sequence[Variable], values: np.ndarray[Any, np.dtype[Any]]) -> Call:
        """A get or set call for these variables, with `values` as its memory."""
        references = (c_uint32 * len(variables))(*[variable.reference for variable in variables])
        count, place = c_size_t(len(variables)), values.ctypes.data_as(c_void_p)
        return Call(name, partial(self.function(name), self.pointer, references, count, place))

    def said(self, at_least: int) -> str:
        """The last few things that the FMU logged with a status of `at_least` or worse."""
        texts = [text for status, text in self.log if status >= at_least and text]
        return "; ".join(dict.fromkeys(texts[-3:]))

    def failed(self, function: str, status: int, time: float) -> RunStoppedError:
        """The error for a call that returned a bad status."""
        self.fatal = self.fatal or status == _FATAL
        shown = _STATUS[status] if 0 <= status < len(_STATUS) else str(status)
        said = self.said(WARNING) or self.said(0)
        if not self.started and said:
            # it may find out in any call, also when its outputs are asked for
            return RunStoppedError(f"{self.name}: start values refused: {said}", time)
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
        for gather, (name, make) in self.feeds:
            gather()
            status = make()
            if status > WARNING:
                raise self.failed(name, status, time)

    def step(self, time: float, size: float) -> None:
        self._time.value, self._size.value = time, size
        status = self._do_step()
        if status > WARNING:
            raise self.failed("fmi2DoStep", status, time)

    def get_outputs(self, time: float) -> None:
        for name, make in self.gets:
            status = make()
            if status > WARNING:
                raise self.failed(name, status, time)

    def set_value(self, variable: Variable, value: Value) -> None:
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        getattr(self.fmu, f"set{kind}")([variable.reference], [value])

    def close(self) -> None:
        """End and free the instance; one that returned fatal must not be touched again."""
        if self.fatal:
            _abandoned.append(self.fmu)
        elif self.fmu is not None:
            if self.ready:
                with suppress(Exception):
                    self.fmu.terminate()
            with suppress(Exception):
                self.fmu.freeInstance()
        _listening.pop(self.number, None)
