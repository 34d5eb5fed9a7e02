"""The oscillator's transition is the matrix exponential."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm

from attitude_fmu.models.plants.second_order import natural_frequency, transition


@pytest.mark.parametrize("damping_ratio", [0.005, 0.7, 0.999999, 1.0])
@pytest.mark.parametrize("turn", [1e-6, 0.1, 3.0, 30.0])
def test_transition_is_the_matrix_exponential(damping_ratio: float, turn: float) -> None:
    """In units of w: the period is `turn`."""
    expected = expm(turn * np.array([[0.0, 1.0], [-1.0, -2.0 * damping_ratio]]))
    found = np.reshape(transition(turn / 1e-3, damping_ratio, 1e-3), (2, 2))
    np.testing.assert_allclose(found, expected, atol=2e-14 * max(turn, 1.0))


@pytest.mark.parametrize("damping_ratio", [0.1, 0.7, 1.0])
def test_gain_is_half_the_power_at_the_bandwidth(damping_ratio: float) -> None:
    r = 2.0 * math.pi * 30.0 / natural_frequency(30.0, damping_ratio)
    assert abs(1.0 / (1.0 - r * r + 2.0j * damping_ratio * r)) ** 2 == pytest.approx(0.5, rel=1e-12)
