from __future__ import annotations

import json
import math
import re
import struct
import subprocess
import sys
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fmpy.fmi1 import FMICallException
from fmu_instance import Instance

Load = Callable[..., Instance]

NEW_VALUES: dict[str, Any] = {
    "noise.density": 2e-3,
    "noise.seed": 5,
    "mounting[2,3]": 0.125,
    "shape": 2,
    "period": 2e-3,
    "gain": 1.5,
    "lower": 0.25,
    "shift": -3,
    "inverted": True,
    "mode": 2,
    "rate[3]": -2.5,
    "temperature": 310.0,
    "steps": 4,
    "switch": False,
    "choice": 2,
}


@pytest.fixture
def unit(fmu: Path, load: Load) -> Instance:
    return load(fmu)


def test_every_start_value_can_be_read(unit: Instance) -> None:
    for name, variable in unit.variables.items():
        if variable.start is not None:
            expected = variable.start == "true" if variable.type == "Boolean" else float(variable.start)
            assert unit[name] == expected, name


@pytest.mark.parametrize("name", NEW_VALUES)
def test_what_is_set_is_read(unit: Instance, name: str) -> None:
    unit[name] = NEW_VALUES[name]
    assert unit[name] == NEW_VALUES[name]


def test_every_variable_can_be_read_after_steps(unit: Instance) -> None:
    unit.initialise(**{"rate[1]": 2.0}).step(10)
    for name in unit.variables:
        assert math.isfinite(unit[name])
    assert unit["shown.count"] == unit["state.ticks"] == 10
    assert unit["shown.moving"] == 1
    assert unit["shown.level"] == 2
    assert unit["coefficient.whole"] == 3


def test_the_initial_outputs_follow_the_inputs(unit: Instance) -> None:
    unit.fmu.setupExperiment()
    unit.fmu.enterInitializationMode()
    for rate in (1.0, 3.0):
        unit["rate[2]"] = rate
        assert unit["shown.rate[2]"] == rate
    unit.fmu.exitInitializationMode()
    assert unit["shown.rate[2]"] == 3.0


def test_a_tunable_parameter_acts_at_once(unit: Instance) -> None:
    unit.initialise().step(4)
    unit["shift"] = 9
    assert unit["shown.count"] == 13
    unit["gain"] = 0.5
    unit.step(1, start=4e-3)
    assert unit["shown.count"] == 14


def test_the_model_starts_at_the_start_time(unit: Instance) -> None:
    unit.initialise(start_time=100.0).step(5, start=100.0)
    assert unit["shown.count"] == 5


@pytest.mark.parametrize("lengths", [(1e-3,), (5e-3,), (7.3e-3,), (10e-3,), (0.4e-3, 11.1e-3)])
def test_the_result_does_not_depend_on_how_time_is_cut(fmu: Path, load: Load, lengths: tuple[float, ...]) -> None:
    whole, cut = load(fmu), load(fmu)
    for one in (whole, cut):
        one.initialise(**{"rate[1]": 0.3, "temperature": 320.0})
    whole.fmu.doStep(0.0, 0.73)
    time, i = 0.0, 0
    while time < 0.73 - 1e-9:
        length = min(lengths[i % len(lengths)], 0.73 - time)
        cut.fmu.doStep(time, length)
        time, i = time + length, i + 1
    assert cut.outputs() == whole.outputs()


REFUSED: dict[str, tuple[Callable[[Instance], Any], str]] = {
    "not a number": (lambda u: u.__setitem__("temperature", math.nan), r"EveryKind.temperature = nan K: not a finite"),
    "celsius": (
        lambda u: u.__setitem__("temperature", 25.0),
        r"EveryKind.temperature = 25 K: .*kelvin.*200 to 400 K",
    ),
    "too large": (lambda u: u.__setitem__("rate[1]", 101.0), r"EveryKind.rate\[1\] = 101 rad/s: too large"),
    "infinite": (lambda u: u.__setitem__("gain", math.inf), r"EveryKind.gain = inf"),
    "no such choice": (lambda u: u.__setitem__("choice", 3), r"EveryKind.choice = 3: no such choice .*1 a, 2 b"),
    "integer out of range": (lambda u: u.__setitem__("steps", -1), r"EveryKind.steps = -1: too small"),
    "fixed parameter": (
        lambda u: u.__setitem__("period", 2e-3),
        r"EveryKind.period = 0.002 s: fixed, can be set only before the end of initialisation "
        r"\(allowed: 0.0001 to 1 s\)",
    ),
    "output": (lambda u: u.__setitem__("shown.count", 3), r"shown.count cannot be set: its causality is output"),
    "wrong type": (lambda u: u.fmu.setReal([u.variables["steps"].valueReference], [1.0]), r"steps is of type Integer"),
    "reading the wrong type": (lambda u: u.fmu.getBoolean([0]), r"noise.density is of type Real, not Boolean"),
    "string": (lambda u: u.fmu.getString([0]), r"noise.density is of type Real, not String"),
    "no such variable": (lambda u: u.fmu.getReal([4711]), r"no variable with value reference 4711"),
    "communication point": (lambda u: u.fmu.doStep(0.5, 1e-3), r"from t = 0.5 s, but the FMU stands at t = 0.003 s"),
    "backwards": (lambda u: u.fmu.doStep(3e-3, -1e-3), r"a step of -0.001 s"),
    "a second experiment": (
        lambda u: u.fmu.setupExperiment(startTime=1.0),
        r"fmi2SetupExperiment refused: the instance is initialised already",
    ),
    "initialising again": (
        lambda u: u.fmu.enterInitializationMode(),
        r"fmi2EnterInitializationMode refused: the instance is initialised already",
    ),
    "ending no initialisation": (
        lambda u: u.fmu.exitInitializationMode(),
        r"fmi2ExitInitializationMode refused: the instance is initialised already",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_call_reaches_the_host_and_changes_nothing(
    fmu: Path, load: Load, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    call, reason = REFUSED[case]
    messages: list[str] = []
    unit = load(fmu, logger=lambda *entry: messages.append(entry[-1].decode()))
    unit.initialise(**{"rate[1]": 1.0}).step(3)
    before = {name: unit[name] for name in unit.variables}
    with pytest.raises(FMICallException, match="fatal"):
        call(unit)
    assert {name: unit[name] for name in unit.variables} == before
    unit.step(1, start=3e-3)
    assert unit["shown.count"] == 4
    shown = capfd.readouterr().err
    assert_matches(reason, shown)
    assert_matches(reason, "".join(messages))


def assert_matches(pattern: str, text: str) -> None:
    assert re.search(pattern, text), text


def test_of_a_list_with_one_bad_value_nothing_is_stored(unit: Instance) -> None:
    references = [unit.variables[f"rate[{i}]"].valueReference for i in (1, 2, 3)]
    with pytest.raises(FMICallException):
        unit.fmu.setReal(references, [1.0, 2.0, 300.0])
    assert unit.fmu.getReal(references) == [0.0, 0.0, 0.0]


def test_parameters_out_of_step_are_refused_until_they_agree(unit: Instance) -> None:
    unit.initialise().step()
    unit["lower"] = 2.0  # more than the gain
    with pytest.raises(FMICallException):
        unit.step(start=1e-3)
    unit["gain"] = 3.0
    unit.step(start=1e-3)
    assert unit["shown.count"] == 2


def _break(unit: Instance, start: float) -> None:
    unit["choice"], unit["steps"] = 2, 10
    with pytest.raises(FMICallException):
        unit.fmu.doStep(start, 1e-3)


def test_after_a_failed_step_only_reset_or_restore_help(unit: Instance, capfd: pytest.CaptureFixture[str]) -> None:
    unit.initialise().step(3)
    saved = unit.fmu.getFMUstate()
    _break(unit, 3e-3)
    assert "float division by zero" in capfd.readouterr().err
    assert unit["shown.count"] == 3
    for call in (lambda: unit.__setitem__("steps", 0), lambda: unit.step(start=3e-3)):
        with pytest.raises(FMICallException):
            call()
        assert "refused: stopped by an error before" in capfd.readouterr().err
    unit.fmu.setFMUstate(saved)
    unit.step(start=3e-3)
    assert unit["shown.count"] == 4
    unit.fmu.freeFMUstate(saved)


def test_reset_after_an_error_is_like_new(fmu: Path, load: Load) -> None:
    fresh, used = load(fmu), load(fmu)
    for _ in range(20):
        used.initialise(**{"rate[1]": 3.0, "noise.seed": 9}).step(2)
        _break(used, 2e-3)
        used.fmu.reset()
    for unit in (fresh, used):
        unit.initialise(temperature=320.0).step(30)
    assert used.outputs() == fresh.outputs()


def test_a_step_before_initialisation_is_refused(unit: Instance, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(FMICallException):
        unit.step()
    assert "EveryKind: fmi2DoStep refused: the instance is not initialised yet" in capfd.readouterr().err
    unit.initialise().step()


def test_while_initialising_only_the_end_of_it_is_due(unit: Instance, capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(FMICallException):
        unit.fmu.exitInitializationMode()
    assert "the instance is not initialised yet" in capfd.readouterr().err
    unit.fmu.enterInitializationMode()
    for call in (unit.fmu.setupExperiment, unit.fmu.enterInitializationMode, unit.step):
        with pytest.raises(FMICallException):
            call()
        assert "refused: the instance is being initialised" in capfd.readouterr().err
    unit.fmu.exitInitializationMode()
    unit.step()


def test_after_terminate_values_are_read_and_nothing_else(unit: Instance, capfd: pytest.CaptureFixture[str]) -> None:
    unit.initialise().step(2)
    saved = unit.fmu.getFMUstate()
    unit.fmu.terminate()
    assert unit["shown.count"] == 2
    for call in (lambda: unit.step(start=2e-3), lambda: unit.__setitem__("steps", 1), unit.initialise):
        with pytest.raises(FMICallException):
            call()
        assert "refused: terminated; fmi2Reset" in capfd.readouterr().err
    unit.fmu.terminate()
    unit.fmu.setFMUstate(saved)
    unit.step(start=2e-3)
    assert unit["shown.count"] == 3
    unit.fmu.freeFMUstate(saved)


def test_a_saved_state_keeps_the_stage(fmu: Path, load: Load) -> None:
    one, other = load(fmu), load(fmu)
    one.fmu.enterInitializationMode()
    state = one.fmu.getFMUstate()
    copy = other.fmu.deSerializeFMUstate(one.fmu.serializeFMUstate(state))
    other.initialise().step(5)
    other.fmu.setFMUstate(copy)
    with pytest.raises(FMICallException):
        other.step()
    other.fmu.exitInitializationMode()
    other.step(2)
    assert other["shown.count"] == 2
    one.fmu.freeFMUstate(state)
    other.fmu.freeFMUstate(copy)


def test_parameters_out_of_step_are_refused_at_the_end_of_initialisation_until_they_agree(unit: Instance) -> None:
    unit.fmu.enterInitializationMode()
    unit["lower"] = 2.0
    for call in (unit.fmu.exitInitializationMode, unit.fmu.exitInitializationMode, lambda: unit["coefficient.fast"]):
        with pytest.raises(FMICallException):
            call()
    assert unit["lower"] == 2.0
    unit["gain"] = 3.0
    unit.fmu.exitInitializationMode()
    unit.step()


def test_a_restored_state_goes_on_bit_for_bit(unit: Instance) -> None:
    unit.initialise(**{"rate[1]": 0.7, "temperature": 333.0}).step(37)
    unit["gain"] = 1.25
    saved = unit.fmu.getFMUstate()
    runs = []
    for _ in range(2):
        unit.fmu.setFMUstate(saved)
        unit.step(40, start=37e-3)
        runs.append(unit.outputs())
        unit["rate[1]"], unit["gain"], unit["shift"] = -9.0, 0.5, 5
        unit.step(11, start=77e-3)
    unit.fmu.freeFMUstate(saved)
    assert runs[0] == runs[1]


def test_another_instance_takes_over_with_its_own_parameters_replaced(fmu: Path, load: Load) -> None:
    one, other = load(fmu), load(fmu)
    one.initialise(5.0, **{"rate[1]": 0.7, "noise.seed": 3, "shape": 2}).step(10, start=5.0)
    other.initialise().step(3)
    state = one.fmu.getFMUstate()
    copy = other.fmu.deSerializeFMUstate(one.fmu.serializeFMUstate(state))
    other.fmu.setFMUstate(copy)
    for unit in (one, other):
        unit.step(10, start=5.01)
    assert other.outputs() == one.outputs()
    assert other["noise.seed"] == 3
    one.fmu.freeFMUstate(state)
    other.fmu.freeFMUstate(copy)


_CONTINUE = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_instance import Instance
unit = Instance(Path(sys.argv[2]))
state = unit.fmu.deSerializeFMUstate(bytes.fromhex(sys.stdin.read()))
unit.fmu.setFMUstate(state)
unit.step(40, start=37e-3)
print(json.dumps(unit.outputs()))
unit.close()
"""


def test_another_process_goes_on_bit_for_bit(unit: Instance, fmu: Path) -> None:
    unit.initialise(**{"rate[1]": 0.7, "temperature": 333.0, "noise.seed": 8}).step(37)
    state = unit.fmu.getFMUstate()
    data = unit.fmu.serializeFMUstate(state)
    unit.step(40, start=37e-3)
    done = subprocess.run(
        [sys.executable, "-c", _CONTINUE, str(Path(__file__).parent), str(fmu)],
        input=bytes(data).hex(),
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) == unit.outputs()
    unit.fmu.freeFMUstate(state)


@pytest.mark.parametrize("damage", ["flip", "cut", "foreign"])
def test_a_damaged_saved_state_is_refused_and_changes_nothing(unit: Instance, damage: str) -> None:
    unit.initialise(**{"rate[1]": 0.7}).step(5)
    state = unit.fmu.getFMUstate()
    data = bytearray(unit.fmu.serializeFMUstate(state))
    if damage == "flip":
        data[len(data) // 2] ^= 1
    elif damage == "cut":
        del data[-20:]
    else:
        data = bytearray(b'{"rate": 1.0}')
    unit.step(5, start=5e-3)
    before = unit.outputs()
    broken = unit.fmu.deSerializeFMUstate(bytes(data))
    for _ in range(3):
        with pytest.raises(FMICallException, match="fmi2SetFMUstate"):
            unit.fmu.setFMUstate(broken)
    assert unit.outputs() == before
    unit.step(5, start=10e-3)
    for one in (state, broken):
        unit.fmu.freeFMUstate(one)


def test_a_state_of_another_version_is_refused(unit: Instance) -> None:
    unit.initialise().step(5)
    state = unit.fmu.getFMUstate()
    data = bytearray(unit.fmu.serializeFMUstate(state))
    data[6] ^= 0xFF  # the fingerprint, with a checksum that fits
    data[-4:] = struct.pack("<I", zlib.crc32(data[:-4]))
    foreign = unit.fmu.deSerializeFMUstate(bytes(data))
    with pytest.raises(FMICallException):
        unit.fmu.setFMUstate(foreign)
    unit.step(start=5e-3)
    for one in (state, foreign):
        unit.fmu.freeFMUstate(one)


def test_a_state_saved_before_initialisation_can_be_restored(unit: Instance) -> None:
    state = unit.fmu.getFMUstate()
    unit.initialise(**{"rate[1]": 3.0}).step(5)
    unit.fmu.setFMUstate(state)
    assert unit["rate[1]"] == 0.0
    unit.initialise().step(2)
    assert unit["shown.count"] == 2
    unit.fmu.freeFMUstate(state)
