"""The command ``attitude-fmu calibrate``: one piece of a device calibrated on the turntable, and what that gains."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console

from attitude_fmu.fmu_src.build_messages import build_and_tell

from ..models.attitude_sensor import MODEL, Parameters
from ..models.record import defaults, with_defaults
from .bench import settable
from .calibration import Calibration, calibrated, compensation
from .calibration_report import (
    Residual,
    coefficient_table,
    residual_of,
    residual_table,
    verdict,
    write_coefficients,
    write_residuals,
)
from .calibration_schedule import (
    CASES,
    FMUS,
    FULL,
    QUICK,
    TABLE_ERROR,
    Case,
    Piece,
    calibration_trials,
    readings_of,
    verification_trials,
)
from .devices import device_parameters, sensor_parameters, write_sensor_parameters
from .errors import RunStoppedError
from .interface import Value, read_interface
from .monte_carlo import Figures, Trial, run_trials
from .progress import shown_progress

_TRIALS = "trials"
_VALUES, _COEFFICIENTS, _RESIDUALS, _PICTURE = "calibration.ssv", "calibration.csv", "residuals.csv", "calibration.png"


class CalibrationRequest(NamedTuple):
    """Which piece to calibrate, and where to put what comes out.

    `settings` are parameters of the sensor by name, which win over the device's; the FMUs lie in `dist`, and are built
    when they are missing or older than their sources. `quick` takes half the temperatures, once each.
    """

    device: str
    specimen: int
    out: Path
    dist: Path
    quick: bool = False
    settings: Mapping[str, Value] = {}


class Outcome(NamedTuple):
    """What a calibration found, and the errors of each case of its verification."""

    calibration: Calibration
    residuals: Mapping[Case, Residual]


def calibrate(request: CalibrationRequest) -> Outcome:
    """Calibrate a piece, verify, write what was found into `out`, and tell it.

    Runs lie in ``out/trials`` as soon as they are done, so that an interrupted command goes on where it stopped.
    Raises `UnknownDeviceError`, `SystemRefusedError` for settings that there are not, `BuildError`, `RunStoppedError`,
    or `ResultsError`.
    """
    device_parameters(request.device, request.specimen)  # an unknown one is refused before anything is built
    build_and_tell(request.dist, list(FMUS), Console(stderr=True), only_built=True)
    piece, schedule = _piece(request), QUICK if request.quick else FULL
    p: Parameters = defaults(with_defaults(Parameters, piece.parameters("")))
    first = calibration_trials(request.dist, piece, schedule)
    later = len(CASES) * len(schedule.verified)
    with shown_progress("runs on the table", len(first) + later) as told:
        found = _figures(first, request.out, told)
        gyro, accelerometer = readings_of([found[trial.name] for trial in first], p)
        calibration = calibrated(gyro, accelerometer, p, MODEL.coefficients(p), TABLE_ERROR)
        values = compensation(calibration.gyro.coefficients, calibration.accelerometer.coefficients)
        cases = verification_trials(request.dist, piece, schedule, values)
        runs = [trial for trials in cases.values() for trial in trials]
        verified = _figures(runs, request.out, lambda done: told(len(first) + done))
    residuals = {
        case: residual_of(schedule.verified, [verified[trial.name] for trial in trials])
        for case, trials in cases.items()
    }
    outcome = Outcome(calibration, residuals)
    _write(request, outcome, values)
    _tell(request, outcome)
    return outcome


def _piece(request: CalibrationRequest) -> Piece:
    interface = read_interface(request.dist / f"{FMUS[1]}.fmu")
    settings = {name: settable(interface, name).value(value) for name, value in request.settings.items()}
    return Piece(request.device, request.specimen, settings)


def _figures(trials: Sequence[Trial], out: Path, told: Callable[[int], None]) -> dict[str, Figures]:
    try:
        return run_trials(trials, out / _TRIALS, told)
    except RunStoppedError as error:
        if not error.interrupted:
            raise
        message = f"stopped by the user; the same command goes on from the runs in {out / _TRIALS}"
        raise RunStoppedError(message, error.time, interrupted=True) from None


# --- showing ----------------------------------------------------------------------------------------------------------


def _heading(request: CalibrationRequest) -> str:
    piece = "nominal piece" if request.specimen == 0 else f"specimen {request.specimen}"
    changes = ", ".join(f"{name}={value}" for name, value in request.settings.items())
    return f"{request.device}, {piece}{f'; set: {changes}' if changes else ''}"


def _write(request: CalibrationRequest, outcome: Outcome, values: Mapping[str, Value]) -> None:
    from .calibration_plot import plot_calibration  # matplotlib takes its time

    out = request.out
    name = f"{request.device}_specimen_{request.specimen}_calibration"
    write_sensor_parameters(out / _VALUES, sensor_parameters(name, values))
    write_coefficients(out / _COEFFICIENTS, outcome.calibration)
    write_residuals(out / _RESIDUALS, outcome.residuals)
    plot_calibration(out / _PICTURE, _heading(request), outcome.residuals, verdict(outcome.residuals))


def _tell(request: CalibrationRequest, outcome: Outcome) -> None:
    console = Console()
    for part in ("gyro", "accelerometer"):
        console.print(coefficient_table(part, outcome.calibration))
    console.print(residual_table(outcome.residuals, _heading(request)))
    console.print(f"{verdict(outcome.residuals)}.", highlight=False)
    names = ", ".join((_VALUES, _COEFFICIENTS, _RESIDUALS, _PICTURE))
    console.print(f"In {request.out}: {names}", highlight=False, markup=False, soft_wrap=True)
