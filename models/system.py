"""Models as records and tasks, and the scheduler that runs them.

A `Model` is five records and a few pure functions. Its tasks run at clocks of their own; tick k (k = 1, 2, ...) of a
clock is at ``start_time + k * period``, counted and never accumulated, so that the result does not depend on how a
master cuts time. A tick that falls on the end of a communication step belongs to that step.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from math import inf, isfinite
from typing import Any, NamedTuple

from .errors import ModelStoppedError, ValueRefusedError, digits
from .noise import normals, stream_of
from .record import allowed_range, check, flatten, leaves, unflatten

TIME_TOLERANCE = 1e-9
"""Part of the time (at least of 1 s) by which a tick may lie past the end of a step and still belong to it: masters
add up rounded steps."""

SHORTEST_PERIOD = 1e-6
"""Shortest period of a clock, s; a shorter one is a slip that would keep a host busy for ever."""

LATEST_TIME = 1e9
"""Largest time that a run may reach, s: beyond it a double does not tell short periods apart."""

STOPPED = 1e12
"""Period of a clock that stands still, s."""

_SEEDS = 2**64 - 1

Step = Callable[[Any, Any, Any, Any, tuple[Any, ...]], Any]


def _once(_coefficients: Any) -> int:
    return 1


class Rule(NamedTuple):
    """A parameter's limits that follow from the others: ``low <= value <= high`` of ``limits(parameters)``.

    `field` is its structured name, `why` tells what is wrong beyond them; an infinite limit is none. A rule may count
    on the rules before it.
    """

    field: str
    why: str
    limits: Callable[[Any], tuple[Any, Any]]


class Clock(NamedTuple):
    """A time base: its name and its period in seconds, read from the coefficients."""

    name: str
    period: Callable[[Any], Any]


class Task(NamedTuple):
    """A pure step ``(state, inputs, parameters, coefficients, normals) -> state`` that runs every n-th tick of a clock.

    `step` is one function, or one for each value of the enumeration parameter that `choice` reads; at a value without
    one the task rests. `normals` is the number of standard normal draws that a call takes.
    """

    name: str
    clock: str
    step: Step | Mapping[int, Step]
    choice: Callable[[Any], Any] | None = None
    every: Callable[[Any], Any] = _once
    normals: int = 0

    def chosen(self, parameters: Any) -> Step | None:
        """The step that these parameters ask for, None where the task rests."""
        if callable(self.step):
            return self.step
        assert self.choice is not None
        return self.step.get(int(self.choice(parameters)))

    def alternatives(self) -> dict[str, Step]:
        """Every step of the task by a name of its own."""
        if callable(self.step):
            return {self.name: self.step}
        return {f"{self.name}_{value}": step for value, step in self.step.items()}


class Model(NamedTuple):
    """A simulated thing: its records, the functions that fill them, its clocks and tasks.

    ==============  ==========================================================================
    `coefficients`  ``(parameters) -> Coefficients``
    `initial_state` ``(parameters, coefficients, inputs) -> State``
    `outputs`       ``(state, parameters, coefficients) -> Outputs``
    `seed`          ``(parameters)``, the whole number that is the key of all its noise
    `rules`         limits of parameters that follow from other parameters
    ==============  ==========================================================================
    """

    name: str
    description: str
    Parameters: type
    Coefficients: type
    Inputs: type
    State: type
    Outputs: type
    coefficients: Callable[[Any], Any]
    initial_state: Callable[[Any, Any, Any], Any]
    outputs: Callable[[Any, Any, Any], Any]
    clocks: Sequence[Clock]
    tasks: Sequence[Task]
    seed: Callable[[Any], Any]
    rules: Sequence[Rule] = ()


def check_rules(model: Model, parameters: Any, instance: str) -> None:
    """Raise `ValueRefusedError` for the first parameter that does not go together with the others."""
    values = dict(zip((leaf.name for leaf in leaves(model.Parameters)), flatten(parameters), strict=True))
    for rule in model.rules:
        low, high = rule.limits(parameters)
        if not low <= values[rule.field] <= high:
            unit = next(leaf.fact.unit for leaf in leaves(model.Parameters) if leaf.name == rule.field)
            raise ValueRefusedError(
                f"{instance}.{rule.field}", values[rule.field], unit, rule.why, allowed_range(low, high, unit)
            )


class _Scheduled(NamedTuple):
    name: str
    step: Step
    every: int
    normals: int
    key: tuple[int, int]


def _check_finite(record: type, scalars: list[Any], prefix: str) -> None:
    """Raise `ModelStoppedError` where one of a record's scalars is no number; `prefix` goes before its name."""
    if isfinite(sum(scalars)):
        return
    for leaf, scalar in zip(leaves(record), scalars, strict=True):
        if not isfinite(scalar):
            raise ModelStoppedError(
                f"{prefix}{leaf.name} = {digits(scalar)}: the numbers ran away; "
                "look for parameters or inputs far from what the model is made for"
            )


class Snapshot(NamedTuple):
    """All that evolves in a `Run`: the state's scalars and the clocks' counters."""

    state: tuple[float, ...]
    counts: tuple[int, ...]


class Run:
    """One simulated instance of a model from `start_time` on.

    Ticks that fall on the very same time run in the order in which their clocks are declared.

    Raises `ValueRefusedError` for parameters or inputs out of range or out of step with one another.
    """

    def __init__(self, model: Model, parameters: Any, inputs: Any, start_time: float = 0.0, name: str = "") -> None:
        self.model = model
        self.name = name or model.name
        self.start_time = start_time
        self._set_parameters(parameters)
        self.counts = [0] * len(model.clocks)
        self._periods = [self._period(clock) for clock in model.clocks]
        self._schedule()
        try:
            self.state = model.initial_state(parameters, self.coefficients, inputs)
        except (ArithmeticError, ValueError) as error:
            raise ModelStoppedError(f"{self.name}: no initial state: {error}") from error
        _check_finite(model.State, flatten(self.state), f"{self.name}.state.")

    def _period(self, clock: Clock) -> float:
        period = float(clock.period(self.coefficients))
        if not period >= SHORTEST_PERIOD:
            raise ValueRefusedError(
                f"{self.name}.{clock.name} clock's period",
                period,
                "s",
                "the parameters give too short a period",
                allowed_range(SHORTEST_PERIOD, inf, "s"),
            )
        return period

    def _set_parameters(self, parameters: Any) -> None:
        check(self.model.Parameters, flatten(parameters), self.name)
        check_rules(self.model, parameters, self.name)
        try:
            self.coefficients = self.model.coefficients(parameters)
        except (ArithmeticError, ValueError) as error:
            raise ModelStoppedError(f"{self.name}: no coefficients from these parameters: {error}") from error
        _check_finite(self.model.Coefficients, flatten(self.coefficients), f"{self.name}.coefficient.")
        self.parameters = parameters

    def _schedule(self) -> None:
        seed = int(self.model.seed(self.parameters)) & _SEEDS
        self._due = [
            self.start_time + (count + 1) * period for count, period in zip(self.counts, self._periods, strict=True)
        ]
        self._tasks = [
            [
                _Scheduled(
                    task.name,
                    step,
                    int(task.every(self.coefficients)),
                    task.normals,
                    (seed, stream_of(task.name)),
                )
                for task in self.model.tasks
                if task.clock == clock.name and (step := task.chosen(self.parameters)) is not None
            ]
            for clock in self.model.clocks
        ]

    def tune(self, parameters: Any) -> None:
        """Go on with other values of tunable parameters; clocks and state stay."""
        self._set_parameters(parameters)
        self._schedule()

    def advance(self, inputs: Any, until: float) -> None:
        """Run every tick due by `until` (s) with `inputs` held; what was reached before an error is kept."""
        limit = until + TIME_TOLERANCE * max(1.0, abs(until))
        due, counts, tasks = self._due, self.counts, self._tasks
        parameters, coefficients = self.parameters, self.coefficients
        while (time := min(due)) <= limit:
            clock = due.index(time)
            count = counts[clock] + 1
            state = self.state
            for name, step, every, draws, key in tasks[clock]:
                if count % every == 0:
                    drawn = normals(key, count // every, draws) if draws else ()
                    try:
                        state = step(state, inputs, parameters, coefficients, drawn)
                    except (ArithmeticError, ValueError) as error:
                        raise ModelStoppedError(f"{self.name}: task {name} at t = {time} s: {error}") from error
            self.state = state
            counts[clock] = count
            due[clock] = self.start_time + (count + 1) * self._periods[clock]
        _check_finite(self.model.State, flatten(self.state), f"{self.name}.state.")

    def outputs(self) -> Any:
        """What the model shows now."""
        return self.model.outputs(self.state, self.parameters, self.coefficients)

    def shown(self) -> list[Any]:
        """The scalars of `outputs`; raises `ModelStoppedError` where one is no finite number."""
        scalars = flatten(self.outputs())
        _check_finite(self.model.Outputs, scalars, f"{self.name}.")
        return scalars

    def snapshot(self) -> Snapshot:
        """A copy of all that evolves."""
        return Snapshot(tuple(flatten(self.state)), tuple(self.counts))

    def restore(self, snapshot: Snapshot) -> None:
        """Go back to a snapshot of the same model."""
        if len(snapshot.state) != len(leaves(self.model.State)) or len(snapshot.counts) != len(self.counts):
            raise ModelStoppedError(f"{self.name}: the saved state is of another model or version")
        self.state = unflatten(self.model.State, snapshot.state)
        self.counts = list(snapshot.counts)
        self._schedule()
