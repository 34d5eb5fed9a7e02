"""The exact linear model of a model at a sampling time, as `control.StateSpace`.

    x[k+1] = A x[k] + B u[k],   y[k] = C x[k]

The input is held over the sampling time, as a master does; everything that happens in it, at several clocks, is one
product of the tasks' Jacobians (`folding`). What rounds lets signals pass, what limits is as it is at the operating
point. Only states that inputs reach and outputs see are kept, under their FMI names.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf
from typing import Any, Literal, NamedTuple, get_args

import control  # type: ignore[import-untyped]
import numpy as np

from ..errors import LinearisationRefusedError
from .folding import (
    SAME,
    Fold,
    Places,
    Slim,
    closure,
    difference,
    fold,
    mean_shares,
    reduced,
    regular,
    regular_calls,
    with_inputs_before,
    without_sums,
)
from .operating_point import SETTLE, STEADY, OperatingPoint, point_of, run_on, start_values
from .stepping import (
    CLOCK_TOLERANCE,
    Array,
    Compiled,
    Source,
    Timing,
    choices,
    inputs_with,
    model_called,
    named,
    parameters_with,
    signal_name,
    smallest_step,
    timing,
)

Where = OperatingPoint | Mapping[str, float] | None
"""An operating point, or the constant inputs of one; none: the model's start values."""

Names = Sequence[str] | str | None
"""Names of signals, of which a stem stands for all its scalars; none: all that take part."""

ClockPhase = Literal["mean", "tied"]
"""Of clocks that slip against each other: the mean over all phases, or all ticks of nominally one moment at one."""

_UNSTABLE = 1e-7
"""By how much an eigenvalue may lie outside the unit circle and still be an integrator's; a double one errs by 1e-8."""


class Linear(NamedTuple):
    """The map of a sampling time, cut down to chosen inputs and outputs, before states are left out."""

    compiled: Compiled
    times: Timing
    folded: Fold
    inputs: Places
    outputs: Places
    point: OperatingPoint


def linear(
    model: Source,
    dt: float,
    parameters: Mapping[str, float | str] | None,
    where: Where,
    inputs: Names,
    outputs: Names,
    clock_tolerance: float,
    clock_phase: ClockPhase = "mean",
) -> Linear:
    """Everything that linear models and noise models have in common.

    Raises `LinearisationRefusedError` as `model_ss` does.
    """
    if not dt > 0.0:
        raise LinearisationRefusedError(f"dt = {dt} s: a sampling time is positive")
    if isinstance(where, OperatingPoint):
        if parameters:
            raise LinearisationRefusedError("an operating point has its own parameters; give one or the other")
        if where.dt != dt:
            raise LinearisationRefusedError(f"the operating point is of dt = {where.dt:.15g} s, not {dt:.15g} s")
        compiled = Compiled(where.model, where.parameters, where.inputs, rounded=False)
        compiled.state[:] = start_values(where.state)
        times = timing(compiled, dt, clock_tolerance)
    else:
        called = model_called(model)
        compiled = Compiled(called, parameters_with(called, parameters), inputs_with(called, where), rounded=False)
        times = timing(compiled, dt, clock_tolerance)
        run_on(compiled, times, SETTLE / dt)
    point = point_of(compiled, dt)
    calls = regular_calls(compiled, times)
    if clock_phase not in get_args(ClockPhase):
        raise LinearisationRefusedError(f"clock_phase = {clock_phase!r}: one of {', '.join(get_args(ClockPhase))}")
    folded = fold(compiled, calls, mean_shares(compiled, times, dt, calls) if clock_phase == "mean" else None)
    edges = _Edges(compiled, times, folded, clock_tolerance)
    shown = _outputs(compiled, outputs)
    entered = _inputs(compiled, edges, inputs, shown, dt)
    return Linear(compiled, times, folded, np.array(entered, np.intp), np.array(shown, np.intp), point)


class _Edges:
    """What follows from what, in the regular tasks and in those that run less often or at odd times."""

    def __init__(self, compiled: Compiled, times: Timing, folded: Fold, tolerance: float) -> None:
        self.compiled, self.times, self.folded, self.tolerance = compiled, times, folded, tolerance
        self.often = set(regular(times))
        rows = folded.rows
        self.state, self.inputs = folded.A != 0.0, folded.B != 0.0
        self.written: dict[int, Places] = {}
        for number, step in enumerate(compiled.steps):
            calls = times.calls[number]
            if number in self.often or calls == 0:
                continue
            places = np.searchsorted(rows, step.rows)
            jacobian = step.jacobian()
            self.state[places] |= jacobian.state[:, rows].toarray() != 0.0
            self.inputs[places] |= jacobian.inputs.toarray() != 0.0
            self.written[number] = places

    def between(self, inputs: Sequence[int], outputs: Sequence[int]) -> Any:
        """Whether each state lies on a way from these inputs to these outputs."""
        start = np.any(self.inputs[:, list(inputs)], axis=1)
        end = np.any(self.folded.C[list(outputs)] != 0.0, axis=0)
        return closure(self.state, start) & closure(self.state.T, end)

    def odd(self, inputs: Sequence[int], outputs: Sequence[int]) -> list[int]:
        """The tasks on a way from these inputs to these outputs that do not run in every sampling time."""
        way = self.between(inputs, outputs)
        return [number for number, places in self.written.items() if way[places].any()]

    def refusal(self, inputs: Sequence[int], outputs: Sequence[int], dt: float) -> LinearisationRefusedError:
        """The error for inputs that act through a task at odd times, which says what to do."""
        compiled = self.compiled
        calls, names = self.times.calls, compiled.input_names
        odd = sorted(self.odd(inputs, outputs), key=lambda number: -(calls[number] or inf))
        task = compiled.tasks[odd[0]]
        period = compiled.periods[task.clock] * compiled.every[odd[0]]
        guilty = [i for i in inputs if odd[0] in self.odd([i], outputs)]
        multiple = smallest_step(self.times, self.odd(guilty, outputs))
        advice = f"choose dt = {multiple * dt:.15g} s" if multiple else self._advice(guilty, outputs, dt)
        return LinearisationRefusedError(
            f"{compiled.model.name}: at dt = {dt:.15g} s the task {task.name} runs every {period:.6g} s, no whole "
            f"number of times in dt, and is on the way of {', '.join(names[i] for i in guilty)}: {advice}, "
            "or leave them out of the inputs"
        )

    def _advice(self, inputs: Sequence[int], outputs: Sequence[int], dt: float) -> str:
        """The sampling time near dt that the slowest odd task fits, and what to set for the rest to fit it."""
        compiled, way = self.compiled, self.between(inputs, outputs)
        odd = self.odd(inputs, outputs)
        slowest = max(compiled.periods[compiled.tasks[number].clock] * compiled.every[number] for number in odd)
        better = max(round(dt / slowest), 1) * slowest
        fitting = regular(timing(compiled, better, self.tolerance))
        rows = self.folded.rows
        misfits = {
            compiled.tasks[number].clock: compiled.tasks[number].name
            for number, step in enumerate(compiled.steps)
            if way[np.searchsorted(rows, step.rows)].any() and number not in fitting and self.times.calls[number] != 0
        }
        ways = [f"choose dt = {better:.15g} s"]
        for clock, task in misfits.items():
            to_set = listed(compiled.set_by(clock))
            ways.append(f"set {to_set} so that {task} runs every {better:.15g} s or a whole part")
        first = compiled.tasks[odd[0]]
        return f"{' and '.join(ways)}; or set {listed(compiled.set_by(first.clock))} so that {first.name} fits dt"

    def pace(self, place: int, outputs: Sequence[int]) -> float:
        """Sampling times that an input's way takes to come round, 1 where everything fits dt."""
        return smallest_step(self.times, self.odd([place], outputs)) or inf


def listed(names: Sequence[str]) -> str:
    """What to set."""
    return ", ".join(names) or "the model's own constants"


def _outputs(compiled: Compiled, wanted: Names) -> list[int]:
    """Places of the outputs asked for; else of the real ones."""
    if wanted is not None:
        return named(compiled.model.Outputs, wanted, f"output of {compiled.model.name} called")
    return compiled.real_outputs


def _inputs(compiled: Compiled, edges: _Edges, wanted: Names, outputs: list[int], dt: float) -> list[int]:
    """Places of the inputs asked for; else of those that act on the outputs at the pace of dt."""
    if wanted is not None:
        chosen = named(compiled.model.Inputs, wanted, f"input of {compiled.model.name} called")
        if edges.odd(chosen, outputs):
            raise edges.refusal(chosen, outputs, dt)
        return chosen
    acting = [i for i in range(len(compiled.input_names)) if edges.between([i], outputs).any()]
    paces = [edges.pace(i, outputs) for i in acting]
    fastest = [i for i, pace in zip(acting, paces, strict=True) if pace == min(paces)]
    if fastest and min(paces) > 1:
        without = [i for i, pace in zip(acting, paces, strict=True) if pace == inf]
        raise edges.refusal(without or fastest, outputs, dt)
    return fastest


def model_ss(
    model: Source,
    dt: float,
    parameters: Mapping[str, float | str] | None = None,
    *,
    operating_point: Where = None,
    inputs: Names = None,
    outputs: Names = None,
    name: str | None = None,
    coupling_delay: int = 1,
    clock_tolerance: float = CLOCK_TOLERANCE,
    clock_phase: ClockPhase = "mean",
    allow_unstable: bool = False,
    allow_drift: bool = False,
) -> control.StateSpace:
    """x[k+1] = A x[k] + B u[k], y[k] = C x[k]: the exact linear model at the sampling time `dt` (s).

    u[k] acts from t_k to t_k+1, y[k] is read at t_k. This is one communication step of a Jacobi master, so that models
    connected with each other need no further delay. `coupling_delay` 0 is for an FMU that a Gauss-Seidel master steps
    after its sources: it has u[k+1] already, y[k] = C A x[k-1] + C B u[k]. Each one above 1 is a further z^-1 ahead of
    the inputs.

    `inputs` are by default those that act at the pace of dt (what acts through slower clocks only, as temperature, is
    left out), `outputs` the real ones that respond. States have their FMI names, signals as well, with ``_`` for a dot.
    Clocks within `clock_tolerance` of a whole ratio to dt are taken at it. Those that miss it slip against the others:
    with `clock_phase` "mean" they read the inputs at the mean over all phases, with "tied" at the one that is latest,
    so that what they read is newest. An input that is read at several phases is a state, ``rate[1].before``.

    Raises `LinearisationRefusedError` for unknown names, for clocks that do not fit dt, for an operating point that
    moves (unless `allow_drift`) or is unstable (unless `allow_unstable`), each with what to do.

    >>> sensor = model_ss("AttitudeSensor_ADXRS450_ADXL355", 0.002, inputs="rate", outputs="rate_measured")
    >>> sensor.dt, sensor.output_labels
    (0.002, ['rate_measured[1]', 'rate_measured[2]', 'rate_measured[3]'])
    """
    found = linear(model, dt, parameters, operating_point, inputs, outputs, clock_tolerance, clock_phase)
    compiled = found.compiled
    folded = with_inputs_before(found.folded, compiled, found.inputs)
    found = found._replace(folded=folded)
    B, C = folded.B[:, found.inputs], folded.C[found.outputs]
    cut = reduced(folded.A, B, C, start_values(found.point.outputs)[found.outputs])
    if (inputs is None and not found.inputs.size) or (outputs is None and not cut.outputs.size):
        raise _nothing_acts(found)
    if outputs is None:
        found = found._replace(outputs=found.outputs[cut.outputs])
    if not allow_drift:
        check_steady(found, cut.states)
    keep = cut.states
    slim = without_sums(folded.A[np.ix_(keep, keep)], B[keep], folded.C[np.ix_(found.outputs, keep)])
    check_same(found, B, slim)
    system = state_space(found, keep, slim, name)
    if not allow_unstable:
        check_stable(compiled.model.name, system)
    return delayed(system, coupling_delay)


def state_space(found: Linear, keep: Places, slim: Slim, name: str | None) -> control.StateSpace:
    """The system of the chosen inputs, the first of those of `slim`, and outputs; `keep` are its states' places."""
    folded, compiled = found.folded, found.compiled
    m = len(found.inputs)
    return control.ss(
        slim.A,
        slim.B[:, :m],
        slim.C,
        np.zeros((len(slim.C), m)),
        found.point.dt,
        name=name or compiled.model.name,
        inputs=[signal_name(compiled.input_names[i]) for i in found.inputs],
        outputs=[signal_name(compiled.output_names[i]) for i in found.outputs],
        states=[compiled.state_name(folded.rows[i]) for i in keep[slim.states]],
        remove_useless_states=False,
    )


def _nothing_acts(found: Linear) -> LinearisationRefusedError:
    """The error for a system that would be empty, which names what chooses between ways through the model."""
    model, names = found.compiled.model, found.compiled.input_names
    idle = [names[i] for i in found.inputs] if found.inputs.size else names
    chosen = [
        f"{what} {'; '.join(found_choices)}"
        for what, record in (("the parameter", model.Parameters), ("the input", model.Inputs))
        if (found_choices := choices(record))
    ]
    advice = f": set {', or '.join(chosen)}, or" if chosen else ":"
    return LinearisationRefusedError(
        f"{model.name}: at this operating point {', '.join(idle) or 'no input'} acts on none of the outputs{advice} "
        "choose inputs (operating_point) at which it does, away from limits"
    )


def check_steady(found: Linear, states: Places) -> None:
    """Raise `LinearisationRefusedError` where one of the states does not stay where it is."""
    folded, compiled = found.folded, found.compiled
    change = (folded.after - folded.before)[states]
    relative = np.abs(change) / np.maximum(1.0, np.abs(folded.before[states]))
    if relative.max(initial=0.0) > STEADY:
        worst = int(np.argmax(relative))
        label = compiled.state_name(folded.rows[states[worst]])
        raise LinearisationRefusedError(
            f"{compiled.model.name}: the operating point moves: state.{label} = {folded.before[states[worst]]:.6g} "
            f"changes by {change[worst]:.3g} in dt; choose inputs that hold it (operating_point with `hold`), a longer "
            "`settle`, or allow it (allow_drift=True)"
        )


def check_same(found: Linear, B: Array, slim: Slim) -> None:
    """Raise `LinearisationRefusedError` where leaving states out has changed the response."""
    folded = found.folded
    error = difference(folded.A, B, folded.C[found.outputs], slim)
    if not error < SAME:
        raise LinearisationRefusedError(
            f"{found.compiled.model.name}: leaving out idle states changes the frequency response by {error:.2g} of "
            f"its largest (allowed: {SAME:.2g}); its numbers differ too much in size: choose fewer inputs and outputs"
        )


def check_stable(name: str, system: control.StateSpace) -> None:
    """Raise `LinearisationRefusedError` for a mode that grows faster than an integrator's."""
    poles = np.linalg.eigvals(system.A) if system.nstates else np.zeros(1)
    worst = poles[np.argmax(np.abs(poles))]
    if abs(worst) > 1.0 + _UNSTABLE:
        growth = np.log(abs(worst)) / system.dt
        raise LinearisationRefusedError(
            f"{name}: the operating point is unstable: eigenvalue {worst:.9g}, a deviation grows e-fold in "
            f"{1.0 / growth:.3g} s; choose another one, or allow it (allow_unstable=True) and stabilise it by feedback"
        )


def delayed(system: control.StateSpace, coupling_delay: int) -> control.StateSpace:
    """The system with 0, 1 (as it is) or more communication steps from input to output."""
    if coupling_delay < 0:
        raise LinearisationRefusedError(f"coupling_delay = {coupling_delay}: 0 (Gauss-Seidel), 1 (Jacobi) or more")
    labels = {
        "name": system.name,
        "inputs": system.input_labels,
        "outputs": system.output_labels,
        "remove_useless_states": False,
    }
    A, B, C, n, m = system.A, system.B, system.C, system.nstates, system.ninputs
    if coupling_delay == 0:
        return control.ss(A, B, C @ A, C @ B, system.dt, states=system.state_labels, **labels)
    for step in range(1, coupling_delay):
        A = np.block([[A, B], [np.zeros((m, n + m))]])
        B = np.vstack([np.zeros((n, m)), np.eye(m)])
        C = np.hstack([C, np.zeros((system.noutputs, m))])
        n += m
        before = [f"{label}.before[{coupling_delay - step}]" for label in system.input_labels]
        labels["states"] = [*labels.get("states", system.state_labels), *before]
    return control.ss(A, B, C, np.zeros((system.noutputs, m)), system.dt, **{"states": system.state_labels, **labels})
