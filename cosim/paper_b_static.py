"""The 2010 paper, tables 1 and 2: pitch and roll by the accelerometer at rest, 0 to 40 deg, the other angle 20 deg.

The paper takes the mean error off as mounting error, -0.9072 deg in pitch and -0.4899 deg in roll. A sensor turned
against the plate by that pitch would read a roll that goes by 0.2 deg from 0 to 40 deg at 20 deg of pitch, which table
2 does not show: so it is entered as the zero of the axes, the same in all positions. A reading is the mean of a rest.
Errors are sensor less table in both; those that table 2 prints have the other sign.

The tolerances of the part (accelerometer scale 0.7 % and axes 0.25 deg rms, after its maker's calibration) leave a few
tenths of a degree between 0 and 40 deg, which no filter takes off: one piece in six keeps the paper's 0.1 deg. The
paper tested one. Calibrated, every piece keeps it.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models.scalar import PI
from .angle_figures import INK, OURS, RAW, RC, error_degrees, note, rms
from .experiment import BAND, Case, Cases, Claim, Experiment
from .interface import Value
from .monte_carlo import Trial
from .paper_b_bench import (
    ANGLES,
    DEFAULT,
    FMUS,
    INTERVAL,
    LEVELLED,
    ORDER,
    STEP,
    TABLE_AXIS,
    TUNED,
    bench,
    calibrated,
    recorded,
    started_beside,
)
from .paper_b_bench import OURS as OUR_WAYS
from .profiles import PAPER_B_PITCH, PAPER_B_ROLL, Profile, labelled_intervals
from .recording import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PRINTED = {
    "pitch": (-0.8731, 9.0705, 19.0651, 29.1822, 39.0193),
    "roll": (-0.4800, 9.5374, 19.4969, 29.5491, 39.4473),
}
"""deg, what the sensor read at `ANGLES`: tables 1 and 2."""

OFFSET = {"pitch": -0.9072, "roll": -0.4899}
"""deg, the mean errors, which the paper calls mounting errors."""

SEEDS, FEWER = 80, 20
"""Of the paper's way, and of ours, whose medians alone count."""

_PROFILES = {"pitch": PAPER_B_PITCH, "roll": PAPER_B_ROLL}
_STOP = 100.0


def printed_errors(angle: str) -> tuple[float, ...]:
    """The printed errors of a table, deg, the mean taken off."""
    return tuple(read - true - OFFSET[angle] for read, true in zip(PRINTED[angle], ANGLES, strict=True))


def figures_of(results: Results, profile: Profile, angle: str) -> Mapping[str, Any]:
    """The mean error (deg) over all positions, what is left at each without it, the largest of that, and the noise."""
    error = error_degrees(results, f"sensor.euler.{angle}", f"table.axis_angle.{TABLE_AXIS[angle]}")
    time = results["time"]
    rests = labelled_intervals(profile, results)[1:]
    at_rest = [error[(time >= rest.start) & (time <= rest.end)] for rest in rests]
    means = np.array([np.mean(one) for one in at_rest])
    left = means - np.mean(means)
    return {
        "offset": float(np.mean(means)),
        "noise": rms([np.std(one) for one in at_rest]),
        "largest_error": float(np.max(np.abs(left))),
        **{f"error_{at}": float(value) for at, value in zip(ANGLES, left, strict=True)},
    }


def trial(dist: Path, angle: str, settings: Mapping[str, Value], is_calibrated: bool, seed: int) -> Trial:
    """A run of one table."""
    profile = _PROFILES[angle]
    table: dict[str, Value] = {
        **started_beside(angle),
        "table.axis.middle.position_error.offset": OFFSET["pitch"] * PI / 180.0,
        "table.axis.inner.position_error.offset": OFFSET["roll"] * PI / 180.0,
    }
    return Trial(
        "static",
        bench(dist, profile, seed, table, settings, calibrated(seed) if is_calibrated else {}),
        partial(figures_of, profile=profile, angle=angle),
        _STOP,
        record=recorded(angle),
        step=STEP,
        interval=INTERVAL,
        order=ORDER,
    )


_WAYS: tuple[tuple[str, Mapping[str, Value], bool, int], ...] = (
    ("", LEVELLED, False, SEEDS),
    ("-default", DEFAULT, True, FEWER),
    ("-tuned", TUNED, True, FEWER),
)


def cases(dist: Path) -> tuple[Case, ...]:
    """Both tables, the paper's way and ours."""
    return tuple(
        Case(f"{angle}{suffix}", partial(trial, dist, angle, settings, is_calibrated), seeds)
        for angle in ("pitch", "roll")
        for suffix, settings, is_calibrated, seeds in _WAYS
    )


def _claims(angle: str, table: str) -> tuple[Claim, ...]:
    printed = printed_errors(angle)

    def claim(what: str, published: float | None, source: str, figure: str, **more: Any) -> Claim:
        ours = Claim("", None, "deg", source, angle, figure, best=f"{angle}-default", tuned=f"{angle}-tuned")
        return ours._replace(what=f"{angle}{what}", published=published, **more)

    largest = round(max(abs(error) for error in printed), 4)
    return (
        claim(", mean error", OFFSET[angle], table, "offset", target=OFFSET[angle], sets=True),
        *[
            claim(f" at {at} deg, error", round(error, 4), table, f"error_{at}")
            for at, error in zip(ANGLES, printed, strict=True)
        ],
        claim(", largest error", largest, table, "largest_error"),
        claim(", limit of the error", 0.1, "section 3", "largest_error", bound=True, one_piece=True),
        claim(", rms noise of a reading", None, "section 3", "noise"),
    )


# --- the picture -----------------------------------------------------------------------------------------------------


def draw(figure: Figure, cases: Cases) -> None:
    """The errors of tables 1 and 2 by angle: printed, ours of every piece their way, and calibrated and fused."""
    figure.set_size_inches(11.0, 5.2)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, angle, table in zip(panels, ("pitch", "roll"), ("Table 1", "Table 2"), strict=True):
        other = "roll" if angle == "pitch" else "pitch"
        axes.set_title(f"{table}: {angle} by the accelerometer, {other} 20 deg")
        _errors(axes, cases, angle)
        axes.set_xlabel(f"{angle} of the table (deg)")
    panels[0].set_ylabel("error without its mean (deg)")
    panels[0].legend(loc="upper left", ncols=2)


def _errors(axes: Axes, cases: Cases, angle: str) -> None:
    theirs, ours = [
        np.array([[one[f"error_{at}"] for at in ANGLES] for one in cases[name]]) for name in (angle, f"{angle}-tuned")
    ]
    for number, line in enumerate(theirs):
        axes.plot(ANGLES, line, color=RAW, lw=0.6, alpha=0.7, label="" if number else "pieces as they come")
    for errors, colour, alpha, label in (
        (theirs, RC, 0.13, "their 5 to 95 %"),
        (ours, OURS, 0.45, "ours, tuned, 5 to 95 %"),
    ):
        low, _, high = np.percentile(errors, BAND, axis=0)
        axes.fill_between(ANGLES, low, high, color=colour, alpha=alpha, lw=0, label=label)
    for limit in (-0.1, 0.1):
        axes.axhline(limit, color=INK, lw=0.8, ls=(0, (4, 3)))
    axes.plot(ANGLES, printed_errors(angle), "D", ms=6, mec=INK, mfc="white", mew=1.3, ls="none", label="printed")
    axes.set_xticks(ANGLES)
    axes.set_ylim(-0.95, 0.95)
    note(axes, "dashed: ±0.1 deg")


STATIC = Experiment(
    "paper-b-static",
    "paper-b",
    "Paper B, tables 1 and 2: pitch and roll at rest by the accelerometer",
    FMUS,
    cases,
    (*_claims("pitch", "table 1"), *_claims("roll", "table 2")),
    draw,
    OUR_WAYS,
)
"""Tables 1 and 2."""
