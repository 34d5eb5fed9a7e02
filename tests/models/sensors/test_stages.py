"""The stages of the signal's way, each against its equation."""

from __future__ import annotations

import math

import numpy as np
import pytest

from attitude_fmu.models.sensors import (
    accelerometer,
    bias_instability,
    devices,
    digital_filter,
    gyro,
    quantiser,
    thermal,
)
from attitude_fmu.models.sensors.bandwidth import low_pass, low_pass_gain
from attitude_fmu.models.sensors.white_noise import block_sums
from attitude_fmu.models.vectors import IDENTITY3, ZERO3


def test_the_bandwidth_stage_has_its_corner_where_it_says() -> None:
    # exact step of a first-order low-pass: e-fold after 1/(2 pi f), whatever the period
    for period in (1e-5, 1e-4, 1e-3):
        gain, x = low_pass_gain(50.0, period), 1.0
        steps = round(1.0 / (2 * math.pi * 50.0) / period)
        for _ in range(steps):
            x = low_pass(x, 0.0, gain)
        assert x == pytest.approx(math.exp(-2 * math.pi * 50.0 * steps * period), rel=1e-12)


@pytest.mark.parametrize("n", [1, 2, 8, 64])
def test_block_sums_give_the_decimated_sinc2_of_a_convolution(n: int) -> None:
    x = np.random.default_rng(n).normal(size=20 * n)
    window = np.convolve(np.ones(n), np.ones(n)) / n**2
    expected = np.concatenate([[0.0], np.convolve(x, window)])  # the newest sample has weight zero
    rising, k = 0.0, np.arange(1, n + 1)
    for block in range(20):
        part = x[block * n : (block + 1) * n]
        y, rising = digital_filter.sinc2_decimated(rising, part.sum(), (k * part).sum(), float(n))
        assert y == pytest.approx(expected[(block + 1) * n - 1], abs=1e-12)


@pytest.mark.parametrize("n", [1, 4, 32])
def test_overlapped_windows_give_the_sinc2_of_twice_the_block(n: int) -> None:
    x = np.random.default_rng(n).normal(size=24 * n)
    window = np.convolve(np.ones(2 * n), np.ones(2 * n)) / (2 * n) ** 2
    expected = np.concatenate([[0.0], np.convolve(x, window)])  # the newest sample has weight zero
    windows, k = digital_filter.OverlappedWindows(0.0, 0.0, 0.0), np.arange(1, n + 1)
    for block in range(24):
        part = x[block * n : (block + 1) * n]
        y, windows = digital_filter.sinc2_overlapped(windows, part.sum(), (k * part).sum(), float(n))
        assert y == pytest.approx(expected[(block + 1) * n - 1], abs=1e-12)


def test_held_samples_enter_a_block_as_if_one_by_one() -> None:
    sums = digital_filter.EMPTY
    for value in (0.3, -1.0, 2.0, 0.7):
        sums = digital_filter.with_samples(sums, value, 8.0)
    x, k = np.repeat([0.3, -1.0, 2.0, 0.7], 8), np.arange(1, 33)
    assert sums == pytest.approx((x.sum(), (k * x).sum(), 32.0), rel=1e-13)


def test_settled_windows_pass_a_constant_unchanged() -> None:
    windows = digital_filter.settled_windows(0.7, 32.0)
    y, after = digital_filter.sinc2_overlapped(windows, 32 * 0.7, 0.7 * 32 * 33 / 2, 32.0)
    assert y == pytest.approx(0.7, rel=1e-15)
    assert after == pytest.approx(windows, rel=1e-14)


def test_block_noise_has_the_covariance_of_sums_over_white_samples() -> None:
    # A and B are linear in z1, z2, so their covariance is exact: n, n(n+1)/2, n(n+1)(2n+1)/6
    n = 32.0
    (a1, b1), (a2, b2) = block_sums(1.0, n, 1.0, 0.0), block_sums(1.0, n, 0.0, 1.0)
    assert a1 * a1 + a2 * a2 == pytest.approx(n)
    assert a1 * b1 + a2 * b2 == pytest.approx(n * (n + 1) / 2)
    assert b1 * b1 + b2 * b2 == pytest.approx(n * (n + 1) * (2 * n + 1) / 6)


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
        assert math.sqrt(variance(tau)) == pytest.approx(0.664, rel=0.025)


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
    lsb = 1.0 / devices.ADXRS450.sensitivity.si
    assert quantiser.register_code(math.radians(300.0), devices.ADXRS450.range.si, lsb, 2.0**15) == 24000
    assert quantiser.register_code(math.radians(-400.0), devices.ADXRS450.range.si, lsb, 2.0**15) == -24000
    assert quantiser.register_code(1.49 * lsb, 1.0, lsb, 2.0**15) == 1
    assert quantiser.register_code(-1.49 * lsb, 1.0, lsb, 2.0**15) == -1
    g = devices.ADXL355.sensitivity.si
    assert quantiser.register_code(9.80665, devices.ADXL355.range.si, 1 / g, 2.0**19) == 256000
    assert quantiser.register_code(50.0, devices.ADXL355.range.si, 1 / g, 2.0**19) == 2**19 - 1
    assert quantiser.register_code(-50.0, devices.ADXL355.range.si, 1 / g, 2.0**19) == -(2**19)
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


def ramp_delay_of_gyro(axis: int) -> float:
    """Age of what the rate register shows of a rate that grows steadily, at the moment of its update."""
    part = gyro.GyroParameters()._replace(range=0.3, resolution=1e-5, clock_error=(0.0, 0.0, 0.0))
    part = part._replace(scale_error=ZERO3, cross_axis=(ZERO3, ZERO3, ZERO3), g_sensitivity=(ZERO3, ZERO3, ZERO3))
    k = gyro.gyro_coefficients(part, IDENTITY3, False)
    k = k._replace(sample_deviation=ZERO3)
    state, _ = gyro.initial_gyro(axis, ZERO3, ZERO3, 0.0, 1.0, part, k)
    period = k.sense_period[axis]
    shown = 0.0
    for tick in range(1, 401):
        t = tick * period
        state = gyro.sense(axis)(state, (t, t, t), ZERO3, 1.0, part, k)
        if tick % gyro.SENSES_PER_REGISTER == 0:
            state = gyro.register(axis)(state, 0.0, part, k, (), (0.0, 0.0, 0.0, 0.0))
            shown = state.code * part.resolution
    return 400 * period - shown


def test_the_gyro_delays_by_the_sheets_four_milliseconds() -> None:
    # half width of the window 64/f0 = 4 ms, and 15 us of analogue bandwidth
    assert ramp_delay_of_gyro(0) == pytest.approx(4.0e-3 + 15e-6, rel=0.02)


def test_device_numbers_carry_source_and_confidence() -> None:
    for sheet in (devices.ADXRS450, devices.ADXL355):
        for datum in sheet:
            assert datum.source
            assert datum.confidence in {"datasheet", "figure", "driver", "calculated", "assumption"}
    assert devices.ADXRS450.noise_density.si == pytest.approx(math.radians(0.015))
    assert devices.ADXL355.noise_density.si == pytest.approx(22.5e-6 * 9.80665)
    assert gyro.GyroParameters().resolution == pytest.approx(math.radians(0.0125))
