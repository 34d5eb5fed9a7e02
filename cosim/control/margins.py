"""How far a loop of several inputs is from instability.

    L = -K P at the plant's inputs,  S = (1 + L)^-1

`disk_margin` alpha: every input's loop may at once change by any complex factor (1 + d/2)/(1 - d/2), |d| < alpha:
by a gain from (2 - alpha)/(2 + alpha) to its inverse, or by a phase of 2 atan(alpha/2), in each loop by its own amount.
Source: Seiler, Packard, Gahinet, "An Introduction to Disk Margins", IEEE CSM 40(5), 2020.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import optimize  # type: ignore[import-untyped]

from .conditioning import Array
from .responses import Complex


class Margins(NamedTuple):
    """Of one loop, the others closed.

    `crossover` (Hz): the last frequency with |L| = 1; `phase` (rad): the least at any crossover; `gain_up` and
    `gain_down`: by what the gain may be multiplied; `peak`: the largest |S|.
    """

    crossover: float
    phase: float
    gain_up: float
    gain_down: float
    peak: float


def sensitivity(L: Complex) -> Complex:
    """(1 + L)^-1 at each frequency."""
    return np.asarray(np.linalg.inv(np.eye(L.shape[-1]) + L))


def loop_at_a_time(S: Complex) -> Complex:
    """1/S_ii - 1: the loop gain of each input with the others closed; frequencies x inputs."""
    return np.asarray(1.0 / np.einsum("fii->fi", S) - 1.0)


def margins(gain: Complex, frequencies: Array) -> Margins:
    """Margins of one loop gain."""
    size, imaginary = np.log(np.abs(gain)), gain.imag
    across = np.flatnonzero(np.diff(np.sign(size)))
    share = size[across] / (size[across] - size[across + 1])
    at = gain[across] + share * (gain[across + 1] - gain[across])
    phase = np.abs(np.angle(-at)).min(initial=np.pi)
    crossover = frequencies[across] + share * np.diff(frequencies)[across]
    real_axis = np.flatnonzero(np.diff(np.sign(imaginary)))
    share = imaginary[real_axis] / (imaginary[real_axis] - imaginary[real_axis + 1])
    real = gain.real[real_axis] + share * np.diff(gain.real)[real_axis]
    factors = -1.0 / real[real < 0.0]
    return Margins(
        float(crossover.max(initial=0.0)),
        float(phase),
        float(factors[factors > 1.0].min(initial=np.inf)),
        float(factors[factors < 1.0].max(initial=0.0)),
        float(np.abs(1.0 / (1.0 + gain)).max()),
    )


def disk_margin(S: Complex) -> Array:
    """alpha at each frequency: 1/mu(S - 1/2) for diagonal uncertainty, exact for up to three loops."""
    found, scales = np.empty(len(S)), np.zeros(S.shape[-1] - 1)
    for k, M in enumerate(S - 0.5 * np.eye(S.shape[-1])):
        scales, worst = _least_scaled_norm(M, scales)
        found[k] = 1.0 / worst
    return found


def _least_scaled_norm(M: Complex, start: Array) -> tuple[Array, float]:
    def norm(scales: Array) -> float:
        d = np.exp(np.concatenate([[0.0], scales]))
        return float(np.linalg.norm(M * d[:, None] / d, 2))

    if not start.size:
        return start, norm(start)
    # coarse is enough: any scaling gives a bound on the safe side
    options = {"xatol": 1e-2, "fatol": 1e-3, "maxiter": 80}
    best = optimize.minimize(norm, start, method="Nelder-Mead", options=options)
    return np.asarray(best.x), float(best.fun)


def phase_of(alpha: float) -> float:
    """2 atan(alpha/2): phase (rad) that a disk margin stands for."""
    return float(2.0 * np.arctan(0.5 * alpha))


def gain_of(alpha: float) -> float:
    """(2 + alpha)/(2 - alpha): factor of gain, up and down, that a disk margin stands for."""
    return float((2.0 + alpha) / (2.0 - alpha)) if alpha < 2.0 else np.inf
