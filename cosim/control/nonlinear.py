"""A whole model as `control.NonlinearIOSystem`, with its noise as inputs.

    x[k+1] = f(t_k, x[k], u[k], w[k]),   y[k] = h(x[k])

f is one sampling time of the model, with limits and quantisers; w are the standard normals that its tasks draw in it.
So both functions are pure, and noise is what the caller makes it: zero, `control.white_noise`, a recording.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from math import ceil
from typing import Any, NamedTuple

import control  # type: ignore[import-untyped]
import numpy as np

from attitude_fmu.models.system import STOPPED, TIME_TOLERANCE

from ..errors import LinearisationRefusedError
from .folding import fold
from .operating_point import OperatingPoint, start_values
from .stepping import (
    Array,
    Compiled,
    Source,
    inputs_with,
    model_called,
    named,
    parameters_with,
    signal_name,
)


class _Noise(NamedTuple):
    """Where in the inputs the normals of a task begin, how many a call takes, and how many calls there may be."""

    first: int
    draws: int
    calls: int


class ModelSystem(control.NonlinearIOSystem):  # type: ignore[misc]
    """A model as a discrete-time system; made by `model_nlsys`.

    `initial_state` is where it starts, `constant_inputs` are the model's inputs there, `noise_labels` name the inputs
    that come after them. Ticks follow from the time that python-control hands over, as
    `models.system.Run` counts them, so that clocks of any period do.
    """

    def __init__(
        self,
        compiled: Compiled,
        dt: float,
        inputs: Sequence[int],
        outputs: Sequence[int],
        noise: bool,
        name: str,
    ) -> None:
        self._compiled, self._inputs, self._outputs = compiled, list(inputs), list(outputs)
        self._rows = np.unique(np.concatenate([step.rows for step in compiled.steps]))
        self._constant = compiled.inputs.copy()
        self._every = _tasks_by_clock(compiled)
        self._noise: dict[int, _Noise] = {}
        labels = [signal_name(compiled.input_names[i]) for i in inputs]
        for number, task in enumerate(compiled.tasks):
            if noise and task.normals:
                calls = _most_calls(compiled, number, dt)
                self._noise[number] = _Noise(len(labels), task.normals, calls)
                labels += noise_labels(compiled, number, calls)
        super().__init__(
            self._after,
            self._shown,
            inputs=labels,
            outputs=[signal_name(compiled.output_names[i]) for i in outputs],
            states=[compiled.state_names[i] for i in self._rows],
            dt=dt,
            name=name,
        )
        self.initial_state: Array = compiled.state[self._rows].copy()
        self.constant_inputs: Array = self._constant[self._inputs]
        self.noise_labels: list[str] = labels[len(self._inputs) :]

    def _place(self, x: Any, u: Any) -> None:
        compiled = self._compiled
        compiled.state[self._rows] = x
        compiled.inputs[:] = self._constant
        compiled.inputs[self._inputs] = u[: len(self._inputs)]

    def _after(self, t: float, x: Any, u: Any, _params: Any) -> Any:
        self._place(x, u)
        steps, noise = self._compiled.steps, self._noise
        calls = dict.fromkeys(noise, 0)
        for number in self._due(t):
            step = steps[number]
            if number in noise:
                first, draws, _ = noise[number]
                start = first + draws * calls[number]
                step.draws[:] = u[start : start + draws]
                calls[number] += 1
            step.run()
        return self._compiled.state[self._rows]

    def _shown(self, _t: float, x: Any, _u: Any, _params: Any) -> Any:
        self._compiled.state[self._rows] = x
        self._compiled.show.run()
        return self._compiled.shown[self._outputs]

    def _due(self, t: float) -> Iterator[int]:
        """Numbers of the tasks that run in (t, t + dt], in the order of `models.system.Run`."""
        begin, end = _limit(t), _limit(t + self.dt)
        ticks: list[tuple[float, int, int]] = []
        for clock, (period, _) in enumerate(self._every):
            if period < STOPPED:
                count = max(int(begin / period) - 1, 0) + 1
                while (time := count * period) <= end:
                    if time > begin:
                        ticks.append((time, clock, count))
                    count += 1
        ticks.sort()
        for _, clock, count in ticks:
            for number, every in self._every[clock][1]:
                if count % every == 0:
                    yield number

    def linearize(
        self,
        x0: Any,
        u0: Any = None,
        t: float = 0.0,
        params: Any = None,
        eps: float = 1e-6,
        copy_names: bool = False,
        **kwargs: Any,
    ) -> control.StateSpace:
        """The exact matrices at (x0, u0) of the sampling time that begins at t; `eps` and `params` are not used.

        What rounds lets signals pass. All states are there; `model_ss` gives the system without the idle ones.
        """
        if isinstance(x0, control.OperatingPoint):
            x0, u0 = x0.states, x0.inputs if u0 is None else u0
        state = np.broadcast_to(np.asarray(x0, dtype=float), (self.nstates,))
        held = np.broadcast_to(np.asarray(0.0 if u0 is None else u0, dtype=float), (self.ninputs,))
        self._place(state, held)
        here = self._compiled
        passing = Compiled(here.model, here.parameters, inputs_with(here.model, None), rounded=False)
        passing.state[:], passing.inputs[:] = here.state, here.inputs
        due = list(self._due(t))
        folded = fold(passing, due)
        B = np.zeros((self.nstates, self.ninputs))
        B[:, : len(self._inputs)] = folded.B[:, self._inputs]
        column = 0
        for turn, number in enumerate(due):
            if number in self._noise:
                first, draws, _ = self._noise[number]
                start = first + draws * due[:turn].count(number)
                B[:, start : start + draws] = folded.G[:, column : column + draws]
            column += passing.steps[number].draws.size
        C = folded.C[self._outputs]
        system = control.ss(
            folded.A, B, C, np.zeros((self.noutputs, self.ninputs)), self.dt, remove_useless_states=False
        )
        if copy_names:
            system._copy_names(self, prefix_suffix_name="linearized")
        return control.StateSpace(system, remove_useless_states=False, **kwargs)


def _limit(time: float) -> float:
    return time + TIME_TOLERANCE * max(1.0, abs(time))


def _tasks_by_clock(compiled: Compiled) -> list[tuple[float, list[tuple[int, int]]]]:
    """Of each clock its period, and number and divider of its tasks."""
    return [
        (
            compiled.periods[clock.name],
            [(i, compiled.every[i]) for i, task in enumerate(compiled.tasks) if task.clock == clock.name],
        )
        for clock in compiled.model.clocks
    ]


def _most_calls(compiled: Compiled, number: int, dt: float) -> int:
    """How often a task may run in one sampling time."""
    ratio = dt / (compiled.periods[compiled.tasks[number].clock] * compiled.every[number])
    whole = round(ratio)
    return max(whole if whole and abs(ratio - whole) < TIME_TOLERANCE * whole else ceil(ratio), 1)


def noise_labels(compiled: Compiled, number: int, calls: int) -> list[str]:
    """``noise_task[call,draw]`` of a task's normals, ``noise_task[draw]`` where there is one call."""
    task = compiled.tasks[number]
    name = f"noise_{task.name}"
    if calls == 1:
        return [f"{name}[{draw + 1}]" for draw in range(task.normals)]
    return [f"{name}[{call + 1},{draw + 1}]" for call in range(calls) for draw in range(task.normals)]


def model_nlsys(
    model: Source,
    dt: float,
    parameters: Mapping[str, float | str] | None = None,
    *,
    operating_point: OperatingPoint | Mapping[str, float] | None = None,
    inputs: Sequence[str] | str | None = None,
    outputs: Sequence[str] | str | None = None,
    noise: bool = True,
    name: str | None = None,
) -> ModelSystem:
    """x[k+1] = f(t_k, x[k], u[k], w[k]), y[k] = h(x[k]): the whole model, one sampling time `dt` (s) a step.

    It starts where the model starts at the constant inputs that `operating_point` gives, or at an `OperatingPoint`;
    inputs that are not among `inputs` keep these values. With `noise` the standard normals that the tasks draw are
    further inputs, ``noise_task[call,draw]``. Simulated from t = 0 with noise zero it is the model without noise; with
    the model's own normals it is `models.system.Run`. It has one array inside: no two threads at once.

    Raises `LinearisationRefusedError` for unknown names.

    >>> import control
    >>> gimbal = model_nlsys("TripodGimbal", 0.001, {"wind.speed": 0.0}, outputs="euler", noise=False)
    >>> t = control.timeresp.np.arange(100) * 0.001
    >>> falling = control.input_output_response(gimbal, t, 0.0, gimbal.initial_state)
    >>> falling.outputs.shape
    (3, 100)
    """
    if isinstance(operating_point, OperatingPoint):
        point = operating_point
        if parameters:
            raise LinearisationRefusedError("an operating point has its own parameters; give one or the other")
        compiled = Compiled(point.model, point.parameters, point.inputs, rounded=True)
        compiled.state[:] = start_values(point.state)
    else:
        called = model_called(model)
        values = parameters_with(called, parameters)
        compiled = Compiled(called, values, inputs_with(called, operating_point), rounded=True)
    called = compiled.model
    entered = (
        range(len(compiled.input_names))
        if inputs is None
        else named(called.Inputs, inputs, f"input of {called.name} called")
    )
    shown = (
        range(len(compiled.output_names))
        if outputs is None
        else named(called.Outputs, outputs, f"output of {called.name} called")
    )
    return ModelSystem(compiled, dt, entered, shown, noise, name or called.name)
