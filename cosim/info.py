"""What can be set and recorded in an FMU or a coupled system, as a list."""

from __future__ import annotations

import re
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.padding import Padding
from rich.text import Text

from attitude_fmu.fmu_src.catalogue import Kind

from .errors import SystemRefusedError
from .interface import Interface, Value, Variable, read_interface
from .scenarios import opened
from .system import Port, interfaces_of, start_values

_SETTABLE, _OUTPUTS, _REST = "What --set takes", "Outputs, for --record", "The rest, for --record"
_GROUPS = (_SETTABLE, _OUTPUTS, _REST)


class _Listed(NamedTuple):
    """What there is to list: the FMUs, the values that the system gives, and its wires by their targets."""

    interfaces: Mapping[str, Interface]
    given: Mapping[Port, Value]
    wired: Mapping[Port, str]


class _Line(NamedTuple):
    port: Port
    variable: Variable
    start: Value | None


def show_info(what: str, dist: Path, kind: Kind, pattern: str, everything: bool) -> None:
    """List what an FMU, an .ssp file or a scenario offers, of which the name contains `pattern`.

    In `pattern` ``*`` stands for anything; case does not matter.

    Raises `SystemRefusedError` if nothing has it in its name.
    """
    listed = _listed(what, dist, kind)
    sought = re.compile(re.escape(pattern).replace(r"\*", ".*"), re.IGNORECASE)
    groups = _grouped(listed, sought)
    wires = [wire for wire in listed.wired.values() if sought.search(wire)]
    shown = {group: lines for group, lines in groups.items() if lines and (everything or group != _REST)}
    if not shown and not wires:
        more = "" if everything else "; --all shows the rest"
        raise SystemRefusedError(f"{what} has nothing with {pattern!r} in its name{more}")
    _print_groups(shown, wires)


def _listed(what: str, dist: Path, kind: Kind) -> _Listed:
    if what.lower().endswith(".fmu"):
        return _Listed({"": read_interface(Path(what))}, {}, {})
    with opened(what, dist, kind) as (system, _):
        interfaces = interfaces_of(system)
        wired = {wire.target: str(wire) for wire in system.connections}
        return _Listed(interfaces, start_values(system, interfaces), wired)


def _grouped(listed: _Listed, sought: re.Pattern[str]) -> dict[str, list[_Line]]:
    groups: dict[str, list[_Line]] = {group: [] for group in _GROUPS}
    for component, interface in listed.interfaces.items():
        for variable in interface.variables.values():
            port = Port(component, variable.name)
            if sought.search(_full_name(port)):
                start = listed.given.get(port, variable.start)
                groups[_group_of(variable, port in listed.wired)].append(_Line(port, variable, start))
    return groups


def _full_name(port: Port) -> str:
    return str(port) if port.component else port.variable


def _group_of(variable: Variable, is_wired: bool) -> str:
    if variable.causality == "output":
        return _OUTPUTS
    settable = variable.settable and variable.causality in ("parameter", "input") and not is_wired
    return _SETTABLE if settable else _REST


def _print_groups(groups: Mapping[str, list[_Line]], wires: list[str]) -> None:
    # a pipe gets whole lines, a terminal what fits
    console = Console() if sys.stdout.isatty() else Console(width=1000)
    for group, lines in groups.items():
        console.print(group, style="bold", highlight=False)
        for line in lines:
            console.print(Padding(_head(line, with_range=group != _OUTPUTS), (0, 0, 0, 2), expand=False))
            if line.variable.description:
                console.print(Padding(Text(line.variable.description), (0, 0, 0, 6), expand=False))
    if wires:
        console.print("Connections", style="bold", highlight=False)
    for wire in wires:
        console.print(Padding(Text(wire), (0, 0, 0, 2), expand=False))


def _head(line: _Line, *, with_range: bool) -> Text:
    """The name, what it starts with and what it may be, as text: names with brackets are no markup."""
    head = Text(_full_name(line.port), style="cyan").append(_start(line.variable, line.start), style="default")
    choices = ", ".join(f"{item.value} {item.name}" for item in line.variable.items)
    allowed = choices or line.variable.allowed
    if allowed and with_range:
        head.append(f"  ({allowed})", style="dim")
    return head


def _start(variable: Variable, value: Value | None) -> str:
    unit = f" {variable.unit}" if variable.unit and variable.unit != "1" else ""
    return unit and f" [{unit.strip()}]" if value is None else f" = {_short(variable, value)}{unit}"


def _short(variable: Variable, value: Value) -> str:
    if variable.type == "Enumeration":
        return next((item.name for item in variable.items if str(item.value) == str(value)), str(value))
    return f"{float(value):.6g}" if variable.type == "Real" else str(value)
