"""What a table is told to do: commands, and the table of rows that gives them one after the other."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple

from ..record import Enumeration, Integer, Item, Real
from ..scalar import PI, Scalar, select, where

ROWS = 48
"""Rows of a profile: the positions and rates of a calibration at one temperature, and some."""

_DEG = PI / 180.0

MODE = Enumeration(
    "TurntableMode",
    (
        Item("position", "to angles, then rest"),
        Item("rate", "turn at rates"),
    ),
    "what the axes are to do",
)

KIND = Enumeration(
    "ProfileRowKind",
    (
        Item("end", "stop and stay there: the profile is over"),
        Item("move", "go to the angles, then rest for the duration"),
        Item("turn", "turn at the rates, steadily for the duration"),
    ),
    "what the row asks for",
)


class Axes(NamedTuple):
    """One number for each axis."""

    outer: float
    middle: float
    inner: float


NO_AXES = Axes(0.0, 0.0, 0.0)


class Command(NamedTuple):
    """What the axes and the chamber are to do now."""

    mode: Annotated[int, MODE]
    angle: Annotated[Axes, Real("rad", "to go to, in mode position", -1e5, 1e5)]
    rate: Annotated[
        Axes,
        Real("rad/s", "in mode rate the rate; in mode position the largest speed, 0: the limit", -1e3, 1e3),
    ]
    temperature: Annotated[float, Real("K", "of the chamber", 200.0, 450.0, "degC", 300.0)]


class Row(NamedTuple):
    """One line of a profile. The next one begins when the duration is over."""

    kind: Annotated[int, KIND] = KIND.value("end")
    angle: Annotated[Axes, Real("rad", "of a move, where it goes", -1e5, 1e5)] = NO_AXES
    rate: Annotated[
        Axes, Real("rad/s", "of a turn, the rate; of a move the largest speed, 0: the axis's limit", -1e3, 1e3)
    ] = NO_AXES
    duration: Annotated[float, Real("s", "of the rest, or of the steady turning", 0.0, 1e6)] = 0.0
    temperature: Annotated[float, Real("K", "of the chamber", 200.0, 450.0, "degC", 300.0)] = 293.15


if TYPE_CHECKING:
    Rows = tuple[Row, ...]
else:
    Rows = tuple[(Row,) * ROWS]


def _move(inner: float, duration: float) -> Row:
    return Row(KIND.value("move"), Axes(0.0, 0.0, inner * _DEG), NO_AXES, duration)


class Profile(NamedTuple):
    """The table of rows, and when they count as fulfilled. Default: the inner axis to +-20 deg and back."""

    row: Rows = (_move(20.0, 5.0), _move(-20.0, 5.0), _move(0.0, 5.0), *[Row()] * (ROWS - 3))
    period: Annotated[float, Real("s", "of the sequencer, rounded to whole ticks of the table", 1e-4, 10.0)] = 0.01
    tolerance: Annotated[
        float, Real("rad", "of a settled axis: from its angle, and in a second from its rate", 1e-9, 0.1, nominal=1e-5)
    ] = 1e-5


class Sequence(NamedTuple):
    """Where a profile is."""

    row: Annotated[float, Integer("row that runs, counted from 1; 0 before the first", 0)] = 0.0
    left: Annotated[float, Integer("sequencer's ticks until the row is over, once settled", 0)] = 0.0
    ends: Annotated[float, Integer("1 in the row that ends the profile", 0, 1)] = 0.0


def row_number(rows: Rows, number: Scalar) -> Row:
    """Row `number`, counted from 1; an end beyond the last."""
    index = number - 1.0

    def axes(values: list[Axes]) -> Axes:
        return Axes(*[select(index, [value[axis] for value in values]) for axis in range(3)])

    kind = select(index, [row.kind for row in rows])
    return Row(
        kind=where(kind < 0.5, KIND.value("end"), kind),
        angle=axes([row.angle for row in rows]),
        rate=axes([row.rate for row in rows]),
        duration=select(index, [row.duration for row in rows]),
        temperature=select(index, [row.temperature for row in rows]),
    )


def command_of(row: Row, before: Command) -> Command:
    """What a row asks for: its end is a turn at no rate, at the temperature before it."""
    is_move, is_end = row.kind == KIND.value("move"), row.kind == KIND.value("end")
    return Command(
        mode=where(is_move, MODE.value("position"), MODE.value("rate")),
        angle=row.angle,
        rate=Axes(*[where(is_end, 0.0, rate) for rate in row.rate]),
        temperature=where(is_end, before.temperature, row.temperature),
    )
