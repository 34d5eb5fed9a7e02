"""The command ``attitude-fmu``."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Literal, NoReturn

import typer
from rich.console import Console

from attitude_fmu.fmu_src.build import Platforms
from attitude_fmu.fmu_src.build_messages import Kinds, build_and_tell
from attitude_fmu.fmu_src.catalogue import Kind
from attitude_fmu.models.errors import AttitudeFmuError
from attitude_fmu.models.sensors.devices import DEVICES

# FMPy, numpy and the rest are imported where they are used: --help answers at once

Order = Literal["jacobi", "gauss-seidel"]

application = typer.Typer(
    add_completion=False,
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    help="A MEMS attitude sensor and a camera gimbal on a tripod, as FMI 2.0 co-simulation FMUs, coupled and run.",
    epilog="[bold]attitude-fmu run[/bold] is the place to start. Each command has a --help of its own.",
)


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

_DIST_HELP = "Folder of the FMUs that scenarios use and build."
_FMU_HELP = "Kind of the FMUs that a scenario uses: compiled from C, or the same models run by Python."


@application.command("run", help=RUN_HELP, no_args_is_help=False)
def run_command(
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
    ] = "gauss-seidel",
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
    fmu: Annotated[Kind | None, typer.Option(help=_FMU_HELP, show_default="native")] = None,
    dist: Annotated[Path | None, typer.Option(metavar="FOLDER", help=_DIST_HELP, show_default="dist")] = None,
) -> None:
    """Couple FMUs, run them, and show what came out."""
    with _reported():
        from .run import Request, run

        request = Request(
            system,
            out,
            stop,
            step,
            _settings(values or []),
            tuple(parameters or ()),
            master,
            tuple(record or ()),
            interval,
            *_of_scenario(system, dist, fmu),
        )
        run(request)


_DEVICES = ", ".join(DEVICES)
_SPECIMEN_HELP = "One piece of the device, drawn from the datasheet's tolerances; 0 is without errors."


@application.command()
def build(
    names: Annotated[list[str] | None, typer.Argument(metavar="NAME", help="Which FMUs; all by default.")] = None,
    kind: Annotated[
        Kinds, typer.Option(help="Compiled from C, or run by Python; those go to the folder python.")
    ] = "native",
    platform: Annotated[
        Platforms, typer.Option(help="What native FMUs are compiled for: this machine alone, or every platform.")
    ] = "host",
    dist: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder to build into.")] = Path("dist"),
    device: Annotated[
        str | None,
        typer.Option(
            metavar="DEVICE",
            help="Build the attitude sensor with the numbers of this device as start values, as AttitudeSensor_DEVICE. "
            f"Devices: {_DEVICES}.",
        ),
    ] = None,
    specimen: Annotated[int, typer.Option(metavar="N", min=0, help=_SPECIMEN_HELP)] = 0,
) -> None:
    """Build the project's FMUs where they are missing or older than their sources.

    Examples: attitude-fmu build AttitudeSensor --platform all --dist fmus

    attitude-fmu build --device ADIS16354_150 --specimen 3
    """
    with _reported():
        if specimen and device is None:
            _refuse_usage(f"--specimen {specimen}: of which device? Name one with --device")
        wanted = [*(names or []), *([] if device is None else [_sensor_with(device, specimen)])]
        build_and_tell(dist, wanted or None, Console(), kinds=kind, platforms=platform)


def _sensor_with(device: str, specimen: int) -> str:
    """Name of the attitude sensor's FMU with the start values of a device."""
    from .devices import device_parameters

    device_parameters(device, specimen)  # an unknown one is refused with those that there are
    return f"AttitudeSensor_{device}" + (f"_specimen_{specimen}" if specimen else "")


@application.command()
def device(
    name: Annotated[str, typer.Argument(metavar="DEVICE", help=f"One of {_DEVICES}.")],
    out: Annotated[Path | None, typer.Option(metavar="FILE", help="File to write.", show_default="DEVICE.ssv")] = None,
    specimen: Annotated[int, typer.Option(metavar="N", min=0, help=_SPECIMEN_HELP)] = 0,
    component: Annotated[
        str, typer.Option(metavar="NAME", help="Component that the parameters are for; empty: names of the FMU alone.")
    ] = "sensor",
) -> None:
    """Write the parameters of a device as an .ssv file, for run --parameters and for any tool that reads SSP.

    Example: attitude-fmu device ADXRS453_ADXL355 --specimen 7 --out piece_7.ssv
    """
    with _reported():
        from .devices import write_device

        typer.echo(write_device(out or Path(f"{name}.ssv"), name, specimen, component))


@application.command()
def info(
    what: Annotated[str, typer.Argument(metavar="SYSTEM", help="An .fmu or .ssp file, or a scenario.")],
    fmu: Annotated[Kind | None, typer.Option(help=_FMU_HELP, show_default="native")] = None,
    dist: Annotated[Path | None, typer.Option(metavar="FOLDER", help=_DIST_HELP, show_default="dist")] = None,
    pattern: Annotated[
        str, typer.Option(metavar="TEXT", help="Show only what has this in its name; * stands for anything.")
    ] = "",
    everything: Annotated[
        bool, typer.Option("--all", help="Also inputs that are connected, calculated parameters and local variables.")
    ] = False,
) -> None:
    """List what can be set and recorded in an FMU or a coupled system: start values, ranges and what they mean.

    Example: attitude-fmu info gimbal --pattern wind
    """
    with _reported():
        from .info import show_info

        show_info(what, *_of_scenario(what, dist, fmu), pattern, everything)


SENSOR_HELP = """Measure a modelled sensor and compare it with its datasheet.

Everything is measured on the native FMU itself: Allan deviation, \
noise spectrum, frequency response at every setting of the filters, step response, calibration, temperature drift and \
register codes.

Written into the output folder: \
gyro.png and accelerometer.png (the pictures), \
characteristics.csv (the table that is shown: datasheet, modelled part, verdict, rule, source). \
A FAIL is a finding: the exit code is 0 whenever all has been measured.

[bold]Examples[/bold]

  attitude-fmu sensor ADXRS450_ADXL355

  attitude-fmu sensor ADIS16354_300 --quick --out adis

  attitude-fmu sensor ADXRS450_ADXL355 --specimen 7

  attitude-fmu sensor ADXRS450_ADXL355 --set accelerometer.output_data_rate=125_Hz --set seed=3

[bold]attitude-fmu info static[/bold] lists the sensor's parameters; --set takes them without the component's name.
"""


@application.command("sensor", help=SENSOR_HELP)
def sensor_command(
    device: Annotated[str, typer.Argument(help=f"The parts to measure: {_DEVICES}.", metavar="DEVICE")],
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for pictures and table; made if missing.")] = Path(
        "out"
    ),
    quick: Annotated[
        bool, typer.Option("--quick", help="Short records and the chosen filter settings only: a few seconds.")
    ] = False,
    specimen: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            help="Which piece of all that the tolerances allow; 0: the nominal one, without errors to measure.",
        ),
    ] = 1,
    values: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the sensor, in SI units. Repeatable."),
    ] = None,
    dist: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder of the FMU, which is built where missing or stale.")
    ] = Path("dist"),
) -> None:
    """Measure a modelled sensor and compare it with its datasheet."""
    with _reported():
        from .sensor import SensorRequest, show_sensor

        settings = _settings(values or [], "write it as parameter=value, for instance seed=7", dotted=False)
        show_sensor(SensorRequest(device, out, quick, specimen, settings, dist))


REPRODUCE_HELP = """Run the experiments of the two papers again, and lay what they print beside what comes out.

PAPER is [bold]paper-a[/bold] (Jing & Gao 2021: three ADXRS450 and an ADXL355 on a turntable), [bold]paper-b[/bold] \
(2010: an ADIS16354) or [bold]all[/bold]. Each experiment is the sensor on the turntable, run over many seeds: the \
paper's own way, and ours. A printed number is inside when 5 to 95 % of the seeds enclose it.

Written into the output folder: a picture for each experiment, paper-a.csv and paper-b.csv (the tables that are \
shown), and trials (the figures of every run, from which an interrupted command goes on).

[bold]Examples[/bold]

  attitude-fmu reproduce

  attitude-fmu reproduce paper-a --out papers
"""

Paper = Literal["paper-a", "paper-b", "all"]


@application.command("reproduce", help=REPRODUCE_HELP, no_args_is_help=False)
def reproduce_command(
    paper: Annotated[Paper, typer.Argument(help="Whose experiments.", metavar="PAPER")] = "all",
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder for tables and pictures; made if missing.")
    ] = Path("out"),
    dist: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder of the FMUs, which are built where missing or stale.")
    ] = Path("dist"),
) -> None:
    """Run the experiments of the two papers again."""
    with _reported():
        from .reproduce import reproduce

        reproduce(paper, out, dist)


CALIBRATE_HELP = """Calibrate one piece of a device on the turntable, and show what that gains.

At eight temperatures from -5 to 65 degC, switched on twice at each, the table turns 26 directions of the sensor up \
and spins it about its axes. Scale, misalignment, g-sensitivity and bias are fitted to the readings, scale and bias \
with their change with temperature. Then the piece is verified, before and after, at other angles and temperatures.

Written into the output folder: \
calibration.ssv (the values for the sensor's processor), \
calibration.csv (every coefficient: true, fitted, standard error), \
residuals.csv and calibration.png (the errors before and after), \
and trials (every run, from which an interrupted command goes on).

[bold]Examples[/bold]

  attitude-fmu calibrate --specimen 7 --out piece_7

  attitude-fmu calibrate --device ADIS16354_150 --quick

  attitude-fmu calibrate --set accelerometer.turn_on_bias=0.005
"""


@application.command("calibrate", help=CALIBRATE_HELP, no_args_is_help=False)
def calibrate_command(
    device: Annotated[
        str, typer.Option(metavar="DEVICE", help="The device, for instance ADXRS453_ADXL355.")
    ] = "ADXRS450_ADXL355",
    specimen: Annotated[int, typer.Option(metavar="N", min=0, help=_SPECIMEN_HELP)] = 1,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder for what is written; made if missing.")] = Path(
        "out"
    ),
    quick: Annotated[bool, typer.Option("--quick", help="Half the temperatures, switched on once at each.")] = False,
    values: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the sensor, in SI units. Repeatable."),
    ] = None,
    dist: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder of the FMUs, which are built where missing or stale.")
    ] = Path("dist"),
) -> None:
    """Calibrate one piece of a device on the turntable."""
    with _reported():
        from .calibrate import CalibrationRequest, calibrate

        settings = _settings(values or [], "write it as parameter=value, for instance seed=7", dotted=False)
        calibrate(CalibrationRequest(device, specimen, out, dist, quick, settings))


DESIGN_HELP = """Design the stabilisation of the camera's line of sight, and prove it.

Linearises the head in its wind and the sensor, shapes a PID and an LQG on the true loop with its noise and delay, \
exports both as FMUs, co-simulates them, and lays the predicted jitter of the line of sight beside the co-simulated one.

Written into the output folder: \
design_overview.png and design_loops.png (the pictures), \
design.csv (the table that is shown), \
the controllers as .fmu, the coupled systems as .ssp, \
and runs (each co-simulation's line of sight).

[bold]Examples[/bold]

  attitude-fmu design

  attitude-fmu design --quick --out quick

  attitude-fmu design --sensor ADXRS453_ADXL355 --sensor ideal --set plant.wind.speed=6
"""


@application.command("design", help=DESIGN_HELP)
def design_command(
    sensors: Annotated[
        list[str] | None,
        typer.Option(
            "--sensor", metavar="DEVICE", help="A device, or ideal. Repeatable; by default the two papers' and ideal."
        ),
    ] = None,
    out: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder for all that is written; made if missing.")
    ] = Path("out"),
    quick: Annotated[
        bool, typer.Option("--quick", help="The first sensor only if none is named, 30 s of co-simulation.")
    ] = False,
    stop: Annotated[
        float | None, typer.Option(metavar="S", help="Duration of the co-simulations in s; 120, or 30 with --quick.")
    ] = None,
    values: Annotated[
        list[str] | None,
        typer.Option(
            "--set", metavar="NAME=VALUE", help="A number: a parameter of plant or sensor, in SI units. Repeatable."
        ),
    ] = None,
    dist: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder of the FMUs, which are built where missing or stale.")
    ] = Path("dist"),
) -> None:
    """Design the stabilisation of the camera's line of sight, and prove it."""
    with _reported():
        from .design import SENSORS, DesignRequest, show_design

        chosen = tuple(dict.fromkeys(sensors or (SENSORS[:1] if quick else SENSORS)))
        if stop is None:
            stop = 30.0 if quick else 120.0
        show_design(DesignRequest(chosen, out, stop, _settings(values or []), dist))


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


def _of_scenario(what: str, dist: Path | None, fmu: Kind | None) -> tuple[Path, Kind]:
    """The options that only a scenario takes."""
    for option, value in (("--fmu", fmu), ("--dist", dist)):
        if value is not None and what.lower().endswith((".ssp", ".fmu")):
            _refuse_usage(f"{option} {value}: {what} is taken as it is; the option is for scenarios")
    return dist or Path("dist"), fmu or "native"


_SETTING = "write it as component.variable=value, for instance sensor.seed=7"


def _settings(texts: list[str], how: str = _SETTING, *, dotted: bool = True) -> dict[str, str]:
    settings: dict[str, str] = {}
    for text in texts:
        name, equals, value = text.partition("=")
        if not equals or (dotted and "." not in name):
            _refuse_usage(f"--set {text}: {how}")
        settings[name.strip()] = value.strip()
    return settings


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
    console = Console(stderr=True, soft_wrap=True)
    console.print(f"attitude-fmu: {message}", style="bold red", highlight=False, markup=False)


if __name__ == "__main__":
    main()
