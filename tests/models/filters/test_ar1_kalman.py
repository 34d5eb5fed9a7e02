"""The 2010 paper's filter: Kalman on raw channels with AR(1) noise."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from attitude_fmu.models.filters.ar1_kalman import (
    SETTLED_GAIN,
    Ar1KalmanParameters,
    Channel,
    ar1_kalman_filtered,
    ar1_kalman_step,
    initial_ar1_kalman,
    initial_channel,
    innovation,
    noise_variance,
    settled_gain,
    settled_variance,
    signal_variance_for,
)
from attitude_fmu.models.filters.kalman import kalman_filtered

Array = NDArray[np.float64]
COEFFICIENT, DRIVING, SIGNAL = 0.7, 4.0, 0.1
SAMPLES = 40_000
EVERY_NOISE = pytest.mark.parametrize("a", [-0.5, 0.0, 0.3, 0.7, 0.95])


def ar1_noise(seed: int, a: float = COEFFICIENT, driving: float = DRIVING, count: int = SAMPLES) -> Array:
    """Stationary from the first sample on."""
    fresh = np.random.default_rng(seed).normal(size=count) * math.sqrt(driving)
    noise = np.empty(count)
    noise[0] = fresh[0] / math.sqrt(1.0 - a * a)
    for k in range(1, count):
        noise[k] = a * noise[k - 1] + fresh[k]
    return noise


def random_walk(seed: int, signal: float = SIGNAL, count: int = SAMPLES) -> Array:
    return np.cumsum(np.random.default_rng(seed).normal(size=count) * math.sqrt(signal))


def filtered(readings: Array, a: float = COEFFICIENT, driving: float = DRIVING, signal: float = SIGNAL) -> Array:
    channel = initial_channel(float(readings[0]), a, driving)
    estimates = [channel.estimate]
    for reading in readings[1:].tolist():
        channel = ar1_kalman_filtered(channel, reading, a, driving, signal)
        estimates.append(channel.estimate)
    return np.array(estimates)


def settled_channel(value: float = 0.0, a: float = COEFFICIENT) -> Channel:
    return Channel(value, settled_variance(a, DRIVING, SIGNAL), value)


def deviation_of_a_variance(pole: float, count: int) -> float:
    """Relative standard deviation of the variance of `count` samples of an AR(1) process with this pole."""
    return math.sqrt(2.0 / count * (1.0 + pole * pole) / (1.0 - pole * pole))


# --- what passes -----------------------------------------------------------------------------------------------------


@EVERY_NOISE
def test_a_signal_that_stays_passes_at_gain_one(a: float) -> None:
    channel = settled_channel(0.0, a)
    for _ in range(10_000):
        channel = ar1_kalman_filtered(channel, 5.0, a, DRIVING, SIGNAL)
    assert channel.estimate == pytest.approx(5.0, rel=1e-12)


@EVERY_NOISE
def test_a_filter_that_agrees_with_its_readings_does_not_move(a: float) -> None:
    assert ar1_kalman_filtered(settled_channel(2.0, a), 2.0, a, DRIVING, SIGNAL).estimate == pytest.approx(2.0)


@EVERY_NOISE
def test_a_ramp_is_lagged_by_the_stated_readings(a: float) -> None:
    channel, slope = settled_channel(0.0, a), 0.3
    for k in range(1, 3001):
        channel = ar1_kalman_filtered(channel, slope * k, a, DRIVING, SIGNAL)
    gain = settled_gain(a, DRIVING, SIGNAL)
    assert (slope * 3000 - channel.estimate) / slope == pytest.approx((1 - gain) / (gain * (1 - a)), rel=1e-9)


@EVERY_NOISE
def test_a_step_is_approached_at_the_stated_pole(a: float) -> None:
    channel, distance = settled_channel(0.0, a), []
    for _ in range(30):
        channel = ar1_kalman_filtered(channel, 1.0, a, DRIVING, SIGNAL)
        distance.append(1.0 - channel.estimate)
    pole = 1.0 - settled_gain(a, DRIVING, SIGNAL) * (1.0 - a)
    assert np.divide(distance[1:], distance[:-1]) == pytest.approx(pole, rel=1e-9)


# --- variance and gain -----------------------------------------------------------------------------------------------


@EVERY_NOISE
@pytest.mark.parametrize("signal", [1e-3, 0.1, 100.0])
def test_the_variance_settles_at_the_root_of_the_riccati_equation(a: float, signal: float) -> None:
    channel = initial_channel(0.0, a, DRIVING)
    for _ in range(20_000):
        channel = ar1_kalman_filtered(channel, 0.0, a, DRIVING, signal)
    settled, left = settled_variance(a, DRIVING, signal), 1.0 - a
    assert channel.variance == pytest.approx(settled, rel=1e-9)
    predicted = left * settled + signal
    total = left * left * settled + signal + DRIVING
    assert settled + signal - predicted * predicted / total == pytest.approx(settled, rel=1e-9)
    assert settled_gain(a, DRIVING, signal) == pytest.approx(math.sqrt(signal / total), rel=1e-9)


@EVERY_NOISE
def test_a_gain_can_be_asked_for(a: float) -> None:
    for gain in (0.02, 0.2, 0.9):
        assert settled_gain(a, DRIVING, signal_variance_for(gain, a, DRIVING)) == pytest.approx(gain, rel=1e-12)


@EVERY_NOISE
def test_it_is_the_two_state_filter_of_signal_and_noise(a: float) -> None:
    """State (s, n), reading s + n without further noise: the textbook equations give the same estimate and variance."""
    readings = random_walk(1, count=60) + ar1_noise(2, a, count=60)
    channel = initial_channel(float(readings[0]), a, DRIVING)
    own = noise_variance(a, DRIVING)
    # after the first reading, the signal unknown before: s = z, n = 0, errors equal and opposite
    state, covariance = np.array([readings[0], 0.0]), own * np.array([[1.0, -1.0], [-1.0, 1.0]])
    move, grow, see = np.diag([1.0, a]), np.diag([SIGNAL, DRIVING]), np.array([1.0, 1.0])
    for reading in readings[1:].tolist():
        state, covariance = move @ state, move @ covariance @ move.T + grow
        gain = covariance @ see / (see @ covariance @ see)
        state = state + gain * (reading - see @ state)
        keep = np.eye(2) - np.outer(gain, see)
        covariance = keep @ covariance @ keep.T
        channel = ar1_kalman_filtered(channel, reading, a, DRIVING, SIGNAL)
        assert channel.estimate == pytest.approx(state[0], rel=1e-10, abs=1e-10)
        assert channel.variance == pytest.approx(covariance[0, 0], rel=1e-10)


def test_without_correlation_it_is_the_kalman_filter_of_the_2021_paper() -> None:
    channel, (y, variance) = Channel(0.1, 2e-4, 0.1), (0.1, 2e-4)
    for reading in (np.random.default_rng(3).normal(size=50) * 0.01).tolist():
        channel = ar1_kalman_filtered(channel, reading, 0.0, 1e-4, 1e-6)
        y, variance = kalman_filtered(y, variance, reading, 1e-6, 1e-4)
        assert (channel.estimate, channel.variance) == pytest.approx((y, variance), rel=1e-12)


def test_the_best_average_of_a_signal_that_never_moves() -> None:
    # Q = 0: differenced readings (1 - a) s + e and the first one weigh in; the variance is that of least squares
    a, count = COEFFICIENT, 50
    channel = initial_channel(0.0, a, DRIVING)
    for _ in range(count):
        channel = ar1_kalman_filtered(channel, 0.0, a, DRIVING, 0.0)
    information = (1.0 - a * a) / DRIVING + count * (1.0 - a) ** 2 / DRIVING
    assert channel.variance == pytest.approx(1.0 / information, rel=1e-12)


# --- noise -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("a", [-0.5, 0.3, 0.7])
def test_what_is_left_of_ar1_noise_is_what_theory_says(a: float) -> None:
    gain = settled_gain(a, DRIVING, SIGNAL)
    left = filtered(ar1_noise(4, a), a)[500:]
    theory = noise_variance(a, DRIVING) * gain * (1.0 + a) / (2.0 - gain * (1.0 - a))
    bound = 4.0 * deviation_of_a_variance(1.0 - gain * (1.0 - a), len(left))  # four standard deviations, 0.1 or less
    assert np.mean(left**2) == pytest.approx(theory, rel=bound)
    assert theory < 0.5 * noise_variance(a, DRIVING)


def test_the_error_of_a_wandering_signal_has_the_settled_variance() -> None:
    truth = random_walk(5)
    error = (filtered(truth + ar1_noise(6)) - truth)[500:]
    pole = 1.0 - settled_gain(COEFFICIENT, DRIVING, SIGNAL) * (1.0 - COEFFICIENT)
    bound = 4.0 * deviation_of_a_variance(pole, len(error))
    assert np.mean(error**2) == pytest.approx(settled_variance(COEFFICIENT, DRIVING, SIGNAL), rel=bound)


def innovations(a: float) -> Array:
    """Of a wandering signal with noise of COEFFICIENT, filtered as if that were `a`."""
    readings = (random_walk(7) + ar1_noise(8)).tolist()
    channel, found = initial_channel(readings[0], a, DRIVING), []
    for reading in readings[1:]:
        found.append(innovation(channel, reading, a))
        channel = ar1_kalman_filtered(channel, reading, a, DRIVING, SIGNAL)
    return np.array(found[500:])


def whiteness(x: Array) -> Array:
    """Autocorrelation at lags 1 to 20, in standard deviations 1/sqrt(n) of a white record."""
    return np.array([x[lag:] @ x[:-lag] / (x @ x) for lag in range(1, 21)]) * math.sqrt(len(x))


def test_the_innovation_is_white_where_the_model_is_right() -> None:
    x = innovations(COEFFICIENT)
    assert np.max(np.abs(whiteness(x))) < 4.2  # twenty lags of a normal: 0.05 % beyond
    left = 1.0 - COEFFICIENT
    total = left * left * settled_variance(COEFFICIENT, DRIVING, SIGNAL) + SIGNAL + DRIVING
    assert np.var(x) == pytest.approx(total, rel=4.0 * math.sqrt(2.0 / len(x)))


def test_the_innovation_is_not_white_where_the_correlation_is_left_out() -> None:
    assert np.max(np.abs(whiteness(innovations(0.0)))) > 20.0


# --- six channels ----------------------------------------------------------------------------------------------------


def test_every_channel_is_filtered_by_itself() -> None:
    p = Ar1KalmanParameters()
    rate, force = (0.01, -0.02, 0.03), (0.1, 0.2, 9.8)
    before = initial_ar1_kalman(rate, force, p)
    assert before.rate.estimate == rate
    assert before.specific_force.estimate == force
    for axis in range(3):
        moved = tuple(x + (0.5 if i == axis else 0.0) for i, x in enumerate(force))
        after = ar1_kalman_step(before, rate, moved, p)  # type: ignore[arg-type]
        assert after.rate.estimate == pytest.approx(rate, rel=1e-12)
        for i in range(3):
            step = after.specific_force.estimate[i] - force[i]
            assert (step > 0.01) == (i == axis)
            assert after.specific_force.reading[i] == moved[i]


def test_default_parameters_settle_at_the_stated_gain() -> None:
    p = Ar1KalmanParameters()
    for noise in p:
        for a, driving, signal in zip(*noise, strict=True):
            assert settled_gain(a, driving, signal) == pytest.approx(SETTLED_GAIN, rel=1e-12)
