"""The fit of a triad's errors: exact without noise, and as uncertain as it says with it."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
import pytest

from attitude_fmu.cosim.calibration import ErrorModel, Readings, compensation, fit
from attitude_fmu.cosim.identification import RecordUnusableError

G = 9.8
DIRECTIONS = np.array([d for d in itertools.product((0.0, 1.0, -1.0), repeat=3) if any(d)])
UP = G * DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1)[:, None]
FACES = np.flatnonzero(np.sum(np.abs(DIRECTIONS), axis=1) == 1.0)
TURN = np.where(np.sum(UP[FACES], axis=1) > 0.0, 1.0, 1.0 / 3.0)[:, None]
"""rad/s: fast with an axis up, slow with it down"""


def errors_of(seed: int) -> ErrorModel:
    """Errors as large as those of a poor part."""
    random = np.random.default_rng(seed)
    return ErrorModel(
        np.eye(3) + 0.03 * random.standard_normal((3, 3)),
        1e-4 * random.standard_normal(3),
        0.02 * random.standard_normal(3),
        0.2 * random.standard_normal(3),
        1e-3 * random.standard_normal(3),
        1e-5 * random.standard_normal(3),
        1e-4 * random.standard_normal((3, 3)),
    )


def read_by(
    truth: ErrorModel,
    temperatures: Any = (-30.0, -10.0, 10.0, 30.0),
    positions: Any = UP,
    noise: float = 0.0,
    scatter: float = 0.0,
    seed: int = 0,
) -> Readings:
    """Gyro readings of a part with these errors, at rest and turning about the faces, a power-up a temperature."""
    random = np.random.default_rng(seed)
    force = np.concatenate((positions, UP[FACES], UP[FACES]))
    rate = np.concatenate((0.0 * positions, TURN * UP[FACES] / G, -TURN * UP[FACES] / G))
    duration = np.concatenate((np.full(len(positions), 9.0), np.full(2 * len(FACES), 4.0)))
    parts = []
    for power_up, d in enumerate(temperatures):
        v = (1.0 + truth.scale_temperature_slope * d) * (rate @ truth.sensitivity.T)
        bias = truth.bias + truth.bias_temperature_slope * d + truth.bias_temperature_curve * d**2
        left = noise / np.sqrt(duration)[:, None] * random.standard_normal(rate.shape)
        read = (
            v + truth.cubic * v**3 + bias + force @ truth.g_sensitivity.T + left + scatter * random.standard_normal(3)
        )
        n = len(rate)
        parts.append(Readings(rate, read, force, np.full(n, d), duration, np.full(n, power_up)))
    return Readings._make(np.concatenate(columns) for columns in zip(*parts, strict=True))


def flat(model: ErrorModel) -> Any:
    """One row for each axis, one column for each coefficient."""
    return np.concatenate([np.reshape(field, (3, -1)) for field in model], axis=1)


@pytest.mark.parametrize("seed", range(3))
def test_without_noise_every_coefficient_is_found_exactly(seed: int) -> None:
    truth = errors_of(seed)
    found = fit(read_by(truth), g_sensitivity=True)
    assert flat(found.coefficients) == pytest.approx(flat(truth), abs=1e-9)
    assert np.max(flat(found.standard_errors)) < 1e-9


def test_what_is_not_asked_for_is_zero() -> None:
    truth = errors_of(1)._replace(g_sensitivity=np.zeros((3, 3)))
    found = fit(read_by(truth), g_sensitivity=False)
    assert flat(found.coefficients) == pytest.approx(flat(truth), abs=1e-9)
    assert not np.any(found.standard_errors.g_sensitivity)


def test_standard_errors_cover_the_truth() -> None:
    """The squares of (fitted - true)/error are chi-square of one degree of freedom on average, for each coefficient.

    With 60 seeds of three axes their mean scatters by sqrt(2/180) = 0.11; the biases' errors rest on 20 power-ups,
    which puts (20 - 3)/(20 - 5) = 1.13 on top at most. Bounds: four times the scatter. The scatter of the power-ups is
    three times what an interval's noise leaves: left out, the biases' mean would be above 50.
    """
    truth, noise, scatter = errors_of(4), 3e-3, 3e-3
    temperatures = np.linspace(-35.0, 35.0, 20)
    positions = UP[FACES]
    found = [
        fit(read_by(truth, temperatures, positions, noise, scatter, seed), g_sensitivity=True) for seed in range(60)
    ]
    off = np.array([(flat(one.coefficients) - flat(truth)) / flat(one.standard_errors) for one in found])
    squares = np.mean(off**2, axis=(0, 1))
    assert np.all(squares > 1.0 - 4 * 0.11)
    assert np.all(squares < 1.13 + 4 * 0.11)
    # the variances themselves: relative deviation sqrt(2/n) of each, n = 19 x 18 intervals and 17 power-ups
    assert np.mean([one.noise**2 for one in found]) == pytest.approx(noise**2, rel=4 * np.sqrt(2.0 / (180 * 340)))
    assert np.mean([one.scatter**2 for one in found]) == pytest.approx(scatter**2, rel=4 * np.sqrt(2.0 / (180 * 17)))


def test_a_longer_interval_weighs_more() -> None:
    truth = errors_of(5)
    exact = read_by(truth)
    # one reading is wrong; the longer it is said to have lasted, the more it pulls
    read = exact.read.copy()
    read[0] += 1e-3
    pulled = []
    for seconds in (1.0, 9.0, 81.0):
        duration = exact.duration.copy()
        duration[0] = seconds
        found = fit(exact._replace(read=read, duration=duration), g_sensitivity=True)
        pulled.append(np.max(np.abs(found.coefficients.bias - truth.bias)))
    assert pulled[0] < pulled[1] < pulled[2]


def test_intervals_that_leave_a_coefficient_open_are_refused() -> None:
    with pytest.raises(RecordUnusableError, match="more positions, rates or temperatures are wanted"):
        fit(read_by(errors_of(1), temperatures=(10.0,)), g_sensitivity=True)
    few = Readings._make(column[[0, 8, 27, 33, 36]] for column in read_by(errors_of(1)))
    with pytest.raises(RecordUnusableError, match="5 intervals do not determine"):
        fit(few, g_sensitivity=True)


def test_a_single_power_up_has_no_scatter() -> None:
    together = read_by(errors_of(2), noise=1e-3)
    found = fit(together._replace(power_up=np.zeros_like(together.power_up)), g_sensitivity=True)
    assert not np.any(found.scatter)


def test_compensation_takes_out_what_was_found() -> None:
    gyro, accelerometer = errors_of(1), errors_of(2)
    values = compensation(gyro, accelerometer)
    read = {"compensation.gyro": gyro, "compensation.accelerometer": accelerometer}
    for prefix, model in read.items():
        matrix = np.array([[values[f"{prefix}_matrix[{i},{j}]"] for j in (1, 2, 3)] for i in (1, 2, 3)])
        assert matrix @ model.sensitivity == pytest.approx(np.eye(3), abs=1e-12)
        for name in ("bias", "bias_temperature_slope", "bias_temperature_curve", "scale_temperature_slope", "cubic"):
            assert [values[f"{prefix}_{name}[{i}]"] for i in (1, 2, 3)] == list(getattr(model, name))
    assert values["compensation.g_sensitivity[2,3]"] == gyro.g_sensitivity[1, 2]
    assert len(values) == 9 + 9 + 9 + 10 * 3
