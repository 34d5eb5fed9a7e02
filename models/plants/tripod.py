"""A tripod's head on its legs: a flexible yaw, pitch and roll about the apex P.

The elastic angles are the Euler angles of the head against its place at rest, so that ``C_nt`` is exact and energy is
kept to rounding; stiffness and damping act on each angle alone.
Source of the mode model: thecentercolumn.com 2018/01/16 (I th'' + C th' + k th = tau; the page swaps I and k).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real, Vector3
from ..scalar import Scalar, cos, sin, sqrt
from .gimbal import Axes, BodyAboutO


class Tripod(NamedTuple):
    """Stiffness, damping and inertia of the head about the apex."""

    stiffness: Annotated[Axes, Real("N.m/rad", "elastic stiffness about the apex", 1.0, 1e7, None, 1e3)] = Axes(
        320.0, 500.0, 500.0
    )  # travel tripod, centre column up: 650 in yaw [S thecentercolumn 2018/01/26], "a little over half" lost [S
    # 2018/03/01]; pitch and roll 1.3 to 2 times stiffer (assumption)
    damping_ratio: Annotated[Axes, Real("1", "of the mode, gimbal locked at zero angles", 0.0, 2.0)] = Axes(
        0.02, 0.03, 0.03
    )  # ring-down of 0.4 to 1 s [C plant facts 3.1]
    inertia: Annotated[Axes, Real("kg.m2", "effective inertia of head and legs", 1e-6, 100.0, None, 0.03)] = Axes(
        0.03, 0.03, 0.03
    )  # larger than the camera's [S thecentercolumn 2019/08/19]; the number is engineering judgement
    height: Annotated[float, Real("m", "gimbal's axes above the apex", 0.0, 2.0)] = 0.4  # column 0.25 m up, assumption


class Mount(NamedTuple):
    """The constants of the elastic mount."""

    stiffness: Annotated[Axes, Real("N.m/rad", "elastic stiffness")]
    damping: Annotated[Axes, Real("N.m.s/rad", "damping")]
    inertia: Annotated[Vector3, Real("kg.m2", "moments of inertia of the head about x, y, z")]


def mount(tripod: Tripod, bodies: tuple[BodyAboutO, ...]) -> Mount:
    """C = 2 zeta sqrt(k I) with I of the head and of all it carries, joints at zero."""
    h = tripod.height
    tilt = sum(h * (2.0 * body.moment[2] + body.mass * h) for body in bodies)
    carried = (
        sum(body.inertia[2] for body in bodies),
        sum(body.inertia[0] for body in bodies) + tilt,
        sum(body.inertia[1] for body in bodies) + tilt,
    )
    damping = [
        2.0 * ratio * sqrt(stiffness * (inertia + load))
        for ratio, stiffness, inertia, load in zip(
            tripod.damping_ratio, tripod.stiffness, tripod.inertia, carried, strict=True
        )
    ]
    yaw, pitch, roll = tripod.inertia
    return Mount(tripod.stiffness, Axes(*damping), (pitch, roll, yaw))


def mount_motion(constants: Mount, deflection: Axes, w: Vector3) -> tuple[Axes, Vector3, Vector3]:
    """Rates of the elastic angles, elastic and damping torque on the head, and up, the last two in t.

    e' = B(e) w;  tau_t = -B' (k e + c e');  up = C_nt' (0, 0, 1)
    """
    (k_yaw, k_pitch, k_roll), (c_yaw, c_pitch, c_roll), _ = constants
    yaw, pitch, roll = deflection
    wx, wy, wz = w
    st, ct = sin(pitch), cos(pitch)
    sg, cg = sin(roll), cos(roll)
    secant = 1.0 / ct
    yaw_rate = (sg * wx - cg * wz) * secant
    pitch_rate = cg * wx + sg * wz
    roll_rate = wy + st * yaw_rate
    yaw_torque = -k_yaw * yaw - c_yaw * yaw_rate
    pitch_torque = -k_pitch * pitch - c_pitch * pitch_rate
    roll_torque = -k_roll * roll - c_roll * roll_rate
    about_yaw = (yaw_torque + st * roll_torque) * secant
    torque = (cg * pitch_torque + sg * about_yaw, roll_torque, sg * pitch_torque - cg * about_yaw)
    return Axes(yaw_rate, pitch_rate, roll_rate), torque, (-sg * ct, st, cg * ct)


def elastic_energy(constants: Mount, deflection: Axes) -> Scalar:
    """V = sum k e^2 / 2, J."""
    k, e = constants.stiffness, deflection
    return 0.5 * (k[0] * e[0] * e[0] + k[1] * e[1] * e[1] + k[2] * e[2] * e[2])
