"""Coupled systems as files: SSP 1.0 archives (``.ssp``) and parameter sets (``.ssv``).

What is written is the subset that other tools were seen to read: one flat system of FMUs in ``resources/``, the literal
prefixes ``ssd:``, ``ssc:`` and ``ssv:``, no connectors of the system itself, parameter sets bound to components.
What is read may be laid out differently, but whatever would change the result and is not understood is refused.
"""

from __future__ import annotations

import itertools
import posixpath
import re
import zipfile
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from urllib.parse import quote, unquote

import fmpy.ssp  # type: ignore[import-untyped]
from lxml import etree  # type: ignore[import-untyped]

from .errors import ResultsError, SystemRefusedError
from .interface import Interface, Unit, Value, Variable
from .system import Component, Connection, ParameterSet, Port, System, check, port_of, start_values
from .workspace import whole_or_not

SSD = "http://ssp-standard.org/SSP1/SystemStructureDescription"
SSC = "http://ssp-standard.org/SSP1/SystemStructureCommon"
SSV = "http://ssp-standard.org/SSP1/SystemStructureParameterValues"
_PREFIXES = {"ssd": SSD, "ssc": SSC, "ssv": SSV}

_STRUCTURE = "SystemStructure.ssd"
_FMU_TYPE = "application/x-fmu-sharedlibrary"
_SET_TYPE = "application/x-ssp-parameter-set"
_ZIP_TIME = (1980, 1, 1, 0, 0, 0)
_BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")

# pictures and notes of other tools do not change what is simulated
_WITHOUT_EFFECT = {
    "Annotations",
    "ElementGeometry",
    "ConnectorGeometry",
    "ConnectionGeometry",
    "SystemGeometry",
    "GraphicalElements",
    "Enumerations",
    "Units",
}
_ADVICE = {
    "System": "a system inside a system is not supported; put all components into one flat system",
    "SignalDictionaryReference": "signal dictionaries are not supported; connect the components directly",
    "SignalDictionaries": "signal dictionaries are not supported; connect the components directly",
    "LinearTransformation": "values are not converted on the way; use one unit on both sides",
    "BooleanMappingTransformation": "values are not mapped on the way; connect variables of one type",
    "IntegerMappingTransformation": "values are not mapped on the way; connect variables of one type",
    "EnumerationMappingTransformation": "values are not mapped on the way; connect variables of one type",
    "ParameterMapping": "parameter mappings are not supported; name the parameters as the FMU does",
}


# --- writing -----------------------------------------------------------------------------------------------------


def write_ssp(system: System, path: Path | str) -> Path:
    """Write a system with its FMUs as an ``.ssp`` archive; the same system gives the same bytes.

    Raises `SystemRefusedError` if the system cannot run as described, `ResultsError` if the file cannot be written.
    """
    path = Path(path)
    interfaces = check(system)
    resources = _resource_names(system)
    parameter_sets = _sets_by_component(system, interfaces)
    members = {_STRUCTURE: _structure(system, interfaces, resources, parameter_sets)}
    for component, (name, source, values) in parameter_sets.items():
        members[source] = _parameter_set(name, values, interfaces[component].variables, {})
    for fmu, source in resources.items():
        members[source] = fmu.read_bytes()
    with whole_or_not(path) as draft, zipfile.ZipFile(draft, "w") as archive:
        for name in (_STRUCTURE, *sorted(set(members) - {_STRUCTURE})):
            entry = zipfile.ZipInfo(name, _ZIP_TIME)
            entry.compress_type = zipfile.ZIP_DEFLATED
            entry.create_system = 3
            entry.external_attr = 0o100644 << 16
            archive.writestr(entry, members[name])
    return path


def write_ssv(parameters: ParameterSet, path: Path | str, interfaces: Mapping[str, Interface]) -> Path:
    """Write a parameter set with names ``component.variable`` as an ``.ssv`` file, with the units that it gives.

    Under the component ``""`` names are those of the FMU, as a set that is bound to a component has them.

    Raises `ResultsError` if the file cannot be written.
    """
    path = Path(path)
    variables = {
        f"{component}.{name}" if component else name: variable
        for component, interface in interfaces.items()
        for name, variable in interface.variables.items()
    }
    with whole_or_not(path) as draft:
        draft.write_bytes(_parameter_set(parameters.name, parameters.values, variables, parameters.units))
    return path


def _resource_names(system: System) -> dict[Path, str]:
    names: dict[Path, str] = {}
    for component in system.components:
        if component.fmu not in names:
            names[component.fmu] = _member(component.fmu.stem, ".fmu", names.values())
    return names


def _member(stem: str, suffix: str, taken: Collection[str]) -> str:
    """A name in the archive that is plain, because not every tool unquotes, and not taken, whatever its case."""
    plain = re.sub(r"[^A-Za-z0-9_.-]", "_", stem)
    others = {name.lower() for name in taken}
    tries = (f"resources/{plain}{f'_{n}' if n > 1 else ''}{suffix}" for n in itertools.count(1))
    return next(name for name in tries if name.lower() not in others)


class _BoundSet(NamedTuple):
    """The values of one component, and where they lie in the archive."""

    name: str
    source: str
    values: dict[str, Value]


def _sets_by_component(system: System, interfaces: Mapping[str, Interface]) -> dict[str, _BoundSet]:
    sets: dict[str, _BoundSet] = {}
    for port, value in start_values(system, interfaces).items():
        if port.component not in sets:
            # one name for all, because some tools apply the sets of one name only
            name = system.parameter_sets[0].name
            taken = [one.source for one in sets.values()]
            sets[port.component] = _BoundSet(name, _member(f"{port.component}_{name}", ".ssv", taken), {})
        sets[port.component].values[port.variable] = value
    return sets


def _tag(name: str) -> str:
    prefix, local = name.split(":")
    return f"{{{_PREFIXES[prefix]}}}{local}"


def _add(parent: Any, tag: str, **attributes: str) -> Any:
    return etree.SubElement(parent, _tag(tag), attributes)


def _to_bytes(root: Any) -> bytes:
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))


def _structure(
    system: System,
    interfaces: Mapping[str, Interface],
    resources: Mapping[Path, str],
    parameter_sets: Mapping[str, _BoundSet],
) -> bytes:
    root = etree.Element(_tag("ssd:SystemStructureDescription"), {"version": "1.0", "name": system.name}, _PREFIXES)
    if system.description:
        root.set("description", system.description)
    top = _add(root, "ssd:System", name=system.name)
    elements = _add(top, "ssd:Elements")
    shown: list[tuple[Variable, Interface]] = []
    for component in system.components:
        interface = interfaces[component.name]
        bound = parameter_sets.get(component.name)
        source = quote(resources[component.fmu])
        element = _add(elements, "ssd:Component", name=component.name, type=_FMU_TYPE, source=source)
        variables = _shown(system, component, interface, set() if bound is None else set(bound.values))
        _add_connectors(element, variables)
        shown += [(variable, interface) for variable in variables]
        if bound is not None:
            bindings = _add(element, "ssd:ParameterBindings")
            _add(bindings, "ssd:ParameterBinding", type=_SET_TYPE, source=quote(bound.source))
    if system.connections:
        connections = _add(top, "ssd:Connections")
        for source_port, target_port in system.connections:
            _add(
                connections,
                "ssd:Connection",
                startElement=source_port.component,
                startConnector=source_port.variable,
                endElement=target_port.component,
                endConnector=target_port.variable,
            )
    _add_enumerations(root, [variable for variable, _ in shown])
    _add_units(root, shown)
    experiment = _add(root, "ssd:DefaultExperiment", startTime=repr(system.start_time))
    if system.stop_time is not None:
        experiment.set("stopTime", repr(system.stop_time))
    return _to_bytes(root)


def _shown(system: System, component: Component, interface: Interface, given: set[str]) -> list[Variable]:
    # an unconnected input stays out: some tools would hold it at zero instead of its start value;
    # so does an enumeration that is not wired: libcosim (2026) refuses the whole file for one
    wires = {port for connection in system.connections for port in connection}
    return [
        variable
        for name, variable in interface.variables.items()
        if Port(component.name, name) in wires
        or (
            variable.type in ("Real", "Integer", "Boolean")
            and (variable.causality == "output" or (name in given and variable.causality == "parameter"))
        )
    ]


def _add_connectors(element: Any, variables: list[Variable]) -> None:
    if not variables:
        return
    connectors = _add(element, "ssd:Connectors")
    for variable in variables:
        connector = _add(connectors, "ssd:Connector", name=variable.name, kind=variable.causality)
        attributes = {}
        if variable.type == "Real" and variable.unit:
            attributes["unit"] = variable.unit
        if variable.type == "Enumeration":
            attributes["name"] = variable.type_name or variable.name
        _add(connector, f"ssc:{variable.type}", **attributes)


def _add_enumerations(root: Any, variables: list[Variable]) -> None:
    enumerations = {v.type_name or v.name: v.items for v in variables if v.type == "Enumeration"}
    if not enumerations:
        return
    parent = _add(root, "ssd:Enumerations")
    for name, items in enumerations.items():
        enumeration = _add(parent, "ssc:Enumeration", name=name)
        for item in items:
            _add(enumeration, "ssc:Item", name=item.name, value=str(item.value))


def _add_units(root: Any, shown: list[tuple[Variable, Interface]]) -> None:
    used = {v.unit: interface.units.get(v.unit) for v, interface in shown if v.type == "Real" and v.unit}
    if not used:
        return
    _add_unit_list(root, "ssd:Units", used)


def _add_unit_list(root: Any, tag: str, used: Mapping[str, Unit | None]) -> None:
    parent = _add(root, tag)
    for name, unit in sorted(used.items()):
        base = _add(_add(parent, "ssc:Unit", name=name), "ssc:BaseUnit")
        if unit is None:
            continue
        for symbol, exponent in zip(_BASE_UNITS, unit.exponents, strict=True):
            if exponent:
                base.set(symbol, str(exponent))
        if unit.factor != 1.0:
            base.set("factor", repr(unit.factor))
        if unit.offset:
            base.set("offset", repr(unit.offset))


def _parameter_set(
    name: str, values: Mapping[str, Value], variables: Mapping[str, Variable], units: Mapping[str, Unit]
) -> bytes:
    prefixes = {"ssv": SSV, "ssc": SSC}
    root = etree.Element(_tag("ssv:ParameterSet"), {"version": "1.0", "name": name}, prefixes)
    parameters = _add(root, "ssv:Parameters")
    for key, value in values.items():
        variable = variables[key]
        parameter = _add(parameters, "ssv:Parameter", name=key)
        if about := _about(variable):
            parameter.set("description", about)
        # by number: libcosim and FMPy do not take the name of an enumeration's item
        kind = "Integer" if variable.type == "Enumeration" else variable.type
        typed = _add(parameter, f"ssv:{kind}", value=_text(variable, value))
        if key in units:
            typed.set("unit", units[key].name)
    if units:
        _add_unit_list(root, "ssv:Units", {unit.name: unit for unit in units.values()})
    return _to_bytes(root)


def _about(variable: Variable) -> str:
    unit = f" [{variable.unit}]" if variable.unit and variable.unit != "1" else ""
    choices = ", ".join(f"{item.value} {item.name}" for item in variable.items)
    return variable.description + unit + (f" ({choices})" if choices else "")


def _text(variable: Variable, value: Value) -> str:
    if variable.type == "Boolean":
        return "true" if value else "false"
    return repr(float(value)) if variable.type == "Real" else str(value)


# --- reading -----------------------------------------------------------------------------------------------------


@contextmanager
def open_ssp(path: Path | str) -> Iterator[System]:
    """Read a system from an ``.ssp`` archive; its FMUs lie in a temporary directory for as long as it is open.

    Raises `SystemRefusedError` for a file that is missing, malformed, or asks for what is not supported.
    """
    with TemporaryDirectory(prefix="attitude_fmu_") as directory:
        yield read_ssp(Path(path), Path(directory))


def read_ssp(path: Path, directory: Path) -> System:
    """Read a system from an ``.ssp`` archive, its FMUs unpacked into `directory`.

    Raises `SystemRefusedError` for a file that is missing, malformed, or asks for what is not supported.
    """
    if not path.is_file():
        raise SystemRefusedError(f"file not found: {path}")
    try:
        with zipfile.ZipFile(path) as archive:
            return _Reader(path.name, archive, directory).system()
    except zipfile.BadZipFile as error:
        raise SystemRefusedError(f"{path.name} is not an SSP archive ({error})") from None
    except OSError as error:
        raise ResultsError(f"cannot unpack {path}: {error.strerror or error}") from error


def read_ssv(path: Path | str) -> ParameterSet:
    """Read a parameter set with names ``component.variable`` from an ``.ssv`` file.

    Raises `SystemRefusedError` for a file that is missing or malformed.
    """
    path = Path(path)
    if not path.is_file():
        raise SystemRefusedError(f"file not found: {path}")
    root = _parsed(path.read_bytes(), path.name, "SystemStructureParameterValues.xsd")
    return _values(root, path.name)


def _parsed(text: bytes, where: str, schema: str) -> Any:
    try:
        # no entities and no network: an archive is somebody else's file
        root = etree.fromstring(text, etree.XMLParser(resolve_entities=False, no_network=True))
    except etree.XMLSyntaxError as error:
        raise SystemRefusedError(f"{where} is not well-formed XML: {error}") from None
    _validate(root, where, schema)
    return root


def _validate(root: Any, where: str, schema: str) -> None:
    grammar = etree.XMLSchema(file=str(Path(fmpy.ssp.__file__).parent / "schema" / schema))
    if not grammar.validate(root):
        first = grammar.error_log[0]
        text = first.message
        for prefix, namespace in _PREFIXES.items():
            text = text.replace(f"{{{namespace}}}", f"{prefix}:")
        raise SystemRefusedError(f"{where} does not follow the SSP 1.0 schema, line {first.line}: {text}")


def _values(root: Any, where: str, prefix: str = "") -> ParameterSet:
    known = {unit.name: unit for unit in map(_unit, root.iterfind("ssv:Units/ssc:Unit", _PREFIXES))}
    values: dict[str, Value] = {}
    units: dict[str, Unit] = {}
    for parameter in root.iterfind("ssv:Parameters/ssv:Parameter", _PREFIXES):
        name = prefix + parameter.get("name")
        typed = next(parameter.iterchildren("*"))
        if _local(typed) == "Binary":
            raise SystemRefusedError(f"{where}: parameter {name} is Binary, which FMI 2.0 does not know")
        values[name] = typed.get("value")
        unit = typed.get("unit")
        if unit is not None and unit not in known:
            raise SystemRefusedError(
                f"{where}: parameter {name} is given in {unit}, which the set does not define under Units; define it, "
                "or give the value in the FMU's own unit and leave the unit out"
            )
        if unit is not None:
            units[name] = known[unit]
    return ParameterSet(root.get("name"), values, units)


def _unit(element: Any) -> Unit:
    base = element.find("ssc:BaseUnit", _PREFIXES)
    exponents = tuple(int(base.get(symbol, 0)) for symbol in _BASE_UNITS)
    return Unit(element.get("name"), exponents, float(base.get("factor", 1.0)), float(base.get("offset", 0.0)))


def _local(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]


class _Reader:
    """Reads one archive; every refusal names the file and the line."""

    def __init__(self, where: str, archive: zipfile.ZipFile, directory: Path) -> None:
        self.where = where
        self.archive = archive
        self.directory = directory
        self.unpacked: dict[str, Path] = {}

    def refuse(self, element: Any, why: str) -> SystemRefusedError:
        return SystemRefusedError(f"{self.where}, {_STRUCTURE} line {element.sourceline}: {why}")

    def system(self) -> System:
        if _STRUCTURE not in self.archive.namelist():
            raise SystemRefusedError(f"{self.where} is not an SSP archive: it holds no {_STRUCTURE}")
        root = _parsed(self.archive.read(_STRUCTURE), f"{self.where}, {_STRUCTURE}", "SystemStructureDescription.xsd")
        self.only(root, {"System", "DefaultExperiment"})
        top = root.find("ssd:System", _PREFIXES)
        self.only(top, {"Elements", "Connections", "ParameterBindings", "Connectors"})
        self.refuse_system_connectors(top)
        elements = top.find("ssd:Elements", _PREFIXES)
        self.only(elements, {"Component"})
        components = [] if elements is None else list(elements.iterfind("ssd:Component", _PREFIXES))
        inner = [values for element in components for values in self.parameter_sets(element, element.get("name"))]
        names = [element.get("name") for element in components]
        outer = [values for values in self.parameter_sets(top, None) if self.names_known(values, names)]
        experiment = root.find("ssd:DefaultExperiment", _PREFIXES)
        stop = None if experiment is None else experiment.get("stopTime")
        return System(
            root.get("name"),
            tuple(self.component(element) for element in components),
            tuple(self.connections(top)),
            # the set of the enclosing system wins over a component's own
            (*inner, *outer),
            0.0 if experiment is None else float(experiment.get("startTime", 0.0)),
            None if stop is None else float(stop),
            root.get("description") or "",
        )

    def only(self, parent: Any, known: set[str]) -> None:
        for child in [] if parent is None else parent.iterchildren("*"):
            name = _local(child)
            if name not in known | _WITHOUT_EFFECT:
                raise self.refuse(child, f"{name}: {_ADVICE.get(name, 'this element is not supported; remove it')}")

    def refuse_system_connectors(self, top: Any) -> None:
        for connector in top.iterfind("ssd:Connectors/ssd:Connector", _PREFIXES):
            raise self.refuse(
                connector,
                f"connector {connector.get('name')} belongs to the system itself, which is not supported; "
                "connect components with each other (their outputs are recorded anyway)",
            )

    def component(self, element: Any) -> Component:
        name = element.get("name")
        self.only(element, {"Connectors", "ParameterBindings"})
        if element.get("type", _FMU_TYPE) != _FMU_TYPE:
            raise self.refuse(element, f"component {name} is a {element.get('type')}; only FMUs are supported")
        if element.get("implementation", "any") == "ModelExchange":
            raise self.refuse(element, f"component {name} asks for model exchange; only co-simulation is supported")
        return Component(name, self.unpack(element, element.get("source")))

    def member(self, element: Any, source: str) -> str:
        path = posixpath.normpath(unquote(source))
        if ":" in path or path.startswith(("/", "..")):
            raise self.refuse(element, f"source {source} lies outside the archive; put the file into resources/")
        if path not in self.archive.namelist():
            raise self.refuse(element, f"{source} is missing in the archive")
        return path

    def unpack(self, element: Any, source: str) -> Path:
        member = self.member(element, source)
        if member not in self.unpacked:
            folder = self.directory / str(len(self.unpacked))
            folder.mkdir(parents=True, exist_ok=True)
            target = folder / PurePosixPath(member).name
            target.write_bytes(self.archive.read(member))
            self.unpacked[member] = target
        return self.unpacked[member]

    def connections(self, top: Any) -> Iterator[Connection]:
        for element in top.iterfind("ssd:Connections/ssd:Connection", _PREFIXES):
            self.only(element, set())
            ends = [element.get(name) for name in ("startElement", "startConnector", "endElement", "endConnector")]
            if ends[0] is None or ends[2] is None:
                raise self.refuse(
                    element,
                    f"connection {ends[1]} -> {ends[3]} goes to the system itself, which is not supported; "
                    "connect components with each other",
                )
            source, target = Port(ends[0], ends[1]), Port(ends[2], ends[3])
            # SSP gives no direction: the kinds of the connectors do
            if self.kind(top, target) == "output" and self.kind(top, source) == "input":
                source, target = target, source
            yield Connection(source, target)

    def kind(self, top: Any, port: Port) -> str | None:
        for component in top.iterfind("ssd:Elements/ssd:Component", _PREFIXES):
            if component.get("name") == port.component:
                for connector in component.iterfind("ssd:Connectors/ssd:Connector", _PREFIXES):
                    if connector.get("name") == port.variable:
                        return str(connector.get("kind"))
        return None

    def parameter_sets(self, element: Any, component: str | None) -> Iterator[ParameterSet]:
        for binding in element.iterfind("ssd:ParameterBindings/ssd:ParameterBinding", _PREFIXES):
            self.only(binding, {"ParameterValues"})
            if binding.get("type", _SET_TYPE) != _SET_TYPE:
                raise self.refuse(binding, f"parameter sets of type {binding.get('type')} are not supported")
            root = self.bound_set(binding)
            prefix = (f"{component}." if component else "") + binding.get("prefix", "")
            yield _values(root, f"{self.where}, parameter set {root.get('name')}", prefix)

    def bound_set(self, binding: Any) -> Any:
        schema = "SystemStructureParameterValues.xsd"
        source = binding.get("source")
        if source is None:
            inline = binding.find("ssd:ParameterValues/ssv:ParameterSet", _PREFIXES)
            if inline is None:
                raise self.refuse(binding, "a parameter binding holds no values")
            _validate(inline, f"{self.where}, {_STRUCTURE}", schema)
            return inline
        if binding.get("sourceBase", "SSD") != "SSD":
            raise self.refuse(binding, "a parameter set inside an FMU is not supported; put it into resources/")
        return _parsed(self.archive.read(self.member(binding, source)), f"{self.where}, {source}", schema)

    def names_known(self, values: ParameterSet, components: list[str]) -> bool:
        for name in values.values:
            try:
                port_of(name, components)
            except SystemRefusedError as error:
                raise SystemRefusedError(f"{self.where}, parameter set {values.name}: {error}") from None
        return True
