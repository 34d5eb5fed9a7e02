"""Linear-quadratic-Gaussian control of a discrete system, and its reduction.

    x+ = A x + B u + w,   y = C x + v,   cov w = W, cov v = R
    xf = xp + M (y - C xp),   xp+ = A xf + B u,   u = -K xf

The estimate is corrected by the newest reading before it is used, so that the controller costs no sampling time.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from ..errors import LinearisationRefusedError
from .conditioning import Array, balancing, radius

_DOUBLINGS = 60
_CONVERGED = 1e-12
_GROWING = 1.0 + 1e-7
"""Magnitude above which a pole grows; a random walk has 1, to rounding."""

_NOTHING = 1e-14
"""Part of the largest Hankel singular value that is rounding."""


class Plant(NamedTuple):
    """A system with its noise: x+ = A x + B u + w, y = C x + v; z = E x is what the control is about."""

    A: Array
    B: Array
    C: Array
    E: Array
    W: Array
    R: Array


class Cost(NamedTuple):
    """Sum of (q z_high)^2 + (leak q z)^2 + (effort u)^2, z_high being z above `corner` (Hz), first order.

    `weights` q and `effort` have a number for each z and u.
    """

    corner: float
    weights: Array
    leak: float
    effort: Array


@np.errstate(over="ignore", invalid="ignore")
def riccati(A: Array, G: Array, Q: Array) -> Array:
    """X = A' X (1 + G X)^-1 A + Q, G = B R^-1 B', by doubling.

    Accurate where eigenvalues lie near the unit circle, as those of slow noise do. Source: Chu, Fan, Lin, Wang,
    "Structure-preserving algorithms for periodic discrete-time algebraic Riccati equations", Int. J. Control 77 (2004).

    Raises `LinearisationRefusedError` where there is none: the plant cannot be stabilised, or not be seen.
    """
    scale = balancing(A, np.diag(np.sqrt(np.diag(G))), np.diag(np.sqrt(np.diag(Q))))
    a, g, h = A * scale / scale[:, None], G / np.outer(scale, scale), Q * np.outer(scale, scale)
    open_loop, reached = a, g
    for _ in range(_DOUBLINGS):
        lu = linalg.lu_factor(np.eye(len(a)) + g @ h)
        across, spread = linalg.lu_solve(lu, a), linalg.lu_solve(lu, g)
        change = a.T @ h @ across
        a, g, h = a @ across, g + a @ spread @ a.T, h + change
        g, h = 0.5 * (g + g.T), 0.5 * (h + h.T)
        if not (np.isfinite(a).all() and np.isfinite(g).all() and np.isfinite(h).all()):
            break
        if linalg.norm(change) < _CONVERGED * linalg.norm(h):
            if radius(linalg.solve(np.eye(len(h)) + reached @ h, open_loop)) > _GROWING:
                break
            return np.asarray(h / np.outer(scale, scale))
    raise LinearisationRefusedError(
        "no stabilising solution: a mode that does not decay is not reached by the torques, or not seen by the readings"
    )


class Observer(NamedTuple):
    """x+ = F x + Gy y + Gu u, v = H x + J y: an estimator with feedback, before its output v is fed back as u.

    It is stable even where the controller alone is not. Gu is also the anti-windup gain: fed with what the motors
    really give, the estimator is right whatever limits that.
    """

    F: Array
    Gy: Array
    Gu: Array
    H: Array
    J: Array

    def controller(self) -> tuple[Array, Array, Array, Array]:
        """A, B, C, D from y to u = v."""
        return self.F + self.Gu @ self.H, self.Gy + self.Gu @ self.J, self.H, self.J


def regulator(plant: Plant, cost: Cost, dt: float) -> tuple[Array, Array, Array]:
    """K of u = -K (x, h), and the filter h+ = a h + b z whose state h is the low-passed z."""
    n, m = len(plant.A), len(plant.E)
    a = np.exp(-2.0 * np.pi * cost.corner * dt)
    A = np.block([[plant.A, np.zeros((n, m))], [(1.0 - a) * plant.E, a * np.eye(m)]])
    B = np.vstack([plant.B, np.zeros((m, plant.B.shape[1]))])
    q = np.diag(cost.weights)
    seen = np.vstack([np.hstack([q @ plant.E, -q]), cost.leak * np.hstack([q @ plant.E, np.zeros((m, m))])])
    R = np.diag(cost.effort**2)
    X = riccati(A, B @ np.linalg.solve(R, B.T), seen.T @ seen)
    K = np.linalg.solve(B.T @ X @ B + R, B.T @ X @ A)
    return K, a * np.eye(m), (1.0 - a) * np.eye(m)


def estimator(plant: Plant) -> tuple[Array, Array]:
    """M of the corrected estimate xf = xp + M (y - C xp), and the standard deviations of y - C xp."""
    Y = riccati(plant.A.T, plant.C.T @ np.linalg.solve(plant.R, plant.C), plant.W)
    spread = plant.C @ Y @ plant.C.T + plant.R
    return np.asarray(np.linalg.solve(spread, plant.C @ Y).T), np.asarray(np.sqrt(np.diag(spread)))


def lqg(plant: Plant, gain: tuple[Array, Array, Array], correction: Array) -> Observer:
    """The controller of a `regulator`, whose states are the first of the plant's, and an `estimator`."""
    K, a, b = gain
    n, m, k = len(plant.A), len(a), K.shape[1] - len(a)
    kept = np.eye(n) - correction @ plant.C
    feedback = np.hstack([K[:, :k], np.zeros((len(K), n - k))])
    low = b @ plant.E
    return Observer(
        np.block([[plant.A @ kept, np.zeros((n, m))], [low @ kept, a]]),
        np.vstack([plant.A @ correction, low @ correction]),
        np.vstack([plant.B, np.zeros((m, plant.B.shape[1]))]),
        -np.hstack([feedback @ kept, K[:, k:]]),
        -feedback @ correction,
    )


def truncated(observer: Observer, order: int, readings: Array, efforts: Array) -> Observer:
    """The observer with `order` states by balanced truncation, its inputs y and u in units of `readings`, `efforts`.

    Reducing the observer, not the controller, keeps what makes the loop stable: a controller may be unstable by itself.
    """
    F, Gy, Gu, H, J = observer
    G = np.hstack([Gy * readings, Gu * efforts])
    size = balancing(F, G, H)
    f, g, h = F * size / size[:, None], G / size[:, None], H * size
    reached, seen = gramian_root(f, g), gramian_root(f.T, h.T)
    U, s, V = np.linalg.svd(seen.T @ reached)
    r = min(order, int(np.sum(s > _NOTHING * s[0])))
    T, back = reached @ V[:r].T / np.sqrt(s[:r]), (seen @ U[:, :r] / np.sqrt(s[:r])).T
    return Observer(back @ f @ T, back @ (Gy / size[:, None]), back @ (Gu / size[:, None]), h @ T, J)


@np.errstate(over="ignore", invalid="ignore")
def gramian_root(A: Array, B: Array) -> Array:
    """Z with Z Z' = P = A P A' + B B', by doubling; the root itself, so that small directions keep their digits.

    Raises `LinearisationRefusedError` where A is not stable.
    """
    Z = B
    for _ in range(_DOUBLINGS):
        further, A = A @ Z, A @ A
        if not (np.isfinite(further).all() and np.isfinite(A).all()):
            break
        Z = np.asarray(np.linalg.qr(np.hstack([Z, further]).T, mode="r")).T
        if linalg.norm(further) < _CONVERGED * linalg.norm(Z):
            return np.asarray(Z)
    raise LinearisationRefusedError("an unstable system has no Gramian")
