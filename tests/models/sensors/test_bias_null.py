"""The bias null of the ADIS16354: offset registers of 13 bits and 0.018315 deg/s an LSB, +-75 deg/s."""

from __future__ import annotations

import math

import numpy as np
import pytest
from faultless_parts import ADIS, GYRO, STILL, faultless, run_of

from attitude_fmu.models.attitude_sensor import MODEL
from attitude_fmu.models.sensors import adis16354_words, gyro
from attitude_fmu.models.sensors.gyro import AUTONULL, GYRO_FILTER
from attitude_fmu.models.system import Run
from attitude_fmu.models.vectors import IDENTITY3, ZERO3

LSB = math.radians(0.018315)


def words(kind: str, bias: float, count: int, noise: float = 0.0, **values: float) -> tuple[list[float], float, float]:
    """Readings, offset register and the mean code before the null, of a still gyro with a bias."""
    p = faultless(ADIS, gyro__autonull=AUTONULL.value(kind), gyro__filter=2, gyro__noise_density=noise).gyro
    p = p._replace(**values)
    k = gyro.gyro_coefficients(p, IDENTITY3, False)
    state, lines = gyro.initial_gyro(0, ZERO3, ZERO3, bias, 1.0, p, k)
    shown = []
    step = gyro.sample(0, 1)
    draws = np.random.default_rng(1).normal(size=(count, 4)).tolist()
    for z in draws:
        state, lines = step(state, lines, bias, p, k, (), z)
        shown.append(state.code * p.resolution)
    return shown, state.null.offset, state.null.sum


@pytest.mark.parametrize("bias", [0.0, 0.05, -0.3, 1.2])
def test_the_automatic_null_takes_one_reading_off_in_steps_of_the_offset_register(bias: float) -> None:
    shown, offset, _ = words("automatic", bias, 3)
    first = math.floor(bias / faultless(ADIS).gyro.resolution + 0.5)
    assert shown[0] == pytest.approx(first * faultless(ADIS).gyro.resolution)
    assert offset == math.floor(-first * 4.0 + 0.5)  # 0.07326 deg/s is four of its steps
    assert offset == adis16354_words.signed(adis16354_words.gyro_offset_word(-shown[0]), 13)
    assert abs(shown[1]) <= 0.5 * faultless(ADIS).gyro.resolution + LSB


@pytest.mark.parametrize(
    ("device", "way", "first"), [(ADIS, "bartlett_4", 7), (ADIS, "bartlett_64", 127), (GYRO, "cic", 4)]
)
def test_the_automatic_null_errs_by_the_noise_of_one_reading(device: str, way: str, first: int) -> None:
    # 300 pieces of noise: the deviation has a standard error of 1/sqrt(600) = 4.1 %, four of these are allowed
    p = faultless(device, gyro__autonull=AUTONULL.value("automatic"), gyro__filter=GYRO_FILTER.value(way)).gyro
    p = p._replace(noise_density=math.radians(0.5))
    k = gyro.gyro_coefficients(p, IDENTITY3, False)
    taps = 4 if way == "cic" else (first + 1) // 2
    register, sample, chance = gyro.register(0), gyro.sample(0, taps), np.random.default_rng(2)
    offsets = []
    for _ in range(300):
        state, lines = gyro.initial_gyro(0, ZERO3, ZERO3, 0.0, 1.0, p, k)
        code = 0.0
        for word in range(1, first + 1):
            assert state.null == (0.0, 0.0, 0.0), word
            draws = tuple(chance.normal(size=4).tolist())
            if way == "cic":
                state = register(state, 0.0, p, k, (), draws)
            else:
                state, lines = sample(state, lines, 0.0, p, k, (), draws)
            code = state.code
        assert (state.null.sum, state.null.done) == (code, 1.0)
        offsets.append(state.null.offset * p.null_resolution)
    window = np.convolve(np.ones(64), np.ones(64)) / 64**2 if way == "cic" else np.bartlett(2 * taps + 1)[1:-1] / taps
    noise = k.sample_deviation[0] * math.sqrt(window @ window)
    assert np.std(offsets) == pytest.approx(noise, rel=4 * 0.041)


def test_a_null_finer_than_the_code_shows_in_the_mean() -> None:
    # the offset register is a quarter of the code's LSB: behind noise the mean is nulled to half its step
    bias = 0.31 * faultless(ADIS).gyro.resolution
    noise = math.radians(0.05)
    shown, offset, _ = words("precision", bias, 40_000, noise)
    settled = np.array(shown[24_576:])
    assert abs(bias + offset * LSB) <= 0.5 * LSB + 5 * 1.01 / math.sqrt(24_576) * math.radians(1.0)
    # noise of 1.01 deg/s over 15,424 readings: standard error 0.008 deg/s
    assert settled.mean() == pytest.approx(bias + offset * LSB, abs=4 * math.radians(1.01) / math.sqrt(len(settled)))
    assert offset != 0.0


def test_the_precision_null_is_the_mean_of_thirty_seconds() -> None:
    bias, count = math.radians(2.0), 24_576  # 30 s at 819.2 readings/s
    shown, offset, total = words("precision", bias, count + 5, math.radians(0.05))
    p = faultless(ADIS).gyro
    mean = np.mean(shown[:count])
    assert total == pytest.approx(np.sum(shown[:count]) / p.resolution)
    assert offset == math.floor(-mean / LSB + 0.5)
    assert np.abs(np.array(shown[count - 3 : count]) - bias).max() < 5 * math.radians(1.01)
    # after it readings scatter about zero: within 5 standard deviations of the noise
    assert np.abs(shown[count + 1 :]).max() < 5 * math.radians(1.01)


def test_the_offset_register_ends_at_75_degrees_a_second() -> None:
    for bias, end in ((math.radians(100.0), -4096.0), (math.radians(-100.0), 4095.0)):
        shown, offset, _ = words("automatic", bias, 3)
        assert offset == end
        assert math.degrees(shown[2]) == pytest.approx(math.copysign(25.0, bias), abs=0.1)


def test_without_a_null_the_offset_register_stays_zero() -> None:
    shown, offset, total = words("none", 0.05, 10)
    assert (offset, total) == (0.0, 0.0)
    assert shown[-1] == pytest.approx(0.05, abs=LSB * 2)


def test_the_whole_sensor_nulls_each_gyro_of_its_own() -> None:
    bias = tuple(map(math.radians, (0.5, -1.0, 2.0)))
    p = faultless(ADIS, gyro__bias=bias, gyro__autonull=AUTONULL.value("automatic"))
    run = run_of(p, STILL, 0.1)
    for axis in range(3):
        state = run.state.gyro[axis]
        assert state.null.done == 1.0
        assert state.null.offset * LSB == pytest.approx(-bias[axis], abs=2.1 * LSB)
        assert abs(state.code) <= 1


def test_a_null_of_thirty_seconds_is_under_way_before() -> None:
    way = GYRO_FILTER.value("bartlett_64")
    null = AUTONULL.value("precision")
    p = faultless(ADIS, gyro__bias=(0.01, 0.0, 0.0), gyro__filter=way, accelerometer__filter=way, gyro__autonull=null)
    run = Run(MODEL, p, STILL)
    assert run.coefficients.gyro.null_words == (24_576.0,) * 3
    run.advance(STILL, 0.2)
    state = run.state.gyro[0]
    assert (state.null.done, state.null.offset) == (0.0, 0.0)
    assert state.null.sum == 8 * (state.words - 126)  # 0.573 deg/s is 7.8 LSB; words 1 to 126 reach behind the start
