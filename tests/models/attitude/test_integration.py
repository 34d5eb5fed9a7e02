"""Integrators of the quaternion kinematics."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attitude_fmu.models.attitude.integration import runge_kutta_4, turned
from attitude_fmu.models.attitude.rotations import quaternion_product

START = (1.0, 0.0, 0.0, 0.0)


def angle_between(p: tuple[float, ...], q: tuple[float, ...]) -> float:
    a, b, c, d = quaternion_product((p[0], -p[1], -p[2], -p[3]), q)  # type: ignore[arg-type]
    return 2.0 * math.atan2(math.sqrt(b * b + c * c + d * d), abs(a))


@pytest.mark.parametrize(
    "rotation", [(0.3, -0.2, 0.9), (1e-5, 0.0, 0.0), (0.0, 1e-9, 0.0), (0.0, 0.0, 0.0), (2.0, 2.0, 0.0)]
)
def test_a_rotation_vector_turns_exactly(rotation: tuple[float, float, float]) -> None:
    x, y, z, w = Rotation.from_rotvec(rotation).as_quat()
    assert turned(START, rotation) == pytest.approx((w, x, y, z), abs=1e-16)


def test_runge_kutta_has_fourth_order_at_constant_rate() -> None:
    rate = (1.0, -2.0, 1.5)
    exact = turned(START, rate)

    def error(steps: int) -> float:
        q = START
        for _ in range(steps):
            q = runge_kutta_4(q, rate, rate, 1.0 / steps)  # type: ignore[assignment]
        return angle_between(q, exact)

    assert math.log2(error(20) / error(40)) == pytest.approx(4.0, abs=0.1)


def coning_drift(step: Callable[..., tuple[float, ...]], lam: float) -> float:
    """Drift about the cone's axis over a^2 W t, with samples lam apart (W = 1)."""
    a, cones = math.radians(0.5), 50

    def rate(t: float) -> tuple[float, float, float]:
        return -math.sin(a) * math.sin(t), math.sin(a) * math.cos(t), -2.0 * math.sin(a / 2) ** 2

    def truth(t: float) -> tuple[float, float, float, float]:
        return math.cos(a / 2), math.sin(a / 2) * math.cos(t), math.sin(a / 2) * math.sin(t), 0.0

    steps = round(2 * math.pi * cones / lam)
    q = truth(0.0)
    for k in range(steps):
        q = step(q, rate(k * lam), rate((k + 1) * lam), lam)  # type: ignore[assignment]
    end = truth(steps * lam)
    error = quaternion_product(q, (end[0], -end[1], -end[2], -end[3]))
    return 2.0 * error[3] / (a * a * steps * lam)


def test_the_rate_model_sets_runge_kuttas_drift_under_coning() -> None:
    # theory: lam^2/12 for a rate linear between two samples; higher terms are of relative order lam^2
    for lam in (0.1, 0.2):
        assert coning_drift(runge_kutta_4, lam) == pytest.approx(-lam * lam / 12.0, rel=lam * lam)


def test_samples_as_increments_drift_by_half_of_that() -> None:
    def rectangle(
        q: tuple[float, ...], _before: tuple[float, ...], now: tuple[float, ...], h: float
    ) -> tuple[float, ...]:
        return turned(q, tuple(h * w for w in now))  # type: ignore[arg-type]

    for lam in (0.1, 0.2):
        assert coning_drift(rectangle, lam) == pytest.approx(-lam * lam / 24.0, rel=lam * lam)


def test_the_quaternion_stays_of_unit_length() -> None:
    q = START
    for _ in range(10_000):
        q = runge_kutta_4(q, (3.0, -1.0, 2.0), (3.1, -1.0, 2.0), 0.01)  # type: ignore[assignment]
    assert np.linalg.norm(q) == pytest.approx(1.0, abs=4e-16)
