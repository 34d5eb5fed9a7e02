"""What a run shows in numbers: the sensor's errors, the jitter of the line of sight, how fast it ran.

The line of sight is the body's forward axis: azimuth is yaw, elevation is pitch.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .interface import Interface
from .recording import Results
from .system import Port, System

AXES = ("yaw", "pitch", "roll")
EXPOSURE = 1.0
"""s, the window about whose mean jitter is counted: one long exposure."""
SETTLING = 2.0
"""s from the end of the alignment until the stabilised head is taken as settled."""

COARSEST = 0.010
"""s between records, beyond which jitter would be missed."""

_UNALIGNED = "The sensor did not finish its alignment before the end: no errors to show."

Signal = NDArray[np.float64]


class Roles(NamedTuple):
    """Which component of a system plays which part; None where none does."""

    truth: str | None
    sensor: str | None
    controller: str | None


class AngleError(NamedTuple):
    """A sensor's error in one angle (rad)."""

    axis: str
    rms: float
    largest: float


class Jitter(NamedTuple):
    """Motion of the line of sight (rad).

    Within exposures: rms over all of them, and rms of the worst one. Over them all: `wander`, the rms about the mean
    direction of the whole time, and `furthest` from it.
    """

    rms: float
    worst: float
    exposures: int
    wander: float
    furthest: float


class Spread(NamedTuple):
    """The values that one recorded variable took."""

    name: str
    unit: str
    smallest: float
    mean: float
    largest: float
    rms: float


class Report(NamedTuple):
    """The numbers of one run. Times in s, angles in rad.

    `real_time_factor` is simulated over wall-clock time, `no_jitter` says why there is none.
    """

    duration: float
    aligned: float | None
    errors: tuple[AngleError, ...]
    jitter: Jitter | None
    jitter_loop_off: Jitter | None
    spreads: tuple[Spread, ...]
    real_time_factor: float
    no_jitter: str = ""


def roles_of(system: System, interfaces: Mapping[str, Interface]) -> Roles:
    """Find the parts by their variables.

    The sensor tells angles and `aligned`, the truth tells angles and feeds the sensor, the controller can hold joints.
    """
    angled = [name for name, interface in interfaces.items() if _outputs(interface, "euler.yaw")]
    sensor = next((name for name in angled if _outputs(interfaces[name], "aligned")), None)
    feeding = {wire.source.component for wire in system.connections if wire.target.component == sensor}
    truth = next((name for name in angled if name in feeding and name != sensor), None)
    controller = next((name for name, interface in interfaces.items() if _holds_joints(interface)), None)
    return Roles(truth, sensor, controller)


def _outputs(interface: Interface, name: str) -> bool:
    variable = interface.variables.get(name)
    return variable is not None and variable.causality == "output"


def _holds_joints(interface: Interface) -> bool:
    mode = interface.variables.get("mode")
    return mode is not None and mode.settable and any(item.name == "hold_joints" for item in mode.items)


def wrapped(angle: Signal) -> Signal:
    """The same angle from -pi up to pi."""
    return np.asarray((angle + np.pi) % (2.0 * np.pi) - np.pi, np.float64)


def aligned_at(results: Results, sensor: str) -> float | None:
    """Time (s) of the first record with a valid attitude, None if there is none."""
    valid = np.flatnonzero(results[f"{sensor}.aligned"])
    return float(results["time"][valid[0]]) if len(valid) else None


def angle_errors(results: Results, sensor: str, truth: str | Sequence[float], since: float) -> dict[str, Signal]:
    """Sensor minus truth (rad) of yaw, pitch and roll from the time `since` (s) on, the short way round.

    `truth` is a component, or the true yaw, pitch and roll (rad) where they do not change.
    """
    kept = results[results["time"] >= since - 1e-9]
    errors = {}
    for number, axis in enumerate(AXES):
        true = kept[f"{truth}.euler.{axis}"] if isinstance(truth, str) else truth[number]
        errors[axis] = wrapped(kept[f"{sensor}.euler.{axis}"] - true)
    return errors


def line_of_sight(results: Results, truth: str) -> tuple[Signal, Signal]:
    """Azimuth and elevation (rad) of the forward axis."""
    return np.unwrap(results[f"{truth}.euler.yaw"]), np.asarray(results[f"{truth}.euler.pitch"], np.float64)


def jitter(results: Results, truth: str, since: float) -> Jitter | None:
    """Jitter from the time `since` (s) on, None if no whole exposure fits or records lie too far apart.

    In each exposure of 1 s, the rms of sqrt(d_el^2 + (cos(el) d_az)^2) about the exposure's own mean direction.
    """
    time = results["time"]
    azimuth, elevation = line_of_sight(results, truth)
    number = np.floor((time - since + 1e-9) / EXPOSURE).astype(int)
    whole = int(np.floor((float(time[-1]) - since + 1e-9) / EXPOSURE))
    if whole < 1 or _interval(results) > COARSEST:
        return None
    squares = [np.mean(_square_about_mean(azimuth, elevation, number == exposure)) for exposure in range(whole)]
    away = _square_about_mean(azimuth, elevation, (number >= 0) & (number < whole))
    return Jitter(
        float(np.sqrt(np.mean(squares))),
        float(np.sqrt(np.max(squares))),
        whole,
        float(np.sqrt(np.mean(away))),
        float(np.sqrt(np.max(away))),
    )


def _interval(results: Results) -> float:
    times = results["time"]
    # to the microsecond: times are rounded
    return float(np.round(np.median(np.diff(times)), 6)) if len(times) > 1 else 0.0


def _square_about_mean(azimuth: Signal, elevation: Signal, inside: NDArray[np.bool_]) -> Signal:
    up = elevation[inside] - np.mean(elevation[inside])
    across = np.cos(elevation[inside]) * (azimuth[inside] - np.mean(azimuth[inside]))
    return np.asarray(up**2 + across**2, np.float64)


def spreads(results: Results, interfaces: Mapping[str, Interface]) -> tuple[Spread, ...]:
    """Smallest, mean, largest and rms value of every recorded variable."""
    units = {
        str(Port(component, variable.name)): variable.unit or ""
        for component, interface in interfaces.items()
        for variable in interface.variables.values()
    }
    found = []
    for name in (results.dtype.names or ())[1:]:
        values = np.asarray(results[name], np.float64)
        rms = float(np.sqrt(np.mean(values**2)))
        least, mean, largest = (float(f(values)) for f in (np.min, np.mean, np.max))
        found.append(Spread(name, units.get(name, ""), least, mean, largest, rms))
    return tuple(found)


def report(
    results: Results,
    elapsed: float,
    roles: Roles,
    interfaces: Mapping[str, Interface],
    *,
    attitude: Sequence[float] | None = None,
    loop_off: Results | None = None,
) -> Report:
    """The numbers of a run of `elapsed` seconds of wall-clock time, as far as its variables were recorded.

    `attitude` is the true attitude where no component tells it, `loop_off` the same run with the joints held.
    """
    duration = float(results["time"][-1] - results["time"][0])
    names = set(results.dtype.names or ())
    truth, sensor = roles.truth, roles.sensor
    told = truth is not None and _recorded(names, truth)
    aligned = aligned_at(results, sensor) if sensor and f"{sensor}.aligned" in names else None
    if aligned is not None and aligned >= results["time"][-1]:
        # a single record is no error to speak of
        aligned = None
    unaligned = f"{sensor}.aligned" in names and aligned is None
    errors: tuple[AngleError, ...] = ()
    true = truth if told else attitude
    if sensor and aligned is not None and true is not None and _recorded(names, sensor):
        errors = tuple(
            AngleError(axis, float(np.sqrt(np.mean(error**2))), float(np.max(np.abs(error))))
            for axis, error in angle_errors(results, sensor, true, aligned).items()
        )
    steady = None if aligned is None else aligned + SETTLING
    stabilised = held = None
    if truth is not None and told and steady is not None:
        stabilised = jitter(results, truth, steady)
        held = None if loop_off is None else jitter(loop_off, truth, steady)
    return Report(
        duration,
        aligned,
        errors,
        stabilised,
        held,
        () if errors or stabilised or (told and unaligned) else spreads(results, interfaces),
        duration / elapsed if elapsed > 0.0 else np.inf,
        _why_no_jitter(results) if told and steady is not None and stabilised is None else "",
    )


def _why_no_jitter(results: Results) -> str:
    interval = _interval(results)
    if interval > COARSEST:
        return f"Recorded too coarsely for jitter: every {interval:g} s; {COARSEST:g} s or less is wanted."
    return f"No jitter: it wants {SETTLING + EXPOSURE:g} s after the alignment."


def _recorded(names: set[str], component: str) -> bool:
    return all(f"{component}.euler.{axis}" in names for axis in AXES)


def table(numbers: Report, title: str, *, loop: bool = True) -> Any:
    """The report as a rich table; `loop` says whether a loop was closed in the run."""
    from rich.table import Table

    if numbers.spreads:
        return _spread_table(numbers, title)
    shown = Table(title=title, title_style="bold", caption=_caption(numbers), caption_justify="left")
    shown.add_column("")
    shown.add_column("rms", justify="right")
    shown.add_column("largest", justify="right")
    shown.add_column("", style="dim")
    for error in numbers.errors:
        values = (f"{np.degrees(error.rms):.4f}", f"{np.degrees(error.largest):.4f}")
        shown.add_row(f"sensor error, {error.axis}", *values, "deg")
    shown.add_section()
    for name, of in (("jitter", _jitter_of), ("wander", _wander_of)):
        for state, value in ((", loop on" if loop else "", numbers.jitter), (", loop off", numbers.jitter_loop_off)):
            if value is not None:
                rms, largest = of(value)
                shown.add_row(f"line-of-sight {name}{state}", f"{1e6 * rms:.1f}", f"{1e6 * largest:.1f}", "µrad")
    shown.add_section()
    shown.add_row("real-time factor", f"{numbers.real_time_factor:.2f}", "", "simulated / wall clock")
    return shown


def _jitter_of(value: Jitter) -> tuple[float, float]:
    return value.rms, value.worst


def _wander_of(value: Jitter) -> tuple[float, float]:
    return value.wander, value.furthest


def _caption(numbers: Report) -> str:
    lines = []
    if numbers.aligned is None:
        lines.append(_UNALIGNED)
    elif numbers.errors:
        lines.append(f"Error: sensor minus truth, {numbers.aligned:g} s (end of alignment) to {numbers.duration:g} s.")
    if numbers.jitter is not None and numbers.aligned is not None:
        exposures = numbers.jitter.exposures
        count = f"{exposures} exposure{'s' if exposures > 1 else ''}"
        lines.append(
            f"Jitter: rms angle about the mean of each {EXPOSURE:g} s exposure, {count} "
            f"from {numbers.aligned + SETTLING:g} s on; largest: the worst exposure.\n"
            "Wander: rms angle about the mean of that whole time; largest: the furthest from it."
        )
        if numbers.jitter_loop_off is not None:
            lines.append("Loop off: the same run with the joints held, as on a plain head.")
    elif numbers.no_jitter:
        lines.append(numbers.no_jitter)
    return "\n".join(lines)


def _spread_table(numbers: Report, title: str) -> Any:
    from rich.table import Table

    caption = f"{numbers.duration:g} s, real-time factor {numbers.real_time_factor:.2f}"
    if numbers.aligned is None and any(spread.name.endswith(".aligned") for spread in numbers.spreads):
        caption += f"\n{_UNALIGNED}"
    shown = Table(title=title, title_style="bold", caption=caption, caption_justify="left")
    shown.add_column("variable", overflow="fold", ratio=1)
    for heading in ("smallest", "mean", "largest", "rms"):
        shown.add_column(heading, justify="right", no_wrap=True)
    shown.add_column("unit", style="dim", no_wrap=True)
    for spread in numbers.spreads:
        values = (spread.smallest, spread.mean, spread.largest, spread.rms)
        shown.add_row(spread.name, *[f"{value:.4g}" for value in values], spread.unit)
    return shown
