"""All that happens in one sampling time as one linear map, exact at the state where it begins.

    x_after = A x + B u + G w,   y = C x

Each task is linear in what it reads, x_i' = x_i + J_i (x_i, u, w_i); their product in the order of their ticks is the
map of the sampling time, with u held over it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from .stepping import Array, Compiled, Timing, calls_within

Places = np.ndarray[Any, np.dtype[np.intp]]


class Draw(NamedTuple):
    """One standard normal or rounding error of a call of a task."""

    name: str
    task: int
    variance: float


class Fold(NamedTuple):
    """The map, on the states that any task writes; `rows` are their places in the model's state.

    `before` and `after` are their values, `start` is the model's whole state before.
    """

    A: Array
    B: Array
    G: Array
    C: Array
    rows: Places
    draws: list[Draw]
    before: Array
    after: Array
    start: Array


def closure(follows: Any, start: Any) -> Any:
    """All that follows from `start`; ``follows[i, j]`` tells that i follows from j."""
    reached = start.copy()
    while True:
        more = reached | (follows @ reached)
        if (more == reached).all():
            return reached
        reached = more


ROUNDING_VARIANCE = 1.0 / 12.0
"""Of a rounding error: uniform over one step."""


def regular(times: Timing) -> list[int]:
    """The tasks that run a whole number of times in every sampling time."""
    return [number for number, calls in enumerate(times.calls) if calls and calls.denominator == 1]


def regular_calls(compiled: Compiled, times: Timing) -> list[int]:
    """Their calls in a sampling time, in order."""
    usual = set(regular(times))
    return [number for number in calls_within(compiled, times, 1) if number in usual]


def fold(compiled: Compiled, calls: Sequence[int]) -> Fold:
    """The linear map of these calls of tasks, one after the other, from the compiled model's state on.

    The state ends where they take it.
    """
    rows = np.unique(np.concatenate([step.rows for step in compiled.steps]))
    n, m = len(rows), len(compiled.input_names)
    place = np.full(len(compiled.state), -1, dtype=np.intp)
    place[rows] = np.arange(n)
    width = sum(compiled.steps[number].draws.size for number in calls)
    start = compiled.state.copy()
    by = np.zeros((n, n + m + width))  # derivatives of the state by x, u and w, after each call
    by[:, :n] = np.eye(n)
    draws: list[Draw] = []
    for turn, number in enumerate(calls):
        step, first = compiled.steps[number], n + m + len(draws)
        jacobian = step.jacobian()
        after = jacobian.state[:, rows] @ by
        after[:, n : n + m] += jacobian.inputs
        after[:, first : first + step.draws.size] += jacobian.draws
        by[place[step.rows]] = after
        step.run()
        draws += _draws(compiled, number, calls[:turn].count(number), calls.count(number))
    return Fold(
        by[:, :n],
        by[:, n : n + m],
        by[:, n + m :],
        compiled.show.jacobian().state[:, rows].toarray(),
        rows,
        draws,
        start[rows],
        compiled.state[rows].copy(),
        start,
    )


def _draws(compiled: Compiled, number: int, call: int, of: int) -> list[Draw]:
    """The draws of a call of a task; their names count the calls where there are several."""
    normals = compiled.tasks[number].normals
    suffix = f"({call + 1})" if of > 1 else ""
    return [
        Draw(name + suffix, number, 1.0 if i < normals else ROUNDING_VARIANCE)
        for i, name in enumerate(compiled.draw_names(number))
    ]


NEGLIGIBLE = 1e-13
"""Part of the largest response of an output below which a state's share is rounding."""


class Reduced(NamedTuple):
    """The states that are kept (places in the fold) and the outputs that respond (places among those chosen)."""

    states: Places
    outputs: Places


def reduced(A: Array, B: Array, C: Array, level: Array) -> Reduced:
    """States that inputs reach and outputs see by more than rounding, and the outputs that they move.

    A state's share in a response is at most the largest that the inputs make of it times the largest that it makes of
    the output; both are looked at in the first steps and at powers of two. `level` is what an output shows.
    """
    way = closure(A != 0.0, np.any(B != 0.0, axis=1)) & closure(A.T != 0.0, np.any(C != 0.0, axis=0))
    states = np.flatnonzero(way)
    a, b, c = A[np.ix_(states, states)], B[states], C[:, states]
    reach, sight = _largest(a, b).max(axis=1, initial=0.0), _largest(a.T, c.T)
    response = _largest_response(a, b, c)
    moved = response > NEGLIGIBLE * (1.0 + np.abs(level))
    share = reach[:, None] * sight
    kept = np.any(share[:, moved] > NEGLIGIBLE * response[moved], axis=1)
    return Reduced(states[kept], np.flatnonzero(moved))


class Slim(NamedTuple):
    """A, B and C of the states that are kept (places among those before)."""

    states: Places
    A: Array
    B: Array
    C: Array


_CONSERVED = 1e-11
"""Change of a sum of states, scaled to their largest values, below which it stays as it is."""


def without_sums(A: Array, B: Array, C: Array) -> Slim:
    """The same responses without states that are sums of others, w x = 0 where w A = w and w B = 0.

    A moving average that keeps its running sum beside its samples has such a state: an integrator that nothing drives.
    """
    n = len(A)
    reach = _largest(A, B).max(axis=1, initial=0.0)
    scale = np.where(reach > 0.0, reach, 1.0)
    a, b = A * scale / scale[:, None], B / scale[:, None]
    b = b / np.maximum(np.abs(b).max(axis=0, initial=0.0), 1e-300)
    _, values, vectors = linalg.svd(np.hstack([a - np.eye(n), b]).T, full_matrices=True)
    W = vectors[len(values) :].T if n > len(values) else np.zeros((n, 0))
    W = np.hstack([vectors[: len(values)][values < _CONSERVED * max(values.max(initial=0.0), 1.0)].T, W])
    if not W.shape[1]:
        return Slim(np.arange(n), A, B, C)
    _, _, order = linalg.qr(W.T, pivoting=True)
    gone, kept = np.sort(order[: W.shape[1]]), np.sort(order[W.shape[1] :])
    T = -np.linalg.solve(W[gone].T, W[kept].T) * scale[gone][:, None] / scale[kept]
    return Slim(kept, A[np.ix_(kept, kept)] + A[np.ix_(kept, gone)] @ T, B[kept], C[:, kept] + C[:, gone] @ T)


_FIRST = 16
_DOUBLINGS = 14


def _powers(a: Array, b: Array) -> Any:
    """a^k b for k = 0 to 15, and for powers of two up to 16384."""
    x = b
    for _ in range(_FIRST):
        yield x
        x = a @ x
    power = np.linalg.matrix_power(a, _FIRST)
    for _ in range(_DOUBLINGS - 4):
        yield power @ b
        power = power @ power
        if not np.abs(power).max(initial=0.0) < 1e12:
            return


def _largest(a: Array, b: Array) -> Any:
    """Largest that each input makes of each state, over time."""
    return np.max([np.abs(x) for x in _powers(a, b)], axis=0)


def _largest_response(a: Array, b: Array, c: Array) -> Any:
    return np.max([np.abs(c @ x).max(axis=1, initial=0.0) for x in _powers(a, b)], axis=0)
