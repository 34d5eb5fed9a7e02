"""The command ``attitude-fmu sensor``: a device measured on its FMU, as table and pictures."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from attitude_fmu.fmu_src.build import build_all
from attitude_fmu.models.sensors.datasheet import Origin
from attitude_fmu.models.sensors.devices import device_called, origins

from .bench import benches, settable
from .characteristics import PARTS, Part, Sensor
from .devices import device_parameters, known_device
from .errors import ResultsError, SystemRefusedError
from .interface import Interface, Value, read_interface
from .sensor_findings import FULL, QUICK, Findings, Stage, findings
from .sensor_report import Line, lines, summary, table, write_table
from .sheet_claims import sheet_claims

_IDENTIFIER = "AttitudeSensor"
_TABLE = "characteristics.csv"


class SensorRequest(NamedTuple):
    """Which device to measure, how, and where to put it.

    `specimen` is the piece of it (0: the nominal one), `settings` parameters by name, which win; the FMU lies in
    `dist`, and is built when it is missing or older than its sources.
    """

    device: str
    out: Path
    quick: bool
    specimen: int
    settings: Mapping[str, Value]
    dist: Path


def values_of(device: str, specimen: int = 0) -> dict[str, Value]:
    """Parameter values of a piece of a device, by structured name.

    Raises `SystemRefusedError` for a device that is not known.
    """
    return dict(device_parameters(device, specimen, component="").values)


def sources_of(device: str) -> dict[str, Origin]:
    """Where each of these values comes from.

    Raises `SystemRefusedError` for a device that is not known.
    """
    known_device(device)
    return origins(device)


def show_sensor(request: SensorRequest) -> None:
    """Measure a device; write table and pictures, and print the table.

    Raises `SystemRefusedError`, `RunStoppedError`, `ResultsError`, or `BuildError` from building the FMU.
    """
    values, sources = values_of(request.device, request.specimen), sources_of(request.device)
    drafts = _drafts(request.out)
    with drafts as name:
        fmu = _built(request.dist)
        interface = read_interface(fmu)
        chosen = {**values, **_settings(interface, request.settings)}
        with _stages() as (stage, progress), benches(fmu, interface, progress) as made:
            sensor = Sensor(made, chosen)
            _refuse_experiments(sensor)
            found = findings(sensor, sheet_claims(request.device), QUICK if request.quick else FULL, stage)
            told = lines(found, sources)
            stage("drawing", 0.0)
            files = _written(request, sensor, found, told, Path(name))
        for path in files:
            path.replace(request.out / path.name)
    _tell(request, told, [path.name for path in files])


def _built(dist: Path) -> Path:
    console = Console(stderr=True)

    def tell(name: str, event: str) -> None:
        if event != "up to date":
            console.print(f"{event} {dist / name}.fmu", style="dim", highlight=False, markup=False, soft_wrap=True)

    return build_all(dist, [_IDENTIFIER], tell)[0]


def _drafts(out: Path) -> tempfile.TemporaryDirectory[str]:
    """A folder in `out` for what is not finished: an interrupted run leaves nothing."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        return tempfile.TemporaryDirectory(prefix=".sensor_", dir=out)
    except OSError as error:
        raise ResultsError(f"cannot write into {out}: {error.strerror or error}") from error


def _settings(interface: Interface, settings: Mapping[str, Value]) -> dict[str, Value]:
    """The settings as values of their variables' types. Raises `SystemRefusedError` for what cannot be set."""
    found = {}
    for name, value in settings.items():
        variable = settable(interface, name)
        if variable.causality == "input":
            raise SystemRefusedError(f"{name} is an input: the bench drives it, only parameters can be set here")
        found[name] = variable.value(value)
    return found


_LEFT_ALONE: tuple[tuple[str, float, str], ...] = (
    ("ideal", 0.0, "a sensor without errors, filters and clocks cannot be measured"),
    ("heater.enabled", 0.0, "the temperatures would be the thermostat's, not the bench's"),
    ("gyro.self_test", 0.0, "the self-test would be taken for an offset"),
    ("accelerometer.self_test", 0.0, "the self-test would be taken for an offset"),
    ("gyro.autonull", 1.0, "the part would take its own errors away"),
    ("accelerometer.high_pass", 1.0, "offset, step and delay of what lets nothing steady pass are not the sheet's"),
    ("fault[1].kind", 1.0, "a part with a fault is not what the sheet describes"),
    ("fault[2].kind", 1.0, "a part with a fault is not what the sheet describes"),
)
"""Parameters that must stand at this number in a measurement, and why."""


def _refuse_experiments(sensor: Sensor) -> None:
    """Raise `SystemRefusedError` for settings under which a part is not what its sheet describes."""
    for name, wanted, why in _LEFT_ALONE:
        value = sensor.number(name)
        if value != wanted:
            variable = sensor.benches.interface.variables[name]
            shown = sensor.item(name) if variable.items else str(value > 0.5).lower()
            raise SystemRefusedError(f"{name} = {shown}: {why}; leave it as it is to measure the sensor")


def _written(
    request: SensorRequest, sensor: Sensor, found: Mapping[Part, Findings], told: tuple[Line, ...], folder: Path
) -> list[Path]:
    from .sensor_plot import Sheet, plot_sensor  # matplotlib takes its time

    files = [write_table(folder / _TABLE, told)]
    for part in PARTS:
        counted = summary(told, part)
        sheet = Sheet(_part_name(request.device, part), _heading(request), sources_of(request.device), counted)
        files.append(plot_sensor(folder / f"{part}.png", sensor, found[part], sheet))
    return files


def _part_name(device: str, part: Part) -> str:
    found = device_called(device)
    return found.gyro.name if part == "gyro" else found.accelerometer.name


def _heading(request: SensorRequest) -> str:
    piece = "nominal piece" if request.specimen == 0 else f"specimen {request.specimen}"
    changes = ", ".join(f"{name}={value}" for name, value in request.settings.items())
    return f"{request.device}, {piece}{f'; set: {changes}' if changes else ''}"


def _tell(request: SensorRequest, told: tuple[Line, ...], names: list[str]) -> None:
    console = Console()
    console.print(table(told, _heading(request), console.width))
    console.print(f"{summary(told)}.", highlight=False)
    console.print(f"In {request.out}: {', '.join(names)}", highlight=False, markup=False, soft_wrap=True)


@contextmanager
def _stages() -> Iterator[tuple[Stage, Callable[[float], None]]]:
    """Shows which stage is under way, and how far it is where that is known."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bars:
        current = bars.add_task("starting", total=None)

        def stage(description: str, seconds: float) -> None:
            nonlocal current
            bars.remove_task(current)
            current = bars.add_task(description, total=seconds if seconds > 0.0 else None)

        def progress(seconds: float) -> None:
            bars.update(current, advance=seconds)

        yield stage, progress
