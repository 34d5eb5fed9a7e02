"""Linear systems of python-control as discrete state spaces."""

from __future__ import annotations

import math
from typing import Any

import control  # type: ignore[import-untyped]
import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from attitude_fmu.models.system import SHORTEST_PERIOD

from ..errors import ExportRefusedError
from .conditioning import Array, balancing, radius

_SAME_PERIOD = 1e-9
"""Part by which two sampling times may differ and still be one."""


def discrete_state_space(sys: Any, dt: float | None, method: str, prewarp_frequency: float | None) -> Any:
    """The system as a discrete ``control.StateSpace`` under the same labels, a continuous one sampled.

    A state space keeps its states. A transfer function gets those of observer form, row by row over the row's common
    denominator, scaled by powers of two, which leaves every response the same to the last bit.

    Raises `ExportRefusedError`.

    >>> discrete_state_space(control.tf([1], [1, -1], 0.01), None, "tustin", None).A
    array([[1.]])
    """
    if not isinstance(sys, control.StateSpace | control.TransferFunction):
        raise ExportRefusedError(
            f"a {type(sys).__name__} is no linear system with states; give a control.StateSpace or TransferFunction "
            "(control.linearize makes one of a nonlinear system)"
        )
    system = _realised(sys) if isinstance(sys, control.TransferFunction) else sys
    matrices = (system.A, system.B, system.C, system.D)
    for name, matrix in zip("ABCD", matrices, strict=True):
        if not (np.isrealobj(matrix) and np.isfinite(matrix).all()):
            raise ExportRefusedError(f"the matrix {name} has entries that are no finite real numbers")
    period = _period(sys, system.nstates, dt)
    if sys.dt != 0:
        return control.ss(*matrices, period, **_labels(system))
    return _sampled(system, period, method, prewarp_frequency)


def _labels(system: Any) -> dict[str, Any]:
    return {"inputs": system.input_labels, "outputs": system.output_labels, "states": system.state_labels}


def _period(sys: Any, states: int, dt: float | None) -> float:
    own = sys.dt
    if dt is None and (own is None or own is True):
        raise ExportRefusedError("the system has no sampling time: give dt=, in s")
    if dt is None and own == 0:
        raise ExportRefusedError(
            "the system is continuous: give dt=, in s, and method= if not 'tustin'; or sample it first "
            "(control.sample_system)"
        )
    if own is None and states:
        raise ExportRefusedError(
            "the system's timebase is unspecified (dt=None): make it with dt=0 if it is continuous, with its sampling "
            "time if it is discrete"
        )
    is_timed = bool(own) and own is not True
    if dt is not None and is_timed and not math.isclose(dt, own, rel_tol=_SAME_PERIOD):
        raise ExportRefusedError(
            f"dt = {dt:.9g} s, but the system's sampling time is {own:.9g} s; leave dt out, or give the continuous "
            "system to sample anew"
        )
    period = float(own) if dt is None else dt
    if not SHORTEST_PERIOD <= period < math.inf:
        raise ExportRefusedError(f"dt = {period:.9g} s: too short (allowed: {SHORTEST_PERIOD:.9g} s or more)")
    return period


def _sampled(system: Any, dt: float, method: str, prewarp_frequency: float | None) -> Any:
    try:
        with np.errstate(all="ignore"):
            sampled = control.sample_system(system, dt, method, prewarp_frequency=prewarp_frequency)
    except (ValueError, TypeError, linalg.LinAlgError, np.linalg.LinAlgError) as error:
        raise ExportRefusedError(f"the system cannot be sampled by {method!r} at dt = {dt:.9g} s: {error}") from None
    if not all(np.isfinite(matrix).all() for matrix in (sampled.A, sampled.B, sampled.C, sampled.D)):
        raise ExportRefusedError(
            f"sampling by {method!r} at dt = {dt:.9g} s leaves the range of numbers; choose another dt or method"
        )
    was_stable = system.nstates == 0 or float(np.linalg.eigvals(system.A).real.max()) < 0.0
    if was_stable and radius(np.asarray(sampled.A)) >= 1.0:
        raise ExportRefusedError(
            f"the system is stable, sampled by {method!r} at dt = {dt:.9g} s it is not; choose 'tustin' or 'zoh', or "
            "a shorter dt"
        )
    return control.ss(sampled.A, sampled.B, sampled.C, sampled.D, dt, **_labels(system))


def _realised(sys: Any) -> Any:
    """A transfer function in observer form, balanced."""
    rows = [_row(sys, i) for i in range(sys.noutputs)]
    A, C = (linalg.block_diag(*(row[part] for row in rows)) for part in (0, 2))
    B, D = (np.vstack([row[part] for row in rows]) for part in (1, 3))
    scale = balancing(A, B, C)
    labels = {"inputs": sys.input_labels, "outputs": sys.output_labels}
    return control.ss(A * scale / scale[:, None], B / scale[:, None], C * scale, D, sys.dt, **labels)


def _polynomials(sys: Any, i: int, j: int) -> tuple[Array, Array]:
    """Numerator and denominator of one element, the denominator's first coefficient being 1."""
    numerator, denominator = (np.atleast_1d(part[i][j]) for part in (sys.num, sys.den))
    if not (np.isrealobj(numerator) and np.isrealobj(denominator)):
        raise ExportRefusedError("the transfer function has coefficients that are no real numbers")
    if not (np.isfinite(numerator).all() and np.isfinite(denominator).all()):
        raise ExportRefusedError("the transfer function has coefficients that are no finite numbers")
    numerator, denominator = (np.trim_zeros(part, "f") for part in (numerator, denominator))
    if len(numerator) > len(denominator):
        where = f"from {sys.input_labels[j]} to {sys.output_labels[i]}"
        raise ExportRefusedError(
            f"the transfer function {where} is improper (numerator of degree {len(numerator) - 1}, denominator of "
            f"degree {len(denominator) - 1}): it would need inputs to come; add a filter pole, or a delay"
        )
    return numerator / denominator[0], denominator / denominator[0]


def _row(sys: Any, i: int) -> tuple[Array, Array, Array, Array]:
    """All elements of one output over their common denominator: x1 is the output without D u."""
    elements = [_polynomials(sys, i, j) for j in range(sys.ninputs)]
    different: list[Array] = []
    for _, denominator in elements:
        if not any(np.array_equal(denominator, other) for other in different):
            different.append(denominator)
    common = np.array([1.0])
    for denominator in different:
        common = np.polymul(common, denominator)
    n = len(common) - 1
    B, D = np.zeros((n, sys.ninputs)), np.zeros((1, sys.ninputs))
    for j, (numerator, denominator) in enumerate(elements):
        whole = numerator
        for other in different:
            if not np.array_equal(denominator, other):
                whole = np.asarray(np.polymul(whole, other), float)
        whole = np.concatenate([np.zeros(n + 1 - len(whole)), whole])
        D[0, j], B[:, j] = whole[0], whole[1:] - common[1:] * whole[0]
    A = np.eye(n, k=1)
    A[:, :1] = -common[1:, None]
    return A, B, np.eye(1, n), D
