"""The parts' digital low-pass: sinc^2, a triangular window, built from block sums instead of a delay line.

With A = sum x_k and B = sum k x_k over a block of n samples (k = 1..n), a triangle that rises over one block and
falls over the next is (B_previous + n A - B)/n^2. Read twice a block, it needs four half blocks; the partial sums of
windows under way are all that is kept.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real
from ..scalar import Scalar


class BlockSums(NamedTuple):
    """A, B and the number of samples of the block under way; whose block it is gives A and B their unit."""

    a: float
    b: float
    samples: Annotated[float, Real("1", "samples in the block so far")]


EMPTY = BlockSums(0.0, 0.0, 0.0)


def with_samples(sums: BlockSums, x: Scalar, count: float) -> BlockSums:
    """The block after `count` more samples of the same value."""
    a, b, samples = sums
    return BlockSums(a + count * x, b + count * x * (samples + 0.5 * (count + 1.0)), samples + count)


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

    The weights over four blocks are k, n + k, 2n - k, n - k.
    """
    first, second, third = windows
    y = (third + n * a - b) / (4.0 * n * n)
    return y, OverlappedWindows(b, first + n * a + b, second + 2.0 * n * a - b)


def settled_windows(x: Scalar, n: Scalar) -> OverlappedWindows:
    """The windows after a long constant input x."""
    a, b = n * x, 0.5 * n * (n + 1.0) * x
    first, second = b, b + n * a + b
    return OverlappedWindows(first, second, second + 2.0 * n * a - b)
