from __future__ import annotations

import zipfile
from pathlib import Path

import fmpy.ssp
import numpy as np
import pytest
from fmpy.ssp.simulation import simulate_ssp
from fmpy.ssp.ssd import read_ssd
from lxml import etree
from slave_building import METRE, with_units

from attitude_fmu.cosim.errors import ResultsError, SystemRefusedError
from attitude_fmu.cosim.master import simulate
from attitude_fmu.cosim.ssp import SSC, open_ssp, read_ssv, write_ssp, write_ssv
from attitude_fmu.cosim.system import Component, System, check, connect, parameters_used, start_values


@pytest.fixture
def board(fmus: dict[str, Path]) -> System:
    return System(
        "board",
        (Component("a", fmus["switchboard"]), Component("b", fmus["switchboard"])),
        connect("a", "b", ("odd", "switch_in")),
        start_time=0.5,
        stop_time=2.0,
        description="switches",
    ).with_values("set", {"a.enabled": False, "b.label": "x & y", "b.number_in": 3})


def structure(path: Path) -> str:
    with zipfile.ZipFile(path) as archive:
        return archive.read("SystemStructure.ssd").decode()


def edited(path: Path, old: str, new: str, **members: str) -> Path:
    """A copy of an archive with one text replaced in its structure."""
    target = path.with_name("edited.ssp")
    with zipfile.ZipFile(path) as source, zipfile.ZipFile(target, "w") as copy:
        for name in source.namelist():
            data = source.read(name)
            if name == "SystemStructure.ssd":
                assert old in data.decode()
                data = data.decode().replace(old, new, 1).encode()
            copy.writestr(name, data)
        for name, text in members.items():
            copy.writestr(name.replace("__", "/") + ".ssv", text)
    return target


SET = """<?xml version="1.0"?>
<ssv:ParameterSet xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="mine">
  <ssv:Parameters>{}</ssv:Parameters>
</ssv:ParameterSet>"""
BINDING = """<ssd:ParameterBindings><ssd:ParameterBinding source="{}"/></ssd:ParameterBindings>"""


def test_round_trip_keeps_the_system(board: System, tmp_path: Path) -> None:
    path = write_ssp(board, tmp_path / "board.ssp")
    with open_ssp(path) as back:
        assert (back.name, back.start_time, back.stop_time, back.description) == ("board", 0.5, 2.0, "switches")
        assert back.connections == board.connections
        assert [component.name for component in back.components] == ["a", "b"]
        assert back.components[0].fmu.read_bytes() == board.components[0].fmu.read_bytes()
        assert start_values(back, check(back)) == start_values(board, check(board))
        kept = back.components[0].fmu
    assert not kept.exists()


def test_same_system_gives_the_same_bytes(board: System, tmp_path: Path) -> None:
    first, second = write_ssp(board, tmp_path / "1.ssp"), write_ssp(board, tmp_path / "2.ssp")
    assert first.read_bytes() == second.read_bytes()


def test_what_is_written_is_the_portable_subset(board: System, tmp_path: Path) -> None:
    path = write_ssp(board, tmp_path / "board.ssp")
    read_ssd(str(path))  # FMPy validates
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        schemas = Path(fmpy.ssp.__file__).parent / "schema"
        grammar = etree.XMLSchema(file=str(schemas / "SystemStructureParameterValues.xsd"))
        for name in names:
            if name.endswith(".ssv"):
                grammar.assertValid(etree.fromstring(archive.read(name)))
    assert names[0] == "SystemStructure.ssd"
    assert set(names[1:]) == {"resources/switchboard.fmu", "resources/a_set.ssv", "resources/b_set.ssv"}
    text = structure(path)
    assert "<ssd:SystemStructureDescription xmlns:ssd=" in text
    root = etree.fromstring(text.encode())
    assert root.get("version") == "1.0"
    names_only = {etree.QName(element).localname for element in root.iter("*")}
    assert "LinearTransformation" not in names_only
    assert root.find("{*}System/{*}Connectors") is None
    assert all(c.get("startElement") and c.get("endElement") for c in root.iter("{*}Connection"))
    # FMPy holds an unconnected input that it sees at zero
    assert 'name="number_in"' not in text


def test_two_fmus_of_one_file_name_both_fit(fmus: dict[str, Path], tmp_path: Path) -> None:
    other = tmp_path / "gain.fmu"
    other.write_bytes(fmus["gain"].read_bytes() + b"")
    system = System("s", (Component("a", fmus["gain"]), Component("b", other)), stop_time=1.0)
    with open_ssp(write_ssp(system, tmp_path / "s.ssp")) as back:
        assert len({component.fmu for component in back.components}) == 2


def test_names_that_look_alike_keep_their_own_values(fmus: dict[str, Path], tmp_path: Path) -> None:
    odd = tmp_path / "my gain ä.fmu"
    odd.write_bytes(fmus["gain"].read_bytes())
    names = ("gyro ä", "gyro ö", "b c", "b_c", "B_C")
    values = {f"{name}.k": float(number) for number, name in enumerate(names)}
    components = tuple(Component(name, odd if number % 2 else fmus["gain"]) for number, name in enumerate(names))
    path = write_ssp(System("s", components).with_values("set", values), tmp_path / "s.ssp")
    with zipfile.ZipFile(path) as archive:
        members = [name.lower() for name in archive.namelist()]
    assert len(set(members)) == len(members) == 1 + 2 + len(names)
    with open_ssp(path) as back:
        assert {str(port): value for port, value in start_values(back, check(back)).items()} == values


@pytest.mark.parametrize(
    "source", ["./resources/switchboard.fmu", "resources/%73witchboard.fmu", "x/../resources/switchboard.fmu"]
)
def test_source_is_a_uri(board: System, tmp_path: Path, source: str) -> None:
    path = edited(write_ssp(board, tmp_path / "b.ssp"), "resources/switchboard.fmu", source)
    with open_ssp(path) as back:
        assert back.components[0].fmu.read_bytes() == board.components[0].fmu.read_bytes()


def test_units_are_written(fmus: dict[str, Path], tmp_path: Path) -> None:
    fmu = with_units(fmus["gain"], tmp_path / "metric.fmu", METRE.replace('"m"', '"metre"', 1), "metre")
    text = structure(write_ssp(System("s", (Component("a", fmu),)), tmp_path / "s.ssp"))
    assert 'unit="metre"' in text
    root = etree.fromstring(text.encode())
    (unit,) = root.iter("{*}Unit")
    assert unit.get("name") == "metre"
    assert dict(unit[0].attrib) == {"m": "1"}


@pytest.mark.parametrize(
    ("units", "unit", "message"),
    [
        ("", "m", "parameter a.k is given in m, which the set does not define"),
        (
            '<ssc:Unit name="mm"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>',
            "mm",
            r"a\.k is given in mm, not in m; .*0\.001 \* value",
        ),
        (
            '<ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>',
            "K",
            r"a\.k is given in K, not in m; .*different quantities",
        ),
        ('<ssc:Unit name="metre"><ssc:BaseUnit m="1"/></ssc:Unit>', "metre", None),
    ],
)
def test_unit_of_a_value_is_that_of_its_variable(
    fmus: dict[str, Path], tmp_path: Path, units: str, unit: str, message: str | None
) -> None:
    fmu = with_units(fmus["gain"], tmp_path / "metric.fmu", METRE, "m")
    text = SET.format(f'<ssv:Parameter name="a.k"><ssv:Real value="7" unit="{unit}"/></ssv:Parameter>')
    if units:
        text = text.replace("</ssv:Parameters>", f'</ssv:Parameters><ssv:Units xmlns:ssc="{SSC}">{units}</ssv:Units>')
    (tmp_path / "u.ssv").write_text(text)
    system = System("s", (Component("a", fmu),))
    if message is None:
        check(system.with_set(read_ssv(tmp_path / "u.ssv")))
    else:
        with pytest.raises(SystemRefusedError, match=message):
            check(system.with_set(read_ssv(tmp_path / "u.ssv")))


def test_fmpy_runs_what_we_write_and_agrees(fmus: dict[str, Path], tmp_path: Path) -> None:
    # FMPy starts all connectors at zero and ignores parameter bindings: x(0) = 0 and a drive of its own parameter set
    system = System(
        "pair",
        (Component("integrator", fmus["integrator"]), Component("gain", fmus["gain"])),
        (*connect("integrator", "gain", ("x", "u")), *connect("gain", "integrator", ("y", "u"))),
        stop_time=1.0,
    ).with_values("drive", {"integrator.drive": 1.0})
    path = write_ssp(system, tmp_path / "pair.ssp")
    parameters = read_ssd(str(path)).system.elements[0].parameterBindings[0].parameterValues[0]
    for parameter in parameters.parameters:
        parameter.name = f"integrator.{parameter.name}"
        parameter.value = float(parameter.value)
    theirs = simulate_ssp(str(path), stop_time=1.0 - 1e-6, step_size=0.01, parameter_set=parameters)
    with open_ssp(path) as back:
        ours = simulate(back, step=0.01, order="jacobi").results
    assert len(theirs) == 100
    # a row of FMPy carries the time before its step
    for name in ("integrator.x", "gain.y"):
        assert np.max(np.abs(theirs[name] - ours[name][1:])) < 1e-12
    assert np.max(np.abs(ours["integrator.x"])) > 0.5


def test_parameter_set_round_trip(board: System, tmp_path: Path) -> None:
    interfaces = check(board)
    used = parameters_used(board, interfaces)
    back = read_ssv(write_ssv(used, tmp_path / "used.ssv", interfaces))
    again = System("again", board.components, board.connections, (back,))
    assert start_values(again, interfaces) == {
        port: value for port, value in start_values(System("u", board.components, (), (used,)), interfaces).items()
    }
    assert back.name == "board_parameters"


def test_inline_and_file_and_system_sets_are_read(fmus: dict[str, Path], tmp_path: Path) -> None:
    system = System("s", (Component("gain", fmus["gain"]),), stop_time=1.0)
    path = write_ssp(system, tmp_path / "s.ssp")
    real = '<ssv:Parameter name="{}"><ssv:Real value="{}"/></ssv:Parameter>'
    inline = SET.partition("?>")[2].format(real.format("k", 2.0) + real.format("c", 7.0))
    body = f"<ssd:ParameterBinding><ssd:ParameterValues>{inline}</ssd:ParameterValues></ssd:ParameterBinding>"
    path = edited(path, "</ssd:Component>", f"<ssd:ParameterBindings>{body}</ssd:ParameterBindings></ssd:Component>")
    path = edited(
        path.rename(tmp_path / "one.ssp"),
        "<ssd:Elements>",
        BINDING.format("resources/mine.ssv") + "<ssd:Elements>",
        resources__mine=SET.format(real.format("gain.k", 3.0)),
    )
    with open_ssp(path) as back:
        values = start_values(back, check(back))
    assert {str(port): value for port, value in values.items()} == {"gain.k": 3.0, "gain.c": 7.0}


def test_connection_written_from_input_to_output_is_turned(board: System, tmp_path: Path) -> None:
    path = write_ssp(board, tmp_path / "b.ssp")
    old = 'startElement="a" startConnector="odd" endElement="b" endConnector="switch_in"'
    new = 'startElement="b" startConnector="switch_in" endElement="a" endConnector="odd"'
    with open_ssp(edited(path, old, new)) as back:
        assert back.connections == board.connections


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</ssd:Elements>", '<ssd:System name="inner"/></ssd:Elements>', "line .*System: a system inside a system"),
        (
            "<ssd:Elements>",
            '<ssd:Connectors><ssd:Connector name="y" kind="output"/></ssd:Connectors><ssd:Elements>',
            "connector y belongs to the system itself",
        ),
        ('startElement="a" ', "", "connection odd -> switch_in goes to the system itself"),
        (
            'endConnector="switch_in"/>',
            'endConnector="switch_in"><ssc:LinearTransformation factor="2"/></ssd:Connection>',
            "LinearTransformation: values are not converted on the way",
        ),
        ('type="application/x-fmu-sharedlibrary"', 'type="application/x-ssp-package"', "only FMUs are supported"),
        ("resources/switchboard.fmu", "resources/gone.fmu", r"resources/gone\.fmu is missing in the archive"),
        ("resources/switchboard.fmu", "../switchboard.fmu", "outside the archive"),
        ("resources/switchboard.fmu", "file:///x.fmu", "outside the archive"),
        ('kind="output"', 'kind="outlet"', "does not follow the SSP 1.0 schema, line .*outlet"),
        ('version="1.0"', 'version="2.0"', "does not follow the SSP 1.0 schema"),
        ("</ssd:System>", "", "not well-formed XML"),
    ],
)
def test_what_is_not_understood_is_refused(board: System, tmp_path: Path, old: str, new: str, message: str) -> None:
    path = edited(write_ssp(board, tmp_path / "b.ssp"), old, new)
    with pytest.raises(SystemRefusedError, match=message), open_ssp(path):
        pass


def test_pictures_and_notes_of_other_tools_are_left_alone(board: System, tmp_path: Path) -> None:
    geometry = '<ssd:ElementGeometry x1="0" y1="0" x2="1" y2="1"/>'
    note = '<ssc:Annotation type="com.example"><x/></ssc:Annotation>'
    path = write_ssp(board, tmp_path / "b.ssp")
    path = edited(path, "</ssd:Connectors>", "</ssd:Connectors>" + geometry)
    path = edited(
        path.rename(tmp_path / "1.ssp"), "</ssd:System>", f"<ssd:Annotations>{note}</ssd:Annotations></ssd:System>"
    )
    with open_ssp(path) as back:
        assert back.connections == board.connections


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ('<ssv:Parameter name="c.enabled"><ssv:Boolean value="1"/></ssv:Parameter>', "no component is called 'c'"),
        ('<ssv:Parameter name="a.enabled"/>', "does not follow the SSP 1.0 schema"),
        ('<ssv:Parameter name="a.level"><ssv:Real value="x"/></ssv:Parameter>', "does not follow"),
    ],
)
def test_wrong_parameter_set_is_explained(board: System, tmp_path: Path, parameters: str, message: str) -> None:
    path = edited(
        write_ssp(board, tmp_path / "b.ssp"),
        "<ssd:Elements>",
        BINDING.format("resources/mine.ssv") + "<ssd:Elements>",
        resources__mine=SET.format(parameters),
    )
    with pytest.raises(SystemRefusedError, match=message), open_ssp(path):
        pass


def test_missing_and_unwritable_files_are_named(board: System, tmp_path: Path) -> None:
    with pytest.raises(SystemRefusedError, match=r"file not found: .*no\.ssp"), open_ssp(tmp_path / "no.ssp"):
        pass
    (tmp_path / "text.ssp").write_text("no zip")
    with pytest.raises(SystemRefusedError, match="not an SSP archive"), open_ssp(tmp_path / "text.ssp"):
        pass
    with zipfile.ZipFile(tmp_path / "empty.ssp", "w"):
        pass
    with pytest.raises(SystemRefusedError, match=r"holds no SystemStructure\.ssd"), open_ssp(tmp_path / "empty.ssp"):
        pass
    with pytest.raises(ResultsError, match="cannot write"):
        write_ssp(board, tmp_path / "missing" / "b.ssp")
