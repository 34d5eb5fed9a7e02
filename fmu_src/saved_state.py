"""The saved state of an instance, as a tuple and as bytes that mean the same on every machine.

Bytes, little-endian: magic, version, fingerprint of the FMU, stage, start time, time, three counts; then the
parameters and inputs, the state (both as doubles), the clocks' counters (as 64-bit integers); then a CRC-32 of it all.
"""

from __future__ import annotations

import struct
import zlib
from typing import Any, NamedTuple

_MAGIC = b"aFMU"
_VERSION = 2
_HEADER = struct.Struct("<4sH16sBddIII")
_CHECKSUM = struct.Struct("<I")

INSTANTIATED, INITIALISING, STEPPING, STOPPED, TERMINATED = range(5)
"""The stages of an instance's life, in their order."""

STAGE_NAMES = ("INSTANTIATED", "INITIALISING", "STEPPING", "STOPPED", "TERMINATED")

STAGES = (
    "the instance is not initialised yet",
    "the instance is being initialised, which fmi2ExitInitializationMode ends",
    "the instance is initialised already; fmi2Reset makes it begin anew",
    "stopped by an error before; fmi2Reset or fmi2SetFMUstate makes it go on",
    "terminated; fmi2Reset or fmi2SetFMUstate makes it go on",
)
"""Why a call is refused in each stage."""

TIME_SLACK = 1e-6
"""Part of a step (of 1 s at most) by which a host's communication point may miss the end of the step before: hosts
add up."""

TIME_ROUNDING = 1e-9
"""s by which it may miss in any case."""


class SavedState(NamedTuple):
    """Everything that decides how an instance goes on; no reference to the instance itself."""

    fingerprint: str
    stage: int
    start_time: float
    time: float
    settable: tuple[Any, ...]
    state: tuple[float, ...]
    counts: tuple[int, ...]


class DamagedState(NamedTuple):
    """What bytes become that are no saved state."""

    reason: str


def to_bytes(saved: SavedState) -> bytes:
    """The bytes of a saved state."""
    header = _HEADER.pack(
        _MAGIC,
        _VERSION,
        bytes.fromhex(saved.fingerprint[:32]),
        saved.stage,
        saved.start_time,
        saved.time,
        len(saved.settable),
        len(saved.state),
        len(saved.counts),
    )
    numbers = (*saved.settable, *saved.state)
    body = header + struct.pack(f"<{len(numbers)}d{len(saved.counts)}q", *numbers, *saved.counts)
    return body + _CHECKSUM.pack(zlib.crc32(body))


def from_bytes(data: bytes) -> SavedState | DamagedState:
    """The saved state in `data`, or why there is none."""
    body = data[: -_CHECKSUM.size]
    if len(body) < _HEADER.size or body[:4] != _MAGIC:
        return DamagedState("the bytes are no saved state of this kind of FMU")
    if _CHECKSUM.pack(zlib.crc32(body)) != data[-_CHECKSUM.size :]:
        return DamagedState("the bytes are damaged (checksum)")
    _, version, fingerprint, stage, start_time, time, *lengths = _HEADER.unpack_from(body)
    if version != _VERSION:
        return DamagedState(f"the bytes are of version {version}, wanted is {_VERSION}")
    settable, state, counts = lengths
    layout = struct.Struct(f"<{settable + state}d{counts}q")
    if _HEADER.size + layout.size != len(body):
        return DamagedState("the bytes are damaged (length)")
    numbers = layout.unpack_from(body, _HEADER.size)
    return SavedState(
        fingerprint.hex(),
        stage,
        start_time,
        time,
        numbers[:settable],
        numbers[settable : settable + state],
        numbers[settable + state :],
    )
