from __future__ import annotations

import math
from fractions import Fraction

import pytest

from attitude_fmu.fmu_src.units import UnknownUnitError, display_of, parse


@pytest.mark.parametrize(
    ("text", "exponents"),
    [
        ("1", {}),
        ("rad/s", {"rad": 1, "s": -1}),
        ("m/s2", {"m": 1, "s": -2}),
        ("m/s^2", {"m": 1, "s": -2}),
        ("s-1", {"s": -1}),
        ("N.m", {"kg": 1, "m": 2, "s": -2}),
        ("N.m.s/rad", {"kg": 1, "m": 2, "s": -1, "rad": -1}),
        ("1/K", {"K": -1}),
        ("kg.m2/(A.s3)", {"kg": 1, "m": 2, "A": -1, "s": -3}),
        ("m/(s2.K)", {"m": 1, "s": -2, "K": -1}),
    ],
)
def test_a_unit_is_a_product_of_powers(text: str, exponents: dict[str, int]) -> None:
    unit = parse(text)
    assert unit.exponents == exponents
    assert unit.factor == 1.0
    assert unit.is_whole


def test_a_noise_density_has_a_half_exponent() -> None:
    unit = parse("rad/(s.Hz^0.5)")
    assert unit.exponents == {"rad": 1, "s": Fraction(-1, 2)}
    assert not unit.is_whole


@pytest.mark.parametrize("text", ["furlong", "m/s/s", "rad s", "", "m..s"])
def test_an_unknown_unit_is_refused(text: str) -> None:
    with pytest.raises(UnknownUnitError, match="unit"):
        parse(text)


def test_display_units_convert_by_factor_and_offset() -> None:
    assert display_of("deg", "rad") == (180.0 / math.pi, 0.0)
    assert display_of("deg/s", "rad/s") == (180.0 / math.pi, 0.0)
    assert display_of("degC", "K") == (1.0, -273.15)
    assert display_of("%", "1") == (100.0, 0.0)


def test_a_display_unit_of_another_kind_is_refused() -> None:
    with pytest.raises(UnknownUnitError, match="not of the kind"):
        display_of("deg", "K")
