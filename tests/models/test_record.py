"""Records: names, flattening and value checks."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import pytest

from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.record import (
    Boolean,
    Enumeration,
    Integer,
    Item,
    Matrix3,
    Real,
    Vector3,
    check,
    defaults,
    flatten,
    leaves,
    unflatten,
)

WAY = Enumeration("Way", (Item("left", ""), Item("right", "")), "which way")


class Part(NamedTuple):
    bias: Annotated[Vector3, Real("rad/s", "bias")] = (1.0, 2.0, 3.0)
    cross: Annotated[Matrix3, Real("1", "cross")] = ((0.0, 0.1, 0.2), (0.3, 0.4, 0.5), (0.6, 0.7, 0.8))


class Whole(NamedTuple):
    temperature: Annotated[float, Real("K", "ambient", min=200.0, max=450.0)] = 293.15
    part: tuple[Part, Part] = (Part(), Part(bias=(4.0, 5.0, 6.0)))
    enabled: Annotated[bool, Boolean("on")] = True
    count: Annotated[int, Integer("how many", min=1)] = 2
    way: Annotated[int, WAY] = WAY.value("right")


def test_nesting_gives_structured_fmi_names_and_start_values() -> None:
    named = {leaf.name: leaf.start for leaf in leaves(Whole)}
    assert named["part[2].bias[1]"] == 4.0
    assert named["part[1].cross[2,3]"] == 0.5
    assert named["way"] == 2
    assert len(named) == len(leaves(Whole)) == 1 + 2 * 12 + 3


def test_unflatten_is_the_inverse_of_flatten() -> None:
    whole = defaults(Whole)
    assert whole == Whole()
    assert unflatten(Whole, flatten(whole)) == whole


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"temperature": 25.0}, r"sensor.temperature = 25 K: too small, kelvin wanted \(allowed: 200 to 450 K\)"),
        ({"temperature": float("nan")}, "sensor.temperature = nan K: not a finite number"),
        ({"way": 3}, r"sensor.way = 3: no such choice \(allowed: 1 left, 2 right\)"),
        ({"enabled": 2}, "sensor.enabled = 2: not a switch"),
        ({"count": 0}, r"sensor.count = 0: too small \(allowed: 1 or more\)"),
        ({"part": (Part(), Part(bias=(0.0, float("inf"), 0.0)))}, r"sensor.part\[2\].bias\[2\] = inf rad/s"),
    ],
)
def test_a_bad_value_is_refused_with_its_name_value_unit_and_range(change: dict[str, object], message: str) -> None:
    with pytest.raises(ValueRefusedError, match=message):
        check(Whole, flatten(Whole()._replace(**change)), "sensor")  # type: ignore[arg-type]


def test_a_field_without_facts_is_refused() -> None:
    class Bare(NamedTuple):
        number: float = 0.0

    with pytest.raises(TypeError, match="number"):
        leaves(Bare)
