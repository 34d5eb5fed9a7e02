"""Integrators of the quaternion kinematics."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from attitude_fmu.models.attitude.integration import (
    INTEGRATION,
    INTEGRATORS,
    coning_2,
    coning_3,
    coning_4,
    coning_compensated,
    coning_rotation,
    coning_with_previous,
    mean_rate,
    mean_rotation,
    quaternion_rate,
    rotation_vector,
    runge_kutta_4,
    taylor_4,
    turned,
)
from attitude_fmu.models.attitude.rotations import quaternion_product
from attitude_fmu.models.vectors import cross

Vector = tuple[float, float, float]
START = (1.0, 0.0, 0.0, 0.0)
EVERY_INTEGRATOR = pytest.mark.parametrize(
    "step", [INTEGRATORS[number] for number in sorted(INTEGRATORS)], ids=lambda step: step.__name__
)


def angle_between(p: Sequence[float], q: Sequence[float]) -> float:
    a, b, c, d = quaternion_product((p[0], -p[1], -p[2], -p[3]), tuple(q))  # type: ignore[arg-type]
    return 2.0 * math.atan2(math.sqrt(b * b + c * c + d * d), abs(a))


def order(step: Callable[..., Any], rate: Callable[[float], Vector], coarse: int) -> float:
    """log2 of the ratio of the errors after 1 s in `coarse` steps and in twice as many."""
    exact = solve_ivp(
        lambda t, q: quaternion_rate(q, rate(t)), (0.0, 1.0), START, method="DOP853", rtol=1e-13, atol=1e-15
    ).y[:, -1]

    def error(steps: int) -> float:
        q: Any = START
        for k in range(steps):
            q = step(q, rate(k / steps), rate((k + 1) / steps), 1.0 / steps)
        return angle_between(exact / np.linalg.norm(exact), q)

    return math.log2(error(coarse) / error(2 * coarse))


def constant(_t: float) -> Vector:
    return 1.0, -2.0, 1.5


def linear(t: float) -> Vector:
    return 1.0 + 3.0 * t, -2.0 + 5.0 * t, 1.5 - 2.0 * t


# --- every integrator ------------------------------------------------------------------------------------------------


def test_every_item_of_the_enumeration_has_an_integrator_of_its_name() -> None:
    assert {item.name: INTEGRATORS[INTEGRATION.value(item.name)].__name__ for item in INTEGRATION.items} == {
        item.name: item.name for item in INTEGRATION.items
    }


@pytest.mark.parametrize(
    "rotation", [(0.3, -0.2, 0.9), (1e-5, 0.0, 0.0), (0.0, 1e-9, 0.0), (0.0, 0.0, 0.0), (2.0, 2.0, 0.0)]
)
def test_a_rotation_vector_turns_exactly(rotation: Vector) -> None:
    x, y, z, w = Rotation.from_rotvec(rotation).as_quat()
    assert turned(START, rotation) == pytest.approx((w, x, y, z), abs=1e-16)


@EVERY_INTEGRATOR
def test_without_rate_the_attitude_stays(step: Callable[..., Any]) -> None:
    q = (0.5, 0.5, -0.5, 0.5)
    assert step(q, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.01) == q


@EVERY_INTEGRATOR
def test_the_quaternion_stays_of_unit_length(step: Callable[..., Any]) -> None:
    q: Any = START
    for _ in range(10_000):
        q = step(q, (3.0, -1.0, 2.0), (3.1, -1.0, 2.0), 0.01)
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=4e-16)


@EVERY_INTEGRATOR
def test_a_turn_of_the_navigation_axes_turns_the_solution_with_it(step: Callable[..., Any]) -> None:
    turn = (0.6, 0.0, 0.8, 0.0)
    before, now = (3.0, -1.0, 2.0), (2.0, 1.0, 2.5)
    turned_after = quaternion_product(turn, step(START, before, now, 0.1))
    assert step(turn, before, now, 0.1) == pytest.approx(turned_after, abs=3e-16)


@pytest.mark.parametrize("step", [rotation_vector, coning_compensated])
def test_closed_forms_are_exact_at_constant_rate_whatever_the_step(step: Callable[..., Any]) -> None:
    assert step(START, constant(0.0), constant(0.0), 1.0) == pytest.approx(turned(START, constant(0.0)), abs=3e-16)


@pytest.mark.parametrize("step", [rotation_vector, coning_compensated])
def test_closed_forms_are_exact_about_a_fixed_axis_while_the_rate_grows_linearly(step: Callable[..., Any]) -> None:
    exact = turned(START, (0.5 * (0.2 + 1.0) * 0.7, 0.0, 0.0))
    assert step(START, (0.2, 0.0, 0.0), (1.0, 0.0, 0.0), 0.7) == pytest.approx(exact, abs=3e-16)


def test_at_constant_rate_the_taylor_series_is_runge_kutta_term_for_term() -> None:
    w = constant(0.0)
    # the same polynomial, summed otherwise: a few roundings of numbers below 1
    assert taylor_4(START, w, w, 0.3) == pytest.approx(runge_kutta_4(START, w, w, 0.3), abs=5e-16)


@pytest.mark.parametrize("step", [runge_kutta_4, taylor_4])
@pytest.mark.parametrize("rate", [constant, linear])
def test_runge_kutta_and_taylor_have_fourth_order_where_the_rate_is_linear(
    step: Callable[..., Any], rate: Callable[[float], Vector]
) -> None:
    assert order(step, rate, 40) == pytest.approx(4.0, abs=0.1)


@pytest.mark.parametrize("rate", [constant, linear])
def test_the_mean_rate_of_each_interval_turns_by_its_increment(rate: Callable[[float], Vector]) -> None:
    q: Any = START
    means = [rate(0.1 * (k + 0.5)) for k in range(5)]  # of a rate that is linear in time
    expected: Any = START
    for mean in means:
        q = mean_rate(q, rate(0.0), mean, 0.1)
        expected = turned(expected, (0.1 * mean[0], 0.1 * mean[1], 0.1 * mean[2]))
    assert q == expected


@pytest.mark.parametrize("step", [rotation_vector, coning_compensated])
def test_closed_forms_have_second_order_where_the_axis_moves(step: Callable[..., Any]) -> None:
    assert order(step, linear, 40) == pytest.approx(2.0, abs=0.1)


@pytest.mark.parametrize("step", [runge_kutta_4, taylor_4, rotation_vector, coning_compensated])
def test_a_rate_that_bends_between_samples_leaves_second_order_to_all(step: Callable[..., Any]) -> None:
    def bending(t: float) -> Vector:
        return math.sin(3.0 * t), math.cos(4.0 * t), 0.5 + math.sin(2.0 * t)

    assert order(step, bending, 40) == pytest.approx(2.0, abs=0.1)


# --- coning ----------------------------------------------------------------------------------------------------------
#
# The body axis z describes a cone of half angle a at the rate W = 1; lam is the phase between samples. Truth and
# increments in closed form. All drifts are over a^2 W.


def cone(a: float, t: float) -> tuple[float, float, float, float]:
    return math.cos(a / 2), math.sin(a / 2) * math.cos(t), math.sin(a / 2) * math.sin(t), 0.0


def cone_rate(a: float, t: float) -> Vector:
    return -math.sin(a) * math.sin(t), math.sin(a) * math.cos(t), -2.0 * math.sin(a / 2) ** 2


def cone_increment(a: float, t: float, h: float) -> Vector:
    return (
        math.sin(a) * (math.cos(t + h) - math.cos(t)),
        math.sin(a) * (math.sin(t + h) - math.sin(t)),
        -2.0 * h * math.sin(a / 2) ** 2,
    )


def drift(q: Sequence[float], a: float, time: float) -> float:
    """Turn about the cone's axis away from the truth at `time`, over a^2 W time."""
    end = cone(a, time)
    error = quaternion_product(tuple(q), (end[0], -end[1], -end[2], -end[3]))  # type: ignore[arg-type]
    return 2.0 * error[3] / (a * a * time)


def drift_by_rates(step: Callable[..., Any], lam: float, a: float = math.radians(0.05), cones: int = 50) -> float:
    steps = round(2 * math.pi * cones / lam)
    q: Any = cone(a, 0.0)
    for k in range(steps):
        q = step(q, cone_rate(a, k * lam), cone_rate(a, (k + 1) * lam), lam)
    return drift(q, a, steps * lam)


class Increments(NamedTuple):
    """An algorithm on n increments (and the one before them): its drift is lam^order / divisor."""

    samples: int
    rotation: Callable[[Vector, list[Vector]], Any]
    order: int
    divisor: float


ALGORITHMS = {
    "one": Increments(1, lambda _before, d: d[0], 2, 12.0),
    "one and the previous": Increments(1, lambda before, d: coning_with_previous(before, d[0]), 4, 60.0),
    "two": Increments(2, lambda _before, d: coning_2(*d), 4, 60.0),
    "three": Increments(3, lambda _before, d: coning_3(*d), 6, 280.0),
    "four": Increments(4, lambda _before, d: coning_4(*d), 8, 1260.0),
}
EVERY_ALGORITHM = pytest.mark.parametrize("algorithm", ALGORITHMS.values(), ids=ALGORITHMS)


def drift_by_increments(algorithm: Increments, lam: float, a: float, cones: int = 50) -> float:
    n = algorithm.samples
    updates = round(2 * math.pi * cones / (n * lam))
    q: Any = cone(a, 0.0)
    for k in range(updates):
        t = n * k * lam
        taken = [cone_increment(a, t + i * lam, lam) for i in range(n)]
        q = turned(q, algorithm.rotation(cone_increment(a, t - lam, lam), taken))
    return drift(q, a, updates * n * lam)


def drift_of_a_narrow_cone(rotation: Vector, a: float, phase: float) -> float:
    """(phi_z + |phi_xy|^2/4 cot(phase/2)) / (a^2 phase): the drift of one update repeated for ever, a to 0.

    Every update is the first one turned by `phase` about z; the second term is the turn of their endless polygon.
    It needs no long run, so that no rounding hides lam^8/1260 at small lam.
    """
    x, y, z = rotation
    return (z + (x * x + y * y) / (4.0 * math.tan(phase / 2.0))) / (a * a * phase)


def narrow(algorithm: Increments, lam: float) -> float:
    a = 1e-9  # a^2 below all roundings, so that nothing but the order a^2 is left
    taken = [cone_increment(a, i * lam, lam) for i in range(algorithm.samples)]
    rotation = algorithm.rotation(cone_increment(a, -lam, lam), taken)
    return drift_of_a_narrow_cone(rotation, a, algorithm.samples * lam)


@EVERY_ALGORITHM
@pytest.mark.parametrize("lam", [0.1, 0.2])
def test_increments_drift_by_their_theory_in_narrow_cones(algorithm: Increments, lam: float) -> None:
    # the next term of each series is of relative order lam^2, at most 1 + 0.3 lam^2 here
    assert narrow(algorithm, lam) == pytest.approx(-(lam**algorithm.order) / algorithm.divisor, rel=0.3 * lam * lam)


@EVERY_ALGORITHM
@pytest.mark.parametrize("lam", [0.1, 0.2])
def test_halving_the_interval_shows_the_order_of_the_increments(algorithm: Increments, lam: float) -> None:
    assert math.log2(narrow(algorithm, 2 * lam) / narrow(algorithm, lam)) == pytest.approx(algorithm.order, abs=0.1)


@EVERY_ALGORITHM
@pytest.mark.parametrize("lam", [0.2, 0.4, 0.8])
def test_fifty_cones_drift_as_the_narrow_cone_does(algorithm: Increments, lam: float) -> None:
    # a = 0.02 deg: finite a adds 0.05 a^2 lam^4 or so (1e-11 at 0.2: 0.5 % of the four increments' drift), rounding
    # 3e-15 rad in 5e-5 rad of cone: 2 %
    assert drift_by_increments(algorithm, lam, math.radians(0.02)) == pytest.approx(narrow(algorithm, lam), rel=0.03)


@pytest.mark.parametrize(
    ("name", "lam"), [(name, lam) for name in ALGORITHMS for lam in (0.1, 0.2) if (name, lam) != ("four", 0.1)]
)
def test_halving_the_interval_shows_the_order_over_fifty_cones(name: str, lam: float) -> None:
    # four increments at 0.1 drift by 3e-15 rad in all, below the rounding of the run
    algorithm = ALGORITHMS[name]
    coarse, fine = (drift_by_increments(algorithm, x, math.radians(0.02)) for x in (2 * lam, lam))
    assert math.log2(coarse / fine) == pytest.approx(algorithm.order, abs=0.1)


def test_one_increment_drifts_by_its_closed_form_at_any_interval() -> None:
    for lam in (0.1, 0.4, 0.8, 2.0):
        assert narrow(ALGORITHMS["one"], lam) == pytest.approx(-0.5 * (1.0 - math.sin(lam) / lam), rel=1e-9)


@pytest.mark.parametrize(("step", "share"), [(runge_kutta_4, 1 / 12), (taylor_4, 1 / 12), (rotation_vector, 1 / 6)])
def test_the_rate_model_sets_the_drift_by_rates_not_the_solver(step: Callable[..., Any], share: float) -> None:
    # higher terms are of relative order lam^2
    for lam in (0.1, 0.2):
        assert drift_by_rates(step, lam) == pytest.approx(-share * lam * lam, rel=lam * lam)


def test_compensated_rates_drift_with_the_fourth_power() -> None:
    drifts = [drift_by_rates(coning_compensated, lam) for lam in (0.1, 0.2, 0.4)]
    # by the narrow cone's formula: lam^2 sin(lam)/24 - lam^3/24 - lam^5/1440 = -11/1440 lam^5 a step, and lam^7 terms
    assert drifts[0] == pytest.approx(-(0.1**4) * 11.0 / 1440.0, rel=0.01)
    for fine, coarse in pairwise(drifts):
        assert math.log2(coarse / fine) == pytest.approx(4.0, abs=0.1)


def test_the_rotation_vectors_of_rates_are_what_the_integrators_turn_by() -> None:
    before, now = (3.0, -1.0, 2.0), (2.0, 1.0, 2.5)
    assert rotation_vector(START, before, now, 0.1) == turned(START, mean_rotation(before, now, 0.1))
    assert coning_compensated(START, before, now, 0.1) == turned(START, coning_rotation(before, now, 0.1))
    assert np.subtract(coning_rotation(before, now, 0.1), mean_rotation(before, now, 0.1)) == pytest.approx(
        np.array(cross(before, now)) * 0.01 / 6.0
    )


@EVERY_ALGORITHM
def test_equal_increments_add_up_without_coning(algorithm: Increments) -> None:
    d = (0.1, -0.02, 0.05)
    assert algorithm.rotation(d, [d] * algorithm.samples) == pytest.approx(
        tuple(algorithm.samples * x for x in d), abs=1e-16
    )


def test_samples_taken_as_increments_drift_by_half_of_runge_kutta() -> None:
    def rectangle(q: Any, _before: Vector, now: Vector, h: float) -> Any:
        return turned(q, (h * now[0], h * now[1], h * now[2]))

    for lam in (0.1, 0.2):
        assert drift_by_rates(rectangle, lam) == pytest.approx(-lam * lam / 24.0, rel=lam * lam)
