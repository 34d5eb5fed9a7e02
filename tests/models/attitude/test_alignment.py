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
    heading_from_magnetic,
    levelled,
    nulled_bias,
    resting_bias,
    samples_for,
    standard_error,
    tilt_error,
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
    tilt_from_specific_force,
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
    assert seen.restarts == 0.0


def test_vibration_without_mean_does_not_disturb() -> None:
    # 17 mg rms of the 2021 paper's bench; low-passed over 0.1 s 0.03 m/s^2 is left, by three axes, of 0.2 allowed
    assert watched(*noisy(2, 15_000, 0.017 * STANDARD_GRAVITY, 0.002)).restarts == 0.0


@pytest.mark.parametrize("first", [1, 3, 40, 700])
def test_a_knock_at_any_time_begins_the_averaging_anew(first: int) -> None:
    forces, rates = noisy(3, 1000, 0.003, 0.002)
    rates[first : first + 100] += (0.0, 0.2, 0.0)
    seen = watched(forces, rates)
    assert seen.restarts >= 1.0
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
    assert seen.restarts > 15


def test_restarting_can_be_switched_off() -> None:
    forces, rates = noisy(4, 300, 0.003, 0.002)
    rates[100:] += 1.0
    seen = watched(forces, rates, MOTION._replace(restart=False))
    assert (seen.restarts, seen.sums.samples) == (0.0, 300.0)


# --- how good it is --------------------------------------------------------------------------------------------------


def test_the_scatter_is_that_of_the_samples() -> None:
    forces, rates = noisy(5, 200, 0.003, 0.002)
    seen = watched(forces, rates)
    assert standard_error(seen.specific_force_squares, 200.0) == pytest.approx(
        forces.std(axis=0, ddof=1) / math.sqrt(200.0), rel=1e-9
    )
    assert standard_error(seen.rate_squares, 200.0) == pytest.approx(
        rates.std(axis=0, ddof=1) / math.sqrt(200.0), rel=1e-9
    )


def test_one_sample_has_no_scatter() -> None:
    assert standard_error(watched(*noisy(6, 1, 0.003, 0.002)).rate_squares, 1.0) == ZERO3


@pytest.mark.parametrize("attitude", ATTITUDES)
def test_the_tilt_error_is_the_linearised_solution(attitude: Euler) -> None:
    force, error, step = at_rest(attitude)[0], (0.003, 0.005, 0.002), 1e-4
    slopes = []
    for axis in range(3):
        ends = [list(force), list(force)]
        ends[0][axis] += step
        ends[1][axis] -= step
        ahead, behind = (tilt_from_specific_force(tuple(end)) for end in ends)  # type: ignore[arg-type]
        slopes.append([(a - b) / (2.0 * step) * error[axis] for a, b in zip(ahead, behind, strict=True)])
    assert tilt_error(force, error) == pytest.approx(np.linalg.norm(slopes, axis=0), rel=1e-6)


def test_the_stated_error_is_the_spread_of_many_alignments() -> None:
    runs = 300
    found, stated = [], []
    for seed in range(runs):
        forces, _ = noisy(100 + seed, 50, 0.01, 0.0)
        seen = watched(forces, np.zeros((50, 3)))
        found.append(tilt_from_specific_force(seen.sums.specific_force))
        mean = scale(1.0 / seen.sums.samples, seen.sums.specific_force)
        stated.append(tilt_error(mean, standard_error(seen.specific_force_squares, seen.sums.samples)))
    # a standard deviation of 300 runs is known to 1/sqrt(600) = 4 %; four of these
    assert np.std(found, axis=0) == pytest.approx(np.mean(stated, axis=0), rel=0.16)


# --- heading ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("attitude", ATTITUDES)
@pytest.mark.parametrize("dip", [-1.1, 0.0, 1.1])
def test_the_heading_of_a_tilted_body_comes_from_the_magnetic_field(attitude: Euler, dip: float) -> None:
    # magnetic north lies at the declination, east of true north; the field points downwards by the dip
    declination = 0.1
    m_n = (math.cos(dip) * math.sin(declination), math.cos(dip) * math.cos(declination), -math.sin(dip))
    m_b = scale(48.0, multiply_transposed(matrix_from_euler(attitude), m_n))
    heading = heading_from_magnetic(m_b, attitude.pitch, attitude.roll)
    assert math.remainder(heading + declination - attitude.yaw, 2.0 * math.pi) == pytest.approx(0.0, abs=1e-14)


def test_a_wrong_tilt_turns_the_heading_by_the_tangent_of_the_dip() -> None:
    dip, wrong = 1.1, 1e-4
    m_b = (0.0, math.cos(dip), -math.sin(dip))
    # rolled by `wrong` in the belief alone, heading north
    assert heading_from_magnetic(m_b, 0.0, wrong) == pytest.approx(math.tan(dip) * wrong, rel=1e-6)


def test_the_heading_closes_the_alignment() -> None:
    attitude = ATTITUDES[1]
    force = at_rest(attitude)[0]
    m_b = multiply_transposed(matrix_from_euler(attitude), (0.0, 0.5, -0.9))
    yaw = heading_from_magnetic(m_b, *tilt_from_specific_force(force))
    assert euler_from_matrix(matrix_from_quaternion(levelled(force, yaw))) == pytest.approx(attitude, abs=1e-14)
