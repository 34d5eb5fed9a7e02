"""The fused solution: its covariance against matrices, and what it does in attitudes that test it."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attitude_fmu.models.attitude import velocity_aided
from attitude_fmu.models.attitude.integration import mean_rate
from attitude_fmu.models.attitude.rotations import (
    STANDARD_GRAVITY,
    Euler,
    matrix_from_quaternion,
    quaternion_from_euler,
)
from attitude_fmu.models.attitude.velocity_aided import (
    Fused,
    FusionParameters,
    RestState,
    corrected,
    initial_fusion,
    is_held,
    with_rest,
)
from attitude_fmu.models.vectors import ZERO3, add, multiply_transposed, subtract

STATES = velocity_aided.STATES
DEFAULT = FusionParameters()


def square(triangle: Any) -> np.ndarray:
    p = np.zeros((STATES, STATES))
    p[np.triu_indices(STATES)] = triangle
    return p + np.triu(p, 1).T


def random_covariance(seed: int) -> np.ndarray:
    a = np.random.default_rng(seed).normal(size=(STATES, STATES))
    return a @ a.T


@pytest.mark.parametrize("free", [0.01, 0.0])
def test_prediction_is_f_p_f_transposed(free: float) -> None:
    c_nb = Rotation.random(random_state=3).as_matrix()
    p, f_up, h = random_covariance(1), 9.3, 0.01
    a = np.zeros((STATES, STATES))
    a[0:2, 4:7] = -c_nb[0:2]
    a[2, 1], a[3, 0] = f_up, -f_up
    f = np.eye(STATES) + h * a
    # an attitude that is held does not follow the bias
    f[0:2, 4:7] *= free / h
    rows = tuple(map(tuple, c_nb.tolist()))
    ours = velocity_aided._predicted(p[np.triu_indices(STATES)].tolist(), rows, f_up, h, free)  # type: ignore[arg-type]
    assert square(ours) == pytest.approx(f @ p @ f.T, abs=1e-13)


@pytest.mark.parametrize("index", [2, 3, 6])
def test_update_is_the_kalman_filters(index: int) -> None:
    p, x, variance, seen = random_covariance(2), np.arange(7.0), 0.3, 1.7
    h = np.eye(STATES)[index]
    gain = p @ h / (h @ p @ h + variance)
    ours, state = velocity_aided._measured(p[np.triu_indices(STATES)].tolist(), x.tolist(), index, seen, variance)
    assert square(ours) == pytest.approx((np.eye(STATES) - np.outer(gain, h)) @ p, abs=1e-13)
    assert state == pytest.approx(x + gain * (seen - x[index]), abs=1e-13)


def fused_step(fused: Fused, rate: Any, force: Any, parameters: FusionParameters, latitude: float, h: float) -> Fused:
    """The solution integrated over a step in which the rate was this, and corrected."""
    earth = multiply_transposed(matrix_from_quaternion(fused.q_nb), velocity_aided.earth_rate_n(latitude))
    turning = subtract(rate, add(fused.bias, earth))
    fusion = with_rest(fused.fusion, fused.q_nb, rate, force, parameters, latitude, h)
    turned = fused.q_nb if is_held(fusion, parameters) else mean_rate(fused.q_nb, ZERO3, turning, h)
    integrated = Fused(turned, fused.bias, fusion)
    return corrected(integrated, rate, force, parameters, latitude, h)


def moved(attitude: Euler, seconds: float, rate: tuple[float, float, float], parameters: Any = DEFAULT) -> Fused:
    """The solution of a body that turns at a constant body rate without going anywhere; no Earth rate."""
    h = 0.01
    q = quaternion_from_euler(attitude)
    truth = Rotation.from_matrix(matrix_from_quaternion(q))
    force = multiply_transposed(matrix_from_quaternion(q), (0.0, 0.0, STANDARD_GRAVITY))
    fused = Fused(q, ZERO3, initial_fusion(parameters, ZERO3, 1e-3, 0.0, RestState(ZERO3, force, 0.0)))
    for _ in range(round(seconds / h)):
        truth = truth * Rotation.from_rotvec(np.array(rate) * h)
        felt = truth.inv().apply([0.0, 0.0, STANDARD_GRAVITY])
        earth = truth.inv().apply([0.0, velocity_aided.earth_rate_n(0.0)[1], 0.0])
        fused = fused_step(fused, tuple((rate + earth).tolist()), tuple(felt.tolist()), parameters, 0.0, h)
    c_nb = np.array(matrix_from_quaternion(fused.q_nb))
    up = np.arccos(np.clip((c_nb[2] * truth.as_matrix()[2]).sum(), -1.0, 1.0))
    assert math.degrees(up) < 0.02
    return fused


@pytest.mark.parametrize(
    "attitude",
    [Euler(0.3, 0.2, 0.1), Euler(0.0, 0.5 * math.pi, 0.0), Euler(1.0, -0.5 * math.pi, 0.0), Euler(0.0, 0.0, math.pi)],
)
@pytest.mark.parametrize("rate", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.3, -2.0, 0.7)])
def test_attitude_is_kept_upright_on_end_and_upside_down(attitude: Euler, rate: tuple[float, float, float]) -> None:
    moved(attitude, 20.0, rate)


@pytest.mark.parametrize(
    "parameters",
    [
        DEFAULT,
        DEFAULT._replace(gyro_noise=1e-9, bias_walk=0.0, rate_noise=0.0),
        DEFAULT._replace(velocity_bound=1e-6, rest_velocity=1e-9),
        DEFAULT._replace(gyro_noise=1.0, bias_walk=1.0),
    ],
)
def test_covariance_stays_positive_with_extreme_parameters(parameters: FusionParameters) -> None:
    h, fused = 0.002, None
    force = (0.0, 0.0, STANDARD_GRAVITY)
    fusion = initial_fusion(parameters, ZERO3, 0.01, 0.0, RestState(ZERO3, force, 0.0))
    fused = Fused((1.0, 0.0, 0.0, 0.0), ZERO3, fusion)
    for k in range(10_000):
        rate = (0.5 * math.sin(0.01 * k), 0.0, 0.2) if k < 5000 else ZERO3
        fused = fused_step(fused, rate, force, parameters, 0.0, h)
        if k % 1000 == 999:
            p = square(fused.fusion.covariance)
            scale = 1.0 / np.sqrt(np.diag(p))
            assert np.all(np.diag(p) > 0.0)
            # correlations: rounding may put an eigenvalue at most a few thousand ulp below zero
            assert np.linalg.eigvalsh(p * np.outer(scale, scale)).min() > -1e-9


def test_errors_are_as_large_as_the_covariance_says() -> None:
    # white gyro noise and a constant bias, drawn as the filter assumes; at the end of each of n runs the squared
    # normalised error of tilt (2) and bias (2 observable axes) sums to chi^2 of 4 n degrees: 4 n +- 4 sqrt(8 n)
    parameters = DEFAULT._replace(rate_noise=0.0, bias_walk=1e-6, rest_bias=0.0, rest_specific_force=0.0)
    rng, h, runs, total = np.random.default_rng(7), 0.02, 40, 0.0
    force = (0.0, 0.0, STANDARD_GRAVITY)
    earth = (0.0, velocity_aided.earth_rate_n(0.0)[1], 0.0)
    for _ in range(runs):
        bias = rng.normal(size=3) * 1e-3
        tilt = rng.normal(size=2) * parameters.initial_tilt
        start = Rotation.from_rotvec([-tilt[0], -tilt[1], 0.0]).as_quat()
        q = (start[3], start[0], start[1], start[2])
        fused = Fused(q, ZERO3, initial_fusion(parameters, ZERO3, 1e-3, 0.0, RestState(ZERO3, force, 0.0)))
        noise = rng.normal(size=(1500, 3)) * parameters.gyro_noise / math.sqrt(h)
        walk = rng.normal(size=2) * 0.1
        fused = fused._replace(fusion=fused.fusion._replace(velocity=(-walk[0], -walk[1])))
        seen = rng.normal(size=(1500, 2)) * parameters.velocity_bound / math.sqrt(h)
        for k in range(1500):
            rate = tuple((np.array(earth) + bias + noise[k]).tolist())
            # the statement "velocity is zero" is off by its noise: moving the estimate is the same
            v = fused.fusion.velocity
            shifted = fused._replace(fusion=fused.fusion._replace(velocity=(v[0] + seen[k, 0], v[1] + seen[k, 1])))
            after = fused_step(shifted, rate, force, parameters._replace(velocity_adaptation=0.0), 0.0, h)
            v = after.fusion.velocity
            fused = after._replace(fusion=after.fusion._replace(velocity=(v[0] - seen[k, 0], v[1] - seen[k, 1])))
        c_nb = np.array(matrix_from_quaternion(fused.q_nb))
        left = -Rotation.from_matrix(c_nb).as_rotvec()[:2]
        error = np.array([*left, *(bias - np.array(fused.bias))[:2]])
        p = square(fused.fusion.covariance)[np.ix_([0, 1, 4, 5], [0, 1, 4, 5])]
        total += error @ np.linalg.solve(p, error)
    assert abs(total - 4 * runs) < 4 * math.sqrt(8 * runs)


HELD = DEFAULT._replace(
    rest_tilt_noise=1e-5, specific_force_noise=0.033, rest_specific_force=1.2, rest_velocity=1e-5, push_noise=0.3
)
H = 0.05


def on_a_shaking_bench(
    rng: np.random.Generator, seconds: float, start: Fused, parameters: FusionParameters, push: float = 0.0
) -> Fused:
    """The solution of a level body at rest that shakes along x, pushed at first by a knock of `push` (m/s)."""
    fused = start
    for k in range(round(seconds / H)):
        shake = rng.normal() * 0.033 / math.sqrt(H) + (push / (2 * H) if k < 2 else 0.0)
        rate = tuple((rng.normal(size=3) * 1.9e-4 / math.sqrt(H)).tolist())
        fused = fused_step(fused, rate, (float(shake), 0.0, STANDARD_GRAVITY), parameters, 0.5 * math.pi, H)
    return fused


def level(parameters: FusionParameters) -> Fused:
    force = (0.0, 0.0, STANDARD_GRAVITY)
    return Fused(
        (1.0, 0.0, 0.0, 0.0), ZERO3, initial_fusion(parameters, ZERO3, 1e-4, 0.0, RestState(ZERO3, force, 3.0))
    )


def tilt_about_y(fused: Fused) -> float:
    return math.atan2(-matrix_from_quaternion(fused.q_nb)[2][0], 1.0)


def test_attitude_held_at_rest_averages_white_shaking_as_well_as_can_be() -> None:
    # from no knowledge at all, T seconds of noise of density A leave A/(g sqrt(T)); 30 runs tell an rms within
    # 4/sqrt(60) = 52 %, and with gyros of 1.9e-4 rad/s^0.5 a tilt that is not held would be known to 7.9e-4 rad at best
    parameters = HELD._replace(initial_tilt=0.1)
    runs = [
        tilt_about_y(on_a_shaking_bench(np.random.default_rng(seed), 60.0, level(parameters), parameters))
        for seed in range(30)
    ]
    limit = 0.033 / STANDARD_GRAVITY / math.sqrt(60.0)
    rms = math.sqrt(float(np.mean(np.square(runs))))
    assert 0.48 * limit < rms < 1.52 * limit < 7.9e-4


def test_yaw_stands_still_while_the_attitude_is_held() -> None:
    rng = np.random.default_rng(5)
    fused = on_a_shaking_bench(rng, 20.0, level(HELD), HELD)
    assert abs(fused.q_nb[3]) < 1e-9
    integrated = on_a_shaking_bench(rng, 20.0, level(DEFAULT), DEFAULT)
    assert abs(integrated.q_nb[3]) > 1e-5


@pytest.mark.parametrize(("push_noise", "allowed"), [(0.3, 1e-3), (0.0, None)])
def test_knock_is_forgotten_if_it_is_known_for_what_it_is(push_noise: float, allowed: float | None) -> None:
    # a bench that is left with 0.5 m/s: taken for tilt, that is 0.5/(g T) = 2.5 mrad over 20 s and more
    parameters = HELD._replace(push_noise=push_noise)
    settled = on_a_shaking_bench(np.random.default_rng(3), 20.0, level(parameters), parameters)
    after = on_a_shaking_bench(np.random.default_rng(4), 4.0, settled, parameters, push=0.5)
    moved = abs(tilt_about_y(after) - tilt_about_y(settled))
    assert moved < allowed if allowed else moved > 2e-3
