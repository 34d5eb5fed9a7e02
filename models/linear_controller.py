"""A discrete linear controller: limits with anti-windup, an operating point, bumpless switching on, reset.

At each tick, with e = u - u0 and r the tracked outputs:

    v  = C x + D e + y0             what the controller asks for
    y  = clip(v, lower, upper)      what it gives until the next tick; clip(r, lower, upper) while not enabled
    x <- A x + B e + L (y - v)      L is the anti-windup gain

At a tick with `reset`, x is the initial state before all this. At the first tick with `enabled` after one without,
x <- x + M (r - v) comes before, M being the bumpless gain, C M = 1: the output goes on from r.

The matrices and the names of the signals are data: `linear_controller` makes the records for those at hand.

Anti-windup and tracking in observer form: Astrom, Wittenmark, Computer-Controlled Systems, 3rd ed., section 9.4.
"""

from __future__ import annotations

import re
import sys
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from math import inf
from typing import Annotated, Any, NamedTuple

from .record import Boolean, Fact, Real, flatten, leaves, unflatten
from .scalar import Scalar, both, clip, either, where
from .system import Clock, Model, Rule, Task

NO_LIMIT = sys.float_info.max
"""A limit that never binds."""

Matrix = tuple[tuple[float, ...], ...]


class Signal(NamedTuple):
    """One scalar: structured name, unit, text, value at the operating point (of a state: at the start), limits."""

    name: str
    unit: str = "1"
    description: str = ""
    offset: float = 0.0
    lower: float = -NO_LIMIT
    upper: float = NO_LIMIT


class Controller(NamedTuple):
    """The data of a controller of n states, m inputs and p outputs, with `period` in s.

    Shapes: A n x n, B n x m, C p x n, D p x m, `anti_windup_gain` and `bumpless_gain` n x p. Names are structured FMI
    names, all different; the indices of a vector are 1 to its length.
    """

    name: str
    description: str
    period: float
    inputs: tuple[Signal, ...]
    outputs: tuple[Signal, ...]
    states: tuple[Signal, ...]
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    anti_windup_gain: Matrix
    bumpless_gain: Matrix


class Coefficients(NamedTuple):
    """The clock."""

    period: Annotated[float, Real("s", "of the controller's clock")]


class _Field(NamedTuple):
    """A field of a record that is made here: its annotation and its start value."""

    kind: Any
    start: Any


def _record(name: str, fields: Mapping[str, _Field]) -> type:
    made = namedtuple(name, fields, defaults=[field.start for field in fields.values()])  # type: ignore[misc]
    made.__annotations__ = {key: field.kind for key, field in fields.items()}
    return made


def _tuple_of(kinds: Sequence[Any]) -> Any:
    return tuple.__class_getitem__(tuple(kinds))


def _whole(name: str, part: Any) -> _Field:
    """A nested mapping as one field: whole numbers count the elements of a tuple, names are fields of a record."""
    if isinstance(part, _Field):
        return part
    fields = {key: _whole(str(key), inner) for key, inner in part.items()}
    if fields and isinstance(next(iter(fields)), int):
        elements = [fields[key] for key in sorted(fields)]
        return _Field(_tuple_of([one.kind for one in elements]), tuple(one.start for one in elements))
    record = _record(name, fields)
    return _Field(record, record())


def _fields(scalars: Mapping[str, _Field]) -> dict[str, _Field]:
    """The fields of a record whose scalars have these structured names."""
    tree: dict[Any, Any] = {}
    for name, field in scalars.items():
        *stem, last = [int(key) if key.isdecimal() else key for key in re.findall(r"\w+", name)]
        part = tree
        for key in stem:
            part = part.setdefault(key, {})
        part[last] = field
    return {key: _whole(key, part) for key, part in tree.items()}


class _Vector:
    """Signals as fields of records, which keep together what the order of the signals may not."""

    def __init__(self, signals: Sequence[Signal]) -> None:
        self.signals = signals
        self.names = [leaf.name for leaf in leaves(self.record("Vector", lambda signal: signal.description))]
        self._places = [self.names.index(signal.name) for signal in signals]
        self._order = [self._places.index(place) for place in range(len(self.names))]

    def fields(
        self,
        text: Callable[[Signal], str],
        start: Callable[[Signal], float] = lambda signal: signal.offset,
        tunable: bool = False,
    ) -> dict[str, _Field]:
        """The signals as fields of a record."""
        return _fields(
            {
                signal.name: _Field(Annotated[float, Real(signal.unit, text(signal), tunable=tunable)], start(signal))
                for signal in self.signals
            }
        )

    def record(self, name: str, text: Callable[[Signal], str], *arguments: Any, **more: Any) -> type:
        """A record of the signals alone."""
        return _record(name, self.fields(text, *arguments, **more))

    def values(self, scalars: Sequence[Scalar]) -> list[Scalar]:
        """A record's scalars in the order of the signals."""
        return [scalars[place] for place in self._places]

    def scalars(self, values: Sequence[Scalar]) -> list[Scalar]:
        """The signals' values in the order of a record's scalars."""
        return [values[place] for place in self._order]


def _field_of(record: type) -> _Field:
    return _Field(record, record())


def _matrix(values: Matrix, text: str) -> _Field:
    entry = Annotated[float, Real("1", text, tunable=True)]
    return _Field(_tuple_of([_tuple_of([entry] * len(row)) for row in values]), values)


def _boolean(text: str, start: bool | float) -> _Field:
    fact: Fact = Boolean(text)
    return _Field(Annotated[bool, fact], start)


def _parameters(controller: Controller, x: _Vector, u: _Vector, y: _Vector) -> type:
    def limits(side: str) -> _Field:
        return _field_of(y.record(side, lambda _: f"{side} limit", lambda one: getattr(one, side), tunable=True))

    return _record(
        "Parameters",
        {
            "A": _matrix(controller.A, "of x <- A x + B e"),
            "B": _matrix(controller.B, "of x <- A x + B e, in the inputs' units"),
            "C": _matrix(controller.C, "of y = C x + D e, in the outputs' units"),
            "D": _matrix(controller.D, "of y = C x + D e, in the units of outputs and inputs"),
            "anti_windup_gain": _matrix(controller.anti_windup_gain, "state's change for a cut output"),
            "bumpless_gain": _matrix(controller.bumpless_gain, "state's change for an output's jump, when enabled"),
            "initial_state": _field_of(x.record("initial_state", lambda _: "state at the start and after a reset")),
            "input_offset": _field_of(u.record("input_offset", lambda _: "input at the operating point", tunable=True)),
            "output_offset": _field_of(
                y.record("output_offset", lambda _: "output at the operating point", tunable=True)
            ),
            "lower_limit": limits("lower"),
            "upper_limit": limits("upper"),
        },
    )


def _inputs(u: _Vector, y: _Vector) -> type:
    tracked = y.record("tracking", lambda _: "shown while not enabled, and where the output goes on from")
    return _record(
        "Inputs",
        {
            **u.fields(lambda signal: signal.description),
            "enabled": _boolean("the controller acts", True),
            "reset": _boolean("the state is held at its initial value", False),
            "tracking": _field_of(tracked),
        },
    )


def _state(x: _Vector, y: _Vector) -> type:
    return _record(
        "State",
        {
            **x.fields(lambda signal: signal.description),
            "output": _field_of(y.record("output", lambda _: "output until the next tick")),
            "enabled": _boolean("the controller acted at the last tick", 1.0),
        },
    )


def _outputs(y: _Vector) -> type:
    return _record(
        "Outputs",
        {**y.fields(lambda signal: signal.description), "saturated": _boolean("an output is at a limit", 0.0)},
    )


def dot(row: Sequence[Scalar], column: Sequence[Scalar]) -> Scalar:
    """Sum of the products, from the first on."""
    total = 0.0
    for a, b in zip(row, column, strict=True):
        total = total + a * b
    return total


def product(matrix: Sequence[Sequence[Scalar]], column: Sequence[Scalar]) -> list[Scalar]:
    """Matrix times column."""
    return [dot(row, column) for row in matrix]


def add(a: Sequence[Scalar], b: Sequence[Scalar]) -> list[Scalar]:
    """Sum, element by element."""
    return [one + other for one, other in zip(a, b, strict=True)]


def subtract(a: Sequence[Scalar], b: Sequence[Scalar]) -> list[Scalar]:
    """Difference, element by element."""
    return [one - other for one, other in zip(a, b, strict=True)]


def _chosen(condition: Scalar, a: Sequence[Scalar], b: Sequence[Scalar]) -> list[Scalar]:
    return [where(condition, one, other) for one, other in zip(a, b, strict=True)]


class _Law:
    """The functions of a controller's model, over the records that are made for its signals."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.x, self.u, self.y = _Vector(controller.states), _Vector(controller.inputs), _Vector(controller.outputs)
        self.Parameters = _parameters(controller, self.x, self.u, self.y)
        self.Inputs = _inputs(self.u, self.y)
        self.State = _state(self.x, self.y)
        self.Outputs = _outputs(self.y)

    def coefficients(self, _p: Any) -> Coefficients:
        """The period is what the matrices were made for."""
        return Coefficients(self.controller.period)

    def _limited(self, values: Sequence[Scalar], p: Any) -> list[Scalar]:
        low, high = self.y.values(flatten(p.lower_limit)), self.y.values(flatten(p.upper_limit))
        return [clip(*limited) for limited in zip(values, low, high, strict=True)]

    def _asked(self, x: Sequence[Scalar], e: Sequence[Scalar], p: Any) -> list[Scalar]:
        """v of the equations above."""
        return add(add(product(p.C, x), product(p.D, e)), self.y.values(flatten(p.output_offset)))

    def _state(self, x: Sequence[Scalar], y: Sequence[Scalar], enabled: Scalar) -> Any:
        return unflatten(self.State, [*self.x.scalars(x), *self.y.scalars(y), enabled])

    def initial_state(self, p: Any, _c: Coefficients, inputs: Any) -> Any:
        """What the state alone gives, or the tracked outputs, until the first tick."""
        x = self.x.values(flatten(p.initial_state))
        alone = self._asked(x, [0.0] * len(self.u.signals), p)
        enabled = where(inputs.enabled > 0.5, 1.0, 0.0)
        y = self._limited(_chosen(enabled > 0.5, alone, self.y.values(flatten(inputs.tracking))), p)
        return self._state(x, y, enabled)

    def tick(self, state: Any, inputs: Any, p: Any, _c: Coefficients, _normals: tuple[Scalar, ...]) -> Any:
        """One step of the equations above."""
        enabled, reset = inputs.enabled > 0.5, inputs.reset > 0.5
        e = subtract(self.u.values(flatten(inputs)[: len(self.u.signals)]), self.u.values(flatten(p.input_offset)))
        tracked = self.y.values(flatten(inputs.tracking))
        x = self.x.values(flatten(state)[: len(self.x.signals)])
        onwards = add(x, product(p.bumpless_gain, subtract(tracked, self._asked(x, e, p))))
        x = _chosen(both(enabled, state.enabled < 0.5), onwards, x)
        x = _chosen(reset, self.x.values(flatten(p.initial_state)), x)
        asked = self._asked(x, e, p)
        y = self._limited(_chosen(enabled, asked, tracked), p)
        cut = product(p.anti_windup_gain, subtract(y, asked))
        after = add(add(product(p.A, x), product(p.B, e)), cut)
        return self._state(after, y, where(enabled, 1.0, 0.0))

    def outputs(self, state: Any, p: Any, _c: Coefficients) -> Any:
        """What was given at the last tick."""
        y = flatten(state.output)
        binding: Scalar = False
        for value, low, high in zip(y, flatten(p.lower_limit), flatten(p.upper_limit), strict=True):
            binding = either(binding, either(value <= low, value >= high))
        return unflatten(self.Outputs, [*y, binding])

    def _rule(self, place: int) -> Rule:
        name = f"lower_limit.{self.y.names[place]}"
        return Rule(name, "above the upper limit", lambda p: (-inf, flatten(p.upper_limit)[place]))

    def model(self) -> Model:
        """All of it."""
        return Model(
            name=self.controller.name,
            description=self.controller.description,
            Parameters=self.Parameters,
            Coefficients=Coefficients,
            Inputs=self.Inputs,
            State=self.State,
            Outputs=self.Outputs,
            coefficients=self.coefficients,
            initial_state=self.initial_state,
            outputs=self.outputs,
            clocks=(Clock("controller", lambda c: c.period),),
            tasks=(Task("control", "controller", self.tick),),
            seed=lambda _p: 0,
            rules=tuple(self._rule(place) for place in range(len(self.y.signals))),
        )


def linear_controller(controller: Controller) -> Model:
    """The model of a controller, ready to run and to become an FMU.

    Raises `ValueError` for names that are no structured names.

    >>> one = ((1.0,),)
    >>> data = Controller("Sum", "", 0.01, (Signal("u"),), (Signal("y"),), (Signal("x"),), one, one, one, one, one, one)
    >>> linear_controller(data).Inputs()
    Inputs(u=0.0, enabled=True, reset=False, tracking=tracking(y=0.0))
    """
    return _Law(controller).model()
