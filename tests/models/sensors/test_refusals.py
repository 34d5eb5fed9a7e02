"""What the parts forbid is refused with a message that names the rule."""

from __future__ import annotations

import math
from typing import Any

import pytest
from faultless_parts import ADIS, STILL, faultless

from attitude_fmu.models.attitude_sensor import MODEL, Parameters
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.record import Boolean, Enumeration, Integer, Leaf, defaults, flatten, leaves, unflatten
from attitude_fmu.models.sensors import adis16354_words
from attitude_fmu.models.sensors.digital_filter import TAPS
from attitude_fmu.models.sensors.faults import FaultParameters
from attitude_fmu.models.sensors.gyro import GYRO_FILTER
from attitude_fmu.models.system import Run

RANGES = {75: adis16354_words.RANGE_75, 150: adis16354_words.RANGE_150, 300: adis16354_words.RANGE_300}


def started(parameters: Parameters) -> None:
    Run(MODEL, parameters, STILL, name="sensor")


@pytest.mark.parametrize("taps", TAPS)
@pytest.mark.parametrize("degrees", RANGES)
def test_the_adis16354s_ranges_go_with_its_taps_as_the_sister_sheet_says(degrees: int, taps: int) -> None:
    code = RANGES[degrees]
    p = faultless(
        ADIS,
        gyro__filter=GYRO_FILTER.value(f"bartlett_{taps}"),
        gyro__range=math.radians(degrees),
        gyro__resolution=adis16354_words.gyro_weight(code),
    )
    if 2 ** adis16354_words.least_exponent(code) <= taps:
        started(p)
    else:
        with pytest.raises(ValueRefusedError) as refused:
            started(p)
        text = str(refused.value)
        assert text.startswith("sensor.gyro.range = ")
        assert "+-150 deg/s with 4 taps or more (bartlett_4), +-75 deg/s with 16 or more, +-300 deg/s always" in text
        assert "allowed:" in text


def test_the_adxrs450_has_no_such_rule() -> None:
    started(faultless(gyro__range=math.radians(50.0)))


@pytest.mark.parametrize("part", ["gyro", "accelerometer"])
def test_a_range_beyond_the_register_word_is_refused(part: str) -> None:
    p = faultless()
    one = getattr(p, part)
    end = one.code_limit * one.resolution
    started(faultless(**{f"{part}__range": end}))
    with pytest.raises(ValueRefusedError, match=rf"sensor.{part}.range = .*{part}.code_limit LSB of {part}.resolution"):
        started(faultless(**{f"{part}__range": 1.001 * end}))
    with pytest.raises(ValueRefusedError, match=rf"sensor.{part}.range"):
        started(faultless(**{f"{part}__code_limit": 1000}))


@pytest.mark.parametrize("number", [1, 2])
def test_a_fault_that_begins_after_its_end_is_refused(number: int) -> None:
    faults = [FaultParameters(), FaultParameters()]
    faults[number - 1] = FaultParameters(start=2.0, end=1.0)
    with pytest.raises(
        ValueRefusedError, match=rf"sensor.fault\[{number}\].start = 2 s: later than its end \(allowed: 0"
    ):
        started(faultless()._replace(fault=tuple(faults)))
    run = Run(MODEL, faultless(), STILL, name="sensor")
    with pytest.raises(ValueRefusedError, match=rf"sensor.fault\[{number}\].start"):
        run.tune(faultless()._replace(fault=tuple(faults)))


def beyond(leaf: Leaf) -> list[Any]:
    """The values just outside a parameter's range."""
    fact = leaf.fact
    if isinstance(fact, Enumeration):
        return [0, len(fact.items) + 1]
    if isinstance(fact, Boolean):
        return [2]
    step = 1 if isinstance(fact, Integer) else 1e-6
    low = [] if fact.min is None else [fact.min - step * max(1.0, abs(fact.min))]
    high = [] if fact.max is None else [fact.max + step * max(1.0, abs(fact.max))]
    return [*low, *high, math.nan, math.inf]


def test_every_parameter_out_of_its_range_is_refused_by_name_and_with_what_is_allowed() -> None:
    values = flatten(defaults(Parameters))
    for place, leaf in enumerate(leaves(Parameters)):
        for value in beyond(leaf):
            changed = [*values[:place], value, *values[place + 1 :]]
            with pytest.raises(ValueRefusedError) as refused:
                started(unflatten(Parameters, changed))
            assert str(refused.value).startswith(f"sensor.{leaf.name} = "), leaf.name
            assert "allowed: " in str(refused.value), leaf.name
