"""White noise of a part, drawn once a block instead of once a sample.

A block of n samples enters the digital filter only by A = sum x_k and B = sum k x_k (k = 0..n-1). For white samples of
standard deviation s these two are Gaussian, so two draws give them exactly::

    A = s sqrt(n) z1
    B = (n - 1)/2 A + s sqrt(n (n^2 - 1)/12) z2
"""

from __future__ import annotations

from ..scalar import Scalar, sqrt


def sample_deviation(density: Scalar, sampling_frequency: Scalar) -> Scalar:
    """s = D sqrt(fs/2) of a one-sided density D."""
    return density * sqrt(0.5 * sampling_frequency)


def block_sums(deviation: Scalar, samples: Scalar, z1: Scalar, z2: Scalar) -> tuple[Scalar, Scalar]:
    """A and B of one block of white noise."""
    a = deviation * sqrt(samples) * z1
    return a, 0.5 * (samples - 1.0) * a + deviation * sqrt(samples * (samples * samples - 1.0) / 12.0) * z2
