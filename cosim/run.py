"""One run as the command makes it: opened, checked, co-simulated, written into a folder and shown."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from attitude_fmu.fmu_src.catalogue import Kind

from .errors import ResultsError, RunStoppedError, SystemRefusedError
from .interface import Interface, Value
from .jobs import Job, check_job, run_jobs
from .master import Order, Outcome
from .report import Roles, report, roles_of, table
from .scenarios import Scenario, opened
from .ssp import read_ssv, write_ssp, write_ssv
from .system import Port, System, check, parameters_used, start_values
from .workspace import claimed

_RESULTS, _LOOP_OFF, _PICTURE = "results.csv", "loop_off.csv", "overview.png"
_SYSTEM, _PARAMETERS = "system.ssp", "parameters.ssv"
_MOST_CHANGES = 110
_MOST_WARNINGS = 5
_ORDERS: dict[Order, str] = {"jacobi": "Jacobi", "gauss-seidel": "Gauss-Seidel"}


class Request(NamedTuple):
    """What to run, how, and where to put it.

    `what` is an .ssp file or the name of a scenario, whose FMUs of the kind `fmu` lie in `dist`; `settings` are values
    by ``component.variable``, which win over the files `parameters`. Times in s.
    """

    what: str
    out: Path
    stop: float | None
    step: float
    settings: Mapping[str, Value]
    parameters: tuple[Path, ...]
    master: Order
    record: tuple[str, ...]
    interval: float | None
    dist: Path
    fmu: Kind

    @property
    def changes(self) -> str:
        """What was set, in short."""
        settings = [f"{name}={value}" for name, value in self.settings.items()]
        text = ", ".join([*(path.name for path in self.parameters), *settings])
        return text if len(text) <= _MOST_CHANGES else f"{text[:_MOST_CHANGES]} ..."


class _Opened(NamedTuple):
    """The system with all that was set, and what was found out about it."""

    system: System
    scenario: Scenario | None
    interfaces: Mapping[str, Interface]
    roles: Roles


def run(request: Request) -> None:
    """Run what was asked for; write results, picture, system and parameters, and print the numbers.

    Raises `SystemRefusedError`, `RunStoppedError`, `ResultsError`, or `BuildError` from building a scenario's FMUs.
    """
    with opened(request.what, request.dist, request.fmu) as (described, scenario):
        system = _with_settings(described, request)
        interfaces = check(system)
        found = _Opened(system, scenario, interfaces, roles_of(system, interfaces))
        jobs = _jobs(found, request)
        for job in jobs:
            check_job(job)
        _keep_what_was_given(request)
        with _owned(request.out):
            outcomes = _outcomes(jobs, interfaces, request.out)
            _show(request, found, jobs[0].stop_time, outcomes)


# --- what is run ----------------------------------------------------------------------------------------------------


def _with_settings(system: System, request: Request) -> System:
    for path in request.parameters:
        system = system.with_set(read_ssv(path))
    return system.with_values("command_line", request.settings)


def _jobs(found: _Opened, request: Request) -> list[Job]:
    stop = found.system.stop_time if request.stop is None else request.stop
    if stop is None:
        raise SystemRefusedError(f"{request.what} names no stop time; give one with --stop")
    # what is written with the results runs as long again
    system = replace(found.system, stop_time=stop)

    def job(name: str, its_system: System, results: str, record: tuple[str, ...] | None) -> Job:
        path = request.out / results
        return Job(name, its_system, path, stop, request.step, request.master, record, request.interval)

    jobs = [job("run", system, _RESULTS, _recorded(found, request))]
    if _loop_is_closed(found):
        held = system.with_values("loop_off", {f"{found.roles.controller}.mode": "hold_joints"})
        jobs.append(job("loop off", held, _LOOP_OFF, (f"{found.roles.truth}.euler.*",)))
    return jobs


def _recorded(found: _Opened, request: Request) -> tuple[str, ...] | None:
    if found.scenario is not None:
        return (*found.scenario.record, *request.record)
    if not request.record:
        return None
    outputs = [
        f"{component}.{variable.name}"
        for component, interface in found.interfaces.items()
        for variable in interface.variables.values()
        if variable.causality == "output" and variable.type != "String"
    ]
    return (*outputs, *request.record)


def _loop_is_closed(found: _Opened) -> bool:
    roles = found.roles
    if roles.controller is None or roles.truth is None or roles.sensor is None:
        return False
    mode = found.interfaces[roles.controller].variables["mode"]
    value = start_values(found.system, found.interfaces).get(Port(roles.controller, "mode"), mode.start_value)
    return {item.value: item.name for item in mode.items}.get(int(value or 0)) == "stabilise"


def _keep_what_was_given(request: Request) -> None:
    ours = [request.out / name for name in (_SYSTEM, _PARAMETERS)]
    for given in (Path(request.what), *request.parameters):
        if given.is_file() and any(path.is_file() and path.samefile(given) for path in ours):
            raise SystemRefusedError(f"{given} would be overwritten by what the run writes; choose another --out")


# --- running and writing --------------------------------------------------------------------------------------------


@contextmanager
def _owned(out: Path) -> Iterator[None]:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultsError(f"cannot write into {out}: {error.strerror or error}") from error
    with claimed(out):
        yield


def _outcomes(jobs: list[Job], interfaces: Mapping[str, Interface], out: Path) -> dict[str, Outcome]:
    """Run the jobs; nothing in the folder `out` changes unless there are new results."""
    with tempfile.TemporaryDirectory(prefix=".run_", dir=out) as name:
        system = jobs[0].system
        files = [
            write_ssp(system, Path(name) / _SYSTEM),
            write_ssv(parameters_used(system, interfaces), Path(name) / _PARAMETERS, interfaces),
        ]
        try:
            with _progress(jobs) as (progress, stopping):
                outcomes = run_jobs(jobs, progress, stopping)
        except RunStoppedError as error:
            if error.results is None or not len(error.results):
                raise
            _publish(files, jobs, out)
            message = f"{error}; what was recorded until then is in {out}"
            raise RunStoppedError(message, error.time, error.results, error.interrupted) from error
        _publish(files, jobs, out)
    return outcomes


def _publish(files: list[Path], jobs: list[Job], out: Path) -> None:
    for path in files:
        path.replace(out / path.name)
    for name in {_LOOP_OFF, _PICTURE} - {job.results.name for job in jobs}:
        # what an earlier run left must not be taken for this one's
        (out / name).unlink(missing_ok=True)


@contextmanager
def _progress(jobs: list[Job]) -> Iterator[tuple[Callable[[str, float], None], Callable[[], None]]]:
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.completed:.1f} of {task.total:g} s"),
        TimeRemainingColumn(),
    )
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bars:
        tasks = {job.name: bars.add_task(job.name, total=job.stop_time) for job in jobs}

        def progress(name: str, time: float) -> None:
            bars.update(tasks[name], completed=time)

        def stopping() -> None:
            bars.console.print("stopping ...", style="dim", highlight=False)

        yield progress, stopping


# --- showing --------------------------------------------------------------------------------------------------------


def _show(request: Request, found: _Opened, stop: float, outcomes: dict[str, Outcome]) -> None:
    from .plot import Picture, plot  # matplotlib takes its time, and only a run that went well needs it

    outcome = outcomes["run"]
    loop_off = outcomes["loop off"].results if "loop off" in outcomes else None
    attitude = None if found.scenario is None else found.scenario.attitude
    numbers = report(
        outcome.results, outcome.elapsed, found.roles, found.interfaces, attitude=attitude, loop_off=loop_off
    )
    system = found.system
    title = f"{system.name}: {stop:g} s, communication step {1e3 * request.step:g} ms, {_ORDERS[request.master]}"
    console = Console()
    console.print(table(numbers, title, loop=loop_off is not None))
    for warning in outcome.warnings[:_MOST_WARNINGS]:
        console.print(f"warning from {warning}", style="yellow", highlight=False, markup=False)
    heading = system.description.rstrip(".") or system.name
    lines = (title, request.changes and f"set: {request.changes}")
    picture = Picture(heading, lines, outcome.results, found.roles, numbers, found.interfaces, attitude, loop_off)
    plot(request.out / _PICTURE, picture)
    _tell_files(console, request.out, [_RESULTS, *([] if loop_off is None else [_LOOP_OFF])])


def _tell_files(console: Console, out: Path, results: list[str]) -> None:
    line = f"In {out}: {', '.join([*results, _PICTURE, _SYSTEM, _PARAMETERS])}"
    console.print(line, highlight=False, markup=False, soft_wrap=True)
