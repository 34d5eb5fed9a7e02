"""What one communication step of the Python kind costs: ours against an empty pythonfmu slave with the same ports.

``python benchmarks/communication_step.py [NAME ...] [--steps N]``. One step sets all inputs, calls ``doStep(1 ms)`` and
gets all outputs, through FMPy, both in one run and in turns; the sensor's quotient has to stay below 10.
"""

from __future__ import annotations

import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any

import typer
from fmpy import extract, instantiate_fmu, read_model_description  # type: ignore[import-untyped]
from rich.console import Console
from rich.table import Table

from attitude_fmu.fmu_src.build import build

STEP = 1e-3
ROUNDS = 9
LIMIT = 10.0

_CLASSES = {"Enumeration": "Integer"}


def _empty_slave(description: Any, folder: Path) -> Path:
    """A pythonfmu slave as a user would write it, with the ports of `description`, that does nothing."""
    # a name of its own for each, because the modules of plain pythonfmu FMUs clash
    name = f"Empty{description.coSimulation.modelIdentifier}"
    lines = ["from pythonfmu import *", f"class {name}(Fmi2Slave):", "    def __init__(self, **kwargs):"]
    lines.append("        super().__init__(**kwargs)")
    ports = [v for v in description.modelVariables if v.causality in ("input", "output")]
    for i, variable in enumerate(ports):
        kind = _CLASSES.get(variable.type, variable.type)
        causality = f"Fmi2Causality.{variable.causality}"
        variability = "Fmi2Variability.continuous" if kind == "Real" else "Fmi2Variability.discrete"
        lines.append(f"        self.v{i} = {'0.0' if kind == 'Real' else '0'}")
        lines.append(
            f"        self.register_variable({kind}('v{i}', causality={causality}, variability={variability}))"
        )
    lines += ["    def do_step(self, current_time, step_size):", "        return True", ""]
    source = folder / f"{name.lower()}.py"
    source.write_text("\n".join(lines))
    subprocess.run(
        [sys.executable, "-m", "pythonfmu", "build", "-f", str(source), "-d", str(folder)],
        check=True,
        capture_output=True,
    )
    return folder / f"{name}.fmu"


class _Stepper:
    """An FMU whose whole communication step is one call."""

    def __init__(self, archive: Path, values: dict[str, Any]) -> None:
        self.folder = extract(str(archive))
        description = read_model_description(self.folder, validate=False)
        self.fmu = instantiate_fmu(self.folder, description, "CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.setters = self._calls(description, "input", "set")
        self.getters = self._calls(description, "output", "get")
        by_reference = {v.valueReference: float(v.start or 0) for v in description.modelVariables if v.type == "Real"}
        self.values = [[by_reference.get(r, values.get(kind, 0)) for r in refs] for kind, _, refs in self.setters]
        self.steps = 0

    def _calls(self, description: Any, causality: str, verb: str) -> list[tuple[str, Callable[..., Any], list[int]]]:
        found: dict[str, list[int]] = {}
        for variable in description.modelVariables:
            if variable.causality == causality:
                found.setdefault(_CLASSES.get(variable.type, variable.type), []).append(variable.valueReference)
        return [(kind, getattr(self.fmu, verb + kind), references) for kind, references in found.items()]

    def run(self, steps: int) -> float:
        """Microseconds per communication step."""
        begin = time.perf_counter()
        for _ in range(steps):
            for (_kind, call, references), values in zip(self.setters, self.values, strict=True):
                call(references, values)
            self.fmu.doStep(self.steps * STEP, STEP)
            for _kind, call, references in self.getters:
                call(references)
            self.steps += 1
        return (time.perf_counter() - begin) / steps * 1e6

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


def measure(identifier: str, steps: int) -> tuple[float, float, int, int]:
    """Median cost in us of our FMU's step and of the empty one's, and their numbers of inputs and outputs."""
    with tempfile.TemporaryDirectory() as folder:
        ours_archive = build(identifier, Path(folder), "python")
        description = read_model_description(str(ours_archive))
        numbers = [sum(v.causality == c for v in description.modelVariables) for c in ("input", "output")]
        ours = _Stepper(ours_archive, {"Integer": 1, "Boolean": False})
        empty = _Stepper(_empty_slave(description, Path(folder)), {"Integer": 1, "Boolean": False})
        pairs = [(ours.run(steps), empty.run(steps)) for _ in range(ROUNDS)]
        ours.close()
        empty.close()
    return statistics.median(a for a, _ in pairs), statistics.median(b for _, b in pairs), numbers[0], numbers[1]


def main(
    names: Annotated[list[str] | None, typer.Argument(help="FMUs to measure.")] = None,
    steps: Annotated[int, typer.Option(help="Steps in each of the nine rounds.")] = 1000,
) -> None:
    """Print the table; fails if the attitude sensor's quotient is above 10."""
    table = Table("FMU", "in", "out", "ours / us", "empty / us", "quotient", "real-time factor")
    worst = 0.0
    for name in names or ["AttitudeSensor"]:
        ours, empty, inputs, outputs = measure(name, steps)
        if name == "AttitudeSensor":
            worst = ours / empty
        table.add_row(
            name,
            str(inputs),
            str(outputs),
            f"{ours:.1f}",
            f"{empty:.1f}",
            f"{ours / empty:.2f}",
            f"{STEP * 1e6 / ours:.1f}",
        )
    Console().print(table)
    sys.exit(worst > LIMIT)


if __name__ == "__main__":
    typer.run(main)
