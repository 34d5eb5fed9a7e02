"""ADXRS450 on its SPI: 32-bit command and response frames, fault word, self-test limits and temperature word.

A frame is the number 0 .. 2^32 - 1 that its bits are, most significant first on the wire; `as_int32` gives what an FMI
Integer carries. Layouts: ADXRS450 Rev. 0 Tables 8 and 9. A command is answered in the exchange after it.

The functions named decode_* are for tests and for users who read recorded frames: plain Python integers, not signals.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean
from ..scalar import Scalar, absolute, either, floor, where
from .adxrs450_sheet import ADXRS450, CONTINUOUS_SELF_TEST, SUPPLY, THERMOMETER_ZERO
from .datasheet import CELSIUS_ZERO
from .words import field, flags, nearest_signed, odd, ones, parity, pattern, signed

INVALID, VALID, SELF_TEST, REGISTER = 0.0, 1.0, 2.0, 3.0
"""Status bits ST1..0: invalid data or error, sensor data, self-test data (CHK), answer to read or write."""

FIRST_RESPONSE = 1.0
"""First response after power-on, 0x00000001 (Rev. 0); P1 holds in it, P0 does not."""

RATE, TEMPERATURE, LOW_SELF_TEST, HIGH_SELF_TEST, QUADRATURE = 0x00, 0x02, 0x04, 0x06, 0x08
FAULT, PART_IDENTITY, SERIAL_NUMBER_HIGH, SERIAL_NUMBER_LOW, NULL_CORRECTION = 0x0A, 0x0C, 0x0E, 0x10, 0x12
"""Addresses of the 16-bit registers (Rev. 0 memory map); only the null correction can be written."""

SELF_TEST_NOMINAL = CONTINUOUS_SELF_TEST.value
"""Continuous self-test (LOCST register) of a sound part, LSB of 1/80 deg/s (Rev. 0 Table 1)."""

SELF_TEST_FLAG_TOLERANCE, SELF_TEST_VALID_TOLERANCE = 320.0, 1280.0
"""Deviations, LSB, that set the fault bit CST and the status 00: Rev. 0 Table 1 (2239..2879 and 1279..3839)."""

SELF_TEST_FLAG_TOLERANCE_OF_TEXT, SELF_TEST_VALID_TOLERANCE_OF_TEXT = 512.0, 1856.0
"""The same limits as the text of the same Rev. 0 has them, in contradiction to its Table 1."""

_TEMPERATURE_ZERO = THERMOMETER_ZERO.value
_TEMPERATURE_SENSITIVITY = ADXRS450.si("thermometer.sensitivity")


class FaultBits(NamedTuple):
    """Fault bits, each 0 or 1, in the order of the FAULT register's bits 11 to 1 (Rev. 0; Linux adxrs450.c agrees)."""

    fail: Annotated[float, Boolean("FAIL: a failure that sets the status to 00")] = 0.0
    amplitude: Annotated[float, Boolean("AMP: resonator amplitude lost")] = 0.0
    over_voltage: Annotated[float, Boolean("OV: regulator above its limit")] = 0.0
    under_voltage: Annotated[float, Boolean("UV: regulator below its limit")] = 0.0
    phase_lock: Annotated[float, Boolean("PLL: out of step with the resonator")] = 0.0
    quadrature: Annotated[float, Boolean("Q: quadrature above 4096 LSB")] = 0.0
    memory: Annotated[float, Boolean("NVM: fault of the nonvolatile memory")] = 0.0
    power_on_reset: Annotated[float, Boolean("POR: power-on reset failed")] = 0.0
    power: Annotated[float, Boolean("PWR: 3 V regulator below 2.77 V or above 3.3 V")] = 0.0
    self_test: Annotated[float, Boolean("CST: continuous self-test outside its limits")] = 0.0
    check: Annotated[float, Boolean("CHK: faults made on command")] = 0.0


NO_FAULTS = FaultBits()
ALL_FAULTS = FaultBits(*(1.0,) * len(NO_FAULTS))
_REGISTER_MARK = float(0b1110 << 8)  # bits 27..24 of every answer but sensor data; the first two are the status 11
_FIRST_IN_FRAME = FaultBits._fields.index("phase_lock")


class RequestErrors(NamedTuple):
    """Why a read or write was refused: bits 18 to 16 of the error response (Rev. 0 Table 9)."""

    spi: Annotated[float, Boolean("SPI: wrong frame")] = 0.0
    request: Annotated[float, Boolean("RE: wrong request")] = 0.0
    unavailable: Annotated[float, Boolean("DU: data not available")] = 0.0


def as_int32(frame: Scalar) -> Scalar:
    """Two's-complement value, -2^31 .. 2^31 - 1, of a 32-bit frame: what an FMI Integer can carry."""
    return signed(frame, 32)


def fault_word(faults: FaultBits) -> Scalar:
    """FAULT word (0x0A): 11 FAIL, 10 AMP, 9 OV, 8 UV, 7 PLL, 6 Q, 5 NVM, 4 POR, 3 PWR, 2 CST, 1 CHK (Rev. 0)."""
    return 2.0 * flags(faults)


def fault_byte(faults: FaultBits) -> Scalar:
    """Fault bits that every sensor data response carries: bits 7 PLL to 1 CHK."""
    return 2.0 * flags(faults[_FIRST_IN_FRAME:])


def self_test_fault(self_test: Scalar, tolerance: float = SELF_TEST_FLAG_TOLERANCE) -> Scalar:
    """Fault bit CST, 0 or 1, of the LOCST register's value in LSB.

    Rev. 0 contradicts itself: +-320 LSB in Table 1, the default here, +-512 in the text.
    """
    return where(absolute(self_test - SELF_TEST_NOMINAL) > tolerance, 1.0, 0.0)


def self_test_invalidates(self_test: Scalar, tolerance: float = SELF_TEST_VALID_TOLERANCE) -> Scalar:
    """1.0 where the LOCST register's value in LSB is so far off that the data count as invalid (status 00), else 0.0.

    Rev. 0 contradicts itself: +-1280 LSB in Table 1, the default here, +-1856 in the text.
    """
    return where(absolute(self_test - SELF_TEST_NOMINAL) > tolerance, 1.0, 0.0)


def power_fault(supply: Scalar) -> Scalar:
    """Fault bit PWR, 0 or 1, of a supply in V: set outside 3.15 to 5.25 V (Rev. 0 Table 1).

    The part watches its 3 V regulator (2.77 to 3.3 V); that this leaves its limits where the supply does is assumed.
    """
    lowest, highest = SUPPLY
    return where(either(supply < lowest.si, supply > highest.si), 1.0, 0.0)


def data_status(checking: Scalar, invalid: Scalar) -> Scalar:
    """Status bits ST1..0 of a sensor data response from two switches, each 0 or 1.

    `checking`: the data come from a check (CHK); it wins, since such data are marked 10 although every fault is set in
    them (Rev. 0 Figure 27). `invalid`: phase lock lost or gross self-test failure.
    """
    return where(checking > 0.5, SELF_TEST, where(invalid > 0.5, INVALID, VALID))


def _framed(upper: Scalar, lower: Scalar, lower_ones: Scalar) -> Scalar:
    """A response of two 16-bit halves, its parity bits P0 (bit 28) and P1 (bit 0) put in place of their zeros.

    P0 makes the upper half odd; then P1 has only to make the lower half even for the whole frame to be odd.
    `lower_ones` is a number as odd as the count of ones in the lower half.
    """
    p0 = 1.0 - parity(upper, 16)
    p1 = odd(lower_ones)
    return 2.0**16 * (upper + 2.0**12 * p0) + (lower + p1)


def sensor_data_response(code: Scalar, sequence: Scalar, status: Scalar, faults: FaultBits) -> Scalar:
    """Response to a sensor data command, 0 .. 2^32 - 1.

    31..29 SQ2..0, 28 P0, 27..26 ST1..0, 25..10 rate code (two's complement, 80 LSB/(deg/s)), 9..8 zero, 7 PLL, 6 Q,
    5 NVM, 4 POR, 3 PWR, 2 CST, 1 CHK, 0 P1 (Rev. 0 Table 9). P0 is odd parity over [31:16], P1 over [31:0].
    The sequence is that of the command, 0 to 7.
    """
    data = pattern(code, 16)
    high = floor(2.0**-6 * data)
    low = data - 2.0**6 * high
    return _framed(
        2.0**13 * sequence + 2.0**10 * status + high,
        2.0**10 * low + fault_byte(faults),
        ones(low, 6) + sum(faults[_FIRST_IN_FRAME:]),
    )


def _register_response(kind: float, data: Scalar) -> Scalar:
    word = pattern(data, 16)
    high = floor(2.0**-11 * word)
    low = word - 2.0**11 * high
    return _framed(kind * 2.0**13 + _REGISTER_MARK + high, 2.0**5 * low, ones(low, 11))


def read_response(data: Scalar) -> Scalar:
    """Response to a read.

    31..29 010, 28 P0, 27..24 1110, 23..21 zero, 20..5 register word, 4..1 zero, 0 P1 (Rev. 0 Table 9).
    """
    return _register_response(2.0, data)


def write_response(data: Scalar) -> Scalar:
    """Response to a write: 31..29 001, the rest as `read_response` (Rev. 0 Table 9)."""
    return _register_response(1.0, data)


def error_response(errors: RequestErrors, faults: FaultBits) -> Scalar:
    """Response to a refused read or write.

    31..29 000, 28 P0, 27..24 1110, 23..21 zero, 20..19 zero, 18 SPI, 17 RE, 16 DU, 15..8 undefined (zero here), 7..1
    faults, 0 P1 (Rev. 0 Table 9).
    """
    return _framed(_REGISTER_MARK + flags(errors), fault_byte(faults), sum(faults[_FIRST_IN_FRAME:]))


def _commanded(word: Scalar) -> Scalar:
    """The command with its parity bit 0, which makes the count of ones odd."""
    return word + (1.0 - parity(word, 32))


def sensor_data_command(sequence: Scalar = 0.0, check: Scalar = 0.0) -> Scalar:
    """Command that asks for sensor data; `sequence` is 0 to 7, `check` (0 or 1) makes the part raise every fault.

    31 SQ1, 30 SQ0, 29 one, 28 SQ2 (not the response's order), 27..2 zero, 1 CHK, 0 odd parity (Rev. 0 Table 8).
    """
    highest = floor(0.25 * sequence)
    word = 2.0**30 * (sequence - 4.0 * highest) + 2.0**29 + 2.0**28 * highest + 2.0 * check
    return word + (1.0 - odd(1.0 + ones(sequence, 3) + check))


def read_command(address: Scalar) -> Scalar:
    """Command that reads a register: 31..29 100, 28..26 zero, 25..17 address, 16..1 zero, 0 odd parity (Table 8)."""
    return _commanded(2.0**31 + 2.0**17 * address)


def write_command(address: Scalar, data: Scalar) -> Scalar:
    """Command that writes a register: 31..29 010, 28..26 zero, 25..17 address, 16..1 data, 0 odd parity (Table 8)."""
    return _commanded(2.0**30 + 2.0**17 * address + 2.0 * pattern(data, 16))


def temperature_word(temperature: Scalar) -> Scalar:
    """TEM register word (0x02) of the part's temperature in K.

    10 bits two's complement in bits 15..6, 5 LSB/degC, 0 at 45 degC (Rev. 0 Table 1); bits 5..0 zero.
    """
    code = nearest_signed((temperature - CELSIUS_ZERO - _TEMPERATURE_ZERO) * _TEMPERATURE_SENSITIVITY, 10)
    return 2.0**6 * pattern(code, 10)


def temperature_of_word(word: Scalar) -> Scalar:
    """Temperature in K that a TEM register word stands for."""
    return signed(field(word, 6, 10), 10) / _TEMPERATURE_SENSITIVITY + _TEMPERATURE_ZERO + CELSIUS_ZERO


class SensorData(NamedTuple):
    """A sensor data response taken apart; faults beyond the frame's seven are zero."""

    sequence: int
    status: int
    code: int
    faults: FaultBits
    parity_holds: bool


class RegisterAnswer(NamedTuple):
    """An answer to a read, a write or (kind "error") a refused request; data are unsigned, zero in an error."""

    kind: str
    data: int
    errors: RequestErrors
    faults: FaultBits
    parity_holds: bool


class Command(NamedTuple):
    """A command taken apart; what its kind does not carry is zero."""

    kind: str
    sequence: int
    check: int
    address: int
    data: int
    parity_holds: bool


def _parities_hold(frame: int) -> bool:
    return (frame >> 16).bit_count() % 2 == 1 and frame.bit_count() % 2 == 1


def _decode_faults(frame: int) -> FaultBits:
    names = FaultBits._fields[_FIRST_IN_FRAME:]
    return FaultBits(**{name: float(frame >> bit & 1) for name, bit in zip(names, range(7, 0, -1), strict=True)})


def decode_sensor_data(frame: int) -> SensorData:
    """What a sensor data response says (signed or unsigned 32-bit integer, not a signal)."""
    frame &= 0xFFFFFFFF
    code = (frame >> 10 & 0xFFFF) - (frame >> 25 & 1) * 0x10000
    return SensorData(frame >> 29, frame >> 26 & 3, code, _decode_faults(frame), _parities_hold(frame))


def decode_register(frame: int) -> RegisterAnswer:
    """What the response to a read or write says (signed or unsigned 32-bit integer, not a signal)."""
    frame &= 0xFFFFFFFF
    kind = {2: "read", 1: "write"}.get(frame >> 29, "error")
    if kind != "error":
        return RegisterAnswer(kind, frame >> 5 & 0xFFFF, RequestErrors(), NO_FAULTS, _parities_hold(frame))
    errors = RequestErrors(*(float(frame >> bit & 1) for bit in (18, 17, 16)))
    return RegisterAnswer(kind, 0, errors, _decode_faults(frame), _parities_hold(frame))


def decode_command(frame: int) -> Command:
    """What a command asks for (signed or unsigned 32-bit integer, not a signal)."""
    frame &= 0xFFFFFFFF
    holds = frame.bit_count() % 2 == 1
    if frame >> 29 & 1:
        return Command("sensor data", (frame >> 28 & 1) << 2 | frame >> 30, frame >> 1 & 1, 0, 0, holds)
    kind = {4: "read", 2: "write"}.get(frame >> 29, "unknown")
    return Command(kind, 0, 0, frame >> 17 & 0x1FF, frame >> 1 & 0xFFFF, holds)
