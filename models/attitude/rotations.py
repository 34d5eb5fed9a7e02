"""Quaternions, direction cosines and Euler angles of the project's conventions.

C_nb (body to navigation) = Rz(-psi) Rx(theta) Ry(gamma)::

    cg cp + sg sp st    sp ct    sg cp - cg sp st
   -cg sp + sg cp st    cp ct   -sg sp - cg cp st
   -sg ct               st       cg ct

Corrects the printed matrices of Jing & Gao 2021, eq. (1), (2), (4), and keeps its angle formulas (9)-(11).
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Matrix3, Quaternion, Real, Vector3
from ..scalar import PI, Scalar, atan2, cos, hypot, maximum, sin, sqrt, where

EARTH_RATE = 7.292115e-5
"""Rotation of the Earth, rad/s (WGS 84)."""

STANDARD_GRAVITY = 9.80665
"""m/s^2 (CGPM 1901)."""


class Euler(NamedTuple):
    """Yaw, pitch and roll."""

    yaw: Annotated[float, Real("rad", "yaw, clockwise from north seen from above", display="deg")]
    pitch: Annotated[float, Real("rad", "pitch, nose up", display="deg")]
    roll: Annotated[float, Real("rad", "roll, right side down", display="deg")]


def quaternion_product(p: Quaternion, q: Quaternion) -> Quaternion:
    """p (x) q, Hamilton."""
    a, b, c, d = p
    w, x, y, z = q
    return (
        a * w - b * x - c * y - d * z,
        a * x + b * w + c * z - d * y,
        a * y - b * z + c * w + d * x,
        a * z + b * y - c * x + d * w,
    )


def normalised(q: Quaternion) -> Quaternion:
    """q / |q|."""
    w, x, y, z = q
    scale = 1.0 / sqrt(w * w + x * x + y * y + z * z)
    return w * scale, x * scale, y * scale, z * scale


def matrix_from_quaternion(q_nb: Quaternion) -> Matrix3:
    """C_nb of a unit quaternion."""
    w, x, y, z = q_nb
    ww, xx, yy, zz = w * w, x * x, y * y, z * z
    return (
        (ww + xx - yy - zz, 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)),
        (2.0 * (x * y + w * z), ww - xx + yy - zz, 2.0 * (y * z - w * x)),
        (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), ww - xx - yy + zz),
    )


Turns = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
"""Sine and cosine of yaw, of pitch and of roll."""


def turns_of(angles: tuple[Scalar, Scalar, Scalar]) -> Turns:
    """Sines and cosines of yaw, pitch and roll."""
    yaw, pitch, roll = angles
    return sin(yaw), cos(yaw), sin(pitch), cos(pitch), sin(roll), cos(roll)


def matrix_from_turns(turns: Turns) -> Matrix3:
    """Rz(-psi) Rx(theta) Ry(gamma) of sines and cosines."""
    sp, cp, st, ct, sg, cg = turns
    return (
        (cg * cp + sg * sp * st, sp * ct, sg * cp - cg * sp * st),
        (-cg * sp + sg * cp * st, cp * ct, -sg * sp - cg * cp * st),
        (-sg * ct, st, cg * ct),
    )


def matrix_from_euler(euler: Euler) -> Matrix3:
    """C_nb of yaw, pitch and roll."""
    return matrix_from_turns(turns_of(euler))


def euler_from_matrix(c_nb: Matrix3) -> Euler:
    """theta = asin(C32), gamma = atan2(-C31, C33), psi = atan2(C12, C22).

    The arcsine is taken as atan2(C32, hypot(C31, C33)), which keeps all digits near +-90 deg.
    At exactly +-90 deg, where yaw and roll are one turn, roll reads 0 and yaw the whole.
    """
    level = hypot(c_nb[2][0], c_nb[2][2])
    upright = level > 1e-15
    return Euler(
        yaw=where(upright, atan2(c_nb[0][1], c_nb[1][1]), atan2(-c_nb[1][0], c_nb[0][0])),
        pitch=atan2(c_nb[2][1], level),
        roll=where(upright, atan2(-c_nb[2][0], c_nb[2][2]), 0.0),
    )


def quaternion_from_euler(euler: Euler) -> Quaternion:
    """q_nb = q_z(-psi) (x) q_x(theta) (x) q_y(gamma)."""
    sp, cp = sin(-0.5 * euler.yaw), cos(-0.5 * euler.yaw)
    st, ct = sin(0.5 * euler.pitch), cos(0.5 * euler.pitch)
    sg, cg = sin(0.5 * euler.roll), cos(0.5 * euler.roll)
    turned = quaternion_product((cp, 0.0, 0.0, sp), (ct, st, 0.0, 0.0))
    return quaternion_product(turned, (cg, 0.0, sg, 0.0))


def quaternion_from_matrix(c: Matrix3) -> Quaternion:
    """q_nb of C_nb by the four-branch form: the largest squared component is taken first (Shepperd 1978)."""
    c11, c22, c33 = c[0][0], c[1][1], c[2][2]
    s0, s1 = 1.0 + c11 + c22 + c33, 1.0 + c11 - c22 - c33
    s2, s3 = 1.0 - c11 + c22 - c33, 1.0 - c11 - c22 + c33
    dx, dy, dz = c[2][1] - c[1][2], c[0][2] - c[2][0], c[1][0] - c[0][1]
    pxy, pxz, pyz = c[0][1] + c[1][0], c[0][2] + c[2][0], c[1][2] + c[2][1]
    most = maximum(maximum(s0, s1), maximum(s2, s3))

    def pick(q0: Scalar, q1: Scalar, q2: Scalar, q3: Scalar) -> Scalar:
        return where(s0 == most, q0, where(s1 == most, q1, where(s2 == most, q2, q3)))

    return normalised((pick(s0, dx, dy, dz), pick(dx, s1, pxy, pxz), pick(dy, pxy, s2, pyz), pick(dz, pxz, pyz, s3)))


def tilt_from_specific_force(f_b: Vector3) -> tuple[Scalar, Scalar]:
    """Pitch and roll at rest: theta = atan2(fy, hypot(fx, fz)), gamma = atan2(-fx, fz)."""
    return atan2(f_b[1], hypot(f_b[0], f_b[2])), atan2(-f_b[0], f_b[2])


REFERENCE_LATITUDE = 0.25 * PI
"""rad, where every model stands unless told otherwise."""


def earth_rate_n(latitude: Scalar) -> Vector3:
    """w_ie_n = 7.292115e-5 (0, cos lat, sin lat) rad/s."""
    return 0.0, EARTH_RATE * cos(latitude), EARTH_RATE * sin(latitude)


def wrapped(euler: Euler) -> Euler:
    """The same attitude with yaw and roll in -pi..pi and pitch in -pi/2..pi/2."""
    return euler_from_matrix(matrix_from_euler(euler))
