"""The picture of a calibration: errors before and after it, over temperature and angle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .angle_figures import INK, KALMAN, OURS, RC, SLOW, note, rms
from .calibration_report import LARGEST, Residual
from .calibration_schedule import Case
from .plot import STYLE
from .workspace import whole_or_not

# matplotlib is imported where a picture is made
if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

_SIDES: tuple[tuple[Case, str], ...] = (("before", "Before"), ("after", "After"))
_LINE = 120
"""Characters that the picture is wide."""

_TILTS = (("pitch", RC), ("roll", OURS))
_GYROS = (("x", RC), ("y", KALMAN), ("z", SLOW))


def plot_calibration(path: Path, title: str, residuals: Mapping[Case, Residual], verdict: str) -> Path:
    """Draw the errors before and after into a PNG file.

    Raises `ResultsError` if the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE), whole_or_not(path) as draft:
        figure = Figure(figsize=(10.0, 9.0), layout="constrained")
        figure.suptitle(fill(title, _LINE) + "\n" + fill(verdict, _LINE), ha="left", x=0.01, fontsize=9.5)
        panels = figure.subplots(3, 2)
        for column, (case, label) in enumerate(_SIDES):
            one = residuals[case]
            _over_temperature(panels[0, column], f"{label}: error of pitch and roll (deg)", one)
            _over_angle(panels[1, column], f"{label}: error of pitch and roll (deg)", one)
            _gyros(panels[2, column], f"{label}: error of the gyros' bias (deg/s)", one)
        for panel in panels[:2, 1]:
            for bound in (-LARGEST, LARGEST):
                panel.axhline(bound, color=INK, lw=0.6, ls="--")
        figure.savefig(draft, dpi=150)
    return path


def _over_temperature(axes: Axes, title: str, one: Residual) -> None:
    axes.set_title(title)
    for number, (angle, colour) in enumerate(_TILTS):
        shift = 1.6 * (number - 0.5)
        _points(axes, one.temperature[:, None] + shift, one.tilt_errors[..., number], angle, colour)
    axes.set_xlabel("chamber (degC)")
    note(axes, _figures(one.tilt_errors))
    axes.legend(loc="best", ncols=2)


def _over_angle(axes: Axes, title: str, one: Residual) -> None:
    axes.set_title(title)
    for number, (angle, colour) in enumerate(_TILTS):
        shift = 1.6 * (number - 0.5)
        _points(axes, one.angles[..., number] + shift, one.tilt_errors[..., number], angle, colour)
    axes.set_xlabel("the same angle, true (deg)")


def _gyros(axes: Axes, title: str, one: Residual) -> None:
    axes.set_title(title)
    for number, (gyro, colour) in enumerate(_GYROS):
        shift = 1.6 * (number - 1.0)
        _points(axes, one.temperature[:, None] + shift, one.rate_errors[..., number], gyro, colour)
    axes.set_xlabel("chamber (degC)")
    note(axes, _figures(one.rate_errors))
    axes.legend(loc="best", ncols=3)


def _figures(errors: Array) -> str:
    return f"{rms(errors):.2g} rms, {np.max(np.abs(errors)):.2g} at most"


def _points(axes: Axes, x: Array, y: Array, label: str, colour: str) -> None:
    flat = np.broadcast_to(x, y.shape).ravel()
    axes.plot(flat, y.ravel(), ".", ms=3.0, color=colour, label=label, alpha=0.7)
