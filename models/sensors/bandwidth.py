"""A first-order low-pass, dx/dt = 2 pi f (u - x), stepped so that the mean of x then and now has its corner at f.

With gain g = 2 t/(1 + t), t = tan(pi f h), and x stepped by x + g (u - x), the mean (x_before + x)/2 is the bilinear
transform of the low-pass, warped to be exact at f; its delay is 1/(2 pi f) within (pi f h)^2/3 of it.
"""

from __future__ import annotations

from ..scalar import PI, Scalar, cos, minimum, sin


def low_pass_gain(bandwidth: Scalar, period: Scalar) -> Scalar:
    """Share of the difference that x goes in `period` s; f in Hz. All of it where f is a quarter of 1/h or more."""
    angle = minimum(PI * bandwidth * period, 0.25 * PI)
    tangent = sin(angle) / cos(angle)
    return 2.0 * tangent / (1.0 + tangent)


def low_pass(x: Scalar, u: Scalar, gain: Scalar) -> Scalar:
    """x + gain (u - x)."""
    return x + gain * (u - x)
