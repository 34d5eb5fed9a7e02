from __future__ import annotations

import math
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from attitude_fmu.fmu_src.saved_state import STEPPING, TERMINATED, DamagedState, SavedState, from_bytes, to_bytes

FINGERPRINT = "0123456789abcdef" * 2
SAVED = SavedState(FINGERPRINT, STEPPING, 0.5, 1.25, (1.0, 298.15, 3.0), (-0.0, 5e-324), (7, 2**40))

doubles = st.lists(st.floats(allow_nan=True, allow_infinity=True), max_size=9)


def _bits(saved: SavedState) -> bytes:
    return struct.pack(f"<{len(saved.settable) + len(saved.state)}d", *saved.settable, *saved.state)


@given(doubles, doubles, st.lists(st.integers(0, 2**60), max_size=4), st.integers(0, TERMINATED))
def test_every_bit_survives(settable: list[float], state: list[float], counts: list[int], stage: int) -> None:
    saved = SavedState(FINGERPRINT, stage, 0.1, math.pi, tuple(settable), tuple(state), tuple(counts))
    back = from_bytes(to_bytes(saved))
    assert isinstance(back, SavedState)
    assert _bits(back) == _bits(saved)
    assert back[:4] == saved[:4]
    assert back.counts == saved.counts


@pytest.mark.parametrize("place", range(0, len(to_bytes(SAVED)), 7))
def test_a_flipped_bit_is_noticed(place: int) -> None:
    data = bytearray(to_bytes(SAVED))
    data[place] ^= 0x10
    assert isinstance(from_bytes(bytes(data)), DamagedState)


@pytest.mark.parametrize("data", [b"", b"aFMU", to_bytes(SAVED)[:-9], to_bytes(SAVED) + b"x", b"{}" * 100])
def test_other_bytes_are_noticed(data: bytes) -> None:
    assert isinstance(from_bytes(data), DamagedState)
