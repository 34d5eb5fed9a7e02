"""LuGre friction: stick, slide, and stability at any rate."""

from __future__ import annotations

import math

import pytest

from attitude_fmu.models.plants.friction import Friction, bristle_after, friction_torque, lugre

FRICTION = Friction(coulomb=3e-3, static_ratio=1.4, stribeck_rate=0.02, presliding=2e-4, viscous=2e-4)
LUGRE = lugre(FRICTION, 3e-3)


def test_constants_follow_from_the_physical_ones() -> None:
    assert LUGRE.stiffness == pytest.approx(15.0)
    assert LUGRE.damping == pytest.approx(2.0 * 0.5 * math.sqrt(15.0 * 3e-3))


def test_a_small_turn_is_a_spring() -> None:
    bristle = bristle_after(LUGRE, 0.0, 1e-4, 0.01)
    assert bristle == pytest.approx(1e-6, rel=0.01)
    assert friction_torque(LUGRE, bristle, 0.0) == pytest.approx(15.0 * 1e-6, rel=0.01)


@pytest.mark.parametrize("rate", [-5.0, -0.1, 1e-3, 0.02, 1.0, 50.0])
def test_steady_sliding_has_the_stribeck_level(rate: float) -> None:
    bristle = bristle_after(LUGRE, 1e-4, rate, 10.0)
    level = 3e-3 + 1.2e-3 * math.exp(-((rate / 0.02) ** 2))
    expected = math.copysign(level, rate) + 2e-4 * rate
    assert friction_torque(LUGRE, bristle, rate) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("rate", [1e-9, 1e-3, 0.3, 5.0, 1000.0])
def test_the_bristle_is_exact_for_any_step(rate: float) -> None:
    """Two halves make a whole, and no step overshoots the sliding deflection."""
    whole = bristle_after(LUGRE, 1e-5, rate, 1e-3)
    halves = bristle_after(LUGRE, bristle_after(LUGRE, 1e-5, rate, 5e-4), rate, 5e-4)
    assert whole == pytest.approx(halves, rel=1e-6)
    assert 0.0 <= whole <= FRICTION.static_ratio * FRICTION.presliding


def test_no_friction_is_no_torque() -> None:
    none = lugre(Friction(coulomb=0.0, viscous=0.0), 3e-3)
    bristle = bristle_after(none, 0.0, 2.0, 1e-3)
    assert friction_torque(none, bristle, 2.0) == 0.0
