"""Friction of a moving joint as a linear one: statistical linearisation of LuGre.

    T = k q + c w + e

k and c fit the torque in the least-squares sense to a Gaussian motion q, w = q' of a given spectrum; the rest e is a
disturbance. At rest k is the bristles' stiffness; once the motion is as wide as the bristles bend, it falls by a
factor of ten, and e takes its place.
Source of the method: Booton, "Nonlinear control systems with random inputs", IRE Trans. CT-1 (1954) 9.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import signal  # type: ignore[import-untyped]

from attitude_fmu.models.plants.friction import LuGre, bristle_after, friction_torque

from .conditioning import Array

_DURATION = 60.0
_STEP = 1e-3
_SEGMENT = 8192
_LOW = 1.0
"""Hz; below it the density is taken as flat."""


class EquivalentFriction(NamedTuple):
    """Stiffness k (N.m/rad), damping c (N.m.s/rad), and the one-sided density of e (N2.m2/Hz) at frequencies (Hz)."""

    stiffness: float
    damping: float
    frequencies: Array
    density: Array

    @property
    def rms(self) -> float:
        """Of e, N.m."""
        return float(np.sqrt(np.trapezoid(self.density, self.frequencies)))

    @property
    def corner(self) -> float:
        """Of the first-order low-pass that has e's rms and its density at low frequencies, Hz."""
        low = self.density[self.frequencies < _LOW].mean()
        return float(2.0 / np.pi * self.rms**2 / low)

    def rest_at(self, frequencies: Array) -> Array:
        """The density of e at other frequencies; what is slower than the analysed record is as at its end."""
        return np.interp(frequencies, self.frequencies, self.density, right=0.0)


def equivalent_friction(friction: LuGre, frequencies: Array, motion: Array, seed: int) -> EquivalentFriction:
    """The linear friction for a Gaussian motion of one-sided density `motion` (rad2/Hz) at `frequencies` (Hz)."""
    angle, rate = gaussian_motion(frequencies, motion, seed)
    torque, bristle = np.empty(len(rate)), 0.0
    for k, w in enumerate(rate.tolist()):
        bristle = bristle_after(friction, bristle, w, _STEP)
        torque[k] = friction_torque(friction, bristle, w)
    torque -= torque.mean()
    fitted = np.stack([angle, rate], axis=1)
    (stiffness, damping), *_ = np.linalg.lstsq(fitted, torque, rcond=None)
    found, density = signal.welch(torque - fitted @ [stiffness, damping], 1.0 / _STEP, nperseg=_SEGMENT)
    return EquivalentFriction(float(stiffness), float(damping), found[1:], density[1:])


def gaussian_motion(frequencies: Array, motion: Array, seed: int) -> tuple[Array, Array]:
    """Angle (rad) and rate (rad/s) every 1 ms for 60 s, with random phases; what is slower than 1/60 Hz is left out."""
    samples = round(_DURATION / _STEP)
    at = np.fft.rfftfreq(samples, _STEP)
    size = np.sqrt(np.interp(at, frequencies, motion, right=0.0) / _DURATION)
    random = np.random.default_rng(seed)
    # a one-sided density S gives sines of mean square S df, of random size and phase
    line = 0.5 * samples * size * (random.standard_normal(len(at)) + 1j * random.standard_normal(len(at)))
    line[0] = 0.0
    return np.fft.irfft(line, samples), np.fft.irfft(2j * np.pi * at * line, samples)
