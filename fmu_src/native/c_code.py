"""model.c: a traced model as C functions and tables for the runtime (`runtime/model.h`)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator

import casadi

from ...models.noise import stream_of
from ...models.record import Enumeration, allowed
from ...models.system import LATEST_TIME, SHORTEST_PERIOD, TIME_TOLERANCE
from ..errors import BuildError
from ..interface import Interface, Variable
from ..ports import limits_of
from ..saved_state import STAGE_NAMES, STAGES, TIME_ROUNDING, TIME_SLACK
from ..trace import Trace, Traced

_OPERATIONS = {
    casadi.OP_ASSIGN: "{0}",
    casadi.OP_ADD: "{0} + {1}",
    casadi.OP_SUB: "{0} - {1}",
    casadi.OP_MUL: "{0} * {1}",
    casadi.OP_DIV: "{0} / {1}",
    casadi.OP_NEG: "-{0}",
    casadi.OP_SQ: "{0} * {0}",
    casadi.OP_TWICE: "2.0 * {0}",
    casadi.OP_INV: "1.0 / {0}",
    casadi.OP_SQRT: "sqrt({0})",
    casadi.OP_EXP: "exp({0})",
    casadi.OP_LOG: "log({0})",
    casadi.OP_POW: "pow({0}, {1})",
    casadi.OP_CONSTPOW: "pow({0}, {1})",
    casadi.OP_SIN: "sin({0})",
    casadi.OP_COS: "cos({0})",
    casadi.OP_ATAN2: "atan2({0}, {1})",
    casadi.OP_FLOOR: "floor({0})",
    casadi.OP_FABS: "fabs({0})",
    casadi.OP_SIGN: "({0} > 0.0) - ({0} < 0.0)",
    casadi.OP_FMIN: "{0} < {1} ? {0} : {1}",
    casadi.OP_FMAX: "{0} > {1} ? {0} : {1}",
    casadi.OP_LT: "{0} < {1}",
    casadi.OP_LE: "{0} <= {1}",
    casadi.OP_EQ: "{0} == {1}",
    casadi.OP_NE: "{0} != {1}",
    casadi.OP_NOT: "{0} == 0.0",
    casadi.OP_AND: "{0} != 0.0 && {1} != 0.0",
    casadi.OP_OR: "{0} != 0.0 || {1} != 0.0",
    casadi.OP_IF_ELSE_ZERO: "{0} != 0.0 ? {1} : 0.0",
}
"""C of each of CasADi's operations on scalars that models and their derivatives use; ``where`` is two of the last."""

_UNUSED = "    (void){0};"


def number(value: float) -> str:
    """A double as C reads it back to the last bit."""
    if math.isinf(value):
        return "HUGE_VAL" if value > 0.0 else "-HUGE_VAL"
    if math.isnan(value):
        raise BuildError("a NaN in a model's constants")
    return repr(float(value))


def text(value: str) -> str:
    """A string literal: octal escapes for control characters, no trigraphs."""
    escapes = {'"': '\\"', "\\": "\\\\", "?": "\\?"}
    return '"' + "".join(f"\\{ord(c):03o}" if ord(c) < 32 else escapes.get(c, c) for c in value) + '"'


def _body(
    traced: Traced, source: str, second: str, target: str, interface: Interface, is_instance: bool
) -> Iterator[str]:
    """Declarations in single static assignment, then the stores, so that nothing is read after it is written."""
    function = casadi.Function(traced.name, list(traced.arguments), [casadi.vertcat(*traced.results)])
    names: dict[int, str] = {}
    stores = []
    for i in range(function.n_instructions()):
        operation = function.instruction_id(i)
        inputs, outputs = function.instruction_input(i), function.instruction_output(i)
        if operation == casadi.OP_OUTPUT:
            place = traced.places[outputs[1]]
            note = f" /* {interface.variables[place].name} */" if is_instance else ""
            stores.append(f"    {target}[{place}] = {names[inputs[0]]};{note}")
            continue
        note = ""
        if operation == casadi.OP_CONST:
            value = number(function.instruction_constant(i))
        elif operation == casadi.OP_INPUT:
            value = f"{(source, second)[inputs[0]]}[{inputs[1]}]"
            note = f" /* {interface.variables[inputs[1]].name} */" if inputs[0] == 0 else ""
        elif operation in _OPERATIONS:
            value = _OPERATIONS[operation].format(*[names[argument] for argument in inputs])
        else:
            raise BuildError(f"{traced.name}: no C for CasADi's operation {operation}; add it to c_code.py")
        name = f"a{i}"
        names[outputs[0]] = name
        yield f"    const double {name} = {value};{note}"
    yield from stores


def _routine(traced: Traced, interface: Interface) -> Iterator[str]:
    yield from (f"/* {traced.purpose} */", f"static void {traced.name}(double *v, const double *z)", "{")
    yield _UNUSED.format("z")
    yield _UNUSED.format("v")
    yield from _body(traced, "v", "z", "v", interface, True)
    yield from ("}", "")


def _query(traced: Traced, interface: Interface, is_instance: bool) -> Iterator[str]:
    yield from (f"/* {traced.purpose} */", f"static void {traced.name}(const double *v, double *answer)", "{")
    yield _UNUSED.format("v")
    yield _UNUSED.format("answer")
    yield from _body(traced, "v", "answer", "answer", interface, is_instance)
    yield from ("}", "")


def _table(declaration: str, rows: Iterable[str]) -> Iterator[str]:
    yield f"static const {declaration} = {{"
    yield from (f"    {row}," for row in rows)
    yield from ("};", "")


def _settable(variable: Variable) -> str:
    low, high = limits_of(variable)
    unit = "1" if isinstance(variable.fact, Enumeration) else variable.fact.unit
    fields = (
        number(variable.start),
        number(low),
        number(high),
        text(unit),
        text(allowed(variable.fact)),
        str(int(variable.variability != "fixed")),
    )
    return "{" + ", ".join(fields) + "}"


def _tables(trace: Trace) -> Iterator[str]:
    variables = trace.interface.variables
    places = {variable.name: variable.value_reference for variable in variables}
    yield from _table(
        "Variable VARIABLE[VARIABLES]",
        (
            f"{{{text(variable.name)}, {'HIDDEN' if variable.is_hidden else variable.kind.upper()}}}"
            for variable in variables
        ),
    )
    yield from _table(
        "Settable SETTABLE[OUTPUTS_AT]", (_settable(variable) for variable in variables[: trace.interface.inputs.stop])
    )
    clocks = [traced.task.clock for traced in trace.tasks]
    yield from _table(
        "Clock CLOCK[CLOCKS]",
        (
            f"{{{text(clock.name)}, {clocks.index(clock.name)}, {clocks.count(clock.name)}}}"
            for clock in trace.model.clocks
        ),
    )
    firsts = [sum(len(before.ways) for before in trace.tasks[:i]) for i in range(len(trace.tasks))]
    yield from _table(
        "Task TASK[TASKS]",
        (
            f"{{{text(task.name)}, {stream_of(task.name)}u, {task.normals}, {first}, {len(ways)}}}"
            for first, (task, ways) in zip(firsts, trace.tasks, strict=True)
        ),
    )
    yield from _table(
        "Way WAY[]", (f"{{{number(way.value)}, {way.step.name}}}" for task in trace.tasks for way in task.ways)
    )
    rules = [f"{{{places[rule.field]}, {text(rule.why)}}}" for rule in trace.model.rules]
    yield from _table("Rule RULE[]", rules or ['{0, ""}'])
    yield from _table("char *const STAGE_TEXT[]", (text(stage) for stage in STAGES))


def _sizes(trace: Trace) -> Iterator[str]:
    interface = trace.interface
    sizes = {
        "PARAMETERS": interface.parameters,
        "INPUTS": interface.inputs,
        "OUTPUTS": interface.outputs,
        "COEFFICIENTS": interface.coefficients,
        "STATES": interface.state,
    }
    yield "enum {"
    yield from (f"    {name} = {place.stop - place.start}," for name, place in sizes.items())
    yield f"    CLOCKS = {len(trace.model.clocks)},"
    yield f"    TASKS = {len(trace.tasks)},"
    yield f"    RULES = {len(trace.model.rules)},"
    yield f"    MOST_NORMALS = {max((task.task.normals for task in trace.tasks), default=0)}"
    yield from ("};", "")
    yield from (f"typedef enum {{ {', '.join(STAGE_NAMES)} }} Stage;", "")


def _constants(guid: str, fingerprint: str) -> Iterator[str]:
    yield f"#define GUID {text(guid)}"
    yield f"#define FINGERPRINT_0 0x{fingerprint[:16]}u"
    yield f"#define FINGERPRINT_1 0x{fingerprint[16:32]}u"
    yield f"#define TIME_TOLERANCE {number(TIME_TOLERANCE)}"
    yield f"#define TIME_SLACK {number(TIME_SLACK)}"
    yield f"#define TIME_ROUNDING {number(TIME_ROUNDING)}"
    yield f"#define SHORTEST_PERIOD {number(SHORTEST_PERIOD)}"
    yield f"#define LATEST_TIME {number(LATEST_TIME)}"
    yield ""


def model_source(trace: Trace, guid: str, fingerprint: str) -> str:
    """The text of model.c."""
    interface = trace.interface
    lines: list[str] = [
        f"/* {trace.model.name}: {trace.model.description}.".replace("*/", "* /"),
        "",
        "   Written by attitude-fmu from the model's Python source; v[i] is the variable with value reference i. */",
        "",
        *_constants(guid, fingerprint),
        *_sizes(trace),
        '#include "model.h"',
        "",
    ]
    for traced in (trace.coefficients, trace.initial_state, trace.outputs):
        lines += _routine(traced, interface)
    for traced in (trace.schedule, trace.limits):
        lines += _query(traced, interface, False)
    for traced in trace.derivatives:
        lines += _query(traced, interface, True)
    for task in trace.tasks:
        for way in task.ways:
            lines += _routine(way.step, interface)
    lines += _tables(trace)
    return "\n".join(lines).rstrip() + "\n"
