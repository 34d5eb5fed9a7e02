"""Frequency responses of state spaces, and the jitter that a spectrum makes in an exposure.

    H(z) = C (z - A)^-1 B + D,   z = exp(2 pi j f dt)

A is brought to triangular form once, so that a thousand frequencies cost little more than one.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from .conditioning import Array, balancing

Complex = np.ndarray[Any, np.dtype[np.complex128]]


def response(A: Array, B: Array, C: Array, D: Array | float, frequencies: Array, dt: float) -> Complex:
    """H at each frequency (Hz): frequencies x outputs x inputs."""
    # states of very different size would cost digits
    scale = balancing(A, B, C)
    T, U = linalg.schur(A * scale / scale[:, None], output="complex")
    b, c = U.conj().T @ (B / scale[:, None]), (C * scale) @ U
    found: Complex = np.empty((len(frequencies), c.shape[0], b.shape[1]), complex)
    place = np.diag_indices(len(T))
    shifted = -T
    for k, z in enumerate(np.exp(2j * np.pi * frequencies * dt)):
        shifted[place] = z - T[place]
        found[k] = c @ linalg.solve_triangular(shifted, b, check_finite=False)
    return np.asarray(found + D)


def density(H: Complex, covariance: Array, dt: float) -> Array:
    """2 dt diag(H Q H'): one-sided spectral density of each output for white noise of covariance Q a step."""
    return np.asarray(2.0 * dt * np.einsum("fij,jk,fik->fi", H, covariance, H.conj()).real)


def exposure_share(frequencies: Array, exposure: float, dt: float) -> Array:
    """Part of the power at a frequency that is motion about the mean of an exposure of `exposure` seconds.

    1 - (sin(pi f N dt) / (N sin(pi f dt)))^2 for N samples of dt, 1 - sinc^2(f T) where dt is short.
    """
    samples = round(exposure / dt)
    below = samples * np.sin(np.pi * frequencies * dt)
    kept = np.sin(np.pi * frequencies * samples * dt) / np.where(below == 0.0, 1.0, below)
    return np.asarray(1.0 - np.where(below == 0.0, 1.0, kept) ** 2)


def jitter_of(spectrum: Array, frequencies: Array, exposure: float, dt: float) -> Array:
    """Rms of each signal about its mean in an exposure, from one-sided densities, frequencies x signals."""
    share = exposure_share(frequencies, exposure, dt)
    squares = np.trapezoid(spectrum * share.reshape(-1, *[1] * (spectrum.ndim - 1)), frequencies, axis=0)
    return np.asarray(np.sqrt(squares))
