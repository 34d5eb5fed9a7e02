"""Runs an .ssp file in a master that is not ours, in a process of its own, because such a master may take it down.

`rows_of` starts ``python other_master.py libcosim|ecos <task as JSON>``; the task names the .ssp file, the step (s) and
how many, what to read (name and kind), what to set before which step, and the .npy file to write: a row for each
communication point.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

NOT_INSTALLED = 77
"""Exit status where the master's own package cannot be imported, and that only."""


def rows_of(
    master: str,
    ssp: Path,
    parameter_set: str,
    step: float,
    steps: int,
    read: Sequence[tuple[str, str]],
    settings: Mapping[int, Sequence[tuple[str, float]]] | None = None,
) -> np.ndarray[Any, np.dtype[Any]]:
    """What a master reads at each communication point, a column for each name; skips where it is not installed."""
    results = ssp.with_suffix(f".{master}.npy")
    task = {
        "ssp": str(ssp),
        "parameter_set": parameter_set,
        "step": step,
        "steps": steps,
        "read": read,
        "set": settings or {},
        "results": str(results),
    }
    done = subprocess.run(
        [sys.executable, __file__, master, json.dumps(task)], capture_output=True, text=True, check=False
    )
    if done.returncode == NOT_INSTALLED:
        pytest.skip(f"{master} is not installed completely: {done.stderr.strip()}")
    assert done.returncode == 0, done.stderr
    print(done.stdout)
    rows: np.ndarray[Any, np.dtype[Any]] = np.load(results)
    results.unlink()
    return rows


class LibCosim:
    """Its values can be read from the first step on."""

    first = 1

    @staticmethod
    def modules() -> tuple[Any, Any, Any]:
        """What of the package is needed."""
        from libcosimpy import CosimExecution, CosimLogging, CosimObserver

        return CosimExecution, CosimLogging, CosimObserver

    def __init__(self, ssp: str, parameter_set: str, step: float) -> None:
        execution, logging, observer = self.modules()
        logging.log_output_level(logging.CosimLogLevel.WARNING)
        self.execution = execution.CosimExecution.from_ssp_file(ssp_path=ssp, step_size=round(step * 1e9))
        self.observer = observer.CosimObserver.create_last_value()
        self.execution.add_observer(self.observer)

    def reader(self, name: str, kind: str) -> Callable[[], float]:
        """A function that reads an output."""
        component, variable = name.split(".", 1)
        index = self.execution.slave_index_from_instance_name(component)
        references = {one.name.decode(): one.reference for one in self.execution.slave_variables(index)}
        read = getattr(self.observer, f"last_{kind.lower()}_values")
        return lambda: float(read(index, [references[variable]])[0])

    def step(self, count: int = 1) -> None:
        assert self.execution.step(count)


class Ecos:
    """It takes no notice of an FMU's status."""

    first = 0

    @staticmethod
    def modules() -> tuple[Any]:
        """What of the package is needed."""
        import ecospy

        return (ecospy,)

    def __init__(self, ssp: str, parameter_set: str, step: float) -> None:
        (ecospy,) = self.modules()
        self.simulation = ecospy.EcosSimulation(ssp_path=ssp, step_size=step)
        assert self.simulation.init(parameter_set=parameter_set)

    def reader(self, name: str, kind: str) -> Callable[[], float]:
        """A function that reads an output."""
        read = getattr(self.simulation, {"Real": "get_real", "Integer": "get_integer", "Boolean": "get_bool"}[kind])
        identifier = name.replace(".", "::", 1)
        return lambda: float(read(identifier))

    def set_real(self, name: str, value: float) -> None:
        self.simulation.set_real(name.replace(".", "::", 1), value)

    def step(self, count: int = 1) -> None:
        self.simulation.step(count)


MASTERS: dict[str, Any] = {"libcosim": LibCosim, "ecos": Ecos}


def rows(master: Any, task: dict[str, Any]) -> Iterator[list[float]]:
    """What is read at each communication point; NaN where the master cannot tell yet."""
    readers = [master.reader(name, kind) for name, kind in task["read"]]
    for point in range(task["steps"] + 1):
        if point:
            for name, value in task["set"].get(str(point), []):
                master.set_real(name, value)
            master.step()
        yield [read() if point >= master.first else np.nan for read in readers]


def main() -> None:
    """Do the task; then tell the time (s) of a step."""
    task = json.loads(sys.argv[2])
    kind = MASTERS[sys.argv[1]]
    try:
        kind.modules()
    except (ImportError, OSError) as error:  # also a shared library that the package needs
        print(error, file=sys.stderr)
        sys.exit(NOT_INSTALLED)
    master = kind(task["ssp"], task["parameter_set"], task["step"])
    np.save(task["results"], np.array(list(rows(master, task))))
    began = time.perf_counter()
    master.step(1000)
    print(f"time of a step: {(time.perf_counter() - began) / 1000:.3g} s")


if __name__ == "__main__":
    main()
