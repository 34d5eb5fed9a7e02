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
from fmu_instance import EVERY_KIND, Instance
from refused_calls import REFUSED

from attitude_fmu.fmu_src.catalogue import KINDS

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
    assert cut.bits() == whole.bits()


@pytest.mark.parametrize("case", REFUSED)
def test_a_bad_call_reaches_the_host_and_changes_nothing(
    unit: Instance, capfd: pytest.CaptureFixture[str], case: str
) -> None:
    call, pattern = REFUSED[case]
    unit.initialise(**{"rate[1]": 1.0}).step(3)
    before = unit.bits()
    reason = unit.refusal(lambda: call(unit))
    assert re.search(pattern, reason), reason
    assert (reason in capfd.readouterr().err) == unit.differs.speaks
    assert unit.bits() == before
    unit.step(1, start=3e-3)
    assert unit["shown.count"] == 4


def test_refused_calls_are_counted_until_the_instance_is_reset(unit: Instance) -> None:
    unit.initialise().step(3)
    saved = unit.fmu.getFMUstate()
    for count, (call, _) in enumerate(REFUSED.values(), 1):
        unit.refusal(lambda call=call: call(unit))
        assert unit["refused_calls"] == count
    unit.fmu.setFMUstate(saved)
    unit.step(1, start=3e-3)
    assert unit["refused_calls"] == len(REFUSED)
    unit.fmu.reset()
    assert unit["refused_calls"] == 0
    unit.fmu.freeFMUstate(saved)


def test_of_a_list_with_one_bad_value_nothing_is_stored(unit: Instance) -> None:
    references = [unit.variables[f"rate[{i}]"].valueReference for i in (1, 2, 3)]
    unit.refusal(lambda: unit.fmu.setReal(references, [1.0, 2.0, 300.0]))
    assert unit.fmu.getReal(references) == [0.0, 0.0, 0.0]


def test_parameters_out_of_step_are_refused_until_they_agree(unit: Instance) -> None:
    unit.initialise().step()
    unit["lower"] = 2.0
    for call in (lambda: unit.step(start=1e-3), lambda: unit["coefficient.fast"], lambda: unit.step(start=1e-3)):
        reason = unit.refusal(call)
        assert reason == "EveryKind.lower = 2: more than 100 % of the gain %s %d (allowed: 1 or less)"
    unit["gain"] = 3.0
    unit.step(start=1e-3)
    assert unit["shown.count"] == 2


def test_parameters_out_of_step_are_refused_at_the_end_of_initialisation_until_they_agree(unit: Instance) -> None:
    unit.fmu.enterInitializationMode()
    unit["lower"] = 2.0
    for call in (unit.fmu.exitInitializationMode, unit.fmu.exitInitializationMode, lambda: unit["coefficient.fast"]):
        assert unit.refusal(call).startswith("EveryKind.lower = 2: more than")
    assert unit["lower"] == 2.0
    unit["gain"] = 3.0
    unit.fmu.exitInitializationMode()
    unit.step()


def _break(unit: Instance, start: float, length: float = 1e-3) -> str:
    """Let the next tick divide by zero; the reason given."""
    unit["choice"], unit["steps"] = 2, 10
    return unit.refusal(lambda: unit.fmu.doStep(start, length))


def test_after_a_failed_step_only_reset_or_restore_help(unit: Instance) -> None:
    unit.initialise().step(3)
    saved = unit.fmu.getFMUstate()
    assert _break(unit, 3e-3).startswith(unit.differs.division_by_zero)
    for call in (lambda: unit.__setitem__("steps", 0), lambda: unit.step(start=3e-3)):
        assert "refused: stopped by an error before" in unit.refusal(call)
    unit.fmu.setFMUstate(saved)
    unit.step(start=3e-3)
    assert unit["shown.count"] == 4
    unit.fmu.freeFMUstate(saved)


def test_a_failed_step_leaves_the_values_at_its_beginning(unit: Instance) -> None:
    unit.initialise(**{"rate[1]": 1.0, "period": 0.02}).step(1, 0.01)
    unit["choice"], unit["steps"] = 2, 10
    before = unit.bits()
    _break(unit, 0.01, 0.05)  # the slow clock ticks before the fast one fails
    assert unit.bits() == before


def test_reset_after_an_error_is_like_new(fmu: Path, load: Load) -> None:
    fresh, used = load(fmu), load(fmu)
    for _ in range(20):
        used.initialise(**{"rate[1]": 3.0, "noise.seed": 9}).step(2)
        _break(used, 2e-3)
        used.fmu.reset()
    for unit in (fresh, used):
        unit.initialise(temperature=320.0).step(30)
    assert used.bits() == fresh.bits()


def test_a_step_before_initialisation_is_refused(unit: Instance) -> None:
    assert unit.refusal(unit.step) == "EveryKind: fmi2DoStep refused: the instance is not initialised yet"
    unit.initialise().step()


def test_while_initialising_only_the_end_of_it_is_due(unit: Instance) -> None:
    assert "the instance is not initialised yet" in unit.refusal(unit.fmu.exitInitializationMode)
    unit.fmu.enterInitializationMode()
    for call in (unit.fmu.setupExperiment, unit.fmu.enterInitializationMode, unit.step):
        assert "refused: the instance is being initialised" in unit.refusal(call)
    unit.fmu.exitInitializationMode()
    unit.step()


def test_values_read_before_the_start_time_is_known_do_not_move_the_clocks(fmu: Path, load: Load) -> None:
    early, late = load(fmu), load(fmu)
    assert early["shown.count"] == 0
    for unit in (early, late):
        unit.initialise(7.0, **{"period": 0.02, "rate[1]": 1.0}).step(3, 0.015, start=7.0)
    assert early.bits() == late.bits()
    assert early["shown.count"] == 2


def test_steps_of_no_size_never_walk_time_backwards(unit: Instance) -> None:
    unit.initialise().step(3)
    for _ in range(5):
        unit.fmu.doStep(3e-3 - 0.9e-9, 0.0)
    assert "stands at t = 0.003 s" in unit.refusal(lambda: unit.fmu.doStep(3e-3 - 1.8e-9, 0.0))
    unit.step(start=3e-3)
    assert unit["shown.count"] == 4


def test_a_communication_point_may_miss_by_a_millionth_of_a_step_but_not_of_more_than_a_second(unit: Instance) -> None:
    unit.initialise(period=1.0)
    for length, miss in ((0.1, 2e-7), (10.0, 2e-6)):
        assert "but the FMU stands at t = 0 s" in unit.refusal(lambda m=miss, n=length: unit.fmu.doStep(m, n))
    unit.fmu.doStep(0.9e-6, 10.0)


def test_after_terminate_values_are_read_and_nothing_else(unit: Instance) -> None:
    unit.initialise().step(2)
    saved = unit.fmu.getFMUstate()
    unit.fmu.terminate()
    assert unit["shown.count"] == 2
    for call in (lambda: unit.step(start=2e-3), lambda: unit.__setitem__("steps", 1), unit.initialise):
        assert "refused: terminated; fmi2Reset" in unit.refusal(call)
    unit.fmu.terminate()
    unit.fmu.setFMUstate(saved)
    unit.step(start=2e-3)
    assert unit["shown.count"] == 3
    unit.fmu.freeFMUstate(saved)


@pytest.mark.parametrize("is_read", [False, True])
def test_a_saved_state_keeps_the_stage(fmu: Path, load: Load, is_read: bool) -> None:
    one, other = load(fmu), load(fmu)
    one.fmu.setupExperiment(startTime=7.0)
    one.fmu.enterInitializationMode()
    if is_read:
        one.bits()
    data = one.serialised()
    for unit in (load(fmu), other.initialise().step(5)):
        unit.restore(data)
        assert "being initialised" in unit.refusal(unit.step)
        unit.fmu.exitInitializationMode()
        unit.step(2, start=7.0)
        assert unit["shown.count"] == 2


def test_a_restored_state_goes_on_bit_for_bit(unit: Instance) -> None:
    unit.initialise(**{"rate[1]": 0.7, "temperature": 333.0}).step(37)
    unit["gain"] = 1.25
    saved = unit.fmu.getFMUstate()
    runs = []
    for _ in range(2):
        unit.fmu.setFMUstate(saved)
        unit.step(40, start=37e-3)
        runs.append(unit.bits())
        unit["rate[1]"], unit["gain"], unit["shift"] = -9.0, 0.5, 5
        unit.step(11, start=77e-3)
    unit.fmu.freeFMUstate(saved)
    assert runs[0] == runs[1]


def test_another_instance_takes_over_with_its_own_parameters_replaced(fmu: Path, load: Load) -> None:
    one, other = load(fmu), load(fmu)
    one.initialise(5.0, **{"rate[1]": 0.7, "noise.seed": 3, "shape": 2}).step(10, start=5.0)
    other.initialise().step(3)
    other.restore(one.serialised())
    for unit in (one, other):
        unit.step(10, start=5.01)
    assert other.bits() == one.bits()
    assert other["noise.seed"] == 3


_CONTINUE = """
import json, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from fmu_instance import Instance
unit = Instance(Path(sys.argv[2]))
unit.restore(bytes.fromhex(sys.stdin.read()))
unit.step(40, start=37e-3)
print(json.dumps(unit.bits()))
unit.close()
"""


def test_another_process_goes_on_bit_for_bit(unit: Instance, fmu: Path) -> None:
    unit.initialise(**{"rate[1]": 0.7, "temperature": 333.0, "noise.seed": 8}).step(37)
    data = unit.serialised()
    unit.step(40, start=37e-3)
    done = subprocess.run(
        [sys.executable, "-c", _CONTINUE, str(Path(__file__).parent), str(fmu)],
        input=data.hex(),
        capture_output=True,
        text=True,
        check=True,
    )
    assert json.loads(done.stdout) == unit.bits()


@pytest.mark.parametrize("damage", ["flip", "cut", "foreign"])
def test_a_damaged_saved_state_is_refused_and_changes_nothing(unit: Instance, damage: str) -> None:
    unit.initialise(**{"rate[1]": 0.7}).step(5)
    data = bytearray(unit.serialised())
    if damage == "flip":
        data[len(data) // 2] ^= 1
    elif damage == "cut":
        del data[-20:]
    else:
        data = bytearray(b'{"rate": 1.0}')
    unit.step(5, start=5e-3)
    before = unit.bits()
    for _ in range(3):
        reason = unit.refusal(lambda: unit.restore(bytes(data)), by=unit.differs.refuses_bytes)
        assert reason.startswith("EveryKind: saved state refused: ")
    assert unit.bits() == before
    assert unit["refused_calls"] == 3
    unit.step(5, start=10e-3)


def test_a_state_of_another_version_is_refused(unit: Instance) -> None:
    unit.initialise().step(5)
    data = bytearray(unit.serialised())
    data[unit.differs.fingerprint_at] ^= 0xFF
    end = struct.calcsize(unit.differs.checksum)
    data[-end:] = struct.pack(unit.differs.checksum, zlib.crc32(data[:-end]))
    reason = unit.refusal(lambda: unit.restore(bytes(data)), by=unit.differs.refuses_bytes)
    assert reason == "EveryKind: saved state refused: another FMU or version saved it"
    unit.step(start=5e-3)


def test_a_state_of_the_other_kind_is_refused(built: Callable[..., Path], load: Load) -> None:
    native, python = (load(built(EVERY_KIND, kind)).initialise().step(5) for kind in KINDS)
    for unit, other in ((native, python), (python, native)):
        unit.refusal(lambda unit=unit, other=other: unit.restore(other.serialised()), by=unit.differs.refuses_bytes)


def test_a_state_saved_before_initialisation_can_be_restored(unit: Instance) -> None:
    state = unit.fmu.getFMUstate()
    unit.initialise(**{"rate[1]": 3.0}).step(5)
    unit.fmu.setFMUstate(state)
    assert unit["rate[1]"] == 0.0
    unit.initialise().step(2)
    assert unit["shown.count"] == 2
    unit.fmu.freeFMUstate(state)


def test_a_state_whose_outputs_left_the_range_of_floats_can_be_restored(unit: Instance) -> None:
    unit.initialise().step(3)
    unit["gain"], unit["rate[2]"] = 1e200, 1.0  # the rate's square is too large, the rate is not
    unit.step(start=3e-3)
    assert "the numbers ran away" in unit.refusal(lambda: unit["shown.square"])
    data = unit.serialised()
    unit["gain"] = 1.0
    unit.restore(data)
    assert unit["gain"] == 1e200
    assert "the numbers ran away" in unit.refusal(lambda: unit["shown.square"])
