"""Jing & Gao 2021, section 5: what temperature does to the angles, and what the two remedies that they propose do.

The paper calibrates at room temperature and leaves temperature out; it proposes to compensate it with factors that are
calibrated at several temperatures, or to hold the sensor's surroundings warm. Here the chamber goes from 20 to 0 and to
40 degC; at each the table rests level and at 43.5 deg. No shaking, so that nothing but temperature shows.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models.plants.turntable_profile import NO_AXES, Axes
from ..models.scalar import PI
from ..models.sensors.thermal import HeaterParameters
from .angle_figures import INK, KALMAN, OURS, RC, SLOW, error_degrees, rms
from .experiment import Case, Cases, Claim, Experiment
from .interface import Value
from .known_errors import known_compensation
from .monte_carlo import Trial
from .paper_a_bench import DEVICE, FMUS, INNER, ORDER, as_printed, bench
from .profiles import ROOM_TEMPERATURE, Profile, labelled_intervals, move
from .recording import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes as Panel
    from matplotlib.figure import Figure

SEEDS = 6
STOP = 1330.0
_STEP, _INTERVAL = 0.02, 0.2
_MEAN = 10.0
"""s at the end of a rest."""

_TILTED = Axes(0.0, 0.0, INNER * PI / 180.0)
_CELSIUS = (20.0, 0.0, 40.0)
PROFILE = Profile(
    "paper-a-temperature",
    tuple(
        row
        for celsius, soak in zip(_CELSIUS, (300.0, 240.0, 240.0), strict=True)
        for row in (
            move(f"level, {celsius:g} degC", NO_AXES, soak, temperature=273.15 + celsius),
            move(f"inner {INNER:g} deg, {celsius:g} degC", _TILTED, 30.0, temperature=273.15 + celsius),
        )
    ),
)
"""Soaks of four time constants of the dies; the first one is their 10 min of warming up, as far as it matters."""

_CHAMBER: dict[str, Value] = {"table.chamber.ramp_limit": 0.2, "table.chamber.time_constant": 20.0}
_RATES = (1, 2, 3)


def figures_of(results: Results) -> Mapping[str, Any]:
    """Error of the inner angle (deg) and of the rates (deg/s) at each rest; largest of all; temperatures over time."""
    time = results["time"]
    error = error_degrees(results, "sensor.euler.roll", "table.euler.roll")
    rests = labelled_intervals(PROFILE, results)
    ends = [(time > rest.end - _MEAN) & (time <= rest.end) for rest in rests]
    angles = np.array([float(np.mean(error[end])) for end in ends])
    off = [np.degrees(results[f"sensor.rate_measured[{i}]"] - results[f"table.rate[{i}]"]) for i in _RATES]
    drifts = np.array([rms([np.mean(axis[end]) for axis in off]) for end in ends])
    level = np.array([rest.label.startswith("level") for rest in rests])
    return {
        "angles": angles,
        "drifts": drifts,
        "level_error": float(np.max(np.abs(angles[level]))),
        "tilted_error": float(np.max(np.abs(angles[~level]))),
        "gyro_drift": float(np.max(drifts)),
        "time": time.astype(np.float32),
        "air": (results["table.temperature"] - 273.15).astype(np.float32),
        "die": (results["sensor.die_temperature.accelerometer"] - 273.15).astype(np.float32),
    }


_WARM = HeaterParameters().setpoint
WAYS: dict[str, tuple[bool, bool]] = {
    "room": (False, False),
    "compensated": (True, False),
    "thermostat": (False, True),
    "both": (True, True),
}
"""Whether the processor compensates by temperature, and whether the enclosure is held warm."""


def trial(dist: Path, compensated: bool, heated: bool, seed: int) -> Trial:
    """A run through the chamber's temperatures, calibrated where it was made to work."""
    enclosure = _WARM if heated else ROOM_TEMPERATURE
    known = known_compensation(DEVICE, seed, enclosure, by_temperature=compensated)
    values = {
        **_CHAMBER,
        **as_printed("rc", from_zero=False),
        "sensor.alignment.null_gyro": False,
        "sensor.heater.enabled": heated,
        "table.period": 0.01,
    }
    rates = [f"{name}[{i}]" for name in ("sensor.rate_measured", "table.rate") for i in _RATES]
    record = (
        *("sensor.euler.roll", "table.euler.roll", *rates),
        *("table.temperature", "sensor.die_temperature.accelerometer"),
        *("table.row", "table.resting", "table.turning"),
    )
    system = bench(dist, PROFILE, seed, values, known)
    return Trial("temperature", system, figures_of, STOP, record=record, step=_STEP, interval=_INTERVAL, order=ORDER)


def cases(dist: Path) -> tuple[Case, ...]:
    """Calibrated at room temperature as the paper's, with either remedy, and with both."""
    return tuple(Case(name, partial(trial, dist, *way), SEEDS) for name, way in WAYS.items())


_NAMES = (
    ("room", "calibrated at room temperature", RC),
    ("compensated", "compensated by temperature", KALMAN),
    ("thermostat", "held at 45 degC", SLOW),
    ("both", "both", OURS),
)
_QUANTITIES = (
    ("angle, level", "deg", "level_error"),
    ("angle, 43.5 deg", "deg", "tilted_error"),
    ("drift of the gyros", "deg/s", "gyro_drift"),
)
CLAIMS = tuple(
    Claim(f"{what}, {title}", None, unit, "section 5", case, figure, best="both")
    for what, unit, figure in _QUANTITIES
    for case, title, _ in _NAMES[:-1]
)


# --- the picture -----------------------------------------------------------------------------------------------------


def draw(figure: Figure, cases: Cases) -> None:
    """The temperatures over time, and at each rest the error of the angle and of the rates."""
    upper, lower = figure.subfigures(2, 1, squeeze=False, height_ratios=(0.8, 1.0))[:, 0]
    _temperatures(upper.subplots(), cases)
    angle, drift = lower.subplots(1, 2)
    _rests(angle, "Error of the inner angle, least to largest of the pieces (deg)", "angles", cases)
    _rests(drift, "Error of the rates, rms of the gyros (deg/s)", "drifts", cases)
    drift.set_ylim(bottom=0.0)
    figure.legend(*angle.get_legend_handles_labels(), loc="outside lower center", ncols=len(_NAMES))


def _temperatures(axes: Panel, cases: Cases) -> None:
    axes.set_title("Temperatures (degC)")
    room, warm = cases["room"][0], cases["thermostat"][0]
    axes.plot(room["time"], room["air"], color=INK, label="chamber")
    axes.plot(room["time"], room["die"], color=RC, label="accelerometer")
    axes.plot(warm["time"], warm["die"], color=SLOW, label="accelerometer in the thermostat")
    axes.set_xlim(0.0, STOP)
    axes.set_xlabel("time (s)")
    axes.legend(loc="center left", bbox_to_anchor=(0.0, 0.3))


def _rests(axes: Panel, title: str, name: str, cases: Cases) -> None:
    axes.set_title(title)
    places = np.arange(len(PROFILE.rows), dtype=float)
    for number, (case, label, colour) in enumerate(_NAMES):
        low, middle, high = np.percentile([figures[name] for figures in cases[case]], (0.0, 50.0, 100.0), axis=0)
        spread = (middle - low, high - middle)
        axes.errorbar(
            places + 0.16 * (number - 1.5), middle, spread, fmt="o", ms=4, capsize=2, color=colour, label=label
        )
    labels = [row.label.replace(", ", "\n").replace("inner ", "") for row in PROFILE.rows]
    axes.set_xticks(places, labels)
    axes.axhline(0.0, color=INK, lw=0.6)


TEMPERATURE = Experiment(
    "paper-a-temperature",
    "paper-a",
    "Paper A, section 5: temperature, its compensation, and a thermostat",
    FMUS,
    cases,
    CLAIMS,
    draw,
    "default is both remedies together: the processor's compensation, in the thermostat.",
)
"""The experiment that the paper leaves to others."""
