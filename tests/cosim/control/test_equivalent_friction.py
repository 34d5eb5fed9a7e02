"""Friction as a linear one: bristles where the motion is small, a describing function where it is large."""

from __future__ import annotations

import numpy as np
import pytest

from attitude_fmu.cosim.control.equivalent_friction import EquivalentFriction, equivalent_friction, gaussian_motion
from attitude_fmu.models.plants.friction import Friction, lugre

PRESLIDING = 5e-4
CONSTANTS = lugre(Friction(static_ratio=1.0, presliding=PRESLIDING), 1e-3)
F = np.linspace(0.02, 20.0, 1000)


def band(rms: float, low: float = 0.5, high: float = 5.0) -> np.ndarray:
    """A flat density between two frequencies."""
    return np.where((low <= F) & (high >= F), rms**2 / (high - low), 0.0)


def test_motion_has_its_density_and_its_rate_is_its_derivative() -> None:
    angle, rate = gaussian_motion(F, band(0.3), seed=1)
    # 2 x 270 squares of Gaussian numbers make the variance: 6 % of one deviation, hence 3 % of the rms; four of them
    assert np.std(angle) == pytest.approx(0.3, rel=0.12)
    # central differences of 5 Hz at 1 ms are off by (2 pi f dt)^2/6
    assert np.allclose(np.gradient(angle, 1e-3)[1:-1], rate[1:-1], atol=2e-4 * np.abs(rate).max())
    assert np.array_equal(gaussian_motion(F, band(0.3), seed=1)[0], angle)


def test_small_motion_meets_the_bristles() -> None:
    one = equivalent_friction(CONSTANTS, F, band(1e-3 * PRESLIDING), seed=2)
    # the bristle slips by the way between two turns over presliding, a few times 1e-3
    assert one.stiffness == pytest.approx(CONSTANTS.stiffness, rel=5e-3)
    assert one.damping == pytest.approx(CONSTANTS.damping + CONSTANTS.viscous, rel=5e-2)
    assert one.rms < 1e-2 * CONSTANTS.stiffness * 1e-3 * PRESLIDING


def test_large_motion_meets_coulombs_describing_function() -> None:
    rms = 1e3 * PRESLIDING
    constants = CONSTANTS._replace(damping=0.0)  # which makes spikes where a fast motion turns
    one = equivalent_friction(constants, F, band(rms), seed=3)
    rate = gaussian_motion(F, band(rms), seed=3)[1]
    # T = Tc sign(w): c = Tc E|w| / E w^2 = sqrt(2/pi) Tc/sigma; bristles turn late, by 1e-3 of the motion
    c = one.damping - CONSTANTS.viscous
    assert c == pytest.approx(CONSTANTS.coulomb * np.abs(rate).mean() / (rate**2).mean(), rel=1e-2)
    # E|w| of a record of 270 independent lines is Gaussian's within a few per cent
    assert c == pytest.approx(np.sqrt(2.0 / np.pi) * CONSTANTS.coulomb / rate.std(), rel=0.05)
    assert one.stiffness < 1e-2 * CONSTANTS.stiffness
    # what is left of a sign: Tc^2 (1 - 2/pi); Welch's estimate leaves the band above Nyquist and its first bin out
    assert one.rms == pytest.approx(CONSTANTS.coulomb * np.sqrt(1.0 - 2.0 / np.pi), rel=0.05)


def test_wider_motion_is_held_softer() -> None:
    found = [equivalent_friction(CONSTANTS, F, band(x * PRESLIDING), seed=4).stiffness for x in (0.01, 0.3, 1.0, 10.0)]
    assert found == sorted(found, reverse=True)


def test_low_pass_of_the_rest_has_its_power_and_its_slow_density() -> None:
    f, corner = np.linspace(0.01, 5e3, 500_000), 7.0
    one = EquivalentFriction(1.0, 1.0, f, 4.0 / (1.0 + (f / corner) ** 2))
    # below 1 Hz the density falls by 1 % and above 5 kHz lies a thousandth of the power
    assert one.corner == pytest.approx(corner, rel=1e-2)
    assert one.rms == pytest.approx(np.sqrt(0.5 * np.pi * 4.0 * corner), rel=2e-3)


def test_rest_is_flat_below_the_analysed_record_and_none_above() -> None:
    one = EquivalentFriction(1.0, 1.0, np.array([1.0, 2.0]), np.array([5.0, 3.0]))
    assert one.rest_at(np.array([0.1, 1.0, 1.5, 2.5])).tolist() == [5.0, 5.0, 4.0, 0.0]
