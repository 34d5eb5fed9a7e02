"""modelDescription.xml of a model, complete: units, types, ranges, causalities, structure.

The outputs follow from the state alone, so none depends directly on an input (``dependencies=""``) and masters see
no algebraic loop. What outputs and coefficients depend on at initialisation is read off the model's trace.
"""

from __future__ import annotations

from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from ..models.record import Boolean, Enumeration, Fact, Integer, Item, Real
from .catalogue import Entry, Kind
from .errors import InterfaceError
from .interface import Interface, Variable, interface_of
from .trace import Trace
from .units import BASE_UNITS, Quantity, completed, display_of, parse, quantity_of
from .wording import descriptions

GENERATED = "1980-01-01T00:00:00Z"
"""Date in the description and in the archive, always the same so that the same sources give the same bytes."""

_LOG_CATEGORIES: dict[Kind, tuple[tuple[str, str], ...]] = {
    "native": (
        ("logEvents", "Initialised, terminated, reset, state restored."),
        ("logStatusError", "A call was refused or a step failed; the text tells why."),
        ("logAll", "All messages."),
    ),
    "python": (
        ("logStatusWarning", "Something looks wrong, the simulation goes on."),
        ("logStatusDiscard", "A step was not completed."),
        ("logStatusError", "A call was refused."),
        ("logStatusFatal", "A call was refused or a step failed; the text tells why."),
        ("logAll", "All messages."),
    ),
}

SOURCE_FILE = "fmu.c"
"""The one C file to compile."""


def _text(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value)


def _attributes(**values: Any) -> dict[str, str]:
    """XML attributes of those values that are given."""
    return {
        name: value if isinstance(value, str) else _text(value) for name, value in values.items() if value is not None
    }


def _unit_definitions(root: Any, variables: tuple[Variable, ...]) -> None:
    displays: dict[str, set[str]] = {}
    for variable in variables:
        if isinstance(variable.fact, Real):
            fact = completed(variable.fact)
            shown = displays.setdefault(fact.unit, set())
            if fact.display is not None:
                shown.add(fact.display)
    if not displays:
        return
    definitions = etree.SubElement(root, "UnitDefinitions")
    for name in sorted(displays):
        unit = parse(name)
        element = etree.SubElement(definitions, "Unit", name=name)
        if unit.is_whole:
            exponents = {symbol: str(unit.exponents[symbol]) for symbol in BASE_UNITS if symbol in unit.exponents}
            factor = {} if unit.factor == 1.0 else {"factor": repr(unit.factor)}
            etree.SubElement(element, "BaseUnit", {**exponents, **factor})
        for display in sorted(displays[name]):
            factor_, offset = display_of(display, name)
            etree.SubElement(element, "DisplayUnit", _attributes(name=display, factor=factor_, offset=offset or None))


def _type_of(fact: Fact) -> tuple[str, Any] | None:
    """Name and content of the type that a field is declared of."""
    if isinstance(fact, Enumeration):
        return fact.type_name, fact.items
    quantity = quantity_of(fact) if isinstance(fact, Real) else None
    return None if quantity is None else (quantity.name, (fact.unit, quantity))


def _enumeration_type(simple: Any, items: tuple[Item, ...]) -> None:
    enumeration = etree.SubElement(simple, "Enumeration")
    for number, item in enumerate(items, 1):
        etree.SubElement(enumeration, "Item", _attributes(name=item.name, value=number, description=item.description))


def _real_type(simple: Any, unit: str, quantity: Quantity) -> None:
    etree.SubElement(
        simple,
        "Real",
        _attributes(
            quantity=quantity.name,
            unit=unit,
            displayUnit=quantity.display,
            relativeQuantity=quantity.relative or None,
            nominal=quantity.nominal,
        ),
    )


def _type_definitions(root: Any, variables: tuple[Variable, ...]) -> None:
    types: dict[str, Any] = {}
    for variable in variables:
        declared = _type_of(variable.fact)
        if declared is not None and types.setdefault(*declared) != declared[1]:
            raise InterfaceError(f"two types are called {declared[0]}")
    taken = {variable.name for variable in variables} & set(types)
    if taken:
        raise InterfaceError(f"{', '.join(taken)} names a type and a variable")
    if not types:
        return
    definitions = etree.SubElement(root, "TypeDefinitions")
    for name in sorted(types):
        simple = etree.SubElement(definitions, "SimpleType", name=name)
        if isinstance(types[name][1], Quantity):
            _real_type(simple, *types[name])
        else:
            _enumeration_type(simple, types[name])


def _type_attributes(variable: Variable) -> dict[str, str]:
    fact, start, declared = variable.fact, variable.start, _type_of(variable.fact)
    type_name = None if declared is None else declared[0]
    if isinstance(fact, Real):
        fact = completed(fact)
        return _attributes(
            declaredType=type_name,
            unit=fact.unit,
            displayUnit=fact.display,
            min=None if fact.min is None else float(fact.min),
            max=None if fact.max is None else float(fact.max),
            nominal=None if fact.nominal is None else float(fact.nominal),
            start=None if start is None else float(start),
        )
    if isinstance(fact, Boolean):
        return _attributes(start=None if start is None else bool(start))
    whole = None if start is None else int(start)
    if isinstance(fact, Integer):
        return _attributes(min=fact.min, max=fact.max, start=whole)
    return _attributes(declaredType=type_name, min=1, max=len(fact.items), start=whole)


def _variables(root: Any, variables: tuple[Variable, ...]) -> None:
    parent = etree.SubElement(root, "ModelVariables")
    for variable, description in zip(variables, descriptions(variables), strict=True):
        scalar = etree.SubElement(
            parent,
            "ScalarVariable",
            _attributes(
                name=variable.name,
                valueReference=variable.value_reference,
                description=description,
                causality=variable.causality,
                variability=variable.variability,
                initial=variable.initial,
            ),
        )
        etree.SubElement(scalar, variable.kind, _type_attributes(variable))


def _structure(root: Any, interface: Interface, initial_dependencies: dict[int, tuple[int, ...]]) -> None:
    structure = etree.SubElement(root, "ModelStructure")
    index = {variable.value_reference: str(place) for place, variable in enumerate(interface.shown, 1)}
    element = etree.SubElement(structure, "Outputs")
    for variable in interface.shown:
        if variable.causality == "output":
            etree.SubElement(element, "Unknown", index=index[variable.value_reference], dependencies="")
    element = etree.SubElement(structure, "InitialUnknowns")
    for variable in interface.shown:
        if variable.causality in ("output", "calculatedParameter"):
            reference = variable.value_reference
            known = " ".join(index[place] for place in initial_dependencies.get(reference, ()))
            etree.SubElement(element, "Unknown", index=index[reference], dependencies=known)


def _co_simulation(root: Any, entry: Entry, kind: Kind) -> None:
    is_native = kind == "native"
    element = etree.SubElement(
        root,
        "CoSimulation",
        _attributes(
            modelIdentifier=entry.identifier,
            needsExecutionTool=False,
            canHandleVariableCommunicationStepSize=True,
            canInterpolateInputs=is_native,
            canBeInstantiatedOnlyOncePerProcess=False,
            canNotUseMemoryManagementFunctions=True,
            canGetAndSetFMUstate=True,
            canSerializeFMUstate=True,
            providesDirectionalDerivative=is_native,
        ),
    )
    if is_native:
        files = etree.SubElement(element, "SourceFiles")
        etree.SubElement(files, "File", name=SOURCE_FILE)


def build_description(entry: Entry) -> bytes:
    """sources/buildDescription.xml as bytes: how to compile the C sources (in the form of FMI 3.0, as 2.0.4 has it)."""
    root = etree.Element("fmiBuildDescription", fmiVersion="3.0")
    configuration = etree.SubElement(root, "BuildConfiguration", modelIdentifier=entry.identifier)
    files = etree.SubElement(configuration, "SourceFileSet", language="C11")
    etree.SubElement(files, "SourceFile", name=SOURCE_FILE)
    xml: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return xml


def model_description(
    trace: Trace, entry: Entry, kind: Kind, guid: str, version: str, copyright_line: str | None
) -> bytes:
    """modelDescription.xml as bytes."""
    model = trace.model
    interface = interface_of(model)
    root = etree.Element(
        "fmiModelDescription",
        _attributes(
            fmiVersion="2.0",
            modelName=model.name,
            guid=guid,
            description=model.description,
            author="The attitude-fmu developers",
            version=version,
            copyright=copyright_line,
            license="MIT",
            generationTool=f"attitude-fmu {version}",
            generationDateAndTime=GENERATED,
            variableNamingConvention="structured",
        ),
    )
    _co_simulation(root, entry, kind)
    _unit_definitions(root, interface.shown)
    _type_definitions(root, interface.shown)
    categories = etree.SubElement(root, "LogCategories")
    for name, text in _LOG_CATEGORIES[kind]:
        etree.SubElement(categories, "Category", name=name, description=text)
    etree.SubElement(
        root,
        "DefaultExperiment",
        _attributes(startTime=0.0, stopTime=float(entry.stop_time), stepSize=float(entry.step_size)),
    )
    _variables(root, interface.shown)
    _structure(root, interface, trace.initial_dependencies)
    xml: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return xml
