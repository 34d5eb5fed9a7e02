"""modelDescription.xml of a model, complete: units, types, ranges, causalities, structure.

The outputs follow from the state alone, so none depends directly on an input (``dependencies=""``) and masters see
no algebraic loop. At initialisation they depend on everything that is set (no ``dependencies``).
"""

from __future__ import annotations

from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from ..models.record import Boolean, Enumeration, Integer, Real
from ..models.system import Model
from .catalogue import Entry
from .errors import InterfaceError
from .interface import Interface, Variable, interface_of
from .units import BASE_UNITS, display_of, parse

GENERATED = "1980-01-01T00:00:00Z"
"""Date in the description and in the archive, always the same so that the same sources give the same bytes."""

_LOG_CATEGORIES = (
    ("logStatusWarning", "Something looks wrong, the simulation goes on."),
    ("logStatusDiscard", "A step was not completed."),
    ("logStatusError", "A call was refused."),
    ("logStatusFatal", "A call was refused or a step failed; the text tells why."),
    ("logAll", "All messages."),
)


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
            shown = displays.setdefault(variable.fact.unit, set())
            if variable.fact.display is not None:
                shown.add(variable.fact.display)
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


def _type_definitions(root: Any, variables: tuple[Variable, ...]) -> None:
    types: dict[str, Enumeration] = {}
    for variable in variables:
        if isinstance(variable.fact, Enumeration):
            fact = variable.fact
            if types.setdefault(fact.type_name, fact).items != fact.items:
                raise InterfaceError(f"two enumerations are called {fact.type_name}")
    taken = {variable.name for variable in variables} & set(types)
    if taken:
        raise InterfaceError(f"{', '.join(taken)} names a type and a variable")
    if not types:
        return
    definitions = etree.SubElement(root, "TypeDefinitions")
    for name in sorted(types):
        simple = etree.SubElement(definitions, "SimpleType", name=name)
        enumeration = etree.SubElement(simple, "Enumeration")
        for number, item in enumerate(types[name].items, 1):
            etree.SubElement(
                enumeration, "Item", _attributes(name=item.name, value=number, description=item.description)
            )


def _type_attributes(variable: Variable) -> dict[str, str]:
    fact, start = variable.fact, variable.start
    if isinstance(fact, Real):
        return _attributes(
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
    return _attributes(declaredType=fact.type_name, min=1, max=len(fact.items), start=whole)


def _variables(root: Any, variables: tuple[Variable, ...]) -> None:
    parent = etree.SubElement(root, "ModelVariables")
    for variable in variables:
        scalar = etree.SubElement(
            parent,
            "ScalarVariable",
            _attributes(
                name=variable.name,
                valueReference=variable.value_reference,
                description=variable.fact.description,
                causality=variable.causality,
                variability=variable.variability,
                initial=variable.initial,
            ),
        )
        etree.SubElement(scalar, variable.kind, _type_attributes(variable))


def _structure(root: Any, interface: Interface) -> None:
    structure = etree.SubElement(root, "ModelStructure")
    outputs = interface.variables[interface.outputs]
    coefficients = interface.variables[interface.coefficients]
    parameters = " ".join(str(i + 1) for i in range(interface.parameters.start, interface.parameters.stop))
    if outputs:
        element = etree.SubElement(structure, "Outputs")
        for variable in outputs:
            etree.SubElement(element, "Unknown", index=str(variable.value_reference + 1), dependencies="")
    if outputs or coefficients:
        element = etree.SubElement(structure, "InitialUnknowns")
        for variable in outputs:
            etree.SubElement(element, "Unknown", index=str(variable.value_reference + 1))
        for variable in coefficients:
            index = str(variable.value_reference + 1)
            etree.SubElement(element, "Unknown", index=index, dependencies=parameters)


def _co_simulation(root: Any, entry: Entry) -> None:
    etree.SubElement(
        root,
        "CoSimulation",
        _attributes(
            modelIdentifier=entry.identifier,
            needsExecutionTool=False,
            canHandleVariableCommunicationStepSize=True,
            canInterpolateInputs=False,
            canBeInstantiatedOnlyOncePerProcess=False,
            canNotUseMemoryManagementFunctions=True,
            canGetAndSetFMUstate=True,
            canSerializeFMUstate=True,
        ),
    )


def model_description(model: Model, entry: Entry, guid: str, version: str, copyright_line: str | None) -> bytes:
    """modelDescription.xml as bytes."""
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
    _co_simulation(root, entry)
    _unit_definitions(root, interface.variables)
    _type_definitions(root, interface.variables)
    categories = etree.SubElement(root, "LogCategories")
    for name, text in _LOG_CATEGORIES:
        etree.SubElement(categories, "Category", name=name, description=text)
    etree.SubElement(
        root,
        "DefaultExperiment",
        _attributes(startTime=0.0, stopTime=float(entry.stop_time), stepSize=float(entry.step_size)),
    )
    _variables(root, interface.variables)
    _structure(root, interface)
    xml: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    return xml
