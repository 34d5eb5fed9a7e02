"""ADXL355 registers against the datasheet and the driver.

Sources of the numbers, as in facts/sensors.md: `355D` ADXL354/ADXL355 datasheet Rev. D (registers pp. 35-43, filter
pp. 25-27, Table 2), `355-0` its Rev. 0, `lx355` Linux drivers/iio/accel/adxl355_core.c.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from attitude_fmu.models.sensors import adxl355_registers as registers

CODES = st.integers(-(2**19), 2**19 - 1)


@given(CODES)
def test_a_code_lies_left_justified_in_three_bytes(code: int) -> None:
    word = registers.data_word(float(code))
    high, middle, low = (int(byte) for byte in registers.data_bytes(word))
    pattern = code & 0xFFFFF
    # 355D 0x08-0A: [19:12], [11:4], [3:0] in bits 7:4
    assert (high, middle, low) == (pattern >> 12, pattern >> 4 & 0xFF, (pattern & 0xF) << 4)
    assert int.from_bytes(bytes((high, middle, low)), "big") == word
    assert registers.code_of_data(word) == code


@pytest.mark.parametrize("code", [0, 1, -1, 2**19 - 1, -(2**19)])
def test_the_driver_sign_extends_the_word_to_the_code(code: int) -> None:
    raw = int(registers.data_word(float(code))) >> 4  # lx355: 20 bits, shift 4
    assert (raw ^ 1 << 19) - (1 << 19) == code


@given(CODES, st.sampled_from([0, 1]), st.sampled_from([0, 1]))
def test_a_fifo_entry_marks_the_x_axis_and_an_empty_fifo(code: int, x_axis: int, empty: int) -> None:
    word = int(registers.fifo_word(float(code), float(x_axis), float(empty)))
    assert (word & 1, word >> 1 & 1) == (x_axis, empty)  # 355D 0x11
    assert registers.code_of_data(float(word)) == code


@pytest.mark.parametrize(("celsius", "code"), [(25.0, 1885), (125.0, 980), (-40.0, 2473), (26.0, 1876)])
def test_the_temperature_code_falls_by_nine_for_a_degree(celsius: float, code: int) -> None:
    # 355D Table 2: 1885 LSB at 25 degC, -9.05 LSB/degC
    assert registers.temperature_code(celsius + 273.15) == code
    assert registers.temperature_of_code(float(code)) == pytest.approx(celsius + 273.15, abs=0.56 / 9.05)


def test_the_temperature_code_of_the_first_revision_is_a_parameter() -> None:
    assert registers.temperature_code(298.15, at_25_degc=1852.0) == 1852  # 355-0


@given(st.integers(0, 4095))
def test_linux_reads_the_temperature_as_we_mean_it(raw: int) -> None:
    linux = (raw - 2111.25) * -110.497  # lx355, m degC
    ours = 1000.0 * (registers.temperature_of_code(float(raw)) - 273.15)
    assert ours == pytest.approx(linux, rel=1e-5, abs=15.0)  # lx355 rounds the offset to a quarter of an LSB


@given(st.integers(0, 4095))
def test_the_temperature_code_lies_in_two_bytes(code: int) -> None:
    assert registers.temperature_bytes(float(code)) == (code >> 8, code & 0xFF)  # 355D 0x06/07


def test_the_temperature_code_stops_at_the_ends_of_its_twelve_bits() -> None:
    assert registers.temperature_code(1000.0) == 0
    assert registers.temperature_code(1.0) == 4095


def test_the_status_byte_has_the_datasheets_bits() -> None:
    # 355D 0x04: 4 NVM_BUSY, 3 Activity, 2 FIFO_OVR, 1 FIFO_FULL, 0 DATA_RDY
    for bit, name in enumerate(("data_ready", "fifo_full", "fifo_overrun", "activity", "memory_busy")):
        assert registers.status_byte(registers.Status()._replace(**{name: 1.0})) == 1 << bit


@pytest.mark.parametrize("high_pass", range(7))
@pytest.mark.parametrize("rate", range(11))
def test_the_filter_register_holds_both_codes(high_pass: int, rate: int) -> None:
    register = registers.filter_register(float(high_pass), float(rate))
    assert register == high_pass << 4 | rate  # 355D 0x28
    assert registers.filter_codes(register) == (high_pass, rate)


@pytest.mark.parametrize(
    ("code", "rate"),
    # 355D p. 27, as printed
    list(enumerate([4000, 2000, 1000, 500, 250, 125, 62.5, 31.25, 15.625, 7.813, 3.906])),
)
def test_each_rate_code_halves_the_rate(code: int, rate: float) -> None:
    assert registers.output_data_rate(code) == pytest.approx(rate, rel=2e-4)


@pytest.mark.parametrize(("code", "corner"), [(0, 0.0), (1, 9.88), (2, 2.48336), (6, 0.00952)])
def test_high_pass_corners_at_4_khz_run_from_10_hz_to_a_hundredth(code: int, corner: float) -> None:
    assert registers.high_pass_corner(code, 0) == pytest.approx(corner, rel=1e-9)  # 355D: 10 ... 0.0095 Hz
    assert registers.high_pass_corner(code, 3) == pytest.approx(corner / 8.0, rel=1e-9)


def test_reserved_codes_are_refused() -> None:
    with pytest.raises(ValueError, match="ODR_LPF code 11 is reserved"):
        registers.output_data_rate(11)
    with pytest.raises(ValueError, match="HPF_CORNER code 7 is reserved"):
        registers.high_pass_corner(7, 0)
    with pytest.raises(ValueError, match="range code 0"):
        registers.sensitivity(0)


def test_the_range_register_starts_at_two_g_with_fast_i2c() -> None:
    assert registers.range_register(float(registers.RANGE_2G)) == 0x81  # 355D reset value
    assert registers.range_register(float(registers.RANGE_8G), 0.0, 1.0) == 0x43


@pytest.mark.parametrize(("code", "sensitivity"), [(1, 256_000), (2, 128_000), (3, 64_000)])
def test_each_range_code_halves_the_sensitivity(code: int, sensitivity: float) -> None:
    assert registers.sensitivity(code) == sensitivity  # 355D Table 2


@given(st.integers(-(2**15), 2**15 - 1))
def test_an_offset_word_moves_the_code_by_sixteen_an_lsb(lsb: int) -> None:
    word = registers.offset_word(16.0 * lsb)
    assert word == lsb & 0xFFFF
    expected = min(max(1000 + 16 * lsb, -(2**19)), 2**19 - 1)
    assert registers.with_offset(1000.0, word) == expected  # 355D 0x1E-23: weight of DATA[19:4]


def test_an_offset_beyond_the_register_stops_at_its_ends() -> None:
    assert registers.offset_word(2.0**20) == 0x7FFF
    assert registers.offset_word(-(2.0**20)) == 0x8000
    assert registers.with_offset(2.0**19 - 1.0, 1.0) == 2**19 - 1
