"""The noise of a model at a sampling time, as states, for the design of estimators.

    x[k+1] = A x[k] + B u[k] + G w[k],   y[k] = C x[k] + v[k],   cov w = QN, cov v = RN

w are the standard normals that the tasks draw in a sampling time and the errors of what rounds (uniform over a step,
variance 1/12, taken as white and independent of the signal). All noise passes the filters and is held in registers
before an output shows it, so that it is in the states. Nothing is left to v; but an estimator that believes so has
modes that do not decay, as moving averages have zeros on the unit circle and integrators poles. So RN is a floor.

Processes that step more seldom than dt (in-run bias instability, every 0.1 s) are taken at dt with the same
covariance function at their own steps; their staircase is smoothed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import control  # type: ignore[import-untyped]
import numpy as np
from scipy import linalg  # type: ignore[import-untyped]

from ..errors import LinearisationRefusedError
from .folding import Draw, Places, closure, reduced, with_inputs_before, without_sums
from .linear import (
    ClockPhase,
    Linear,
    Names,
    Where,
    check_same,
    check_stable,
    check_steady,
    linear,
    listed,
    state_space,
)
from .operating_point import start_values
from .stepping import CLOCK_TOLERANCE, Array, Compiled, Source, signal_name

_INSIDE = 1.0 - 1e-9
"""Largest eigenvalue of what has a stationary covariance."""

READING_NOISE = 1e-3
"""White noise of a reading as part of the largest deviation that a sampling time's noise makes of it: enough for
`control.dlqe`, and 0.003 % worse for a measured rate; assumption."""

_UNREST = 256
"""Sampling times, a power of two: half a second at 500 Hz."""

_MATCH = 1e-9
"""Part by which a state may miss being a sum of others."""


class ModelNoise(NamedTuple):
    """A linear model with its noise: `system` (inputs u), G, QN, the floor RN, and the names of w."""

    system: control.StateSpace
    G: Array
    QN: Array
    RN: Array
    names: list[str]

    @property
    def driven(self) -> control.StateSpace:
        """x[k+1] = A x + B u + G w: the system with w as further inputs."""
        s = self.system
        B = np.hstack([s.B, self.G])
        return control.ss(
            s.A,
            B,
            s.C,
            np.zeros((s.noutputs, B.shape[1])),
            s.dt,
            name=s.name,
            inputs=[*s.input_labels, *self.names],
            outputs=s.output_labels,
            states=s.state_labels,
            remove_useless_states=False,
        )

    def scaled(self) -> ModelNoise:
        """The same with the states x/s, s powers of two near the deviations that noise from rest gives them.

        Riccati equations, as `control.dlqe` solves them, lose fewer digits with states of like size. Noise of
        `_UNREST` sampling times counts; the gain and covariance of x are s L and s P s.
        """
        s = self.system
        A, P = s.A, self.G @ self.QN @ self.G.T
        for _ in range(_UNREST.bit_length() - 1):
            A, P = A @ A, P + A @ P @ A.T
        deviation = np.sqrt(np.diag(P))
        size = np.exp2(np.round(np.log2(np.where(deviation > 0.0, deviation, 1.0))))
        system = control.ss(
            s.A * size / size[:, None],
            s.B / size[:, None],
            s.C * size,
            s.D,
            s.dt,
            name=s.name,
            inputs=s.input_labels,
            outputs=s.output_labels,
            states=s.state_labels,
            remove_useless_states=False,
        )
        return self._replace(system=system, G=self.G / size[:, None])

    def covariance(self) -> Any:
        """C P C' with P = A P A' + G QN G': stationary covariance of the outputs, of the states that noise reaches.

        RN, which the model does not have, is not in it.

        Raises `LinearisationRefusedError` where there is none, as for an angle that the noise walks away.
        """
        s = self.system
        ways = closure(s.A != 0.0, np.any(self.G != 0.0, axis=1)) & closure(s.A.T != 0.0, np.any(s.C != 0.0, axis=0))
        A, G, C = s.A[np.ix_(ways, ways)], self.G[ways], s.C[:, ways]
        if np.abs(np.linalg.eigvals(A)).max(initial=0.0) > _INSIDE:
            raise LinearisationRefusedError(
                f"{s.name}: the noise has no stationary variance, something integrates it; choose outputs ahead of "
                "that, or close the loop first"
            )
        return C @ linalg.solve_discrete_lyapunov(A, G @ self.QN @ G.T) @ C.T

    def density(self, frequencies: Sequence[float] | Array) -> Array:
        """2 dt diag(H QN H'), H(z) = C (z - A)^-1 G: one-sided spectral density (unit^2/Hz), outputs by Hz."""
        s = self.system
        found = []
        for z in np.exp(2j * np.pi * np.asarray(frequencies) * s.dt):
            H = s.C @ np.linalg.solve(z * np.eye(s.nstates) - s.A, self.G)
            found.append(2.0 * s.dt * np.real(np.diag(H @ self.QN @ H.conj().T)))
        return np.array(found).T


def model_noise(
    model: Source,
    dt: float,
    parameters: Mapping[str, float | str] | None = None,
    *,
    operating_point: Where = None,
    inputs: Names = None,
    outputs: Names = None,
    name: str | None = None,
    clock_tolerance: float = CLOCK_TOLERANCE,
    clock_phase: ClockPhase = "mean",
    allow_unstable: bool = False,
    allow_drift: bool = False,
    reading_noise: float = READING_NOISE,
) -> ModelNoise:
    """x[k+1] = A x[k] + B u[k] + G w[k], y[k] = C x[k]: `model_ss` with the states that shape the noise.

    G, QN and RN are what `control.dlqe` and `control.create_estimator_iosystem` take. Arguments and errors are those of
    `model_ss`; noise that steps every few dt and is no sum of Markov processes is refused too. `reading_noise` makes
    RN: the deviation of a white noise on each output, as a part of the largest that the noise of one sampling time
    makes of it. Design needs outputs that are independent of each other: euler, or the quaternion, not both.

    >>> import control
    >>> noise = model_noise("AttitudeSensor_ADXRS450_ADXL355", 0.002, inputs="rate", outputs="rate_measured")
    >>> deviation = float(noise.covariance()[0, 0]) ** 0.5  # 0.015 deg/s/sqrt(Hz) in the part's 80 Hz
    >>> 0.0020 < deviation < 0.0030  # rad/s
    True
    """
    found = linear(model, dt, parameters, operating_point, inputs, outputs, clock_tolerance, clock_phase)
    slow = _slow(found)
    folded = found.folded._replace(
        A=slow.A, G=slow.G * np.sqrt([draw.variance for draw in slow.draws]), draws=slow.draws
    )
    folded = with_inputs_before(folded, found.compiled, found.inputs)
    found = found._replace(folded=folded)
    both = np.hstack([folded.B[:, found.inputs], folded.G])
    cut = reduced(folded.A, both, folded.C[found.outputs], start_values(found.point.outputs)[found.outputs])
    if outputs is None:
        found = found._replace(outputs=found.outputs[cut.outputs])
    keep = cut.states
    if not allow_drift:
        check_steady(found, keep)
    slim = without_sums(folded.A[np.ix_(keep, keep)], both[keep], folded.C[np.ix_(found.outputs, keep)])
    check_same(found, both, slim)
    system = state_space(found, keep, slim, name)
    if not allow_unstable:
        check_stable(system.name, system)
    G = slim.B[:, len(found.inputs) :]
    heard = np.flatnonzero(np.any(G != 0.0, axis=0))
    return ModelNoise(
        system,
        G[:, heard] / np.sqrt([folded.draws[i].variance for i in heard]),
        np.diag([folded.draws[i].variance for i in heard]),
        np.diag(reading_noise**2 * _largest_variance(system, G)),
        [f"noise_{signal_name(folded.draws[i].name)}" for i in heard],
    )


def _largest_variance(system: control.StateSpace, G: Array) -> Array:
    """Of each output, the largest over time that draws of variance 1 in one sampling time make; G already scaled."""
    largest, reached = np.zeros(system.noutputs), G
    for _ in range(system.nstates):
        largest = np.maximum(largest, ((system.C @ reached) ** 2).sum(axis=1))
        reached = system.A @ reached
    return largest


# --- processes that step more seldom than dt -------------------------------------------------------------------------


class _Map(NamedTuple):
    A: Array
    G: Array
    draws: list[Draw]


def _slow(found: Linear) -> _Map:
    """The fold with every slower task's processes at dt.

    Raises `LinearisationRefusedError` for other noise that such a task draws or hands on.
    """
    compiled, folded, calls = found.compiled, found.folded, found.times.calls
    rows = folded.rows
    slower = {
        number: step.jacobian()
        for number, step in enumerate(compiled.steps)
        if calls[number] != 0 and (calls[number] or Fraction(1, 2)).denominator != 1
    }
    follows = folded.A != 0.0
    moved = np.any(folded.B[:, found.inputs] != 0.0, axis=1) | np.any(folded.G != 0.0, axis=1)
    for number, jacobian in slower.items():
        places = np.searchsorted(rows, compiled.steps[number].rows)
        follows[places] |= jacobian.state[:, rows].toarray() != 0.0
        moved[places] |= np.any(jacobian.draws.toarray() != 0.0, axis=1)
    moved = closure(follows, moved)
    seen = closure(follows.T, np.any(folded.C[found.outputs] != 0.0, axis=0))
    held = (np.eye(len(rows)) == folded.A).all(axis=1) & ~folded.G.any(axis=1)
    A, G, draws = folded.A.copy(), folded.G, list(folded.draws)
    for number, jacobian in slower.items():
        places = np.searchsorted(rows, compiled.steps[number].rows)
        group = np.flatnonzero((moved & seen)[places])
        if not group.size:
            continue
        inner = places[group]
        others = np.setdiff1d(np.flatnonzero(moved), inner)
        state, drawn = jacobian.state[group][:, rows].toarray(), jacobian.draws[group].toarray()
        if state[:, others].any() or not held[inner].all():
            raise _refusal(compiled, number, "hands on what other tasks draw or round")
        process, normals = None, compiled.tasks[number].normals
        if (share := calls[number]) is not None and share.numerator == 1 and not drawn[:, normals:].any():
            process = _at(state[:, inner], drawn[:, :normals], share.denominator)
        if process is None:
            raise _refusal(compiled, number, "draws noise that is no sum of Markov processes")
        kept, a, g = process
        A[np.ix_(inner, inner)] = a
        wide = np.zeros((len(A), g.shape[1]))
        wide[inner] = g
        G = np.hstack([G, wide])
        draws += [Draw(compiled.state_names[rows[inner[i]]], number, 1.0) for i in kept]
    return _Map(A, G, draws)


def _refusal(compiled: Compiled, number: int, why: str) -> LinearisationRefusedError:
    task = compiled.tasks[number]
    period = compiled.periods[task.clock] * compiled.every[number]
    return LinearisationRefusedError(
        f"{compiled.model.name}: the task {task.name} steps every {period:.6g} s, not every dt, and {why}: choose "
        f"dt so, or set {listed(compiled.set_by(task.clock))}, or leave out the outputs that show it"
    )


def _at(A: Array, G: Array, steps: int) -> tuple[Places, Array, Array] | None:
    """x' = A x + G w every so many steps as a process of every step: its driven states, A, G; None if there is none.

    States that nothing reads are sums of the others' new values, y' = T x'.
    """
    dynamic = np.flatnonzero(np.any(A != 0.0, axis=0))
    sums = np.setdiff1d(np.arange(len(A)), dynamic)
    old, new = A[np.ix_(dynamic, dynamic)], G[dynamic]
    if np.linalg.matrix_rank(old) < len(dynamic):
        return None
    both = np.hstack([old, new])
    wanted = np.hstack([A[np.ix_(sums, dynamic)], G[sums]])
    T = np.linalg.lstsq(both.T, wanted.T, rcond=None)[0].T
    if np.abs(T @ both - wanted).max(initial=0.0) > _MATCH * np.abs(wanted).max(initial=1.0):
        return None
    F, L = np.zeros_like(old), np.zeros_like(old)
    linked = (old != 0.0) | (new @ new.T != 0.0)
    left = np.ones(len(dynamic), dtype=bool)
    while left.any():
        block = np.flatnonzero(closure(linked | linked.T, np.arange(len(dynamic)) == np.argmax(left)))
        part = _root(old[np.ix_(block, block)], new[block] @ new[block].T, steps)
        if part is None:
            return None
        F[np.ix_(block, block)], L[np.ix_(block, block)] = part
        left[block] = False
    a, g = np.zeros_like(A), np.zeros((len(A), len(dynamic)))
    a[np.ix_(dynamic, dynamic)], g[dynamic] = F, L
    a[np.ix_(sums, dynamic)], g[sums] = T @ F, T @ L
    driven = np.flatnonzero(np.any(g != 0.0, axis=0))
    return dynamic[driven], a, g[:, driven]


def _root(A: Array, Q: Array, steps: int) -> tuple[Array, Array] | None:
    """F and L with F^steps = A and sum(F^i L L' F'^i) = Q; None if there is no real, positive one."""
    F = linalg.fractional_matrix_power(A, 1.0 / steps)
    if np.iscomplexobj(F) and np.abs(F.imag).max(initial=0.0) > _MATCH:
        return None
    F = np.real(F)
    n = len(F)
    total, power = np.zeros((n * n, n * n)), np.eye(n)
    for _ in range(steps):
        total += np.kron(power, power)
        power = F @ power
    each = np.linalg.solve(total, Q.ravel()).reshape(n, n)
    values, vectors = np.linalg.eigh(0.5 * (each + each.T))
    if values.min() < -_MATCH * max(values.max(), 0.0):
        return None
    return F, vectors * np.sqrt(np.maximum(values, 0.0))
