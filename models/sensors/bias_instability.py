"""In-run bias instability: flicker noise as a sum of first-order Gauss-Markov processes.

x_i <- exp(-h/tau_i) x_i + sigma sqrt(1 - exp(-2h/tau_i)) w, tau_i spaced by the ratio r = 10,
sigma = B sqrt(ln r / pi) each. Its Allan deviation stays within 2.3 % of 0.664 B from 1 s to 1000 s.
"""

from __future__ import annotations

from ..record import Vector3
from ..scalar import Scalar, exp, sqrt
from ..vectors import ZERO3

TIME_CONSTANTS = (0.1, 1.0, 10.0, 100.0, 1e3, 1e4)
"""tau_i in s: flat from 1 s to 1000 s."""

PROCESSES = len(TIME_CONSTANTS)
SIGMA_PER_INSTABILITY = 0.8561
"""sqrt(ln 10 / pi)."""

Processes = tuple[Vector3, Vector3, Vector3, Vector3, Vector3, Vector3]
STILL: Processes = (ZERO3, ZERO3, ZERO3, ZERO3, ZERO3, ZERO3)


def decays(period: Scalar) -> tuple[Scalar, ...]:
    """exp(-h/tau_i)."""
    return tuple(exp(-period / tau) for tau in TIME_CONSTANTS)


def stepped(x: Processes, decay: tuple[Scalar, ...], sigma: Scalar, draws: tuple[Scalar, ...]) -> Processes:
    """The processes one period later."""
    after = []
    for i in range(PROCESSES):
        a = decay[i]
        drive = sigma * sqrt(1.0 - a * a)
        u, v, w = x[i]
        after.append((a * u + drive * draws[3 * i], a * v + drive * draws[3 * i + 1], a * w + drive * draws[3 * i + 2]))
    return tuple(after)  # type: ignore[return-value]


def total(x: Processes) -> Vector3:
    """Sum of the processes of each axis."""
    sums = [x[0][axis] for axis in range(3)]
    for process in x[1:]:
        for axis in range(3):
            sums[axis] = sums[axis] + process[axis]
    return sums[0], sums[1], sums[2]
