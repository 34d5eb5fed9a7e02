"""Three single-axis digital gyros (ADXRS450), each at its own resonator's clock.

The signal's way: sensitivity and mounting, bandwidth, g-sensitivity (sensed at f0/8); white noise, sinc^2 filter over
128/f0, offset, range, register word (updated at f0/32).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

from ..record import Boolean, Integer, Matrix3, Real, Vector3
from ..scalar import Scalar, where
from ..system import STOPPED
from ..vectors import dot, each_axis, matrix_product
from . import devices
from .bandwidth import low_pass, low_pass_gain
from .bias_instability import SIGMA_PER_INSTABILITY
from .digital_filter import (
    EMPTY,
    BlockSums,
    OverlappedWindows,
    settled_windows,
    sinc2_overlapped,
    with_samples,
)
from .quantiser import over_range, register_code
from .sensitivity import sensitivity_matrix
from .thermal import ThermalParameters
from .white_noise import block_sums, sample_deviation

_SHEET = devices.ADXRS450
WORD_LENGTH = int(_SHEET.word_length.value)
SAMPLES_PER_REGISTER = int(_SHEET.samples_per_register.value)
SENSES_PER_REGISTER = 4
SAMPLES_PER_SENSE = SAMPLES_PER_REGISTER // SENSES_PER_REGISTER
_BOARD = devices.BOARD


class GyroParameters(NamedTuple):
    """A triad of ADXRS450 and what is peculiar to this board's three."""

    range: Annotated[float, Real("rad/s", "full scale", min=1e-3, display="deg/s")] = _SHEET.range.si
    resolution: Annotated[float, Real("rad/s", "one LSB of the rate register", min=1e-12, display="deg/s")] = (
        1.0 / _SHEET.sensitivity.si
    )
    noise_density: Annotated[float, Real("rad/(s.Hz^0.5)", "white rate noise, one-sided", min=0.0)] = (
        _SHEET.noise_density.si
    )
    bias_instability: Annotated[float, Real("rad/s", "flicker of the bias, IEEE 952 B", min=0.0, display="deg/h")] = (
        _SHEET.bias_stability.si * devices.ALLAN_MINIMUM_TO_BIAS_INSTABILITY
    )
    bandwidth: Annotated[float, Real("Hz", "analogue bandwidth before the digital filter", min=1.0)] = (
        _SHEET.demodulator_bandwidth.si
    )
    resonator_frequency: Annotated[
        float, Real("Hz", "nominal f0, from which every rate of the part follows", min=1e3, max=1e5)
    ] = _SHEET.resonator_frequency.si
    clock_error: Annotated[Vector3, Real("1", "relative error of f0", min=-0.25, max=0.25)] = _BOARD.gyro_clock_error
    bias: Annotated[Vector3, Real("rad/s", "null offset at 25 degC", display="deg/s")] = _BOARD.gyro_bias
    bias_temperature_slope: Annotated[Vector3, Real("rad/(s.K)", "change of the offset with temperature")] = (
        _BOARD.gyro_bias_temperature_slope
    )
    scale_error: Annotated[Vector3, Real("1", "relative error of the sensitivity", min=-0.5, max=0.5)] = (
        _BOARD.gyro_scale_error
    )
    cross_axis: Annotated[Matrix3, Real("1", "share of the column's axis in the row's reading", min=-0.5, max=0.5)] = (
        _BOARD.gyro_cross_axis
    )
    g_sensitivity: Annotated[Matrix3, Real("rad.s/m", "reading of the row's gyro by specific force of the column")] = (
        _BOARD.gyro_g_sensitivity
    )
    thermal: ThermalParameters = ThermalParameters(_SHEET.self_heating.si, _SHEET.warm_up.si)


class GyroCoefficients(NamedTuple):
    """What follows from the parameters."""

    sensitivity: Annotated[Matrix3, Real("1", "reading of the row's gyro by body rate of the column")]
    g_sensitivity: Annotated[Matrix3, Real("rad.s/m", "reading of the row's gyro by body specific force")]
    sense_period: Annotated[Vector3, Real("s", "time between inputs taken")]
    low_pass_gain: Annotated[Vector3, Real("1", "share of a step taken over in a sense period")]
    sample_deviation: Annotated[Vector3, Real("rad/s", "white noise of a sample at f0")]
    instability_sigma: Annotated[float, Real("rad/s", "standard deviation of one Gauss-Markov process of the bias")]


class GyroState(NamedTuple):
    """One gyro."""

    rate: Annotated[float, Real("rad/s", "rate behind the analogue bandwidth")]
    sensed: Annotated[float, Real("rad/s", "rate and what specific force adds to it, as last sensed")]
    block: Annotated[BlockSums, Real("rad/s", "sums of the block under way")]
    windows: Annotated[OverlappedWindows, Real("rad/s", "partial sums of the windows under way")]
    code: Annotated[float, Integer("rate register")]
    over_range: Annotated[float, Boolean("reading beyond the range")]


def gyro_coefficients(gyro: GyroParameters, mounting: Matrix3, ideal: Any) -> GyroCoefficients:
    """Coefficients of the triad; an ideal one is read directly, its clocks stand still."""
    perfect = ideal > 0.5
    frequency = each_axis(lambda i: gyro.resonator_frequency * (1.0 + gyro.clock_error[i]))
    period = each_axis(lambda i: SAMPLES_PER_SENSE / frequency[i])
    return GyroCoefficients(
        sensitivity=sensitivity_matrix(gyro.scale_error, gyro.cross_axis, mounting),
        g_sensitivity=matrix_product(gyro.g_sensitivity, mounting),
        sense_period=each_axis(lambda i: where(perfect, STOPPED, period[i])),
        low_pass_gain=each_axis(lambda i: low_pass_gain(gyro.bandwidth, period[i])),
        sample_deviation=each_axis(lambda i: sample_deviation(gyro.noise_density, frequency[i])),
        instability_sigma=gyro.bias_instability * SIGMA_PER_INSTABILITY,
    )


def _register(
    gyro: GyroState, value: Scalar, block: BlockSums, windows: OverlappedWindows, parameters: GyroParameters
) -> GyroState:
    code = register_code(value, parameters.range, parameters.resolution, WORD_LENGTH)
    return GyroState(gyro.rate, gyro.sensed, block, windows, code, over_range(value, parameters.range))


def initial_gyro(
    axis: int, rate: Vector3, force: Vector3, offset: Scalar, parameters: GyroParameters, k: GyroCoefficients
) -> GyroState:
    """The gyro after a long time at these inputs, without noise."""
    passed = dot(k.sensitivity[axis], rate)
    sensed = passed + dot(k.g_sensitivity[axis], force)
    settled = settled_windows(sensed, float(SAMPLES_PER_REGISTER))
    return _register(GyroState(passed, sensed, EMPTY, settled, 0.0, 0.0), sensed + offset, EMPTY, settled, parameters)


def sense(axis: int) -> Callable[[GyroState, Vector3, Vector3, GyroCoefficients], GyroState]:
    """Step of one gyro at f0/8: the true rate and specific force enter the block.

    The eight samples since the last step are taken at their mean, half way between what was sensed then and now.
    """

    def step(gyro: GyroState, rate: Vector3, force: Vector3, k: GyroCoefficients) -> GyroState:
        passed = low_pass(gyro.rate, dot(k.sensitivity[axis], rate), k.low_pass_gain[axis])
        sensed = passed + dot(k.g_sensitivity[axis], force)
        block = with_samples(gyro.block, 0.5 * (gyro.sensed + sensed), float(SAMPLES_PER_SENSE))
        return GyroState(passed, sensed, block, gyro.windows, gyro.code, gyro.over_range)

    return step


def register(
    axis: int,
) -> Callable[[GyroState, Scalar, GyroParameters, GyroCoefficients, tuple[Scalar, ...]], GyroState]:
    """Step of one gyro at f0/32: noise, filter, offset, range and register word."""

    def step(
        gyro: GyroState, offset: Scalar, parameters: GyroParameters, k: GyroCoefficients, draws: tuple[Scalar, ...]
    ) -> GyroState:
        n = float(SAMPLES_PER_REGISTER)
        noise_a, noise_b = block_sums(k.sample_deviation[axis], n, draws[0], draws[1])
        y, windows = sinc2_overlapped(gyro.windows, gyro.block.a + noise_a, gyro.block.b + noise_b, n)
        return _register(gyro, y + offset, EMPTY, windows, parameters)

    return step
