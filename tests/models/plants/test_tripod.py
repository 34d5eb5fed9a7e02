"""The elastic mounts: their attitude, rates and torque."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from attitude_fmu.models.attitude.rotations import matrix_from_quaternion
from attitude_fmu.models.plants.gimbal import Axes, Body, about_o
from attitude_fmu.models.plants.tripod import (
    Head,
    Mount,
    Tripod,
    attitude,
    attitude_quaternion,
    carried_inertia,
    elastic_energy,
    mount,
    mount_motion,
)
from attitude_fmu.models.record import Vector3

MOUNT = Mount(Axes(300.0, 500.0, 700.0), Axes(0.1, 0.2, 0.3), (0.03, 0.04, 0.05), 0.2)
ANGLES = [Axes(0.0, 0.0, 0.0), Axes(1e-4, -2e-4, 3e-4), Axes(0.4, -0.7, 1.1)]


def vector(deflection: Axes) -> NDArray[np.float64]:
    """About x, y and z."""
    return np.array([deflection.pitch, deflection.roll, -deflection.yaw])


def elastic(rotation: Rotation) -> NDArray[np.float64]:
    """2 tan(angle/2) axis."""
    turn = rotation.as_rotvec()
    angle = float(np.linalg.norm(turn))
    found: NDArray[np.float64] = turn * (2.0 * math.tan(0.5 * angle) / angle)
    return found


@pytest.mark.parametrize("deflection", ANGLES)
def test_attitude_is_the_turn_by_gibbs_vector(deflection: Axes) -> None:
    e = vector(deflection)
    size = float(np.linalg.norm(e))
    expected = Rotation.from_rotvec(e * (2.0 * math.atan(0.5 * size) / max(size, 1e-30))).as_matrix()
    np.testing.assert_allclose(attitude(deflection), expected, atol=1e-15)
    np.testing.assert_allclose(matrix_from_quaternion(attitude_quaternion(deflection)), expected, atol=1e-15)


def test_small_angles_are_yaw_pitch_and_roll() -> None:
    small = Axes(1e-4, -2e-4, 3e-4)
    expected = Rotation.from_euler("ZXY", [-1e-4, -2e-4, 3e-4]).as_matrix()
    np.testing.assert_allclose(attitude(small), expected, atol=1e-7)


@pytest.mark.parametrize("deflection", ANGLES[1:])
def test_rates_are_the_derivatives_of_the_angles(deflection: Axes) -> None:
    w, d = np.array([0.3, -0.5, 0.2]), 1e-5
    start = Rotation.from_matrix(attitude(deflection))
    numeric = (elastic(start * Rotation.from_rotvec(w * d)) - elastic(start * Rotation.from_rotvec(-w * d))) / (2.0 * d)
    rates, _ = mount_motion(MOUNT, deflection, (0.3, -0.5, 0.2))
    np.testing.assert_allclose(vector(rates), numeric, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("deflection", ANGLES)
def test_torque_takes_what_springs_store_and_dampers_burn(deflection: Axes) -> None:
    """w'tau = -dV/dt - sum c e'^2."""
    w: Vector3 = (0.3, -0.5, 0.2)
    rates, torque = mount_motion(MOUNT, deflection, w)
    d = 1e-7
    after, before = (
        elastic_energy(MOUNT, Axes(*[e + sign * d * rate for e, rate in zip(deflection, rates, strict=True)]))
        for sign in (1.0, -1.0)
    )
    burnt = sum(c * rate * rate for c, rate in zip(MOUNT.damping, rates, strict=True))
    assert np.dot(w, torque) == pytest.approx(-(after - before) / (2.0 * d) - burnt, abs=1e-6)


@pytest.mark.parametrize("part", [Tripod(), Head()])
def test_damping_ratio_is_that_of_the_loaded_mode(part: Tripod | Head) -> None:
    load = carried_inertia((about_o(Body(1.5, (0.0, 0.0, 0.0), (4e-3, 2e-3, 6e-3))),), 0.2)
    assert load == pytest.approx(Axes(6e-3, 4e-3 + 0.06, 2e-3 + 0.06))
    for c, k, zeta, own, carried in zip(
        mount(part, load).damping, part.stiffness, part.damping_ratio, part.inertia, load, strict=True
    ):
        assert c / (2.0 * math.sqrt(k * (own + carried))) == pytest.approx(zeta)
