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
from .characteristics import PARTS, Estimate, Part, Setting
from .sensor_findings import Findings, SettingFound
from .workspace import whole_or_not

Origins = Mapping[str, Origin]

_DEGREE = math.pi / 180.0
_G = STANDARD_GRAVITY
_WHITE, _INSTABILITY, _WALK = 0.03, 0.10, 0.10
_CUTOFF, _DELAY = 0.01, 0.02
_RMS, _NONLINEARITY = 0.05, 0.10


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
        *[line for one in found.settings for line in _setting(found.part, one)],
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


def _rule(tolerance: Tolerance) -> str:
    return "within 3 sigma" if tolerance.reading == "sigma" and not math.isfinite(tolerance.limit) else "within limits"


def _spread(
    part: Part, quantity: str, unit: tuple[str, float], values: Array, tolerance: Tolerance | None, text: str = ""
) -> Line:
    """A line about numbers that differ from piece to piece; values in SI."""
    name, size = unit
    modelled = text or _listed(values / size)
    if tolerance is None:
        return Line(part, quantity, name, "not given", modelled, "", None, "", "the sheet gives none", "")
    low, high = bounds(tolerance)
    agrees = bool(np.all((values >= low * (1.0 + 1e-6) - 1e-12) & (values <= high * (1.0 + 1e-6) + 1e-12)))
    agrees = agrees or bool(np.max(np.abs(values)) <= 1e-3 * max(abs(low), abs(high)))
    sheet = f"{shown(low / size)} to {shown(high / size)}"
    return Line(
        part, quantity, name, sheet, modelled, "", agrees, _rule(tolerance), tolerance.source, tolerance.confidence
    )


# --- the lines -------------------------------------------------------------------------------------------------------


def _noise(found: Findings, origins: Origins) -> list[Line]:
    part, units = found.part, UNITS[found.part]
    density = _datum(origins, f"{part}.noise_density")
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
    if density is not None:
        name, size = units.reading
        bandwidth = found.claim.noise_bandwidth * found.clock
        claim = density.si * math.sqrt(bandwidth)
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
                "calculated" if density.confidence not in UNSURE else density.confidence,
            )
        )
    return told


def _as_walk(found: Estimate | None) -> Estimate | None:
    """K = sigma sqrt(3/tau) at the cluster time of 1 s."""
    return None if found is None else Estimate(*[math.sqrt(3.0) * value for value in found])


def _filter(found: Findings) -> list[Line]:
    told = _setting(found.part, SettingFound(Setting("", {}), found.claim, found.response))
    claim, half = found.claim, found.step.half
    told.append(
        Line(
            found.part,
            "step, half way after",
            "ms",
            shown(1e3 * claim.delay),
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


def _setting(part: Part, one: SettingFound) -> list[Line]:
    claim, response = one.claim, one.response
    at = f"{_setting_name(one.setting.label)}: " if one.setting.label else ""
    frequency = response.frequency_of(claim.decibels)
    named = cutoff_name(claim.decibels)
    limits = claim.delay_limits
    sheet = shown(1e3 * claim.delay)
    if limits is not None:
        sheet += f" ({shown(1e3 * limits[0])} to {shown(1e3 * limits[1])})"
    return [
        Line(
            part,
            f"{at}{named}",
            "Hz",
            shown(claim.frequency),
            shown(frequency) if math.isfinite(frequency) else "none",
            "",
            _near(frequency, claim.frequency, _CUTOFF),
            f"±{_CUTOFF:.0%}",
            claim.source,
            claim.confidence,
        ),
        Line(
            part,
            f"{at}delay",
            "ms",
            sheet,
            shown(1e3 * response.delay),
            "",
            _near(response.delay, claim.delay, _DELAY),
            f"±{_DELAY:.0%}",
            claim.source,
            claim.confidence,
        ),
    ]


def _setting_name(label: str) -> str:
    return label.replace(".Hz", " Hz") if label.endswith("Hz") else f"{label} tap{'' if label == '1' else 's'}"


def _registers(found: Findings, origins: Origins) -> list[Line]:
    part = found.part
    resolution, limit = _datum(origins, f"{part}.resolution"), _datum(origins, f"{part}.code_limit")
    exact = int(np.sum(found.codes.codes == found.expected_codes[:, None]))
    told = []
    if resolution is not None and limit is not None:
        told.append(
            Line(
                part,
                "register codes of known inputs",
                "LSB",
                f"{resolution.text}, {limit.text}",
                f"{exact} of {found.codes.codes.size} exact",
                "",
                exact == found.codes.codes.size,
                "exact",
                resolution.source,
                resolution.confidence,
            )
        )
    thermometer = _thermometer(found, origins)
    rate = _word_rate(found, origins)
    return [*told, *([] if thermometer is None else [thermometer]), *([] if rate is None else [rate])]


def _thermometer(found: Findings, origins: Origins) -> Line | None:
    part, codes = found.part, found.thermometer
    slope, zero = (_datum(origins, f"{part}.thermometer.{name}") for name in ("sensitivity", "code_at_25"))
    if slope is None or zero is None:
        return None
    expected = np.floor(zero.si + slope.si * (codes.given - 25.0) + 0.5)
    exact = int(np.sum(codes.codes == expected))
    return Line(
        part,
        "thermometer codes, -40 to 85 °C",
        "LSB",
        f"{slope.text}, {zero.text} at 25 °C",
        f"{exact} of {len(expected)} exact",
        "",
        exact == len(expected),
        "exact",
        slope.source,
        slope.confidence,
    )


def _word_rate(found: Findings, origins: Origins) -> Line | None:
    part = found.part
    tolerance = _tolerance(origins, f"{part}.clock_error" + ("[1]" if part == "gyro" else ""))
    if tolerance is None:
        return None
    nominal = found.at_rest.rate
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
        _spread(part, "offset at 25 °C", units.reading, measured.offset, _tolerance(origins, f"{part}.bias[1]")),
        _spread(part, "scale error", percent, own, _tolerance(origins, f"{part}.scale_error[1]")),
        _spread(
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
        _spread(
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
        _spread(
            part,
            "offset by temperature",
            units.slope,
            drift.slope(drift.offset),
            _tolerance(origins, f"{part}.bias_temperature_slope[1]"),
        ),
        _spread(
            part,
            "scale by temperature",
            ("ppm/°C", 1e-6),
            drift.slope(drift.scale),
            _tolerance(origins, f"{part}.scale_temperature_slope[1]"),
        ),
    ]
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


def summary(told: Sequence[Line]) -> str:
    """How many lines agree."""
    judged = [line for line in told if line.agrees is not None]
    agreeing = sum(line.agrees is True for line in judged)
    unsure = sum(line.confidence in UNSURE for line in judged)
    text = f"{agreeing} of {len(judged)} numbers agree with the datasheet"
    return f"{text}; {unsure} of the datasheet's are unsure" if unsure else text


def table(told: Sequence[Line], title: str) -> Any:
    """The lines as a rich table."""
    from rich.table import Table
    from rich.text import Text

    caption = "[ ]: 95 % interval of the record. ?: not from the part's own sheet (sister part, memory, assumption)."
    drawn = Table(title=title, title_style="bold", caption=caption, caption_justify="left")
    drawn.add_column("", overflow="fold")
    drawn.add_column("unit", style="dim", no_wrap=True)
    drawn.add_column("datasheet", justify="right", overflow="fold")
    drawn.add_column("modelled", justify="right", overflow="fold")
    drawn.add_column("", no_wrap=True)
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
            drawn.add_row(
                line.quantity,
                line.unit,
                line.sheet + unsure_mark(line.confidence),
                Text(modelled),
                Text(line.verdict, style=style),
                line.rule,
                line.source,
            )
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
