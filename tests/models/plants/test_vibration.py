"""Vibration has the rms and the spectrum that it is asked for, at any period."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.linalg import solve_discrete_lyapunov
from scipy.signal import welch
from scipy.stats import chi2

from attitude_fmu.models.plants.vibration import (
    Held,
    Oscillation,
    Oscillator,
    Shaking,
    held,
    holder,
    oscillated,
    oscillator,
)

PERIOD = 1e-3


def matrices(c: Oscillator) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Transition of (value, rate/w) and what a push of rms 1 adds."""
    phi = np.reshape(c.transition, (2, 2))
    return phi, c.push * (np.eye(2) - phi) @ [1.0, 0.0]


def record(c: Oscillator, count: int, seed: int = 1) -> NDArray[np.float64]:
    """Value, rate and acceleration of every tick."""
    pairs = np.random.default_rng(seed).standard_normal((count, 2)).tolist()
    now, found = Oscillation(), []
    for tick, pair in enumerate(pairs):
        now = oscillated(c, now, tick == 0, tuple(pair))
        found.append(now)
    return np.array(found)


CASES = [
    (10.0, 0.1, 1e-3),
    (100.0, 0.7, 1e-3),
    (0.1, 0.005, 1e-3),
    (30.0, 1.0, 1e-4),
    (400.0, 0.3, 1e-3),
    (1e4, 1.0, 1e-2),
]


@pytest.mark.parametrize(("frequency", "damping_ratio", "period"), CASES)
def test_the_stationary_value_has_rms_1_and_the_start_is_drawn_from_it(
    frequency: float, damping_ratio: float, period: float
) -> None:
    """Against the discrete Lyapunov equation."""
    c = oscillator(frequency, damping_ratio, period)
    phi, push = matrices(c)
    covariance = solve_discrete_lyapunov(phi, np.outer(push, push), method="bilinear")
    assert covariance[0, 0] == pytest.approx(1.0, rel=1e-6)
    n11, n21, n22 = c.start
    root = np.array([[n11, 0.0], [n21, n22]])
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-6)


def test_ticks_far_below_the_frequency_are_white() -> None:
    """Correlation of neighbours within 4 standard errors of none."""
    values = record(oscillator(1e4, 1.0, PERIOD), 20_000)[:, 0]
    assert abs(np.mean(values[1:] * values[:-1])) < 4.0 / math.sqrt(20_000)
    assert np.var(values) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / 20_000))


def test_rms_of_many_starts_is_that_of_the_stationary_process() -> None:
    """Chi-square bounds of 0.9999 on 2000 independent runs, at the first tick and at the 50th."""
    c = oscillator(30.0, 0.2, PERIOD)
    runs = np.array([record(c, 50, seed) for seed in range(2000)])
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 2000)
    for tick in (0, 49):
        assert low < np.sum(runs[:, tick, 0] ** 2) < high


def continuous_spectrum(f: NDArray[np.float64], frequency: float, damping_ratio: float) -> NDArray[np.float64]:
    """The density that the module's first lines give."""
    r = f / frequency
    density: NDArray[np.float64] = 4.0 * damping_ratio / (math.pi * frequency)
    return density / ((1.0 - r * r) ** 2 + (2.0 * damping_ratio * r) ** 2)


@pytest.mark.parametrize(("frequency", "damping_ratio"), [(40.0, 0.7), (20.0, 0.1)])
def test_spectrum_is_the_one_asked_for(frequency: float, damping_ratio: float) -> None:
    """Welch's mean of n segments without overlap: 2 n P / S is chi-square of 2 n degrees; bounds of 1e-6 on each line.

    The Hann window's leakage is small for lines of 1 Hz against the peak's width of 4 Hz; above 100 Hz the hold of the
    pushes changes the spectrum by more than the bounds.
    """
    segments, length = 60, 1000
    values = record(oscillator(frequency, damping_ratio, PERIOD), segments * length)[:, 0]
    f, density = welch(values, 1.0 / PERIOD, nperseg=length, noverlap=0, detrend=False)
    lines = (f >= 2.0) & (f <= 100.0)
    expected = continuous_spectrum(f[lines], frequency, damping_ratio)
    low, high = chi2.ppf([1e-6, 1.0 - 1e-6], 2 * segments) / (2 * segments)
    ratio = density[lines] / expected
    assert low * 0.97 < ratio.min()
    assert ratio.max() < high * 1.03
    assert ratio.mean() == pytest.approx(1.0, abs=0.05)


def test_rate_and_acceleration_are_derivatives() -> None:
    """Within a period x is smooth: Simpson's rule, whose error is (w T)^4/2880 of it, 5e-9."""
    whole, half = (oscillator(10.0, 0.1, period) for period in (PERIOD, 0.5 * PERIOD))
    c_half = half._replace(push=whole.push)
    start = Oscillation(0.3, -20.0, 0.0)
    end = oscillated(whole, start, False, (1.3, 0.0))
    middle = oscillated(c_half, start, False, (1.3, 0.0))
    assert oscillated(c_half, middle, False, (1.3, 0.0)) == pytest.approx(end, rel=1e-12)
    simpson = PERIOD / 6.0 * (start.rate + 4.0 * middle.rate + end.rate)
    assert end.value - start.value == pytest.approx(simpson, rel=1e-7)
    w, push = whole.frequency, 1.3 * whole.push
    first = w * w * (push - start.value) - 2.0 * 0.1 * w * start.rate
    simpson = PERIOD / 6.0 * (first + 4.0 * middle.acceleration + end.acceleration)
    assert end.rate - start.rate == pytest.approx(simpson, rel=1e-7)


# --- a bench that is held in its place -------------------------------------------------------------------------------


def felt(lower_frequency: float, pushes: NDArray[np.float64], period: float = PERIOD) -> NDArray[np.float64]:
    """What a bench feels that is pushed so, tick by tick."""
    c, now, found = holder(Shaking(lower_frequency=lower_frequency), period), Held(), []
    for push in pushes.tolist():
        now = held(c, now, push)
        found.append(now.acceleration)
    return np.array(found)


def test_a_bench_that_is_not_held_feels_the_push_itself() -> None:
    pushes = np.random.default_rng(1).standard_normal(100)
    np.testing.assert_array_equal(felt(0.0, pushes), pushes)


@pytest.mark.parametrize("frequency", [0.5, 2.0, 20.0])
def test_below_its_lower_frequency_a_held_bench_stays_where_it_is(frequency: float) -> None:
    """Against |G| = r^2/sqrt((1 - r^2)^2 + 2 r^2), r = f/f_lower; 10 s are 63 time constants, whole cycles follow."""
    lower, count = 2.0, 10_000
    time = PERIOD * np.arange(3 * count)
    tail = felt(lower, np.sin(2.0 * math.pi * frequency * time))[-count:]
    gain = 2.0 * abs(np.mean(tail * np.exp(-2j * math.pi * frequency * time[-count:])))
    r = frequency / lower
    expected = r * r / math.sqrt((1.0 - r * r) ** 2 + 2.0 * r * r)
    # the mean over a period of 20 Hz is (pi f T)^2/6 less, twice with the hold's: 1.3e-3
    assert gain == pytest.approx(expected, rel=2e-3)


def test_speed_and_way_of_a_held_bench_are_bounded() -> None:
    """A steady push moves it by 1/w^2 and leaves no speed: sums of the mean acceleration, to rounding."""
    lower = 2.0
    w = 2.0 * math.pi * lower
    speed = np.cumsum(felt(lower, np.ones(5000))) * PERIOD
    assert abs(speed[-1]) < 1e-12
    # the way by the trapezoid rule, whose error is (w T)^2/12
    way = PERIOD * (np.sum(speed) - 0.5 * speed[-1])
    assert way * w * w == pytest.approx(1.0, rel=1e-4)
