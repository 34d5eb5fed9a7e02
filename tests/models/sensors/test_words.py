"""Register words: doubles in place of integers, each function against Python's own bit operators."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from attitude_fmu.models.sensors import words

WORDS = st.integers(0, 2**32 - 1)
WIDTHS = st.integers(1, 32)


@given(st.integers(-(2**31), 2**32 - 1), WIDTHS)
def test_pattern_and_signed_are_masks_and_sign_extension(value: int, bits: int) -> None:
    masked = value & (1 << bits) - 1
    assert words.pattern(float(value), bits) == masked
    assert words.signed(float(value), bits) == masked - ((masked >> bits - 1) << bits)


@given(WORDS, st.integers(0, 31), WIDTHS)
def test_a_field_is_what_a_shift_and_a_mask_give(word: int, lowest: int, bits: int) -> None:
    assert words.field(float(word), lowest, bits) == word >> lowest & (1 << bits) - 1


@given(WORDS, st.integers(0, 24), st.integers(1, 8), st.integers(-128, 255))
def test_a_field_put_in_leaves_the_other_bits_alone(word: int, lowest: int, bits: int, value: int) -> None:
    mask = (1 << bits) - 1 << lowest
    assert words.with_field(float(word), lowest, bits, float(value)) == word & ~mask | value << lowest & mask


@given(st.lists(st.booleans(), min_size=1, max_size=16))
def test_flags_are_the_bits_of_a_number_highest_first(switches: list[bool]) -> None:
    assert words.flags([float(switch) for switch in switches]) == int("".join(str(int(s)) for s in switches), 2)


def test_parity_is_the_oddness_of_the_count_of_ones_for_every_16_bit_word() -> None:
    assert all(words.parity(float(word), 16) == word.bit_count() % 2 for word in range(2**16))


@given(WORDS, WIDTHS)
def test_parity_holds_for_every_width(word: int, bits: int) -> None:
    word &= (1 << bits) - 1
    assert words.parity(float(word), bits) == word.bit_count() % 2


@pytest.mark.parametrize("bits", [1, 2, 10, 13, 16, 20, 25, 26, 27, 31, 32])
def test_parity_is_exact_at_the_largest_words(bits: int) -> None:
    for word in (2**bits - 1, 2 ** (bits - 1), max(2**bits - 2, 0)):
        assert words.parity(float(word), bits) == word.bit_count() % 2


@pytest.mark.parametrize(
    ("value", "code"), [(0.4999, 0), (0.5, 1), (-0.5, 0), (-0.51, -1), (7.4, 7), (7.6, 7), (-8.4, -8), (-99.0, -8)]
)
def test_codes_are_the_nearest_that_the_word_can_hold(value: float, code: int) -> None:
    assert words.nearest_signed(value, 4) == code
    assert words.nearest_unsigned(value, 4) == max(round(value) if value > 7.5 else code, 0)
