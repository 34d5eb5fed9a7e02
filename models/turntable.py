"""A three-axis turntable on a vibrating bench, in a temperature chamber, that runs a profile of moves, rests and turns.

    C_nb = C_bench Rz(-outer) Rx(middle) Ry(inner) C_mounting,   with every axis's wobble and errors on the way

The axes follow time-optimal references through their servos; the plate's rate and acceleration are the derivatives of
its attitude. A sensor on the plate feels

    w_ib_b = w_nb_b + C_nb' w_ie_n,   f_b = C_nb' (a_bench + g up) + w' x r + w x (w x r)
"""

from __future__ import annotations

from math import inf
from typing import Annotated, Any, NamedTuple

from .attitude.rotations import (
    REFERENCE_LATITUDE,
    STANDARD_GRAVITY,
    Euler,
    earth_rate_n,
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
    normalised,
    quaternion_from_euler,
    quaternion_product,
)
from .plants.turntable_axes import (
    AT_REST,
    AxisErrors,
    Motion,
    NonOrthogonality,
    PositionError,
    Turn,
    Wobble,
    axis_errors,
    plate_motion,
    turned,
)
from .plants.turntable_chamber import Air, Chamber, aired, is_at
from .plants.turntable_profile import (
    KIND,
    MODE,
    NO_AXES,
    Axes,
    Command,
    Profile,
    Sequence,
    command_of,
    row_number,
)
from .plants.turntable_reference import Reference, toward_angle, toward_rate
from .plants.turntable_servo import AxisMotion, Servo, followed, servo
from .plants.turntable_shock import Shock, mean_acceleration, pulse_length, speed_felt
from .plants.vibration import (
    HELD_STILL,
    QUIET,
    Held,
    Holder,
    Oscillations,
    Oscillator,
    Shaking,
    Tilt,
    held,
    holder,
    oscillated_axes,
    oscillator,
)
from .record import Boolean, Enumeration, Integer, Item, Matrix3, Quaternion, Real, Vector3, choose
from .scalar import PI, Scalar, absolute, both, clip, either, maximum, minimum, round_half_up, where
from .system import Clock, Model, Rule, Task
from .vectors import ZERO3, add, cross, matrix_product, multiply, multiply_transposed, subtract

_DEG = PI / 180.0

SOURCE = Enumeration(
    "TurntableSource",
    (
        Item("profile", "the rows of the profile, one after the other"),
        Item("inputs", "the inputs called command"),
    ),
    "where the table's commands come from",
)


class Axis(NamedTuple):
    """One axis: its limits, its servo and its errors."""

    rate_limit: Annotated[float, Real("rad/s", "largest rate of the reference", 1e-6, 100.0)] = 10.0 * _DEG
    acceleration_limit: Annotated[float, Real("rad/s2", "largest acceleration of the reference", 1e-6, 1e4)] = (
        10.0 * _DEG
    )  # both as in Jing & Gao 2021
    bandwidth: Annotated[float, Real("Hz", "of the servo, where its gain is 3 dB down", 0.1, 1e3, None, 10.0)] = 30.0
    damping_ratio: Annotated[float, Real("1", "of the servo", 0.05, 1.0)] = 0.7
    # rate tables have 10 to 60 Hz, engineering judgement; the damping is an assumption
    initial_angle: Annotated[float, Real("rad", "where the axis rests at the start", -1e5, 1e5)] = 0.0
    position_error: PositionError = PositionError()
    wobble: Wobble = Wobble()


class EveryAxis(NamedTuple):
    """The three axes, from the base inward."""

    outer: Axis = Axis()
    middle: Axis = Axis()
    inner: Axis = Axis()


class Base(NamedTuple):
    """How the table stands: 0, 0, 0 is its outer axis upright and its zero to the north."""

    heading: Annotated[float, Real("rad", "clockwise from north", -10.0, 10.0)] = 0.0
    pitch: Annotated[float, Real("rad", "front up", -1.0, 1.0)] = 0.0
    roll: Annotated[float, Real("rad", "right side down", -1.0, 1.0)] = 0.0


class Mounting(NamedTuple):
    """How the sensor is turned against the plate, in the order yaw, pitch, roll."""

    yaw: Annotated[float, Real("rad", "clockwise seen from above", -10.0, 10.0)] = 0.0
    pitch: Annotated[float, Real("rad", "nose up", -10.0, 10.0)] = 0.0
    roll: Annotated[float, Real("rad", "right side down", -10.0, 10.0)] = 0.0


class Parameters(NamedTuple):
    """The table, what it is told, and what disturbs it. A magnitude of 0 switches a disturbance off."""

    source: Annotated[int, SOURCE] = SOURCE.value("profile")
    profile: Profile = Profile()
    axis: EveryAxis = EveryAxis()
    nonorthogonality: NonOrthogonality = NonOrthogonality()
    base: Base = Base()
    mounting: Mounting = Mounting()
    sensor_position: Annotated[
        Vector3, Real("m", "sensor from the axes' meeting point, along the plate's right, forward, up", -1.0, 1.0)
    ] = ZERO3
    tilt: Tilt = Tilt()
    shaking: Shaking = Shaking()
    shock: Shock = Shock()
    chamber: Chamber = Chamber()
    latitude: Annotated[float, Real("rad", "geodetic, north positive", -PI / 2.0, PI / 2.0)] = REFERENCE_LATITUDE
    gravity: Annotated[float, Real("m/s2", "gravity where the table stands", 0.0, 30.0)] = STANDARD_GRAVITY
    period: Annotated[float, Real("s", "of the table's clock", 1e-5, 0.01, None, 1e-3)] = 1e-3
    seed: Annotated[int, Integer("key of all noise", 0, 2**31 - 1)] = 1


class Coefficients(NamedTuple):
    """What the equations need, worked out once."""

    period: Annotated[float, Real("s", "of the table's clock")]
    every: Annotated[float, Real("1", "ticks from one command to the next")]
    servo: tuple[Servo, Servo, Servo]
    errors: tuple[AxisErrors, AxisErrors, AxisErrors]
    tilt: Oscillator
    shaking: Oscillator
    holder: Holder
    mounting: Annotated[Matrix3, Real("1", "turns the sensor's axes into the plate's")]
    mounting_quaternion: Annotated[Quaternion, Real("1", "the same as a quaternion")]


class Inputs(NamedTuple):
    """What a master wants, where `source` is inputs."""

    command: Command = Command(MODE.value("position"), NO_AXES, NO_AXES, 293.15)


class State(NamedTuple):
    """All that evolves."""

    ticks: Annotated[float, Real("1", "ticks so far")]
    sequence: Sequence
    command: Command
    steady: Annotated[float, Integer("1 while axes and chamber are where they should be", 0, 1)]
    reference: tuple[Reference, Reference, Reference]
    axis: tuple[AxisMotion, AxisMotion, AxisMotion]
    tilt: Oscillations
    shaking: Oscillations
    held: tuple[Held, Held, Held]
    shocks: Annotated[float, Real("1", "speed by pulses, in that of a half sine")]
    shock: Annotated[Vector3, Real("m/s2", "acceleration by pulses, mean of the last period")]
    air: Air


class Outputs(NamedTuple):
    """The sensor's true motion, as it would feel it, the encoders, and where the profile is."""

    euler: Euler
    quaternion: Annotated[Quaternion, Real("1", "q_nb, scalar first")]
    rate: Annotated[Vector3, Real("rad/s", "w_ib_b, with the Earth's", display="deg/s")]
    angular_acceleration: Annotated[Vector3, Real("rad/s2", "derivative of w_ib_b")]
    specific_force: Annotated[Vector3, Real("m/s2", "f_b at the sensor; +g upward at rest", nominal=10.0)]
    temperature: Annotated[float, Real("K", "of the chamber's air", display="degC", nominal=300.0)]
    axis_angle: Annotated[Axes, Real("rad", "as the encoder tells it")]
    axis_rate: Annotated[Axes, Real("rad/s", "as the encoder tells it")]
    row: Annotated[float, Integer("row of the profile that runs, counted from 1; 0: none")]
    resting: Annotated[bool, Boolean("at rest where the command wants the axes, the chamber at its temperature")]
    turning: Annotated[bool, Boolean("turning steadily at the command's rates, the chamber at its temperature")]
    finished: Annotated[bool, Boolean("the profile is over")]


def coefficients(p: Parameters) -> Coefficients:
    """Exact transitions for one period, errors as waves, the mounting as a matrix."""
    every = maximum(round_half_up(p.profile.period / p.period), 1.0)
    outer, middle, inner = p.axis
    mounting = Euler(*p.mounting)
    return Coefficients(
        period=p.period,
        every=where(p.source == SOURCE.value("inputs"), 1.0, every),
        servo=(
            servo(outer.bandwidth, outer.damping_ratio, p.period),
            servo(middle.bandwidth, middle.damping_ratio, p.period),
            servo(inner.bandwidth, inner.damping_ratio, p.period),
        ),
        errors=(
            axis_errors(outer.position_error, outer.wobble),
            axis_errors(middle.position_error, middle.wobble),
            axis_errors(inner.position_error, inner.wobble),
        ),
        tilt=oscillator(p.tilt.frequency, p.tilt.damping_ratio, p.period),
        shaking=oscillator(p.shaking.frequency, p.shaking.damping_ratio, p.period),
        holder=holder(p.shaking, p.period),
        mounting=matrix_from_euler(mounting),
        mounting_quaternion=quaternion_from_euler(mounting),
    )


def initial_state(p: Parameters, _c: Coefficients, _inputs: Inputs) -> State:
    """Everything at rest at the initial angles and temperature."""
    outer, middle, inner = [axis.initial_angle for axis in p.axis]
    start = p.chamber.initial_temperature
    return State(
        ticks=0.0,
        sequence=Sequence(),
        command=Command(MODE.value("position"), Axes(outer, middle, inner), NO_AXES, start),
        steady=0.0,
        reference=(Reference(outer, 0.0), Reference(middle, 0.0), Reference(inner, 0.0)),
        axis=(AxisMotion(outer, 0.0, 0.0), AxisMotion(middle, 0.0, 0.0), AxisMotion(inner, 0.0, 0.0)),
        tilt=QUIET,
        shaking=QUIET,
        held=HELD_STILL,
        shocks=speed_felt(p.shock, 0.0),
        shock=ZERO3,
        air=Air(start, start),
    )


def _steady(state: State, p: Parameters) -> Scalar:
    """1 while the references are where the command wants them, the axes near them, and the air is right; else 0."""
    command = state.command
    to_angle = command.mode == MODE.value("position")
    steady = is_at(p.chamber, state.air, command.temperature)
    for axis, target, rate, reference, motion in zip(
        p.axis, command.angle, command.rate, state.reference, state.axis, strict=True
    ):
        wanted = where(to_angle, 0.0, clip(rate, -axis.rate_limit, axis.rate_limit))
        missing = where(to_angle, reference.angle - target, reference.rate - wanted)
        off = where(to_angle, motion.angle - target, 0.0)
        near = both(
            absolute(off) < p.profile.tolerance,
            absolute(motion.rate - wanted) < p.profile.tolerance,
        )
        steady = both(steady, both(missing == 0.0, near))
    return where(steady, 1.0, 0.0)


def follow_profile(state: State, _inputs: Inputs, p: Parameters, c: Coefficients, _n: tuple[Scalar, ...]) -> State:
    """Count a rest down once the table is steady, and take the next row when it is over."""
    sequence = state.sequence
    steady = _steady(state, p)
    is_done = both(steady > 0.5, sequence.left < 0.5)
    is_over = both(either(sequence.row < 0.5, is_done), sequence.ends < 0.5)
    number = sequence.row + 1.0
    row = row_number(p.profile.row, number)
    ticks = round_half_up(row.duration / (c.every * c.period))
    taken = Sequence(number, ticks, where(row.kind == KIND.value("end"), 1.0, 0.0))
    held = sequence._replace(left=maximum(sequence.left - steady, 0.0))
    return state._replace(
        sequence=choose(is_over, taken, held),
        command=choose(is_over, command_of(row, state.command), state.command),
        steady=where(is_over, 0.0, steady),
    )


def follow_inputs(state: State, inputs: Inputs, p: Parameters, _c: Coefficients, _n: tuple[Scalar, ...]) -> State:
    """Take what the inputs say."""
    told = state._replace(command=inputs.command)
    return told._replace(steady=_steady(told, p))


def sway(state: State, _inputs: Inputs, _p: Parameters, c: Coefficients, normals: tuple[Scalar, ...]) -> State:
    """The bench's next tilt."""
    return state._replace(tilt=oscillated_axes(c.tilt, state.tilt, state.ticks < 0.5, normals))


def shake(state: State, _inputs: Inputs, _p: Parameters, c: Coefficients, normals: tuple[Scalar, ...]) -> State:
    """The bench's next acceleration."""
    shaking = oscillated_axes(c.shaking, state.shaking, state.ticks < 0.5, normals)
    x, y, z = [held(c.holder, now, push.value) for now, push in zip(state.held, shaking, strict=True)]
    return state._replace(shaking=shaking, held=(x, y, z))


def _referred(reference: Reference, axis: Axis, mode: Scalar, angle: Scalar, rate: Scalar, period: Scalar) -> Reference:
    """The reference one period on."""
    limit, acceleration = axis.rate_limit, axis.acceleration_limit
    speed = where(rate == 0.0, limit, minimum(absolute(rate), limit))
    going = toward_angle(reference, angle, speed, acceleration, period)
    turning = toward_rate(reference, clip(rate, -limit, limit), acceleration, period)
    to_angle = mode == MODE.value("position")
    return Reference(where(to_angle, going.angle, turning.angle), where(to_angle, going.rate, turning.rate))


def move(state: State, _inputs: Inputs, p: Parameters, c: Coefficients, _normals: tuple[Scalar, ...]) -> State:
    """One period of the axes, the shocks and the air."""
    h, command = c.period, state.command
    ticks = state.ticks + 1.0
    references, motions = [], []
    for i, axis in enumerate(p.axis):
        before = state.reference[i]
        after = _referred(before, axis, command.mode, command.angle[i], command.rate[i], h)
        references.append(after)
        motions.append(followed(c.servo[i], state.axis[i], before, after.angle, h))
    shocks = speed_felt(p.shock, ticks * h)
    return state._replace(
        ticks=ticks,
        reference=(references[0], references[1], references[2]),
        axis=(motions[0], motions[1], motions[2]),
        shocks=shocks,
        shock=mean_acceleration(p.shock, state.shocks, shocks, h),
        air=aired(p.chamber, state.air, command.temperature, h),
    )


def bench_motion(state: State, p: Parameters) -> Motion:
    """The bench against n: as it was set up, and its tilt."""
    right, forward, up = [
        Turn(rms * one.value, rms * one.rate, rms * one.acceleration)
        for rms, one in zip(p.tilt.rms, state.tilt, strict=True)
    ]
    heading = turned(AT_REST, 2, Turn(up.angle - p.base.heading, up.rate, up.acceleration))
    pitch = turned(heading, 0, right._replace(angle=p.base.pitch + right.angle))
    return turned(pitch, 1, forward._replace(angle=p.base.roll + forward.angle))


def _bench_acceleration(state: State, p: Parameters) -> Vector3:
    """Along the bench's axes, m/s^2."""
    (right, forward, up), (x, y, z) = p.shaking.rms, state.held
    return add((right * x.acceleration, forward * y.acceleration, up * z.acceleration), state.shock)


def outputs(state: State, p: Parameters, c: Coefficients) -> Outputs:
    """Motion of the plate, and what a sensor that is mounted on it feels."""
    bench = bench_motion(state, p)
    plate = plate_motion(bench, state.axis, c.errors, p.nonorthogonality)
    q_plate = normalised(plate.attitude)
    c_plate = matrix_from_quaternion(q_plate)
    w, alpha, r = plate.rate, plate.acceleration, p.sensor_position
    earth = multiply_transposed(c_plate, earth_rate_n(p.latitude))
    shaken = multiply(matrix_from_quaternion(bench.attitude), _bench_acceleration(state, p))
    felt = multiply_transposed(c_plate, add(shaken, (0.0, 0.0, p.gravity)))
    force = add(felt, add(cross(alpha, r), cross(w, cross(w, r))))
    is_steady = both(state.steady > 0.5, state.sequence.ends < 0.5)
    outer, middle, inner = state.axis
    return Outputs(
        euler=euler_from_matrix(matrix_product(c_plate, c.mounting)),
        quaternion=quaternion_product(q_plate, c.mounting_quaternion),
        rate=multiply_transposed(c.mounting, add(w, earth)),
        angular_acceleration=multiply_transposed(c.mounting, subtract(alpha, cross(w, earth))),
        specific_force=multiply_transposed(c.mounting, force),
        temperature=state.air.temperature,
        axis_angle=Axes(outer.angle, middle.angle, inner.angle),
        axis_rate=Axes(outer.rate, middle.rate, inner.rate),
        row=state.sequence.row,
        resting=both(is_steady, state.command.mode == MODE.value("position")),
        turning=both(is_steady, state.command.mode == MODE.value("rate")),
        finished=state.sequence.ends > 0.5,
    )


def _spacing(p: Parameters) -> tuple[Scalar, Scalar]:
    """A pulse is over when the next one begins."""
    return where(p.shock.pulses > 1.0, pulse_length(p.shock), 0.0), inf


def _is_there(rms: Any) -> Scalar:
    """1 where a vibration has any magnitude."""
    return where(rms[0] + rms[1] + rms[2] > 0.0, 1.0, 0.0)


MODEL = Model(
    name="Turntable",
    description="Three-axis turntable on a vibrating bench in a temperature chamber, run by a profile",
    Parameters=Parameters,
    Coefficients=Coefficients,
    Inputs=Inputs,
    State=State,
    Outputs=Outputs,
    coefficients=coefficients,
    initial_state=initial_state,
    outputs=outputs,
    clocks=(Clock("table", lambda c: c.period),),
    tasks=(
        Task(
            "command",
            "table",
            {SOURCE.value("profile"): follow_profile, SOURCE.value("inputs"): follow_inputs},
            choice=lambda p: p.source,
            every=lambda c: c.every,
        ),
        Task("sway", "table", {1: sway}, choice=lambda p: _is_there(p.tilt.rms), normals=6),
        Task("shake", "table", {1: shake}, choice=lambda p: _is_there(p.shaking.rms), normals=6),
        Task("move", "table", move),
    ),
    seed=lambda p: p.seed,
    rules=(Rule("shock.period", "shorter than a pulse", _spacing),),
)
