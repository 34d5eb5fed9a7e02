"""Scalar Kalman filter with A = H = 1 on an angle (Jing & Gao 2021, eqs. 14-18).

P- = P + Q,  K = P-/(P- + R),  y <- y + K (x - y),  P = (1 - K) P-
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real
from ..scalar import PI, Scalar, wrap

_SQUARE_DEGREE = (PI / 180.0) * (PI / 180.0)


class KalmanParameters(NamedTuple):
    """Variances by step: Q as printed in the paper, R from its noise (1.36 deg)."""

    Q: Annotated[
        float, Real("rad2", "variance of the angle's change in a step", min=0.0, display="deg2", tunable=True)
    ] = 0.018 * _SQUARE_DEGREE
    R: Annotated[float, Real("rad2", "variance of a measured angle", min=1e-18, display="deg2", tunable=True)] = (
        1.84 * _SQUARE_DEGREE
    )


def kalman_filtered(y: Scalar, variance: Scalar, angle: Scalar, q: Scalar, r: Scalar) -> tuple[Scalar, Scalar]:
    """The angle on the circle and its variance after one more measurement."""
    predicted = variance + q
    gain = predicted / (predicted + r)
    return wrap(y + gain * wrap(angle - y)), (1.0 - gain) * predicted
