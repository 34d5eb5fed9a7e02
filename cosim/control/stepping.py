"""A model's tasks as fast functions on one array of numbers, and the moments at which its clocks tick."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from fractions import Fraction
from functools import cached_property
from math import lcm
from typing import Any, NamedTuple

import casadi
import numpy as np
from scipy import sparse  # type: ignore[import-untyped]

from attitude_fmu.fmu_src import catalogue
from attitude_fmu.fmu_src.errors import BuildError, did_you_mean
from attitude_fmu.fmu_src.interface import Interface
from attitude_fmu.fmu_src.trace import Running, Traced, trace_running
from attitude_fmu.models.record import Enumeration, Integer, Real, defaults, flatten, leaves, unflatten
from attitude_fmu.models.system import STOPPED, Model, Run

from ..errors import LinearisationRefusedError

Source = Model | str
"""A model, or the name of an FMU in the catalogue, which may name a device: ``AttitudeSensor_ADIS16354_150``."""

Array = np.ndarray[Any, np.dtype[np.float64]]

CLOCK_TOLERANCE = 0.05
"""A clock that misses a whole ratio to the sampling time by less than this part is taken at the whole ratio."""

_LARGEST_DENOMINATOR = 64
"""Of a ratio of two clocks that is taken as rational."""


def model_called(source: Source) -> Model:
    """The model itself.

    Raises `LinearisationRefusedError` for a name that the catalogue does not have.
    """
    if not isinstance(source, str):
        return source
    try:
        return catalogue.model_of(catalogue.entry(source))
    except BuildError as error:
        raise LinearisationRefusedError(str(error)) from None


def parameters_with(model: Model, values: Mapping[str, float | str] | None) -> Any:
    """The model's parameters with other values by structured name; enumerations by number or by name.

    Raises `LinearisationRefusedError` for an unknown name.
    """
    facts = {leaf.name: leaf.fact for leaf in leaves(model.Parameters)}
    numbers: dict[str, Any] = {}
    for name, value in (values or {}).items():
        if name not in facts:
            raise LinearisationRefusedError(f"{model.name} has no parameter {name}{did_you_mean(name, facts)}")
        fact = facts[name]
        if isinstance(value, str):
            items = [item.name for item in fact.items] if isinstance(fact, Enumeration) else []
            if value not in items:
                known = f"; there are {', '.join(items)}" if items else "; it takes a number"
                raise LinearisationRefusedError(f"{model.name}.{name} has no choice {value!r}{known}")
            numbers[name] = items.index(value) + 1
        else:
            numbers[name] = value
    starts = zip(leaves(model.Parameters), flatten(defaults(model.Parameters)), strict=True)
    return unflatten(model.Parameters, [numbers.get(leaf.name, start) for leaf, start in starts])


def named(record: type, wanted: Sequence[str] | str, what: str) -> list[int]:
    """Places of scalars by name; a stem stands for all its scalars, ``rate`` for ``rate[1]`` to ``rate[3]``."""
    names = [leaf.name for leaf in leaves(record)]
    found: list[int] = []
    for one in [wanted] if isinstance(wanted, str) else wanted:
        places = [i for i, name in enumerate(names) if name == one or name.startswith((f"{one}[", f"{one}."))]
        if not places:
            stems = [re.split(r"[.\[]", name)[0] for name in names]
            raise LinearisationRefusedError(f"there is no {what} {one}{did_you_mean(one, {*names, *stems})}")
        found += [place for place in places if place not in found]
    return found


def inputs_with(model: Model, values: Mapping[str, float] | None) -> Any:
    """The model's inputs at their start values, with other values by name; a stem sets all its scalars."""
    numbers = flatten(defaults(model.Inputs))
    for name, value in (values or {}).items():
        for place in named(model.Inputs, name, f"input of {model.name} called"):
            numbers[place] = value
    return unflatten(model.Inputs, numbers)


class Jacobian(NamedTuple):
    """Derivatives of what a task writes: by state, by inputs, and by normals and rounding errors."""

    state: Any
    inputs: Any
    draws: Any


class _Columns(NamedTuple):
    """Columns of the Jacobians by the hash of their symbols: states, whose first place is `first`, then inputs."""

    states: int
    inputs: int
    first: int
    of: dict[int, int]


def _columns(symbols: Any, places: Interface) -> _Columns:
    order = [*range(places.state.start, places.state.stop), *range(places.inputs.start, places.inputs.stop)]
    n = places.state.stop - places.state.start
    of = {symbols[place].element_hash(): column for column, place in enumerate(order)}
    return _Columns(n, len(order) - n, places.state.start, of)


class CompiledTask:
    """A step as a function on the array `numbers`; `draws` are its normals and then its rounding errors."""

    def __init__(self, step: Traced, numbers: Array, columns: _Columns) -> None:
        self._step, self._columns, self._numbers = step, columns, numbers
        self.places = np.array(step.places, dtype=np.intp)
        self.rows = self.places - columns.first
        self.draws = np.zeros(step.arguments[1].numel())
        self._results = np.zeros(len(step.places))
        function = casadi.Function("step", list(step.arguments), [casadi.densify(casadi.vertcat(*step.results))])
        self._held = self._bound(function, self._results)
        self._call: Callable[[], None] = self._held[1]

    def _bound(self, function: Any, results: Array) -> Any:
        """The function's buffer, tied to our arrays, and what calls it."""
        buffer, call = function.buffer()
        buffer.set_arg(0, self._numbers.data)
        if self.draws.size:
            buffer.set_arg(1, self.draws.data)
        if results.size:
            buffer.set_res(0, results.data)
        return buffer, call, function

    def run(self) -> None:
        """Do the step in place."""
        self._call()
        self._numbers[self.places] = self._results

    @cached_property
    def _derivative(self) -> tuple[Any, Array, Any, Any]:
        """What fills the Jacobian's entries, the entries, and their rows and columns; columns: state, inputs, draws."""
        values, draws = self._step.arguments
        results = casadi.vertcat(*self._step.results)
        before = self._columns.states + self._columns.inputs
        column = self._columns.of | {draws[i].element_hash(): before + i for i in range(draws.numel())}
        by = [symbol for symbol in casadi.symvar(results) if symbol.element_hash() in column]
        jacobian = casadi.jacobian(results, casadi.vertcat(*by)) if by else casadi.SX(results.numel(), 0)
        rows, columns = jacobian.sparsity().get_triplet()
        places = np.array([column[symbol.element_hash()] for symbol in by], dtype=np.intp)
        entries = np.zeros(jacobian.nnz())
        function = casadi.Function("jacobian", [values, draws], [jacobian])
        return self._bound(function, entries), entries, np.array(rows, dtype=np.intp), places[np.array(columns, int)]

    def jacobian(self) -> Jacobian:
        """Sparse derivatives here and now, before the step is run."""
        bound, entries, rows, columns = self._derivative
        bound[1]()
        n = self._columns.states
        m = n + self._columns.inputs
        whole = sparse.csr_matrix((entries.copy(), (rows, columns)), shape=(len(self.places), m + self.draws.size))
        whole.eliminate_zeros()
        return Jacobian(whole[:, :n], whole[:, n:m], whole[:, m:])


class Compiled:
    """A model with given parameters: all its numbers in one array, its tasks and outputs as functions on it.

    With `rounded` false signals pass quantisers unchanged, and rounding errors are draws of the tasks.

    Raises `ValueRefusedError` for parameters or inputs out of range, `BuildError` for a model that cannot be traced.
    """

    def __init__(self, model: Model, parameters: Any, inputs: Any, rounded: bool) -> None:
        self.model, self.parameters = model, parameters
        run = Run(model, parameters, inputs)
        self.coefficients = run.coefficients
        running: Running = trace_running(model, parameters, rounded)
        places = running.interface
        self.numbers = np.zeros(len(places.variables))
        self.numbers[places.parameters] = flatten(parameters)
        self.numbers[places.coefficients] = flatten(run.coefficients)
        self.state = self.numbers[places.state]
        self.inputs = self.numbers[places.inputs]
        self.shown = self.numbers[places.outputs]
        self.initial = np.array(flatten(run.state), dtype=float)
        self.state[:] = self.initial
        self.inputs[:] = flatten(inputs)
        self.tasks = running.tasks
        columns = _columns(running.outputs.arguments[0], places)
        self.steps = tuple(CompiledTask(step, self.numbers, columns) for step in running.steps)
        self.show = CompiledTask(running.outputs, self.numbers, columns)
        self.every = tuple(int(task.every(run.coefficients)) for task in running.tasks)
        self.periods = {clock.name: float(clock.period(run.coefficients)) for clock in model.clocks}
        self.state_names = tuple(leaf.name for leaf in leaves(model.State))
        self.input_names = tuple(leaf.name for leaf in leaves(model.Inputs))
        self.output_names = tuple(leaf.name for leaf in leaves(model.Outputs))
        self.real_outputs = [i for i, leaf in enumerate(leaves(model.Outputs)) if isinstance(leaf.fact, Real)]

    def __deepcopy__(self, _memo: Any) -> Compiled:
        """Itself: compiled functions cannot be copied, and systems put their state in before each call."""
        return self

    def state_name(self, place: int) -> str:
        """Of a state; beyond them, of the last value of an input."""
        own = len(self.state_names)
        return self.state_names[place] if place < own else f"{self.input_names[place - own]}.before"

    def draw_names(self, number: int) -> list[str]:
        """``task[draw]`` of each normal of a task, ``task.rounding[number]`` of each rounding error."""
        task, step = self.tasks[number], self.steps[number]
        normals = [f"{task.name}[{i + 1}]" for i in range(task.normals)]
        errors = range(step.draws.size - task.normals)
        return [*normals, *[f"{task.name}.rounding[{i + 1}]" for i in errors]]

    def set_by(self, clock: str) -> list[str]:
        """Names of the numbers that the period of a clock or the dividers of its tasks follow from."""
        return _parameters_behind(self.model, self.parameters, clock)


def choices(record: type) -> list[str]:
    """``name (item, item)`` of each enumeration that stands alone, not in a row of many."""
    return [
        f"{leaf.name} ({', '.join(item.name for item in leaf.fact.items)})"
        for leaf in leaves(record)
        if isinstance(leaf.fact, Enumeration) and "[" not in leaf.name
    ]


def _parameters_behind(model: Model, parameters: Any, clock: str) -> list[str]:
    known = leaves(model.Parameters)
    symbols = casadi.SX.sym("p", len(known))
    traced = unflatten(model.Parameters, [symbols[i] for i in range(symbols.numel())])
    coefficients = model.coefficients(traced)
    period = next(one.period(coefficients) for one in model.clocks if one.name == clock)
    chosen = [task for task in model.tasks if task.clock == clock and task.chosen(parameters) is not None]
    answers = casadi.vertcat(period, *[task.every(coefficients) for task in chosen])
    _, columns = casadi.jacobian_sparsity(answers, symbols).get_triplet()
    # flags such as `ideal` reach everything; a number is what the reader can set
    return [known[i].name for i in sorted(set(columns)) if isinstance(known[i].fact, Real | Integer)]


class Timing(NamedTuple):
    """Ticks of each clock, and calls of each task, in a sampling time; None where the ratio is no small one."""

    ticks: dict[str, Fraction | None]
    calls: tuple[Fraction | None, ...]


def _ratio(dt: float, period: float, tolerance: float) -> Fraction | None:
    """dt/period, or the whole ratio one way or the other that it misses by less than the tolerance."""
    if period >= STOPPED:
        return Fraction(0)
    ratio = dt / period
    whole = Fraction(round(ratio)) if ratio >= 1.0 else Fraction(1, round(1.0 / ratio))
    if abs(float(whole) / ratio - 1.0) <= tolerance:
        return whole
    near = Fraction(ratio).limit_denominator(_LARGEST_DENOMINATOR)
    return near if near and abs(float(near) / ratio - 1.0) < 1e-6 else None


def timing(compiled: Compiled, dt: float, tolerance: float) -> Timing:
    """How often everything happens in dt, clocks at their nominal rates."""
    ticks = {name: _ratio(dt, period, tolerance) for name, period in compiled.periods.items()}
    calls = [
        None if (rate := ticks[task.clock]) is None else rate / every
        for task, every in zip(compiled.tasks, compiled.every, strict=True)
    ]
    return Timing(ticks, tuple(calls))


def calls_within(compiled: Compiled, times: Timing, steps: int) -> Iterator[int]:
    """Numbers of the tasks that run in the first `steps` sampling times, in their order.

    Left out are tasks whose clocks have no small ratio. Ticks of the same moment run in the clocks' declared order.
    """
    period = period_of(times)
    pattern = _pattern(compiled, times, min(period, steps))
    for _ in range(steps // period):
        yield from pattern
    if steps % period:
        yield from _pattern(compiled, times, steps % period)


def period_of(times: Timing) -> int:
    """Sampling times after which everything that has a small ratio to dt has run a whole number of times."""
    return lcm(*[calls.denominator for calls in times.calls if calls])


def _pattern(compiled: Compiled, times: Timing, steps: int) -> list[int]:
    moments: list[tuple[Fraction, int, int]] = []
    order = [clock.name for clock in compiled.model.clocks]
    for number, clock in enumerate(order):
        rate = times.ticks[clock]
        if rate:
            moments += [(count / rate, number, count) for count in range(1, int(steps * rate) + 1)]
    moments.sort()
    return [
        number
        for _, clock_number, count in moments
        for number, task in enumerate(compiled.tasks)
        if task.clock == order[clock_number] and count % compiled.every[number] == 0
    ]


def smallest_step(times: Timing, numbers: Sequence[int]) -> int | None:
    """The smallest multiple of dt in which all these tasks run a whole number of times, None if there is none."""
    multiple = 1
    for number in numbers:
        calls = times.calls[number]
        if calls is None:
            return None
        multiple = lcm(multiple, calls.denominator)
    return multiple


def signal_name(name: str) -> str:
    """An FMI name as python-control takes it for a signal: ``euler.yaw`` is ``euler_yaw``."""
    return name.replace(".", "_")
