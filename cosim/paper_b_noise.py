"""The 2010 paper, section 3: noise of the static record by power spectrum and cross-correlation, and what a Kalman
filter on an AR(1) model makes of it.

30 s at rest, every reading of the six channels. A mean is taken off, and nothing else. The model of each channel is
fitted to its own record; the filter is the sensor's, its gain the bench's. The part's Bartlett filter of 4 taps shapes
the noise over 7 readings, which an AR(1) model meets in its first lag only: it takes twice too much for slow noise and
too little for that of 30 to 130 Hz, and the filter does a little worse than a plain low-pass that lags as much.

"Near Gaussian", the paper's word, is taken by skewness and excess kurtosis: both are 0 of a Gaussian, and scatter by
sqrt(6/n) and sqrt(24/n) of n independent samples. Channels that correlate would show beyond 1.96/sqrt(n).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from itertools import combinations
from pathlib import Path
from statistics import NormalDist
from typing import TYPE_CHECKING, Any

import numpy as np

from ..models.filters.ar1_kalman import ar1_kalman_filtered, initial_channel, signal_variance_for
from ..models.plants.turntable_profile import NO_AXES
from .angle_figures import INK, KALMAN, OURS, RAW, RC, Array, note, rms
from .experiment import Case, Cases, Claim, Experiment
from .identification import Ar1Fit, ar1_density, cross_correlation, fit_ar1, power_spectrum
from .interface import Value
from .monte_carlo import Figures, Take, Trial
from .paper_b_bench import FILTERED, FMUS, RATE, SIGNAL_GAIN, bench
from .profiles import Profile, move
from .recording import Results

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SEEDS = 6
READINGS = 24576
"""Of a record: 30 s."""
_SETTLING = 1024
_PERIOD = 1.0 / RATE
_PROFILE = Profile("paper-b-rest", (move("level", NO_AXES, 60.0),))

CHANNELS = {
    "gyro x": ("rate", 1),
    "gyro y": ("rate", 2),
    "gyro z": ("rate", 3),
    "accelerometer x": ("specific_force", 1),
    "accelerometer y": ("specific_force", 2),
    "accelerometer z": ("specific_force", 3),
}
_MOST_LAG = 40
_SHAPED = 7
"""Readings that the part's filter spreads a conversion over: further apart they are independent."""


def filtered(record: Array, fit: Ar1Fit, gain: float = SIGNAL_GAIN) -> Array:
    """A record behind the sensor's AR(1)-Kalman filter with this model of its noise."""
    a, driving = fit.coefficient, fit.driving_variance
    signal = signal_variance_for(gain, a, driving)
    channel = initial_channel(float(record[0]), a, driving)
    passed = np.full(len(record), channel.estimate)
    for index, reading in enumerate(record[1:].tolist(), 1):
        channel = ar1_kalman_filtered(channel, reading, a, driving, signal)
        passed[index] = channel.estimate
    return passed


def lag_of(fit: Ar1Fit, gain: float = SIGNAL_GAIN) -> float:
    """(1 - K)/(K (1 - a)): readings by which the settled filter is behind a ramp."""
    return (1.0 - gain) / (gain * (1.0 - fit.coefficient))


def low_passed(record: Array, lag: float) -> Array:
    """A record behind y += (x - y)/(lag + 1), which is behind a ramp by `lag` readings."""
    passed, latest = np.empty(len(record)), float(record[0])
    for index, reading in enumerate(record.tolist()):
        latest += (reading - latest) / (lag + 1.0)
        passed[index] = latest
    return passed


def independent(record: Array) -> float:
    """n / sum r(l)^2: as many independent samples scatter in a correlation as this record does (Bartlett's formula)."""
    shape = cross_correlation(record, record, _MOST_LAG).values
    return len(record) / float(shape @ shape)


def _records(results: Results) -> dict[str, Array]:
    return {
        name: np.asarray(results[f"sensor.{signal}_measured[{axis}]"], dtype=np.float64)[_SETTLING:]
        for name, (signal, axis) in CHANNELS.items()
    }


def _standardised(record: Array) -> Array:
    return np.asarray((record - np.mean(record)) / np.std(record))


def low_pass_figures(results: Results) -> Mapping[str, Any]:
    """Noise of each channel behind a plain low-pass that lags as much as the filter on the channel's model."""
    return {
        f"{name}, noise left": rms(low_passed(_standardised(record), lag_of(fit_ar1(record)))[_SETTLING:])
        for name, record in _records(results).items()
    }


def figures_of(results: Results) -> Mapping[str, Any]:
    """Of each channel: model, shape of the distribution, noise before and after the filter; and between channels."""
    records = _records(results)
    figures: dict[str, Any] = {}
    for name, record in records.items():
        fit, standardised = fit_ar1(record), _standardised(record)
        scaled = fit._replace(driving_variance=fit.driving_variance / float(np.var(record)))
        figures |= {
            f"{name}, coefficient": fit.coefficient,
            f"{name}, driving variance": fit.driving_variance,
            f"{name}, skewness": float(np.mean(standardised**3)),
            f"{name}, excess kurtosis": float(np.mean(standardised**4)) - 3.0,
            f"{name}, noise left": rms(filtered(standardised, scaled)[_SETTLING:]),
            f"{name}, density": power_spectrum(record, RATE, 32).density,
            f"{name}, standardised": standardised[::_SHAPED].astype(np.float32),
        }
    pairs = {
        (one, two): cross_correlation(records[one], records[two], _MOST_LAG) for one, two in combinations(records, 2)
    }
    shown = records["gyro x"]
    figures |= {
        "largest correlation": max(abs(float(pair.values[_MOST_LAG])) for pair in pairs.values()),
        "crossed": np.array([pair.values for pair in pairs.values()]),
        "own": cross_correlation(shown, shown, _MOST_LAG).values,
        "bound": pairs["gyro x", "gyro y"].bound * np.sqrt(len(shown) / independent(shown)),
        "frequency": power_spectrum(shown, RATE, 32).frequency,
        "raw": np.degrees(shown[: 2 * round(RATE)] - np.mean(shown)),
        "passed": np.degrees(filtered(shown, fit_ar1(shown))[: 2 * round(RATE)] - np.mean(shown)),
    }
    return figures


def _trial(dist: Path, take: Take, seed: int) -> Trial:
    # a reading each step: the processor keeps to the nominal rate, and the part to its own
    steady: dict[str, Value] = {"sensor.processor.clock_error": 0.0}
    return Trial(
        "noise",
        bench(dist, _PROFILE, seed, FILTERED, steady),
        take,
        READINGS * _PERIOD,
        record=("sensor.rate_measured*", "sensor.specific_force_measured*"),
        step=_PERIOD,
    )


def cases(dist: Path) -> tuple[Case, ...]:
    """The record of a piece at rest; the same behind a plain low-pass."""
    return (
        Case("rest", partial(_trial, dist, figures_of), SEEDS),
        Case("low-pass", partial(_trial, dist, low_pass_figures), SEEDS),
    )


_CHANNEL_CLAIMS = tuple(
    Claim(f"{name}, {what}", None, "1", "section 3", "rest", f"{name}, {figure}")
    for what, figure in (("AR(1) a", "coefficient"), ("kurtosis - 3", "excess kurtosis"))
    for name in CHANNELS
)
_LEFT = tuple(
    Claim(f"{name}, noise left", None, "1", "section 3", "rest", f"{name}, noise left", tuned="low-pass")
    for name in CHANNELS
)
_BETWEEN = Claim("largest correlation", None, "1", "section 3", "rest", "largest correlation")


# --- the picture -----------------------------------------------------------------------------------------------------


def draw(figure: Figure, cases: Cases) -> None:
    """Spectrum, distribution, cross-correlation and two seconds of the record raw and filtered."""
    figure.set_size_inches(12.0, 8.0)
    (spectrum, spread), (crossed, record) = figure.subplots(2, 2)
    first = cases["rest"][0]
    _spectrum(spectrum, first)
    _distribution(spread, cases["rest"])
    _crossed(crossed, cases["rest"])
    _record(record, first)


def _spectrum(axes: Axes, one: Figures) -> None:
    axes.set_title("Power spectrum of a gyro at rest, deg/s/√Hz")
    frequency = np.asarray(one["frequency"])[1:]
    fit = Ar1Fit(float(one["gyro x, coefficient"]), float(one["gyro x, driving variance"]), 0.0, 0.0)
    for name, colour in zip(("gyro x", "gyro y", "gyro z"), (RC, "#56B4E9", "#009E73"), strict=True):
        axes.loglog(frequency, np.degrees(np.sqrt(one[f"{name}, density"]))[1:], color=colour, lw=0.9, label=name)
    axes.loglog(
        frequency, np.degrees(np.sqrt(ar1_density(fit, frequency, RATE))), color=OURS, lw=1.6, label="AR(1) fit of x"
    )
    axes.axhline(0.05, color=INK, lw=0.8, ls=(0, (4, 3)))
    note(axes, "dashed: datasheet, 0.05")
    axes.set_xlabel("frequency (Hz)")
    axes.set_ylim(1e-4, 0.2)
    axes.legend(loc="lower left")


def _distribution(axes: Axes, trials: Any) -> None:
    axes.set_title("Distribution of the readings, all pieces")
    # bins of half a standard deviation: the parts' own steps are up to a quarter
    edges = np.linspace(-4.75, 4.75, 20)
    middle = 0.5 * (edges[1:] + edges[:-1])
    share = np.diff([NormalDist().cdf(float(edge)) for edge in edges])
    axes.semilogy(middle, share, color=INK, lw=1.0, ls=(0, (4, 3)), label="Gaussian")
    for kind, colour, marker in (("gyro", RC, "o"), ("accelerometer", KALMAN, "D")):
        values = np.concatenate([one[f"{kind} {axis}, standardised"] for one in trials for axis in "xyz"])
        counts = np.histogram(values, edges)[0]
        seen, style = counts > 0, {"ms": 4.5, "color": colour, "mfc": "none", "ls": "none"}
        axes.semilogy(middle[seen], counts[seen] / len(values), marker, label=f"{kind}s", **style)
    axes.set_ylabel("share in bins of 0.5")
    axes.set_xlabel("reading over its standard deviation")
    axes.legend(loc="upper left")


def _crossed(axes: Axes, trials: Any) -> None:
    axes.set_title("Correlation of the channels")
    lags = np.arange(-_MOST_LAG, _MOST_LAG + 1) / RATE * 1e3
    first = trials[0]
    for number, line in enumerate(first["crossed"]):
        axes.plot(lags, line, color=RAW, lw=0.5, label="" if number else "two channels, all 15 pairs")
    axes.plot(lags, first["own"], color=RC, lw=1.4, label="gyro x with itself")
    bound = float(first["bound"])
    axes.fill_between(lags, -bound, bound, color=OURS, alpha=0.3, lw=0, label="95 % of independent ones", zorder=3)
    axes.set_xlabel("lag (ms)")
    axes.legend(loc="upper right")


def _record(axes: Axes, one: Figures) -> None:
    axes.set_title("AR(1)-Kalman against raw, gyro x (deg/s)")
    time = np.arange(len(one["raw"])) / RATE
    axes.plot(time, one["raw"], color=RAW, lw=0.5, label="raw")
    axes.plot(time, one["passed"], color=OURS, lw=1.1, label="AR(1)-Kalman")
    note(axes, f"noise left {float(one['gyro x, noise left']):.2f}")
    axes.set_xlabel("time (s)")
    axes.set_xlim(0.0, 2.0)
    axes.set_ylim(-1.7, 1.7)
    axes.legend(loc="upper right", ncols=2)


NOISE = Experiment(
    "paper-b-noise",
    "paper-b",
    "Paper B, section 3: the noise at rest, and the AR(1)-Kalman filter on it",
    FMUS,
    cases,
    (*_CHANNEL_CLAIMS, _BETWEEN, *_LEFT),
    draw,
    "tuned is a plain low-pass that is behind a ramp as much; by default the readings stay as they are, and the fused "
    "solution averages: what that leaves is the noise of the angles at rest, with tables 1 and 2.",
)
"""The static record."""
