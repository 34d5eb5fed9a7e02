"""How far a stable loop of several inputs is from instability.

    L = -K P at the plant's inputs,  S = (1 + L)^-1

`disk_margin` alpha: every input's loop may at once change by any complex factor (1 + d/2)/(1 - d/2), |d| < alpha:
by a gain from (2 - alpha)/(2 + alpha) to its inverse, or by a phase of 2 atan(alpha/2), in each loop by its own amount.
Source: Seiler, Packard, Gahinet, "An Introduction to Disk Margins", IEEE CSM 40(5), 2020.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np

from .conditioning import Array
from .responses import Complex

_STEPS = (1.0, 0.25, 0.0625)
"""Of the logarithms of scalings."""

_REAL = 1e-2
"""Largest |imaginary/real| of a gain at rest, or at Nyquist's frequency, that is taken as real there."""

_GAIN = 1e-4
"""Part of a norm for which no further scaling is tried."""


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
    """Margins of one gain of a stable loop, from next to rest to Nyquist's frequency.

    A real pole leaves the circle at 1 or -1, where the gain is real without crossing the axis: both ends count.
    """
    size, imaginary = np.log(np.abs(gain)), gain.imag
    across = np.flatnonzero(np.diff(np.sign(size)))
    share = size[across] / (size[across] - size[across + 1])
    at = gain[across] + share * (gain[across + 1] - gain[across])
    phase = np.abs(np.angle(-at)).min(initial=np.pi)
    crossover = frequencies[across] + share * np.diff(frequencies)[across]
    real_axis = np.flatnonzero(np.diff(np.sign(imaginary)))
    share = imaginary[real_axis] / (imaginary[real_axis] - imaginary[real_axis + 1])
    real = gain.real[real_axis] + share * np.diff(gain.real)[real_axis]
    ends = gain[[0, -1]]
    real = np.concatenate([real, ends.real[np.abs(ends.imag) < _REAL * np.abs(ends.real)]])
    factors = -1.0 / real[real < 0.0]
    return Margins(
        float(crossover.max(initial=0.0)),
        float(phase),
        float(factors[factors > 1.0].min(initial=np.inf)),
        float(factors[factors < 1.0].max(initial=0.0)),
        float(np.abs(1.0 / (1.0 + gain)).max()),
    )


def disk_margin(S: Complex) -> Array:
    """alpha at each frequency: 1/mu(S - 1/2) for diagonal uncertainty, exact for up to three loops.

    mu is the least norm of D (S - 1/2) D^-1 over diagonal D, whose logarithm is sought along all diagonals by ever
    smaller steps; any D gives a bound on the safe side.
    """
    M = S - 0.5 * np.eye(S.shape[-1])
    ways = [np.array(way) for way in product((-1.0, 0.0, 1.0), repeat=S.shape[-1] - 1) if any(way)]
    scales = np.zeros((len(M), S.shape[-1]))
    worst = _scaled_norm(M, scales)
    for step in _STEPS:
        moving = np.arange(len(M))
        while len(moving):
            start = worst[moving]
            for way in ways:
                tried = scales[moving] + step * np.concatenate([[0.0], way])
                norm = _scaled_norm(M[moving], tried)
                better = norm < worst[moving] * (1.0 - _GAIN)
                scales[moving[better]], worst[moving[better]] = tried[better], norm[better]
            moving = moving[worst[moving] < start]
    return np.asarray(1.0 / worst)


def _scaled_norm(M: Complex, scales: Array) -> Array:
    d = np.exp(scales)
    return np.asarray(np.linalg.norm(M * d[:, :, None] / d[:, None, :], 2, axis=(1, 2)))


def phase_of(alpha: float) -> float:
    """2 atan(alpha/2): phase (rad) that a disk margin stands for."""
    return float(2.0 * np.arctan(0.5 * alpha))


def gain_of(alpha: float) -> float:
    """(2 + alpha)/(2 - alpha): factor of gain, up and down, that a disk margin stands for."""
    return float((2.0 + alpha) / (2.0 - alpha)) if alpha < 2.0 else np.inf
