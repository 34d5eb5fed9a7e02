from __future__ import annotations

import zipfile
from pathlib import Path

import pytest
from slave_building import METRE, with_units

from attitude_fmu.cosim.errors import SystemRefusedError
from attitude_fmu.cosim.interface import Item, Unit, Variable
from attitude_fmu.cosim.system import (
    Component,
    Connection,
    Port,
    System,
    check,
    connect,
    parameters_used,
    port_of,
    start_values,
)


def wire(source: str, target: str) -> Connection:
    return Connection(Port(*source.split(".", 1)), Port(*target.split(".", 1)))


@pytest.fixture
def parts(fmus: dict[str, Path]) -> tuple[Component, ...]:
    return (
        Component("integrator", fmus["integrator"]),
        Component("gain", fmus["gain"]),
        Component("board", fmus["switchboard"]),
    )


@pytest.mark.parametrize(
    ("wires", "message"),
    [
        ("integrator.x>gian.u", "no component is called 'gian'; did you mean gain"),
        ("integrator.z>gain.u", r"integrator\.z: Integrator has no variable 'z'"),
        ("integrator.last_tme>gain.u", "did you mean last_time"),
        ("integrator.x0>gain.u", r"integrator\.x0 is a parameter; a connection starts at an output"),
        ("integrator.x>gain.y", r"gain\.y is an output; a connection ends at an input"),
        ("board.steps>gain.u", "Integer does not fit Real; connect variables of one type"),
        ("integrator.x>board.number_in", "Real does not fit Integer"),
        ("integrator.x>gain.u board.level>gain.u", r"input gain\.u is connected twice, from integrator\.x and from"),
    ],
)
def test_impossible_connection_is_explained(parts: tuple[Component, ...], wires: str, message: str) -> None:
    connections = tuple(wire(*pair.split(">")) for pair in wires.split())
    with pytest.raises(SystemRefusedError, match=message):
        check(System("s", parts, connections))


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("gian.k", 1.0, "no component is called 'gian'; did you mean gain"),
        ("gain.kk", 1.0, r"gain\.kk: Gain has no variable 'kk'; did you mean k"),
        ("gain.y", 1.0, r"gain\.y is an output, which cannot be set; parameters and inputs can"),
        ("gain.u", 1.0, r"gain\.u cannot be set: integrator\.x is connected to it"),
        ("gain.k", "fast", r"gain\.k = fast: not a finite number"),
        ("gain.k", "nan", r"gain\.k = nan: not a finite number"),
        ("board.enabled", "maybe", r"board\.enabled = maybe: not true or false"),
        ("board.number_in", "1.5", r"board\.number_in = 1\.5: not a whole number"),
    ],
)
def test_impossible_value_is_explained(parts: tuple[Component, ...], name: str, value: object, message: str) -> None:
    system = System("s", parts, (wire("integrator.x", "gain.u"),))
    with pytest.raises(SystemRefusedError, match=message):
        check(system.with_values("v", {name: value}))  # type: ignore[dict-item]


def test_missing_and_broken_fmus_are_named(parts: tuple[Component, ...], tmp_path: Path) -> None:
    def refused(fmu: Path, message: str) -> None:
        with pytest.raises(SystemRefusedError, match=message):
            check(System("s", (Component("c", fmu),)))

    refused(tmp_path / "none.fmu", r"component c: FMU not found: .*none\.fmu")
    (tmp_path / "text.fmu").write_text("no zip")
    refused(tmp_path / "text.fmu", r"component c: text\.fmu is not an FMU")
    with zipfile.ZipFile(tmp_path / "empty.fmu", "w"):
        pass
    refused(tmp_path / "empty.fmu", r"empty\.fmu is not an FMU")
    with pytest.raises(SystemRefusedError, match="two components are called gain"):
        check(System("s", (parts[1], parts[1])))
    with pytest.raises(SystemRefusedError, match="no components"):
        check(System("s", ()))


@pytest.mark.parametrize(
    ("definitions", "unit", "message"),
    [
        ('<Unit name="metre"><BaseUnit m="1"/></Unit>', "metre", None),
        ('<Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit>', "mm", r"unit m does not fit mm; .*1000 \* value"),
        ('<Unit name="K"><BaseUnit K="1"/></Unit>', "K", "unit m does not fit K; these are different quantities"),
    ],
)
def test_units_must_fit(
    fmus: dict[str, Path], tmp_path: Path, definitions: str, unit: str, message: str | None
) -> None:
    first = with_units(fmus["gain"], tmp_path / "first.fmu", METRE, "m")
    second = with_units(fmus["gain"], tmp_path / "second.fmu", definitions, unit)
    system = System("s", (Component("a", first), Component("b", second)), (wire("a.y", "b.u"),))
    if message is None:
        check(system)
    else:
        with pytest.raises(SystemRefusedError, match=message):
            check(system)


def test_later_parameter_set_wins(parts: tuple[Component, ...]) -> None:
    system = System("s", parts).with_values("a", {"gain.k": 1.0, "gain.c": 2.0}).with_values("b", {"gain.k": "3"})
    assert start_values(system, check(system)) == {Port("gain", "k"): 3.0, Port("gain", "c"): 2.0}


def test_parameters_used_are_all_with_their_defaults(parts: tuple[Component, ...]) -> None:
    system = System("s", parts).with_values("a", {"gain.k": 4, "board.number_in": 5})
    values = parameters_used(system, check(system)).values
    assert values["gain.k"] == 4.0
    assert values["gain.c"] == 0.0
    assert values["board.enabled"] is True
    assert values["board.label"] == "none"
    assert values["board.number_in"] == 5
    assert "gain.u" not in values


def test_component_names_may_hold_dots() -> None:
    assert port_of("a.b.c.d", ["a", "a.b"]) == Port("a.b", "c.d")


def test_connect_spreads_vectors() -> None:
    assert connect("a", "b", ("rate[:2]", "w[:2]"), ("rate[3]", "z"), "t") == (
        wire("a.rate[1]", "b.w[1]"),
        wire("a.rate[2]", "b.w[2]"),
        wire("a.rate[3]", "b.z"),
        wire("a.t", "b.t"),
    )


def test_enumeration_takes_names_and_numbers() -> None:
    items = (Item("off", 1), Item("on", 2))
    mode = Variable("mode", 0, "Enumeration", "parameter", "fixed", "exact", None, "1", "", "Mode", items)
    assert mode.value("on") == 2
    assert mode.value("2") == 2
    assert mode.value(1) == 1
    for wrong in ("onn", "3"):
        with pytest.raises(SystemRefusedError, match=rf"mode = {wrong}: not one of off \(1\), on \(2\)"):
            mode.value(wrong)


def test_value_out_of_the_declared_range_is_refused() -> None:
    speed = Variable("speed", 0, "Real", "parameter", "fixed", "exact", "m/s", "1", "", None, (), 0.0, 60.0)
    assert speed.value("60") == 60.0
    for wrong, message in (
        ("-5", r"speed = -5 m/s: too small \(allowed: 0 to 60 m/s\)"),
        ("60.5", r"speed = 60\.5 m/s: too large"),
        ("inf", "not a finite number"),
    ):
        with pytest.raises(SystemRefusedError, match=message):
            speed.value(wrong)


@pytest.mark.parametrize("number", [2**31, -(2**31) - 1])
def test_whole_number_beyond_32_bits_is_refused(parts: tuple[Component, ...], number: int) -> None:
    system = System("s", parts).with_values("v", {"board.number_in": number})
    with pytest.raises(SystemRefusedError, match=r"board\.number_in = .*\(allowed: -2147483648 to 2147483647\)"):
        check(system)


def test_units_of_one_quantity_are_equal() -> None:
    assert Unit("m/s2", (0, 1, -2, 0, 0, 0, 0, 0), 1.0, 0.0).same_quantity(
        Unit("m/s^2", (0, 1, -2, 0, 0, 0, 0, 0), 1.0, 0.0)
    )
