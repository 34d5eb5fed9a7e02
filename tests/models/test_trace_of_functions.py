"""One source, two executions, for single functions: traced with CasADi they give the floats' bits.

`test_trace` does so for whole models; here are functions that a model may offer beside those it runs.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Iterator
from typing import Any

import casadi
import pytest

from attitude_fmu.models.attitude import alignment, integration
from attitude_fmu.models.filters import ar1_kalman
from attitude_fmu.models.record import flatten

POINTS = 200
STEP = 0.002

Arguments = tuple[Any, ...]
Sampler = Callable[[random.Random], Arguments]


@pytest.fixture(autouse=True)
def _no_simplification() -> Iterator[None]:
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    yield
    casadi.GlobalOptions.setSimplificationOnTheFly(True)


def like(shape: Any, leaf: Callable[[], Any]) -> Any:
    """The same nest of tuples and records with other scalars."""
    if not isinstance(shape, tuple):
        return leaf()
    inner = [like(part, leaf) for part in shape]
    return shape._make(inner) if hasattr(shape, "_make") else tuple(inner)


def flat(result: Any) -> list[Any]:
    return flatten(result) if isinstance(result, tuple) else [result]


def traced(function: Callable[..., Any], arguments: Arguments) -> Callable[[Arguments], list[float]]:
    names: list[casadi.SX] = []

    def symbol() -> casadi.SX:
        names.append(casadi.SX.sym(f"x{len(names)}"))
        return names[-1]

    result = casadi.vertcat(*flat(function(*like(arguments, symbol))))
    compiled = casadi.Function("f", [casadi.vertcat(*names)], [result])
    return lambda values: compiled(flatten(values)).full().ravel().tolist()


def bits(values: list[Any]) -> list[str]:
    return [float(value).hex() for value in values]


def vector(chance: random.Random, size: float) -> tuple[float, float, float]:
    """Now and then zero, very small or very large."""
    scale = chance.choice((0.0, 1e-9 * size, size, size, size, 100.0 * size))
    return scale * chance.gauss(0.0, 1.0), scale * chance.gauss(0.0, 1.0), scale * chance.gauss(0.0, 1.0)


def vectors(count: int, size: float = 1.0) -> Sampler:
    return lambda chance: tuple(vector(chance, size) for _ in range(count))


def integrator_arguments(chance: random.Random) -> Arguments:
    q = tuple(chance.gauss(0.0, 1.0) for _ in range(4))
    return q, vector(chance, 3.0), vector(chance, 3.0), chance.uniform(1e-4, 0.5)


def rotation_arguments(chance: random.Random) -> Arguments:
    return integrator_arguments(chance)[1:]


def channel_arguments(chance: random.Random) -> Arguments:
    channel = ar1_kalman.Channel(chance.gauss(0.0, 1.0), chance.uniform(0.0, 2.0), chance.gauss(0.0, 1.0))
    return channel, chance.gauss(0.0, 1.0), chance.uniform(-0.999, 0.999), chance.uniform(1e-9, 1.0), chance.random()


def six_channel_arguments(chance: random.Random) -> Arguments:
    p = ar1_kalman.Ar1KalmanParameters()
    state = ar1_kalman.initial_ar1_kalman(vector(chance, 0.1), vector(chance, 10.0), p)
    for _ in range(chance.choice((0, 3))):
        state = ar1_kalman.ar1_kalman_step(state, vector(chance, 0.1), vector(chance, 10.0), p)
    return state, vector(chance, 0.1), vector(chance, 10.0), p


def watched_arguments(chance: random.Random) -> Arguments:
    """Some samples of a body at rest, then one more at rest or pushed."""
    p = alignment.MotionParameters(restart=chance.random() < 0.8)
    watched = alignment.NOTHING_SEEN
    for _ in range(chance.choice((0, 1, 5, 80))):
        force = (0.1 + chance.gauss(0.0, 0.003), 0.2, 9.8 + chance.gauss(0.0, 0.003))
        watched = alignment.with_watched_sample(watched, force, vector(chance, 1e-4), p, STEP)
    pushed = chance.choice((0.0, 0.0, 100.0))
    return watched, (0.1 + pushed, 0.2, 9.8), vector(chance, 1e-4), p, STEP


CASES: dict[str, tuple[Callable[..., Any], Sampler]] = {
    **{step.__name__: (step, integrator_arguments) for step in integration.INTEGRATORS.values()},
    "turned": (integration.turned, lambda chance: integrator_arguments(chance)[:2]),
    "mean_rotation": (integration.mean_rotation, rotation_arguments),
    "coning_rotation": (integration.coning_rotation, rotation_arguments),
    "coning_with_previous": (integration.coning_with_previous, vectors(2)),
    "coning_2": (integration.coning_2, vectors(2)),
    "coning_3": (integration.coning_3, vectors(3)),
    "coning_4": (integration.coning_4, vectors(4)),
    "ar1_kalman_filtered": (ar1_kalman.ar1_kalman_filtered, channel_arguments),
    "ar1_kalman_step": (ar1_kalman.ar1_kalman_step, six_channel_arguments),
    "initial_ar1_kalman": (ar1_kalman.initial_ar1_kalman, lambda chance: six_channel_arguments(chance)[1:]),
    "settled_gain": (ar1_kalman.settled_gain, lambda chance: channel_arguments(chance)[2:]),
    "signal_variance_for": (
        ar1_kalman.signal_variance_for,
        lambda chance: (chance.uniform(0.0, 0.99), *channel_arguments(chance)[2:4]),
    ),
    "with_watched_sample": (alignment.with_watched_sample, watched_arguments),
}


@pytest.mark.parametrize(("function", "sampler"), CASES.values(), ids=CASES)
def test_a_function_traces_to_the_same_bits(function: Callable[..., Any], sampler: Sampler) -> None:
    chance = random.Random(1)
    compiled = traced(function, sampler(chance))
    for _ in range(POINTS):
        arguments = sampler(chance)
        assert bits(compiled(arguments)) == bits(flat(function(*arguments)))


def test_the_watched_samples_both_restart_and_go_on() -> None:
    chance = random.Random(1)
    samples = [watched_arguments(chance) for _ in range(POINTS)]
    restarted = [
        alignment.with_watched_sample(*arguments).sums.samples <= arguments[0].sums.samples for arguments in samples
    ]
    assert 10 < sum(restarted) < POINTS - 10
