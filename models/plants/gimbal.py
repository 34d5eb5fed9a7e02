"""A three-axis gimbal: yaw (outer), pitch, roll (inner), axes that meet in one point O.

Frames: t is the tripod's head, k the yaw frame, a the pitch frame, b the camera, each right-forward-up.
``C_tb = Rz(-yaw) Rx(pitch) Ry(roll)``, so that a joint angle turns the camera as the Euler angle of that name does.
All moments are taken about O, where a body is no more than its mass, first moment and inertia: the recursion from
frame to frame is then three plain turns, with no lever arms.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..attitude.rotations import Turns
from ..record import Real, Vector3
from ..scalar import Scalar
from .linear_equations import Symmetric6


class Axes(NamedTuple):
    """One number for each joint."""

    yaw: float
    pitch: float
    roll: float


NO_AXES = Axes(0.0, 0.0, 0.0)


class Body(NamedTuple):
    """A rigid body in the axes of its own frame (right, forward, up)."""

    mass: Annotated[float, Real("kg", "mass", min=0.0, max=100.0, nominal=1.0)]
    center_of_gravity: Annotated[
        Vector3, Real("m", "centre of gravity from the axes' meeting point O", min=-1.0, max=1.0, nominal=1e-3)
    ]
    inertia: Annotated[
        Vector3, Real("kg.m2", "moments of inertia xx, yy, zz about the centre of gravity", min=1e-9, nominal=1e-3)
    ]
    products: Annotated[
        Vector3, Real("kg.m2", "tensor elements xy, xz, yz (minus the products of inertia)", nominal=1e-4)
    ] = (0.0, 0.0, 0.0)


class BodyAboutO(NamedTuple):
    """What Newton and Euler need of a body that turns about O."""

    mass: Annotated[float, Real("kg", "mass")]
    moment: Annotated[Vector3, Real("kg.m", "first moment, mass times centre of gravity")]
    inertia: Annotated[Vector3, Real("kg.m2", "moments of inertia xx, yy, zz about O")]
    products: Annotated[Vector3, Real("kg.m2", "tensor elements xy, xz, yz about O")]


Bodies = tuple[BodyAboutO, BodyAboutO, BodyAboutO]
"""Yaw frame, pitch frame, camera."""

Forces6 = tuple[Vector3, Vector3, Vector3, Vector3, Vector3, Vector3]
"""A force for each of six coordinates, N per unit acceleration."""


class HeadMotion(NamedTuple):
    """Motion of the frame that carries the gimbal, in its own axes t."""

    rate: Vector3  # w_nt_t, rad/s
    acceleration: Vector3  # its derivative, rad/s^2
    felt: Vector3  # specific force of O, m/s^2


class JointMotion(NamedTuple):
    """Rates (rad/s) and accelerations (rad/s^2) of the joints."""

    rates: Axes
    accelerations: Axes


class Wrench(NamedTuple):
    """A force (N) at O and a torque (N.m) about O."""

    force: Vector3
    torque: Vector3


def about_o(body: Body) -> BodyAboutO:
    """J_O = J_c + m (c'c I - c c') (Steiner)."""
    m = body.mass
    x, y, z = body.center_of_gravity
    xx, yy, zz = body.inertia
    xy, xz, yz = body.products
    return BodyAboutO(
        mass=m,
        moment=(m * x, m * y, m * z),
        inertia=(xx + m * (y * y + z * z), yy + m * (x * x + z * z), zz + m * (x * x + y * y)),
        products=(xy - m * x * y, xz - m * x * z, yz - m * y * z),
    )


def to_camera(turns: Turns, v_t: Vector3) -> Vector3:
    """v_b = C_tb' v_t."""
    sp, cp, st, ct, sg, cg = turns
    x, y, z = v_t
    x, y = cp * x - sp * y, sp * x + cp * y
    y, z = ct * y + st * z, ct * z - st * y
    return cg * x - sg * z, y, sg * x + cg * z


def camera_rates(turns: Turns, w: Vector3, alpha: Vector3, joints: JointMotion) -> tuple[Vector3, Vector3]:
    """w_nb_b and its derivative from the head's w_nt_t, its derivative alpha and the joints' motion."""
    sp, cp, st, ct, sg, cg = turns
    wx, wy, wz = w
    ax, ay, az = alpha
    (yaw, pitch, roll), accelerations = joints
    wx, wy = cp * wx - sp * wy, sp * wx + cp * wy
    ax, ay, az = cp * ax - sp * ay - wy * yaw, sp * ax + cp * ay + wx * yaw, az - accelerations[0]
    wz = wz - yaw
    wy, wz = ct * wy + st * wz, ct * wz - st * wy
    ax, ay, az = ax + accelerations[1], ct * ay + st * az + wz * pitch, ct * az - st * ay - wy * pitch
    wx = wx + pitch
    wx, wz = cg * wx - sg * wz, sg * wx + cg * wz
    ax, ay, az = cg * ax - sg * az - wz * roll, ay + accelerations[2], sg * ax + cg * az + wx * roll
    return (wx, wy + roll, wz), (ax, ay, az)


def _inertial_wrench(body: BodyAboutO, w: Vector3, alpha: Vector3, a: Vector3) -> tuple[Scalar, ...]:
    """F = m a + alpha x s + w x (w x s);  N = J alpha + w x J w + s x a  (Newton, Euler, about O)."""
    m, (sx, sy, sz), (xx, yy, zz), (xy, xz, yz) = body
    wx, wy, wz = w
    px, py, pz = alpha
    ax, ay, az = a
    hx, hy, hz = xx * wx + xy * wy + xz * wz, xy * wx + yy * wy + yz * wz, xz * wx + yz * wy + zz * wz
    along, square = wx * sx + wy * sy + wz * sz, wx * wx + wy * wy + wz * wz
    return (
        m * ax + py * sz - pz * sy + wx * along - sx * square,
        m * ay + pz * sx - px * sz + wy * along - sy * square,
        m * az + px * sy - py * sx + wz * along - sz * square,
        xx * px + xy * py + xz * pz + wy * hz - wz * hy + sy * az - sz * ay,
        xy * px + yy * py + yz * pz + wz * hx - wx * hz + sz * ax - sx * az,
        xz * px + yz * py + zz * pz + wx * hy - wy * hx + sx * ay - sy * ax,
    )


def inverse_dynamics(
    bodies: Bodies, turns: Turns, head: HeadMotion, joints: JointMotion, outside: Wrench
) -> tuple[Axes, Wrench]:
    """Joint torques that a motion wants (N.m), and the wrench that it wants of the head, in t.

    outside: what else acts on the camera, in b. Recursive Newton-Euler, outward for motion and inward for forces.
    Source: Luh, Walker, Paul, J. Dyn. Sys. Meas. Control 102 (1980) 69.
    """
    sp, cp, st, ct, sg, cg = turns
    (yaw, pitch, roll), accelerations = joints
    (wx, wy, wz), (px, py, pz), (ax, ay, az) = head
    force_b, torque_b = outside

    wx, wy = cp * wx - sp * wy, sp * wx + cp * wy
    px, py, pz = cp * px - sp * py - wy * yaw, sp * px + cp * py + wx * yaw, pz - accelerations[0]
    ax, ay = cp * ax - sp * ay, sp * ax + cp * ay
    wz = wz - yaw
    fkx, fky, fkz, nkx, nky, nkz = _inertial_wrench(bodies[0], (wx, wy, wz), (px, py, pz), (ax, ay, az))

    wy, wz = ct * wy + st * wz, ct * wz - st * wy
    px, py, pz = px + accelerations[1], ct * py + st * pz + wz * pitch, ct * pz - st * py - wy * pitch
    ay, az = ct * ay + st * az, ct * az - st * ay
    wx = wx + pitch
    fax, fay, faz, nax, nay, naz = _inertial_wrench(bodies[1], (wx, wy, wz), (px, py, pz), (ax, ay, az))

    wx, wz = cg * wx - sg * wz, sg * wx + cg * wz
    px, py, pz = cg * px - sg * pz - wz * roll, py + accelerations[2], sg * px + cg * pz + wx * roll
    ax, az = cg * ax - sg * az, sg * ax + cg * az
    wy = wy + roll
    fx, fy, fz, nx, ny, nz = _inertial_wrench(bodies[2], (wx, wy, wz), (px, py, pz), (ax, ay, az))
    fx, fy, fz = fx - force_b[0], fy - force_b[1], fz - force_b[2]
    nx, ny, nz = nx - torque_b[0], ny - torque_b[1], nz - torque_b[2]

    roll_torque = ny
    fx, fy, fz = fax + cg * fx + sg * fz, fay + fy, faz + cg * fz - sg * fx
    nx, ny, nz = nax + cg * nx + sg * nz, nay + ny, naz + cg * nz - sg * nx
    pitch_torque = nx
    fx, fy, fz = fkx + fx, fky + ct * fy - st * fz, fkz + st * fy + ct * fz
    nx, ny, nz = nkx + nx, nky + ct * ny - st * nz, nkz + st * ny + ct * nz
    return (
        Axes(-nz, pitch_torque, roll_torque),
        Wrench((cp * fx + sp * fy, cp * fy - sp * fx, fz), (cp * nx + sp * ny, cp * ny - sp * nx, nz)),
    )


def mass_matrix(bodies: Bodies, turns: Turns, height: Scalar, head: Vector3) -> tuple[Symmetric6, Forces6]:
    """M of M(q) u' + h = tau for u = (w_nt_t, yaw rate, pitch rate, roll rate), by composite bodies, and their forces.

    height: O above the ball's centre Q (m); head: moments of inertia of what turns with it about Q (kg.m2).
    Each joint's column is the wrench that a unit acceleration of it wants of all bodies it carries; the forces, in t,
    are what a unit acceleration of each coordinate wants of Q.
    Source: Featherstone, Rigid Body Dynamics Algorithms, section 6.2.
    """
    sp, cp, st, ct, sg, cg = turns
    yaw_frame, pitch_frame, camera = bodies
    m, (sx, sy, sz), (xx, yy, zz), (xy, xz, yz) = camera

    # camera in a
    sx, sz = cg * sx + sg * sz, cg * sz - sg * sx
    cc, ss, cs = cg * cg, sg * sg, cg * sg
    xx, zz, xz = cc * xx + ss * zz + 2.0 * cs * xz, ss * xx + cc * zz - 2.0 * cs * xz, (cc - ss) * xz - cs * (xx - zz)
    xy, yz = cg * xy + sg * yz, cg * yz - sg * xy
    roll_roll, roll_pitch = yy, xy
    # roll column, wanted in k
    ry, rz = ct * yy - st * yz, st * yy + ct * yz
    roll_yaw = -rz
    rx, ry = cp * xy + sp * ry, cp * ry - sp * xy
    rfx, rfy, rfz = sz, st * sx, -ct * sx
    rfx, rfy = cp * rfx + sp * rfy, cp * rfy - sp * rfx

    # pitch frame and camera, in k
    am, (ax, ay, az), (axx, ayy, azz), (axy, axz, ayz) = pitch_frame
    m, sx, sy, sz = m + am, sx + ax, sy + ay, sz + az
    xx, yy, zz, xy, xz, yz = xx + axx, yy + ayy, zz + azz, xy + axy, xz + axz, yz + ayz
    sy, sz = ct * sy - st * sz, st * sy + ct * sz
    cc, ss, cs = ct * ct, st * st, ct * st
    yy, zz, yz = cc * yy + ss * zz - 2.0 * cs * yz, ss * yy + cc * zz + 2.0 * cs * yz, (cc - ss) * yz + cs * (yy - zz)
    xy, xz = ct * xy - st * xz, st * xy + ct * xz
    pitch_pitch, pitch_yaw = xx, -xz
    tx, ty, tz = cp * xx + sp * xy, cp * xy - sp * xx, xz
    tfx, tfy, tfz = -sp * sz, -cp * sz, sy

    # all three, in t
    km, (kx, ky, kz), (kxx, kyy, kzz), (kxy, kxz, kyz) = yaw_frame
    m, sx, sy, sz = m + km, sx + kx, sy + ky, sz + kz
    xx, yy, zz, xy, xz, yz = xx + kxx, yy + kyy, zz + kzz, xy + kxy, xz + kxz, yz + kyz
    sx, sy = cp * sx + sp * sy, cp * sy - sp * sx
    cc, ss, cs = cp * cp, sp * sp, cp * sp
    xx, yy, xy = cc * xx + ss * yy + 2.0 * cs * xy, ss * xx + cc * yy - 2.0 * cs * xy, (cc - ss) * xy - cs * (xx - yy)
    xz, yz = cp * xz + sp * yz, cp * yz - sp * xz

    level = height * (2.0 * sz + m * height)
    head_rows = (xx + level + head[0], xy, yy + level + head[1], xz - height * sx, yz - height * sy, zz + head[2])
    yaw_row = (height * sx - xz, height * sy - yz, -zz, zz)
    pitch_row = (tx - height * tfy, ty + height * tfx, tz, pitch_yaw, pitch_pitch)
    roll_row = (rx - height * rfy, ry + height * rfx, rz, roll_yaw, roll_pitch, roll_roll)
    lever = sz + m * height
    forces = ((0.0, -lever, sy), (lever, 0.0, -sx), (-sy, sx, 0.0), (sy, -sx, 0.0), (tfx, tfy, tfz), (rfx, rfy, rfz))
    return (*head_rows, *yaw_row, *pitch_row, *roll_row), forces


def first_moment(bodies: Bodies, turns: Turns) -> Vector3:
    """Sum of mass times centre of gravity from O, in t."""
    sp, cp, st, ct, sg, cg = turns
    x, y, z = bodies[2].moment
    x, z = cg * x + sg * z, cg * z - sg * x
    x, y, z = x + bodies[1].moment[0], y + bodies[1].moment[1], z + bodies[1].moment[2]
    y, z = ct * y - st * z, st * y + ct * z
    x, y, z = x + bodies[0].moment[0], y + bodies[0].moment[1], z + bodies[0].moment[2]
    return cp * x + sp * y, cp * y - sp * x, z
