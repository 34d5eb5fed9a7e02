"""What a communication step of the coupled gimbal costs: our master, FMPy's own calls, ecos and libcosim, on one SSP.

``python benchmarks/coupled_run.py [--seconds S] [--fmu KIND]``. Each master runs in a process of its own, in turns; the
figure is microseconds per FMU and communication step of 1 ms, the median of the rounds. Ours runs twice: with the
scenario's recording of every step, and with nothing recorded, which is all that the others do here.
"""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer
from rich.console import Console
from rich.table import Table

from attitude_fmu.cosim.master import simulate
from attitude_fmu.cosim.scenarios import SCENARIOS
from attitude_fmu.cosim.ssp import open_ssp, write_ssp
from attitude_fmu.fmu_src.build import build_all, folder_of
from attitude_fmu.fmu_src.catalogue import Kind

STEP = 1e-3
ROUNDS = 5
LIMIT = 7.0
SCENARIO = SCENARIOS[0]


def _ours(ssp: Path, seconds: float, record: tuple[str, ...]) -> float:
    with open_ssp(ssp) as system:
        return simulate(system, stop_time=seconds, step=STEP, order="jacobi", record=record).elapsed


class _Own(NamedTuple):
    """An FMU and what a loop over FMPy's methods calls: sets with the places of the values, and gets."""

    fmu: Any
    sets: list[tuple[Callable[..., Any], list[int], list[tuple[str, str]]]]
    gets: list[tuple[Callable[..., Any], list[int], list[tuple[str, str]]]]


def _fmpy(ssp: Path, seconds: float) -> float:
    """The loop that FMPy's examples show: getReal, setReal, doStep with lists, for connected variables only."""
    from fmpy import extract, instantiate_fmu, read_model_description

    with open_ssp(ssp) as system:
        units: dict[str, _Own] = {}
        values: dict[tuple[str, str], Any] = {}
        for component in system.components:
            folder = extract(str(component.fmu))
            description = read_model_description(folder)
            fmu = instantiate_fmu(folder, description, "CoSimulation")
            variables = {variable.name: variable for variable in description.modelVariables}
            sets: dict[str, list[tuple[int, tuple[str, str]]]] = {}
            gets: dict[str, list[tuple[int, tuple[str, str]]]] = {}
            for connection in system.connections:
                source, target = connection
                if target.component == component.name:
                    variable = variables[target.variable]
                    sets.setdefault(variable.type, []).append((variable.valueReference, tuple(source)))
                if source.component == component.name:
                    variable = variables[source.variable]
                    gets.setdefault(variable.type, []).append((variable.valueReference, tuple(source)))
            calls = [
                [(getattr(fmu, f"{verb}{kind}"), [r for r, _ in pairs], [p for _, p in pairs]) for kind, pairs in group]
                for verb, group in (("set", sets.items()), ("get", gets.items()))
            ]
            units[component.name] = _Own(fmu, *calls)
            fmu.setupExperiment(startTime=0.0)
            for parameter_set in system.parameter_sets:
                for name, value in parameter_set.values.items():
                    owner, _, variable_name = name.partition(".")
                    if owner == component.name:
                        fmu.setReal([variables[variable_name].valueReference], [float(value)])
            fmu.enterInitializationMode()

        def get() -> None:
            for unit in units.values():
                for call, references, places in unit.gets:
                    values.update(zip(places, call(references), strict=True))

        def put() -> None:
            for unit in units.values():
                for call, references, places in unit.sets:
                    call(references, [values[place] for place in places])

        for _ in units:
            get()
            put()
        for unit in units.values():
            unit.fmu.exitInitializationMode()
        get()
        begin = time.perf_counter()
        for i in range(round(seconds / STEP)):
            put()
            for unit in units.values():
                unit.fmu.doStep(i * STEP, STEP)
            get()
        return time.perf_counter() - begin


def _ecos(ssp: Path, seconds: float) -> float:
    from ecospy import EcosSimulation

    with EcosSimulation(ssp_path=str(ssp), step_size=STEP) as simulation:
        simulation.init(parameter_set=SCENARIO.name)
        begin = time.perf_counter()
        simulation.step(round(seconds / STEP))
        return time.perf_counter() - begin


def _libcosim(ssp: Path, seconds: float) -> float:
    from libcosimpy.CosimExecution import CosimExecution

    execution = CosimExecution.from_ssp_file(ssp_path=str(ssp), step_size=round(STEP * 1e9))
    begin = time.perf_counter()
    if not execution.step(round(seconds / STEP)):
        raise SystemExit("libcosim stopped")
    return time.perf_counter() - begin


MASTERS: dict[str, Callable[[Path, float], float]] = {
    "ours, every step recorded": lambda ssp, seconds: _ours(ssp, seconds, SCENARIO.record),
    "ours": lambda ssp, seconds: _ours(ssp, seconds, ()),
    "FMPy's own calls": _fmpy,
    "ecos": _ecos,
    "libcosim": _libcosim,
}


def _measured(master: str, ssp: Path, seconds: float) -> float | None:
    """Seconds that the steps took in a process of its own; None where the master does not run."""
    done = subprocess.run(
        [sys.executable, __file__, "--one", json.dumps([master, str(ssp), seconds])],
        capture_output=True,
        text=True,
        check=False,
    )
    found = [line for line in done.stdout.splitlines() if line.startswith("elapsed ")]
    return float(found[-1].split()[1]) if done.returncode == 0 and found else None


def main(
    seconds: Annotated[float, typer.Option(help="Simulated time of a run.")] = 10.0,
    fmu: Annotated[str, typer.Option(help="Kind of the FMUs: native or python.")] = "native",
    one: Annotated[str, typer.Option(hidden=True, help="Run one master here: its name, the SSP, the time.")] = "",
) -> None:
    """Print the table; fails if our master needs more than 7 us per FMU and step with native FMUs."""
    if one:
        master, ssp_name, simulated = json.loads(one)
        print("elapsed", MASTERS[master](Path(ssp_name), simulated), flush=True)
        return
    kind: Kind = "python" if fmu == "python" else "native"
    with tempfile.TemporaryDirectory() as folder:
        build_all(Path(folder), list(SCENARIO.fmus), kind=kind)
        ssp = write_ssp(SCENARIO.system(folder_of(Path(folder), kind)), Path(folder) / "gimbal.ssp")
        rounds = [{master: _measured(master, ssp, seconds) for master in MASTERS} for _ in range(ROUNDS)]
    table = Table("master", "us per FMU and step", "ratio to ours", "real-time factor")
    per_call = 1e6 * STEP / seconds / len(SCENARIO.fmus)
    medians = {
        master: statistics.median(times) if (times := [t for r in rounds if (t := r[master]) is not None]) else None
        for master in MASTERS
    }
    ours = medians["ours"] or float("nan")
    for master, median in medians.items():
        if median is None:
            table.add_row(master, "does not run here", "", "")
        else:
            table.add_row(master, f"{median * per_call:.2f}", f"{median / ours:.2f}", f"{seconds / median:.0f}")
    Console().print(table)
    slowest = (medians["ours, every step recorded"] or float("inf")) * per_call
    sys.exit(kind == "native" and slowest > LIMIT)


if __name__ == "__main__":
    typer.run(main)
