"""The command ``attitude-fmu``."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, NoReturn

import typer

from attitude_fmu.models.errors import AttitudeFmuError

# FMPy, numpy and the rest are imported where they are used: --help answers at once
if TYPE_CHECKING:
    from .interface import Value
    from .jobs import Job
    from .master import Outcome
    from .report import Roles
    from .scenarios import Scenario
    from .system import System

application = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A MEMS attitude sensor and a camera gimbal on a tripod, as FMI 2.0 co-simulation FMUs, coupled and run.",
    epilog="[bold]attitude-fmu run[/bold] is the place to start. Each command has a --help of its own.",
)


_RESULTS, _LOOP_OFF, _PICTURE = "results.csv", "loop_off.csv", "overview.png"
_SYSTEM, _PARAMETERS = "system.ssp", "parameters.ssv"
_MOST_CHANGES = 110


class Order(StrEnum):
    """The two orders of the master."""

    JACOBI = "jacobi"
    GAUSS_SEIDEL = "gauss-seidel"


RUN_HELP = """Couple FMUs, run them, and show what came out.

SYSTEM is a scenario ([bold]gimbal[/bold]: a camera on a gimbal on a windy tripod, stabilised from the sensor; \
[bold]static[/bold]: the sensor alone at rest) or an .ssp file of yours. \
The FMUs of a scenario are built when they are missing or older than their sources.

Written into the output folder: \
results.csv (what was recorded, in SI units), \
overview.png (the picture), \
system.ssp (the coupled system, for any tool that reads SSP), \
parameters.ssv (every parameter that was used), \
and for the gimbal loop_off.csv (the same run with the joints held).

[bold]Examples[/bold]

  attitude-fmu run

  attitude-fmu run --stop 10 --out calm --set plant.wind.speed=0

  attitude-fmu run --set sensor.solver.kind=gyro --set sensor.seed=7

  attitude-fmu run --set controller.mode=hold_joints --record 'plant.*'

  attitude-fmu run static --stop 300 --set sensor.filter.kind=kalman

  attitude-fmu run out/system.ssp --out again

[bold]attitude-fmu info gimbal[/bold] lists what --set and --record take.
"""


@application.command(help=RUN_HELP, no_args_is_help=False)
def run(
    system: Annotated[str, typer.Argument(help="A scenario, or an .ssp file.", metavar="SYSTEM")] = "gimbal",
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder for what the run writes; made if missing.")
    ] = Path("out"),
    stop: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", help="Stop time in s.", show_default="the system's own, 60 for the scenarios"),
    ] = None,
    step: Annotated[float, typer.Option(metavar="SECONDS", help="Communication step in s.")] = 1e-3,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set",
            metavar="COMPONENT.VARIABLE=VALUE",
            help="A parameter or a free input, in the FMU's own unit (SI); numbers, true, false, or the name of a "
            "choice. Repeat it for more; wins over --parameters.",
        ),
    ] = None,
    parameters: Annotated[
        list[Path] | None,
        typer.Option(metavar="FILE", help="An .ssv file with values named component.variable. Repeatable."),
    ] = None,
    master: Annotated[
        Order, typer.Option(help="Order of the FMUs in a step: all at once, or each seeing those before it.")
    ] = Order.GAUSS_SEIDEL,
    record: Annotated[
        list[str] | None,
        typer.Option(
            metavar="PATTERN",
            help="Also record these variables; * stands for anything. Repeatable.",
            show_default="a scenario's signals of interest; all outputs of an .ssp",
        ),
    ] = None,
    interval: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS", help="Time between records in s, a multiple of the step.", show_default="the step"
        ),
    ] = None,
    dist: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder of the FMUs that scenarios use and build.")
    ] = Path("dist"),
) -> None:
    """Couple FMUs, run them, and show what came out."""
    with _reported():
        _run(_Request(system, out, stop, step, values or [], parameters or [], master, record or [], interval, dist))


@application.command()
def build(
    names: Annotated[list[str] | None, typer.Argument(metavar="NAME", help="Which FMUs; all by default.")] = None,
    dist: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder to build into.")] = Path("dist"),
) -> None:
    """Build the project's FMUs where they are missing or older than their sources.

    Example: attitude-fmu build AttitudeSensor --dist fmus
    """
    with _reported():
        _build(names, dist, always_tell=True)


@application.command()
def info(
    what: Annotated[str, typer.Argument(metavar="SYSTEM", help="An .fmu or .ssp file, or a scenario.")],
    dist: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder of the FMUs that scenarios use and build.")
    ] = Path("dist"),
    pattern: Annotated[str, typer.Option(metavar="TEXT", help="Show only what has this in its name.")] = "",
    everything: Annotated[
        bool, typer.Option("--all", help="Also inputs that are connected, calculated parameters and local variables.")
    ] = False,
) -> None:
    """List what can be set and recorded in an FMU or a coupled system: start values, ranges and what they mean.

    Example: attitude-fmu info gimbal --pattern wind
    """
    with _reported():
        _info(what, dist, pattern, everything)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"attitude-fmu {version('attitude-fmu')}")
        raise typer.Exit


@application.callback()
def _common(
    show: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    pass


def main() -> None:
    """Run the command; an error that has a cause in what was asked for is one line on stderr."""
    application()


# --- run -----------------------------------------------------------------------------------------------------------


class _Request(NamedTuple):
    """What `run` was asked to do."""

    what: str
    out: Path
    stop: float | None
    step: float
    settings: list[str]
    parameters: list[Path]
    master: Order
    record: list[str]
    interval: float | None
    dist: Path

    @property
    def changes(self) -> str:
        """What was set, in short."""
        text = ", ".join([*(path.name for path in self.parameters), *self.settings])
        return text if len(text) <= _MOST_CHANGES else f"{text[:_MOST_CHANGES]} ..."


def _run(request: _Request) -> None:
    from .jobs import check_job
    from .report import roles_of
    from .system import check

    with _system(request.what, request.dist) as (described, scenario):
        system = _with_settings(described, request)
        interfaces = check(system)
        roles = roles_of(system, interfaces)
        jobs = _jobs(system, scenario, roles, request, interfaces)
        for job in jobs:
            check_job(job)
        _keep_what_was_given(request)
        outcomes = _outcomes(jobs, interfaces, request.out)
        _show(request, system, scenario, roles, interfaces, jobs, outcomes)


def _keep_what_was_given(request: _Request) -> None:
    from .errors import SystemRefusedError

    ours = [request.out / name for name in (_SYSTEM, _PARAMETERS)]
    for given in (Path(request.what), *request.parameters):
        if given.is_file() and any(path.is_file() and path.samefile(given) for path in ours):
            raise SystemRefusedError(f"{given} would be overwritten by what the run writes; choose another --out")


def _outcomes(jobs: list[Job], interfaces: Any, out: Path) -> dict[str, Outcome]:
    """Run the jobs; nothing in the folder `out` changes unless there are new results."""
    from .errors import ResultsError, RunStoppedError
    from .jobs import run_jobs
    from .ssp import write_ssp, write_ssv
    from .system import parameters_used

    try:
        out.mkdir(parents=True, exist_ok=True)
        drafts = tempfile.TemporaryDirectory(prefix=".run_", dir=out)
    except OSError as error:
        raise ResultsError(f"cannot write into {out}: {error.strerror or error}") from error
    with drafts as name:
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
def _system(what: str, dist: Path) -> Iterator[tuple[System, Scenario | None]]:
    from .errors import SystemRefusedError
    from .scenarios import SCENARIOS, scenario_called
    from .ssp import open_ssp

    if what.lower().endswith(".ssp"):
        with open_ssp(Path(what)) as system:
            yield system, None
        return
    if Path(what).exists() and what not in [scenario.name for scenario in SCENARIOS]:
        kind = "a folder" if Path(what).is_dir() else "no .ssp file"
        raise SystemRefusedError(f"{what} is {kind}; give the .ssp file of a system, or the name of a scenario")
    scenario = scenario_called(what)
    _build(list(scenario.fmus), dist)
    yield scenario.system(dist), scenario


def _with_settings(system: System, request: _Request) -> System:
    from .ssp import read_ssv

    for path in request.parameters:
        system = system.with_set(read_ssv(path))
    return system.with_values("command_line", _settings(request.settings))


def _settings(texts: list[str]) -> dict[str, Value]:
    settings: dict[str, Value] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or "." not in name:
            _refuse_usage(f"--set {text}: write it as component.variable=value, for instance sensor.seed=7")
        settings[name.strip()] = value.strip()
    return settings


def _jobs(system: System, scenario: Scenario | None, roles: Roles, request: _Request, interfaces: Any) -> list[Job]:
    from .errors import SystemRefusedError
    from .jobs import Job

    stop = system.stop_time if request.stop is None else request.stop
    if stop is None:
        raise SystemRefusedError(f"{request.what} names no stop time; give one with --stop")
    record = _recorded(scenario, request, interfaces)
    # what is written with the results runs as long again
    system = replace(system, stop_time=stop)
    common: dict[str, Any] = {
        "stop_time": stop,
        "step": request.step,
        "order": request.master.value,
        "interval": request.interval,
    }
    jobs = [Job("run", system, request.out / _RESULTS, record=record, **common)]
    if _loop_is_closed(system, roles, interfaces):
        held = system.with_values("loop_off", {f"{roles.controller}.mode": "hold_joints"})
        names = (f"{roles.truth}.euler.*",)
        jobs.append(Job("loop off", held, request.out / _LOOP_OFF, record=names, **common))
    return jobs


def _recorded(scenario: Scenario | None, request: _Request, interfaces: Any) -> tuple[str, ...] | None:
    if scenario is not None:
        return (*scenario.record, *request.record)
    if not request.record:
        return None
    outputs = [
        f"{component}.{variable.name}"
        for component, interface in interfaces.items()
        for variable in interface.variables.values()
        if variable.causality == "output" and variable.type != "String"
    ]
    return (*outputs, *request.record)


def _loop_is_closed(system: System, roles: Roles, interfaces: Any) -> bool:
    from .system import Port, start_values

    if roles.controller is None or roles.truth is None or roles.sensor is None:
        return False
    mode = interfaces[roles.controller].variables["mode"]
    value = start_values(system, interfaces).get(Port(roles.controller, "mode"), mode.start_value)
    return {item.value: item.name for item in mode.items}.get(int(value or 0)) == "stabilise"


@contextmanager
def _progress(jobs: list[Job]) -> Iterator[tuple[Callable[[str, float], None], Callable[[], None]]]:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

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


def _show(
    request: _Request,
    system: System,
    scenario: Scenario | None,
    roles: Roles,
    interfaces: Any,
    jobs: list[Job],
    outcomes: dict[str, Outcome],
) -> None:
    from rich.console import Console

    from .plot import Picture, plot
    from .report import report, table

    outcome = outcomes["run"]
    loop_off = outcomes["loop off"].results if "loop off" in outcomes else None
    attitude = None if scenario is None else scenario.attitude
    numbers = report(outcome.results, outcome.elapsed, roles, interfaces, attitude=attitude, loop_off=loop_off)
    order = {Order.JACOBI: "Jacobi", Order.GAUSS_SEIDEL: "Gauss-Seidel"}[request.master]
    title = f"{system.name}: {jobs[0].stop_time:g} s, communication step {1e3 * request.step:g} ms, {order}"
    console = Console()
    console.print(table(numbers, title, loop=loop_off is not None))
    for warning in outcome.warnings[:5]:
        console.print(f"warning from {warning}", style="yellow", highlight=False, markup=False)
    changes = request.changes and f"set: {request.changes}"
    heading = system.description.rstrip(".") or system.name
    plot(
        request.out / _PICTURE,
        Picture(heading, (title, changes), outcome.results, roles, numbers, interfaces, attitude, loop_off),
    )
    names = [_RESULTS, *([_LOOP_OFF] if loop_off is not None else [])]
    console.print(
        f"In {request.out}: {', '.join([*names, _PICTURE, _SYSTEM, _PARAMETERS])}",
        highlight=False,
        markup=False,
        soft_wrap=True,
    )


_SETTABLE, _OUTPUTS, _REST = "What --set takes", "Outputs, for --record", "The rest, for --record"
_GROUPS = (_SETTABLE, _OUTPUTS, _REST)


# --- the other commands --------------------------------------------------------------------------------------------


def _build(names: list[str] | None, dist: Path, *, always_tell: bool = False) -> None:
    from rich.console import Console

    from attitude_fmu.fmu_src.build import build_all

    console = Console(stderr=True)

    def tell(name: str, event: str) -> None:
        if always_tell or event == "building":
            console.print(f"{event} {dist / name}.fmu", style="dim", highlight=False, markup=False)

    build_all(dist, names, tell)


def _info(what: str, dist: Path, pattern: str, everything: bool) -> None:
    from .errors import SystemRefusedError
    from .interface import read_interface
    from .system import Port, interfaces_of, start_values

    wired: dict[Port, str] = {}
    given: dict[Port, Value] = {}
    if what.lower().endswith(".fmu"):
        interfaces = {"": read_interface(Path(what))}
    else:
        with _system(what, dist) as (system, _):
            interfaces = interfaces_of(system)
            given = start_values(system, interfaces)
            wired = {wire.target: str(wire) for wire in system.connections}
    groups: dict[str, list[Any]] = {group: [] for group in _GROUPS}
    for component, interface in interfaces.items():
        for variable in interface.variables.values():
            port = Port(component, variable.name)
            if pattern in _full_name(port):
                groups[_group_of(variable, port in wired)].append((port, variable, given.get(port, variable.start)))
    wires = [wire for wire in wired.values() if pattern in wire]
    shown = {group: entries for group, entries in groups.items() if entries and (everything or group != _REST)}
    if not shown and not wires:
        more = "" if everything else "; --all shows the rest"
        raise SystemRefusedError(f"{what} has nothing with {pattern!r} in its name{more}")
    _print_groups(shown, wires)


def _full_name(port: Any) -> str:
    return str(port) if port.component else str(port.variable)


def _group_of(variable: Any, is_wired: bool) -> str:
    if variable.causality == "output":
        return _OUTPUTS
    settable = variable.settable and variable.causality in ("parameter", "input") and not is_wired
    return _SETTABLE if settable else _REST


def _print_groups(groups: dict[str, list[Any]], wires: list[str]) -> None:
    from rich.console import Console
    from rich.padding import Padding
    from rich.text import Text

    # a pipe gets whole lines, a terminal what fits
    console = Console() if sys.stdout.isatty() else Console(width=1000)
    for group, entries in groups.items():
        console.print(group, style="bold", highlight=False)
        for port, variable, start in entries:
            choices = ", ".join(f"{item.value} {item.name}" for item in variable.items)
            # as text: names with brackets are no markup
            head = Text(_full_name(port), style="cyan").append(_start(variable, start), style="default")
            allowed = choices or variable.allowed
            if allowed and group != _OUTPUTS:
                head.append(f"  ({allowed})", style="dim")
            console.print(Padding(head, (0, 0, 0, 2), expand=False))
            if variable.description:
                console.print(Padding(Text(variable.description), (0, 0, 0, 6), expand=False))
    if wires:
        console.print("Connections", style="bold", highlight=False)
    for wire in wires:
        console.print(Padding(Text(wire), (0, 0, 0, 2), expand=False))


def _start(variable: Any, value: Any) -> str:
    unit = f" {variable.unit}" if variable.unit and variable.unit != "1" else ""
    return unit and f" [{unit.strip()}]" if value is None else f" = {_short(variable, value)}{unit}"


def _short(variable: Any, value: Any) -> str:
    if variable.type == "Enumeration":
        return next((item.name for item in variable.items if str(item.value) == str(value)), str(value))
    return f"{float(value):.6g}" if variable.type == "Real" else str(value)


# --- errors --------------------------------------------------------------------------------------------------------


@contextmanager
def _reported() -> Iterator[None]:
    try:
        yield
    except AttitudeFmuError as error:
        _complain(str(error))
        raise typer.Exit(130 if getattr(error, "interrupted", False) else 1) from None
    except OSError as error:
        _complain(f"{error.filename or 'file system'}: {error.strerror or error}")
        raise typer.Exit(1) from None
    except KeyboardInterrupt:
        _complain("stopped by the user")
        raise typer.Exit(130) from None


def _refuse_usage(message: str) -> NoReturn:
    _complain(message)
    raise typer.Exit(2)


def _complain(message: str) -> None:
    from rich.console import Console

    console = Console(stderr=True, soft_wrap=True)
    console.print(f"attitude-fmu: {message}", style="bold red", highlight=False, markup=False)


if __name__ == "__main__":
    main()
