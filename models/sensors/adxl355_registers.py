"""ADXL355 registers: acceleration words, FIFO entry, temperature, STATUS, Filter, Range and OFFSET.

Layouts: ADXL354/ADXL355 Rev. D (6/2025) pp. 35-43. Registers hold bytes; words of several are most significant first.
What is set once (rates, corners, ranges) is looked up with plain integers, all else takes signals.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..record import Boolean
from ..scalar import Scalar, clip, floor
from .adxl355_sheet import ADXL355_2G, ADXL355_4G, ADXL355_8G, DELAYS
from .adxl355_sheet import HIGH_PASS_CORNERS as _CORNERS
from .datasheet import REFERENCE_TEMPERATURE
from .words import field, flags, nearest_signed, nearest_unsigned, pattern, signed

CODE_BITS = 20

RANGE_2G, RANGE_4G, RANGE_8G = 1, 2, 3
"""Codes of the Range register's bits 1..0."""

TEMPERATURE_AT_25_DEGC: float = ADXL355_2G.si("thermometer.code_at_25")
"""Temperature code at 25 degC, Rev. D Table 2; Rev. 0 has 1852. The sensor is not calibrated."""

TEMPERATURE_SLOPE: float = ADXL355_2G.si("thermometer.sensitivity")
"""LSB/K, Rev. D Table 2."""

OFFSET_WEIGHT = 16.0
"""One LSB of an OFFSET register in 20-bit codes: it has the weight of DATA[19:4]."""

HIGH_PASS_CORNERS = (0.0, *[corner.value for corner in _CORNERS])
"""Corner over output data rate for each HPF_CORNER code; code 0 is off (Rev. D; Linux adxl355_core.c agrees)."""

OUTPUT_RATE_CODES = len(DELAYS)
"""ODR_LPF codes 0 to 10: 4000 Hz, each half the one before (Rev. D p. 27)."""

_PARTS = {RANGE_2G: ADXL355_2G, RANGE_4G: ADXL355_4G, RANGE_8G: ADXL355_8G}
_FASTEST: float = ADXL355_2G.si("sampling_frequency")  # Hz


class Status(NamedTuple):
    """Bits 4 to 0 of STATUS (0x04), each 0 or 1."""

    memory_busy: Annotated[float, Boolean("NVM_BUSY: nonvolatile memory in use")] = 0.0
    activity: Annotated[float, Boolean("Activity: threshold passed")] = 0.0
    fifo_overrun: Annotated[float, Boolean("FIFO_OVR: samples were lost")] = 0.0
    fifo_full: Annotated[float, Boolean("FIFO_FULL: watermark reached")] = 0.0
    data_ready: Annotated[float, Boolean("DATA_RDY: a complete sample can be read")] = 0.0


def data_word(code: Scalar) -> Scalar:
    """XDATA, YDATA or ZDATA as one 24-bit word: the 20-bit code in two's complement, left-justified, bits 3..0 zero."""
    return 2.0**4 * pattern(code, CODE_BITS)


def data_bytes(word: Scalar) -> tuple[Scalar, Scalar, Scalar]:
    """Registers DATA3, DATA2, DATA1 of a 24-bit word: code bits 19..12, 11..4, and 3..0 in the high half."""
    high, middle = floor(2.0**-16 * word), floor(2.0**-8 * word)
    return high, middle - 2.0**8 * high, word - 2.0**8 * middle


def code_of_data(word: Scalar) -> Scalar:
    """The 20-bit code, -2^19 .. 2^19 - 1, that a 24-bit data word or FIFO entry carries; bits 3..0 are ignored."""
    return signed(floor(2.0**-4 * word), CODE_BITS)


def fifo_word(code: Scalar, x_axis: Scalar, empty: Scalar = 0.0) -> Scalar:
    """The 24 bits read from FIFO_DATA (0x11): data word with bit 1 for an empty FIFO and bit 0 for the X axis."""
    return data_word(code) + 2.0 * empty + x_axis


def temperature_code(temperature: Scalar, at_25_degc: float = TEMPERATURE_AT_25_DEGC) -> Scalar:
    """12-bit unsigned temperature code of the part's temperature in K."""
    return nearest_unsigned(at_25_degc + TEMPERATURE_SLOPE * (temperature - REFERENCE_TEMPERATURE), 12)


def temperature_of_code(code: Scalar, at_25_degc: float = TEMPERATURE_AT_25_DEGC) -> Scalar:
    """Temperature in K that a 12-bit temperature code stands for."""
    return REFERENCE_TEMPERATURE + (code - at_25_degc) / TEMPERATURE_SLOPE


def temperature_bytes(code: Scalar) -> tuple[Scalar, Scalar]:
    """Registers TEMP2 (code bits 11..8) and TEMP1 (7..0); they are not double-buffered in the part."""
    high = floor(2.0**-8 * code)
    return high, code - 2.0**8 * high


def status_byte(status: Status) -> Scalar:
    """STATUS (0x04): 4 NVM_BUSY, 3 Activity, 2 FIFO_OVR, 1 FIFO_FULL, 0 DATA_RDY."""
    return flags(status)


def filter_register(high_pass: Scalar, output_rate: Scalar) -> Scalar:
    """Filter register (0x28) from its codes: 6..4 HPF_CORNER (0 is off), 3..0 ODR_LPF; reset value 0x00."""
    return 2.0**4 * high_pass + output_rate


def filter_codes(register: Scalar) -> tuple[Scalar, Scalar]:
    """HPF_CORNER and ODR_LPF codes that a Filter register holds."""
    return field(register, 4, 3), field(register, 0, 4)


def output_data_rate(code: int) -> float:
    """Output data rate in Hz of an ODR_LPF code 0 to 10; the low-pass corner is nominally a quarter of it."""
    if code not in range(OUTPUT_RATE_CODES):
        raise ValueError(f"ODR_LPF code {code} is reserved (allowed: 0 to {OUTPUT_RATE_CODES - 1})")
    return _FASTEST / 2.0**code


def high_pass_corner(code: int, rate_code: int) -> float:
    """Corner in Hz of the first-order high-pass for HPF_CORNER and ODR_LPF codes; 0.0 where it is off."""
    if code not in range(len(HIGH_PASS_CORNERS)):
        raise ValueError(f"HPF_CORNER code {code} is reserved (allowed: 0 to {len(HIGH_PASS_CORNERS) - 1})")
    return HIGH_PASS_CORNERS[code] * output_data_rate(rate_code)


def range_register(code: Scalar, fast_i2c: Scalar = 1.0, interrupt_polarity: Scalar = 0.0) -> Scalar:
    """Range register (0x2C): 7 I2C_HS, 6 INT_POL, 5..2 zero, 1..0 range code; reset value 0x81, +-2 g."""
    return 2.0**7 * fast_i2c + 2.0**6 * interrupt_polarity + code


def sensitivity(range_code: int) -> float:
    """Nominal sensitivity in LSB/g of the 20-bit code for a range code 1 to 3 (Rev. D Table 2)."""
    if range_code not in _PARTS:
        raise ValueError(f"range code {range_code} is not one of 1 (+-2 g), 2 (+-4 g), 3 (+-8 g)")
    return _PARTS[range_code].datum("resolution").value


def offset_word(offset: Scalar) -> Scalar:
    """OFFSET register pair as 16-bit word for an offset in 20-bit codes: two's complement, 16 codes an LSB."""
    return pattern(nearest_signed(offset / OFFSET_WEIGHT, 16), 16)


def with_offset(code: Scalar, word: Scalar) -> Scalar:
    """20-bit code after an OFFSET word was added, the last step of the part's processing.

    That the sum stops at the ends of the 20 bits is an assumption; the datasheet does not say.
    """
    half = 2.0 ** (CODE_BITS - 1)
    return clip(code + OFFSET_WEIGHT * signed(word, 16), -half, half - 1.0)
