"""Three single-axis digital gyros, each at its own clock: ADXRS450 (or 453), or the gyros of an ADIS16354.

The signal's way: sensitivity and mounting, temperature, nonlinearity, g-sensitivity, self-test; bandwidth; white noise;
digital filter; offset, fault, range, register word. Two digital filters are offered:

* ``cic``, the ADXRS450's sinc^2 over 128/f0: sensed at f0/8, register updated at f0/32;
* ``bartlett_1`` to ``bartlett_64``, the ADIS16354's at every sample, four inputs a conversion.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from ..record import Boolean, Enumeration, Integer, Item, Matrix3, Real, Vector3
from ..scalar import Scalar, clip, either, maximum, round_half_up, where
from ..system import STOPPED
from ..vectors import dot, each_axis, matrix_product
from .adxrs450_sheet import ADXRS450
from .bandwidth import low_pass, low_pass_gain, low_pass_share
from .bias_instability import SIGMA_PER_INSTABILITY
from .board import BOARD
from .digital_filter import (
    BARTLETT_ITEMS,
    CONVERTER_STEPS,
    EMPTY,
    BartlettSums,
    BlockSums,
    DelayLines,
    OverlappedWindows,
    bartlett,
    converted,
    settled_bartlett,
    settled_windows,
    sinc2_overlapped,
    taps_of,
    with_samples,
)
from .faults import FaultParameters, condition_of, faulted
from .quantiser import over_range, register_code
from .sensitivity import bent, cubic_gains, sensitivity_matrix
from .thermal import ThermalParameters, ThermometerParameters
from .white_noise import block_sums, sample_deviation

SAMPLES_PER_REGISTER = 32
"""ADXRS450: f0 over the register's rate (Rev. 0 p. 11); the window is four times as long."""
WORDS_PER_WINDOW = 4
"""Register words that the CIC's window reaches over."""
SENSES_PER_REGISTER = 4
SAMPLES_PER_SENSE = SAMPLES_PER_REGISTER // SENSES_PER_REGISTER
GYRO_FILTER = Enumeration(
    "GyroFilter", (Item("cic", "ADXRS450: two-stage CIC over 128/f0"), *BARTLETT_ITEMS), "digital filter of the gyros"
)
AUTONULL = Enumeration(
    "Autonull",
    (
        Item("none", "offset registers stay zero"),
        Item("automatic", "one reading is taken as offset (ADIS16354, COMMAND bit 0)"),
        Item("precision", "the mean of 30 s is taken as offset (ADIS16354, COMMAND bit 4)"),
    ),
    "bias null of the part at power-up, as soon as its filter is full of readings with noise",
)
NULL_DURATION = 30.0
"""s of the ADIS16354's precision null."""
NULL_CODES = (-4096.0, 4095.0)
"""Smallest and largest offset register: 13 bits."""


class GyroParameters(NamedTuple):
    """A triad of gyros and what is peculiar to this board's three."""

    filter: Annotated[int, GYRO_FILTER] = GYRO_FILTER.value("cic")
    range: Annotated[float, Real("rad/s", "full scale", min=1e-3, display="deg/s")] = ADXRS450.si("range")
    resolution: Annotated[float, Real("rad/s", "one LSB of the rate register", min=1e-12, display="deg/s")] = (
        ADXRS450.si("resolution")
    )
    code_limit: Annotated[float, Integer("codes run from minus this to one less", min=2, max=2**31 - 1)] = int(
        ADXRS450.si("code_limit")
    )
    noise_density: Annotated[float, Real("rad/(s.Hz^0.5)", "white rate noise, one-sided, of each gyro", min=0.0)] = (
        ADXRS450.si("noise_density")
    )
    bias_instability: Annotated[float, Real("rad/s", "flicker of the bias, IEEE 952 B", min=0.0, display="deg/h")] = (
        ADXRS450.si("bias_instability")
    )
    rate_random_walk: Annotated[float, Real("rad/(s.s^0.5)", "random walk of the bias, IEEE 952 K", min=0.0)] = 0.0
    turn_on_bias: Annotated[
        float, Real("rad/s", "standard deviation of the bias from run to run", min=0.0, display="deg/s")
    ] = 0.0
    bandwidth: Annotated[
        float,
        Real(
            "Hz",
            "analogue bandwidth ahead of the digital filter, one pole; acts below f0/32 (CIC), sampling_frequency "
            "(Bartlett), not above",
            min=1.0,
        ),
    ] = ADXRS450.si("bandwidth")
    resonator_frequency: Annotated[
        float, Real("Hz", "nominal f0, from which every rate of the part with a CIC follows", min=1e3, max=1e5)
    ] = ADXRS450.si("resonator_frequency")
    sampling_frequency: Annotated[
        float, Real("Hz", "nominal conversion rate of the part with a Bartlett filter", min=1.0, max=1e5)
    ] = ADXRS450.si("sampling_frequency")
    divider: Annotated[
        int, Integer("conversions per sample of the Bartlett filter: 1 to 64, multiples of 31 to 1984", min=1, max=1984)
    ] = 1
    clock_error: Annotated[
        Vector3, Real("1", "relative error of the part's clock, which starts with the run", min=-0.25, max=0.25)
    ] = BOARD.gyro_clock_error
    clock_jitter: Annotated[float, Real("s", "standard deviation of the moment of a sample", min=0.0, max=1e-2)] = 0.0
    bias: Annotated[Vector3, Real("rad/s", "null offset at 25 degC", display="deg/s")] = BOARD.gyro_bias
    bias_temperature_slope: Annotated[Vector3, Real("rad/(s.K)", "change of the offset with temperature")] = (
        BOARD.gyro_bias_temperature_slope
    )
    bias_temperature_curve: Annotated[Vector3, Real("rad/(s.K2)", "change of the offset with temperature squared")] = (
        0.0,
        0.0,
        0.0,
    )
    hysteresis: Annotated[
        float, Real("rad/s", "offset after long warming, minus it after cooling", min=0.0, display="deg/s")
    ] = 0.0
    hysteresis_width: Annotated[float, Real("K", "change of temperature that turns the hysteresis round", min=0.01)] = (
        5.0
    )
    supply_sensitivity: Annotated[float, Real("rad/(s.V)", "change of the offset with the supply voltage")] = 0.0
    scale_error: Annotated[Vector3, Real("1", "relative error of the sensitivity", min=-0.5, max=0.5)] = (
        BOARD.gyro_scale_error
    )
    scale_temperature_slope: Annotated[Vector3, Real("1/K", "relative change of the sensitivity with temperature")] = (
        0.0,
        0.0,
        0.0,
    )
    scale_temperature_curve: Annotated[
        Vector3, Real("1/K2", "relative change of the sensitivity with temperature squared")
    ] = (0.0, 0.0, 0.0)
    nonlinearity: Annotated[
        float, Real("1", "rms deviation from the best straight line, of the full scale", min=0.0, max=0.1)
    ] = ADXRS450.si("nonlinearity")
    cross_axis: Annotated[Matrix3, Real("1", "share of the column's axis in the row's reading", min=-0.5, max=0.5)] = (
        BOARD.gyro_cross_axis
    )
    nonorthogonality: Annotated[
        Vector3,
        Real(
            "rad",
            "lean of the second axis to the first, of the third to the first, of the third to the second",
            min=-0.2,
            max=0.2,
        ),
    ] = (0.0, 0.0, 0.0)
    misalignment: Annotated[Vector3, Real("rad", "rotation vector of the triad in its package", min=-0.5, max=0.5)] = (
        0.0,
        0.0,
        0.0,
    )
    g_sensitivity: Annotated[Matrix3, Real("rad.s/m", "reading of the row's gyro by specific force of the column")] = (
        BOARD.gyro_g_sensitivity
    )
    rectification: Annotated[
        Vector3, Real("rad.s3/m2", "offset by the square of the whole specific force, at rest by g squared")
    ] = ADXRS450.of_each_axis("rectification")
    autonull: Annotated[int, AUTONULL] = AUTONULL.value("none")
    null_resolution: Annotated[float, Real("rad/s", "one LSB of the offset registers", min=1e-12, display="deg/s")] = (
        ADXRS450.si("null_resolution")
    )
    self_test_response: Annotated[Vector3, Real("rad/s", "rate that the self-test feigns", display="deg/s")] = (
        0.0,
        0.0,
        0.0,
    )
    self_test: Annotated[bool, Boolean("the self-test is on", tunable=True)] = False
    thermometer: ThermometerParameters = ThermometerParameters(
        ADXRS450.si("thermometer.sensitivity"),
        ADXRS450.si("thermometer.code_at_25"),
        int(ADXRS450.si("thermometer.lowest_code")),
        int(ADXRS450.si("thermometer.highest_code")),
    )
    thermal: ThermalParameters = ThermalParameters(ADXRS450.si("thermal.self_heating"), ADXRS450.si("thermal.warm_up"))


class GyroCoefficients(NamedTuple):
    """What follows from the parameters."""

    sensitivity: Annotated[Matrix3, Real("1", "reading of the row's gyro by body rate of the column")]
    g_sensitivity: Annotated[Matrix3, Real("rad.s/m", "reading of the row's gyro by body specific force")]
    cubic: Annotated[
        tuple[float, float, float], Real("1", "gains of the nonlinearity: linear, cubic (s2/rad2), the cubic's largest")
    ]
    self_test: Annotated[Vector3, Real("rad/s", "rate that the self-test feigns now", display="deg/s")]
    sense_period: Annotated[Vector3, Real("s", "time between inputs taken")]
    word_period: Annotated[Vector3, Real("s", "time between register words")]
    low_pass_gain: Annotated[Vector3, Real("1", "share of a step taken over in a sense period")]
    low_pass_share: Annotated[Vector3, Real("1", "weight of the latest input in the mean that is converted")]
    sample_deviation: Annotated[Vector3, Real("rad/s", "white noise of a sample")]
    instability_sigma: Annotated[float, Real("rad/s", "standard deviation of one Gauss-Markov process of the bias")]
    null_words: Annotated[Vector3, Integer("register words averaged for the bias null, 0: none")]
    null_begin: Annotated[float, Integer("first of these words: the first whose filter holds nothing but noisy inputs")]
    senses: Annotated[float, Integer("inputs taken per register word")]


class NullState(NamedTuple):
    """The bias null of the part."""

    sum: Annotated[float, Integer("sum of the codes so far")]
    offset: Annotated[float, Integer("offset register")]
    done: Annotated[float, Boolean("the null has ended")]


class GyroState(NamedTuple):
    """One gyro."""

    sensed: Annotated[
        float, Real("rad/s", "rate and what specific force adds to it, as last sensed, behind the bandwidth")
    ]
    block: Annotated[BlockSums, Real("rad/s", "sums of the block under way")]
    windows: Annotated[OverlappedWindows, Real("rad/s", "partial sums of the windows under way")]
    mean: Annotated[float, Real("rad/s", "mean over the last block, or since the input before")]
    sums: BartlettSums
    words: Annotated[float, Real("1", "register words so far")]
    null: NullState
    code: Annotated[float, Integer("rate register")]
    over_range: Annotated[float, Boolean("reading beyond the range")]
    condition: Annotated[float, Integer("0 well, 1 stuck, 2 without a valid reading")]


def gyro_coefficients(gyro: GyroParameters, mounting: Matrix3, ideal: Any) -> GyroCoefficients:
    """Coefficients of the triad; an ideal one is read directly, its clocks stand still."""
    perfect, is_cic = ideal > 0.5, gyro.filter == GYRO_FILTER.value("cic")
    window = 2.0 * taps_of(gyro.filter, GYRO_FILTER.value("bartlett_1")) - 1.0
    # the converter samples noise of its full rate, however seldom it is read
    nominal = where(is_cic, gyro.resonator_frequency, gyro.sampling_frequency)
    frequency = each_axis(lambda i: nominal * (1.0 + gyro.clock_error[i]))
    senses = where(is_cic, 1.0, 1.0 * gyro.divider) * SENSES_PER_REGISTER
    period = each_axis(lambda i: where(is_cic, float(SAMPLES_PER_SENSE), 1.0 / SENSES_PER_REGISTER) / frequency[i])
    word = each_axis(lambda i: senses * period[i])
    precise = gyro.autonull == AUTONULL.value("precision")
    idle = either(perfect, gyro.autonull == AUTONULL.value("none"))
    return GyroCoefficients(
        sensitivity=sensitivity_matrix(
            gyro.scale_error, gyro.cross_axis, gyro.nonorthogonality, gyro.misalignment, mounting
        ),
        g_sensitivity=matrix_product(gyro.g_sensitivity, mounting),
        cubic=cubic_gains(gyro.nonlinearity, gyro.range),
        self_test=each_axis(lambda i: where(gyro.self_test > 0.5, gyro.self_test_response[i], 0.0)),
        sense_period=each_axis(lambda i: where(perfect, STOPPED, period[i])),
        word_period=word,
        low_pass_gain=each_axis(lambda i: low_pass_gain(gyro.bandwidth, period[i])),
        low_pass_share=each_axis(lambda i: low_pass_share(gyro.bandwidth, period[i])),
        sample_deviation=each_axis(lambda i: sample_deviation(gyro.noise_density, frequency[i])),
        instability_sigma=gyro.bias_instability * SIGMA_PER_INSTABILITY,
        null_words=each_axis(lambda i: where(idle, 0.0, where(precise, round_half_up(NULL_DURATION / word[i]), 1.0))),
        null_begin=where(is_cic, float(WORDS_PER_WINDOW), window),
        senses=senses,
    )


def initial_null(words: Scalar) -> NullState:
    """The bias null before the first of so many words; done where there are none."""
    return NullState(0.0, 0.0, where(words < 0.5, 1.0, 0.0))


def _felt(axis: int, rate: Vector3, force: Vector3, scale: Scalar, p: GyroParameters, k: GyroCoefficients) -> Scalar:
    """What the part makes of the true rate and specific force, ahead of its bandwidth."""
    turned = bent(dot(k.sensitivity[axis], rate) * scale, k.cubic)
    pushed = dot(k.g_sensitivity[axis], force) + p.rectification[axis] * dot(force, force)
    return turned + pushed + k.self_test[axis]


def _word(
    axis: int,
    gyro: GyroState,
    value: Scalar,
    offset: Scalar,
    p: GyroParameters,
    k: GyroCoefficients,
    faults: tuple[FaultParameters, ...],
    draw: Scalar,
) -> tuple[Scalar, ...]:
    """Words so far, bias null, code, over-range and condition after one more word of this value."""
    words = gyro.words + 1.0
    time = words * k.word_period[axis]
    value = value + offset + gyro.null.offset * p.null_resolution
    stuck: Scalar = 0.0
    dropped: Scalar = 0.0
    for fault in faults:
        found = faulted(value, p.range, fault, axis, time, draw)
        value, stuck, dropped = found.value, stuck + found.stuck, dropped + found.dropped
    fresh = register_code(value, p.range, p.resolution, p.code_limit)
    null = nulled(gyro.null, fresh, words, axis, p, k)
    code = where(dropped > 0.5, 0.0, where(stuck > 0.5, gyro.code, fresh))
    return words, null, code, over_range(value, p.range), condition_of(stuck, dropped)


def nulled(
    null: NullState, code: Scalar, words: Scalar, axis: int, p: GyroParameters, k: GyroCoefficients
) -> NullState:
    """The bias null after one more word: offset = -mean, in whole LSB of the offset register."""
    count = words - k.null_begin + 1.0
    total = null.sum + where(either(null.done > 0.5, count < 0.5), 0.0, code)
    ends = where(null.done > 0.5, 0.0, where(count >= k.null_words[axis], 1.0, 0.0))
    steps = round_half_up(-(total / maximum(k.null_words[axis], 1.0)) * (p.resolution / p.null_resolution))
    offset = clip(steps, *NULL_CODES)
    return NullState(total, where(ends > 0.5, offset, null.offset), where(ends > 0.5, 1.0, null.done))


def _converted(value: Scalar, p: GyroParameters) -> Scalar:
    """What the ADIS16354's converter makes of a rate; it goes on to twice the range, an assumption."""
    return converted(clip(value, -2.0 * p.range, 2.0 * p.range), p.resolution)


def initial_gyro(
    axis: int,
    rate: Vector3,
    force: Vector3,
    offset: Scalar,
    scale: Scalar,
    p: GyroParameters,
    k: GyroCoefficients,
) -> tuple[GyroState, DelayLines]:
    """The gyro after a long time at these inputs, without noise."""
    sensed = _felt(axis, rate, force, scale, p, k)
    code = register_code(sensed + offset, p.range, p.resolution, p.code_limit)
    settled = settled_windows(sensed, float(SAMPLES_PER_REGISTER))
    taps = taps_of(p.filter, GYRO_FILTER.value("bartlett_1"))
    sums, lines = settled_bartlett(_converted(sensed + offset, p), taps)
    beyond = over_range(sensed + offset, p.range)
    state = GyroState(sensed, EMPTY, settled, sensed, sums, 0.0, initial_null(k.null_words[axis]), code, beyond, 0.0)
    return state, lines


Sense = Callable[[GyroState, Vector3, Vector3, Scalar, GyroParameters, GyroCoefficients], GyroState]


def sense(axis: int) -> Sense:
    """Step of one CIC gyro at f0/8: the true rate and specific force enter the block.

    The eight samples since the last step are taken on a straight line from what was sensed then to what is now.
    """

    def step(
        gyro: GyroState, rate: Vector3, force: Vector3, scale: Scalar, p: GyroParameters, k: GyroCoefficients
    ) -> GyroState:
        sensed = low_pass(gyro.sensed, _felt(axis, rate, force, scale, p, k), k.low_pass_gain[axis])
        block = with_samples(gyro.block, gyro.sensed, sensed, float(SAMPLES_PER_SENSE))
        return GyroState(sensed, block, *gyro[2:])

    return step


def sense_bartlett(axis: int) -> Sense:
    """Step of one Bartlett gyro at four times its conversions: the true rate and specific force pass the bandwidth."""

    def step(
        gyro: GyroState, rate: Vector3, force: Vector3, scale: Scalar, p: GyroParameters, k: GyroCoefficients
    ) -> GyroState:
        sensed = low_pass(gyro.sensed, _felt(axis, rate, force, scale, p, k), k.low_pass_gain[axis])
        mean = gyro.sensed + k.low_pass_share[axis] * (sensed - gyro.sensed)
        return GyroState(sensed, gyro.block, gyro.windows, mean, *gyro[4:])

    return step


Register = Callable[
    [GyroState, Scalar, GyroParameters, GyroCoefficients, tuple[FaultParameters, ...], tuple[Scalar, ...]], GyroState
]


def register(axis: int) -> Register:
    """Step of one CIC gyro at f0/32: noise, filter, offset, fault, range and register word."""

    def step(
        gyro: GyroState,
        offset: Scalar,
        p: GyroParameters,
        k: GyroCoefficients,
        faults: tuple[FaultParameters, ...],
        draws: tuple[Scalar, ...],
    ) -> GyroState:
        n = float(SAMPLES_PER_REGISTER)
        mean = gyro.block.a / n
        jitter = (mean - gyro.mean) / k.word_period[axis] * (p.clock_jitter * draws[2])
        noise_a, noise_b = block_sums(k.sample_deviation[axis], n, draws[0], draws[1])
        y, windows = sinc2_overlapped(gyro.windows, gyro.block.a + noise_a, gyro.block.b + noise_b, n)
        words, null, code, beyond, condition = _word(axis, gyro, y + jitter, offset, p, k, faults, draws[3])
        return GyroState(gyro.sensed, EMPTY, windows, mean, gyro.sums, words, null, code, beyond, condition)

    return step


Sample = Callable[..., tuple[GyroState, DelayLines]]


def sample(axis: int, taps: int) -> Sample:
    """Step of one Bartlett gyro at its sampling rate: noise, offset, filter of `taps`, fault, range, register word."""

    def step(
        gyro: GyroState,
        lines: DelayLines,
        offset: Scalar,
        p: GyroParameters,
        k: GyroCoefficients,
        faults: tuple[FaultParameters, ...],
        draws: tuple[Scalar, ...],
    ) -> tuple[GyroState, DelayLines]:
        late = p.clock_jitter * draws[2] / ((1.0 - k.low_pass_share[axis]) * k.sense_period[axis])
        jitter = (gyro.sensed - gyro.mean) * late
        noisy = gyro.mean + jitter + k.sample_deviation[axis] * draws[0] + offset
        y, sums, after = bartlett(gyro.sums, lines, _converted(noisy, p), taps)
        value = y * (p.resolution / CONVERTER_STEPS)
        words, null, code, beyond, condition = _word(axis, gyro, value, 0.0, p, k, faults, draws[3])
        return GyroState(*gyro[:4], sums, words, null, code, beyond, condition), after

    return step
