"""The attitude sensor: three ADXRS450, an ADXL355 and the processor (STM32) that filters and solves.

True body rate, specific force and temperature enter; the parts sample them at their own clocks; the processor reads
the parts' registers by its timer, aligns at rest, solves the attitude and filters the angles.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import Annotated, Any, NamedTuple

from .attitude.alignment import (
    NOTHING_SEEN,
    AlignmentParameters,
    MotionParameters,
    WatchedAlignment,
    levelled,
    nulled_bias,
    samples_for,
    with_watched_sample,
)
from .attitude.integration import INTEGRATION, INTEGRATORS, Integrator
from .attitude.rotations import (
    REFERENCE_LATITUDE,
    STANDARD_GRAVITY,
    Euler,
    earth_rate_n,
    euler_from_matrix,
    matrix_from_euler,
    matrix_from_quaternion,
)
from .attitude.velocity_aided import (
    Fused,
    FusionParameters,
    FusionState,
    RestState,
    corrected,
    initial_fusion,
    is_held,
    with_rest,
)
from .filters.ar1_kalman import Ar1KalmanParameters, Ar1KalmanState, ar1_kalman_step, initial_ar1_kalman
from .filters.kalman import KalmanParameters, kalman_filtered
from .filters.rc import RcParameters, rc_filtered
from .record import Boolean, Enumeration, Integer, Item, Matrix3, Quaternion, Real, Vector3, choose
from .scalar import PI, Scalar, both, either, maximum, minimum, sqrt, where
from .sensors import accelerometer as accelerometers
from .sensors import adis16354_words as adis16354
from .sensors import bias_instability, exchange
from .sensors import gyro as gyros
from .sensors.accelerometer import (
    ACCELEROMETER_FILTER,
    AccelerometerCoefficients,
    AccelerometerParameters,
    AccelerometerState,
    RegisterWords,
    registers,
)
from .sensors.board import BOARD
from .sensors.datasheet import REFERENCE_TEMPERATURE
from .sensors.digital_filter import TAPS, DelayLines
from .sensors.exchange import Answering, Exchange, Received
from .sensors.faults import LOST_FRAMES, FaultParameters, is_active
from .sensors.gyro import GYRO_FILTER, GyroCoefficients, GyroParameters, GyroState
from .sensors.sensitivity import hysteresis_loop, hysteresis_offset, straightened, with_temperature
from .sensors.thermal import (
    HeaterParameters,
    HeaterState,
    die_temperature,
    heated,
    initial_die_temperature,
    initial_heater,
    thermometer_code,
    thermometer_reading,
)
from .system import Clock, Model, Rule, Task
from .vectors import IDENTITY3, ZERO3, add, each_axis, multiply, multiply_transposed, scale, subtract, transpose

_NOTHING: Matrix3 = (ZERO3, ZERO3, ZERO3)
_MOST_COUNTED = 2.0**31 - 1.0
"""Largest count that an FMI integer holds."""

SLOW_PERIOD = 0.1
"""s between steps of temperature and bias instability, whose shortest time constant it is: assumption."""

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


_ALIGNING, _RUNNING, _OVER_RANGE = (STATUS.value(item.name) for item in STATUS.items)
_CIC, _DECIMATOR = GYRO_FILTER.value("cic"), ACCELEROMETER_FILTER.value("decimator")
_BARTLETT = 2
"""How an ADIS16354 senses, whatever its taps."""


class MountingParameters(NamedTuple):
    """Where the sensor sits on the body; its attitude is that of its own axes."""

    rotation: Euler = Euler(0.0, 0.0, 0.0)
    lever_arm: Annotated[
        Vector3, Real("m", "accelerometer alone, the gyros not, from where the specific force is given, body axes")
    ] = ZERO3


class ProcessorParameters(NamedTuple):
    """The processor's timer."""

    period: Annotated[float, Real("s", "nominal time between readings of the registers", min=1e-4, max=10.0)] = 0.002
    clock_error: Annotated[float, Real("1", "relative error of the timer's frequency", min=-0.05, max=0.05)] = (
        BOARD.processor_clock_error
    )


class SupplyParameters(NamedTuple):
    """What feeds the parts."""

    nominal: Annotated[float, Real("V", "supply voltage at which the offsets are given", min=0.1, max=60.0)] = 5.0


class CompensationParameters(NamedTuple):
    """What the processor takes out of the readings, with the parts' own thermometers: M diag(s)^-1 v.

    v + c v^3 = y - b - G f,  b = b0 + b1 (T - 25 degC) + b2 (T - 25 degC)^2,  s = 1 + k (T - 25 degC).
    """

    gyro_bias: Annotated[Vector3, Real("rad/s", "gyro bias taken out", display="deg/s")] = ZERO3
    gyro_bias_temperature_slope: Annotated[Vector3, Real("rad/(s.K)", "its change with temperature")] = ZERO3
    gyro_bias_temperature_curve: Annotated[Vector3, Real("rad/(s.K2)", "its change with temperature squared")] = ZERO3
    gyro_scale_temperature_slope: Annotated[
        Vector3, Real("1/K", "relative change of the gyros' sensitivity with temperature", min=-1e-3, max=1e-3)
    ] = ZERO3
    gyro_cubic: Annotated[Vector3, Real("s2/rad2", "what bends the gyros' line by its cube", min=-1.0, max=1.0)] = ZERO3
    gyro_matrix: Annotated[Matrix3, Real("1", "what the gyro readings are multiplied by")] = IDENTITY3
    g_sensitivity: Annotated[Matrix3, Real("rad.s/m", "gyro reading by specific force taken out")] = _NOTHING
    accelerometer_bias: Annotated[Vector3, Real("m/s2", "accelerometer bias taken out")] = ZERO3
    accelerometer_bias_temperature_slope: Annotated[
        Vector3, Real("m/(s2.K)", "change of the accelerometer bias with temperature")
    ] = ZERO3
    accelerometer_bias_temperature_curve: Annotated[
        Vector3, Real("m/(s2.K2)", "change of the accelerometer bias with temperature squared")
    ] = ZERO3
    accelerometer_scale_temperature_slope: Annotated[
        Vector3, Real("1/K", "relative change of the accelerometer's sensitivity with temperature", min=-1e-3, max=1e-3)
    ] = ZERO3
    accelerometer_cubic: Annotated[
        Vector3, Real("s4/m2", "what bends the accelerometer's line by its cube", min=-1e-3, max=1e-3)
    ] = ZERO3
    accelerometer_matrix: Annotated[Matrix3, Real("1", "what the accelerometer readings are multiplied by")] = IDENTITY3


SIGNAL_FILTER = Enumeration(
    "SignalFilter",
    (
        Item("none", "signals as read"),
        Item("ar1_kalman", "Kalman filter on AR(1) noise, each of the six channels"),
    ),
    "filter on the readings before the solver",
)


class SignalFilterParameters(NamedTuple):
    """The filter on the readings."""

    kind: Annotated[int, SIGNAL_FILTER] = SIGNAL_FILTER.value("none")
    ar1: Ar1KalmanParameters = Ar1KalmanParameters()


class SolverParameters(NamedTuple):
    """The attitude solution."""

    kind: Annotated[int, SOLVER] = SOLVER.value("fused")
    integration: Annotated[int, INTEGRATION] = INTEGRATION.value("mean_rate")
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
    supply: SupplyParameters = SupplyParameters()
    heater: HeaterParameters = HeaterParameters()
    fault: tuple[FaultParameters, FaultParameters] = (FaultParameters(), FaultParameters())
    compensation: CompensationParameters = CompensationParameters()
    processor: ProcessorParameters = ProcessorParameters()
    alignment: AlignmentParameters = AlignmentParameters()
    motion: MotionParameters = MotionParameters()
    signal_filter: SignalFilterParameters = SignalFilterParameters()
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
        REFERENCE_TEMPERATURE
    )
    supply_voltage: Annotated[float, Real("V", "voltage that feeds the parts", min=0.0, max=60.0)] = 5.0
    heading_aid: Annotated[float, Real("rad", "outside yaw, used once at the end of the alignment", display="deg")] = (
        0.0
    )


class WanderingOffset(NamedTuple):
    """What moves a part's offset slowly, on each axis; whose offset it is gives the unit."""

    instability: bias_instability.Processes
    walk: Vector3
    turn_on: Vector3


class SlowState(NamedTuple):
    """Temperatures and wandering offsets, stepped slowly."""

    started: Annotated[float, Boolean("the bias instability and the turn-on bias have been drawn")]
    gyro_wander: Annotated[WanderingOffset, Real("rad/s", "wandering gyro offset", display="deg/s")]
    accelerometer_wander: Annotated[WanderingOffset, Real("m/s2", "wandering accelerometer offset")]
    heater: HeaterState
    gyro_temperature: Annotated[float, Real("K", "die temperature of the gyros", display="degC")]
    accelerometer_temperature: Annotated[float, Real("K", "die temperature of the accelerometer", display="degC")]
    gyro_loop: Annotated[float, Real("K", "hysteresis loop of the gyros", display="degC")]
    accelerometer_loop: Annotated[float, Real("K", "hysteresis loop of the accelerometer", display="degC")]
    gyro_offset: Annotated[Vector3, Real("rad/s", "all that the gyros read too much at rest", display="deg/s")]
    accelerometer_offset: Annotated[Vector3, Real("m/s2", "all that the accelerometer reads too much")]
    supply_voltage: Annotated[float, Real("V", "voltage that feeds the parts")]
    gyro_scale: Annotated[Vector3, Real("1", "sensitivity of the gyros over that at 25 degC")]
    accelerometer_scale: Annotated[Vector3, Real("1", "sensitivity of the accelerometer over that at 25 degC")]


class ReadingState(NamedTuple):
    """What the processor read last; a lost word leaves its channel as it was."""

    rate: Annotated[Vector3, Real("rad/s", "rate as read", display="deg/s")]
    specific_force: Annotated[Vector3, Real("m/s2", "specific force as read")]
    gyro_words: Annotated[Vector3, Real("1", "gyro words until the last reading")]
    accelerometer_words: Annotated[Vector3, Real("1", "accelerometer words until the last reading")]
    received: Received
    repeated: Annotated[float, Integer("words that were read more than once")]
    missed: Annotated[float, Integer("words that were never read")]
    readings: Annotated[float, Real("1", "readings so far")]


class AttitudeState(NamedTuple):
    """The attitude solution."""

    aligned: Annotated[float, Boolean("the alignment has ended")]
    alignment: WatchedAlignment
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
    signal: Ar1KalmanState
    attitude: AttitudeState
    filter: FilterState
    gyro_lines: tuple[DelayLines, DelayLines, DelayLines]
    accelerometer_lines: tuple[DelayLines, DelayLines, DelayLines]


class RegisterOutputs(NamedTuple):
    """Codes in the parts' registers as they are now, and the words in which the processor received them last."""

    rate: Annotated[Vector3, Integer("RATE registers of the three gyros")]
    acceleration: Annotated[Vector3, Integer("XDATA, YDATA, ZDATA of the accelerometer")]
    gyro_temperature: Annotated[float, Integer("code of the gyros' thermometer; simplified: one for all three")]
    accelerometer_temperature: Annotated[float, Integer("code of the accelerometer's thermometer")]
    gyro_word: Annotated[
        Vector3, Integer("as last received from the gyro: ADXRS450 32-bit response as signed, ADIS16354 16-bit word")
    ]
    accelerometer_word: Annotated[
        Vector3, Integer("as last received from the accelerometer: ADXL355 24-bit, ADIS16354 16-bit word")
    ]
    status_word: Annotated[float, Integer("STATUS of an ADIS16354 as last received, 0 for the other parts")]


class SampleOutputs(NamedTuple):
    """What the beat between the parts' clocks and the processor's does, counted over all six channels."""

    repeated: Annotated[float, Integer("words that the processor read more than once")]
    missed: Annotated[float, Integer("words that the processor never read")]


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
    sample: SampleOutputs
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


class _Part(NamedTuple):
    """What the temperature makes of a part: offset and scale on each axis."""

    offset: Vector3
    scale: Vector3


def _at_temperature(
    part: GyroParameters | AccelerometerParameters, temperature: Scalar, loop: Scalar, volts: Scalar
) -> _Part:
    """Offset and scale of a part by temperature, its history and supply; what wanders comes on top."""
    common = hysteresis_offset(loop, temperature, part.hysteresis_width, part.hysteresis)
    common = common + part.supply_sensitivity * volts

    def offset(axis: int) -> Scalar:
        slope, curve = part.bias_temperature_slope[axis], part.bias_temperature_curve[axis]
        return with_temperature(part.bias[axis], slope, curve, temperature) + common

    def factor(axis: int) -> Scalar:
        slope, curve = part.scale_temperature_slope[axis], part.scale_temperature_curve[axis]
        return with_temperature(1.0, slope, curve, temperature)

    return _Part(each_axis(offset), each_axis(factor))


def _force_at_part(inputs: Inputs, p: Parameters) -> Vector3:
    return accelerometers.at_lever_arm(
        inputs.specific_force, inputs.rate, inputs.angular_acceleration, p.mounting.lever_arm
    )


_STILL = WanderingOffset(bias_instability.STILL, ZERO3, ZERO3)


def _initial_slow(p: Parameters, inputs: Inputs) -> SlowState:
    gyro_temperature = initial_die_temperature(p.gyro.thermal, inputs.temperature)
    part_temperature = initial_die_temperature(p.accelerometer.thermal, inputs.temperature)
    volts = inputs.supply_voltage - p.supply.nominal
    gyro = _at_temperature(p.gyro, gyro_temperature, gyro_temperature, volts)
    part = _at_temperature(p.accelerometer, part_temperature, part_temperature, volts)
    return SlowState(
        0.0,
        _STILL,
        _STILL,
        initial_heater(inputs.temperature),
        gyro_temperature,
        part_temperature,
        gyro_temperature,
        part_temperature,
        gyro.offset,
        part.offset,
        inputs.supply_voltage,
        gyro.scale,
        part.scale,
    )


def initial_state(p: Parameters, k: Coefficients, inputs: Inputs) -> State:
    """The sensor switched on at these inputs: parts settled, noise and alignment yet to begin."""
    slow = _initial_slow(p, inputs)
    force = _force_at_part(inputs, p)
    gyro = each_axis(
        lambda axis: gyros.initial_gyro(
            axis, inputs.rate, inputs.specific_force, slow.gyro_offset[axis], slow.gyro_scale[axis], p.gyro, k.gyro
        )
    )
    part, part_lines = accelerometers.initial_accelerometer(
        force, slow.accelerometer_offset, slow.accelerometer_scale, p.accelerometer, k.accelerometer
    )
    states = (gyro[0][0], gyro[1][0], gyro[2][0])
    words = part.latest
    read = _read(states, words, slow, inputs, p, k)
    now = _exchange(0.0, _ALL_NEW, _ALL_NEW, slow, p)
    received = choose(
        p.gyro.filter == _CIC,
        exchange.of_adxrs450_and_adxl355(states, words, now),
        exchange.of_adis16354(states, words, now),
    )
    reading = ReadingState(read.rate, read.specific_force, ZERO3, ZERO3, received, 0.0, 0.0, 0.0)
    q_nb = levelled(reading.specific_force, inputs.heading_aid)
    euler = euler_from_matrix(matrix_from_quaternion(q_nb))
    filtered = Euler(*[where(p.filter.from_zero > 0.5, 0.0, angle) for angle in euler])
    return State(
        gyro=states,
        accelerometer=part,
        slow=slow,
        reading=reading,
        signal=initial_ar1_kalman(reading.rate, reading.specific_force, p.signal_filter.ar1),
        attitude=AttitudeState(
            aligned=0.0,
            alignment=NOTHING_SEEN,
            q_nb=q_nb,
            rate_before=reading.rate,
            bias=ZERO3,
            fusion=initial_fusion(
                p.solver.fusion, ZERO3, p.solver.fusion.initial_bias, 0.0, RestState(ZERO3, reading.specific_force, 0.0)
            ),
        ),
        filter=FilterState(where(p.filter.from_zero > 0.5, 1.0, 0.0), filtered, (p.filter.kalman.R,) * 3),
        gyro_lines=(gyro[0][1], gyro[1][1], gyro[2][1]),
        accelerometer_lines=part_lines,
    )


# --- the parts -------------------------------------------------------------------------------------------------------


def _with_gyro(state: State, axis: int, gyro: GyroState) -> State:
    three = state.gyro
    replaced = (
        (gyro, three[1], three[2]) if axis == 0 else (three[0], gyro, three[2]) if axis == 1 else (*three[:2], gyro)
    )
    return State(replaced, *state[1:])


TaskStep = Callable[[State, Inputs, Parameters, Coefficients, tuple[Any, ...]], State]


def _gyro_sense(axis: int, kind: Callable[[int], gyros.Sense]) -> TaskStep:
    sense = kind(axis)

    def step(state: State, inputs: Inputs, p: Parameters, k: Coefficients, _draws: tuple[Any, ...]) -> State:
        factor = state.slow.gyro_scale[axis]
        return _with_gyro(
            state, axis, sense(state.gyro[axis], inputs.rate, inputs.specific_force, factor, p.gyro, k.gyro)
        )

    return step


def _gyro_register(axis: int) -> TaskStep:
    register = gyros.register(axis)

    def step(state: State, _inputs: Inputs, p: Parameters, k: Coefficients, draws: tuple[Any, ...]) -> State:
        offset = state.slow.gyro_offset[axis]
        return _with_gyro(state, axis, register(state.gyro[axis], offset, p.gyro, k.gyro, p.fault, draws))

    return step


def _gyro_sample(axis: int, taps: int) -> TaskStep:
    sample = gyros.sample(axis, taps)

    def step(state: State, _inputs: Inputs, p: Parameters, k: Coefficients, draws: tuple[Any, ...]) -> State:
        lines, offset = state.gyro_lines, state.slow.gyro_offset[axis]
        gyro, after = sample(state.gyro[axis], lines[axis], offset, p.gyro, k.gyro, p.fault, draws)
        replaced = (
            (after, *lines[1:]) if axis == 0 else (lines[0], after, lines[2]) if axis == 1 else (*lines[:2], after)
        )
        return _with_gyro(state, axis, gyro)._replace(gyro_lines=replaced)

    return step


def _accelerometer_sense(sense: accelerometers.Sense) -> TaskStep:
    def step(state: State, inputs: Inputs, p: Parameters, k: Coefficients, _draws: tuple[Any, ...]) -> State:
        factor = state.slow.accelerometer_scale
        part = sense(state.accelerometer, _force_at_part(inputs, p), factor, p.accelerometer, k.accelerometer)
        return State(state.gyro, part, *state[2:])

    return step


def accelerometer_register(
    state: State, _inputs: Inputs, p: Parameters, k: Coefficients, draws: tuple[Any, ...]
) -> State:
    """The decimating accelerometer finishes an output word."""
    part = accelerometers.register(
        state.accelerometer, state.slow.accelerometer_offset, p.accelerometer, k.accelerometer, p.fault, draws
    )
    return State(state.gyro, part, *state[2:])


def _accelerometer_sample(taps: int) -> TaskStep:
    sample = accelerometers.sample(taps)

    def step(state: State, _inputs: Inputs, p: Parameters, k: Coefficients, draws: tuple[Any, ...]) -> State:
        part, lines = sample(
            state.accelerometer,
            state.accelerometer_lines,
            state.slow.accelerometer_offset,
            p.accelerometer,
            k.accelerometer,
            p.fault,
            draws,
        )
        return State(state.gyro, part, *state[2:-1], lines)

    return step


_WANDER_DRAWS = 3 * bias_instability.PROCESSES + 6
"""Normals that an offset's wandering takes a step: the processes, the walk, the turn-on bias."""


def _wandered(
    wander: WanderingOffset,
    part: GyroParameters | AccelerometerParameters,
    sigma: Scalar,
    started: Scalar,
    draws: tuple[Any, ...],
) -> WanderingOffset:
    """Instability, random walk and turn-on bias one slow period later; the first call draws what they start from."""
    begun = started > 0.5
    decay = tuple(where(begun, a, 0.0) for a in bias_instability.decays(SLOW_PERIOD))
    step = part.rate_random_walk * SLOW_PERIOD**0.5
    first = 3 * bias_instability.PROCESSES
    return WanderingOffset(
        bias_instability.stepped(wander.instability, decay, sigma, draws[:first]),
        each_axis(lambda i: wander.walk[i] + step * draws[first + i]),
        each_axis(lambda i: where(begun, wander.turn_on[i], part.turn_on_bias * draws[first + 3 + i])),
    )


def _total(wander: WanderingOffset) -> Vector3:
    return add(bias_instability.total(wander.instability), add(wander.walk, wander.turn_on))


def slow_step(state: State, inputs: Inputs, p: Parameters, k: Coefficients, draws: tuple[Any, ...]) -> State:
    """Temperatures, offsets and sensitivities go on by one slow period."""
    slow = state.slow
    gyro_wander = _wandered(slow.gyro_wander, p.gyro, k.gyro.instability_sigma, slow.started, draws[:_WANDER_DRAWS])
    part_wander = _wandered(
        slow.accelerometer_wander,
        p.accelerometer,
        k.accelerometer.instability_sigma,
        slow.started,
        draws[_WANDER_DRAWS:],
    )
    heater = heated(slow.heater, p.heater, inputs.temperature, SLOW_PERIOD)
    gyro_temperature = die_temperature(p.gyro.thermal, slow.gyro_temperature, heater.temperature, SLOW_PERIOD)
    part_temperature = die_temperature(
        p.accelerometer.thermal, slow.accelerometer_temperature, heater.temperature, SLOW_PERIOD
    )
    gyro_loop = hysteresis_loop(slow.gyro_loop, gyro_temperature, p.gyro.hysteresis_width)
    part_loop = hysteresis_loop(slow.accelerometer_loop, part_temperature, p.accelerometer.hysteresis_width)
    volts = inputs.supply_voltage - p.supply.nominal
    gyro = _at_temperature(p.gyro, gyro_temperature, gyro_loop, volts)
    part = _at_temperature(p.accelerometer, part_temperature, part_loop, volts)
    after = SlowState(
        1.0,
        gyro_wander,
        part_wander,
        heater,
        gyro_temperature,
        part_temperature,
        gyro_loop,
        part_loop,
        add(gyro.offset, _total(gyro_wander)),
        add(part.offset, _total(part_wander)),
        inputs.supply_voltage,
        gyro.scale,
        part.scale,
    )
    return State(state.gyro, state.accelerometer, after, *state[3:])


# --- the processor ---------------------------------------------------------------------------------------------------


class _Read(NamedTuple):
    rate: Vector3
    specific_force: Vector3


def _compensated(rate: Vector3, force: Vector3, slow: SlowState, p: Parameters) -> _Read:
    """Readings without what the processor knows to be errors, by the temperatures that the parts' thermometers read."""
    c = p.compensation
    gyro_meter, part_meter = p.gyro.thermometer, p.accelerometer.thermometer
    gyro_temperature = thermometer_reading(gyro_meter, thermometer_code(gyro_meter, slow.gyro_temperature))
    part_temperature = thermometer_reading(part_meter, thermometer_code(part_meter, slow.accelerometer_temperature))

    def part_bias(i: int) -> Scalar:
        slope, curve = c.accelerometer_bias_temperature_slope[i], c.accelerometer_bias_temperature_curve[i]
        return with_temperature(c.accelerometer_bias[i], slope, curve, part_temperature)

    def gyro_bias(i: int) -> Scalar:
        slope, curve = c.gyro_bias_temperature_slope[i], c.gyro_bias_temperature_curve[i]
        return with_temperature(c.gyro_bias[i], slope, curve, gyro_temperature)

    unbiased = subtract(force, each_axis(part_bias))
    straight = each_axis(lambda i: straightened(unbiased[i], c.accelerometer_cubic[i]))
    scaled = _at_reference_scale(straight, c.accelerometer_scale_temperature_slope, part_temperature)
    true_force = multiply(c.accelerometer_matrix, scaled)
    unmoved = subtract(subtract(rate, each_axis(gyro_bias)), multiply(c.g_sensitivity, true_force))
    turning = each_axis(lambda i: straightened(unmoved[i], c.gyro_cubic[i]))
    true_rate = multiply(c.gyro_matrix, _at_reference_scale(turning, c.gyro_scale_temperature_slope, gyro_temperature))
    return _Read(true_rate, true_force)


def _at_reference_scale(reading: Vector3, slope: Vector3, temperature: Scalar) -> Vector3:
    """diag(1 + k (T - 25 degC))^-1 y; what a thermometer of no use reads is kept from the division."""
    return each_axis(lambda i: reading[i] / maximum(1.0 + slope[i] * (temperature - REFERENCE_TEMPERATURE), 0.5))


def _read(
    gyro: tuple[GyroState, GyroState, GyroState],
    part: RegisterWords,
    slow: SlowState,
    inputs: Inputs,
    p: Parameters,
    k: Coefficients,
) -> _Read:
    """Registers in SI units, compensated; an ideal part shows the truth instead."""
    rate = each_axis(lambda i: gyro[i].code * p.gyro.resolution)
    force = each_axis(lambda i: part.code[i] * p.accelerometer.resolution)
    read = _compensated(rate, force, slow, p)
    truth = _Read(multiply(k.C_sb, inputs.rate), multiply(k.C_sb, _force_at_part(inputs, p)))
    return _Read(
        each_axis(lambda i: where(p.ideal > 0.5, truth.rate[i], read.rate[i])),
        each_axis(lambda i: where(p.ideal > 0.5, truth.specific_force[i], read.specific_force[i])),
    )


def _lost(p: Parameters, time: Scalar) -> tuple[Vector3, Vector3]:
    """1.0 for each gyro and each axis of the accelerometer whose word does not reach the processor."""
    silent = [where(both(fault.kind == LOST_FRAMES, is_active(fault, time)), fault.channel, 0.0) for fault in p.fault]

    def lost(channel: int) -> Scalar:
        return where(either(silent[0] == channel + 1, silent[1] == channel + 1), 1.0, 0.0)

    return each_axis(lost), each_axis(lambda i: lost(3 + i))


_ALL_NEW: Vector3 = (1.0, 1.0, 1.0)


def _exchange(number: Scalar, gyro_is_new: Vector3, part_is_new: Vector3, slow: SlowState, p: Parameters) -> Exchange:
    return Exchange(number, gyro_is_new, part_is_new, slow.supply_voltage, where(p.gyro.self_test > 0.5, 1.0, 0.0))


def _unless(lost: Vector3, arrived: Vector3, before: Vector3) -> Vector3:
    """What has arrived; where a word was lost, what was there before."""
    return each_axis(lambda i: where(lost[i] > 0.5, before[i], arrived[i]))


def _acquire(answering: Answering) -> TaskStep:
    """The processor's timer fires: the parts answer; words are counted that come twice or not at all."""

    def step(state: State, inputs: Inputs, p: Parameters, k: Coefficients, _draws: tuple[Any, ...]) -> State:
        before, part = state.reading, registers(state.accelerometer, k.accelerometer)
        attitude = state.attitude._replace(rate_before=state.signal.rate.estimate)
        read = _read(state.gyro, part, state.slow, inputs, p, k)
        readings = before.readings + 1.0
        time = readings * k.processor_period
        lost_rate, lost_force = _lost(p, time)
        # a lost word has not been read: it counts as missed once one arrives again
        gyro_words = _unless(lost_rate, each_axis(lambda i: state.gyro[i].words), before.gyro_words)
        count = state.accelerometer.words
        part_words = _unless(lost_force, (count, count, count), before.accelerometer_words)
        new_rates = subtract(gyro_words, before.gyro_words)
        new_forces = subtract(part_words, before.accelerometer_words)
        repeated, missed = before.repeated, before.missed
        real = where(p.ideal > 0.5, 0.0, 1.0)
        for new, gone in zip((*new_rates, *new_forces), (*lost_rate, *lost_force), strict=True):
            repeated = repeated + where(new + gone < 0.5, real, 0.0)
            missed = missed + maximum(new - 1.0, 0.0)
        now = _exchange(
            readings,
            each_axis(lambda i: where(new_rates[i] > 0.5, 1.0, 0.0)),
            each_axis(lambda i: where(new_forces[i] > 0.5, 1.0, 0.0)),
            state.slow,
            p,
        )
        arrived = answering(state.gyro, part, now)
        reading = ReadingState(
            _unless(lost_rate, read.rate, before.rate),
            _unless(lost_force, read.specific_force, before.specific_force),
            gyro_words,
            part_words,
            Received(
                _unless(lost_rate, arrived.gyro, before.received.gyro),
                _unless(lost_force, arrived.accelerometer, before.received.accelerometer),
                arrived.status,
            ),
            minimum(repeated, _MOST_COUNTED),
            minimum(missed, _MOST_COUNTED),
            readings,
        )
        return State(*state[:3], reading, state.signal, attitude, *state[6:])

    return step


def _signals_as_read(state: State, _inputs: Inputs, _p: Parameters, _k: Coefficients, _draws: tuple[Any, ...]) -> State:
    rate, force = state.reading.rate, state.reading.specific_force
    signal = Ar1KalmanState(
        state.signal.rate._replace(estimate=rate, reading=rate),
        state.signal.specific_force._replace(estimate=force, reading=force),
    )
    return State(*state[:4], signal, *state[5:])


def _signals_filtered(state: State, _inputs: Inputs, p: Parameters, _k: Coefficients, _draws: tuple[Any, ...]) -> State:
    reading = state.reading
    signal = ar1_kalman_step(state.signal, reading.rate, reading.specific_force, p.signal_filter.ar1)
    return State(*state[:4], signal, *state[5:])


class _Start(NamedTuple):
    """The solution that an alignment gives."""

    q_nb: Quaternion
    bias: Vector3
    fusion: FusionState
    alignment: WatchedAlignment


def _aligning(
    attitude: AttitudeState,
    reading: ReadingState,
    nulled_parts: Scalar,
    inputs: Inputs,
    p: Parameters,
    k: Coefficients,
) -> tuple[_Start, Scalar]:
    """The start of the solution after one more reading at rest, and 1.0 once there are enough.

    Readings count from when the parts have ended their own bias null.
    """
    seen = with_watched_sample(attitude.alignment, reading.specific_force, reading.rate, p.motion, p.processor.period)
    watched = choose(nulled_parts > 0.5, seen, attitude.alignment)
    alignment = watched.sums
    q_nb = levelled(alignment.specific_force, inputs.heading_aid)
    done = where(alignment.samples > k.alignment_samples - 0.5, 1.0, 0.0)
    nulled, found = nulled_bias(alignment, q_nb, p.latitude, p.alignment)
    mean = 1.0 / maximum(alignment.samples, 1.0)
    rest = RestState(scale(mean, alignment.rate), scale(mean, alignment.specific_force), p.alignment.duration)
    fusion = p.solver.fusion
    fused = initial_fusion(
        fusion,
        nulled,
        where(found > 0.5, minimum(k.nulled_deviation, fusion.initial_bias), fusion.initial_bias),
        where(found > 0.5, 0.0, 3.0 * fusion.initial_bias),
        rest,
    )
    return _Start(q_nb, choose(done > 0.5, nulled, ZERO3), fused, watched), done


def _look_for_rest(state: State, _inputs: Inputs, p: Parameters, _k: Coefficients, _draws: tuple[Any, ...]) -> State:
    attitude, signal = state.attitude, state.signal
    rate, force = signal.rate.estimate, signal.specific_force.estimate
    a, h = p.solver.fusion, p.processor.period
    fusion = with_rest(attitude.fusion, attitude.q_nb, rate, force, a, p.latitude, h)
    return State(*state[:5], attitude._replace(fusion=fusion), *state[6:])


def _integration(integrate: Integrator) -> TaskStep:
    """The attitude goes on by the rates of the last two readings; the solver has the last word on it."""

    def step(state: State, _inputs: Inputs, p: Parameters, _k: Coefficients, _draws: tuple[Any, ...]) -> State:
        attitude = state.attitude
        earth = multiply_transposed(matrix_from_quaternion(attitude.q_nb), earth_rate_n(p.latitude))
        known = add(attitude.bias, earth)
        before, now = subtract(attitude.rate_before, known), subtract(state.signal.rate.estimate, known)
        held = both(p.solver.kind == SOLVER.value("fused"), is_held(attitude.fusion, p.solver.fusion))
        q_nb = choose(held, attitude.q_nb, integrate(attitude.q_nb, before, now, p.processor.period))
        return State(*state[:5], attitude._replace(q_nb=q_nb), *state[6:])

    return step


Solver = Callable[[AttitudeState, _Read, Parameters], Fused]
"""The solution after one more reading, to which q_nb has been integrated."""


def _levelling(attitude: AttitudeState, signal: _Read, _p: Parameters) -> Fused:
    yaw = euler_from_matrix(matrix_from_quaternion(attitude.q_nb)).yaw
    return Fused(levelled(signal.specific_force, yaw), attitude.bias, attitude.fusion)


def _gyro_only(attitude: AttitudeState, _signal: _Read, _p: Parameters) -> Fused:
    return Fused(attitude.q_nb, attitude.bias, attitude.fusion)


def _fused(attitude: AttitudeState, signal: _Read, p: Parameters) -> Fused:
    integrated = Fused(attitude.q_nb, attitude.bias, attitude.fusion)
    return corrected(integrated, signal.rate, signal.specific_force, p.solver.fusion, p.latitude, p.processor.period)


def _solver(running: Solver) -> TaskStep:
    def step(state: State, inputs: Inputs, p: Parameters, k: Coefficients, _draws: tuple[Any, ...]) -> State:
        attitude = state.attitude
        gyro = state.gyro
        nulled_parts = minimum(gyro[0].null.done, minimum(gyro[1].null.done, gyro[2].null.done))
        start, done = _aligning(attitude, state.reading, nulled_parts, inputs, p, k)
        aligned = attitude.aligned > 0.5
        signal = _Read(state.signal.rate.estimate, state.signal.specific_force.estimate)
        now = choose(aligned, _Start(*running(attitude, signal, p), attitude.alignment), start)
        solved = AttitudeState(
            where(aligned, 1.0, done), now.alignment, now.q_nb, attitude.rate_before, now.bias, now.fusion
        )
        return State(*state[:5], solved, *state[6:])

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
        return State(*state[:6], FilterState(1.0, euler, variance), *state[7:])

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


def _registers(state: State, part: RegisterWords, p: Parameters) -> RegisterOutputs:
    words = exchange.shown_words(state.reading.received, p.gyro.filter == _CIC)
    return RegisterOutputs(
        each_axis(lambda i: state.gyro[i].code),
        part.code,
        thermometer_code(p.gyro.thermometer, state.slow.gyro_temperature),
        thermometer_code(p.accelerometer.thermometer, state.slow.accelerometer_temperature),
        *words,
    )


def outputs(state: State, p: Parameters, k: Coefficients) -> Outputs:
    """Angles and signals as they stand after the last reading, registers as they are now."""
    attitude, reading = state.attitude, state.reading
    part = registers(state.accelerometer, k.accelerometer)
    beyond = maximum(
        maximum(state.gyro[0].over_range, state.gyro[1].over_range),
        maximum(state.gyro[2].over_range, part.over_range),
    )
    return Outputs(
        euler=state.filter.euler,
        quaternion=attitude.q_nb,
        rate_measured=reading.rate,
        rate_corrected=subtract(reading.rate, attitude.bias),
        gyro_bias=attitude.bias,
        specific_force_measured=reading.specific_force,
        register=_registers(state, part, p),
        sample=SampleOutputs(reading.repeated, reading.missed),
        die_temperature=DieTemperatureOutputs(state.slow.gyro_temperature, state.slow.accelerometer_temperature),
        aligned=attitude.aligned > 0.5,
        status=where(
            attitude.aligned > 0.5,
            where(beyond > 0.5, _OVER_RANGE, _RUNNING),
            _ALIGNING,
        ),
    )


_RANGE_ROUNDING = 5e-6
"""Part of a range by which six digits of it may be off."""


def _offered_range(p: Parameters) -> tuple[Scalar, Scalar]:
    """The range that an ADIS16354 offers with its taps, the nearest; of another part whatever it is."""
    exponent = p.gyro.filter - GYRO_FILTER.value("bartlett_1")
    offered = where(p.gyro.filter == _CIC, p.gyro.range, adis16354.nearest_range(p.gyro.range, exponent))
    return offered * (1.0 - _RANGE_ROUNDING), offered * (1.0 + _RANGE_ROUNDING)


def _gyros_filter(p: Parameters) -> tuple[Scalar, Scalar]:
    """The accelerometer's filter that goes with that of the gyros: the same taps, or CIC and decimator."""
    return p.gyro.filter, p.gyro.filter


def _offered_divider(p: Parameters) -> tuple[Scalar, Scalar]:
    """The nearest divider that SMPL_PRD can make; of another part whatever it is."""
    offered = where(p.gyro.filter == _CIC, p.gyro.divider, adis16354.nearest_divider(p.gyro.divider))
    return offered, offered


def _gyros_divider(p: Parameters) -> tuple[Scalar, Scalar]:
    """The divider of the gyros; for another part whatever the accelerometer's is."""
    wanted = where(p.gyro.filter == _CIC, p.accelerometer.divider, p.gyro.divider)
    return wanted, wanted


def _rules() -> tuple[Rule, ...]:
    """Range, taps, divider and resolution must fit the parts; a fault must begin before it ends."""
    faults = tuple(
        Rule(
            f"fault[{i + 1}].start",
            "later than its end",
            lambda p, i=i: (0.0, p.fault[i].end),  # type: ignore[misc]
        )
        for i in range(2)
    )
    return (
        Rule("gyro.range", f"SENS/AVG of an ADIS16354 offers {adis16354.ranges_in_words()}", _offered_range),
        Rule(
            "accelerometer.filter",
            "one SENS/AVG sets the taps of an ADIS16354's gyros and accelerometers (ADIS16350/55 Rev. B), the "
            "decimator goes with the CIC: the number is that of gyro.filter",
            _gyros_filter,
        ),
        Rule(
            "gyro.divider",
            "SMPL_PRD of an ADIS16354 makes 1 to 64 and the multiples of 31 up to 1984 (ADIS16350/55 Rev. B Table 17)",
            _offered_divider,
        ),
        Rule(
            "accelerometer.divider",
            "one SMPL_PRD sets the samples of an ADIS16354's gyros and accelerometers (ADIS16350/55 Rev. B Table 17)",
            _gyros_divider,
        ),
        Rule(
            "gyro.range",
            "the register word ends at gyro.code_limit LSB of gyro.resolution",
            lambda p: (0.0, p.gyro.code_limit * p.gyro.resolution * (1.0 + 1e-9)),
        ),
        Rule(
            "accelerometer.range",
            "the register word ends at accelerometer.code_limit LSB of accelerometer.resolution",
            lambda p: (0.0, p.accelerometer.code_limit * p.accelerometer.resolution * (1.0 + 1e-9)),
        ),
        *(
            Rule(
                f"{part}.thermometer.lowest_code",
                "above the highest code",
                lambda p, part=part: (-inf, getattr(p, part).thermometer.highest_code),  # type: ignore[misc]
            )
            for part in ("gyro", "accelerometer")
        ),
        *faults,
    )


def _gyro_tasks(axis: int) -> tuple[Task, Task, Task]:
    """A gyro senses, and every few inputs updates its register: one task for a CIC, one for Bartlett filters."""
    name = f"gyro_{axis + 1}"

    def kind(p: Parameters) -> Scalar:
        return p.gyro.filter

    def senses(k: Coefficients) -> Scalar:
        return k.gyro.senses

    ways = {GYRO_FILTER.value(f"bartlett_{taps}"): _gyro_sample(axis, taps) for taps in TAPS}
    return (
        Task(
            f"{name}_sense",
            name,
            {_CIC: _gyro_sense(axis, gyros.sense), _BARTLETT: _gyro_sense(axis, gyros.sense_bartlett)},
            lambda p: where(p.gyro.filter == _CIC, _CIC, _BARTLETT),
        ),
        Task(f"{name}_register", name, {_CIC: _gyro_register(axis)}, kind, senses, normals=4),
        Task(f"{name}_sample", name, ways, kind, senses, normals=4),
    )


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
        Task("slow", "slow", slow_step, normals=2 * _WANDER_DRAWS),
        *[task for axis in range(3) for task in _gyro_tasks(axis)],
        Task(
            "accelerometer_sense",
            "accelerometer",
            {
                _DECIMATOR: _accelerometer_sense(accelerometers.sense),
                _BARTLETT: _accelerometer_sense(accelerometers.sense_bartlett),
            },
            lambda p: where(p.accelerometer.filter == _DECIMATOR, _DECIMATOR, _BARTLETT),
        ),
        Task(
            "accelerometer_register",
            "accelerometer",
            {_DECIMATOR: accelerometer_register},
            choice=lambda p: p.accelerometer.filter,
            every=lambda k: k.accelerometer.decimation,
            normals=10,
        ),
        Task(
            "accelerometer_sample",
            "accelerometer",
            {ACCELEROMETER_FILTER.value(f"bartlett_{taps}"): _accelerometer_sample(taps) for taps in TAPS},
            choice=lambda p: p.accelerometer.filter,
            every=lambda k: k.accelerometer.decimation,
            normals=10,
        ),
        Task(
            "acquire",
            "processor",
            {_CIC: _acquire(exchange.of_adxrs450_and_adxl355), _BARTLETT: _acquire(exchange.of_adis16354)},
            choice=lambda p: where(p.gyro.filter == _CIC, _CIC, _BARTLETT),
        ),
        Task(
            "signal_filter",
            "processor",
            {
                SIGNAL_FILTER.value("none"): _signals_as_read,
                SIGNAL_FILTER.value("ar1_kalman"): _signals_filtered,
            },
            choice=lambda p: p.signal_filter.kind,
        ),
        Task("rest", "processor", {SOLVER.value("fused"): _look_for_rest}, choice=lambda p: p.solver.kind),
        Task(
            "integrate",
            "processor",
            {number: _integration(integrate) for number, integrate in INTEGRATORS.items()},
            choice=lambda p: p.solver.integration,
        ),
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
