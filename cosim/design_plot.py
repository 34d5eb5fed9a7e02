"""The pictures of `attitude-fmu design`: what the designs reach, and how their loops are made."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import signal  # type: ignore[import-untyped]

from .plot import STYLE
from .report import AXES, EXPOSURE
from .workspace import whole_or_not

# matplotlib is imported where a picture is made: most commands need none
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

# Okabe and Ito's palette, which colour-blind readers can tell apart
_KINDS = {"held": "#666666", "PID": "#E69F00", "LQG": "#0072B2"}
_CAUSES = ("#56B4E9", "#D55E00", "#CC79A7", "#009E73", "#999999")
_NAMES = {"held": "joints held", "PID": "PID", "LQG": "LQG"}
_LINES = ("--", "-", ":")
_BLACK = "#333333"
_URAD = 1e6
_TRACE = 6.0
"""s of the line of sight that are shown."""

_SEGMENT = 8.0
"""s of the spectra's segments."""

_SHOWN = (0.1, 100.0)
"""Hz of the line of sight's spectra."""

_PITCH = AXES.index("pitch")
_NOTHING = 0.5
"""deg of phase below which a delay is not shown."""


def plot_overview(path: Path, designs: list[Any], runs: list[Any], wind: float) -> Path:
    """Jitter predicted and co-simulated, its causes, the line of sight, its spectrum, in a wind of `wind` m/s.

    Raises `ResultsError` if the file cannot be written.
    """
    first = designs[0]
    held = runs[0].jitter
    best = min((run for run in runs if run.label == first.sensor.label), key=lambda run: float(run.jitter.rms))
    lines = (
        f"Co-simulated with {_sensor(first)} in {wind:g} m/s of wind: {_shown(_URAD * held.rms)} µrad with the "
        f"joints held, {_shown(_URAD * best.jitter.rms)} µrad with the {best.kind}, "
        f"{held.rms / best.jitter.rms:.1f} times less",
        f"Jitter: rms motion of the line of sight, azimuth and elevation together, about its mean in an exposure of "
        f"{EXPOSURE:g} s",
    )

    def draw(figure: Figure) -> None:
        grid = figure.add_gridspec(2, 2, left=0.055, right=0.985, top=0.85, bottom=0.065, hspace=0.36, wspace=0.22)
        _bars(figure.add_subplot(grid[0, 0]), designs, runs)
        _causes(figure.add_subplot(grid[0, 1]), designs)
        _trace(figure.add_subplot(grid[1, 0]), first, runs)
        _spectrum(figure.add_subplot(grid[1, 1]), first, runs)

    return _picture(path, "A camera held still in the wind: designed, exported, co-simulated", lines, draw)


def _picture(path: Path, title: str, lines: tuple[str, ...], draw: Callable[[Figure], None]) -> Path:
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({**STYLE, "axes.axisbelow": True}):
        figure = Figure(figsize=(13.0, 8.6), dpi=130)
        figure.text(0.012, 0.985, title, va="top", fontsize=14, weight="bold")
        for number, line in enumerate(lines):
            figure.text(0.012, 0.945 - 0.026 * number, line, va="top", fontsize=10)
        draw(figure)
        with whole_or_not(path) as draft:
            figure.savefig(draft, format="png")
    return path


def _plain(*axes: Axis) -> None:
    """Decades as plain numbers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for axis in axes:
        axis.set_major_locator(LogLocator(10.0, numticks=12))
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        axis.set_minor_formatter(NullFormatter())


def _hertz(axes: Axes, low: float, high: float) -> None:
    axes.set_xlim(low, high)
    axes.set_xlabel("frequency (Hz)", labelpad=1)
    _plain(axes.xaxis)


def _decades(axes: Axes, curves: list[Any], most: int) -> None:
    """Whole decades about the curves, at most so many below the highest."""
    top = np.ceil(np.log10(max(float(curve.max()) for curve in curves)))
    low = np.floor(np.log10(max(min(float(curve.min()) for curve in curves), 10.0 ** (top - most))))
    axes.set_ylim(10.0**low, 10.0**top)
    _plain(axes.yaxis)


def _shown(number: float) -> str:
    """Three digits, no more than one behind the point."""
    return f"{number:.0f}" if number >= 99.95 else f"{number:.1f}"


def _size(jitter: Any) -> float:
    return _URAD * float(np.hypot(jitter[0], jitter[1]))


def _sensor(design: Any) -> str:
    label = str(design.sensor.label)
    return "an ideal sensor" if label == "ideal" else label.replace("_", " ", 1)


# --- overview ---------------------------------------------------------------------------------------------------------


def _bars(axes: Axes, designs: list[Any], runs: list[Any]) -> None:
    from matplotlib.ticker import FuncFormatter

    axes.set_title(
        f"Jitter (µrad): bars co-simulated in {runs[0].jitter.exposures} exposures, ◆ predicted by the design"
    )
    found = {(run.label, run.kind): (_URAD * run.jitter.rms, _URAD * run.error) for run in runs}
    names, place = ["joints held"], 0.0
    bars = [(0.0, "held", *found[runs[0].label, "held"], _size(designs[0].held))]
    for design in designs:
        place += 1.4
        names.append(_two_lines(design.sensor.label))
        for shift, one in zip((-0.26, 0.26), design.controllers, strict=True):
            bars.append((place + shift, one.kind, *found[design.sensor.label, one.kind], _size(one.jitter)))
    for x, kind, simulated, error, predicted in bars:
        axes.bar(x, simulated, 0.46, color=_KINDS[kind], zorder=2)
        axes.errorbar([x + 0.12], [simulated], 2.0 * error, color="black", lw=1.0, capsize=3, zorder=3)
        axes.plot([x - 0.06], [predicted], "D", ms=7, color="white", mec="black", mew=1.2, zorder=4)
        text = f"{'' if kind == 'held' else kind}\n{_shown(simulated)}".strip()
        top = max(simulated + 2.0 * error, predicted)
        axes.annotate(text, (x, top), (0, 9), textcoords="offset points", ha="center", fontsize=8.5)
    axes.set_yscale("log")
    low, high = (pick(pick(bar[2], bar[4]) for bar in bars) for pick in (min, max))
    axes.set_ylim(10.0 ** np.floor(np.log10(0.7 * low)), 3.2 * high)
    axes.yaxis.set_major_locator(_ones_twos_fives())
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.minorticks_off()
    axes.set_xticks([0.0, *[1.4 * (k + 1) for k in range(len(designs))]], names)
    axes.grid(axis="x", visible=False)
    axes.text(0.995, 0.985, "lines: ± 2 standard errors", transform=axes.transAxes, ha="right", va="top", fontsize=8)


def _ones_twos_fives() -> Any:
    from matplotlib.ticker import LogLocator

    return LogLocator(10.0, subs=(1.0, 2.0, 5.0), numticks=30)


def _two_lines(label: str) -> str:
    return "ideal sensor" if label == "ideal" else label.replace("_", "\n", 1)


def _causes(axes: Axes, designs: list[Any]) -> None:
    axes.set_title("What makes the predicted jitter: share of its square (%)")
    names: list[str] = []
    places: list[float] = []
    for number, design in enumerate(designs):
        for shift, one in zip((-0.2, 0.2), design.controllers, strict=True):
            x, left = -(number + shift), 0.0
            squares = {cause: _size(value) ** 2 for cause, value in one.causes.items()}
            for (cause, square), colour in zip(squares.items(), _CAUSES, strict=True):
                share = 100.0 * square / sum(squares.values())
                axes.barh(x, share, 0.34, left=left, color=colour, label=None if places else cause)
                if share > 10.0:
                    text = f"{_shown(np.sqrt(square))} µrad"
                    axes.text(left + 0.5 * share, x, text, ha="center", va="center", fontsize=8, color="black")
                left += share
            names.append(f"{_two_lines(design.sensor.label).splitlines()[0]}, {one.kind}")
            places.append(x)
    axes.set_yticks(places, names)
    axes.set_xlim(0.0, 100.0)
    axes.grid(axis="y", visible=False)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=5, handlelength=1.0, columnspacing=1.2)


def _of(design: Any, runs: list[Any], kind: str) -> Any:
    label = runs[0].label if kind == "held" else design.sensor.label
    return next(run for run in runs if run.label == label and run.kind == kind)


def _trace(axes: Axes, design: Any, runs: list[Any]) -> None:
    axes.set_title(f"Elevation of the line of sight in the same wind, with {_sensor(design)}")
    for kind, colour in _KINDS.items():
        run = _of(design, runs, kind)
        time = run.results["time"]
        shown = (time >= run.since) & (time < run.since + _TRACE)
        angle = run.results["plant.euler.pitch"][shown]
        axes.plot(time[shown], _URAD * (angle - angle.mean()), color=colour, lw=1.0, label=_NAMES[kind])
    axes.set_xlabel("time (s)", labelpad=1)
    axes.set_ylabel("µrad", labelpad=1)
    axes.margins(x=0.0)
    low, high = axes.get_ylim()
    axes.set_ylim(low, high + 0.16 * (high - low))
    axes.legend(loc="upper right", ncols=3)


def _spectrum(axes: Axes, design: Any, runs: list[Any]) -> None:
    axes.set_title("Spectrum of the line of sight: thin co-simulated, thick and pale predicted")
    predicted = {"held": design.held_spectrum, **{one.kind: one.spectrum for one in design.controllers}}
    seen = (design.frequencies >= _SHOWN[0]) & (design.frequencies <= _SHOWN[1])
    curves = []
    for kind, colour in _KINDS.items():
        run = _of(design, runs, kind)
        kept = run.results["time"] >= run.since
        rate = 1.0 / float(np.median(np.diff(run.results["time"])))
        frequency, densities = signal.welch(
            np.stack([run.results[f"plant.euler.{axis}"][kept] for axis in AXES[:2]]),
            rate,
            nperseg=min(int(_SEGMENT * rate), int(kept.sum())),
            detrend="linear",
        )
        axes.loglog(frequency[1:], _URAD * np.sqrt(densities.sum(axis=0))[1:], color=colour, lw=0.8)
        whole = _URAD * np.sqrt(predicted[kind][:, 0] + predicted[kind][:, 1])
        axes.loglog(design.frequencies, whole, color=colour, lw=4.0, alpha=0.3, label=_NAMES[kind])
        curves.append(whole[seen])
    _hertz(axes, *_SHOWN)
    _decades(axes, curves, 5)
    axes.set_ylabel("µrad/√Hz", labelpad=1)
    axes.legend(loc="lower left")


# --- loops ------------------------------------------------------------------------------------------------------------


def plot_loops(path: Path, design: Any) -> Path:
    """Loop gain, Nyquist's curve, sensitivity, disturbance rejection, margins and delays of a sensor's designs.

    Raises `ResultsError` if the file cannot be written.
    """
    lines = ["Changes that all three loops stand at once, each by its own:"]
    lines += [f"{one.kind} {_stands(float(one.disk.min()))}" for one in design.controllers]

    def draw(figure: Figure) -> None:
        grid = figure.add_gridspec(2, 3, left=0.055, right=0.985, top=0.875, bottom=0.065, hspace=0.32, wspace=0.24)
        inner = grid[0, 0].subgridspec(2, 1, hspace=0.1, height_ratios=(3, 2))
        _bode(figure.add_subplot(inner[0]), figure.add_subplot(inner[1]), design)
        _nyquist(figure.add_subplot(grid[0, 1]), design)
        _sensitivity(figure.add_subplot(grid[0, 2]), design)
        _rejection(figure.add_subplot(grid[1, 0]), design)
        _margin_table(figure.add_subplot(grid[1, 1]), design)
        _delays(figure.add_subplot(grid[1, 2]), design)

    return _picture(path, f"The loops with {_sensor(design)}", ("   ".join(lines),), draw)


def _stands(alpha: float) -> str:
    from .control.margins import gain_of, phase_of

    return f"±{np.degrees(phase_of(alpha)):.0f}° or ±{_decibels(gain_of(alpha))} (disk margin {alpha:.2f})"


def _decibels(factor: float) -> str:
    return "∞" if not 1e-3 < factor < 1e3 else f"{abs(20.0 * np.log10(factor)):.1f} dB"


def _bode(gain: Axes, phase: Axes, design: Any) -> None:
    gain.set_title("Loop gain of pitch at its motor")
    f = design.frequencies
    for one in design.controllers:
        L, margin, colour = one.single[:, _PITCH], one.margins[_PITCH], _KINDS[one.kind]
        label = f"{one.kind}: crossover {margin.crossover:.0f} Hz, {np.degrees(margin.phase):.0f}°"
        gain.loglog(f, np.abs(L), color=colour, label=label)
        gain.plot([margin.crossover], [1.0], "o", ms=5, color=colour)
        angle = np.degrees(np.unwrap(np.angle(L)))
        # whole turns such that it is between -360 and 0 where it matters
        turns = np.ceil(np.interp(margin.crossover, f, angle) / 360.0)
        phase.semilogx(f, angle - 360.0 * turns, color=colour)
    gain.axhline(1.0, color="black", lw=0.7)
    _hertz(gain, 0.1, f[-1])
    _decades(gain, [np.abs(one.single[f >= 0.1, _PITCH]) for one in design.controllers], 5)
    gain.set_xlabel("")
    gain.tick_params(labelbottom=False)
    gain.legend(loc="lower left", handlelength=1.0)
    phase.axhline(-180.0, color="black", lw=0.7)
    phase.set_yticks([-360, -270, -180, -90, 0, 90])
    phase.set_ylim(-380.0, 100.0)
    phase.set_ylabel("phase (°)", labelpad=1)
    _hertz(phase, 0.1, f[-1])


def _nyquist(axes: Axes, design: Any) -> None:
    axes.set_title("Nyquist curves (disc: |S| > 2)")
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.fill(-1.0 + 0.5 * np.cos(turn), 0.5 * np.sin(turn), color="#F0D0D0", lw=0)
    axes.plot([-1.0], [0.0], "+", color="black", ms=9)
    for one in design.controllers:
        for number, style in enumerate(_LINES):
            L = one.single[:, number]
            axes.plot(L.real, L.imag, style, color=_KINDS[one.kind], lw=1.0)
        axes.plot([], [], color=_KINDS[one.kind], label=one.kind)
    for name, style in zip(AXES, _LINES, strict=True):
        axes.plot([], [], style, color=_BLACK, label=name)
    axes.set_aspect("equal")
    axes.set_xlim(-3.0, 1.5)
    axes.set_ylim(-2.2, 1.6)
    # a loop with the margins asked for stays out of the corner above the disc
    axes.legend(loc="upper left", ncols=5, handlelength=1.5, columnspacing=1.0)
    axes.set_xlabel("real part", labelpad=1)
    axes.set_ylabel("imaginary part", labelpad=1)


def _sensitivity(axes: Axes, design: Any) -> None:
    axes.set_title("Sensitivity |S| of pitch; disk margin")
    f, curves = design.frequencies, []
    for one in design.controllers:
        curves.append(np.abs(1.0 / (1.0 + one.single[:, _PITCH])))
        axes.loglog(f, curves[-1], color=_KINDS[one.kind], label=one.kind)
        axes.loglog(f, one.disk, ":", color=_KINDS[one.kind], lw=1.0)
    axes.plot([], [], ":", color=_BLACK, label="disk margin, all loops")
    axes.axhline(1.0, color="black", lw=0.7)
    _hertz(axes, 0.1, f[-1])
    _decades(axes, [curve[f >= 0.1] for curve in curves], 4)
    axes.legend(loc="lower right")


def _rejection(axes: Axes, design: Any) -> None:
    axes.set_title("Pitch by a torque at its joint (µrad per mN·m)")
    f = design.frequencies
    curves = [1e3 * design.free_compliance[:, _PITCH]]
    axes.loglog(f, curves[0], "--", color=_BLACK, label="motors off, friction holds")
    for one in design.controllers:
        curves.append(1e3 * one.compliance[:, _PITCH])
        axes.loglog(f, curves[-1], color=_KINDS[one.kind], label=one.kind)
    _hertz(axes, *_SHOWN)
    _decades(axes, [curve[(f >= _SHOWN[0]) & (f <= _SHOWN[1])] for curve in curves], 5)
    axes.legend(loc="lower left")


def _margin_table(axes: Axes, design: Any) -> None:
    axes.set_title("Margins of each loop, the other two closed")
    axes.axis("off")
    heads = ["", "crossover", "phase", "gain up", "down", "peak |S|"]
    rows = [
        [
            f"{one.kind} {axis}",
            f"{margin.crossover:.0f} Hz",
            f"{np.degrees(margin.phase):.0f}°",
            _decibels(margin.gain_up),
            _decibels(margin.gain_down),
            f"{margin.peak:.2f}",
        ]
        for one in design.controllers
        for axis, margin in zip(AXES, one.margins, strict=True)
    ]
    widths = [0.19, 0.2, 0.13, 0.16, 0.16, 0.16]
    shown = axes.table(
        rows, colLabels=heads, colWidths=widths, loc="upper center", cellLoc="center", edges="horizontal"
    )
    shown.auto_set_font_size(False)
    shown.set_fontsize(9)
    shown.scale(1.0, 1.75)


def _delays(axes: Axes, design: Any) -> None:
    last = design.controllers[-1]
    crossover = last.margins[_PITCH].crossover
    axes.set_title(f"Delays at the {last.kind}'s crossover, {crossover:.0f} Hz")
    delays = [delay for delay in design.delays if abs(np.degrees(delay.phase)) >= _NOTHING]
    total = 0.0
    for place, delay in zip(range(len(delays), 0, -1), delays, strict=True):
        milliseconds = 1e3 * delay.seconds
        axes.barh(place, milliseconds, 0.42, left=total, color=_KINDS["LQG"])
        axes.text(0.0, place + 0.28, delay.part + ("" if milliseconds > 0.0 else " (leads)"), fontsize=8, va="bottom")
        text = f" {milliseconds:.2f} ms, {np.degrees(delay.phase):.0f}°"
        axes.text(max(total, total + milliseconds), place, text, fontsize=8.5, va="center")
        total += milliseconds
    whole, phase = (sum(getattr(delay, what) for delay in design.delays) for what in ("seconds", "phase"))
    axes.barh(0, 1e3 * whole, 0.42, color=_BLACK)
    axes.text(
        1e3 * whole, 0, f" {1e3 * whole:.2f} ms, {np.degrees(phase):.0f}°", fontsize=8.5, va="center", weight="bold"
    )
    axes.text(0.0, 0.28, "together, before the controller", fontsize=8, va="bottom")
    axes.set_yticks([])
    axes.set_ylim(-0.5, len(delays) + 0.7)
    axes.set_xlim(0.0, 1.45e3 * max(whole, *np.cumsum([delay.seconds for delay in delays])))
    axes.set_xlabel("ms", labelpad=1)
    axes.grid(axis="y", visible=False)
