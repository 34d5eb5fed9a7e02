"""A three-axis digital accelerometer at its own clock: ADXL355, or the accelerometers of an ADIS16354.

The signal's way: lever arm, sensitivity and mounting, overload, temperature, nonlinearity, rectification, self-test;
bandwidth; white noise; digital filter; offset, fault, range, register word. Two digital filters are offered:

* ``decimator``, the ADXL355's: first stage at 4 kHz, sinc^2 decimation to the output data rate, high-pass; the word
  appears after the filter's extra latency;
* ``bartlett_1`` to ``bartlett_64``, the ADIS16354's at every sample, four inputs a conversion.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from ..record import Boolean, Enumeration, Integer, Item, Matrix3, Real, Vector3, choose
from ..scalar import Scalar, absolute, clip, floor, maximum, minimum, round_half_up, where
from ..system import STOPPED
from ..vectors import ZERO3, add, dot, each_axis, multiply, scale
from .adxl355_sheet import ADXL355_2G, DELAYS, HIGH_PASS_CORNERS
from .bandwidth import low_pass, low_pass_gain, low_pass_share
from .bias_instability import SIGMA_PER_INSTABILITY
from .board import BOARD
from .digital_filter import (
    BARTLETT_ITEMS,
    CONVERTER_STEPS,
    BartlettSums,
    DelayLines,
    FourTaps,
    bartlett,
    converted,
    delaying_taps,
    four_tapped,
    settled_bartlett,
    sinc2_decimated,
    taps_of,
)
from .faults import FaultParameters, condition_of, faulted
from .quantiser import over_range, register_code
from .sensitivity import bent, cubic_gains, sensitivity_matrix
from .thermal import ThermalParameters, ThermometerParameters
from .white_noise import block_sums, sample_deviation

_FASTEST = ADXL355_2G.si("sampling_frequency")

OUTPUT_DATA_RATE = Enumeration(
    "OutputDataRate",
    tuple(
        Item(
            f"{_FASTEST / 2**i:.4g}_Hz".replace(".", "_"),
            f"{_FASTEST / 2**i:.4g} samples a second",
        )
        for i in range(len(DELAYS))
    ),
    "output data rate of the decimator, FILTER register [3:0]",
)
HIGH_PASS = Enumeration(
    "HighPass",
    (
        Item("none", "no high-pass"),
        *(
            Item(f"corner_{code}", f"corner at {corner.value:.4g} of the output data rate, code {code}")
            for code, corner in enumerate(HIGH_PASS_CORNERS, 1)
        ),
    ),
    "high-pass, FILTER register [6:4]",
)
ACCELEROMETER_FILTER = Enumeration(
    "AccelerometerFilter",
    (Item("decimator", "ADXL355: decimation to the output data rate"), *BARTLETT_ITEMS),
    "digital filter of the accelerometer",
)
SENSES_PER_CONVERSION = 4.0
"""Inputs taken per conversion of the part with Bartlett filters, for the sake of its bandwidth."""
FIRST_STAGE_CURVATURE = 0.32
"""1 - |H| of the first stage at a quarter of its rate: -3.6 dB at 1 kHz (Rev. D p. 26), full path."""


_SILENCE = 5e-4
"""s for which the part falls silent after an overload (Rev. D p. 24)."""


class AccelerometerParameters(NamedTuple):
    """An accelerometer and what is peculiar to this board's."""

    filter: Annotated[int, ACCELEROMETER_FILTER] = ACCELEROMETER_FILTER.value("decimator")
    range: Annotated[float, Real("m/s2", "full scale", min=1e-3)] = ADXL355_2G.si("range")
    resolution: Annotated[float, Real("m/s2", "one LSB of the data registers", min=1e-12)] = ADXL355_2G.si("resolution")
    code_limit: Annotated[float, Integer("codes run from minus this to one less", min=2, max=2**31 - 1)] = int(
        ADXL355_2G.si("code_limit")
    )
    noise_density: Annotated[float, Real("m/(s2.Hz^0.5)", "white noise, one-sided, of each axis", min=0.0)] = (
        ADXL355_2G.si("noise_density")
    )
    bias_instability: Annotated[float, Real("m/s2", "flicker of the bias, IEEE 952 B", min=0.0)] = ADXL355_2G.si(
        "bias_instability"
    )
    rate_random_walk: Annotated[float, Real("m/(s2.s^0.5)", "random walk of the bias, IEEE 952 K", min=0.0)] = 0.0
    turn_on_bias: Annotated[float, Real("m/s2", "standard deviation of the bias from run to run", min=0.0)] = 0.0
    bandwidth: Annotated[
        float,
        Real(
            "Hz",
            "analogue bandwidth ahead of the Bartlett filter, one pole; acts below sampling_frequency, not above, and "
            "not in the decimator, whose first stage has its own",
            min=1.0,
        ),
    ] = ADXL355_2G.si("bandwidth")
    sampling_frequency: Annotated[
        float, Real("Hz", "nominal rate of the first decimation, or of conversions", min=1.0, max=1e5)
    ] = _FASTEST
    divider: Annotated[
        int, Integer("conversions per sample of the Bartlett filter: 1 to 64, multiples of 31 to 1984", min=1, max=1984)
    ] = 1
    output_data_rate: Annotated[int, OUTPUT_DATA_RATE] = OUTPUT_DATA_RATE.value("500_Hz")
    high_pass: Annotated[int, HIGH_PASS] = HIGH_PASS.value("none")
    clock_error: Annotated[
        float, Real("1", "relative error of the part's clock, which starts with the run", min=-0.1, max=0.1)
    ] = BOARD.accelerometer_clock_error
    clock_jitter: Annotated[float, Real("s", "standard deviation of the moment of a sample", min=0.0, max=1e-2)] = 0.0
    bias: Annotated[Vector3, Real("m/s2", "0 g offset at 25 degC")] = BOARD.accelerometer_bias
    bias_temperature_slope: Annotated[Vector3, Real("m/(s2.K)", "change of the offset with temperature")] = (
        BOARD.accelerometer_bias_temperature_slope
    )
    bias_temperature_curve: Annotated[Vector3, Real("m/(s2.K2)", "change of the offset with temperature squared")] = (
        ZERO3
    )
    hysteresis: Annotated[float, Real("m/s2", "offset after long warming, minus it after cooling", min=0.0)] = 0.0
    hysteresis_width: Annotated[float, Real("K", "change of temperature that turns the hysteresis round", min=0.01)] = (
        5.0
    )
    supply_sensitivity: Annotated[float, Real("m/(s2.V)", "change of the offset with the supply voltage")] = 0.0
    scale_error: Annotated[Vector3, Real("1", "relative error of the sensitivity at 25 degC", min=-0.5, max=0.5)] = (
        BOARD.accelerometer_scale_error
    )
    scale_temperature_slope: Annotated[Vector3, Real("1/K", "relative change of the sensitivity with temperature")] = (
        ZERO3
    )
    scale_temperature_curve: Annotated[
        Vector3, Real("1/K2", "relative change of the sensitivity with temperature squared")
    ] = ZERO3
    nonlinearity: Annotated[
        float, Real("1", "rms deviation from the best straight line, of the full scale", min=0.0, max=0.1)
    ] = ADXL355_2G.si("nonlinearity")
    cross_axis: Annotated[Matrix3, Real("1", "share of the column's axis in the row's reading", min=-0.5, max=0.5)] = (
        BOARD.accelerometer_cross_axis
    )
    nonorthogonality: Annotated[
        Vector3,
        Real(
            "rad",
            "lean of the second axis to the first, the third to the first, the third to the second",
            min=-0.2,
            max=0.2,
        ),
    ] = ZERO3
    misalignment: Annotated[Vector3, Real("rad", "rotation vector of the triad in its package", min=-0.5, max=0.5)] = (
        ZERO3
    )
    rectification: Annotated[
        Vector3, Real("s2/m", "offset by the square of the whole specific force, at rest by g squared")
    ] = ZERO3
    overload: Annotated[
        float,
        Real("m/s2", "specific force along an axis beyond which the part is silent for half a millisecond", min=1e-3),
    ] = ADXL355_2G.si("overload")
    self_test_response: Annotated[Vector3, Real("m/s2", "specific force that the self-test feigns")] = (
        ADXL355_2G.of_each_axis("self_test_response")
    )
    self_test: Annotated[bool, Boolean("the self-test is on", tunable=True)] = False
    thermometer: ThermometerParameters = ThermometerParameters(
        ADXL355_2G.si("thermometer.sensitivity"),
        ADXL355_2G.si("thermometer.code_at_25"),
        int(ADXL355_2G.si("thermometer.lowest_code")),
        int(ADXL355_2G.si("thermometer.highest_code")),
    )
    thermal: ThermalParameters = ThermalParameters(
        ADXL355_2G.si("thermal.self_heating"), ADXL355_2G.si("thermal.warm_up")
    )


class AccelerometerCoefficients(NamedTuple):
    """What follows from the parameters."""

    sensitivity: Annotated[Matrix3, Real("1", "reading of the row's axis by body specific force of the column")]
    cubic: Annotated[
        tuple[float, float, float], Real("1", "gains of the nonlinearity: linear, cubic (s4/m2), the cubic's largest")
    ]
    self_test: Annotated[Vector3, Real("m/s2", "specific force that the self-test feigns now")]
    sense_period: Annotated[float, Real("s", "time between inputs taken")]
    word_period: Annotated[float, Real("s", "time between register words")]
    low_pass_gain: Annotated[float, Real("1", "share of a step taken over in a sense period")]
    low_pass_share: Annotated[float, Real("1", "weight of the latest input in the mean that is converted")]
    silence: Annotated[float, Integer("inputs that an overload silences the part for")]
    taps: Annotated[FourTaps, Real("1", "weights of the first stage")]
    decimation: Annotated[float, Integer("inputs taken per register word")]
    latency: Annotated[float, Integer("sense periods from the end of a window to its word")]
    high_pass_gain: Annotated[float, Real("1", "share of a step that the high-pass forgets in a word")]
    sample_deviation: Annotated[float, Real("m/s2", "white noise of a sample at the sampling frequency")]
    instability_sigma: Annotated[float, Real("m/s2", "standard deviation of one Gauss-Markov process of the bias")]


class RegisterWords(NamedTuple):
    """What the data registers show at a time."""

    code: Annotated[Vector3, Integer("data registers")]
    over_range: Annotated[float, Boolean("a reading in them lies beyond the range")]
    condition: Annotated[Vector3, Integer("0 well, 1 stuck, 2 without a valid reading")]


class AccelerometerState(NamedTuple):
    """The three axes; the `latest` words are in the registers once their latency is over, until then the `earlier`."""

    specific_force: Annotated[Vector3, Real("m/s2", "specific force as last sensed, behind the bandwidth")]
    before: Annotated[tuple[Vector3, Vector3, Vector3], Real("m/s2", "the three samples before, for the first stage")]
    silent: Annotated[float, Integer("sense periods that an overload still silences the part")]
    block: Annotated[Vector3, Real("m/s2", "sum of the block's samples")]
    weighted_block: Annotated[Vector3, Real("m/s2", "sum of the block's samples by their number")]
    samples: Annotated[float, Real("1", "samples in the block so far")]
    rising: Annotated[Vector3, Real("m/s2", "rising half of the window under way")]
    mean: Annotated[Vector3, Real("m/s2", "mean over the last block, or since the input before")]
    steady: Annotated[Vector3, Real("m/s2", "what the high-pass takes away")]
    sums: tuple[BartlettSums, BartlettSums, BartlettSums]
    words: Annotated[float, Real("1", "register words so far")]
    latest: RegisterWords
    earlier: RegisterWords


def _chosen(choice: Scalar, values: tuple[float, ...]) -> Scalar:
    """The value that an enumeration, counted from 1, chooses."""
    found: Scalar = values[0]
    for number, value in enumerate(values[1:], 2):
        found = where(choice > number - 0.5, value, found)
    return found


def accelerometer_coefficients(
    part: AccelerometerParameters, mounting: Matrix3, ideal: Any
) -> AccelerometerCoefficients:
    """Coefficients of the part; an ideal one is read directly, its clock stands still."""
    decimates = part.filter == ACCELEROMETER_FILTER.value("decimator")
    full = part.sampling_frequency * (1.0 + part.clock_error)
    frequency = full * where(decimates, 1.0, SENSES_PER_CONVERSION)
    choice = part.output_data_rate
    decimation = where(
        decimates, _chosen(choice, tuple(2.0**i for i in range(len(DELAYS)))), SENSES_PER_CONVERSION * part.divider
    )
    # the sinc^2 itself delays by R - 1 samples; of the rest whole ones are latency, the first stage does what is left
    rest = _chosen(choice, tuple(delay.si * _FASTEST for delay in DELAYS)) - (decimation - 1.0)
    latency = minimum(maximum(floor(rest - 1.0 + 1e-9), 1.0), decimation)
    corner = _chosen(part.high_pass, (0.0, *[corner.value for corner in HIGH_PASS_CORNERS]))
    return AccelerometerCoefficients(
        sensitivity=sensitivity_matrix(
            part.scale_error, part.cross_axis, part.nonorthogonality, part.misalignment, mounting
        ),
        cubic=cubic_gains(part.nonlinearity, part.range),
        self_test=each_axis(lambda i: where(part.self_test > 0.5, part.self_test_response[i], 0.0)),
        sense_period=where(ideal > 0.5, STOPPED, 1.0 / frequency),
        word_period=decimation / frequency,
        low_pass_gain=low_pass_gain(part.bandwidth, 1.0 / frequency),
        low_pass_share=low_pass_share(part.bandwidth, 1.0 / frequency),
        silence=round_half_up(_SILENCE * frequency),
        taps=delaying_taps(clip(rest - latency, 1.0, 2.0), FIRST_STAGE_CURVATURE),
        decimation=decimation,
        latency=latency,
        high_pass_gain=low_pass_gain(corner, 1.0),
        sample_deviation=sample_deviation(part.noise_density, full),
        instability_sigma=part.bias_instability * SIGMA_PER_INSTABILITY,
    )


def at_lever_arm(force: Vector3, rate: Vector3, angular_acceleration: Vector3, arm: Vector3) -> Vector3:
    """f + w' x r + w x (w x r): specific force at the arm r from the place where f is given."""
    x, y, z = arm
    (p, q, r), (a, b, c) = rate, angular_acceleration
    along, square = p * x + q * y + r * z, p * p + q * q + r * r  # w x (w x r) = w (w r) - r w^2
    return (
        force[0] + (b * z - c * y) + (p * along - x * square),
        force[1] + (c * x - a * z) + (q * along - y * square),
        force[2] + (a * y - b * x) + (r * along - z * square),
    )


def _felt(
    along: Vector3, force: Vector3, factor: Vector3, p: AccelerometerParameters, k: AccelerometerCoefficients
) -> Vector3:
    """What the part makes of the true specific force at its place, `along` its axes."""
    square = dot(force, force)
    x, y, z = along
    return (
        bent(x * factor[0], k.cubic) + p.rectification[0] * square + k.self_test[0],
        bent(y * factor[1], k.cubic) + p.rectification[1] * square + k.self_test[1],
        bent(z * factor[2], k.cubic) + p.rectification[2] * square + k.self_test[2],
    )


def _converted(value: Scalar, p: AccelerometerParameters) -> Scalar:
    """What the ADIS16354's converter makes of a specific force; it goes on to twice the range, an assumption."""
    return converted(clip(value, -2.0 * p.range, 2.0 * p.range), p.resolution)


def _words(
    values: Vector3,
    before: Vector3,
    p: AccelerometerParameters,
    time: Scalar,
    faults: tuple[FaultParameters, ...],
    draws: tuple[Scalar, ...],
) -> RegisterWords:
    """Register words of these readings, under faults."""
    codes, beyond, condition = [], [], []
    for axis in range(3):
        value = values[axis]
        stuck: Scalar = 0.0
        dropped: Scalar = 0.0
        for fault in faults:
            found = faulted(value, p.range, fault, 3 + axis, time, draws[axis])
            value, stuck, dropped = found.value, stuck + found.stuck, dropped + found.dropped
        fresh = register_code(value, p.range, p.resolution, p.code_limit)
        codes.append(where(dropped > 0.5, 0.0, where(stuck > 0.5, before[axis], fresh)))
        beyond.append(over_range(value, p.range))
        condition.append(condition_of(stuck, dropped))
    return RegisterWords(
        (codes[0], codes[1], codes[2]),
        maximum(maximum(beyond[0], beyond[1]), beyond[2]),
        (condition[0], condition[1], condition[2]),
    )


def initial_accelerometer(
    force: Vector3, offset: Vector3, factor: Vector3, p: AccelerometerParameters, k: AccelerometerCoefficients
) -> tuple[AccelerometerState, tuple[DelayLines, DelayLines, DelayLines]]:
    """The part after a long time at this specific force, without noise."""
    sensed = _felt(multiply(k.sensitivity, force), force, factor, p, k)
    n = k.decimation
    rising = scale(0.5 * n * (n - 1.0), sensed)
    read = add(sensed, offset)
    passes = p.high_pass == HIGH_PASS.value("none")
    steady = choose(passes, ZERO3, read)
    values = choose(passes, read, ZERO3)
    code = each_axis(lambda i: register_code(values[i], p.range, p.resolution, p.code_limit))
    each = each_axis(lambda i: over_range(values[i], p.range))
    words = RegisterWords(code, maximum(maximum(each[0], each[1]), each[2]), ZERO3)
    taps = taps_of(p.filter, ACCELEROMETER_FILTER.value("bartlett_1"))
    filters = each_axis(lambda i: settled_bartlett(_converted(read[i], p), taps))
    state = AccelerometerState(
        sensed,
        (sensed, sensed, sensed),
        0.0,
        ZERO3,
        ZERO3,
        0.0,
        rising,
        sensed,
        steady,
        (filters[0][0], filters[1][0], filters[2][0]),
        0.0,
        words,
        words,
    )
    return state, (filters[0][1], filters[1][1], filters[2][1])


def registers(state: AccelerometerState, k: AccelerometerCoefficients) -> RegisterWords:
    """What the data registers show now."""
    words: RegisterWords = choose(state.samples >= k.latency, state.latest, state.earlier)
    return words


Sense = Callable[
    [AccelerometerState, Vector3, Vector3, AccelerometerParameters, AccelerometerCoefficients], AccelerometerState
]


def sense(
    state: AccelerometerState, force: Vector3, factor: Vector3, p: AccelerometerParameters, k: AccelerometerCoefficients
) -> AccelerometerState:
    """Step of the decimating part at the sampling frequency: an input enters the block, a due word the registers."""
    along = multiply(k.sensitivity, force)
    most = maximum(maximum(absolute(along[0]), absolute(along[1])), absolute(along[2]))
    silent = where(most > p.overload, k.silence, maximum(state.silent - 1.0, 0.0))
    heard = where(silent > 0.5, 0.0, 1.0)
    x, y, z = _felt(along, force, factor, p, k)
    sensed = (heard * x, heard * y, heard * z)
    f = four_tapped(k.taps, sensed, state.before)
    a, b, n = state.block, state.weighted_block, state.samples
    return AccelerometerState(
        sensed,
        (sensed, state.before[0], state.before[1]),
        silent,
        (a[0] + f[0], a[1] + f[1], a[2] + f[2]),
        (b[0] + n * f[0], b[1] + n * f[1], b[2] + n * f[2]),
        n + 1.0,
        state.rising,
        state.mean,
        state.steady,
        state.sums,
        state.words + where(n + 1.0 == k.latency, 1.0, 0.0),
        state.latest,
        state.earlier,
    )


def sense_bartlett(
    state: AccelerometerState, force: Vector3, factor: Vector3, p: AccelerometerParameters, k: AccelerometerCoefficients
) -> AccelerometerState:
    """Step of the part with Bartlett filters at four times its conversions: an input passes the bandwidth."""
    before, felt = state.specific_force, _felt(multiply(k.sensitivity, force), force, factor, p, k)
    passed = each_axis(lambda i: low_pass(before[i], felt[i], k.low_pass_gain))
    mean = each_axis(lambda i: before[i] + k.low_pass_share * (passed[i] - before[i]))
    return state._replace(specific_force=passed, mean=mean)


def register(
    state: AccelerometerState,
    offset: Vector3,
    p: AccelerometerParameters,
    k: AccelerometerCoefficients,
    faults: tuple[FaultParameters, ...],
    draws: tuple[Scalar, ...],
) -> AccelerometerState:
    """Step at the output data rate: noise, decimation, offset, high-pass, fault, range and the next register word."""
    values, rising, steady = [], [], []
    mean = scale(1.0 / k.decimation, state.block)
    late = p.clock_jitter * draws[6] / k.word_period
    for axis in range(3):
        noise_a, noise_b = block_sums(k.sample_deviation, k.decimation, draws[2 * axis], draws[2 * axis + 1])
        y, kept = sinc2_decimated(
            state.rising[axis], state.block[axis] + noise_a, state.weighted_block[axis] + noise_b, k.decimation
        )
        read = y + (mean[axis] - state.mean[axis]) * late + offset[axis]
        slow = low_pass(state.steady[axis], read, k.high_pass_gain)
        values.append(read - 0.5 * (state.steady[axis] + slow))
        rising.append(kept)
        steady.append(slow)
    time = state.words * k.word_period
    latest = _words((values[0], values[1], values[2]), state.latest.code, p, time, faults, draws[7:10])
    return AccelerometerState(
        state.specific_force,
        state.before,
        state.silent,
        ZERO3,
        ZERO3,
        0.0,
        (rising[0], rising[1], rising[2]),
        mean,
        (steady[0], steady[1], steady[2]),
        state.sums,
        state.words,
        latest,
        state.latest,
    )


def sample(taps: int) -> Callable[..., tuple[AccelerometerState, tuple[DelayLines, DelayLines, DelayLines]]]:
    """Step of the part with Bartlett filters at its sampling rate: noise, offset, filter, fault, range and word."""

    def step(
        state: AccelerometerState,
        lines: tuple[DelayLines, DelayLines, DelayLines],
        offset: Vector3,
        p: AccelerometerParameters,
        k: AccelerometerCoefficients,
        faults: tuple[FaultParameters, ...],
        draws: tuple[Scalar, ...],
    ) -> tuple[AccelerometerState, tuple[DelayLines, DelayLines, DelayLines]]:
        late = p.clock_jitter * draws[6] / ((1.0 - k.low_pass_share) * k.sense_period)
        values, sums, after = [], [], []
        for axis in range(3):
            jitter = (state.specific_force[axis] - state.mean[axis]) * late
            noisy = state.mean[axis] + jitter + k.sample_deviation * draws[2 * axis] + offset[axis]
            y, one_sums, one_lines = bartlett(state.sums[axis], lines[axis], _converted(noisy, p), taps)
            values.append(y * (p.resolution / CONVERTER_STEPS))
            sums.append(one_sums)
            after.append(one_lines)
        counted = state.words + 1.0
        time, before = counted * k.word_period, state.latest.code
        words = _words((values[0], values[1], values[2]), before, p, time, faults, draws[7:10])
        part = AccelerometerState(*state[:9], (sums[0], sums[1], sums[2]), counted, words, words)
        return part, (after[0], after[1], after[2])

    return step
