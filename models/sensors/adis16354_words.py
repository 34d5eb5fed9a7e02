"""ADIS16354 registers: output words, temperature, supply and auxiliary codes, STATUS, SENS/AVG, SMPL_PRD and offsets.

The ADIS16354's own datasheet was not found. Layouts: ADIS16350/ADIS16355 Rev. B (9/2009), the sister with the same
register map; driver sources written for the ADIS16354 (PX4, Chamberlain's ADIS16354A.h) confirm the addresses and the
weights below. The accelerometer's weight is the ADIS16354's: Linux adis16400.c has the sister's 2.522 mg for it.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean
from ..scalar import Scalar, both, clip, minimum, round_half_up, where
from .adis16354_sheet import ACCELEROMETERS, AUXILIARY_WEIGHT, GYRO_RANGES, GYROS_300, SUPPLY, SUPPLY_WEIGHT
from .datasheet import REFERENCE_TEMPERATURE
from .words import field, flags, nearest_signed, nearest_unsigned, pattern, signed

RANGE_75, RANGE_150, RANGE_300 = 1.0, 2.0, 4.0
"""SENS/AVG [10:8] for +-75, +-150 and +-300 deg/s: the range in units of 75 deg/s."""

DATA_BITS, SHORT_BITS = 14, 12
"""Width of gyro and accelerometer data, and of temperature, supply and auxiliary data."""

TEMPERATURE_WEIGHT: float = 1.0 / GYROS_300.si("thermometer.sensitivity")
"""K/LSB, 0 at 25 degC (ADIS16354A.h; sister Rev. B Table 1)."""

GYRO_OFFSET_WEIGHT: float = GYROS_300.si("null_resolution")
"""rad/s per LSB of X/Y/ZGYRO_OFF (sister Rev. B): a quarter of the data's 0.07326 deg/s at +-300 deg/s."""

ACCELERATION_WEIGHT: float = ACCELEROMETERS.si("resolution")
"""m/s^2 per LSB of X/Y/ZACCL_OUT and X/Y/ZACCL_OFF (ADIS16354A.h; 0.467 mg in PX4)."""

FAST_TIME_BASE, SLOW_TIME_BASE = 0.61035e-3, 18.921e-3
"""s, for TB = 0 and 1 (PX4; sister Rev. B Table 17)."""

_GYRO_OFFSET_BITS, _ACCELERATION_OFFSET_BITS = 13, 12


class Status(NamedTuple):
    """STATUS (0x3C) bits, each 0 or 1: 15 to 8, then 5 to 0."""

    z_acceleration: Annotated[float, Boolean("15: Z accelerometer failed its self-test")] = 0.0
    y_acceleration: Annotated[float, Boolean("14: Y accelerometer failed its self-test")] = 0.0
    x_acceleration: Annotated[float, Boolean("13: X accelerometer failed its self-test")] = 0.0
    z_gyro: Annotated[float, Boolean("12: Z gyro failed its self-test")] = 0.0
    y_gyro: Annotated[float, Boolean("11: Y gyro failed its self-test")] = 0.0
    x_gyro: Annotated[float, Boolean("10: X gyro failed its self-test")] = 0.0
    alarm_2: Annotated[float, Boolean("9: alarm 2")] = 0.0
    alarm_1: Annotated[float, Boolean("8: alarm 1")] = 0.0
    self_test: Annotated[float, Boolean("5: self-test error")] = 0.0
    over_range: Annotated[float, Boolean("4: a sensor beyond its range")] = 0.0
    spi: Annotated[float, Boolean("3: SPI communication failed")] = 0.0
    control_update: Annotated[float, Boolean("2: control register update failed")] = 0.0
    supply_high: Annotated[float, Boolean("1: supply above 5.25 V")] = 0.0
    supply_low: Annotated[float, Boolean("0: supply below 4.75 V")] = 0.0


_HIGH_BYTE = 8


def output_word(code: Scalar, new_data: Scalar, error: Scalar, bits: int = DATA_BITS) -> Scalar:
    """16-bit output word: 15 ND (not read before), 14 EA (error or alarm), then the code, right-justified.

    13..0 gyro and accelerometer data in two's complement; with `bits` = 12 temperature (two's complement), supply and
    auxiliary data, for which bits 13 and 12 are unused, zero here.
    """
    return 2.0**15 * new_data + 2.0**14 * error + pattern(code, bits)


def code_of_output(word: Scalar, bits: int = DATA_BITS) -> Scalar:
    """Signed code of an output word, whatever ND and EA are (supply and auxiliary data: `field(word, 0, 12)`)."""
    return signed(word, bits)


def temperature_code(temperature: Scalar) -> Scalar:
    """Signed 12-bit code of X/Y/ZTEMP_OUT for a temperature in K: 0.1453 degC/LSB, 0 at 25 degC."""
    return nearest_signed((temperature - REFERENCE_TEMPERATURE) / TEMPERATURE_WEIGHT, SHORT_BITS)


def temperature_of_code(code: Scalar) -> Scalar:
    """Temperature in K that a signed 12-bit code stands for."""
    return REFERENCE_TEMPERATURE + TEMPERATURE_WEIGHT * code


def supply_code(voltage: Scalar) -> Scalar:
    """Unsigned 12-bit code of SUPPLY_OUT for a supply in V, 1.8315 mV/LSB."""
    return nearest_unsigned(voltage / SUPPLY_WEIGHT.si, SHORT_BITS)


def auxiliary_code(voltage: Scalar) -> Scalar:
    """Unsigned 12-bit code of AUX_ADC for an input in V, 0.6105 mV/LSB, 2.5 V at full scale."""
    return nearest_unsigned(voltage / AUXILIARY_WEIGHT.si, SHORT_BITS)


def status_word(status: Status) -> Scalar:
    """STATUS (0x3C): 15..13 Z/Y/X accelerometer, 12..10 Z/Y/X gyro, 9..8 alarms, 7..6 zero, 5..0 errors."""
    return 2.0**8 * flags(status[:_HIGH_BYTE]) + flags(status[_HIGH_BYTE:])


def supply_errors(supply: Scalar) -> tuple[Scalar, Scalar]:
    """STATUS bits 0 and 1 of a supply in V, each 0 or 1: below 4.75 V, above 5.25 V."""
    lowest, highest = SUPPLY
    return where(supply < lowest.si, 1.0, 0.0), where(supply > highest.si, 1.0, 0.0)


def error_or_alarm(word: Scalar) -> Scalar:
    """EA bit of the output words: 1.0 where any bit of STATUS is set (said so for the sister ADIS16362), else 0.0."""
    return where(word > 0.0, 1.0, 0.0)


def sensitivity_average_word(range_code: Scalar, exponent: Scalar) -> Scalar:
    """SENS/AVG (0x38): 10..8 range code 1, 2 or 4, 2..0 exponent M of the N = 2^M taps; default 0x0402."""
    return 2.0**8 * range_code + exponent


def sensitivity_average_fields(word: Scalar) -> tuple[Scalar, Scalar]:
    """Range code and exponent M that a SENS/AVG word holds."""
    return field(word, 8, 3), field(word, 0, 3)


def least_exponent(range_code: Scalar) -> Scalar:
    """Smallest M that a range may be used with: 0 for +-300, 2 for +-150, 4 for +-75 deg/s (sister Rev. B)."""
    at_75, at_150, at_300 = (offered.least_exponent.si for offered in GYRO_RANGES)
    return where(range_code > 3.0, at_300, where(range_code > 1.5, at_150, at_75))


def nearest_range(wanted: Scalar, exponent: Scalar) -> Scalar:
    """The range (rad/s), of those that 2^M taps go with, nearest to the wanted one."""
    wider = GYRO_RANGES[-1].range.si
    nearest: Scalar = wider
    for offered in reversed(GYRO_RANGES[:-1]):
        range_ = offered.range.si
        is_nearer = both(exponent >= offered.least_exponent.si, wanted < 0.5 * (range_ + wider))
        nearest, wider = where(is_nearer, range_, nearest), range_
    return nearest


def ranges_in_words() -> str:
    """What SENS/AVG offers, for people."""
    offers = []
    for offered in reversed(GYRO_RANGES):
        taps = 2 ** int(offered.least_exponent.si)
        fewest = f" with {taps} taps or more" if taps > 1 else ""
        offers.append(f"+-{offered.range.value:g} {offered.range.unit}{fewest}")
    return ", ".join(offers)


def gyro_weight(range_code: Scalar) -> Scalar:
    """rad/s per LSB of X/Y/ZGYRO_OUT: 0.07326, 0.03663 and 0.01832 deg/s at +-300, +-150 and +-75 deg/s."""
    return GYRO_OFFSET_WEIGHT * range_code


def sample_period_word(slow: Scalar, count: Scalar) -> Scalar:
    """SMPL_PRD (0x36): bit 7 TB (1 for the slow time base), 6..0 N_S; default 0x0001."""
    return 2.0**7 * slow + count


def sample_period(word: Scalar) -> Scalar:
    """Period in s that a SMPL_PRD word sets: time base times (N_S + 1).

    The sister's sheet rates the part from 819.2 (0x01) down to 0.413 samples/s (0xFF).
    """
    base = where(field(word, 7, 1) > 0.5, SLOW_TIME_BASE, FAST_TIME_BASE)
    return base * (field(word, 0, 7) + 1.0)


def nearest_divider(wanted: Scalar) -> Scalar:
    """The divider of 819.2 SPS, of the whole ones that SMPL_PRD can make, nearest to a wanted one.

    Period over that of 0x01: (N_S + 1)/2 with the fast time base, 31 times that with the slow one, N_S up to 127, and
    none faster than 0x01. Whole are 1 to 64 and the multiples of 31 up to 1984, 0.413 SPS.
    """
    slow = clip(31.0 * round_half_up(wanted / 31.0), 93.0, 1984.0)
    return where(wanted > 78.5, slow, minimum(wanted, 64.0))


def gyro_offset_word(rate: Scalar) -> Scalar:
    """X/Y/ZGYRO_OFF word for a correction in rad/s: 13 bits two's complement, 0.018315 deg/s an LSB, +-75 deg/s."""
    return pattern(nearest_signed(rate / GYRO_OFFSET_WEIGHT, _GYRO_OFFSET_BITS), _GYRO_OFFSET_BITS)


def gyro_offset(word: Scalar) -> Scalar:
    """Correction in rad/s that a GYRO_OFF word adds; bits 15..13 are ignored."""
    return GYRO_OFFSET_WEIGHT * signed(word, _GYRO_OFFSET_BITS)


def acceleration_offset_word(acceleration: Scalar) -> Scalar:
    """X/Y/ZACCL_OFF word for a correction in m/s^2: 12 bits two's complement, 0.4672 mg an LSB, +-0.957 g.

    That the weight is the ADIS16354's own data weight is calculated: the sister's +-5.16 g goes with its 2.522 mg.
    """
    return pattern(
        nearest_signed(acceleration / ACCELERATION_WEIGHT, _ACCELERATION_OFFSET_BITS), _ACCELERATION_OFFSET_BITS
    )


def acceleration_offset(word: Scalar) -> Scalar:
    """Correction in m/s^2 that an ACCL_OFF word adds; bits 15..12 are ignored."""
    return ACCELERATION_WEIGHT * signed(word, _ACCELERATION_OFFSET_BITS)
