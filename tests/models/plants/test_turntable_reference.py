"""The reference of an axis takes the shortest time that its limits allow, and ends where it is sent."""

from __future__ import annotations

import math

import numpy as np
import pytest

from attitude_fmu.models.plants.turntable_reference import Reference, toward_angle, toward_rate

H = 1e-3
FASTEST, ACCELERATION = 0.2, 0.5


def path(start: Reference, target: float, fastest: float = FASTEST) -> list[Reference]:
    """From tick to tick until rest at the target."""
    found = [start]
    while found[-1] != (target, 0.0):
        found.append(toward_angle(found[-1], target, fastest, ACCELERATION, H))
        assert len(found) < 100_000
    return found


def shortest_time(distance: float) -> float:
    """d/v + v/a of a trapezoid, 2 sqrt(d/a) of a triangle that does not reach v."""
    if distance > FASTEST**2 / ACCELERATION:
        return distance / FASTEST + FASTEST / ACCELERATION
    return 2.0 * math.sqrt(distance / ACCELERATION)


@pytest.mark.parametrize("distance", [1.0, 0.0801, 0.08, 0.0799, 0.01, 1e-4, 1e-7])
@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_move_takes_the_time_of_its_trapezoid_or_triangle(distance: float, way: float) -> None:
    """To the next tick."""
    ticks = len(path(Reference(0.3, 0.0), 0.3 + way * distance)) - 1
    assert 0.0 <= ticks * H - shortest_time(distance) < H * (1.0 + 1e-6)


@pytest.mark.parametrize(
    "start", [Reference(0.0, 0.0), Reference(0.1, 0.15), Reference(-0.2, -0.2), Reference(1.0, 0.0)]
)
def test_limits_are_kept_and_the_target_is_not_overshot(start: Reference) -> None:
    """Roundings of 1e-15 aside."""
    target = 0.5
    found = path(start, target)
    angles, rates = np.array(found).T
    assert np.abs(rates).max() <= FASTEST + 1e-15
    assert np.abs(np.diff(rates)).max() <= ACCELERATION * H + 1e-15
    side = np.sign(target - start.angle)
    assert (side * (target - angles)).min() >= -1e-15


def test_ticks_lie_on_the_closed_form() -> None:
    found = path(Reference(0.0, 0.0), 1.0)
    t = H * np.arange(len(found))
    total, ramp = shortest_time(1.0), FASTEST / ACCELERATION
    up = 0.5 * ACCELERATION * np.minimum(t, ramp) ** 2
    down = 0.5 * ACCELERATION * np.maximum(t - (total - ramp), 0.0) ** 2
    expected = up + FASTEST * np.maximum(t - ramp, 0.0) - down
    np.testing.assert_allclose([one.angle for one in found[:-1]], expected[:-1], atol=1e-13)


def test_a_start_at_speed_beyond_the_limit_brakes_first() -> None:
    found = path(Reference(0.0, FASTEST), 0.5, 0.5 * FASTEST)
    rates = np.array([one.rate for one in found])
    braking = round(0.5 * FASTEST / ACCELERATION / H)
    np.testing.assert_allclose(np.diff(rates[: braking + 1]), -ACCELERATION * H, rtol=1e-9)
    assert rates[braking + 1] == pytest.approx(0.5 * FASTEST)


def test_a_target_that_is_too_near_to_stop_at_is_passed_and_come_back_to() -> None:
    """Brake, v/a; back by d = v^2/2a - target, 2 sqrt(d/a)."""
    found = path(Reference(0.0, FASTEST), 0.01)
    passed = 0.5 * FASTEST**2 / ACCELERATION - 0.01
    expected = FASTEST / ACCELERATION + 2.0 * math.sqrt(passed / ACCELERATION)
    assert max(one.angle for one in found) == pytest.approx(0.01 + passed, abs=1e-6)
    assert 0.0 <= (len(found) - 1) * H - expected < H * (1.0 + 1e-6)


def test_a_target_may_change_at_any_time() -> None:
    now = Reference(0.0, 0.0)
    for tick in range(3000):
        before = now
        now = toward_angle(now, math.sin(tick // 300), FASTEST, ACCELERATION, H)
        assert abs(now.rate - before.rate) <= ACCELERATION * H + 1e-15
        assert now.angle - before.angle == pytest.approx(0.5 * H * (now.rate + before.rate), abs=ACCELERATION * H * H)


def test_a_rate_is_reached_after_its_ramp_and_kept() -> None:
    now = Reference(0.0, -0.1)
    for _ in range(1000):
        now = toward_rate(now, 0.15, ACCELERATION, H)
    ramp = 0.25 / ACCELERATION
    assert now.rate == 0.15
    assert now.angle == pytest.approx(0.5 * (-0.1 + 0.15) * ramp + 0.15 * (1.0 - ramp), abs=1e-13)
