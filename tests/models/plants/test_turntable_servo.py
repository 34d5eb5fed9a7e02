"""The servo against the equation that it solves."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from attitude_fmu.models.plants.turntable_reference import Reference
from attitude_fmu.models.plants.turntable_servo import AxisMotion, followed, servo

PERIOD = 2e-3
REST = AxisMotion(0.0, 0.0, 0.0)


def references(accelerations: list[float], period: float) -> list[Reference]:
    """A reference from rest on, by the acceleration of each period."""
    found = [Reference(0.0, 0.0)]
    for gained in accelerations:
        angle, rate = found[-1]
        found.append(Reference(angle + (rate + 0.5 * gained * period) * period, rate + gained * period))
    return found


def response(reference: list[Reference], bandwidth: float, damping_ratio: float, period: float) -> list[AxisMotion]:
    constants = servo(bandwidth, damping_ratio, period)
    found = [REST]
    for before, after in pairwise(reference):
        found.append(followed(constants, found[-1], before, after.angle, period))
    return found


@pytest.mark.parametrize("damping_ratio", [0.2, 0.7, 1.0])
def test_ticks_are_the_exact_solution_for_a_reference_of_parabolas(damping_ratio: float) -> None:
    """An adaptive solver of the continuous equation agrees to its tolerance."""
    accelerations = [100.0, 100.0, -40.0, 0.0, 0.0, 0.0, -60.0, -100.0, 50.0, 0.0]
    reference = references(accelerations, PERIOD)
    w = servo(20.0, damping_ratio, PERIOD).frequency
    y, expected = np.zeros(2), [np.zeros(2)]
    for (angle, rate), gained in zip(reference, accelerations, strict=False):

        def slope(t: float, y: Any, angle: float = angle, rate: float = rate, gained: float = gained) -> list[float]:
            r = angle + rate * t + 0.5 * gained * t * t
            return [y[1], w * w * (r - y[0]) - 2.0 * damping_ratio * w * y[1]]

        y = solve_ivp(slope, (0.0, PERIOD), y, rtol=1e-11, atol=1e-13, method="DOP853").y[:, -1]
        expected.append(y)
    found = response(reference, 20.0, damping_ratio, PERIOD)
    np.testing.assert_allclose([one[:2] for one in found], expected, atol=1e-10)
    last = found[-1]
    wanted = w * w * (reference[-1].angle - last.angle) - 2.0 * damping_ratio * w * last.rate
    assert last.acceleration == pytest.approx(wanted, rel=1e-9)


def test_a_ramp_is_followed_late_by_twice_the_damping_over_the_frequency() -> None:
    constants = servo(30.0, 0.7, PERIOD)
    reference = references([100.0] + [0.0] * 1000, PERIOD)
    last = response(reference, 30.0, 0.7, PERIOD)[-1]
    assert last.rate == pytest.approx(0.2, rel=1e-12)
    assert reference[-1].angle - last.angle == pytest.approx(0.2 * constants.lag, rel=1e-9)


def test_a_constant_acceleration_is_followed_with_itself() -> None:
    last = response(references([0.5] * 1000, PERIOD), 30.0, 0.7, PERIOD)[-1]
    assert last.acceleration == pytest.approx(0.5, rel=1e-6)  # roundings of 1e-16 rad, times w^2


def test_a_sine_at_the_bandwidth_loses_3_db() -> None:
    """Parabolas through the ticks miss the sine between them by less than (2 pi f T)^3/60, 1e-4."""
    period, bandwidth = 1e-3, 30.0
    w = 2.0 * math.pi * bandwidth
    times = period * np.arange(3001)
    reference = [Reference(math.sin(w * t), w * math.cos(w * t)) for t in times]
    angles = np.array([one.angle for one in response(reference, bandwidth, 0.7, period)])[1000:-1]
    gain = 2.0 * abs(np.mean(angles * np.exp(-1.0j * w * times[1000:-1])))
    assert gain == pytest.approx(math.sqrt(0.5), rel=2e-4)


def test_a_settled_axis_is_exactly_at_rest() -> None:
    found = response([Reference(0.0, 0.0)] + [Reference(0.3, 0.0)] * 1000, 30.0, 0.7, 1e-3)
    assert found[-1] == AxisMotion(0.3, 0.0, 0.0)
