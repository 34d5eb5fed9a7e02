from __future__ import annotations

from typing import Annotated, Any, NamedTuple

import every_kind
import pytest

from attitude_fmu.fmu_src.errors import InterfaceError
from attitude_fmu.fmu_src.interface import interface_of
from attitude_fmu.models.record import Real

VARIABLES = {variable.name: variable for variable in interface_of(every_kind.MODEL).variables}


def test_value_references_count_the_variables() -> None:
    assert [variable.value_reference for variable in VARIABLES.values()] == list(range(len(VARIABLES)))


@pytest.mark.parametrize(
    ("name", "kind", "causality", "variability", "initial", "start"),
    [
        ("noise.density", "Real", "parameter", "fixed", "exact", 1e-3),
        ("mounting[1,2]", "Real", "parameter", "fixed", "exact", 0.0),
        ("gain", "Real", "parameter", "tunable", "exact", 1.0),
        ("shift", "Integer", "parameter", "tunable", "exact", 0),
        ("inverted", "Boolean", "parameter", "tunable", "exact", False),
        ("shape", "Enumeration", "parameter", "fixed", "exact", 1),
        ("rate[2]", "Real", "input", "continuous", None, 0.0),
        ("steps", "Integer", "input", "discrete", None, 0),
        ("switch", "Boolean", "input", "discrete", None, True),
        ("choice", "Enumeration", "input", "discrete", None, 1),
        ("shown.rate[1]", "Real", "output", "continuous", "calculated", None),
        ("shown.count", "Integer", "output", "discrete", "calculated", None),
        ("shown.moving", "Boolean", "output", "discrete", "calculated", None),
        ("shown.level", "Enumeration", "output", "discrete", "calculated", None),
        ("coefficient.sigma", "Real", "calculatedParameter", "tunable", "calculated", None),
        ("state.filtered[3]", "Real", "local", "discrete", "calculated", None),
        ("state.ticks", "Integer", "local", "discrete", "calculated", None),
        ("refused_calls", "Integer", "output", "discrete", "calculated", None),
    ],
)
def test_a_field_becomes_a_variable(
    name: str, kind: str, causality: str, variability: str, initial: str | None, start: Any
) -> None:
    variable = VARIABLES[name]
    found = (variable.kind, variable.causality, variable.variability, variable.initial, variable.start)
    assert found == (kind, causality, variability, initial, start)


class _Clash(NamedTuple):
    gain: Annotated[float, Real("1", "also a parameter")]


class _Startless(NamedTuple):
    rate: Annotated[float, Real("1", "no start value")]


class _Outside(NamedTuple):
    rate: Annotated[float, Real("1", "start below min", min=2.0)] = 1.0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"Outputs": _Clash}, "two records have a variable gain"),
        ({"Inputs": _Startless}, "rate needs a start value"),
        ({"Inputs": _Outside}, "out of range"),
    ],
)
def test_impossible_records_are_refused(change: dict[str, type], message: str) -> None:
    with pytest.raises(InterfaceError, match=message):
        interface_of(every_kind.MODEL._replace(**change))
