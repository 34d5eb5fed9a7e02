"""Alignment at rest."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from attitude_fmu.models.attitude.alignment import (
    NOTHING_SEEN,
    AlignmentParameters,
    AlignmentState,
    MotionParameters,
    WatchedAlignment,
    levelled,
    nulled_bias,
    resting_bias,
    samples_for,
    with_sample,
    with_watched_sample,
)
from attitude_fmu.models.attitude.rotations import (
    EARTH_RATE,
    STANDARD_GRAVITY,
    Euler,
    earth_rate_n,
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
    quaternion_from_euler,
)
from attitude_fmu.models.vectors import ZERO3, add, multiply_transposed, scale

LATITUDE, PERIOD = 0.8, 0.002
ATTITUDES = [Euler(0.3, 0.2, -0.4), Euler(-2.5, -1.2, 3.0), Euler(3.0, 0.0, 0.0), Euler(-0.7, 1.4, 1.6)]
MOTION = MotionParameters()


def at_rest(attitude: Euler) -> tuple[Any, Any]:
    """Specific force and rate of a body that stands on the Earth."""
    c_nb = matrix_from_euler(attitude)
    return multiply_transposed(c_nb, (0.0, 0.0, STANDARD_GRAVITY)), multiply_transposed(c_nb, earth_rate_n(LATITUDE))


def watched(forces: Any, rates: Any, p: MotionParameters = MOTION) -> WatchedAlignment:
    seen = NOTHING_SEEN
    for force, rate in zip(np.asarray(forces).tolist(), np.asarray(rates).tolist(), strict=True):
        seen = with_watched_sample(seen, tuple(force), tuple(rate), p, PERIOD)
    return seen


def noisy(seed: int, count: int, force_sigma: float, rate_sigma: float) -> tuple[Any, Any]:
    chance = np.random.default_rng(seed)
    force, rate = at_rest(ATTITUDES[0])
    return (
        np.array(force) + force_sigma * chance.normal(size=(count, 3)),
        np.array(rate) + rate_sigma * chance.normal(size=(count, 3)),
    )


# --- the means -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("attitude", ATTITUDES)
def test_a_body_at_rest_is_levelled_to_its_attitude(attitude: Euler) -> None:
    q_nb = levelled(at_rest(attitude)[0], attitude.yaw)
    assert euler_from_matrix(matrix_from_quaternion(q_nb)) == pytest.approx(attitude, abs=1e-14)


def test_whole_samples_cover_the_duration() -> None:
    assert [samples_for(t, 0.002) for t in (0.0, 0.002, 0.003, 2.0, 30.0)] == [1.0, 1.0, 2.0, 1000.0, 15_000.0]


@pytest.mark.parametrize("attitude", ATTITUDES)
def test_the_earths_rotation_is_no_bias(attitude: Euler) -> None:
    bias = (0.01, -0.02, 0.005)
    force, rate = at_rest(attitude)
    alignment = with_sample(AlignmentState(0.0, ZERO3, ZERO3), force, add(rate, bias))
    found, sure = nulled_bias(alignment, levelled(force, attitude.yaw), LATITUDE, AlignmentParameters())
    assert found == pytest.approx(bias, abs=1e-17)
    assert sure == 1.0


def test_a_wrong_yaw_leaves_a_known_part_of_the_earths_rotation_in_the_bias() -> None:
    attitude, wrong = ATTITUDES[0], 0.3
    bias = resting_bias(
        at_rest(attitude)[1], quaternion_from_euler(attitude._replace(yaw=attitude.yaw + wrong)), LATITUDE
    )
    left = 2.0 * EARTH_RATE * math.cos(LATITUDE) * math.sin(0.5 * wrong)
    assert np.linalg.norm(bias) == pytest.approx(left, rel=1e-9)


def test_a_body_that_turns_gets_no_bias() -> None:
    force, rate = at_rest(ATTITUDES[0])
    alignment = with_sample(AlignmentState(0.0, ZERO3, ZERO3), force, add(rate, (0.0, 0.0, 0.1)))
    found, sure = nulled_bias(alignment, levelled(force, 0.0), LATITUDE, AlignmentParameters())
    assert (found, sure) == (ZERO3, 0.0)


# --- watching for motion ---------------------------------------------------------------------------------------------


def test_at_rest_watching_changes_nothing_in_the_sums() -> None:
    forces, rates = noisy(1, 1000, 0.003, 0.002)
    seen, plain = watched(forces, rates), AlignmentState(0.0, ZERO3, ZERO3)
    for force, rate in zip(forces.tolist(), rates.tolist(), strict=True):
        plain = with_sample(plain, tuple(force), tuple(rate))
    assert seen.sums == plain


def test_vibration_without_mean_does_not_disturb() -> None:
    # 17 mg rms of the 2021 paper's bench; low-passed over 0.1 s 0.03 m/s^2 is left, by three axes, of 0.2 allowed
    assert watched(*noisy(2, 15_000, 0.017 * STANDARD_GRAVITY, 0.002)).sums.samples == 15_000


@pytest.mark.parametrize("first", [1, 3, 40, 700])
def test_a_knock_at_any_time_begins_the_averaging_anew(first: int) -> None:
    forces, rates = noisy(3, 1000, 0.003, 0.002)
    rates[first : first + 100] += (0.0, 0.2, 0.0)
    seen = watched(forces, rates)
    assert seen.sums.samples < 1000 - first
    rest = rates[1000 - int(seen.sums.samples) :].mean(axis=0)
    assert np.array(scale(1.0 / seen.sums.samples, seen.sums.rate)) == pytest.approx(rest, abs=1e-12)


def test_a_body_that_keeps_tilting_is_never_aligned() -> None:
    # 2 deg/s about the right-hand axis: 1.2 deg away from the mean after about 1.2 s
    time = PERIOD * np.arange(15_000)
    tilt = math.radians(2.0) * time
    forces = STANDARD_GRAVITY * np.stack([0.0 * time, np.sin(tilt), np.cos(tilt)], axis=1)
    rates = np.tile((math.radians(2.0), 0.0, 0.0), (15_000, 1))
    samples, seen = [], NOTHING_SEEN
    for force, rate in zip(forces.tolist(), rates.tolist(), strict=True):
        seen = with_watched_sample(seen, tuple(force), tuple(rate), MOTION, PERIOD)
        samples.append(seen.sums.samples)
    assert max(samples) * PERIOD < 2.0
    assert sum(after == 1.0 for after in samples[1:]) > 15


def test_restarting_can_be_switched_off() -> None:
    forces, rates = noisy(4, 300, 0.003, 0.002)
    rates[100:] += 1.0
    seen = watched(forces, rates, MOTION._replace(restart=False))
    assert seen.sums.samples == 300.0
