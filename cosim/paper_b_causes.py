"""The 2010 paper, causes of error 3 and 4: how the rates are integrated, and two clocks that disagree.

Cause 4. The processor's timer has the part's nominal rate, the part's clock is up to 3 % off. Read by the timer, words
come twice or get lost; yet time is the timer's, and the angle is right. Read when the part tells of a new word, none is
lost; but each is taken for 1/819.2 s, and the angle is wrong by as much as the clock, in every axis alike: 2 % is what
tables 3 and 4 print. That the paper read so is a hypothesis; pitch is run, roll would be the same. With the part's
rate measured once against the timer the angle is right again. The part has no other error here, so that this one shows.

Cause 3. True rates, without any part between, sampled at 200 Hz on a bench that sways by 0.3 deg rms at 5 Hz about two
axes (an assumption, strong enough to show coning). Drift is how far the solution has left the truth, sway averaged.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models.attitude.integration import INTEGRATION
from ..models.attitude.rotations import quaternion_product
from ..models.attitude_sensor import SOLVER
from ..models.plants.turntable_profile import NO_AXES
from ..models.scalar import PI
from ..models.sensors.devices import parameters
from .angle_figures import INK, KALMAN, OURS, RAW, RC, Array, error_degrees, note, rms_over_trials, within
from .devices import device_parameters
from .experiment import Case, Cases, Claim, Experiment
from .interface import Value
from .monte_carlo import Trial
from .paper_b_bench import DEVICE, FMUS, INTERVAL, ORDER, RATE, STEP, bench
from .profiles import Profile, move
from .recording import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TURN = 40.0
"""deg, of pitch, at 1 deg/s."""

_DEG = PI / 180.0
_WORDS = 6
"""Words that are counted at a reading: those of three gyros and three accelerometer channels."""


def _profile(name: str, rest: float) -> Profile:
    """Level, then 40 deg of pitch, with a rest before and after."""
    turned = NO_AXES._replace(middle=TURN * _DEG)
    return Profile(name, (move("level", NO_AXES, rest), move("pitch 40 deg", turned, rest, _DEG)))


_GYROS: dict[str, Value] = {
    "sensor.alignment.null_gyro": False,
    "sensor.solver.integration": INTEGRATION.value("runge_kutta_4"),
    "sensor.solver.kind": SOLVER.value("gyro"),
}

# --- cause 4: the clocks ---------------------------------------------------------------------------------------------

CLOCK_SEEDS = 16
_CLOCK_REST = 4.0
_CLOCK_STOP = 50.0
_CLOCK_PROFILE = _profile("paper-b-clock", _CLOCK_REST)


def clock_error(seed: int) -> float:
    """By what share the clock of a piece is quick; one clock for all of its channels."""
    return float(parameters(DEVICE, seed)["gyro.clock_error[1]"])


def _clock_alone(seed: int) -> dict[str, Value]:
    """A flawless part but for the clock of piece `seed`."""
    own = clock_error(seed)
    return {
        **device_parameters(DEVICE).values,
        **{f"sensor.gyro.clock_error[{i}]": own for i in (1, 2, 3)},
        "sensor.accelerometer.clock_error": own,
        **dict.fromkeys(("sensor.gyro.noise_density", "sensor.gyro.bias_instability", "sensor.gyro.nonlinearity"), 0.0),
        # without noise the part's own steps of 0.07 deg/s would round a rate of 1 deg/s
        "sensor.gyro.resolution": 1e-6,
        "sensor.gyro.code_limit": 2**31 - 1,
    }


def _timing(way: str, seed: int) -> dict[str, Value]:
    """When the processor reads, and what time it takes a reading for."""
    own = clock_error(seed)
    if way == "flag":
        return {"sensor.processor.clock_error": own}
    if way == "measured":
        return {"sensor.processor.clock_error": 0.0, "sensor.processor.period": 1.0 / (RATE * (1.0 + own))}
    return {}


def clock_figures(results: Results, clock: float) -> Mapping[str, Any]:
    """What came on top of the angle in the turn (deg), and the words per second that came twice or not at all."""
    time = results["time"]
    error = -error_degrees(results, "sensor.euler.pitch", "table.axis_angle.middle")
    added = float(error[-1] - error[within(time, _CLOCK_REST, _CLOCK_REST)][0])
    slipped = results["sensor.sample.repeated"][-1] + results["sensor.sample.missed"][-1]
    return {
        "clock": clock,
        "added": added,
        "error": abs(added),
        "slipped": float(slipped) / (_WORDS * float(time[-1])),
    }


def _clock_trial(dist: Path, way: str, seed: int) -> Trial:
    alignment: dict[str, Value] = {"sensor.alignment.duration": 2.0}
    return Trial(
        "clock",
        bench(dist, _CLOCK_PROFILE, seed, _clock_alone(seed), _GYROS, alignment, _timing(way, seed)),
        partial(clock_figures, clock=clock_error(seed)),
        _CLOCK_STOP,
        record=("sensor.euler.pitch", "table.axis_angle.middle", "sensor.sample.*"),
        step=STEP,
        interval=INTERVAL,
        order=ORDER,
    )


# --- cause 3: the integration ----------------------------------------------------------------------------------------

SWAY_SEEDS = 5
_PERIOD = 5e-3
_SWAY_REST = 5.0
_SWAY_STOP = 52.0
_SWAY_PROFILE = _profile("paper-b-sway", _SWAY_REST)
_SWAYING: dict[str, Value] = {
    "table.period": _PERIOD,
    "table.tilt.rms[1]": 0.3 * _DEG,
    "table.tilt.rms[2]": 0.3 * _DEG,
    "table.tilt.frequency": 5.0,
    "table.tilt.damping_ratio": 0.05,
    "sensor.ideal": True,
    "sensor.processor.period": _PERIOD,
    "sensor.alignment.duration": 0.0,
    "sensor.motion.restart": False,
}


def attitude_error(results: Results) -> Array:
    """Twice the vector part of q_solved (x) q_true^-1, navigation axes, shape (n, 3), deg; constant without drift."""
    solved = tuple(results[f"sensor.quaternion[{i}]"] for i in (1, 2, 3, 4))
    w, x, y, z = (results[f"table.quaternion[{i}]"] for i in (1, 2, 3, 4))
    product: Any = quaternion_product(solved, (w, -x, -y, -z))  # type: ignore[arg-type]
    real = np.sign(product[0])
    return np.degrees(2.0 * np.column_stack([real * one for one in product[1:]]))


def sway_figures(results: Results) -> Mapping[str, Any]:
    """How far the attitude (deg) has drifted from before the turn to after it, and on the way by the second."""
    error = attitude_error(results)[1:]
    seconds = round(1.0 / INTERVAL)
    means = error[: len(error) // seconds * seconds].reshape(-1, seconds, 3).mean(axis=1)
    whole = round(_SWAY_REST)
    moved = np.linalg.norm(means - means[:whole].mean(axis=0), axis=1)
    return {
        "drift": float(np.linalg.norm(means[-whole:].mean(axis=0) - means[:whole].mean(axis=0))),
        "moved": moved.astype(np.float32),
    }


def _sway_trial(dist: Path, integration: str, seed: int) -> Trial:
    chosen: dict[str, Value] = {"sensor.solver.integration": INTEGRATION.value(integration)}
    return Trial(
        "sway",
        bench(dist, _SWAY_PROFILE, seed, _GYROS, _SWAYING, chosen),
        sway_figures,
        _SWAY_STOP,
        record=("sensor.quaternion*", "table.quaternion*"),
        step=_PERIOD,
        interval=INTERVAL,
        order=ORDER,
    )


_INTEGRATIONS = {
    "runge-kutta": "runge_kutta_4",
    "taylor": "taylor_4",
    "rotation-vector": "rotation_vector",
    "coning": "coning_compensated",
}


def cases(dist: Path) -> tuple[Case, ...]:
    """Three ways of timing, four of integrating."""
    timings = [Case(way, partial(_clock_trial, dist, way), CLOCK_SEEDS) for way in ("timer", "flag", "measured")]
    ways = [Case(name, partial(_sway_trial, dist, kind), SWAY_SEEDS) for name, kind in _INTEGRATIONS.items()]
    return (*timings, *ways)


_CAUSE_3, _CAUSE_4 = "section 3, cause 3", "section 3, cause 4"
CLAIMS = (
    Claim("timer, slipped words", None, "1/s", _CAUSE_4, "timer", "slipped", best="flag"),
    Claim("timer, 40 deg, error", None, "deg", _CAUSE_4, "timer", "error", best="measured"),
    # no verdict: that the paper read so is a hypothesis, which its tables' 0.79 deg in both axes suggests
    Claim("hypothesis: flag, 40 deg, error", None, "deg", "tables 3 and 4", "flag", "error", best="measured"),
    Claim("Runge-Kutta, drift", None, "deg", _CAUSE_3, "runge-kutta", "drift", best="coning"),
    Claim("Taylor, drift", None, "deg", _CAUSE_3, "taylor", "drift", best="coning"),
    Claim("mean rate alone, drift", None, "deg", _CAUSE_3, "rotation-vector", "drift", best="coning"),
)


# --- the picture -----------------------------------------------------------------------------------------------------

_TIMINGS = (
    ("flag", "new-data flag, nominal rate", KALMAN, "o"),
    ("timer", "timer", RC, "s"),
    ("measured", "new-data flag, rate measured: ours", OURS, "x"),
)
_CLOCK_LIMITS = (-3.2, 3.2)
_DRAWN = (
    ("rotation-vector", "mean rate alone", RAW, "-"),
    ("runge-kutta", "Runge-Kutta of 4th order: the paper's", RC, "-"),
    ("taylor", "Taylor of 4th order", INK, (0, (2, 4))),
    ("coning", "coning compensated: ours", OURS, "-"),
)


def draw(figure: Figure, cases: Cases) -> None:
    """Error of 40 deg by the part's clock, the words that slip, and the drift by way of integration."""
    figure.set_size_inches(12.0, 6.0)
    panels = figure.subplot_mosaic([["clocks", "drifts"], ["slips", "drifts"]], height_ratios=(2.0, 1.0))
    _clocks(panels["clocks"], cases)
    _slips(panels["slips"], cases)
    _drifts(panels["drifts"], cases)


def _values(trials: Any, figure: str) -> list[float]:
    return [float(one[figure]) for one in trials]


def _percent(trials: Any) -> Array:
    return 100.0 * np.array(_values(trials, "clock"))


def _clocks(axes: Axes, cases: Cases) -> None:
    axes.set_title("Cause 4: error of 40 deg by the part's clock")
    for name, label, colour, marker in _TIMINGS:
        added = _values(cases[name], "added")
        axes.plot(_percent(cases[name]), added, marker, ms=5, color=colour, ls="none", label=label)
    axes.axhline(0.79, color=INK, lw=0.8, ls=(0, (4, 3)))
    note(axes, "dashed: tables 3 and 4")
    axes.set_ylabel("table less sensor (deg)")
    axes.set_xlim(*_CLOCK_LIMITS)
    axes.legend(loc="lower left")


def _slips(axes: Axes, cases: Cases) -> None:
    for name, _, colour, marker in _TIMINGS[:2]:
        axes.plot(_percent(cases[name]), _values(cases[name], "slipped"), marker, ms=5, color=colour, ls="none")
    axes.set_ylabel("words that slip (1/s)")
    axes.set_xlabel("the part's clock is quick by (%)")
    axes.set_xlim(*_CLOCK_LIMITS)


def _drifts(axes: Axes, cases: Cases) -> None:
    axes.set_title("Cause 3: drift on a swaying bench (deg)")
    for name, label, colour, line in _DRAWN:
        moved = rms_over_trials([one["moved"] for one in cases[name]])
        time = np.arange(len(moved)) + 0.5
        axes.semilogy(time, moved, color=colour, lw=1.3, ls=line, label=label)
    # room for the legend
    axes.set_ylim(bottom=1.5e-5)
    note(axes, "rms over the seeds")
    axes.set_xlabel("time (s)")
    axes.legend(loc="lower right")


CAUSES = Experiment(
    "paper-b-causes",
    "paper-b",
    "Paper B, causes of error 3 and 4: integration and clocks",
    FMUS,
    cases,
    CLAIMS,
    draw,
)
"""What the paper blames, each by itself."""
