"""fmi2GetDirectionalDerivative against central differences of the Python model and of the FMU itself."""

from __future__ import annotations

import random
from collections.abc import Callable
from contextlib import suppress
from importlib import import_module
from math import inf, isfinite
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from fmu_instance import EVERY_KIND, Instance

from attitude_fmu.fmu_src.catalogue import CATALOGUE, Entry
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.record import Leaf, Real, flatten, leaves, unflatten
from attitude_fmu.models.system import Model, check_rules

Load = Callable[[Path], Instance]
Values = dict[str, float]
Function = Callable[[Values], Values]

STEP = 1e-5
"""Of the differences, relative; halved once to see where they can be trusted: not at a kink or a rounding."""


@pytest.fixture(params=[EVERY_KIND, *CATALOGUE], ids=lambda entry: entry.identifier)
def entry(request: pytest.FixtureRequest) -> Entry:
    chosen: Entry = request.param
    return chosen


@pytest.fixture
def model(entry: Entry) -> Model:
    found: Model = import_module(entry.module).MODEL
    return found


@pytest.fixture
def unit(built: Callable[..., Path], load: Load, entry: Entry) -> Instance:
    return load(built(entry, "native"))


def _record(record: type, values: Values, prefix: str = "") -> Any:
    return unflatten(record, [values[prefix + leaf.name] for leaf in leaves(record)])


def _named(record: type, values: Any, prefix: str = "") -> Values:
    return {
        prefix + leaf.name: float(value)
        for leaf, value in zip(leaves(record), flatten(values), strict=True)
        if isinstance(leaf.fact, Real)
    }


def _at_initialisation(model: Model) -> Function:
    """Outputs and coefficients from parameters and inputs."""

    def function(values: Values) -> Values:
        parameters, inputs = _record(model.Parameters, values), _record(model.Inputs, values)
        coefficients = model.coefficients(parameters)
        state = model.initial_state(parameters, coefficients, inputs)
        shown = _named(model.Outputs, model.outputs(state, parameters, coefficients))
        return shown | _named(model.Coefficients, coefficients, "coefficient.")

    return function


def _while_running(model: Model) -> Function:
    """Outputs and coefficients from parameters and the state."""

    def function(values: Values) -> Values:
        parameters, state = _record(model.Parameters, values), _record(model.State, values, "state.")
        coefficients = model.coefficients(parameters)
        shown = _named(model.Outputs, model.outputs(state, parameters, coefficients))
        return shown | _named(model.Coefficients, coefficients, "coefficient.")

    return function


def _near(leaf: Leaf, chance: random.Random) -> float:
    """Off the start value, where zeros would hide terms, and inside the range."""
    fact = leaf.fact
    if not isinstance(fact, Real):
        return leaf.start
    moved = (leaf.start or chance.choice((0.0, 3e-4))) * (1.0 + 0.02 * chance.random())
    is_inside = (fact.min is None or moved > fact.min) and (fact.max is None or moved < fact.max)
    return moved if is_inside else leaf.start


def _settable(model: Model, chance: random.Random) -> Values:
    """Parameters that go together, and inputs."""
    while True:
        values = {leaf.name: _near(leaf, chance) for leaf in (*leaves(model.Parameters), *leaves(model.Inputs))}
        with suppress(ValueRefusedError):
            check_rules(model, _record(model.Parameters, values), "")
            return values


def _difference(function: Function, at: Values, name: str, step: float) -> Values:
    above, below = (function({**at, name: at[name] + change}) for change in (step, -step))
    return {unknown: (above[unknown] - below[unknown]) / (2.0 * step) for unknown in above}


def _knowns(model: Model, records: dict[str, type]) -> list[str]:
    return [
        prefix + leaf.name for prefix, rec in records.items() for leaf in leaves(rec) if isinstance(leaf.fact, Real)
    ]


def _derivatives(unit: Instance, unknowns: list[str], direction: Values) -> Values:
    def references(names: Any) -> list[int]:
        return [unit.variables[name].valueReference for name in names]

    found = unit.fmu.getDirectionalDerivative(references(unknowns), references(direction), list(direction.values()))
    return dict(zip(unknowns, found, strict=True))


def _compare(unit: Instance, function: Function, at: Values, knowns: list[str]) -> tuple[int, int]:
    """Assert equality with trusted differences; how many derivatives those were, and how many there are at all."""
    value = function(at)
    trusted = 0
    for known in knowns:
        exact = _derivatives(unit, list(value), {known: 1.0})
        step = STEP * max(abs(at[known]), 1e-3)
        coarse, fine = (_difference(function, at, known, one) for one in (step, 0.5 * step))
        for unknown, derivative in exact.items():
            assert isfinite(derivative), (unknown, known)
            noise = 1e-13 * max(abs(value[unknown]), 1e-6) / step
            spread = abs(coarse[unknown] - fine[unknown])
            if spread > 1e-3 * abs(fine[unknown]) + noise:
                continue
            trusted += 1
            wrong = abs(derivative - fine[unknown]) > 2e-3 * abs(fine[unknown]) + 4.0 * noise
            if wrong:  # two differences across a rounding may agree by chance, a third does not
                third = _difference(function, at, known, 0.31 * step)[unknown]
                wrong = abs(third - fine[unknown]) <= 2e-3 * abs(fine[unknown]) + 4.0 * noise
            assert not wrong, (unknown, known)
    return trusted, len(knowns) * len(value)


def test_while_initialising_they_are_those_by_parameters_and_inputs(unit: Instance, model: Model) -> None:
    values = _settable(model, random.Random(1))
    for name, value in values.items():
        unit[name] = value
    unit.fmu.enterInitializationMode()
    knowns = _knowns(model, {"": model.Parameters}) + _knowns(model, {"": model.Inputs})
    trusted, total = _compare(unit, _at_initialisation(model), values, knowns)
    assert trusted > 0.9 * total


def test_after_steps_they_are_those_by_parameters_and_the_state(unit: Instance, model: Model) -> None:
    values = _settable(model, random.Random(2))
    for name, value in values.items():
        unit[name] = value
    unit.initialise().step(5, 7.3e-3)
    # no output follows from hidden state
    values |= {name: float(unit[name]) if name in unit.variables else 0.0 for name in _state(model)}
    knowns = _knowns(model, {"": model.Parameters}) + [
        n for n in _knowns(model, {"state.": model.State}) if n in unit.variables
    ]
    trusted, total = _compare(unit, _while_running(model), values, knowns)
    assert trusted > 0.9 * total


def test_after_initialisation_outputs_do_not_move_with_inputs(unit: Instance, model: Model) -> None:
    unit.initialise().step(5)
    inputs = dict.fromkeys(_knowns(model, {"": model.Inputs}), 1.0)
    unknowns = list(_at_initialisation(model)(_starts(model)))
    assert set(_derivatives(unit, unknowns, inputs).values()) == {0.0}


def _state(model: Model) -> list[str]:
    return [f"state.{leaf.name}" for leaf in leaves(model.State)]


def _starts(model: Model) -> Values:
    return {leaf.name: leaf.start for leaf in (*leaves(model.Parameters), *leaves(model.Inputs))}


def test_they_are_linear_in_the_direction(unit: Instance, model: Model) -> None:
    chance = random.Random(3)
    unit.fmu.enterInitializationMode()
    knowns = _knowns(model, {"": model.Parameters}) + _knowns(model, {"": model.Inputs})
    unknowns = list(_at_initialisation(model)(_starts(model)))
    direction = {known: chance.gauss(0.0, 1.0) for known in knowns}
    whole = _derivatives(unit, unknowns, direction)
    parts = [_derivatives(unit, unknowns, {known: size}) for known, size in direction.items()]
    for unknown in unknowns:
        size = sum(abs(part[unknown]) for part in parts)
        # a last pivot of Davenport's noise is a small difference of large numbers: seven digits of sixteen are left
        assert whole[unknown] == pytest.approx(sum(part[unknown] for part in parts), abs=1e-6 * size + 1e-15)


def _ends(variable: Any) -> list[float]:
    limits = {0.0, *(float(end) for end in (variable.min, variable.max) if end is not None)}
    low, high = (float(end) if end is not None else sign * inf for end, sign in ((variable.min, -1), (variable.max, 1)))
    return [value for value in sorted(limits) if low <= value <= high]


def _taken(call: Callable[[], Any]) -> bool:
    try:
        call()
    except FMICallException:
        return False
    return True


def test_they_are_finite_with_any_parameter_at_zero_or_at_an_end_of_its_range(unit: Instance, model: Model) -> None:
    unknowns = list(_at_initialisation(model)(_starts(model)))
    settable = _knowns(model, {"": model.Parameters}) + _knowns(model, {"": model.Inputs})
    asked = 0
    for name in _knowns(model, {"": model.Parameters}):
        for value in _ends(unit.variables[name]):
            unit.fmu.reset()
            unit[name] = value
            if not _taken(lambda: unit[unknowns[0]]):
                continue  # it does not go together with the others
            for knowns in ([name], settable):
                assert all(map(isfinite, _derivatives(unit, unknowns, dict.fromkeys(knowns, 1.0)).values()))
            unit.initialise().step(2)
            for knowns in ([name], settable + _knowns(model, {"state.": model.State})):
                assert all(map(isfinite, _derivatives(unit, unknowns, dict.fromkeys(knowns, 1.0)).values()))
            asked += 1
    assert asked > len(settable)


# --- the FMU against itself, and what is refused


@pytest.fixture
def small(native_fmu: Path, load: Load) -> Instance:
    return load(native_fmu)


DIRECTION = {"gain": 0.3, "rate[1]": -1.0, "rate[2]": 0.5, "rate[3]": 2.0}
POINT = {"gain": 1.5, "rate[1]": 0.7, "rate[2]": -0.4, "rate[3]": 1.1}


def test_the_outputs_of_the_fmu_move_as_it_says(small: Instance) -> None:
    unknowns = ["shown.rate[1]", "shown.rate[2]", "shown.rate[3]", "shown.square"]
    small.fmu.enterInitializationMode()

    def shown(step: float) -> list[float]:
        for name, value in POINT.items():
            small[name] = value + step * DIRECTION[name]
        return [small[name] for name in unknowns]

    above, below = shown(1e-5), shown(-1e-5)
    shown(0.0)
    found = _derivatives(small, unknowns, DIRECTION)
    assert list(found.values()) == pytest.approx([(a - b) / 2e-5 for a, b in zip(above, below, strict=True)], rel=1e-8)


def test_a_variable_named_twice_adds_up(small: Instance) -> None:
    small.initialise(**POINT)
    square, rate, gain = (small.variables[n].valueReference for n in ("shown.square", "state.filtered[1]", "gain"))
    once = small.fmu.getDirectionalDerivative([square], [rate, gain], [1.0, 0.5])
    twice = small.fmu.getDirectionalDerivative([square], [rate, gain, rate], [0.75, 0.5, 0.25])
    assert twice == once != [0.0]


def test_a_derivative_that_is_no_number_is_refused(small: Instance) -> None:
    small.initialise(**POINT)
    reason = small.refusal(
        lambda: _derivatives(small, ["shown.rate[1]", "shown.square"], {"state.filtered[1]": 1.7e308})
    )
    assert reason == "EveryKind: the derivative of shown.square is inf here"
    assert small["refused_calls"] == 1


def test_a_tuned_parameter_counts_at_once(small: Instance) -> None:
    small.initialise(**POINT).step(3)
    for period in (3e-3, 4e-3):
        rate = small["state.filtered[2]"]
        assert _derivatives(small, ["shown.square"], {"state.filtered[2]": 1.0}) == {"shown.square": 2.0 * rate}
        small["gain"] = 9.0
        small.step(start=period)


def test_asking_changes_nothing(native_fmu: Path, load: Load) -> None:
    asked, other = (load(native_fmu).initialise(**POINT).step(3) for _ in range(2))
    _derivatives(asked, ["shown.square"], {"gain": 1.0, "state.filtered[2]": 1.0})
    assert asked.bits() == other.bits()
    for one in (asked, other):
        one.step(3, start=3e-3)
    assert asked.bits() == other.bits()


REFUSED = {
    "integer known": (["shown.square"], ["shift"], "shift is of type Integer, not Real"),
    "integer unknown": (["shown.count"], ["gain"], "shown.count is of type Integer, not Real"),
    "switch": (["shown.moving"], ["gain"], "shown.moving is of type Boolean, not Real"),
    "input as unknown": (["rate[1]"], ["gain"], "no derivative of rate[1] is offered"),
    "parameter as unknown": (["gain"], ["rate[1]"], "no derivative of gain is offered"),
    "state as unknown": (["state.drift"], ["gain"], "no derivative of state.drift is offered"),
    "output as known": (["shown.square"], ["shown.rate[1]"], "with respect to shown.rate[1] is offered"),
    "coefficient as known": (["shown.square"], ["coefficient.sigma"], "with respect to coefficient.sigma is offered"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_not_offered_is_refused(small: Instance, case: str) -> None:
    unknowns, knowns, reason = REFUSED[case]
    small.initialise()
    assert reason in small.refusal(lambda: _derivatives(small, unknowns, dict.fromkeys(knowns, 1.0)))
    assert small["refused_calls"] == 1


def test_before_the_end_of_initialisation_the_state_follows_and_is_no_known(small: Instance) -> None:
    small.fmu.enterInitializationMode()
    ask = {"state.filtered[1]": 1.0}
    assert "after initialisation, states" in small.refusal(lambda: _derivatives(small, ["shown.rate[1]"], ask))
    small.fmu.exitInitializationMode()
    assert _derivatives(small, ["shown.rate[1]"], ask) == {"shown.rate[1]": 1.0}


def test_an_unknown_reference_is_refused(small: Instance) -> None:
    small.initialise()
    square = small.variables["shown.square"].valueReference
    for unknown, known in ((4711, square), (square, 4711)):
        reason = small.refusal(lambda u=unknown, k=known: small.fmu.getDirectionalDerivative([u], [k], [1.0]))
        assert reason == "EveryKind: there is no variable with value reference 4711"


def test_parameters_out_of_step_have_no_derivatives(small: Instance) -> None:
    small.initialise()
    small["lower"] = 2.0
    reason = small.refusal(lambda: _derivatives(small, ["shown.square"], {"gain": 1.0}))
    assert reason.startswith("EveryKind.lower = 2: more than")
