"""One source, two executions: every model function traced with CasADi gives the floats' bits."""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from importlib import import_module
from typing import Any

import casadi
import pytest

from attitude_fmu.fmu_src.catalogue import CATALOGUE
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.record import Boolean, Enumeration, Integer, Leaf, Real, defaults, flatten, leaves, unflatten
from attitude_fmu.models.system import Model, Run

MODELS = [import_module(entry.module).MODEL for entry in CATALOGUE]
POINTS = 40


@pytest.fixture(autouse=True)
def _no_simplification() -> Iterator[None]:
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    yield
    casadi.GlobalOptions.setSimplificationOnTheFly(True)


def symbols(record: type) -> list[casadi.SX]:
    return [casadi.SX.sym(leaf.name) for leaf in leaves(record)]


def traced(function: Callable[..., Any], *records: type, draws: int = 0) -> Callable[..., list[float]]:
    arguments = [symbols(record) for record in records]
    normals = [casadi.SX.sym(f"z{i}") for i in range(draws)]
    values = [unflatten(record, flat) for record, flat in zip(records, arguments, strict=True)]
    if draws:
        values.append(tuple(normals))
    result = casadi.vertcat(*flatten(function(*values)))
    compiled = casadi.Function("f", [casadi.vertcat(*flat) for flat in [*arguments, normals]], [result])
    return lambda *points: compiled(*points).full().ravel().tolist()


def near(leaf: Leaf, value: float, chance: random.Random) -> float:
    """A random legal value near `value`."""
    fact = leaf.fact
    if isinstance(fact, Enumeration):
        return chance.randint(1, len(fact.items))
    if isinstance(fact, Boolean):
        return chance.randint(0, 1)
    if isinstance(fact, Integer):
        return value
    assert isinstance(fact, Real)
    moved = value * (1.0 + 0.1 * chance.gauss(0.0, 1.0)) + (0.001 * chance.gauss(0.0, 1.0) if value == 0.0 else 0.0)
    low = fact.min if fact.min is not None else -float("inf")
    high = fact.max if fact.max is not None else float("inf")
    return min(max(moved, low), high)


def points_near(record: type, centre: Any, chance: random.Random) -> list[float]:
    return [float(near(leaf, value, chance)) for leaf, value in zip(leaves(record), flatten(centre), strict=True)]


def bits(values: list[float]) -> list[str]:
    return [float(value).hex() for value in values]


def legal_parameters(model: Model, chance: random.Random) -> list[float]:
    """Random parameters that go together."""
    while True:
        parameters = points_near(model.Parameters, defaults(model.Parameters), chance)
        try:
            model.rules(unflatten(model.Parameters, parameters), model.name)
        except ValueRefusedError:
            continue
        return parameters


def random_cases(model: Model, seed: int) -> Iterator[tuple[list[float], list[float], list[float], list[float]]]:
    """Parameters, coefficients, inputs and state at random points of random short runs."""
    chance = random.Random(seed)
    for _ in range(POINTS):
        parameters = legal_parameters(model, chance)
        inputs = points_near(model.Inputs, defaults(model.Inputs), chance)
        held = unflatten(model.Inputs, inputs)
        run = Run(model, unflatten(model.Parameters, parameters), held)
        run.advance(held, chance.choice((0.0, 0.004, 0.02)))
        state = points_near(model.State, run.state, chance)
        yield parameters, [float(x) for x in flatten(run.coefficients)], inputs, state


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_coefficients_outputs_and_initial_state_trace_to_the_same_bits(model: Model) -> None:
    coefficients = traced(model.coefficients, model.Parameters)
    initial = traced(model.initial_state, model.Parameters, model.Coefficients, model.Inputs)
    outputs = traced(model.outputs, model.State, model.Parameters, model.Coefficients)
    for p, k, u, x in random_cases(model, seed=1):
        parameters, held, inputs = (
            unflatten(record, flat)
            for record, flat in ((model.Parameters, p), (model.Coefficients, k), (model.Inputs, u))
        )
        assert bits(coefficients(p, [])) == bits(flatten(model.coefficients(parameters)))
        assert bits(initial(p, k, u, [])) == bits(flatten(model.initial_state(parameters, held, inputs)))
        shown = model.outputs(unflatten(model.State, x), parameters, held)
        assert bits(outputs(x, p, k, [])) == bits(flatten(shown))


@pytest.mark.parametrize(
    ("model", "task", "way"),
    [
        pytest.param(model, task, way, id=f"{model.name}-{way}")
        for model in MODELS
        for task in model.tasks
        for way in task.alternatives()
    ],
)
def test_every_way_of_every_task_traces_to_the_same_bits(model: Model, task: Any, way: str) -> None:
    step = task.alternatives()[way]
    records = (model.State, model.Inputs, model.Parameters, model.Coefficients)

    def with_draws(x: Any, u: Any, p: Any, k: Any, draws: tuple[Any, ...] = ()) -> Any:
        return step(x, u, p, k, draws)

    compiled = traced(with_draws, *records, draws=task.normals)
    chance = random.Random(2)
    for p, k, u, x in random_cases(model, seed=3):
        draws = [chance.gauss(0.0, 1.0) for _ in range(task.normals)]
        values = [unflatten(record, flat) for record, flat in zip(records, (x, u, p, k), strict=True)]
        assert bits(compiled(x, u, p, k, draws)) == bits(flatten(step(*values, tuple(draws))))


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_clock_periods_and_dividers_follow_from_the_coefficients_alone(model: Model) -> None:
    run = Run(model, defaults(model.Parameters), defaults(model.Inputs))
    for clock in model.clocks:
        assert float(clock.period(run.coefficients)) > 0.0
    for task in model.tasks:
        assert int(task.every(run.coefficients)) >= 1
