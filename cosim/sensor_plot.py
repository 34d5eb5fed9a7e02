"""The pictures of `attitude-fmu sensor`: six panels for each part, what was measured beside what the sheets say."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from attitude_fmu.models.sensors import bias_instability
from attitude_fmu.models.sensors.datasheet import UNSURE, Datum, Origin, Tolerance

from .allan import combined, modelled_instability, pooled, rate_random_walk, rounding, white_noise
from .bench import Array
from .characteristics import Part, Response, Sensor
from .filter_claims import HALF_POWER, FilterClaim
from .identification import power_spectrum
from .plot import STYLE
from .sensor_findings import Findings
from .sensor_report import SAME_CLOCK, UNITS, bounds, floor_of, limits_name, shown
from .workspace import whole_or_not

# matplotlib is imported where a picture is made: most commands need none
if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Okabe and Ito's palette, which colour-blind readers can tell apart
_AXES = {"x": "#0072B2", "y": "#009E73", "z": "#CC79A7"}
_MODEL, _SHEET, _THEORY, _REST = "#0072B2", "#D55E00", "#333333", "#B8C4CC"
_MINUS = "\N{MINUS SIGN}"
_SEGMENTS = (8, 64, 1024)
"""Spectra of ever shorter segments are joined: fine at low frequencies, smooth at high ones."""


class Sheet(NamedTuple):
    """What a picture says besides what was measured: the part's name, how it was run, the sheet's numbers, the sum."""

    name: str
    heading: str
    origins: Mapping[str, Origin]
    summary: str


class _Drawn(NamedTuple):
    sensor: Sensor
    found: Findings
    sheet: Sheet

    @property
    def part(self) -> Part:
        return self.found.part

    def modelled(self, name: str) -> float:
        """The value of one of the part's parameters."""
        return self.sensor.number(f"{self.part}.{name}")

    @property
    def density(self) -> float:
        """Of the modelled white noise as the words show it."""
        return self.modelled("noise_density") * self.found.claims.nominal.density_gain

    def datum(self, name: str) -> Datum | None:
        """The sheet's number for it, None where there is none or it is zero for want of one."""
        origin = self.sheet.origins.get(f"{self.part}.{name}")
        return origin if isinstance(origin, Datum) and origin.value != 0.0 else None


def plot_sensor(path: Path, sensor: Sensor, found: Findings, sheet: Sheet) -> Path:
    """Draw one part into a PNG file.

    Raises `ResultsError` if the file cannot be written.
    """
    import matplotlib as mpl
    from matplotlib.figure import Figure

    drawn = _Drawn(sensor, found, sheet)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 8.0), dpi=130)
        _headings(figure, drawn)
        grid = figure.add_gridspec(2, 3, left=0.06, right=0.985, top=0.855, bottom=0.075, hspace=0.36, wspace=0.24)
        _allan(figure.add_subplot(grid[0, 0]), drawn)
        _spectrum(figure.add_subplot(grid[0, 1]), drawn)
        _temperature(figure.add_subplot(grid[0, 2]), drawn)
        _gain(figure.add_subplot(grid[1, 0]), drawn)
        _delay(figure.add_subplot(grid[1, 1]), drawn)
        _step(figure.add_subplot(grid[1, 2]), drawn)
        with whole_or_not(path) as draft:
            figure.savefig(draft, format="png")
    return path


def _headings(figure: Figure, drawn: _Drawn) -> None:
    name = drawn.sheet.name.replace("+-", "±").replace("deg", "°")
    figure.text(0.012, 0.985, f"{name}, as modelled", va="top", fontsize=13, fontweight="bold")
    lines = f"{drawn.sheet.heading}   ·   measured on the FMU   ·   {drawn.part}: {drawn.sheet.summary}"
    figure.text(0.012, 0.949, lines, va="top", fontsize=9.5)
    is_unsure = any(
        origin.confidence in UNSURE
        for name, origin in drawn.sheet.origins.items()
        if name in _drawn_origins(drawn.part)
    )
    legend = "of the datasheet" + ("   (hollow, dotted: unsure, not from the part's own sheet)" if is_unsure else "")
    figure.text(0.0155, 0.925, "◆", va="top", fontsize=9.5, color=_SHEET)
    figure.text(0.0275, 0.925, legend, va="top", fontsize=9.5)


def _drawn_origins(part: Part) -> set[str]:
    """Parameters whose sheet's numbers a picture shows."""
    return {f"{part}.{name}" for name in ("noise_density", "bias_instability", "bias_temperature_slope[1]", "filter")}


def _is_unsure(confidence: str) -> bool:
    return confidence in UNSURE


def _marker(axes: Axes, x: float, y: float, confidence: str, label: str = "") -> None:
    fill = "white" if _is_unsure(confidence) else _SHEET
    axes.plot([x], [y], "D", ms=6, mew=1.4, color=_SHEET, mfc=fill, zorder=6, ls="none", label=label or None)


def _line(axes: Axes, y: float, confidence: str) -> None:
    axes.axhline(y, color=_SHEET, lw=1.1, ls=":" if _is_unsure(confidence) else "--", zorder=5)


# --- noise -----------------------------------------------------------------------------------------------------------


def _allan(axes: Axes, drawn: _Drawn) -> None:
    found = drawn.found
    name, size = UNITS[drawn.part].floor
    axes.set_title(f"Allan deviation, {_duration(found.at_rest.duration)} at rest ({name})")
    parts = found.at_rest.allan()
    for (axis, colour), one in zip(_AXES.items(), parts, strict=True):
        axes.loglog(one.tau, one.deviation / size, color=colour, label=axis, lw=0.8)
    together = pooled(parts)
    axes.fill_between(together.tau, together.low / size, together.high / size, color=_REST, alpha=0.55, lw=0, zorder=1)
    tau = together.tau
    axes.loglog(tau, _theory(tau, drawn) / size, color=_THEORY, lw=1.1, ls=(0, (4, 2)), label="theory", zorder=4)
    density, floor = drawn.datum("noise_density"), drawn.datum("bias_instability")
    if density is not None:
        gain = found.claims.nominal.density_gain
        y = density.si * gain / math.sqrt(2.0) / size
        _marker(axes, 1.0, y, density.confidence)
        text = f"D/√2 at 1 s,\nD = {density.value * gain:.4g} {_plain(density.unit)}"
        _note(axes, 1.0, y, text, (8, 8))
    if floor is not None:
        y = floor_of(floor) / size
        _line(axes, y, floor.confidence)
        axes.text(0.02, y, f"{shown(round(y, 2))} {name}", transform=axes.get_yaxis_transform(), **_over())
    _plain_ticks(axes)
    axes.set_xlabel("cluster time (s)", labelpad=1)
    axes.legend(loc="upper right", ncols=2, handlelength=1.6, columnspacing=1.0)


def _theory(tau: Array, drawn: _Drawn) -> Array:
    """All terms together, at cluster times above what the filter correlates."""
    instability = modelled_instability(
        tau,
        drawn.modelled("bias_instability"),
        bias_instability.TIME_CONSTANTS,
        bias_instability.SIGMA_PER_INSTABILITY,
    )
    total = combined(
        white_noise(tau, drawn.density),
        instability,
        rate_random_walk(tau, drawn.modelled("rate_random_walk")),
        rounding(tau, drawn.modelled("resolution"), 1.0 / drawn.found.at_rest.rate),
    )
    return np.where(tau < 3.0 * drawn.found.claims.nominal.delay, np.nan, total)


def _duration(seconds: float) -> str:
    return f"{seconds / 3600.0:.3g} h" if seconds >= 3600.0 else f"{seconds:.3g} s"


def _plain(unit: str) -> str:
    return unit.replace("rtHz", "√Hz").replace("deg", "°").replace("ug", "µg")


def _over() -> dict[str, Any]:
    return {"va": "bottom", "fontsize": 8, "color": _SHEET}


def _plain_ticks(axes: Axes, *, with_x: bool = True) -> None:
    """1, 2 and 5 of each decade, in plain numbers, where there are few decades."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    low, high = axes.get_ylim()
    is_wide = math.log10(high / low) > 2.5
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0,) if is_wide else (1.0, 2.0, 5.0)))
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.yaxis.set_minor_formatter(NullFormatter())
    if not is_wide:
        axes.yaxis.set_minor_locator(NullLocator())
    if with_x:
        axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def _note(axes: Axes, x: float, y: float, text: str, offset: tuple[float, float]) -> None:
    axes.annotate(text, (x, y), offset, textcoords="offset points", fontsize=8, color=_SHEET, va="bottom")


def _spectrum(axes: Axes, drawn: _Drawn) -> None:
    found = drawn.found
    name, size = UNITS[drawn.part].density
    axes.set_title(f"Noise spectrum ({name})")
    frequency, density = _joined_spectrum(found.at_rest.readings, found.at_rest.rate)
    axes.loglog(frequency, density / size, color=_MODEL, lw=0.9, label="modelled, mean of x, y, z")
    at = np.geomspace(frequency[0], 0.5 * found.at_rest.rate, 300)
    axes.loglog(
        at,
        _spectral_theory(at, drawn) / size,
        color=_THEORY,
        lw=1.1,
        ls=(0, (4, 2)),
        label="theory, through the filter",
    )
    datum = drawn.datum("noise_density")
    if datum is not None:
        gain = found.claims.nominal.density_gain
        y = datum.si * gain / size
        _line(axes, y, datum.confidence)
        text = f"{datum.value * gain:.4g} {_plain(datum.unit)}"
        axes.text(0.98, y, text, transform=axes.get_yaxis_transform(), ha="right", **_over())
    axes.set_ylim(bottom=max(0.03 * float(np.median(density)), 0.3 * float(np.min(density))) / size)
    _plain_ticks(axes)
    axes.set_xlabel("frequency (Hz)", labelpad=1)
    axes.legend(loc="lower left")


def _power_as_read(frequency: Array, found: Findings) -> Array:
    """sum_k P(f + k r) sinc^2((f + k r)/w): share of white noise in words of rate w that are held and read at rate r.

    P repeats with w; the mean of the axes, each of which has a clock of its own.
    """
    rate = found.at_rest.rate
    power = np.zeros(len(frequency))
    for word_rate in found.word_rate:
        for image in range(-20, 21):
            at = np.abs(frequency + image * rate) / word_rate
            folded = np.abs(at - np.round(at)) * rate
            power += np.interp(folded, *found.folded) * np.sinc(at) ** 2
    return power / 3.0


def _joined_spectrum(readings: Array, rate: float) -> tuple[Array, Array]:
    """Amplitude density of the axes' mean power, each decade from segments as long as it wants."""
    pieces: list[tuple[Array, Array]] = []
    top = 0.0
    for segments in (s for s in _SEGMENTS if len(readings) >= 40 * (s + 1)):
        spectra = [power_spectrum(readings[:, axis], rate, segments) for axis in range(3)]
        frequency, power = spectra[0].frequency, np.mean([one.density for one in spectra], axis=0)
        # the lowest lines hold what the window makes of the mean
        kept = frequency > max(top, 2.5 * frequency[1])
        last = 25.0 * frequency[1] if segments != _SEGMENTS[-1] else math.inf
        pieces.append((frequency[kept & (frequency <= last)], power[kept & (frequency <= last)]))
        top = last
    if math.isfinite(top):
        pieces.append((frequency[frequency > top], power[frequency > top]))
    # the last line, at half the rate, has no twin
    pieces[-1] = (pieces[-1][0][:-1], pieces[-1][1][:-1])
    joined = [np.concatenate([piece[i] for piece in pieces]) for i in (0, 1)]
    return joined[0], np.sqrt(joined[1])


def _spectral_theory(frequency: Array, drawn: _Drawn) -> Array:
    """sqrt(P (D^2 + sum 4 sigma^2 T/(1 + (2 pi f T)^2) + 2 K^2/(2 pi f)^2) + q^2/(6 r)): one-sided, as read.

    The register rounds behind the filter, which leaves P of the power of what comes before.
    """
    sigma = drawn.modelled("bias_instability") * bias_instability.SIGMA_PER_INSTABILITY
    turn = 2.0 * np.pi * frequency
    total = np.full(len(frequency), drawn.density**2)
    for constant in bias_instability.TIME_CONSTANTS:
        total += 4.0 * sigma**2 * constant / (1.0 + (turn * constant) ** 2)
    total += 2.0 * drawn.modelled("rate_random_walk") ** 2 / turn**2
    rounded = drawn.modelled("resolution") ** 2 / (6.0 * drawn.found.at_rest.rate)
    return np.asarray(np.sqrt(total * _power_as_read(frequency, drawn.found) + rounded))


# --- temperature -----------------------------------------------------------------------------------------------------


def _temperature(axes: Axes, drawn: _Drawn) -> None:
    drift, (name, size) = drawn.found.drift, UNITS[drawn.part].reading
    axes.set_title(f"Offset by temperature, from that at 25 °C ({name})")
    up = drift.warming
    at_25 = drift.offset[int(np.argmin(np.abs(drift.temperature[up] - 25.0)))]
    away = (drift.offset - at_25) / size
    tolerance = drawn.sheet.origins.get(f"{drawn.part}.bias_temperature_slope[1]")
    if isinstance(tolerance, Tolerance):
        _cone(axes, tolerance, drift.temperature[up], size)
    for number, (axis, colour) in enumerate(_AXES.items()):
        axes.plot(drift.temperature[up], away[up, number], color=colour, label=axis, lw=1.3)
        down = slice(up.stop, None)
        axes.plot(drift.temperature[down], away[down, number], color=colour, lw=1.3, ls=(0, (3, 2)))
    axes.set_xlim(float(drift.temperature.min()), float(drift.temperature.max()))
    is_loop = float(np.max(np.abs(drift.hysteresis))) > 1e-3 * float(np.max(np.abs(drift.offset)))
    axes.set_xlabel(f"ambient temperature (°C){', falling dashed' if is_loop else ''}", labelpad=1)
    axes.legend(loc="upper center", ncols=4, handlelength=1.2, columnspacing=1.0)


def _cone(axes: Axes, tolerance: Tolerance, temperature: Array, size: float) -> None:
    low, high = (bound / size * (temperature - 25.0) for bound in bounds(tolerance))
    unsure = _is_unsure(tolerance.confidence)
    label = f"sheet, {limits_name(tolerance)}"
    axes.fill_between(temperature, low, high, color=_SHEET, alpha=0.1, lw=0, zorder=0, label=label)
    for edge in (low, high):
        axes.plot(temperature, edge, color=_SHEET, lw=0.9, ls=":" if unsure else "--")


# --- responses -------------------------------------------------------------------------------------------------------


class _Curve(NamedTuple):
    """A response to draw, what the sheet says of it at its clock, and what it is called."""

    response: Response
    claim: FilterClaim
    colour: str
    label: str
    axis: str


def _curves(found: Findings) -> list[_Curve]:
    """One for each axis where their clocks differ."""
    if float(np.ptp(found.clocks)) <= SAME_CLOCK:
        label = "modelled, as set" if found.settings else "modelled"
        return [_Curve(found.responses[0], found.claims.x, _MODEL, label, "")]
    triads = zip(found.responses, found.claims.own, _AXES.items(), strict=True)
    return [_Curve(response, claim, colour, axis, f"{axis}: ") for response, claim, (axis, colour) in triads]


def _gain(axes: Axes, drawn: _Drawn) -> None:
    found = drawn.found
    axes.set_title("Frequency response: gain (dB)")
    axes.axhline(HALF_POWER, color=_THEORY, lw=0.6)
    for one in found.settings:
        axes.semilogx(one.responses[0].frequency, one.responses[0].decibels, color=_REST, lw=0.9)
    for curve in _curves(found):
        axes.semilogx(curve.response.frequency, curve.response.decibels, color=curve.colour, lw=1.6, label=curve.label)
    if found.settings:
        axes.plot([], [], color=_REST, lw=0.9, label="every other setting")
    for claim in [one.claims.x for one in found.settings] or [curve.claim for curve in _curves(found)]:
        if math.isfinite(claim.frequency):
            _marker(axes, claim.frequency, claim.decibels, claim.confidence)
    decibels = f"{found.claims.nominal.decibels:.2f} dB"
    told = [f"{decibels} at"]
    for curve in _curves(found):
        measured, claimed = curve.response.frequency_of(curve.claim.decibels), curve.claim.frequency
        if math.isfinite(measured) and math.isfinite(claimed):
            told.append(f"{curve.axis}{shown(measured)} Hz, sheet {shown(claimed)} Hz")
        else:
            told.append(f"{curve.axis}no frequency below half the word rate")
    text = "\n".join(told)
    box: dict[str, Any] = {"facecolor": "white", "edgecolor": "none", "alpha": 0.85, "pad": 1.5}
    text = text.replace("-", _MINUS)
    axes.text(0.03, 0.30, text, transform=axes.transAxes, fontsize=8.5, va="bottom", bbox=box, zorder=7)
    axes.set_ylim(-12.0, 1.0)
    axes.xaxis.set_major_formatter(lambda value, _: f"{value:g}")
    axes.set_xlabel("frequency (Hz)", labelpad=1)
    axes.legend(loc="lower left")


def _delay(axes: Axes, drawn: _Drawn) -> None:
    if drawn.found.settings:
        _delay_by_setting(axes, drawn)
    else:
        _delay_by_frequency(axes, drawn)


def _delay_by_setting(axes: Axes, drawn: _Drawn) -> None:
    settings = drawn.found.settings
    is_rate = settings[0].setting.label.endswith("Hz")
    axes.set_title("Delay by output data rate (ms)" if is_rate else "Delay by taps (ms)")
    places = np.arange(len(settings))
    modelled = np.array([1e3 * one.responses[0].delay for one in settings])
    axes.semilogy(places, modelled, "o-", color=_MODEL, ms=4.5, lw=0.9, label="modelled")
    for place, one in zip(places, settings, strict=True):
        claimed = 1e3 * one.claims.x.delay
        _marker(axes, float(place), claimed, one.claims.nominal.confidence)
        away = 100.0 * (modelled[place] / claimed - 1.0)
        _percent(axes, float(place), max(claimed, modelled[place]), away)
    labels = [one.setting.label.removesuffix(".Hz") for one in settings]
    axes.set_xticks(places, [label.rstrip("0").rstrip(".") if "." in label else label for label in labels], rotation=35)
    axes.tick_params(axis="x", labelsize=8, pad=1)
    axes.set_xlim(-0.6, len(settings) - 0.4)
    axes.set_ylim(top=3.0 * float(np.max(modelled)))
    _plain_ticks(axes, with_x=False)
    axes.set_xlabel("samples a second" if is_rate else "taps", labelpad=1)
    axes.legend(loc="upper left")


def _percent(axes: Axes, x: float, y: float, away: float) -> None:
    if abs(away) < 0.05:
        return
    text = f"{away:+.1f}%".replace("-", _MINUS)
    axes.annotate(text, (x, y), (0, 8), textcoords="offset points", fontsize=7.5, ha="center")


def _delay_by_frequency(axes: Axes, drawn: _Drawn) -> None:
    claim, curves = drawn.found.claims.nominal, _curves(drawn.found)
    axes.set_title("Frequency response: delay (ms)")
    spread = np.zeros(0)
    for curve in curves:
        response = curve.response
        passed = response.decibels > -12.0
        delays = 1e3 * response.delays[passed]
        axes.plot(response.frequency[passed], delays, color=curve.colour, lw=1.6, label=curve.label)
        _line(axes, 1e3 * curve.claim.delay, curve.claim.confidence)
        spread = np.concatenate((spread, delays))
    low, high = claim.delay_limits or (0.9 * claim.delay, 1.1 * claim.delay)
    if claim.delay_limits is not None:
        axes.axhspan(1e3 * low, 1e3 * high, color=_SHEET, alpha=0.1, lw=0, label="sheet, any piece")
    margin = 0.5 * (high - low)
    axes.set_ylim(
        min(1e3 * (low - margin), 0.98 * float(spread.min())), max(1e3 * (high + margin), 1.02 * float(spread.max()))
    )
    text = "\n".join(
        f"{curve.axis}{1e3 * curve.response.delay:.3f} ms, sheet {1e3 * curve.claim.delay:.3f} ms" for curve in curves
    )
    axes.text(0.03, 0.06, text, transform=axes.transAxes, fontsize=8.5, va="bottom")
    axes.set_xlim(left=0.0)
    axes.set_xlabel("frequency (Hz); dashed: sheet, at its clock", labelpad=1)
    axes.legend(loc="upper right", ncols=4, handlelength=1.2, columnspacing=1.0)


def _step(axes: Axes, drawn: _Drawn) -> None:
    step, claim = drawn.found.step, drawn.found.claims.x
    word = 1e3 / float(drawn.found.word_rate[0])
    late = 1e3 * claim.delay
    axes.set_title("Step response of x")
    axes.plot(1e3 * step.time, step.share, ".-", color=_MODEL, ms=4, lw=0.8, label="modelled, several steps overlaid")
    _marker(axes, late, 0.5, claim.confidence)
    _note(axes, late, 0.5, f"delay {late:.4g} ms", (8, -10))
    axes.text(0.97, 0.30, f"a word every {word:.4g} ms", transform=axes.transAxes, fontsize=8.5, ha="right")
    settled = 1e3 * float(step.time[np.flatnonzero(step.share > 0.999)[0]])
    axes.set_xlim(0.0, max(1.25 * settled, 2.2 * late))
    axes.set_ylim(-0.08, 1.12)
    axes.set_xlabel("time since the step (ms)", labelpad=1)
    axes.legend(loc="upper left")
