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
from attitude_fmu.models.sensors.devices import DEVICES, device_called, origins

from .bench import benches, settable
from .characteristics import PARTS, Part, Sensor
from .devices import device_parameters
from .errors import ResultsError, SystemRefusedError, did_you_mean
from .interface import Interface, Value, read_interface
from .sensor_findings import FULL, QUICK, Findings, Stage, findings
from .sensor_report import Line, lines, summary, table, write_table

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
    _known(device)
    return dict(device_parameters(device, specimen, component="").values)


def sources_of(device: str) -> dict[str, Origin]:
    """Where each of these values comes from.

    Raises `SystemRefusedError` for a device that is not known.
    """
    _known(device)
    return origins(device)


def _known(device: str) -> None:
    if device not in DEVICES:
        hint = did_you_mean(device.upper(), DEVICES) or did_you_mean(device, DEVICES)
        raise SystemRefusedError(f"there is no device called {device!r}{hint} (devices: {', '.join(DEVICES)})")


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
            if sensor.number("ideal") > 0.5:
                raise SystemRefusedError("ideal = true: a sensor without errors, filters and clocks cannot be measured")
            found = findings(sensor, QUICK if request.quick else FULL, stage)
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
    return {name: settable(interface, name).value(value) for name, value in settings.items()}


def _written(
    request: SensorRequest, sensor: Sensor, found: Mapping[Part, Findings], told: tuple[Line, ...], folder: Path
) -> list[Path]:
    from .sensor_plot import Sheet, plot_sensor  # matplotlib takes its time

    files = [write_table(folder / _TABLE, told)]
    for part in PARTS:
        sheet = Sheet(_part_name(request.device, part), _heading(request), sources_of(request.device), summary(told))
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
    console.print(table(told, _heading(request)))
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
