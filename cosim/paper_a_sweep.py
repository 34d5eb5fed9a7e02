"""Jing & Gao 2021, section 4.1: the inner axis from -20 to 20 deg in steps of 10 deg, then the middle one.

At 10 deg/s and 10 deg/s^2, as printed; what came out is not printed. The bench shakes as in their static run; the rests
of 10 s are an assumption. An angle at rest is the mean over the last second of the rest.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .angle_figures import DEFAULT_COLOUR, INK, OURS, RC, error_degrees, rms
from .experiment import BAND, Case, Cases, Claim, Experiment
from .interface import Value
from .monte_carlo import Figures, Trial
from .paper_a_bench import DEFAULT, FMUS, ORDER, READ, STEP, TUNED, as_printed, bench, shaking
from .paper_a_bench import OURS as OUR_WAYS
from .profiles import PAPER_A_SWEEP, labelled_intervals
from .recording import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SEEDS = 20
STOP = 165.0
_AXES = {"inner": "roll", "middle": "pitch"}
_MEAN = 1.0
"""s at the end of a rest."""


def figures_of(results: Results) -> Mapping[str, Any]:
    """Errors (deg) of each axis's own angle at its rests and on its moves, and both angles over time."""
    time = results["time"]
    rests = labelled_intervals(PAPER_A_SWEEP, results)
    figures: dict[str, Any] = {}
    for axis, angle in _AXES.items():
        error = error_degrees(results, f"sensor.euler.{angle}", f"table.euler.{angle}")
        own = [number for number, rest in enumerate(rests) if rest.label.startswith(axis)]
        at_rest = [float(np.mean(error[_last(time, rests[number].end)])) for number in own]
        moving = [(time > rests[number - 1].end) & (time < rests[number].start) for number in own]
        figures |= {
            f"{axis}_rests": np.array(at_rest),
            f"{axis}_rest_error": rms(at_rest),
            f"{axis}_move_error": max(float(np.max(np.abs(error[one]))) for one in moving),
            f"{axis}_error": error.astype(np.float32),
            f"{axis}_true": np.degrees(results[f"table.euler.{angle}"]).astype(np.float32),
        }
    return figures


def _last(time: Any, end: float) -> Any:
    return (time > end - _MEAN) & (time <= end)


WAYS: dict[str, dict[str, Value]] = {
    "rc-100": as_printed("rc", from_zero=False),
    "default": DEFAULT,
    "tuned": TUNED,
}


def trial(dist: Path, settings: Mapping[str, Value], seed: int) -> Trial:
    """A sweep of both axes on the shaking bench."""
    system = bench(dist, PAPER_A_SWEEP, seed, {**shaking(), **settings})
    angles = [f"{owner}.euler.{angle}" for owner in ("sensor", "table") for angle in _AXES.values()]
    record = (*angles, "table.row", "table.resting", "table.turning")
    return Trial("sweep", system, figures_of, STOP, record=record, step=STEP, interval=READ, order=ORDER)


def cases(dist: Path) -> tuple[Case, ...]:
    """The filter that the paper chose, and our two ways."""
    return tuple(Case(name, partial(trial, dist, settings), SEEDS) for name, settings in WAYS.items())


CLAIMS = tuple(
    Claim(
        f"{axis} axis, {what}", None, "deg", "section 4.1", "rc-100", f"{axis}_{figure}", best="default", tuned="tuned"
    )
    for axis in _AXES
    for what, figure in (("rms error at rest", "rest_error"), ("largest error on a move", "move_error"))
)


# --- the picture -----------------------------------------------------------------------------------------------------

_NAMES = (
    ("rc-100", "RC, num = 100", RC),
    ("default", "Ours: fused, default", DEFAULT_COLOUR),
    ("tuned", "Ours: fused, tuned", OURS),
)


def draw(figure: Figure, cases: Cases) -> None:
    """Angle and error of both axes over time, and the error at each rest over the seeds."""
    rows = figure.subplots(2, 2, sharex="row", sharey="row", height_ratios=(1.0, 1.0))
    for column, axis in enumerate(_AXES):
        _angles(rows[0][column], axis, cases)
        _errors(rows[1][column], axis, cases)
    rows[0][0].legend(loc="upper left")
    rows[0][0].set_ylabel("deg")
    rows[1][0].set_ylabel("error (deg)")


def _angles(axes: Axes, axis: str, cases: Cases) -> None:
    axes.set_title(f"{axis.capitalize()} axis")
    first = cases["tuned"][0]
    time = READ * np.arange(len(first[f"{axis}_true"]))
    for name, title, colour in _NAMES:
        one = cases[name][0]
        axes.plot(time, one[f"{axis}_true"] + one[f"{axis}_error"], color=colour, label=title)
    axes.plot(time, first[f"{axis}_true"], color=INK, lw=0.6, ls=(0, (4, 3)), label="table")
    axes.set_xlabel("time (s)")


def _errors(axes: Axes, axis: str, cases: Cases) -> None:
    axes.set_title(f"{axis.capitalize()} axis, error at each rest, 5 to 95 % of the seeds")
    for shift, (name, _, colour) in zip((-0.8, 0.0, 0.8), _NAMES, strict=True):
        low, middle, high = _band(cases[name], f"{axis}_rests")
        place = np.arange(-20.0, 21.0, 10.0) + shift
        axes.errorbar(place, middle, (middle - low, high - middle), fmt="o", ms=4, color=colour, capsize=2)
    axes.axhline(0.0, color=INK, lw=0.6)
    axes.set_xlabel("angle of the table (deg)")


def _band(trials: Sequence[Figures], name: str) -> Any:
    return np.percentile([figures[name] for figures in trials], BAND, axis=0)


SWEEP = Experiment(
    "paper-a-sweep",
    "paper-a",
    "Paper A, section 4.1: both axes from -20 to 20 deg on a shaking bench",
    FMUS,
    cases,
    CLAIMS,
    draw,
    OUR_WAYS,
)
"""The experiment that the paper describes without its outcome."""
