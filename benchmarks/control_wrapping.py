"""What it costs to run an FMU as a nonlinear system of python-control, beside the FMU alone.

``python benchmarks/control_wrapping.py [--dist dist] [--steps N]``. A step alone sets the inputs, calls ``doStep`` and
reads the outputs, by calls that are prepared before; wrapped it is the system's update and output. All in one run and
in turns; processor time, which other work on the machine disturbs least. Fails if the wrapping costs more than 15 us.

"go on": the states one after the other, as simulations do. "go back": two steps from each state, as a search over
inputs does. "whole": `control.input_output_response`, whose own cost is in it.
"""

from __future__ import annotations

import statistics
import sys
import time
from pathlib import Path
from typing import Annotated, NamedTuple

import control as ct  # type: ignore[import-untyped]
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

from attitude_fmu.cosim.control.driven_fmu import DrivenFmu
from attitude_fmu.cosim.control.fmu_systems import FmuSystem, fmu_nlsys
from attitude_fmu.fmu_src.build import build_all

STEP = 1e-3
ROUNDS = 9
LIMIT = 15.0
PORTS = {
    "AttitudeSensor": (["rate", "specific_force"], ["euler", "rate_measured"]),
    "TripodGimbal": ("motor_torque", ["euler", "joint"]),
    "GimbalController": (["euler", "rate", "joint"], "motor_torque"),
}


class Cost(NamedTuple):
    """us for each step."""

    alone: float
    on: float
    back: float
    whole: float


def _alone(fmu: DrivenFmu, done: int, given: np.ndarray) -> float:
    slave = fmu._slave
    begin = time.process_time()
    for k, row in enumerate(given, done):
        fmu._given[:] = row
        slave.set_inputs(k * STEP)
        slave.step(k * STEP, STEP)
        slave.get_outputs(k * STEP)
    return (time.process_time() - begin) / len(given) * 1e6


def _on(system: FmuSystem, given: np.ndarray) -> float:
    x = np.zeros(1)
    begin = time.process_time()
    for row in given:
        x = system._rhs(0.0, x, row)
        system._out(0.0, x, row)
    return (time.process_time() - begin) / len(given) * 1e6


def _back(system: FmuSystem, given: np.ndarray) -> float:
    x, other = np.zeros(1), given[::-1].copy()
    begin = time.process_time()
    for row, second in zip(given, other, strict=True):
        system._rhs(0.0, x, second)
        x = system._rhs(0.0, x, row)
    return (time.process_time() - begin) / (2 * len(given)) * 1e6


def _whole(system: FmuSystem, given: np.ndarray) -> float:
    times = STEP * np.arange(len(given))
    begin = time.process_time()
    ct.input_output_response(system, times, given.T)
    return (time.process_time() - begin) / len(given) * 1e6


def measure(fmu: Path, steps: int) -> Cost:
    """Medians of the rounds, each with inputs of its own."""
    inputs, outputs = PORTS[fmu.stem]
    chance = np.random.default_rng(1)
    with (
        DrivenFmu(fmu, STEP, inputs, outputs) as alone,
        fmu_nlsys(fmu, STEP, inputs, outputs) as system,
    ):
        rounds = []
        for number in range(ROUNDS):
            given = [alone.start_inputs + 1e-3 * chance.normal(size=(steps, len(alone.start_inputs))) for _ in range(4)]
            first = _alone(alone, number * steps, given[0])
            rounds.append((first, _on(system, given[1]), _back(system, given[2]), _whole(system, given[3])))
    return Cost(*[statistics.median(column) for column in zip(*rounds, strict=True)])


def main(
    dist: Annotated[Path, typer.Option(help="Folder of the FMUs.")] = Path("dist"),
    steps: Annotated[int, typer.Option(help="Steps in each of the nine rounds.")] = 3000,
) -> None:
    """Print the table; fails if going on costs more than 15 us above the FMU alone."""
    table = Table("FMU", "alone / us", "go on / us", "wrapping / us", "quotient", "go back / us", "whole / us")
    worst = 0.0
    for fmu in build_all(dist, list(PORTS)):
        cost = measure(fmu, steps)
        worst = max(worst, cost.on - cost.alone)
        added = cost.on - cost.alone
        numbers = (cost.alone, cost.on, added, cost.on / cost.alone, cost.back, cost.whole)
        table.add_row(fmu.stem, *[f"{number:.2f}" for number in numbers])
    Console().print(table)
    sys.exit(worst > LIMIT)


if __name__ == "__main__":
    typer.run(main)
