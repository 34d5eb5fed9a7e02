"""The controller of a three-axis gimbal: joints held, or line of sight stabilised from an attitude sensor.

    stabilise:  w_c = 2 pi f_a E(euler) (target - euler),   T = J G(joint) 2 pi f_r (w_c - w) + I
    hold:       T = J ((2 pi f)^2 (target - joint) - 2 zeta 2 pi f joint') + I

E turns differences of Euler angles into body axes, G turns body axes into joint axes. w is the camera's rate: its fast
part from the encoders, its slow part from the gyros (`blended_rate`), whose delay would else bound the crossover.
One integral per joint, in N.m, serves both loops, so that a change from one to the other is bumpless; it stops where
the torque limit binds. The target of stabilisation is the attitude at the moment of engagement plus the setpoint.

Default gains are for the default `TripodGimbal` and a gyro path of 9 ms.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from .attitude.rotations import Euler
from .plants.gimbal import NO_AXES, Axes
from .record import Boolean, Enumeration, Integer, Item, Real, Vector3, choose
from .scalar import PI, Scalar, absolute, both, clip, cos, either, exp, maximum, sin, where, wrap
from .system import Clock, Model, Task
from .vectors import ZERO3, add, subtract

_LEVEL = Euler(0.0, 0.0, 0.0)
_LEAST_COSINE = 0.1
"""Of the pitch joint: beyond 84 deg the yaw joint is no longer asked for more, where the axes align."""

MODE = Enumeration(
    "GimbalMode",
    (
        Item("off", "no torque"),
        Item("hold_joints", "joints held at their first angles plus the setpoint: an unstabilised head"),
        Item("stabilise", "attitude held as soon as it is valid, joints until then"),
    ),
    "what the gimbal does",
)

STATUS = Enumeration(
    "GimbalStatus",
    (
        Item("off", "no torque"),
        Item("joints_held", "joints held"),
        Item("attitude_held", "attitude held"),
    ),
    "what the gimbal is doing",
)


class Hold(NamedTuple):
    """PD and slow integral on the joint encoders."""

    frequency: Annotated[float, Real("Hz", "natural frequency of the held joint", 0.0, 100.0, tunable=True)] = 12.0
    damping_ratio: Annotated[float, Real("1", "of the held joint", 0.0, 10.0, tunable=True)] = 1.0
    integral: Annotated[float, Real("Hz", "frequency below which the integral acts", 0.0, 10.0, tunable=True)] = 0.5


class Stabilise(NamedTuple):
    """P on the attitude, PI on the body rate."""

    rate_bandwidth: Annotated[
        float, Real("Hz", "gain of the rate loop: its crossover with the encoders alone", 0.0, 200.0, tunable=True)
    ] = 30.0  # with the gyros' late share 12 to 15 Hz
    integral: Annotated[
        float, Real("Hz", "frequency below which the rate loop's integral acts", 0.0, 50.0, tunable=True)
    ] = 3.0
    attitude_bandwidth: Annotated[float, Real("Hz", "crossover of the attitude loop", 0.0, 50.0, tunable=True)] = 2.0
    rate_limit: Annotated[
        float, Real("rad/s", "largest rate asked for, on each body axis", 0.0, 20.0, "deg/s", tunable=True)
    ] = 1.0
    blend: Annotated[
        Axes,
        Real("Hz", "below it the gyros tell the rate, above it the encoders; 0: gyros alone", 0.0, 500.0, tunable=True),
    ] = Axes(5.0, 15.0, 15.0)


class Parameters(NamedTuple):
    """What the gimbal does, its inertias and its loops."""

    mode: Annotated[int, MODE] = MODE.value("stabilise")
    period: Annotated[float, Real("s", "of the controller's clock", 1e-4, 0.1, nominal=1e-3)] = 1e-3
    inertia: Annotated[Axes, Real("kg.m2", "what the joint turns", 1e-6, 10.0, nominal=0.01, tunable=True)] = Axes(
        0.0079, 0.0056, 0.0023
    )  # of the default TripodGimbal
    torque_limit: Annotated[Axes, Real("N.m", "of the motor", 0.0, 100.0, nominal=0.5, tunable=True)] = Axes(
        0.5, 0.5, 0.5
    )  # small gimbal motor, assumption
    hold: Hold = Hold()
    stabilise: Stabilise = Stabilise()


class Coefficients(NamedTuple):
    """Clock and low-pass."""

    period: Annotated[float, Real("s", "of the controller's clock")]
    blend: Annotated[Vector3, Real("1", "share of a new sample in the base rate, 1 - exp(-2 pi f T); 1: all")]


class Inputs(NamedTuple):
    """Sensor, encoders and operator."""

    euler: Euler = _LEVEL
    rate: Annotated[Vector3, Real("rad/s", "measured w_ib_b", display="deg/s")] = ZERO3
    attitude_valid: Annotated[bool, Boolean("the attitude is worth holding")] = False
    joint: Annotated[Axes, Real("rad", "joint angle", display="deg")] = NO_AXES
    joint_rate: Annotated[Axes, Real("rad/s", "joint rate", display="deg/s")] = NO_AXES
    setpoint: Annotated[Axes, Real("rad", "added to the attitude or joint angle held", display="deg")] = NO_AXES


class State(NamedTuple):
    """What is held, and what the loops remember."""

    ticks: Annotated[float, Real("1", "controller steps so far")] = 0.0
    engaged: Annotated[float, Integer("1 while the attitude is held", 0, 1)] = 0.0
    held_attitude: Euler = _LEVEL
    held_joint: Annotated[Axes, Real("rad", "joint angle", display="deg")] = NO_AXES
    base_rate: Annotated[Vector3, Real("rad/s", "tripod's rate in camera axes, low-pass", display="deg/s")] = ZERO3
    integral: Annotated[Axes, Real("N.m", "integral of each joint")] = NO_AXES
    torque: Annotated[Axes, Real("N.m", "motor torque")] = NO_AXES
    saturated: Annotated[float, Boolean("a motor is at its limit")] = 0.0


class Outputs(NamedTuple):
    """Torques and what the controller is doing."""

    motor_torque: Annotated[Axes, Real("N.m", "on the joint; + turns its angle up", nominal=0.1)]
    status: Annotated[int, STATUS]
    saturated: Annotated[bool, Boolean("a motor is at its limit")]


def coefficients(p: Parameters) -> Coefficients:
    """1 - exp(-2 pi f T), 1 for f = 0."""
    yaw, pitch, roll = [where(f > 0.0, 1.0 - exp(-2.0 * PI * f * p.period), 1.0) for f in p.stabilise.blend]
    return Coefficients(p.period, (pitch, roll, yaw))


def initial_state(_p: Parameters, _c: Coefficients, _inputs: Inputs) -> State:
    """Nothing held yet: the first tick takes the joint angles, when the inputs are sure to be there."""
    return State()


def body_from_euler(difference: Axes, euler: Euler | Axes) -> Vector3:
    """E: a small difference of Euler angles as a rotation vector in b.

    (cg dp + sg cp dy, dr - sp dy, sg dp - cg cp dy), the kinematics of C_nb = Rz(-y) Rx(p) Ry(r).
    """
    dy, dp, dr = difference
    sp, cp = sin(euler[1]), cos(euler[1])
    sg, cg = sin(euler[2]), cos(euler[2])
    return cg * dp + sg * cp * dy, dr - sp * dy, sg * dp - cg * cp * dy


def joint_from_body(v_b: Vector3, joint: Axes) -> Axes:
    """G, the inverse of E for the joint angles; short of 90 deg of pitch."""
    x, y, z = v_b
    sp, cp = sin(joint[1]), cos(joint[1])
    sg, cg = sin(joint[2]), cos(joint[2])
    yaw = (sg * x - cg * z) / maximum(cp, _LEAST_COSINE)
    return Axes(yaw, cg * x + sg * z, y + sp * yaw)


def blended_rate(state: State, inputs: Inputs, c: Coefficients) -> tuple[Vector3, Vector3]:
    """w = w_r + base, base = low-pass(gyro - w_r), with w_r the joints' rate in b.

    What the gyros tell too late at the loop's crossover, the encoders tell at once; what the encoders cannot tell,
    the tripod's own motion, is left to the gyros.
    """
    relative = body_from_euler(inputs.joint_rate, inputs.joint)
    tripod = subtract(inputs.rate, relative)
    first = state.ticks < 0.5
    base = [
        where(first, new, old + share * (new - old))
        for new, old, share in zip(tripod, state.base_rate, c.blend, strict=True)
    ]
    low = (base[0], base[1], base[2])
    return add(relative, low), low


class Demand(NamedTuple):
    """Proportional torque (N.m) and rate of the integral (N.m/s) of each joint."""

    proportional: Axes
    integral_rate: Axes


def hold_demand(inputs: Inputs, target: Axes, p: Parameters) -> Demand:
    """PD on the joint angles, and what the integral gathers."""
    w = 2.0 * PI * p.hold.frequency
    damping, slow = 2.0 * p.hold.damping_ratio * w, 2.0 * PI * p.hold.integral
    parts = []
    for inertia, wanted, angle, rate in zip(p.inertia, target, inputs.joint, inputs.joint_rate, strict=True):
        spring = inertia * w * w * (wanted - angle)
        parts.append((spring - inertia * damping * rate, slow * spring))
    return Demand(Axes(*[part[0] for part in parts]), Axes(*[part[1] for part in parts]))


def stabilise_demand(inputs: Inputs, rate: Vector3, target: Axes, p: Parameters) -> Demand:
    """P on the attitude asks for a body rate, PI on the body rate asks for joint torques."""
    gains, (x, y, z), euler = p.stabilise, rate, inputs.euler
    difference = Axes(
        wrap(target[0] - euler[0]),
        target[1] - euler[1],
        wrap(target[2] - euler[2]),
    )
    error, fast, limit = body_from_euler(difference, euler), 2.0 * PI * gains.attitude_bandwidth, gains.rate_limit
    missing = (
        clip(fast * error[0], -limit, limit) - x,
        clip(fast * error[1], -limit, limit) - y,
        clip(fast * error[2], -limit, limit) - z,
    )
    crossover, slow = 2.0 * PI * gains.rate_bandwidth, 2.0 * PI * gains.integral
    wanted = joint_from_body(missing, inputs.joint)
    torque = [inertia * crossover * rate for inertia, rate in zip(p.inertia, wanted, strict=True)]
    return Demand(Axes(*torque), Axes(*[slow * t for t in torque]))


def _limited(proportional: Scalar, integral: Scalar, gained: Scalar, limit: Scalar) -> tuple[Scalar, Scalar]:
    """Torque within the limit, and the integral, which does not grow where that would only press on the limit."""
    total = proportional + integral + gained
    pressing = both(absolute(total) > limit, gained * total > 0.0)
    kept = clip(where(pressing, integral, integral + gained), -limit, limit)
    return clip(proportional + kept, -limit, limit), kept


def _driven(state: State, demand: Demand, integral: Axes, p: Parameters) -> State:
    """The state with the torques of a demand."""
    pairs = [
        _limited(demand.proportional[i], integral[i], p.period * demand.integral_rate[i], p.torque_limit[i])
        for i in range(3)
    ]
    full = [absolute(torque) >= limit for (torque, _), limit in zip(pairs, p.torque_limit, strict=True)]
    return state._replace(
        ticks=state.ticks + 1.0,
        torque=Axes(*[torque for torque, _ in pairs]),
        integral=Axes(*[kept for _, kept in pairs]),
        saturated=where(either(either(full[0], full[1]), full[2]), 1.0, 0.0),
    )


def _sum(a: Axes | Euler, b: Axes) -> Axes:
    return Axes(a[0] + b[0], a[1] + b[1], a[2] + b[2])


def rest(state: State, _inputs: Inputs, _p: Parameters, _c: Coefficients, _normals: tuple[Scalar, ...]) -> State:
    """No torque."""
    return state._replace(ticks=state.ticks + 1.0)


def hold_joints(state: State, inputs: Inputs, p: Parameters, _c: Coefficients, _n: tuple[Scalar, ...]) -> State:
    """Joints at their first angles plus the setpoint."""
    held = choose(state.ticks < 0.5, inputs.joint, state.held_joint)
    demand = hold_demand(inputs, _sum(held, inputs.setpoint), p)
    return _driven(state._replace(held_joint=held), demand, state.integral, p)


def stabilise(state: State, inputs: Inputs, p: Parameters, c: Coefficients, _n: tuple[Scalar, ...]) -> State:
    """Attitude held while it is valid, joints held before and between."""
    valid, was = inputs.attitude_valid > 0.5, state.engaged > 0.5
    engaging = both(valid, state.engaged < 0.5)
    leaving = both(inputs.attitude_valid < 0.5, either(was, state.ticks < 0.5))
    attitude = choose(engaging, inputs.euler, state.held_attitude)
    joint = choose(leaving, inputs.joint, state.held_joint)
    rate, base = blended_rate(state, inputs, c)
    steady = stabilise_demand(inputs, rate, _sum(attitude, inputs.setpoint), p)
    held = hold_demand(inputs, joint, p)
    demand = choose(valid, steady, held)
    # at a change of loops the integral takes the torque's jump upon itself
    changing = either(engaging, both(leaving, was))
    jump = Axes(*[t - d for t, d in zip(state.torque, demand.proportional, strict=True)])
    after = state._replace(engaged=where(valid, 1.0, 0.0), held_attitude=attitude, held_joint=joint, base_rate=base)
    return _driven(after, demand, choose(changing, jump, state.integral), p)


def outputs(state: State, p: Parameters, _c: Coefficients) -> Outputs:
    """The torques of the last tick."""
    return Outputs(
        motor_torque=state.torque,
        status=where(
            state.engaged > 0.5,
            STATUS.value("attitude_held"),
            where(p.mode == MODE.value("off"), STATUS.value("off"), STATUS.value("joints_held")),
        ),
        saturated=state.saturated > 0.5,
    )


MODEL = Model(
    name="GimbalController",
    description="Controller of a three-axis gimbal: joints held or line of sight stabilised",
    Parameters=Parameters,
    Coefficients=Coefficients,
    Inputs=Inputs,
    State=State,
    Outputs=Outputs,
    coefficients=coefficients,
    initial_state=initial_state,
    outputs=outputs,
    clocks=(Clock("controller", lambda c: c.period),),
    tasks=(
        Task(
            "control",
            "controller",
            {
                MODE.value("off"): rest,
                MODE.value("hold_joints"): hold_joints,
                MODE.value("stabilise"): stabilise,
            },
            choice=lambda p: p.mode,
        ),
    ),
    seed=lambda _p: 0,
)
