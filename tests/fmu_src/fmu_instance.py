"""An FMU loaded with FMPy, and the test model as an FMU; used by the tests here and by the processes they start."""

from __future__ import annotations

import shutil
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

from fmpy import extract, instantiate_fmu, read_model_description
from fmpy.fmi1 import FMICallException

from attitude_fmu.fmu_src.catalogue import Entry, Kind

EVERY_KIND = Entry("EveryKind", "every_kind", 1.0, 1e-3, about="For tests.")


class Difference(NamedTuple):
    """All that a host sees of an FMU's kind, but for what only the native one offers."""

    status: str
    """of a refused call, in FMPy's words"""
    speaks: bool
    """on stderr as well as in the log"""
    refuses_bytes: str
    """the call that refuses bytes which are no saved state"""
    fingerprint_at: int
    """place in those bytes"""
    checksum: str
    """format of their end"""
    division_by_zero: str
    """in a task's step, as the reason given"""


DIFFERENCES: dict[Kind, Difference] = {
    "native": Difference(
        "error", False, "fmi2DeSerializeFMUstate", 8, "<Q", "EveryKind.state.ticks = inf: the numbers ran away"
    ),
    "python": Difference("fatal", True, "fmi2SetFMUstate", 6, "<I", "EveryKind: task sample at t = 0.004 s: float div"),
}


class Instance:
    """An FMU loaded with FMPy, its variables by name."""

    log: ClassVar[deque[str]] = deque(maxlen=100)
    """Of all instances: FMPy hands every message to the logger that it was given last."""

    def __init__(self, archive: Path) -> None:
        self.kind: Kind = "python" if archive.parent.name == "python" else "native"
        self.differs = DIFFERENCES[self.kind]
        self.folder = extract(str(archive))
        self.description = read_model_description(self.folder)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self._groups: dict[str, list[Any]] = {}
        for variable in self.variables.values():
            self._groups.setdefault({"Enumeration": "Integer"}.get(variable.type, variable.type), []).append(variable)
        self.fmu: Any = None
        self.open()

    def open(self) -> None:
        self.fmu = instantiate_fmu(
            self.folder,
            self.description,
            "CoSimulation",
            debug_logging=True,
            logger=lambda *entry: self.log.append(entry[-1].decode()),
        )

    def _call(self, verb: str, name: str) -> tuple[Any, list[int]]:
        variable = self.variables[name]
        kind = {"Enumeration": "Integer"}.get(variable.type, variable.type)
        return getattr(self.fmu, f"{verb}{kind}"), [variable.valueReference]

    def __getitem__(self, name: str) -> Any:
        call, references = self._call("get", name)
        return call(references)[0]

    def __setitem__(self, name: str, value: Any) -> None:
        call, references = self._call("set", name)
        call(references, [value])

    def initialise(self, start_time: float = 0.0, **values: Any) -> Instance:
        self.fmu.setupExperiment(startTime=start_time)
        for name, value in values.items():
            self[name] = value
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        return self

    def step(self, count: int = 1, length: float = 1e-3, start: float = 0.0) -> Instance:
        for i in range(count):
            self.fmu.doStep(start + i * length, length)
        return self

    def bits(self) -> dict[str, str]:
        """Every variable to the last bit, without the count of refused calls."""
        found = {}
        for kind, variables in self._groups.items():
            values = getattr(self.fmu, f"get{kind}")([variable.valueReference for variable in variables])
            found |= {v.name: float(value).hex() for v, value in zip(variables, values, strict=True)}
        del found["refused_calls"]
        return found

    def refusal(self, call: Callable[[], Any], by: str = "") -> str:
        """The reason in the log for refusing `call`; it must be refused, by the FMI function `by` if given."""
        self.log.clear()
        failed = ""
        try:
            call()
        except FMICallException as error:
            failed = str(error)
        assert f"({self.differs.status})" in failed, "the call was not refused"
        assert by in failed
        return self.log[-1].rpartition("\n")[2]  # pythonfmu puts a line before it

    def serialised(self) -> bytes:
        """The state as bytes."""
        state = self.fmu.getFMUstate()
        data = bytes(self.fmu.serializeFMUstate(state))
        self.fmu.freeFMUstate(state)
        return data

    def restore(self, data: bytes) -> None:
        """Go on from what `serialised` gave."""
        state = self.fmu.deSerializeFMUstate(data)
        try:
            self.fmu.setFMUstate(state)
        finally:
            self.fmu.freeFMUstate(state)

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)
