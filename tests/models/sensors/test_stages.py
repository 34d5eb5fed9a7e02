"""The stages of the signal's way, each against its equation."""

from __future__ import annotations

import cmath
import itertools
import math

import numpy as np
import pytest

from attitude_fmu.models.sensors import (
    accelerometer,
    bias_instability,
    digital_filter,
    quantiser,
    thermal,
)
from attitude_fmu.models.sensors.adxl355_sheet import ADXL355_2G
from attitude_fmu.models.sensors.adxrs450_sheet import ADXRS450
from attitude_fmu.models.sensors.bandwidth import low_pass, low_pass_gain, low_pass_share
from attitude_fmu.models.sensors.white_noise import block_sums


@pytest.mark.parametrize("period", [1e-5, 1e-4, 1e-3, 4e-3])
def test_the_bandwidth_stage_has_its_corner_where_it_says(period: float) -> None:
    # the mean of then and now of exp(j w t), 40 e-folds after the start
    gain, x, before, turn = low_pass_gain(50.0, period), 0j, 0j, cmath.exp(2j * math.pi * 50.0 * period)
    u = 1.0 + 0j
    for _ in range(round(40.0 / (2 * math.pi * 50.0) / period) + 2):
        u *= turn
        before, x = x, low_pass(x, u, gain)
    assert abs(0.5 * (before + x) / u) == pytest.approx(math.sqrt(0.5), rel=1e-9)


@pytest.mark.parametrize("period", [1e-5, 1e-4, 1e-3, 4e-3])
def test_the_weighted_mean_has_the_poles_delay_and_its_corner_nearly(period: float) -> None:
    gain, share = low_pass_gain(50.0, period), low_pass_share(50.0, period)

    def response(frequency: float) -> complex:
        late = cmath.exp(-2j * math.pi * frequency * period)
        return gain / (1.0 - (1.0 - gain) * late) * ((1.0 - share) * late + share)

    slow = 1e-3
    assert -cmath.phase(response(slow)) / (2 * math.pi * slow) == pytest.approx(1 / (2 * math.pi * 50.0), rel=1e-6)
    # |H|^2 at the corner is off by (pi f h)^4/9 and less than as much again of higher orders
    angle = math.pi * 50.0 * period
    assert abs(response(50.0)) ** 2 == pytest.approx(0.5, rel=2.0 * angle**4 / 9.0 + 1e-9)


def test_a_bandwidth_beyond_a_quarter_of_the_sampling_passes_everything() -> None:
    assert low_pass_gain(300.0, 1e-3) == pytest.approx(1.0)
    assert low_pass_gain(1e6, 1e-3) == pytest.approx(1.0)


@pytest.mark.parametrize("n", [1, 2, 8, 64])
def test_block_sums_give_the_decimated_sinc2_of_a_convolution(n: int) -> None:
    x = np.random.default_rng(n).normal(size=20 * n)
    window = np.convolve(np.ones(n), np.ones(n)) / n**2
    expected = np.convolve(x, window)
    rising, k = 0.0, np.arange(n)
    for block in range(20):
        part = x[block * n : (block + 1) * n]
        y, rising = digital_filter.sinc2_decimated(rising, part.sum(), (k * part).sum(), float(n))
        assert y == pytest.approx(expected[(block + 1) * n - 1], abs=1e-12)


@pytest.mark.parametrize("n", [1, 4, 32])
def test_overlapped_windows_give_the_sinc2_of_twice_the_block(n: int) -> None:
    x = np.random.default_rng(n).normal(size=24 * n)
    window = np.convolve(np.ones(2 * n), np.ones(2 * n)) / (2 * n) ** 2
    expected = np.convolve(x, window)
    windows, k = digital_filter.OverlappedWindows(0.0, 0.0, 0.0), np.arange(n)
    for block in range(24):
        part = x[block * n : (block + 1) * n]
        y, windows = digital_filter.sinc2_overlapped(windows, part.sum(), (k * part).sum(), float(n))
        assert y == pytest.approx(expected[(block + 1) * n - 1], abs=1e-12)


def test_samples_on_straight_lines_enter_a_block_as_if_one_by_one() -> None:
    corners = (0.4, 0.3, -1.0, 2.0, 0.7)
    sums = digital_filter.EMPTY
    for before, now in itertools.pairwise(corners):
        sums = digital_filter.with_samples(sums, before, now, 8.0)
    k = np.arange(32)
    x = np.interp(k + 1, 8 * np.arange(5), corners)
    assert sums == pytest.approx((x.sum(), (k * x).sum(), 32.0), rel=1e-13)


def test_settled_windows_pass_a_constant_unchanged() -> None:
    windows = digital_filter.settled_windows(0.7, 32.0)
    y, after = digital_filter.sinc2_overlapped(windows, 32 * 0.7, 0.7 * 32 * 31 / 2, 32.0)
    assert y == pytest.approx(0.7, rel=1e-15)
    assert after == pytest.approx(windows, rel=1e-14)


def test_block_noise_has_the_covariance_of_sums_over_white_samples() -> None:
    # A and B are linear in z1, z2, so their covariance is exact: n, n(n-1)/2, n(n-1)(2n-1)/6
    n = 32.0
    (a1, b1), (a2, b2) = block_sums(1.0, n, 1.0, 0.0), block_sums(1.0, n, 0.0, 1.0)
    assert a1 * a1 + a2 * a2 == pytest.approx(n)
    assert a1 * b1 + a2 * b2 == pytest.approx(n * (n - 1) / 2)
    assert b1 * b1 + b2 * b2 == pytest.approx(n * (n - 1) * (2 * n - 1) / 6)


def test_bias_instability_keeps_the_allan_floor_of_flicker_noise() -> None:
    # Allan variance of first-order Gauss-Markov processes added up (IEEE 952); floor 0.664 B from 1 s to 1000 s
    sigma = bias_instability.SIGMA_PER_INSTABILITY

    def variance(tau: float) -> float:
        total = 0.0
        for time in bias_instability.TIME_CONSTANTS:
            x = tau / time
            total += 2 * sigma**2 / x * (1 - (3 - 4 * math.exp(-x) + math.exp(-2 * x)) / (2 * x))
        return total

    assert sigma == pytest.approx(math.sqrt(math.log(10) / math.pi), abs=1e-4)
    for tau in np.geomspace(1.0, 1000.0, 30):
        assert math.sqrt(variance(tau)) == pytest.approx(0.664, rel=0.023)


def test_bias_instability_is_stationary_from_its_first_call_on() -> None:
    draws = tuple(float(i) for i in range(18))
    still = ((0.0, 0.0, 0.0),) * 6
    first = bias_instability.stepped(still, (0.0,) * 6, 2.0, draws)  # type: ignore[arg-type]
    assert [x for process in first for x in process] == pytest.approx([2.0 * z for z in draws])
    decay = bias_instability.decays(0.1)
    # x' = a x + s sqrt(1 - a^2) z keeps the variance s^2
    for i, a in enumerate(decay):
        unit = bias_instability.stepped(((1.0,) * 3,) * 6, decay, 1.0, (1.0,) * 18)[i][0]  # type: ignore[arg-type]
        assert unit == pytest.approx(a + math.sqrt(1 - a * a))


def test_register_codes_round_and_saturate() -> None:
    lsb, full_scale = ADXRS450.si("resolution"), ADXRS450.si("range")
    assert quantiser.register_code(math.radians(300.0), full_scale, lsb, 2.0**15) == 24000
    assert quantiser.register_code(math.radians(-400.0), full_scale, lsb, 2.0**15) == -24000
    assert quantiser.register_code(1.49 * lsb, 1.0, lsb, 2.0**15) == 1
    assert quantiser.register_code(-1.49 * lsb, 1.0, lsb, 2.0**15) == -1
    lsb, full_scale = ADXL355_2G.si("resolution"), ADXL355_2G.si("range")
    assert quantiser.register_code(9.80665, full_scale, lsb, 2.0**19) == 256000
    assert quantiser.register_code(50.0, full_scale, lsb, 2.0**19) == 2**19 - 1
    assert quantiser.register_code(-50.0, full_scale, lsb, 2.0**19) == -(2**19)
    assert quantiser.over_range(1.1, 1.0) == 1.0
    assert quantiser.over_range(-0.9, 1.0) == 0.0


def test_the_die_warms_up_by_its_own_heat_and_follows_ambient() -> None:
    part = thermal.ThermalParameters(self_heating=4.0, warm_up=60.0, warmed_up=False)
    die = thermal.initial_die_temperature(part, 300.0)
    for _ in range(600):
        die = thermal.die_temperature(part, die, 300.0, 0.1)
    assert die == pytest.approx(304.0 - 4.0 * math.exp(-1.0), rel=1e-12)
    assert thermal.initial_die_temperature(part._replace(warmed_up=True), 300.0) == 304.0


def test_lever_arm_adds_tangential_and_centripetal_terms() -> None:
    force = accelerometer.at_lever_arm((0.0, 0.0, 9.8), (0.0, 0.0, 2.0), (0.0, 0.0, 5.0), (0.1, 0.0, 0.0))
    assert force == pytest.approx((-0.4, 0.5, 9.8))
