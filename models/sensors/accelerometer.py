"""A three-axis digital accelerometer (ADXL355) at its own clock.

The signal's way: lever arm, sensitivity and mounting, anti-alias bandwidth (sensed at 4 kHz); white noise, sinc^2
decimation to the output data rate, offset, range, register word; the word appears after the filter's extra latency.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple

from ..record import Boolean, Enumeration, Integer, Item, Matrix3, Real, Vector3
from ..scalar import PI, Scalar, maximum, minimum, round_half_up, where
from ..system import STOPPED
from ..vectors import add, cross, each_axis, multiply, scale
from . import devices
from .bandwidth import low_pass, low_pass_gain
from .bias_instability import SIGMA_PER_INSTABILITY
from .digital_filter import sinc2_decimated
from .quantiser import over_range, register_code
from .sensitivity import sensitivity_matrix
from .thermal import ThermalParameters
from .white_noise import block_sums, sample_deviation

_SHEET = devices.ADXL355
_BOARD = devices.BOARD
_DECIMATIONS = int(_SHEET.decimations.value)
WORD_LENGTH = int(_SHEET.word_length.value)

OUTPUT_DATA_RATE = Enumeration(
    "OutputDataRate",
    tuple(
        Item(
            f"{_SHEET.sampling_frequency.value / 2**i:.4g}_Hz".replace(".", "_"),
            f"{_SHEET.sampling_frequency.value / 2**i:.4g} samples a second",
        )
        for i in range(_DECIMATIONS)
    ),
    "output data rate, FILTER register [3:0]",
)


class AccelerometerParameters(NamedTuple):
    """An ADXL355 and what is peculiar to this board's."""

    range: Annotated[float, Real("m/s2", "full scale", min=1e-3)] = _SHEET.range.si
    resolution: Annotated[float, Real("m/s2", "one LSB of the data registers", min=1e-12)] = 1.0 / _SHEET.sensitivity.si
    noise_density: Annotated[float, Real("m/(s2.Hz^0.5)", "white noise, one-sided", min=0.0)] = _SHEET.noise_density.si
    bias_instability: Annotated[float, Real("m/s2", "flicker of the bias, IEEE 952 B", min=0.0)] = (
        _SHEET.bias_stability.si * devices.ALLAN_MINIMUM_TO_BIAS_INSTABILITY
    )
    bandwidth: Annotated[float, Real("Hz", "anti-alias bandwidth before the digital filter", min=1.0)] = (
        _SHEET.antialias_bandwidth.si
    )
    sampling_frequency: Annotated[float, Real("Hz", "nominal rate of the first decimation", min=1.0, max=1e5)] = (
        _SHEET.sampling_frequency.si
    )
    first_stage_delay: Annotated[float, Real("s", "delay at the sampling frequency", min=0.0, max=0.1)] = (
        _SHEET.first_stage_delay.si
    )
    output_data_rate: Annotated[int, OUTPUT_DATA_RATE] = OUTPUT_DATA_RATE.value("500_Hz")
    clock_error: Annotated[float, Real("1", "relative error of the part's clock", min=-0.1, max=0.1)] = (
        _BOARD.accelerometer_clock_error
    )
    bias: Annotated[Vector3, Real("m/s2", "0 g offset at 25 degC")] = _BOARD.accelerometer_bias
    bias_temperature_slope: Annotated[Vector3, Real("m/(s2.K)", "change of the offset with temperature")] = (
        _BOARD.accelerometer_bias_temperature_slope
    )
    scale_error: Annotated[Vector3, Real("1", "relative error of the sensitivity at 25 degC", min=-0.5, max=0.5)] = (
        _BOARD.accelerometer_scale_error
    )
    cross_axis: Annotated[Matrix3, Real("1", "share of the column's axis in the row's reading", min=-0.5, max=0.5)] = (
        _BOARD.accelerometer_cross_axis
    )
    thermal: ThermalParameters = ThermalParameters(_SHEET.self_heating.si, _SHEET.warm_up.si)


class AccelerometerCoefficients(NamedTuple):
    """What follows from the parameters."""

    sensitivity: Annotated[Matrix3, Real("1", "reading of the row's axis by body specific force of the column")]
    sense_period: Annotated[float, Real("s", "time between inputs taken")]
    low_pass_gain: Annotated[float, Real("1", "share of a step taken over in a sense period")]
    decimation: Annotated[float, Integer("sense periods per output word")]
    latency: Annotated[float, Integer("sense periods from the end of a window to its word")]
    sample_deviation: Annotated[float, Real("m/s2", "white noise of a sample at the sampling frequency")]
    instability_sigma: Annotated[float, Real("m/s2", "standard deviation of one Gauss-Markov process of the bias")]


class AccelerometerState(NamedTuple):
    """The three axes."""

    specific_force: Annotated[Vector3, Real("m/s2", "specific force behind the analogue bandwidth")]
    sums: Annotated[Vector3, Real("m/s2", "sum of the block's samples")]
    weighted_sums: Annotated[Vector3, Real("m/s2", "sum of the block's samples by their number")]
    samples: Annotated[float, Real("1", "samples in the block so far")]
    rising: Annotated[Vector3, Real("m/s2", "rising half of the window under way")]
    pending: Annotated[Vector3, Integer("code on its way to the registers")]
    code: Annotated[Vector3, Integer("data registers")]
    over_range: Annotated[float, Boolean("a reading beyond the range")]


def _decimation(odr: Scalar) -> Scalar:
    ratio: Scalar = 1.0
    for choice in range(2, _DECIMATIONS + 1):
        ratio = where(odr > choice - 0.5, 2.0 * ratio, ratio)
    return ratio


def _latency(part: AccelerometerParameters, decimation: Scalar) -> Scalar:
    """Sense periods to add so that the delay is first_stage + 1.5 (R - 1)/fs, at most one output period.

    That delay fits the table of Rev. D p. 26 within 1.6 % (calculated). The window itself delays by R/fs, the
    analogue filter by 1/(2 pi f).
    """
    missing = part.first_stage_delay - 1.0 / (2.0 * PI * part.bandwidth)
    ticks = round_half_up(missing * part.sampling_frequency + 0.5 * (decimation - 1.0) - 1.0)
    return minimum(maximum(ticks, 1.0), decimation)


def accelerometer_coefficients(
    part: AccelerometerParameters, mounting: Matrix3, ideal: Any
) -> AccelerometerCoefficients:
    """Coefficients of the part; an ideal one is read directly, its clock stands still."""
    frequency = part.sampling_frequency * (1.0 + part.clock_error)
    decimation = _decimation(part.output_data_rate)
    return AccelerometerCoefficients(
        sensitivity=sensitivity_matrix(part.scale_error, part.cross_axis, mounting),
        sense_period=where(ideal > 0.5, STOPPED, 1.0 / frequency),
        low_pass_gain=low_pass_gain(part.bandwidth, 1.0 / frequency),
        decimation=decimation,
        latency=_latency(part, decimation),
        sample_deviation=sample_deviation(part.noise_density, frequency),
        instability_sigma=part.bias_instability * SIGMA_PER_INSTABILITY,
    )


def at_lever_arm(force: Vector3, rate: Vector3, angular_acceleration: Vector3, arm: Vector3) -> Vector3:
    """f + w' x r + w x (w x r): specific force at the arm r from the place where f is given."""
    return add(force, add(cross(angular_acceleration, arm), cross(rate, cross(rate, arm))))


def _codes(value: Vector3, part: AccelerometerParameters) -> tuple[Vector3, Scalar]:
    codes = each_axis(lambda i: register_code(value[i], part.range, part.resolution, WORD_LENGTH))
    beyond = each_axis(lambda i: over_range(value[i], part.range))
    return codes, maximum(maximum(beyond[0], beyond[1]), beyond[2])


def initial_accelerometer(
    force: Vector3, offset: Vector3, part: AccelerometerParameters, k: AccelerometerCoefficients
) -> AccelerometerState:
    """The part after a long time at this specific force, without noise."""
    sensed = multiply(k.sensitivity, force)
    n = k.decimation
    rising = scale(0.5 * n * (n + 1.0), sensed)
    code, beyond = _codes(add(sensed, offset), part)
    zero = (0.0, 0.0, 0.0)
    return AccelerometerState(sensed, zero, zero, 0.0, rising, code, code, beyond)


def sense(part: AccelerometerState, force: Vector3, k: AccelerometerCoefficients) -> AccelerometerState:
    """Step at the sampling frequency: the true specific force enters the block; a due word reaches the registers."""
    true_x, true_y, true_z = multiply(k.sensitivity, force)
    gain = k.low_pass_gain
    x = low_pass(part.specific_force[0], true_x, gain)
    y = low_pass(part.specific_force[1], true_y, gain)
    z = low_pass(part.specific_force[2], true_z, gain)
    a, b, n, pending, code = part.sums, part.weighted_sums, part.samples + 1.0, part.pending, part.code
    due = n == k.latency
    return AccelerometerState(
        (x, y, z),
        (a[0] + x, a[1] + y, a[2] + z),
        (b[0] + n * x, b[1] + n * y, b[2] + n * z),
        n,
        part.rising,
        pending,
        (where(due, pending[0], code[0]), where(due, pending[1], code[1]), where(due, pending[2], code[2])),
        part.over_range,
    )


def register(
    state: AccelerometerState,
    offset: Vector3,
    part: AccelerometerParameters,
    k: AccelerometerCoefficients,
    draws: tuple[Scalar, ...],
) -> AccelerometerState:
    """Step at the output data rate: noise, decimation, offset, range and the next register word."""
    values, rising = [], []
    for axis in range(3):
        noise_a, noise_b = block_sums(k.sample_deviation, k.decimation, draws[2 * axis], draws[2 * axis + 1])
        y, kept = sinc2_decimated(
            state.rising[axis], state.sums[axis] + noise_a, state.weighted_sums[axis] + noise_b, k.decimation
        )
        values.append(y + offset[axis])
        rising.append(kept)
    pending, beyond = _codes((values[0], values[1], values[2]), part)
    zero = (0.0, 0.0, 0.0)
    return AccelerometerState(
        state.specific_force, zero, zero, 0.0, (rising[0], rising[1], rising[2]), pending, state.code, beyond
    )
