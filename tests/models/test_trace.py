"""One source, two executions: every model function traced with CasADi gives the floats' bits."""

from __future__ import annotations

import math
import random
import sys
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import casadi
import pytest
from random_records import bits, legal_parameters, points_near

from attitude_fmu.fmu_src.catalogue import CATALOGUE
from attitude_fmu.models import scalar
from attitude_fmu.models.attitude.rotations import Euler, euler_from_matrix, matrix_from_euler
from attitude_fmu.models.record import defaults, flatten, leaves, unflatten
from attitude_fmu.models.scalar import PI
from attitude_fmu.models.system import Model, Run

MODELS = [import_module(entry.module).MODEL for entry in CATALOGUE]
POINTS = 80


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


Case = tuple[list[float], list[float], list[float], list[float]]


@cache
def random_cases(model_name: str) -> tuple[Case, ...]:
    """Parameters, coefficients, inputs and state at random points of random short runs; some states as the run was."""
    model = next(model for model in MODELS if model.name == model_name)
    chance = random.Random(8)
    cases = []
    for case in range(POINTS):
        parameters = legal_parameters(model, chance)
        inputs = points_near(model.Inputs, defaults(model.Inputs), chance)
        held = unflatten(model.Inputs, inputs)
        run = Run(model, unflatten(model.Parameters, parameters), held)
        run.advance(held, chance.choice((0.0, 0.004, 0.02)))
        state = points_near(model.State, run.state, chance)
        if case % 8 == 7:
            state = [float(x) for x in flatten(run.state)]
        cases.append((parameters, [float(x) for x in flatten(run.coefficients)], inputs, state))
    return tuple(cases)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_coefficients_outputs_and_initial_state_trace_to_the_same_bits(model: Model) -> None:
    coefficients = traced(model.coefficients, model.Parameters)
    initial = traced(model.initial_state, model.Parameters, model.Coefficients, model.Inputs)
    outputs = traced(model.outputs, model.State, model.Parameters, model.Coefficients)
    for p, k, u, x in random_cases(model.name):
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
    for p, k, u, x in random_cases(model.name):
        draws = [chance.gauss(0.0, 1.0) for _ in range(task.normals)]
        values = [unflatten(record, flat) for record, flat in zip(records, (x, u, p, k), strict=True)]
        assert bits(compiled(x, u, p, k, draws)) == bits(flatten(step(*values, tuple(draws))))


def test_the_random_points_take_every_choice_both_ways(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without this the tests above could pass on one branch of each `where`."""
    taken: dict[tuple[str, int], set[bool]] = {}
    original = scalar.where

    def watched(condition: Any, a: Any, b: Any) -> Any:
        frame = sys._getframe(1)
        taken.setdefault((Path(frame.f_code.co_filename).name, frame.f_lineno), set()).add(bool(condition))
        return original(condition, a, b)

    for name, module in list(sys.modules.items()):
        if name.startswith("attitude_fmu.models.") and getattr(module, "where", None) is original:
            monkeypatch.setattr(module, "where", watched)
    for model in MODELS:
        steps = [(task, step) for task in model.tasks for step in task.alternatives().values()]
        chance = random.Random(4)
        for p, k, u, x in random_cases(model.name):
            parameters, held = unflatten(model.Parameters, p), unflatten(model.Coefficients, k)
            inputs, state = unflatten(model.Inputs, u), unflatten(model.State, x)
            model.coefficients(parameters)
            model.initial_state(parameters, held, inputs)
            model.outputs(state, parameters, held)
            for task, step in steps:
                step(state, inputs, parameters, held, tuple(chance.gauss(0.0, 1.0) for _ in range(task.normals)))
    assert len(taken) > 40
    one_sided = {place for place, seen in taken.items() if len(seen) < 2}
    assert {file for file, _ in one_sided} <= {"rotations.py"}, one_sided  # straight up or down: the next test


@pytest.mark.parametrize("pitch", [0.5 * PI, -0.5 * PI, 0.3])
def test_euler_angles_trace_to_the_same_bits_straight_up_and_down_too(pitch: float) -> None:
    up = math.copysign(1.0, pitch)
    straight = ((0.8, 0.0, 0.6 * up), (-0.6 * up, 0.0, 0.8), (0.0, up, 0.0))
    matrix = straight if abs(pitch) > 1.0 else matrix_from_euler(Euler(0.2, pitch, 0.4))
    elements = casadi.SX.sym("c", 9)
    rows = tuple(tuple(elements[3 * i + j] for j in range(3)) for i in range(3))
    compiled = casadi.Function("f", [elements], [casadi.vertcat(*euler_from_matrix(rows))])
    assert bits(compiled(flatten(matrix)).full().ravel().tolist()) == bits(list(euler_from_matrix(matrix)))


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
def test_clock_periods_and_dividers_follow_from_the_coefficients_alone(model: Model) -> None:
    run = Run(model, defaults(model.Parameters), defaults(model.Inputs))
    for clock in model.clocks:
        assert float(clock.period(run.coefficients)) > 0.0
    for task in model.tasks:
        assert int(task.every(run.coefficients)) >= 1
