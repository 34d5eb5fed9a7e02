"""Where a model is linearised: its state after a while at constant inputs, without noise.

    x* = F(x*, u*),   F: one sampling time, every task in it, noise zero, signals passing where they are rounded

The model runs from its initial state, so that whatever it does at the start (an alignment) has been done; Newton's
method with the exact Jacobian of F then removes what slow modes have left.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil
from typing import Any, NamedTuple

import numpy as np

from attitude_fmu.models.errors import digits
from attitude_fmu.models.record import flatten, unflatten
from attitude_fmu.models.system import Model

from ..errors import LinearisationRefusedError
from .folding import Fold, Places, fold, reduced, regular_calls
from .stepping import (
    CLOCK_TOLERANCE,
    Array,
    Compiled,
    Source,
    Timing,
    calls_within,
    inputs_with,
    model_called,
    named,
    parameters_with,
    period_of,
    timing,
)

SETTLE = 20.0
"""s that a model runs before it is linearised: the sensor's alignment takes 2 s, its gains settle within 20 s."""

STEADY = 1e-9
"""Largest change in a sampling time, relative to the value (at least to 1), of a state that is steady."""

_NEWTON_STEPS = 30
_EXACT = 1e-15
_CHEAP = 1e3
"""How much rather a free input changes than a state, where both would do."""


class OperatingPoint(NamedTuple):
    """Parameters, inputs, state and outputs (records of the model) where it stays, and the sampling time."""

    model: Model
    parameters: Any
    inputs: Any
    state: Any
    outputs: Any
    dt: float


def operating_point(
    model: Source,
    dt: float,
    parameters: Mapping[str, float | str] | None = None,
    inputs: Mapping[str, float] | None = None,
    *,
    hold: Mapping[str, float] | None = None,
    free: Sequence[str] | str = (),
    settle: float = SETTLE,
    clock_tolerance: float = CLOCK_TOLERANCE,
) -> OperatingPoint:
    """x* = F(x*, u*): the state that the model comes to at constant `inputs`, without noise.

    `inputs` are those that differ from the model's start values, ``{"rate[3]": 0.1}``; a stem sets all its scalars.
    `settle` is the time (s) that the model runs before Newton's method. With `hold`, values of outputs, each
    task runs once only: sought are the state and the inputs named in `free` that keep these outputs there.

    Raises `LinearisationRefusedError` for unknown names, for a state that is no finite number, and for outputs that
    the free inputs cannot hold.

    >>> point = operating_point("AttitudeSensor_ADXRS450_ADXL355", 0.002)
    >>> bool(point.outputs.aligned)
    True
    >>> point = operating_point("TripodGimbal", 0.001, hold={"joint": 0.0}, free="motor_torque")
    >>> abs(point.inputs.motor_torque.pitch) > 1e-3  # N.m, against wind and imbalance
    True
    """
    called = model_called(model)
    values = parameters_with(called, parameters)
    compiled = Compiled(called, values, inputs_with(called, inputs), rounded=False)
    times = timing(compiled, dt, clock_tolerance)
    if hold is None:
        run_on(compiled, times, settle / dt)
    else:
        _hold(compiled, times, hold, free)
    return point_of(compiled, dt)


def point_of(compiled: Compiled, dt: float) -> OperatingPoint:
    """Where a compiled model stands."""
    compiled.show.run()
    model = compiled.model
    return OperatingPoint(
        model,
        compiled.parameters,
        unflatten(model.Inputs, compiled.inputs.tolist()),
        unflatten(model.State, compiled.state.tolist()),
        unflatten(model.Outputs, compiled.shown.tolist()),
        dt,
    )


def run_on(compiled: Compiled, times: Timing, steps: float) -> None:
    """Run at least so many sampling times, and then to where it stays.

    Raises `LinearisationRefusedError` for a state that is no finite number.
    """
    _run(compiled, times, steps)
    wrong = np.flatnonzero(~np.isfinite(compiled.state))
    if wrong.size:
        raise LinearisationRefusedError(
            f"{compiled.model.name}: no operating point: state.{compiled.state_names[wrong[0]]} = "
            f"{digits(compiled.state[wrong[0]])}; look for inputs or parameters far from what the model is made for"
        )
    _newton(compiled, times, _NOTHING)


def _run(compiled: Compiled, times: Timing, steps: float) -> None:
    whole = period_of(times)
    for number in calls_within(compiled, times, max(ceil(steps / whole), 1) * whole):
        compiled.steps[number].run()


def _hold(compiled: Compiled, times: Timing, hold: Mapping[str, float], free: Sequence[str] | str) -> None:
    sought = _sought(compiled.model, hold, free)
    # what is drawn at the start only has been drawn once every task has run; the rest begins where it was
    start = compiled.state.copy()
    _run(compiled, times, 1.0)
    folded = fold(compiled, regular_calls(compiled, times))
    way = folded.rows[_between(folded, compiled)]
    compiled.state[:] = folded.start
    compiled.state[way] = start[way]
    left = _newton(compiled, times, sought)
    if not left < STEADY:
        raise LinearisationRefusedError(
            f"{compiled.model.name}: {', '.join(hold)} cannot be held by {', '.join(sought.names) or 'no free input'}: "
            f"{left:.3g} is left; free more inputs, or hold what they reach"
        )


class _Sought(NamedTuple):
    """Places of the inputs that are free, of the outputs that are held, and their values."""

    free: Places
    held: Places
    values: Array
    names: Sequence[str]


_NOTHING = _Sought(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0), ())


def _sought(model: Model, hold: Mapping[str, float], free: Sequence[str] | str) -> _Sought:
    held: list[int] = []
    values: list[float] = []
    for name, value in hold.items():
        places = named(model.Outputs, name, f"output of {model.name} called")
        held += places
        values += [value] * len(places)
    names = [free] if isinstance(free, str) else list(free)
    places = named(model.Inputs, names, f"input of {model.name} called")
    return _Sought(np.array(places, np.intp), np.array(held, np.intp), np.array(values), names)


def _between(folded: Fold, compiled: Compiled) -> Places:
    """The states between the inputs and the real outputs."""
    shown = compiled.real_outputs
    return reduced(folded.A, folded.B, folded.C[shown], compiled.shown[shown]).states


def _newton(compiled: Compiled, times: Timing, sought: _Sought) -> float:
    """Newton's method on the states between inputs and outputs, as far as it helps; what is left of the residual."""
    calls = regular_calls(compiled, times)
    best, kept = np.inf, (compiled.state.copy(), compiled.inputs.copy())
    for _ in range(_NEWTON_STEPS):
        begun = compiled.state.copy(), compiled.inputs.copy()
        compiled.show.run()
        missing = sought.values - compiled.shown[sought.held]
        folded = fold(compiled, calls)
        drift = folded.after - folded.before
        seen = _between(folded, compiled)
        left = max(
            np.abs(drift[seen] / np.maximum(1.0, np.abs(folded.before[seen]))).max(initial=0.0),
            np.abs(missing).max(initial=0.0),
        )
        if not left < 0.9 * best:
            break
        best, kept = left, begun
        if left < _EXACT:
            break
        C = folded.C[sought.held][:, seen]
        equations = np.block(
            [
                [np.eye(len(seen)) - folded.A[np.ix_(seen, seen)], -_CHEAP * folded.B[np.ix_(seen, sought.free)]],
                [C, np.zeros((len(sought.held), len(sought.free)))],
            ]
        )
        solution = np.linalg.lstsq(equations, np.concatenate([drift[seen], missing]), rcond=1e-14)[0]
        compiled.state[:] = begun[0]
        compiled.state[folded.rows[seen]] += solution[: len(seen)]
        compiled.inputs[sought.free] += _CHEAP * solution[len(seen) :]
    compiled.state[:], compiled.inputs[:] = kept
    return float(best)


def start_values(record: Any) -> Array:
    """The scalars of a record as an array."""
    return np.array(flatten(record), dtype=float)
