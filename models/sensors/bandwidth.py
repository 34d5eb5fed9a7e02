"""The part's analogue bandwidth: dx/dt = 2 pi f (u - x), stepped exactly for a held input."""

from __future__ import annotations

from ..scalar import PI, Scalar, exp


def low_pass_gain(bandwidth: Scalar, period: Scalar) -> Scalar:
    """1 - exp(-2 pi f h): share of a step that a first-order low-pass takes over in `period` s; f in Hz."""
    return 1.0 - exp(-2.0 * PI * bandwidth * period)


def low_pass(x: Scalar, u: Scalar, gain: Scalar) -> Scalar:
    """x + gain (u - x)."""
    return x + gain * (u - x)
