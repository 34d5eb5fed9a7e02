"""The pages inside an FMU: its reference page, written from the records, and what it needs from the host."""

from __future__ import annotations

import html
import re
from collections.abc import Mapping

from ..models.record import Boolean, Enumeration, Real, allowed
from ..models.sensors.datasheet import CONFIDENCE, READINGS, UNSURE, Origin, differs_from_piece_to_piece
from ..models.sensors.devices import DEVICES, origins, parameters
from ..models.system import Model
from .catalogue import Entry, Kind
from .interface import Variable, interface_of
from .units import completed, display_of
from .wording import descriptions

_EXTERNAL_DEPENDENCIES: dict[Kind, str] = {
    "native": """\
This FMU is compiled C and needs nothing from the machine that runs it but the C library: on Linux glibc 2.17 or later,
on Windows the Universal C Runtime (part of Windows 10 and later), on macOS version 11 or later.

The C sources lie in sources/ (fmu.c is the one to compile, with the headers of FMI 2.0): a platform that is not in
binaries/ is one compilation away, for instance with "fmpy compile".
""",
    "python": """\
This FMU runs Python. It carries its own sources and pythonfmu 0.7; it needs from the machine that runs it

- CPython 3.11 or later, 64 bit (Windows or Linux on x86-64), nothing installed into it;
- on Windows, python3.dll on the PATH;
- on Linux, a host program that has libpython in it: any Python program (FMPy, libcosimpy, ecospy, ...), or another one
  started with LD_PRELOAD=<path of libpython3.x.so>; and GLIBC 2.32, GLIBCXX 3.4.30 or later.

Unpack it under a path of plain characters (letters, digits, "_", "-", "~", blanks): pythonfmu's binary crashes on a
resource location with other characters ("%.." escapes, as for umlauts), and on one written "file:/" without "//".
""",
}


def external_dependencies(kind: Kind) -> str:
    """documentation/externalDependencies.txt."""
    return _EXTERNAL_DEPENDENCIES[kind]


_STYLE = """
body { font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 75rem; padding: 0 1rem; color: #1d2733; }
table { border-collapse: collapse; width: 100%; margin-bottom: 2rem; }
th, td { text-align: left; vertical-align: top; padding: .25rem .6rem; border-bottom: 1px solid #d7dde4; }
th { background: #eef2f6; } td:first-child { font-family: ui-monospace, monospace; white-space: nowrap; }
td:nth-child(2), td:nth-child(5) { white-space: nowrap; }
td:nth-child(4) { min-width: 9rem; } td:last-child { width: 36%; }
"""

_REFUSAL: dict[Kind, str] = {
    "native": "fmi2Error, nothing of it is stored, and its reason is written to the log",
    "python": "fmi2Fatal (pythonfmu 0.7 has no other way), nothing of it is stored, and its reason is written to the "
    "log (with logging on) and to stderr",
}

_ERRORS = """\
A value out of its range, a fixed parameter set after initialisation, a call at the wrong time, a step from a wrong
communication point: the call returns {refusal}, for a value as
<code>instance.variable = value unit: why (allowed range)</code>. The instance is whole: it can be set rightly, reset
or freed. The output <code>refused_calls</code> counts such calls, for masters that do not look at what a call
returns.</p>
<p>Values that are each in their range but do not go together can only be judged once all are set. They are stored;
fmi2ExitInitializationMode, the next step or the next reading of a calculated value refuses them in the same way, again
and again until they agree.</p>
<p>When the model itself fails in a step, the instance stops: values can be read, further steps and settings are
refused until it is reset or a saved state is restored."""

_SOURCES: dict[Kind, str] = {
    "native": """\
The C sources lie in <code>sources/</code>; they are written from the same Python source that the Python kind of this
FMU runs, and give the same bits. Real inputs may be given with their first derivatives (fmi2SetRealInputDerivatives):
they then follow a slope within the next step. Directional derivatives are exact.""",
    "python": "The Python sources lie in <code>resources/</code>.",
}

_CONVENTIONS = """\
Units are SI, temperatures in K; a unit in brackets is for showing. Body axes b are right, forward, up (elements 1, 2, 3
of a vector); navigation axes n are east, north, up. Yaw is clockwise from north seen from above, so a positive rate
about the up axis makes yaw fall; pitch is nose up; roll is right side down. Specific force is what an accelerometer
feels: +g upward at rest. A body's rate is against inertial space and includes the Earth's. A quaternion is scalar
first and turns b into n."""


def _start(variable: Variable) -> str:
    if variable.start is None:
        return ""
    if isinstance(variable.fact, Enumeration):
        return variable.fact.items[int(variable.start) - 1].name
    if isinstance(variable.start, bool):
        return str(variable.start).lower()
    display = _display(variable)
    shown = ""
    if display is not None and variable.start:
        factor, offset = display_of(display, variable.fact.unit)
        shown = f" ({factor * variable.start + offset:.6g} {display})"
    return f"{variable.start:.10g}{shown}"


def _display(variable: Variable) -> str | None:
    """The unit that values are shown in, None if it is the variable's own."""
    return completed(variable.fact).display if isinstance(variable.fact, Real) else None


def _unit(variable: Variable) -> str:
    unit = "" if variable.fact.unit == "1" else variable.fact.unit
    display = _display(variable)
    return unit if display is None else f"{unit} ({display})"


def _values(variable: Variable) -> list[str]:
    """What the variable may be, a line each."""
    fact = variable.fact
    if isinstance(fact, Enumeration):
        return [f"{number} {item.name}: {item.description}" for number, item in enumerate(fact.items, 1)]
    is_bounded = isinstance(fact, Boolean) or not fact.min is fact.max is None
    if variable.start is None and not is_bounded:
        return []
    # without the unit, which has a column of its own
    return [re.sub(rf" {re.escape(fact.unit)}(?= or |$)", "", allowed(fact)).replace("any finite number", "any")]


def _row(variable: Variable, description: str, source: list[str]) -> str:
    cells = (
        [variable.name],
        [_unit(variable)],
        [_start(variable)],
        _values(variable),
        [variable.variability],
        *([source] if source else []),
        [description],
    )
    return "<tr>" + "".join(f"<td>{'<br>'.join(map(html.escape, cell))}</td>" for cell in cells) + "</tr>"


def _table(described: list[tuple[Variable, str]], sources: Mapping[str, str]) -> str:
    has_sources = any(variable.name in sources for variable, _ in described)
    names = ("name", "unit", "start", "values", "variability", *(["source"] if has_sources else []), "meaning")
    head = "".join(f"<th>{name}</th>" for name in names)
    rows = "\n".join(
        _row(variable, description, [sources.get(variable.name, "")] if has_sources else [])
        for variable, description in described
    )
    return f"<table>\n<tr>{head}</tr>\n{rows}\n</table>\n"


def _by_record(described: list[tuple[Variable, str]], prefix: str) -> dict[str, list[tuple[Variable, str]]]:
    """Variables by the record that they belong to; those of no record of their own come first, under ``""``."""
    groups: dict[str, list[tuple[Variable, str]]] = {"": []}
    for variable, description in described:
        record, dot, _ = variable.name.removeprefix(prefix).partition(".")
        groups.setdefault(record.partition("[")[0] if dot else "", []).append((variable, description))
    return {record: group for record, group in groups.items() if group}


def _section(title: str, described: list[tuple[Variable, str]], prefix: str | None, sources: Mapping[str, str]) -> str:
    """One heading with its table, or with a table for each record if a prefix of the names is given."""
    if not described:
        return ""
    groups = {"": described} if prefix is None else _by_record(described, prefix)
    tables = ((f"<h3>{record}</h3>\n" if record else "") + _table(group, sources) for record, group in groups.items())
    return f"<h2>{title}</h2>\n{''.join(tables)}"


_UNSURE_MARK = "(?)"
"""Before a number that the part's own sheet may contradict."""


def _source(variable: Variable, origin: Origin, nominal: float) -> str:
    is_own = variable.start != nominal
    if is_own and not differs_from_piece_to_piece(origin):
        return "chosen when this FMU was built"
    mark = f"{_UNSURE_MARK} " if origin.confidence in UNSURE else ""
    number = f"this piece's; all pieces: {origin.text}" if is_own else origin.text
    return f"{mark}{number}: {origin.source} [{origin.confidence}]"


def _sources(entry: Entry, variables: tuple[Variable, ...]) -> dict[str, str]:
    """Where the parameters' start values come from and how sure they are, by name; for sensors only."""
    if not entry.device:
        return {}
    found, nominal = origins(entry.device), parameters(entry.device)
    return {
        variable.name: _source(variable, found[variable.name], nominal[variable.name])
        for variable in variables
        if variable.name in found
    }


def _legend(entry: Entry) -> str:
    """What the column with the sources says."""
    if not entry.device:
        return ""
    kinds = "".join(
        f"<li>{f'{_UNSURE_MARK} ' if name in UNSURE else ''}<b>{name}</b>: {html.escape(meaning)}</li>\n"
        for name, meaning in CONFIDENCE.items()
    )
    readings = "".join(f"<li><b>{name}</b>: {html.escape(meaning)}</li>\n" for name, meaning in READINGS.items())
    return f"""<h2>Sources of the parts' numbers</h2>
<p>Parameters of the parts ({html.escape(DEVICES[entry.device].description)}) show in the column "source" the number as
the datasheet has it, where it stands, and in brackets how sure it is. {_UNSURE_MARK} marks what the part's own sheet
may contradict.</p>
<ul>
{kinds}</ul>
<p>What differs from piece to piece has a tolerance, which a specimen is drawn from as it says:</p>
<ul>
{readings}</ul>
"""


def _with_contents(body: str) -> str:
    """A page's body with a list of its headings before the first of them; a record is listed after its heading."""
    links: list[str] = []

    def named(heading: re.Match[str]) -> str:
        level, text = heading[1], heading[2]
        name = f"{len(links)}-{re.sub(r'[^a-z0-9]+', '-', text.lower())}"
        links.append(f'{"<br>" if level == "2" and links else ""}<a href="#{name}">{text}</a>')
        return f'<h{level} id="{name}">{text}</h{level}>'

    before, first, after = body.partition("<h2>")
    rest = re.sub(r"<h([23])>(.*?)</h\1>", named, first + after)
    return f"{before}<p>{' '.join(links)}</p>\n{rest}"


def index_page(model: Model, entry: Entry, kind: Kind, version: str) -> str:
    """documentation/index.html: conventions, errors, and every variable with unit, range and meaning."""
    interface = interface_of(model)
    described = list(zip(interface.shown, descriptions(interface.shown), strict=True))
    table_sources = _sources(entry, interface.variables)
    sections = (
        ("Inputs", "input", None),
        ("Outputs", "output", None),
        ("Parameters", "parameter", ""),
        ("Calculated parameters", "calculatedParameter", "coefficient."),
        ("State", "local", "state."),
    )
    tables = "".join(
        _section(heading, [pair for pair in described if pair[0].causality == causality], prefix, table_sources)
        for heading, causality, prefix in sections
    )
    title = html.escape(model.name)
    body = _with_contents(f"""\
<h1>{title}</h1>
<p>{html.escape(model.description)}</p>
<p>{html.escape(entry.about)}</p>
<h2>Axes, signs and units</h2>
<p>{html.escape(_CONVENTIONS)}</p>
<h2>Use</h2>
<p>FMI 2.0 for co-simulation, attitude-fmu {html.escape(version)}. Communication steps of any length give the same
results at common times for the same inputs. {_SOURCES[kind]}</p>
<h2>Errors</h2>
<p>{_ERRORS.format(refusal=_REFUSAL[kind])}</p>
{_legend(entry)}{tables}""")
    return f"""<!DOCTYPE html>
<html lang="en">
<head><meta charset="utf-8"><title>{title}</title><style>{_STYLE}</style></head>
<body>
{body}</body>
</html>
"""
