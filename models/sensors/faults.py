"""Faults of single channels, switched by tunable parameters at a given time."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Enumeration, Item, Real
from ..scalar import Scalar, absolute, both, where

FAULT = Enumeration(
    "Fault",
    (
        Item("none", "no fault"),
        Item("stuck", "the register keeps its last word"),
        Item("dropped", "the channel delivers nothing: its word is zero and marked invalid"),
        Item("spiking", "one word in a hundred is off by the size"),
        Item("drifting", "the reading runs away by the size each second"),
        Item("saturated", "the reading lies at the end of the range"),
        Item("lost_frames", "words do not reach the processor, which goes on with the last one"),
    ),
    "what is wrong with a channel",
    tunable=True,
)
CHANNEL = Enumeration(
    "Channel",
    tuple(
        Item(f"{part}_{axis}", f"{part} along {name}")
        for part in ("gyro", "accelerometer")
        for axis, name in enumerate(("right", "forward", "up"), 1)
    ),
    "which channel",
    tunable=True,
)
_NONE, _STUCK, _DROPPED, _SPIKING, _DRIFTING, _SATURATED, LOST_FRAMES = (FAULT.value(item.name) for item in FAULT.items)
_SPIKE = 2.5758293035489004
"""A standard normal draw lies beyond it once in a hundred."""


class FaultParameters(NamedTuple):
    """One fault."""

    kind: Annotated[int, FAULT] = _NONE
    channel: Annotated[int, CHANNEL] = CHANNEL.value("gyro_1")
    start: Annotated[float, Real("s", "after the start of the run", min=0.0, tunable=True)] = 0.0
    end: Annotated[float, Real("s", "after the start of the run", min=0.0, tunable=True)] = 1e9
    size: Annotated[
        float, Real("1", "share of the full scale (each second where it drifts)", min=-10.0, max=10.0, tunable=True)
    ] = 0.1


class Faulted(NamedTuple):
    """What a fault makes of a reading: the reading, 1.0 where the old word stays, 1.0 where there is none."""

    value: Scalar
    stuck: Scalar
    dropped: Scalar


def condition_of(stuck: Scalar, dropped: Scalar) -> Scalar:
    """0 well, 1 stuck, 2 without a valid reading."""
    return where(dropped > 0.5, 2.0, where(stuck > 0.5, 1.0, 0.0))


def is_active(fault: FaultParameters, time: Scalar) -> Scalar:
    """Whether the fault's channel suffers from it at this time (s) of the run."""
    return both(time >= fault.start, time < fault.end)


def faulted(
    value: Scalar, full_scale: Scalar, fault: FaultParameters, channel: int, time: Scalar, draw: Scalar
) -> Faulted:
    """The reading of a channel (from 0) under a fault; `draw` is a standard normal."""
    kind = where(both(fault.channel == channel + 1, is_active(fault, time)), fault.kind, _NONE)
    size = fault.size * full_scale
    spike = where(absolute(draw) > _SPIKE, where(draw > 0.0, size, -size), 0.0)
    added = where(kind == _SPIKING, spike, 0.0)
    added = where(kind == _DRIFTING, size * (time - fault.start), added)
    end = where(fault.size < 0.0, -2.0, 2.0) * full_scale
    return Faulted(
        where(kind == _SATURATED, end, value + added),
        where(kind == _STUCK, 1.0, 0.0),
        where(kind == _DROPPED, 1.0, 0.0),
    )
