"""What a calibration found and what it gains, as tables and CSV files."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from ..models.attitude.rotations import STANDARD_GRAVITY
from ..models.scalar import PI
from .angle_figures import rms
from .calibration import Calibration
from .calibration_schedule import Case
from .monte_carlo import Figures
from .workspace import whole_or_not

Array = NDArray[np.float64]
Part = Literal["gyro", "accelerometer"]
PARTS: tuple[Part, ...] = ("gyro", "accelerometer")

FACTOR, LARGEST = 10.0, 0.05
"""What a calibration is for: the static error falls so many times, and nowhere exceeds so many degrees."""

_AXES = "xyz"
_SCALE_ERROR = "scale error"
_DEG = PI / 180.0
_MILLI_G = 1e-3 * STANDARD_GRAVITY


class _Unit(NamedTuple):
    """The SI unit of a coefficient, and the one that tables show, with its SI value."""

    si: str
    shown: str
    value: float


_SHARE, _DRIFT = _Unit("1", "%", 0.01), _Unit("1/K", "ppm/K", 1e-6)
_UNITS: dict[Part, dict[str, _Unit]] = {
    "gyro": {
        "sensitivity": _SHARE,
        "scale_temperature_slope": _DRIFT,
        "cubic": _Unit("s2/rad2", "% at 100 deg/s", 0.01 * (100.0 * _DEG) ** -2),
        "bias": _Unit("rad/s", "deg/s", _DEG),
        "bias_temperature_slope": _Unit("rad/(s.K)", "mdeg/s/K", 1e-3 * _DEG),
        "bias_temperature_curve": _Unit("rad/(s.K2)", "mdeg/s/K2", 1e-3 * _DEG),
        "g_sensitivity": _Unit("rad.s/m", "deg/s/g", _DEG / STANDARD_GRAVITY),
    },
    "accelerometer": {
        "sensitivity": _SHARE,
        "scale_temperature_slope": _DRIFT,
        "cubic": _Unit("s4/m2", "% at 1 g", 0.01 * STANDARD_GRAVITY**-2),
        "bias": _Unit("m/s2", "mg", _MILLI_G),
        "bias_temperature_slope": _Unit("m/(s2.K)", "ug/K", 1e-3 * _MILLI_G),
        "bias_temperature_curve": _Unit("m/(s2.K2)", "ug/K2", 1e-3 * _MILLI_G),
    },
}
"""By part and field of its `ErrorModel`."""

_WORDS = {
    "scale_temperature_slope": "scale drift",
    "cubic": "cubic",
    "bias": "bias at 25 degC",
    "bias_temperature_slope": "bias drift",
    "bias_temperature_curve": "bias curve",
}


class Coefficient(NamedTuple):
    """One coefficient of one part in SI units: `name` as the table shows it, `key` as a program looks for it."""

    part: Part
    key: str
    name: str
    true: float
    fitted: float
    error: float
    unit: _Unit

    @property
    def deviation(self) -> float:
        """What the fit misses of the truth, in standard errors."""
        return (self.fitted - self.true) / self.error if self.error > 0.0 else 0.0


def coefficients(part: Part, found: Calibration) -> list[Coefficient]:
    """Every coefficient of a part, axis by axis."""
    fit, true = found.part(part)
    rows = []
    for field, unit in _UNITS[part].items():
        values, errors, truths = (getattr(model, field) for model in (fit.coefficients, fit.standard_errors, true))
        for place in np.ndindex(values.shape):
            rows.append(
                Coefficient(
                    part,
                    f"{field}[{','.join(str(i + 1) for i in place)}]",
                    _named(field, place),
                    float(truths[place]),
                    float(values[place]),
                    float(errors[place]),
                    unit,
                )
            )
    return rows


def _named(field: str, place: tuple[int, ...]) -> str:
    axis = _AXES[place[0]]
    if field == "sensitivity":
        return f"{axis} {_SCALE_ERROR}" if place[0] == place[1] else f"{axis} from {_AXES[place[1]]}"
    if field == "g_sensitivity":
        return f"{axis} by force along {_AXES[place[1]]}"
    return f"{axis} {_WORDS[field]}"


def coefficient_table(part: Part, found: Calibration) -> Table:
    """True and fitted value of each coefficient of a part, with its standard error."""
    fit, _ = found.part(part)
    unit = _UNITS[part]["bias"]
    noise, scatter = rms(fit.noise) / unit.value, rms(fit.scatter) / unit.value
    table = Table(
        title=f"{part}: condition {np.max(fit.condition):.1f}\n"
        f"left of a mean over 1 s: {noise:.2g} {unit.shown}; of the bias of a power-up: {scatter:.2g} {unit.shown}",
        title_justify="left",
        title_style="bold",
    )
    for heading in ("", "true", "fitted", "± sigma", "unit", "off, sigma"):
        table.add_column(heading, justify="left" if heading in ("", "unit") else "right")
    last = ""
    for one in coefficients(part, found):
        field = one.key.partition("[")[0]
        if last not in ("", field):
            table.add_section()
        last = field
        # a scale error is what the sensitivity differs from 1 by
        whole = 1.0 if one.name.endswith(_SCALE_ERROR) else 0.0
        numbers = [x / one.unit.value for x in (one.true - whole, one.fitted - whole, one.error)]
        table.add_row(one.name, *[f"{x:.4g}" for x in numbers], one.unit.shown, f"{one.deviation:.1f}")
    return table


def write_coefficients(path: Path, found: Calibration) -> Path:
    """Write every coefficient in SI units as a CSV file.

    Raises `ResultsError` if the file cannot be written.
    """
    with whole_or_not(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(("part", "coefficient", "what", "unit", "true", "fitted", "standard error"))
        for part in PARTS:
            for one in coefficients(part, found):
                writer.writerow((one.part, one.key, one.name, one.unit.si, one.true, one.fitted, one.error))
    return path


# --- residuals --------------------------------------------------------------------------------------------------------


class Residual(NamedTuple):
    """Errors of a verification over m temperatures (degC) of n rests: true pitch and roll (m, n, 2, deg), the errors
    that levelling has of them (m, n, 2, deg), and the errors of the rates (m, n, 3, deg/s)."""

    temperature: Array
    angles: Array
    tilt_errors: Array
    rate_errors: Array


def residual_of(celsius: Sequence[float], figures: Sequence[Figures]) -> Residual:
    """The errors of one case, from its runs in the order of their temperatures."""
    names = Residual._fields[1:]
    return Residual(np.array(celsius), *[np.array([one[name] for one in figures]) for name in names])


class _Quantity(NamedTuple):
    name: str
    unit: str
    field: str


_QUANTITIES = (
    _Quantity("static error", "deg", "tilt_errors"),
    _Quantity("gyro bias", "deg/s", "rate_errors"),
)


def residual_table(residuals: Mapping[Case, Residual], title: str) -> Table:
    """rms and largest errors before and after, and what of them repeats."""
    table = Table(title=title, title_justify="left", title_style="bold")
    table.add_column("")
    for heading in ("before", "after", "falls", "of which repeats", ""):
        table.add_column(heading, justify="left" if heading == "" else "right")
    for quantity in _QUANTITIES:
        for what, figure in (("rms", rms), ("largest", _largest)):
            before, after, repeats = (figure(getattr(residuals[case], quantity.field)) for case in residuals)
            row = (f"{before:.4f}", f"{after:.4f}", f"{_times(before / after)} x", f"{repeats:.4f}", quantity.unit)
            table.add_row(f"{quantity.name}, {what}", *row)
    return table


def _times(factor: float) -> str:
    return f"{factor:.0f}" if factor > 99.5 else f"{factor:.2g}"


def _largest(errors: Array) -> float:
    return float(np.max(np.abs(errors)))


def verdict(residuals: Mapping[Case, Residual]) -> str:
    """In a sentence: how far the static error fell, and whether that is what a calibration is for."""
    before, after = (residuals[case].tilt_errors for case in ("before", "after"))
    factor, largest = rms(before) / rms(after), _largest(after)
    reached = "reaches" if factor >= FACTOR and largest < LARGEST else "misses"
    celsius = residuals["after"].temperature
    return (
        f"static error over ±40 deg and {celsius[0]:g} to {celsius[-1]:g} degC: {_times(factor)} times smaller, "
        f"{rms(after):.4f} deg rms, {largest:.4f} deg at most "
        f"({reached} the goal of {FACTOR:g} times and {LARGEST:g} deg)"
    )


def write_residuals(path: Path, residuals: Mapping[Case, Residual]) -> Path:
    """Write the errors of every rest as a CSV file: angles in deg, rates in deg/s.

    Raises `ResultsError` if the file cannot be written.
    """
    with whole_or_not(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        axes = [f"rate error {axis} (deg/s)" for axis in _AXES]
        names = ("pitch (deg)", "roll (deg)", "pitch error (deg)", "roll error (deg)")
        writer.writerow(("case", "temperature (degC)", *names, *axes))
        for case, one in residuals.items():
            for celsius, *rests in zip(*one, strict=True):
                for angles, tilts, rates in zip(*rests, strict=True):
                    writer.writerow((case, f"{celsius:g}", *[f"{x:.6f}" for x in (*angles, *tilts, *rates)]))
    return path
