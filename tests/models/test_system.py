"""Clocks, tasks and the scheduler."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple

import pytest

from attitude_fmu.models.errors import ModelStoppedError, ValueRefusedError
from attitude_fmu.models.record import Integer, Real
from attitude_fmu.models.scalar import floor
from attitude_fmu.models.system import Clock, Model, Run, Task


class Parameters(NamedTuple):
    fast: Annotated[float, Real("s", "period of the fast clock", min=1e-6)] = 0.003
    gain: Annotated[float, Real("1", "gain", tunable=True)] = 1.0
    seed: Annotated[int, Integer("seed", min=0)] = 7


class Coefficients(NamedTuple):
    fast: Annotated[float, Real("s", "period of the fast clock")]


class Inputs(NamedTuple):
    u: Annotated[float, Real("1", "input")] = 0.0


class State(NamedTuple):
    ticks: Annotated[float, Real("1", "calls of the fast task")] = 0.0
    halves: Annotated[float, Real("1", "calls of the task at every second tick")] = 0.0
    noise: Annotated[float, Real("1", "sum of its noise")] = 0.0
    slow: Annotated[float, Real("1", "what the slow task saw of the fast one")] = 0.0


class Outputs(NamedTuple):
    ticks: Annotated[float, Real("1", "calls")]


def fast(x: State, u: Inputs, p: Parameters, _k: Coefficients, _z: tuple[Any, ...]) -> State:
    return x._replace(ticks=x.ticks + p.gain / (1.0 - u.u))


def half(x: State, _u: Inputs, _p: Parameters, _k: Coefficients, z: tuple[Any, ...]) -> State:
    return x._replace(halves=x.halves + 1.0, noise=x.noise + z[0] - z[4])


def slow(x: State, _u: Inputs, _p: Parameters, _k: Coefficients, _z: tuple[Any, ...]) -> State:
    return x._replace(slow=x.ticks)


MODEL = Model(
    "Counter",
    "counts",
    Parameters,
    Coefficients,
    Inputs,
    State,
    Outputs,
    lambda p: Coefficients(p.fast),
    lambda _p, _k, _u: State(),
    lambda x, _p, _k: Outputs(x.ticks),
    (Clock("fast", lambda k: k.fast), Clock("slow", lambda _k: 0.1)),
    (
        Task("fast", "fast", fast),
        Task("half", "fast", half, every=lambda _k: 2, normals=5),
        Task("slow", "slow", slow),
    ),
    lambda p: p.seed,
)


def test_a_tick_on_the_end_of_a_step_belongs_to_that_step() -> None:
    run = Run(MODEL, Parameters(), Inputs(), start_time=2.0)
    run.advance(Inputs(), 2.003)
    assert run.state.ticks == 1.0
    run.advance(Inputs(), 2.0059)
    assert run.state.ticks == 1.0


def test_ticks_are_counted_not_accumulated_over_a_million_periods() -> None:
    run = Run(MODEL, Parameters(fast=1e-4), Inputs())
    run.advance(Inputs(), 100.0)
    assert run.state.ticks == 1_000_000
    assert run.state.halves == 500_000


@pytest.mark.parametrize("step", [0.001, 0.005, 0.0073, 0.01])
def test_the_result_does_not_depend_on_how_time_is_cut(step: float) -> None:
    whole, cut = (Run(MODEL, Parameters(), Inputs()) for _ in range(2))
    whole.advance(Inputs(), 0.73)
    t, n = 0.0, 0
    while t < 0.73 - 1e-12:
        n += 1
        t = min(n * step, 0.73)
        cut.advance(Inputs(), t)
    assert cut.snapshot() == whole.snapshot()


def test_a_restored_snapshot_goes_on_to_the_same_bits() -> None:
    straight, other = (Run(MODEL, Parameters(), Inputs()) for _ in range(2))
    straight.advance(Inputs(), 0.1)
    saved = straight.snapshot()
    straight.advance(Inputs(), 0.3)
    other.restore(saved)
    other.advance(Inputs(), 0.3)
    assert other.snapshot() == straight.snapshot()


def test_a_snapshot_of_another_model_is_refused_and_changes_nothing() -> None:
    run = Run(MODEL, Parameters(), Inputs())
    run.advance(Inputs(), 0.1)
    before = run.snapshot()
    with pytest.raises(ModelStoppedError, match="another model"):
        run.restore(before._replace(state=before.state[1:]))
    assert run.snapshot() == before


def test_a_failing_task_names_itself_and_its_time_and_keeps_the_last_good_state() -> None:
    run = Run(MODEL, Parameters(), Inputs(), name="bench")
    run.advance(Inputs(), 0.009)
    with pytest.raises(ModelStoppedError, match=r"bench: task fast at t = 0.012 s: float division by zero"):
        run.advance(Inputs(u=1.0), 0.02)
    assert run.state.ticks == 3.0
    run.advance(Inputs(), 0.02)
    assert run.state.ticks == 6.0


def test_bad_parameters_are_refused_at_the_start_and_when_tuned() -> None:
    with pytest.raises(ValueRefusedError, match="bench.fast = 0 s: too small"):
        Run(MODEL, Parameters(fast=0.0), Inputs(), name="bench")
    run = Run(MODEL, Parameters(), Inputs(), name="bench")
    with pytest.raises(ValueRefusedError, match=r"bench.gain = nan"):
        run.tune(Parameters(gain=float("nan")))
    run.tune(Parameters(gain=2.0))
    run.advance(Inputs(), 0.003)
    assert run.state.ticks == 2.0


def test_equal_seeds_give_equal_noise_and_others_do_not() -> None:
    def noise(seed: int) -> float:
        run = Run(MODEL, Parameters(seed=seed), Inputs())
        run.advance(Inputs(), 0.1)
        return float(run.state.noise)

    assert noise(7) == noise(7) != noise(8)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"coefficients": lambda p: Coefficients(p.fast * math.inf)}, "bench.coefficient.fast = inf: the numbers ran"),
        ({"initial_state": lambda _p, _k, _u: State(noise=math.nan)}, "bench.state.noise = nan: the numbers ran away"),
    ],
)
def test_numbers_that_run_away_are_refused_at_the_start(change: dict[str, Any], told: str) -> None:
    with pytest.raises(ModelStoppedError, match=told):
        Run(MODEL._replace(**change), Parameters(), Inputs(), name="bench")


def test_a_state_that_runs_away_is_refused_at_the_end_of_the_step() -> None:
    run = Run(MODEL, Parameters(gain=1e308), Inputs(), name="bench")
    with pytest.raises(ModelStoppedError, match=r"bench.state.ticks = inf: the numbers ran away"):
        run.advance(Inputs(), 0.01)


def test_the_floor_of_an_infinity_is_itself_as_in_c() -> None:
    assert [floor(math.inf), floor(-math.inf), floor(-0.5), floor(2.5)] == [math.inf, -math.inf, -1.0, 2.0]
