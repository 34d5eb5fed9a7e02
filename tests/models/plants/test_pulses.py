"""Pulses hand over their impulse, once or again and again."""

from __future__ import annotations

import numpy as np
import pytest

from attitude_fmu.models.plants.pulses import (
    Knock,
    Press,
    Shutter,
    half_sine_share,
    knock_share,
    press_share,
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


def test_a_press_hands_over_its_area_slowly() -> None:
    """(1 - cos)/2 of 0.5 s: half of its impulse in its middle, and next to none of it above 4 Hz."""
    press = Press(start=1.0, period=2.0, duration=0.5)
    assert press_share(press, 0.9) == 0.0
    assert press_share(press, 1.25) == pytest.approx(0.5)
    assert press_share(press, 1.5) == pytest.approx(1.0)
    assert press_share(press, 3.5) == pytest.approx(2.0)
    times = np.arange(0.0, 4.0, 1e-3) + 1.0
    once = press._replace(period=0.0)
    force = np.diff([press_share(once, time) for time in times.tolist()])
    power, frequency = np.abs(np.fft.rfft(force)) ** 2, np.fft.rfftfreq(len(force), 1e-3)
    assert force.sum() == pytest.approx(1.0)
    assert power[frequency > 4.0].sum() < 1e-3 * power.sum()


@pytest.mark.parametrize("exposure", [1e-3, 5e-3, 0.02, 1.0])
def test_curtains_move_by_the_exposure_time(exposure: float) -> None:
    """The second curtain is flung an exposure after the first; each pulse has the area of one."""
    shutter = Shutter(start=0.0, period=0.0, exposure=exposure, lag=0.05, travel=1e-4, width=1e-4)
    times = np.arange(0.0, 1.3, 5e-6)
    curtains = np.array([shutter_shares(shutter, time)[0] for time in times.tolist()])
    peaks = times[
        np.flatnonzero((curtains[1:-1] > 0.999) & (curtains[1:-1] >= curtains[2:]) & (curtains[1:-1] > curtains[:-2]))
        + 1
    ]
    assert peaks == pytest.approx([0.05 + 1e-4, 0.05 + exposure + 1e-4], abs=1e-5)
