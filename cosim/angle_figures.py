"""Figures of angles that a run recorded, in degrees, and how the papers' pictures draw them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..models.scalar import PI
from .recording import Results

# matplotlib is imported where a picture is made
if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]

TURN = 2.0 * PI

# Okabe and Ito's palette, which colour-blind readers can tell apart
RAW, KALMAN, RC, SLOW, OURS, INK = "#999999", "#E69F00", "#0072B2", "#56B4E9", "#D55E00", "#333333"
DEFAULT_COLOUR = "#009E73"
"""Of our solution as it comes, `OURS` being that of the tuned one."""


def degrees(results: Results, name: str) -> Array:
    """A recorded angle, deg."""
    return np.degrees(np.asarray(results[name], dtype=np.float64))


def error_degrees(results: Results, measured: str, true: str) -> Array:
    """Measured without true angle, deg, the short way round the circle."""
    difference = np.asarray(results[measured] - results[true], dtype=np.float64)
    return np.degrees(difference - TURN * np.round(difference / TURN))


def within(time: Array, start: float, end: float) -> NDArray[np.bool_]:
    """Which of the times (s) lie from `start` to `end`, both included."""
    return (time >= start - 1e-9) & (time <= end + 1e-9)


def settling_time(time: Array, angle: Array, target: float, tolerance: float) -> float:
    """The first time (s) at which an angle's mean over the second before is within `tolerance` of `target` (deg).

    Infinite if it never is; `time` has equal steps.
    """
    size = round(1.0 / float(time[1] - time[0]))
    mean = np.convolve(angle, np.ones(size) / size, "valid")
    near = np.flatnonzero(np.abs(mean - target) <= tolerance)
    return float(time[near[0] + size - 1]) if len(near) else float("inf")


def spread(angle: Array, target: float) -> dict[str, float]:
    """Where an angle (deg) lay: lowest, highest, largest error and rms error against `target`."""
    error = angle - target
    return {
        "lowest": float(np.min(angle)),
        "highest": float(np.max(angle)),
        "largest_error": float(np.max(np.abs(error))),
        "rms_error": rms(error),
    }


def rms(values: Any) -> float:
    """sqrt(mean(x^2))."""
    return float(np.sqrt(np.mean(np.square(values))))


def rms_over_trials(errors: Any) -> Array:
    """sqrt(mean(x^2)) over the first axis, the trials."""
    return np.asarray(np.sqrt(np.mean(np.square(np.asarray(errors, dtype=np.float64)), axis=0)))


def note(axes: Axes, text: str, colour: str = INK) -> None:
    """A line of text in the upper right corner of a panel."""
    axes.text(1.0, 1.015, text, color=colour, transform=axes.transAxes, ha="right", va="bottom", fontsize=8.5)
