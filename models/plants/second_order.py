"""An oscillator driven through its spring, x'' + 2 zeta w x' + w^2 x = w^2 u, exactly from tick to tick.

One period T takes the deviation from rest ``(x - u, x'/w)`` to ``Phi`` times it; y = w T, r = sqrt(1 - zeta^2) y::

    Phi = exp(-zeta y) (cos r + zeta y sinc r   y sinc r               )
                       (-y sinc r               cos r - zeta y sinc r  )
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real
from ..scalar import PI, Scalar, cos, exp, maximum, sin, sqrt

_LEAST_TURN = 1e-9
"""rad; sin(r)/r is 1 to the last bit there."""

_LEAST_SQUARE = 1e-18
"""Of sqrt(1 - zeta^2); keeps its slope finite at critical damping."""


class Transition(NamedTuple):
    """The matrix Phi, row by row."""

    a: Annotated[float, Real("1", "of the deviation to the deviation")]
    b: Annotated[float, Real("1", "of the scaled rate to the deviation")]
    c: Annotated[float, Real("1", "of the deviation to the scaled rate")]
    d: Annotated[float, Real("1", "of the scaled rate to the scaled rate")]


def transition(frequency: Scalar, damping_ratio: Scalar, period: Scalar) -> Transition:
    """Phi for the natural frequency w (rad/s) and a damping ratio up to 1."""
    y = frequency * period
    left = exp(-damping_ratio * y)
    turn = maximum(y * sqrt(maximum(1.0 - damping_ratio * damping_ratio, _LEAST_SQUARE)), _LEAST_TURN)
    b = left * y * sin(turn) / turn
    swing, lag = left * cos(turn), damping_ratio * b
    return Transition(swing + lag, b, -b, swing - lag)


def natural_frequency(bandwidth: Scalar, damping_ratio: Scalar) -> Scalar:
    """w (rad/s) of the oscillator whose gain is 3 dB down at `bandwidth` (Hz).

    w = 2 pi f / sqrt(k + sqrt(k^2 + 1)),  k = 1 - 2 zeta^2
    """
    k = 1.0 - 2.0 * damping_ratio * damping_ratio
    return 2.0 * PI * bandwidth / sqrt(k + sqrt(k * k + 1.0))
