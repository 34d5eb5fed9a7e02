"""LQG by its own Riccati equations, and its reduction, held against scipy, closed forms and definitions."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import linalg

from attitude_fmu.cosim.control.lqg import (
    Cost,
    Observer,
    Plant,
    estimator,
    gramian_root,
    lqg,
    regulator,
    riccati,
    truncated,
)
from attitude_fmu.cosim.control.responses import response
from attitude_fmu.cosim.errors import LinearisationRefusedError

DT = 0.01
ROUNDING = 1e-9
"""Far above what a few hundred operations of double precision lose, far below any mistake."""


def benign(n: int, inputs: int, outputs: int, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    A = random.standard_normal((n, n))
    A *= 0.9 / np.abs(np.linalg.eigvals(A)).max()
    return A, random.standard_normal((n, inputs)), random.standard_normal((outputs, n))


def plant() -> Plant:
    A, B, C = benign(5, 2, 3)
    E = benign(5, 1, 2, seed=4)[2]
    return Plant(A, B, C, E, 0.1 * np.eye(5) + 0.3 * B @ B.T, np.diag([0.1, 0.2, 0.3]))


COST = Cost(2.0, np.array([1.0, 0.5]), 0.1, np.array([0.2, 0.3]))


def designed() -> tuple[Plant, tuple[np.ndarray, np.ndarray, np.ndarray], np.ndarray, Observer]:
    p = plant()
    gain = regulator(p, COST, DT)
    correction, _ = estimator(p)
    return p, gain, correction, lqg(p, gain, correction)


def same_set(found: np.ndarray, wanted: np.ndarray, tolerance: float) -> bool:
    """Whether two lists of complex numbers are the same but for their order."""
    left = list(wanted)
    for one in found:
        nearest = min(left, key=lambda other: abs(other - one))
        if abs(nearest - one) > tolerance:
            return False
        left.remove(nearest)
    return not left


def test_riccati_is_that_of_scipy() -> None:
    A, B, C = benign(6, 2, 3)
    R = np.diag([0.5, 2.0])
    X = riccati(A, B @ np.linalg.solve(R, B.T), C.T @ C)
    assert np.allclose(X, linalg.solve_discrete_are(A, B, C.T @ C, R), rtol=ROUNDING, atol=ROUNDING)


@pytest.mark.parametrize("a", [0.0, 0.5, 1.0, 1.0 - 1e-10, 3.0])
def test_scalar_riccati_is_the_root_of_its_quadratic(a: float) -> None:
    g, q = 0.7, 1e-3
    X = riccati(np.array([[a]]), np.array([[g]]), np.array([[q]]))
    # g x^2 + (1 - a^2 - g q) x - q = 0
    half = 0.5 * (1.0 - a * a - g * q)
    assert X[0, 0] == pytest.approx((-half + np.sqrt(half * half + g * q)) / g, rel=ROUNDING)


def test_mode_that_no_torque_reaches_and_does_not_decay_is_refused() -> None:
    with pytest.raises(LinearisationRefusedError, match="no stabilising solution"):
        riccati(np.diag([1.1, 0.5]), np.diag([0.0, 1.0]), np.eye(2))


def test_mode_that_grows_unseen_is_refused() -> None:
    with pytest.raises(LinearisationRefusedError, match="not seen"):
        riccati(np.diag([1.1, 0.5]), np.eye(2), np.diag([0.0, 1.0]))


def test_poles_of_the_loop_are_those_of_regulator_and_estimator() -> None:
    p, (K, a, b), correction, observer = designed()
    F, G, H, J = observer.controller()
    loop = np.block([[p.A + p.B @ J @ p.C, p.B @ H], [G @ p.C, F]])
    whole = np.block([[p.A, np.zeros((5, 2))], [b @ p.E, a]])
    regulated = np.linalg.eigvals(whole - np.vstack([p.B, np.zeros((2, 2))]) @ K)
    estimated = np.linalg.eigvals(p.A - p.A @ correction @ p.C)
    assert same_set(np.linalg.eigvals(loop), np.concatenate([regulated, estimated]), 1e-6)


def test_controller_does_what_the_equations_of_filter_and_feedback_say() -> None:
    p, (K, a, b), correction, observer = designed()
    F, G, H, J = observer.controller()
    x, predicted, low = np.zeros(len(F)), np.zeros(5), np.zeros(2)
    for y in np.random.default_rng(5).standard_normal((40, 3)):
        filtered = predicted + correction @ (y - p.C @ predicted)
        u = -K @ np.concatenate([filtered, low])
        assert np.allclose(H @ x + J @ y, u, rtol=ROUNDING, atol=ROUNDING)
        predicted, low = p.A @ filtered + p.B @ u, a @ low + b @ p.E @ filtered
        x = F @ x + G @ y


def test_observer_fed_with_its_own_output_is_the_controller() -> None:
    *_, observer = designed()
    f = np.geomspace(0.01, 49.0, 50)
    zero = np.zeros((2, 2))
    by_reading = response(observer.F, observer.Gy, observer.H, observer.J, f, DT)
    by_torque = response(observer.F, observer.Gu, observer.H, zero, f, DT)
    closed = np.linalg.solve(np.eye(2) - by_torque, by_reading)
    assert np.allclose(response(*observer.controller(), f, DT), closed, rtol=1e-8, atol=1e-10)


def test_part_regulator_acts_on_the_first_states_only() -> None:
    p = plant()
    first = Plant(p.A[:3, :3], p.B[:3], p.C[:, :3], p.E[:, :3], p.W[:3, :3], p.R)
    gain, (correction, _) = regulator(first, COST, DT), estimator(p)
    K = gain[0]
    whole = (np.hstack([K[:, :3], np.zeros((2, 2)), K[:, 3:]]), gain[1], gain[2])
    for one, other in zip(lqg(p, gain, correction), lqg(p, whole, correction), strict=True):
        assert np.array_equal(one, other)


def test_estimator_tells_the_deviation_of_its_innovations() -> None:
    p = plant()
    correction, deviations = estimator(p)
    Y = linalg.solve_discrete_are(p.A.T, p.C.T, p.W, p.R)
    spread = p.C @ Y @ p.C.T + p.R
    assert np.allclose(deviations, np.sqrt(np.diag(spread)), rtol=ROUNDING)
    assert np.allclose(correction, Y @ p.C.T @ np.linalg.inv(spread), rtol=1e-8, atol=ROUNDING)


READINGS, EFFORTS = np.array([0.5, 1.0, 2.0]), np.array([0.1, 3.0])


def scaled(observer: Observer, f: np.ndarray) -> np.ndarray:
    """Response by readings and torques in the units of the reduction."""
    G = np.hstack([observer.Gy * READINGS, observer.Gu * EFFORTS])
    return response(observer.F, G, observer.H, 0.0, f, DT)


def hankel(observer: Observer) -> np.ndarray:
    G = np.hstack([observer.Gy * READINGS, observer.Gu * EFFORTS])
    P = linalg.solve_discrete_lyapunov(observer.F, G @ G.T)
    Q = linalg.solve_discrete_lyapunov(observer.F.T, observer.H.T @ observer.H)
    return np.sqrt(np.sort(np.linalg.eigvals(P @ Q).real.clip(0.0))[::-1])


def test_truncation_to_the_whole_order_changes_nothing() -> None:
    *_, observer = designed()
    f = np.geomspace(0.01, 49.0, 50)
    same = truncated(observer, len(observer.F), READINGS, EFFORTS)
    assert len(same.F) == len(observer.F)
    assert np.allclose(scaled(same, f), scaled(observer, f), rtol=1e-8, atol=1e-10)
    assert np.array_equal(same.J, observer.J)


@pytest.mark.parametrize("order", [1, 2, 4, 6])
def test_error_of_a_truncation_lies_below_twice_the_sum_of_what_is_cut(order: int) -> None:
    *_, observer = designed()
    f = np.linspace(0.0, 50.0, 400)
    error = scaled(truncated(observer, order, READINGS, EFFORTS), f) - scaled(observer, f)
    bound = 2.0 * hankel(observer)[order:].sum()
    worst = np.linalg.norm(error, 2, axis=(1, 2)).max()
    # and no reduction is better than the first singular value cut
    assert hankel(observer)[order] * 0.5 < worst <= bound


def test_root_of_the_gramian_squared_is_scipys_gramian() -> None:
    A, B, _ = benign(6, 2, 1)
    Z = gramian_root(A, B)
    assert np.allclose(Z @ Z.T, linalg.solve_discrete_lyapunov(A, B @ B.T), rtol=ROUNDING, atol=ROUNDING)


def test_unstable_system_has_no_gramian() -> None:
    with pytest.raises(LinearisationRefusedError, match="unstable"):
        gramian_root(np.array([[1.1]]), np.eye(1))
