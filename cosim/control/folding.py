"""All that happens in one sampling time as one linear map, exact at the state where it begins.

    x_after = A x + B u + G w,   y = C x

Each task is linear in what it reads, x_i' = x_i + J_i (x_i, u, w_i); their product in the order of their ticks is the
map of the sampling time, with u held over it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg, sparse  # type: ignore[import-untyped]

from .stepping import Array, Compiled, Timing, calls_within

Places = np.ndarray[Any, np.dtype[np.intp]]


class Draw(NamedTuple):
    """One standard normal or rounding error of a call of a task."""

    name: str
    task: int
    variance: float


class Fold(NamedTuple):
    """The map, on the states that any task writes; `rows` are their places in the model's state.

    `E` is the influence of the inputs of the sampling time before. `before` and `after` are the states' values, `start`
    is the model's whole state before.
    """

    A: Array
    B: Array
    E: Array
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


def with_inputs_before(folded: Fold, compiled: Compiled, inputs: Places) -> Fold:
    """The fold with the last values of these inputs as further states, of those that have influence; E is then 0.

    Their rows come after those of the model's states.
    """
    late = inputs[np.any(folded.E[:, inputs] != 0.0, axis=0)]
    if not late.size:
        return folded
    n, m, k = len(folded.A), folded.B.shape[1], len(late)
    values = compiled.inputs[late]
    return folded._replace(
        A=np.block([[folded.A, folded.E[:, late]], [np.zeros((k, n + k))]]),
        B=np.vstack([folded.B, np.eye(m)[late]]),
        E=np.zeros((n + k, m)),
        G=np.vstack([folded.G, np.zeros((k, folded.G.shape[1]))]),
        C=np.hstack([folded.C, np.zeros((len(folded.C), k))]),
        rows=np.concatenate([folded.rows, len(compiled.state) + late]),
        before=np.concatenate([folded.before, values]),
        after=np.concatenate([folded.after, values]),
    )


ROUNDING_VARIANCE = 1.0 / 12.0
"""Of a rounding error: uniform over one step."""


def regular(times: Timing) -> list[int]:
    """The tasks that run a whole number of times in every sampling time."""
    return [number for number, calls in enumerate(times.calls) if calls and calls.denominator == 1]


def regular_calls(compiled: Compiled, times: Timing) -> list[int]:
    """Their calls in a sampling time, in order."""
    usual = set(regular(times))
    return [number for number in calls_within(compiled, times, 1) if number in usual]


def mean_shares(compiled: Compiled, times: Timing, dt: float, calls: Sequence[int]) -> list[float]:
    """Of each call, how likely it reads this sampling time's inputs, not yet those of the one before.

    A clock whose ratio to dt is rounded slips: its words end at any time up to one word before what reads them, and so
    do its ticks. All phases are as likely; a call at the part f of dt is early enough for the old inputs in a share of
    1 - f n of them, n words in dt. A clock whose words are not read as they end, but wait for an own later tick, stays
    tied: it has such a wait already.
    """
    count = {number: calls.count(number) for number in set(calls)}
    words: dict[str, int] = {}
    for number, called in count.items():
        clock = compiled.tasks[number].clock
        words[clock] = min(called, words.get(clock, called))
    slips = {clock: _slips(compiled, times, dt, count, clock, least) for clock, least in words.items()}
    turn = dict.fromkeys(count, 0)
    shares = []
    for number in calls:
        turn[number] += 1
        clock = compiled.tasks[number].clock
        shares.append(min(1.0, turn[number] / count[number] * words[clock]) if slips[clock] else 1.0)
    return shares


def _slips(compiled: Compiled, times: Timing, dt: float, count: dict[int, int], clock: str, words: int) -> bool:
    """Whether a clock is not tied to dt and others read only what it writes as a word ends."""
    ratio = times.ticks[clock]
    if not ratio or abs(float(ratio) * compiled.periods[clock] / dt - 1.0) < _SLIP:
        return False
    between = [compiled.steps[i].rows for i in count if compiled.tasks[i].clock == clock and count[i] > words]
    readers = [compiled.steps[i] for i in count if compiled.tasks[i].clock != clock]
    read = [reader.jacobian().state.indices for reader in readers]
    return not np.intersect1d(np.concatenate([*between, []]), np.concatenate([*read, []])).size


_SLIP = 1e-9
"""Part by which a clock may miss a whole ratio and still be tied to the others."""


def fold(compiled: Compiled, calls: Sequence[int], shares: Sequence[float] | None = None) -> Fold:
    """The linear map of these calls of tasks, one after the other, from the compiled model's state on.

    The state ends where they take it. `shares` are those of `mean_shares`, by default 1.
    """
    rows = np.unique(np.concatenate([step.rows for step in compiled.steps]))
    n, m = len(rows), len(compiled.input_names)
    place = np.full(len(compiled.state), -1, dtype=np.intp)
    place[rows] = np.arange(n)
    width = sum(compiled.steps[number].draws.size for number in calls)
    start = compiled.state.copy()
    fixed = n + 2 * m
    by = np.zeros((n, fixed + width))  # derivatives of the state by x, u, u before, and w, after each call
    by[:, :n] = np.eye(n)
    draws: list[Draw] = []
    for turn, number in enumerate(calls):
        step, first = compiled.steps[number], fixed + len(draws)
        share = shares[turn] if shares else 1.0
        jacobian = step.jacobian()
        after = jacobian.state[:, rows] @ by
        after[:, n : n + m] += share * jacobian.inputs
        if share < 1.0:
            after[:, n + m : fixed] += (1.0 - share) * jacobian.inputs
        after[:, first : first + step.draws.size] += jacobian.draws
        by[place[step.rows]] = after
        step.run()
        draws += _draws(compiled, number, calls[:turn].count(number), calls.count(number))
    return Fold(
        by[:, :n],
        by[:, n : n + m],
        by[:, n + m : fixed],
        by[:, fixed:],
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
    the output. `level` is what an output shows.
    """
    way = closure(A != 0.0, np.any(B != 0.0, axis=1)) & closure(A.T != 0.0, np.any(C != 0.0, axis=0))
    states = np.flatnonzero(way)
    largest = _largest(A[np.ix_(states, states)], B[states], C[:, states])
    moved = largest.response > NEGLIGIBLE * (1.0 + np.abs(level))
    share = largest.reach[:, None] * largest.sight.T
    kept = np.any(share[:, moved] > NEGLIGIBLE * largest.response[moved], axis=1)
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
    reach = _largest(A, B, C).reach
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


class _Largest(NamedTuple):
    """Over time, by inputs of one: largest of each state, each state's of each output, largest of each output."""

    reach: Array
    sight: Array
    response: Array


_LATE = 14
"""Doublings of the time after which the slowest modes are looked at."""

_OVERFLOW = 1e12


def _largest(A: Array, B: Array, C: Array) -> _Largest:
    """The largest of A^k B, C A^k and C A^k B for every k below the number of states, and then at powers of two.

    What is zero for so many k is zero for all of them (Cayley and Hamilton): no delay line is too long. The later k
    tell how large slow modes grow.
    """
    n = len(A)
    found = _Largest(np.zeros(n), np.zeros((len(C), n)), np.zeros(len(C)))
    sparse_A, sparse_At = sparse.csr_matrix(A), sparse.csr_matrix(A.T)
    reached, seen = B, C.T
    for _ in range(n):
        found = _larger(found, reached, seen.T, C @ reached)
        reached, seen = sparse_A @ reached, sparse_At @ seen
    power = A
    for doubling in range(_LATE):
        if not np.abs(power).max(initial=0.0) < _OVERFLOW:
            break
        if 2**doubling >= n:
            found = _larger(found, power @ B, C @ power, C @ power @ B)
        power = power @ power
    return found


def _larger(found: _Largest, reached: Array, seen: Array, response: Array) -> _Largest:
    return _Largest(
        np.maximum(found.reach, np.abs(reached).max(axis=1, initial=0.0)),
        np.maximum(found.sight, np.abs(seen)),
        np.maximum(found.response, np.abs(response).max(axis=1, initial=0.0)),
    )


_LOOKED_AT = np.exp(1j * np.array([0.003, 0.1, 0.7, 2.5]))
"""Points on the unit circle, as angles per sampling time, where two systems are compared; assumption."""

SAME = 1e-7
"""Part of an output's largest gain by which they may differ; poles near 1 magnify rounding; assumption."""


def difference(A: Array, B: Array, C: Array, slim: Slim) -> float:
    """Largest difference of two systems' frequency responses, as a part of each output's largest gain."""
    way = closure(A != 0.0, np.any(B != 0.0, axis=1)) & closure(A.T != 0.0, np.any(C != 0.0, axis=0))
    worst = 0.0
    for z in _LOOKED_AT:
        expected = _response(A[np.ix_(way, way)], B[way], C[:, way], z)
        error = np.abs(_response(slim.A, slim.B, slim.C, z) - expected).max(axis=1, initial=0.0)
        size = np.abs(expected).max(axis=1, initial=0.0)
        worst = max(worst, (error[size > 0.0] / size[size > 0.0]).max(initial=0.0))
    return worst


def _response(A: Array, B: Array, C: Array, z: complex) -> Any:
    """C (z - A)^-1 B."""
    return C @ np.linalg.solve(z * np.eye(len(A)) - A, B.astype(complex))
