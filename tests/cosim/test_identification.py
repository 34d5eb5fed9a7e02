"""Noise models from records."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from fmpy import simulate_fmu  # type: ignore[import-untyped]
from numpy.typing import NDArray
from scipy import signal

from attitude_fmu.cosim.identification import (
    RecordUnusableError,
    ar1_density,
    cross_correlation,
    fit_ar1,
    power_spectrum,
)
from attitude_fmu.models.errors import AttitudeFmuError
from attitude_fmu.models.filters.ar1_kalman import Ar1KalmanParameters

Array = NDArray[np.float64]
RATE = 500.0
SAMPLES = 20_000


def white(seed: int, count: int = SAMPLES) -> Array:
    return np.random.default_rng(seed).normal(size=count)


def ar1(seed: int, a: float, driving: float = 4.0, count: int = SAMPLES) -> Array:
    fresh = white(seed, count) * math.sqrt(driving)
    fresh[0] /= math.sqrt(1.0 - a * a)
    return np.asarray(signal.lfilter([1.0], [1.0, -a], fresh), dtype=np.float64)


# --- AR(1) -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("a", [-0.6, 0.0, 0.3, 0.715, 0.98])
def test_the_fit_finds_the_truth_within_three_standard_errors(a: float) -> None:
    fit = fit_ar1(7.0 + ar1(1, a))
    assert abs(fit.coefficient - a) < 3.0 * fit.coefficient_error
    assert abs(fit.driving_variance - 4.0) < 3.0 * fit.driving_variance_error


@pytest.mark.parametrize("a", [0.0, 0.715])
def test_the_standard_errors_are_the_spread_of_many_fits(a: float) -> None:
    fits = np.array([fit_ar1(ar1(seed, a, count=2000)) for seed in range(400)])
    # a standard deviation of 400 fits is known to 1/sqrt(800) = 3.5 %; four of these
    assert fits[:, :2].std(axis=0) == pytest.approx(fits[:, 2:].mean(axis=0), rel=0.14)


def test_the_fit_scales_with_the_unit() -> None:
    record = ar1(2, 0.7)
    fit, scaled = fit_ar1(record), fit_ar1(1e-3 * record)
    assert scaled.coefficient == pytest.approx(fit.coefficient, rel=1e-12)
    assert scaled.driving_variance == pytest.approx(1e-6 * fit.driving_variance, rel=1e-12)


def test_the_filters_start_values_are_what_a_record_of_the_default_device_shows(sensor_dist: Path) -> None:
    channels = [f"{signal}[{axis}]" for signal in ("rate_measured", "specific_force_measured") for axis in (1, 2, 3)]
    record = simulate_fmu(
        str(sensor_dist / "AttitudeSensor.fmu"),
        stop_time=200.0,
        step_size=0.002,
        output_interval=0.002,
        start_values={"seed": 11, "processor.clock_error": 0.0},
        output=channels,
    )
    given = Ar1KalmanParameters()
    for place, channel in enumerate(channels):
        noise, axis = given[place // 3], place % 3
        x = record[channel][500:]
        fit, blocks = fit_ar1(x), [fit_ar1(block) for block in np.array_split(x, 20)]
        # the chain's noise is not quite AR(1), so the record itself tells how well it is known; beyond five of these
        # errors, of 19 degrees of freedom, one channel in a thousand lies; half of the last digit is rounding
        for value, found, start, rounding in (
            (fit.coefficient, [block.coefficient for block in blocks], noise.coefficient[axis], 5e-4),
            (
                fit.driving_variance,
                [block.driving_variance for block in blocks],
                noise.driving_variance[axis],
                2e-3 * noise.driving_variance[axis],
            ),
        ):
            error = np.std(found, ddof=1) / math.sqrt(len(found))
            assert error < 0.02 * value, channel
            assert abs(value - start) < 5.0 * error + rounding, channel


# --- power spectrum --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("count", "segments"), [(4096, 7), (5001, 9), (999, 1), (1000, 3)])
def test_the_spectrum_is_welchs(count: int, segments: int) -> None:
    record = ar1(3, 0.5, count=count)
    ours = power_spectrum(record, RATE, segments)
    length = count if segments == 1 else 2 * count // (segments + 1)
    used = length + (segments - 1) * (length // 2)
    fluctuation = (record - record.mean())[:used]
    frequency, density = signal.welch(
        fluctuation, RATE, "hann", length, length - length // 2, detrend=False, scaling="density"
    )
    assert ours.frequency == pytest.approx(frequency)
    assert ours.density == pytest.approx(density, rel=1e-9, abs=1e-15)


def test_the_spectrum_of_white_noise_is_flat_and_adds_up_to_the_variance() -> None:
    record, segments = white(4), 200
    frequency, density = power_spectrum(record, RATE, segments)
    # windows weigh the samples unevenly: half-overlapping Hann ones know the variance to sqrt(2 * 1.06/20000) = 1 %,
    # those samples that they share with the mean square itself to less; 4 %
    assert np.sum(density) * frequency[1] == pytest.approx(np.var(record), rel=0.04)
    # 200 overlapping segments scatter by sqrt(1.06/200) = 7.3 % a line, lines apart; five of them over 98 lines
    assert density[2:-2] == pytest.approx(2.0 / RATE, rel=0.37)
    low, high = density[2:50].mean(), density[50:-2].mean()
    # a mean over 48 lines, each of about 1.5 lines' width: 1.3 %, their difference 1.8 %; four of these
    assert low == pytest.approx(high, rel=0.08)


def test_the_spectrum_of_ar1_noise_is_that_of_its_fit() -> None:
    record = ar1(5, 0.715, count=100_000)
    frequency, density = power_spectrum(record, RATE, 400)
    ratio = density / ar1_density(fit_ar1(record), frequency, RATE)
    # 5.2 % a line, five of them; the first lines lack the mean
    assert ratio[3:-1] == pytest.approx(1.0, abs=0.26)
    assert ratio[3:-1].mean() == pytest.approx(1.0, abs=0.02)


def test_a_sine_stands_at_its_frequency_with_its_power() -> None:
    time = np.arange(SAMPLES) / RATE
    frequency, density = power_spectrum(0.1 * np.sin(2.0 * np.pi * 50.0 * time), RATE, 15)
    assert frequency[np.argmax(density)] == pytest.approx(50.0, abs=frequency[1])
    assert np.sum(density) * frequency[1] == pytest.approx(0.005, rel=1e-3)


# --- cross-correlation -----------------------------------------------------------------------------------------------


def test_it_is_the_sum_of_products_at_each_lag() -> None:
    a, b = white(6, 200), white(7, 200)
    x, y = a - a.mean(), b - b.mean()
    found = cross_correlation(a, b, 30)
    for lag, value in zip(found.lags.tolist(), found.values.tolist(), strict=True):
        products = sum(x[k] * y[k + lag] for k in range(200) if 0 <= k + lag < 200)
        assert value == pytest.approx(products / math.sqrt((x @ x) * (y @ y)), abs=1e-13)


def test_independent_channels_stay_within_the_bound_as_often_as_it_says() -> None:
    beyond = 0
    for seed in range(20):
        found = cross_correlation(white(100 + seed), ar1(200 + seed, 0.7), 0)
        beyond += int(abs(found.values[0]) > found.bound)
    assert beyond <= 4  # of twenty at 5 %: more than four in 0.3 % of such tests
    found = cross_correlation(white(8), white(9), 100, confidence=0.99995)
    assert np.all(np.abs(found.values) < found.bound)  # 201 lags: 1 % would fail
    assert found.bound == pytest.approx(4.06 / math.sqrt(SAMPLES), rel=0.01)


def test_a_delay_between_channels_shows_at_its_lag() -> None:
    a = white(10)
    found = cross_correlation(a, np.roll(a, 5) + white(11), 20)
    assert found.lags[np.argmax(found.values)] == 5
    # half of b's variance is a's; four standard deviations 1/sqrt(n)
    assert found.values.max() == pytest.approx(math.sqrt(0.5), abs=4.0 / math.sqrt(SAMPLES))


def test_ar1_noise_correlates_with_itself_by_powers_of_its_coefficient() -> None:
    found = cross_correlation(ar1(12, 0.7), ar1(12, 0.7), 5)
    assert found.values[5] == pytest.approx(1.0, abs=1e-12)
    # Bartlett: (1 + a^2)/(1 - a^2)/n at large lags, four standard deviations
    assert found.values[5:] == pytest.approx(0.7 ** np.arange(6), abs=4.0 * math.sqrt(1.49 / 0.51 / SAMPLES))


# --- what has no answer ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("record", "why"),
    [
        (np.ones(50), "never changes"),
        (np.full(50, 0.1), "never changes"),
        (np.arange(2.0), "samples or more"),
        (np.zeros((50, 3)), "one channel"),
        (np.array([math.nan] * 50), "finite"),
    ],
)
def test_a_record_without_noise_is_refused(record: Array, why: str) -> None:
    for ask in (fit_ar1, lambda x: power_spectrum(x, RATE, 1), lambda x: cross_correlation(x, x, 1)):
        with pytest.raises(RecordUnusableError, match=why):
            ask(record)
    assert issubclass(RecordUnusableError, AttitudeFmuError)


def test_questions_beyond_the_record_are_refused() -> None:
    record = white(13, 100)
    with pytest.raises(RecordUnusableError, match="wanted are 1 to 24"):
        power_spectrum(record, RATE, 25)
    with pytest.raises(RecordUnusableError, match="positive number"):
        power_spectrum(record, 0.0)
    with pytest.raises(RecordUnusableError, match="equally many"):
        cross_correlation(record, record[:-1], 3)
    with pytest.raises(RecordUnusableError, match="wanted are 0 to 99"):
        cross_correlation(record, record, 100)
    with pytest.raises(RecordUnusableError, match="probability"):
        cross_correlation(record, record, 3, confidence=1.0)
