"""Integration of the quaternion kinematics dq/dt = 1/2 q (x) (0, w)."""

from __future__ import annotations

from ..record import Quaternion, Vector3
from ..scalar import Scalar, cos, sin, sqrt, where
from .rotations import normalised, quaternion_product


def quaternion_rate(q: Quaternion, w: Vector3) -> Quaternion:
    """1/2 q (x) (0, w); w = w_nb_b."""
    a, b, c, d = q
    x, y, z = w
    return (
        -0.5 * (b * x + c * y + d * z),
        0.5 * (a * x + c * z - d * y),
        0.5 * (a * y - b * z + d * x),
        0.5 * (a * z + b * y - c * x),
    )


def _moved(q: Quaternion, rate: Quaternion, h: Scalar) -> Quaternion:
    return q[0] + h * rate[0], q[1] + h * rate[1], q[2] + h * rate[2], q[3] + h * rate[3]


def runge_kutta_4(q: Quaternion, w_before: Vector3, w_now: Vector3, h: Scalar) -> Quaternion:
    """One step of fourth-order Runge-Kutta on the two latest rate samples, rate linear in between.

    The rate model, not the solver, sets the error under coning: drift (w h)^2/12. Source: the 2010 paper, section
    "attitude solution".
    """
    middle = (0.5 * (w_before[0] + w_now[0]), 0.5 * (w_before[1] + w_now[1]), 0.5 * (w_before[2] + w_now[2]))
    k1 = quaternion_rate(q, w_before)
    k2 = quaternion_rate(_moved(q, k1, 0.5 * h), middle)
    k3 = quaternion_rate(_moved(q, k2, 0.5 * h), middle)
    k4 = quaternion_rate(_moved(q, k3, h), w_now)
    sixth = h / 6.0
    return normalised(
        (
            q[0] + sixth * (k1[0] + 2.0 * (k2[0] + k3[0]) + k4[0]),
            q[1] + sixth * (k1[1] + 2.0 * (k2[1] + k3[1]) + k4[1]),
            q[2] + sixth * (k1[2] + 2.0 * (k2[2] + k3[2]) + k4[2]),
            q[3] + sixth * (k1[3] + 2.0 * (k2[3] + k3[3]) + k4[3]),
        )
    )


def turned(q: Quaternion, rotation: Vector3) -> Quaternion:
    """q (x) (cos(a/2), sin(a/2)/a r): q turned by the rotation vector r of length a, in body axes; exact."""
    x, y, z = rotation
    quarter = 0.25 * (x * x + y * y + z * z)
    small = quarter < 1e-8
    half = sqrt(where(small, 1.0, quarter))
    real = where(small, 1.0 - quarter / 2.0, cos(half))
    share = 0.5 * where(small, 1.0 - quarter / 6.0, sin(half) / half)
    return normalised(quaternion_product(q, (real, share * x, share * y, share * z)))
