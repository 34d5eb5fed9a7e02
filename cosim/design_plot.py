"""The pictures of `attitude-fmu design`: what the designs reach, and how their loops are made."""

from __future__ import annotations

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
    from matplotlib.figure import Figure

# Okabe and Ito's palette, which colour-blind readers can tell apart
_KINDS = {"held": "#666666", "PID": "#E69F00", "LQG": "#0072B2"}
_CAUSES = ("#56B4E9", "#D55E00", "#CC79A7", "#009E73", "#999999")
_LINES = {"yaw": "#009E73", "pitch": "#0072B2", "roll": "#CC79A7"}
_URAD = 1e6
_TRACE = 6.0
"""s of the line of sight that are shown."""

_SEGMENT = 8.0
"""s of the spectra's segments."""

_PITCH = AXES.index("pitch")


def plot_overview(path: Path, designs: list[Any], runs: list[Any]) -> Path:
    """Jitter predicted and co-simulated, its causes, the line of sight, its spectrum.

    Raises `ResultsError` if the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 8.4), dpi=130)
        held = runs[0].jitter.rms
        best = min(runs, key=lambda run: run.jitter.rms if run.label == designs[0].sensor.label else np.inf)
        figure.text(
            0.012, 0.985, "A camera held still: designed, exported, co-simulated", va="top", fontsize=14, weight="bold"
        )
        line = (
            f"{designs[0].sensor.label}: {_URAD * held:.0f} µrad with the joints held, {_URAD * best.jitter.rms:.0f} µrad "
            f"with the {best.kind}, {held / best.jitter.rms:.1f} times less   ·   motion of the line of sight within "
            f"exposures of {EXPOSURE:g} s"
        )
        figure.text(0.012, 0.945, line, va="top", fontsize=10)
        grid = figure.add_gridspec(2, 2, left=0.062, right=0.985, top=0.875, bottom=0.07, hspace=0.34, wspace=0.18)
        _bars(figure.add_subplot(grid[0, 0]), designs, runs)
        _causes(figure.add_subplot(grid[0, 1]), designs)
        _trace(figure.add_subplot(grid[1, 0]), designs[0], runs)
        _spectrum(figure.add_subplot(grid[1, 1]), designs[0], runs)
        _save(figure, path)
    return path


def _save(figure: Figure, path: Path) -> None:
    with whole_or_not(path) as draft:
        figure.savefig(draft, format="png")


def _size(jitter: Any) -> float:
    return _URAD * float(np.hypot(jitter[0], jitter[1]))


def _bars(axes: Axes, designs: list[Any], runs: list[Any]) -> None:
    axes.set_title("Jitter (µrad): co-simulated, and predicted (◆)")
    found = {(run.label, run.kind): _URAD * run.jitter.rms for run in runs}
    names, place = ["joints held"], 0.0
    bars = [(0.0, "held", found[runs[0].label, "held"], _size(designs[0].held))]
    for design in designs:
        place += 1.4
        names.append(_short(design.sensor.label))
        for shift, one in zip((-0.26, 0.26), design.controllers, strict=True):
            bars.append((place + shift, one.kind, found[design.sensor.label, one.kind], _size(one.jitter)))
    for x, kind, simulated, predicted in bars:
        axes.bar(x, simulated, 0.46, color=_KINDS[kind], zorder=2)
        axes.plot([x], [predicted], "D", ms=7, color="white", mec="black", mew=1.2, zorder=4)
        text = f"{kind if kind != 'held' else ''} {simulated:.3g}".strip()
        axes.annotate(
            text, (x, max(simulated, predicted)), (0, 7), textcoords="offset points", ha="center", fontsize=8.5
        )
    axes.set_yscale("log")
    low = min(min(bar[2:]) for bar in bars)
    axes.set_ylim(0.5 * low, 2.2 * max(max(bar[2:]) for bar in bars))
    axes.set_xticks([0.0, *[1.4 * (k + 1) for k in range(len(designs))]], names)
    axes.grid(axis="x", visible=False)


def _short(label: str) -> str:
    return {"ideal": "ideal sensor"}.get(label, label.replace("_", "\n", 1))


def _causes(axes: Axes, designs: list[Any]) -> None:
    axes.set_title("What makes it, predicted: share of the jitter's square (%)")
    names, places = [], []
    for number, design in enumerate(designs):
        for shift, one in zip((-0.2, 0.2), design.controllers, strict=True):
            x, left = -(number + shift), 0.0
            squares = {cause: _size(value) ** 2 for cause, value in one.causes.items()}
            for (cause, square), colour in zip(squares.items(), _CAUSES, strict=True):
                share = 100.0 * square / sum(squares.values())
                axes.barh(x, share, 0.34, left=left, color=colour, label=cause if not places else None)
                if share > 7.0:
                    axes.text(
                        left + 0.5 * share, x, f"{np.sqrt(square):.3g} µrad", ha="center", va="center", fontsize=8
                    )
                left += share
            names.append(f"{_short(design.sensor.label).splitlines()[0]}, {one.kind}")
            places.append(x)
    axes.set_yticks(places, names)
    axes.set_xlim(0.0, 100.0)
    axes.grid(axis="y", visible=False)
    axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.07), ncols=5, fontsize=8, handlelength=1.0, columnspacing=1.0
    )


def _of(design: Any, runs: list[Any], kind: str) -> Any:
    label = runs[0].label if kind == "held" else design.sensor.label
    return next(run for run in runs if run.label == label and run.kind == kind)


def _trace(axes: Axes, design: Any, runs: list[Any]) -> None:
    axes.set_title(f"Elevation of the line of sight (µrad), {design.sensor.label}, the same wind")
    for kind, colour in _KINDS.items():
        run = _of(design, runs, kind)
        time = run.results["time"]
        shown = (time >= run.since) & (time < run.since + _TRACE)
        angle = run.results["plant.euler.pitch"][shown]
        label = "joints held" if kind == "held" else kind
        axes.plot(time[shown], _URAD * (angle - angle.mean()), color=colour, lw=1.0, label=label)
    axes.set_xlabel("time (s)", labelpad=1)
    axes.margins(x=0.0)
    axes.legend(loc="upper right", ncols=3)


def _spectrum(axes: Axes, design: Any, runs: list[Any]) -> None:
    axes.set_title("Spectrum of the line of sight (µrad/√Hz): co-simulated, and predicted (thick, pale)")
    predicted = {"held": design.held_spectrum, **{one.kind: one.spectrum for one in design.controllers}}
    for kind, colour in _KINDS.items():
        run = _of(design, runs, kind)
        kept = run.results["time"] >= run.since
        rate = 1.0 / float(np.median(np.diff(run.results["time"])))
        densities = [
            signal.welch(run.results[f"plant.euler.{axis}"][kept], rate, nperseg=int(_SEGMENT * rate), detrend="linear")
            for axis in AXES[:2]
        ]
        frequency = densities[0][0][1:]
        total = sum(density for _, density in densities)[1:]
        axes.loglog(frequency, _URAD * np.sqrt(total), color=colour, lw=0.8)
        whole = _URAD * np.sqrt(predicted[kind][:, 0] + predicted[kind][:, 1])
        axes.loglog(
            design.frequencies, whole, color=colour, lw=4.0, alpha=0.3, label="held" if kind == "held" else kind
        )
    axes.set_xlim(0.1, 150.0)
    axes.set_ylim(1e-2, 3e3)
    axes.set_xlabel("frequency (Hz)", labelpad=1)
    axes.legend(loc="lower left")


# --- loops ------------------------------------------------------------------------------------------------------------


def plot_loops(path: Path, design: Any) -> Path:
    """Loop gain, Nyquist's curve, sensitivity, disturbance rejection, margins and delays of a sensor's designs.

    Raises `ResultsError` if the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 8.4), dpi=130)
        figure.text(0.012, 0.985, f"The loops with {design.sensor.label}", va="top", fontsize=14, weight="bold")
        line = "   ·   ".join(
            f"{one.kind}: disk margin {one.disk.min():.2f}, {np.degrees(2 * np.arctan(0.5 * one.disk.min())):.0f}° "
            "in all three loops at once"
            for one in design.controllers
        )
        figure.text(0.012, 0.945, line, va="top", fontsize=10)
        grid = figure.add_gridspec(2, 3, left=0.055, right=0.985, top=0.875, bottom=0.07, hspace=0.34, wspace=0.24)
        inner = grid[0, 0].subgridspec(2, 1, hspace=0.08, height_ratios=(3, 2))
        _bode(figure.add_subplot(inner[0]), figure.add_subplot(inner[1]), design)
        _nyquist(figure.add_subplot(grid[0, 1]), design)
        _sensitivity(figure.add_subplot(grid[0, 2]), design)
        _rejection(figure.add_subplot(grid[1, 0]), design)
        _margin_table(figure.add_subplot(grid[1, 1]), design)
        _delays(figure.add_subplot(grid[1, 2]), design)
        _save(figure, path)
    return path


def _bode(gain: Axes, phase: Axes, design: Any) -> None:
    gain.set_title("Loop gain of pitch at its motor, the others closed")
    f = design.frequencies
    for one in design.controllers:
        L = one.single[:, _PITCH]
        gain.loglog(f, np.abs(L), color=_KINDS[one.kind], label=one.kind)
        phase.semilogx(f, np.degrees(np.unwrap(np.angle(L))) % 360.0 - 360.0, ".", ms=1.5, color=_KINDS[one.kind])
        margin = one.margins[_PITCH]
        gain.plot([margin.crossover], [1.0], "o", ms=5, color=_KINDS[one.kind])
        text = f"{one.kind}: {margin.crossover:.0f} Hz, {np.degrees(margin.phase):.0f}°"
        gain.annotate(
            text,
            (margin.crossover, 1.0),
            (-8, 4 if one.kind == "LQG" else -14),
            textcoords="offset points",
            fontsize=8,
            ha="right",
            color=_KINDS[one.kind],
        )
    gain.axhline(1.0, color="black", lw=0.7)
    gain.set_ylim(1e-2, 1e4)
    gain.tick_params(labelbottom=False)
    phase.axhline(-180.0, color="black", lw=0.7)
    phase.set_yticks([-360, -270, -180, -90, 0])
    phase.set_ylabel("deg", labelpad=1)
    for axes in (gain, phase):
        axes.set_xlim(0.1, f[-1])
    phase.set_xlabel("frequency (Hz)", labelpad=1)


def _nyquist(axes: Axes, design: Any) -> None:
    axes.set_title("Nyquist, all motors (circle: |S| = 2)")
    turn = np.linspace(0.0, 2.0 * np.pi, 200)
    axes.fill(-1.0 + 0.5 * np.cos(turn), 0.5 * np.sin(turn), color="#F0D0D0", lw=0)
    axes.plot([-1.0], [0.0], "+", color="black", ms=9)
    for one in design.controllers:
        for number, _ in enumerate(AXES):
            L = one.single[:, number]
            style = ("--", "-", ":")[number]
            axes.plot(L.real, L.imag, style, color=_KINDS[one.kind], lw=1.0, label=f"{one.kind} {AXES[number]}")
    axes.set_xlim(-3.2, 1.2)
    axes.set_ylim(-2.4, 2.4)
    axes.legend(loc="lower left", ncols=2, fontsize=7.5)


def _sensitivity(axes: Axes, design: Any) -> None:
    axes.set_title("Sensitivity |S| of pitch, and disk margin (dotted)")
    for one in design.controllers:
        axes.loglog(
            design.frequencies, np.abs(1.0 / (1.0 + one.single[:, _PITCH])), color=_KINDS[one.kind], label=one.kind
        )
        axes.loglog(design.frequencies, one.disk, ":", color=_KINDS[one.kind], lw=1.0)
    axes.axhline(1.0, color="black", lw=0.7)
    axes.set_xlim(0.1, design.frequencies[-1])
    axes.set_ylim(1e-4, 5.0)
    axes.set_xlabel("frequency (Hz)", labelpad=1)
    axes.legend(loc="lower right")


def _rejection(axes: Axes, design: Any) -> None:
    axes.set_title("Line of sight by disturbing torque, pitch (µrad per mN·m)")
    f = design.frequencies
    axes.loglog(f, 1e3 * design.held_compliance[:, _PITCH], color=_KINDS["held"], label="motors off")
    for one in design.controllers:
        axes.loglog(f, 1e3 * one.compliance[:, _PITCH], color=_KINDS[one.kind], label=one.kind)
    axes.set_xlim(0.1, f[-1])
    axes.set_ylim(1e-2, 1e4)
    axes.set_xlabel("frequency (Hz)", labelpad=1)
    axes.legend(loc="upper right")


def _margin_table(axes: Axes, design: Any) -> None:
    axes.set_title("Margins of each loop, the others closed")
    axes.axis("off")
    heads = ["", "crossover", "phase", "gain up", "gain down", "peak |S|"]
    rows = []
    for one in design.controllers:
        for axis, margin in zip(AXES, one.margins, strict=True):
            up = "∞" if np.isinf(margin.gain_up) else f"{20 * np.log10(margin.gain_up):.1f} dB"
            down = "∞" if margin.gain_down < 1e-3 else f"{-20 * np.log10(margin.gain_down):.1f} dB"
            phase = f"{np.degrees(margin.phase):.0f}°"
            rows.append([f"{one.kind} {axis}", f"{margin.crossover:.0f} Hz", phase, up, down, f"{margin.peak:.2f}"])
    shown = axes.table(rows, colLabels=heads, loc="upper center", cellLoc="center", edges="horizontal")
    shown.auto_set_font_size(False)
    shown.set_fontsize(9)
    shown.scale(1.0, 1.75)


def _delays(axes: Axes, design: Any) -> None:
    crossover = design.controllers[-1].margins[_PITCH].crossover
    axes.set_title(f"Delays of the gyro's way at {crossover:.0f} Hz, the LQG's crossover")
    total, places = 0.0, range(len(design.delays), 0, -1)
    for place, delay in zip(places, design.delays, strict=True):
        milliseconds = 1e3 * delay.seconds
        axes.barh(
            place,
            milliseconds,
            0.42,
            left=min(total, total + milliseconds) if milliseconds >= 0 else total,
            color="#0072B2",
        )
        axes.text(0.0, place + 0.28, delay.part, fontsize=8, va="bottom")
        text = f" {milliseconds:.2f} ms, {np.degrees(delay.phase):.0f}°"
        axes.text(max(total, total + milliseconds), place, text, fontsize=8.5, va="center")
        total += milliseconds
    phase = sum(np.degrees(delay.phase) for delay in design.delays)
    axes.barh(0, total, 0.42, color="#333333")
    axes.text(total, 0, f" {total:.2f} ms, {phase:.0f}°", fontsize=8.5, va="center", weight="bold")
    axes.text(0.0, 0.28, "together", fontsize=8, va="bottom")
    axes.set_yticks([])
    axes.set_ylim(-0.5, len(design.delays) + 0.7)
    axes.set_xlim(0.0, 1.45 * total)
    axes.set_xlabel("ms", labelpad=1)
    axes.grid(axis="y", visible=False)
