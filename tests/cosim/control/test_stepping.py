"""Models as functions on one array: the trace of what runs, rounding passed, ratios of clocks."""

from __future__ import annotations

import sys
from fractions import Fraction
from pathlib import Path

import casadi
import numpy as np
import pytest

from attitude_fmu.cosim.control.stepping import Compiled, parameters_with, period_of, smallest_step, timing
from attitude_fmu.fmu_src.trace import trace_running
from attitude_fmu.models.record import defaults
from attitude_fmu.models.scalar import round_half_up, rounding_of_symbols

sys.path.insert(0, str(Path(__file__).parent))
from small_models import Inputs, model

PROBE = model()


def compiled(rounded: bool = False, **values: float) -> Compiled:
    return Compiled(PROBE, parameters_with(PROBE, values), defaults(Inputs), rounded)


def test_rounding_of_symbols_is_changed_inside_only_and_for_symbols_only() -> None:
    x = casadi.SX.sym("x")
    with rounding_of_symbols(lambda value: 3.0 * value):
        assert round_half_up(2.6) == 3.0
        inside = round_half_up(x)
    outside = round_half_up(x)
    assert float(casadi.Function("f", [x], [inside])(0.7)) == pytest.approx(2.1)
    assert float(casadi.Function("f", [x], [outside])(0.7)) == 1.0


def test_rounding_errors_are_further_draws_of_the_task_that_rounds() -> None:
    running = trace_running(PROBE, defaults(PROBE.Parameters), rounded=False)
    assert dict(zip([task.name for task in running.tasks], running.errors, strict=True)) == {
        "lag": 0,
        "read": 1,
        "drift": 0,
    }
    probe = compiled(step=0.5)
    probe.state[:] = [0.7, 0.0, 0.0, 0.0, 0.0, 0.0]
    read = probe.steps[1]
    read.draws[:] = [0.0, -0.4]
    read.run()
    assert probe.state[1] == pytest.approx(0.5 * (0.7 / 0.5 - 0.4))
    assert probe.draw_names(1) == ["read[1]", "read.rounding[1]"]


def test_with_rounding_a_step_is_the_models_own() -> None:
    probe = compiled(rounded=True, step=0.5)
    probe.state[:] = [0.7, 0.0, 0.0, 0.0, 0.0, 0.0]
    probe.steps[1].run()
    assert probe.state[1] == 0.5


def test_jacobians_are_of_what_the_step_reads_here_and_now() -> None:
    probe = compiled()
    lag = probe.steps[0].jacobian()
    rows = probe.steps[0].rows
    np.testing.assert_allclose(lag.state.toarray()[list(rows).index(0), 0], 0.8)
    np.testing.assert_allclose(lag.inputs.toarray()[list(rows).index(0)], [0.2, 0.0], rtol=1e-12)
    assert lag.draws.shape == (len(rows), 0)


@pytest.mark.parametrize(
    ("reading", "ratio"),
    [(1.0, Fraction(1)), (0.501, Fraction(2)), (3.03, Fraction(1, 3)), (1.5, Fraction(2, 3)), (1.41421356, None)],
)
def test_ratio_of_a_clock_is_whole_where_it_nearly_is_else_small_or_none(reading: float, ratio: Fraction) -> None:
    times = timing(compiled(reading=reading), 1.0, 0.05)
    assert times.ticks["reading"] == ratio
    assert times.calls[1] == ratio


def test_period_and_smallest_step_are_common_multiples() -> None:
    times = timing(compiled(reading=1.5, every=2), 1.0, 0.05)
    assert times.calls == (Fraction(4), Fraction(1, 3), Fraction(1, 10))
    assert period_of(times) == 30
    assert smallest_step(times, [0, 1]) == 3
    assert smallest_step(timing(compiled(reading=1.41421356), 1.0, 0.05), [1]) is None


def test_parameters_that_set_a_clock_are_named() -> None:
    assert compiled().set_by("reading") == ["reading", "every"]
