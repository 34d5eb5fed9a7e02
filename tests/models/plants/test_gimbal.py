"""The gimbal's mechanics against the closed two-axis form and against themselves."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from attitude_fmu.models.attitude.rotations import matrix_from_turns, turns_of
from attitude_fmu.models.plants.gimbal import (
    Axes,
    Bodies,
    Body,
    HeadMotion,
    JointMotion,
    Wrench,
    about_o,
    camera_rates,
    first_moment,
    inverse_dynamics,
    mass_matrix,
    to_camera,
)
from attitude_fmu.models.plants.linear_equations import solve_symmetric
from attitude_fmu.models.record import Vector3
from attitude_fmu.models.vectors import ZERO3

NOTHING = Wrench(ZERO3, ZERO3)
STILL = Axes(0.0, 0.0, 0.0)


def vector(rng: np.random.Generator, size: float = 1.0) -> Vector3:
    x, y, z = (size * rng.uniform(-1.0, 1.0, 3)).tolist()
    return x, y, z


def body(rng: np.random.Generator, mass: float, offset: float) -> Body:
    inertia = (1e-3 * rng.uniform(2.0, 3.0, 3)).tolist()
    return Body(mass, vector(rng, offset), (inertia[0], inertia[1], inertia[2]), vector(rng, 3e-4))


def bodies_of(rng: np.random.Generator) -> Bodies:
    return about_o(body(rng, 0.4, 0.05)), about_o(body(rng, 0.3, 0.02)), about_o(body(rng, 1.2, 0.03))


def tensor(inertia: Vector3, products: Vector3) -> NDArray[np.float64]:
    (xx, yy, zz), (xy, xz, yz) = inertia, products
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.mark.parametrize("seed", range(20))
def test_two_axes_agree_with_the_closed_form(seed: int) -> None:
    """Ekstrand 2001, IEEE TAES 37(3): axes forward, right, down; balanced bodies, roll locked."""
    rng = np.random.default_rng(seed)
    outer, inner = body(rng, 0.5, 0.0), body(rng, 1.0, 0.0)
    weightless = Body(0.0, ZERO3, (0.0, 0.0, 0.0))
    p, q, r, dp, dq, dr = rng.uniform(-3.0, 3.0, 6)
    psi, theta, dpsi, dtheta, ddpsi, ddtheta = rng.uniform(-1.4, 1.4, 6)

    # forward, right, down = our y, x, -z
    def swapped(b: Body) -> list[float]:
        (xx, yy, zz), (xy, xz, yz) = b.inertia, b.products
        return [yy, xx, zz, xy, -yz, -xz]

    K_x, K_y, K_z, K_xy, K_xz, K_yz = swapped(outer)
    A_x, A_y, A_z, A_xy, A_xz, A_yz = swapped(inner)
    c, s, c2, s2 = np.cos(theta), np.sin(theta), np.cos(2 * theta), np.sin(2 * theta)
    p_K, q_K, r_K = p * np.cos(psi) + q * np.sin(psi), -p * np.sin(psi) + q * np.cos(psi), r + dpsi
    dp_K = dp * np.cos(psi) + dq * np.sin(psi) + dpsi * q_K
    dq_K = -dp * np.sin(psi) + dq * np.cos(psi) - dpsi * p_K
    dr_K = dr + ddpsi
    p_A, q_A, r_A = p_K * c - r_K * s, q_K + dtheta, p_K * s + r_K * c
    dp_A, dq_A = dp_K * c - dr_K * s - dtheta * r_A, dq_K + ddtheta
    dr_A = dp_K * s + dr_K * c + dtheta * p_A
    pitch = (
        A_y * dq_A
        - (A_z - A_x) * p_A * r_A
        - A_xz * (p_A**2 - r_A**2)
        + A_yz * (dr_A - p_A * q_A)
        + A_xy * (dp_A + q_A * r_A)
    )
    D1 = (K_x + A_x * c**2 + A_z * s**2 + A_xz * s2 - (K_y + A_y)) * p_K * q_K
    D2 = (
        -(K_xz + (A_z - A_x) * s * c + A_xz * c2) * (dp_K - q_K * r_K)
        - (K_yz + A_yz * c - A_xy * s) * (dq_K + p_K * r_K)
        - (K_xy + A_xy * c + A_yz * s) * (p_K**2 - q_K**2)
    )
    D3 = ddtheta * (A_xy * s - A_yz * c) + dtheta * (
        (A_x - A_z) * (p_K * c2 - r_K * s2)
        + 2 * A_xz * (p_K * s2 + r_K * c2)
        + (A_yz * s + A_xy * c) * (q_A + q_K)
        - A_y * p_K
    )
    yaw = (K_z + A_x * s**2 + A_z * c**2 - A_xz * s2) * dr_K - D1 - D2 - D3

    torques, _ = inverse_dynamics(
        (about_o(outer), about_o(weightless), about_o(inner)),
        turns_of(Axes(psi, theta, 0.0)),
        HeadMotion((q, p, -r), (dq, dp, -dr), ZERO3),
        JointMotion(Axes(dpsi, dtheta, 0.0), Axes(ddpsi, ddtheta, 0.0)),
        NOTHING,
    )
    scale = 1e-3 * 9.0
    assert torques.pitch == pytest.approx(pitch, abs=1e-12 * scale, rel=1e-12)
    assert torques.yaw == pytest.approx(yaw, abs=1e-12 * scale, rel=1e-12)


def full(triangle: tuple[float, ...]) -> NDArray[np.float64]:
    m = np.zeros((6, 6))
    m[np.tril_indices(6)] = triangle
    return m + np.tril(m, -1).T


@pytest.mark.parametrize("seed", range(10))
def test_mass_matrix_holds_the_recursions_columns_and_is_positive_definite(seed: int) -> None:
    rng = np.random.default_rng(seed)
    bodies, turns, h, head = bodies_of(rng), turns_of(Axes(*vector(rng, 3.0))), 0.3, (0.03, 0.04, 0.05)
    triangle, forces = mass_matrix(bodies, turns, h, head)
    m = full(triangle)
    for column in range(6):
        unit = [1.0 if i == column else 0.0 for i in range(6)]
        alpha, joints = (unit[0], unit[1], unit[2]), Axes(*unit[3:])
        felt = (alpha[1] * h, -alpha[0] * h, 0.0)
        torques, (force, moment) = inverse_dynamics(
            bodies, turns, HeadMotion(ZERO3, alpha, felt), JointMotion(STILL, joints), NOTHING
        )
        wanted = [moment[0] - h * force[1], moment[1] + h * force[0], moment[2], *torques]
        for i in range(3):
            wanted[i] += head[i] * alpha[i]
        np.testing.assert_allclose(m[:, column], wanted, rtol=0.0, atol=1e-15)
        np.testing.assert_allclose(forces[column], force, rtol=0.0, atol=1e-15)
    assert np.linalg.eigvalsh(m)[0] > 0.0


@pytest.mark.parametrize("seed", range(10))
def test_equations_are_solved(seed: int) -> None:
    rng = np.random.default_rng(seed)
    triangle, _ = mass_matrix(bodies_of(rng), turns_of(Axes(*vector(rng, 3.0))), 0.3, (0.03, 0.04, 0.05))
    b = rng.standard_normal(6)
    x = solve_symmetric(triangle, tuple(b.tolist()))  # type: ignore[arg-type]
    np.testing.assert_allclose(x, np.linalg.solve(full(triangle), b), rtol=1e-10)


def test_steiner_is_the_tensor_of_point_masses() -> None:
    one = Body(2.0, (0.1, -0.2, 0.3), (1e-3, 2e-3, 1.5e-3), (1e-4, -2e-4, 3e-4))
    c = np.array(one.center_of_gravity)
    expected = tensor(one.inertia, one.products) + 2.0 * (c @ c * np.eye(3) - np.outer(c, c))
    moved = about_o(one)
    np.testing.assert_allclose(tensor(moved.inertia, moved.products), expected, rtol=1e-15)
    np.testing.assert_allclose(moved.moment, 2.0 * c)


def test_frames_agree_with_scipy() -> None:
    rng = np.random.default_rng(1)
    yaw, pitch, roll = 0.4, -0.7, 1.1
    turns = turns_of(Axes(yaw, pitch, roll))
    C = Rotation.from_euler("ZXY", [-yaw, pitch, roll]).as_matrix()
    np.testing.assert_allclose(matrix_from_turns(turns), C, atol=1e-15)
    v = vector(rng)
    np.testing.assert_allclose(to_camera(turns, v), C.T @ v, atol=1e-15)
    bodies = bodies_of(rng)
    a = Rotation.from_euler("ZX", [-yaw, pitch]).as_matrix()
    k = Rotation.from_euler("Z", [-yaw]).as_matrix()
    expected = k @ bodies[0].moment + a @ bodies[1].moment + C @ bodies[2].moment
    np.testing.assert_allclose(first_moment(bodies, turns), expected, atol=1e-16)


def test_camera_rates_are_the_derivatives_of_its_attitude() -> None:
    """By differences of the attitude on a head that turns at a constant rate with accelerating joints."""
    w = np.array([0.3, -0.5, 0.2])
    start, rate, acceleration = np.array([0.4, -0.7, 1.1]), np.array([1.0, -2.0, 1.5]), np.array([3.0, 2.0, -4.0])

    def joint(t: float) -> NDArray[np.float64]:
        return start + rate * t + 0.5 * acceleration * t * t

    def attitude(t: float) -> Rotation:
        yaw, pitch, roll = joint(t)
        return Rotation.from_rotvec(w * t) * Rotation.from_euler("ZXY", [-yaw, pitch, roll])

    def numeric(t: float, h: float = 1e-4) -> NDArray[np.float64]:
        turn: NDArray[np.float64] = (attitude(t - h).inv() * attitude(t + h)).as_rotvec() / (2.0 * h)
        return turn

    found, derivative = camera_rates(
        turns_of(Axes(*start)), tuple(w), ZERO3, JointMotion(Axes(*rate), Axes(*acceleration))
    )
    np.testing.assert_allclose(found, numeric(0.0), atol=1e-6)
    np.testing.assert_allclose(derivative, (numeric(1e-3) - numeric(-1e-3)) / 2e-3, atol=1e-4)
