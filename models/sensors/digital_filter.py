"""The parts' digital low-passes.

sinc^2, a triangular window, is built from block sums instead of a delay line. With A = sum x_k and B = sum k x_k over
a block of n samples (k = 0..n-1), a triangle that rises over one block and falls over the next is
(B_previous + n A - B)/n^2. Read twice a block, it needs four half blocks; the partial sums of windows under way are
all that is kept.

Bartlett filters are read at every sample and are two moving averages over delay lines; their sums are of whole
numbers, so that they stay exact.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, NamedTuple

from ..record import Integer, Item, Real, Vector3
from ..scalar import Scalar, round_half_up, where


class BlockSums(NamedTuple):
    """A, B and the number of samples of the block under way; whose block it is gives A and B their unit."""

    a: float
    b: float
    samples: Annotated[float, Real("1", "samples in the block so far")]


EMPTY = BlockSums(0.0, 0.0, 0.0)


def with_samples(sums: BlockSums, before: Scalar, now: Scalar, count: float) -> BlockSums:
    """The block after `count` more samples on a straight line, the last of them `now`, the one ahead of them `before`.

    Sample i = 0..n-1 of them is before + (i + 1)/n (now - before).
    """
    a, b, samples = sums
    more = 0.5 * ((count - 1.0) * before + (count + 1.0) * now)
    late = (count * count - 1.0) / 3.0
    weighted = (0.5 * count * (count - 1.0) - late) * before + late * now
    return BlockSums(a + more, b + samples * more + weighted, samples + count)


def sinc2_decimated(rising: Scalar, a: Scalar, b: Scalar, n: Scalar) -> tuple[Scalar, Scalar]:
    """Output at the end of a block and the rising half kept for the next: y = (B_previous + n A - B)/n^2."""
    return (rising + n * a - b) / (n * n), b


class OverlappedWindows(NamedTuple):
    """Partial sums of the three triangles under way when a sinc^2 of 2n is read every n samples.

    They began one, two and three blocks ago.
    """

    first: float
    second: float
    third: float


def sinc2_overlapped(windows: OverlappedWindows, a: Scalar, b: Scalar, n: Scalar) -> tuple[Scalar, OverlappedWindows]:
    """Output of a triangle of half width 2n at the end of a block of n, and the windows under way.

    The weights over four blocks are k, n + k, 2n - k, n - k, with k = 0 for a block's first sample.
    """
    first, second, third = windows
    y = (third + n * a - b) / (4.0 * n * n)
    return y, OverlappedWindows(b, first + n * a + b, second + 2.0 * n * a - b)


def settled_windows(x: Scalar, n: Scalar) -> OverlappedWindows:
    """The windows after a long constant input x."""
    a, b = n * x, 0.5 * n * (n - 1.0) * x
    first, second = b, b + n * a + b
    return OverlappedWindows(first, second, second + 2.0 * n * a - b)


TAPS = (1, 2, 4, 8, 16, 32, 64)
MOST_TAPS = TAPS[-1]
BARTLETT_ITEMS = tuple(Item(f"bartlett_{taps}", f"ADIS16354: Bartlett window of {taps} taps") for taps in TAPS)
CONVERTER_STEPS = 64.0
"""Steps of the ADIS16354's converter in a register's LSB: assumption, fine enough not to show behind the filter."""


def taps_of(filter_kind: Scalar, first: int) -> Scalar:
    """Taps of the Bartlett filter that an enumeration value asks for, whose item of one tap is `first`."""
    taps: Scalar = 1.0
    for i in range(1, len(TAPS)):
        taps = where(filter_kind > first + i - 0.5, float(TAPS[i]), taps)
    return taps


def converted(value: Scalar, resolution: Scalar) -> Scalar:
    """Whole steps of the ADIS16354's converter."""
    return round_half_up(value * (CONVERTER_STEPS / resolution))


if TYPE_CHECKING:
    Line = tuple[float, ...]
else:
    Line = tuple[(float,) * MOST_TAPS]


class DelayLines(NamedTuple):
    """The two delay lines of a Bartlett filter, the newest sample first."""

    samples: Annotated[Line, Integer("sample of the converter", hidden=True)]
    averages: Annotated[Line, Integer("sum of the first moving average", hidden=True)]


class BartlettSums(NamedTuple):
    """The sums under way of the two moving averages."""

    first: Annotated[float, Integer("sum over the samples", hidden=True)]
    second: Annotated[float, Integer("sum over the sums", hidden=True)]


def settled_bartlett(code: Scalar, taps: Scalar) -> tuple[BartlettSums, DelayLines]:
    """The filter after a long constant input."""
    return BartlettSums(taps * code, taps * taps * code), DelayLines((code,) * MOST_TAPS, (taps * code,) * MOST_TAPS)


def bartlett(sums: BartlettSums, lines: DelayLines, code: Scalar, taps: int) -> tuple[Scalar, BartlettSums, DelayLines]:
    """y = (sum of the last N sums of the last N samples)/N^2 and the filter after it; 2N - 1 coefficients."""
    first = sums.first + code - lines.samples[taps - 1]
    second = sums.second + first - lines.averages[taps - 1]
    after = DelayLines(
        (code, *lines.samples[: taps - 1], *lines.samples[taps:]),
        (first, *lines.averages[: taps - 1], *lines.averages[taps:]),
    )
    return second / float(taps * taps), BartlettSums(first, second), after


class FourTaps(NamedTuple):
    """Weights of the newest sample and the three before it."""

    newest: float
    second: float
    third: float
    oldest: float


def delaying_taps(delay: Scalar, curvature: Scalar) -> FourTaps:
    """Weights of unit gain, a delay of 1..2 samples and |H| = 1 - curvature (1 - cos w) + ... for low frequencies w.

    With l = delay - 1 they are (1 - l) (a, 1 - 2a, a, 0) + l (0, a, 1 - 2a, a), 2a + l (1 - l) = curvature.
    """
    late = delay - 1.0
    early = 1.0 - late
    side = 0.5 * (curvature - late * early)
    middle = 1.0 - 2.0 * side
    return FourTaps(early * side, early * middle + late * side, early * side + late * middle, late * side)


def four_tapped(taps: FourTaps, x: Vector3, before: tuple[Vector3, Vector3, Vector3]) -> Vector3:
    """The weighted sum of a sample and the three before it, on each axis."""
    a, b, c = before
    return (
        taps[0] * x[0] + taps[1] * a[0] + taps[2] * b[0] + taps[3] * c[0],
        taps[0] * x[1] + taps[1] * a[1] + taps[2] * b[1] + taps[3] * c[1],
        taps[0] * x[2] + taps[1] * a[2] + taps[2] * b[2] + taps[3] * c[2],
    )
