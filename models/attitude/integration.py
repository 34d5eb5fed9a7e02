"""Integration of the quaternion kinematics dq/dt = 1/2 q (x) (0, w), from samples of the rate or its increments.

Between two samples the motion is a guess, and under coning the guess, not the solver, sets the drift. With W the
coning rate, a its half angle, lam = W h the phase between samples, the drift about the cone is a^2 W times

======================  ==========  ======================  ==============
from increments                     from rates
======================  ==========  ======================  ==============
one, by `turned`        lam^2/12    `runge_kutta_4`         lam^2/12
`coning_with_previous`  lam^4/60    `taylor_4`              lam^2/12
`coning_2`              lam^4/60    `rotation_vector`       lam^2/6
`coning_3`              lam^6/280   `coning_compensated`    11/1440 lam^4
`coning_4`              lam^8/1260
======================  ==========  ======================  ==============

An increment is the integral of the rate over one sampling interval; a part whose filter averages the rate just over
that interval delivers it (times h), and `mean_rate` takes every reading for one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ..record import Enumeration, Item, Quaternion, Vector3
from ..scalar import Scalar, cos, sin, sqrt, where
from ..vectors import add, cross, scale, subtract
from .rotations import normalised, quaternion_product

Integrator = Callable[[Quaternion, Vector3, Vector3, Scalar], Quaternion]
"""``(q_nb, w_before, w_now, h) -> q_nb`` one step of h seconds later; w = w_nb_b in rad/s."""


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


# --- from two samples of the rate ------------------------------------------------------------------------------------


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


def _taylor_term(latest: Quaternion, before: Quaternion, w: Vector3, change: Vector3, share: Scalar) -> Quaternion:
    """share (1/2 latest (x) w + 1/2 before (x) change)."""
    a, b = quaternion_rate(latest, w), quaternion_rate(before, change)
    return share * (a[0] + b[0]), share * (a[1] + b[1]), share * (a[2] + b[2]), share * (a[3] + b[3])


def taylor_4(q: Quaternion, w_before: Vector3, w_now: Vector3, h: Scalar) -> Quaternion:
    """q + c1 + c2 + c3 + c4, c_(n+1) = h/(n+1) 1/2 (c_n (x) w_before + c_(n-1) (x) (w_now - w_before)), c_0 = q.

    The Taylor series of the solution for a rate linear between the two latest samples. At constant rate it is
    `runge_kutta_4`, term for term; else the two differ from the fifth order on. The 2010 paper names it as the more
    exact of the two (section "test results", cause 3); under coning both drift by lam^2/12 all the same.
    """
    change = subtract(w_now, w_before)
    first = quaternion_rate(q, w_before)
    c1 = h * first[0], h * first[1], h * first[2], h * first[3]
    c2 = _taylor_term(c1, q, w_before, change, h / 2.0)
    c3 = _taylor_term(c2, c1, w_before, change, h / 3.0)
    c4 = _taylor_term(c3, c2, w_before, change, h / 4.0)
    return normalised(
        (
            q[0] + (c1[0] + (c2[0] + (c3[0] + c4[0]))),
            q[1] + (c1[1] + (c2[1] + (c3[1] + c4[1]))),
            q[2] + (c1[2] + (c2[2] + (c3[2] + c4[2]))),
            q[3] + (c1[3] + (c2[3] + (c3[3] + c4[3]))),
        )
    )


def mean_rotation(w_before: Vector3, w_now: Vector3, h: Scalar) -> Vector3:
    """h (w_before + w_now)/2: the increment between two rate samples by the trapezoid."""
    return scale(0.5 * h, add(w_before, w_now))


def coning_rotation(w_before: Vector3, w_now: Vector3, h: Scalar) -> Vector3:
    """h (w_before + w_now)/2 + h^2/6 w_before x w_now: the rotation vector between two rate samples, coning made up.

    One half of the cross product is the rotation vector's own for a linear rate, the other makes up for the trapezoid,
    which cuts the cone small; so it is right for vibration, and of second order for any motion.
    """
    return add(mean_rotation(w_before, w_now, h), scale(h * h / 6.0, cross(w_before, w_now)))


def mean_rate(q: Quaternion, _w_before: Vector3, w_now: Vector3, h: Scalar) -> Quaternion:
    """q (x) exp(h w_now): the closed form on the latest sample, taken as the mean rate since the one before.

    Right for parts that average and for rates held through a step. The others take samples for the rate at their
    moment, and where they are means lag by half an interval: on recorded hand motion that costs a quarter of accuracy.
    """
    return turned(q, scale(h, w_now))


def rotation_vector(q: Quaternion, w_before: Vector3, w_now: Vector3, h: Scalar) -> Quaternion:
    """q (x) exp(h (w_before + w_now)/2): the closed form on the mean of the two latest rate samples.

    Exact about a fixed axis, the rate linear in time; under coning it drifts by lam^2/6, twice as fast as Runge-Kutta.
    """
    return turned(q, mean_rotation(w_before, w_now, h))


def coning_compensated(q: Quaternion, w_before: Vector3, w_now: Vector3, h: Scalar) -> Quaternion:
    """q (x) exp(h (w_before + w_now)/2 + h^2/6 w_before x w_now): the closed form with `coning_rotation`."""
    return turned(q, coning_rotation(w_before, w_now, h))


INTEGRATION = Enumeration(
    "Integration",
    (
        Item("runge_kutta_4", "fourth-order Runge-Kutta, rate linear between samples; the 2010 paper's"),
        Item("taylor_4", "fourth-order Taylor series, rate linear between samples"),
        Item("rotation_vector", "closed form on the mean of two samples"),
        Item("coning_compensated", "closed form with coning compensation, for vibration"),
        Item("mean_rate", "closed form on the latest sample, taken as the mean since the one before"),
    ),
    "integration of the rates",
)

INTEGRATORS: Mapping[int, Integrator] = {
    INTEGRATION.value("runge_kutta_4"): runge_kutta_4,
    INTEGRATION.value("taylor_4"): taylor_4,
    INTEGRATION.value("rotation_vector"): rotation_vector,
    INTEGRATION.value("coning_compensated"): coning_compensated,
    INTEGRATION.value("mean_rate"): mean_rate,
}
"""The step of each value of `INTEGRATION`."""


# --- from increments -------------------------------------------------------------------------------------------------


def turned(q: Quaternion, rotation: Vector3) -> Quaternion:
    """q (x) (cos(a/2), sin(a/2)/a r): q turned by the rotation vector r of length a, in body axes; exact."""
    x, y, z = rotation
    quarter = 0.25 * (x * x + y * y + z * z)
    small = quarter < 1e-8
    half = sqrt(where(small, 1.0, quarter))
    real = where(small, 1.0 - quarter / 2.0, cos(half))
    share = 0.5 * where(small, 1.0 - quarter / 6.0, sin(half) / half)
    return normalised(quaternion_product(q, (real, share * x, share * y, share * z)))


def coning_with_previous(before: Vector3, now: Vector3) -> Vector3:
    """d_k + 1/12 d_(k-1) x d_k: rotation vector (rad) of one increment, the one before it at hand.

    Source: Ignagni, "Efficient class of optimized coning compensation algorithms", 1996.
    """
    return add(now, scale(1.0 / 12.0, cross(before, now)))


def coning_2(d1: Vector3, d2: Vector3) -> Vector3:
    """d1 + d2 + 2/3 d1 x d2: rotation vector (rad) over two increments."""
    return add(add(d1, d2), scale(2.0 / 3.0, cross(d1, d2)))


def coning_3(d1: Vector3, d2: Vector3, d3: Vector3) -> Vector3:
    """d1 + d2 + d3 + 9/20 d1 x d3 + 27/40 d2 x (d3 - d1): rotation vector (rad) over three increments.

    Source: Miller, "A new strapdown attitude algorithm", 1983.
    """
    coning = add(scale(9.0 / 20.0, cross(d1, d3)), scale(27.0 / 40.0, cross(d2, subtract(d3, d1))))
    return add(add(d1, add(d2, d3)), coning)


def coning_4(d1: Vector3, d2: Vector3, d3: Vector3, d4: Vector3) -> Vector3:
    """d1 + d2 + d3 + d4 + (54 d1 + 92 d2 + 214 d3)/105 x d4: rotation vector (rad) over four increments.

    Made for cones: it compensates vibration, and is not the best fit to a smooth turn. Source: Lee et al., "Extension
    of strapdown attitude algorithm for high-frequency base motion", 1990.
    """
    weighed = add(scale(54.0 / 105.0, d1), add(scale(92.0 / 105.0, d2), scale(214.0 / 105.0, d3)))
    return add(add(add(d1, d2), add(d3, d4)), cross(weighed, d4))
