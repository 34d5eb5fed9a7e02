"""The chain of turns against scipy, and its rates against differences."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from attitude_fmu.models.plants.turntable_axes import (
    AT_REST,
    AxisErrors,
    Harmonic,
    Motion,
    NonOrthogonality,
    PositionError,
    Turn,
    Wobble,
    axis_errors,
    plate_motion,
    spun,
    turned,
)
from attitude_fmu.models.plants.turntable_servo import AxisMotion

LARGE = axis_errors(
    PositionError(0.02, Harmonic(0.03, 0.4), Harmonic(0.02, -1.0)), Wobble(Harmonic(0.05, 0.7), Harmonic(0.03, 2.0))
)
"""Errors so large that a slip in any derivative shows."""

NONE = axis_errors(PositionError(0.0, Harmonic(), Harmonic()), Wobble(Harmonic(), Harmonic()))
UNITS = np.eye(3)


def rotation(motion: Motion) -> Rotation:
    w, x, y, z = motion.attitude
    return Rotation.from_quat([x, y, z, w])


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_turn_is_scipys(axis: int) -> None:
    start = Motion((0.8, 0.0, 0.6, 0.0), (0.1, 0.2, 0.3), (0.4, 0.5, 0.6))
    found = turned(start, axis, Turn(0.7))
    step = Rotation.from_rotvec(0.7 * UNITS[axis])
    np.testing.assert_allclose(rotation(found).as_matrix(), (rotation(start) * step).as_matrix(), atol=1e-15)
    np.testing.assert_allclose(found.rate, step.inv().apply(start.rate), atol=1e-15)
    np.testing.assert_allclose(found.acceleration, step.inv().apply(start.acceleration), atol=1e-15)


def at(time: float, errors: AxisErrors) -> Motion:
    """A plate whose base and axes all move, at a time (s)."""
    waves = [(0.9, 1.3, 0.2), (0.7, 2.1, 1.0), (1.1, 1.7, -0.4)]
    axes = [
        AxisMotion(a * math.sin(w * time + p), a * w * math.cos(w * time + p), -a * w * w * math.sin(w * time + p))
        for a, w, p in waves
    ]
    base = turned(AT_REST, 0, Turn(0.3 * time * time, 0.6 * time, 0.6))
    return plate_motion(base, (axes[0], axes[1], axes[2]), (errors, errors, errors), NonOrthogonality(0.1, -0.2))


@pytest.mark.parametrize("errors", [NONE, LARGE])
def test_rate_and_acceleration_are_the_derivatives_of_the_attitude(errors: AxisErrors) -> None:
    """Central differences of 1 ms: truncated at 1e-6, rounded at 1e-12."""
    h = 1e-3
    before, now, after = (at(0.8 + k * h, errors) for k in (-1, 0, 1))
    turn = (rotation(before).inv() * rotation(after)).as_rotvec()
    np.testing.assert_allclose(now.rate, turn / (2.0 * h), atol=2e-5)
    np.testing.assert_allclose(now.acceleration, (np.array(after.rate) - before.rate) / (2.0 * h), atol=1e-4)
    assert np.abs(now.acceleration).min() > 0.1


def test_differences_close_in_on_the_derivatives_at_second_order() -> None:
    def misses(h: float) -> NDArray[np.float64]:
        before, now, after = (at(0.8 + k * h, LARGE) for k in (-1, 0, 1))
        turn = (rotation(before).inv() * rotation(after)).as_rotvec() / (2.0 * h)
        rate = (np.array(after.rate) - before.rate) / (2.0 * h)
        return np.array([np.linalg.norm(turn - now.rate), np.linalg.norm(rate - now.acceleration)])

    orders = np.log2(misses(8e-3) / misses(4e-3))
    np.testing.assert_allclose(orders, 2.0, atol=0.02)


def test_a_perfect_table_turns_by_its_angles() -> None:
    axes = tuple(AxisMotion(angle, 0.0, 0.0) for angle in (0.4, -0.3, 1.2))
    found = plate_motion(AT_REST, axes, (NONE, NONE, NONE), NonOrthogonality(0.0, 0.0))  # type: ignore[arg-type]
    expected = Rotation.from_euler("ZXY", [-0.4, -0.3, 1.2])
    np.testing.assert_allclose(rotation(found).as_matrix(), expected.as_matrix(), atol=1e-15)


@pytest.mark.parametrize("direction", [0, 1, 2])
def test_an_axis_wobbles_once_and_twice_a_turn(direction: int) -> None:
    """The axis line itself, seen from outside: a circle of each amplitude, to the square of the angles."""
    small = axis_errors(PositionError(0.0, Harmonic(), Harmonic()), Wobble(Harmonic(3e-5, 0.3), Harmonic(1e-5, 1.0)))
    angles = 2.0 * math.pi * np.arange(64) / 64
    lines = [
        rotation(spun(AT_REST, direction, AxisMotion(angle, 0.0, 0.0), small)).apply(UNITS[direction])
        for angle in angles
    ]
    across = np.array([(line[(direction + 1) % 3], line[(direction + 2) % 3]) for line in lines])
    spectrum = np.fft.fft(across[:, 0] + 1.0j * across[:, 1]) / 64
    sizes = np.abs(spectrum)
    assert sizes[1] == pytest.approx(3e-5, abs=1e-9)
    assert sizes[2] == pytest.approx(1e-5, abs=1e-9)
    assert np.delete(sizes, [1, 2]).max() < 1e-9


def test_position_errors_add_to_what_the_encoder_tells() -> None:
    off = axis_errors(PositionError(1e-3, Harmonic(2e-3, 0.5), Harmonic(5e-4, -0.2)), Wobble(Harmonic(), Harmonic()))
    for told in (0.0, 1.0, -2.5, 7.0):
        turn = rotation(spun(AT_REST, 1, AxisMotion(told, 0.0, 0.0), off)) * Rotation.from_rotvec([0.0, -told, 0.0])
        wanted = 1e-3 + 2e-3 * math.sin(told + 0.5) + 5e-4 * math.sin(2.0 * told - 0.2)
        np.testing.assert_allclose(turn.as_rotvec(), (0.0, wanted, 0.0), atol=1e-15)


def test_non_orthogonal_axes_miss_a_right_angle() -> None:
    """Direction of each axis at zero angles, from tiny turns of it."""
    lean = NonOrthogonality(0.01, -0.02)

    def plate(*angles: float) -> Rotation:
        axes = tuple(AxisMotion(angle, 0.0, 0.0) for angle in angles)
        return rotation(plate_motion(AT_REST, axes, (NONE, NONE, NONE), lean))  # type: ignore[arg-type]

    lines = []
    for i in range(3):
        angles = [1e-4 if j == i else 0.0 for j in range(3)]
        line = (plate(*angles) * plate(0.0, 0.0, 0.0).inv()).as_rotvec()
        lines.append(line / np.linalg.norm(line))
    cosines = [float(np.dot(a, b)) for a, b in pairwise(lines)]
    # the outer axis points down, the middle one's right end is down by 0.01, the inner one's front is right by 0.02
    assert cosines == pytest.approx([math.sin(0.01), math.sin(0.02)], abs=1e-7)
