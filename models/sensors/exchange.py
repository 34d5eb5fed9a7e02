"""What the parts answer with when the processor reads them: code, freshness and condition of that one exchange."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, NamedTuple

from ..record import Integer, Real, Vector3
from ..scalar import Scalar, floor, maximum, where
from ..vectors import each_axis
from . import adis16354_words as adis16354
from . import adxl355_registers as adxl355
from . import adxrs450_frame as adxrs450
from .accelerometer import RegisterWords
from .gyro import GyroState
from .words import field, signed

Gyros = tuple[GyroState, GyroState, GyroState]


class Received(NamedTuple):
    """What the last exchange with each channel brought; `shown_words` makes the words of it."""

    gyro: Annotated[
        Vector3, Real("1", "ADXRS450: code + 2^32 (SQ + 8 condition + 32 PWR + 64 CHK); ADIS16354: output word")
    ]
    accelerometer: Annotated[Vector3, Integer("ADXL355: code; ADIS16354: output word")]
    status: Annotated[float, Integer("STATUS of an ADIS16354, 0 for the other parts")]


class Exchange(NamedTuple):
    """What the words depend on beside the parts: the exchange's number, what is new in it, supply and self-test."""

    number: Scalar
    gyro_is_new: Vector3
    accelerometer_is_new: Vector3
    volts: Scalar
    checking: Scalar


Answering = Callable[[Gyros, RegisterWords, Exchange], Received]


def of_adxrs450_and_adxl355(gyro: Gyros, part: RegisterWords, exchange: Exchange) -> Received:
    """Codes of three ADXRS450, packed with what goes into their frames, and of an ADXL355.

    Frames take time to make, and few are ever looked at.
    """
    sequence = exchange.number - 8.0 * floor(exchange.number / 8.0)
    common = sequence + 32.0 * adxrs450.power_fault(exchange.volts) + 64.0 * exchange.checking
    packed = each_axis(lambda i: gyro[i].code + 2.0**32 * (common + 8.0 * gyro[i].condition))
    return Received(packed, part.code, 0.0)


def adxrs450_response(packed: Scalar) -> Scalar:
    """The sensor data response, 0 .. 2^32 - 1, of an ADXRS450; stuck fails the self-test, silent the PLL too."""
    code = signed(packed, 32)
    header = (packed - code) * 2.0**-32
    sequence, condition, power, checking = (field(header, *place) for place in ((0, 3), (3, 2), (5, 1), (6, 1)))
    lost = where(condition > 1.5, 1.0, 0.0)
    faults = adxrs450.FaultBits(
        phase_lock=maximum(lost, checking),
        quadrature=checking,
        memory=checking,
        power_on_reset=checking,
        power=maximum(power, checking),
        self_test=maximum(where(condition > 0.5, 1.0, 0.0), checking),
        check=checking,
    )
    return adxrs450.sensor_data_response(code, sequence, adxrs450.data_status(checking, lost), faults)


def shown_words(received: Received, is_adxrs450: Scalar) -> Received:
    """The words received: ADXRS450 32-bit responses as signed numbers, ADXL355 24-bit, ADIS16354 16-bit words."""
    return Received(
        each_axis(
            lambda i: where(is_adxrs450, adxrs450.as_int32(adxrs450_response(received.gyro[i])), received.gyro[i])
        ),
        each_axis(
            lambda i: where(is_adxrs450, adxl355.data_word(received.accelerometer[i]), received.accelerometer[i])
        ),
        received.status,
    )


def of_adis16354(gyro: Gyros, part: RegisterWords, exchange: Exchange) -> Received:
    """Output words of an ADIS16354 and its STATUS: self-test failures of stuck or silent channels, range, supply."""
    failed = [where(condition > 0.5, 1.0, 0.0) for condition in (*(one.condition for one in gyro), *part.condition)]
    beyond = maximum(maximum(gyro[0].over_range, gyro[1].over_range), maximum(gyro[2].over_range, part.over_range))
    low, high = adis16354.supply_errors(exchange.volts)
    status = adis16354.status_word(
        adis16354.Status(
            z_acceleration=failed[5],
            y_acceleration=failed[4],
            x_acceleration=failed[3],
            z_gyro=failed[2],
            y_gyro=failed[1],
            x_gyro=failed[0],
            self_test=where(sum(failed) > 0.5, 1.0, 0.0),
            over_range=beyond,
            supply_high=high,
            supply_low=low,
        )
    )
    error = adis16354.error_or_alarm(status)
    return Received(
        each_axis(lambda i: adis16354.output_word(gyro[i].code, exchange.gyro_is_new[i], error)),
        each_axis(lambda i: adis16354.output_word(part.code[i], exchange.accelerometer_is_new[i], error)),
        status,
    )
