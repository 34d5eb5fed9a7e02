"""ADIS16354 words against the sister's datasheet and the drivers.

Sources of the numbers, as in facts/sensors.md: `350` ADIS16350/ADIS16355 datasheet Rev. B (Tables 1, 6, 10, 15-37),
`cc354` Chamberlain's ADIS16354A.h, `px4` PX4's ADIS16354 driver. The ADIS16354's own datasheet was not found.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from attitude_fmu.models.scalar import PI
from attitude_fmu.models.sensors import adis16354_words as words
from attitude_fmu.models.sensors.words import field

BIT = st.sampled_from([0, 1])
DEGREE = PI / 180.0
GRAVITY = 9.80665


@pytest.mark.parametrize("bits", [14, 12])
def test_every_code_comes_back_from_an_output_word(bits: int) -> None:
    for code in range(-(2 ** (bits - 1)), 2 ** (bits - 1)):
        word = words.output_word(float(code), 1.0, 0.0, bits)
        assert word == 0x8000 | code & (1 << bits) - 1
        assert words.code_of_output(word, bits) == code


@given(st.integers(-(2**13), 2**13 - 1), BIT, BIT)
def test_new_data_and_alarm_lie_above_the_data(code: int, new_data: int, alarm: int) -> None:
    word = int(words.output_word(float(code), float(new_data), float(alarm)))
    assert (word >> 15, word >> 14 & 1, word & 0x3FFF) == (new_data, alarm, code & 0x3FFF)  # 350: ND, EA, 13:0
    assert words.code_of_output(float(word)) == code


@pytest.mark.parametrize(("kelvin", "code"), [(298.15, 0), (298.15 + 0.1453, 1), (298.15 - 0.1453, -1), (358.15, 413)])
def test_the_temperature_code_is_zero_at_25_degc(kelvin: float, code: int) -> None:
    assert words.temperature_code(kelvin) == code  # cc354; 350 Table 1: 6.88 LSB/degC
    assert words.temperature_of_code(float(code)) == pytest.approx(kelvin, abs=0.0727)


def test_a_temperature_below_25_degc_is_twelve_bits_of_twos_complement() -> None:
    assert words.output_word(words.temperature_code(298.0047), 0.0, 0.0, words.SHORT_BITS) == 0x0FFF


@pytest.mark.parametrize(
    ("voltage", "code"), [(5.0, 2730), (4.75, 2594), (5.25, 2867), (0.0, 0), (-1.0, 0), (9.0, 4095)]
)
def test_the_supply_code_counts_1_8315_mv(voltage: float, code: int) -> None:
    assert words.supply_code(voltage) == code  # cc354; 350
    assert field(words.output_word(float(code), 1.0, 1.0, words.SHORT_BITS), 0, 12) == code


def test_the_auxiliary_code_spans_two_and_a_half_volts() -> None:
    assert words.auxiliary_code(2.5) == 4095  # 350: 0.6105 mV/LSB, 0-2.5 V
    assert words.auxiliary_code(0.6105e-3) == 1


def test_the_status_word_has_the_datasheets_bits() -> None:
    places = (15, 14, 13, 12, 11, 10, 9, 8, 5, 4, 3, 2, 1, 0)  # 350: STATUS 0x3C
    for place, name in zip(places, words.Status._fields, strict=True):
        word = words.status_word(words.Status()._replace(**{name: 1.0}))
        assert word == 1 << place
        assert words.error_or_alarm(word) == 1.0
    assert words.error_or_alarm(words.status_word(words.Status())) == 0.0


def test_the_default_of_sens_avg_is_300_degrees_and_four_taps() -> None:
    assert words.sensitivity_average_word(words.RANGE_300, 2.0) == 0x0402  # 350: default
    assert words.sensitivity_average_fields(0x0402) == (words.RANGE_300, 2.0)


@pytest.mark.parametrize(
    ("code", "weight", "exponent"),
    # 350 Table 1 and SENS/AVG; 0.07326 also cc354
    [(words.RANGE_300, 0.07326, 0), (words.RANGE_150, 0.03663, 2), (words.RANGE_75, 0.01832, 4)],
)
def test_a_smaller_range_has_a_smaller_lsb_and_needs_more_taps(code: float, weight: float, exponent: int) -> None:
    assert words.gyro_weight(code) / DEGREE == pytest.approx(weight, rel=4e-4)
    assert words.least_exponent(code) == exponent


@pytest.mark.parametrize(("word", "rate", "digits"), [(0x01, 819.2, 0.05), (0x07, 204.8, 0.05), (0xFF, 0.413, 5e-4)])
def test_the_sample_period_is_the_datasheets(word: int, rate: float, digits: float) -> None:
    assert 1.0 / words.sample_period(float(word)) == pytest.approx(rate, abs=digits)  # 350: SMPL_PRD


@given(BIT, st.integers(0, 127))
def test_the_sample_period_counts_its_time_base(slow: int, count: int) -> None:
    word = words.sample_period_word(float(slow), float(count))
    assert word == slow << 7 | count
    assert words.sample_period(word) == (18.921e-3 if slow else 0.61035e-3) * (count + 1)  # px4; 350 Table 17


@given(st.integers(-(2**12), 2**12 - 1))
def test_a_gyro_offset_word_is_thirteen_bits(lsb: int) -> None:
    word = words.gyro_offset_word(lsb * 0.018315 * DEGREE)
    assert word == lsb & 0x1FFF
    assert words.gyro_offset(word) == pytest.approx(lsb * 0.018315 * DEGREE, rel=1e-12)


@given(st.integers(-(2**11), 2**11 - 1))
def test_an_acceleration_offset_word_is_twelve_bits(lsb: int) -> None:
    word = words.acceleration_offset_word(lsb * 0.4672e-3 * GRAVITY)
    assert word == lsb & 0xFFF
    assert words.acceleration_offset(word) == pytest.approx(lsb * 0.4672e-3 * GRAVITY, rel=1e-12)


def test_offsets_reach_75_degrees_per_second_and_0_957_g() -> None:
    # 350: +-75 deg/s; +-0.957 g is calculated in the facts
    assert words.gyro_offset(words.gyro_offset_word(-10.0)) / DEGREE == pytest.approx(-75.0, abs=0.02)
    assert words.acceleration_offset(words.acceleration_offset_word(-20.0)) / GRAVITY == pytest.approx(-0.957, abs=5e-4)
