"""The plant: a camera on a three-axis gimbal on a flexible tripod, in wind, with its shutter and knocks.

    M(q) u' + h(q, u) = tau,   u = (w_nt_t, yaw rate, pitch rate, roll rate)

Six degrees of freedom: the tripod's head turns elastically about the apex P, the gimbal's three joints about the
point O above it. Motor torques act between the bodies, so that their reactions and the imbalance reach the tripod.
The mechanics are integrated by RK4; the friction's bristles, which are stiff at high rates, by their exact solution
half a step before and half a step after (Strang splitting).
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Annotated, NamedTuple

from .attitude.rotations import (
    REFERENCE_LATITUDE,
    STANDARD_GRAVITY,
    Euler,
    earth_rate_n,
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_turns,
    normalised,
    quaternion_from_euler,
    quaternion_product,
    turns_of,
)
from .plants.friction import Friction, LuGre, bristle_after, friction_torque, lugre
from .plants.gimbal import (
    NO_AXES,
    Axes,
    Body,
    BodyAboutO,
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
from .plants.linear_equations import solve_symmetric
from .plants.pulses import Knock, Shutter, knock_share, shutter_length, shutter_shares
from .plants.tripod import Mount, Tripod, elastic_energy, mount, mount_motion
from .plants.wind import Wind, WindCoefficients, WindState, wind_after, wind_coefficients, wind_now
from .record import Integer, Matrix3, Quaternion, Real, Vector3
from .scalar import PI, Scalar, floor, maximum, round_half_up, sqrt, where
from .system import Clock, Model, Rule, Task
from .vectors import ZERO3, add, cross, matrix_product, multiply_transposed, scale, subtract

# The bodies are sized after a mirrorless camera of 0.7 kg with a lens of 0.5 kg in a small gimbal: uniform boxes and
# rings, with centres of gravity as far out as a careful user balances them (0.3 to 0.5 mm). All engineering judgement.
_YAW_FRAME = Body(0.35, (0.0002, 0.0003, -0.06), (1.5e-3, 1.2e-3, 1.0e-3))
_PITCH_FRAME = Body(0.25, (0.0002, -0.0002, 0.0002), (1.0e-3, 0.8e-3, 1.2e-3))
_CAMERA = Body(1.2, (0.0003, 0.0005, -0.0005), (4.6e-3, 2.3e-3, 5.7e-3), (1.0e-4, 0.5e-4, 2.0e-4))


class JointFriction(NamedTuple):
    """LuGre friction of each joint."""

    yaw: Friction = Friction()
    pitch: Friction = Friction()
    roll: Friction = Friction()


class Initial(NamedTuple):
    """Where the run starts: at rest, the tripod sunk into its equilibrium."""

    heading: Annotated[float, Real("rad", "of the tripod, clockwise from north", -10.0, 10.0, "deg")] = 0.0
    joint: Annotated[Axes, Real("rad", "joint angle", -4.0, 4.0, "deg")] = NO_AXES
    joint_rate: Annotated[Axes, Real("rad/s", "joint rate", -20.0, 20.0, "deg/s")] = NO_AXES


class Parameters(NamedTuple):
    """Bodies, springs, friction and disturbances. A magnitude of 0 switches a disturbance off."""

    yaw_frame: Body = _YAW_FRAME
    pitch_frame: Body = _PITCH_FRAME
    camera: Body = _CAMERA
    tripod: Tripod = Tripod()
    friction: JointFriction = JointFriction()
    wind: Wind = Wind()
    shutter: Shutter = Shutter()
    knock: Knock = Knock()
    initial: Initial = Initial()
    sensor_position: Annotated[Vector3, Real("m", "sensor from O, in camera axes", -1.0, 1.0, None, 0.01)] = (
        0.02,
        -0.03,
        0.04,
    )  # on the camera's plate, assumption
    ambient_temperature: Annotated[float, Real("K", "of the air", 200.0, 450.0, "degC", 300.0)] = 293.15
    latitude: Annotated[float, Real("rad", "geodetic, north positive", -PI / 2.0, PI / 2.0, "deg")] = REFERENCE_LATITUDE
    gravity: Annotated[float, Real("m/s2", "gravity where the tripod stands", 0.0, 30.0)] = STANDARD_GRAVITY
    solver_period: Annotated[float, Real("s", "step of the integration", 1e-6, 0.01, None, 1e-3)] = 1e-3
    seed: Annotated[int, Integer("key of all noise", 0, 2**31 - 1)] = 1


class Coefficients(NamedTuple):
    """What the equations need, worked out once."""

    solver_period: Annotated[float, Real("s", "step of the integration")]
    height: Annotated[float, Real("m", "O above P")]
    bodies: tuple[BodyAboutO, BodyAboutO, BodyAboutO]
    mount: Mount
    friction: tuple[LuGre, LuGre, LuGre]
    wind: WindCoefficients


class Inputs(NamedTuple):
    """What the drives do."""

    motor_torque: Annotated[Axes, Real("N.m", "on the joint; + turns its angle up", -100.0, 100.0, None, 0.1)] = NO_AXES


class State(NamedTuple):
    """All that evolves."""

    ticks: Annotated[float, Real("1", "solver steps so far")]
    deflection: Annotated[Axes, Real("rad", "elastic angle of the tripod", display="deg")]
    joint: Annotated[Axes, Real("rad", "joint angle", display="deg")]
    head_rate: Annotated[Vector3, Real("rad/s", "w_nt_t", display="deg/s")]
    joint_rate: Annotated[Axes, Real("rad/s", "joint rate", display="deg/s")]
    head_acceleration: Annotated[Vector3, Real("rad/s2", "derivative of w_nt_t")]
    joint_acceleration: Annotated[Axes, Real("rad/s2", "joint acceleration")]
    bristle: Annotated[Axes, Real("rad", "deflection of the friction's bristles", display="deg")]
    curtains: Annotated[float, Real("1", "momentum in the shutter's curtains, share of the impulse")]
    mirror: Annotated[float, Real("1", "momentum in the mirror, share of the impulse")]
    knocks: Annotated[float, Real("1", "blows taken")]
    wind: WindState


class Outputs(NamedTuple):
    """The camera's true motion, as sensors on it would feel it, and the encoders' truth."""

    euler: Euler
    quaternion: Annotated[Quaternion, Real("1", "q_nb, scalar first")]
    rate: Annotated[Vector3, Real("rad/s", "w_ib_b, with the Earth's", display="deg/s")]
    angular_acceleration: Annotated[Vector3, Real("rad/s2", "derivative of w_ib_b")]
    specific_force: Annotated[Vector3, Real("m/s2", "f_b at the sensor; +g upward at rest", nominal=10.0)]
    temperature: Annotated[float, Real("K", "of the air", display="degC", nominal=300.0)]
    joint: Annotated[Axes, Real("rad", "joint angle", display="deg")]
    joint_rate: Annotated[Axes, Real("rad/s", "joint rate", display="deg/s")]
    tripod_deflection: Annotated[Axes, Real("rad", "elastic angle of the tripod", display="deg")]
    wind_speed: Annotated[float, Real("m/s", "at the camera")]


Motion = tuple[Scalar, ...]
"""Elastic angles (3), joint angles (3), w_nt_t (3), joint rates (3), in one tuple for the integrator."""


class Drives(NamedTuple):
    """Torques and forces held over a solver step."""

    motor: Axes
    bristle: Axes
    on_head: Vector3
    on_camera: Vector3
    wind_force: Vector3


def coefficients(p: Parameters) -> Coefficients:
    """Bodies about O, the mount's damping, friction constants and the wind's discrete filters."""
    bodies = (about_o(p.yaw_frame), about_o(p.pitch_frame), about_o(p.camera))
    outer, middle, inner = bodies
    turned = (
        outer.inertia[2] + middle.inertia[2] + inner.inertia[2],
        middle.inertia[0] + inner.inertia[0],
        inner.inertia[1],
    )
    every = maximum(round_half_up(p.wind.period / p.solver_period), 1.0)
    return Coefficients(
        solver_period=p.solver_period,
        height=p.tripod.height,
        bodies=bodies,
        mount=mount(p.tripod, bodies),
        friction=(
            lugre(p.friction.yaw, turned[0]),
            lugre(p.friction.pitch, turned[1]),
            lugre(p.friction.roll, turned[2]),
        ),
        wind=wind_coefficients(p.wind, p.solver_period, every),
    )


def _motion_rate(motion: Motion, drives: Drives, c: Coefficients, gravity: Scalar, center: Vector3) -> Motion:
    """Derivative of the motion: elastic rates, joint rates, and u' of M(q) u' = tau - h(q, u)."""
    yaw, pitch, roll, joint_yaw, joint_pitch, joint_roll, wx, wy, wz, *rest = motion
    w, rates = (wx, wy, wz), Axes(*rest)
    bodies, height, (ix, iy, iz) = c.bodies, c.height, c.mount.inertia
    turns = turns_of(Axes(joint_yaw, joint_pitch, joint_roll))
    elastic_rates, elastic, up = mount_motion(c.mount, Axes(yaw, pitch, roll), w)
    spin = -height * (wx * wx + wy * wy)
    felt = (wx * wz * height + gravity * up[0], wy * wz * height + gravity * up[1], spin + gravity * up[2])
    wind = to_camera(turns, drives.wind_force)
    outside = Wrench(wind, add(cross(center, wind), drives.on_camera))
    wanted, (force, moment) = inverse_dynamics(
        bodies, turns, HeadMotion(w, ZERO3, felt), JointMotion(rates, NO_AXES), outside
    )
    motor, bristle, friction, on_head = drives.motor, drives.bristle, c.friction, drives.on_head
    torques = (
        elastic[0] + on_head[0] - moment[0] + height * force[1] - (iz - iy) * wy * wz,
        elastic[1] + on_head[1] - moment[1] - height * force[0] - (ix - iz) * wz * wx,
        elastic[2] + on_head[2] - moment[2] - (iy - ix) * wx * wy,
        motor[0] - friction_torque(friction[0], bristle[0], rates[0]) - wanted[0],
        motor[1] - friction_torque(friction[1], bristle[1], rates[1]) - wanted[1],
        motor[2] - friction_torque(friction[2], bristle[2], rates[2]) - wanted[2],
    )
    return (*elastic_rates, *rates, *solve_symmetric(mass_matrix(bodies, turns, height, c.mount.inertia), torques))


def _moved(motion: Motion, step: Scalar, rate: Motion) -> Motion:
    return tuple([x + step * r for x, r in zip(motion, rate, strict=True)])


def _rk4(motion: Motion, drives: Drives, c: Coefficients, gravity: Scalar, center: Vector3) -> Motion:
    h = c.solver_period
    half, sixth = 0.5 * h, h / 6.0
    k1 = _motion_rate(motion, drives, c, gravity, center)
    k2 = _motion_rate(_moved(motion, half, k1), drives, c, gravity, center)
    k3 = _motion_rate(_moved(motion, half, k2), drives, c, gravity, center)
    k4 = _motion_rate(_moved(motion, h, k3), drives, c, gravity, center)
    return tuple(
        [x + sixth * (r1 + 2.0 * (r2 + r3) + r4) for x, r1, r2, r3, r4 in zip(motion, k1, k2, k3, k4, strict=True)]
    )


def _about(axes: Axes) -> Vector3:
    """A torque given by axes (yaw about -z, pitch about x, roll about y) as a vector."""
    return axes[1], axes[2], -axes[0]


def _bristles(c: Coefficients, bristle: Axes, rates: Motion) -> Axes:
    half, friction = 0.5 * c.solver_period, c.friction
    return Axes(
        bristle_after(friction[0], bristle[0], rates[0], half),
        bristle_after(friction[1], bristle[1], rates[1], half),
        bristle_after(friction[2], bristle[2], rates[2], half),
    )


def _wind_force(state_wind: WindState, deflection: Axes, p: Parameters, c: Coefficients, share: Scalar) -> Vector3:
    """Wind force on the camera in t."""
    force_n, _ = wind_now(p.wind, c.wind, state_wind, share)
    return multiply_transposed(_head_attitude(deflection, p), force_n)


def _head_euler(deflection: Axes, p: Parameters) -> Euler:
    """The head's yaw, pitch and roll against n."""
    return Euler(p.initial.heading + deflection[0], deflection[1], deflection[2])


def _head_attitude(deflection: Axes, p: Parameters) -> Matrix3:
    """C_nt."""
    return matrix_from_euler(_head_euler(deflection, p))


def _wind_share(state: State, c: Coefficients, steps: Scalar) -> Scalar:
    """How far between two wind ticks the time `steps` solver steps after the last one lies, 0 to 1."""
    ticks, every = state.ticks, c.wind.every
    return (ticks - every * floor(ticks / every) + steps) / every


def integrate(state: State, inputs: Inputs, p: Parameters, c: Coefficients, _normals: tuple[Scalar, ...]) -> State:
    """One solver step: half a step of the bristles, RK4 of the mechanics, half a step of the bristles.

    Torques of motors, pulses and wind are held over the step; those of pulses and wind are its means.
    """
    h = c.solver_period
    ticks = state.ticks + 1.0
    time = ticks * h
    curtains, mirror = shutter_shares(p.shutter, time)
    knocks = knock_share(p.knock, time)
    pulse = [
        (a * (curtains - state.curtains) + b * (mirror - state.mirror)) / h
        for a, b in zip(p.shutter.impulse, p.shutter.mirror_impulse, strict=True)
    ]
    blow = scale((knocks - state.knocks) / h, _about(p.knock.impulse))
    before = _bristles(c, state.bristle, state.joint_rate)
    drives = Drives(
        motor=inputs.motor_torque,
        bristle=before,
        on_head=blow,
        on_camera=_about(Axes(*pulse)),
        wind_force=_wind_force(state.wind, state.deflection, p, c, _wind_share(state, c, 0.5)),
    )
    start = (*state.deflection, *state.joint, *state.head_rate, *state.joint_rate)
    end = _rk4(start, drives, c, p.gravity, p.wind.center_of_pressure)
    after = _bristles(c, before, end[9:12])
    rate = _motion_rate(end, drives._replace(bristle=after), c, p.gravity, p.wind.center_of_pressure)
    return State(
        ticks=ticks,
        deflection=Axes(*end[0:3]),
        joint=Axes(*end[3:6]),
        head_rate=end[6:9],
        joint_rate=Axes(*end[9:12]),
        head_acceleration=rate[6:9],
        joint_acceleration=Axes(*rate[9:12]),
        bristle=after,
        curtains=curtains,
        mirror=mirror,
        knocks=knocks,
        wind=state.wind,
    )


def blow_on(state: State, _inputs: Inputs, _p: Parameters, c: Coefficients, normals: tuple[Scalar, ...]) -> State:
    """The next gusts and vortices."""
    return state._replace(wind=wind_after(state.wind, c.wind, normals))


def _equilibrium(drives: Drives, p: Parameters, c: Coefficients) -> Axes:
    """Elastic angles at rest with locked joints: e <- e + (k e - wanted torque) / k, four times.

    Each turn gains a factor of stiffness over gravity's tilting moment, a thousand for a usable tripod.
    """
    k = c.mount.stiffness
    turns = turns_of(p.initial.joint)
    force_b = to_camera(turns, drives.wind_force)
    outside = Wrench(force_b, cross(p.wind.center_of_pressure, force_b))
    still = JointMotion(NO_AXES, NO_AXES)
    e = NO_AXES
    for _ in range(4):
        _, elastic, up = mount_motion(c.mount, e, ZERO3)
        head = HeadMotion(ZERO3, ZERO3, scale(p.gravity, up))
        _, (force, moment) = inverse_dynamics(c.bodies, turns, head, still, outside)
        about_p = add(moment, (-c.height * force[1], c.height * force[0], 0.0))
        left = subtract(elastic, about_p)
        e = Axes(e.yaw - left[2] / k.yaw, e.pitch + left[0] / k.pitch, e.roll + left[1] / k.roll)
    return e


def initial_state(p: Parameters, c: Coefficients, inputs: Inputs) -> State:
    """The tripod at rest under gravity and mean wind, the joints where the parameters put them."""
    wind = WindState()
    drives = Drives(inputs.motor_torque, NO_AXES, ZERO3, ZERO3, _wind_force(wind, NO_AXES, p, c, 0.0))
    deflection = _equilibrium(drives, p, c)
    start = (*deflection, *p.initial.joint, *ZERO3, *p.initial.joint_rate)
    rate = _motion_rate(start, drives, c, p.gravity, p.wind.center_of_pressure)
    return State(
        ticks=0.0,
        deflection=deflection,
        joint=p.initial.joint,
        head_rate=ZERO3,
        joint_rate=p.initial.joint_rate,
        head_acceleration=rate[6:9],
        joint_acceleration=Axes(*rate[9:12]),
        bristle=NO_AXES,
        curtains=0.0,
        mirror=0.0,
        knocks=0.0,
        wind=wind,
    )


def outputs(state: State, p: Parameters, c: Coefficients) -> Outputs:
    """f_b = C_tb' (a_O + g up) + w' x r + w x (w x r);  w_ib_b = w_nb_b + C_nb' w_ie_n."""
    turns = turns_of(state.joint)
    c_nt = _head_attitude(state.deflection, p)
    c_nb = matrix_product(c_nt, matrix_from_turns(turns))
    joints = JointMotion(state.joint_rate, state.joint_acceleration)
    w, alpha = camera_rates(turns, state.head_rate, state.head_acceleration, joints)
    earth = multiply_transposed(c_nb, earth_rate_n(p.latitude))
    o = (0.0, 0.0, c.height)
    at_o = add(
        cross(state.head_acceleration, o),
        add(cross(state.head_rate, cross(state.head_rate, o)), scale(p.gravity, c_nt[2])),
    )
    r = p.sensor_position
    felt = add(to_camera(turns, at_o), add(cross(alpha, r), cross(w, cross(w, r))))
    _, speed = wind_now(p.wind, c.wind, state.wind, _wind_share(state, c, 0.0))
    head = quaternion_from_euler(_head_euler(state.deflection, p))
    joint = quaternion_from_euler(Euler(*state.joint))
    return Outputs(
        euler=euler_from_matrix(c_nb),
        quaternion=normalised(quaternion_product(head, joint)),
        rate=add(w, earth),
        angular_acceleration=subtract(alpha, cross(w, earth)),
        specific_force=felt,
        temperature=p.ambient_temperature,
        joint=state.joint,
        joint_rate=state.joint_rate,
        tripod_deflection=state.deflection,
        wind_speed=speed,
    )


def energy(state: State, p: Parameters, c: Coefficients) -> Scalar:
    """T + V of the mechanics, J: u'Mu/2, the mount's springs, and gravity from the apex up."""
    turns = turns_of(state.joint)
    m = mass_matrix(c.bodies, turns, c.height, c.mount.inertia)
    u = (*state.head_rate, *state.joint_rate)
    kinetic, k = 0.0, 0
    for i in range(6):
        for j in range(i + 1):
            kinetic = kinetic + (0.5 if i == j else 1.0) * m[k] * u[i] * u[j]
            k += 1
    x, y, z = first_moment(c.bodies, turns)
    up = _head_attitude(state.deflection, p)[2]
    mass = c.bodies[0].mass + c.bodies[1].mass + c.bodies[2].mass
    lifted = up[0] * x + up[1] * y + up[2] * (z + mass * c.height)
    return kinetic + elastic_energy(c.mount, state.deflection) + p.gravity * lifted


# --- values that must go together ------------------------------------------------------------------------------------

_MARGIN = 1e-9
"""Relative width of a limit: what is computed from decimal numbers may miss it by roundings."""


def _fastest(p: Parameters) -> Scalar:
    """Upper bound of the fastest rate of springs, bristles and dampers, 1/s: sqrt(k/J) + C/J.

    J is the inertia that each is sure to move.
    """
    c = coefficients(p)
    x, y, z = p.camera.inertia
    fastest: Scalar = 0.0
    for k, damping, inertia in zip(c.mount.stiffness, c.mount.damping, p.tripod.inertia, strict=True):
        fastest = maximum(fastest, sqrt(k / inertia) + damping / inertia)
    for friction, inertia in zip(c.friction, (z, x, y), strict=True):
        damping = friction.damping + friction.viscous
        fastest = maximum(fastest, sqrt(friction.stiffness / inertia) + damping / inertia)
    return fastest


def _tipping(p: Parameters) -> Scalar:
    """Stiffness below which gravity tips the head over, N.m/rad: g sum(m (h + z))."""
    c = coefficients(p)
    outer, middle, inner = (body.mass * c.height + body.moment[2] for body in c.bodies)
    return p.gravity * (outer + middle + inner)


def _moment_rule(name: str, axis: int) -> Rule:
    def limits(p: Parameters) -> tuple[Scalar, Scalar]:
        inertia = getattr(p, name).inertia
        return 0.0, (inertia[axis - 1] + inertia[axis - 2]) * (1.0 + _MARGIN)

    return Rule(f"{name}.inertia[{axis + 1}]", "larger than the other two together, as in no rigid body", limits)


def _product_rules(name: str) -> tuple[Rule, ...]:
    """The inertia tensor is positive definite: what its minors leave for xy, xz and then yz."""

    def around(centre: Scalar, square: Scalar) -> tuple[Scalar, Scalar]:
        half = (1.0 - _MARGIN) * sqrt(maximum(square, 0.0))
        return centre - half, centre + half

    def xy_limits(p: Parameters) -> tuple[Scalar, Scalar]:
        x, y, _ = getattr(p, name).inertia
        return around(0.0, x * y)

    def xz_limits(p: Parameters) -> tuple[Scalar, Scalar]:
        x, _, z = getattr(p, name).inertia
        return around(0.0, x * z)

    def yz_limits(p: Parameters) -> tuple[Scalar, Scalar]:
        (x, y, z), (xy, xz, _) = getattr(p, name).inertia, getattr(p, name).products
        return around(xy * xz / x, (x * y - xy * xy) * (x * z - xz * xz) / (x * x))

    why = "too large for the moments, as in no rigid body"
    return tuple(
        Rule(f"{name}.products[{i}]", why, limits) for i, limits in enumerate((xy_limits, xz_limits, yz_limits), 1)
    )


def _body_rules(name: str) -> tuple[Rule, ...]:
    return (*[_moment_rule(name, axis) for axis in range(3)], *_product_rules(name))


def _pulse_rule(name: str, length: Callable[[Parameters], Scalar], why: str) -> Rule:
    def limits(p: Parameters) -> tuple[Scalar, Scalar]:
        return where(getattr(p, name).period > 0.0, length(p), 0.0), inf

    return Rule(f"{name}.period", why, limits)


def _rules() -> tuple[Rule, ...]:
    """Bodies must be rigid, pulses must end before they start again, the tripod must stand, the step must be stable.

    A step times the fastest rate of 1 is half of what RK4 and the splitting bear.
    """
    standing = [
        Rule(
            f"tripod.stiffness.{axis}",
            "the camera's weight tips the tripod over",
            lambda p: (_tipping(p) * (1.0 + _MARGIN), inf),
        )
        for axis in ("pitch", "roll")
    ]
    return (
        *[rule for name in ("yaw_frame", "pitch_frame", "camera") for rule in _body_rules(name)],
        _pulse_rule("shutter", lambda p: shutter_length(p.shutter), "0 switches it off; the exposure is not over"),
        _pulse_rule("knock", lambda p: p.knock.width, "0 switches it off; the blow is not over"),
        *standing,
        Rule(
            "solver_period",
            "too long for the stiffness and damping of tripod and friction",
            lambda p: (0.0, 1.0 / _fastest(p)),
        ),
    )


MODEL = Model(
    name="TripodGimbal",
    description="Camera on a three-axis gimbal on a flexible tripod, in wind",
    Parameters=Parameters,
    Coefficients=Coefficients,
    Inputs=Inputs,
    State=State,
    Outputs=Outputs,
    coefficients=coefficients,
    initial_state=initial_state,
    outputs=outputs,
    clocks=(Clock("solver", lambda c: c.solver_period),),
    tasks=(
        Task("integrate", "solver", integrate),
        Task("wind", "solver", blow_on, every=lambda c: c.wind.every, normals=5),
    ),
    seed=lambda p: p.seed,
    rules=_rules(),
)
