"""The chamber's air."""

from __future__ import annotations

import math

import pytest

from attitude_fmu.models.plants.turntable_chamber import Air, Chamber, aired, is_at

CHAMBER = Chamber(ramp_limit=0.5, time_constant=40.0)


def after(time: float, period: float, target: float) -> Air:
    air = Air(293.15, 293.15)
    for _ in range(round(time / period)):
        air = aired(CHAMBER, air, target, period)
    return air


@pytest.mark.parametrize("period", [1e-2, 0.1, 1.0])
def test_air_follows_the_ramp_late_and_then_decays_to_the_target(period: float) -> None:
    """T = s - r tau (1 - exp(-t/tau)) while the setpoint s runs at r, then exponentially; at any period."""
    ramping = after(20.0, period, 313.15)
    lag = 0.5 * 40.0 * (1.0 - math.exp(-20.0 / 40.0))
    assert ramping.setpoint == pytest.approx(303.15, abs=1e-9)
    assert ramping.temperature == pytest.approx(303.15 - lag, abs=1e-9)
    left = 0.5 * 40.0 * (1.0 - math.exp(-1.0)) * math.exp(-60.0 / 40.0)
    assert after(100.0, period, 313.15).temperature == pytest.approx(313.15 - left, abs=1e-9)


def test_rows_wait_for_the_air_only_if_told_to() -> None:
    air = Air(313.15, 312.0)
    assert not is_at(CHAMBER, air, 313.15)
    assert is_at(CHAMBER._replace(tolerance=2.0), air, 313.15)
    assert is_at(CHAMBER._replace(wait=False), air, 313.15)
