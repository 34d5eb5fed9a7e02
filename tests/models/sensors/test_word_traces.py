"""Every function of a register word that is meant for signals, traced with CasADi, gives the floats' bits."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator, Sequence
from inspect import getmembers, isfunction
from typing import Any

import casadi
import pytest

from attitude_fmu.models.record import flatten
from attitude_fmu.models.sensors import adis16354_words, adxl355_registers, adxrs450_frame, words

POINTS = 400
Draw = Callable[[random.Random], float]


def whole(low: int, high: int) -> Draw:
    return lambda chance: float(chance.choice((low, high, 0, chance.randint(low, high), chance.randint(low, high))))


def real(low: float, high: float) -> Draw:
    return lambda chance: chance.uniform(low, high)


BIT, BYTE, WORD, FRAME = whole(0, 1), whole(0, 2**8 - 1), whole(0, 2**16 - 1), whole(0, 2**32 - 1)
KELVIN = real(100.0, 500.0)
FAULTS = (BIT,) * len(adxrs450_frame.FaultBits._fields)


def with_faults(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function with the fault bits as its last arguments, one by one."""
    count = len(FAULTS)
    return lambda *values: function(*values[:-count], adxrs450_frame.FaultBits(*values[-count:]))


def refused(*values: Any) -> Any:
    errors = adxrs450_frame.RequestErrors(*values[:3])
    return adxrs450_frame.error_response(errors, adxrs450_frame.FaultBits(*values[3:]))


SIGNALS: dict[Any, list[tuple[str, Callable[..., Any], Sequence[Draw]]]] = {
    words: [
        ("nearest_code", lambda x: words.nearest_code(x, -3.0, 5.0), (real(-9.0, 9.0),)),
        ("nearest_signed", lambda x: words.nearest_signed(x, 4), (real(-20.0, 20.0),)),
        ("nearest_unsigned", lambda x: words.nearest_unsigned(x, 4), (real(-20.0, 20.0),)),
        ("pattern", lambda x: words.pattern(x, 16), (whole(-(2**15), 2**16),)),
        ("signed", lambda x: words.signed(x, 16), (WORD,)),
        ("field", lambda x: words.field(x, 5, 11), (FRAME,)),
        ("with_field", lambda x, y: words.with_field(x, 5, 11, y), (FRAME, whole(-1024, 1023))),
        ("flags", lambda *bits: words.flags(bits), (BIT,) * 7),
        ("odd", words.odd, (FRAME,)),
        ("ones", lambda x: words.ones(x, 32), (FRAME,)),
        ("parity", lambda x: words.parity(x, 26), (whole(0, 2**26 - 1),)),
    ],
    adxrs450_frame: [
        ("as_int32", adxrs450_frame.as_int32, (FRAME,)),
        ("fault_word", with_faults(adxrs450_frame.fault_word), FAULTS),
        ("fault_byte", with_faults(adxrs450_frame.fault_byte), FAULTS),
        ("self_test_fault", adxrs450_frame.self_test_fault, (whole(1000, 4000),)),
        ("self_test_invalidates", adxrs450_frame.self_test_invalidates, (whole(1000, 4000),)),
        ("power_fault", adxrs450_frame.power_fault, (real(2.0, 6.0),)),
        ("data_status", adxrs450_frame.data_status, (BIT, BIT)),
        (
            "sensor_data_response",
            with_faults(adxrs450_frame.sensor_data_response),
            (whole(-(2**15), 2**15 - 1), whole(0, 7), whole(0, 3), *FAULTS),
        ),
        ("read_response", adxrs450_frame.read_response, (WORD,)),
        ("write_response", adxrs450_frame.write_response, (WORD,)),
        ("error_response", refused, (BIT, BIT, BIT, *FAULTS)),
        ("sensor_data_command", adxrs450_frame.sensor_data_command, (whole(0, 7), BIT)),
        ("read_command", adxrs450_frame.read_command, (whole(0, 0x1FF),)),
        ("write_command", adxrs450_frame.write_command, (whole(0, 0x1FF), whole(-512, 511))),
        ("temperature_word", adxrs450_frame.temperature_word, (KELVIN,)),
        ("temperature_of_word", adxrs450_frame.temperature_of_word, (WORD,)),
    ],
    adxl355_registers: [
        ("data_word", adxl355_registers.data_word, (whole(-(2**19), 2**19 - 1),)),
        ("data_bytes", adxl355_registers.data_bytes, (whole(0, 2**24 - 1),)),
        ("code_of_data", adxl355_registers.code_of_data, (whole(0, 2**24 - 1),)),
        ("fifo_word", adxl355_registers.fifo_word, (whole(-(2**19), 2**19 - 1), BIT, BIT)),
        ("temperature_code", adxl355_registers.temperature_code, (KELVIN,)),
        ("temperature_of_code", adxl355_registers.temperature_of_code, (whole(0, 4095),)),
        ("temperature_bytes", adxl355_registers.temperature_bytes, (whole(0, 4095),)),
        ("status_byte", lambda *bits: adxl355_registers.status_byte(adxl355_registers.Status(*bits)), (BIT,) * 5),
        ("filter_register", adxl355_registers.filter_register, (whole(0, 6), whole(0, 10))),
        ("filter_codes", adxl355_registers.filter_codes, (BYTE,)),
        ("range_register", adxl355_registers.range_register, (whole(1, 3), BIT, BIT)),
        ("offset_word", adxl355_registers.offset_word, (real(-6e5, 6e5),)),
        ("with_offset", adxl355_registers.with_offset, (whole(-(2**19), 2**19 - 1), WORD)),
    ],
    adis16354_words: [
        ("output_word", adis16354_words.output_word, (whole(-(2**13), 2**13 - 1), BIT, BIT)),
        ("code_of_output", adis16354_words.code_of_output, (WORD,)),
        ("temperature_code", adis16354_words.temperature_code, (KELVIN,)),
        ("temperature_of_code", adis16354_words.temperature_of_code, (whole(-2048, 2047),)),
        ("supply_code", adis16354_words.supply_code, (real(-1.0, 9.0),)),
        ("auxiliary_code", adis16354_words.auxiliary_code, (real(-1.0, 3.0),)),
        ("status_word", lambda *bits: adis16354_words.status_word(adis16354_words.Status(*bits)), (BIT,) * 14),
        ("supply_errors", adis16354_words.supply_errors, (real(4.0, 6.0),)),
        ("error_or_alarm", adis16354_words.error_or_alarm, (WORD,)),
        ("sensitivity_average_word", adis16354_words.sensitivity_average_word, (whole(1, 4), whole(0, 6))),
        ("sensitivity_average_fields", adis16354_words.sensitivity_average_fields, (WORD,)),
        ("least_exponent", adis16354_words.least_exponent, (whole(1, 4),)),
        ("nearest_range", adis16354_words.nearest_range, (real(0.0, 7.0), whole(0, 6))),
        ("gyro_weight", adis16354_words.gyro_weight, (whole(1, 4),)),
        ("sample_period_word", adis16354_words.sample_period_word, (BIT, whole(0, 127))),
        ("sample_period", adis16354_words.sample_period, (BYTE,)),
        ("nearest_divider", adis16354_words.nearest_divider, (whole(1, 4096),)),
        ("gyro_offset_word", adis16354_words.gyro_offset_word, (real(-2.0, 2.0),)),
        ("gyro_offset", adis16354_words.gyro_offset, (WORD,)),
        ("acceleration_offset_word", adis16354_words.acceleration_offset_word, (real(-12.0, 12.0),)),
        ("acceleration_offset", adis16354_words.acceleration_offset, (WORD,)),
    ],
}
PLAIN = {
    adxrs450_frame: {"decode_sensor_data", "decode_register", "decode_command"},
    adxl355_registers: {"output_data_rate", "high_pass_corner", "sensitivity"},
    adis16354_words: {"ranges_in_words"},
}
"""Functions of plain numbers: for tests, for choices made once, for people."""


@pytest.fixture(autouse=True)
def _as_written() -> Iterator[None]:
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    yield
    casadi.GlobalOptions.setSimplificationOnTheFly(True)


def scalars(result: Any) -> list[Any]:
    return flatten(result) if isinstance(result, tuple) else [result]


@pytest.mark.parametrize(
    ("function", "draws"),
    [
        pytest.param(function, draws, id=f"{module.__name__.rsplit('.', 1)[-1]}.{name}")
        for module, signals in SIGNALS.items()
        for name, function, draws in signals
    ],
)
def test_a_word_traces_to_the_same_bits(function: Callable[..., Any], draws: Sequence[Draw]) -> None:
    symbols = [casadi.SX.sym(f"x{i}") for i in range(len(draws))]
    compiled = casadi.Function("f", [casadi.vertcat(*symbols)], [casadi.vertcat(*scalars(function(*symbols)))])
    chance = random.Random(len(draws))
    for _ in range(POINTS):
        values = [draw(chance) for draw in draws]
        expected = [float(x).hex() for x in scalars(function(*values))]
        assert [x.hex() for x in compiled(values).full().ravel().tolist()] == expected


@pytest.mark.parametrize("module", SIGNALS, ids=lambda module: module.__name__.rsplit(".", 1)[-1])
def test_no_function_of_signals_is_left_out(module: Any) -> None:
    own = {
        name
        for name, function in getmembers(module, isfunction)
        if function.__module__ == module.__name__ and not name.startswith("_")
    }
    assert {name for name, _, _ in SIGNALS[module]} == own - PLAIN.get(module, set())
