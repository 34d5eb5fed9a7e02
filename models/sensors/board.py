"""The board that the sensor model has by default: one piece of each part, its errors within the sheets' spread."""

from __future__ import annotations

from typing import NamedTuple

from ..record import Matrix3, Vector3
from ..vectors import scale
from .datasheet import in_si


class Board(NamedTuple):
    """What differs from one board to the next."""

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
    return scale(in_si(1.0, unit), values)


def _rows_in_si(rows: Matrix3, unit: str) -> Matrix3:
    return _in_si(rows[0], unit), _in_si(rows[1], unit), _in_si(rows[2], unit)


BOARD = Board(
    # far within the sheet's 13 to 19 kHz: three parts of one lot
    gyro_clock_error=_in_si((1.3, -0.8, 2.1), "%"),
    gyro_bias=_in_si((0.52, -0.21, 0.38), "deg/s"),
    gyro_bias_temperature_slope=scale(in_si(0.003, "deg/s/degC"), (0.73, -0.43, 0.93)),
    gyro_scale_error=_in_si((0.41, -0.18, 0.64), "%"),
    gyro_cross_axis=_rows_in_si(((0.0, 0.9, -1.4), (-1.1, 0.0, 0.7), (1.6, -0.5, 0.0)), "%"),
    # each gyro's as long as the sheet's 0.03 deg/s/g
    gyro_g_sensitivity=(
        scale(in_si(0.03, "deg/s/g"), (0.60, -0.72, 0.35)),
        scale(in_si(0.03, "deg/s/g"), (0.32, 0.80, -0.51)),
        scale(in_si(0.03, "deg/s/g"), (-0.50, 0.37, 0.78)),
    ),
    accelerometer_clock_error=in_si(0.6, "%"),
    accelerometer_bias=_in_si((11.0, -7.0, 16.0), "mg"),
    accelerometer_bias_temperature_slope=scale(in_si(0.01, "mg/degC"), (1.0, -0.8, 1.2)),
    accelerometer_scale_error=_in_si((0.8, -0.5, 1.1), "%"),
    accelerometer_cross_axis=_rows_in_si(((0.0, 0.4, -0.3), (-0.4, 0.0, 0.5), (0.3, -0.5, 0.0)), "%"),
    # a crystal's 20 to 50 ppm, with the timer's own rounding below 7 ppm
    processor_clock_error=18e-6,
)
