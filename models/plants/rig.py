"""The mechanics of the whole rig: tripod, ball head and gimbal, one on top of the other.

    M(q) u' + h(q, u) = tau,   u = (w_np_p, w_nt_t, yaw rate, pitch rate, roll rate)

Frames: n is the ground, p the tripod's apex, which turns elastically about P; t the head, which turns elastically about
the ball's centre Q above P; the gimbal's axes meet in O above Q. The apex meets the rest in the force at Q alone, so
that its part of M is diagonal and leaves the equations in closed form; six remain.
"""

from __future__ import annotations

from typing import NamedTuple

from ..attitude.rotations import turns_of
from ..record import Matrix3, Vector3
from ..scalar import Scalar
from ..vectors import ZERO3, add, cross, each_axis, multiply, multiply_transposed, scale, subtract
from .gimbal import (
    NO_AXES,
    Axes,
    BodyAboutO,
    Forces6,
    HeadMotion,
    JointMotion,
    Wrench,
    first_moment,
    inverse_dynamics,
    mass_matrix,
    to_camera,
)
from .joint import JointParts, joint_energy, joint_torque
from .linear_equations import Symmetric6, solve_symmetric
from .tripod import Mount, attitude, elastic_energy, mount_motion


class Rig(NamedTuple):
    """The constants of the mechanics."""

    bodies: tuple[BodyAboutO, BodyAboutO, BodyAboutO]
    tripod: Mount
    head: Mount


class Position(NamedTuple):
    """Elastic angles of the tripod and of its head, and joint angles, rad."""

    tripod: Axes
    head: Axes
    joint: Axes


class Rates(NamedTuple):
    """w_np_p, w_nt_t and the joints' rates, rad/s; or their derivatives."""

    apex: Vector3
    head: Vector3
    joint: Axes


class Motion(NamedTuple):
    """Where everything is and how it moves."""

    position: Position
    rates: Rates


class Loads(NamedTuple):
    """What acts on the rig over a solver step."""

    motor: Axes  # torque on the joints, N.m
    bristle: Axes  # of the joints' friction, rad
    on_apex: Vector3  # torque about P in p, N.m
    on_camera: Wrench  # at O, in b
    wind: Vector3  # force in t, N
    center_of_pressure: Vector3  # from O in b, m


Parts = tuple[JointParts, JointParts, JointParts]


def _felt_above(felt: Vector3, w: Vector3, height: Scalar) -> Vector3:
    """Specific force `height` above a point, without the angular acceleration's: felt + w x (w x (0, 0, height))."""
    wx, wy, wz = w
    along = wz * height
    return felt[0] + wx * along, felt[1] + wy * along, felt[2] - height * (wx * wx + wy * wy)


def _about_below(moment: Vector3, force: Vector3, height: Scalar) -> Vector3:
    """The moment about a point `height` below that of `moment`."""
    return moment[0] - height * force[1], moment[1] + height * force[0], moment[2]


def _gyroscopic(inertia: Vector3, w: Vector3) -> Vector3:
    """w x J w."""
    ix, iy, iz = inertia
    wx, wy, wz = w
    return (iz - iy) * wy * wz, (ix - iz) * wz * wx, (iy - ix) * wx * wy


class Coupling(NamedTuple):
    """The apex's part of M: its diagonal, and its rows about x and y against the six other coordinates."""

    diagonal: Vector3
    about_x: tuple[Scalar, ...]
    about_y: tuple[Scalar, ...]


def coupling(rig: Rig, c_pt: Matrix3, forces: Forces6) -> Coupling:
    """Moments about P of the forces at Q that unit accelerations want."""
    height, (ix, iy, iz) = rig.tripod.height, rig.tripod.inertia
    mass = rig.bodies[0].mass + rig.bodies[1].mass + rig.bodies[2].mass
    carried = mass * height * height
    (xx, xy, xz), (yx, yy, yz), _ = c_pt
    return Coupling(
        (ix + carried, iy + carried, iz),
        tuple([-height * (yx * f[0] + yy * f[1] + yz * f[2]) for f in forces]),
        tuple([height * (xx * f[0] + xy * f[1] + xz * f[2]) for f in forces]),
    )


def _accelerations(matrix: Symmetric6, beside: Coupling, on_apex: Vector3, on_rest: tuple[Scalar, ...]) -> Rates:
    """u' of M u' = tau: the apex's three rows are eliminated, the other six solved."""
    (dx, dy, dz), about_x, about_y = beside
    x_share, y_share = 1.0 / dx, 1.0 / dy
    by_x, by_y = [b * x_share for b in about_x], [b * y_share for b in about_y]
    rest, k = [], 0
    for i in range(6):
        for j in range(i + 1):
            rest.append(matrix[k] - by_x[i] * about_x[j] - by_y[i] * about_y[j])
            k += 1
    left = [on_rest[i] - by_x[i] * on_apex[0] - by_y[i] * on_apex[1] for i in range(6)]
    solved = solve_symmetric(tuple(rest), (left[0], left[1], left[2], left[3], left[4], left[5]))
    ax, ay = on_apex[0] * x_share, on_apex[1] * y_share
    for i in range(6):
        ax, ay = ax - by_x[i] * solved[i], ay - by_y[i] * solved[i]
    return Rates((ax, ay, on_apex[2] / dz), solved[0:3], Axes(*solved[3:6]))


def motion_rate(motion: Motion, loads: Loads, rig: Rig, parts: Parts, gravity: Scalar) -> Motion:
    """Derivative of the motion: rates of all angles, and u' of M(q) u' = tau - h(q, u)."""
    (tripod, head, joint), (w_p, w_t, rates) = motion
    bodies, low, high = rig.bodies, rig.tripod, rig.head
    turns, c_pt, up_p = turns_of(joint), attitude(head), attitude(tripod)[2]
    tripod_rates, on_apex = mount_motion(low, tripod, w_p)
    head_rates, on_head = mount_motion(high, head, subtract(w_t, multiply_transposed(c_pt, w_p)))

    felt = _felt_above(multiply_transposed(c_pt, _felt_above(scale(gravity, up_p), w_p, low.height)), w_t, high.height)
    wind = to_camera(turns, loads.wind)
    force_b, torque_b = loads.on_camera
    outside = Wrench(add(wind, force_b), add(cross(loads.center_of_pressure, wind), torque_b))
    wanted, (force, moment) = inverse_dynamics(
        bodies, turns, HeadMotion(w_t, ZERO3, felt), JointMotion(rates, NO_AXES), outside
    )
    at_q = _about_below(moment, force, high.height)
    # what the head gets of its mount the apex loses, and it bears the force at Q
    lost = _about_below(multiply(c_pt, on_head), multiply(c_pt, force), low.height)
    gyro_p, gyro_t = _gyroscopic(low.inertia, w_p), _gyroscopic(high.inertia, w_t)
    about_p = each_axis(lambda i: on_apex[i] + loads.on_apex[i] - lost[i] - gyro_p[i])
    rest = (
        *[on_head[i] - at_q[i] - gyro_t[i] for i in range(3)],
        *[loads.motor[i] + joint_torque(parts[i], loads.bristle[i], joint[i], rates[i]) - wanted[i] for i in range(3)],
    )
    matrix, forces = mass_matrix(bodies, turns, high.height, high.inertia)
    accelerations = _accelerations(matrix, coupling(rig, c_pt, forces), about_p, rest)
    return Motion(Position(tripod_rates, head_rates, rates), accelerations)


def _flat(motion: Motion) -> tuple[Scalar, ...]:
    (tripod, head, joint), (w_p, w_t, rates) = motion
    return (*tripod, *head, *joint, *w_p, *w_t, *rates)


def _motion(flat: list[Scalar]) -> Motion:
    return Motion(
        Position(Axes(*flat[0:3]), Axes(*flat[3:6]), Axes(*flat[6:9])),
        Rates((flat[9], flat[10], flat[11]), (flat[12], flat[13], flat[14]), Axes(*flat[15:18])),
    )


def _moved(motion: Motion, step: Scalar, rate: Motion) -> Motion:
    return _motion([x + step * r for x, r in zip(_flat(motion), _flat(rate), strict=True)])


def rk4(motion: Motion, loads: Loads, rig: Rig, parts: Parts, gravity: Scalar, h: Scalar) -> Motion:
    """The motion a step of h (s) later, the loads held."""
    half, sixth = 0.5 * h, h / 6.0
    k1 = motion_rate(motion, loads, rig, parts, gravity)
    k2 = motion_rate(_moved(motion, half, k1), loads, rig, parts, gravity)
    k3 = motion_rate(_moved(motion, half, k2), loads, rig, parts, gravity)
    k4 = motion_rate(_moved(motion, h, k3), loads, rig, parts, gravity)
    slopes = zip(_flat(motion), _flat(k1), _flat(k2), _flat(k3), _flat(k4), strict=True)
    return _motion([x + sixth * (r1 + 2.0 * (r2 + r3) + r4) for x, r1, r2, r3, r4 in slopes])


def equilibrium(joint: Axes, loads: Loads, rig: Rig, gravity: Scalar) -> Position:
    """Elastic angles at rest with locked joints: e <- e + (k e - wanted torque) / k, six times.

    Each turn gains a factor of stiffness over gravity's tilting moment, a hundred for a usable tripod.
    """
    turns = turns_of(joint)
    wind = to_camera(turns, loads.wind)
    outside = Wrench(wind, cross(loads.center_of_pressure, wind))
    tripod = head = NO_AXES
    for _ in range(6):
        c_pt = attitude(head)
        up = multiply_transposed(c_pt, attitude(tripod)[2])
        still = HeadMotion(ZERO3, ZERO3, scale(gravity, up))
        _, (force, moment) = inverse_dynamics(rig.bodies, turns, still, JointMotion(NO_AXES, NO_AXES), outside)
        at_q = _about_below(moment, force, rig.head.height)
        at_p = _about_below(multiply(c_pt, at_q), multiply(c_pt, force), rig.tripod.height)
        tripod = _relaxed(rig.tripod, tripod, at_p)
        head = _relaxed(rig.head, head, at_q)
    return Position(tripod, head, joint)


def _relaxed(constants: Mount, e: Axes, wanted: Vector3) -> Axes:
    k = constants.stiffness
    _, elastic = mount_motion(constants, e, ZERO3)
    x, y, z = subtract(elastic, wanted)
    return Axes(e.yaw - z / k.yaw, e.pitch + x / k.pitch, e.roll + y / k.roll)


def kinetic_energy(motion: Motion, rig: Rig) -> Scalar:
    """u' M u / 2, J."""
    (_, head, joint), (w_p, w_t, rates) = motion
    matrix, forces = mass_matrix(rig.bodies, turns_of(joint), rig.head.height, rig.head.inertia)
    (dx, dy, dz), about_x, about_y = coupling(rig, attitude(head), forces)
    u = (*w_t, *rates)
    kinetic = 0.5 * (dx * w_p[0] * w_p[0] + dy * w_p[1] * w_p[1] + dz * w_p[2] * w_p[2])
    k = 0
    for i in range(6):
        kinetic = kinetic + (about_x[i] * w_p[0] + about_y[i] * w_p[1]) * u[i]
        for j in range(i + 1):
            kinetic = kinetic + (0.5 if i == j else 1.0) * matrix[k] * u[i] * u[j]
            k += 1
    return kinetic


def potential_energy(position: Position, rig: Rig, parts: Parts, gravity: Scalar) -> Scalar:
    """Springs of mounts, cables, stops and cogging, and gravity from the apex up, J."""
    tripod, head, joint = position
    x, y, z = first_moment(rig.bodies, turns_of(joint))
    mass = rig.bodies[0].mass + rig.bodies[1].mass + rig.bodies[2].mass
    up_p = attitude(tripod)[2]
    up_t = multiply_transposed(attitude(head), up_p)
    lifted = up_p[2] * mass * rig.tripod.height + up_t[0] * x + up_t[1] * y + up_t[2] * (z + mass * rig.head.height)
    held = joint_energy(parts[0], joint[0]) + joint_energy(parts[1], joint[1]) + joint_energy(parts[2], joint[2])
    return elastic_energy(rig.tripod, tripod) + elastic_energy(rig.head, head) + held + gravity * lifted
