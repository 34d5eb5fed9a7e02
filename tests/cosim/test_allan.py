"""Allan deviation: estimator and theory, on seeded records of numpy."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from attitude_fmu.cosim import allan
from attitude_fmu.cosim.identification import RecordUnusableError
from attitude_fmu.models.sensors.bias_instability import SIGMA_PER_INSTABILITY, TIME_CONSTANTS

Array = NDArray[np.float64]
RATE = 100.0
SAMPLES = 20_000


def white(seed: int, count: int = SAMPLES) -> Array:
    return np.random.default_rng(seed).normal(size=count)


def correlated(seed: int, time_constant: float, count: int = SAMPLES) -> Array:
    a = math.exp(-1.0 / (RATE * time_constant))
    fresh = white(seed, count) * math.sqrt(1.0 - a * a)
    x = np.zeros(count)
    x[0] = white(seed + 1, 1)[0]
    for k in range(1, count):
        x[k] = a * x[k - 1] + fresh[k]
    return x


def test_the_estimate_is_the_definition() -> None:
    x, m = white(1, 50), 4
    means = np.array([x[k : k + m].mean() for k in range(len(x) - m + 1)])
    expected = math.sqrt(np.mean((means[m:] - means[:-m]) ** 2) / 2.0)
    assert allan.allan_deviation(x, RATE, [m / RATE]).deviation[0] == pytest.approx(expected, rel=1e-12)


def test_a_ramp_gives_its_slope_times_the_cluster_time_over_root_two() -> None:
    found = allan.allan_deviation(3.0 * np.arange(1000) / RATE, RATE)
    assert found.deviation == pytest.approx(3.0 * found.tau / math.sqrt(2.0), rel=1e-9)


def test_an_offset_changes_nothing() -> None:
    x = white(2)
    assert allan.allan_deviation(x + 1e6, RATE).deviation == pytest.approx(
        allan.allan_deviation(x, RATE).deviation, rel=1e-9
    )


# 20 cluster times, of which neighbours move together: at 99.9 % hardly one in fifty records has one outside
@pytest.mark.parametrize(
    ("record", "theory"),
    [
        (white(3), lambda tau: allan.white_noise(tau, math.sqrt(2.0 / RATE))),
        (np.cumsum(white(4)) / math.sqrt(RATE), lambda tau: allan.rate_random_walk(tau, 1.0)),
        (correlated(5, 0.3), lambda tau: allan.gauss_markov(tau, 1.0, 0.3)),
        (RATE * np.diff(np.random.default_rng(6).uniform(size=SAMPLES + 1)), lambda tau: allan.quantisation(tau, 1.0)),
    ],
    ids=["white", "random walk", "Gauss-Markov", "quantised angle"],
)
def test_a_record_agrees_with_its_theory(record: Array, theory: object) -> None:
    found = allan.allan_deviation(record, RATE, np.array([0.04, 0.1, 0.3, 1.0, 3.0, 10.0]), confidence=0.999)
    expected = theory(found.tau)  # type: ignore[operator]
    # sampled processes differ from continuous ones by some (1 sample/cluster)^2 of the variance, 6 % at four samples
    assert np.all(found.low <= 1.03 * expected)
    assert np.all(found.high >= 0.97 * expected)


@pytest.mark.parametrize("walks", [False, True])
def test_the_interval_holds_the_truth_as_often_as_it_says(walks: bool) -> None:
    taus = np.array([0.08, 0.64, 2.56])
    theory = allan.rate_random_walk(taus, 1.0) if walks else allan.white_noise(taus, math.sqrt(2.0 / RATE))
    hits = np.zeros(3)
    for seed in range(300):
        x = white(seed, 2000)
        record = np.cumsum(x) / math.sqrt(RATE) if walks else x
        found = allan.allan_deviation(record, RATE, taus, confidence=0.9)
        hits += (found.low <= theory) & (theory <= found.high)
    # of 300 at 90 %: standard deviation 1.7 %; four of these, and what the approximations leave
    assert hits / 300.0 == pytest.approx(0.9, abs=0.08)


def test_records_together_have_their_degrees_of_freedom_together() -> None:
    parts = [allan.allan_deviation(white(seed), RATE) for seed in (7, 8, 9)]
    together = allan.pooled(parts)
    assert together.freedom == pytest.approx(sum(part.freedom for part in parts))
    assert np.all(together.high - together.low < parts[0].high - parts[0].low)
    assert together.deviation[0] == pytest.approx(
        math.sqrt(np.mean([part.deviation[0] ** 2 for part in parts])), rel=1e-12
    )


@pytest.mark.parametrize("freedom", [2.0, 5.0, 50.0, 3000.0])
def test_bounds_are_those_of_chi_squared(freedom: float) -> None:
    low, high = allan.chi_squared_bounds(freedom, 0.95)
    # Wilson and Hilferty's cube errs by 0.6 % at the upper end for two degrees of freedom, by 0.03 at the lower one,
    # and by ever less for more
    assert float(high) == pytest.approx(stats.chi2.ppf(0.975, freedom), rel=0.012 / freedom)
    assert float(low) == pytest.approx(stats.chi2.ppf(0.025, freedom), abs=0.035)


def test_correlated_noise_peaks_where_the_literature_says() -> None:
    tau = np.geomspace(0.5, 10.0, 20_001)
    hump = allan.gauss_markov(tau, 2.0, 1.5)
    # to half of the last digits that are given
    assert float(hump.max()) == pytest.approx(2.0 * 0.6174, abs=2.0 * 0.5e-4)
    assert float(tau[np.argmax(hump)]) == pytest.approx(1.89 * 1.5, abs=1.5 * 0.5e-2)


def test_correlated_noise_is_smooth_where_its_series_takes_over() -> None:
    tau = np.array([0.0099999, 0.0100001])
    below, above = allan.gauss_markov(tau, 1.0, 1.0)
    # it grows as sqrt(tau), by 1e-5 over this step; the series ends at 1e-7 and the full form cancels to 1e-10
    assert above / below - 1.0 == pytest.approx(1e-5, abs=1e-6)


def test_the_modelled_instability_is_flat_from_a_second_to_a_thousand() -> None:
    tau = np.geomspace(1.0, 1000.0, 50)
    modelled = allan.modelled_instability(tau, 1.0, TIME_CONSTANTS, SIGMA_PER_INSTABILITY)
    # one process a decade ripples by 2 %, the ends of the chain at 0.1 s and 10^4 s take a little off as well
    assert modelled == pytest.approx(allan.bias_instability(tau, 1.0), rel=0.025)


def test_terms_add_by_their_squares() -> None:
    assert allan.combined(np.array([3.0]), np.array([4.0]))[0] == pytest.approx(5.0)


def test_rounding_is_the_white_noise_of_its_variance() -> None:
    readings = np.round(white(10) * 20.0) - 20.0 * white(10)
    found = allan.allan_deviation(readings, RATE, [0.1])
    # 2960 degrees of freedom: known to 1/sqrt(2 * 2960) = 1.3 %, three of these
    assert found.deviation[0] == pytest.approx(allan.rounding(0.1, 1.0, 1.0 / RATE), rel=0.04)


@pytest.mark.parametrize(
    ("record", "rate", "taus", "message"),
    [
        (np.zeros(3), RATE, None, "10 finite samples or more"),
        (np.full(100, np.nan), RATE, None, "finite"),
        (white(1, 100), 0.0, None, "rate = 0.0 Hz"),
        (white(1, 100), RATE, [0.6], "cluster times of 0.01 to 0.5 s fit a record of 1 s"),
    ],
)
def test_what_has_no_answer_is_refused(record: Array, rate: float, taus: list[float] | None, message: str) -> None:
    with pytest.raises(RecordUnusableError, match=message):
        allan.allan_deviation(record, rate, taus)
