"""The linear controller in Python: its equations, its limits, switching on and off."""

from __future__ import annotations

import doctest
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pytest

from attitude_fmu.models import linear_controller as module
from attitude_fmu.models.errors import ValueRefusedError
from attitude_fmu.models.linear_controller import Controller, Signal, linear_controller
from attitude_fmu.models.record import defaults, flatten, leaves, unflatten, with_defaults
from attitude_fmu.models.system import Model, Run

DT = 0.01
PROPORTIONAL, INTEGRAL = 2.0, 0.05
"""v = PROPORTIONAL e + INTEGRAL x, x the sum of errors."""


def pi_controller(limit: float, gain: float = 1.0 / PROPORTIONAL, **more: Any) -> Model:
    return linear_controller(
        Controller(
            "PI",
            "",
            DT,
            (Signal("error", "rad"),),
            (Signal("torque", "N.m", lower=-limit, upper=limit),),
            (Signal("sum"),),
            ((1.0,),),
            ((1.0,),),
            ((INTEGRAL,),),
            ((PROPORTIONAL,),),
            ((gain,),),
            ((1.0 / INTEGRAL,),),
        )._replace(**more)
    )


def random_controller(n: int, m: int, p: int, seed: int, **more: Any) -> Controller:
    rng = np.random.default_rng(seed)

    def matrix(rows: int, columns: int, size: float = 1.0) -> tuple[tuple[float, ...], ...]:
        return tuple(tuple(float(v) for v in row) for row in size * rng.standard_normal((rows, columns)))

    return Controller(
        "Random",
        "",
        DT,
        tuple(Signal(f"u[{i + 1}]") for i in range(m)),
        tuple(Signal(f"y[{i + 1}]") for i in range(p)),
        tuple(Signal(f"x[{i + 1}]", offset=float(v)) for i, v in enumerate(rng.standard_normal(n))),
        matrix(n, n, 0.5 / max(n, 1) ** 0.5),  # spectral radius about 0.5
        matrix(n, m),
        matrix(p, n),
        matrix(p, m),
        matrix(n, p, 0.0),
        matrix(n, p, 0.0),
    )._replace(**more)


def run_of(model: Model, **values: float) -> Run:
    parameters = defaults(with_defaults(model.Parameters, values))
    return Run(model, parameters, model.Inputs())


def driven(run: Run, inputs: Sequence[Any], steps: int = 1) -> list[list[float]]:
    """The outputs after each of the inputs was held for a period that is cut into `steps`."""
    found, first = [], run.counts[0]
    for k, given in enumerate(inputs):
        for i in range(steps):
            run.advance(given, (first + k + (i + 1) / steps) * DT)
        found.append(flatten(run.outputs())[:-1])
    return found


@pytest.fixture
def error() -> Callable[..., Any]:
    """Inputs of the PI controller."""
    model = pi_controller(1.0)
    return lambda value, enabled=True, reset=False, tracking=0.0: model.Inputs._make(
        (value, enabled, reset, type(model.Inputs().tracking)(tracking))
    )


@pytest.mark.parametrize(("n", "m", "p"), [(0, 2, 1), (1, 1, 1), (4, 1, 3), (5, 3, 2)])
def test_outputs_follow_the_difference_equation(n: int, m: int, p: int) -> None:
    controller = random_controller(n, m, p, seed=n)
    model = linear_controller(controller)
    A, B = np.reshape(controller.A, (n, n)), np.reshape(controller.B, (n, m))
    C, D = np.reshape(controller.C, (p, n)), np.reshape(controller.D, (p, m))
    x = np.array([signal.offset for signal in controller.states])
    rest = flatten(model.Inputs())[m:]
    u = np.random.default_rng(7).standard_normal((50, m))
    wanted = []
    for now in u:
        wanted.append(C @ x + D @ now)
        x = A @ x + B @ now
    given = [unflatten(model.Inputs, [*map(float, now), *rest]) for now in u]
    found = np.array(driven(run_of(model), given))
    assert np.abs(found - wanted).max() < 1e-14 * 50 * (n + m)  # a rounding for each product


def test_signals_keep_their_order_where_records_group_them() -> None:
    names = ("euler.yaw", "rate[2]", "euler.pitch", "rate[1]")
    model = linear_controller(
        random_controller(0, 4, 1, 1, inputs=tuple(map(Signal, names)), D=((1.0, 10.0, 100.0, 1000.0),))
    )
    assert [leaf.name for leaf in leaves(model.Inputs)][:4] == ["euler.yaw", "euler.pitch", "rate[1]", "rate[2]"]
    inputs = unflatten(model.Inputs, [1.0, 2.0, 3.0, 4.0, True, False, 0.0])
    assert driven(run_of(model), [inputs]) == [[1.0 + 40.0 + 200.0 + 3000.0]]


def test_result_does_not_depend_on_the_communication_step() -> None:
    model = linear_controller(random_controller(3, 1, 2, 3))
    rest = flatten(model.Inputs())[1:]
    given = [unflatten(model.Inputs, [float(value), *rest]) for value in np.random.default_rng(1).standard_normal(30)]
    assert driven(run_of(model), given) == driven(run_of(model), given, steps=7)


def test_before_the_first_tick_the_output_is_that_of_the_initial_state_alone(error: Callable[..., Any]) -> None:
    model = pi_controller(1.0)
    parameters = defaults(with_defaults(model.Parameters, {"initial_state.sum": 4.0, "output_offset.torque": 0.1}))
    assert Run(model, parameters, error(9.0)).outputs().torque == 4.0 * INTEGRAL + 0.1
    assert Run(model, parameters, error(9.0, enabled=False, tracking=0.7)).outputs().torque == 0.7


def test_at_the_operating_point_the_output_is_its_offset() -> None:
    model = pi_controller(1.0, inputs=(Signal("error", offset=0.3),), outputs=(Signal("torque", offset=0.2),))
    found = driven(run_of(model), [model.Inputs()] * 5)  # inputs start at the operating point
    assert found == [[0.2]] * 5


def test_limited_integral_goes_to_the_limit_and_not_beyond(error: Callable[..., Any]) -> None:
    # x+ = x + e + (U - v) / kp = (1 - ki/kp) x + U / kp, whatever e
    limit, ratio = 0.5, 1.0 - INTEGRAL / PROPORTIONAL
    run = run_of(pi_controller(limit))
    found = driven(run, [error(10.0)] * 200)
    assert found == [[limit]] * 200
    assert run.outputs().saturated
    assert INTEGRAL * run.state.sum == pytest.approx(limit * (1.0 - ratio**200), rel=1e-12)
    # so the output leaves the limit at once when the error turns: v = INTEGRAL x - PROPORTIONAL e
    before = INTEGRAL * run.state.sum
    assert driven(run, [error(-0.1)]) == [[pytest.approx(before - PROPORTIONAL * 0.1, rel=1e-12)]]
    assert not run.outputs().saturated


def test_without_the_gain_the_integral_winds_up(error: Callable[..., Any]) -> None:
    run = run_of(pi_controller(0.5, gain=0.0))
    driven(run, [error(10.0)] * 200)
    assert run.state.sum == 2000.0
    assert driven(run, [error(-0.1)]) == [[0.5]]


def test_enabling_goes_on_from_what_is_tracked(error: Callable[..., Any]) -> None:
    run = run_of(pi_controller(1.0))
    tracked = 0.35
    found = driven(run, [error(0.2), *[error(0.4, enabled=False, tracking=tracked)] * 30, error(0.3, tracking=tracked)])
    assert found[1:-1] == [[tracked]] * 30
    assert found[-1][0] == pytest.approx(tracked, abs=1e-15)
    # and then as an integral does
    after = driven(run, [error(0.3)] * 3)
    assert after[2][0] == pytest.approx(tracked + 3 * 0.3 * INTEGRAL, abs=1e-14)


def test_while_not_enabled_outputs_stay_within_the_limits(error: Callable[..., Any]) -> None:
    run = run_of(pi_controller(0.5))
    assert driven(run, [error(0.0, enabled=False, tracking=3.0)]) == [[0.5]]


def test_reset_begins_anew_to_the_bit(error: Callable[..., Any]) -> None:
    values = [error(float(v)) for v in np.random.default_rng(5).standard_normal(20)]
    fresh = driven(run_of(pi_controller(9.0), **{"initial_state.sum": 2.0}), values)
    run = run_of(pi_controller(9.0), **{"initial_state.sum": 2.0})
    driven(run, [error(0.7)] * 13)
    assert driven(run, [values[0]._replace(reset=True), *values[1:]]) == fresh


def test_while_reset_holds_the_state_stays(error: Callable[..., Any]) -> None:
    run = run_of(pi_controller(9.0), **{"initial_state.sum": 2.0})
    found = driven(run, [error(0.5, reset=True)] * 10)
    assert found == [[2.0 * INTEGRAL + 0.5 * PROPORTIONAL]] * 10


def test_limits_can_be_tuned(error: Callable[..., Any]) -> None:
    model = pi_controller(0.5)
    run = run_of(model)
    driven(run, [error(10.0)] * 3)
    run.tune(defaults(with_defaults(model.Parameters, {"upper_limit.torque": 0.2})))
    assert driven(run, [error(10.0)]) == [[0.2]]


def test_limits_that_cross_are_refused() -> None:
    with pytest.raises(ValueRefusedError, match=r"PI\.lower_limit\.torque = -0\.5 N\.m: above the upper limit"):
        run_of(pi_controller(0.5), **{"upper_limit.torque": -1.0})


def test_the_example_runs_as_printed() -> None:
    failed, attempted = doctest.testmod(module)
    assert attempted > 0
    assert not failed
