"""Rotations against scipy's."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from attitude_fmu.models.attitude import rotations
from attitude_fmu.models.attitude.rotations import Euler

CHANCE = random.Random(5)
ATTITUDES = [
    Euler(CHANCE.uniform(-math.pi, math.pi), CHANCE.uniform(-1.57, 1.57), CHANCE.uniform(-math.pi, math.pi))
    for _ in range(200)
]


def peer(euler: Euler) -> Rotation:
    return Rotation.from_euler("ZXY", [-euler.yaw, euler.pitch, euler.roll])


@pytest.mark.parametrize("euler", ATTITUDES[:50])
def test_direction_cosines_and_quaternion_agree_with_scipy(euler: Euler) -> None:
    c_nb = np.array(rotations.matrix_from_euler(euler))
    assert abs(c_nb - peer(euler).as_matrix()).max() < 1e-15
    q = rotations.quaternion_from_euler(euler)
    assert abs(np.array(rotations.matrix_from_quaternion(q)) - c_nb).max() < 1e-15


@pytest.mark.parametrize("euler", ATTITUDES)
def test_angles_come_back_from_matrix_and_quaternion(euler: Euler) -> None:
    c_nb = rotations.matrix_from_euler(euler)
    # asin-free formulas: a few ulp over cos(pitch)
    bound = 1e-15 / math.cos(euler.pitch)
    assert rotations.euler_from_matrix(c_nb) == pytest.approx(tuple(euler), abs=bound + 1e-15)
    q = rotations.quaternion_from_matrix(c_nb)
    assert abs(abs(np.dot(q, rotations.quaternion_from_euler(euler))) - 1) < 1e-15


@pytest.mark.parametrize("half_turn_about", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, -1, 1)])
def test_quaternion_from_matrix_holds_where_its_scalar_part_vanishes(half_turn_about: tuple[int, int, int]) -> None:
    axis = np.array(half_turn_about) / np.linalg.norm(half_turn_about)
    c_nb = Rotation.from_rotvec(math.pi * axis).as_matrix()
    q = rotations.quaternion_from_matrix(tuple(map(tuple, c_nb.tolist())))
    assert abs(np.array(rotations.matrix_from_quaternion(q)) - c_nb).max() < 1e-14


@pytest.mark.parametrize("pitch", [math.pi / 2, -math.pi / 2])
def test_straight_up_and_down_keep_their_attitude_through_the_angles(pitch: float) -> None:
    c_nb = rotations.matrix_from_euler(Euler(0.7, pitch, 0.0))
    again = rotations.matrix_from_euler(rotations.euler_from_matrix(c_nb))
    assert abs(np.array(again) - np.array(c_nb)).max() < 1e-15


def test_levelling_inverts_the_specific_force_at_rest() -> None:
    for euler in ATTITUDES:
        up_b = np.array(rotations.matrix_from_euler(euler)).T @ [0, 0, rotations.STANDARD_GRAVITY]
        pitch, roll = rotations.tilt_from_specific_force(tuple(up_b.tolist()))
        assert (pitch, roll) == pytest.approx((euler.pitch, euler.roll), abs=2e-15 / math.cos(euler.pitch))


def test_earth_rate_points_north_at_the_equator_and_up_at_the_pole() -> None:
    assert rotations.earth_rate_n(0.0) == (0.0, rotations.EARTH_RATE, 0.0)
    assert rotations.earth_rate_n(math.pi / 2)[2] == pytest.approx(rotations.EARTH_RATE)
