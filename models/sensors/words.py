"""Bits of register words held as doubles: two's complement, fields, flags and parity without bit operators.

A word of n bits is a whole number 0 .. 2^n - 1. Every function takes whole numbers and is exact for words of up to 32
bits; multiplications by powers of two and `floor` stand for shifts, differences for masks.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..scalar import Scalar, clip, floor, round_half_up

_WIDEST_PRODUCT = 26
"""Bits of q for which q (q + 1) is still exact in a double."""


def nearest_code(value: Scalar, low: float, high: float) -> Scalar:
    """Whole number nearest to a value in LSB, limited to low..high; halves go upwards."""
    return clip(round_half_up(value), low, high)


def nearest_signed(value: Scalar, bits: int) -> Scalar:
    """Whole number nearest to a value in LSB, limited to what two's complement of `bits` can hold."""
    half = 2.0 ** (bits - 1)
    return nearest_code(value, -half, half - 1.0)


def nearest_unsigned(value: Scalar, bits: int) -> Scalar:
    """Whole number nearest to a value in LSB, limited to 0 .. 2^bits - 1."""
    return nearest_code(value, 0.0, 2.0**bits - 1.0)


def pattern(value: Scalar, bits: int) -> Scalar:
    """Bit pattern, 0 .. 2^bits - 1, of a whole number in two's complement; higher bits are dropped."""
    return value - 2.0**bits * floor(2.0**-bits * value)


def signed(word: Scalar, bits: int) -> Scalar:
    """Whole number that the lowest `bits` of a word are in two's complement; higher bits are dropped."""
    return word - 2.0**bits * floor(2.0**-bits * word + 0.5)


def field(word: Scalar, lowest: int, bits: int) -> Scalar:
    """Unsigned number in `bits` of a word, counted from bit `lowest`."""
    return pattern(floor(2.0**-lowest * word), bits)


def with_field(word: Scalar, lowest: int, bits: int, value: Scalar) -> Scalar:
    """The word with its `bits` from `lowest` on replaced by the two's complement of a whole number."""
    return word + 2.0**lowest * (pattern(value, bits) - field(word, lowest, bits))


def flags(switches: Sequence[Scalar]) -> Scalar:
    """Number whose bits are these switches, each 0 or 1, the highest first."""
    word = switches[0]
    for switch in switches[1:]:
        word = 2.0 * word + switch
    return word


def odd(number: Scalar) -> Scalar:
    """1.0 where a whole number is odd, else 0.0."""
    return number - 2.0 * floor(0.5 * number)


def ones(word: Scalar, bits: int) -> Scalar:
    """Whole number as odd as the count of ones in a word of `bits`, in five operations for two bits.

    The triangular number q (q + 1)/2 = q + C(q, 2) is odd just where the lowest two bits of q differ (Lucas' theorem),
    whatever the higher bits are: nothing need be masked.
    """
    if bits > _WIDEST_PRODUCT:
        high = floor(2.0**-16 * word)
        return ones(high, bits - 16) + ones(word - 2.0**16 * high, 16)
    products = word * (word + 1.0)
    for _ in range((bits - 1) // 2):
        word = floor(0.25 * word)
        products = products + word * (word + 1.0)
    return 0.5 * products


def parity(word: Scalar, bits: int) -> Scalar:
    """1.0 where a word of `bits` has an odd count of ones, else 0.0."""
    return odd(ones(word, bits))
