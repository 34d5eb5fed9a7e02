"""A tripod and its ball head, two elastic mounts in series: the apex P on the legs, and the head on its ball Q.

Each gives in yaw, pitch and roll. The elastic angles are those of the child against the parent's place at rest, as
twice Gibbs's vector, e = 2 tan(angle/2) axis: attitude and energy are then exact to rounding without sines. Stiffness
and damping act on each angle alone.
Source of the mode model: thecentercolumn.com 2018/01/16 (I th'' + C th' + k th = tau; the page swaps I and k).

Both have states of their own: of the defaults' first yaw mode, joints locked, most inertia is the tripod's, so that the
head lowers it by 1 % (13.9 to 13.8 Hz), one spring k1 k2/(k1 + k2) by 9 %; and tripod and gimbal swing against
each other across the ball at 67 Hz (89 and 96 Hz in tilt), within the gyros' band and the shutter's. With a free yaw
joint the ball carries no more than its base, at 106 Hz.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Matrix3, Quaternion, Real, Vector3
from ..scalar import Scalar, sqrt
from ..vectors import cross, dot
from .gimbal import Axes, BodyAboutO


class Tripod(NamedTuple):
    """Stiffness, damping and inertia about the apex."""

    stiffness: Annotated[Axes, Real("N.m/rad", "elastic stiffness about the apex", 1.0, 1e7, None, 1e3)] = Axes(
        320.0, 500.0, 500.0
    )  # travel tripod, centre column up: 650 in yaw [S thecentercolumn 2018/01/26], "a little over half" lost [S
    # 2018/03/01]; pitch and roll 1.3 to 2 times stiffer (assumption)
    damping_ratio: Annotated[Axes, Real("1", "of the mode, all above it rigid at zero angles", 0.0, 2.0)] = Axes(
        0.02, 0.03, 0.03
    )  # ring-down of 0.4 to 1 s [C plant facts 3.1]
    inertia: Annotated[
        Axes, Real("kg.m2", "effective inertia of legs, column and the ball's load", 1e-6, 100.0, None, 0.03)
    ] = Axes(0.03, 0.03, 0.03)
    # larger than the camera's [S thecentercolumn 2019/08/19]; the number is engineering judgement
    height: Annotated[float, Real("m", "the ball's centre above the apex", 0.0, 2.0)] = 0.25  # column up, assumption


class Head(NamedTuple):
    """Stiffness, damping and inertia about the ball's centre."""

    stiffness: Annotated[Axes, Real("N.m/rad", "elastic stiffness about the ball", 1.0, 1e7, None, 1e3)] = Axes(
        1500.0, 2500.0, 2500.0
    )  # a ball head has 1e3 to 4e3 (judgement); softer in yaw, where it pans (assumption)
    damping_ratio: Annotated[Axes, Real("1", "of the gimbal on the ball, rigid at zero angles", 0.0, 2.0)] = Axes(
        0.02, 0.02, 0.02
    )  # as the tripod's, assumption
    inertia: Annotated[
        Axes, Real("kg.m2", "of what lies between ball and yaw joint, its centre in the ball", 1e-6, 100.0, None, 2e-3)
    ] = Axes(4e-3, 2.7e-3, 2.7e-3)  # plate, battery and stator of 1.25 kg within 80 mm, assumption
    height: Annotated[float, Real("m", "gimbal's axes above the ball's centre", 0.0, 2.0)] = 0.15  # assumption


class Mount(NamedTuple):
    """The constants of an elastic mount."""

    stiffness: Annotated[Axes, Real("N.m/rad", "elastic stiffness")]
    damping: Annotated[Axes, Real("N.m.s/rad", "damping")]
    inertia: Annotated[Vector3, Real("kg.m2", "moments of inertia about x, y, z")]
    height: Annotated[float, Real("m", "of what it carries above it")]


def carried_inertia(bodies: tuple[BodyAboutO, ...], height: Scalar) -> Axes:
    """Moments of inertia (kg.m2) of the gimbal at zero angles about a point `height` (m) below O."""
    tilt = sum(height * (2.0 * body.moment[2] + body.mass * height) for body in bodies)
    return Axes(
        sum(body.inertia[2] for body in bodies),
        sum(body.inertia[0] for body in bodies) + tilt,
        sum(body.inertia[1] for body in bodies) + tilt,
    )


def mount(part: Tripod | Head, load: Axes) -> Mount:
    """C = 2 zeta sqrt(k I) with I of the part and of its load (kg.m2)."""
    damping = [
        2.0 * ratio * sqrt(stiffness * (inertia + carried))
        for ratio, stiffness, inertia, carried in zip(
            part.damping_ratio, part.stiffness, part.inertia, load, strict=True
        )
    ]
    yaw, pitch, roll = part.inertia
    return Mount(part.stiffness, Axes(*damping), (pitch, roll, yaw), part.height)


def _gibbs(deflection: Axes) -> Vector3:
    """g = e/2 about x, y and z."""
    yaw, pitch, roll = deflection
    return 0.5 * pitch, 0.5 * roll, -0.5 * yaw


def attitude(deflection: Axes) -> Matrix3:
    """Child to parent: ((1 - g'g) I + 2 g g' + 2 [g x]) / (1 + g'g)."""
    x, y, z = _gibbs(deflection)
    xx, yy, zz = x * x, y * y, z * z
    share = 1.0 / (1.0 + xx + yy + zz)
    twice = 2.0 * share
    xy, xz, yz = twice * x * y, twice * x * z, twice * y * z
    x, y, z = twice * x, twice * y, twice * z
    return (
        (share * (1.0 + xx - yy - zz), xy - z, xz + y),
        (xy + z, share * (1.0 - xx + yy - zz), yz - x),
        (xz - y, yz + x, share * (1.0 - xx - yy + zz)),
    )


def attitude_quaternion(deflection: Axes) -> Quaternion:
    """Child to parent: (1, g) / sqrt(1 + g'g)."""
    x, y, z = _gibbs(deflection)
    share = 1.0 / sqrt(1.0 + x * x + y * y + z * z)
    return share, share * x, share * y, share * z


def mount_motion(constants: Mount, deflection: Axes, w: Vector3) -> tuple[Axes, Vector3]:
    """Rates of the elastic angles, elastic and damping torque on the child, in its axes: e' = B w, -B' (k e + c e').

    B v = v + g x v + g (g'v);  w: the child's rate against the parent, in the child's axes, rad/s.
    """
    k, c, g = constants.stiffness, constants.damping, _gibbs(deflection)
    x, y, z = g
    turned, along = cross(g, w), dot(g, w)
    rates = Axes(-w[2] - turned[2] - z * along, w[0] + turned[0] + x * along, w[1] + turned[1] + y * along)
    pull = (
        -k[1] * deflection[1] - c[1] * rates[1],
        -k[2] * deflection[2] - c[2] * rates[2],
        k[0] * deflection[0] + c[0] * rates[0],
    )
    turned, along = cross(pull, g), dot(g, pull)
    return rates, (
        pull[0] + turned[0] + x * along,
        pull[1] + turned[1] + y * along,
        pull[2] + turned[2] + z * along,
    )


def elastic_energy(constants: Mount, deflection: Axes) -> Scalar:
    """V = sum k e^2 / 2, J."""
    k, e = constants.stiffness, deflection
    return 0.5 * (k[0] * e[0] * e[0] + k[1] * e[1] * e[1] + k[2] * e[2] * e[2])
