"""The plant: a camera on a three-axis gimbal on a ball head on a flexible tripod, in wind, with its shutter and knocks.

    M(q) u' + h(q, u) = tau,   u = (w_np_p, w_nt_t, yaw rate, pitch rate, roll rate)

Nine degrees of freedom: the tripod's apex turns elastically about P, the head about the ball's centre Q above it, the
gimbal's three joints about the point O above that. Motor torques act between the bodies, so that their reactions and
the imbalance reach the tripod. The mechanics are integrated by RK4; what is too fast for it, the friction's bristles
and the motors' currents, by its exact solution half a step before and half a step after (Strang splitting).
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
from .plants.friction import Friction, LuGre, bristle_after, lugre
from .plants.gimbal import NO_AXES, Axes, Body, JointMotion, Wrench, about_o, camera_rates, to_camera
from .plants.joint import Cable, EndStop, JointParts
from .plants.motor import DRIVE, Motor, MotorCommand, MotorConstants, current_after, current_at_rest, motor_constants
from .plants.pulses import (
    Knock,
    Press,
    Shutter,
    knock_share,
    press_share,
    shutter_length,
    shutter_shares,
)
from .plants.rig import (
    Loads,
    Motion,
    Parts,
    Position,
    Rates,
    Rig,
    equilibrium,
    kinetic_energy,
    motion_rate,
    potential_energy,
    rk4,
)
from .plants.rig_rules import MARGIN, body_rules, pulse_rule, start_rule, wind_rule
from .plants.tripod import Head, Tripod, attitude, attitude_quaternion, carried_inertia, mount
from .plants.wind import (
    SPECTRUM,
    Wind,
    WindCoefficients,
    WindState,
    davenport_wind_after,
    dryden_wind_after,
    wind_coefficients,
    wind_force,
    wind_speed,
)
from .record import Integer, Matrix3, Quaternion, Real, Vector3
from .scalar import PI, Scalar, floor, maximum, round_half_up, sqrt
from .system import Clock, Model, Rule, Task
from .vectors import ZERO3, add, cross, each_axis, matrix_product, multiply_transposed, scale, subtract

# The bodies are sized after a mirrorless camera of 0.7 kg with a lens of 0.5 kg in a small gimbal: uniform boxes and
# rings, with centres of gravity as far out as a careful user balances them (0.3 to 0.5 mm). The products of inertia are
# those of arms on one side: the yaw frame's rises behind, the pitch frame's runs along the right. All engineering
# judgement.
_YAW_FRAME = Body(0.35, (0.0002, 0.0003, -0.06), (1.5e-3, 1.2e-3, 1.0e-3), (0.5e-4, 1.0e-4, 2.0e-4))
_PITCH_FRAME = Body(0.25, (0.0002, -0.0002, 0.0002), (1.0e-3, 0.8e-3, 1.2e-3), (1.5e-4, 0.5e-4, 0.5e-4))
_CAMERA = Body(1.2, (0.0003, 0.0005, -0.0005), (4.6e-3, 2.3e-3, 5.7e-3), (1.0e-4, 0.5e-4, 2.0e-4))


class JointFriction(NamedTuple):
    """LuGre friction of each joint."""

    yaw: Friction = Friction()
    pitch: Friction = Friction()
    roll: Friction = Friction()


class JointMotors(NamedTuple):
    """Motor and driver of each joint."""

    yaw: Motor = Motor()
    pitch: Motor = Motor()
    roll: Motor = Motor()


class JointCables(NamedTuple):
    """Cables through each joint."""

    yaw: Cable = Cable()
    pitch: Cable = Cable()
    roll: Cable = Cable()


def _within(degrees: float) -> EndStop:
    return EndStop(-degrees / 180.0 * PI, degrees / 180.0 * PI)


class JointStops(NamedTuple):
    """End stops of each joint; travels are assumptions."""

    yaw: EndStop = _within(170.0)
    pitch: EndStop = _within(100.0)
    roll: EndStop = _within(60.0)


_FASTEST_JOINT = 10.0
"""rad/s, that a joint starts with or hits its end stop with, whose damping grows with the rate; assumption."""


class Initial(NamedTuple):
    """Where the run starts: at rest, the tripod sunk into its equilibrium."""

    heading: Annotated[float, Real("rad", "of the tripod, clockwise from north", -10.0, 10.0, "deg")] = 0.0
    joint: Annotated[Axes, Real("rad", "joint angle", -4.0, 4.0, "deg")] = NO_AXES
    joint_rate: Annotated[Axes, Real("rad/s", "joint rate", -_FASTEST_JOINT, _FASTEST_JOINT, "deg/s")] = NO_AXES


class Parameters(NamedTuple):
    """Bodies, springs, friction and disturbances. A magnitude of 0 switches a disturbance off."""

    yaw_frame: Body = _YAW_FRAME
    pitch_frame: Body = _PITCH_FRAME
    camera: Body = _CAMERA
    tripod: Tripod = Tripod()
    head: Head = Head()
    friction: JointFriction = JointFriction()
    cable: JointCables = JointCables()
    stop: JointStops = JointStops()
    drive: Annotated[int, DRIVE] = DRIVE.value("current")
    motor: JointMotors = JointMotors()
    wind: Wind = Wind()
    shutter: Shutter = Shutter()
    press: Press = Press()
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
    rig: Rig
    friction: tuple[LuGre, LuGre, LuGre]
    motor: tuple[MotorConstants, MotorConstants, MotorConstants]
    wind: WindCoefficients


class Inputs(NamedTuple):
    """What the drives do."""

    motor_torque: Annotated[
        Axes, Real("N.m", "torque command of the joint; + turns its angle up", -100.0, 100.0, None, 0.1)
    ] = NO_AXES
    motor_voltage: Annotated[
        Axes, Real("V", "of the joint's motor, where the drive is voltage; + turns its angle up", -1e3, 1e3)
    ] = NO_AXES


class State(NamedTuple):
    """All that evolves."""

    ticks: Annotated[float, Real("1", "solver steps so far")]
    tripod: Annotated[Axes, Real("rad", "elastic angle of the tripod", display="deg")]
    head: Annotated[Axes, Real("rad", "elastic angle of the ball head", display="deg")]
    joint: Annotated[Axes, Real("rad", "joint angle", display="deg")]
    apex_rate: Annotated[Vector3, Real("rad/s", "w_np_p", display="deg/s")]
    head_rate: Annotated[Vector3, Real("rad/s", "w_nt_t", display="deg/s")]
    joint_rate: Annotated[Axes, Real("rad/s", "joint rate", display="deg/s")]
    apex_acceleration: Annotated[Vector3, Real("rad/s2", "derivative of w_np_p")]
    head_acceleration: Annotated[Vector3, Real("rad/s2", "derivative of w_nt_t")]
    joint_acceleration: Annotated[Axes, Real("rad/s2", "joint acceleration")]
    bristle: Annotated[Axes, Real("rad", "deflection of the friction's bristles", display="deg")]
    current: Annotated[Axes, Real("A", "of the joint's motor")]
    curtains: Annotated[float, Real("1", "momentum in the shutter's curtains, share of the impulse")]
    mirror: Annotated[float, Real("1", "momentum in the mirror, share of the impulse")]
    presses: Annotated[float, Real("1", "presses taken, share of the impulse")]
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
    motor_current: Annotated[Axes, Real("A", "of the joint's motor")]
    tripod_deflection: Annotated[Axes, Real("rad", "elastic angle of the tripod", display="deg")]
    head_deflection: Annotated[Axes, Real("rad", "elastic angle of the ball head", display="deg")]
    wind_speed: Annotated[float, Real("m/s", "at the camera")]


def coefficients(p: Parameters) -> Coefficients:
    """Bodies about O, the mounts' damping, friction and motor constants and the wind's discrete filters."""
    bodies = (about_o(p.yaw_frame), about_o(p.pitch_frame), about_o(p.camera))
    outer, middle, inner = bodies
    turned = (
        outer.inertia[2] + middle.inertia[2] + inner.inertia[2],
        middle.inertia[0] + inner.inertia[0],
        inner.inertia[1],
    )
    on_ball = carried_inertia(bodies, p.head.height)
    on_apex = carried_inertia(bodies, p.head.height + p.tripod.height)
    on_apex = Axes(*[load + own for load, own in zip(on_apex, p.head.inertia, strict=True)])
    every = maximum(round_half_up(p.wind.period / p.solver_period), 1.0)
    half = 0.5 * p.solver_period
    return Coefficients(
        solver_period=p.solver_period,
        rig=Rig(bodies, mount(p.tripod, on_apex), mount(p.head, on_ball)),
        friction=each_axis(lambda i: lugre(p.friction[i], turned[i])),
        motor=each_axis(lambda i: motor_constants(p.motor[i], half)),
        wind=wind_coefficients(p.wind, p.solver_period, every),
    )


def joint_parts(p: Parameters, c: Coefficients) -> Parts:
    """What acts on the joints by itself."""
    return each_axis(
        lambda i: JointParts(c.friction[i], p.cable[i], p.stop[i], c.motor[i].cogging, p.motor[i].cogging_positions)
    )


def _about(axes: Axes) -> Vector3:
    """A torque given by axes (yaw about -z, pitch about x, roll about y) as a vector."""
    return axes[1], axes[2], -axes[0]


def _bristles(c: Coefficients, bristle: Axes, rates: Axes) -> Axes:
    half = 0.5 * c.solver_period
    return Axes(*each_axis(lambda i: bristle_after(c.friction[i], bristle[i], rates[i], half)))


def _command(inputs: Inputs, p: Parameters, axis: int) -> MotorCommand:
    return MotorCommand(p.drive, inputs.motor_torque[axis], inputs.motor_voltage[axis])


def _currents(inputs: Inputs, p: Parameters, c: Coefficients, current: Axes, rates: Axes) -> Axes:
    return Axes(
        *each_axis(
            lambda i: current_after(p.motor[i], c.motor[i], _command(inputs, p, i), current[i], rates[i]),
        )
    )


def _torques(current: Axes, p: Parameters) -> Axes:
    return Axes(*each_axis(lambda i: p.motor[i].torque_constant * current[i]))


def _apex_attitude(tripod: Axes, p: Parameters) -> Matrix3:
    """C_np."""
    return matrix_product(matrix_from_euler(Euler(p.initial.heading, 0.0, 0.0)), attitude(tripod))


def _head_attitude(tripod: Axes, head: Axes, p: Parameters) -> Matrix3:
    """C_nt."""
    return matrix_product(_apex_attitude(tripod, p), attitude(head))


def _wind_share(state: State, c: Coefficients, steps: Scalar) -> Scalar:
    """How far between two wind ticks the time `steps` solver steps after the last one lies, 0 to 1."""
    ticks, every = state.ticks, c.wind.every
    return (ticks - every * floor(ticks / every) + steps) / every


class _Pulses(NamedTuple):
    """Momenta handed over so far, as shares of the impulses."""

    curtains: Scalar
    mirror: Scalar
    presses: Scalar
    knocks: Scalar


def _pulses_at(p: Parameters, time: Scalar) -> _Pulses:
    return _Pulses(*shutter_shares(p.shutter, time), press_share(p.press, time), knock_share(p.knock, time))


def _on_camera(p: Parameters, gained: _Pulses, h: Scalar) -> Wrench:
    """Mean force at O and torque about it (in b) of shutter, mirror and finger over a step of h (s)."""
    pulse = [
        (a * gained.curtains + b * gained.mirror) / h
        for a, b in zip(p.shutter.impulse, p.shutter.mirror_impulse, strict=True)
    ]
    pressed = (0.0, 0.0, -0.5 * p.press.force * p.press.duration * gained.presses / h)
    return Wrench(pressed, add(_about(Axes(*pulse)), cross(p.press.position, pressed)))


def integrate(state: State, inputs: Inputs, p: Parameters, c: Coefficients, _normals: tuple[Scalar, ...]) -> State:
    """One solver step: RK4 of the mechanics, between two half steps of bristles and currents.

    Commands, pulses and wind are held over the step; those of pulses and wind are its means.
    """
    h, parts = c.solver_period, joint_parts(p, c)
    ticks = state.ticks + 1.0
    pulses = _pulses_at(p, ticks * h)
    gained = _Pulses(
        pulses.curtains - state.curtains,
        pulses.mirror - state.mirror,
        pulses.presses - state.presses,
        pulses.knocks - state.knocks,
    )
    bristle = _bristles(c, state.bristle, state.joint_rate)
    current = _currents(inputs, p, c, state.current, state.joint_rate)
    force_n = wind_force(p.wind, c.wind, state.wind, _wind_share(state, c, 0.5))
    loads = Loads(
        motor=_torques(current, p),
        bristle=bristle,
        on_apex=scale(gained.knocks / h, _about(p.knock.impulse)),
        on_camera=_on_camera(p, gained, h),
        wind=multiply_transposed(_head_attitude(state.tripod, state.head, p), force_n),
        center_of_pressure=p.wind.center_of_pressure,
    )
    end = rk4(_motion_of(state), loads, c.rig, parts, p.gravity, h)
    position, rates = end
    bristle = _bristles(c, bristle, rates.joint)
    current = _currents(inputs, p, c, current, rates.joint)
    after = loads._replace(motor=_torques(current, p), bristle=bristle)
    acceleration = motion_rate(end, after, c.rig, parts, p.gravity).rates
    return State(
        ticks=ticks,
        tripod=position.tripod,
        head=position.head,
        joint=position.joint,
        apex_rate=rates.apex,
        head_rate=rates.head,
        joint_rate=rates.joint,
        apex_acceleration=acceleration.apex,
        head_acceleration=acceleration.head,
        joint_acceleration=acceleration.joint,
        bristle=bristle,
        current=current,
        curtains=pulses.curtains,
        mirror=pulses.mirror,
        presses=pulses.presses,
        knocks=pulses.knocks,
        wind=state.wind,
    )


def _motion_of(state: State) -> Motion:
    return Motion(
        Position(state.tripod, state.head, state.joint),
        Rates(state.apex_rate, state.head_rate, state.joint_rate),
    )


def blow_dryden(state: State, _inputs: Inputs, _p: Parameters, c: Coefficients, normals: tuple[Scalar, ...]) -> State:
    """The next Dryden gusts and vortices."""
    return state._replace(wind=dryden_wind_after(state.wind, c.wind, normals))


def blow_davenport(state: State, _i: Inputs, _p: Parameters, c: Coefficients, normals: tuple[Scalar, ...]) -> State:
    """The next Davenport gusts and vortices."""
    return state._replace(wind=davenport_wind_after(state.wind, c.wind, normals))


def initial_state(p: Parameters, c: Coefficients, inputs: Inputs) -> State:
    """Tripod and head at rest under gravity and mean wind, the joints where the parameters put them."""
    wind = WindState()
    force_n = wind_force(p.wind, c.wind, wind, 0.0)
    current = Axes(*each_axis(lambda i: current_at_rest(p.motor[i], _command(inputs, p, i))))
    loads = Loads(
        motor=_torques(current, p),
        bristle=NO_AXES,
        on_apex=ZERO3,
        on_camera=Wrench(ZERO3, ZERO3),
        wind=multiply_transposed(_head_attitude(NO_AXES, NO_AXES, p), force_n),
        center_of_pressure=p.wind.center_of_pressure,
    )
    position = equilibrium(p.initial.joint, loads, c.rig, p.gravity)
    start = Motion(position, Rates(ZERO3, ZERO3, p.initial.joint_rate))
    rate = motion_rate(start, loads, c.rig, joint_parts(p, c), p.gravity).rates
    return State(
        ticks=0.0,
        tripod=position.tripod,
        head=position.head,
        joint=p.initial.joint,
        apex_rate=ZERO3,
        head_rate=ZERO3,
        joint_rate=p.initial.joint_rate,
        apex_acceleration=rate.apex,
        head_acceleration=rate.head,
        joint_acceleration=rate.joint,
        bristle=NO_AXES,
        current=current,
        curtains=0.0,
        mirror=0.0,
        presses=0.0,
        knocks=0.0,
        wind=wind,
    )


def _turning(w: Vector3, alpha: Vector3, r: Vector3) -> Vector3:
    """w' x r + w x (w x r)."""
    return add(cross(alpha, r), cross(w, cross(w, r)))


def outputs(state: State, p: Parameters, c: Coefficients) -> Outputs:
    """f_b = C_tb' (a_O + g up) + w' x r + w x (w x r);  w_ib_b = w_nb_b + C_nb' w_ie_n."""
    turns = turns_of(state.joint)
    c_np, c_pt = _apex_attitude(state.tripod, p), attitude(state.head)
    c_nb = matrix_product(matrix_product(c_np, c_pt), matrix_from_turns(turns))
    joints = JointMotion(state.joint_rate, state.joint_acceleration)
    w, alpha = camera_rates(turns, state.head_rate, state.head_acceleration, joints)
    earth = multiply_transposed(c_nb, earth_rate_n(p.latitude))
    q, o = (0.0, 0.0, c.rig.tripod.height), (0.0, 0.0, c.rig.head.height)
    at_q = add(scale(p.gravity, c_np[2]), _turning(state.apex_rate, state.apex_acceleration, q))
    at_o = add(multiply_transposed(c_pt, at_q), _turning(state.head_rate, state.head_acceleration, o))
    heading = quaternion_from_euler(Euler(p.initial.heading, 0.0, 0.0))
    mounts = quaternion_product(attitude_quaternion(state.tripod), attitude_quaternion(state.head))
    head = quaternion_product(heading, mounts)
    return Outputs(
        euler=euler_from_matrix(c_nb),
        quaternion=normalised(quaternion_product(head, quaternion_from_euler(Euler(*state.joint)))),
        rate=add(w, earth),
        angular_acceleration=subtract(alpha, cross(w, earth)),
        specific_force=add(to_camera(turns, at_o), _turning(w, alpha, p.sensor_position)),
        temperature=p.ambient_temperature,
        joint=state.joint,
        joint_rate=state.joint_rate,
        motor_current=state.current,
        tripod_deflection=state.tripod,
        head_deflection=state.head,
        wind_speed=wind_speed(p.wind, state.wind, _wind_share(state, c, 0.0)),
    )


def energy(state: State, p: Parameters, c: Coefficients) -> Scalar:
    """T + V of the mechanics, J: u'Mu/2, all springs, and gravity from the apex up."""
    motion = _motion_of(state)
    return kinetic_energy(motion, c.rig) + potential_energy(motion.position, c.rig, joint_parts(p, c), p.gravity)


# --- values that must go together ------------------------------------------------------------------------------------

_LEAST_MASS = 1e-9
"""kg; keeps a weightless gimbal's centre of gravity defined."""


def _mounts_fastest(p: Parameters, c: Coefficients, axis: int) -> Scalar:
    """Bound of the modes of tripod and head about an axis, the gimbal a mass on top: traces of M^-1 K and M^-1 C."""
    bodies, (low, high) = (p.yaw_frame, p.pitch_frame, p.camera), (c.rig.tripod, c.rig.head)
    mass: Scalar = sum([body.mass for body in bodies])
    moment: Scalar = sum([body.mass * (high.height + body.center_of_gravity[2]) for body in bodies])
    tilting = 0.0 if axis == 0 else 1.0
    arm = tilting * moment / maximum(mass, _LEAST_MASS)
    below = p.tripod.inertia[axis] + tilting * mass * low.height * low.height
    above = p.head.inertia[axis] + mass * arm * arm
    beside = mass * arm * low.height
    determinant = below * above - beside * beside

    def trace(of_tripod: Scalar, of_head: Scalar) -> Scalar:
        return (of_tripod * above + of_head * (above + 2.0 * beside + below)) / determinant

    return sqrt(trace(low.stiffness[axis], high.stiffness[axis])) + trace(low.damping[axis], high.damping[axis])


def _joints_fastest(p: Parameters, c: Coefficients, axis: int) -> Scalar:
    """Bound of bristle, cable, cogging, back-EMF and of the end stop, on the camera alone."""
    inertia = (p.camera.inertia[2], p.camera.inertia[0], p.camera.inertia[1])[axis]
    friction, motor, stop, cable = c.friction[axis], p.motor[axis], p.stop[axis], p.cable[axis]
    springs = friction.stiffness + cable.stiffness + c.motor[axis].cogging * motor.cogging_positions
    braking = motor.torque_constant * motor.torque_constant / motor.resistance
    damping = friction.damping + friction.viscous + cable.damping + braking
    bumper = sqrt(stop.stiffness / inertia)
    return maximum(sqrt(springs / inertia) + damping / inertia, bumper * (1.0 + stop.loss * _FASTEST_JOINT))


def _fastest(p: Parameters) -> Scalar:
    """Upper bound of the fastest rate of springs, bristles and dampers, 1/s: sqrt(k/J) + C/J.

    J is the inertia that each is sure to move.
    """
    c = coefficients(p)
    fastest: Scalar = 0.0
    for axis in range(3):
        fastest = maximum(fastest, maximum(_mounts_fastest(p, c, axis), _joints_fastest(p, c, axis)))
    return fastest


def _tipping(p: Parameters, height: Scalar) -> Scalar:
    """Stiffness below which gravity tips what is elastic `height` (m) under O over, N.m/rad: g sum(m (height + z))."""
    outer, middle, inner = (
        body.mass * (height + body.center_of_gravity[2]) for body in (p.yaw_frame, p.pitch_frame, p.camera)
    )
    return p.gravity * (outer + middle + inner)


def _rules() -> tuple[Rule, ...]:
    """Bodies must be rigid, pulses must end before they start again, tripod and head must stand, joints must start
    between their stops, the step must be stable, the wind's clock must follow the vortices.

    A step times the fastest rate of 1 is half of what RK4 and the splitting bear.
    """

    def standing(name: str, height: Callable[[Parameters], Scalar]) -> list[Rule]:
        why = f"the camera's weight tips the {name} over"
        return [
            Rule(f"{name}.stiffness.{axis}", why, lambda p: (_tipping(p, height(p)) * (1.0 + MARGIN), inf))
            for axis in ("pitch", "roll")
        ]

    return (
        *[rule for name in ("yaw_frame", "pitch_frame", "camera") for rule in body_rules(name)],
        pulse_rule("shutter", lambda p: shutter_length(p.shutter), "0 switches it off; the exposure is not over"),
        pulse_rule("press", lambda p: p.press.duration, "0 switches it off; the press is not over"),
        pulse_rule("knock", lambda p: p.knock.width, "0 switches it off; the blow is not over"),
        *standing("tripod", lambda p: p.head.height + p.tripod.height),
        *standing("head", lambda p: p.head.height),
        *[start_rule(axis) for axis in range(3)],
        Rule(
            "solver_period",
            "too long for the stiffness and damping of tripod, head, friction and stops",
            lambda p: (0.0, 1.0 / _fastest(p)),
        ),
        wind_rule(),
    )


def _spectrum(p: Parameters) -> int:
    return p.wind.spectrum


def _wind_period(c: Coefficients) -> Scalar:
    return c.wind.every


MODEL = Model(
    name="TripodGimbal",
    description="Camera on a three-axis gimbal on a ball head on a flexible tripod, in wind",
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
        Task("wind", "solver", {SPECTRUM.value("dryden"): blow_dryden}, _spectrum, _wind_period, normals=5),
        Task("davenport", "solver", {SPECTRUM.value("davenport"): blow_davenport}, _spectrum, _wind_period, normals=10),
    ),
    seed=lambda p: p.seed,
    rules=_rules(),
)
