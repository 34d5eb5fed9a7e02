"""A discrete model as a continuous one, for what continuous tools do best: shaping, root loci, models to talk about.

States that act on each other in a circle belong together; one such group acts on the next. Within a group the poles are
split. Slow ones become continuous modes and a part of a sampling time of delay, with a = -ln lambda,

    1/(z - lambda) ~ exp(-s T d) (1 + a d) / (s T + a),   d = 1/(1 - lambda) - 1/a,   1/2 where lambda is 1,

which is right in gain at rest and in phase to first order, and too large in gain by less than (w T)^2/24. Fast and
ringing ones, the digital filters' and delays', stay as they are, with a Pade approximation for every z^-1: its phase is
short by (w T)^3/12 for order 1, (w T)^5/720 for 2.
"""

from __future__ import annotations

import warnings
from typing import NamedTuple

import control  # type: ignore[import-untyped]
import numpy as np
from scipy import linalg  # type: ignore[import-untyped]
from scipy.sparse import csgraph, csr_matrix  # type: ignore[import-untyped]
from scipy.special import zeta  # type: ignore[import-untyped]

from ..errors import LinearisationRefusedError
from .stepping import Array

_BETWEEN = (0.3, 0.9)
"""Where in magnitude the slow poles begin: in the widest gap; nearer ones would make large parts that cancel."""

_CHECKS = ((0.002, 0.01, 1), (0.01, 0.01, 1), (0.05, 0.1, 2))
"""Where the answer is compared: part of the sampling rate, part of an output's gain that it may miss there, and from
which order on. More than is left of 60 delays and of 20 poles in a row; assumption."""


class _Matrices(NamedTuple):
    A: Array
    B: Array
    C: Array
    D: Array


def continuous_ss(system: control.StateSpace, order: int = 2) -> control.StateSpace:
    """G(s) ~ H(exp(s T)): the continuous system whose frequency response is that of a discrete one, T its period.

    Delays become Pade approximations of `order`. With order 2 it holds within 2 % and 1 deg up to a tenth of the
    sampling rate for each slow pole in a row; where all poles are fast, as from rate to measured rate, up to a fifth.
    Signals keep their names.

    Raises `LinearisationRefusedError` for a system that is continuous already, an order below 1, a pole at -1 with an
    odd order, and a system whose poles rounding hides, so that the answer would be wrong.

    >>> import control
    >>> late = control.ss(control.tf([1.0], [1.0, 0.0, 0.0], 0.01))  # two samples
    >>> near = continuous_ss(late)
    >>> bool(abs(near(10j) - late(control.timeresp.np.exp(0.1j))) < 1e-5)
    True
    """
    T = system.dt
    if not system.isdtime(strict=True) or T is True:
        raise LinearisationRefusedError("continuous_ss wants a discrete system with a sampling time")
    if order < 1:
        raise LinearisationRefusedError(f"order = {order}: a Pade approximation begins at 1")
    _, group = csgraph.connected_components(csr_matrix(system.A), directed=True, connection="strong")
    places = [np.flatnonzero(group == number) for number in np.unique(group)]
    parts = [_resolvent(system.A[np.ix_(inner, inner)], T, order) for inner in places]
    inner = np.concatenate([*places, np.zeros(0, np.intp)])
    a, b, c, d = (linalg.block_diag(*[part[i] for part in parts]) if parts else np.zeros((0, 0)) for i in range(4))
    A, B, C = system.A[np.ix_(inner, inner)], system.B[inner], system.C[:, inner]
    # x = c p + d (others x + B u) is solved for x; there is no circle in it
    others = np.where(group[inner][:, None] == group[inner], 0.0, A)
    solved = np.linalg.inv(np.eye(len(A)) - d @ others)
    answer = control.ss(
        a + b @ others @ solved @ c,
        b @ (B + others @ solved @ d @ B),
        C @ solved @ c,
        system.D + C @ solved @ d @ B,
        0,
        name=system.name,
        inputs=system.input_labels,
        outputs=system.output_labels,
        remove_useless_states=False,
    )
    _check(system, answer, order)
    return answer


def _check(system: control.StateSpace, answer: control.StateSpace, order: int) -> None:
    """Raise `LinearisationRefusedError` where the answer is another system."""
    for part, allowed, least in _CHECKS:
        x = 2.0 * np.pi * part
        expected = system(np.exp(1j * x), squeeze=False, warn_infinite=False)
        error = np.abs(answer(1j * x / system.dt, squeeze=False, warn_infinite=False) - expected)
        size = np.maximum(np.abs(expected).max(axis=1, initial=0.0), 1e-300)
        missed = np.nan_to_num(error.max(axis=1, initial=0.0) / size, nan=np.inf)
        if order >= least and missed.max(initial=0.0) > allowed:
            raise LinearisationRefusedError(
                f"{system.name}: the continuous form of {system.output_labels[int(np.argmax(missed))]} misses "
                f"{missed.max():.2g} of its gain at {part / system.dt:.3g} Hz (allowed: {allowed:.2g}): rounding hides "
                f"the poles of {system.nstates} states, or they lie too close together to be told apart; give the "
                "system as parts in a row (control.series), or with fewer states (control.minreal)"
            )


def _resolvent(A: Array, T: float, order: int) -> _Matrices:
    """(z - A)^-1 as a continuous system."""
    slow, fast, turn = _split(A)
    count = len(slow)
    parts = (_modes(slow, T, order), _delays(fast, T, order))
    a, b, c, d = (linalg.block_diag(*[part[i] for part in parts]) for i in range(4))
    back = np.linalg.inv(turn)
    return _Matrices(a, b @ back, turn @ c, turn @ d @ back) if 0 < count < len(A) else parts[0 if count else 1]


def _split(A: Array) -> tuple[Array, Array, Array]:
    """Slow and fast with A = turn diag(slow, fast) turn^-1."""
    n, sizes = len(A), np.abs(np.linalg.eigvals(A))
    low, high = _BETWEEN
    edges = np.sort([low, high, *sizes[(sizes > low) & (sizes < high)]])
    widest = int(np.argmax(np.diff(edges)))
    limit = 0.5 * (edges[widest] + edges[widest + 1])
    triangle, turn, count = linalg.schur(A, output="real", sort=lambda x, y: x > 0.0 and np.hypot(x, y) > limit)
    if count in (0, n):
        return (A, A[:0, :0], np.eye(n)) if count else (A[:0, :0], A, np.eye(n))
    slow, fast = triangle[:count, :count], triangle[count:, count:]
    # X with slow X - X fast = -coupling makes the two independent
    X = linalg.solve_sylvester(slow, -fast, -triangle[:count, count:])
    apart = np.block([[np.eye(count), X], [np.zeros((n - count, count)), np.eye(n - count)]])
    return slow, fast, turn @ apart


_TERMS = 40


def _modes(A: Array, T: float, order: int) -> _Matrices:
    """exp(-s T d) (s T + a)^-1 (1 + a d), a = -ln A, d = 1/2 + sum of B_2k a^(2k-1)/(2k)!, the delay ahead."""
    n = len(A)
    if not n:
        return _Matrices(A, A, A, A)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the answer is looked at
        a = -np.real(linalg.logm(A))
    # Bernoulli's numbers fall like (2 pi)^-2k; slow poles have a magnitude of a below 3.2
    delay, power = 0.5 * np.eye(n), a
    for k in range(1, _TERMS):
        delay = delay - 2.0 * (-1.0) ** k * zeta(2 * k) / (2.0 * np.pi) ** (2 * k) * power
        power = power @ a @ a
    P = _pade(T * delay, order)
    gain = (np.eye(n) + a @ delay) / T
    return _Matrices(
        np.block([[-a / T, gain @ P.C], [np.zeros((len(P.A), n)), P.A]]),
        np.vstack([gain @ P.D, P.B]),
        np.hstack([np.eye(n), np.zeros((n, len(P.A)))]),
        np.zeros((n, n)),
    )


def _delays(A: Array, T: float, order: int) -> _Matrices:
    """x with x = P(s) (A x + u), P the Pade approximation of exp(-s T) for each state."""
    n = len(A)
    a, b, c, d = _pade(T * np.eye(n), order)
    # x = c p + d (A x + u) is solved for x
    loop = np.eye(n) - d @ A
    if n and np.linalg.cond(loop) > 1e9:
        raise LinearisationRefusedError(
            f"a pole at z = -1 has no Pade approximation of order {order}: take an even order, or damp what rings at "
            "half the sampling rate"
        )
    solved = np.linalg.inv(loop)
    return _Matrices(a + b @ A @ solved @ c, b + b @ A @ solved @ d, solved @ c, solved @ d)


def _pade(delay: Array, order: int) -> _Matrices:
    """exp(-s delay), the delay a matrix."""
    n = len(delay)
    one = control.tf2ss(control.tf(*control.pade(1.0, order)))
    pace, each = np.linalg.inv(delay) if n else delay, np.eye(n)
    return _Matrices(np.kron(pace, one.A), np.kron(pace, one.B), np.kron(each, one.C), np.kron(each, one.D))
