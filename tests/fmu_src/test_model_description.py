from __future__ import annotations

import random
import subprocess
import sys
import zipfile
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest
from fmpy import read_model_description
from fmpy.fmi1 import FMICallException
from fmpy.validation import validate_fmu
from fmu_instance import EVERY_KIND, Instance
from lxml import etree
from random_records import settable_near

from attitude_fmu.fmu_src.catalogue import CATALOGUE, KINDS, Entry, Kind
from attitude_fmu.models.record import leaves

Built = Callable[[Entry, Kind], Path]

ALL = [EVERY_KIND, *CATALOGUE]

FLAGS: dict[Kind, dict[str, str]] = {
    "native": {"canInterpolateInputs": "true", "providesDirectionalDerivative": "true"},
    "python": {"canInterpolateInputs": "false", "providesDirectionalDerivative": "false"},
}
SOURCE_FILES: dict[Kind, list[str]] = {"native": ["fmu.c"], "python": []}
LOG_CATEGORIES: dict[Kind, set[str]] = {
    "native": {"logEvents", "logStatusError", "logAll"},
    "python": {"logStatusWarning", "logStatusDiscard", "logStatusError", "logStatusFatal", "logAll"},
}


@pytest.fixture(scope="module", params=ALL, ids=[entry.identifier for entry in ALL])
def archive(request: pytest.FixtureRequest, built: Built, kind: Kind) -> Path:
    return built(request.param, kind)


def _xml(archive: Path) -> Any:
    with zipfile.ZipFile(archive) as fmu:
        return etree.fromstring(fmu.read("modelDescription.xml"))


def test_fmpy_finds_nothing(archive: Path) -> None:
    assert validate_fmu(str(archive)) == []


def test_fmutool_finds_nothing(archive: Path) -> None:
    code = "from fmu_manipulation_toolbox.cli.fmutool import fmutool; fmutool()"
    done = subprocess.run(
        [sys.executable, "-c", code, "-input", str(archive), "-check"], capture_output=True, text=True, check=True
    )
    report = done.stdout + done.stderr
    assert "compliant with FMI-2.0" in report
    assert "No semantic error" in report
    assert not [line for line in report.splitlines() if line.startswith(("WARN", "ERROR", "CRITICAL"))]


def test_every_real_variable_has_a_defined_unit(archive: Path) -> None:
    root = _xml(archive)
    defined = {unit.get("name") for unit in root.find("UnitDefinitions")}
    assert {real.get("unit") for real in root.iter("Real")} <= defined


def test_every_variable_says_what_it_is(archive: Path) -> None:
    for variable in _xml(archive).find("ModelVariables"):
        assert variable.get("description")
        assert variable.get("causality")
        assert variable.get("variability")
        assert variable.get("initial") or variable.get("causality") == "input"


def test_no_two_variables_say_the_same(archive: Path) -> None:
    said = [(v.get("causality"), v.get("description")) for v in _xml(archive).find("ModelVariables")]
    assert len(said) == len(set(said))


def test_angles_and_temperatures_are_shown_in_degrees(archive: Path) -> None:
    wanted = {"rad": "deg", "rad/s": "deg/s", "rad/s2": "deg/s2"}
    root = _xml(archive)
    for real in root.iter("Real"):
        if real.get("unit") in wanted:
            assert real.get("displayUnit", "").startswith("deg")
        if real.get("unit") == "K" and real.getparent().tag == "ScalarVariable":
            difference = real.get("declaredType") == "TemperatureDifference"
            assert real.get("displayUnit") == (None if difference else "degC")
            assert real.get("nominal") == ("10.0" if difference else "300.0")


def test_types_name_the_quantity_and_agree_with_their_variables(archive: Path) -> None:
    root = _xml(archive)
    types = {simple.get("name"): simple[0] for simple in root.find("TypeDefinitions")}
    for variable in root.find("ModelVariables"):
        name = variable[0].get("declaredType")
        if variable[0].get("unit") in ("rad", "rad/s", "m/s2", "K", "s", "N.m", "Hz"):
            assert types[name].get("quantity") == name
            assert types[name].get("unit") == variable[0].get("unit")
            assert float(variable[0].get("nominal")) > 0.0


def test_outputs_depend_on_no_input_directly(archive: Path) -> None:
    root = _xml(archive)
    assert all(unknown.get("dependencies") == "" for unknown in root.find("ModelStructure/Outputs"))


def _initial_dependencies(archive: Path) -> dict[str, list[str]]:
    """What each initial unknown depends on."""
    root = _xml(archive)
    names = [variable.get("name") for variable in root.find("ModelVariables")]
    return {
        names[int(unknown.get("index")) - 1]: [names[int(i) - 1] for i in unknown.get("dependencies").split()]
        for unknown in root.find("ModelStructure/InitialUnknowns")
    }


def test_initial_unknowns_are_all_outputs_and_coefficients_in_order(archive: Path) -> None:
    root = _xml(archive)
    wanted = [
        index
        for index, variable in enumerate(root.find("ModelVariables"), 1)
        if variable.get("causality") in ("output", "calculatedParameter")
    ]
    assert [int(unknown.get("index")) for unknown in root.find("ModelStructure/InitialUnknowns")] == wanted


def test_initial_dependencies_are_parameters_and_inputs_in_order(archive: Path) -> None:
    root = _xml(archive)
    causalities = [variable.get("causality") for variable in root.find("ModelVariables")]
    for unknown in root.find("ModelStructure/InitialUnknowns"):
        indices = [int(index) for index in unknown.get("dependencies").split()]
        assert indices == sorted(set(indices))
        assert {causalities[index - 1] for index in indices} <= {"parameter", "input"}


RATE = ["rate[1]", "rate[2]", "rate[3]"]


@pytest.mark.parametrize(
    ("unknown", "knowns"),
    [
        ("coefficient.fast", ["period"]),
        ("coefficient.sigma", ["noise.density", "period"]),
        ("coefficient.whole", []),
        ("shown.rate[1]", ["gain", "rate[1]"]),
        ("shown.rate[3]", ["gain", "rate[3]"]),
        ("shown.count", ["shift"]),
        ("shown.moving", ["gain", *RATE]),
        ("shown.level", ["gain", *RATE]),
        ("shown.square", ["gain", *RATE]),
        ("refused_calls", []),
    ],
)
def test_an_initial_unknown_depends_on_what_moves_it_alone(fmu: Path, unknown: str, knowns: list[str]) -> None:
    assert _initial_dependencies(fmu)[unknown] == knowns


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.identifier)
def test_no_parameter_or_input_moves_what_does_not_depend_on_it(
    built: Built, load: Callable[[Path], Instance], entry: Entry
) -> None:
    archive = built(entry, "native")
    dependencies, unit = _initial_dependencies(archive), load(archive)
    model, chance = import_module(entry.module).MODEL, random.Random(1)
    unit.fmu.enterInitializationMode()
    before, moved = unit.bits(), 0
    for leaf in (*leaves(model.Parameters), *leaves(model.Inputs)):
        unit[leaf.name] = settable_near(leaf, leaf.start, chance)
        try:
            after = unit.bits()
        except FMICallException:  # it does not go together with the others
            after = before
        changed = {name for name in before if after[name] != before[name]} & set(dependencies)
        assert not [name for name in changed if leaf.name not in dependencies[name]], leaf.name
        moved += bool(changed)
        unit[leaf.name] = leaf.start
    assert moved >= 5


def test_it_can_save_its_state_and_needs_no_tool(archive: Path) -> None:
    flags = _xml(archive).find("CoSimulation").attrib
    assert flags["needsExecutionTool"] == "false"
    assert flags["canGetAndSetFMUstate"] == "true"
    assert flags["canSerializeFMUstate"] == "true"
    assert flags["canHandleVariableCommunicationStepSize"] == "true"


def test_each_kind_says_what_it_offers(fmu: Path, kind: Kind) -> None:
    root = _xml(fmu)
    flags = root.find("CoSimulation").attrib
    assert {name: flags[name] for name in FLAGS[kind]} == FLAGS[kind]
    assert [file.get("name") for file in root.iterfind("CoSimulation/SourceFiles/File")] == SOURCE_FILES[kind]
    assert {category.get("name") for category in root.find("LogCategories")} == LOG_CATEGORIES[kind]


@pytest.mark.parametrize("entry", ALL, ids=lambda entry: entry.identifier)
def test_the_kinds_have_the_same_variables_and_structure(built: Built, entry: Entry) -> None:
    native, python = (_xml(built(entry, kind)) for kind in KINDS)
    for part in ("UnitDefinitions", "TypeDefinitions", "DefaultExperiment", "ModelVariables", "ModelStructure"):
        assert etree.tostring(native.find(part)) == etree.tostring(python.find(part))
    assert native.get("guid") != python.get("guid")


def test_start_values_come_back_exactly(fmu: Path) -> None:
    description = read_model_description(str(fmu))
    starts = {variable.name: variable.start for variable in description.modelVariables}
    assert float(starts["noise.density"]) == 1e-3
    assert starts["temperature"] == "298.15"
    assert (starts["inverted"], starts["switch"], starts["shape"]) == ("false", "true", "1")


def test_units_and_types_stand_in_the_description(fmu: Path) -> None:
    root = _xml(fmu)
    assert dict(root.find("UnitDefinitions/Unit[@name='rad/s']/BaseUnit").attrib) == {"s": "-1", "rad": "1"}
    assert dict(root.find("UnitDefinitions/Unit[@name='K']/DisplayUnit").attrib) == {
        "name": "degC",
        "factor": "1.0",
        "offset": "-273.15",
    }
    assert root.find("UnitDefinitions/Unit[@name='rad/(s.Hz^0.5)']/BaseUnit") is None
    assert [item.get("name") for item in root.find("TypeDefinitions/SimpleType[@name='Shape']/Enumeration")] == [
        "lag",
        "mean",
    ]
    temperature = root.find("ModelVariables/ScalarVariable[@name='temperature']/Real").attrib
    assert dict(temperature) == {
        "declaredType": "Temperature",
        "unit": "K",
        "displayUnit": "degC",
        "min": "200.0",
        "max": "400.0",
        "nominal": "300.0",
        "start": "298.15",
    }


@pytest.mark.parametrize(
    ("name", "attributes"),
    [
        ("period", {"nominal": "0.001", "declaredType": "Time"}),
        ("state.filtered[1]", {"nominal": "1.0", "displayUnit": "deg/s", "declaredType": "AngularVelocity"}),
        ("coefficient.rise", {"nominal": "10.0", "displayUnit": None, "declaredType": "TemperatureDifference"}),
        ("gain", {"nominal": None, "displayUnit": "%", "declaredType": None}),
        ("shift", {"min": "-9", "max": "9", "start": "0"}),
        ("steps", {"min": "0", "max": "10"}),
        ("noise.seed", {"min": "0", "max": None}),
        ("shape", {"min": "1", "max": "2", "declaredType": "Shape"}),
    ],
)
def test_a_field_keeps_its_facts(fmu: Path, name: str, attributes: dict[str, str | None]) -> None:
    found = _xml(fmu).find(f"ModelVariables/ScalarVariable[@name='{name}']")[0]
    assert {key: found.get(key) for key in attributes} == attributes


def test_a_difference_of_temperatures_has_no_offset(fmu: Path) -> None:
    types = _xml(fmu).find("TypeDefinitions")
    assert types.find("SimpleType[@name='TemperatureDifference']/Real").get("relativeQuantity") == "true"
    assert types.find("SimpleType[@name='Temperature']/Real").get("relativeQuantity") is None


@pytest.mark.parametrize(
    ("name", "description"),
    [
        ("noise.density", "white noise, one-sided"),
        ("rate[3]", "true rate (up)"),
        ("mounting[1,3]", "mounting matrix (row 1, column 3)"),
    ],
)
def test_elements_tell_their_place(fmu: Path, name: str, description: str) -> None:
    assert _xml(fmu).find(f"ModelVariables/ScalarVariable[@name='{name}']").get("description") == description
