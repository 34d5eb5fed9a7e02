"""Profiles of a turntable: labelled rows of moves, rests and turns, as data, as a CSV file and as parameter values.

A profile's file has a line of column names with their units, and a line for each row::

    label,kind,outer (deg),middle (deg),inner (deg),duration (s),temperature (degC)
    level,move,0,0,0,30,20
    inner up,move,0,0,20,10,

Columns that are missing are zero; further ones are ``outer rate (deg/s)`` and so on. A temperature that is left out is
that of the row before. The labels stay here: `labelled_intervals` finds them again in what a run recorded.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from attitude_fmu.fmu_src.errors import did_you_mean

from ..fmu_src.units import UnknownUnitError, display_of
from ..models.errors import ValueRefusedError, digits
from ..models.plants.turntable_profile import KIND, NO_AXES, ROWS, Axes, Row
from ..models.record import check, flatten
from ..models.scalar import PI
from .errors import ResultsError, SystemRefusedError
from .system import ParameterSet

ROOM_TEMPERATURE = 293.15
"""K, where a profile says nothing about it."""

_DEG = PI / 180.0
_KINDS = ("move", "turn")


class ProfileRow(NamedTuple):
    """One labelled row: angles (rad) of a move, rates (rad/s) of a turn, duration (s), temperature (K).

    `rate` is a move's largest speed, 0 being the axis's limit; a `temperature` of None is that of the row before.
    """

    label: str
    kind: str
    angle: Axes = NO_AXES
    rate: Axes = NO_AXES
    duration: float = 0.0
    temperature: float | None = None


class Profile(NamedTuple):
    """Rows that a table runs one after the other."""

    name: str
    rows: tuple[ProfileRow, ...]


class Interval(NamedTuple):
    """When a run rested in a row, or turned steadily (s), the ends included."""

    label: str
    row: int
    kind: str
    start: float
    end: float

    def of(self, results: Any) -> Any:
        """The rows of a structured array that lie within."""
        time = results["time"]
        return results[(time >= self.start) & (time <= self.end)]


def move(label: str, angle: Axes, duration: float, speed: float = 0.0, temperature: float | None = None) -> ProfileRow:
    """To `angle` (rad), no axis faster than `speed` (rad/s; 0: its limit), then rest for `duration` (s)."""
    return ProfileRow(label, "move", angle, Axes(speed, speed, speed), duration, temperature)


def turn(label: str, rate: Axes, duration: float, temperature: float | None = None) -> ProfileRow:
    """Turn steadily at `rate` (rad/s) for `duration` (s)."""
    return ProfileRow(label, "turn", NO_AXES, rate, duration, temperature)


# --- parameter values ------------------------------------------------------------------------------------------------


def _start_temperature(profile: Profile) -> float:
    given = [row.temperature for row in profile.rows if row.temperature is not None]
    return given[0] if given else ROOM_TEMPERATURE


def _model_rows(profile: Profile) -> list[Row]:
    """The rows as the model takes them, checked."""
    if not 0 < len(profile.rows) <= ROWS:
        raise SystemRefusedError(f"profile {profile.name} has {len(profile.rows)} rows; a table takes 1 to {ROWS}")
    temperature, rows = _start_temperature(profile), []
    for number, row in enumerate(profile.rows, 1):
        where = f"profile {profile.name}, row {number} ({row.label})"
        if row.kind not in _KINDS:
            raise SystemRefusedError(f"{where}: kind is {row.kind!r}; there are {' and '.join(_KINDS)}")
        temperature = temperature if row.temperature is None else row.temperature
        made = Row(KIND.value(row.kind), row.angle, row.rate, row.duration, temperature)
        try:
            check(Row, flatten(made), where)
        except ValueRefusedError as error:
            raise SystemRefusedError(str(error)) from None
        rows.append(made)
    return rows


def profile_values(profile: Profile) -> dict[str, float | int]:
    """Every parameter of `Turntable` that a profile sets, the chamber's first temperature among them.

    Raises `SystemRefusedError` for a row that the table cannot take.
    """
    values: dict[str, float | int] = {"chamber.initial_temperature": _start_temperature(profile)}
    for number, row in enumerate(_model_rows(profile), 1):
        stem = f"profile.row[{number}]"
        values[f"{stem}.kind"] = row.kind
        for axis in Axes._fields:
            values[f"{stem}.angle.{axis}"] = getattr(row.angle, axis)
            values[f"{stem}.rate.{axis}"] = getattr(row.rate, axis)
        values[f"{stem}.duration"] = row.duration
        values[f"{stem}.temperature"] = row.temperature
    if len(profile.rows) < ROWS:
        values[f"profile.row[{len(profile.rows) + 1}].kind"] = KIND.value("end")
    return values


def profile_parameters(profile: Profile, component: str = "table") -> ParameterSet:
    """The same as a parameter set for the component that is so called; ``component=""`` gives plain names."""
    prefix = f"{component}." if component else ""
    return ParameterSet(profile.name, {f"{prefix}{name}": value for name, value in profile_values(profile).items()})


# --- what a run recorded ---------------------------------------------------------------------------------------------


def labelled_intervals(profile: Profile, results: Any, component: str = "table") -> list[Interval]:
    """The rests and steady turns of a run, in order, from its recorded outputs ``row``, ``resting`` and ``turning``.

    A row that the run did not reach, or that rests for less than a recorded step, gives none. Raises
    `SystemRefusedError` if one of the three was not recorded.
    """
    prefix = f"{component}." if component else ""
    row, resting, turning = (_column(results, f"{prefix}{name}") for name in ("row", "resting", "turning"))
    time: NDArray[np.float64] = results["time"]
    found = []
    for number, one in enumerate(profile.rows, 1):
        times = time[(row == number) & (resting.astype(bool) | turning.astype(bool))]
        if len(times):
            found.append(Interval(one.label, number, one.kind, float(times[0]), float(times[-1])))
    return found


def _column(results: Any, name: str) -> NDArray[Any]:
    names = results.dtype.names or ()
    if name not in names:
        raise SystemRefusedError(f"the run did not record {name}{did_you_mean(name, names)}")
    column: NDArray[Any] = results[name]
    return column


# --- files -----------------------------------------------------------------------------------------------------------

_COLUMNS = {
    **{axis: ("angle", "rad", "deg") for axis in Axes._fields},
    **{f"{axis} rate": ("rate", "rad/s", "deg/s") for axis in Axes._fields},
    "duration": ("duration", "s", "s"),
    "temperature": ("temperature", "K", "degC"),
}
"""Columns of numbers: field of the row, its unit, and the unit that is written."""


def read_profile(path: Path) -> Profile:
    """The profile in a CSV file, called as the file is.

    Raises `SystemRefusedError`, with row and column, for what it cannot take.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines = [line for line in csv.reader(file) if any(cell.strip() for cell in line)]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise SystemRefusedError(f"{path}: {error}") from error
    if not lines:
        raise SystemRefusedError(f"{path} is empty; its first line names the columns")
    columns = [_read_column(cell.strip(), path) for cell in lines[0]]
    rows = [_read_row(columns, line, f"{path}, row {number}") for number, line in enumerate(lines[1:], 1)]
    profile = Profile(path.stem, tuple(rows))
    _model_rows(profile)
    return profile


class _Column(NamedTuple):
    """A column of a file: ``value = (written - offset) / factor``."""

    heading: str
    name: str
    factor: float = 1.0
    offset: float = 0.0


def _read_column(heading: str, path: Path) -> _Column:
    if heading in ("label", "kind"):
        return _Column(heading, heading)
    name, _, rest = heading.partition(" (")
    if name not in _COLUMNS or not rest.endswith(")"):
        known = ["label", "kind", *(f"{name} ({shown})" for name, (_, _, shown) in _COLUMNS.items())]
        raise SystemRefusedError(
            f"{path}: unknown column {heading!r}{did_you_mean(heading, known)} (columns: {', '.join(known)})"
        )
    try:
        return _Column(heading, name, *display_of(rest[:-1], _COLUMNS[name][1]))
    except UnknownUnitError as error:
        raise SystemRefusedError(f"{path}: column {heading!r}: {error}") from None


def _read_row(columns: list[_Column], cells: list[str], where: str) -> ProfileRow:
    if len(cells) > len(columns):
        raise SystemRefusedError(f"{where} has {len(cells)} cells for {len(columns)} columns")
    texts: dict[str, str] = {}
    numbers: dict[str, float] = {}
    for column, cell in zip(columns, cells, strict=False):
        text = cell.strip()
        if column.name in ("label", "kind"):
            texts[column.name] = text
        elif text:
            try:
                numbers[column.name] = (float(text) - column.offset) / column.factor
            except ValueError:
                raise SystemRefusedError(f"{where}, column {column.heading!r}: {text!r} is no number") from None
    if texts.get("kind") not in _KINDS:
        raise SystemRefusedError(f"{where}, column 'kind': {texts.get('kind', '')!r}; there are {' and '.join(_KINDS)}")
    return ProfileRow(
        texts.get("label", ""),
        texts["kind"],
        Axes(*[numbers.get(axis, 0.0) for axis in Axes._fields]),
        Axes(*[numbers.get(f"{axis} rate", 0.0) for axis in Axes._fields]),
        numbers.get("duration", 0.0),
        numbers.get("temperature"),
    )


def write_profile(profile: Profile, path: Path) -> Path:
    """Write a profile as a CSV file that `read_profile` reads.

    Raises `ResultsError` if the file cannot be written.
    """
    scales = {name: display_of(shown, unit) for name, (_, unit, shown) in _COLUMNS.items()}
    try:
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(["label", "kind", *(f"{name} ({shown})" for name, (_, _, shown) in _COLUMNS.items())])
            for row in profile.rows:
                numbers = _numbers(row)
                cells = [
                    "" if numbers[name] is None else digits(factor * numbers[name] + offset)
                    for name, (factor, offset) in scales.items()
                ]
                writer.writerow([row.label, row.kind, *cells])
    except OSError as error:
        raise ResultsError(f"{path}: {error}") from error
    return path


def _numbers(row: ProfileRow) -> Mapping[str, Any]:
    return {
        **row.angle._asdict(),
        **{f"{axis} rate": rate for axis, rate in row.rate._asdict().items()},
        "duration": row.duration,
        "temperature": row.temperature,
    }


# --- the papers' profiles --------------------------------------------------------------------------------------------


def _degrees(middle: float, inner: float) -> Axes:
    return Axes(0.0, middle * _DEG, inner * _DEG)


def _sweep(
    name: str, first: ProfileRow, rows: Iterable[tuple[str, float, float]], rest: float, speed: float = 0.0
) -> Profile:
    """After the first row, rests at angles of middle and inner axis in degrees, one after the other."""
    moves = [move(label, _degrees(middle, inner), rest, speed * _DEG) for label, middle, inner in rows]
    return Profile(name, (first, *moves))


_STEPS = (-20.0, -10.0, 0.0, 10.0, 20.0)
_ANGLES = (0.0, 10.0, 20.0, 30.0, 40.0)

PAPER_B_START = 36.0
"""s at rest before all else: the 2010 device nulls its bias for 30 s of a clock that may be 3 % slow, then levels."""

PAPER_B_BESIDE = 20.0
"""deg, of the axis that is not turned, in all four tables of the 2010 paper."""

_PITCHING = move("pitch 0 deg, null", _degrees(0.0, PAPER_B_BESIDE), PAPER_B_START)
_ROLLING = move("roll 0 deg, null", _degrees(PAPER_B_BESIDE, 0.0), PAPER_B_START)

PAPER_A_STATIC = Profile("paper-a-static", (move("inner 43.5 deg", _degrees(0.0, 43.5), 120.0),))
"""Jing & Gao 2021, figures 6 to 9: inner axis at 43.5 deg. The record's length is an assumption."""

PAPER_A_SWEEP = _sweep(
    "paper-a-sweep",
    move("level", NO_AXES, 30.0),
    [
        *[(f"inner {angle:g} deg", 0.0, angle) for angle in _STEPS],
        *[(f"middle {angle:g} deg", angle, 0.0) for angle in _STEPS],
    ],
    10.0,
)
"""Jing & Gao 2021: inner axis -20 to 20 deg with the middle one at 0, then the other way round; at the default limits
of 10 deg/s and 10 deg/s^2, which are theirs. The length of the rests is an assumption."""

PAPER_B_PITCH = _sweep(
    "paper-b-pitch", _PITCHING, [(f"pitch {angle:g} deg", angle, PAPER_B_BESIDE) for angle in _ANGLES], 10.0
)
"""The 2010 paper, table 1: pitch at 0 to 40 deg, roll at 20 deg. The table starts there (`initial_angle`)."""

PAPER_B_ROLL = _sweep(
    "paper-b-roll", _ROLLING, [(f"roll {angle:g} deg", PAPER_B_BESIDE, angle) for angle in _ANGLES], 10.0
)
"""The 2010 paper, table 2: roll at 0 to 40 deg, pitch at 20 deg."""

PAPER_B_PITCH_TURNS = _sweep(
    "paper-b-pitch-turns",
    _PITCHING,
    [(f"pitch {angle:g} deg", angle, PAPER_B_BESIDE) for angle in _ANGLES[1:]],
    0.1,
    1.0,
)
"""The 2010 paper, table 3: pitch turned from 0 to 10, 20, 30, 40 deg at 1 deg/s, the rate that its drift implies; the
rests are as short as results can be taken in."""

PAPER_B_ROLL_TURNS = _sweep(
    "paper-b-roll-turns",
    _ROLLING,
    [(f"roll {angle:g} deg", PAPER_B_BESIDE, angle) for angle in _ANGLES[1:]],
    0.1,
    1.0,
)
"""The 2010 paper, table 4: the same in roll."""

PROFILES = {
    profile.name: profile
    for profile in (
        PAPER_A_STATIC,
        PAPER_A_SWEEP,
        PAPER_B_PITCH,
        PAPER_B_ROLL,
        PAPER_B_PITCH_TURNS,
        PAPER_B_ROLL_TURNS,
    )
}
"""The ready profiles by name."""
