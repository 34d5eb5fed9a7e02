"""The command ``attitude-fmu design``: the stabilised head designed, exported, co-simulated and compared."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from attitude_fmu.fmu_src.build_messages import build_and_tell
from attitude_fmu.fmu_src.errors import did_you_mean
from attitude_fmu.models.errors import AttitudeFmuError
from attitude_fmu.models.sensors.devices import DEVICES

from .bench import settable
from .design_table import Run, rows_of, show_rows, write_rows
from .errors import ResultsError, SystemRefusedError
from .interface import Value, read_interface
from .jobs import Job, portable, run_jobs
from .recording import Results
from .report import AXES, EXPOSURE, Jitter, aligned_at, jitter
from .scenarios import WIND_SPEED
from .ssp import write_ssp
from .system import Component, ParameterSet, System, connect
from .workspace import claimed

IDEAL = "ideal"
SENSORS = ("ADXRS450_ADXL355", "ADIS16354_150", IDEAL)
"""Of the two papers, and one without errors."""

PLANT, HOLD, SENSOR = "TripodGimbal", "GimbalController", "AttitudeSensor"
_JOINTS = [f"{group}.{axis}" for group in ("joint", "joint_rate") for axis in AXES]
_TORQUES = [f"motor_torque.{axis}" for axis in AXES]

_SETTLING = 8.0
"""s from the end of the alignment until the loop is taken as settled."""

_TOGETHER = 2
"""Runs and designs at a time."""

_OURS = {
    "plant.wind.period": "it steps with the plant",
    "plant.solver_period": "it follows from the sensor's clock",
    "sensor.processor.period": "it follows from the sensor's clock",
    "sensor.ideal": "ask for --sensor ideal",
}
_RUNS = "runs"
_TABLE, _OVERVIEW, _LOOPS = "design.csv", "design_overview.png", "design_loops.png"


class DesignRequest(NamedTuple):
    """For which sensors to design, how long to co-simulate (s), and where to put it; `settings` are parameters of the
    plant and the sensor by ``component.variable``, FMUs lie in `dist`."""

    sensors: tuple[str, ...]
    out: Path
    stop: float
    settings: Mapping[str, str]
    dist: Path


def show_design(request: DesignRequest) -> None:
    """Design, export, co-simulate and compare; write everything into the folder and print the table.

    Raises `SystemRefusedError`, `LinearisationRefusedError`, `RunStoppedError`, `ResultsError` or `BuildError`.
    """
    plant, sensor = _parameters(request.settings)
    chosen = [_sensor(name, sensor) for name in request.sensors]
    console = Console(stderr=True)
    names = [PLANT, HOLD, *dict.fromkeys(one.fmu for one in chosen)]
    build_and_tell(request.dist, names, console, only_built=True, option="--fmu")
    _check_settings(request, chosen)
    _check_stop(request.stop, chosen)
    try:
        request.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ResultsError(f"cannot write into {request.out}: {error.strerror or error}") from error
    with claimed(request.out), _stages() as bars:
        for name in (_TABLE, _OVERVIEW, _LOOPS):  # of an earlier design
            (request.out / name).unlink(missing_ok=True)
        designs = _designed(chosen, plant, request.out, bars)
        runs = _simulated(designs, request, bars)
        bars.add_task("drawing", total=None)
        _write(request, designs, runs)
    _tell(request, designs, runs)


# --- what is asked for ----------------------------------------------------------------------------------------------


def _parameters(settings: Mapping[str, str]) -> tuple[dict[str, float], dict[str, float]]:
    """Parameters of plant and sensor as numbers. Raises `SystemRefusedError` for what cannot be taken."""
    found: dict[str, dict[str, float]] = {"plant": {"wind.speed": WIND_SPEED}, "sensor": {}}
    for name, text in settings.items():
        component, _, variable = name.partition(".")
        if name in _OURS:
            raise SystemRefusedError(f"{name} is not free in a design: {_OURS[name]}")
        if component not in found:
            raise SystemRefusedError(f"{name}: a design has the components plant and sensor")
        try:
            found[component][variable] = float(text)
        except ValueError:
            raise SystemRefusedError(f"{name} = {text}: a design takes numbers") from None
    return found["plant"], found["sensor"]


def _check_settings(request: DesignRequest, sensors: list[Any]) -> None:
    """Raise `SystemRefusedError` for a setting that an FMU does not take, before anything is worked out."""
    fmus = {"plant": [PLANT], "sensor": [sensor.fmu for sensor in sensors]}
    for name, text in request.settings.items():
        component, _, variable = name.partition(".")
        for fmu in fmus[component]:
            settable(read_interface(request.dist / f"{fmu}.fmu"), variable).value(text)


def _check_stop(stop: float, sensors: list[Any]) -> None:
    """Raise `SystemRefusedError` where no whole exposure would be left."""
    from .control.stepping import model_called, parameters_with

    aligned = max(parameters_with(model_called(one.fmu), one.parameters).alignment.duration for one in sensors)
    least = aligned + _SETTLING + 2.0 * EXPOSURE
    if not least <= stop < float("inf"):
        raise SystemRefusedError(
            f"--stop {stop:g}: jitter is counted in exposures of {EXPOSURE:g} s, from {_SETTLING:g} s after the "
            f"sensor's alignment of {aligned:g} s; choose {least:g} s or more"
        )


def _sensor(name: str, parameters: Mapping[str, float]) -> Any:
    from .head_design import Sensor

    if name == IDEAL:
        return Sensor(IDEAL, SENSOR, {**parameters, "ideal": True})
    if name not in DEVICES:
        known = [*DEVICES, IDEAL]
        raise SystemRefusedError(f"there is no sensor called {name!r}{did_you_mean(name, known)} ({', '.join(known)})")
    return Sensor(name, f"{SENSOR}_{name}", dict(parameters))


# --- design ---------------------------------------------------------------------------------------------------------


def _designed(sensors: list[Any], plant: Mapping[str, float], out: Path, bars: Progress) -> list[Any]:
    """The designs in the order of the sensors; sensors of the same clocks share a process."""
    from .control.head_models import clocks_of

    groups: dict[Any, list[Any]] = {}
    for sensor in sensors:
        groups.setdefault(clocks_of(sensor.fmu, sensor.parameters), []).append(sensor)
    with (
        tempfile.TemporaryDirectory(prefix=".design_", dir=out) as folder,
        _one_thread_each(),
        get_context("spawn").Pool(min(len(groups), _TOGETHER), _ignore_interrupts) as pool,
    ):
        tasks = {}
        for clocks, group in groups.items():
            shown = bars.add_task(f"designing for {', '.join(one.label for one in group)}", total=None)
            tasks[shown] = pool.apply_async(_design, (tuple(group), clocks, plant, Path(folder)))
        found: dict[str, Any] = {}
        for shown, task in tasks.items():
            answer = task.get()
            if isinstance(answer, AttitudeFmuError):
                raise answer
            found |= {design.sensor.label: _moved(design, out) for design in answer}
            bars.remove_task(shown)
    return [found[sensor.label] for sensor in sensors]


def _design(sensors: tuple[Any, ...], clocks: Any, plant: Mapping[str, float], folder: Path) -> Any:
    """`design_head` in a process of its own, from which not every error could come back."""
    from .head_design import design_head

    try:
        return design_head(sensors, clocks, plant, folder)
    except AttitudeFmuError as error:
        return portable(error)


def _moved(design: Any, folder: Path) -> Any:
    """The design with its controllers' FMUs in the folder."""
    controllers = []
    for one in design.controllers:
        path = folder / one.fmu.name
        one.fmu.replace(path)
        controllers.append(one._replace(fmu=path))
    return design._replace(controllers=tuple(controllers))


def _ignore_interrupts() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Small matrices in several processes: threads of the linear algebra would only wait for each other."""
    names = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
    before = {name: os.environ.get(name) for name in names}
    os.environ.update(dict.fromkeys(names, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


# --- co-simulation --------------------------------------------------------------------------------------------------


def head_system(design: Any, controller: Any | None, settings: Mapping[str, Value], dist: Path, stop: float) -> System:
    """The head with a sensor and a controller; without one, its joints are held.

    A holding controller has the joints until the sensor is aligned; the other one follows its torques until then.
    """
    label = design.sensor.label
    components = [
        Component("plant", dist / f"{PLANT}.fmu"),
        Component("sensor", dist / f"{design.sensor.fmu}.fmu"),
        Component("hold", dist / f"{HOLD}.fmu"),
    ]
    wires = [
        *connect("plant", "sensor", "rate[:3]", "specific_force[:3]", "angular_acceleration[:3]", "temperature"),
        *connect("plant", "sensor", ("euler.yaw", "heading_aid")),
        *connect("plant", "hold", *_JOINTS),
    ]
    if controller is None:
        wires += connect("hold", "plant", *_TORQUES)
    else:
        components.append(Component("controller", controller.fmu))
        read = [name for name in controller.inputs if not name.startswith("joint")]
        encoders = [name for name in controller.inputs if name.startswith("joint")]
        wires += [
            *connect("sensor", "controller", *read, ("aligned", "enabled")),
            *connect("plant", "controller", *encoders),
            *connect("hold", "controller", *[(torque, f"tracking.{torque}") for torque in _TORQUES]),
            *connect("controller", "plant", *_TORQUES),
        ]
    clocks = design.clocks
    values: dict[str, Value] = {
        f"plant.{name}": value for name, value in {"wind.speed": WIND_SPEED, **clocks.plant}.items()
    }
    values |= {f"sensor.{name}": value for name, value in {**design.sensor.parameters, **clocks.sensor}.items()}
    values |= {"hold.mode": "hold_joints", **{f"hold.{name}": value for name, value in clocks.hold.items()}}
    name = f"{controller.kind.lower() if controller else 'held'}_{label}"
    what = f"A camera on a gimbal in wind, {controller.kind if controller else 'its joints held'}, {label}"
    system = System(name, tuple(components), tuple(wires), (ParameterSet(name, values),), 0.0, stop, what)
    return system.with_values("settings", settings)


def _simulated(designs: list[Any], request: DesignRequest, bars: Progress) -> list[Run]:
    """The held head once, and every design; two at a time."""
    wanted = [(designs[0], None), *[(design, controller) for design in designs for controller in design.controllers]]
    settings: dict[str, Value] = dict(request.settings)
    runs = []
    folder = request.out / _RUNS
    folder.mkdir(exist_ok=True)
    jobs = []
    for design, controller in wanted:
        system = head_system(design, controller, settings, request.dist, _whole(request.stop, design.clocks.period))
        write_ssp(system, request.out / f"{system.name}.ssp")
        assert system.stop_time is not None
        record, results = ("plant.euler.*", "sensor.aligned"), folder / f"{system.name}.csv"
        jobs.append(Job(system.name, system, results, system.stop_time, design.clocks.period, record=record))
    for first in range(0, len(jobs), _TOGETHER):
        pair = jobs[first : first + _TOGETHER]
        shown = {job.name: bars.add_task(f"co-simulating {job.name}", total=job.stop_time) for job in pair}
        outcomes = run_jobs(pair, partial(_advance, bars, shown))
        for (design, controller), job in zip(wanted[first:], pair, strict=False):
            kind = "held" if controller is None else controller.kind
            runs.append(_run(design.sensor.label, kind, outcomes[job.name].results))
            bars.remove_task(shown[job.name])
    return runs


def _advance(bars: Progress, shown: Mapping[str, TaskID], name: str, time: float) -> None:
    bars.update(shown[name], completed=time)


def _whole(duration: float, period: float) -> float:
    """The duration in whole periods."""
    return float(np.floor(duration / period + 1e-6) * period)


def _run(label: str, kind: str, results: Results) -> Run:
    aligned = aligned_at(results, "sensor")
    since = (0.0 if aligned is None else aligned) + _SETTLING
    found = jitter(results, "plant", since)
    if aligned is None or found is None:
        raise SystemRefusedError(
            f"{kind} with {label}: no whole exposure after the sensor's alignment and {_SETTLING:g} s; choose a longer "
            "--stop"
        )
    return Run(label, kind, results, found, _standard_error(results, since, found), since)


def _standard_error(results: Results, since: float, found: Jitter) -> float:
    """std(squares)/(2 rms sqrt(n)) of an rms over n exposures, which count as independent of each other."""
    if found.exposures == 1:
        return float("nan")
    squares = []
    for number in range(found.exposures):
        begin = since + number * EXPOSURE
        # up to within the next one: the last record may lie at the exposure's end but for rounding
        near = (results["time"] > begin - 1e-6) & (results["time"] < begin + 1.5 * EXPOSURE)
        one = jitter(results[near], "plant", begin)
        assert one is not None
        squares.append(one.rms**2)
    return float(np.std(squares, ddof=1) / (2.0 * found.rms * np.sqrt(found.exposures)))


# --- showing --------------------------------------------------------------------------------------------------------


def _wind(request: DesignRequest) -> float:
    return float(request.settings.get("plant.wind.speed", WIND_SPEED))


def _write(request: DesignRequest, designs: list[Any], runs: list[Run]) -> None:
    from .design_plot import plot_loops, plot_overview

    write_rows(request.out / _TABLE, rows_of(designs, runs))
    plot_overview(request.out / _OVERVIEW, designs, runs, _wind(request))
    plot_loops(request.out / _LOOPS, designs[0])


def _tell(request: DesignRequest, designs: list[Any], runs: list[Run]) -> None:
    console = Console()
    show_rows(console, rows_of(designs, runs), _wind(request))
    files = [_TABLE, _OVERVIEW, _LOOPS, *[f"{one.fmu.name}" for design in designs for one in design.controllers]]
    line = f"In {request.out}: {', '.join(files)}, the systems as .ssp, and {_RUNS}"
    console.print(line, highlight=False, markup=False, soft_wrap=True)


@contextmanager
def _stages() -> Iterator[Progress]:
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bars:
        yield bars
