"""An FMU loaded with FMPy, and the test model as an FMU; used by the tests here and by the processes they start."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from fmpy import extract, instantiate_fmu, read_model_description

from attitude_fmu.fmu_src.catalogue import Entry

EVERY_KIND = Entry("EveryKind", "every_kind", 1.0, 1e-3, about="For tests.")


class Instance:
    """An FMU loaded with FMPy, its variables by name."""

    def __init__(self, archive: Path, logger: Any = None) -> None:
        self.folder = extract(str(archive))
        self.description = read_model_description(self.folder)
        self.variables = {variable.name: variable for variable in self.description.modelVariables}
        self.fmu: Any = None
        self.open(logger)

    def open(self, logger: Any = None) -> None:
        self.fmu = instantiate_fmu(
            self.folder, self.description, "CoSimulation", debug_logging=logger is not None, logger=logger
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

    def outputs(self) -> dict[str, Any]:
        return {name: self[name] for name, v in self.variables.items() if v.causality in ("output", "local")}

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)
