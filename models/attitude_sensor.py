"""The attitude sensor: three ADXRS450, an ADXL355 and the processor (STM32) that filters and solves.

True body rate, specific force and temperature enter; the parts sample them at their own clocks; the processor reads
the parts' registers by its timer, aligns at rest, solves the attitude and filters the angles.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from .attitude.alignment import (
    AlignmentParameters,
    AlignmentState,
    levelled,
    nulled_bias,
    samples_for,
    with_sample,
)
from .attitude.integration import runge_kutta_4
from .attitude.rotations import (
    REFERENCE_LATITUDE,
    STANDARD_GRAVITY,
    Euler,
    earth_rate_n,
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
)
from .attitude.velocity_aided import Fused, FusionParameters, FusionState, RestState, fused_step, initial_fusion
from .filters.kalman import KalmanParameters, kalman_filtered
from .filters.rc import RcParameters, rc_filtered
from .record import Boolean, Enumeration, Integer, Item, Matrix3, Quaternion, Real, Vector3, choose
from .scalar import PI, Scalar, maximum, minimum, sqrt, where
from .sensors import accelerometer as accelerometers
from .sensors import bias_instability, devices
from .sensors import gyro as gyros
from .sensors.accelerometer import AccelerometerCoefficients, AccelerometerParameters, AccelerometerState
from .sensors.gyro import GyroCoefficients, GyroParameters, GyroState
from .sensors.sensitivity import offset_at
from .sensors.thermal import die_temperature, initial_die_temperature
from .system import Clock, Model, Rule, Task
from .vectors import ZERO3, add, each_axis, multiply, multiply_transposed, scale, subtract, transpose

SLOW_PERIOD = 0.1
"""s between steps of temperature and bias instability."""

SOLVER = Enumeration(
    "Solver",
    (
        Item("levelling", "pitch and roll from each accelerometer sample, yaw from the gyros"),
        Item("gyro", "gyros integrated from the alignment on, accelerometer not used"),
        Item("fused", "gyros integrated, tilt and bias corrected by the accelerometer"),
    ),
    "attitude solver",
)
FILTER = Enumeration(
    "AngleFilter",
    (
        Item("none", "angles as solved"),
        Item("rc", "first-order RC on each angle"),
        Item("kalman", "scalar Kalman on each angle"),
    ),
    "filter on the solved angles",
)
STATUS = Enumeration(
    "SensorStatus",
    (
        Item("aligning", "at rest, averaging"),
        Item("running", "attitude valid"),
        Item("over_range", "attitude valid, a part beyond its range"),
    ),
    "what the sensor is doing",
)


class MountingParameters(NamedTuple):
    """Where the sensor sits on the body; its attitude is that of its own axes."""

    rotation: Euler = Euler(0.0, 0.0, 0.0)
    lever_arm: Annotated[Vector3, Real("m", "accelerometer from where the specific force is given, body axes")] = ZERO3


class ProcessorParameters(NamedTuple):
    """The processor's timer."""

    period: Annotated[float, Real("s", "nominal time between readings of the registers", min=1e-4, max=10.0)] = 0.002
    clock_error: Annotated[float, Real("1", "relative error of the timer's frequency", min=-0.05, max=0.05)] = (
        devices.BOARD.processor_clock_error
    )


class SolverParameters(NamedTuple):
    """The attitude solution."""

    kind: Annotated[int, SOLVER] = SOLVER.value("fused")
    fusion: FusionParameters = FusionParameters()


class FilterParameters(NamedTuple):
    """The filter on the solved angles."""

    kind: Annotated[int, FILTER] = FILTER.value("none")
    divider: Annotated[int, Integer("readings per filter step; 10: the 2021 paper's 50 Hz", min=1, max=100000)] = 10
    from_zero: Annotated[bool, Boolean("start at zero, as the 2021 paper's filters do, not at the first angle")] = False
    rc: RcParameters = RcParameters()
    kalman: KalmanParameters = KalmanParameters()


class Parameters(NamedTuple):
    """What the user sets."""

    ideal: Annotated[bool, Boolean("switch every error of the parts off and read them without delay")] = False
    seed: Annotated[int, Integer("key of all noise; equal seeds give equal noise", min=0, max=2**31 - 1)] = 1
    latitude: Annotated[float, Real("rad", "geographic latitude", min=-0.5 * PI, max=0.5 * PI, display="deg")] = (
        REFERENCE_LATITUDE
    )
    mounting: MountingParameters = MountingParameters()
    gyro: GyroParameters = GyroParameters()
    accelerometer: AccelerometerParameters = AccelerometerParameters()
    processor: ProcessorParameters = ProcessorParameters()
    alignment: AlignmentParameters = AlignmentParameters()
    solver: SolverParameters = SolverParameters()
    filter: FilterParameters = FilterParameters()


class Coefficients(NamedTuple):
    """What follows from the parameters."""

    C_sb: Annotated[Matrix3, Real("1", "body into sensor coordinates")]
    gyro: GyroCoefficients
    accelerometer: AccelerometerCoefficients
    processor_period: Annotated[float, Real("s", "true time between readings of the registers")]
    alignment_samples: Annotated[float, Integer("readings averaged in the alignment")]
    nulled_deviation: Annotated[float, Real("rad/s", "standard deviation of a bias nulled in the alignment")]
    filter_divider: Annotated[float, Integer("processor readings per filter step")]


class Inputs(NamedTuple):
    """What the world does to the sensor."""

    rate: Annotated[Vector3, Real("rad/s", "true rate w_ib_b of the body, the Earth's included", display="deg/s")] = (
        ZERO3
    )
    specific_force: Annotated[Vector3, Real("m/s2", "true specific force f_b, +g upward at rest")] = (
        0.0,
        0.0,
        STANDARD_GRAVITY,
    )
    angular_acceleration: Annotated[
        Vector3, Real("rad/s2", "true angular acceleration, wanted for a lever arm only")
    ] = ZERO3
    temperature: Annotated[float, Real("K", "ambient temperature", min=200.0, max=450.0, display="degC")] = (
        devices.REFERENCE_TEMPERATURE
    )
    heading_aid: Annotated[float, Real("rad", "outside yaw, used once at the end of the alignment", display="deg")] = (
        0.0
    )


class SlowState(NamedTuple):
    """Temperatures and wandering offsets, stepped slowly."""

    started: Annotated[float, Boolean("the bias instability has been drawn")]
    gyro_instability: Annotated[bias_instability.Processes, Real("rad/s", "Gauss-Markov processes of the gyro biases")]
    accelerometer_instability: Annotated[
        bias_instability.Processes, Real("m/s2", "Gauss-Markov processes of the accelerometer biases")
    ]
    gyro_temperature: Annotated[float, Real("K", "die temperature of the gyros", display="degC")]
    accelerometer_temperature: Annotated[float, Real("K", "die temperature of the accelerometer", display="degC")]
    gyro_offset: Annotated[Vector3, Real("rad/s", "all that the gyros read too much at rest", display="deg/s")]
    accelerometer_offset: Annotated[Vector3, Real("m/s2", "all that the accelerometer reads too much")]


class ReadingState(NamedTuple):
    """What the processor read last."""

    rate: Annotated[Vector3, Real("rad/s", "rate as read", display="deg/s")]
    specific_force: Annotated[Vector3, Real("m/s2", "specific force as read")]


class AttitudeState(NamedTuple):
    """The attitude solution."""

    aligned: Annotated[float, Boolean("the alignment has ended")]
    alignment: AlignmentState
    q_nb: Annotated[Quaternion, Real("1", "attitude, body to navigation")]
    rate_before: Annotated[Vector3, Real("rad/s", "rate of the reading before", display="deg/s")]
    bias: Annotated[Vector3, Real("rad/s", "gyro bias as estimated", display="deg/s")]
    fusion: FusionState


class FilterState(NamedTuple):
    """The filter on the angles."""

    started: Annotated[float, Boolean("an angle has come in")]
    euler: Euler
    variance: Annotated[Vector3, Real("rad2", "variance of the filtered angles")]


class State(NamedTuple):
    """All that evolves."""

    gyro: tuple[GyroState, GyroState, GyroState]
    accelerometer: AccelerometerState
    slow: SlowState
    reading: ReadingState
    attitude: AttitudeState
    filter: FilterState


class RegisterOutputs(NamedTuple):
    """Codes in the parts' registers."""

    rate: Annotated[Vector3, Integer("RATE registers of the three gyros")]
    acceleration: Annotated[Vector3, Integer("XDATA, YDATA, ZDATA of the accelerometer")]


class DieTemperatureOutputs(NamedTuple):
    """True die temperatures."""

    gyro: Annotated[float, Real("K", "die temperature of the gyros", display="degC")]
    accelerometer: Annotated[float, Real("K", "die temperature of the accelerometer", display="degC")]


class Outputs(NamedTuple):
    """What the sensor shows."""

    euler: Euler
    quaternion: Annotated[Quaternion, Real("1", "q_nb as solved, Hamilton, scalar first", min=-1.000001, max=1.000001)]
    rate_measured: Annotated[Vector3, Real("rad/s", "rate as read", display="deg/s")]
    rate_corrected: Annotated[Vector3, Real("rad/s", "rate as read without the estimated bias", display="deg/s")]
    gyro_bias: Annotated[Vector3, Real("rad/s", "gyro bias as estimated", display="deg/s")]
    specific_force_measured: Annotated[Vector3, Real("m/s2", "specific force as read")]
    register: RegisterOutputs
    die_temperature: DieTemperatureOutputs
    aligned: Annotated[bool, Boolean("alignment has ended, attitude valid")]
    status: Annotated[int, STATUS]


def coefficients(p: Parameters) -> Coefficients:
    """Sensitivities, clock periods and noise levels of these parameters."""
    mounting = transpose(matrix_from_euler(p.mounting.rotation))
    samples = samples_for(p.alignment.duration, p.processor.period)
    averaged = p.solver.fusion.gyro_noise / sqrt(samples * p.processor.period)
    return Coefficients(
        C_sb=mounting,
        gyro=gyros.gyro_coefficients(p.gyro, mounting, p.ideal),
        accelerometer=accelerometers.accelerometer_coefficients(p.accelerometer, mounting, p.ideal),
        processor_period=p.processor.period / (1.0 + where(p.ideal > 0.5, 0.0, p.processor.clock_error)),
        alignment_samples=samples,
        nulled_deviation=averaged,
        filter_divider=where(p.filter.kind == FILTER.value("none"), 1.0, 1.0 * p.filter.divider),
    )


def _offsets(p: Parameters, gyro_temperature: Scalar, accelerometer_temperature: Scalar) -> tuple[Vector3, Vector3]:
    def gyro(axis: int) -> Scalar:
        return offset_at(p.gyro.bias[axis], p.gyro.bias_temperature_slope[axis], gyro_temperature)

    def accelerometer(axis: int) -> Scalar:
        part = p.accelerometer
        return offset_at(part.bias[axis], part.bias_temperature_slope[axis], accelerometer_temperature)

    return each_axis(gyro), each_axis(accelerometer)


def _force_at_part(inputs: Inputs, p: Parameters) -> Vector3:
    return accelerometers.at_lever_arm(
        inputs.specific_force, inputs.rate, inputs.angular_acceleration, p.mounting.lever_arm
    )


def initial_state(p: Parameters, k: Coefficients, inputs: Inputs) -> State:
    """The sensor switched on at these inputs: parts settled, noise and alignment yet to begin."""
    gyro_temperature = initial_die_temperature(p.gyro.thermal, inputs.temperature)
    accelerometer_temperature = initial_die_temperature(p.accelerometer.thermal, inputs.temperature)
    gyro_offset, accelerometer_offset = _offsets(p, gyro_temperature, accelerometer_temperature)
    force = _force_at_part(inputs, p)
    still = bias_instability.STILL
    gyro = each_axis(lambda axis: gyros.initial_gyro(axis, inputs.rate, force, gyro_offset[axis], p.gyro, k.gyro))
    part = accelerometers.initial_accelerometer(force, accelerometer_offset, p.accelerometer, k.accelerometer)
    reading = _reading(gyro, part, inputs, p, k)
    q_nb = levelled(reading.specific_force, inputs.heading_aid)
    euler = euler_from_matrix(matrix_from_quaternion(q_nb))
    filtered = Euler(*[where(p.filter.from_zero > 0.5, 0.0, angle) for angle in euler])
    return State(
        gyro=gyro,
        accelerometer=part,
        slow=SlowState(
            0.0,
            still,
            still,
            gyro_temperature,
            accelerometer_temperature,
            gyro_offset,
            accelerometer_offset,
        ),
        reading=reading,
        attitude=AttitudeState(
            aligned=0.0,
            alignment=AlignmentState(0.0, ZERO3, ZERO3),
            q_nb=q_nb,
            rate_before=reading.rate,
            bias=ZERO3,
            fusion=initial_fusion(
                p.solver.fusion, ZERO3, p.solver.fusion.initial_bias, 0.0, RestState(ZERO3, reading.specific_force, 0.0)
            ),
        ),
        filter=FilterState(where(p.filter.from_zero > 0.5, 1.0, 0.0), filtered, (p.filter.kalman.R,) * 3),
    )


# --- the parts -------------------------------------------------------------------------------------------------------


def _with_gyro(state: State, axis: int, gyro: GyroState) -> State:
    three = state.gyro
    replaced = (
        (gyro, three[1], three[2]) if axis == 0 else (three[0], gyro, three[2]) if axis == 1 else (*three[:2], gyro)
    )
    return State(replaced, state.accelerometer, state.slow, state.reading, state.attitude, state.filter)


TaskStep = Callable[[State, Inputs, Parameters, Coefficients, tuple[Any, ...]], State]


def _gyro_sense(axis: int) -> TaskStep:
    sense = gyros.sense(axis)

    def step(state: State, inputs: Inputs, _p: Parameters, k: Coefficients, _draws: tuple[Any, ...]) -> State:
        return _with_gyro(state, axis, sense(state.gyro[axis], inputs.rate, inputs.specific_force, k.gyro))

    return step


def _gyro_register(axis: int) -> TaskStep:
    register = gyros.register(axis)

    def step(state: State, _inputs: Inputs, p: Parameters, k: Coefficients, draws: tuple[Any, ...]) -> State:
        return _with_gyro(state, axis, register(state.gyro[axis], state.slow.gyro_offset[axis], p.gyro, k.gyro, draws))

    return step


def accelerometer_sense(state: State, inputs: Inputs, p: Parameters, k: Coefficients, _draws: tuple[Any, ...]) -> State:
    """The accelerometer takes an input sample."""
    part = accelerometers.sense(state.accelerometer, _force_at_part(inputs, p), k.accelerometer)
    return State(state.gyro, part, state.slow, state.reading, state.attitude, state.filter)


def accelerometer_register(
    state: State, _inputs: Inputs, p: Parameters, k: Coefficients, draws: tuple[Any, ...]
) -> State:
    """The accelerometer finishes an output word."""
    part = accelerometers.register(
        state.accelerometer, state.slow.accelerometer_offset, p.accelerometer, k.accelerometer, draws
    )
    return State(state.gyro, part, state.slow, state.reading, state.attitude, state.filter)


def slow_step(state: State, inputs: Inputs, p: Parameters, k: Coefficients, draws: tuple[Any, ...]) -> State:
    """Die temperatures and bias instability go on by one slow period; the first call draws their stationary start."""
    slow = state.slow
    decay = tuple(where(slow.started > 0.5, a, 0.0) for a in bias_instability.decays(SLOW_PERIOD))
    half = 3 * bias_instability.PROCESSES
    gyro = bias_instability.stepped(slow.gyro_instability, decay, k.gyro.instability_sigma, draws[:half])
    part = bias_instability.stepped(
        slow.accelerometer_instability, decay, k.accelerometer.instability_sigma, draws[half:]
    )
    gyro_temperature = die_temperature(p.gyro.thermal, slow.gyro_temperature, inputs.temperature, SLOW_PERIOD)
    part_temperature = die_temperature(
        p.accelerometer.thermal, slow.accelerometer_temperature, inputs.temperature, SLOW_PERIOD
    )
    gyro_offset, part_offset = _offsets(p, gyro_temperature, part_temperature)
    after = SlowState(
        1.0,
        gyro,
        part,
        gyro_temperature,
        part_temperature,
        add(gyro_offset, bias_instability.total(gyro)),
        add(part_offset, bias_instability.total(part)),
    )
    return State(state.gyro, state.accelerometer, after, state.reading, state.attitude, state.filter)


# --- the processor ---------------------------------------------------------------------------------------------------


def _reading(
    gyro: tuple[GyroState, GyroState, GyroState],
    part: AccelerometerState,
    inputs: Inputs,
    p: Parameters,
    k: Coefficients,
) -> ReadingState:
    """Registers in SI units; an ideal part shows the truth instead."""
    ideal = p.ideal > 0.5
    true_rate = multiply(k.C_sb, inputs.rate)
    true_force = multiply(k.C_sb, _force_at_part(inputs, p))
    return ReadingState(
        each_axis(lambda i: where(ideal, true_rate[i], gyro[i].code * p.gyro.resolution)),
        each_axis(lambda i: where(ideal, true_force[i], part.code[i] * p.accelerometer.resolution)),
    )


def acquire(state: State, inputs: Inputs, p: Parameters, k: Coefficients, _draws: tuple[Any, ...]) -> State:
    """The processor's timer fires: the registers are read."""
    attitude = state.attitude._replace(rate_before=state.reading.rate)
    reading = _reading(state.gyro, state.accelerometer, inputs, p, k)
    return State(state.gyro, state.accelerometer, state.slow, reading, attitude, state.filter)


class _Start(NamedTuple):
    """The solution that an alignment gives."""

    q_nb: Quaternion
    bias: Vector3
    fusion: FusionState
    alignment: AlignmentState


def _aligning(
    attitude: AttitudeState, reading: ReadingState, inputs: Inputs, p: Parameters, k: Coefficients
) -> tuple[_Start, Scalar]:
    """The start of the solution after one more reading at rest, and 1.0 once there are enough."""
    alignment = with_sample(attitude.alignment, reading.specific_force, reading.rate)
    q_nb = levelled(alignment.specific_force, inputs.heading_aid)
    done = where(alignment.samples > k.alignment_samples - 0.5, 1.0, 0.0)
    nulled, found = nulled_bias(alignment, q_nb, p.latitude, p.alignment)
    mean = 1.0 / alignment.samples
    rest = RestState(scale(mean, alignment.rate), scale(mean, alignment.specific_force), p.alignment.duration)
    fusion = p.solver.fusion
    fused = initial_fusion(
        fusion,
        nulled,
        where(found > 0.5, minimum(k.nulled_deviation, fusion.initial_bias), fusion.initial_bias),
        where(found > 0.5, 0.0, 3.0 * fusion.initial_bias),
        rest,
    )
    return _Start(q_nb, choose(done > 0.5, nulled, ZERO3), fused, alignment), done


Solution = tuple[Quaternion, Vector3, FusionState]


def _integrated(attitude: AttitudeState, reading: ReadingState, p: Parameters) -> Quaternion:
    earth = multiply_transposed(matrix_from_quaternion(attitude.q_nb), earth_rate_n(p.latitude))
    known = add(attitude.bias, earth)
    return runge_kutta_4(
        attitude.q_nb, subtract(attitude.rate_before, known), subtract(reading.rate, known), p.processor.period
    )


def _levelling(attitude: AttitudeState, reading: ReadingState, p: Parameters) -> Solution:
    yaw = euler_from_matrix(matrix_from_quaternion(_integrated(attitude, reading, p))).yaw
    return levelled(reading.specific_force, yaw), attitude.bias, attitude.fusion


def _gyro_only(attitude: AttitudeState, reading: ReadingState, p: Parameters) -> Solution:
    return _integrated(attitude, reading, p), attitude.bias, attitude.fusion


def _fused(attitude: AttitudeState, reading: ReadingState, p: Parameters) -> Solution:
    before = Fused(attitude.q_nb, attitude.bias, attitude.fusion)
    return fused_step(
        before,
        reading.rate,
        reading.specific_force,
        p.solver.fusion,
        p.latitude,
        p.processor.period,
    )


def _solver(running: Callable[[AttitudeState, ReadingState, Parameters], Solution]) -> TaskStep:
    def step(state: State, inputs: Inputs, p: Parameters, k: Coefficients, _draws: tuple[Any, ...]) -> State:
        attitude, reading = state.attitude, state.reading
        start, done = _aligning(attitude, reading, inputs, p, k)
        aligned = attitude.aligned > 0.5
        now = choose(aligned, _Start(*running(attitude, reading, p), attitude.alignment), start)
        solved = AttitudeState(
            where(aligned, 1.0, done), now.alignment, now.q_nb, attitude.rate_before, now.bias, now.fusion
        )
        return State(state.gyro, state.accelerometer, state.slow, reading, solved, state.filter)

    return step


def _filter(
    filtered: Callable[[Euler, Vector3, Euler, FilterParameters], tuple[Euler, Vector3]],
) -> TaskStep:
    def step(state: State, _inputs: Inputs, p: Parameters, _k: Coefficients, _draws: tuple[Any, ...]) -> State:
        solved = euler_from_matrix(matrix_from_quaternion(state.attitude.q_nb))
        before = state.filter
        begun = before.started > 0.5
        start = Euler(*[where(begun, y, angle) for y, angle in zip(before.euler, solved, strict=True)])
        euler, variance = filtered(start, before.variance, solved, p.filter)
        return State(
            state.gyro,
            state.accelerometer,
            state.slow,
            state.reading,
            state.attitude,
            FilterState(1.0, euler, variance),
        )

    return step


def _unfiltered(_before: Euler, variance: Vector3, solved: Euler, _p: FilterParameters) -> tuple[Euler, Vector3]:
    return solved, variance


def _rc(before: Euler, variance: Vector3, solved: Euler, p: FilterParameters) -> tuple[Euler, Vector3]:
    return Euler(*[rc_filtered(y, angle, p.rc.num) for y, angle in zip(before, solved, strict=True)]), variance


def _kalman(before: Euler, variance: Vector3, solved: Euler, p: FilterParameters) -> tuple[Euler, Vector3]:
    pairs = [
        kalman_filtered(y, v, angle, p.kalman.Q, p.kalman.R)
        for y, v, angle in zip(before, variance, solved, strict=True)
    ]
    return Euler(*[y for y, _ in pairs]), each_axis(lambda i: pairs[i][1])


def outputs(state: State, _p: Parameters, _k: Coefficients) -> Outputs:
    """Angles, signals as read and registers, as they stand after the last reading."""
    attitude, reading = state.attitude, state.reading
    beyond = maximum(
        maximum(state.gyro[0].over_range, state.gyro[1].over_range),
        maximum(state.gyro[2].over_range, state.accelerometer.over_range),
    )
    return Outputs(
        euler=state.filter.euler,
        quaternion=attitude.q_nb,
        rate_measured=reading.rate,
        rate_corrected=subtract(reading.rate, attitude.bias),
        gyro_bias=attitude.bias,
        specific_force_measured=reading.specific_force,
        register=RegisterOutputs(
            (state.gyro[0].code, state.gyro[1].code, state.gyro[2].code), state.accelerometer.code
        ),
        die_temperature=DieTemperatureOutputs(state.slow.gyro_temperature, state.slow.accelerometer_temperature),
        aligned=attitude.aligned > 0.5,
        status=where(
            attitude.aligned > 0.5,
            where(beyond > 0.5, STATUS.value("over_range"), STATUS.value("running")),
            STATUS.value("aligning"),
        ),
    )


def _rules() -> tuple[Rule, ...]:
    """Range and resolution must fit the parts' register words."""

    def longest(part: str, bits: int) -> Callable[[Parameters], tuple[Scalar, Scalar]]:
        return lambda p: (0.0, 2.0 ** (bits - 1) * getattr(p, part).resolution * (1.0 + 1e-9))

    parts = (("gyro", gyros.WORD_LENGTH), ("accelerometer", accelerometers.WORD_LENGTH))
    why = "the register word ends at {codes} LSB of {part}.resolution"
    return tuple(
        Rule(f"{part}.range", why.format(codes=2 ** (bits - 1), part=part), longest(part, bits)) for part, bits in parts
    )


def _senses_per_register(_k: Coefficients) -> int:
    return gyros.SENSES_PER_REGISTER


MODEL = Model(
    name="AttitudeSensor",
    description="Six-axis MEMS attitude sensor: three ADXRS450, one ADXL355, filters and attitude solver",
    Parameters=Parameters,
    Coefficients=Coefficients,
    Inputs=Inputs,
    State=State,
    Outputs=Outputs,
    coefficients=coefficients,
    initial_state=initial_state,
    outputs=outputs,
    clocks=(
        Clock("slow", lambda _k: SLOW_PERIOD),
        Clock("gyro_1", lambda k: k.gyro.sense_period[0]),
        Clock("gyro_2", lambda k: k.gyro.sense_period[1]),
        Clock("gyro_3", lambda k: k.gyro.sense_period[2]),
        Clock("accelerometer", lambda k: k.accelerometer.sense_period),
        Clock("processor", lambda k: k.processor_period),
    ),
    tasks=(
        Task("slow", "slow", slow_step, normals=6 * bias_instability.PROCESSES),
        *(Task(f"gyro_{axis + 1}_sense", f"gyro_{axis + 1}", _gyro_sense(axis)) for axis in range(3)),
        *(
            Task(
                f"gyro_{axis + 1}_register",
                f"gyro_{axis + 1}",
                _gyro_register(axis),
                every=_senses_per_register,
                normals=2,
            )
            for axis in range(3)
        ),
        Task("accelerometer_sense", "accelerometer", accelerometer_sense),
        Task(
            "accelerometer_register",
            "accelerometer",
            accelerometer_register,
            every=lambda k: k.accelerometer.decimation,
            normals=6,
        ),
        Task("acquire", "processor", acquire),
        Task(
            "solve",
            "processor",
            {
                SOLVER.value("levelling"): _solver(_levelling),
                SOLVER.value("gyro"): _solver(_gyro_only),
                SOLVER.value("fused"): _solver(_fused),
            },
            choice=lambda p: p.solver.kind,
        ),
        Task(
            "filter",
            "processor",
            {
                FILTER.value("none"): _filter(_unfiltered),
                FILTER.value("rc"): _filter(_rc),
                FILTER.value("kalman"): _filter(_kalman),
            },
            choice=lambda p: p.filter.kind,
            every=lambda k: k.filter_divider,
        ),
    ),
    seed=lambda p: p.seed,
    rules=_rules(),
)
