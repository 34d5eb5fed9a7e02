"""The picture of a run.

For the gimbal: the line of sight with the loop on and off, the sensor's errors, what disturbs and what drives; for
any other system its recorded variables.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from .interface import Interface
from .recording import Results
from .report import AXES, EXPOSURE, SETTLING, Report, Roles, Signal, angle_errors, line_of_sight
from .workspace import whole_or_not

# matplotlib is imported where a picture is made: most commands need none
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, which colour-blind readers can tell apart
_ON, _OFF = "#0072B2", "#D55E00"
_AXIS_COLOURS = {"yaw": "#009E73", "pitch": "#CC79A7", "roll": "#56B4E9"}
_INK = "#333333"
_MOST_VARIABLES = 12
_SEGMENT = 4.0
"""s, length of the pieces that the spectrum averages over."""

STYLE: Any = {
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.edgecolor": _INK,
    "axes.labelcolor": _INK,
    "xtick.color": _INK,
    "ytick.color": _INK,
    "text.color": _INK,
    "axes.grid": True,
    "grid.color": "#E3E3E3",
    "grid.linewidth": 0.6,
    "lines.linewidth": 0.8,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}


class Picture(NamedTuple):
    """What to draw: `lines` under the title say how the system was run.

    `attitude` is the true attitude (rad) where no component tells it, `loop_off` the same run with the joints held.
    """

    title: str
    lines: tuple[str, ...]
    results: Results
    roles: Roles
    numbers: Report
    interfaces: Mapping[str, Interface]
    attitude: Sequence[float] | None = None
    loop_off: Results | None = None


def plot(path: Path, picture: Picture) -> Path:
    """Draw a run into a PNG file.

    Raises `ResultsError` if the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    numbers = picture.numbers
    with mpl.rc_context(STYLE):
        if numbers.jitter is not None and picture.roles.truth is not None and numbers.aligned is not None:
            figure = Figure(figsize=(12.0, 9.0), dpi=150)
            _gimbal(figure, picture)
        else:
            figure = Figure(dpi=150)
            _variables(figure, picture)
        with whole_or_not(path) as draft:
            figure.savefig(draft, format="png")
    return path


# --- the gimbal ----------------------------------------------------------------------------------------------------


class _Sight:
    """The line of sight from the time `since` on, in microradians: across (azimuth on the sky) and up."""

    def __init__(self, results: Results, truth: str, since: float, label: str, colour: str) -> None:
        self.label, self.colour = label, colour
        kept = results[results["time"] >= since - 1e-9]
        azimuth, elevation = line_of_sight(kept, truth)
        self.time: Signal = kept["time"]
        self.across: Signal = 1e6 * np.cos(elevation) * (azimuth - np.mean(azimuth))
        self.up: Signal = 1e6 * (elevation - np.mean(elevation))
        self.exposure = np.floor((self.time - since + 1e-9) / EXPOSURE).astype(int)
        self.exposures = int(np.floor((float(self.time[-1]) - since + 1e-9) / EXPOSURE))

    def within(self, signal: Signal) -> Signal:
        """The signal about its mean in each exposure, NaN between them so that no line joins two."""
        out = np.full_like(signal, np.nan)
        for number in range(self.exposures):
            inside = np.flatnonzero(self.exposure == number)
            out[inside] = signal[inside] - np.mean(signal[inside])
            out[inside[0]] = np.nan
        return out

    def jitter(self) -> tuple[Signal, Signal]:
        """Start and rms of each exposure."""
        across, up = self.within(self.across), self.within(self.up)
        inside = [self.exposure == number for number in range(self.exposures)]
        rms = [float(np.sqrt(np.nanmean(across[part] ** 2 + up[part] ** 2))) for part in inside]
        return np.array([self.time[part][0] for part in inside]), np.array(rms)

    def spectrum(self) -> tuple[Signal, Signal]:
        """Frequency (Hz) and one-sided amplitude density (urad/Hz^0.5) of both directions together, by Welch."""
        rate = 1.0 / float(np.median(np.diff(self.time)))
        size = min(int(_SEGMENT * rate), len(self.time))
        window = np.hanning(size)
        density = np.zeros(size // 2 + 1)
        starts = range(0, len(self.time) - size + 1, max(1, size // 2))
        for signal in (self.across, self.up):
            for start in starts:
                piece = signal[start : start + size]
                transform = np.fft.rfft(window * (piece - np.mean(piece)))
                density += 2.0 * np.abs(transform) ** 2 / (rate * np.sum(window**2)) / len(starts)
        # the window's own width hides the lowest two
        return np.asarray(np.fft.rfftfreq(size, 1.0 / rate)[2:]), np.sqrt(density[2:])


def _gimbal(figure: Figure, picture: Picture) -> None:
    _, lines, results, roles, numbers, _, _, loop_off = picture
    assert roles.truth is not None
    assert numbers.aligned is not None
    since = numbers.aligned + SETTLING
    sights = [_Sight(results, roles.truth, since, "loop on" if loop_off is not None else "line of sight", _ON)]
    if loop_off is not None:
        sights.insert(0, _Sight(loop_off, roles.truth, since, "loop off", _OFF))
    top = _headings(figure, picture.title, [*lines, _facts(numbers)])
    left = figure.add_gridspec(5, 1, left=0.06, right=0.635, top=top, bottom=0.06, hspace=0.5)
    first = figure.add_subplot(left[0])
    rows = [first, *[figure.add_subplot(left[row], sharex=first) for row in range(1, 5)]]
    _sight_over_time(rows[0], "Line of sight, azimuth about the mean of each exposure", sights, "across")
    _sight_over_time(rows[1], "Line of sight, elevation about the mean of each exposure", sights, "up")
    _sensor_errors(rows[2], results, roles, numbers)
    _torques(rows[3], results, roles)
    _wind(rows[4], results, roles)
    for row in rows[:-1]:
        row.tick_params(labelbottom=False)
    rows[-1].set_xlabel("time (s)")
    rows[0].set_xlim(float(results["time"][0]), float(results["time"][-1]))
    figure.align_ylabels(rows)
    for row in rows:
        row.axvspan(float(results["time"][0]), numbers.aligned, color="#EFEFEF", lw=0, zorder=0)
    right = figure.add_gridspec(
        3, 1, left=0.7, right=0.985, top=top, bottom=0.06, hspace=0.36, height_ratios=(2.4, 1.5, 0.9)
    )
    _blur(figure.add_subplot(right[0]), sights)
    _spectra(figure.add_subplot(right[1]), sights)
    _jitters(figure.add_subplot(right[2]), sights)


def _headings(figure: Figure, title: str, lines: Sequence[str]) -> float:
    """Title and lines at the top; gives where the panels may begin, as a part of the figure's height."""
    height = float(figure.get_figheight())
    shown = [line for line in lines if line]
    figure.text(0.012, 1.0 - 0.12 / height, title, ha="left", va="top", fontsize=13, fontweight="bold")
    figure.text(0.012, 1.0 - 0.42 / height, "\n".join(shown), ha="left", va="top", fontsize=9.5, linespacing=1.35)
    return 1.0 - (0.78 + 0.2 * len(shown)) / height


def _facts(numbers: Report) -> str:
    assert numbers.jitter is not None
    parts = [f"line-of-sight jitter {1e6 * numbers.jitter.rms:.0f} µrad rms in {EXPOSURE:g} s exposures"]
    if numbers.jitter_loop_off is not None:
        parts[0] += f", {1e6 * numbers.jitter_loop_off.rms:.0f} µrad with the loop off"
    if numbers.errors:
        worst = ", ".join(f"{error.axis} {np.degrees(error.rms):.3g}" for error in numbers.errors)
        parts.append(f"sensor error rms (deg): {worst}")
    return "   ·   ".join(parts)


def _sight_over_time(axes: Axes, title: str, sights: list[_Sight], name: str) -> None:
    axes.set_title(title)
    largest = 1e-3
    for sight in sights:
        values = sight.within(getattr(sight, name))
        largest = max(largest, float(np.nanmax(np.abs(values))))
        axes.plot(sight.time, values, color=sight.colour, label=sight.label, lw=0.6, alpha=0.9)
    axes.set_ylim(-1.05 * largest, 1.05 * largest)
    axes.set_ylabel("µrad")
    if name == "across" and len(sights) > 1:
        _legend(axes)


def _legend(axes: Axes) -> None:
    legend = axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=3, borderaxespad=0.1, handlelength=1.2)
    for line in legend.get_lines():
        line.set_linewidth(2.0)
        line.set_alpha(1.0)


def _sensor_errors(axes: Axes, results: Results, roles: Roles, numbers: Report) -> None:
    axes.set_title("Sensor error")
    assert roles.truth is not None
    if roles.sensor is None or numbers.aligned is None:
        return
    errors = angle_errors(results, roles.sensor, roles.truth, float(results["time"][0]))
    valid = results["time"] >= numbers.aligned
    for axis, error in errors.items():
        axes.plot(results["time"], np.degrees(error), color=_AXIS_COLOURS[axis], label=axis)
    # the first moments of the alignment would dwarf the rest
    low, high = (float(np.degrees(f([f(error[valid]) for error in errors.values()]))) for f in (np.min, np.max))
    margin = 0.25 * max(high - low, 1e-6)
    axes.set_ylim(low - margin, high + margin)
    axes.set_ylabel("deg")
    axes.text(numbers.aligned, 0.04, " ← alignment", transform=axes.get_xaxis_transform(), fontsize=8, va="bottom")
    _legend(axes)


def _torques(axes: Axes, results: Results, roles: Roles) -> None:
    axes.set_title("Motor torque")
    axes.set_ylabel("mN·m")
    names = set(results.dtype.names or ())
    found = [axis for axis in AXES if f"{roles.controller}.motor_torque.{axis}" in names]
    for axis in found:
        torque = 1e3 * results[f"{roles.controller}.motor_torque.{axis}"]
        axes.plot(results["time"], torque, color=_AXIS_COLOURS[axis], label=axis)
    if not found:
        _say(axes, "not recorded")


def _wind(axes: Axes, results: Results, roles: Roles) -> None:
    axes.set_title("Wind at the camera")
    axes.set_ylabel("m/s")
    name = f"{roles.truth}.wind_speed"
    if name in (results.dtype.names or ()):
        axes.plot(results["time"], results[name], color=_INK)
        axes.set_ylim(bottom=min(0.0, float(np.min(results[name]))))
    else:
        _say(axes, "not recorded")


def _say(axes: Axes, text: str) -> None:
    axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", va="center", color="#888888")


def _blur(axes: Axes, sights: list[_Sight]) -> None:
    axes.set_title("Blur: the line of sight in all exposures")
    # the wide one below, so that the narrow one shows
    for sight in sorted(sights, key=lambda sight: -float(np.mean(sight.jitter()[1]))):
        across, up = sight.within(sight.across), sight.within(sight.up)
        thin = max(1, len(across) // 8000)
        axes.plot(across[::thin], up[::thin], ".", ms=1.4, mew=0, alpha=0.35, color=sight.colour)
    largest = max(
        float(np.nanpercentile(np.abs(sight.within(signal)), 99.8))
        for sight in sights
        for signal in (sight.across, sight.up)
    )
    axes.set_xlim(-1.1 * largest, 1.1 * largest)
    axes.set_ylim(-1.1 * largest, 1.1 * largest)
    axes.set_aspect("equal", adjustable="box", anchor="NW")
    axes.locator_params(nbins=5)
    axes.set_xlabel("azimuth (µrad)", labelpad=1)
    axes.set_ylabel("elevation (µrad)", labelpad=1)
    for sight, place, side in zip(sights, (0.02, 0.98), ("left", "right"), strict=False):
        rms = float(np.sqrt(np.mean(sight.jitter()[1] ** 2)))
        text = f"{sight.label}\n{rms:.0f} µrad rms"
        axes.text(place, 0.98, text, transform=axes.transAxes, color=sight.colour, fontweight="bold", va="top", ha=side)


def _spectra(axes: Axes, sights: list[_Sight]) -> None:
    axes.set_title("Line of sight, spectrum (µrad/√Hz)")
    for sight in sights:
        frequency, density = sight.spectrum()
        axes.loglog(frequency, np.maximum(density, 1e-6), color=sight.colour, label=sight.label, lw=1.0)
    largest = max(float(np.max(line.get_ydata())) for line in axes.get_lines())
    axes.set_ylim(1e-5 * largest, 2.0 * largest)
    axes.set_xlabel("frequency (Hz)", labelpad=1)


def _jitters(axes: Axes, sights: list[_Sight]) -> None:
    axes.set_title("Jitter of each exposure (µrad rms)")
    for sight in sights:
        start, rms = sight.jitter()
        axes.stairs(rms, [*start, start[-1] + EXPOSURE], color=sight.colour, lw=1.4, baseline=None)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("time (s)")


# --- any other system ----------------------------------------------------------------------------------------------


def _variables(figure: Figure, picture: Picture) -> None:
    """One row for each group of variables: a vector or the angles share one."""
    title, heading_lines, results, roles, numbers, interfaces, attitude, _ = picture
    panels = _panels(results, interfaces)
    if roles.sensor is not None and numbers.errors and numbers.aligned is not None:
        true = roles.truth or attitude
        assert true is not None
        errors = angle_errors(results, roles.sensor, true, float(results["time"][0]))
        angles = {axis: np.degrees(error) for axis, error in errors.items()}
        panels = {"sensor error (deg)": angles, **panels}
    panels = dict(list(panels.items())[:_MOST_VARIABLES])
    rows = max(1, -(-len(panels) // 2))
    height = 1.5 + 1.7 * rows
    figure.set_size_inches(12.0, height)
    top = _headings(figure, title, heading_lines)
    grid = figure.add_gridspec(rows, 2, left=0.065, right=0.985, top=top, bottom=0.5 / height, hspace=0.5, wspace=0.15)
    for number, (name, lines) in enumerate(panels.items()):
        axes = figure.add_subplot(grid[number // 2, number % 2])
        axes.set_title(name)
        colours = [*_AXIS_COLOURS.values(), _INK]
        for place, (label, values) in enumerate(lines.items()):
            axes.plot(results["time"], values, color=colours[place % len(colours)], label=label)
        if len(lines) > 1:
            _legend(axes)
        if number >= len(panels) - 2:
            axes.set_xlabel("time (s)")
        if numbers.aligned is not None:
            axes.axvspan(float(results["time"][0]), numbers.aligned, color="#EFEFEF", lw=0, zorder=0)


def _panels(results: Results, interfaces: Mapping[str, Interface]) -> dict[str, dict[str, Signal]]:
    panels: dict[str, dict[str, Signal]] = {}
    for full in (results.dtype.names or ())[1:]:
        owner = next((component for component in interfaces if full.startswith(component + ".")), "")
        variable = interfaces[owner].variables.get(full[len(owner) + 1 :]) if owner else None
        unit = f" ({variable.unit})" if variable is not None and variable.unit not in (None, "1") else ""
        stem, label = _group(full)
        panels.setdefault(stem + unit, {})[label] = np.asarray(results[full], np.float64)
    return panels


def _group(name: str) -> tuple[str, str]:
    """The panel that a variable belongs to and its label there."""
    if name.endswith("]"):
        stem, _, element = name[:-1].rpartition("[")
        return stem, element
    stem, _, last = name.rpartition(".")
    return (stem, last) if last in AXES else (name, last)
