"""What the parts forbid is refused with a message that names the rule."""

from __future__ import annotations

import math
from typing import Any

import pytest
from faultless_parts import ADIS, GYRO, STILL, faultless

from attitude_fmu.models.attitude_sensor import MODEL, Parameters
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.record import Boolean, Enumeration, Integer, Leaf, defaults, flatten, leaves, unflatten
from attitude_fmu.models.sensors import adis16354_sheet, adis16354_words
from attitude_fmu.models.sensors.accelerometer import ACCELEROMETER_FILTER
from attitude_fmu.models.sensors.digital_filter import TAPS
from attitude_fmu.models.sensors.faults import FaultParameters
from attitude_fmu.models.sensors.gyro import GYRO_FILTER
from attitude_fmu.models.system import Run, check_rules

RANGES = {75: adis16354_words.RANGE_75, 150: adis16354_words.RANGE_150, 300: adis16354_words.RANGE_300}


def started(parameters: Parameters) -> None:
    Run(MODEL, parameters, STILL, name="sensor")


@pytest.mark.parametrize("taps", TAPS)
@pytest.mark.parametrize("degrees", RANGES)
def test_the_adis16354s_ranges_go_with_its_taps_as_the_sister_sheet_says(degrees: int, taps: int) -> None:
    code, way = RANGES[degrees], GYRO_FILTER.value(f"bartlett_{taps}")
    p = faultless(
        ADIS,
        gyro__filter=way,
        accelerometer__filter=way,
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
        assert "+-300 deg/s, +-150 deg/s with 4 taps or more, +-75 deg/s with 16 taps or more" in text
        assert "allowed:" in text


@pytest.mark.parametrize(
    ("degrees", "taps", "nearest"),
    [
        (50.0, 64, 75),
        (76.0, 16, 75),
        (112.0, 16, 75),
        (113.0, 16, 150),
        (113.0, 4, 150),
        (250.0, 64, 300),
        (75.0, 1, 300),
    ],
)
def test_other_ranges_of_an_adis16354_are_refused_and_the_nearest_named(
    degrees: float, taps: int, nearest: int
) -> None:
    p = faultless(ADIS, gyro__filter=GYRO_FILTER.value(f"bartlett_{taps}"), gyro__range=math.radians(degrees))
    with pytest.raises(ValueRefusedError, match=r"sensor\.gyro\.range = .*SENS/AVG of an ADIS16354 offers") as refused:
        started(p)
    low, _, high = str(refused.value).partition("allowed: ")[2].partition(" rad/s")[0].partition(" to ")
    assert math.radians(nearest) == pytest.approx(0.5 * (float(low) + float(high)), rel=1e-12)
    assert float(high) / float(low) < 1.0 + 2e-5


@pytest.mark.parametrize("typed", [5.23599, 5.235987755982988, 5.2359878])
def test_a_range_typed_in_six_digits_is_the_range(typed: float) -> None:
    started(faultless(ADIS, gyro__range=typed))


def test_what_the_adis16354_offers_is_what_its_devices_have() -> None:
    offered = {round(one.range.value): 2 ** int(one.least_exponent.si) for one in adis16354_sheet.GYRO_RANGES}
    assert offered == {75: 16, 150: 4, 300: 1}
    for degrees in offered:
        started(faultless(f"ADIS16354_{degrees}"))


def test_the_adxrs450_has_no_such_rule() -> None:
    started(faultless(gyro__range=math.radians(50.0)))
    started(faultless(gyro__divider=65, accelerometer__divider=3))


@pytest.mark.parametrize(
    ("device", "gyros", "accelerometers"),
    [
        (ADIS, "bartlett_64", "bartlett_1"),
        (ADIS, "bartlett_4", "decimator"),
        (GYRO, "bartlett_4", "decimator"),
        (GYRO, "cic", "bartlett_4"),
    ],
)
def test_filters_of_two_parts_that_no_sensor_has_are_refused(device: str, gyros: str, accelerometers: str) -> None:
    p = faultless(
        device,
        gyro__filter=GYRO_FILTER.value(gyros),
        accelerometer__filter=ACCELEROMETER_FILTER.value(accelerometers),
    )
    with pytest.raises(
        ValueRefusedError, match=r"sensor\.accelerometer\.filter = .*one SENS/AVG .*Rev\. B.*gyro\.filter"
    ):
        started(p)


def test_gyros_and_accelerometers_number_their_filters_alike() -> None:
    names = [[item.name for item in kind.items] for kind in (GYRO_FILTER, ACCELEROMETER_FILTER)]
    assert names[0][1:] == names[1][1:]
    assert (names[0][0], names[1][0]) == ("cic", "decimator")


def dividers() -> set[int]:
    """Sample periods that SMPL_PRD has, in those of 819.2 SPS, as far as they are whole; the sheet's are rounded."""
    shortest = adis16354_words.sample_period(1.0)
    made = [adis16354_words.sample_period(float(word)) / shortest for word in (*range(1, 128), *range(128, 256))]
    return {round(divider) for divider in made if abs(divider - round(divider)) < 2e-5 * divider}


def test_only_dividers_that_the_register_can_make_are_taken() -> None:
    possible = dividers()
    assert max(possible) == 1984  # 0.413 SPS
    for divider in range(1, 1985):
        p = faultless(ADIS, gyro__divider=divider, accelerometer__divider=divider)
        if divider in possible:
            check_rules(MODEL, p, "sensor")
            continue
        with pytest.raises(ValueRefusedError, match=r"sensor\.gyro\.divider = .*SMPL_PRD .*Table 17") as refused:
            check_rules(MODEL, p, "sensor")
        named = int(str(refused.value).partition("allowed: ")[2].partition(" to ")[0])
        assert abs(named - divider) == min(abs(one - divider) for one in possible)
    with pytest.raises(ValueRefusedError, match=r"sensor\.gyro\.divider = 4096: too large"):
        started(faultless(ADIS, gyro__divider=4096, accelerometer__divider=4096))


def test_gyros_and_accelerometers_of_an_adis16354_have_one_divider() -> None:
    with pytest.raises(ValueRefusedError, match=r"sensor\.accelerometer\.divider = 1: one SMPL_PRD .*allowed: 2 to 2"):
        started(faultless(ADIS, gyro__divider=2))


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
