"""A discrete model as a continuous one, for what continuous tools do best: shaping, root loci, models to talk about.

The poles are split. Slow ones become continuous modes and half a sampling time of delay,

    1/(z - lambda) ~ exp(-s T/2) / (sqrt(lambda) (s T - ln lambda)),

which is right in phase and too small in gain by (w T)^2/24. Fast ones, the digital filters' and delays' near zero, stay
as they are, with a Pade approximation for every z^-1: its phase is short by (w T)^3/12 for order 1, (w T)^5/720 for 2.
"""

from __future__ import annotations

import control  # type: ignore[import-untyped]
import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from ..errors import LinearisationRefusedError
from .stepping import Array

_FAST = 0.2
"""Poles closer to zero than this are taken as delays'."""


def continuous_ss(system: control.StateSpace, order: int = 2) -> control.StateSpace:
    """G(s) ~ H(exp(s T)): the continuous system whose frequency response is that of a discrete one, T its period.

    Delays become Pade approximations of `order`. With order 2 it holds within 2 % and 1 deg up to a tenth of the
    sampling rate; where all poles are fast, as from rate to measured rate, up to a fifth. Signals keep their names.

    Raises `LinearisationRefusedError` for a system that is continuous already, an order below 1, and a slow pole on
    the negative real axis, which no continuous mode has.

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
    slow, fast = _split(system)
    parts = [_modes(*slow, T, order), _delays(*fast, T, order)]
    A = linalg.block_diag(*[part[0] for part in parts])
    B = np.vstack([part[1] for part in parts])
    C = np.hstack([part[2] for part in parts])
    D = system.D + sum(part[3] for part in parts)
    return control.ss(
        A,
        B,
        C,
        D,
        0,
        name=system.name,
        inputs=system.input_labels,
        outputs=system.output_labels,
        remove_useless_states=False,
    )


Matrices = tuple[Array, Array, Array]
WithDirect = tuple[Array, Array, Array, Array]


def _split(system: control.StateSpace) -> tuple[Matrices, Matrices]:
    """A, B, C of the slow and of the fast poles, which add up to the system."""
    n = system.nstates
    if not n:
        nothing = np.zeros((0, 0)), np.zeros((0, system.ninputs)), np.zeros((system.noutputs, 0))
        return nothing, nothing
    triangle, turn, count = linalg.schur(system.A, output="real", sort=lambda x, y: np.hypot(x, y) > _FAST)
    B, C = turn.T @ system.B, system.C @ turn
    slow, fast = triangle[:count, :count], triangle[count:, count:]
    # X with slow X - X fast = -coupling makes the two independent
    X = linalg.solve_sylvester(slow, -fast, -triangle[:count, count:])
    return (slow, B[:count] - X @ B[count:], C[:, :count]), (fast, B[count:], C[:, count:] + C[:, :count] @ X)


def _modes(A: Array, B: Array, C: Array, T: float, order: int) -> WithDirect:
    """exp(-s T/2) C A^(-1/2) (s T - ln A)^-1 B, the delay ahead of the inputs."""
    poles = np.linalg.eigvals(A) if len(A) else np.zeros(0)
    beyond = [pole for pole in poles if pole.real < 0.0 and abs(pole.imag) < 1e-12]
    if beyond:
        raise LinearisationRefusedError(
            f"a pole at z = {beyond[0].real:.6g} rings at half the sampling rate; no continuous mode does that"
        )
    direct = np.zeros((C.shape[0], B.shape[1]))
    if not len(A):
        return A, B, C, direct
    a, b, c, d = _pade(0.5 * T, order, B.shape[1])
    logarithm = np.real(linalg.logm(A)) / T
    root = np.real(linalg.sqrtm(np.linalg.inv(A))) @ B / T
    size = len(logarithm)
    return (
        np.block([[logarithm, root @ c], [np.zeros((len(a), size)), a]]),
        np.vstack([root @ d, b]),
        np.hstack([C, np.zeros((C.shape[0], len(a)))]),
        direct,
    )


def _delays(A: Array, B: Array, C: Array, T: float, order: int) -> WithDirect:
    """C x with x = P(s) (A x + B u), P the Pade approximation of exp(-s T) for each state."""
    n = len(A)
    a, b, c, d = _pade(T, order, n)
    # x = c p + d (A x + B u) is solved for x
    solved = np.linalg.inv(np.eye(n) - d @ A)
    return (
        a + b @ A @ solved @ c,
        b @ (B + A @ solved @ d @ B),
        C @ solved @ c,
        C @ solved @ d @ B,
    )


def _pade(delay: float, order: int, channels: int) -> WithDirect:
    """A, B, C, D of as many equal delays side by side."""
    one = control.tf2ss(control.tf(*control.pade(delay, order)))
    each = np.eye(channels)
    return np.kron(each, one.A), np.kron(each, one.B), np.kron(each, one.C), np.kron(each, one.D)
