"""What holds a joint besides its motor and friction: the cables through it, and its end stops.

    cable:  T = -k (angle - neutral) - c w
    stop:   T = -k d max(0, 1 + chi d'),   d: depth of the angle in the stop, d' its rate

The stop (Hunt & Crossley 1975) pushes only, grows from zero at touch, and gives back less than it took, never more.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Real
from ..scalar import PI, Scalar, maximum
from .friction import LuGre, friction_torque
from .motor import cogging_energy, cogging_torque


class Cable(NamedTuple):
    """Cables through a joint: 1 to 20 mN.m/rad (judgement), and a little damping (assumption)."""

    stiffness: Annotated[float, Real("N.m/rad", "torque per turn", 0.0, 10.0, None, 0.01)] = 5e-3
    damping: Annotated[float, Real("N.m.s/rad", "torque per rate", 0.0, 10.0, None, 1e-4)] = 1e-4
    neutral: Annotated[float, Real("rad", "joint angle at which it pulls to neither side", -10.0, 10.0, "deg")] = 0.0


class EndStop(NamedTuple):
    """Rubber bumpers at both ends of a joint's travel; stiffness and loss are assumptions."""

    lower: Annotated[float, Real("rad", "joint angle at the lower stop", -100.0, 0.0, "deg")] = -170.0 / 180.0 * PI
    upper: Annotated[float, Real("rad", "joint angle at the upper stop", 0.0, 100.0, "deg")] = 170.0 / 180.0 * PI
    stiffness: Annotated[float, Real("N.m/rad", "of the stops; 0: the joint turns freely", 0.0, 1e6)] = 100.0
    loss: Annotated[float, Real("s/rad", "chi; at 1 rad/s the rebound is slower by about 2/3 of it", 0.0, 10.0)] = 0.2


class JointParts(NamedTuple):
    """What acts on a joint by itself."""

    friction: LuGre
    cable: Cable
    stop: EndStop
    cogging: Scalar  # N.m
    positions: Scalar  # of the cogging, in a turn


def _push(stop: EndStop, depth: Scalar, rate: Scalar) -> Scalar:
    return stop.stiffness * maximum(depth, 0.0) * maximum(1.0 + stop.loss * rate, 0.0)


def stop_torque(stop: EndStop, angle: Scalar, rate: Scalar) -> Scalar:
    """Torque of both stops on the joint, N.m."""
    return _push(stop, stop.lower - angle, -rate) - _push(stop, angle - stop.upper, rate)


def joint_torque(parts: JointParts, bristle: Scalar, angle: Scalar, rate: Scalar) -> Scalar:
    """Sum of cable, stops, cogging and friction, N.m."""
    cable = parts.cable
    return (
        cogging_torque(parts.cogging, parts.positions, angle)
        - cable.stiffness * (angle - cable.neutral)
        - cable.damping * rate
        + stop_torque(parts.stop, angle, rate)
        - friction_torque(parts.friction, bristle, rate)
    )


def joint_energy(parts: JointParts, angle: Scalar) -> Scalar:
    """What cable, stops and cogging hold, J."""
    cable, stop = parts.cable, parts.stop
    turned = angle - cable.neutral
    above, below = maximum(angle - stop.upper, 0.0), maximum(stop.lower - angle, 0.0)
    sprung = cable.stiffness * turned * turned + stop.stiffness * (above * above + below * below)
    return 0.5 * sprung + cogging_energy(parts.cogging, parts.positions, angle)
