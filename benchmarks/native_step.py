"""What a step of 1 ms of a native FMU costs, called from C.

``python benchmarks/native_step.py [NAME ...] [--steps N]``, on Linux or macOS. Beside it, in the same run and in turns:
the same doStep of the Python kind through FMPy, VQF's C++ update of one sample, and fmi2Instantiate. Shown are medians
and, in brackets, the smallest of the rounds.
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
from typing import Annotated, Any, NamedTuple

import numpy as np
import typer
from fmpy import extract, instantiate_fmu, read_model_description  # type: ignore[import-untyped]
from rich.console import Console
from rich.table import Table
from vqf import VQF  # type: ignore[import-untyped]

from attitude_fmu.fmu_src.build import build
from attitude_fmu.fmu_src.catalogue import CATALOGUE
from attitude_fmu.fmu_src.native.compile import compiler, headers, host_platform

STEP = 1e-3
ROUNDS = 9
FIRST_BUILD = 0.82
"""us of doStep(1 ms) in the first native build of the attitude sensor, on the machine that the limits are meant for."""

LARGEST_STEP = 1.5 * FIRST_BUILD
SMALLEST_RATIO = 100.0
LARGEST_INSTANTIATION = 1000.0
JUDGED = "AttitudeSensor"

_PYTHON_SHARE = 100
_KINDS = {"Real": "Real", "Integer": "Integer", "Enumeration": "Integer", "Boolean": "Boolean"}


def compiled_host(folder: Path) -> Path:
    """The C host."""
    program = folder / "native_step"
    source = Path(__file__).with_suffix(".c")
    command = [*compiler(), "-std=gnu99", "-O2", "-I", str(headers()), str(source), "-ldl", "-o", str(program)]
    subprocess.run(command, check=True)
    return program


def _group(description: Any, causality: str, kind: str) -> str:
    found = [v for v in description.modelVariables if v.causality == causality and _KINDS[v.type] == kind]
    values = {"true": "1", "false": "0", None: "0"}
    numbers = [f"{v.valueReference} {values.get(v.start, v.start)}" for v in found]
    return " ".join([str(len(found)), *numbers])


class NativeUnit:
    """An initialised instance in the C host."""

    def __init__(self, program: Path, archive: Path) -> None:
        self.folder = extract(str(archive))
        description = read_model_description(self.folder)
        platform = host_platform()
        library = Path(self.folder) / "binaries" / platform.folder / f"{archive.stem}{platform.suffix}"
        self.host = subprocess.Popen(
            [str(program), str(library), description.guid],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        for causality in ("input", "output"):
            for kind in ("Real", "Integer", "Boolean"):
                self._say(_group(description, causality, kind))

    def _say(self, line: str) -> None:
        assert self.host.stdin is not None
        self.host.stdin.write(f"{line}\n")
        self.host.stdin.flush()

    def measure(self, command: str, count: int) -> float:
        """Microseconds per call."""
        self._say(f"{command} {count}")
        assert self.host.stdout is not None
        return float(self.host.stdout.readline())

    def close(self) -> None:
        self.host.communicate()
        shutil.rmtree(self.folder, ignore_errors=True)
        assert self.host.returncode == 0


class PythonUnit:
    """An initialised instance of the Python kind."""

    def __init__(self, archive: Path) -> None:
        self.folder = extract(str(archive))
        self.fmu = instantiate_fmu(self.folder, read_model_description(self.folder), "CoSimulation")
        self.fmu.setupExperiment(startTime=0.0)
        self.fmu.enterInitializationMode()
        self.fmu.exitInitializationMode()
        self.steps = 0

    def measure(self, count: int) -> float:
        """Microseconds per doStep."""
        begin = time.perf_counter()
        for _ in range(count):
            self.fmu.doStep(self.steps * STEP, STEP)
            self.steps += 1
        return (time.perf_counter() - begin) / count * 1e6

    def close(self) -> None:
        self.fmu.terminate()
        self.fmu.freeInstance()
        shutil.rmtree(self.folder, ignore_errors=True)


def vqf_measurement() -> Callable[[int], float]:
    """Microseconds per sample of VQF's six-axis update."""
    estimator = VQF(STEP)
    random = np.random.default_rng(1)

    def measure(count: int) -> float:
        rate = 0.01 * random.standard_normal((count, 3))
        force = np.array([0.0, 0.0, 9.81]) + 0.01 * random.standard_normal((count, 3))
        begin = time.perf_counter()
        estimator.updateBatch(rate, force)
        return (time.perf_counter() - begin) / count * 1e6

    return measure


class Costs(NamedTuple):
    """Microseconds of each round."""

    step: list[float]
    communication: list[float]
    instantiation: list[float]
    python: list[float]
    vqf: list[float]


def measure(identifier: str, program: Path, folder: Path, steps: int) -> Costs:
    """Every cost in turns."""
    native = NativeUnit(program, build(identifier, folder, "native"))
    python = PythonUnit(build(identifier, folder, "python"))
    vqf = vqf_measurement()
    costs = Costs([], [], [], [], [])
    for _ in range(ROUNDS):
        costs.step.append(native.measure("step", steps))
        costs.communication.append(native.measure("communicate", steps))
        costs.instantiation.append(native.measure("instantiate", 1000))
        costs.python.append(python.measure(max(steps // _PYTHON_SHARE, 1)))
        costs.vqf.append(vqf(steps))
    native.close()
    python.close()
    return costs


def _shown(rounds: list[float]) -> str:
    return f"{statistics.median(rounds):.3g} ({min(rounds):.3g})"


def _row(identifier: str, costs: Costs) -> list[str]:
    step, python, vqf = (statistics.median(rounds) for rounds in (costs.step, costs.python, costs.vqf))
    shown = [
        _shown(rounds) for rounds in (costs.step, costs.communication, costs.vqf, costs.python, costs.instantiation)
    ]
    return [identifier, *shown, f"{step / vqf:.2f}", f"{python / step:.0f}"]


def _limits(costs: Costs) -> list[tuple[str, float, str, bool]]:
    step, python, instantiation = (
        statistics.median(rounds) for rounds in (costs.step, costs.python, costs.instantiation)
    )
    return [
        ("doStep(1 ms) / us", step, f"<= {LARGEST_STEP:g}", step <= LARGEST_STEP),
        ("Python kind / native", python / step, f">= {SMALLEST_RATIO:g}", python / step >= SMALLEST_RATIO),
        ("instantiate / us", instantiation, f"< {LARGEST_INSTANTIATION:g}", instantiation < LARGEST_INSTANTIATION),
    ]


def main(
    names: Annotated[list[str] | None, typer.Argument(help="FMUs to measure; all of the catalogue if none.")] = None,
    steps: Annotated[int, typer.Option(help="Native steps in each of the nine rounds.")] = 50_000,
) -> None:
    """Print the tables; fails if the attitude sensor misses a limit."""
    table = Table("FMU", "doStep / us", "set, doStep, get / us", "VQF / us", "Python doStep / us", "instantiate / us")
    table.add_column("doStep / VQF")
    table.add_column("Python / native")
    judged = Table(f"{JUDGED}, median", "measured", "limit", "kept")
    kept = True
    with tempfile.TemporaryDirectory() as name:
        program = compiled_host(Path(name))
        for identifier in names or [entry.identifier for entry in CATALOGUE]:
            costs = measure(identifier, program, Path(name), steps)
            table.add_row(*_row(identifier, costs))
            if identifier == JUDGED:
                for what, value, limit, is_kept in _limits(costs):
                    judged.add_row(what, f"{value:.3g}", limit, "yes" if is_kept else "no")
                    kept &= is_kept
    console = Console()
    console.print(table)
    if judged.row_count:
        console.print(judged)
    sys.exit(not kept)


if __name__ == "__main__":
    typer.run(main)
