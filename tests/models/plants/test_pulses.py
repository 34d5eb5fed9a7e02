"""Pulses hand over their impulse, once or again and again."""

from __future__ import annotations

import pytest

from attitude_fmu.models.plants.pulses import (
    Knock,
    Shutter,
    half_sine_share,
    knock_share,
    shutter_length,
    shutter_shares,
)


def test_half_sine_hands_over_its_area() -> None:
    assert half_sine_share(-1e-3, 4e-3) == 0.0
    assert half_sine_share(2e-3, 4e-3) == pytest.approx(0.5)
    assert half_sine_share(5e-3, 4e-3) == 1.0


@pytest.mark.parametrize(
    ("period", "time", "blows"), [(0.0, 100.0, 1.0), (2.0, 0.5, 0.0), (2.0, 6.9, 3.0), (2.0, 7.5, 4.0)]
)
def test_knocks_are_counted(period: float, time: float, blows: float) -> None:
    assert knock_share(Knock(start=1.0, period=period), time) == pytest.approx(blows)


def test_the_shutter_gives_back_what_it_takes() -> None:
    shutter = Shutter(start=1.0, period=2.0, exposure=0.02, lag=0.05, travel=4e-3, width=2e-3)
    assert shutter_shares(shutter, 0.99) == (0.0, 0.0)
    assert shutter_shares(shutter, 1.003) == pytest.approx((0.0, 1.0))  # mirror flies up
    assert shutter_shares(shutter, 1.053) == pytest.approx((1.0, 0.0))  # first curtain
    assert shutter_shares(shutter, 1.06) == pytest.approx((0.0, 0.0))  # exposure
    assert shutter_shares(shutter, 1.073) == pytest.approx((1.0, 0.0))  # second curtain
    assert shutter_shares(shutter, 1.123) == pytest.approx((0.0, -1.0))  # mirror comes down
    assert shutter_shares(shutter, 1.0 + shutter_length(shutter)) == pytest.approx((0.0, 0.0), abs=1e-15)
    assert shutter_shares(shutter, 3.003) == pytest.approx((0.0, 1.0))  # again
