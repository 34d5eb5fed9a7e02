"""A coupled system: FMUs, the connections between them and the parameter values that they start with.

The file form of a system is the SSP archive (module `ssp`); `check` says whether a system can run.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

from attitude_fmu.fmu_src.errors import did_you_mean

from .errors import SystemRefusedError
from .interface import Interface, Unit, Value, Variable, read_interface

_WHOLE = {"Integer", "Boolean", "Enumeration"}


@dataclass(frozen=True, init=False)
class Component:
    """An FMU under the name that it has in the system."""

    name: str
    fmu: Path

    def __init__(self, name: str, fmu: Path | str) -> None:
        object.__setattr__(self, "name", name)
        object.__setattr__(self, "fmu", Path(fmu))


class Port(NamedTuple):
    """A variable of a component."""

    component: str
    variable: str

    def __str__(self) -> str:
        return f"{self.component}.{self.variable}"


class Connection(NamedTuple):
    """A wire from an output to an input."""

    source: Port
    target: Port

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


class ParameterSet(NamedTuple):
    """Values under the names ``component.variable``; `units` are those that were given with a value."""

    name: str
    values: Mapping[str, Value]
    units: Mapping[str, Unit] = {}


@dataclass(frozen=True)
class System:
    """FMUs, the wires between them, their values (a later set wins) and the time span (s) of an experiment."""

    name: str
    components: tuple[Component, ...]
    connections: tuple[Connection, ...] = ()
    parameter_sets: tuple[ParameterSet, ...] = ()
    start_time: float = 0.0
    stop_time: float | None = None
    description: str = ""

    def with_values(self, name: str, values: Mapping[str, Value]) -> System:
        """The same system with one more parameter set, which wins over those before it."""
        return self.with_set(ParameterSet(name, values)) if values else self

    def with_set(self, parameter_set: ParameterSet) -> System:
        """The same system with one more parameter set, which wins over those before it."""
        return replace(self, parameter_sets=(*self.parameter_sets, parameter_set))


def connect(source: str, target: str, *pairs: str | tuple[str, str]) -> tuple[Connection, ...]:
    """Wires from one component to another, each ``"name"`` or ``("output", "input")``.

    A name that ends in ``[:3]`` stands for its first three elements, ``[1]`` to ``[3]``.
    """
    wires = []
    for pair in pairs:
        start, end = (pair, pair) if isinstance(pair, str) else pair
        for first, second in zip(_elements(start), _elements(end), strict=True):
            wires.append(Connection(Port(source, first), Port(target, second)))
    return tuple(wires)


def _elements(name: str) -> list[str]:
    stem, colon, count = name.removesuffix("]").rpartition("[:")
    return [f"{stem}[{i + 1}]" for i in range(int(count))] if colon else [name]


def port_of(name: str, components: Iterable[str]) -> Port:
    """The port that ``component.variable`` names.

    Raises `SystemRefusedError` if no component is so named.
    """
    components = list(components)
    for component in sorted(components, key=len, reverse=True):
        if name.startswith(component + "."):
            return Port(component, name[len(component) + 1 :])
    first = name.split(".", 1)[0]
    raise SystemRefusedError(
        f"{name}: no component is called {first!r}{did_you_mean(first, components)} "
        f"(components: {', '.join(components)})"
    )


def interfaces_of(system: System) -> dict[str, Interface]:
    """What each component offers, by its name.

    Raises `SystemRefusedError` for a missing or unreadable FMU, or a name used twice.
    """
    found: dict[str, Interface] = {}
    read: dict[Path, Interface] = {}
    for component in system.components:
        if component.name in found:
            raise SystemRefusedError(f"two components are called {component.name}; rename one")
        try:
            if component.fmu not in read:
                read[component.fmu] = read_interface(component.fmu)
            found[component.name] = read[component.fmu]
        except SystemRefusedError as error:
            raise SystemRefusedError(f"component {component.name}: {error}") from error
    if not found:
        raise SystemRefusedError(f"system {system.name} has no components")
    return found


def start_values(system: System, interfaces: Mapping[str, Interface]) -> dict[Port, Value]:
    """Every value that the system's parameter sets give, of the variable's own type, later sets winning.

    Raises `SystemRefusedError` for an unknown name, a value of the wrong kind, or a variable that cannot be set.
    """
    wired = {connection.target: connection for connection in system.connections}
    values: dict[Port, Value] = {}
    for parameter_set in system.parameter_sets:
        for name, given in parameter_set.values.items():
            port = port_of(name, interfaces)
            variable = _variable(port, interfaces)
            if not variable.settable:
                raise SystemRefusedError(
                    f"{port} is {_article(variable.causality)}, which cannot be set; parameters and inputs can"
                )
            if port in wired:
                source = wired[port].source
                hint = _parameters_behind(source, interfaces)
                raise SystemRefusedError(f"{port} cannot be set: {source} is connected to it{hint}")
            if name in parameter_set.units:
                _check_given_unit(port, parameter_set.units[name], variable, interfaces)
            try:
                values[port] = variable.value(given)
            except SystemRefusedError as error:
                raise SystemRefusedError(f"{port.component}.{error}") from None
    return values


def _parameters_behind(source: Port, interfaces: Mapping[str, Interface]) -> str:
    """A hint that names the parameters of a component which are called like its output."""
    stem = source.variable.partition("[")[0]
    variables = interfaces[source.component].variables.values() if source.component in interfaces else ()
    found = [v.name for v in variables if v.causality == "parameter" and v.settable and stem in v.name]
    return f"; set {' or '.join(f'{source.component}.{name}' for name in found[:3])}" if found else ""


def parameters_used(system: System, interfaces: Mapping[str, Interface]) -> ParameterSet:
    """Every parameter of every component with the value that it starts with, defaults included."""
    given = start_values(system, interfaces)
    values: dict[str, Value] = {}
    for component, interface in interfaces.items():
        for variable in interface.variables.values():
            port = Port(component, variable.name)
            value = given.get(port, variable.start_value if variable.causality == "parameter" else None)
            if variable.settable and value is not None:
                values[str(port)] = value
    return ParameterSet(f"{system.name}_parameters", values)


def check(system: System) -> dict[str, Interface]:
    """Say whether the system can run; gives what each component offers.

    Raises `SystemRefusedError` with the first thing that is wrong: a missing FMU, an unknown variable, a connection
    of types or units that do not fit, an input connected twice, a value that cannot be set.
    """
    interfaces = interfaces_of(system)
    sources: dict[Port, Port] = {}
    for connection in system.connections:
        _check_connection(connection, interfaces)
        if connection.target in sources:
            raise SystemRefusedError(
                f"input {connection.target} is connected twice, from {sources[connection.target]} and from "
                f"{connection.source}; remove one connection"
            )
        sources[connection.target] = connection.source
    start_values(system, interfaces)
    return interfaces


def _article(causality: str) -> str:
    shown = {"calculatedParameter": "calculated parameter", "local": "local variable"}.get(causality, causality)
    return ("an " if shown[0] in "aeiou" else "a ") + shown


def _variable(port: Port, interfaces: Mapping[str, Interface]) -> Variable:
    if port.component not in interfaces:
        raise SystemRefusedError(
            f"no component is called {port.component!r}{did_you_mean(port.component, interfaces)} "
            f"(components: {', '.join(interfaces)})"
        )
    variables = interfaces[port.component].variables
    if port.variable not in variables:
        model = interfaces[port.component].model_name
        hint = did_you_mean(port.variable, variables)
        raise SystemRefusedError(f"{port}: {model} has no variable {port.variable!r}{hint}")
    return variables[port.variable]


def _check_connection(connection: Connection, interfaces: Mapping[str, Interface]) -> None:
    try:
        source, target = (_variable(port, interfaces) for port in connection)
    except SystemRefusedError as error:
        raise SystemRefusedError(f"connection {connection}: {error}") from None
    if source.causality != "output":
        raise SystemRefusedError(
            f"connection {connection}: {connection.source} is {_article(source.causality)}; a connection starts "
            "at an output"
        )
    if target.causality != "input":
        raise SystemRefusedError(
            f"connection {connection}: {connection.target} is {_article(target.causality)}; a connection ends "
            "at an input"
        )
    _check_types(connection, source, target)
    _check_units(connection, source, target, interfaces)


def _check_types(connection: Connection, source: Variable, target: Variable) -> None:
    fits = source.type == target.type or {source.type, target.type} <= _WHOLE
    if source.type == "String" or not fits:
        raise SystemRefusedError(
            f"connection {connection}: {source.type} does not fit {target.type}; connect variables of one type "
            "(Integer, Boolean and Enumeration also fit each other)"
        )
    if source.type == target.type == "Enumeration" and source.items != target.items:
        raise SystemRefusedError(
            f"connection {connection}: the enumerations {source.type_name} and {target.type_name} have different "
            "choices; connect enumerations of one type"
        )


def _check_units(
    connection: Connection, source: Variable, target: Variable, interfaces: Mapping[str, Interface]
) -> None:
    # a variable without a unit takes and gives plain numbers
    if source.unit is None or target.unit is None or source.unit == target.unit:
        return
    first = interfaces[connection.source.component].units.get(source.unit)
    second = interfaces[connection.target.component].units.get(target.unit)
    if first is not None and second is not None and first.same_quantity(second) and any(first.exponents):
        return
    raise SystemRefusedError(
        f"connection {connection}: unit {source.unit} does not fit {target.unit}{_conversion(first, second)}"
    )


def _check_given_unit(port: Port, given: Unit, variable: Variable, interfaces: Mapping[str, Interface]) -> None:
    own = interfaces[port.component].units.get(variable.unit or "")
    if variable.unit is None or (given.name == variable.unit if own is None else given.same_quantity(own)):
        return
    raise SystemRefusedError(f"{port} is given in {given.name}, not in {variable.unit}{_conversion(given, own)}")


def _conversion(first: Unit | None, second: Unit | None) -> str:
    if first is None or second is None or first.exponents != second.exponents or not any(first.exponents):
        return "; these are different quantities, connect another variable"
    factor = first.factor / second.factor
    offset = (first.offset - second.offset) / second.factor
    shown = f"{factor:.9g} * value" + (f" + {offset:.9g}" if offset else "")
    return f"; use one unit on both sides (here {shown} would convert), units are not converted on the way"
