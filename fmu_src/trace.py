"""Models traced with CasADi: the same functions, called with symbols, as expressions that C code is written from.

All numbers of an instance lie in one array, in which a variable's place is its value reference (`interface`). Every
traced function reads and writes places of it.
"""

from __future__ import annotations

import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

import casadi

from ..models.record import flatten, leaves, unflatten
from ..models.scalar import rounding_of_symbols
from ..models.system import Model, Task
from .errors import BuildError
from .interface import Interface, interface_of


class Traced(NamedTuple):
    """A function of ``arguments[0]`` (the instance's numbers) and ``arguments[1]`` (draws or tangents).

    `results[i]` goes to place ``places[i]``.
    """

    name: str
    purpose: str
    arguments: tuple[Any, Any]
    results: tuple[Any, ...]
    places: tuple[int, ...]


class Way(NamedTuple):
    """One step of a task and the value of the choosing parameter that asks for it."""

    value: int
    step: Traced


class TracedTask(NamedTuple):
    """A task with all its ways."""

    task: Task
    ways: tuple[Way, ...]


class Trace(NamedTuple):
    """Everything of a model that becomes C; `tasks` are grouped by clock, in the clocks' order.

    `initial_dependencies` are the settable variables that each output and coefficient follows from at initialisation.
    """

    model: Model
    interface: Interface
    coefficients: Traced
    initial_state: Traced
    outputs: Traced
    schedule: Traced
    limits: Traced
    derivatives: tuple[Traced, ...]
    tasks: tuple[TracedTask, ...]
    initial_dependencies: dict[int, tuple[int, ...]]


def _refuse_float(self: Any) -> float:
    raise TypeError("a signal is no number while the model is traced")


@contextmanager
def _as_written() -> Iterator[None]:
    """Keep expressions as the model writes them: simplified ones would differ from the floats in the last bits.

    CasADi would hand a function of ``math`` a NaN for a symbol; here it is refused.
    """
    as_float = casadi.SX.__float__
    casadi.GlobalOptions.setSimplificationOnTheFly(False)
    casadi.SX.__float__ = _refuse_float  # type: ignore[method-assign]
    try:
        yield
    finally:
        casadi.SX.__float__ = as_float  # type: ignore[method-assign]
        casadi.GlobalOptions.setSimplificationOnTheFly(True)


_HINTS = {
    "__bool__": "an if, and, or, not, min or max on a signal; use where(condition, a, b), both, either, minimum, "
    "maximum of attitude_fmu.models.scalar",
    "_refuse_float": "a signal given to what takes numbers only; use the functions of attitude_fmu.models.scalar "
    "instead of math's",
}
"""What a model's author did, by the function that CasADi's symbols end in."""

_NOT_THE_MODELS = (Path(casadi.__file__).parent, Path(__file__).parent)


def _place_in_model(error: Exception) -> tuple[str, str]:
    """``file.py:line in function`` of the model where an error arose, nothing if not in there; and a hint."""
    frames = traceback.extract_tb(error.__traceback__)
    inside = [one for one in frames if not any(Path(one.filename).is_relative_to(room) for room in _NOT_THE_MODELS)]
    own = [one for one in inside if Path(one.filename).name != "scalar.py"] or inside
    where = f" ({Path(own[-1].filename).name}:{own[-1].lineno} in {own[-1].name})" if own else ""
    return where, _HINTS.get(frames[-1].name, f"{type(error).__name__}: {str(error).partition(chr(10))[0]}")


@contextmanager
def _told(model: Model, what: str) -> Iterator[None]:
    """Turn whatever a model's function raises into a `BuildError` that says which it was, and where."""
    try:
        yield
    except BuildError:
        raise
    except Exception as error:
        where, why = _place_in_model(error)
        raise BuildError(f"{model.name}: {what}: {why}{where}") from error


def _filled(model: Model, what: str, record: type, value: Any) -> tuple[Any, ...]:
    """The scalars of the record that a model's function returns."""
    if not isinstance(value, record):
        raise BuildError(f"{model.name}: {what} must return {record.__name__}, gave {type(value).__name__}")
    scalars, wanted = flatten(value), len(leaves(record))
    if len(scalars) != wanted:
        raise BuildError(f"{model.name}: {what} must give {wanted} numbers in {record.__name__}, gave {len(scalars)}")
    return tuple(scalars)


class _Symbols:
    """The instance's numbers as symbols, and as the model's records."""

    def __init__(self, model: Model, interface: Interface) -> None:
        self.places = interface
        self.v = casadi.SX.sym("v", len(interface.variables))
        self.p = self._record(model.Parameters, interface.parameters)
        self.u = self._record(model.Inputs, interface.inputs)
        self.k = self._record(model.Coefficients, interface.coefficients)
        self.x = self._record(model.State, interface.state)

    def _record(self, record: type, place: slice) -> Any:
        return unflatten(record, [self.v[i] for i in range(place.start, place.stop)])


def _places(place: slice) -> tuple[int, ...]:
    return tuple(range(place.start, place.stop))


def _scalars(values: Any) -> tuple[Any, ...]:
    return tuple(casadi.SX(value) for value in values)


def _step(model: Model, symbols: _Symbols, name: str, task: Task, step: Callable[..., Any]) -> Traced:
    """A task's step, of which only what changes is written back."""
    z = casadi.SX.sym("z", task.normals)
    draws = tuple(z[i] for i in range(task.normals))
    what = f"task {task.name}"
    with _told(model, what):
        after = _filled(model, what, model.State, step(symbols.x, symbols.u, symbols.p, symbols.k, draws))
        moved = [
            (place, casadi.SX(new))
            for place, old, new in zip(_places(symbols.places.state), flatten(symbols.x), after, strict=True)
            if new is not old
        ]
    return Traced(
        name,
        f"One step of the task {task.name}.",
        (symbols.v, z),
        tuple(new for _, new in moved),
        tuple(place for place, _ in moved),
    )


def _task(model: Model, symbols: _Symbols, task: Task) -> TracedTask:
    names = task.alternatives()
    values = [0] if callable(task.step) else list(task.step)
    steps = zip(values, names.items(), strict=True)
    return TracedTask(
        task, tuple(Way(value, _step(model, symbols, f"step_{name}", task, step)) for value, (name, step) in steps)
    )


def _schedule(model: Model, symbols: _Symbols, tasks: Sequence[Task]) -> Traced:
    with _told(model, "seed, clocks and tasks"):
        answers = _scalars(
            [
                model.seed(symbols.p),
                *[clock.period(symbols.k) for clock in model.clocks],
                *[task.every(symbols.k) for task in tasks],
                *[0.0 if task.choice is None else task.choice(symbols.p) for task in tasks],
            ]
        )
    return Traced(
        "schedule",
        "Seed, periods of the clocks, dividers and choices of the tasks.",
        (symbols.v, casadi.SX(0, 1)),
        answers,
        tuple(range(len(answers))),
    )


def _limits(model: Model, symbols: _Symbols) -> Traced:
    with _told(model, "rules"):
        bounds = _scalars(bound for rule in model.rules for bound in rule.limits(symbols.p))
    return Traced(
        "limits",
        "Limits of parameters that follow from other parameters: low and high of each rule.",
        (symbols.v, casadi.SX(0, 1)),
        bounds,
        tuple(range(len(bounds))),
    )


def _derivative(of: Traced, symbols: _Symbols) -> Traced:
    """Tangents of the results, from the tangents of all that they follow from."""
    tangent = casadi.SX.sym("d", symbols.v.numel())
    direction = casadi.jtimes(casadi.vertcat(*of.results), symbols.v, tangent)
    return Traced(
        f"{of.name}_derivative",
        f"Directional derivative of {of.name}.",
        (symbols.v, tangent),
        tuple(direction[i] for i in range(direction.numel())),
        of.places,
    )


def _initial(traced: Sequence[Traced], symbols: _Symbols) -> Any:
    """All numbers after the given functions have run one after the other."""
    values = casadi.SX(symbols.v)
    for function in traced:
        results = casadi.substitute(casadi.vertcat(*function.results), symbols.v, values)
        values = casadi.SX(values)
        for i, place in enumerate(function.places):
            values[place] = results[i]
    return values


def _dependencies(traced: Sequence[Traced], symbols: _Symbols) -> dict[int, tuple[int, ...]]:
    values = _initial(traced, symbols)
    pattern = casadi.jacobian_sparsity(values, symbols.v)
    rows, columns = pattern.get_triplet()
    settable = symbols.places.inputs.stop
    found: dict[int, list[int]] = {
        place: [] for group in (symbols.places.outputs, symbols.places.coefficients) for place in _places(group)
    }
    for row, column in zip(rows, columns, strict=True):
        if row in found and column < settable:
            found[row].append(column)
    return {place: tuple(sorted(columns)) for place, columns in found.items()}


def _check_clocks(
    model: Model, interface: Interface, coefficients: Traced, schedule: Traced, symbols: _Symbols
) -> None:
    """Clocks are set at initialisation: what may be tuned later must not move them."""
    values = _initial([coefficients], symbols)
    periods = casadi.substitute(casadi.vertcat(*schedule.results[1 : 1 + len(model.clocks)]), symbols.v, values)
    for variable in interface.variables[interface.parameters]:
        if variable.variability == "tunable" and casadi.depends_on(periods, symbols.v[variable.value_reference]):
            raise BuildError(
                f"{model.name}: a clock's period depends on {variable.name}, which must then not be tunable"
            )


def _by_clock(model: Model) -> list[Task]:
    """The tasks in the order of their clocks."""
    order = [clock.name for clock in model.clocks]
    for task in model.tasks:
        if task.clock not in order:
            raise BuildError(
                f"{model.name}: task {task.name} runs at a clock {task.clock!r}, which is not there "
                f"(clocks: {', '.join(order)})"
            )
    return sorted(model.tasks, key=lambda task: order.index(task.clock))


def trace(model: Model) -> Trace:
    """Call every function of ``model`` with symbols.

    Raises `BuildError` for a function that cannot be traced or returns the wrong record, a task at an unknown clock,
    and a tunable parameter that moves a clock.
    """
    interface = interface_of(model)
    symbols = _Symbols(model, interface)
    v, p, u, k, x = symbols.v, symbols.p, symbols.u, symbols.k, symbols.x
    none = casadi.SX(0, 1)
    tasks = _by_clock(model)

    def traced(name: str, purpose: str, record: type, place: slice, *arguments: Any) -> Traced:
        with _told(model, name):
            values = _scalars(_filled(model, name, record, getattr(model, name)(*arguments)))
        return Traced(name, purpose, (v, none), values, _places(place))

    with _as_written():
        coefficients = traced(
            "coefficients", "What follows from the parameters.", model.Coefficients, interface.coefficients, p
        )
        initial_state = traced("initial_state", "The state at the start time.", model.State, interface.state, p, k, u)
        outputs = traced("outputs", "What the model shows.", model.Outputs, interface.outputs, x, p, k)
        schedule = _schedule(model, symbols, tasks)
        limits = _limits(model, symbols)
        steps = tuple(_task(model, symbols, task) for task in tasks)
    derivatives = tuple(_derivative(function, symbols) for function in (coefficients, initial_state, outputs))
    _check_clocks(model, interface, coefficients, schedule, symbols)
    return Trace(
        model,
        interface,
        coefficients,
        initial_state,
        outputs,
        schedule,
        limits,
        derivatives,
        steps,
        _dependencies((coefficients, initial_state, outputs), symbols),
    )


class Running(NamedTuple):
    """What runs with given parameters: the outputs, and one step for each task that does not rest.

    `errors` are the rounding errors that come after the normals of each step in its ``arguments[1]``.
    """

    interface: Interface
    outputs: Traced
    tasks: tuple[Task, ...]
    steps: tuple[Traced, ...]
    errors: tuple[int, ...]


def _with_errors(model: Model, symbols: _Symbols, task: Task, step: Callable[..., Any]) -> tuple[Traced, int]:
    """A step in which rounding x to a whole number adds an error e to it, e being a further draw."""
    errors: list[Any] = []

    def passed(x: Any) -> Any:
        errors.append(casadi.SX.sym("e"))
        return x + errors[-1]

    with rounding_of_symbols(passed):
        traced = _step(model, symbols, task.name, task, step)
    values, draws = traced.arguments
    return traced._replace(arguments=(values, casadi.vertcat(draws, *errors))), len(errors)


def trace_running(model: Model, parameters: Any, rounded: bool = True) -> Running:
    """Call with symbols only what these parameters choose; `rounded` false lets signals pass where they are rounded.

    Raises `BuildError` for a function that cannot be traced.
    """
    interface = interface_of(model)
    symbols = _Symbols(model, interface)
    chosen = [(task, step) for task in _by_clock(model) if (step := task.chosen(parameters)) is not None]
    with _as_written():
        if rounded:
            steps = [(_step(model, symbols, task.name, task, step), 0) for task, step in chosen]
        else:
            steps = [_with_errors(model, symbols, task, step) for task, step in chosen]
        with _told(model, "outputs"), rounding_of_symbols(lambda x: x) if not rounded else nullcontext():
            shown = model.outputs(symbols.x, symbols.p, symbols.k)
            values = _scalars(_filled(model, "outputs", model.Outputs, shown))
    outputs = Traced(
        "outputs", "What the model shows.", (symbols.v, casadi.SX(0, 1)), values, _places(interface.outputs)
    )
    return Running(
        interface,
        outputs,
        tuple(task for task, _ in chosen),
        tuple(step for step, _ in steps),
        tuple(errors for _, errors in steps),
    )
