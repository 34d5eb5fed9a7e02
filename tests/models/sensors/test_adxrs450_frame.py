"""ADXRS450 frames against the datasheet's examples and the drivers' formulas.

Sources of the numbers, as in facts/sensors.md: `450` ADXRS450 datasheet Rev. 0 (frames: Tables 8 and 9; temperature and
self-test limits: Table 1; start-up: Figure 27); `lx450` Linux drivers/iio/gyro/adxrs450.c; `wpi` WPILib
ADXRS450_Gyro.java; `noos453` no-OS drivers/gyro/adxrs453.
"""

from __future__ import annotations

from typing import Any

import casadi
import pytest
from hypothesis import given
from hypothesis import strategies as st

from attitude_fmu.models.record import flatten
from attitude_fmu.models.sensors import adxrs450_frame as frame
from attitude_fmu.models.sensors.words import nearest_signed, signed

WPI_VALID_MASK, WPI_VALID_VALUE = 0x0C00000E, 0x04000000  # wpi: initAccumulator
BIT = st.sampled_from([0.0, 1.0])
CODES = st.integers(-(2**15), 2**15 - 1)
FAULTS = st.tuples(*(BIT,) * 11).map(frame.FaultBits._make)
FRAME_FAULTS = st.tuples(*(st.just(0.0),) * 4, *(BIT,) * 7).map(frame.FaultBits._make)


def whole(word: Any) -> int:
    assert word == int(word)
    return int(word)


def plain(code: float) -> int:
    return whole(frame.sensor_data_response(code, 0.0, frame.VALID, frame.NO_FAULTS))


def test_every_rate_code_gives_a_frame_of_odd_parities_that_decodes_to_itself() -> None:
    for code in range(-(2**15), 2**15):
        word = plain(float(code))
        assert (word >> 16).bit_count() % 2 == 1  # 450 Table 9: P0
        assert word.bit_count() % 2 == 1  # P1
        assert frame.decode_sensor_data(word) == (0, 1, code, frame.NO_FAULTS, True)


@given(CODES, st.integers(0, 7), st.integers(0, 3), FRAME_FAULTS)
def test_sequence_status_and_faults_come_back(code: int, sequence: int, status: int, faults: frame.FaultBits) -> None:
    word = whole(frame.sensor_data_response(float(code), float(sequence), float(status), faults))
    assert 0 <= word < 2**32
    assert frame.decode_sensor_data(word) == (sequence, status, code, faults, True)
    assert frame.decode_sensor_data(whole(frame.as_int32(word))) == frame.decode_sensor_data(word)


@pytest.mark.parametrize(
    ("code", "word"),
    # by hand from 450 Table 9: status 01 is bit 26, the code's lowest bit is bit 10
    [(0, 0x04000000), (1, 0x04000401), (64, 0x14010000), (-1, 0x07FFFC00), (24_000, 0x15770000)],
)
def test_frames_worked_out_by_hand(code: int, word: int) -> None:
    assert plain(float(code)) == word


@given(CODES, st.integers(0, 7), FRAME_FAULTS, st.integers(0, 31))
def test_one_turned_bit_breaks_a_parity(code: int, sequence: int, faults: frame.FaultBits, bit: int) -> None:
    word = whole(frame.sensor_data_response(float(code), float(sequence), frame.VALID, faults))
    assert not frame.decode_sensor_data(word ^ 1 << bit).parity_holds


@given(CODES, st.integers(0, 3))
def test_the_drivers_shifts_find_rate_and_status(code: int, status: int) -> None:
    rx = whole(frame.sensor_data_response(float(code), 5.0, float(status), frame.NO_FAULTS))
    assert rx >> 10 & 0xFFFF == code & 0xFFFF  # lx450, wpi: dataShift 10, 16 bits
    assert rx >> 26 & 3 == status  # lx450: ADXRS450_GET_ST


@given(CODES, st.integers(0, 7), st.integers(0, 3), FRAME_FAULTS)
def test_wpilib_takes_just_the_frames_of_status_01_without_power_or_self_test_faults(
    code: int, sequence: int, status: int, faults: frame.FaultBits
) -> None:
    word = whole(frame.sensor_data_response(float(code), float(sequence), float(status), faults))
    taken = word & WPI_VALID_MASK == WPI_VALID_VALUE
    assert taken == (status == 1 and not (faults.power or faults.self_test or faults.check))


@pytest.mark.parametrize(("rate", "code"), [(300.0, 24_000), (-300.0, -24_000), (0.0125, 1), (0.0, 0)])
def test_a_code_is_an_eightieth_of_a_degree_per_second(rate: float, code: int) -> None:
    # 450: +24000 = +300 deg/s; wpi 0.0125 deg/s per LSB, noos453 rate/80
    assert frame.decode_sensor_data(plain(nearest_signed(80.0 * rate, 16))).code == code
    assert 0.0125 * code == pytest.approx(rate)


def test_the_first_response_is_the_datasheets_and_has_no_p0() -> None:
    assert frame.FIRST_RESPONSE == 0x00000001  # 450
    first = frame.decode_sensor_data(int(frame.FIRST_RESPONSE))
    assert (first.status, first.code, first.faults) == (0, 0, frame.NO_FAULTS)
    assert not first.parity_holds


def test_a_check_is_answered_with_all_faults_and_status_10() -> None:
    # 450 Figure 27: response ...FF or ...FE with ST = 10
    status = frame.data_status(1.0, 1.0)
    for code in (0.0, 1.0, -7.0):
        word = whole(frame.sensor_data_response(code, 0.0, status, frame.ALL_FAULTS))
        assert word & 0xFF in {0xFE, 0xFF}
        assert word >> 26 & 3 == 0b10


@pytest.mark.parametrize(("checking", "invalid", "status"), [(0, 0, 0b01), (0, 1, 0b00), (1, 0, 0b10), (1, 1, 0b10)])
def test_the_status_says_valid_invalid_or_check(checking: int, invalid: int, status: int) -> None:
    assert frame.data_status(float(checking), float(invalid)) == status


@pytest.mark.parametrize(
    ("self_test", "flagged", "invalid"),
    # 450 Table 1: 2239..2879 and 1279..3839
    [
        (2559, 0, 0),
        (2239, 0, 0),
        (2238, 1, 0),
        (2879, 0, 0),
        (2880, 1, 0),
        (1279, 1, 0),
        (1278, 1, 1),
        (3839, 1, 0),
        (3840, 1, 1),
    ],
)
def test_the_self_test_limits_are_those_of_table_1(self_test: int, flagged: int, invalid: int) -> None:
    assert frame.self_test_fault(float(self_test)) == flagged
    assert frame.self_test_invalidates(float(self_test)) == invalid


def test_the_self_test_limits_of_the_text_are_at_hand() -> None:
    # 450 L2033-2045: +-512 and +-1856, against Table 1
    assert frame.self_test_fault(2559.0 + 512.0, frame.SELF_TEST_FLAG_TOLERANCE_OF_TEXT) == 0.0
    assert frame.self_test_fault(2559.0 + 513.0, frame.SELF_TEST_FLAG_TOLERANCE_OF_TEXT) == 1.0
    assert frame.self_test_invalidates(2559.0 - 1856.0, frame.SELF_TEST_VALID_TOLERANCE_OF_TEXT) == 0.0
    assert frame.self_test_invalidates(2559.0 - 1857.0, frame.SELF_TEST_VALID_TOLERANCE_OF_TEXT) == 1.0


def test_commands_for_data_are_the_datasheets() -> None:
    assert frame.sensor_data_command() == 0x20000000  # 450 start-up, wpi
    assert frame.sensor_data_command(check=1.0) == 0x20000003  # 450 start-up


@pytest.mark.parametrize("sequence", range(8))
@pytest.mark.parametrize("check", [0, 1])
def test_a_data_command_has_odd_parity_and_its_own_order_of_sequence_bits(sequence: int, check: int) -> None:
    word = whole(frame.sensor_data_command(float(sequence), float(check)))
    assert frame.decode_command(word) == ("sensor data", sequence, check, 0, 0, True)
    # 450 Table 8: 31 SQ1, 30 SQ0, 29 one, 28 SQ2
    assert [word >> bit & 1 for bit in (28, 31, 30, 29)] == [*(sequence >> bit & 1 for bit in (2, 1, 0)), 1]


@given(st.integers(0, 0x1FF), st.integers(0, 0xFFFF))
def test_register_commands_are_those_that_linux_sends(address: int, data: int) -> None:
    def with_parity(tx: int) -> int:  # lx450: P is set where hweight32(tx) is even
        return tx | (tx.bit_count() % 2 == 0)

    assert frame.read_command(float(address)) == with_parity(1 << 31 | address << 17)
    assert frame.write_command(float(address), float(data)) == with_parity(1 << 30 | address << 17 | data << 1)
    assert frame.decode_command(whole(frame.read_command(float(address)))) == ("read", 0, 0, address, 0, True)
    written = whole(frame.write_command(float(address), float(data)))
    assert frame.decode_command(written) == ("write", 0, 0, address, data, True)


def test_every_register_word_comes_back_from_the_answer_to_a_read_or_write() -> None:
    for data in range(2**16):
        word = whole(frame.read_response(float(data)))
        assert word >> 5 & 0xFFFF == data  # lx450
        assert word & 0xEFE0001E == 0x4E000000  # 450 Table 9: 010, 1110, SM 000, zeros
        assert frame.decode_register(word)[:2] == ("read", data)
        assert frame.decode_register(word).parity_holds
    for data in range(0, 2**16, 257):
        written = frame.decode_register(whole(frame.write_response(float(data))))
        assert (written.kind, written.data, written.parity_holds) == ("write", data, True)


@given(st.builds(frame.RequestErrors, spi=BIT, request=BIT, unavailable=BIT), FRAME_FAULTS)
def test_a_refused_request_says_why(errors: frame.RequestErrors, faults: frame.FaultBits) -> None:
    word = whole(frame.error_response(errors, faults))
    assert word >> 29 == 0
    assert word >> 24 & 0b1111 == 0b1110
    assert frame.decode_register(word) == ("error", 0, errors, faults, True)


@given(FAULTS)
def test_the_fault_word_has_the_bits_of_the_driver(faults: frame.FaultBits) -> None:
    # lx450: ADXRS450_CHK 0x02 ... ADXRS450_FAIL 0x800
    bits = (0x800, 0x400, 0x200, 0x100, 0x80, 0x40, 0x20, 0x10, 0x08, 0x04, 0x02)
    word = whole(frame.fault_word(faults))
    assert word == sum(bit for bit, fault in zip(bits, faults, strict=True) if fault)
    assert frame.fault_byte(faults) == word & 0xFE


@pytest.mark.parametrize(
    ("celsius", "code"), [(45.0, 0b0000000000), (85.0, 0b0011001000), (0.0, 0b1100011111), (-40.0, 1024 - 425)]
)
def test_the_temperature_word_is_the_datasheets(celsius: float, code: int) -> None:
    word = whole(frame.temperature_word(celsius + 273.15))
    assert word == code << 6  # 450 L2656: left-justified in 16 bits
    assert frame.temperature_of_word(float(word)) == pytest.approx(celsius + 273.15, abs=1e-9)


def test_linux_reads_every_temperature_word_as_we_mean_it() -> None:
    for code in range(-512, 512):
        t = whole(frame.temperature_word(45.0 + 273.15 + 0.2 * code))
        assert signed(float(t), 16) == code * 64
        linux = ((code * 64 >> 6) + 225) * 200  # lx450, m degC
        assert 1000.0 * (frame.temperature_of_word(float(t)) - 273.15) == pytest.approx(linux, abs=1e-6)


def test_the_temperature_word_stops_at_the_ends_of_its_ten_bits() -> None:
    assert frame.temperature_word(1000.0) == 511 << 6
    assert frame.temperature_word(1.0) == 512 << 6


@pytest.mark.parametrize(
    ("word", "value"), [(0, 0), (1, 1), (0x7FFFFFFF, 2**31 - 1), (0x80000000, -(2**31)), (0xFFFFFFFF, -1)]
)
def test_an_fmi_integer_carries_the_frame(word: int, value: int) -> None:
    assert frame.as_int32(float(word)) == value


def test_a_response_costs_few_operations() -> None:
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    try:
        code, sequence, status = (casadi.SX.sym(name) for name in ("code", "sequence", "status"))
        faults = frame.FaultBits(*(casadi.SX.sym(name) for name in frame.FaultBits._fields))
        word = frame.sensor_data_response(code, sequence, status, faults)
        compiled = casadi.Function("f", [casadi.vertcat(code, sequence, status, *flatten(faults))], [word])
    finally:
        casadi.GlobalOptions.setSimplificationOnTheFly(True)
    assert compiled.n_instructions() < 130  # inputs and constants counted
