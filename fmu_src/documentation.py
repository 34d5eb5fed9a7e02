"""The pages inside an FMU: its reference page, written from the records, and what it needs from the host."""

from __future__ import annotations

import html

from ..models.record import Enumeration, allowed
from ..models.system import Model
from .catalogue import Entry
from .interface import Variable, interface_of

EXTERNAL_DEPENDENCIES = """\
This FMU runs Python. It carries its own sources and pythonfmu 0.7; it needs from the machine that runs it

- CPython 3.11 or later, 64 bit (Windows or Linux on x86-64), nothing installed into it;
- on Windows, python3.dll on the PATH;
- on Linux, a host program that has libpython in it: any Python program (FMPy, libcosimpy, ecospy, ...), or another one
  started with LD_PRELOAD=<path of libpython3.x.so>; and GLIBC 2.32, GLIBCXX 3.4.30 or later.

Unpack it under a path of plain characters (letters, digits, "_", "-", "~", blanks): pythonfmu's binary crashes on a
resource location with other characters ("%.." escapes, as for umlauts), and on one written "file:/" without "//".
"""

_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 75rem; padding: 0 1rem; color: #1d2733; }
table { border-collapse: collapse; width: 100%; margin-bottom: 2rem; }
th, td { text-align: left; vertical-align: top; padding: .25rem .6rem; border-bottom: 1px solid #d7dde4; }
th { background: #eef2f6; } td:first-child { font-family: ui-monospace, monospace; white-space: nowrap; }
"""

_ERRORS = """\
A value out of its range, a fixed parameter set after initialisation, a step from a wrong communication point: the
call returns fmi2Fatal (pythonfmu 0.7 has no other way), nothing of it is stored, and its reason is written to the log
(with logging on) and to stderr as <code>instance.variable = value unit: why (allowed range)</code>. The instance is
whole: it can be set rightly, reset or freed. After a failed step, reset it or restore a saved state."""


def _start(variable: Variable) -> str:
    if variable.start is None:
        return ""
    if isinstance(variable.fact, Enumeration):
        return variable.fact.items[int(variable.start) - 1].name
    return str(variable.start).lower() if isinstance(variable.start, bool) else f"{variable.start:.10g}"


def _row(variable: Variable) -> str:
    fact = variable.fact
    unit = "" if fact.unit == "1" else fact.unit
    display = getattr(fact, "display", None)
    cells = (
        variable.name,
        unit if display is None else f"{unit} ({display})",
        _start(variable),
        allowed(fact) if variable.start is not None else "",
        variable.variability,
        fact.description,
    )
    return "<tr>" + "".join(f"<td>{html.escape(cell)}</td>" for cell in cells) + "</tr>"


def _table(title: str, variables: tuple[Variable, ...]) -> str:
    if not variables:
        return ""
    head = "".join(f"<th>{name}</th>" for name in ("name", "unit", "start", "allowed", "variability", "meaning"))
    rows = "\n".join(_row(variable) for variable in variables)
    return f"<h2>{title}</h2>\n<table>\n<tr>{head}</tr>\n{rows}\n</table>\n"


def index_page(model: Model, entry: Entry, version: str) -> str:
    """documentation/index.html: every variable with unit, range and meaning."""
    interface = interface_of(model)
    groups = (
        ("Inputs", interface.inputs),
        ("Outputs", interface.outputs),
        ("Parameters", interface.parameters),
        ("Calculated parameters", interface.coefficients),
        ("State", interface.state),
    )
    tables = "".join(_table(title, interface.variables[place]) for title, place in groups)
    title = html.escape(model.name)
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title><style>{_STYLE}</style></head>
<body>
<h1>{title}</h1>
<p>{html.escape(model.description)}</p>
<p>{html.escape(entry.about)}</p>
<p>FMI 2.0 for co-simulation, attitude-fmu {html.escape(version)}. Units are SI; the unit in brackets is for showing.
Communication steps of any length give the same results at common times for the same inputs. The Python sources lie
in <code>resources/</code>.</p>
<h2>Errors</h2>
<p>{_ERRORS}</p>
{tables}</body>
</html>
"""
