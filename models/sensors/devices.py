"""The parts as data: every number of a datasheet once, in the datasheet's unit, with its source and how sure it is.

Confidence of a number: ``datasheet`` (read in its text), ``figure`` (read by eye off a figure, +-20 % or worse),
``driver`` (read in driver source), ``sister`` (datasheet of a sister part), ``recalled`` (from memory, not seen),
``calculated`` (from such numbers), ``assumption`` (engineering judgement).
The sheets: ADXRS450 Rev. 0 (1/2011), ADXL354/ADXL355 Rev. D (6/2025) and Rev. 0 (9/2016).
"""

from __future__ import annotations

from typing import NamedTuple

from ..attitude.rotations import STANDARD_GRAVITY
from ..record import Matrix3, Vector3
from ..scalar import PI
from ..vectors import scale

_DEGREE = PI / 180.0
_SI_FACTOR = {
    "1": 1.0,
    "%": 1e-2,
    "Hz": 1.0,
    "s": 1.0,
    "ms": 1e-3,
    "K": 1.0,
    "deg/s": _DEGREE,
    "deg/h": _DEGREE / 3600.0,
    "deg/s/rtHz": _DEGREE,
    "deg/s/degC": _DEGREE,
    "deg/s/g": _DEGREE / STANDARD_GRAVITY,
    "LSB/(deg/s)": 1.0 / _DEGREE,
    "g": STANDARD_GRAVITY,
    "mg": 1e-3 * STANDARD_GRAVITY,
    "ug": 1e-6 * STANDARD_GRAVITY,
    "ug/rtHz": 1e-6 * STANDARD_GRAVITY,
    "mg/degC": 1e-3 * STANDARD_GRAVITY,
    "LSB/g": 1.0 / STANDARD_GRAVITY,
    "LSB": 1.0,
    "LSB/degC": 1.0,
    "cycles": 1.0,
}
CELSIUS_ZERO = 273.15
REFERENCE_TEMPERATURE = 25.0 + CELSIUS_ZERO
"""Temperature of the datasheets' typical numbers, K."""

ALLAN_MINIMUM_TO_BIAS_INSTABILITY = 1.0 / 0.664
"""B = (minimum of the Allan deviation) / sqrt(2 ln 2 / pi), IEEE Std 952 Annex C."""


class Datum(NamedTuple):
    """A number of a datasheet."""

    value: float
    unit: str
    source: str
    confidence: str = "datasheet"

    @property
    def si(self) -> float:
        """The number in SI units (rad, m, s, K)."""
        return self.value * _SI_FACTOR[self.unit]


class GyroSheet(NamedTuple):
    """Datasheet of a single-axis digital rate gyro."""

    range: Datum
    sensitivity: Datum
    noise_density: Datum
    null_accuracy: Datum
    bias_stability: Datum
    bias_temperature_slope: Datum
    g_sensitivity: Datum
    word_length: Datum
    resonator_frequency: Datum
    demodulator_bandwidth: Datum
    thermometer_sensitivity: Datum
    thermometer_code: Datum
    self_heating: Datum
    warm_up: Datum


class AccelerometerSheet(NamedTuple):
    """Datasheet of a three-axis digital accelerometer."""

    range: Datum
    sensitivity: Datum
    noise_density: Datum
    bias_stability: Datum
    offset_temperature_slope: Datum
    word_length: Datum
    sampling_frequency: Datum
    overload: Datum
    thermometer_sensitivity: Datum
    thermometer_code: Datum
    self_heating: Datum
    warm_up: Datum


ADXRS450 = GyroSheet(
    range=Datum(300.0, "deg/s", "Rev. 0 Table 1, guaranteed full scale"),
    sensitivity=Datum(80.0, "LSB/(deg/s)", "Rev. 0 Table 1"),
    noise_density=Datum(0.015, "deg/s/rtHz", "Rev. 0 Table 1, one-sided"),
    null_accuracy=Datum(3.0, "deg/s", "Rev. 0 Table 1, typical column, over temperature"),
    bias_stability=Datum(25.0, "deg/h", "Rev. 0 p. 1, minimum of the root Allan variance"),
    bias_temperature_slope=Datum(0.003, "deg/s/degC", "Rev. 0 Figure 14, 16 parts over 150 degC", "figure"),
    g_sensitivity=Datum(0.03, "deg/s/g", "Rev. 0 Table 1"),
    resonator_frequency=Datum(16e3, "Hz", "Rev. 0 p. 11; 13 to 19 kHz by Table 10"),
    word_length=Datum(16, "1", "Rev. 0 Table 9"),
    demodulator_bandwidth=Datum(10.6e3, "Hz", "Rev. 0 p. 11, three blocks below 5 us each", "calculated"),
    thermometer_sensitivity=Datum(5.0, "LSB/degC", "Rev. 0 Table 1"),
    thermometer_code=Datum(-100.0, "LSB", "0 LSB at 45 degC and 5 LSB/degC (Rev. 0 Table 1), at 25 degC", "calculated"),
    self_heating=Datum(4.5, "K", "30 mW (Rev. 0 Table 1) through 150 K/W", "assumption"),
    warm_up=Datum(60.0, "s", "small board in still air", "assumption"),
)

ADXL355 = AccelerometerSheet(
    range=Datum(2.048, "g", "20-bit code at 256000 LSB/g", "calculated"),
    sensitivity=Datum(256_000.0, "LSB/g", "Rev. D Table 2, +-2 g"),
    noise_density=Datum(22.5, "ug/rtHz", "Rev. D Table 2, +-2 g, one-sided"),
    bias_stability=Datum(3.5, "ug", "Rev. 0 Figure 56, Z axis, as quoted in public code", "driver"),
    offset_temperature_slope=Datum(0.01, "mg/degC", "Rev. D Table 2, typical"),
    word_length=Datum(20, "1", "Rev. D Table 2"),
    sampling_frequency=Datum(4000.0, "Hz", "Rev. D p. 25, first decimation"),
    overload=Datum(8.0, "g", "Rev. D p. 24, +-2 g range, +-25 %"),
    thermometer_sensitivity=Datum(-9.05, "LSB/degC", "Rev. D Table 2"),
    thermometer_code=Datum(1885.0, "LSB", "Rev. D Table 2, at 25 degC"),
    self_heating=Datum(0.1, "K", "0.66 mW (Rev. D Table 2) through 150 K/W", "assumption"),
    warm_up=Datum(60.0, "s", "small board in still air", "assumption"),
)


ADXL355_DELAYS = tuple(
    Datum(value, "ms", "Rev. D p. 26, delay by output data rate, 4000 Hz first")
    for value in (0.63, 1.00, 1.78, 3.26, 6.27, 12.34, 24.18, 47.59, 96.25, 189.58, 384.31)
)
ADXL355_HIGH_PASS = tuple(
    Datum(value, "1", "Rev. D p. 27, corner over output data rate, codes 001 to 110")
    for value in (24.7e-4, 6.2084e-4, 1.5545e-4, 0.3862e-4, 0.0954e-4, 0.0238e-4)
)
ADXL355_SELF_TEST = (
    Datum(0.3, "g", "Rev. D Table 2, X and Y, typical"),
    Datum(1.5, "g", "Rev. D Table 2, Z, typical"),
)

ADIS16354_SAMPLING_FREQUENCY = Datum(
    819.2, "Hz", "driver registers, and sister sheet ADIS16350/55 Rev. B Table 17", "driver"
)
ADIS16354_BANDWIDTH = Datum(350.0, "Hz", "sister sheet Rev. B p. 19: 0.45 ms, one pole", "sister")
ADIS16354_NULL_RESOLUTION = Datum(0.018315, "deg/s", "sister sheet Rev. B, xGYRO_OFF", "sister")


class Specimen(NamedTuple):
    """What differs from one piece of hardware to the next: one board, its values within the datasheets' spread."""

    gyro_clock_error: Vector3
    gyro_bias: Vector3
    gyro_bias_temperature_slope: Vector3
    gyro_scale_error: Vector3
    gyro_cross_axis: Matrix3
    gyro_g_sensitivity: Matrix3
    accelerometer_clock_error: float
    accelerometer_bias: Vector3
    accelerometer_bias_temperature_slope: Vector3
    accelerometer_scale_error: Vector3
    accelerometer_cross_axis: Matrix3
    processor_clock_error: float


def _in_si(values: Vector3, unit: str) -> Vector3:
    factor = _SI_FACTOR[unit]
    return values[0] * factor, values[1] * factor, values[2] * factor


def _rows_in_si(rows: Matrix3, unit: str) -> Matrix3:
    return _in_si(rows[0], unit), _in_si(rows[1], unit), _in_si(rows[2], unit)


BOARD = Specimen(
    # f0 may lie anywhere in 13..19 kHz (Rev. 0 Table 10); a few per cent apart: assumption
    gyro_clock_error=_in_si((1.3, -0.8, 2.1), "%"),
    # null 0.33 +- 0.42 deg/s at 25 degC (Rev. 0 histograms, SOIC)
    gyro_bias=_in_si((0.52, -0.21, 0.38), "deg/s"),
    # shares of the slope read off Figure 14: assumption
    gyro_bias_temperature_slope=scale(ADXRS450.bias_temperature_slope.si, (0.73, -0.43, 0.93)),
    # sensitivity 0.35 +- 0.42 % at 25 degC (Rev. 0 histograms, SOIC)
    gyro_scale_error=_in_si((0.41, -0.18, 0.64), "%"),
    # cross-axis +-3 % (Rev. 0 Table 1, typical column)
    gyro_cross_axis=_rows_in_si(((0.0, 0.9, -1.4), (-1.1, 0.0, 0.7), (1.6, -0.5, 0.0)), "%"),
    # each of the size in Table 1, directions: assumption
    gyro_g_sensitivity=(
        scale(ADXRS450.g_sensitivity.si, (0.60, -0.72, 0.35)),
        scale(ADXRS450.g_sensitivity.si, (0.32, 0.80, -0.51)),
        scale(ADXRS450.g_sensitivity.si, (-0.50, 0.37, 0.78)),
    ),
    # +-1.4 % device to device (Rev. D p. 25)
    accelerometer_clock_error=0.6 * _SI_FACTOR["%"],
    # 0 g offset +-25 mg typical (Rev. D Table 2)
    accelerometer_bias=_in_si((11.0, -7.0, 16.0), "mg"),
    accelerometer_bias_temperature_slope=scale(ADXL355.offset_temperature_slope.si, (1.0, -0.8, 1.2)),
    # sensitivity within +-8 % (Rev. D Table 2 limits); well inside: assumption
    accelerometer_scale_error=_in_si((0.8, -0.5, 1.1), "%"),
    # cross-axis 1 % (Rev. D Table 2)
    accelerometer_cross_axis=_rows_in_si(((0.0, 0.4, -0.3), (-0.4, 0.0, 0.5), (0.3, -0.5, 0.0)), "%"),
    # crystal +-20..50 ppm (recalled), with the timer's own rounding below 7 ppm
    processor_clock_error=18e-6,
)
"""The board that the sensor model has by default."""
