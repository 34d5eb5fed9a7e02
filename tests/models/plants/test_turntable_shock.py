"""Shocks hand over their speed, whatever the period."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest

from attitude_fmu.models.plants.turntable_shock import Shock, mean_acceleration, pulse_length, speed_felt


def felt_speed(shock: Shock, period: float, time: float) -> list[float]:
    ticks = [speed_felt(shock, k * period) for k in range(round(time / period) + 1)]
    pulses = [mean_acceleration(shock, a, b, period) for a, b in pairwise(ticks)]
    return (np.sum(pulses, axis=0) * period).tolist()


@pytest.mark.parametrize("period", [1e-3, 7e-3])
@pytest.mark.parametrize("pulses", [1, 3])
def test_pulses_hand_over_their_area(period: float, pulses: int) -> None:
    """2/pi peak duration each, shorter or longer than a period, off its grid."""
    shock = Shock((30.0, 0.0, -10.0), 0.1234, 3.3e-3, pulses, 0.2)
    expected = np.array(shock.peak) * 2.0 / math.pi * shock.duration * pulses
    assert felt_speed(shock, period, 2.1) == pytest.approx(expected.tolist(), rel=1e-9)


def test_a_long_pulse_is_a_half_sine() -> None:
    shock = Shock((5.0, 0.0, 0.0), 1.0, 0.5)
    mean = mean_acceleration(shock, speed_felt(shock, 1.2 - 5e-4), speed_felt(shock, 1.2 + 5e-4), 1e-3)
    assert mean[0] == pytest.approx(5.0 * math.sin(math.pi * 0.2 / 0.5), rel=1e-5)


def test_nothing_is_felt_before_the_start_or_after_the_last_pulse() -> None:
    shock = Shock((5.0, 0.0, 0.0), 1.0, 0.01, 2, 0.5)
    assert speed_felt(shock, 0.999) == 0.0
    assert speed_felt(shock, 1.3) == 1.0
    assert speed_felt(shock, 100.0) == 2.0


def test_a_rebound_follows_at_once_the_other_way_and_gives_the_speed_back() -> None:
    shock = Shock((5.0, 0.0, 0.0), 1.0, 0.5, rebound=1.0)
    for time, sign in ((1.2, 1.0), (1.7, -1.0)):
        mean = mean_acceleration(shock, speed_felt(shock, time - 5e-4), speed_felt(shock, time + 5e-4), 1e-3)
        assert mean[0] == pytest.approx(sign * 5.0 * math.sin(math.pi * 0.2 / 0.5), rel=1e-5)
    assert speed_felt(shock, 1.5) == 1.0
    assert speed_felt(shock, 1.0 + pulse_length(shock)) == pytest.approx(0.0, abs=1e-15)


@pytest.mark.parametrize("rebound", [0.3, 1.4])
def test_pulses_with_a_rebound_leave_what_it_does_not_give_back(rebound: float) -> None:
    shock = Shock((30.0, 0.0, -10.0), 0.1234, 3.3e-3, 3, 0.2, rebound)
    expected = np.array(shock.peak) * 2.0 / math.pi * shock.duration * 3 * (1.0 - rebound)
    assert felt_speed(shock, 1e-3, 2.1) == pytest.approx(expected.tolist(), rel=1e-9)
