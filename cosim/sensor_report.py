"""The table of `attitude-fmu sensor`: what the datasheet says, what the modelled part does, whether they agree."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from attitude_fmu.models.attitude.rotations import STANDARD_GRAVITY
from attitude_fmu.models.sensors.adxrs450_sheet import NULL_ACCURACY
from attitude_fmu.models.sensors.datasheet import UNSURE, Choice, Datum, Origin, Tolerance, in_si

from .bench import Array
from .characteristics import PARTS, Codes, Estimate, Part, Setting
from .sensor_findings import Findings, SettingFound
from .sheet_claims import Example
from .workspace import whole_or_not

Origins = Mapping[str, Origin]

_DEGREE = math.pi / 180.0
_G = STANDARD_GRAVITY
_WHITE, _INSTABILITY, _WALK = 0.03, 0.10, 0.10
_CUTOFF, _DELAY = 0.01, 0.02
_RMS, _NONLINEARITY = 0.05, 0.10
_WIDE = 120
"""Columns of a terminal that has room for sources."""

SAME_CLOCK = 5e-4
"""Share of its rate to which a piece's clock is found."""

_NOTHING = 1e-3
"""Of its limits: an error so small is that of a piece without it."""


class Units(NamedTuple):
    """Units that people use for a part's numbers, each with its size in SI."""

    reading: tuple[str, float]
    density: tuple[str, float]
    floor: tuple[str, float]
    walk: tuple[str, float]
    slope: tuple[str, float]


UNITS: dict[Part, Units] = {
    "gyro": Units(
        ("°/s", _DEGREE),
        ("°/s/√Hz", _DEGREE),
        ("°/h", _DEGREE / 3600.0),
        ("°/h/√s", _DEGREE / 3600.0),
        ("°/s/°C", _DEGREE),
    ),
    "accelerometer": Units(
        ("mg", 1e-3 * _G), ("µg/√Hz", 1e-6 * _G), ("µg", 1e-6 * _G), ("µg/√s", 1e-6 * _G), ("mg/°C", 1e-3 * _G)
    ),
}


class Line(NamedTuple):
    """One line of the table. `agrees` is None where there is nothing to agree with, `limits` are those of the verdict
    or of the 95 % interval of what was measured."""

    part: Part
    quantity: str
    unit: str
    sheet: str
    modelled: str
    interval: str
    agrees: bool | None
    rule: str
    source: str
    confidence: str

    @property
    def verdict(self) -> str:
        """pass, FAIL, or nothing."""
        return {True: "pass", False: "FAIL", None: ""}[self.agrees]


def lines(found: Mapping[Part, Findings], origins: Origins) -> tuple[Line, ...]:
    """The whole table."""
    told: list[Line] = []
    for part in PARTS:
        told += _of_part(found[part], origins)
    return tuple(told)


def _of_part(found: Findings, origins: Origins) -> list[Line]:
    return [
        *_noise(found, origins),
        *_filter(found),
        *_registers(found, origins),
        *_errors(found, origins),
        *_temperature(found, origins),
        *[line for one in found.settings for line in _setting(found, one)],
    ]


# --- pieces of lines -------------------------------------------------------------------------------------------------


def shown(value: float) -> str:
    """A number in three or four digits."""
    if not math.isfinite(value):
        return "none"
    if abs(value) >= 999.5:
        return f"{value:.0f}"
    return f"{value:.4g}" if abs(value) >= 1e-4 or value == 0.0 else f"{value:.1e}"


def _listed(values: Sequence[float] | Array) -> str:
    return ", ".join(f"{value:.3g}" for value in np.ravel(values))


def _of_axes(values: Sequence[float] | Array) -> str:
    """The numbers of the axes, one where they are alike."""
    told = [shown(float(value)) for value in values]
    return ", ".join(told if len(set(told)) > 1 else told[:1])


def _near(value: float, claim: float, share: float) -> bool:
    return bool(abs(value - claim) <= share * abs(claim))


def _datum(origins: Origins, name: str) -> Datum | None:
    origin = origins.get(name)
    return origin if isinstance(origin, Datum) else None


def _tolerance(origins: Origins, name: str) -> Tolerance | None:
    origin = origins.get(name)
    return origin if isinstance(origin, Tolerance) else None


def floor_of(instability: Datum) -> float:
    """The minimum of the Allan deviation as the sheet prints it, in SI; the parameter is the coefficient B."""
    return 0.664 * instability.si


def _is_given(datum: Datum | None) -> bool:
    return datum is not None and not (datum.value == 0.0 and datum.confidence == "assumption")


def _estimated(
    part: Part,
    quantity: str,
    unit: tuple[str, float],
    measured: Estimate | None,
    claim: float | None,
    share: float,
    datum: Datum | None,
) -> Line:
    """A line about a number with a 95 % interval; claim and measurement in SI."""
    name, size = unit
    if claim is None or datum is None:
        source = "the sheet gives none" if datum is None else datum.source
        text = "none modelled" if measured is None else shown(measured.value / size)
        return Line(part, quantity, name, "not given", text, "", None, "", source, "")
    if measured is None:
        return Line(
            part,
            quantity,
            name,
            shown(claim / size),
            "none",
            "",
            False,
            f"±{share:.0%}",
            datum.source,
            datum.confidence,
        )
    value, low, high = (number / size for number in measured)
    return Line(
        part,
        quantity,
        name,
        shown(claim / size),
        shown(value),
        f"{shown(low)} to {shown(high)}",
        _near(measured.value, claim, share),
        f"±{share:.0%}",
        datum.source,
        datum.confidence,
    )


def bounds(tolerance: Tolerance) -> tuple[float, float]:
    """Where a tolerance puts a piece, in SI: three standard deviations, or its limits."""
    reach = 3.0 * tolerance.size if tolerance.reading == "sigma" else tolerance.size
    reach = min(reach, tolerance.limit)
    return in_si(tolerance.mean - reach, tolerance.unit), in_si(tolerance.mean + reach, tolerance.unit)


def limits_name(tolerance: Tolerance) -> str:
    """What `bounds` are: three standard deviations, or the sheet's limits."""
    return "3 sigma" if tolerance.reading == "sigma" and 3.0 * tolerance.size < tolerance.limit else "limits"


def _rule(tolerance: Tolerance) -> str:
    return f"within {limits_name(tolerance)}"


def spread(
    part: Part, quantity: str, unit: tuple[str, float], values: Array, tolerance: Tolerance | None, text: str = ""
) -> Line:
    """A line about numbers that differ from piece to piece; values in SI."""
    name, size = unit
    modelled = text or _listed(values / size)
    if tolerance is None:
        return Line(part, quantity, name, "not given", modelled, "", None, "", "the sheet gives none", "")
    low, high = bounds(tolerance)
    sheet, rule = f"{shown(low / size)} to {shown(high / size)}", _rule(tolerance)
    agrees: bool | None = bool(np.all((values >= low) & (values <= high)))
    if float(np.max(np.abs(values))) <= _NOTHING * max(abs(low), abs(high)):
        agrees, rule = None, "nominal: it has none"
    return Line(part, quantity, name, sheet, modelled, "", agrees, rule, tolerance.source, tolerance.confidence)


# --- the lines -------------------------------------------------------------------------------------------------------


def _noise(found: Findings, origins: Origins) -> list[Line]:
    part, units = found.part, UNITS[found.part]
    density = _density(found, origins)
    instability = _datum(origins, f"{part}.bias_instability")
    walk = _datum(origins, f"{part}.rate_random_walk")
    floor = floor_of(instability) if instability is not None and _is_given(instability) else None
    step = walk.si if walk is not None and _is_given(walk) else None
    told = [
        _estimated(part, "noise density", units.density, found.white, density and density.si, _WHITE, density),
        _estimated(
            part, "bias instability, Allan floor", units.floor, found.instability, floor, _INSTABILITY, instability
        ),
        _estimated(part, "rate random walk", units.walk, _as_walk(found.walk), step, _WALK, walk),
    ]
    datum = _datum(origins, f"{part}.noise_density")
    if datum is not None:
        name, size = units.reading
        bandwidth = float(np.mean([claim.noise_bandwidth for claim in found.claims.own]))
        claim = datum.si * math.sqrt(bandwidth)
        told.append(
            Line(
                part,
                "noise of a reading, rms",
                name,
                shown(claim / size),
                shown(found.noise_rms / size),
                "",
                _near(found.noise_rms, claim, _RMS),
                f"±{_RMS:.0%}",
                f"density and {bandwidth:.4g} Hz of noise bandwidth at this piece's clock",
                _calculated(datum),
            )
        )
    walk_line = _random_walk(found)
    return told if walk_line is None else [*told[:1], walk_line, *told[1:]]


def _calculated(datum: Datum) -> str:
    """How sure what follows from a number is."""
    return datum.confidence if datum.confidence in UNSURE else "calculated"


def _density(found: Findings, origins: Origins) -> Datum | None:
    """The sheet's density as the words show it: conversions that a divider leaves out fold their noise down."""
    datum, gain = _datum(origins, f"{found.part}.noise_density"), found.claims.nominal.density_gain
    if datum is None or gain == 1.0:
        return datum
    source = f"{datum.source}: {datum.text} by √{gain**2:g}, folded by the divider"
    return datum._replace(value=datum.value * gain, source=source, confidence=_calculated(datum))


def _random_walk(found: Findings) -> Line | None:
    """N = D/sqrt(2) of the density as found, beside a random walk that the sheet prints and its density contradicts."""
    printed = found.sheet.random_walk
    if printed is None:
        return None
    is_gyro = found.part == "gyro"
    density = found.white.value / found.claims.nominal.density_gain
    value = density / math.sqrt(2.0) * 60.0 * (1.0 / _DEGREE if is_gyro else 1e3)
    return Line(
        found.part,
        "angle random walk" if is_gyro else "velocity random walk",
        "°/√h" if is_gyro else "mm/s/√h",
        printed.printed,
        shown(value),
        "",
        None,
        "contradicts the density",
        f"{printed.source}: {printed.why}",
        printed.confidence,
    )


def _as_walk(found: Estimate | None) -> Estimate | None:
    """K = sigma sqrt(3/tau) at the cluster time of 1 s."""
    return None if found is None else Estimate(*[math.sqrt(3.0) * value for value in found])


def _filter(found: Findings) -> list[Line]:
    told = _setting(found, SettingFound(Setting("", {}), found.claims, found.responses))
    claim, half = found.claims.nominal, found.step.half
    if claim.delay_limits is not None:
        told.append(_delay_within_limits(found, claim.delay_limits))
    told.append(
        Line(
            found.part,
            "step of x, half way after",
            "ms",
            shown(1e3 * found.claims.x.delay),
            shown(1e3 * half),
            "",
            None,
            "",
            "the delay, as the filter is symmetric",
            claim.confidence,
        )
    )
    return told


def cutoff_name(decibels: float) -> str:
    """What the frequency at which the gain has fallen so far is called."""
    return f"{decibels:.2f} dB frequency".replace("-3.01", "-3")


def _setting(found: Findings, one: SettingFound) -> list[Line]:
    """-3 dB frequency and delay of the axes, beside the sheet's at the clocks that they were found to have."""
    claim, clocks = one.claims.nominal, found.clocks
    at = f"{_setting_name(one.setting.label)}: " if one.setting.label else ""
    frequencies = np.array([response.frequency_of(claim.decibels) for response in one.responses])
    delays = np.array([response.delay for response in one.responses])
    at_its_clock = "" if np.allclose(clocks, 1.0, rtol=0.0, atol=SAME_CLOCK) else ", at its clock"
    told = []
    own_frequencies = np.array([own.frequency for own in one.claims.own])
    own_delays = np.array([own.delay for own in one.claims.own])
    for quantity, unit, size, nominal, claims, values, share in (
        (cutoff_name(claim.decibels), "Hz", 1.0, claim.frequency, own_frequencies, frequencies, _CUTOFF),
        ("delay", "ms", 1e-3, claim.delay, own_delays, delays, _DELAY),
    ):
        source = f"{claim.source}: {shown(nominal / size)} {unit}" if at_its_clock else claim.source
        told.append(
            Line(
                found.part,
                f"{at}{quantity}",
                unit,
                _of_axes(claims / size) if at_its_clock else shown(nominal / size),
                _of_axes(values / size),
                "",
                _all_near(values, claims, share),
                f"±{share:.0%}{at_its_clock}",
                source,
                claim.confidence,
            )
        )
    return told


def _all_near(values: Array, claims: Array, share: float) -> bool:
    """Whether each number is near its claim, or there is neither."""
    return bool(np.allclose(values, claims, rtol=share, atol=0.0, equal_nan=True))


def _delay_within_limits(found: Findings, limits: tuple[float, float]) -> Line:
    delays = np.array([response.delay for response in found.responses])
    return Line(
        found.part,
        "delay, of any piece",
        "ms",
        f"{shown(1e3 * limits[0])} to {shown(1e3 * limits[1])}",
        _of_axes(1e3 * delays),
        "",
        bool(np.all((delays >= limits[0]) & (delays <= limits[1]))),
        "within limits",
        found.claims.nominal.source,
        found.claims.nominal.confidence,
    )


def _setting_name(label: str) -> str:
    return label.replace(".Hz", " Hz") if label.endswith("Hz") else f"{label} tap{'' if label == '1' else 's'}"


def _registers(found: Findings, origins: Origins) -> list[Line]:
    rate = _word_rate(found, origins)
    sheet = found.sheet
    told = [
        _codes(found.part, "register codes of known inputs", found.codes, sheet.codes, sheet.codes_source, origins),
        _codes(
            found.part,
            "thermometer codes",
            found.thermometer,
            sheet.thermometer,
            sheet.thermometer_source,
            origins,
        ),
    ]
    return told if rate is None else [*told, rate]


def _codes(part: Part, quantity: str, found: Codes, examples: Sequence[Example], source: str, origins: Origins) -> Line:
    """The codes of the sheet's examples; as sure as what the sheet says of the register."""
    expected = np.array([example.code for example in examples])
    exact = int(np.sum(expected == found.codes.T))
    name = "thermometer.sensitivity" if quantity.startswith("thermometer") else "resolution"
    datum = _datum(origins, f"{part}.{name}")
    given = ", ".join(f"{example.given:g}: {example.code}" for example in examples[:2])
    return Line(
        part,
        quantity,
        "LSB",
        given,
        f"{exact} of {found.codes.size} exact",
        "",
        exact == found.codes.size,
        "exact",
        source,
        "" if datum is None else datum.confidence,
    )


def _word_rate(found: Findings, origins: Origins) -> Line | None:
    part = found.part
    tolerance = _tolerance(origins, f"{part}.clock_error" + ("[1]" if part == "gyro" else ""))
    if tolerance is None:
        return None
    nominal = found.claims.nominal.word_rate
    low, high = (nominal * (1.0 + bound) for bound in bounds(tolerance))
    rates = found.word_rate if part == "gyro" else found.word_rate[:1]
    return Line(
        part,
        "register words a second",
        "Hz",
        f"{shown(low)} to {shown(high)}",
        ", ".join(f"{value:.1f}" for value in rates),
        "",
        bool(np.all((rates >= 0.9999 * low) & (rates <= 1.0001 * high))),
        _rule(tolerance),
        tolerance.source,
        tolerance.confidence,
    )


def _errors(found: Findings, origins: Origins) -> list[Line]:
    part, units, measured = found.part, UNITS[found.part], found.calibration
    percent = ("%", 0.01)
    own = np.diag(measured.matrix) - 1.0
    across = measured.matrix - np.diag(np.diag(measured.matrix))
    told = [
        spread(part, "offset at 25 °C", units.reading, measured.offset, _tolerance(origins, f"{part}.bias[1]")),
        spread(part, "scale error", percent, own, _tolerance(origins, f"{part}.scale_error[1]")),
        spread(
            part,
            "cross-axis",
            percent,
            across,
            _cross_axis(part, origins),
            f"largest {100.0 * np.max(np.abs(across)):.3g}",
        ),
    ]
    nonlinear = _datum(origins, f"{part}.nonlinearity")
    if nonlinear is not None:
        is_rms = nonlinear.unit.endswith("rms")
        value = measured.nonlinearity_rms if is_rms else measured.nonlinearity_largest
        claim = 0.01 * nonlinear.value
        told.append(
            Line(
                part,
                f"nonlinearity, {'rms' if is_rms else 'largest'}",
                "% of FS",
                shown(100.0 * claim),
                shown(100.0 * value),
                "",
                _near(value, claim, _NONLINEARITY),
                f"±{_NONLINEARITY:.0%}",
                nonlinear.source,
                nonlinear.confidence,
            )
        )
    return [*told, *(_pushed(found, origins) if part == "gyro" else [])]


def _cross_axis(part: Part, origins: Origins) -> Tolerance | None:
    """The tolerance of the cross-axis sensitivity, else of what leans the axes, as an angle."""
    direct = _tolerance(origins, f"{part}.cross_axis[1,2]")
    turned, leaning = (_tolerance(origins, f"{part}.{name}[1]") for name in ("misalignment", "nonorthogonality"))
    if direct is not None or turned is None or leaning is None:
        return direct
    return turned._replace(size=math.hypot(turned.size, leaning.size))


def _pushed(found: Findings, origins: Origins) -> list[Line]:
    """Lines about what specific force does to a gyro."""
    measured = found.calibration
    by_g, by_square = ("°/s/g", _DEGREE / _G), ("°/s/g²", _DEGREE / _G**2)
    largest = float(np.max(np.abs(measured.g_sensitivity))) / by_g[1]
    told = [
        spread(
            "gyro",
            "sensitivity to acceleration",
            by_g,
            measured.g_sensitivity,
            _tolerance(origins, "gyro.g_sensitivity[1,1]"),
            f"largest {largest:.3g}",
        )
    ]
    datum = _datum(origins, "gyro.rectification[1]")
    if datum is not None and _is_given(datum):
        values = measured.rectification
        agrees = bool(np.all(np.abs(values - datum.si) <= 0.05 * abs(datum.si)))
        told.append(
            Line(
                "gyro",
                "vibration rectification",
                by_square[0],
                shown(datum.value),
                _listed(values / by_square[1]),
                "",
                agrees,
                "±5%",
                datum.source,
                datum.confidence,
            )
        )
    return told


def _temperature(found: Findings, origins: Origins) -> list[Line]:
    part, units, drift = found.part, UNITS[found.part], found.drift
    told = [
        spread(
            part,
            "offset by temperature",
            units.slope,
            drift.slope(drift.offset),
            _tolerance(origins, f"{part}.bias_temperature_slope[1]"),
        ),
        spread(
            part,
            "scale by temperature",
            ("ppm/°C", 1e-6),
            drift.slope(drift.scale),
            _tolerance(origins, f"{part}.scale_temperature_slope[1]"),
        ),
    ]
    hysteresis = 0.5 * np.max(np.abs(drift.hysteresis), axis=0)
    if np.max(hysteresis) > _NOTHING * np.max(np.abs(drift.offset)):
        name, size = units.reading
        told.append(
            Line(
                part,
                "hysteresis of the offset, ±",
                name,
                "not given",
                _listed(hysteresis / size),
                "",
                None,
                "",
                "the sheet gives none",
                "",
            )
        )
    if part == "gyro" and _is_adxrs450(origins):
        name, size = units.reading
        worst = float(np.max(np.abs(drift.offset)))
        told.append(
            Line(
                part,
                "offset, -40 to 85 °C, largest",
                name,
                f"±{NULL_ACCURACY.value:g}",
                shown(worst / size),
                "",
                worst <= NULL_ACCURACY.si,
                "within limits",
                NULL_ACCURACY.source,
                NULL_ACCURACY.confidence,
            )
        )
    return told


def _is_adxrs450(origins: Origins) -> bool:
    kind = origins.get("gyro.filter")
    return isinstance(kind, Choice) and kind.item == "cic" and kind.confidence == "datasheet"


# --- as table and file -----------------------------------------------------------------------------------------------


def unsure_mark(confidence: str) -> str:
    """A question mark for a number that the part's own sheet may contradict."""
    return " ?" if confidence in UNSURE else ""


def summary(told: Sequence[Line], part: Part | None = None) -> str:
    """How many of the lines with a verdict, of one part or of both, agree."""
    judged = [line for line in told if line.agrees is not None and part in (None, line.part)]
    agreeing = sum(line.agrees is True for line in judged)
    unsure = sum(line.confidence in UNSURE for line in judged)
    text = f"{agreeing} of {len(judged)} numbers agree with the datasheet"
    return f"{text}; {unsure} of the datasheet's are unsure" if unsure else text


def table(told: Sequence[Line], title: str, width: int) -> Any:
    """The lines as a rich table for so many columns of text; where they are few, rules and sources stay in the file."""
    from rich.table import Table
    from rich.text import Text

    caption = "[ ]: 95 % interval of the record. ?: not from the part's own sheet (sister part, memory, assumption)."
    drawn = Table(title=title, title_style="bold", caption=caption, caption_justify="left")
    drawn.add_column("", overflow="fold")
    drawn.add_column("unit", style="dim", no_wrap=True)
    drawn.add_column("datasheet", justify="right", overflow="fold")
    drawn.add_column("modelled", justify="right", overflow="fold")
    drawn.add_column("", no_wrap=True)
    is_wide = width >= _WIDE
    if is_wide:
        drawn.add_column("rule", style="dim", overflow="fold")
        drawn.add_column("source", style="dim", overflow="fold")
    for part in PARTS:
        drawn.add_section()
        drawn.add_row(Text(part, style="bold"))
        for line in told:
            if line.part != part:
                continue
            modelled = f"{line.modelled} [{line.interval}]" if line.interval else line.modelled
            style = {True: "green", False: "bold red", None: "dim"}[line.agrees]
            cells: list[Any] = [
                line.quantity,
                line.unit,
                line.sheet + unsure_mark(line.confidence),
                Text(modelled),
                Text(line.verdict, style=style),
            ]
            drawn.add_row(*cells, *([line.rule, line.source] if is_wide else []))
    return drawn


def write_table(path: Path, told: Sequence[Line]) -> Path:
    """Write the lines as CSV.

    Raises `ResultsError` if the file cannot be written.
    """
    with whole_or_not(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*Line._fields, "verdict"])
        for line in told:
            judged = "" if line.agrees is None else str(line.agrees).lower()
            writer.writerow([*line._replace(agrees=None)[:6], judged, *line[7:], line.verdict])
    return path
