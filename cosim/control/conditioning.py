"""What a controller's state does when its output is not what it asked for: gains for anti-windup and switching on.

Both are for x+ = A x + B u, v = C x + D u, of which y is given.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from ..errors import ExportRefusedError

Array = np.ndarray[Any, np.dtype[np.float64]]

_SLOWEST = 1.0 - 1e-6
"""Largest magnitude of a mode that counts as decaying."""

_DOUBT = 0.1
"""Part of an output that is taken as no consequence of the inputs, where without any there is no gain; assumption."""

_SEEN = 1e-6
"""Part of the best seen direction's energy in the outputs below which one is left alone; assumption."""

_HORIZON = 1000.0
"""Samples over which an output set on enabling should last; assumption."""


def radius(A: Array) -> float:
    """Largest magnitude of the eigenvalues."""
    return float(np.abs(linalg.eigvals(A)).max(initial=0.0))


def balancing(A: Array, B: Array, C: Array) -> Array:
    """Powers of two s such that the states x / s make rows and columns of A, B and C alike in size."""
    n, m, p = len(A), B.shape[1], len(C)
    whole = np.zeros((n + m + p, n + m + p))
    whole[:n, :n], whole[:n, n : n + m], whole[n + m :, :n] = A, B, C
    _, (scale, _) = linalg.matrix_balance(whole, permute=False, separate=True)
    return np.asarray(scale[:n])


def _innovation_gains(A: Array, B: Array, C: Array, D: Array) -> Iterator[Array]:
    """Kalman gains, with white noise at the inputs and ever more doubt, until one stands."""
    size = np.zeros(len(C))  # squares of the outputs' responses to pulses
    response, state = D, B
    for _ in range(len(A) + 1):
        size += (response**2).sum(axis=1)
        response, state = C @ state, A @ state
    size[size == 0.0] = 1.0
    for doubt, unrest in ((0.0, 0.0), (_DOUBT, 0.0), (_DOUBT, _DOUBT)):
        Q = B @ B.T + unrest**2 * np.eye(len(A)) * max(np.abs(B).max(), 1.0) ** 2
        R, S = D @ D.T + doubt**2 * np.diag(size), B @ D.T
        if np.linalg.cond(R) > 1e12:
            continue
        try:
            P = linalg.solve_discrete_are(A.T, C.T, Q, R, s=S)
            yield np.asarray(linalg.solve(C @ P @ C.T + R, (A @ P @ C.T + S).T, assume_a="pos").T)
        except (linalg.LinAlgError, ValueError):
            continue


def anti_windup_gain(A: Array, B: Array, C: Array, D: Array) -> Array:
    """L of x+ = A x + B u + L (y - v), with A - L C stable; n x p.

    B D^-1 where that is stable: the state goes on as if the input had been the one that makes v = y (Hanus,
    Kinnaert, Henrotte, Automatica 23(6), 1987). Otherwise the gain of the Kalman filter that sees v alone, with white
    noise of one intensity at all inputs: the same, but with zeros outside the unit circle mirrored into it.

    Raises `ExportRefusedError` if a mode that does not decay is not seen in the outputs.

    >>> one = np.eye(1)
    >>> anti_windup_gain(one, one, 0.05 * one, 2.0 * one)  # a PI controller
    array([[0.5]])
    """
    n, p = len(A), len(C)
    if n == 0:
        return np.zeros((0, p))
    scale = balancing(A, B, C)
    a, b, c = A * scale / scale[:, None], B / scale[:, None], C * scale
    if D.shape == (p, p) and np.linalg.cond(D) < 1e9:
        L = np.linalg.solve(D.T, b.T).T
        if radius(a - L @ c) < _SLOWEST:
            return scale[:, None] * L
    for L in _innovation_gains(a, b, c, D):
        if np.isfinite(L).all() and radius(a - L @ c) < _SLOWEST:
            return scale[:, None] * L
    raise ExportRefusedError(
        "no anti-windup gain makes the limited controller stable: a mode that does not decay is not seen in the "
        "outputs; remove it (ct.minreal), or give anti_windup='none' or a matrix"
    )


def bumpless_gain(A: Array, C: Array) -> Array:
    """M of x <- x + M d, which moves the output by d at once and keeps it there as well as the state can; n x p.

    Of all M with C M = 1 the one whose free response differs least from d in the sum of squares over the next
    thousand samples, discounted; an integrator takes all of d upon itself, a fast lag nothing.

    >>> bumpless_gain(np.eye(1), np.array([[0.05]]))
    array([[20.]])
    """
    if len(A) == 0:
        return np.zeros((0, len(C)))
    scale = balancing(A, np.zeros((len(A), 0)), C)
    a, c = A * scale / scale[:, None], C * scale
    direct, free = np.linalg.pinv(c), linalg.null_space(c)
    discount = min(1.0 - 1.0 / _HORIZON, 0.99 / max(radius(a), 1e-3) ** 2)
    faded = np.sqrt(discount) * a.T
    H = linalg.solve_discrete_lyapunov(faded, faded @ c.T @ c @ faded.T)
    G = np.linalg.solve(np.eye(len(a)) - discount * a.T, discount * a.T @ c.T)
    moved = direct + free @ np.linalg.pinv(free.T @ H @ free, rcond=_SEEN, hermitian=True) @ free.T @ (G - H @ direct)
    moved += direct @ (c @ direct - c @ moved)  # what rounding left over
    return np.asarray(scale[:, None] * moved)
